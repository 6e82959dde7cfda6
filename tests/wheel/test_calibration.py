"""Property: planted speed maps, delay and forces are found, and a file gives them back."""

import numpy as np
import pytest

from tests.wheel.phase_truth import DYNAMIC, RAMP, Drive, Encoder, Tread, recording
from tirelog.data.recording import Channel, TimeAxis
from tirelog.errors import UsageError
from tirelog.vocabulary.quality import Quality, having
from tirelog.wheel.calibration import (
    calibrate,
    clean_passages,
    read_calibration,
    table,
    with_zero,
    write_calibration,
)
from tirelog.wheel.phase_shift import measure_phase_shift

TREND = (0.03, 0.0015)  # degrees per m/s and per (m/s)^2 about 10 m/s
WIDTH = (-0.05, -0.002)


pytestmark = pytest.mark.xdist_group("calibration")  # one worker makes what these tests share


def trend(v, of=TREND):
    return of[0] * (v - 10) + of[1] * (v - 10) ** 2


def tread(seed):
    """A wheel: shift from force and trend, width from load transfer and trend."""
    return Tread(
        shift=lambda v, a: 0.15 * a + trend(v),
        width=lambda v, a: 25 + 0.25 * a + trend(v, WIDTH),
        seed=seed,
    )


def passages(drive, wheel, forces=()):
    """`forces` (kind, values): what else is recorded, in newtons."""
    found = recording(drive, Encoder(seed=wheel.seed + 5).signal(drive), wheel.signal(drive))
    axis = TimeAxis.uniform(drive.time.size, 10_000.0)
    for kind, values in forces:
        found.channels[kind] = Channel.of_array(kind, kind, values, axis, unit="N")
    return next(measure_phase_shift(found, "auto", bool(forces)))


@pytest.fixture(scope="module")
def ramp():
    return passages(Drive(*RAMP), tread(20_000))


def test_speed_maps_are_found_within_their_errors(ramp):
    """The 130 s ramp up and down has 0.25 m/s^2: the force in it must not bend the map."""
    learnt = calibrate([ramp])
    for found, true in ((learnt.shift, TREND), (learnt.width, WIDTH)):
        speed = np.linspace(10, 25, 16)
        design = np.stack([speed - 10, (speed - 10) ** 2], axis=1)
        se = np.sqrt(np.einsum("ni,ij,nj->n", design, found.covariance, design))
        assert 1e-4 < se[-1] < 0.01
        # beyond the noise: a tooth's error bends the sine inside the window that places it, a
        # little differently at each speed
        off = found(speed, learnt.reference_speed_m_s) - trend(speed, true)
        assert (np.abs(off) < 4 * se + 0.008).all()
    assert learnt.shift.low_m_s == pytest.approx(10, abs=0.1)
    assert learnt.shift.high_m_s == pytest.approx(25, abs=0.1)


@pytest.mark.parametrize("delay_s", [0.0, 0.4e-3])
def test_a_delay_is_found_and_taken_off_and_its_rows_say_so(delay_s):
    drag = {"shift": lambda v, a: 0.0015 * (v**2 - 100)}
    found = passages(Drive(*RAMP), Tread(delay_s=delay_s, seed=22_000, **drag))
    learnt = calibrate([found])
    assert abs(learnt.delay_s - delay_s) < 4 * learnt.delay_se_s + 1e-5
    assert learnt.delay_se_s < 1e-4
    assert learnt.has_delay == (delay_s > 0)
    steady = found.steady >= 0
    assert np.nanmax(np.abs(clean_passages(found, learnt)["shift_deg"][steady])) < 0.12
    other = passages(Drive(*DYNAMIC), Tread(delay_s=delay_s, seed=22_200, **drag))
    columns = table(other, learnt)
    inner = slice(1, -1)  # without those that the log's ends may cut
    assert set(columns["quality"][inner]) == {"delay_removed" if delay_s else "ok"}
    assert np.nanstd(columns["phase_shift_detrended_deg"]) < 0.05
    assert np.nanstd(columns["phase_shift_deg"]) > 0.05
    assert set(table(other, None)["quality"][inner]) == {"ok"}


def test_speeds_beyond_the_maps_have_no_zero_of_theirs_and_are_extrapolated(ramp):
    learnt = calibrate([ramp])
    beyond = passages(Drive((0, 20), (33, 33)), tread(23_200))
    given = with_zero(beyond, learnt)
    assert having(given.quality, Quality.NO_ZERO).all()
    assert "within the calibration's range of speed" in given.said[-1]
    fast = passages(Drive((0, 8, 13, 20), (10, 10, 32, 32)), tread(23_000))
    inner = slice(1, -1)
    quality, speed = np.array(table(fast, learnt)["quality"])[inner], fast.speed_m_s[inner]
    assert (quality[speed > 26] == "extrapolated").all()
    assert (quality[speed < 24] == "ok").all()


def test_what_the_logs_do_not_show_is_empty_or_refused(ramp):
    learnt = calibrate([ramp])
    assert np.isnan(learnt.crosstalk)
    assert np.isnan(table(ramp, learnt)["phase_shift_corrected_deg"]).all()
    with pytest.raises(UsageError, match="vertical_load"):
        calibrate([ramp], forces=True)


@pytest.fixture(scope="module")
def forces(ramp):
    """(drive, true loads [N], passages, calibration with these)."""
    drive = Drive(*DYNAMIC)
    noise = 15 * np.random.default_rng(5).standard_normal(drive.time.size)
    loads = {
        "vertical_load": 4000 + 320 * drive.acceleration + noise,
        "longitudinal_force": 400 * drive.acceleration,
    }
    found = passages(drive, tread(24_000), tuple(loads.items()))
    return drive, loads, found, calibrate([ramp, found], forces=True)


@pytest.mark.parametrize(
    ("load", "column", "fit", "rms_N"),
    [
        ("vertical_load", "vertical_force", "vertical", 200),
        ("longitudinal_force", "longitudinal_force", "longitudinal", 300),
    ],
)
def test_force_maps(forces, load, column, fit, rms_N):
    drive, loads, found, learnt = forces
    assert getattr(learnt, fit).rms_N < rms_N
    columns, time = table(found, learnt), found.time_s
    calm = (found.steady >= 0) | ((time > 9) & (time < 12)) | ((time > 21.6) & (time < 23))
    error = (columns[f"{column}_N"] - np.interp(time, drive.time, loads[load]))[calm]
    se = columns[f"{column}_se_N"][calm]
    assert np.mean(np.abs(error) < 2 * se) > 0.9
    assert np.sqrt(np.mean(error**2)) > 0.2 * np.median(se)


def test_the_file_gives_the_same_calibration(tmp_path, forces):
    learnt = forces[3]
    write_calibration(tmp_path / "c.toml", learnt)
    again = read_calibration(tmp_path / "c.toml")
    assert again.shift.linear_deg_s_m == learnt.shift.linear_deg_s_m
    np.testing.assert_array_equal(again.width.covariance, learnt.width.covariance)
    np.testing.assert_array_equal(again.vertical.coefficients_N, learnt.vertical.coefficients_N)
    assert again.delay_s == learnt.delay_s
