"""The coupled ring: a cleat passed within one second of driving (goal: 5 s), the step that half of
it confirms, what the command takes for it with two sensors, and energy over 10 s.

CPU seconds, since a shared machine makes wall time say little. The kernels are compiled (once for a
machine) before the clock starts.
"""

import time
from dataclasses import replace

import numpy as np

from tests.physics.coupled_tire import TIRE
from tirelog.data.recording import Conditions
from tirelog.data.setup import parse_road
from tirelog.physics import Model
from tirelog.physics.moving.road import RoadProfile, cleat, road_of
from tirelog.physics.moving.transient import (
    Course,
    HubMotion,
    RingMotion,
    Schedule,
    State,
    Stepper,
    driven,
    stepped_motion,
)

LOAD, SPEED = 1000.0, 20.0


def passage(step_s: float, duration_s: float) -> tuple[RingMotion, float, float]:
    """A 10 mm cleat at half a metre: the motion, CPU and wall seconds."""
    stepper = Stepper(
        TIRE,
        State.rolling(TIRE, LOAD, SPEED),
        HubMotion(lambda time_s: LOAD, lambda time_s: SPEED),
        cleat(0.5, 0.010, 0.030),
        step_s=step_s,
    )
    cpu, wall = time.process_time(), time.perf_counter()
    motion = stepped_motion(stepper, duration_s, every=round(1e-3 / step_s))
    return motion, time.process_time() - cpu, time.perf_counter() - wall


def sensed() -> float:
    """CPU seconds of one second over the cleat as `model predict --road` does it: motion, strain
    and acceleration of two sensors.
    """
    model = Model.new(
        "coupled_ring", load_N=3434.0, radius_m=0.305, inflation_pressure_Pa=2.2e5, width_m=0.215
    )
    road = road_of(parse_road("cleat,height_m=0.01,length_m=0.04"), 0.5)
    course = Course(Schedule.constant(SPEED), Schedule.constant(3434.0), road, 1.0)
    cpu = time.process_time()
    transient = driven(model, Conditions.of(1, speed_m_s=SPEED), course)
    for theta in (1.0, 2.0):
        for observable in ("strain", "radial_acceleration"):
            transient.sensed(observable, theta)
    return time.process_time() - cpu


def energy(lift_m: float, step_s: float) -> tuple[float, float]:
    """Largest deviation in 10 s without damping, relative to all energy and to that of the
    vibration it was started with.
    """
    tire = replace(TIRE, c_w=0.0, c_v=0.0, c_x=0.0)
    start, calm = State.rolling(tire, LOAD, SPEED), State.rolling(tire, LOAD, SPEED)
    start.hub, start.centre = start.hub + 1j * lift_m, start.centre + 1j * lift_m
    steppers = [
        Stepper(tire, state, HubMotion(lambda time_s: LOAD), RoadProfile(), step_s=step_s)
        for state in (start, calm)
    ]
    begun, rest = (s.energy() + LOAD * s.state.hub.imag for s in steppers)
    motion = stepped_motion(steppers[0], 10.0, every=37)
    away = float(np.abs(motion.energy_J + LOAD * motion.hub_z_m - begun).max())
    return away / begun, away / (begun - rest)


def main() -> None:
    passage(1e-4, 1e-3)
    coarse, cpu, wall = passage(1e-4, 1.0)
    print(
        f"cleat, 1 s of driving at 1e-4 s: {cpu:.2f} s cpu, {wall:.2f} s wall; "
        f"spindle {np.ptp(coarse.spindle_z_N):.0f} N peak to peak"
    )
    fine, cpu, wall = passage(5e-5, 1.0)
    off = np.abs(coarse.spindle_z_N - fine.spindle_z_N).max() / np.ptp(fine.spindle_z_N)
    print(
        f"the same at 5e-5 s: {cpu:.2f} s cpu, {wall:.2f} s wall; spindle force of the longer "
        f"step within {off:.2%} of its range"
    )
    print(f"the same with two sensors, as the command does it: {sensed():.2f} s cpu")
    for step in (1e-4, 5e-5):
        total, vibration = energy(0.001, step)
        print(
            f"energy, 10 s undamped, dropped from 1 mm, {step:g} s: {total:.1e} of all, "
            f"{vibration:.1e} of the vibration's"
        )


if __name__ == "__main__":
    main()
