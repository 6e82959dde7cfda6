"""What a motion tells and the steady waveform does not.

Masses, damping and bristles, fitted to the answers to obstacles.

    TransientLogs, Model
        --damped least squares over the free names of `carcass.MOTION`
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
from tirelog.errors import UsageError
from tirelog.inference.motion import motion_names
from tirelog.inference.obstacle_log import TransientLog, around
from tirelog.physics.carcass.numbers import MOTION
from tirelog.physics.model.model import Model
from tirelog.vocabulary.arrays import FloatArray

#: A hit is fitted for so long [s] after it, with signals smoothed over so long [s], one pair after
#: the other.
_STAGES = ((0.03, 2e-3), (0.06, 1e-3), (0.12, 0.0), (0.2, 0.0))
_WINDOW_S = _STAGES[-1][0]
_ROUNDS, _SETTLED, _STEP = 6, 1e-2, 0.02
#: Steps of a hit's time [s] and phase [rad] for their derivatives.
_NUISANCE_STEPS = (1e-4, 1e-3)


@dataclass(frozen=True)
class Learned:
    """The model with values and errors of what was fitted, and the error (rms, the observable's
    unit) before and after; hits used.
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

    def view(self, model: Model) -> View:
        return view_of(
            self.log,
            *motion_at(self.log, model, self.rough_s, self.window_s),
            self.rough_s,
            self.window_s,
        )


def learn(logs: Sequence[TransientLog], model: Model) -> Learned:
    """The free parameters of `motion_names` fitted to all hits.  UsageError where none is free."""
    names = motion_names(model)
    if not names:
        raise UsageError(
            f"no free parameter that a motion tells; allowed are {', '.join(MOTION)}; "
            "free one in the model file"
        )
    events, nuisances = _events(logs, model)
    values = np.array([model.values[name] for name in names])
    views = [event.view(model) for event in events]
    begun = _left(views, nuisances, _STAGES[-1])
    for stage in _STAGES:
        values, nuisances, views, jacobian = _descend(
            events, model, names, values, nuisances, views, stage
        )
    left = _left(views, nuisances, _STAGES[-1])
    errors = _errors(left, jacobian, len(names))
    fitted = model.with_values(dict(zip(names, values)), se=dict(zip(names, errors)))
    return Learned(fitted, names, _rms(begun), _rms(left), len(events))


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


def _left(views: Sequence[View], nuisances: FloatArray, stage: tuple[float, float]) -> FloatArray:
    """What the model misses at all hits, in a stage's (window, smoothing), one after the other."""
    window_s, smoothed_s = stage
    parts = []
    for view, (time, phase) in zip(views, nuisances):
        # a view ends with the longest window
        seen = view.log.time_s[view.rows]
        left = view.left(float(time), float(phase))[
            : np.searchsorted(seen, seen[-1] - (_WINDOW_S - window_s))
        ]
        width = round(smoothed_s * view.log.rate_Hz)
        parts.append(uniform_filter1d(left, width) if width > 1 else left)
    return np.concatenate(parts)


def _descend(
    events: Sequence[_Event],
    model: Model,
    names: tuple[str, ...],
    values: FloatArray,
    nuisances: FloatArray,
    views: list[View],
    stage: tuple[float, float],
) -> tuple[FloatArray, FloatArray, list[View], FloatArray]:
    """Damped Gauss-Newton steps until they are small; values within their bounds."""
    low, high = (
        np.array([getattr(model.parameters[name], end) for name in names]) for end in ("min", "max")
    )
    damping = 1e-2
    left = _left(views, nuisances, stage)
    jacobian = _jacobian(events, model, names, values, nuisances, views, stage, left)
    for _ in range(_ROUNDS):
        scale = np.linalg.norm(jacobian, axis=0) + 1e-300
        scaled = jacobian / scale
        step = (
            -np.linalg.solve(scaled.T @ scaled + damping * np.eye(scale.size), scaled.T @ left)
            / scale
        )
        tried = np.clip(values + step[: values.size], low, high)
        moved = nuisances + step[values.size :].reshape(nuisances.shape)
        seen = [event.view(model.with_values(dict(zip(names, tried)))) for event in events]
        after = _left(seen, moved, stage)
        if after @ after >= left @ left:
            damping *= 10.0
            if damping > 1e3:
                break
            continue
        small = after @ after > (1.0 - _SETTLED) * (left @ left)
        values, nuisances, views, left, damping = (
            tried,
            moved,
            seen,
            after,
            max(damping / 5.0, 1e-4),
        )
        if small:
            break
        jacobian = _jacobian(events, model, names, values, nuisances, views, stage, left)
    return values, nuisances, views, jacobian


def _jacobian(
    events: Sequence[_Event], model: Model, names: tuple[str, ...], values: FloatArray,
    nuisances: FloatArray, views: list[View], stage: tuple[float, float], left: FloatArray,
) -> FloatArray:  # fmt: skip
    """Derivatives of `_left` by the parameters and by each hit's time and phase, (N, p + 2 h)."""
    columns = []
    for i, name in enumerate(names):
        step = _STEP * max(abs(values[i]), 0.1 * abs(model.parameters[name].probe))
        step = -step if values[i] + step > model.parameters[name].max else step
        moved = model.with_values(dict(zip(names, values + step * (np.arange(values.size) == i))))
        columns.append(
            (_left([event.view(moved) for event in events], nuisances, stage) - left) / step
        )
    for i in range(nuisances.size):
        step = _NUISANCE_STEPS[i % 2]
        shifted = nuisances + step * (np.arange(nuisances.size) == i).reshape(nuisances.shape)
        columns.append((_left(views, shifted, stage) - left) / step)
    return np.stack(columns, axis=1)


def _errors(left: FloatArray, jacobian: FloatArray, count: int) -> FloatArray:
    """Standard errors of the first `count`; what is missed counts as noise, correlated as it is."""
    spectrum = np.abs(np.fft.rfft(left, 2 * left.size)) ** 2
    covariance = np.fft.irfft(spectrum)[: left.size]
    fades = int(np.argmax(covariance <= 0.0)) or left.size
    together = 2.0 * float(np.sum(covariance[:fades])) / covariance[0] - 1.0
    variance = float(left @ left) / max(left.size - jacobian.shape[1], 1) * together
    scale = np.linalg.norm(jacobian, axis=0) + 1e-300
    inverse = np.linalg.pinv((jacobian / scale).T @ (jacobian / scale))
    errors: FloatArray = np.sqrt(variance * np.diag(inverse))[:count] / scale[:count]
    return errors


def _rms(left: FloatArray) -> float:
    return float(np.sqrt(np.mean(left**2)))
