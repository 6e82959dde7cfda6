"""Faults: what a broken, truncated or hostile input, role or number meets on the command line."""

import errno
import gzip
import json
import lzma
import re
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.cli.conftest import SETUP, Command, pulse_rows
from tests.cli.test_printed_commands import SCENARIO
from tests.readers.mcap_files import START_NS, write_json

HEADER = "time_s,CH1,CH2\n"


def message(err):
    """The one error line, in the contract's form."""
    lines = [line for line in err.splitlines() if line.startswith("tirelog: error: ")]
    assert lines, err
    assert "Traceback" not in err
    assert err.count("defect of tirelog") == 0, err
    return lines[0]


def with_rows(change):
    rows = pulse_rows()
    for number, text in change.items():
        rows[number] = text
    return (HEADER + "\n".join(rows) + "\n").encode()


def scaled(factor):
    """The log with its stamps running at another rate."""
    rows = [row.split(",") for row in pulse_rows()]
    lines = (f"{float(a) * factor:.6f},{b},{c}\n" for a, b, c in rows)
    return (HEADER + "".join(lines)).encode()


ROWS = (HEADER + "0.0,1550,1542\n" * 100).encode()
UNREADABLE = {
    "blank": (b" \n\n\n", "is empty"),
    "binary": (bytes(range(256)) * 64, "is not text"),
    "control characters": (b"\x01\x02\x03\x04abc\n" * 100, "is not text"),
    "nul in every row": (ROWS.replace(b",1542", b",15\x0042"), "is not text (a NUL byte at"),
    "nothing but nul": (HEADER.encode() + b"\x00" * 4000, "is not text (a NUL byte at"),
    "utf-32": (ROWS.decode().encode("utf-32"), "iconv -f UTF-32"),
    "utf-32 big-endian": (b"\0\0\xfe\xff" + ROWS.decode().encode("utf-32-be"), "iconv -f UTF-32"),
    "no column": (ROWS.replace(b"CH1,CH2", b"C,D"), "no column 'CH1'"),
    "gzip without its end": (gzip.compress(b"x" * 100_000)[:20], "gzip stream is cut off"),
    "gzip of binary": (gzip.compress(bytes(range(256)) * 100), "is not text"),
    "mcap magic alone": (b"\x89MCAP0\r\n", "names no field"),
    "hdf5 magic alone": (b"\x89HDF\r\n\x1a\n" + b"\x00" * 600, "HDF5"),
    "zstd magic alone": (b"\x28\xb5\x2f\xfd", "zstd stream is cut off"),
    "xz damaged": (lzma.compress(ROWS)[:30] + b"\xff" * 50, "xz stream is damaged"),
}


@pytest.mark.parametrize("name", UNREADABLE)
def test_nothing_can_be_read(folder, tirelog, name):
    data, words = UNREADABLE[name]
    (folder / "log.csv").write_bytes(data)
    outcome = tirelog("speed", "log.csv").ended(4)
    assert message(outcome.err).startswith("tirelog: error: log.csv: ")
    assert words in message(outcome.err)
    assert outcome.err.count(";") >= 2
    assert len(outcome.out.splitlines()) <= 1


LOST = {
    "cut in a row": with_rows({})[:-12],
    "text in a number column": with_rows({500: "0.2000,oops,1542.0"}),
    "gzip cut off": gzip.compress(with_rows({}))[:-3000],
}


@pytest.mark.parametrize("name", LOST)
def test_some_of_it_is_lost(folder, tirelog, name):
    (folder / "log.csv").write_bytes(LOST[name])
    outcome = tirelog("speed", "log.csv").ended(3)
    assert message(outcome.err).startswith("tirelog: error: log.csv")
    assert len(outcome.out.splitlines()) > 10


