"""Property: `phase-shift` and `speed` from MCAP (encoder and accelerometer in batches, the
vehicle's speed a message each) give the rows of the same log in HDF5.
"""

import csv

import h5py
import numpy as np
import pytest

from tests.readers.mcap_files import START_NS, write_json
from tests.wheel.phase_truth import DYNAMIC, Drive, Encoder, Tread
from tirelog.cli import run

pytestmark = pytest.mark.xdist_group("messages")  # one worker makes what these tests share

BATCH = 250

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
LAYOUTS = {
    "topics": ("/wheel/encoder:samples", "/wheel/acceleration:samples"),
    "one topic": ("/wheel:encoder", "/wheel:acceleration"),
    "interleaved": ("/wheel:data[0::2]", "/wheel:data[1::2]"),
}


def samples():
    """(encoder [V], acceleration [g], vehicle speed [m/s]) as single precision, at 10 kHz, 10 kHz
    and 100 Hz.
    """
    drive, tread = Drive(*DYNAMIC), Tread(seed=8200)
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


def table(folder, capfd, command, log):
    capfd.readouterr()
    assert run([command, str(log), "-o", str(folder / "t.csv")]) in (0, None)
    with (folder / "t.csv").open() as stream:
        return list(csv.DictReader(stream)), capfd.readouterr().err


@pytest.fixture(scope="module")
def hdf5(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hdf5")
    with h5py.File(folder / "log.h5", "w") as file:
        for name, values, unit, rate in zip(
            ("e", "a", "v"), samples(), ("V", "g", "m/s"), (1e4, 1e4, 100.0), strict=True
        ):
            data = file.create_dataset(name, data=values)
            data.attrs["unit"], data.attrs["sampling_rate_Hz"] = unit, rate
    (folder / "log.toml").write_text(SETUP.format(encoder="/e", acceleration="/a", vehicle="/v"))
    return folder / "log.h5"


@pytest.mark.parametrize("layout", LAYOUTS)
def test_rows_are_those_of_the_same_log_in_hdf5(layout, hdf5, tmp_path, capfd):
    log = tmp_path / "log.mcap"
    write_json(log, messages(layout, *samples()), chunk_size=200_000)
    encoder, acceleration = LAYOUTS[layout]
    log.with_suffix(".toml").write_text(
        SETUP.format(encoder=encoder, acceleration=acceleration, vehicle="/vehicle:speed")
    )
    for command in ("phase-shift", "speed"):
        (ours, said), (theirs, _) = (table(tmp_path, capfd, command, path) for path in (log, hdf5))
        assert len(ours) == len(theirs) > 200
        assert "calibrated against vehicle" in said
        assert sum(row["quality"] == "ok" for row in ours) > 0.98 * len(ours)
        for name in ours[0].keys() - {"log"}:
            if name in ("channel", "quality"):
                assert [row[name] for row in ours] == [row[name] for row in theirs]
            else:
                one, other = (
                    np.array([float(row[name] or "nan") for row in part]) for part in (ours, theirs)
                )
                np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-6, err_msg=name)
