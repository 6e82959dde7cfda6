"""Fits: the truth comes back within its errors, from several logs and channels; what cannot be
known is said.

The truth is collocation (no formula of the package) plus noise.
"""

from dataclasses import replace

import numpy as np
import pytest

from tests.physics.collocation import solve_closed_line
from tirelog.data.recording import Conditions, Stack
from tirelog.errors import ModelError
from tirelog.inference.fit.design import design
from tirelog.inference.fit.revolutions import fit
from tirelog.inference.metric.revolutions import NUISANCES
from tirelog.physics import Model

R, F = 0.3126, 3600.0
TRUTH = {
    "flexural_stiffness_N_m2": 5.2,
    "foundation_stiffness_N_m2": 2.5e6,
    "patch_half_length_m": 0.061,
    "lever_arm_m": 4.2e-4,
    "viscous_damping.damping_rate_1_s": 35.0,
}
SPEEDS = np.array([9.0, 13.0, 17.0, 21.0, 24.0])
M = 96
PHI = (np.arange(M) + 0.5) * 2 * np.pi / M - np.pi


def collocated_strain(speed):
    """w'' at PHI of the true beam at a speed, times the lever arm (groove: least in the patch)."""
    EJ, k, L, y, rate = TRUTH.values()
    mu, gamma = 4.5, 0.75 * F / L**3
    edges = [-np.pi * R, -0.3, -L, L, 0.3, np.pi * R]
    x, u = solve_closed_line(
        [k, 2 * mu * rate * speed, mu * speed**2, 0.0, EJ],
        edges,
        lambda at, piece: gamma * (L**2 - at**2) if piece == 2 else 0.0,
        scale=(k / (4 * EJ)) ** 0.25,
        n=40,
    )
    values = np.empty(M)
    for piece in range(5):
        inside = (edges[piece] <= R * PHI) & (edges[piece + 1] >= R * PHI)
        middle, half = (
            0.5 * (edges[piece] + edges[piece + 1]),
            0.5 * (edges[piece + 1] - edges[piece]),
        )
        polynomial = np.polynomial.chebyshev.Chebyshev.fit(
            (x[piece] - middle) / half, u[2, piece], 40, domain=[-1, 1]
        )
        values[inside] = polynomial((R * PHI[inside] - middle) / half)
    return y * values


@pytest.fixture(scope="module")
def waves():
    return np.stack([collocated_strain(speed) for speed in SPEEDS])


def measured(waves, seed, *, noise=5e-6, surface="outer", offset=2e-5, log=0, repeats=8):
    rng = np.random.default_rng(seed)
    which = np.repeat(np.arange(SPEEDS.size), repeats)
    n = which.size
    count = rng.integers(0, 4, (n, M))
    values = waves[which] * (1.0 if surface == "outer" else -1.0) + offset
    values = values + noise * rng.standard_normal((n, M)) / np.sqrt(np.maximum(count, 1))
    drive = Conditions.of(
        n, speed_m_s=SPEEDS[which], acceleration_m_s2=0.0, time_s=np.arange(n) * 0.1, load_N=F
    )
    return Stack(
        observable="strain", channel="s", surface=surface, radius_m=R,
        values=np.where(count > 0, values, np.nan), phi_rad=PHI,
        phi_mean=np.where(count > 0, PHI, np.nan), phi_variance=np.zeros((n, M)), count=count,
        noise=np.full(n, noise), conditions=drive, log=np.full(n, log),
        manoeuvre=np.zeros(n, int), revolution=np.arange(n), regime=np.full(n, "cruise"),
        logs=("a.csv", "b.csv"),
    )  # fmt: skip


START = Model.new("beam", radius_m=R).with_effect("viscous_damping")


def test_the_truth_lies_within_two_standard_errors_in_95_percent_of_40_seeds(waves):
    inside, chi2 = [], []
    for seed in range(1000, 1040):
        result = fit(START, [measured(waves, seed)])
        assert result.names == tuple(TRUTH)
        inside.append(np.abs(result.values - list(TRUTH.values())) < 2.0 * result.se)
        chi2.append(result.reduced_chi2)
    assert np.mean(inside) >= 0.93  # 200 numbers: 95 % less the 1.5 % of chance
    assert np.all(np.abs(np.array(chi2) - 1.0) < 0.1)


def test_several_logs_have_their_own_offsets_and_surfaces(waves):
    stacks = [measured(waves, 1100), measured(waves, 1101, surface="inner", offset=-4e-4, log=1)]
    result = fit(START, stacks)
    assert np.all(np.abs(result.values - list(TRUTH.values())) < 4.0 * result.se)
    assert abs(result.reduced_chi2 - 1.0) < 0.1
    alone = fit(START, stacks[:1])
    assert np.all(result.se < alone.se)
    assert result.revolutions == 80


