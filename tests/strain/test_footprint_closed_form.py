"""Closed form: forms of the footprint by their equations, and windows of samples."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import eval_legendre

from tirelog.data.recording import Channel, TimeAxis
from tirelog.strain.footprint.family import (
    SHAPES,
    EdgeFamily,
)
from tirelog.strain.footprint.measure import gather_windows


def test_a_spectrum_fulfils_the_contact():
    """p = k_t (delta - xi^2 / 2R - w) inside the patch: the pressure that the spectrum holds, with
    what it does to a carcass (foundation one, in the equation's own units), adds up to a parabola.
    """
    family, form = EdgeFamily(0.305, 900.0), np.array([[0.055, 0.04, 0.4, 1.5, 0.0, 0.0]])
    (L, ell, tension, tread, *_), kappa = form[0], family.kappa_1_m
    wave, terms = kappa * L, np.arange(0, 14, 2)
    transforms = np.column_stack([by_quadrature(n, wave) for n in terms])
    pressure = (family.spectra(form)[0, :, 0] / family.receptance(form)[0]).real / L
    series = np.linalg.lstsq(transforms, pressure, rcond=None)[0]
    np.testing.assert_allclose(transforms @ series, pressure, atol=1e-8 * np.abs(pressure).max())
    square = kappa**2
    stiffness = ell**4 * square**2 + tension * ell**2 * square + 1.0
    x = np.linspace(0.0, 0.9, 10)
    displacement = (
        L / (np.pi * 0.305) * np.cos(np.multiply.outer(x, wave)) @ (transforms @ series / stiffness)
    )
    load = (1.0 - x**2) * sum(c * eval_legendre(n, x) for n, c in zip(terms, series, strict=True))
    parabola = load + np.expm1(tread) * displacement
    line = np.polyfit(x**2, parabola, 1)
    assert np.ptp(parabola - np.polyval(line, x**2)) < 1e-3 * np.ptp(parabola)
    assert line[0] == pytest.approx(-1.0, rel=2e-3)


def by_quadrature(order, wave):
    """Transform of (1 - x^2) P_n(x) over the patch."""

    def term(x):
        return 2.0 * (1 - x**2) * eval_legendre(order, x)

    return np.array([quad(term, 0, 1, weight="cos", wvar=z)[0] for z in wave])


def test_a_tire_s_own_pressure_and_stiffness():
    """Shapes times the mean pressure on a parabola's carcass that is stiffer by wavelength, and
    what the spectrum changes by with each of them.
    """
    rng, form = np.random.default_rng(907), np.array([[0.055, 0.04, 0.4, 0.0, 0.2, -0.1]])
    plain = EdgeFamily(0.305, 600.0)
    own = np.zeros(plain.own.size)
    own[:SHAPES] = rng.normal(scale=0.1, size=SHAPES)
    wave = plain.kappa_1_m * form[0, 0]
    x, weights = np.polynomial.legendre.leggauss(300)
    legendre = [eval_legendre(n, x) for n in range(15)]
    even = [legendre[n - 1] - legendre[n + 1] for n in (3, 5, 7, 9, 11, 13)]
    shapes = np.array([*even, legendre[2], legendre[3] - legendre[5], -legendre[1]])
    pressure = (1 - x**2) * (1 - form[0, 5] * x) + 2 / 3 * own[:SHAPES] @ shapes
    transform = np.exp(-1j * np.multiply.outer(wave, x)) @ (weights * pressure)
    family = plain.with_own(own)
    load = family.spectra(form)[0, :, 0] / family.receptance(form)[0] / form[0, 0]
    np.testing.assert_allclose(load, transform, atol=1e-9)
    own[SHAPES:] = 0.1
    softer = plain.with_own(own).receptance(form)[0] / plain.receptance(form)[0]
    assert np.all(np.abs(softer[20:60]) < 1.0)
    (spectra,) = plain.with_own(own).spectra(form)
    for number, nudge in enumerate(1e-6 * np.eye(own.size)):
        ahead, behind = (
            plain.with_own(own + sign * nudge).spectra(form)[0, :, 0] for sign in (1, -1)
        )
        slope = spectra[:, 7 + number]
        np.testing.assert_allclose((ahead - behind) / 2e-6, slope, atol=2e-6 * np.abs(slope).max())


def test_windows_are_the_samples_around_and_end_at_gaps():
    values = np.arange(1000.0)
    axis = TimeAxis(1000, 2500.0, np.array([0, 600]), np.array([0.0, 9.0]), np.array([4e-4, 4e-4]))
    channel = Channel.of_array("s", "strain", values, axis)
    index = np.array([3.2, 300.4, 597.0, 603.0, 998.0])
    (found,) = gather_windows(channel, 1.0, index, (index, index), np.full(5, 16.0), np.arange(5))
    for row, at in enumerate(np.round(index).astype(int)):
        own = np.arange(at - 16, at + 16)
        inside = (own >= 0) & (own < 1000) & ((own < 600) == (at < 600))
        expected = np.where(inside, -own.astype(float), np.nan)
        np.testing.assert_array_equal(found.values[row], expected)
        assert found.motion["centre"][row] == pytest.approx(index[row] - at + 16)
