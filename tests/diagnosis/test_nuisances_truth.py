"""A nuisance of the wheel or the road is none of the tire's effects: truth by `simulate`."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.cases import Case, case
from benchmarks.nuisance_worlds import CaseOf
from tirelog.diagnosis.beside import allowed_nuisances, best_nuisance, groups_of
from tirelog.diagnosis.compare import start
from tirelog.diagnosis.diagnose import conclude
from tirelog.diagnosis.naming import quiet
from tirelog.diagnosis.nuisance_sizes import nuisances_found
from tirelog.diagnosis.search import search_effects
from tirelog.inference.base import prepare, settled
from tirelog.inference.cells.cells import cells_of
from tirelog.inference.cells.gathering import pieces_of_logs
from tirelog.inference.nuisances import shared_effects
from tirelog.inference.stacks.cut import stacks_from_logs
from tirelog.physics.model.model import Model
from tirelog.simulation import simulate, to_recording
from tirelog.simulation.scenario.planted import Planted
from tirelog.simulation.scenario.schema import (
    ForceVariation,
    LoadWander,
    Nuisances,
    RollingRadius,
    RunOut,
)

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
    return stacks_from_logs(
        [to_recording(simulate(log), f"log_{i}") for i, log in enumerate(logs)], angles=64
    )


def diagnosed(stacks, model=MODEL):
    return conclude(search_effects(start(stacks, model)), ())


@pytest.fixture(scope="module")
def wheel_null():
    return measured(WHEEL)


def test_run_out_and_force_variation_are_told_with_their_size(wheel_null):
    result = diagnosed(wheel_null)
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


def test_an_effect_is_named_beside_the_wheel():
    stacks = measured(WHEEL, {"viscous_damping": {"damping_rate_1_s": 40.0}})
    result = diagnosed(stacks)
    assert result.selected == ("viscous_damping",)
    damping = result.model.parameters["viscous_damping.damping_rate_1_s"]
    assert abs(damping.value - 40.0) < 4.0 * damping.se


def test_a_radius_that_is_wrong_and_grows_is_no_effect():
    stacks = measured(Nuisances(rolling_radius=RollingRadius(-0.015, 0.02)))
    result = diagnosed(stacks)
    assert result.verdict == "nothing_missing"
    assert [n.nuisance for n in result.nuisances if n.stayed] == ["rolling"]


def test_a_load_that_wanders_is_in_the_floor():
    how = replace(SHORT, plan="mixed")
    calm, restless = (
        start(measured(Nuisances(load_wander=LoadWander(share, 2.0)), how=how), MODEL)
        for share in (0.0, 0.03)
    )
    assert calm.floor.scatter.wander_sd < 0.005 < 0.012 < restless.floor.scatter.wander_sd < 0.05
    assert restless.reduced_chi2 < 1.2
    np.testing.assert_array_less(calm.floor.between, restless.floor.between)


def test_loads_that_scatter_by_3_percent_leave_a_null_at_its_floor():
    logs = CaseOf("scatter_3", 2).scenarios()
    stacks = stacks_from_logs([to_recording(simulate(x), f"log_{i}") for i, x in enumerate(logs)])
    base = start(stacks, Model.new("beam", radius_m=logs[0].tire.rolling_radius_m))
    assert 0.015 < base.floor.scatter.load_sd < 0.04
    assert base.reduced_chi2 < 1.15  # 2 and more if a waveform were straight in its load
    assert quiet(base, base.floor.square)


def test_another_patch_law_is_fitted_and_told():
    logs = [
        replace(log, tire=replace(log.tire, patch_load_exponent=0.8))
        for log in case((), seed=412, how=replace(SHORT, plan="mixed"))
    ]
    stacks = stacks_from_logs(
        [to_recording(simulate(log), f"log_{i}") for i, log in enumerate(logs)], angles=64
    )
    base = start(stacks, MODEL)
    assert base.reduced_chi2 > 5.0
    found = search_effects(base)
    exponent = found.before.model.parameters["patch_load_exponent"]
    assert groups_of(found.before) == ("patch_law",)
    assert abs(exponent.value - 0.8) < max(4.0 * exponent.se, 0.01)
    (told,) = (n for n in nuisances_found(found.before) if n.nuisance == "patch_law")
    assert told.stayed
    assert told.parts[0].value == pytest.approx(exponent.value - 0.5)
    assert found.before.reduced_chi2 < 1.2


def at_pressures(*pressures_Pa: float):
    """Two short logs at one load; the patch shrinks as the pressure to the power of 0.4."""
    logs, softer = case((), seed=413, how=SHORT), Planted("inflation", "exact", {"exponent": 0.4})
    driven = [
        replace(
            log,
            conditions=replace(log.conditions, load_N=3434.0, inflation_pressure_Pa=p),
            effects=(*log.effects, softer),
        )
        for log, p in zip(logs, pressures_Pa, strict=True)
    ]
    return stacks_from_logs(
        [to_recording(simulate(log), f"log_{i}") for i, log in enumerate(driven)], angles=64
    )


def test_a_patch_that_pressure_shrinks_is_fitted_and_told():
    base = prepare(cells_of(pieces_of_logs(at_pressures(2.2e5, 1.7e5))), MODEL, several=False)
    assert base.reduced_chi2 > 5.0
    found = best_nuisance(base, allowed_nuisances(base))
    assert found is not None
    found = settled(found)
    exponent = found.model.parameters["patch_pressure_exponent"]
    assert groups_of(found) == ("pressure_law",)
    assert abs(exponent.value - 0.4) < max(4.0 * exponent.se, 0.01)
    half = found.model.half_length_m(found.cells.conditions)
    ratio = half[found.cells.log == 1].mean() / half[found.cells.log == 0].mean()
    assert ratio == pytest.approx((1.7 / 2.2) ** -0.4, rel=0.01)
    assert found.reduced_chi2 < 1.2


def test_nuisances_are_seen_where_bins_are_empty(wheel_null):
    base = start(wheel_null, MODEL)
    cells = base.cells
    values, phi = cells.values.copy(), cells.phi.copy()
    values[::3, ::9] = phi[::3, ::9] = np.nan
    holed = replace(cells, values=values, phi=phi)
    for name in ("wheel", "drift", "rolling"):
        effects = shared_effects(
            holed,
            replace(base.fit, prediction=np.where(np.isfinite(phi), base.fit.prediction, np.nan)),
            name,
        )
        assert effects is not None, name
        assert np.isfinite(effects.columns).all(), name
        assert np.isfinite(effects.sd).all(), name
