"""When the waveform is solved anew, and the solutions, chunk by chunk.

drive --plan--> chunks of equal steps: the scenario's knot_s, or QUICK_STEP_S if the load changes
                within tenths of a second
      --World.solve--> solutions at one load, or at three on a rough road
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tirelog.simulation.scenario.drive import TrueDrive
from tirelog.simulation.steady.waveforms import Solution, World

#: knots of an ordinary chunk, and steps of the cells that are quick or not as a whole
CHUNK, CELL = 96, 12
#: step if loads that follow the acceleration change with it [s], and the jerk above which they
#: do [m/s^3]
QUICK_STEP_S, QUICK_JERK_M_S3 = 0.01, 0.05
#: relative step of the load between the three solutions; twice as far apart, a parabola through
#: the three is off by eight times as much between them
LOAD_STEP = 0.03


@dataclass(frozen=True)
class Span:
    """Times [start_s, end_s) of the log in `steps` equal steps."""

    start_s: float
    end_s: float
    steps: int

    @property
    def step_s(self) -> float:
        return (self.end_s - self.start_s) / self.steps


@dataclass(frozen=True)
class KnotChunk:
    """One span of the drive with its solutions at knots.

    The span's samples lie between the knots of `solutions`: its first knot is one step before the
    span, its last two steps behind. Solutions at the loads 1, 1 + LOAD_STEP, 1 - LOAD_STEP; the
    first alone on a smooth road.
    """

    span: Span
    knots: int
    solutions: list[Solution]


def plan_knots(
    drive: TrueDrive, step_s: float, quick: bool, start_s: float, end_s: float
) -> list[Span]:
    """The spans from start_s to end_s, in order.

    They are finer if `quick` and the acceleration changes.
    """
    cell = CELL * step_s
    cells = np.arange(np.floor(start_s / cell), np.ceil(end_s / cell) + 1).astype(int)
    jerks = np.abs(
        drive.speed(
            np.clip(
                np.linspace(cells[:-1] - 0.1, cells[1:] + 0.1, 80) * cell, 0.0, drive.time_s[-1]
            ),
            2,
        )
    ).max(axis=0)
    fine = (jerks > QUICK_JERK_M_S3) & (quick and step_s > QUICK_STEP_S)
    spans: list[Span] = []
    for number, finer in zip(cells[:-1].tolist(), fine.tolist(), strict=True):
        span = Span(
            number * cell, (number + 1) * cell, round(cell / QUICK_STEP_S) if finer else CELL
        )
        last = spans[-1] if spans else None
        if (
            last is not None
            and not finer
            and last.steps % CELL == 0
            and last.step_s > 0.9 * step_s
            and last.steps < CHUNK
        ):
            spans[-1] = Span(last.start_s, span.end_s, last.steps + CELL)
        else:
            spans.append(span)
    return spans


def chunks(world: World, start_s: float, end_s: float) -> Iterator[KnotChunk]:
    """Every span of the plan with its solutions."""
    scenario = world.scenario
    quick = (
        scenario.planted("traction") is not None or scenario.planted("load_transfer") is not None
    )
    factors = (1.0, 1.0 + LOAD_STEP, 1.0 - LOAD_STEP) if world.fluctuates else (1.0,)
    for span in plan_knots(world.drive, scenario.knot_s, quick, start_s, end_s):
        times = np.asarray(span.start_s + np.arange(-1, span.steps + 2) * span.step_s, float)
        middle = world.solve(world.instants(times))
        rest = [world.solve(world.instants(times, f), middle.w * f) for f in factors[1:]]
        yield KnotChunk(span, times.size, [middle, *rest])
