"""Property: `phase-shift` gives fronts, zero and words of an accelerometer whose patch is known."""

import numpy as np
import pytest

from tests.wheel.phase_truth import (
    DYNAMIC,
    RADIUS_M,
    STEADY,
    Drive,
    Encoder,
    Tread,
    front_errors,
    recording,
)
from tirelog.errors import DataLoss, SetupError
from tirelog.vocabulary.quality import Quality, good, having
from tirelog.wheel.phase_shift import measure_phase_shift


def moving(**more):
    """A patch that follows speed and acceleration."""
    return Tread(
        shift=lambda v, a: 0.15 * a + 0.02 * (v - 10),
        width=lambda v, a: 25 + 0.1 * a - 0.05 * (v - 10),
        **more,
    )


def run(drive, tread, *, encoder=None, acceleration=None, zero="auto", **more):
    """The passages of a drive; the signals of `encoder` and `acceleration` if these are given."""
    if not isinstance(encoder, np.ndarray):
        encoder = (encoder or Encoder(seed=tread.seed + 7)).signal(drive)
    if acceleration is None:
        acceleration = tread.signal(drive)
    return next(measure_phase_shift(recording(drive, encoder, acceleration, **more), zero))


def rms(values):
    return np.sqrt(np.mean(values**2))


@pytest.mark.parametrize("speed", [15.05, 20.02])
def test_the_shift_has_the_error_of_edges_between_two_samples(speed):
    """At 20.02 m/s a half tooth takes 9.97 samples: errors do not average out."""
    drive, tread = Drive((0, 15), (speed, speed)), Tread(noise_g=0.6)
    pulses = np.where(Encoder(noise=0, wobble=0, pitch_deg=0).clean(drive) > 0, 5.0, 0.0)
    passages = run(drive, tread, encoder=pulses, zero="none")
    shift, width, _ = front_errors(passages, drive, tread)
    assert rms(shift) < 1.4 * np.nanmedian(passages.shift_se_deg)
    assert rms(width) < 1.4 * np.nanmedian(passages.width_se_deg)


def bound_deg(drive, tread):
    """Cramer-Rao bound of (shift, width) for a flank of known form in white noise: information is
    the squared slope over angle of the samples of a passage, up to the patch's middle for the entry
    and from it for the exit.
    """
    clean = Tread(**{**tread.__dict__, "noise_g": 0.0}).signal(drive)
    phi = np.rad2deg(np.mod(drive.angle - tread.place_rad + np.pi, 2 * np.pi) - np.pi)
    slope = np.gradient(clean, np.rad2deg(drive.angle))
    turns = (drive.angle[-1] - drive.angle[0]) / (2 * np.pi)
    sides = [(phi > -20) & (phi < 0), (phi > 0) & (phi < 20)]
    entry, leave = (
        tread.noise_g * 9.81 / np.sqrt(np.sum(slope[side] ** 2) / turns) for side in sides
    )
    return np.hypot(entry, leave) / 2, np.hypot(entry, leave)


@pytest.mark.parametrize(("sharp_deg", "spike"), [(0.8, 0.5), (2.0, 1.5), (3.0, 1.2)])
def test_errors_are_near_the_bound(sharp_deg, spike):
    """Within a tenth, and what 540 passages leave uncertain."""
    drive, tread = Drive((0, 105), (10, 10)), Tread(sharp_deg=sharp_deg, spike=spike, seed=8300)
    shift, width, _ = front_errors(run(drive, tread), drive, tread)
    for error, bound in zip((shift, width), bound_deg(drive, tread), strict=True):
        most = 1.1 * np.hypot(bound, 0.006) + 2 * bound / np.sqrt(2 * error.size)
        assert 0.9 * bound < error.std() < most


