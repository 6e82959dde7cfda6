"""Pressure and shear under traction against P2 (13), and a ring that is pulled along by the shear
itself.
"""

from dataclasses import replace

import numpy as np
import pytest

from tirelog.data.recording import Conditions
from tirelog.physics import Model, brush

PHI = np.linspace(-np.pi, np.pi, 97)[:-1] + 0.01
ONE = Conditions.of(1, speed_m_s=12.0, load_N=3400.0, acceleration_m_s2=0.0)


@pytest.mark.parametrize("carcass", ["beam", "ring"])
@pytest.mark.parametrize("sigma", [0.1, -0.3])
def test_pressure_and_shear_under_traction_are_told_apart(carcass, sigma):
    """P2 Fig. 10: the parabola stays what it is, and tau is P2 (13) beside it."""
    one = replace(ONE, slip=np.array([sigma]))
    base = Model.new(carcass, contact="prescribed")
    model = base.with_effect("traction", lever_m=0.018)
    F, R = one.load_N[0], base.values["radius_m"]
    L = 0.055 * (F / 3600.0) ** 0.5
    phi = np.linspace(-0.9, 0.9, 301) * L / R
    p, tau = (
        model.predict(one, phi, observable=name)[0]
        for name in ("contact_pressure", "shear_traction")
    )
    assert np.allclose(p, base.predict(one, phi, observable="contact_pressure")[0], rtol=1e-12)
    wanted = brush.traction(phi * R, np.array([F]), np.array([L]), np.array([sigma]))
    steep = (
        np.abs(phi * R - brush.transition(np.array([sigma]), np.array([L]))) < 0.06 * L
    )  # the jump at x_s ripples
    assert np.abs(tau - wanted)[~steep].max() < 0.02 * np.abs(wanted).max()
    assert np.sign(np.median(tau)) == np.sign(sigma)
    assert not base.predict(one, phi, observable="shear_traction").any()


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
