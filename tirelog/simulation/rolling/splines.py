"""Finite elements on a closed belt: periodic splines of degree five on equal elements.

    coefficients c (N,) --basis--> v(theta) = sum_j c_j B((theta - theta_0)/step - j), four times
                                   continuously differentiable

B_j lives on the elements j .. j + 5, so that element e sees the coefficients e - 5 .. e (modulo N).
All elements are equal: a matrix of basis integrals is circulant and banded, and is kept as its
stencil, shape (11,), offsets -5 .. 5.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline

from tirelog.vocabulary.arrays import FloatArray

#: degree of the belt's splines: bending and its shear are continuous
DEGREE = 5
_BASIS = BSpline.basis_element(np.arange(DEGREE + 2.0), extrapolate=False)


@dataclass(frozen=True)
class Splines:
    """`elements` equal elements around the belt, angles in [rad]."""

    elements: int

    @property
    def step_rad(self) -> float:
        return 2.0 * np.pi / self.elements

    @cached_property
    def middle_rad(self) -> FloatArray:
        """Where each basis function has its middle, shape (N,)."""
        return np.asarray((np.arange(self.elements) + 0.5 * (DEGREE + 1)) * self.step_rad, float)

    def local(self, place: FloatArray, derivative: int = 0) -> FloatArray:
        """The six functions that live at a place of an element, shape (n, 6).

        Or a derivative of them by the angle; `place` (n,) in [0, 1).
        """
        x = np.asarray(place, float)[:, None] + np.arange(DEGREE, -1, -1.0)
        basis = _BASIS.derivative(derivative) if derivative else _BASIS
        return np.asarray(np.nan_to_num(basis(x)) / self.step_rad**derivative, float)

    def gram(self, left: int, right: int) -> FloatArray:
        """Stencil of int B_i^(left) B_k^(right) dtheta, shape (11,).

        Over offsets k - i = -5 .. 5, by Gauss's rule (exact).
        """
        points, weights = np.polynomial.legendre.leggauss(DEGREE + 1)
        a, b = (self.local(0.5 * (points + 1.0), m) for m in (left, right))
        # a[:, i] is the function that began DEGREE - i elements ago
        shared = 0.5 * self.step_rad * (a * weights[:, None]).T @ b
        return np.array([np.trace(shared, offset) for offset in range(-DEGREE, DEGREE + 1)])

    @property
    def first_harmonic(self) -> float:
        """int B_j sin(theta) dtheta over sin(middle of B_j)."""
        half = 0.5 * self.step_rad
        return float(self.step_rad * (np.sin(half) / half) ** (DEGREE + 1))

    def functional(
        self, angle_rad: float, weights: dict[int, float], length_rad: float = 0.0
    ) -> FloatArray:
        """Row (N,) that reads sum_m weights[m] v^(m) at `angle_rad`.

        Or its mean over `length_rad` around it.
        """
        points, shares = (
            np.polynomial.legendre.leggauss(24) if length_rad else (np.zeros(1), np.full(1, 2.0))
        )
        place = ((angle_rad + 0.5 * length_rad * points) / self.step_rad) % self.elements
        element = np.clip(place.astype(int), 0, self.elements - 1)
        row = np.zeros(self.elements)
        index = (element[:, None] - DEGREE + np.arange(DEGREE + 1)) % self.elements
        for derivative, weight in weights.items():
            np.add.at(
                row, index, 0.5 * weight * shares[:, None] * self.local(place - element, derivative)
            )
        return row


def circulant(stencil: FloatArray, size: int) -> FloatArray:
    """The full matrix (size, size) of a stencil."""
    half = stencil.size // 2
    column = np.zeros((size, size))
    rows = np.arange(size)
    for offset, value in zip(range(-half, half + 1), stencil, strict=True):
        column[rows, (rows + offset) % size] += value
    return column