@pytest.mark.parametrize(
    ("noise_g", "shift_deg", "width_deg"), [(1.2, 0.02, 0.05), (3.0, 0.05, 0.11)]
)
def test_all_passages_are_found_with_errors_that_hold(noise_g, shift_deg, width_deg):
    drive, tread = Drive(*DYNAMIC), moving(noise_g=noise_g, seed=3000)
    passages = run(drive, tread)
    shift, width, _ = front_errors(passages, drive, tread)
    rows = np.isfinite(passages.width_deg)
    assert rms(shift) < shift_deg
    assert rms(width) < width_deg
    for error, se in ((shift, passages.shift_se_deg), (width, passages.width_se_deg)):
        assert 0.92 < np.mean(np.abs(error) < 1.96 * se[rows]) <= 1.0
        assert np.median(se[rows]) < 1.6 * error.std()
    true = 1.0 + 2 * np.pi * np.arange(int((drive.angle[-1] - 1.0) / (2 * np.pi)) + 1)
    times = np.interp(true, drive.angle, drive.time)
    assert np.abs(passages.time_s[:, None] - times).min(axis=1).max() < 0.01
    found = passages.time_s[passages.good]
    assert np.mean(np.abs(times[:, None] - found).min(axis=1) < 0.01) > 0.97


@pytest.mark.parametrize(("hertz", "seconds"), [(397.0, 5.0), (397.0, 25.0), (53.0, 25.0)])
def test_errors_hold_under_a_hum_that_each_passage_sees_otherwise(hertz, seconds):
    """Also of some 25 passages, and of a third of the log: it hardly moves those at 22 m/s."""
    drive, tread = Drive((0, seconds, seconds + 1, 3 * seconds), (10, 10, 22, 22)), Tread()
    signal = tread.signal(drive) + 30.0 * np.sin(2.0 * np.pi * hertz * drive.time)
    passages = run(drive, tread, acceleration=signal)
    shift, _, _ = front_errors(passages, drive, tread)
    rows = np.isfinite(passages.width_deg)
    clean = good(passages.quality[rows])
    assert clean.sum() > 20
    assert (np.abs(shift) < 5.0 * passages.shift_se_deg[rows])[clean].all()


@pytest.mark.parametrize(("sharp_deg", "spike"), [(0.4, 0.8), (1.6, 0.0), (1.6, 0.8)])
def test_width_has_no_bias_with_speed(sharp_deg, spike):
    # the sensor's bandwidth would move the crossing of a flank with a spike itself, so it is left
    # out here
    drive = Drive((0, 8, 60), (10, 10, 25))
    tread = Tread(sharp_deg=sharp_deg, spike=spike, seed=5000, blur_s=0.0)
    _, width, speed = front_errors(run(drive, tread), drive, tread)
    assert abs(15 * np.polyfit(speed, width, 1)[0]) < 0.03


def test_fronts_lie_at_half_of_the_level_beside_a_lobe():
    """(1 + spike) / (1 + exp(-outside / sharp)) is a half at outside = -sharp log(1 + 2 spike)."""
    tread = Tread(sharp_deg=0.8, spike=0.5, seed=5100, blur_s=0.0)
    width = run(Drive((0, 20), (10, 14)), tread).width_deg
    assert np.nanmean(width) == pytest.approx(25.0 - 2 * 0.8 * np.log(2.0), abs=0.03)


@pytest.mark.parametrize(("sign", "gravity"), [(-1, True), (1, True), (1, False)])
def test_either_sign_and_gravity_or_not(sign, gravity):
    drive, tread = Drive(*DYNAMIC), Tread(sign=sign, gravity=gravity, seed=6000)
    passages = run(drive, tread)
    shift, width, _ = front_errors(passages, drive, tread)
    assert shift.std() < 0.02
    assert width.std() < 0.05
    remarks = " ".join(passages.remarks)
    assert ("inward" if sign > 0 else "outward") in remarks
    assert ("with gravity" if gravity else "without gravity") in remarks