def test_a_full_disk_is_told_of_the_run_that_was_asked_for(folder, tirelog, monkeypatch):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(h5py.File, "create_dataset", full)
    said = message(tirelog("ingest log.csv -o a.h5").err)
    assert said.startswith("tirelog: error: a.h5: cannot be written (No space left on device); the")
    monkeypatch.setattr("tirelog.runs.temporary.RunWriter.append", full)
    outcome = tirelog("ingest log.csv -o a.h5").ended(2)
    assert message(outcome.err).startswith("tirelog: error: a.h5: cannot be written (No space")
    assert "run: cannot be written (No space" in message(tirelog("speed log.csv").err)
    assert sorted(path.name for path in folder.iterdir()) == ["log.csv", "log.toml"]


MISREAD = {
    "another name": scaled(1.0).replace(b"time_s", b"tine_s"),
    "another rate": scaled(2.0),
    "another source": scaled(1.0).replace(b"CH1,CH2", b"CI1,CI2"),
}


@pytest.mark.parametrize("damaged", [False, True])
@pytest.mark.parametrize("name", MISREAD)
def test_a_setup_is_not_blamed_for_a_damaged_log(folder, tirelog, name, damaged):
    """What does not go with the setup, under a gzip checksum of its own or of other bytes."""
    (folder / "log.toml").write_text(SETUP + "sampling_rate_Hz = 2500.0\n")
    packed = gzip.compress(MISREAD[name])
    sums = zlib.crc32(b"what was written") if damaged else zlib.crc32(MISREAD[name])
    (folder / "log.csv.gz").write_bytes(packed[:-8] + sums.to_bytes(4, "little") + packed[-4:])
    found = tirelog("speed", "log.csv.gz", "--setup", "log.toml")
    assert found.status == (4 if damaged or name == "another source" else 2), found.err
    assert ("the gzip stream is damaged" in message(found.err)) == damaged


def test_a_missing_column_costs_that_channel_only(folder, tirelog):
    (folder / "log.toml").write_text(
        SETUP.replace("[log]", '[channels.other]\nkind = "strain"\nsource = "CH7"\n[log]')
    )
    outcome = tirelog("speed log.csv").ended(3)
    assert "CH7" in message(outcome.err)
    assert len(outcome.out.splitlines()) > 10


#: rows of a log, and how many revolutions it has
QUIET = {
    "all lost": ([f"{i / 2500:.4f},,1542.0" for i in range(5000)], 0),
    "constant": ([f"{i / 2500:.4f},1550.0000,1542.0" for i in range(5000)], 0),
    "half a revolution": (pulse_rows(0.04), 0),
    "one revolution": (pulse_rows(0.16), 1),
    "two revolutions": (pulse_rows(0.32), 2),
}


@pytest.mark.parametrize("name", QUIET)
def test_ordinary_data_with_little_in_it(folder, tirelog, name):
    lines, revolutions = QUIET[name]
    (folder / "log.csv").write_text(HEADER + "\n".join(lines) + "\n")
    outcome = tirelog("speed", "log.csv").ended(0)
    rows = outcome.out.splitlines()[1:]
    assert len(rows) == revolutions
    # no speed without a neighbour on either side
    assert all(row.split(",")[-1] != "ok" for row in rows)


REPAIRED = {
    "time backwards": with_rows({3000: pulse_rows()[2900]}),
    "two rows with one stamp": with_rows({3000: pulse_rows()[2999]}),
}


@pytest.mark.parametrize("name", REPAIRED)
def test_a_clock_that_stumbles_is_repaired_and_said(folder, tirelog, name):
    clean = tirelog("speed", "log.csv").out.splitlines()
    (folder / "log.csv").write_bytes(REPAIRED[name])
    outcome = tirelog("speed", "log.csv").ended(0)
    assert len(outcome.out.splitlines()) == len(clean)
    assert "repaired" in tirelog("info", "log.csv").out


def test_a_rate_that_contradicts_the_stamps(folder, tirelog):
    (folder / "log.toml").write_text(SETUP + "sampling_rate_Hz = 2500.0\n")
    (folder / "log.csv").write_bytes(scaled(1.02))
    tirelog("speed", "log.csv").ended(0, "2500")
    (folder / "log.csv").write_bytes(scaled(2.0))
    outcome = tirelog("speed", "log.csv").ended(2)
    assert "1250" in message(outcome.err)


