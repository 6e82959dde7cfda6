"""Closed form: pressure and shear under traction against P2 (13), and a ring that is pulled along
by the shear itself.
"""

from dataclasses import replace

import numpy as np
import pytest

from tirelog.data.recording import Conditions
from tirelog.physics import Model, pressure

PHI = np.linspace(-np.pi, np.pi, 97)[:-1] + 0.01
ONE = Conditions.of(1, speed_m_s=12.0, load_N=3400.0, acceleration_m_s2=0.0)


GRIPS = [pressure.Grip(), pressure.Grip(1.1, 0.7, 4.0), pressure.Grip(0.3, 0.3, 0.5)]


@pytest.mark.parametrize("carcass", ["beam", "ring"])
@pytest.mark.parametrize(("sigma", "grip"), [(0.1, GRIPS[0]), (-0.3, GRIPS[1]), (0.05, GRIPS[2])])
def test_pressure_and_shear_under_traction_are_told_apart(carcass, sigma, grip):
    """P2 Fig. 10: the parabola stays what it is, and tau is P2 (13) beside it."""
    one = replace(ONE, slip=np.array([sigma]))
    base = Model.new(carcass, contact="prescribed")
    model = base.with_effect(
        "traction",
        lever_m=0.018,
        static_friction=grip.static_friction,
        sliding_friction=grip.sliding_friction,
        slip_stiffness_ratio=grip.stiffness_ratio,
    )
    F, R = one.load_N[0], base.values["radius_m"]
    L = 0.055 * (F / 3600.0) ** 0.5
    phi = np.linspace(-0.9, 0.9, 301) * L / R
    p, tau = (
        model.predict(one, phi, observable=name)[0]
        for name in ("contact_pressure", "shear_traction")
    )
    assert np.allclose(p, base.predict(one, phi, observable="contact_pressure")[0], rtol=1e-12)
    slip, half = np.array([sigma]), np.array([L])
    wanted = pressure.traction(phi * R, np.array([F]), half, slip, grip)
    onset = pressure.transition(slip, half, grip.stiffness_ratio)  # the jump there ripples
    smooth = np.abs(phi * R - onset) > 0.06 * L
    assert np.abs(tau - wanted)[smooth].max() < 0.03 * np.abs(wanted).max()
    assert np.sign(np.median(tau)) == np.sign(sigma)
    assert not base.predict(one, phi, observable="shear_traction").any()


@pytest.mark.parametrize("grip", GRIPS)
@pytest.mark.parametrize("sigma", [0.05, -0.3, 0.9])
def test_friction_and_slip_stiffness_are_those_of_the_brush(grip, sigma):
    """(15): adhesion reaches f_s p at x_s; and the modes are those of tau(xi), by quadrature."""
    F, L, R = np.array([[3400.0]]), np.array([[0.055]]), 0.31
    gamma, s = 0.75 * F / L**3, np.array([[sigma]])
    x_s = pressure.transition(s, L, grip.stiffness_ratio)
    stiffness = grip.stiffness_ratio * pressure.slip_stiffness(F, L, grip.static_friction)
    if x_s > -L:
        held = abs(sigma) * stiffness * (x_s + L)
        assert held == pytest.approx(grip.static_friction * gamma * (L**2 - x_s**2))
        assert abs(sigma) == pytest.approx((L - x_s) * gamma * grip.static_friction / stiffness)
    pieces = [np.linspace(-L[0, 0], x_s[0, 0], 40001), np.linspace(x_s[0, 0], L[0, 0], 40001)]
    modes = pressure.traction_modes(F, L, s, R, grip)[0]
    for n in (0, 1, 7):
        whole = 0.0
        for number, xi in enumerate(pieces):
            if xi[-1] > xi[0]:
                inside = 0.5 * (xi[1:] + xi[:-1])
                if number == 0:
                    tau = sigma * stiffness[0, 0] * (inside + L[0, 0])
                else:
                    tau = np.sign(sigma) * grip.sliding_friction * gamma[0, 0]
                    tau = tau * (L[0, 0] ** 2 - inside**2)
                whole = whole + np.sum(tau * np.exp(-1j * n * inside / R)) * (xi[1] - xi[0])
        assert modes[n] == pytest.approx(whole / (2 * np.pi * R), rel=1e-6, abs=1e-6)


def test_a_ring_is_pulled_by_the_road_whatever_the_lever():
    one = replace(ONE, slip=np.array([0.2]))
    base = Model.new("ring", contact="prescribed")
    free = base.predict(one, PHI)[0]
    none, hair, beam = (m.with_effect("traction", lever_m=h).predict(one, PHI)[0] for m, h in
                        ((base, 0.0), (base, 1e-9), (Model.new("beam"), 0.0)))  # fmt: skip
    assert (
        np.abs(none - hair).max()
        < 1e-5 * np.abs(free).max()
        < 1e-3 * np.abs(none - free).max() * 100.0
    )
    assert np.array_equal(beam, Model.new("beam").predict(one, PHI)[0])
