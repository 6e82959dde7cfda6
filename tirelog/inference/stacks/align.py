"""The wheel's angle at every sample.

Passages refined by a matched filter, and a smooth course between them.

    passage times (n,) [s] -> WheelAngle: theta(t) with theta(t_i) = 2 pi i, an interpolating cubic
                              spline (its slope is the speed)
    samples at theta, chunk by chunk -> sums by angle -> template T(phi)
    the same once more -> sums by revolution  y = b + a [T(phi) - s T'(phi)]  -> t_i moved by s

The matched filter uses the whole front around the patch, not its peak: a peak would follow whatever
an odd effect does to it. What is left of a shift is a nuisance of every cell (`cells`), so nothing
is learnt from absolute position.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from tirelog.inference.stacks.samples import Chunk, Samples
from tirelog.vocabulary.arrays import FloatArray

#: angles [rad] that the matched filter looks at, and the template's grid
FRONT_RAD = 1.0
_TEMPLATE_POINTS = 512


@dataclass(frozen=True)
class WheelAngle:
    """theta(t) through the passages `centre_s` (n,): 2 pi i at the i-th; outside of them it goes on
    at the speed of the end.
    """

    centre_s: FloatArray
    spline: CubicSpline

    @classmethod
    def through(cls, centre_s: FloatArray) -> WheelAngle:
        turns = 2.0 * np.pi * np.arange(centre_s.size)
        return cls(centre_s, CubicSpline(centre_s, turns, bc_type="natural"))

    def theta(self, time_s: FloatArray) -> FloatArray:
        """Angle [rad] at times [s], any shape."""
        first, last = self.centre_s[0], self.centre_s[-1]
        inside = np.clip(time_s, first, last)
        theta: FloatArray = self.spline(inside)
        beyond = inside != time_s
        if beyond.any():
            theta[beyond] += (time_s[beyond] - inside[beyond]) * self.spline(inside[beyond], 1)
        return theta

    def speed_rad_s(self, time_s: FloatArray) -> FloatArray:
        rate: FloatArray = self.spline(np.clip(time_s, self.centre_s[0], self.centre_s[-1]), 1)
        return rate


def split_turns(theta: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
    """(revolution, phi in [-pi, pi)) of angles theta."""
    turn = np.floor(theta / (2.0 * np.pi) + 0.5).astype(np.int64)
    return turn, theta - 2.0 * np.pi * turn


def turned(
    samples: Samples, angle: WheelAngle, chunk: Chunk
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """The samples of a chunk's turns: turn after the chunk's first, phi and value, (k,) each."""
    time_s, values = samples.read(chunk)
    turn, phi = split_turns(angle.theta(time_s))
    turn -= chunk.first
    mine = (turn >= 0) & (turn < chunk.stop - chunk.first)
    return turn[mine], phi[mine], values[mine]


class TemplateSums:
    """Counts and sums of samples by angle, from which the mean waveform follows."""

    def __init__(self) -> None:
        self._count = np.zeros(_TEMPLATE_POINTS, np.int64)
        self._angle, self._value = np.zeros(_TEMPLATE_POINTS), np.zeros(_TEMPLATE_POINTS)

    def add(self, phi: FloatArray, values: FloatArray) -> None:
        """More samples (N,) at angles (N,)."""
        bins = ((phi + np.pi) * (_TEMPLATE_POINTS / (2.0 * np.pi))).astype(
            np.int64
        ) % _TEMPLATE_POINTS
        self._count += np.bincount(bins, minlength=_TEMPLATE_POINTS)
        self._angle += np.bincount(bins, phi, _TEMPLATE_POINTS)
        self._value += np.bincount(bins, values, _TEMPLATE_POINTS)

    def curve(self) -> CubicSpline:
        """A periodic spline through bin means at the bins' mean angles."""
        full = self._count > 0
        angle, mean = self._angle[full] / self._count[full], self._value[full] / self._count[full]
        return CubicSpline(
            np.append(angle, angle[0] + 2.0 * np.pi), np.append(mean, mean[0]), bc_type="periodic"
        )


def template(phi: FloatArray, values: FloatArray) -> CubicSpline:
    """Mean waveform of samples (N,) at angles (N,)."""
    sums = TemplateSums()
    sums.add(phi, values)
    return sums.curve()


def front_fit(
    turn: NDArray[np.int64], phi: FloatArray, values: FloatArray, shape: CubicSpline, n: int
) -> tuple[FloatArray, FloatArray]:
    """Shift [rad] (n,) and amplitude (n,) of each revolution against the template by least squares
    near the patch; NaN where it cannot be.
    """
    near = np.abs(phi) < FRONT_RAD
    turn, phi, values = turn[near], phi[near], values[near]
    columns = (np.ones_like(phi), shape(phi), -shape(phi, 1))
    gram = np.empty((n, 3, 3))
    right = np.empty((n, 3))
    for i, a in enumerate(columns):
        right[:, i] = np.bincount(turn, a * values, n)
        for j, b in enumerate(columns[: i + 1]):
            gram[:, i, j] = gram[:, j, i] = np.bincount(turn, a * b, n)
    enough = np.bincount(turn, minlength=n) >= 8
    enough &= np.linalg.cond(np.where(enough[:, None, None], gram, np.eye(3))) < 1e16
    solution = np.full((n, 3), np.nan)
    solution[enough] = np.linalg.solve(gram[enough], right[enough][..., None])[..., 0]
    amplitude = solution[:, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = solution[:, 2] / amplitude
    bad = ~(np.abs(shift) < 0.3) | ~(amplitude > 0.2) | ~(amplitude < 5.0)
    return np.where(bad, np.nan, shift), np.where(bad, np.nan, amplitude)


def refine(samples: Samples, centre_s: FloatArray, rounds: int = 3) -> FloatArray:
    """Passage times (n,) after matched filtering.

    A passage whose front cannot be fitted keeps its time.
    """
    chunks = samples.chunks(centre_s, 0, centre_s.size)
    for _ in range(rounds):
        angle = WheelAngle.through(centre_s)
        sums = TemplateSums()
        for chunk in chunks:
            _, phi, values = turned(samples, angle, chunk)
            sums.add(phi, values)
        shape = sums.curve()
        shift = np.concatenate(
            [
                front_fit(*turned(samples, angle, chunk), shape, chunk.stop - chunk.first)[0]
                for chunk in chunks
            ]
        )
        shift = np.where(
            np.isfinite(shift),
            shift - np.nanmedian(shift) if np.isfinite(shift).any() else 0.0,
            0.0,
        )
        centre_s = centre_s + shift / angle.speed_rad_s(centre_s)
    return centre_s
