"""Literature: P4 sections IV and V on drives with known forces (rear-wheel drive)."""

from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.wheel.phase_truth import (
    DYNAMIC,
    RADIUS_M,
    RAMP,
    RATE_HZ,
    Drive,
    Encoder,
    Tread,
    recording,
)
from tirelog.simulation.scenario.schema import scenario_of
from tirelog.simulation.simulate import simulate, to_recording
from tirelog.wheel.angle import encoder_of
from tirelog.wheel.calibration import calibrate, clean_passages
from tirelog.wheel.phase_shift import measure_phase_shift

pytestmark = pytest.mark.xdist_group("four corners")  # one worker makes what these tests share

MASS_KG, HEIGHT_OVER_BASE = 1500.0, 0.2
STATIC_N = {"front": 3700.0, "rear": 3650.0}
WIDTH_DEG = {2.0: 25.0, 1.6: 26.4}  # P4 Fig. 10: about 25 degrees, slightly more at low pressure
WIND_UP_DEG_N = 3.0e-4
CROSSTALK = 0.12


def vertical(wheel, a):
    return STATIC_N[wheel] + (1 if wheel == "rear" else -1) * MASS_KG * a * HEIGHT_OVER_BASE / 2


def longitudinal(wheel, a):
    """Drive on the rear wheels only, brakes on all four."""
    driving = MASS_KG * a / 2 if wheel == "rear" else 0.0 * a
    return np.where(a > 0, driving, MASS_KG * a * (0.2 if wheel == "rear" else 0.3))


def tread(wheel, bar, seed, noise_g=1.2):
    def width(v, a):
        return (
            WIDTH_DEG[bar] * np.sqrt(vertical(wheel, a) / STATIC_N[wheel])
            - 0.045 * (v - 10)
            - 0.001 * (v - 10) ** 2
        )

    def shift(v, a):
        load = WIDTH_DEG[bar] * (np.sqrt(vertical(wheel, a) / STATIC_N[wheel]) - 1)
        return (
            WIND_UP_DEG_N * longitudinal(wheel, a)
            + 0.02 * (v - 10)
            + 0.002 * (v - 10) ** 2
            - CROSSTALK * load
        )

    return Tread(shift=shift, width=width, seed=seed, noise_g=noise_g)


@cache
def drive(wheel, bar, seed, corners=DYNAMIC):
    """The passages of a wheel on a drive."""
    road = Drive(*corners)
    found = recording(
        road,
        Encoder(seed=seed).signal(road),
        tread(wheel, bar, seed).signal(road),
        driven=str(wheel == "rear").lower(),
    )
    return next(measure_phase_shift(found))


#: what is shown is of other drives than the calibration
SEEDS = {"front": 32_000, "rear": 33_000}
#: phases of the drive [s]
PHASES = {
    "low": (0.5, 7.5),
    "accelerating": (8.3, 12.7),
    "high": (13.5, 20.5),
    "braking": (21.2, 23.3),
}


@pytest.fixture(scope="module")
def calibration():
    """From both wheels' quasi-static tests and the front wheel's dynamic one."""
    roads = [("front", 31_000, RAMP), ("rear", 31_100, RAMP)]
    roads += [("front", 31_200, DYNAMIC), ("rear", 31_300, DYNAMIC)]
    return calibrate([drive(wheel, 2.0, seed, road) for wheel, seed, road in roads])


def within(passages, phase):
    start, stop = PHASES[phase]
    return (passages.time_s > start) & (passages.time_s < stop) & passages.good


@pytest.fixture(scope="module", params=[2.0, 1.6])
def results(request, calibration):
    """(pressure [bar], {(wheel, phase): (corrected shift, detrended width)}) of a dynamic test."""
    found = {}
    for wheel, seed in SEEDS.items():
        passages = drive(wheel, request.param, seed)
        cleaned = clean_passages(passages, calibration)
        for phase in PHASES:
            rows = within(passages, phase)
            values = cleaned["corrected_deg"][rows], cleaned["width_deg"][rows]
            found[wheel, phase] = tuple(map(np.mean, values))
    return request.param, found


def usual_width(found, wheel):
    return 0.5 * (found[wheel, "low"][1] + found[wheel, "high"][1])


# ---- section V: phases, noise and pressure ---------------------------------------


