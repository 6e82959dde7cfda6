"""A model against hits on obstacles: fit in time, comparison, what a motion tells."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.optimize import least_squares, minimize_scalar

from tirelog.data.recording import Conditions
from tirelog.data.road import road_of
from tirelog.diagnosis.answer import AnswerTable, excess_of, plain_fields
from tirelog.errors import UsageError
from tirelog.inference.fit.cells import LeastSquares, bounds, descend, errors_of
from tirelog.inference.measured import (
    DISTURBED,
    WINDOW_S,
    TransientLog,
    around,
    motion_names,
)
from tirelog.inference.stacks.align import split_turns
from tirelog.physics.carcass.numbers import MOTION
from tirelog.physics.model.model import Model
from tirelog.physics.moving.transient import (
    Course,
    Schedule,
    Transient,
    driven,
    free_rolling_radius,
)
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import shown
from tirelog.vocabulary.quality import OK, Quality, quality_text

# ---- When a hit happened, and what the model says of it.
#
# Four nuisance numbers per hit, found by least squares.
#
#     TransientLog, Model, rough time
#         --one motion of the model--> readings over (time of the hit, phase of the sensor)
#         --least squares--> Hit
#
# Nuisances: where the model's patch centre lies among the passages, from the steady revolutions
# around (`alignment`); the time at which the wheel's centre stood over the obstacle's beginning
# and a
# shift of the wheel's angle, fitted to what the obstacle added as measured, D = y - T(phi), so
# that a
# misfit of the model's steady waveform does not move them; and the level. Speed and load are
# those of
# the revolutions around it.


#: Nuisance numbers of a hit.
NUISANCES = 4
#: Its time is sought first among signals smoothed over _SMOOTH_S [s], on a grid, so far [turns]
#: from the rough time; then beside the best few on a fine grid and unsmoothed. Twice as coarse a
#: grid needs signals smoothed as much more; twice as many of the best take twice as long.
_SMOOTH_S, _GRID_S, _FINE_S, _BEST = 4e-3, 1e-3, 1e-4, 3
#: Turns before and after the rough time between which the hit is sought. Twice as far takes in the
#: passages before and after the one that was hit.
_BEFORE, _AFTER = 1.25, 0.5


@dataclass(frozen=True)
class Hit:
    """One passage over the obstacle, its samples in the window after it, (m,).

    In the observable's unit but for times, phase and shares.

    since_s  time since the hit; measured, predicted (steady + added + level); added: what the
             obstacle added as measured, missed: what of it the model's does not cover
    ordinal  its number in the log;  squares: (m,) of each of `_SQUARES`, charged for the nuisances
    """

    log: TransientLog
    time_s: float
    time_se_s: float
    alignment_rad: float
    phase_rad: float
    level: float
    speed_m_s: float
    since_s: FloatArray
    measured: FloatArray
    predicted: FloatArray
    added: FloatArray
    missed: FloatArray
    remarks: tuple[str, ...]
    ordinal: int = 0
    squares: Mapping[str, FloatArray] = field(default_factory=dict)

    def row(self) -> dict[str, Any]:
        """One row of the table by hit."""
        errors = _errors(self.squares)
        covered = _covered(errors)
        # A hit of which the model covers less than this share may be something else than the
        # obstacle. Twice as much marks also hits of which a third is explained.
        unlike = 0 if covered > 0.2 else Quality.UNLIKE
        return {
            "log": self.log.log,
            "channel": self.log.channel,
            "hit": self.ordinal,
            "time_s": self.time_s,
            "time_se_s": self.time_se_s,
            "speed_m_s": self.speed_m_s,
            "phase_deg": float(np.degrees(self.phase_rad)),
            "alignment_deg": float(np.degrees(self.alignment_rad)),
            "level": self.level,
            "samples": int(self.since_s.size),
            **errors,
            "covered": covered,
            "quality": quality_text(unlike),
        }

    def doubts(self) -> list[str]:
        """What a reader should know of the hit."""
        doubt = (
            f"{self.log.log}: the model covers little of what happened at {self.time_s:.4g} s; "
            "the obstacle's dimensions, the model, or another event are to be doubted"
        )
        return [*self.remarks, *[doubt] * (self.row()["quality"] != OK)]


def motion_at(
    log: TransientLog, model: Model, rough_s: float, window_s: float
) -> tuple[Transient, float]:
    """(the model's motion over the obstacle, the time in it at which the hit happens).

    At the speed and load around `rough_s`.
    """
    turn = 2.0 * np.pi / log.spin_rad_s
    around = np.linspace(rough_s - 2.0 * turn, rough_s + window_s, 64)
    around = around[(around >= log.time_s[0]) & (around <= log.time_s[-1])]
    slope, spin = np.polyfit(around - rough_s, log.wheel.speed_rad_s(around), 1)
    conditions = _conditions_at(log, rough_s - 1.5 * turn)
    load = float(conditions.load_N[0]) if conditions.known("load_N") else model.values["load_N"]
    # the axle's speed at which the model's wheel turns as the log's does
    radius = free_rolling_radius(
        model, replace(conditions, speed_m_s=np.array([log.radius_m * spin]))
    )
    # Distance [m] driven on a level road before the obstacle. Half a turn of a car's wheel, for
    # what the start leaves to die away; twice as much drives that metre more.
    run_up = 1.0 / (radius * spin)
    length, speed = run_up + window_s + 0.02, Schedule.constant(float(radius * spin))
    if abs(slope) > 1e-2 * spin:
        speeds = tuple(float(radius * (spin + slope * t)) for t in (-run_up, length - run_up))
        speed = Schedule((0.0, length), speeds)
    folder = Path(log.folder).parent if log.folder else None
    begins = 0.5 * (speed(0.0) + speed(run_up)) * run_up
    road = road_of(replace(log.road, spacing_m=None), begins, folder=folder)
    return driven(model, conditions, Course(speed, Schedule.constant(load), road, length)), run_up


def fit_hit(log: TransientLog, model: Model, rough_s: float, window_s: float = WINDOW_S) -> Hit:
    """The hit near `rough_s`, its nuisances fitted.

    The window ends after `window_s` or with the log.
    """
    window_s = min(window_s, log.time_s[-1] - rough_s)
    turn = 2.0 * np.pi / log.spin_rad_s
    view = view_of(log, model, rough_s, window_s)
    times = np.arange(rough_s - _BEFORE * turn, rough_s + _AFTER * turn, _GRID_S)
    best = _sought(view, times, max(round(_SMOOTH_S * log.rate_Hz), 1))

    def left_at(x: FloatArray) -> FloatArray:
        return view.left(best + 1e-3 * float(x[0]), float(x[1]))

    # largest phase [rad] of a hit, either way: twice as much lets a hit that the model does not
    # describe be turned as far until it seems to
    most = np.array([1.0, 0.2])
    found = least_squares(left_at, np.zeros(2), bounds=(-most, most), diff_step=[1e-3, 1e-3])
    time, phase = best + 1e-3 * float(found.x[0]), float(found.x[1])
    left, slopes = view.left(time, phase), np.asarray(found.jac, dtype=np.float64)
    variance = float(left @ left) / max(left.size - NUISANCES, 1)
    error = 1e-3 * float(np.sqrt(variance * np.linalg.pinv(slopes.T @ slopes)[0, 0]))
    return view.hit(time, error, phase, window_s)


def _conditions_at(log: TransientLog, time_s: float) -> Conditions:
    """Those of the revolution next to a time."""
    nearest = int(np.argmin(np.abs(log.conditions.time_s - time_s)))
    return log.conditions.take(np.array([nearest]))


def view_of(log: TransientLog, model: Model, rough_s: float, window_s: float) -> View:
    """The samples from before to after the hit beside the model's motion."""
    transient, reached = motion_at(log, model, rough_s, window_s)
    early = rough_s - _BEFORE * 2.0 * np.pi / log.spin_rad_s
    rows = (log.time_s >= early) & (log.time_s <= rough_s + window_s)
    aligned = alignment(log, transient.model, transient.conditions)
    return View(log, transient, reached, rows, aligned)


def alignment(log: TransientLog, model: Model, conditions: Conditions) -> float:
    """Angle [rad] of the model's patch where the passages are: its steady waveform laid on T."""
    phi = np.linspace(-np.pi, np.pi, 1024, endpoint=False)
    measured = log.steady_at(phi, np.full(phi.size, log.spin_rad_s))

    def left(shift: float) -> float:
        turned = np.mod(phi + shift + np.pi, 2.0 * np.pi) - np.pi
        missed = measured - model.predict(conditions, turned, surface=log.surface)[0]
        return float(np.sum((missed - missed.mean()) ** 2))

    # so far from the passages [rad]: twice as far reaches shapes that lie on the wrong side of the
    # patch
    near = (-0.15, 0.15)
    return float(minimize_scalar(left, bounds=near, method="bounded", options={"xatol": 1e-6}).x)


def _sought(view: View, times: FloatArray, width: int) -> float:
    """The time [s] at which the model's answer is most like the measured one."""
    # where the waveform is steep, a wheel that was turned a little off weighs more than the time of
    # the hit
    # Angle [rad] from the patch centre within which the steady waveform is steep. Twice as much
    # leaves an eighth less of the turn to find a hit's time by.
    apart = np.abs(split_turns(view.log.wheel.theta(view.log.time_s[view.rows]))[1]) > 0.4

    def loss(time: float, width: int) -> float:
        return float(np.sum(uniform_filter1d(view.left(time, 0.0) * apart, width) ** 2))

    losses = np.array([loss(time, width) for time in times.tolist()])
    low = np.flatnonzero((losses <= np.roll(losses, 1)) & (losses <= np.roll(losses, -1)))
    candidates = times[low[np.argsort(losses[low])[:_BEST]]]
    near = np.arange(-2.0 * _GRID_S, 2.0 * _GRID_S, _FINE_S)
    fine = (candidates[:, None] + near).ravel()
    return float(fine[int(np.argmin([loss(time, 1) for time in fine.tolist()]))])


@dataclass(frozen=True)
class View:
    """The samples `rows` of a log beside a motion that meets the obstacle at `reached` [s]."""

    log: TransientLog
    transient: Transient
    reached: float
    rows: NDArray[np.bool_]
    aligned_rad: float

    def _parts(
        self, time_s: float, phase_rad: float
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """(added by the model, steady as measured, motion's time, wheel's angle), (m,) each.

        The angle is that among the passages, if the hit is at `time_s`. Passages before and after
        tell it; between, where the obstacle disturbs them, it swings as the model's does.
        """
        log, motion = self.log, self.transient.motion
        when = log.time_s[self.rows] - time_s + self.reached
        begin = self.reached
        end = min(begin + DISTURBED[1] * 2.0 * np.pi / log.spin_rad_s, motion.time_s[-1])
        at = np.clip(when, begin, end)
        first, last = np.interp([begin, end], motion.time_s, motion.psi_rad)
        swing = np.interp(at, motion.time_s, motion.psi_rad) - first
        swing -= (last - first) * (at - begin) / (end - begin)
        theta = log.wheel.theta(when - self.reached + time_s) + phase_rad + swing
        added = self.transient.added(
            log.observable, theta + self.aligned_rad, when, surface=log.surface
        )
        added = np.where(when < motion.time_s[0], 0.0, added)
        spin = np.interp(when, motion.time_s, motion.omega_rad_s)
        return added, log.steady_at(theta, spin), when, theta

    def left(self, time_s: float, phase_rad: float) -> FloatArray:
        """Measured less steady as measured less added by the model, without its mean, (m,)."""
        added, steady, _, _ = self._parts(time_s, phase_rad)
        left = self.log.values[self.rows] - steady - added
        return np.asarray(left - left.mean(), dtype=np.float64)

    def hit(self, time_s: float, error_s: float, phase_rad: float, window_s: float) -> Hit:
        since = self.log.time_s - time_s
        window = replace(self, rows=(since >= 0.0) & (since <= window_s))
        added, steady, when, theta = window._parts(time_s, phase_rad)
        measured = self.log.values[window.rows]
        model = self.transient.at(
            self.log.observable, theta + self.aligned_rad, when, surface=self.log.surface
        )
        level = float(np.mean(measured - model))
        off = self.log.off()[window.rows]
        missed = measured - steady - added
        return Hit(
            self.log, time_s, error_s, self.aligned_rad, phase_rad, level,
            float(self.transient.conditions.speed_m_s[0]), since[window.rows], measured,
            model + level, off - off.mean(), missed - missed.mean(), self.transient.remarks,
        )  # fmt: skip


# ---- What a motion tells and the steady waveform does not.
#
# Masses, damping and bristles, fitted to the answers to obstacles.
#
#     TransientLogs, Model
#         --the descent of every fit, over the free names of `carcass.numbers.MOTION`
#           and (time, phase) of each hit--> FittedMotion
#
# What is fitted is what the obstacle added as measured, D = y - T(phi), over all hits together. A
# tire of a wrong mass rings out of step with the measured one, so that the least error may be far
# from the truth: the fit begins with the first moments after a hit, smoothed, and goes on to longer
# and plain signals. Parameters that the steady waveform tells stay as they are.


#: A hit is fitted for so long [s] after it, with signals smoothed over so long [s], one pair after
#: the other. The first stages see the blow alone, before an error of a frequency has become one of
#: phase; in stages twice as long it has become twice as large.
_STAGES = ((0.03, 2e-3), (0.06, 1e-3), (0.12, 0.0), (0.2, 0.0))
#: Steps of a stage at most, the share of the sum of squares that a further one has to gain, and
#: the step of a parameter for its derivative, relative. Twice as many steps take twice as long;
#: twice as long ones double what is not linear in a slope.
_STEPS, _SETTLED, _STEP = 6, 1e-2, 0.02
#: Steps of a hit's time [s] and phase [rad] for their derivatives; the descent moves them at most
#: ten times as far at once.
_NUISANCE_STEPS = (1e-4, 1e-3)


@dataclass(frozen=True)
class FittedMotion:
    """The model with values and errors of what was fitted.

    With the error (rms, the observable's unit) before and after, and the hits used.
    """

    model: Model
    names: tuple[str, ...]
    before: float
    after: float
    hits: int


def learn_motion(logs: Sequence[TransientLog], model: Model) -> FittedMotion:
    """The free parameters of `motion_names` fitted to all hits.  UsageError if none is free."""
    names = motion_names(model)
    if not names:
        raise UsageError(
            "no free parameter that a motion tells",
            allowed=f"allowed are {', '.join(MOTION)}",
            do="free one in the model file",
        )
    problem = _Hits(model, names, logs)
    theta = problem.start
    begun = problem.residual(theta)
    for stage in _STAGES:
        problem.stage = stage
        theta = descend(problem, theta, steps=_STEPS, settled=_SETTLED)[0]
    left = problem.residual(theta)
    slopes = problem.slopes(theta, np.ones(theta.size))
    known = errors_of(slopes, _variance(left, theta.size))
    count = len(names)
    errors = {n: s for n, s in zip(names, known.se[:count].tolist()) if np.isfinite(s)}
    fitted = model.with_values(dict(zip(names, theta[:count].tolist())), se=errors)
    before, after = (float(np.sqrt(np.mean(x**2))) for x in (begun, left))
    return FittedMotion(fitted, names, before, after, len(problem.events))


class _Hits(LeastSquares):
    """All hits as one problem of least squares.

    theta is the parameters, then time and phase of each hit; `stage` is how long after a hit and
    how smooth.
    """

    def __init__(self, model: Model, names: tuple[str, ...], logs: Sequence[TransientLog]) -> None:
        self.model, self.names, self.stage = model, names, _STAGES[-1]
        self._seen: tuple[tuple[list[float], float], list[View]] = ([], 0.0), []
        #: of each hit its log around it, its time and window [s]
        self.events: list[tuple[TransientLog, float, float]] = []
        start = [model.values[name] for name in names]
        for near, rough, window in (
            event for log in logs for event in _windows(log, self.stage[0])
        ):
            hit = fit_hit(near, model, rough, window)
            self.events.append((near, hit.time_s, window))
            start += [hit.time_s, hit.phase_rad]
        self.start = np.array(start)
        low, high = bounds(model, names)
        free = np.full(2 * len(self.events), np.inf)  # a hit's time and phase have no bounds
        self.low, self.high = np.append(low, -free), np.append(high, free)

    def sizes(self, theta: FloatArray) -> FloatArray:
        probes = [0.3 * abs(self.model.parameters[name].probe) for name in self.names]
        own = np.maximum(np.abs(theta[: len(probes)]), probes)
        return np.append(own, np.tile(10.0 * np.array(_NUISANCE_STEPS), len(self.events)))

    def left(self, theta: FloatArray) -> FloatArray:
        """What the model misses at all hits within the stage, one after the other, (N,)."""
        parts = []
        for view, at in zip(self._views(theta), theta[len(self.names) :].reshape(-1, 2).tolist()):
            left = view.left(*at)
            width = round(self.stage[1] * view.log.rate_Hz)
            parts.append(uniform_filter1d(left, width) if width > 1 else left)
        return np.concatenate(parts)

    def slopes(self, theta: FloatArray, size: FloatArray) -> FloatArray:
        left, steps = self.residual(theta), []
        for name, value in zip(self.names, theta.tolist()):
            step = _STEP * max(abs(value), 0.1 * abs(self.model.parameters[name].probe))
            steps.append(-step if value + step > self.model.parameters[name].max else step)
        steps += _NUISANCE_STEPS * len(self.events)
        columns = np.empty((left.size, theta.size))
        for i in reversed(range(theta.size)):  # hits first: they need no other motions
            moved = theta + steps[i] * (np.arange(theta.size) == i)
            columns[:, i] = (left - self.residual(moved)) / steps[i]
        return columns * size

    def _views(self, theta: FloatArray) -> list[View]:
        """The motions at the parameters, which take long: those of the last point are kept."""
        own, longest = theta[: len(self.names)].tolist(), self.stage[0]
        if self._seen[0] != (own, longest):
            model = self.model.with_values(dict(zip(self.names, own)))
            views = [view_of(log, model, at, min(longest, end)) for log, at, end in self.events]
            self._seen = (own, longest), views
        return self._seen[1]


def _variance(left: FloatArray, fitted: int) -> float:
    """Variance [unit^2] that one value of `left` (N,) counts with.

    After so many numbers are fitted; what is missed is taken for noise, correlated as it is.
    """
    covariance = np.fft.irfft(np.abs(np.fft.rfft(left, 2 * left.size)) ** 2)[: left.size]
    fades = int(np.argmax(covariance <= 0.0)) or left.size
    together = 2.0 * float(np.sum(covariance[:fades])) / float(covariance[0]) - 1.0
    return float(left @ left) / max(left.size - fitted, 1) * together


# ---- `compare` on transients.
#
# A coupled ring model's answer to an obstacle against a log.
#
#     TransientLogs, Model (fitted on the steady revolutions) --`fit_hit` each--> Hits
#         --a row per hit--> TransientComparison
#
# The model's own parameters are not touched here: what it says of an obstacle is a prediction,
# with
# four nuisance numbers per hit (when, phase, level, alignment), which the errors are charged for.
# Beside the error of the whole reading stand the model's error off the obstacle (`rmse_steady`),
# the
# repeatability of steady revolutions at the same wheel angles (`noise_floor`), what the obstacle
# added as measured (`added`) and what of that the model does not cover (`missed`). Errors in the
# observable's unit.


#: Angles over which errors off the obstacle are averaged. Twice as many leave half as many samples
#: for each mean.
_ANGLES = 128


#: mean squares of a hit: what the model leaves, its error off the obstacle, noise
#: floor, what the obstacle added as measured, and what of that the model's answer misses
_SQUARES = ("residual", "steady", "floor", "added", "missed")


def _errors(squares: Mapping[str, FloatArray]) -> dict[str, float]:
    """rmse, rmse_steady, noise_floor, excess, added, missed, of `_SQUARES`."""
    rmse, steady, floor, added, missed = (
        float(np.sqrt(max(squares[name].mean(), 0.0))) for name in _SQUARES
    )
    return {
        "rmse": rmse, "rmse_steady": steady, "noise_floor": floor, "excess": excess_of(rmse, floor),
        "added": added, "missed": missed,
    }  # fmt: skip


def _covered(errors: Mapping[str, float]) -> float:
    """The share of what the obstacle added above the floor that the model covers."""
    floor, added, missed = (errors[name] ** 2 for name in ("noise_floor", "added", "missed"))
    return 1.0 - max(missed - floor, 0.0) / max(added - floor, 1e-300)


@dataclass(frozen=True)
class TransientComparison:
    """All hits of all logs."""

    observable: str
    unit: str
    hits: tuple[Hit, ...]
    remarks: tuple[str, ...]

    def rows(self) -> list[dict[str, Any]]:
        """A row per hit."""
        return [hit.row() for hit in self.hits]

    def to_json(self) -> dict[str, Any]:
        """Totals over the hits, each as many samples as it has, and a row per hit."""
        rows = self.rows()
        of_all = {
            name: np.concatenate([hit.squares[name] for hit in self.hits]) for name in _SQUARES
        }
        numbers = _errors(of_all)
        numbers["covered"] = _covered(numbers)
        return plain_fields({**numbers, "nuisance_parameters": NUISANCES * len(rows), "hits": rows})

    def page(self) -> list[str | AnswerTable]:
        """What a terminal shows of the hits."""
        total, table = self.to_json(), self.hits_table()
        text = (
            f"obstacles: {len(self.hits)} hits; the model covers {100.0 * total['covered']:.0f} "
            f"% of what they added ({total['nuisance_parameters']} nuisance numbers: when, "
            "phase, level and alignment of each)"
        )
        return [text, table.columns(*table.names[:-2])]

    def hits_table(self, log_name: Callable[[str], str] = str) -> AnswerTable:
        """Hit by hit: what the obstacle added, what of it the model misses, errors and floor."""
        factor, unit = shown(self.observable, self.unit)
        sizes = ("added", "missed", "rmse", "rmse_steady", "noise_floor", "excess")
        rows = [
            [
                f"  {log_name(row['log'])} at {row['time_s']:.4f} +- {row['time_se_s']:.1g} s",
                row["speed_m_s"],
                *(row[name] * factor for name in sizes),
                f"{100.0 * row['covered']:.0f}",
                row["quality"],
            ]
            for row in self.rows()
        ]
        words = ("m/s", "added", "missed", "rmse", "steady", "floor", "excess", "covered [%]")
        return AnswerTable(f"Hit by hit, in {unit}", [f"in {unit}", *words, "quality"], rows)


def compare_transients(
    logs: Sequence[TransientLog], model: Model, *, unit: str
) -> TransientComparison:
    """The model's answer to every hit of the logs.

    ModelError if the model cannot be driven over their roads.
    """
    hits = tuple(
        _result(near, ordinal, fit_hit(near, model, rough, window), model)
        for log in logs
        for ordinal, (near, rough, window) in enumerate(_windows(log, WINDOW_S))
    )
    remarks = dict.fromkeys(remark for hit in hits for remark in hit.doubts())
    return TransientComparison(model.observable, unit, hits, tuple(remarks))


def _windows(log: TransientLog, most_s: float) -> Iterator[tuple[TransientLog, float, float]]:
    """Of each hit the log around it, its rough time, and how long it is seen [s]."""
    ends = [*(log.hits_s[1:] - 0.02).tolist(), np.inf]
    for rough, end in zip(log.hits_s.tolist(), ends, strict=True):
        yield around(log, rough), rough, min(most_s, end - rough, float(log.time_s[-1]) - rough)


def _result(log: TransientLog, ordinal: int, hit: Hit, model: Model) -> Hit:
    """The hit beside the errors off the obstacle at the same wheel angles."""
    off, error, near = log.off(), _steady_error(log, hit, model), np.flatnonzero(log.calm)
    phi = split_turns(log.wheel.theta(log.time_s))[1]
    bins = np.clip((phi + np.pi) * (_ANGLES / (2.0 * np.pi)), 0, _ANGLES - 1).astype(np.int64)
    rows = (log.time_s >= hit.time_s) & (log.time_s - hit.time_s <= hit.since_s[-1] + 1e-9)
    at_hit = bins[rows][: hit.since_s.size]
    answers = {"residual": hit.measured - hit.predicted, "added": hit.added, "missed": hit.missed}
    squares = {name: x**2 for name, x in answers.items()}
    for name, values in (("steady", error), ("floor", off)):
        squares[name] = _by_angle(values[near] ** 2, bins[near])[at_hit]
    # errors of the model are charged for its nuisances
    charged = hit.since_s.size / max(hit.since_s.size - NUISANCES, 1)
    for name in ("residual", "missed"):
        squares[name] *= charged
    return replace(hit, ordinal=ordinal, squares=squares)


def _steady_error(log: TransientLog, hit: Hit, model: Model) -> FloatArray:
    """Samples less the model's steady waveform, level removed, (N,).

    At the angle of the passages and at the hit's conditions.
    """
    conditions = _conditions_at(log, hit.time_s)
    phi = split_turns(log.wheel.theta(log.time_s) + hit.alignment_rad)[1]
    wave = model.predict(conditions, phi, surface=log.surface)[0]
    if log.observable == "radial_acceleration":
        # the frame's part does not follow the spin
        frame = model.predict(conditions, phi, observable="frame_acceleration")[0]
        speed = log.wheel.speed_rad_s(log.time_s) * log.radius_m
        wave = (wave - frame) * (speed / conditions.speed_m_s[0]) ** 2 + frame
    error = log.values - wave
    return np.asarray(error - error[log.calm].mean(), dtype=np.float64)


def _by_angle(squares: FloatArray, bins: NDArray[np.int64]) -> FloatArray:
    """Mean square per angle (_ANGLES,); if no sample fell in one, the mean of all."""
    count = np.bincount(bins, minlength=_ANGLES)
    total = np.bincount(bins, squares, minlength=_ANGLES)
    return np.where(count > 0, total / np.maximum(count, 1), squares.mean())
