"""Literature: printed numbers of P1 and P2, and the errata shown."""

import numpy as np
import pytest

from tests.physics.beam_roots import exact_displacement
from tirelog.data.recording import Conditions
from tirelog.physics import Model
from tirelog.physics.carcass.structures import critical_speed
from tirelog.physics.pressure import slip_stiffness, traction, transition

# Table 1 with mu = rho x cross-section (errata)
EJ, K, MU, L, M, H, R, C = 5e7 * 1.66e-8, 7.790e6, 0.676, 0.05, 400 * 9.81, 0.018, 0.3126, 11.11
ONE = np.array([[1.0]])


def table_1(**more):
    values = {
        "flexural_stiffness_N_m2": EJ, "foundation_stiffness_N_m2": K, "line_mass_kg_m": MU,
        "patch_half_length_m": L, "lever_arm_m": H / 2, "load_N": M, "reference_load_N": M,
        "radius_m": R,
    }  # fmt: skip
    return Model.new("beam", **{**values, **more})


def test_critical_speed_and_alpha_of_table_1():
    assert critical_speed(EJ, K, MU) == pytest.approx(86.7, abs=0.1)
    assert C / critical_speed(EJ, K, MU) == pytest.approx(0.128, abs=5e-4)
    assert C / critical_speed(EJ, K, 1100.0) == pytest.approx(5.2, abs=0.05)


def test_brush_transition_and_slip_stiffness():
    assert float(transition(0.15 * ONE, L * ONE).item()) == pytest.approx(0.0350, abs=5e-5)
    assert float(slip_stiffness(M * ONE, L * ONE).item()) == pytest.approx(1.8835e6, rel=1e-4)


def test_brush_is_the_whole_patch_at_full_slip_and_continuous_at_the_limit():
    assert transition(ONE, L * ONE).item() == -L
    x = transition(0.15 * ONE, L * ONE)
    gamma = 0.75 * M / L**3
    before = traction(x - 1e-9, M * ONE, L * ONE, 0.15 * ONE).item()
    assert before == pytest.approx(0.8 * gamma * (L**2 - x.item() ** 2), rel=1e-6)
    assert traction(x + 1e-9, M * ONE, L * ONE, 0.15 * ONE).item() == pytest.approx(
        before * 0.6 / 0.8, rel=1e-6
    )


def test_largest_displacement_of_fig_11():
    phi = np.linspace(-0.3, 0.3, 2001)
    rolling = Conditions.of(1, speed_m_s=C, slip=0.0)
    braking = Conditions.of(1, speed_m_s=C, slip=0.15)
    model = table_1().with_effect("traction", lever_m=H)
    free = model.predict(rolling, phi, observable="displacement").max()
    assert free == pytest.approx(6.6e-3, abs=5e-5)
    assert model.predict(braking, phi, observable="displacement").max() == pytest.approx(
        7.1e-3, abs=5e-5
    )


def test_first_derivative_extrema_lie_well_inside_the_patch():
    phi = np.linspace(-0.3, 0.3, 60001)
    slope = np.gradient(
        table_1().predict(Conditions.of(1, speed_m_s=C), phi, surface="outer")[0], R * phi
    )
    inside = np.abs(R * phi) < L
    assert R * phi[inside][np.argmax(slope[inside])] == pytest.approx(0.0356, abs=1e-4)
    assert R * phi[inside][np.argmin(slope[inside])] == pytest.approx(-0.0356, abs=1e-4)


# ---- P1: light damping, printed and corrected, against the exact roots (s > 0 lies ahead of the
# load: s = -lambda xi) --------------------


def undamped(s, a, b):
    return np.exp(-b * np.abs(s)) / (a * b) * (a * np.cos(a * s) + b * np.sin(a * np.abs(s)))


def exact_point_load(s, alpha, beta):
    """The beam's roots at a short patch: EJ = 1, k = 4, mu = 1 makes lambda = 1, c_cr = 2, and
    w_0 = 1 at 8 N.
    """
    return exact_displacement(
        -s, load_N=8.0, half_length_m=1e-3, circumference_m=200.0, flexural_stiffness_N_m2=1.0,
        foundation_stiffness_N_m2=4.0, line_mass_kg_m=1.0, speed_m_s=2 * alpha,
        damping_rate_1_s=2 * beta,
    )  # fmt: skip


S = np.linspace(-8, 8, 1601)


def miss(formula, alpha, beta):
    return np.abs(formula - exact_point_load(S, alpha, beta)).max()


def test_undamped_formula_10():
    for alpha in (0.13, 0.8):
        a, b = np.sqrt(1 + alpha**2), np.sqrt(1 - alpha**2)
        assert miss(undamped(S, a, b), alpha, 0.0) < 2e-6
