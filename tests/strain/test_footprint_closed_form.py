"""Closed form: forms of the footprint by their equations, edges and least values of known curves,
and windows.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import eval_legendre, spherical_jn

from tirelog.data.recording import Channel, TimeAxis
from tirelog.strain.footprint.family import (
    ORDERS,
    SHAPES,
    EdgeFamily,
    EdgeShape,
    spherical_bessel,
)
from tirelog.strain.footprint.learn import gather_windows
from tirelog.strain.footprint.measure import find_edges, least


@pytest.mark.parametrize("z", [0.02, 0.9, 3.2, 4.4934, 15.9, 16.1, 60.0])
def test_spherical_bessel_functions(z):
    found = np.empty(ORDERS)
    spherical_bessel(z, found)
    np.testing.assert_allclose(found, spherical_jn(np.arange(ORDERS), z), rtol=1e-9, atol=1e-300)


def test_a_spectrum_fulfils_the_contact():
    """p = k_t (delta - xi^2 / 2R - w) inside the patch: the pressure that the spectrum holds, with
    what it does to a carcass (foundation one, in the equation's own units), adds up to a parabola.
    """
    family, shape = (
        EdgeFamily(0.305, 900.0),
        EdgeShape(0.055, 0.04, 0.4, 1.5, 0.0, 0.0),
    )
    L, ell, kappa = shape.half_length_m, shape.bending_length_m, family.kappa_1_m
    wave, terms = kappa * L, np.arange(0, 14, 2)
    transforms = np.column_stack([by_quadrature(n, wave) for n in terms])
    pressure = (family.spectrum(shape) / family.receptance(shape)).real / L
    series = np.linalg.lstsq(transforms, pressure, rcond=None)[0]
    np.testing.assert_allclose(transforms @ series, pressure, atol=1e-8 * np.abs(pressure).max())
    square = kappa**2
    stiffness = ell**4 * square**2 + shape.tension * ell**2 * square + 1.0
    x = np.linspace(0.0, 0.9, 10)
    displacement = (
        L / (np.pi * 0.305) * np.cos(np.multiply.outer(x, wave)) @ (transforms @ series / stiffness)
    )
    load = (1.0 - x**2) * sum(c * eval_legendre(n, x) for n, c in zip(terms, series, strict=True))
    parabola = load + np.expm1(shape.tread) * displacement
    assert np.ptp(parabola - np.polyval(np.polyfit(x**2, parabola, 1), x**2)) < 1e-3 * np.ptp(
        parabola
    )
    assert np.polyfit(x**2, parabola, 1)[0] == pytest.approx(-1.0, rel=2e-3)


def by_quadrature(order: int, wave: np.ndarray) -> np.ndarray:
    """Transform of (1 - x^2) P_n(x) over the patch."""
    return np.array(
        [
            2.0
            * quad(lambda x: (1 - x**2) * eval_legendre(order, x), 0, 1, weight="cos", wvar=z)[0]
            for z in wave
        ]
    )


def assert_slopes(spectrum, at, slopes):
    """The columns of `slopes` are what `spectrum` changes by with each number of `at`."""
    for number, nudge in enumerate(1e-6 * np.eye(at.size)):
        ahead, behind = (spectrum(at + sign * nudge) for sign in (1, -1))
        slope = slopes[:, number]
        np.testing.assert_allclose((ahead - behind) / 2e-6, slope, atol=2e-6 * np.abs(slope).max())


def test_slopes_of_a_spectrum_are_differences():
    family, shape = EdgeFamily(0.305, 900.0), EdgeShape(0.055, 0.04, 0.4, 1.5, 0.2, -0.1)
    slopes = family.jacobian(shape)[:, 1:]
    assert_slopes(lambda values: family.spectrum(EdgeShape.of(values)), shape.array(), slopes)


def test_a_tire_s_own_pressure_and_stiffness():
    """Shapes times the mean pressure on a parabola's carcass that is stiffer by wavelength, and
    what the spectrum changes by with each of them.
    """
    rng, shape = np.random.default_rng(907), EdgeShape(0.055, 0.04, 0.4, 0.0, 0.2, -0.1)
    plain = EdgeFamily(0.305, 600.0)
    own = np.zeros(plain.own.size)
    own[:SHAPES] = rng.normal(scale=0.1, size=SHAPES)
    wave = plain.kappa_1_m * shape.half_length_m
    x, weights = np.polynomial.legendre.leggauss(300)
    legendre = [eval_legendre(n, x) for n in range(15)]
    even = [legendre[n - 1] - legendre[n + 1] for n in (3, 5, 7, 9, 11, 13)]
    shapes = np.array([*even, legendre[2], legendre[3] - legendre[5], -legendre[1]])
    pressure = (1 - x**2) * (1 - shape.tilt * x) + 2 / 3 * own[:SHAPES] @ shapes
    transform = np.exp(-1j * np.multiply.outer(wave, x)) @ (weights * pressure)
    family = plain.with_own(own)
    load = family.spectrum(shape) / family.receptance(shape) / shape.half_length_m
    np.testing.assert_allclose(load, transform, atol=1e-9)
    own[SHAPES:] = 0.1
    softer = plain.with_own(own).receptance(shape) / plain.receptance(shape)
    assert np.all(np.abs(softer[20:60]) < 1.0)
    spectra = plain.with_own(own).by_form(shape)
    assert_slopes(lambda values: plain.with_own(values).spectrum(shape), own, spectra[:, 7:])


def test_the_least_of_a_row_between_samples():
    x = np.arange(40.0)
    rows = np.stack([0.3 * (x - 17.3) ** 2 - 2.0, x, -((x - 17.3) ** 2)])
    place, height, curvature = least(rows, np.full(3, 10.2), np.full(3, 25.0))
    assert (place[0], height[0], curvature[0]) == pytest.approx((17.3, -2.0, 0.6))
    assert np.isnan(place[1])
    assert np.isnan(curvature[2])


@pytest.mark.parametrize(("columns", "off"), [(6.0, 0.005), (8.0, 0.0016), (16.0, 0.00012)])
def test_the_least_of_a_wave_lies_where_it_is(columns, off):
    """A wave of so many columns a period, wherever its trough lies between two of them; a parabola
    is off by 0.019 at six.
    """
    trough, omega = np.linspace(19.0, 20.0, 21), 2 * np.pi / columns
    rows = -np.cos(omega * (np.arange(40.0) - trough[:, None]))
    place, height, curvature = least(rows, trough - 0.6 * columns, trough + 0.6 * columns)
    np.testing.assert_allclose(place, trough, atol=off)
    np.testing.assert_allclose(height, -1.0, atol=1.3 * off)
    np.testing.assert_allclose(curvature, omega**2, rtol=10 * off)


def test_edges_of_a_known_curve():
    """Two humps of the slope with their centres told: the extrema of the derivatives of two tanh
    steps.
    """
    rate, speed, at = 25_000.0, np.array([10.0]), 0.05
    time = (np.arange(1024) - 512.3) / rate
    xi = 10.0 * time
    values = (0.5 * (np.tanh((xi - at) / 0.01) - np.tanh((xi + at) / 0.01)))[None]
    one = np.ones(1)
    found = find_edges(
        values, rate, 512.3 * one, speed, 0.0 * one, 9000.0 * one, 0.05 * one, 1e-6, 2
    )
    assert found["length_d1_m"][0] == pytest.approx(2 * at, rel=1e-4)
    # the bend of tanh is sharpest where tanh^2 = 1/3, outside of its centre
    assert found["length_d2_m"][0] == pytest.approx(
        2 * (at + 0.01 * np.arctanh(np.sqrt(1 / 3))), rel=1e-4
    )
    assert found["entry_height"][0] == pytest.approx(found["exit_height"][0], rel=1e-3)


def test_windows_are_the_samples_around_and_end_at_gaps():
    values = np.arange(1000.0)
    axis = TimeAxis(1000, 2500.0, np.array([0, 600]), np.array([0.0, 9.0]), np.array([4e-4, 4e-4]))
    channel = Channel.of_array("s", "strain", values, axis)
    index = np.array([3.2, 300.4, 597.0, 603.0, 998.0])
    (found,) = gather_windows(channel, 1.0, index, (index, index), np.full(5, 16.0), np.arange(5))
    for row, at in enumerate(np.round(index).astype(int)):
        own = np.arange(at - 16, at + 16)
        inside = (own >= 0) & (own < 1000) & ((own < 600) == (at < 600))
        np.testing.assert_array_equal(
            found.values[row], np.where(inside, -own.astype(float), np.nan)
        )
        assert found.motion["centre"][row] == pytest.approx(index[row] - at + 16)
