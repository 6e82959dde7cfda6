"""Literature: the papers' numbers from the product's models, as docs/gallery.md shows them."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tirelog
from tests.strain.strain_truth import Beam
from tirelog.api.models import forces, revolutions
from tirelog.cli import run
from tirelog.data.recording import Conditions
from tirelog.physics import Model
from tirelog.physics.model.file import preset_model
from tirelog.physics.model.forces import worn_model
from tirelog.simulation import load_scenario, simulate, write_log
from tirelog.simulation.scenario.schema import Manoeuvre

SCENARIOS = Path(__file__).parents[2] / "sample_data" / "scenarios"
EJ, K, MU, LEVER_M = 5e7 * 1.66e-8, 7.79e6, 0.676, 0.009


def factors(model, *speeds):
    drive = Conditions.of(len(speeds), speed_m_s=np.array(speeds))
    return model.predict(drive, observable="dissipation_factor")[:, 0]


def nodes(line_mass):
    own = {"stiffness": EJ, "foundation": K, "line_mass": line_mass, "lever_m": LEVER_M}
    return Beam(half_length_m=0.05, load_N=400 * 9.81, **own)


@pytest.mark.parametrize(("beta", "least", "most"), [
    (0.01, 1.14, 1.16), (0.05, 1.14, 1.16), (0.5, 1.05, 1.2), (1.2, 0.6, 0.95), (2.0, 0.3, 0.75),
])  # fmt: skip
def test_p1_s_factor_rises_unless_it_is_damped_beyond_one(beta, least, most):
    """Errata to P1 Fig. 11, where the factor falls: 1.145 times from 3 to 24 m/s."""
    rate = beta * np.sqrt(K / MU)
    model = preset_model("P1").with_effect("viscous_damping", damping_rate_1_s=rate)
    slow, fast = factors(model, 3.0, 24.0)
    assert least < fast / slow < most


def test_a_belt_that_grows_taut_has_the_trend_of_fig_11():
    """A beam of finite differences with tension 3 v^2: its factor falls to 0.67, and that is what
    the effect belt_tension gives; an undamped ring is flat."""
    speeds = (3.0, 12.0, 24.0)
    taut = preset_model("P1").with_effect("belt_tension", tension_mass_kg_m=3.0)
    told = factors(taut, *speeds)
    truth = np.array([nodes(MU - 3.0).dissipation_factor(v) for v in speeds])
    np.testing.assert_allclose(told, truth, rtol=5e-3)
    assert told[2] / told[0] == pytest.approx(0.67, abs=0.01)
    assert (np.diff(told) < 0.0).all()
    power = told * np.square(speeds)
    assert (np.diff(power) > 0.0).all()  # Fig. 11's other half: specific power rises
    ring = factors(preset_model("P3"), *speeds)
    assert ring == pytest.approx(np.full(3, ring[0]), rel=1e-9)


def test_p1_fig_5_s_difference_is_the_corrected_psi():
    """(12) at alpha 0.128, beta 0.05: as printed 1.3e-2 off, corrected 5.5e-5."""
    numbers = preset_model("P1").values
    plain = Model.new("beam", "strain", "point", **numbers)
    damped = plain.with_effect("viscous_damping", damping_rate_1_s=0.05 * np.sqrt(K / MU))
    told, other = (revolutions(m, {"speed_m_s": 11.11}, points=4096) for m in (damped, plain))
    wave, w_0 = (K / (4 * EJ)) ** 0.25, 400 * 9.81 * (K / (4 * EJ)) ** 0.25 / (2 * K)
    alpha = 11.11 / (2 * wave * np.sqrt(EJ / MU))
    a, b, s = np.sqrt(1 + alpha**2), np.sqrt(1 - alpha**2), wave * told["xi_m"]
    decay = np.exp(-b * np.abs(s)) / (a * b)
    first = decay * (a * np.cos(a * s) + b * np.sin(a * np.abs(s))) / a
    second = (1 + b * np.abs(s)) / b * decay * (b * np.cos(a * s) - a * np.sin(a * np.abs(s)))
    difference = (told["displacement_m"] - other["displacement_m"]) / w_0
    scale = alpha * 0.05 / (a * b) * np.sign(s)
    corrected, printed = (
        np.abs(difference - scale * (first + sign * second)).max() for sign in (-1.0, 1.0)
    )
    assert np.abs(difference).max() == pytest.approx(5.2e-3, rel=0.05)
    # (7) to (9), s ahead of the load: right to 0.013 beta^2 at this alpha (errata)
    light = np.empty_like(s)
    for ahead, sign in ((s <= 0.0, 1.0), (s > 0.0, -1.0)):
        one = np.sqrt(1 + alpha**2 + sign * 2 * alpha * 0.05 / b)
        odd, even = one * b, b**2 - sign * alpha * 0.05 / b
        x = np.abs(s[ahead])
        wave = odd * np.cos(one * x) + even * np.sin(one * x)
        light[ahead] = 2 / (one * (odd**2 + even**2)) * np.exp(-b * x) * wave
    missed_by_light = np.abs(told["displacement_m"] / w_0 - light).max()
    assert missed_by_light == pytest.approx(0.013 * 0.05**2, rel=0.1)
    assert corrected < 7e-5
    assert printed == pytest.approx(1.3e-2, rel=0.05)


def test_p2_fig_13_s_maxima():
    """Displacement: towards the entry from slip 0 on; strain: only beyond 0.15 (errata)."""
    model = preset_model("P2").with_effect("traction", lever_m=0.018)
    slips = np.array([0.05, 0.15, 0.3, 0.5])
    told = revolutions(model, {"speed_m_s": 11.11, "slip": slips}, points=8192)
    x = told["xi_m"][:8192]
    deepest = x[told["displacement_m"].reshape(4, -1).argmax(axis=1)]
    least = x[told["strain"].reshape(4, -1).argmin(axis=1)]
    step = x[1] - x[0]
    assert 1e3 * deepest == pytest.approx([-0.8, -3.0, -6.8, -11.4], abs=1e3 * step)
    assert 1e3 * least == pytest.approx([0.4, 0.1, -4.2, -13.3], abs=1e3 * step)


def test_p2_fig_11_s_first_derivative_turns_at_the_onset(tmp_path, monkeypatch):
    """At -36.8 and 34.9 mm of a beam solved apart, on the angles that `--all` takes by itself."""
    monkeypatch.chdir(tmp_path)
    for words in (
        "model new --preset P2 -o p2.toml --quiet",
        "model add p2.toml traction -o brush.toml --set lever_m=0.018 --quiet",
        "model predict brush.toml --speed 11.11 --slip 0.15 --all -o along.csv --quiet",
    ):
        assert run(words.split()) == 0
    with Path("along.csv").open() as file:
        rows = [(float(r["xi_m"]), float(r["strain_slope_1_m"])) for r in csv.DictReader(file)]
    place, slope = 1e3 * np.array(rows).T[0], np.array(rows).T[1]
    assert [place[slope.argmin()], place[slope.argmax()]] == pytest.approx([-36.8, 34.9], abs=0.7)


def test_p2_fig_14_s_second_derivative_marks_edges_or_the_onset():
    model = preset_model("P2").with_effect("traction", lever_m=0.018)
    told = revolutions(model, {"speed_m_s": 11.11, "slip": np.array([0.0, 0.15])}, points=8192)
    x = told["xi_m"][:8192]
    free, braked = told["strain_curvature_1_m2"].reshape(2, -1)
    behind = (x > 0.0) & (x < 0.07)
    assert 1e3 * x[behind][free[behind].argmin()] == pytest.approx(50.0, abs=0.4)
    assert 1e3 * x[behind][np.abs(braked[behind]).argmax()] == pytest.approx(35.0, abs=0.4)


def test_p3_fig_4_s_lobes_and_the_forces_on_the_hub():
    model = preset_model("P3").with_effect("traction", lever_m=0.0)
    slips = np.array([-0.2, 0.0, 0.2])
    drive = {"speed_m_s": 10.0, "load_N": 250.0, "slip": slips}
    told = revolutions(model, drive, points=2048, surface="inner")["strain"].reshape(3, 2, -1)
    lobes = told.min(axis=2)
    assert lobes[1, 0] == pytest.approx(lobes[1, 1], rel=1e-9)
    assert lobes[0] == pytest.approx(lobes[2, ::-1], rel=2e-4)  # odd in slip, but for the grid
    assert lobes[2, 1] < 1.1 * lobes[2, 0] < 0.0
    hub = forces(model, drive)
    assert hub["hub_longitudinal_N"] == pytest.approx([-92.4, 0.0, 92.4], abs=0.05)
    assert hub["hub_vertical_N"] == pytest.approx(np.full(3, 250.0), abs=0.2)


def test_p3_s_wear_lowers_the_strain_by_its_lever_arm():
    """Figs. 5, 6: nothing by the lost mass; less by the lever arm, somewhat more by the tread."""
    new = preset_model("P3")
    worn, changed = worn_model(new, 0.008, 0.002)
    assert changed["lever_arm_m"] == pytest.approx((0.005, 0.002))
    peaks = [
        m.predict(Conditions.of(1, speed_m_s=10.0), np.zeros(1), surface="inner").item()
        for m in (new, worn, new.with_values({"line_mass_kg_m": 1.0}))
    ]
    assert 0.4 < peaks[1] / peaks[0] < 0.5
    assert peaks[2] == pytest.approx(peaks[0], rel=1e-9)


@pytest.mark.parametrize(("name", "least", "most"), [
    ("falling_factor", 0.65, 0.8), ("rising_factor", 1.06, 1.2),
])  # fmt: skip
def test_both_trends_are_in_the_logs(name, least, most, tmp_path):
    """P1 Fig. 11 and its contrary, by the command on short logs of both scenarios."""
    scenario = load_scenario(SCENARIOS / f"{name}.toml")
    cruises = ((4.0, 9.0), (8.0, 9.0), (4.0, 22.0), (4.0, 22.0))
    drive = tuple(Manoeuvre(seconds, speed) for seconds, speed in cruises)
    log = tmp_path / "log.csv"
    write_log(simulate(replace(scenario, manoeuvres=drive)), log)
    table = tirelog.dissipation(log)
    steady = table["speed_m_s"], table["dissipation_factor_1_m"]
    slow, fast = (np.nanmedian(steady[1][np.abs(steady[0] - v) < 0.5]) for v in (9.0, 22.0))
    assert least < fast / slow < most
