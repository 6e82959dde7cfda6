"""Closed form: the footprint by its equations, windows of samples, known fronts."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import erf, eval_legendre

from tirelog.data.recording import Channel, Recording, TimeAxis
from tirelog.data.setup import parse_setup
from tirelog.errors import UsageError
from tirelog.products import tables_of
from tirelog.strain.footprint.measure import gather_windows
from tirelog.strain.footprint.reference import SHAPES, EdgeFamily


def test_a_spectrum_fulfils_the_contact():
    """p = k_t (delta - xi^2 / 2R - w) inside the patch: both together are a parabola."""
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
    """Shapes on a parabola's pressure, a carcass stiffer by wavelength, and derivatives."""
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


R, RATE_HZ, G = 0.31, 10_000.0, 9.80665
SETUP = """[tire]
unloaded_radius_m = 0.31
rolling_radius_m = 0.31
[channels.a]
kind = "radial_acceleration"
source = "a"
"""
#: angles of the fronts [rad], and how far each is smeared
ENTRY, EXIT, SMEARED = np.radians(-11.0), np.radians(9.5), np.radians([1.2, 0.8])


def log_of(*, seconds=6.0, speed=18.0, gains=0.0, sign=1.0, coupled=False, noise=2.0, lost=()):
    """A sensor that reads -Omega^2 R, nothing in the patch, and gravity."""
    time = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    omega = (speed + gains * time) / R
    turned = (speed * time + 0.5 * gains * time**2) / R + 2.0
    phi = np.mod(turned + np.pi, 2 * np.pi) - np.pi
    inside = 0.5 * (erf((phi - ENTRY) / SMEARED[0]) - erf((phi - EXIT) / SMEARED[1]))
    values = -(omega**2) * R * (1.0 - inside) + G * np.cos(phi)
    if coupled:
        values = values - values.mean()
    values = sign * values + np.random.default_rng(5).normal(0.0, noise, time.size)
    values[list(lost)] = np.nan
    return values


def table(values, kind="radial_acceleration"):
    channel = Channel.of_array("a", kind, values, TimeAxis.uniform(values.size, RATE_HZ))
    recording = Recording("log", {"a": channel}, parse_setup(SETUP))
    (part,) = tables_of(recording, {"footprint": {}})
    return part.columns, np.array(part.columns["quality"]), part.remarks


@pytest.mark.parametrize(
    "given",
    [{}, {"sign": -1.0}, {"coupled": True}, {"gains": 1.5, "speed": 12.0}],
    ids=["as it is", "turned round", "AC-coupled", "speeding up"],
)
def test_the_length_is_the_way_between_the_fronts(given):
    columns, words, remarks = table(log_of(**given))
    good = words == "ok"
    assert good.sum() >= good.size - 3
    true = R * (EXIT - ENTRY)
    length = columns["length_m"][good]
    assert np.median(length) == pytest.approx(true, rel=4e-3)
    assert np.abs(length - true).max() < 0.02 * true
    told = columns["exit_time_s"] - columns["entry_time_s"]
    np.testing.assert_allclose((told * columns["speed_m_s"])[good], length, rtol=2e-3)
    assert np.median(columns["edge_asymmetry"][good]) > 0.05  # the exit is the sharper one
    assert np.isnan(columns["length_d2_m"]).all()
    assert "half of the step" in " ".join(remarks)


def test_the_errors_cover_the_noise():
    """They hold what a cubic misses of a flank besides, so they are somewhat larger."""
    columns, words, _ = table(log_of(noise=16.0, seconds=12.0))
    length, se = columns["length_m"][words == "ok"], columns["length_se_m"][words == "ok"]
    assert 1.0 < np.sqrt(np.mean(se**2)) / np.std(length) < 2.0


def test_what_is_lost_in_a_passage_costs_that_passage_alone():
    whole, _, _ = table(log_of())
    middle = int((whole["entry_time_s"][20]) * RATE_HZ)
    columns, marks, _ = table(log_of(lost=range(middle - 20, middle + 20)))
    assert np.isnan(columns["length_m"][20])
    assert marks[20] != "ok"
    assert (marks[10:15] == "ok").all()


def test_a_log_of_neither_strain_nor_acceleration_says_what_it_lacks():
    with pytest.raises(UsageError, match="no strain channel"):
        table(log_of(), kind="signal")
