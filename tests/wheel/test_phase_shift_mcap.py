"""Property: `phase-shift` and `speed` from MCAP (encoder and accelerometer in batches, the
vehicle's speed a message each) give the rows of the same log in HDF5.
"""

import csv
from functools import cache

import numpy as np
import pytest

from tests.readers.mcap_files import START_NS, write_json
from tests.wheel.phase_truth import Drive, Encoder, Tread, write_hdf5
from tirelog.cli import run

pytestmark = pytest.mark.xdist_group("messages")  # one worker makes what these tests share

BATCH = 250
#: constant, faster, constant, braking, constant: the drive of P4 Fig. 8 in half its time
MOTION = ((0, 4, 6.5, 10.5, 11.75, 15), (10, 10, 22, 22, 10, 10))

SETUP = """[tire]
unloaded_radius_m = 0.3126
[channels.encoder]
kind = "wheel_encoder"
source = "{encoder}"
unit = "V"
steps = 48
[channels.acceleration]
kind = "radial_acceleration"
source = "{acceleration}"
unit = "g"
[channels.vehicle]
kind = "vehicle_speed"
source = "{vehicle}"
unit = "m/s"
"""
COMMANDS = ("phase-shift", "speed")
LAYOUTS = {
    "topics": ("/wheel/encoder:samples", "/wheel/acceleration:samples"),
    "one topic": ("/wheel:encoder", "/wheel:acceleration"),
    "interleaved": ("/wheel:data[0::2]", "/wheel:data[1::2]"),
}


@cache
def samples():
    """(encoder [V], acceleration [g], vehicle speed [m/s]) as single precision, at 10 kHz, 10 kHz
    and 100 Hz.
    """
    drive, tread = Drive(*MOTION), Tread(seed=8200)
    speed = drive.speed[::100] + 0.05 * np.random.default_rng(8201).standard_normal(
        drive.speed[::100].size
    )
    return tuple(
        x.astype("f4")
        for x in (Encoder(seed=8202).signal(drive), tread.signal(drive) / 9.80665, speed)
    )


def messages(layout, encoder, acceleration, speed):
    """(topic, time [ns], message) in order of time."""
    for start in range(0, encoder.size, BATCH):
        e, a = (x[start : start + BATCH].astype(float) for x in (encoder, acceleration))
        now = START_NS + start * 100_000
        if layout == "topics":
            yield "/wheel/encoder", now, {"samples": e.tolist()}
            yield "/wheel/acceleration", now, {"samples": a.tolist()}
        elif layout == "one topic":
            yield "/wheel", now, {"encoder": e.tolist(), "acceleration": a.tolist()}
        else:
            yield "/wheel", now, {"data": np.stack([e, a], axis=1).ravel().tolist()}
        for k in range(start // 100 + (start % 100 > 0), (start + BATCH + 99) // 100):
            yield "/vehicle", START_NS + k * 10_000_000, {"speed": float(speed[k])}


def table(folder, command, log):
    assert run([command, str(log), "-o", str(folder / "t.csv")]) in (0, None)
    with (folder / "t.csv").open() as stream:
        return list(csv.DictReader(stream))


@pytest.fixture(scope="module")
def wanted(tmp_path_factory):
    """Rows of each command from HDF5."""
    folder = tmp_path_factory.mktemp("hdf5")
    encoder, acceleration, speed = samples()
    write_hdf5(
        folder / "log.h5",
        {"e": (encoder, "V", 1e4), "a": (acceleration, "g", 1e4), "v": (speed, "m/s", 100.0)},
    )
    (folder / "log.toml").write_text(SETUP.format(encoder="/e", acceleration="/a", vehicle="/v"))
    return {command: table(folder, command, folder / "log.h5") for command in COMMANDS}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_rows_are_those_of_the_same_log_in_hdf5(layout, wanted, tmp_path, capfd):
    log = tmp_path / "log.mcap"
    write_json(log, messages(layout, *samples()), chunk_size=200_000)
    encoder, acceleration = LAYOUTS[layout]
    log.with_suffix(".toml").write_text(
        SETUP.format(encoder=encoder, acceleration=acceleration, vehicle="/vehicle:speed")
    )
    for command, theirs in wanted.items():
        ours = table(tmp_path, command, log)
        assert len(ours) == len(theirs) > 100
        assert "calibrated against vehicle" in capfd.readouterr().err
        assert sum(row["quality"] == "ok" for row in ours) > 0.98 * len(ours)
        for name in ours[0].keys() - {"log"}:
            if name in ("channel", "quality"):
                assert [row[name] for row in ours] == [row[name] for row in theirs]
            else:
                one, other = (
                    np.array([float(row[name] or "nan") for row in part]) for part in (ours, theirs)
                )
                np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-6, err_msg=name)
