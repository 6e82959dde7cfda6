"""Property: with the longitudinal force measured, the phase shift tells how far the sidewalls wind
up from how late the telemetry is. Truth by `simulate`.
"""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.wheel_cases import TORSIONAL_STIFFNESS_N_M2, Instruments, wheel_scenario
from tirelog.diagnosis.compare import compare
from tirelog.diagnosis.diagnose import diagnose
from tirelog.inference.measured import measured
from tirelog.physics import Model
from tirelog.simulation import simulate, to_recording
from tirelog.simulation.scenario.schema import Manoeuvre

RADIUS_M, DELAY_S = 0.305, 4e-4
PLAN = ((12, 9.0), (5, 20.0), (5, 24.0), (10, 24.0), (3, 13.0), (12, 13.0))


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


def two_pressures(*, forces):
    """Two logs of a late telemetry, at 2.0 and at 1.6 bar, in which the sidewalls do not yield."""
    plan = ((5, 10.0), (3, 18.0), (5, 18.0), (3, 12.0), (5, 12.0), (3, 22.0), (5, 22.0))
    logs = []
    for number, pressure in enumerate((2.0e5, 1.6e5)):
        drive = wheel_scenario(
            seed=8320 + number,
            pressure_Pa=pressure,
            with_=Instruments(delay_s=DELAY_S, forces=forces),
        )
        stiff = replace(drive.tire, torsional_stiffness_N_m2=None)
        moves = tuple(Manoeuvre(float(s), v, None) for s, v in plan)
        logs.append(to_recording(simulate(replace(drive, tire=stiff, manoeuvres=moves)), "log"))
    return diagnose(
        measured(logs, "phase_shift").stacks, Model.new("ring", "phase_shift", radius_m=RADIUS_M)
    )


@pytest.mark.slow
def test_a_delay_is_told_by_the_measured_force_and_confounded_without_it():
    told, untold = two_pressures(forces=True), two_pressures(forces=False)
    assert (told.verdict, told.selected) == ("missing", ("telemetry_delay",))
    strength = told.effects[0].strengths["delay_s"]
    assert abs(strength["value"] - DELAY_S) < 2.5 * strength["se"] < 0.02 * DELAY_S
    assert told.not_tested["speed_trend"] == ("replaces longitudinal_force_N, which is measured")
    assert untold.verdict == "ambiguous"
    assert {"telemetry_delay", "speed_trend"} <= set(untold.ambiguous_groups[0])
    for found in (told, untold):  # the zeros of two logs are no sign of their pressures
        assert "a zero of its own" in found.not_tested["inflation"]
