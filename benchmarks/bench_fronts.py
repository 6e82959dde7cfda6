"""Fronts at constant 10 m/s on a simulated carcass against the Cramer-Rao bound of its own flanks.

    python -m benchmarks.bench_fronts

The bound: samples of a passage in white noise of known size, the flank's form known, its place not;
entry and exit each from the quarter of a turn on their side of the patch's middle. Truth (shift,
and the load's width up to a constant and a factor) by the simulation.
"""

from dataclasses import replace

import numpy as np

from benchmarks.wheel_cases import Instruments, wheel_scenario
from tirelog.simulation import simulate, to_recording
from tirelog.simulation.scenario.schema import Manoeuvre, Scenario
from tirelog.wheel.angle import encoder_of
from tirelog.wheel.phase_shift import EdgeTimes, measure_phase_shift

SPEED_M_S, SECONDS, SEEDS, GRAVITY = 10.0, 25.0, range(8000, 8004), 9.80665


def scenario(seed: int, noise_g: float, roughness: float = 0.01) -> Scenario:
    plan = wheel_scenario(
        seed=seed, with_=Instruments(acceleration_noise_g=noise_g), roughness=roughness
    )
    return replace(plan, manoeuvres=(Manoeuvre(SECONDS, SPEED_M_S, None),))


def bounds_deg() -> tuple[float, float]:
    """(shift, width) at a noise of 1 g, from the slopes of the mean passage of a log almost without
    noise.
    """
    recording = to_recording(simulate(scenario(8000, 0.05, roughness=0.0)), "bound")
    found = next(measure_phase_shift(recording))
    middle = float(np.mean(found.entry_deg + found.width_deg / 2))
    channel = recording.of_kind("radial_acceleration")[0]
    time = channel.axis.time()
    phi = (
        np.mod(np.rad2deg(encoder_of(recording)[1].angle.at(time)) - middle + 180.0, 360.0) - 180.0
    )
    edges = np.arange(-90.0, 90.01, 0.1)
    inside = np.isfinite(phi)
    count, total = (
        np.histogram(phi[inside], edges, weights=w)[0] for w in (None, channel.read()[inside])
    )
    slope = np.gradient(total / np.maximum(count, 1), 0.1)
    step = np.rad2deg(SPEED_M_S / found.radius_m / channel.axis.rate_Hz)
    side = np.split(slope, 2)
    entry, leave = (GRAVITY / np.sqrt(np.sum(s**2) * 0.1 / step) for s in side)
    return float(np.hypot(entry, leave)) / 2, float(np.hypot(entry, leave))


def errors_deg(found: EdgeTimes, truth: dict[str, list[float]]) -> tuple[float, float, float]:
    """(shift, width) rms without their constants, and the share of the passages found."""
    nearest = np.abs(np.array(truth["time_s"])[:, None] - found.time_s).argmin(axis=1)
    angle, width = np.rad2deg(truth["wheel_angle_rad"]), np.array(truth["patch_width_deg"])
    shift = (found.entry_deg + found.width_deg / 2)[nearest] - angle
    shift = np.mod(shift - shift[0] + 180.0, 360.0)
    design = np.stack([np.ones(width.size), width], axis=1)
    measured = found.width_deg[nearest]
    left = measured - design @ np.linalg.lstsq(design, measured, rcond=None)[0]
    return float(np.std(shift)), float(np.std(left)), float(np.mean(found.good))


def main() -> None:
    shift, width = bounds_deg()
    for noise in (1.2, 3.0):
        rows = []
        for seed in SEEDS:
            simulated = simulate(scenario(seed, noise))
            found = next(measure_phase_shift(to_recording(simulated, "log")))
            rows.append(errors_deg(found, simulated.truth["channels"]["acceleration"]["passages"]))
        rms = np.sqrt(np.mean(np.square(rows), axis=0))
        print(
            f"{noise:g} g at {SPEED_M_S:g} m/s: shift {rms[0]:.4f} degree rms (bound "
            f"{noise * shift:.4f}), width {rms[1]:.4f} (bound {noise * width:.4f}), "
            f"{100 * np.mean(rows, axis=0)[2]:.1f} % of the passages"
        )


if __name__ == "__main__":
    main()
