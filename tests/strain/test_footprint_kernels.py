"""Closed form: the compiled inside of the footprint against plain numpy and scipy on the same input
(least squares, spectra, windows, derivatives).
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import eval_legendre, spherical_jn

from tirelog.data.recording import Channel, TimeAxis
from tirelog.dsp.filters import closed, derivatives, lowpassed, window_spectra
from tirelog.strain.footprint import kernels
from tirelog.strain.footprint.family import (
    ORDERS,
    SHAPES,
    EdgeFamily,
    EdgeShape,
    inverted,
    spherical_bessel,
)
from tirelog.strain.footprint.kernels import (
    MOST_BEND,
    ONSET,
    class_sums,
    fit_rows,
    onset_rows,
    traction_gains,
)
from tirelog.strain.footprint.measure import find_edges, least
from tirelog.strain.footprint.refine import gather_windows

SIGMA, ODD_SD = 0.02, 0.3
#: the table's grid: first, step, squared speed, shift, half window
GRID = np.array([-0.15, 5e-4, 196.0, 0.003, 0.13])
#: and as the kernels take it
GRIDS = GRID.view(kernels.GRID)


def smooth(columns: int) -> np.ndarray:
    """A table of smooth columns that can be told apart, (601, columns)."""
    xi = GRID[0] + GRID[1] * np.arange(601)
    bell = np.exp(-((xi / 0.05) ** 2))
    waves = [bell * np.cos(0.5 * np.pi * k * xi / 0.05 + 0.3 * k) for k in range(columns)]
    return np.ascontiguousarray(np.column_stack([bell, *waves[1:]]))


def windows(
    rows: int, seed: int, table: np.ndarray, extra: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Noisy rows of passages that hold the table's columns, and how they move; a sample lost here
    and there.
    """
    rng = np.random.default_rng(seed)
    motion = np.column_stack(
        [
            30 + rng.uniform(-0.5, 0.5, rows),
            np.full(rows, 2500.0),
            rng.uniform(12, 16, rows),
            rng.normal(0, 2, rows),
        ]
    )
    values = rng.normal(0, SIGMA, (rows, 61))
    for row in range(rows):
        xi = distance(motion[row], 61) - GRID[3]
        at = GRID[0] + GRID[1] * np.arange(len(table))
        size = 1.0 + 0.2 * rng.normal()
        for k, share in enumerate((1.0, 0.05, 0.04, 0.03, 0.03)):
            values[row] += size * share * np.interp(xi, at, table[:, k])
        if extra is not None:
            values[row] += size * np.interp(xi, at, extra)
        values[row] += 0.7
    values[rng.uniform(size=values.shape) < 0.01] = np.nan
    return values, motion


def moving(motion: np.ndarray) -> np.ndarray:
    """Centre, rate, speed and acceleration (n, 4) as the kernels take them."""
    return np.ascontiguousarray(motion).view(kernels.MOTION)[:, 0]


def numbers(found: np.ndarray) -> np.ndarray:
    """Records of numbers as rows of an array, in the order of their fields."""
    return found.view(float).reshape(found.size, -1)


def fitted_rows(values: np.ndarray, motion: np.ndarray, table: np.ndarray) -> np.ndarray:
    """The fit of each row by one table: the solution, two errors, chi2, samples."""
    n = len(values)
    found = np.full(n, np.nan, kernels.FIT)
    form = np.zeros(n, np.int64)
    fit_rows(values, moving(motion), form, table[None], GRIDS, SIGMA, ODD_SD, found)
    return numbers(found)


def distance(motion: np.ndarray, count: int) -> np.ndarray:
    centre, rate, speed, acceleration = motion
    time = (np.arange(count) - centre) / rate
    return speed * time + 0.5 * acceleration * time**2


