"""Faults: damaged files of tirelog's own, and outputs that are inputs, are named."""

import gzip
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tirelog.cli import run
from tirelog.tables.writer import TableWriter

SAMPLES = Path(__file__).parents[2] / "sample_data"
LOG = str(SAMPLES / "drive.csv.gz")
STEP = {
    "step": 0, "effect": "base", "rmse_fit": 1e-6, "rmse_heldout": None, "noise_floor": 1e-6,
    "excess_heldout": None, "p_adjusted": None, "decision": "start",
    "outcome": "start", "sentence": "s",
    "parameters": {"k": {"value": 1.0, "se": None, "unit": "1"}},
}  # fmt: skip


def speed_table(path, rows=5000):
    columns = ("time_s", "speed_m_s", "period_s", "speed_se_m_s", "acceleration_m_s2")
    rng = np.random.default_rng(1)
    with TableWriter("speed", path, None) as table:
        table.write(
            {"log": "a.csv", "channel": "1", "revolution": np.arange(rows), "quality": "ok"}
            | {name: rng.random(rows) for name in columns}
        )
    return path


def refused(words, status, said, capfd, folder):
    """That a page is refused with these words, and is not there."""
    page = folder / "page.html"
    assert run(["report", LOG, *words, "-o", str(page)]) == status
    assert said in capfd.readouterr().err
    assert not page.exists()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("\na.csv,1,0,", "\na.csv,1,0x1F,", "row 1, column revolution: no int"),
        ("\na.csv,1,3,", "\na.csv,1,3.5,", "row 4, column revolution: no int"),
        (",ok\na.csv,1,3,", ",ok\na.csv,1,3,x", "row 4, column time_s: no float"),
    ],
)
def test_a_cell_of_another_kind_is_named(tmp_path, capfd, old, new, said):
    table = speed_table(tmp_path / "t.csv")
    table.write_text(table.read_text().replace(old, new, 1))
    refused(["--table", str(table)], 4, said, capfd, tmp_path)


def test_a_damaged_page_of_parquet_is_said(tmp_path, capfd):
    table = speed_table(tmp_path / "t.parquet")
    data = bytearray(table.read_bytes())
    data[len(data) // 3 : len(data) // 3 + 400] = bytes(400)
    table.write_bytes(data)
    refused(["--table", str(table)], 4, "is not a table", capfd, tmp_path)


@pytest.mark.parametrize(
    ("where", "value", "said"),
    [
        ("effect", 7, "steps[0].effect is int"),
        ("noise_floor", "x", "steps[0].noise_floor is str"),
        ("rmse_fit", True, "steps[0].rmse_fit is bool"),
        ("parameters", {"k": {"value": 1.0}}, "steps[0].parameters.k has no se"),
        ("parameters", [], "steps[0].parameters is list"),
    ],
)
def test_a_ladder_of_other_types_is_none(tmp_path, capfd, where, value, said):
    ladder = {"observable": "strain", "unit": "1", "steps": [STEP | {where: value}]}
    path = tmp_path / "ladder.json"
    path.write_text(json.dumps(ladder))
    refused(["--ladder", str(path)], 2, said, capfd, tmp_path)


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
