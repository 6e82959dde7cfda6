"""Fourier tools on the tread's circumference.

Powers, and the evaluation of a waveform at given angles.

A waveform f(phi) over one revolution is kept as its coefficients c_n, n = 0 ... K-1, shape (...,
K), with f(phi) = Re[ c_0 + 2 sum c_n exp(i n phi) ]. Strain has c_n ~ n^-4, because the parabola's
slope jumps at +-L. So K = 1024 leaves 2e-7 of the largest strain at the edges of the patch. A grid
of 3072 points with local cubic interpolation adds 4e-7 there.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft
from scipy.interpolate import BarycentricInterpolator

from tirelog.errors import ModelError
from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray, IntArray

# ---- Waveforms on their grids at the angles asked, each row at its own: four points and weights
# each.
#
# In one pass: 96 rows at 256 angles take 0.16 ms of CPU for numpy's 0.45, and a diagnosis has them
# interpolated some thousand times (23 November 2026, two shared cores, Python 3.11).


@compiled
def interpolated(
    grid: FloatArray,
    at: IntArray,
    before: FloatArray,
    here: FloatArray,
    after: FloatArray,
    beyond: FloatArray,
    out: FloatArray,
) -> None:
    """Fills `out` (n, m) with rows of `grid` (n or 1, points), which go round, at `at` (n or 1, m).

    before, here, after, beyond: weights (n or 1, m) of the point before each index, at it, and of
    the next two.
    """
    points = grid.shape[1]
    for row in range(out.shape[0]):
        g, i = min(row, grid.shape[0] - 1), min(row, at.shape[0] - 1)
        for j in range(at.shape[1]):
            k = at[i, j]
            total = before[i, j] * grid[g, k - 1 if k > 0 else points - 1]
            total += here[i, j] * grid[g, k]
            total += after[i, j] * grid[g, k + 1 if k + 1 < points else k + 1 - points]
            total += beyond[i, j] * grid[g, k + 2 if k + 2 < points else k + 2 - points]
            out[row, j] = total


# ---- A number of a model: value, bounds, unit, and whether a fit may move it.


@dataclass(frozen=True)
class Parameter:
    """One number of a model.

    `value` in `unit`, allowed within [min, max]; `free` says whether a fit moves it; `probe` is a
    typical size (not zero), used for steps, for plots and as a second start; `se` the standard
    error of the last fit, and `se_with_form` what it may be off by if the tire has a form of its
    own; `prior` mean and standard deviation before any data, if it has them.
    """

    name: str
    unit: str
    description: str
    value: float
    min: float
    max: float
    probe: float
    free: bool = True
    se: float | None = None
    se_with_form: float | None = None
    prior: tuple[float, float] | None = None

    def at(self, value: float | str, *, se: float | None = None) -> Parameter:
        """The same parameter with another value.

        ModelError if it is not a number within the bounds.
        """
        if isinstance(value, str):
            raise ModelError(f"{self.name} = {value}", allowed="a number is allowed", do="give one")
        return replace(self, value=float(value), se=se, se_with_form=None).checked()

    def within(self, minimum: float, maximum: float) -> Parameter:
        """The same parameter with other bounds."""
        return replace(self, min=float(minimum), max=float(maximum)).checked()

    def fixed(self) -> Parameter:
        """The same parameter, not moved by a fit."""
        return replace(self, free=False)

    def checked(self, label: str | None = None) -> Parameter:
        """Itself; ModelError if value and bounds contradict each other."""
        label = label or self.name
        if not (self.min < self.max and all(map(math.isfinite, (self.value, self.min, self.max)))):
            raise ModelError(
                f"{label}: value {self.value:g}, bounds [{self.min:g}, {self.max:g}] are no "
                "number in an interval",
                allowed="finite numbers with min < max are allowed",
                do="correct the parameter",
            )
        if not self.min <= self.value <= self.max:
            raise ModelError(
                f"{label} = {self.value:g} {self.unit} lies outside its bounds",
                allowed=f"allowed is [{self.min:g}, {self.max:g}]",
                do="change the value or give wider min and max",
            )
        return self


ComplexArray = NDArray[np.complex128]

#: Fourier modes of a waveform, and points of the uniform grid on which it is laid out. Twice as
#: many take twice as long; an edge of the patch is then resolved over half of the length.
MODES = 1024
GRID = 3 * MODES
#: The grid's angles: GRID points from 0, shape (GRID,); the second half is for negative angles.
STEP = 2.0 * np.pi / GRID
#: Waveforms that are laid out at once: they stay in the processor's cache. Twice as many leave it.
BLOCK = 96
_BLOCK = 32


def grid_angles() -> FloatArray:
    """Angles of the grid in (-pi, pi], in the grid's order, shape (GRID,)."""
    phi = np.arange(GRID) * STEP
    return np.where(phi > np.pi, phi - 2.0 * np.pi, phi)