def test_a_wrong_grating_window(folder, tirelog):
    (folder / "log.toml").write_text(
        SETUP.replace('source = "CH1"', "window_nm = [1500.0, 1502.0]")
    )
    outcome = tirelog("speed", "log.csv")
    assert outcome.status in (0, 3, 4)
    assert "strain_1" in outcome.err
    assert len(outcome.out.splitlines()) <= 1


def test_a_setup_s_source_is_a_name_not_a_path(folder, tirelog):
    (folder / "log.toml").write_text(SETUP.replace('"CH1"', '"/etc/passwd"'))
    outcome = tirelog("speed", "log.csv")
    assert outcome.status in (3, 4)
    assert "root:" not in outcome.out + outcome.err


@pytest.mark.parametrize("log", [".", "/", "", "..", "x" * 300, "a" * 5000 + ".csv"])
def test_a_log_that_is_no_file(folder, tirelog, log):
    for command in (["speed"], ["info"], ["ingest", "-o", "run.h5"]):
        outcome = tirelog(command[0], log, *command[1:])
        assert outcome.status in (2, 4), outcome.err
        message(outcome.err)
    assert sorted(p.name for p in folder.iterdir()) == ["log.csv", "log.toml"]


def test_names_of_a_log_do_not_reach_the_terminal_raw(folder, tirelog):
    """Names that clear the screen, set a title, turn writing round or begin a message."""
    hostile = "/\x1b[2J\x9b31m\u202e\ntirelog: error: a lie"
    topic = [(hostile, START_NS + 10**6 * i, {hostile: i, "v": i}) for i in range(99)]
    write_json(folder / "log.mcap", topic)
    rows = "".join(f"{row},0\n" for row in pulse_rows(0.1))
    (folder / "cells.csv").write_text(f"time_s,CH1,CH2,\x1b]0;title\x07\x9b\n{rows}", "utf-8")
    (folder / "log.toml").write_text(SETUP.replace('"CH1"', '"/t:v"'))
    (folder / "cells.toml").write_text(SETUP.replace('"CH1"', '"CH7"').replace('"CH2"', '"CH8"'))
    (folder / "topic.toml").write_text(
        f'[channels.v]\nkind = "vehicle_speed"\nsource = {json.dumps(hostile + ":w")}\n'
    )
    for words in ("log.mcap", "cells.csv", "log.mcap --setup topic.toml"):
        outcome = tirelog(f"speed {words}")
        assert outcome.status in (2, 3, 4)
        assert r"\x1b" in outcome.err
        lines = outcome.err.splitlines()
        assert all(line.startswith("tirelog: ") and line.isprintable() for line in lines)
        assert not any(line.startswith("tirelog: error: a lie") for line in lines)


@pytest.mark.parametrize("name", ["compare", "diagnose", "ladder"])
def test_a_model_against_nothing_that_can_be_read(folder, tirelog, name):
    assert tirelog("model new --carcass beam --setup log.toml -o beam.toml").status == 0
    (folder / "empty.csv").write_text("")
    outcome = tirelog(name, "empty.csv", "--setup", "log.toml", "--model", "beam.toml").ended(4)
    assert outcome.err.count("error:") == 1
    assert "is empty" in outcome.err


