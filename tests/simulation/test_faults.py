"""Faults: scenarios that cannot be carried out are refused with what is allowed and what to do, on
the command line too.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tirelog.cli import run
from tirelog.errors import OutputError, UsageError
from tirelog.simulation import load_scenario, scenario_of, simulate, write_log

from .worlds import tables

GOOD = '[[manoeuvres]]\nduration_s = 1.0\nspeed_m_s = 10.0\n\n[channels.s]\nkind = "fbg_strain"\n'


def grating(**more: Any) -> dict[str, Any]:
    return {"channels": {"s": {"kind": "fbg_strain", **more}}}


def nuisance(name: str, **values: Any) -> dict[str, Any]:
    return {"nuisances": {name: values}}


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"sead": 3}, "nearest: seed"),
        ({"seed": 1.5}, "seed = 1.5"),
        ({"truth": "beem"}, "nearest: beam"),
        ({"grid_points": 1001}, "even"),
        ({"knot_s": 0.2}, "0.05"),
        ({"manoeuvres": []}, "no manoeuvres"),
        ({"manoeuvres": {"duration_s": 1}}, "manoeuvres is not a list of tables"),
        ({"manoeuvres": [{"duration": 1.0}]}, "nearest: duration_s"),
        ({"manoeuvres": [{"regime": "crusie"}]}, "nearest: cruise"),
        ({"manoeuvres": [{"speed_m_s": -3.0}]}, "from 0 to 120"),
        ({"manoeuvres": [{"speed_m_s": float("nan")}]}, "from 0 to 120"),
        ({"manoeuvres": [3]}, "not a table"),
        ({"channels": {}}, "no channels"),
        (grating(noize=1.0), "nearest: noise"),
        ({"channels": {"s": {"kind": "fbg_stain"}}}, "nearest: fbg_strain"),
        ({"channels": {"s": {}}}, "allowed are"),
        (grating(surface="outside"), "nearest: outer"),
        (grating(lost_fraction=1.5), "from 0 to 0.9"),
        (grating(bits=12.5), "bits = 12.5"),
        (grating(temperature_channel="t"), "fbg_temperature"),
        (grating(missing_teeth=[-1]), "whole numbers"),
        ({"tire": {"flexural_stifness_N_m2": 4.0}}, "nearest: flexural_stiffness_N_m2"),
        ({"tire": {"contact": "flat"}}, "flat_road"),
        ({"conditions": {"driven": 1}}, "true or false"),
        ({"conditions": {"load_N": 0.0}}, "from 1 to"),
        ({"road": 3}, "not a table"),
        ({"ramp": {"stops": [1.0]}}, "nearest: stops_s"),
        ({"ramp": {"stops_s": [5.0, 5.5]}}, "overlap"),
        ({"ramp": {"begin_s": 3.0, "end_s": 2.0}}, "overlap"),
        ({"effects": [{"form": "other"}]}, "without a name"),
        ({"effects": [{"name": "water_flim"}]}, "nearest: water_film"),
        ({"effects": [{"name": "ring_curvature"}]}, 'truth = "ring"'),
        ({"effects": [{"name": "wear", "form": "second"}]}, "exact, other"),
        ({"effects": [{"name": "splice", "form": "other"}]}, "allowed are exact"),
        ({"effects": [{"name": "wear", "amplitud": 1.0}]}, "nearest: amplitude"),
        ({"effects": [{"name": "wear", "amplitude": "big"}]}, "finite number"),
        ({"effects": [{"name": "wear"}, {"name": "wear"}]}, "planted twice"),
        ({"nuisance": {}}, "nearest: nuisances"),
        ({"nuisances": 3}, "[nuisances] is not a table; allowed are run_out,"),
        ({"nuisances": {"runout": {}}}, "nearest: run_out"),
        ({"nuisances": {"run_out": [3.0]}}, "[nuisances.run_out] is not a table"),
        (nuisance("run_out", amplitude=3.0), "unknown key 'amplitude' in [nuisances.run_out]"),
        (nuisance("run_out", amplitudes_microstrain=3.0), "at most 3 numbers from 0 to 1000"),
        (nuisance("run_out", amplitudes_microstrain=[1.0] * 4), "at most 3 numbers"),
        (nuisance("run_out", amplitudes_microstrain=[-1.0]), "from 0 to 1000"),
        (nuisance("run_out", amplitudes_microstrain=[float("nan")]), "from 0 to 1000"),
        (nuisance("run_out", amplitudes_microstrain=["3"]), "from 0 to 1000"),
        (nuisance("run_out", amplitudes_microstrain=[True]), "from 0 to 1000"),
        (nuisance("run_out", phases_deg=[10.0]), "1 phases_deg for 0 harmonics"),
        (nuisance("force_variation", shares=[1.2]), "from 0 to 0.1"),
        (nuisance("force_variation", shares=[0.01], phases_deg=[0.0, 0.0]), "one for each"),
        (nuisance("force_variation", shares=[0.01], phases_deg=[999.0]), "from -360 to 360"),
        (nuisance("load_wander", share=0.5), "from 0 to 0.1"),
        (nuisance("load_wander", time_constant_s=0.0), "from 1 to 10000"),
        (nuisance("warming", stiffness_per_K=1.0), "from -0.02 to 0.02"),
        (
            nuisance("warming", stiffness_per_K=-0.02) | {"conditions": {"warm_up_K": 50.0}},
            "leaves 0 of it after warm_up_K = 50; allowed is 0.3 at least",
        ),
        (
            nuisance("warming", patch_length_per_K=-0.001) | {"truth": "ring"},
            "whose patch follows from pressure and stiffness",
        ),
        (nuisance("rolling_radius", error=-0.5), "from -0.1 to 0.1"),
        (nuisance("rolling_radius", growth=-0.1), "from 0 to 0.1"),
        (nuisance("rolling_radius", at_speed_m_s=0.0), "from 1 to 120"),
        (
            nuisance("load_wander", share=0.01) | {"truth": "coupled_ring"},
            'allowed is a drive with truth = "beam" or "ring"',
        ),
        (nuisance("load_wander", share=0.01) | {"ramp": {}}, "[nuisances] with a [ramp]"),
        (grating(noise_correlation=1.0), "from 0 to 0.999"),
        (grating(hum=-1.0), "from 0 to"),
        (grating(hum_Hz=0.0), "from 0.1 to"),
        (grating(flicker="much"), "from 0 to"),
        (grating(lost_at_flanks=1.0), "from 0 to 0.9"),
    ],
)
def test_refused_with_advice(more: dict[str, Any], said: str) -> None:
    with pytest.raises(UsageError) as refusal:
        scenario_of(tables(**more), "case.toml")
    assert said in str(refusal.value)
    assert str(refusal.value).startswith("case.toml: ")
    assert refusal.value.message.count(";") >= 2


def test_file_with_everything_is_read(tmp_path: Any) -> None:
    """The same keys in TOML."""
    file = tmp_path / "drive.toml"
    file.write_text(
        "[[manoeuvres]]\nduration_s = 1.0\nspeed_m_s = 10.0\n"
        '[channels.s]\nkind = "fbg_strain"\nhum = 0.003\nlost_at_flanks = 0.3\n'
        "[nuisances.run_out]\namplitudes_microstrain = [3, 1.5]\nphases_deg = [-20, 40]\n"
        "[nuisances.rolling_radius]\nerror = -0.015\n",
        encoding="utf-8",
    )
    read = load_scenario(file)
    assert read.nuisances.run_out.amplitudes_microstrain == (3.0, 1.5)
    assert read.nuisances.rolling_radius.error == -0.015
    assert read.nuisances.load_wander.share == 0.0
    assert read.channels["s"].hum == 0.003


def test_supercritical_speed_is_refused() -> None:
    fast = scenario_of(tables(manoeuvres=[{"duration_s": 2.0, "speed_m_s": 40.0}]))
    with pytest.raises(UsageError, match="critical speed"):
        simulate(fast)


def test_load_that_flattens_the_ring_is_refused() -> None:
    heavy = scenario_of(tables(truth="ring", conditions={"load_N": 60000.0}))
    with pytest.raises(UsageError, match="contact"):
        simulate(heavy)


@pytest.mark.parametrize("content", [b"", b"\x00\xff\xfe", b"seed = = 3", b"[manoeuvres"])
def test_files_that_are_no_scenario(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "s.toml"
    path.write_bytes(content)
    with pytest.raises(UsageError):
        load_scenario(path)


def command(
    tmp_path: Path, text: str, output: str, capsys: pytest.CaptureFixture[str]
) -> tuple[int, str]:
    scenario = tmp_path / "s.toml"
    scenario.write_text(text, encoding="utf-8")
    status = run(["simulate", str(scenario), "-o", str(tmp_path / output)])
    return status, capsys.readouterr().err


def test_command_writes_log_truth_and_setup(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, said = command(tmp_path, GOOD, "log.csv", capsys)
    assert status == 0
    assert {p.name for p in tmp_path.iterdir()} == {
        "s.toml",
        "log.csv",
        "log.csv.truth.json",
        "log.toml",
    }
    assert "no effect" in said


@pytest.mark.parametrize("output", ["log.dat", "log", "log.mcap.gz", "missing/log.csv"])
def test_command_refuses_where_nothing_can_be_written(
    tmp_path: Path, output: str, capsys: pytest.CaptureFixture[str]
) -> None:
    status, said = command(tmp_path, GOOD, output, capsys)
    assert status == 2
    assert said.startswith("tirelog: error: ")
    assert [p.name for p in tmp_path.iterdir()] == ["s.toml"]


def test_command_refuses_a_scenario_that_is_not_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["simulate", str(tmp_path / "none.toml"), "-o", str(tmp_path / "log.csv")]) == 2
    assert "cannot be read" in capsys.readouterr().err


def test_setup_does_not_overwrite_the_scenario(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """s.toml -> s.csv would put its setup on the scenario itself."""
    status, said = command(tmp_path, GOOD, "s.csv", capsys)
    assert status == 2
    assert "scenario" in said
    assert (tmp_path / "s.toml").read_text(encoding="utf-8") == GOOD


def test_text_cannot_hold_two_rates(tmp_path: Path) -> None:
    channels = {
        "s": {"kind": "fbg_strain"},
        "v": {"kind": "vehicle_speed", "sampling_rate_Hz": 100.0},
    }
    made = simulate(scenario_of(tables(channels=channels)))
    with pytest.raises(UsageError, match="one sampling rate"):
        write_log(made, tmp_path / "log.csv")
    assert list(tmp_path.iterdir()) == []


def test_read_only_folder(tmp_path: Path) -> None:
    made = simulate(scenario_of(tables()))
    target = tmp_path / "log.csv"
    target.mkdir()
    with pytest.raises(OutputError):
        write_log(made, target)


def test_a_disk_that_is_full_while_hdf5_is_written(tmp_path: Path) -> None:
    """HDF5 itself ends the process there; a limit on a file's size stands for the disk."""
    (tmp_path / "s.toml").write_text(GOOD, encoding="utf-8")
    program = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000));"
        "from tirelog.cli import run; sys.exit(run(['simulate', 's.toml', '-o', 'o.h5']))"
    )
    done = subprocess.run(
        [sys.executable, "-B", "-c", program],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.splitlines()[-1].startswith(
        "tirelog: error: o.h5: cannot be written (File too large)"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["s.toml"]


@pytest.mark.parametrize(("seconds", "rate"), [(10_143.0, 1.0), (601.0, 10_000.0)])
def test_a_log_that_memory_does_not_hold_is_refused(seconds: float, rate: float) -> None:
    data = grating(sampling_rate_Hz=rate)
    data["manoeuvres"] = [{"duration_s": seconds, "speed_m_s": 12.0}]
    with pytest.raises(UsageError, match="too long to be simulated"):
        scenario_of(data)
