"""Truth by `simulate`: with the longitudinal force measured, the phase shift tells how far the
sidewalls wind up from how late the telemetry is.
"""

from dataclasses import replace

import numpy as np

from benchmarks.wheel_cases import TORSIONAL_STIFFNESS_N_M2, Instruments, wheel_scenario
from tirelog.diagnosis.compare import compare
from tirelog.inference.measured import measured
from tirelog.physics import Model
from tirelog.simulation import simulate, to_recording
from tirelog.simulation.scenario.schema import Manoeuvre

RADIUS_M, DELAY_S = 0.305, 4e-4
PLAN = ((8, 9.0), (5, 20.0), (5, 24.0), (5, 24.0), (3, 13.0), (6, 13.0))


def test_wind_up_and_delay_are_parted_by_the_measured_force():
    drive = wheel_scenario(seed=8311, with_=Instruments(delay_s=DELAY_S, forces=True))
    plan = tuple(Manoeuvre(float(s), v, None) for s, v in PLAN)
    recording = to_recording(simulate(replace(drive, manoeuvres=plan)), "log")
    model = Model.new("ring", "phase_shift", radius_m=RADIUS_M)
    both = model.with_effect("wind_up", per_force_rad_N=1e-6)
    both = both.with_effect("telemetry_delay", delay_s=1e-5)
    stacks = measured([recording], "phase_shift").stacks
    found = compare(stacks, both)
    wanted = {
        "wind_up.per_force_rad_N": 1.0 / (2 * np.pi * RADIUS_M**2 * TORSIONAL_STIFFNESS_N_M2),
        "telemetry_delay.delay_s": DELAY_S,
    }
    for name, true in wanted.items():
        told = found.parameters[name]
        assert abs(told["value"] - true) < 3.0 * told["se"] < 0.15 * true, name
    assert found.rmse < 1.1 * found.noise_floor
    late = compare(stacks, model.with_effect("telemetry_delay", delay_s=1e-5))
    # drag grows with speed as a delay does: without the force the delay is hardly told
    name = "telemetry_delay.delay_s"
    assert late.parameters[name]["se"] > 5.0 * found.parameters[name]["se"]
    assert late.reduced_chi2 > 3.0 * found.reduced_chi2
