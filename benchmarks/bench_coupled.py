"""The coupled ring: a cleat passed within one second of driving (goal: 5 s), the step that half of it confirms, and energy over 10 s.

OMP_NUM_THREADS=1 for one core.  CPU seconds, since a shared machine makes wall time say little.
"""

import time
from dataclasses import replace

import numpy as np

from tirelog.physics.coupled_ring import CoupledRing
from tirelog.physics.coupled_ring_motion import Drive, Motion, State, Stepper, simulate
from tirelog.physics.road import FlatRoad, cleat

TIRE = CoupledRing(EI=2.0, k_w=6.3e5, k_v=5.1e5, c_w=60.0, c_v=60.0, pb=1.2e5 * 0.14, R=0.3, k_t=8.75e7, rho_A=3.15, modes=40)
LOAD, SPEED = 1000.0, 20.0


def passage(step_s: float, duration_s: float) -> tuple[Motion, float, float]:
    """A 10 mm cleat at half a metre: the motion, CPU and wall seconds."""
    stepper = Stepper(
        TIRE,
        State.rolling(TIRE, LOAD, SPEED),
        Drive(lambda time_s: LOAD, lambda time_s: SPEED),
        cleat(0.5, 0.010, 0.030),
        step_s=step_s,
    )
    cpu, wall = time.process_time(), time.perf_counter()
    motion = simulate(stepper, duration_s, every=round(1e-3 / step_s))
    return motion, time.process_time() - cpu, time.perf_counter() - wall


def energy(lift_m: float) -> tuple[float, float]:
    """Largest deviation in 10 s without damping, relative to all energy and to that of the vibration it was started with."""
    tire = replace(TIRE, c_w=0.0, c_v=0.0, c_x=0.0)
    start, calm = State.rolling(tire, LOAD, SPEED), State.rolling(tire, LOAD, SPEED)
    start.hub, start.centre = start.hub + 1j * lift_m, start.centre + 1j * lift_m
    steppers = [Stepper(tire, state, Drive(lambda time_s: LOAD), FlatRoad()) for state in (start, calm)]
    begun, rest = (s.energy() + LOAD * s.state.hub.imag for s in steppers)
    motion = simulate(steppers[0], 10.0, every=37)
    away = float(np.abs(motion.energy_J + LOAD * motion.hub_z_m - begun).max())
    return away / begun, away / (begun - rest)


def main() -> None:
    coarse, cpu, wall = passage(1e-4, 1.0)
    print(f"cleat, 1 s of driving at 1e-4 s: {cpu:.2f} s cpu, {wall:.2f} s wall; spindle {np.ptp(coarse.spindle_z_N):.0f} N peak to peak")
    fine, cpu, wall = passage(5e-5, 1.0)
    off = np.abs(coarse.spindle_z_N - fine.spindle_z_N).max() / np.ptp(fine.spindle_z_N)
    print(f"the same at 5e-5 s: {cpu:.2f} s cpu, {wall:.2f} s wall; spindle force of the longer step within {off:.2%} of its range")
    for lift in (0.0005, 0.001):
        total, vibration = energy(lift)
        print(f"energy, 10 s undamped, dropped from {lift * 1e3:g} mm: {total:.1e} of all, {vibration:.1e} of the vibration's")


if __name__ == "__main__":
    main()
