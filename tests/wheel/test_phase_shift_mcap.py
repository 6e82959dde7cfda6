"""Property: `phase-shift` and `speed` from MCAP (encoder and accelerometer in turns in a batch, the
vehicle's speed a message each) give the rows of the same log in HDF5.
"""

import numpy as np
import pandas as pd
import pytest

from tests.readers.mcap_files import START_NS, write_json
from tests.wheel.phase_truth import Drive, Encoder, Tread, write_hdf5
from tirelog.cli import run

BATCH = 250
#: constant, faster, constant, braking, constant: the drive of P4 Fig. 8 in half its time
MOTION = ((0, 4, 6.5, 10.5, 11.75, 15), (10, 10, 22, 22, 10, 10))
SETUP = """[tire]
unloaded_radius_m = 0.3126
[channels.encoder]
kind = "wheel_encoder"
source = "{}"
unit = "V"
steps = 48
[channels.acceleration]
kind = "radial_acceleration"
source = "{}"
unit = "g"
[channels.vehicle]
kind = "vehicle_speed"
source = "{}"
unit = "m/s"
"""


def messages(encoder, acceleration, speed):
    """(topic, time [ns], message) in order of time; 10 kHz, 10 kHz and 100 Hz."""
    both = np.stack([encoder, acceleration], axis=1).astype(float)
    for start in range(0, encoder.size, BATCH):
        now = START_NS + start * 100_000
        yield "/wheel", now, {"data": both[start : start + BATCH].ravel().tolist()}
        for k in range(-(-start // 100), -(-(start + BATCH) // 100)):
            yield "/vehicle", START_NS + k * 10_000_000, {"speed": float(speed[k])}


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """The log in HDF5 and in MCAP, in single precision."""
    folder, drive = tmp_path_factory.mktemp("messages"), Drive(*MOTION)
    scatter = np.random.default_rng(8201).normal(0.0, 0.05, drive.speed[::100].size)
    acceleration = Tread(seed=8200).signal(drive) / 9.80665
    signals = Encoder(seed=8202).signal(drive), acceleration, drive.speed[::100] + scatter
    e, a, v = (values.astype("f4") for values in signals)
    kept, sent = folder / "kept.h5", folder / "sent.mcap"
    write_hdf5(kept, {"e": (e, "V", 1e4), "a": (a, "g", 1e4), "v": (v, "m/s", 100.0)})
    write_json(sent, messages(e, a, v), chunk_size=200_000)
    kept.with_suffix(".toml").write_text(SETUP.format("/e", "/a", "/v"))
    sources = "/wheel:data[0::2]", "/wheel:data[1::2]", "/vehicle:speed"
    sent.with_suffix(".toml").write_text(SETUP.format(*sources))
    return kept, sent


@pytest.mark.parametrize("command", ["phase-shift", "speed"])
def test_rows_are_those_of_the_same_log_in_hdf5(command, logs, tmp_path, capfd):
    tables = []
    for log in logs:
        assert run([command, str(log), "-o", str(tmp_path / "t.csv")]) == 0
        assert "calibrated against vehicle" in capfd.readouterr().err
        tables.append(pd.read_csv(tmp_path / "t.csv").drop(columns="log"))
    assert len(tables[0]) > 100
    assert (tables[1]["quality"] == "ok").mean() > 0.98
    pd.testing.assert_frame_equal(*tables, check_exact=False, rtol=1e-6, atol=1e-6)
