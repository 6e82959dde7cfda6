"""Property: a task hands out one hook of the effects that have it, given their values."""

import numpy as np
import pytest

from tirelog.data.recording import Conditions
from tirelog.physics.effects import BY_ID, CATALOGUE, Drive, Site
from tirelog.physics.effects.base import REACH, Structure
from tirelog.physics.model.model import ModelEffect
from tirelog.physics.model.stages import Active, Task

CONDITIONS = Conditions.of(
    2,
    speed_m_s=np.array([12.0, 25.0]),
    acceleration_m_s2=np.array([-1.0, 2.0]),
    time_s=np.array([3.0, 400.0]),
    temperature_K=np.array([1.0, 12.0]),
    load_N=3500.0,
    inflation_pressure_Pa=2.2e5,
    distance_km=900.0,
    water_depth_mm=1.5,
    slip=0.01,
)
DRIVE = Drive.of(CONDITIONS)
SITE = Site(np.array([[3500.0]]), np.array([[0.06]]), 0.3, 3600.0)
#: what a hook takes besides values and conditions
MORE = {
    "pressure": (SITE,),
    "kernel": (SITE,),
    "transfer": (SITE,),
    "traction": (SITE,),
    "strain": (SITE, np.zeros((1, 3))),
    "acceleration": (SITE, np.zeros((1, 3))),
    "regressor": (SITE, "phase_shift"),
}


def switched_on(effect) -> Active:
    """An effect with its start values, each strength at its probe."""
    entry = ModelEffect.of(effect)
    values = {f"{effect.id}.{p.name}": p.value or p.probe for p in effect.parameters}
    return Active(effect, entry.values(values))


TASK = Task("beam", False, {}, [switched_on(effect) for effect in CATALOGUE], DRIVE)


@pytest.mark.parametrize("hook", REACH)
def test_a_hook_is_handed_out_bound_for_the_effects_that_have_it_and_no_other(hook: str) -> None:
    found = TASK.hooks(lambda effect: getattr(effect, hook))
    having = [active for active in TASK.active if getattr(active.effect, hook) is not None]
    assert list(found) == [active.effect.id for active in having]
    for active in having:
        more = MORE.get(hook, ())
        own = getattr(active.effect, hook)(active.values, DRIVE, *more)
        handed = found[active.effect.id](*more)
        if isinstance(own, Structure):
            handed, own = vars(handed), vars(own)
        np.testing.assert_equal(handed, own)


def test_a_form_by_load_is_the_form_of_that_load() -> None:
    form, place = BY_ID["form"], np.array([[0.05], [0.06]])
    loads = np.array([[3000.0], [4500.0]])
    rng = np.random.default_rng(5)
    values = {p.name: float(rng.normal(0.0, p.prior[1])) for p in form.parameters if p.prior}
    both = form.pressure(values, DRIVE, Site(loads, place, 0.3, 3600.0))
    for row, (load, half) in enumerate(zip(loads, place, strict=True)):
        own = dict(values)
        for name in (name for name in values if name.endswith("_by_load")):
            own[name] = 0.0
            own[name.removesuffix("_by_load")] += (load[0] / 3600.0 - 1.0) * values[name]
        alone = form.pressure(own, DRIVE, Site(load[None], half[None], 0.3, 3600.0))
        np.testing.assert_allclose(both[row], alone[0], rtol=1e-12, atol=1e-9)