@pytest.mark.parametrize(
    ("wheel", "phase", "acceleration", "wider_deg"),
    [
        ("front", "accelerating", 2.4, -0.3),
        ("rear", "accelerating", 2.4, 0.3),
        ("front", "braking", -4.8, 0.5),
        # errata: the rear wheel's F_z and width fall below the mean (printed with the wrong sign)
        ("rear", "braking", -4.8, -0.5),
    ],
)
def test_a_driven_wheel_shifts_forwards_a_braked_one_back_and_a_loaded_one_is_wider(
    results, wheel, phase, acceleration, wider_deg
):
    """The front wheel, which nothing drives, has no shift in acceleration."""
    _, found = results
    shift, width = found[wheel, phase]
    expected = WIND_UP_DEG_N * float(longitudinal(wheel, np.array(acceleration)))
    assert shift == pytest.approx(expected, abs=0.04 if phase == "braking" else 0.03)
    assert expected == 0.0 or shift / np.sign(expected) > 0.3
    assert (width - usual_width(found, wheel)) / wider_deg > 1.0


def test_noise_depends_on_the_forward_speed():
    """Section V: noises of two windows differ "simply due to the change of the forward speed"."""
    passages = drive("rear", 2.0, SEEDS["rear"])
    low, high = (np.median(passages.width_se_deg[within(passages, n)]) for n in ("low", "high"))
    assert low > 1.5 * high


def test_low_pressure_is_slightly_wider_and_varies_like_nominal_pressure(calibration):
    """With the same calibration; the variations in shift and width are very similar."""
    widths, variations = [], []
    for bar in (2.0, 1.6):
        passages = drive("front", bar, SEEDS["front"])
        cleaned = clean_passages(passages, calibration)
        braking, calm = within(passages, "braking"), passages.steady >= 0
        widths.append(np.mean(cleaned["width_deg"][calm]))
        values = cleaned["corrected_deg"], cleaned["width_deg"]
        variations.append([np.mean(x[braking]) - np.mean(x[calm]) for x in values])
    assert widths[1] - widths[0] == pytest.approx(1.4, abs=0.05)
    np.testing.assert_allclose(*variations, rtol=0.1, atol=0.03)


# ---- section IV -------------------------------------------------------------------


def test_after_trend_removal_every_constant_speed_has_the_same_values(results):
    """Section IV C: phase shift 0 and one width (25 degrees at 2.0 bar) at constant speeds."""
    bar, found = results
    for wheel in SEEDS:
        for phase in ("low", "high"):
            assert abs(found[wheel, phase][0]) < 0.03
            assert abs(found[wheel, phase][1] - found[wheel, "low"][1]) < 0.05
    if bar == 2.0:
        # the half-level front of this flank lies 0.4 degree outside of the edge: a constant
        assert usual_width(found, "front") == pytest.approx(25.0, abs=1.5)


def test_the_crosstalk_of_equation_3_is_found_within_its_error_and_the_maps_range(calibration):
    assert abs(calibration.crosstalk - CROSSTALK) < 4 * calibration.crosstalk_se
    assert calibration.crosstalk_se < 0.03
    assert calibration.shift.low_m_s == pytest.approx(10, abs=0.2)
    assert calibration.shift.high_m_s == pytest.approx(25, abs=0.2)


def test_without_equation_3_the_front_wheel_would_seem_driven(calibration):
    """Fig. 11: before the correction the front wheel's shift in acceleration is not zero."""
    passages = drive("front", 2.0, SEEDS["front"])
    cleaned = clean_passages(passages, calibration)
    driving = within(passages, "accelerating")
    assert np.mean(cleaned["shift_deg"][driving]) > 0.08
    assert abs(np.mean(cleaned["corrected_deg"][driving])) < 0.03


@pytest.mark.parametrize("road_noise", [0.0, 10.0])
def test_what_the_road_makes_of_it_is_noisier_at_the_higher_speed(road_noise):
    """Section V, of a simulated ring: the width and the shift scatter more at 22 m/s than at 10 if
    the road shakes the sensor, and not by the sensor's own noise.
    """
    steps = [(24.0, 10.0), (5.0, 22.0), (10.0, 22.0)]
    scenario = scenario_of(
        {
            "seed": 4, "truth": "ring",
            "manoeuvres": [{"duration_s": t, "speed_m_s": v} for t, v in steps],
            "channels": {
                "a": {
                    "kind": "radial_acceleration", "source": "a", "sampling_rate_Hz": 1e4,
                    "noise": 1.2, "road_noise": road_noise,
                },
                "e": {"kind": "wheel_encoder", "source": "e", "sampling_rate_Hz": 1e4},
            },
        }
    )  # fmt: skip
    (passages,) = measure_phase_shift(to_recording(simulate(scenario)))
    low, high = (
        passages.good & (np.abs(passages.speed_m_s - speed) < 0.1) for speed in (10.0, 22.0)
    )
    for values in (passages.width_deg, passages.shift_deg):
        assert (np.std(values[high]) > 1.15 * np.std(values[low])) == (road_noise > 0.0)


