"""Faults: damaged files of tirelog's own, and outputs that are inputs, are named."""

import gzip
import subprocess
import sys
from pathlib import Path

import pytest

from tirelog.cli import run

SAMPLES = Path(__file__).parents[2] / "sample_data"
LOG = str(SAMPLES / "drive.csv.gz")


def test_a_damaged_page_of_parquet_is_said(tmp_path, capfd):
    table, page = tmp_path / "t.parquet", tmp_path / "page.html"
    assert run(["speed", LOG, "-o", str(table)]) == 0
    data = bytearray(table.read_bytes())
    data[len(data) // 3 : len(data) // 3 + 400] = bytes(400)
    table.write_bytes(data)
    assert run(["report", LOG, "--table", str(table), "-o", str(page)]) == 4
    assert "is not a table" in capfd.readouterr().err
    assert not page.exists()


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


ROWS = [f"1542,{1550 + k % 7},{{}}" for k in range(2000)]
#: rows above those of a log, each with an odd first one
ODD = [
    ["1549,0.0000"],
    ["1549"],
    ["1541.9,1549.9", "1549"],
    *([f"1542,1550,{'9' * n}"] for n in (309, 320)),
]


@pytest.mark.parametrize("stamp", ["{:.4f}", "2026-11-25T10:00:{:07.4f}"])
@pytest.mark.parametrize("odd", ODD)
def test_an_odd_first_row_is_no_defect(tmp_path, capfd, odd, stamp):
    rows = [row.format(stamp.format(k * 0.001)) for k, row in enumerate(ROWS)]
    log = tmp_path / "l.csv"
    log.write_text("\n".join(["CH1_FBG2,CH1_FBG1,time_s", *odd, *rows]) + "\n")
    assert run(["speed", str(log), "--setup", str(SAMPLES / "drive.toml")]) in (2, 3, 4)
    assert "defect" not in capfd.readouterr().err


def test_a_value_whose_square_is_no_number_is_no_defect(tmp_path, capfd):
    head, *rows = gzip.decompress((SAMPLES / "inflation.csv.gz").read_bytes()).decode().split("\n")
    log = tmp_path / "l.csv"
    for number in (len(rows) // 3, len(rows) // 2):
        cells = rows[number].split(",")
        rows[number] = ",".join([cells[0], "1e260", *cells[2:]])
    log.write_text("\n".join([head, *rows]))
    assert run(["inflation", str(log), "--setup", str(SAMPLES / "inflation.toml")]) in (0, 2, 3, 4)
    assert "defect" not in capfd.readouterr().err
