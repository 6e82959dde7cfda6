"""Linear algebra in a given metric.

Columns out of residuals, normal matrices per manoeuvre, held-out losses.

Arrays are cells x angles x columns, (C, m, k); `manoeuvre` (C,) numbers the groups 0 ... M-1. A
metric is what the arrays were multiplied with before they came here: whitened for significance,
plain (shift removed, weighted by revolutions) for size.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tirelog.vocabulary.arrays import FloatArray, IntArray

#: singular values below this share of the largest are no directions: EJ, k, mu, y and load share
#: one scale; twice as much drops directions that are seen 1.4 times as well
RANK = 1e-7
#: cells that are worked on at a time
_BLOCK = 32
#: columns of free shapes that are worked on at a time
SOME_COLUMNS = 8


def stacked(columns: FloatArray) -> FloatArray:
    """Columns (..., k) as (N, k), all leading axes in one; k may be 0."""
    return columns.reshape(math.prod(columns.shape[:-1]), columns.shape[-1])


def orthonormal(columns: FloatArray) -> FloatArray:
    """Orthonormal basis (N, r) of the span of columns (..., k).

    All leading axes are flattened; scale-free in each column.

    Free shapes are many columns: beside them there are never more than two arrays of their size.
    """
    flat: FloatArray = stacked(columns)
    norm = np.linalg.norm(flat, axis=0)
    flat = flat[:, norm > 0] / norm[norm > 0]
    if not flat.shape[1]:
        return flat
    values, vectors = np.linalg.eigh(flat.T @ flat)
    keep = values > RANK * values[-1]
    basis: FloatArray = flat @ (vectors[:, keep] / np.sqrt(values[keep]))
    del flat
    basis -= basis @ (0.5 * (basis.T @ basis - np.eye(basis.shape[1])))
    return basis


def without(basis: FloatArray, x: FloatArray) -> FloatArray:
    """x (C, m) or (C, m, k) with its part in the span of `basis` (N, r) taken out."""
    flat = x.reshape(basis.shape[0], -1)
    taken = basis @ (basis.T @ flat)
    return np.subtract(flat, taken, out=taken).reshape(x.shape)


def in_blocks(operator: Callable[[slice, FloatArray], FloatArray], x: FloatArray) -> FloatArray:
    """operator(rows, x[rows]) for all cells of x (C, m, k), some at a time.

    What it needs besides its result stays small.
    """
    result = np.empty(x.shape)
    for start in range(0, x.shape[0], _BLOCK):
        rows = slice(start, start + _BLOCK)
        result[rows] = operator(rows, x[rows])
    return result


def side_by_side(
    metric: Callable[[FloatArray], FloatArray], parts: Sequence[FloatArray]
) -> FloatArray:
    """The metric of all columns of the parts (C, m, k), as one array.

    Some columns at a time, since free shapes are many.
    """
    result = np.empty((*parts[0].shape[:-1], sum(part.shape[-1] for part in parts)))
    first = 0
    for part in parts:
        for start in range(0, part.shape[-1], SOME_COLUMNS):
            some = part[..., start : start + SOME_COLUMNS]
            result[..., first : first + some.shape[-1]] = metric(some)
            first += some.shape[-1]
    return result


def per_group(products: FloatArray, group: IntArray) -> FloatArray:
    """Sums of (C, ...) over the members of each group (a manoeuvre, a log), (groups, ...)."""
    total = np.zeros((int(group.max()) + 1, *products.shape[1:]))
    np.add.at(total, group, products)
    return total


@dataclass(frozen=True)
class Normal:
    """Normal equations of each manoeuvre.

    gram (M, p, p), right (M, p), square (M,) of residual on columns.
    """

    gram: FloatArray
    right: FloatArray
    square: FloatArray

    @classmethod
    def of(cls, columns: FloatArray, residual: FloatArray, manoeuvre: IntArray) -> Normal:
        """columns (C, m, p), residual (C, m)."""
        swapped = np.swapaxes(columns, 1, 2)
        return cls(
            per_group(swapped @ columns, manoeuvre),
            per_group((swapped @ residual[..., None])[..., 0], manoeuvre),
            per_group((residual**2).sum(axis=1), manoeuvre),
        )


def solve_scaled(gram: FloatArray, right: FloatArray) -> FloatArray:
    """Least squares from normal equations, (..., p, p) and (..., p).

    Columns are scaled to one; directions without support stay at zero.
    """
    scale = np.sqrt(np.maximum(np.einsum("...ii->...i", gram), 1e-300))
    scale = np.where(scale > 1e-140, scale, np.inf)
    scaled = gram / scale[..., :, None] / scale[..., None, :]
    inverse = _inverse(scaled)
    return (inverse @ (right / scale)[..., None])[..., 0] / scale


def _inverse(gram: FloatArray) -> FloatArray:
    """The inverse of symmetric (..., p, p) on the directions that have support.

    Where all have, which the size of the plain inverse shows, that is it: for fifty columns it
    takes a tenth of the time of an eigenvalue problem, and a diagnosis beside nuisances a third
    less.
    """
    try:
        inverse = np.asarray(np.linalg.inv(gram), dtype=np.float64)
    except np.linalg.LinAlgError:
        return _inverse_on_support(gram)
    size = np.sqrt((inverse**2).sum(axis=(-2, -1)))
    poor = ~(size * gram.shape[-1] < 0.1 / RANK)
    if np.any(poor):
        inverse[poor] = _inverse_on_support(gram[poor])
    return inverse


def _inverse_on_support(gram: FloatArray) -> FloatArray:
    values, vectors = np.linalg.eigh(gram)
    good = values > RANK * values[..., -1:]
    inverse = np.where(good, 1.0 / np.where(good, values, 1.0), 0.0)
    return np.asarray((vectors * inverse[..., None, :]) @ np.swapaxes(vectors, -1, -2))