def test_a_few_irregular_stamps_do_not_take_the_log_with_them(folder, tirelog):
    """A short topic from a bus: its times are its stamps, the strain is as without it."""
    times_s = np.cumsum(np.random.default_rng(5).uniform(0.01, 0.09, 69))
    cells = [row.split(",") for row in pulse_rows()]
    strain = [
        ("/s", START_NS + round(t * 1e9), {"a": a, "b": b})
        for t, a, b in np.array(cells, float).tolist()
    ]
    bus = [("/can", START_NS + round(t * 1e9), {"v": 12.0}) for t in times_s]
    write_json(folder / "log.mcap", sorted(strain + bus, key=lambda m: m[1]))
    sources = SETUP.split("[log]")[0].replace('"CH1"', '"/s:a"').replace('"CH2"', '"/s:b"')
    (folder / "alone.toml").write_text(sources)
    speed = '[channels.v]\nkind = "vehicle_speed"\nsource = "/can:v"\n'
    (folder / "log.toml").write_text(sources + speed)
    alone = tirelog("speed", "log.mcap", "--setup", "alone.toml")
    both = tirelog("speed", "log.mcap").ended(0)
    assert both.out == alone.out
    assert len(both.out.splitlines()) > 10


# ---- files in the wrong role --------------------------------------------------------------------


#: (command, the file and what it is, what is needed, what to do with it)
CASES = (
    ("compare log.csv --model log.toml", "log.toml: is a setup; a model", "model new --setup"),
    ("compare log.toml --model m.toml", "log.toml: is a setup; a log", "--setup"),
    ("compare m.toml --model m.toml", "m.toml: is a model; a log", "--model"),
    ("speed m.toml", "m.toml: is a model; a log", "--model"),
    ("speed log.toml", "log.toml: is a setup; a log", "--setup"),
    ("info m.toml", "m.toml: is a model; a log", "--model"),
    ("setup new log.toml", "log.toml: is a setup; a log", "--setup"),
    ("speed log.csv --setup m.toml", "m.toml: is a model; a setup", "--model"),
    ("speed log.csv --setup s.toml", "s.toml: is a scenario; a setup", "simulate s.toml"),
    ("model show log.toml", "log.toml: is a setup; a model", "model new --setup log.toml"),
    ("simulate log.toml -o made.csv", "log.toml: is a setup; a scenario", "--setup"),
    ("campaign run m.toml", "m.toml: is a model; a manifest", "--model"),
    ("compare log.csv --model c.toml", "c.toml: is a manifest; a model", "campaign run c.toml"),
)


@pytest.mark.parametrize(("words", "role", "use"), CASES, ids=[case[0] for case in CASES])
def test_a_file_in_the_wrong_role_is_named(folder, tirelog, words, role, use):
    (folder / "s.toml").write_text(SCENARIO)
    (folder / "c.toml").write_text('[campaign]\noutput = "o"\n[[logs]]\nglob = "*.csv"\n')
    assert tirelog("model", "new", "--setup", "log.toml", "-o", "m.toml").status == 0
    outcome = tirelog(*words.split())
    outcome.refused(f"{role} is needed here", use)
    assert len(outcome.err.split("error:")) == 2


def test_who_has_no_model_is_told_what_makes_one(folder, tirelog):
    outcome = tirelog("compare", "log.csv").ended(2)
    found = re.search(r"`tirelog (model new [^`]*)` makes a model", outcome.err)
    assert found
    words = found[1].replace("SETUP.toml", "log.toml").split()
    assert tirelog(*words).status == 0


def test_a_setup_without_a_radius_is_named_by_its_file(folder, tirelog):
    setup = (folder / "log.toml").read_text()
    lines = [line for line in setup.splitlines() if "radius" not in line]
    (folder / "log.toml").write_text("\n".join(lines))
    tirelog("speed", "log.csv").refused("log.toml: the setup has no radius")
    assert "file" not in tirelog("info", "log.csv").out.split("setup:")[-1]


def test_passages_are_counted_as_they_are(folder, tirelog):
    assert tirelog("model", "new", "--setup", "log.toml", "-o", "m.toml").status == 0
    rows = (folder / "log.csv").read_text().splitlines()
    (folder / "log.csv").write_text("\n".join(rows[:1200]) + "\n")
    outcome = tirelog("compare", "log.csv", "--model", "m.toml").ended(
        2, "3 passages in channel strain_1; at least 8 in a row are needed"
    )
    assert "0 whole" not in outcome.err


# ---- numbers that no instrument writes ----------------------------------------------------------


