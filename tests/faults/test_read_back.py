"""Faults: setups of any line ends, a disk that is full, and logs that are being recorded."""

import subprocess
import sys
from pathlib import Path

import pytest

from tirelog.cli import run

SAMPLES = Path(__file__).parents[2] / "sample_data"
LOG = str(SAMPLES / "drive.csv.gz")


def test_a_setup_with_any_line_ends_is_read(tmp_path):
    lines = (SAMPLES / "drive.toml").read_text().split("\n")
    ends = ("\n", "\r\n", "\r")
    setup = tmp_path / "s.toml"
    setup.write_bytes("".join(line + ends[k % 3] for k, line in enumerate(lines)).encode())
    assert run(["info", LOG, "--setup", str(setup)]) == 0


def test_a_folder_without_tables_is_removed(tmp_path):
    output = tmp_path / "new" / "folder"
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("os.fsync", lambda number: (_ for _ in ()).throw(OSError(28, "full")))
        assert run(["tables", LOG, "-o", str(output)]) == 2
    assert not output.parent.exists()
    assert run(["tables", LOG, "-o", str(output)]) == 0
    assert len(list(output.iterdir())) == 3


RECORDER = """
import sys, time, h5py, numpy as np
with h5py.File("l.h5", "w", libver="latest") as file:
    made = file.create_dataset("wl", shape=(0,), maxshape=(None,), chunks=(500,), dtype="f8")
    made.attrs["sampling_rate_Hz"] = 2500.0
    if sys.argv[1] == "swmr":
        file.swmr_mode = True
    made.resize((50_000,))
    made[:] = 1550 + 0.001 * np.random.default_rng(1).random(50_000)
    made.flush()
    print("ready", flush=True)
    sys.stdin.read()
"""


@pytest.mark.parametrize("mode", ["swmr", "locked"])
def test_a_log_that_is_being_recorded(tmp_path, monkeypatch, capfd, mode):
    monkeypatch.chdir(tmp_path)
    text = (SAMPLES / "drive.toml").read_text().split("[channels.temp_1]")[0]
    text = text.replace("CH1_FBG1", "/wl").replace('temperature_channel = "temp_1"\n', "")
    (tmp_path / "l.toml").write_text(text)
    command = [sys.executable, "-c", RECORDER, mode]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as recorder:
        recorder.stdout.readline()
        assert run(["ingest", "l.h5", "-o", "run.h5"]) == 4
        recorder.stdin.close()
    said = capfd.readouterr().err
    assert "is still being recorded" in said
    assert "repair" not in said