def quinn_fernandes(values):
    """Frequency [rad/sample] of a sinusoid (n,): P4's [17], begun by the formula of its [20]."""
    first, second = (values[k:] @ values[:-k] / (values.size - k) for k in (1, 2))
    alpha = (second + np.sqrt(second**2 + 8 * first**2)) / (2 * first)
    for step in range(8):
        xi = lfilter([1.0], [1.0, -alpha, 1.0], values)
        beta = (xi[2:] + xi[:-2]) @ xi[1:-1] / (xi[1:-1] @ xi[1:-1])
        alpha = beta if step > 2 else 2 * beta - alpha
    return np.arccos(alpha / 2)


@pytest.mark.parametrize("pitch_deg", [0.0, 0.4])
def test_the_speed_is_as_good_as_any_tracker_of_frequency_could_be(pitch_deg):
    """Section IV A: trackers on windows that are a low-pass at 20 Hz. None of those without a bias
    has a variance below 24 sigma^2 / (A^2 N^3) (Cramer and Rao); P4's also see the uneven teeth.
    """
    driven = Drive((0, 20), (10, 10))
    signal = Encoder(pitch_deg=pitch_deg, noise=0.02).signal(driven)
    wheel = encoder_of(recording(driven, signal))[1]
    length = round(0.443 / 20 * RATE_HZ)
    windows = signal[: signal.size // length * length].reshape(-1, length)
    middle_s = ((np.arange(len(windows)) + 0.5) * length - 0.5) / RATE_HZ
    by_tracker = [quinn_fernandes(one - one.mean()) * RATE_HZ / 48 for one in windows]
    inside = slice(5, -5)
    tracked, ours = (
        RADIUS_M * np.std(speed[inside] - 10 / RADIUS_M)
        for speed in (np.array(by_tracker), wheel.speed_rad_s(middle_s))
    )
    least = RADIUS_M * np.sqrt(24 * 0.02**2 / length**3) * RATE_HZ / 48
    assert ours < 1.2 * least
    assert tracked > 10 * ours


# ---- section VI -------------------------------------------------------------------


def curve(bends, load_N=3434.0):
    """Passages 0.05 m left and right of the middle of a belt that leans 1.5 degrees per g."""
    sides = {"left": 0.05, "right": -0.05}
    channels = {
        name: {
            "kind": "radial_acceleration", "source": name, "sampling_rate_Hz": 1e4, "noise": 1.2,
            "lateral_m": y, "angle_deg": 60.0 * (y > 0.0),
        }
        for name, y in sides.items()
    }  # fmt: skip
    channels["e"] = {"kind": "wheel_encoder", "source": "e", "sampling_rate_Hz": 1e4}
    driven = [{"duration_s": 6.0, "speed_m_s": 12.0, "lateral_m_s2": a} for a in bends]
    known = {"seed": 46, "truth": "ring", "conditions": {"load_N": load_N}}
    known |= {"vehicle": {"roll_deg_per_g": 1.5}, "manoeuvres": driven, "channels": channels}
    return list(measure_phase_shift(to_recording(simulate(scenario_of(known)))))


def width_about(passages, middle_s):
    """Mean width and its error [deg] of the good passages within 1.5 s."""
    width = passages.width_deg[passages.good & (np.abs(passages.time_s - middle_s) < 1.5)]
    assert len(width) > 15
    return np.mean(width), np.std(width) / np.sqrt(len(width))


def test_in_a_curve_the_two_sides_of_the_tread_meet_unlike_patches():
    """Section VI leaves curves to later work. At y from the middle a belt that leans is deeper in
    the road by y sin(lean), of d = L^2 / 2R, and is as wide as straight on under that more of load.
    """
    more = 0.05 * np.sin(np.radians(1.5 * 4.0 / 9.81)) / (0.058**2 / (2.0 * 0.305))
    left, right = curve((0.0, 4.0, -4.0))
    for passages, middle_s in ((left, 9.5), (right, 15.5)):
        (light, error), (heavy, other) = width_about(passages, 3.5), width_about(passages, middle_s)
        assert heavy - light > 10.0 * np.hypot(error, other)
        as_heavy, _ = width_about(curve((0.0,), 3434.0 * (1.0 + more))[0], 3.5)
        assert heavy - light == pytest.approx(as_heavy - light, rel=0.2)
    for passages, middle_s in ((left, 15.5), (right, 9.5)):
        (light, error), (heavy, other) = width_about(passages, middle_s), width_about(passages, 3.5)
        assert heavy - light > 10.0 * np.hypot(error, other)
