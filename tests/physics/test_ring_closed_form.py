"""Closed form: what holds exactly of the ring (P3 with the errata)."""

import numpy as np
import pytest

from tirelog.api.models import forces
from tirelog.data.recording import Conditions
from tirelog.physics import Model

EI, KW, KV, P0, B, R, RHO_A, L, F, Y = 2.0, 6.3e5, 5.1e5, 1.2e5, 0.14, 0.3, 3.15, 0.04, 1000.0, 3e-4
PHI = np.linspace(-np.pi, np.pi, 1501)[:-1]


def ring(**more):
    values = {
        "flexural_stiffness_N_m2": EI, "radial_stiffness_N_m2": KW, "tangential_stiffness_N_m2": KV,
        "inflation_pressure_Pa": P0, "width_m": B, "radius_m": R, "line_mass_kg_m": RHO_A,
        "patch_half_length_m": L, "load_N": F, "reference_load_N": F, "lever_arm_m": Y,
    }  # fmt: skip
    return Model.new("ring", contact="prescribed", **{**values, **more})


def drive(speed=10.0, **more):
    return Conditions.of(1, speed_m_s=speed, **more)


def test_no_speed_trend_without_damping():
    slow, fast = (ring().predict(drive(v), PHI) for v in (1.0, 90.0))
    assert np.array_equal(slow, fast)
    damped = ring(radial_damping_N_s_m2=50.0)
    assert not np.allclose(damped.predict(drive(1.0), PHI), damped.predict(drive(90.0), PHI))


@pytest.mark.parametrize("speed", [0.0, 10.0, 60.0])
def test_a_road_load_reaches_the_hub(speed):
    for model in (ring(), ring(radial_damping_N_s_m2=80.0, tangential_damping_N_s_m2=30.0)):
        told = forces(model, {"speed_m_s": speed, "load_N": 1000.0})
        assert told["hub_vertical_N"][0] == pytest.approx(1000.0, rel=1e-9)
        assert told["hub_longitudinal_N"][0] == pytest.approx(0.0, abs=1e-6)


PATCH = {"load_N": F, "patch_half_length_m": L, "reference_load_N": F, "lever_arm_m": Y}


def test_ring_curvature_turns_the_beam_into_the_ring():
    values = {"radius_m": R, "flexural_stiffness_N_m2": EI, "line_mass_kg_m": RHO_A, **PATCH}
    beam = Model.new("beam", foundation_stiffness_N_m2=KW, **values)
    bent = beam.with_effect("ring_curvature", fraction=1.0, tangential_stiffness_N_m2=KV)
    closed = ring(inflation_pressure_Pa=0.0).predict(drive(20.0), PHI)
    # the ring's road load has a tangential part, of order phi at the edges
    off, before = (np.abs(m.predict(drive(20.0), PHI) - closed).max() for m in (bent, beam))
    assert off < 0.03 * np.abs(closed).max()
    assert before > 0.2 * np.abs(closed).max()
