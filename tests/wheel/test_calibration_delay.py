"""Property: what a ramp tells of a delay beside drag and inertia, force known or not."""

from dataclasses import replace

import numpy as np
import pytest

from tirelog.vocabulary.quality import none_of
from tirelog.wheel.calibration import calibrate, clean_passages, read_calibration, write_calibration
from tirelog.wheel.phase_shift import EdgeTimes

RADIUS_M, DELAY_S = 0.305, 0.4e-3
SEEDS = range(700, 714)
#: phase shift per force of a driven wheel [deg/N]; mass [kg], rolling resistance [N] and air drag
#: [kg/m] of the car
WIND_UP, MASS, ROLLING, AIR = 6.5e-4, 1500.0, 177.0, 0.4


def ramp(
    seed, *, trend_deg_s_m=0.0, bend_m_s=None, drive_s=24.0, coast_s=24.0, noise_deg=0.02,
    measured=True,
):  # fmt: skip
    """Rows of a slow drive-up and coast-down, by kinematics alone: no signal, no fronts."""
    rng = np.random.default_rng(seed)
    corners = np.cumsum([0.0, 5.0, drive_s, 3.0, coast_s, 3.0])
    fine = np.linspace(0.0, corners[-1], 20_001)
    speed_at = np.interp(fine, corners, [10.0, 10.0, 24.0, 24.0, 10.0, 10.0])
    turned = np.cumsum(speed_at) * (fine[1] - fine[0]) / (2 * np.pi * RADIUS_M)
    time = np.interp(np.arange(1, int(turned[-1])), turned, fine)
    v = np.interp(time, fine, speed_at)
    a = np.interp(time, fine, np.gradient(speed_at, fine))
    demand = MASS * a + ROLLING + AIR * v**2
    force = np.where(a < -0.01, 0.0, 0.5 * demand)  # nothing is driven while it coasts
    shift = WIND_UP * force + trend_deg_s_m * v + np.rad2deg(DELAY_S * v / RADIUS_M)
    shift += 0.0 if bend_m_s is None else trend_deg_s_m / bend_m_s * v**2
    shift = shift - np.mean(shift[:20]) + noise_deg * rng.standard_normal(v.size)
    se, width = np.full(v.size, noise_deg), np.full(v.size, 15.0)
    width = width + 2 * noise_deg * rng.standard_normal(v.size)
    scattered = force + 5.0 * rng.standard_normal(v.size) if measured else None
    return EdgeTimes(
        "log", "acceleration", RADIUS_M, True, time, v, a, shift, shift, width, 2 * se, shift, se,
        np.where(np.abs(a) < 0.01, 0, -1), none_of(v.size), 10.0,
        forces_N={"longitudinal_force": scattered} if measured else {},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("trend_deg_s_m", "drive"),
    [
        *((trend, {"measured": known}) for trend in (0.0, 0.0115) for known in (True, False)),
        # a driven wheel carries drag at constant speed and none while it coasts
        (0.0, {"drive_s": 4.0, "measured": False}),
    ],
)
def test_the_part_linear_in_speed_is_covered_by_its_error(trend_deg_s_m, drive):
    """Delay and linear trend together."""
    true = DELAY_S + np.deg2rad(trend_deg_s_m) * RADIUS_M
    found = [calibrate([ramp(seed, trend_deg_s_m=trend_deg_s_m, **drive)]) for seed in SEEDS]
    delay, se = (np.array([getattr(c, name) for c in found]) for name in ("delay_s", "delay_se_s"))
    assert np.mean(np.abs(delay - true) < 2 * se) > 0.85
    assert np.median(se) < 0.05e-3 or "drive_s" in drive
    assert all(c.beside_force == drive["measured"] for c in found)


@pytest.mark.parametrize("measured", [True, False])
def test_a_drag_that_bends_is_in_the_error_of_the_delay(measured):
    """f1 / f2 of 1 to 11 m/s, at which a delay of 0.4 ms alone has f2 = 0."""
    straight = calibrate([ramp(SEEDS[0], measured=measured)])
    for number, bend_m_s in enumerate((1.0, 3.0, 5.0, 8.0, 11.0)):
        for seed in SEEDS[:3]:
            linear = bend_m_s * 1.2e-3  # 0.4 deg from 10 to 24 m/s by the quadratic part
            bent = ramp(seed + number, trend_deg_s_m=linear, bend_m_s=bend_m_s, measured=measured)
            found = calibrate([bent])
            assert abs(found.delay_s - DELAY_S) < 2.0 * found.delay_se_s, bend_m_s
            assert straight.delay_se_s < found.delay_se_s < 0.06e-3


def test_the_map_beside_the_force_leaves_the_force_in_the_shift():
    """Drag is a force: what remains of a drive at constant speed is its wind-up."""
    p = ramp(1, noise_deg=1e-3)
    left = clean_passages(p, calibrate([p]))["shift_deg"]
    force = p.forces_N["longitudinal_force"]
    slope = np.polyfit(force, left, 1)[0]
    assert slope == pytest.approx(WIND_UP, rel=0.02)
    assert np.std(left - slope * force - np.mean(left - slope * force)) < 0.01


def test_one_log_without_the_channel_leaves_the_force_out_for_all():
    both = calibrate([ramp(2), ramp(3, measured=False)])
    assert not both.beside_force
    lost = ramp(4)
    lost.forces_N["longitudinal_force"][5:9] = np.nan
    few = calibrate([lost])
    assert few.beside_force
    assert few.shift.passages == calibrate([ramp(4)]).shift.passages - 4
    lost.forces_N["longitudinal_force"][5:200] = np.nan
    assert not calibrate([lost]).beside_force


@pytest.mark.parametrize("measured", [True, False])
def test_the_sentence_says_what_cannot_be_told_apart_and_the_file_keeps_it(measured, tmp_path):
    learnt = calibrate([ramp(5, measured=measured)])
    write_calibration(tmp_path / "c.toml", learnt)
    again = read_calibration(tmp_path / "c.toml")
    assert again.beside_force == measured
    said = again.delay_remark
    assert said in again.remarks
    assert "any other trend linear in speed counts as delay" in said
    assert ("the measured longitudinal force is not in it" in said) == measured
    assert ("longitudinal_force channel in every log would make it smaller" in said) != measured
    assert "it is no force" not in said
    old = (tmp_path / "c.toml").read_text().replace("beside_force", "#")
    (tmp_path / "c.toml").write_text(old)
    assert not read_calibration(tmp_path / "c.toml").beside_force


def test_a_calibration_without_two_ways_still_has_a_map():
    up = ramp(6, coast_s=0.02, measured=False)
    climbing = replace(up, acceleration_m_s2=np.maximum(up.acceleration_m_s2, 0.0))
    assert calibrate([climbing]).shift.passages > 100