def test_strain_and_radial_acceleration_together(waves):
    """P3 asks for both: the acceleration parts the lever arm from the stiffness."""
    strain = measured(waves, 1102)
    truth = START.with_values(TRUTH)
    rng = np.random.default_rng(1103)
    values = truth.predict(
        strain.conditions, PHI, observable="radial_acceleration"
    ) + rng.standard_normal((len(strain), M))
    acceleration = replace(
        strain, observable="radial_acceleration", channel="a", values=values,
        count=np.ones((len(strain), M), int), phi_mean=np.tile(PHI, (len(strain), 1)),
        noise=np.full(len(strain), 1.0),
    )  # fmt: skip
    both, alone = fit(START, [strain, acceleration]), fit(START, [strain])
    assert np.all(np.abs(both.values - list(TRUTH.values())) < 4.0 * both.se)
    lever = both.names.index("lever_arm_m")
    assert both.se[lever] < 0.9 * alone.se[lever]


def test_nuisances_of_every_revolution_are_taken_out(waves):
    """Offsets and amplitudes that scatter from revolution to revolution leave the other parameters
    alone.
    """
    clean = measured(waves, 1104)
    rng = np.random.default_rng(1105)
    n = len(clean)
    moved = (
        clean.values
        + 3e-5 * rng.standard_normal((n, 1))
        + 0.02 * rng.standard_normal((n, 1)) * (clean.values - 2e-5)
    )
    plain = fit(START, [replace(clean, values=moved)])
    cleared = fit(START, [replace(clean, values=moved)], nuisances=("offset", "amplitude"))
    assert plain.reduced_chi2 > 5.0
    assert abs(cleared.reduced_chi2 - 1.0) < 0.1
    assert "lever_arm_m" not in cleared.names
    truth = np.array([TRUTH[name] for name in cleared.names])
    assert np.all(np.abs(cleared.values - truth) < 4.0 * cleared.se)


def test_correlations_bounds_and_the_shared_scale_are_said(waves):
    stack = measured(waves, 1106)
    result = fit(START, [stack])
    assert any(
        "share one scale" in sentence and "line_mass_kg_m and load_N are held" in sentence
        for sentence in result.degenerate
    )
    pairs = {frozenset(pair[:2]): pair[2] for pair in result.correlations}
    assert all(abs(r) > 0.9 for r in pairs.values())
    i, j = result.names.index("flexural_stiffness_N_m2"), result.names.index("lever_arm_m")
    r = result.covariance[i, j] / (result.se[i] * result.se[j])
    assert (abs(r) > 0.9) == (frozenset((result.names[i], result.names[j])) in pairs)
    narrow = START.parameters["patch_half_length_m"].within(0.01, 0.058)
    bound = fit(START.with_parameters({"patch_half_length_m": narrow}), [stack])
    assert bound.at_bound == ("patch_half_length_m",)
    assert bound.reduced_chi2 > 1.5


def test_what_the_data_do_not_determine_is_named(waves):
    stack = measured(waves, 1107)
    slow = stack.take(stack.conditions.speed_m_s == 9.0)
    both = Model.new("beam", radius_m=R).with_effect("belt_tension", tension_N=10.0)
    result = fit(both, [slow], starts=1)
    blind = [s for s in result.degenerate if "do not determine" in s]
    assert blind
    assert "belt_tension.tension_N" in " ".join(blind)
    assert np.isinf(result.se[result.names.index("belt_tension.tension_mass_kg_m")])


def test_a_fit_that_does_not_converge_is_an_error(waves):
    with pytest.raises(ModelError, match="did not converge"):
        fit(START, [measured(waves, 1108)], starts=1, max_evaluations=2)


def test_fits_that_cannot_be(waves):
    stack = measured(waves, 1109, repeats=1)
    with pytest.raises(ModelError, match="no revolution"):
        fit(START, [])
    with pytest.raises(ModelError, match="no free parameter"):
        fit(
            START.with_parameters({name: p.fixed() for name, p in START.parameters.items()}),
            [stack],
        )
    with pytest.raises(ModelError, match="predicts patch_length"):
        fit(Model.new("beam", "patch_length"), [stack])
    with pytest.raises(ModelError, match="measure strain"):
        fit(Model.new("beam", "radial_acceleration"), [stack])
    with pytest.raises(ModelError, match="needs water_depth_mm"):
        fit(START.with_effect("water_film"), [stack])


def test_design_gives_prediction_slopes_and_columns(waves):
    stack = measured(waves, 1110)
    parts = design(START, stack)
    assert parts.names == tuple(START.free)
    seen = np.isfinite(stack.values)
    assert np.allclose(parts.prediction[seen], START.predict(stack.conditions, PHI)[seen])
    assert parts.jacobian.shape == (len(parts.names), *stack.values.shape)
    ahead = START.predict(stack.conditions, PHI + 1e-4)
    behind = START.predict(stack.conditions, PHI - 1e-4)
    slope = ((ahead - behind) / 2e-4)[seen]
    assert np.abs(parts.slope[seen] - slope).max() < 1e-3 * np.abs(slope).max()
    assert NUISANCES == ("offset", "amplitude", "shift")


