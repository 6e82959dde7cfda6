"""Faults: what a broken, truncated or hostile input, role or number meets on the command line."""

import errno
import json

import h5py
import numpy as np

from tests.cli.conftest import SETUP, pulse_rows
from tests.readers.mcap_files import START_NS, write_json


def message(err):
    """The one error line, in the contract's form."""
    lines = [line for line in err.splitlines() if line.startswith("tirelog: error: ")]
    assert lines, err
    assert "Traceback" not in err
    assert err.count("defect of tirelog") == 0, err
    return lines[0]


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


def test_an_encoder_of_numbers_too_large_to_square_shows_no_teeth(folder, tirelog):
    teeth = np.sin(2 * np.pi * 300 * np.arange(20_000) / 5000.0)
    with h5py.File(folder / "encoder.h5", "w") as file:
        file.create_dataset("encoder", data=1.7e308 * teeth).attrs["sampling_rate_Hz"] = 5000.0
    (folder / "encoder.toml").write_text(ENCODER)
    outcome = tirelog("speed", "encoder.h5")
    assert outcome.status in (3, 4), outcome.err
    assert "encoder" in outcome.err


def test_a_check_of_a_setup_tells_the_share_of_a_pulse(folder, tirelog):
    pulses = 5.0 * (20.0 * np.arange(60_000) / 1e4 % 1.0 < 0.06)
    with h5py.File(folder / "encoder.h5", "w") as file:
        file.create_dataset("encoder", data=pulses).attrs["sampling_rate_Hz"] = 1e4
    (folder / "encoder.toml").write_text(ENCODER.replace("48", "1"))
    done = tirelog("setup check encoder.h5")
    assert "noted: channel encoder: pulses of 6% of a step" in done.out