def design(values, motion, table, by_speed2, follows, shift=GRID[3]):
    """The linear model at the samples in use: columns with the offset second, values about their
    mean, distances.
    """
    xi = distance(motion, values.size) - shift
    good = (np.abs(xi) < GRID[4]) & np.isfinite(values)
    at = GRID[0] + GRID[1] * np.arange(len(table))
    columns = np.column_stack([np.interp(xi[good], at, column) for column in table.T])
    columns[:, 0] += by_speed2 * (motion[2] ** 2 - GRID[2]) * columns[:, follows]
    known = values[good]
    return np.insert(columns, 1, 1.0, axis=1), known - known.mean(), xi[good], known.mean()


def known_oddness(columns: np.ndarray, values: np.ndarray, odd_sd: float) -> np.ndarray:
    """Weight of what is known of the fifth and sixth column, for six."""
    rough = abs(columns[:, 0] @ values) / (columns[:, 0] @ columns[:, 0])
    return np.diag([0, 0, 0, 0, 1, 1]) * (SIGMA / (odd_sd * rough)) ** 2


def plain_fit(columns, values, odd_sd):
    """Solution with the quadratic terms put back until they stand, the inverse, and the eight
    coefficients.
    """
    own, bent = columns[:, :6], columns[:, 6:8]
    inverse = np.linalg.inv(own.T @ own + known_oddness(columns, values, odd_sd))
    quadratic, rough = np.zeros(2), abs(columns[:, 0] @ values) / (columns[:, 0] @ columns[:, 0])
    for _ in range(5):
        solution = inverse @ own.T @ (values - bent @ quadratic)
        quadratic = np.clip(
            0.5 * solution[[3, 2]] ** 2 / solution[0], -MOST_BEND * rough, MOST_BEND * rough
        )
    return np.r_[solution, quadratic], inverse


