"""Faults: a disk that is full while a simulated log is written."""

from tests.processes import python

GOOD = '[[manoeuvres]]\nduration_s = 1.0\nspeed_m_s = 10.0\n\n[channels.s]\nkind = "fbg_strain"\n'


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