def powers(angle: FloatArray) -> ComplexArray:
    """exp(i n angle) for n = 0 ... K-1, from `angle` of shape (n, 1) to (n, K).

    Two short tables and one product instead of K exponentials: exact to some 1e-15.
    """
    fine = np.exp(1j * angle * np.arange(_BLOCK))
    coarse = np.exp(1j * angle * (_BLOCK * np.arange(MODES // _BLOCK)))
    return np.asarray((coarse[:, :, None] * fine[:, None, :]).reshape(angle.shape[0], MODES))


def interpolation_shares(nodes: FloatArray, weights: FloatArray, at: FloatArray) -> FloatArray:
    """Shares (n, k) of values at `nodes` (k,) in the polynomial's through them `at` others (n,).

    The barycentric formula, with the nodes' own `weights` (k,).
    """
    through = BarycentricInterpolator(nodes, np.eye(nodes.size), wi=weights)
    return np.asarray(through(at), dtype=np.float64)


def to_grid(coefficients: ComplexArray) -> FloatArray:
    """Values on the grid, (..., K) to (..., GRID)."""
    return np.asarray(irfft(coefficients, GRID, axis=-1, norm="forward"))


def to_modes(values: FloatArray) -> ComplexArray:
    """Coefficients from values on the grid, (..., GRID) to (..., K)."""
    return np.asarray(rfft(values, axis=-1, norm="forward")[..., :MODES])


class Angles:
    """The angles at which waveforms are wanted, with their interpolation weights made once.

    `phi_rad` (m,) for all revolutions or (n, m), NaN allowed; `phi_variance` of a shape that
    broadcasts with it [rad^2] adds f''/2 times it: the mean over a bin of samples with that
    variance.
    """

    def __init__(self, phi_rad: FloatArray, phi_variance: FloatArray | float | None = None) -> None:
        given = np.zeros((1, 1)) if phi_variance is None else phi_variance
        phi, variance = np.broadcast_arrays(np.atleast_2d(phi_rad), np.atleast_2d(given))
        self.phi_rad = np.ascontiguousarray(phi, dtype=np.float64)
        self._spread = np.sqrt(variance)
        position = self.phi_rad / STEP
        floor = np.floor(position)
        t = position - floor
        u = 1.0 - t
        # cubic through four points: the chord, less the curvature that runs linearly from the first
        # to the second
        curved = variance * (0.5 / STEP**2)
        first = curved * u - t * u * (1.0 + u) / 6.0
        second = curved * t - t * u * (1.0 + t) / 6.0
        self._weights = np.stack(
            [first, u - 2.0 * first + second, t + first - 2.0 * second, second]
        )
        self._index = np.where(np.isfinite(floor), floor, 0.0).astype(np.int64) % GRID

    def take(self, rows: slice) -> Angles:
        """The angles of some revolutions."""
        if self.phi_rad.shape[0] == 1:
            return self
        part = copy(self)
        part.phi_rad, part._spread = self.phi_rad[rows], self._spread[rows]
        part._weights, part._index = self._weights[:, rows], self._index[rows]
        return part

    def mean(self, function: Callable[[FloatArray], FloatArray]) -> FloatArray:
        """Mean of a function of the angle over the samples' spread, (n or 1, m).

        At two angles a standard deviation to either side: f + f''/2 times the variance.
        """
        if not np.any(self._spread > 0.0):
            return function(self.phi_rad)
        return 0.5 * (function(self.phi_rad - self._spread) + function(self.phi_rad + self._spread))

    def evaluate(self, coefficients: ComplexArray, shares: FloatArray | None = None) -> FloatArray:
        """Values (n or 1, m) of waveforms given by coefficients (n or 1, K).

        With `shares` (n, k) each is so much of the k that are given.
        """
        grid = to_grid(coefficients)
        if shares is None or grid.shape[0] == 1:
            return self._between(grid)
        parts = []
        for start in range(0, shares.shape[0], BLOCK):
            rows = slice(start, start + BLOCK)
            parts.append(self.take(rows)._between(shares[rows] @ grid))
        return np.concatenate(parts)

    def _between(self, grid: FloatArray) -> FloatArray:
        """Values (n or 1, m) of waveforms on the grid (n or 1, GRID)."""
        rows = max(grid.shape[0], self._index.shape[0])
        out = np.empty((rows, self._index.shape[1]))
        before, here, after, beyond = self._weights
        interpolated(grid, self._index, before, here, after, beyond, out)
        return out