@pytest.mark.parametrize(
    ("zero", "mean", "zero_speed"),
    [("auto", 0.24, 10.0), ("22", 0.0, 22.0), ("14:20", 0.0, 22.0), ("10", 0.24, 10.0)],
)
def test_zero_is_the_first_low_steady_stretch_or_a_setting(zero, mean, zero_speed):
    passages = run(Drive(*DYNAMIC), moving(seed=9000), zero=zero)
    first, high = passages.time_s < 7.5, (passages.time_s > 14) & (passages.time_s < 20)
    assert np.mean(passages.shift_deg[first]) == pytest.approx(mean - 0.24, abs=0.02)
    assert np.mean(passages.shift_deg[high]) == pytest.approx(mean, abs=0.02)
    assert passages.zero_speed_m_s == pytest.approx(zero_speed, abs=0.05)


def test_rows_do_not_depend_on_the_blocks(monkeypatch):
    drive, tread = Drive(*DYNAMIC), moving(seed=13_000)
    whole = run(drive, tread)
    monkeypatch.setattr("tirelog.dsp.teeth.BLOCK", 40_000)
    monkeypatch.setattr("tirelog.wheel.fronts.PIECE", 30_000)
    parts = run(drive, tread)
    np.testing.assert_allclose(parts.shift_deg, whole.shift_deg, atol=1e-6)
    np.testing.assert_allclose(parts.width_deg, whole.width_deg, atol=1e-6)


# ---- bad input ---------------------------------------------------------------


def test_accelerometer_without_a_patch():
    drive = Drive(*STEADY)
    noise = np.random.default_rng(2).standard_normal(drive.time.size)
    with pytest.raises(DataLoss, match="no patch"):
        run(drive, Tread(), acceleration=noise)


@pytest.mark.parametrize("steps", [44, 47, 60, 96])
def test_wrong_number_of_steps(steps):
    with pytest.raises(SetupError, match="steps = 48"):
        run(Drive(*STEADY), Tread(), steps=steps)


@pytest.mark.parametrize(("rate_Hz", "factor"), [(1000.0, r"(10|9\.99)"), (20_000.0, r"0\.5")])
def test_sampling_rate_wrong_by_a_factor(rate_Hz, factor):
    with pytest.raises(SetupError, match=f"sampling rate wrong by a factor {factor}"):
        run(Drive(*DYNAMIC), Tread(), rate=rate_Hz)


@pytest.mark.parametrize(
    ("tread", "limit_m_s2", "clips_m_s", "clean_m_s"),
    [
        ({}, 120 * 9.81, 20.0, 12.0),
        # without a spike beside the fronts only the noise on the level reaches the limit, 2 % above
        # it at 22 m/s: the level is too low
        ({"spike": 0.0, "gravity": False}, 1.02 * 22**2 / RADIUS_M, 21.9, 20.0),
    ],
)
def test_saturated_accelerometer(tread, limit_m_s2, clips_m_s, clean_m_s):
    drive, tread = Drive(*DYNAMIC), Tread(**tread)
    cut = np.clip(tread.signal(drive), -limit_m_s2, limit_m_s2)
    passages = run(drive, tread, acceleration=cut)
    clipped, fast = having(passages.quality, Quality.CLIPPED), passages.speed_m_s > clips_m_s
    assert fast.sum() > 50
    assert clipped[fast].all()
    assert not clipped[passages.speed_m_s < clean_m_s].any()
    assert any("clipped" in remark for remark in passages.remarks)


@pytest.mark.parametrize("kind", ["blank", "held", "zero"])
def test_radio_drop_outs(kind):
    drive, tread = Drive(*STEADY), Tread(seed=14_000)
    values = tread.signal(drive)
    for start in np.random.default_rng(3).integers(10_000, values.size - 1000, 15):
        values[start : start + 300] = {"blank": np.nan, "held": values[start], "zero": 0.0}[kind]
    passages = run(drive, tread, acceleration=values)
    shift, width, _ = front_errors(passages, drive, tread)
    good = passages.good[np.isfinite(passages.width_deg)]
    assert np.abs(shift[good]).max() < 0.12
    assert np.abs(width[good]).max() < 0.25
    assert abs(len(passages.quality) - round(drive.angle[-1] / (2 * np.pi))) <= 1
    assert 0.6 < passages.good.mean() < 1.0


