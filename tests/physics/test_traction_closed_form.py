"""Closed form: pressure and shear under traction against P2 (13) and a pulled ring."""

from dataclasses import replace

import numpy as np
import pytest

from tests.physics.brush_shear import traction
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
    wanted = traction(phi * R, np.array([F]), half, slip, grip)
    onset = pressure.transition(slip, half, grip.stiffness_ratio)  # the jump there ripples
    smooth = np.abs(phi * R - onset) > 0.06 * L
    assert np.abs(tau - wanted)[smooth].max() < 0.03 * np.abs(wanted).max()
    assert np.sign(np.median(tau)) == np.sign(sigma)
    assert not base.predict(one, phi, observable="shear_traction").any()


@pytest.mark.parametrize("grip", GRIPS)
@pytest.mark.parametrize("sigma", [0.05, -0.3, 0.9])
def test_the_modes_of_the_brush_are_those_of_its_shear(grip, sigma):
    """By a sum over P2 (13); (15): adhesion reaches f_s p where sliding begins."""
    F, L, R, slip = np.array([3400.0]), np.array([0.055]), 0.31, np.array([sigma])
    border, step = np.linspace(-L[0], L[0], 400_001, retstep=True)
    xi, gamma = border[1:] - 0.5 * step, 0.75 * F[0] / L[0] ** 3
    stiffness = 2.0 * gamma * L[0] * grip.static_friction * grip.stiffness_ratio
    held, p = abs(sigma) * stiffness * (xi + L[0]), gamma * (L[0] ** 2 - xi**2)
    slides = held > grip.static_friction * p
    tau = np.sign(sigma) * np.where(slides, grip.sliding_friction * p, held)
    onset = pressure.transition(slip, L, grip.stiffness_ratio)[0]
    assert onset == pytest.approx(xi[slides][0], abs=2.0 * step)
    modes = pressure.traction_modes(F[:, None], L[:, None], slip[:, None], R, grip)[0]
    for n in (0, 1, 7):
        whole = np.sum(tau * np.exp(-1j * n * xi / R)) * step / (2 * np.pi * R)
        assert modes[n] == pytest.approx(whole, rel=1e-4)


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
