"""Difference operators on a closed grid: the truth's derivatives.

A grid has N points xi_j = (j - N/2) h around one loaded rolling circumference, the patch centre at
index N/2. A linear operator that is the same at every point is a circulant matrix; it is kept as
the discrete Fourier transform of its stencil, shape (N/2 + 1,), so that sums of stencils are sums
of arrays and the solution of a circulant system is a division. The stencils are finite differences
of order eight, not the derivatives' own symbols.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from tirelog.vocabulary.arrays import FloatArray

ComplexArray = NDArray[np.complex128]

#: points on either side of the central stencils: order eight up to the fourth derivative
HALF_WIDTH = 5


def central_weights(derivative: int, half_width: int = HALF_WIDTH) -> FloatArray:
    """Weights of the central difference of unit step, shape (2 half_width + 1,).

    From the moment conditions sum_j w_j j^m = m! [m = derivative].
    """
    offsets = np.arange(-half_width, half_width + 1)
    moments = np.vander(offsets.astype(float), increasing=True).T
    wanted = np.zeros(offsets.size)
    wanted[derivative] = math.factorial(derivative)
    weights = np.linalg.solve(moments, wanted)
    # even or odd to the last bit: what rounding leaves is multiplied by step^-derivative
    return np.asarray(0.5 * (weights + (-1) ** derivative * weights[::-1]), float)


@dataclass(frozen=True)
class Ring:
    """The closed grid of `points` points (even) around `circumference_m`.

    With its operators as transforms of stencils.
    """

    points: int
    circumference_m: float

    @property
    def step_m(self) -> float:
        return self.circumference_m / self.points

    @cached_property
    def xi_m(self) -> FloatArray:
        """Positions [m], shape (points,): -circumference/2 .. +circumference/2.

        The patch centre is at index points/2.
        """
        return np.asarray((np.arange(self.points) - self.points // 2) * self.step_m, float)

    @cached_property
    def derivatives(self) -> tuple[ComplexArray, ...]:
        """Transforms of the stencils of the 0th to 4th derivative by xi.

        Each of shape (points/2 + 1,).
        """
        return tuple(self.stencil(central_weights(m) / self.step_m**m) for m in range(5))

    def stencil(self, weights: FloatArray) -> ComplexArray:
        """Transform of the operator (A f)_j = sum_i weights_i f_(j + i), i from -half to half."""
        column = np.zeros(self.points)
        half = weights.size // 2
        for offset, weight in zip(range(-half, half + 1), weights, strict=True):
            column[-offset % self.points] += weight
        spectrum: ComplexArray = fft.rfft(column)
        if abs(weights.sum()) < 1e-9 * np.abs(weights).sum():
            spectrum[0] = 0.0
        return spectrum

    def kernel(self, values: FloatArray) -> ComplexArray:
        """Transform of a smoothing: even `values` at xi_m, scaled to sum to one."""
        return np.asarray(fft.rfft(np.fft.ifftshift(values / values.sum())))

    @cached_property
    def quarter_turn(self) -> ComplexArray:
        """The discrete Hilbert operator: every wave e^(i kappa xi), kappa > 0, times i.

        The mean and the shortest wave vanish.
        """
        symbol = np.full(self.points // 2 + 1, 1j)
        symbol[[0, -1]] = 0.0
        return symbol

    def transform(self, values: FloatArray) -> ComplexArray:
        """Discrete Fourier transform along the last axis."""
        return np.asarray(fft.rfft(values, axis=-1))

    def inverse(self, spectrum: ComplexArray) -> FloatArray:
        """Values on the grid from a transform, along the last axis."""
        return np.asarray(fft.irfft(spectrum, n=self.points, axis=-1))

    @cached_property
    def borders_m(self) -> FloatArray:
        """Borders of the cells around the points [m], shape (points + 1,)."""
        return np.asarray(
            (np.arange(self.points + 1) - 0.5 - self.points // 2) * self.step_m, float
        )

    def window(self, reach_m: float) -> slice:
        """The points within `reach_m` of the patch centre, and one more on either side."""
        half = min(int(reach_m / self.step_m) + 2, self.points // 2)
        return slice(self.points // 2 - half, min(self.points // 2 + half + 1, self.points))

    def point_load(self, position_m: FloatArray, amount: FloatArray) -> FloatArray:
        """Concentrated loads, shape (..., points).

        `amount` [N] at `position_m`, shared by two points so that force and moment are kept.
        """
        place = np.asarray(position_m, float) / self.step_m + self.points // 2
        left = np.floor(place).astype(int)
        share = place - left
        load = np.zeros((*np.shape(place), self.points))
        for index, weight in ((left, 1.0 - share), (left + 1, share)):
            np.put_along_axis(
                load,
                (index % self.points)[..., None],
                (weight * amount / self.step_m)[..., None],
                axis=-1,
            )
        return load