@pytest.mark.parametrize("grows", [True, False])
def test_standing_still_in_between(grows):
    drive, tread = Drive((0, 6, 9, 14, 17, 30), (10, 10, 0, 0, 10, 10)), Tread(seed=15_000)
    passages = run(drive, tread, encoder=Encoder(grows=grows))
    shift, _, speed = front_errors(passages, drive, tread)
    assert np.abs(shift[speed > 5]).max() < 0.15
    assert having(passages.quality, Quality.STANDSTILL).any()


@pytest.mark.parametrize("steps", [48, 120, 200])
def test_a_shift_of_more_than_half_a_tooth_is_the_patchs(steps):
    """Hard braking moves the patch by 2.4 degrees within two turns; teeth of 200 steps take 1.8."""
    drive = Drive((0, 6, 8, 10, 11.2, 16), (10, 10, 20, 20, 10, 10))
    tread = Tread(shift=lambda v, a: 0.25 * a, seed=15_500)
    passages = run(drive, tread, encoder=Encoder(steps=steps, pitch_deg=0.05), steps=steps)
    shift, _, _ = front_errors(passages, drive, tread)
    assert passages.good.mean() > 0.95
    assert np.abs(shift).max() < 0.15


def test_a_tooth_that_was_dropped_whole_is_given_back():
    """Both channels lack the samples of a tooth, so that every tooth is as long as before."""
    drive, tread = Drive((0, 12), (10, 10)), Tread(seed=15_600)
    tooth = round(2 * np.pi * RADIUS_M / 48 / 10 * 10_000)
    kept = np.ones(drive.time.size, bool)
    for start in (30_500, 61_000, 90_200):
        kept[start : start + tooth] = False
    signals = (Encoder(pitch_deg=0.05).signal(drive)[kept], tread.signal(drive)[kept])
    drive = Drive((0, kept.sum() / 10_000), (10, 10))
    found = next(measure_phase_shift(recording(drive, *signals), "none"))
    middle = (found.entry_deg + found.width_deg / 2)[found.good]
    assert found.good.mean() > 0.8
    assert np.ptp(middle) < 0.3


def test_missing_and_glitching_teeth():
    drive, tread = Drive(*DYNAMIC), Tread(seed=16_000)
    signal = Encoder().signal(drive)
    random = np.random.default_rng(4)
    for start in random.integers(0, signal.size - 100, 30):
        signal[start : start + 3] += random.choice([-3.0, 3.0])
    shift, _, _ = front_errors(run(drive, tread, encoder=signal), drive, tread)
    assert shift.std() < 0.02


@pytest.mark.parametrize(
    ("pitch_deg", "start", "count"),
    [(0.0, 104_000, 5100), (0.4, 104_000, 5100)]
    + [(0.4, start, 32_768) for start in (60_000, 150_000, 204_000)],
)
def test_teeth_lost_in_a_hole_are_given_back(pitch_deg, start, count):
    """By the tone wheel's own pattern, or, where it has none, by the patch."""
    drive, tread = Drive(*DYNAMIC), Tread(seed=17_000)
    signal = Encoder(pitch_deg=pitch_deg, wobble=0.0).signal(drive)
    signal[start : start + count] = np.nan
    passages = run(drive, tread, encoder=signal)
    shift, _, _ = front_errors(passages, drive, tread)
    assert shift[passages.good[np.isfinite(passages.width_deg)]].std() < 0.02
    assert having(passages.quality, Quality.GAP | Quality.STANDSTILL).any()
    assert any("whole teeth back" in remark for remark in passages.remarks) == (pitch_deg == 0)
    begin, end = drive.time[[start, start + count]]
    inside = (passages.time_s > begin) & (passages.time_s < end)
    assert not passages.good[inside].any()
    assert 0.5 < passages.good.mean() < 1.0
