"""What a motion tells and the steady waveform does not.

Masses, damping and bristles, fitted to the answers to obstacles.

    TransientLogs, Model
        --the descent of every fit, over the free names of `carcass.numbers.MOTION`
          and (time, phase) of each hit--> Learned

What is fitted is what the obstacle added as measured, D = y - T(phi), over all hits together. A
tire of a wrong mass rings out of step with the measured one, so that the least error may be far
from the truth: the fit begins with the first moments after a hit, smoothed, and goes on to longer
and plain signals. Parameters that the steady waveform tells stay as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

from tirelog.diagnosis.obstacles.fit import View, fit_hit, motion_at, view_of
from tirelog.errors import ModelError, UsageError, or_refusal
from tirelog.inference.fit.descent import descend
from tirelog.inference.fit.errors import errors_of
from tirelog.inference.motion import motion_names
from tirelog.inference.obstacle_log import TransientLog, around
from tirelog.physics.carcass.numbers import MOTION
from tirelog.physics.model.model import Model
from tirelog.vocabulary.arrays import FloatArray

#: A hit is fitted for so long [s] after it, with signals smoothed over so long [s], one pair after
#: the other. The first stages see the blow alone, before an error of a frequency has become one of
#: phase; in stages twice as long it has become twice as large.
_STAGES = ((0.03, 2e-3), (0.06, 1e-3), (0.12, 0.0), (0.2, 0.0))
_WINDOW_S = _STAGES[-1][0]
#: Steps of a stage at most, the share of the sum of squares that a further one has to gain, and
#: the step of a parameter for its derivative, relative. Twice as many steps take twice as long;
#: twice as long ones double what is not linear in a slope.
_STEPS, _SETTLED, _STEP = 6, 1e-2, 0.02
#: Steps of a hit's time [s] and phase [rad] for their derivatives; the descent moves them at most
#: ten times as far at once.
_NUISANCE_STEPS = (1e-4, 1e-3)


@dataclass(frozen=True)
class Learned:
    """The model with values and errors of what was fitted.

    With the error (rms, the observable's unit) before and after, and the hits used.
    """

    model: Model
    names: tuple[str, ...]
    before: float
    after: float
    hits: int


@dataclass(frozen=True)
class _Event:
    """A hit: its log around it, rough time and window."""

    log: TransientLog
    rough_s: float
    window_s: float

    def view(self, model: Model, window_s: float) -> View:
        """The log beside the motion, for so long after the hit, at most to the window's end."""
        window_s = min(window_s, self.window_s)
        motion = motion_at(self.log, model, self.rough_s, window_s)
        return view_of(self.log, *motion, self.rough_s, window_s)


def learn_motion(logs: Sequence[TransientLog], model: Model) -> Learned:
    """The free parameters of `motion_names` fitted to all hits.  UsageError if none is free."""
    names = motion_names(model)
    if not names:
        raise UsageError(
            "no free parameter that a motion tells",
            allowed=f"allowed are {', '.join(MOTION)}",
            do="free one in the model file",
        )
    problem = _Hits(model, names, *_events(logs, model))
    theta = problem.start
    begun = problem.residual(theta)
    low, high = problem.bounds
    for stage in _STAGES:
        problem.stage = stage
        reached = descend(problem, theta, low, high, problem.sizes, steps=_STEPS, settled=_SETTLED)
        theta = reached.theta
    left = problem.residual(theta)
    slopes = problem.slopes(theta, np.ones(theta.size))
    known = errors_of(slopes, _variance(left, theta.size))
    count = len(names)
    errors = {n: s for n, s in zip(names, known.se[:count].tolist()) if np.isfinite(s)}
    fitted = model.with_values(dict(zip(names, theta[:count].tolist())), se=errors)
    return Learned(fitted, names, _rms(begun), _rms(left), len(problem.events))


def _events(logs: Sequence[TransientLog], model: Model) -> tuple[list[_Event], FloatArray]:
    """All hits, and time and phase of each by the model as it is, (h, 2)."""
    events, nuisances = [], []
    for log in logs:
        for i, rough in enumerate(log.hits_s):
            window = float(
                min(
                    [_WINDOW_S, *(log.hits_s[i + 1 : i + 2] - rough - 0.02), log.time_s[-1] - rough]
                )
            )
            near = around(log, float(rough))
            hit = fit_hit(near, model, float(rough), window)
            events.append(_Event(near, hit.time_s, window))
            nuisances.append((hit.time_s, hit.phase_rad))
    return events, np.array(nuisances)


class _Hits:
    """All hits as one problem of least squares.

    theta is the parameters, then time and phase of each hit; `stage` is how long after a hit and
    how smooth.
    """

    def __init__(
        self, model: Model, names: tuple[str, ...], events: Sequence[_Event], nuisances: FloatArray
    ) -> None:
        self.model, self.names, self.events = model, names, events
        self.start = np.concatenate([[model.values[n] for n in names], nuisances.ravel()])
        self.stage = _STAGES[-1]
        self._seen: tuple[tuple[bytes, float], list[View]] = (b"", 0.0), []

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Those of the parameters; a hit's time and phase have none."""
        parameters = [self.model.parameters[name] for name in self.names]
        free = np.full(self.start.size - len(parameters), np.inf)
        return (
            np.concatenate([[p.min for p in parameters], -free]),
            np.concatenate([[p.max for p in parameters], free]),
        )

    def sizes(self, theta: FloatArray) -> FloatArray:
        own = [max(abs(v), 0.3 * abs(self.model.parameters[n].probe)) for n, v in self._own(theta)]
        hits = (theta.size - len(own)) // 2
        return np.concatenate([own, np.tile(10.0 * np.array(_NUISANCE_STEPS), hits)])

    def residual(self, theta: FloatArray) -> FloatArray:
        return self._left(self._views(theta), theta)

    def square(self, theta: FloatArray) -> float:
        left = or_refusal(self.residual)(theta)
        return float("inf") if isinstance(left, ModelError) else float((left**2).sum())

    def slopes(self, theta: FloatArray, size: FloatArray) -> FloatArray:
        views, columns = self._views(theta), []
        left = self._left(views, theta)
        for i, (name, value) in enumerate(self._own(theta)):
            step = _STEP * max(abs(value), 0.1 * abs(self.model.parameters[name].probe))
            step = -step if value + step > self.model.parameters[name].max else step
            moved = theta + step * (np.arange(theta.size) == i)
            columns.append((left - self._left(self._made(moved), moved)) / step)
        for i in range(len(self.names), theta.size):
            step = _NUISANCE_STEPS[(i - len(self.names)) % 2]
            moved = theta + step * (np.arange(theta.size) == i)
            columns.append((left - self._left(views, moved)) / step)
        return np.stack(columns, axis=1) * size

    def _own(self, theta: FloatArray) -> list[tuple[str, float]]:
        return list(zip(self.names, theta.tolist()))

    def _views(self, theta: FloatArray) -> list[View]:
        """The motions at the parameters, which take long: those of the last point are kept."""
        key = theta[: len(self.names)].tobytes(), self.stage[0]
        if self._seen[0] != key:
            self._seen = key, self._made(theta)
        return self._seen[1]

    def _made(self, theta: FloatArray) -> list[View]:
        model = self.model.with_values(dict(self._own(theta)))
        return [event.view(model, self.stage[0]) for event in self.events]

    def _left(self, views: Sequence[View], theta: FloatArray) -> FloatArray:
        """What the model misses at all hits within the stage, one after the other, (N,)."""
        parts = []
        for view, (time, phase) in zip(views, theta[len(self.names) :].reshape(-1, 2)):
            left = view.left(float(time), float(phase))
            width = round(self.stage[1] * view.log.rate_Hz)
            parts.append(uniform_filter1d(left, width) if width > 1 else left)
        return np.concatenate(parts)


def _variance(left: FloatArray, fitted: int) -> float:
    """Variance [unit^2] that one value of `left` (N,) counts with.

    After so many numbers are fitted; what is missed is taken for noise, correlated as it is.
    """
    spectrum = np.abs(np.fft.rfft(left, 2 * left.size)) ** 2
    covariance = np.fft.irfft(spectrum)[: left.size]
    fades = int(np.argmax(covariance <= 0.0)) or left.size
    together = 2.0 * float(np.sum(covariance[:fades])) / float(covariance[0]) - 1.0
    return float(left @ left) / max(left.size - fitted, 1) * together


def _rms(left: FloatArray) -> float:
    return float(np.sqrt(np.mean(left**2)))
