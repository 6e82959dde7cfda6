"""Property: on a flat road the contact of a ring that takes power keeps the law of the springs, its
pressure leans to the entry edge, and without losses it is the even contact.
"""

from dataclasses import replace

import numpy as np
import pytest

from tirelog.data.recording import Conditions
from tirelog.physics import Model
from tirelog.physics.carcass.contact import (
    LOSSES,
    NONE,
    solve_contact,
)
from tirelog.physics.carcass.structures import RingCarcass, modal_impedance

R, STEP, SPIN = 0.3, 2 * np.pi / 3072, 60.0
CARCASS = RingCarcass(
    EI=2.0, k_w=6.3e5, k_v=6.3e5, c_w=0.0, c_v=0.0, pb=1.2e5 * 0.14, R=R, k_t=8.75e7
)
#: foundation of 540 N s/m^2 radially and 200 along, a loss of 0.15, a belt that lags by 20 us
DAMPED = (540.0 * SPIN, 200.0 * SPIN, 0.15 * 6.3e5, 2e-5 * SPIN * 2.0)


@pytest.mark.parametrize("load", [250.0, 3500.0, 6000.0])
def test_springs_press_just_as_deep_as_the_lagging_ring_under_them_lies(load):
    """By the ring's own modes with damping, without the solver's matrix."""
    losses = (DAMPED[0], DAMPED[1], 0.0, 0.0)
    contact = solve_contact(CARCASS, load, losses)
    assert contact.pressure_N_m.sum() * R * STEP == pytest.approx(load, rel=1e-9)
    assert contact.pressure_N_m.min() >= 0.0
    phi, p = np.arange(3072) * STEP, np.zeros(3072)
    p[contact.on] = contact.pressure_N_m
    n = np.arange(1537.0)
    damped = modal_impedance(n, replace(CARCASS, c_w=540.0, c_v=200.0), SPIN)
    q_v, q_w = np.fft.rfft(p * np.sin(phi)), np.fft.rfft(-p * np.cos(phi))
    modes = (q_v + 1j * n * q_w) / damped
    v, w = np.fft.irfft(modes), np.fft.irfft(-1j * n * modes)
    lies = -R + (R + w) * np.cos(phi) - v * np.sin(phi)
    first = contact.on[0]
    depth = lies + p[first] / CARCASS.k_t - lies[first]
    below = np.abs(np.arctan2(np.sin(phi), np.cos(phi))) < 0.8
    pressed = CARCASS.k_t * np.maximum(depth, 0.0)[below]
    assert np.allclose(pressed, p[below], atol=1e-7 * p.max())


def test_without_losses_it_is_the_even_contact():
    lossy, even = (solve_contact(CARCASS, 3500.0, losses) for losses in (NONE, ()))
    assert np.allclose(lossy.pressure_N_m, even.pressure_N_m, rtol=0.0, atol=1e-7 * 3e4)
    assert lossy.half_length_m == pytest.approx(even.half_length_m, rel=1e-9)


@pytest.mark.parametrize("which", range(len(LOSSES)))
def test_every_loss_makes_the_pressure_lean_to_the_entry_edge(which):
    """What takes power needs a moment that brakes: more pressure where the tread arrives."""
    losses = tuple(x if i == which else 0.0 for i, x in enumerate(DAMPED))
    contact = solve_contact(CARCASS, 3500.0, losses)
    assert contact.pressure_N_m @ contact.on < 0.0


def test_rows_of_other_speeds_are_a_step_away_to_its_square():
    """Contacts are solved at one row's losses; of what losses do, the others miss 3 % at most at
    two thirds and four thirds of that speed, and a quarter of it at half the distance."""
    phi = np.linspace(-0.5, 0.5, 401)
    plain = Model.new("ring", radius_m=R, load_N=3500.0)
    model = plain.with_effect("viscous_damping", damping_rate_1_s=90.0)

    def missed(speeds):
        conditions = Conditions.of(3, speed_m_s=speeds)
        many, without = model.predict(conditions, phi), plain.predict(conditions, phi)
        alone = [model.predict(conditions.take(slice(i, i + 1)), phi)[0] for i in (0, 2)]
        off, whole = many[[0, 2]] - alone, alone - without[[0, 2]]
        return np.linalg.norm(off, axis=1) / np.linalg.norm(whole, axis=1)

    far, near = missed([12.0, 18.0, 24.0]), missed([15.0, 18.0, 21.0])
    assert far.max() < 0.03
    assert np.all(near < 0.5 * far)
