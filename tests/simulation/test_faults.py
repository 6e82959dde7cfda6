"""Faults: scenarios and motions that cannot be are refused, with what to do."""

import pytest

from tests.processes import python
from tirelog.cli import run
from tirelog.errors import UsageError
from tirelog.simulation import simulate, write_log

from .worlds import scenario

GOOD = '[[manoeuvres]]\nduration_s = 1.0\nspeed_m_s = 10.0\n\n[channels.s]\nkind = "fbg_strain"\n'


def command(tmp_path, text, output, capsys):
    scenario = tmp_path / "s.toml"
    scenario.write_text(text, encoding="utf-8")
    status = run(["simulate", str(scenario), "-o", str(tmp_path / output)])
    return status, capsys.readouterr().err


def test_command_writes_log_truth_and_setup(tmp_path, capsys):
    status, said = command(tmp_path, GOOD, "log.csv", capsys)
    assert status == 0
    assert {p.name for p in tmp_path.iterdir()} == {
        "s.toml",
        "log.csv",
        "log.csv.truth.json",
        "log.toml",
    }
    assert "no effect" in said


@pytest.mark.parametrize(
    ("output", "why"),
    [
        ("log.dat", "suffix"),
        ("log", "suffix"),
        ("log.mcap.gz", "suffix"),
        ("missing/log.csv", "missing"),
        ("s.csv", "scenario"),  # its setup would be on the scenario itself
    ],
)
def test_command_refuses_where_nothing_can_be_written(tmp_path, output, why, capsys):
    status, said = command(tmp_path, GOOD, output, capsys)
    assert status == 2
    assert said.startswith("tirelog: error: ")
    assert why in said
    assert [p.name for p in tmp_path.iterdir()] == ["s.toml"]
    assert (tmp_path / "s.toml").read_text(encoding="utf-8") == GOOD


def test_text_cannot_hold_two_rates(tmp_path):
    channels = {
        "s": {"kind": "fbg_strain"},
        "v": {"kind": "vehicle_speed", "sampling_rate_Hz": 100.0},
    }
    made = simulate(scenario(channels=channels))
    with pytest.raises(UsageError, match="one sampling rate"):
        write_log(made, tmp_path / "log.csv")
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_is_full_while_hdf5_is_written(tmp_path):
    """HDF5 itself ends the process there; a limit on a file's size stands for the disk."""
    (tmp_path / "s.toml").write_text(GOOD, encoding="utf-8")
    program = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000));"
        "from tirelog.cli import run; sys.exit(run(['simulate', 's.toml', '-o', 'o.h5']))"
    )
    # without a file of bytecode, which would be the first that is too large
    done = python(program, folder=tmp_path, status=2, PYTHONDONTWRITEBYTECODE="1")
    said = "tirelog: error: o.h5: cannot be written (File too large)"
    assert done.stderr.splitlines()[-1].startswith(said)
    assert [path.name for path in tmp_path.iterdir()] == ["s.toml"]
