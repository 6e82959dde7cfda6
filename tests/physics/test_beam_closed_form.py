"""Closed form: the beam against its exact roots; what an accelerometer's band makes of a ride."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from tests.physics.beam_roots import exact_displacement
from tirelog.data.recording import Conditions
from tirelog.errors import ModelError
from tirelog.physics import Model
from tirelog.physics.carcass.structures import critical_speed
from tirelog.physics.spectral import Angles

EJ, K, MU, L, Y, F, R = 4.0, 2.0e6, 4.5, 0.055, 3e-4, 3600.0, 0.3126
BEAM = Model.new("beam", radius_m=R)
PHI = np.linspace(-np.pi, np.pi, 2503)[:-1]


def strain(speed, damping, surface="inner"):
    model = BEAM.with_effect("viscous_damping", damping_rate_1_s=damping)
    return model.predict(Conditions.of(1, speed_m_s=speed), PHI, surface=surface)[0]


def exact(speed, damping, derivative, x=R * PHI):
    return exact_displacement(
        x, load_N=F, half_length_m=L, circumference_m=2 * np.pi * R, flexural_stiffness_N_m2=EJ,
        foundation_stiffness_N_m2=K, line_mass_kg_m=MU, speed_m_s=speed, damping_rate_1_s=damping,
        derivative=derivative,
    )  # fmt: skip


@pytest.mark.parametrize("damping", [0.0, 5.0, 400.0])
@pytest.mark.parametrize("share", [0.01, 0.3, 0.8, 0.95])
def test_strain_and_displacement_follow_the_exact_roots(share, damping):
    speed = share * critical_speed(EJ, K, MU)
    wanted = -Y * exact(speed, damping, 2)
    assert np.abs(strain(speed, damping) - wanted).max() < 1e-6 * np.abs(wanted).max()
    model = BEAM.with_effect("viscous_damping", damping_rate_1_s=damping)
    w = model.predict(Conditions.of(1, speed_m_s=speed), PHI, observable="displacement")[0]
    wanted = exact(speed, damping, 0)
    assert np.abs(w - wanted).max() < 1e-7 * np.abs(wanted).max()


def test_bins_with_a_variance_read_the_mean_over_their_samples():
    phi, spread = np.array([-0.21, 0.02, 0.15]), 0.01
    samples = np.linspace(-1.0, 1.0, 2001) * spread
    conditions = Conditions.of(1, speed_m_s=12.0)
    mean = np.array([BEAM.predict(conditions, p + samples)[0].mean() for p in phi])
    got = BEAM.predict(conditions, Angles(phi, np.full(3, samples.var())))[0]
    plain = BEAM.predict(conditions, phi)[0]
    assert np.abs(got - mean).max() < 0.02 * np.abs(plain - mean).max()


@pytest.mark.parametrize("ahead", [0.0, 4.0, -6.0])
def test_radial_acceleration_is_the_specific_force_at_a_point_of_the_tread(ahead):
    """A point at (R + w) e_r + v e_t, v' = -w, differenced twice in time, less gravity."""
    speed, step, g = 12.0, 2e-3, 9.80665
    omega = speed / R
    model = Model.new("beam", "radial_acceleration", radius_m=R, load_N=20.0)
    conditions = Conditions.of(1, speed_m_s=speed, acceleration_m_s2=ahead)
    phi = np.arange(-np.pi, np.pi, step)
    w = -model.predict(conditions, phi, observable="displacement")[0]
    v = -np.cumsum(w - w.mean()) * step + 0.5 * step * (w - w.mean())
    outwards = np.sin(phi) - 1j * np.cos(phi)  # straight down at the patch centre
    time = phi / omega
    place = -(speed * time + 0.5 * ahead * time**2) + (R + w + 1j * v) * outwards
    second = (place[:-2] - 2 * place[1:-1] + place[2:]) / (step / omega) ** 2
    outward = ((second + 1j * g) * np.conj(outwards[1:-1])).real
    middle = slice(1000, -1000)
    level = 2 * omega**2 * w.mean()  # the mean of w that an inextensible belt would not have
    got = model.predict(conditions, phi)[0][1:-1]
    assert np.abs(got - outward - level)[middle].max() < 2e-3 * np.ptp(outward[middle])
    frame = model.predict(conditions, phi, observable="frame_acceleration")[0]
    assert np.allclose(frame, -g * np.cos(phi) - ahead * np.sin(phi), atol=1e-5)


def test_above_the_critical_speed_the_beam_refuses():
    limit = critical_speed(EJ, K, MU)
    strain(0.999 * limit, 0.0)
    with pytest.raises(ModelError, match=r"critical speed 35\.46 m/s"):
        strain(1.001 * limit, 0.0)
    tension = BEAM.with_effect("belt_tension", tension_N=500.0)
    tension.predict(Conditions.of(1, speed_m_s=1.001 * limit), PHI)


RADIUS_M, SPEED_M_S, SAMPLES = 0.3, 20.0, 4096
RING = {"radius_m": RADIUS_M, "width_m": 0.14, "load_N": 3500.0}
RATE_HZ = SAMPLES * SPEED_M_S / (2 * np.pi * RADIUS_M)
AROUND = (np.arange(SAMPLES) + 0.5) / SAMPLES * 2 * np.pi - np.pi


def read(phi=AROUND, acceleration=0.0, **values):
    model = Model.new("ring", "radial_acceleration", **RING, **values)
    conditions = Conditions.of(1, speed_m_s=SPEED_M_S, acceleration_m_s2=acceleration)
    return model.predict(conditions, phi)[0]


def in_time(b, a, turns):
    """The last of many turns through a filter."""
    return lfilter(b, a, np.tile(read(), turns))[-SAMPLES:]


def test_a_low_pass_is_a_second_order_butterworth_without_its_delay():
    cut_Hz = 200.0
    filtered = in_time(*butter(2, cut_Hz, fs=RATE_HZ), turns=4)
    delay = np.sqrt(2.0) / (2 * np.pi * cut_Hz) * SPEED_M_S / RADIUS_M  # [rad]
    early = np.interp(AROUND + delay, AROUND, filtered, period=2 * np.pi)
    made = read(bandwidth_Hz=cut_Hz)
    unfiltered = read()
    assert np.abs(made - early).max() < 2e-4 * np.ptp(unfiltered)
    assert np.abs(made - unfiltered).max() > 0.05 * np.ptp(unfiltered)


def test_a_high_pass_takes_the_level_and_tilts_what_is_left():
    cut_Hz = 2.0
    filtered = in_time(*butter(1, cut_Hz, "high", fs=RATE_HZ), turns=40)
    made = read(coupling_Hz=cut_Hz)
    assert np.abs(made - filtered).max() < 1e-3 * np.ptp(filtered)
    assert abs(made.mean()) < 1e-6 * np.ptp(made)
    assert np.ptp(made - read()) > 0.03 * np.ptp(made)  # no mere offset


def test_a_level_that_falls_slowly_leaves_its_slope():
    """-v^2/R through i w tau / (1 + i w tau) is tau d/dt of it, while that changes slowly."""
    cut_Hz, acceleration = 5.0, -1.5
    still, braking = (read(coupling_Hz=cut_Hz, acceleration=a).mean() for a in (0.0, acceleration))
    slope = -2.0 * SPEED_M_S * acceleration / RADIUS_M / (2 * np.pi * cut_Hz)
    assert braking - still == pytest.approx(slope, rel=1e-9)


def test_no_band_is_the_model_as_ever():
    assert np.array_equal(read(), read(bandwidth_Hz=1e6, coupling_Hz=0.0))
