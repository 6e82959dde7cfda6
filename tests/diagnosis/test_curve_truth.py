"""Property: curves are named on either side of a tread that leans, with unlike signs, and not in
its middle.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.diagnosis.planted import diagnosed
from tirelog.diagnosis.compare import start
from tirelog.inference.stacks.cut import stacks_from_logs
from tirelog.physics import Model
from tirelog.simulation import simulate, to_recording
from tirelog.simulation.scenario.schema import scenario_of

pytestmark = pytest.mark.slow

#: lean per g times the place across over the depth L^2 / 2R of the patch
EACH = np.radians(1.5) * 0.05 / (0.058**2 / (2 * 0.305))


@pytest.fixture(scope="module")
def log():
    driven = []
    for speed in (10.0, 14.0, 18.0, 14.0, 10.0, 16.0, 12.0, 18.0):
        driven.append({"duration_s": 3.0, "speed_m_s": speed})
        driven += [
            {"duration_s": 4.0, "speed_m_s": speed, "lateral_m_s2": a} for a in (3.5, 0.0, -3.5)
        ]
    gratings = {
        name: {
            "kind": "strain", "source": name, "surface": "outer", "noise": 2.0, "lateral_m": y,
            "angle_deg": 30.0,
        }
        for name, y in (("left", 0.05), ("middle", 0.0), ("right", -0.05))
    }  # fmt: skip
    lateral = {"kind": "lateral_acceleration", "source": "a", "noise": 0.02}
    scenario = scenario_of(
        {
            "seed": 460, "road": {"roughness": 0.003, "load_scatter": 0.003},
            "vehicle": {"roll_deg_per_g": 1.5}, "manoeuvres": driven,
            "channels": gratings | {"lateral": lateral},
        }
    )  # fmt: skip
    return to_recording(simulate(scenario))


@pytest.mark.parametrize(("side", "sign"), [("left", 1.0), ("right", -1.0), ("middle", 0.0)])
def test_a_curve_is_named_where_the_tread_has_two_sides(log, side, sign):
    model = Model.new("beam", radius_m=0.305, load_N=3434.0)
    base = start(list(stacks_from_logs([log], channel=side)), model)
    found = diagnosed(base)
    assert found.selected == (("cornering",) if sign else ())
    assert found.verdict == ("missing" if sign else "nothing_missing")
    if sign:
        strength = found.model.values["cornering.coefficient"]
        assert strength == pytest.approx(sign * EACH, rel=0.15)
