"""Property: a nuisance of wheel or road is none of the tire's effects. Truth by `simulate`."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.cases import Case, case
from tests.diagnosis.planted import diagnosed, simulated
from tirelog.diagnosis import diagnose
from tirelog.diagnosis.candidates.assessment import at_noise_floor
from tirelog.diagnosis.candidates.nuisances import allowed_nuisances, groups_of, nuisances_found
from tirelog.diagnosis.candidates.search import search_effects
from tirelog.diagnosis.compare import start
from tirelog.diagnosis.diagnose import conclude
from tirelog.diagnosis.residual_structure import describe
from tirelog.inference.base import prepare
from tirelog.inference.nuisances import shared_effects
from tirelog.physics.model.model import Model
from tirelog.simulation.scenario.schema import (
    ForceVariation,
    LoadWander,
    Nuisances,
    RollingRadius,
    RunOut,
)

pytestmark = pytest.mark.xdist_group("nuisances")  # one worker makes what these tests share

SHORT = Case(plan="short", logs=2, duration=0.6)
WHEEL = Nuisances(
    run_out=RunOut((8.0, 4.0, 2.0), (30.0, 100.0, 200.0)),
    force_variation=ForceVariation((0.012, 0.006, 0.004), (10.0, 80.0, 150.0)),
)


#: what every case of the benchmark's tire is known by
MODEL = Model.new("beam", radius_m=0.305)


def measured(nuisances, planted=(), seed=403, how=SHORT):
    """Stacks of two short logs in a world."""
    logs = [replace(log, nuisances=nuisances) for log in case(planted, seed=seed, how=how)]
    return simulated(logs, angles=64)


@pytest.fixture(scope="module")
def wheel_null():
    return measured(WHEEL)


def test_run_out_and_force_variation_are_told_with_their_size(wheel_null):
    result = diagnosed(start(wheel_null, MODEL))
    assert result.verdict == "nothing_missing"
    wheel = next(n for n in result.nuisances if n.nuisance == "wheel")
    assert wheel.stayed
    sizes = {part.name: part for part in wheel.parts}
    for order, run_out, force in zip(
        ("first", "second", "third"), (8e-6, 4e-6, 2e-6), (0.012, 0.006, 0.004), strict=True
    ):
        for name, true in (("run-out", run_out), ("force variation", force)):
            part = sizes[f"{name} at the {order} harmonic of log 1"]
            assert abs(part.value - true) < max(4.0 * part.se, 0.05 * true), part
    said = result.to_json()["nuisances"]["wheel"]
    assert said["stayed"]
    assert said["se"] > 0.0
    assert said["unit"]


def test_a_nuisance_that_is_on_stands_beside_the_base(wheel_null):
    base = start(wheel_null, MODEL.with_nuisance("wheel", "on"))
    assert groups_of(base) == ("wheel",)
    assert base.reduced_chi2 < 1.2
    off = MODEL.with_nuisance("wheel", "off")
    plain = start(wheel_null, off)
    assert plain.reduced_chi2 > 5.0
    assert "wheel" not in allowed_nuisances(plain)


@pytest.mark.slow
def test_an_effect_is_named_beside_the_wheel(monkeypatch):
    stacks = measured(WHEEL, {"viscous_damping": {"damping_rate_1_s": 40.0}})
    found = search_effects(start(stacks, MODEL))
    result = conclude(found, ())
    assert result.verdict == "missing"
    assert result.selected == ("viscous_damping",)
    # if a drift did the same, the name would stand, and not alone; what the model has is no rival
    either = conclude(replace(found, alike=(("drift", "viscous_damping"),)), ())
    assert either.verdict == "ambiguous"
    assert either.sentence.startswith(
        "viscous_damping is missing, or in place of viscous_damping a drift: these data do not"
    )
    held = conclude(replace(found, alike=(("wheel", "viscous_damping"),)), ())
    assert (held.verdict, held.sentence) == (result.verdict, result.sentence)
    # held out below the floor, and not beyond doubt: nothing of a size is missing, named or not
    step = found.steps[0]
    doubtful = replace(step.named, p=0.005)
    held = found.before.held_white, 0.0 * found.before.held_plain
    low = replace(found.before, held=held)
    small = replace(found, before=low, steps=(replace(step, named=doubtful), *found.steps[1:]))
    monkeypatch.setattr(
        diagnose, "describe", lambda base: replace(describe(base), significant=True)
    )
    assert conclude(small, ()).verdict == "scatter"
    damping = result.model.parameters["viscous_damping.damping_rate_1_s"]
    assert abs(damping.value - 40.0) < 4.0 * damping.se


def test_a_radius_that_is_wrong_and_grows_is_no_effect():
    stacks = measured(Nuisances(rolling_radius=RollingRadius(-0.015, 0.02)))
    result = diagnosed(start(stacks, MODEL))
    assert result.verdict == "nothing_missing"
    (rolling,) = (n for n in result.nuisances if n.stayed)
    assert rolling.nuisance == "rolling"
    # a radius 3 % off moves the edges by their width: its derivative alone would give it wrong
    (grows,) = (part for part in rolling.parts if part.name == "radius with speed")
    assert abs(grows.value - 0.02) < 0.001


@pytest.mark.slow
@pytest.mark.parametrize(
    "microstrain",
    [
        pytest.param(0.8, id="neither removes most"),
        pytest.param(3.0, id="wear stands in for the patch law until the wheel is known"),
    ],
)
def test_two_at_once_come_in_together(microstrain):
    runs_out = Nuisances(run_out=RunOut((microstrain, 0.5 * microstrain), (30.0, 100.0)))
    logs = [
        replace(
            log,
            nuisances=runs_out,
            tire=replace(log.tire, patch_load_exponent=0.35),
            conditions=replace(log.conditions, distance_km=distance),
        )
        for log, distance in zip(
            case((), seed=413, how=replace(SHORT, plan="mixed")), (3e4, 5e3), strict=True
        )
    ]
    found = search_effects(start(simulated(logs, angles=64), MODEL))
    assert found.named == ()
    assert set(groups_of(found.before)) == {"wheel", "patch_law"}
    exponent = found.before.model.parameters["patch_load_exponent"]
    assert abs(exponent.value - 0.35) < max(4.0 * exponent.se, 0.01)
    (law,) = (n for n in nuisances_found(found.before) if n.nuisance == "patch_law")
    assert law.stayed
    assert law.parts[0].value == pytest.approx(exponent.value - 0.5)
    assert at_noise_floor(found.before, found.before.floor.square)


def test_a_tire_that_drifts_far_on_a_wrong_radius_is_found_as_it_drifted(wheel_null):
    """Edges move by their own width: the derivatives of the first fit say something else."""
    base = start(wheel_null, MODEL.with_nuisance("wheel", "off"))
    raw, model = base.raw, base.model
    time, speed = raw.conditions.time_s, raw.conditions.speed_m_s
    turn = np.where(raw.log == 0, 1.0, -1.0)  # one log warms up, the other cools down
    along = turn * (time - time.mean()) / np.ptp(time)
    values = raw.sd * np.random.default_rng(1).standard_normal(raw.values.shape)
    for c in range(len(raw)):
        cell, grown = raw.take(np.array([c])), 1.0 + 0.06 * (speed[c] / 25.0) ** 2
        factors = {
            "patch_half_length_m": 1.0 + 0.06 * along[c],
            "foundation_stiffness_N_m2": 1.0 - 0.06 * along[c],
            "radius_m": grown,
        }
        moved = model.with_values({name: model.values[name] * x for name, x in factors.items()})
        values[c] += moved.predict(
            replace(cell.conditions, speed_m_s=speed[c : c + 1] * grown),
            cell.angles,
            surface=cell.surface,
        )[0]
    known = MODEL.with_nuisance("rolling", "on").with_nuisance("drift", "on")
    found = prepare(replace(raw, values=values), known)
    size = dict(zip(found.cells.shared.names, found.fit.amplitudes.tolist(), strict=True))
    assert found.reduced_chi2 < 1.2  # 1.7 with derivatives alone
    assert abs(size["radius with speed"] - 0.06) < 0.002
    assert abs(size["radius with load"]) < 0.005
    assert abs(size["radius level"]) < 0.01
    for log, way in (("log 1", 1.0), ("log 2", -1.0)):
        assert abs(size[f"patch length along {log}"] - 0.06 * way) < 0.003
        assert abs(size[f"foundation stiffness along {log}"] + 0.06 * way) < 0.006


def test_a_load_that_wanders_is_in_the_floor():
    how = replace(SHORT, plan="mixed")
    calm, restless = (
        start(measured(Nuisances(load_wander=LoadWander(share, 2.0)), how=how), MODEL)
        for share in (0.0, 0.03)
    )
    assert calm.floor.scatter.wander_sd < 0.005 < 0.012 < restless.floor.scatter.wander_sd < 0.05
    assert restless.reduced_chi2 < 1.2
    np.testing.assert_array_less(calm.floor.between, restless.floor.between)


def test_nuisances_are_seen_where_bins_are_empty(wheel_null):
    base = start(wheel_null, MODEL)
    cells = base.cells
    values, phi = cells.values.copy(), cells.phi.copy()
    values[::3, ::9] = phi[::3, ::9] = np.nan
    holed = replace(cells, values=values, phi=phi)
    fit = replace(base.fit, prediction=np.where(np.isfinite(phi), base.fit.prediction, np.nan))
    for name in ("wheel", "drift", "rolling"):
        effects = shared_effects(holed, fit, name)
        assert effects is not None, name
        assert np.isfinite(effects.columns).all(), name
        assert np.isfinite(effects.sd).all(), name