ENCODER = """[tire]
name = "t"
rolling_radius_m = 0.305
[channels.encoder]
kind = "wheel_encoder"
source = "/encoder"
unit = "V"
steps = 48
"""


def test_hundreds_of_decimals_are_no_counts(folder: Path, tirelog: Command) -> None:
    rows = (folder / "log.csv").read_text().splitlines()
    rows[20] = rows[20].replace("1542.0000", "1542." + "0" * 400)
    (folder / "log.csv").write_text("\n".join(rows) + "\n")
    outcome = tirelog("speed", "log.csv")
    assert outcome.status == 0, outcome.err
    assert len(outcome.out.splitlines()) > 10


def test_an_encoder_of_numbers_too_large_to_square_shows_no_teeth(folder, tirelog):
    teeth = np.sin(2 * np.pi * 300 * np.arange(20_000) / 5000.0)
    with h5py.File(folder / "encoder.h5", "w") as file:
        file.create_dataset("encoder", data=1.7e308 * teeth).attrs["sampling_rate_Hz"] = 5000.0
    (folder / "encoder.toml").write_text(ENCODER)
    outcome = tirelog("speed", "encoder.h5")
    assert outcome.status in (3, 4), outcome.err
    assert "encoder" in outcome.err


def test_a_log_that_spans_centuries_is_no_inflation_test(folder: Path, tirelog: Command) -> None:
    seconds = np.concatenate([np.arange(2000) / 100.0, 9e9 + np.arange(2000) / 100.0])
    rows = [f"{at:.2f},{1550 + 1e-5 * number:.5f},1542.0000" for number, at in enumerate(seconds)]
    (folder / "log.csv").write_text("time_s,CH1,CH2\n" + "\n".join(rows) + "\n")
    outcome = tirelog("inflation", "log.csv")
    assert outcome.status == 2, outcome.err
    assert "days; an inflation test of up to 7 days is allowed" in outcome.err


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("model predict beam.toml --speed 20kmh", "20 km/h is 5.556 m/s"),
        ("model predict beam.toml --speed 20m/s", "leave the unit out: 20"),
        ("model predict beam.toml --speed 22,5", "the decimal sign is a point: 22.5"),
        ("model forces beam.toml --speed 5 --slip 0,05", "the decimal sign is a point: 0.05"),
        ("model predict beam.toml --speed 80", "--speed 80 is 288 km/h; 80 km/h is 22.22"),
        ("model forces beam.toml --speed 80", "--speed 80 is 288 km/h; 80 km/h is 22.22"),
        ("model modes beam.toml --load 350kgf", "350 kgf is 3432 N"),
        ("model new -o new.toml --set radius_m=0,305", "the decimal sign is a point: 0.305"),
        ("check log.csv --against log.csv --tolerance time_s=5ms", "5 ms is 0.005 s"),
        ("footprint log.csv --friction-ratio 0,75", "the decimal sign is a point: 0.75"),
    ],
)
def test_a_number_with_a_unit_is_read_back_in_si(model, tirelog, words, says):
    done = tirelog(words)
    assert done.status == 2
    assert says in done.err


def test_two_numbers_that_may_be_one_are_named(model, tirelog):
    done = tirelog("model forces beam.toml --speed 2,5")
    assert done.status == 0
    assert "2,5 is two values; the decimal sign is a point: 2.5" in done.err
    assert len(done.out.splitlines()) == 3


def test_a_check_of_a_setup_tells_the_share_of_a_pulse(folder, tirelog):
    pulses = 5.0 * (20.0 * np.arange(60_000) / 1e4 % 1.0 < 0.06)
    with h5py.File(folder / "encoder.h5", "w") as file:
        file.create_dataset("encoder", data=pulses).attrs["sampling_rate_Hz"] = 1e4
    (folder / "encoder.toml").write_text(ENCODER.replace("48", "1"))
    done = tirelog("setup check encoder.h5")
    assert "noted: channel encoder: pulses of 6% of a step" in done.out