def test_scatter_of_the_load_is_learnt_and_the_errors_hold(waves):
    """Load that scatters from revolution to revolution and from manoeuvre to manoeuvre: without it
    in the metric the errors are feigned.
    """
    truth, inside, plain_chi2, chi2 = START.with_values(TRUTH), [], [], []
    for seed in range(1200, 1216):
        rng = np.random.default_rng(seed)
        still = measured(waves, seed, noise=2e-6)
        n, groups = len(still), 8
        manoeuvre = np.arange(n) * groups // n
        load = (
            1.0
            + 0.01 * rng.standard_normal((n, 1))
            + 0.006 * rng.standard_normal(groups)[manoeuvre][:, None]
        )
        by_load = truth.load_slope(still.conditions, PHI)
        stack = replace(still, values=still.values + (load - 1.0) * by_load, manoeuvre=manoeuvre)
        result = fit(START, [stack], scatter=True, starts=1)
        inside.append(np.abs(result.values - list(TRUTH.values())) < 2.0 * result.se)
        chi2.append(result.reduced_chi2)
        plain_chi2.append(fit(START, [stack], starts=1).reduced_chi2 if seed < 1203 else np.inf)
    assert min(plain_chi2) > 1.5
    assert np.mean(inside) >= 0.9
    assert np.abs(np.mean(chi2) - 1.0) < 0.05


def test_a_load_that_scatters_far_does_not_bend_the_stiffness(waves):
    """Strain is no straight line in the load: 4 % of scatter leaves 0.08 % of curvature, whose mean
    would pass for a stiffness.
    """
    truth, pulls = START.with_values(TRUTH), []
    for seed in range(1300, 1308):
        still = measured(waves, seed, noise=2e-6, repeats=16)
        rng = np.random.default_rng(seed)
        load = 1.0 + 0.04 * rng.standard_normal(len(still))
        noise = still.values - np.where(
            still.count > 0, 2e-5 + waves[np.repeat(np.arange(SPEEDS.size), 16)], np.nan
        )
        values = truth.predict(truth.loaded(still.conditions, load), PHI) + noise
        result = fit(START, [replace(still, values=values)], scatter=True, starts=1)
        pulls.append(((result.values - list(TRUTH.values())) / result.se)[:2])
    assert np.abs(np.mean(pulls, axis=0)).max() < 1.0
    assert np.sqrt(np.mean(np.square(pulls))) < 1.6


def test_without_scatter_nothing_is_learnt(waves):
    stack = measured(waves, 1300)
    with_scatter, without = fit(START, [stack], scatter=True), fit(START, [stack])
    assert np.allclose(with_scatter.values, without.values, atol=1.5 * without.se)
    assert np.all(with_scatter.se < 1.6 * without.se)


def test_numbers_per_revolution_are_fitted():
    """P4's regressors on a phase shift, and the patch length's half at the reference load."""
    rng = np.random.default_rng(1400)
    n = 120
    drive = Conditions.of(
        n,
        speed_m_s=rng.uniform(10.0, 25.0, n),
        acceleration_m_s2=rng.normal(0.0, 2.0, n),
        time_s=np.arange(n) * 0.1,
        load_N=F,
    )
    wanted = {
        "offset_rad": 0.011,
        "per_acceleration_rad_s2_m": 0.004,
        "speed_trend.linear_rad": 0.03,
        "speed_trend.quadratic_rad": -0.012,
    }
    model = Model.new("beam", "phase_shift", radius_m=R).with_effect("speed_trend")
    model = model.with_parameters(
        {"patch_half_length_m": model.parameters["patch_half_length_m"].fixed()}
    )
    values = model.predict(drive, values=wanted) + 1e-3 * rng.standard_normal((n, 1))
    column, zero = np.zeros((n, 1)), np.zeros(n, int)
    stack = Stack(
        "phase_shift", "a", "inner", R, values, np.zeros(1), column, column, np.ones((n, 1), int),
        np.full(n, 1e-3), drive, zero, zero, np.arange(n), np.full(n, "cruise"), ("a.h5",),
    )  # fmt: skip
    result = fit(model, [stack])
    assert set(result.names) == set(wanted)
    assert np.all(np.abs(result.values - [wanted[name] for name in result.names]) < 4.0 * result.se)
    assert abs(result.reduced_chi2 - 1.0) < 0.3


def test_a_spoilt_revolution_is_set_aside_and_counted(waves):
    """One revolution in eighty of another tire, such as a passage cut wrongly at standstill."""
    stack = measured(waves, 1500, repeats=16)
    values = stack.values.copy()
    values[7] = 0.5 * np.roll(values[7], 5)
    spoilt = replace(stack, values=values)
    result = fit(START, [spoilt], scatter=True)
    assert result.set_aside == 1
    assert np.all(np.abs(result.values - list(TRUTH.values())) < 4.0 * result.se)
    assert abs(result.reduced_chi2 - 1.0) < 0.1
    assert fit(START, [stack], scatter=True).set_aside == 0
