"""Faults: foreign logs, where they are at hand, are read."""

from pathlib import Path

import numpy as np
import pytest

from tests.readers.text_logs import joined, read, setup_of
from tirelog.data.recording import TimeAxis
from tirelog.readers.text.reader import open_text
from tirelog.runs.clock import ClockFit
from tirelog.vocabulary.quality import Quality

REAL = Path(__file__).resolve().parents[3] / "shared" / "real"
FBGS, COMMA = REAL / "fbgs_illumisense", REAL / "comma2k19"

#: log -> (start, rows, samples lost, rows with error codes, error codes)
EXPORTS = {
    "good_20220414-1300_02-SCB.txt.gz": ("2022-04-14T13:00:00+02:00", 12_000, 0, 0, 0),
    "bad_20220414-1310_02-SCB.txt.gz": ("2022-04-14T13:10:00+02:00", 11_999, 1, 505, 1472),
    "bad_20220414-1320_02-SCB.txt.gz": ("2022-04-14T13:20:00+02:00", 11_999, 1, 5994, 12_165),
    "bad_20230702-0020_02-SCB.txt.gz": ("2023-07-02T00:20:00+02:00", 11_999, 1, 11_999, 23_998),
}


def clock_of(reader, block, **more):
    group = reader.groups[0]
    clock = ClockFit(
        file_rate_Hz=group.rate_Hz,
        resolution_s=group.stamp_resolution_s,
        counted=group.counted,
        **more,
    )
    clock.add(block.stamps_s, block.number, next(iter(block.values.values())).size)
    assert clock.axis.size
    return clock


@pytest.mark.skipif(not FBGS.exists(), reason="the real logs are not at hand")
@pytest.mark.parametrize("name", EXPORTS)
def test_interrogator_export(name):
    start, rows, lost, with_codes, codes = EXPORTS[name]
    columns = ["W-N-01", "T-N-01", "B-S-04", "W-S-13", "T-W-S-13"]
    setup = setup_of({c: {"kind": "strain", "source": c, "unit": "microstrain"} for c in columns})
    reader = open_text(FBGS / name, setup, name)
    block = joined(list(reader.blocks()), reader)
    assert reader.groups[0].channels == tuple(c for c in columns if c != "W-S-13")
    assert len(reader.report.losses) == 1  # W-S-13 is no column of it
    assert block.values["W-N-01"].size == rows == reader.report.counts["rows"]
    assert not any(np.isnan(values).any() for values in block.values.values())
    assert reader.report.counts.get("rows_with_error_codes", 0) == with_codes
    assert reader.report.counts.get("error_codes", 0) == codes
    flagged = [stop - begin for channel, begin, stop, _ in block.flags if channel == "W-N-01"]
    assert sum(flagged) == with_codes
    assert reader.report.start == start
    clock = clock_of(reader, block)
    assert clock.axis.rate_Hz == 20.0
    assert clock.axis.duration_s == pytest.approx((rows - 1) / 20.0)
    assert clock.repairs.get("lost_samples", 0) == lost


@pytest.mark.skipif(not FBGS.exists(), reason="the real logs are not at hand")
def test_readings_that_come_with_error_codes_are_kept_and_flagged():
    reader = open_text(
        FBGS / "bad_20220414-1320_02-SCB.txt.gz",
        setup_of({"x": {"kind": "strain", "source": "#50", "unit": "microstrain"}}),
        "log",
    )
    block = joined(list(reader.blocks()), reader)
    flagged = np.zeros(11_999, bool)
    for _, start, stop, word in block.flags:
        assert word == Quality.ERROR_CODE
        flagged[start:stop] = True
    assert block.values["x"].min() < -1000.0
    assert flagged[block.values["x"] < -1000.0].all()


def as_text(times, columns):
    names = ",".join(f"c{k}" for k in range(columns.shape[1]))
    return f"time_s,{names}\n" + "".join(
        f"{t:.9f}," + ",".join(f"{x:.17g}" for x in row) + "\n"
        for t, row in zip(times.tolist(), columns.tolist())
    )


@pytest.mark.skipif(not COMMA.exists(), reason="the real logs are not at hand")
@pytest.mark.parametrize(
    ("name", "kind", "unit", "rate_Hz", "within_s"),
    [
        ("CAN_wheel_speed", "vehicle_speed", "m/s", 82.926, 2e-9),
        # inertial samples have a clock of their own
        ("IMU_accelerometer", "longitudinal_acceleration", "m/s^2", 104.264, 2e-4),
    ],
)
def test_samples_off_a_bus_keep_their_stamps(name, kind, unit, rate_Hz, within_s):
    times, values = np.load(COMMA / f"{name}_t.npy"), np.load(COMMA / f"{name}_value.npy")
    channels = {
        f"x{k}": {"kind": kind, "source": f"c{k}", "unit": unit} for k in range(values.shape[1])
    }
    reader, block = read(as_text(times, values), setup_of(channels))
    for k in range(values.shape[1]):
        np.testing.assert_array_equal(block.values[f"x{k}"], values[:, k])
    axis: TimeAxis = clock_of(reader, block).axis
    assert (axis.explicit is None) == (name == "IMU_accelerometer")
    assert axis.rate_Hz == pytest.approx(rate_Hz, abs=0.001)
    np.testing.assert_allclose(axis.time(), times - times[0], rtol=0, atol=within_s)
