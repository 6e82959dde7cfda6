"""Closed form: a form that follows the load is, at each load, the form of that load."""

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.physics.effects import BY_ID, Drive, Site

DRIVE = Drive.of(Conditions.of(2, speed_m_s=np.array([12.0, 25.0]), load_N=3500.0))


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