def test_a_fit_is_the_least_squares_solution():
    table = smooth(8)
    table[:, 5:7] *= 1e-2
    table[:, 7] *= 1e-4
    values, motion = windows(20, 900, table)
    found = fitted_rows(values, motion, table)
    for row in range(20):
        columns, known, _, middle = design(values[row], motion[row], table, 1.0, 7)
        whole, inverse = plain_fit(columns, known, ODD_SD)
        expected = whole[:6] + np.array([0, middle, 0, 0, 0, 0])
        np.testing.assert_allclose(found[row, :6], expected, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(found[row, 6], np.sqrt(inverse[3, 3]), rtol=1e-8)
        left = known - columns[:, :8] @ whole
        assert found[row, 7] == pytest.approx(left @ left / SIGMA**2, rel=1e-8)
        assert found[row, 8] == known.size


def test_a_row_with_too_few_samples_is_not_known():
    table = smooth(8)
    values, motion = windows(1, 901, table)
    values[0, np.r_[:28, 33:61]] = np.nan
    found = fitted_rows(values, motion, table)
    assert np.isnan(found[0, :8]).all()
    assert found[0, 8] == np.isfinite(values).sum()


def test_what_passages_leave_about_a_form():
    """Each row's own columns taken out exactly, and what is left by place."""
    table = smooth(8)[:, :6].copy()
    values, motion = windows(12, 902, table)
    sums = class_sums(values, moving(motion), table, GRIDS[0], -1e-4, SIGMA, ODD_SD, 40)
    cells = np.zeros((2, 40))
    for row in range(12):
        columns, known, xi, _ = design(values[row], motion[row], table, -1e-4, 5)
        own = columns[:, :6]
        solution = np.linalg.solve(
            own.T @ own + known_oddness(columns, known, ODD_SD), own.T @ known
        )
        np.testing.assert_allclose(sums.own[row], solution, rtol=1e-7, atol=1e-10)
        residual = known - own @ solution
        assert sums.chi2[row] == pytest.approx(residual @ residual / SIGMA**2, rel=1e-8)
        np.add.at(
            cells,
            (slice(None), ((xi + GRID[4]) / (2 * GRID[4]) * 40).astype(int)),
            [residual / solution[0], np.ones(xi.size)],
        )
    np.testing.assert_allclose([sums.left, sums.counts], cells, atol=1e-9)


def traction_waves() -> np.ndarray:
    """Steps at eleven onsets, smoothed, on the table's grid."""
    xi = GRID[0] + GRID[1] * np.arange(601)
    return np.ascontiguousarray(
        np.column_stack(
            [
                np.tanh((xi - onset) / 0.008) * (np.abs(xi) < 0.1)
                for onset in np.linspace(-0.04, 0.05, 11)
            ]
        )
    )


def plain_joint(columns, known, wave):
    """Chi-square of form and wave together, their quadratic terms put back in turns; the solution,
    and the error of its length column.
    """
    both = np.column_stack([columns[:, :6], wave])
    weight = np.zeros((7, 7))
    weight[:6, :6] = known_oddness(columns, known, ODD_SD)
    quadratic, limit = (
        np.zeros(2),
        MOST_BEND
        * abs(np.linalg.solve((both.T @ both + weight)[:6, :6], columns[:, :6].T @ known)[0]),
    )
    for _ in range(5):
        solution = np.linalg.solve(
            both.T @ both + weight, both.T @ (known - columns[:, 6:8] @ quadratic)
        )
        quadratic = np.clip(0.5 * solution[[3, 2]] ** 2 / solution[0], -limit, limit)
    left = known - both @ solution - columns[:, 6:8] @ quadratic
    return (
        left @ left / SIGMA**2,
        solution,
        SIGMA * np.sqrt(np.linalg.inv(both.T @ both + weight)[3, 3]),
    )


def test_the_gain_of_a_traction():
    table, waves = smooth(8), traction_waves()
    table[:, 5:7] *= 1e-2
    table[:, 7] *= 1e-4
    values, motion = windows(8, 903, table, 0.1 * waves[:, 5])
    every_other = np.ascontiguousarray(waves[:, ::2])
    found = traction_gains(values, moving(motion), table, GRIDS[0], every_other, SIGMA, ODD_SD)
    for row in range(8):
        columns, known, xi, _ = design(values[row], motion[row], table, 1.0, 7)
        whole, inverse = plain_fit(columns, known, ODD_SD)
        residual, own = known - columns[:, :8] @ whole, columns[:, :6]
        best = 0.0
        for onset in range(0, 11, 2):
            wave = np.interp(xi, GRID[0] + GRID[1] * np.arange(601), waves[:, onset])
            free = wave @ wave - wave @ own @ inverse @ own.T @ wave
            best = max(best, (wave @ residual) ** 2 / free / SIGMA**2)
        assert found[row] == pytest.approx(best, rel=1e-6)


@pytest.mark.slow
def test_form_and_traction_together():
    """From one start: the onset of least chi-square there, and the best of three where that
    solution puts the form, with its neighbours.
    """
    table, waves = smooth(8), traction_waves()
    table[:, 5:7] *= 1e-2
    table[:, 7] *= 1e-4
    values, motion = windows(6, 904, table, 0.2 * waves[:, 6])
    shift = np.linspace(-0.002, 0.002, 6)
    starts = np.array([0.0, 1e4])  # the second is outside of the window
    made = np.full(6, np.nan, ONSET)
    onset_rows(
        values, moving(motion), values, moving(motion), table, GRIDS[0], waves, 1, shift, starts,
        1, 1, SIGMA, SIGMA, ODD_SD, np.inf, 3, made,
    )  # fmt: skip
    found = numbers(made)
    at = GRID[0] + GRID[1] * np.arange(601)

    def tried(row, place, onsets):
        columns, known, xi, _ = design(values[row], motion[row], table, 1.0, 7, GRID[3] + place)
        return [
            plain_joint(columns, known, np.interp(xi, at, waves[:, k])) for k in onsets
        ], known.size

    for row in range(6):
        plain, _ = tried(row, shift[row], range(11))
        rough = int(np.argmin([one[0] for one in plain]))
        own = plain[rough][1][2] / plain[rough][1][0]
        first = [one[0] for one in plain]
        best = rough
        for _ in range(2):  # a turn with the averages, one with the samples: here the same
            near = np.clip(best, 1, 9) + np.arange(-1, 2)
            plain, used = tried(row, shift[row] + own, near)
            best = int(near[np.argmin([one[0] for one in plain])])
        best = int(np.argmin([one[0] for one in plain]))
        assert found[row, 0] == near[best]
        assert found[row, 1] == near[1]
        np.testing.assert_allclose(found[row, 2:5], [chi2 for chi2, _, _ in plain], rtol=1e-5)
        np.testing.assert_allclose(
            found[row, 5:8], [whole[3] / whole[0] for _, whole, _ in plain], rtol=1e-4
        )
        chi2, whole, error = plain[best]
        np.testing.assert_allclose(
            found[row, 8:12], [chi2, whole[3] / whole[0], error / abs(whole[0]), used], rtol=1e-4
        )
        assert found[row, 12] == pytest.approx(
            min(one for k, one in enumerate(first) if abs(k - near[best]) > 3), rel=1e-5
        )


@pytest.mark.parametrize("z", [0.02, 0.9, 3.2, 4.4934, 15.9, 16.1, 60.0])
def test_spherical_bessel_functions(z):
    found = np.empty(ORDERS)
    spherical_bessel(z, found)
    np.testing.assert_allclose(found, spherical_jn(np.arange(ORDERS), z), rtol=1e-9, atol=1e-300)


def test_an_inverse():
    matrix = np.random.default_rng(905).normal(size=(7, 7))
    matrix[0, 0] = 0.0
    np.testing.assert_allclose(inverted(matrix.copy()) @ matrix, np.eye(7), atol=1e-10)


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


def test_a_tilted_parabola():
    """Without tread the load is (1 - x^2)(1 - tilt x), heavier towards the entry."""
    family, shape = EdgeFamily(0.305, 300.0), EdgeShape(0.055, 0.04, 0.4, 0.0, 0.0, 0.3)
    load = family.spectrum(shape) / family.receptance(shape)
    wave = family.kappa_1_m * shape.half_length_m
    odd = np.array(
        [2.0 * quad(lambda x: x * (1 - x**2), 0, 1, weight="sin", wvar=z)[0] for z in wave]
    )
    wanted = by_quadrature(0, wave) + 0.3j * odd
    np.testing.assert_allclose(load / load[0], wanted / wanted[0], atol=1e-9)


def test_slopes_of_a_spectrum_are_differences():
    family, shape = (
        EdgeFamily(0.305, 900.0),
        EdgeShape(0.055, 0.04, 0.4, 1.5, 0.2, -0.1),
    )
    spectra = family.jacobian(shape)
    for number in range(6):
        nudge = 1e-6 * np.eye(6)[number]
        ahead, behind = (
            family.spectrum(EdgeShape.of(shape.array() + sign * nudge)) for sign in (1, -1)
        )
        np.testing.assert_allclose(
            (ahead - behind) / 2e-6,
            spectra[:, 1 + number],
            atol=2e-6 * np.abs(spectra[:, 1 + number]).max(),
        )


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
    for number, nudge in enumerate(1e-6 * np.eye(own.size)):
        ahead, behind = (plain.with_own(own + sign * nudge).spectrum(shape) for sign in (1, -1))
        slope = spectra[:, 7 + number]
        np.testing.assert_allclose((ahead - behind) / 2e-6, slope, atol=1e-6 * np.abs(slope).max())


def plain_closed(row: np.ndarray) -> np.ndarray:
    known, place, edge = np.isfinite(row), np.arange(row.size), max(row.size // 32, 1)
    filled = np.interp(place, place[known], row[known]) if known.any() else np.zeros(row.size)
    return filled - np.linspace(filled[:edge].mean(), filled[-edge:].mean(), row.size)


@pytest.mark.parametrize(
    ("count", "order", "upsample"), [(64, 0, 2), (96, 1, 2), (96, 2, 4), (33, 2, 2), (64, 2, 1)]
)
def test_derivatives_of_windows(count, order, upsample):
    rng = np.random.default_rng(906)
    rows, cutoff = (
        np.cumsum(rng.normal(size=(5, count)), axis=1),
        np.array([100.0, 300.0, 500.0, 1000.0, 1200.0]),
    )
    rows[1, 10:14], rows[2, :3], rows[3, -2:], rows[4] = np.nan, np.nan, np.nan, np.nan
    expected = np.array([plain_closed(row) for row in rows])
    np.testing.assert_allclose(closed(rows), expected, atol=1e-11)
    frequency = np.fft.rfftfreq(count, 1 / 2500.0)
    shaped = (
        np.fft.rfft(expected)
        * (2j * np.pi * frequency) ** order
        / (1 + (frequency / cutoff[:, None]) ** 8)
    )
    if count % 2 == 0:
        shaped[:, -1] = shaped[:, -1].real * (0.5 if upsample > 1 else 1.0)
    wanted = np.fft.irfft(shaped, count * upsample) * upsample
    asked = window_spectra(rows), 2500.0, cutoff, count, upsample
    found = derivatives(*asked)[order - 1] if order else lowpassed(*asked)
    np.testing.assert_allclose(found, wanted, atol=1e-9 * max(np.abs(wanted).max(), 1e-9))


def test_noise_of_low_passed_derivatives():
    noise = np.random.default_rng(907).normal(size=(4000, 128))
    cutoff = np.full(4000, 400.0)
    frequency = np.fft.rfftfreq(128, 1 / 2500.0)
    *_, told = derivatives(np.fft.rfft(noise), 2500.0, cutoff, 128, 1)
    for column, order in enumerate((2, 3)):
        shaped = (
            np.fft.rfft(noise) * (2j * np.pi * frequency) ** order / (1 + (frequency / 400.0) ** 8)
        )
        assert told[0, column] == pytest.approx(np.fft.irfft(shaped).std(), rel=0.02)


def test_the_least_of_a_row_between_samples():
    x = np.arange(40.0)
    place, height, curvature = least(0.3 * (x - 17.3) ** 2 - 2.0, 10.2, 25.0)
    assert (place, height, curvature) == pytest.approx((17.3, -2.0, 0.6))
    assert np.isnan(least(x, 10.2, 25.0)[0])
    assert np.isnan(least(-((x - 17.3) ** 2), 10.2, 25.0)[2])


@pytest.mark.parametrize(("columns", "off"), [(6.0, 0.005), (8.0, 0.0016), (16.0, 0.00012)])
def test_the_least_of_a_wave_lies_where_it_is(columns, off):
    """A wave of so many columns a period, wherever its trough lies between two of them; a parabola
    is off by 0.019 at six.
    """
    x, omega = np.arange(40.0), 2 * np.pi / columns
    for trough in np.linspace(19.0, 20.0, 21):
        place, height, curvature = least(
            -np.cos(omega * (x - trough)), trough - 0.6 * columns, trough + 0.6 * columns
        )
        assert place == pytest.approx(trough, abs=off)
        assert height == pytest.approx(-1.0, abs=1.3 * off)
        assert curvature == pytest.approx(omega**2, rel=10 * off)


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
    (found,) = gather_windows(channel, 1.0, index, np.full(5, 16.0), np.arange(5))
    for row, at in enumerate(np.round(index).astype(int)):
        own = np.arange(at - 16, at + 16)
        inside = (own >= 0) & (own < 1000) & ((own < 600) == (at < 600))
        np.testing.assert_array_equal(
            found.values[row], np.where(inside, -own.astype(float), np.nan)
        )
        assert found.centre[row] == pytest.approx(index[row] - at + 16)
