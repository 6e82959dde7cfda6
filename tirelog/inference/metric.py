"""What is beside the model, in a metric: one free offset per log, and shared random effects.

    Cells, metric -> a log's column is 1 in its own cells, 0 elsewhere: whitened, one array (C, m)
                     for all logs together
                  -> the columns of the shared effects, each as large as its standard deviation

The level of a log's baseline is no physics. A metric couples no two manoeuvres and a
manoeuvre belongs to one log, so the columns of two logs never meet: each is projected out alone,
and the number of logs costs neither memory nor time. A shared effect is not projected out but
shrunk by what its standard deviation allows: the sum of squares left is the least one that
amplitudes can leave, their own squares in standard deviations counted with it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from tirelog.inference.cells.cells import Cells
from tirelog.vocabulary.arrays import FloatArray, IntArray

# ---- Linear algebra in a given metric.
#
# Columns out of residuals, normal matrices per manoeuvre, held-out losses.
#
# Arrays are cells x angles x columns, (C, m, k); `manoeuvre` (C,) numbers the groups 0 ... M-1. A
# metric is what the arrays were multiplied with before they came here: whitened for significance,
# plain (shift removed, weighted by revolutions) for size.


#: singular values below this share of the largest are no directions: EJ, k, mu, y and load share
#: one scale; twice as much drops directions that are seen 1.4 times as well
RANK = 1e-7
#: cells, and manoeuvres that are left out, that are worked on at a time
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


def projected_out(basis: FloatArray, x: FloatArray, shrink: FloatArray | None = None) -> FloatArray:
    """x (C, m) or (C, m, k) with its part in the span of `basis` (N, r) taken out.

    `shrink` (r,): the share of it along each direction, all if there is none.
    """
    flat = x.reshape(basis.shape[0], -1)
    along = basis.T @ flat
    taken = basis @ (along if shrink is None else shrink[:, None] * along)
    return np.subtract(flat, taken, out=taken).reshape(x.shape)


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


class Normal(NamedTuple):
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

    def beside(self, more: Normal, crossed: FloatArray) -> Normal:
        """With the columns of another (M, k) behind its own.

        `crossed` (M, p, k): products of its columns with the other's.
        """
        gram = np.block([[self.gram, crossed], [np.swapaxes(crossed, 1, 2), more.gram]])
        return Normal(gram, np.concatenate([self.right, more.right], axis=1), self.square)

    def solved(self) -> tuple[FloatArray, FloatArray]:
        """What the columns' strengths are in each manoeuvre, (M, p), and their variances (M, p)."""
        spread = solve_scaled(self.gram[:, None], np.eye(self.right.shape[1]))
        return solve_scaled(self.gram, self.right), np.einsum("mii->mi", spread)


def solve_scaled(gram: FloatArray, right: FloatArray) -> FloatArray:
    """Least squares from normal equations, (..., p, p) and (..., p).

    Columns are scaled to one; directions without support stay at zero.
    """
    scale = np.sqrt(np.maximum(np.einsum("...ii->...i", gram), 1e-300))
    scale = np.where(scale > 1e-140, scale, np.inf)
    scaled = gram / scale[..., :, None] / scale[..., None, :]
    inverse = _inverse(scaled)
    return (inverse @ (right / scale)[..., None])[..., 0] / scale


def made_of(columns: FloatArray, values: FloatArray) -> FloatArray:
    """How much of each column (C, m, k) is nearest to values (C, m), cell by cell, (C, k)."""
    swapped = np.swapaxes(columns, 1, 2)
    return solve_scaled(swapped @ columns, (swapped @ values[..., None])[..., 0])


def _inverse(gram: FloatArray) -> FloatArray:
    """The inverse of symmetric (..., p, p) on the directions that have support.

    Where all have, which the size of the plain inverse shows, that is it: for fifty columns it
    takes a tenth of the time of an eigenvalue problem, and a diagnosis beside nuisances a third
    less.
    """
    try:
        inverse = np.asarray(np.linalg.inv(gram), dtype=np.float64)
    except np.linalg.LinAlgError:
        inverse = np.full(gram.shape, np.nan)
    size = np.sqrt((inverse**2).sum(axis=(-2, -1)))
    poor = ~(size * gram.shape[-1] < 0.1 / RANK)
    if np.any(poor):
        values, vectors = np.linalg.eigh(gram[poor])
        good = values > RANK * values[..., -1:]
        share = np.where(good, 1.0 / np.where(good, values, 1.0), 0.0)
        inverse[poor] = (vectors * share[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    return inverse


# ---- The metric in which residuals are judged.
#
# One linear operator per manoeuvre that makes repeatable noise white.
#
#     x (C, m, k) -> x / sd -> per cell: shift removed, shrunk along the random effects of
#     revolutions
#                           -> per manoeuvre: shrunk along the random effects of manoeuvres
#                 -> (C, m, k)
#
# With columns B of covariance T the covariance I + B T B' has the inverse root
#
#     I - Q (1 - 1/sqrt(1 + D)) Q',  Q D Q' = B T B':
#
# a small singular value decomposition per cell or manoeuvre, no N x N matrix. Infinite variance
# removes a direction. Empty bins become zero.


@dataclass(frozen=True)
class Whitener:
    """What whitens cells: noise, and shrinkage along correlated errors.

    `inverse_sd` (C, m), zero if empty; per cell basis (C, m, k) and shrinkage (C, k); the same per
    manoeuvre (each observable's own), rows of its cells.
    """

    inverse_sd: FloatArray
    basis: FloatArray
    shrink: FloatArray
    groups: tuple[NDArray[np.int64], ...] = ()
    group_basis: tuple[FloatArray, ...] = ()
    group_shrink: tuple[FloatArray, ...] = ()

    @property
    def freedom(self) -> float:
        """The number of values that count, less those that the shrinkage takes out of chi-square.

        As the expectation under the covariance is one per value.
        """
        return float((self.inverse_sd > 0).sum() - (self.shrink > 0.999999).sum())

    def __call__(self, x: FloatArray) -> FloatArray:
        """Whitened x, shape (C, m) or (C, m, k); NaN in empty bins is allowed."""
        if x.size == 0:
            return x
        columns = x.reshape(*x.shape[:2], -1)
        white = np.empty(columns.shape)
        for start in range(0, len(x), _BLOCK):  # some cells at a time: what they need stays small
            rows = slice(start, start + _BLOCK)
            inverse, basis = self.inverse_sd[rows, :, None], self.basis[rows]
            own = np.where(inverse > 0, columns[rows] * inverse, 0.0)
            taken = self.shrink[rows, :, None] * (np.swapaxes(basis, 1, 2) @ own)
            white[rows] = own - basis @ taken
        white = white.reshape(x.shape)
        coupled = zip(self.groups, self.group_basis, self.group_shrink, strict=True)
        for group, basis, shrink in coupled:
            white[group] = projected_out(basis, white[group], shrink)
        return white

    def only(self, rows: NDArray[np.bool_]) -> Self:
        """The operator on these cells alone; no manoeuvre's scatter couples them with others."""
        return replace(self, inverse_sd=np.where(rows[:, None], self.inverse_sd, 0.0))

    def some(self, rows: NDArray[np.int64]) -> Self:
        """The operator of some manoeuvres alone, whose cells are the ascending `rows`."""
        own = np.flatnonzero(np.isin([group[0] for group in self.groups], rows))
        return replace(
            self,
            inverse_sd=self.inverse_sd[rows],
            basis=self.basis[rows],
            shrink=self.shrink[rows],
            groups=tuple(np.searchsorted(rows, self.groups[i]) for i in own),
            group_basis=tuple(self.group_basis[i] for i in own),
            group_shrink=tuple(self.group_shrink[i] for i in own),
        )

    def with_manoeuvres(
        self, manoeuvre: NDArray[np.int64], columns: FloatArray, sd: FloatArray
    ) -> Whitener:
        """The operator of single cells with random effects of manoeuvres besides.

        `columns` (C, m, k) in the observable's unit per unit of effect, `sd` (k,).
        """
        white = self(columns) * sd
        groups = [np.flatnonzero(manoeuvre == number) for number in range(int(manoeuvre.max()) + 1)]
        found = [np.linalg.svd(stacked(white[rows]), full_matrices=False) for rows in groups]
        return replace(
            self,
            groups=tuple(groups),
            group_basis=tuple(basis for basis, _, _ in found),
            group_shrink=tuple(1.0 - 1.0 / np.sqrt(1.0 + size**2) for _, size, _ in found),
        )


def whitener(
    cells: Cells, discrepancy: float = 0.0, scattered: FloatArray | None = None
) -> Whitener:
    """The operator of single cells: noise, shift and the random effects of revolutions.

    `discrepancy` [unit^2] is the mean square that the model at hand misses. It is added to the
    noise. Else a model of wrong shape would trade amplitude for shape, since amplitude scatters
    from revolution to revolution. `scattered` (C, m), if any, is what else scatters from cell to
    cell, at one standard deviation.
    """
    inverse = np.where(
        np.isfinite(cells.values) & np.isfinite(cells.sd),
        1.0 / np.sqrt(cells.sd**2 + discrepancy),
        0.0,
    )
    scale, vectors = np.linalg.eigh(cells.random_cov)
    root = vectors * np.sqrt(np.maximum(scale, 0.0))[:, None, :]
    # prior sd of the shift [rad]: free against what the matched filter leaves
    columns = np.concatenate([cells.random @ root, 0.05 * cells.shift[..., None]], axis=-1)
    if scattered is not None:
        columns = np.concatenate([columns, scattered[..., None]], axis=-1)
    basis, size, _ = np.linalg.svd(np.nan_to_num(columns) * inverse[..., None], full_matrices=False)
    return Whitener(inverse, basis, 1.0 - 1.0 / np.sqrt(1.0 + size**2))


def shrinkage(columns: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """What random effects take, of whitened columns (N, K), each as large as its deviation.

    An orthonormal basis (N, r), the shares (r,) taken along it, and (K, r) the amplitudes in
    standard deviations from what lies along it.
    """
    values, vectors = np.linalg.eigh(columns.T @ columns)
    keep = values > RANK * max(float(values[-1]), 1e-300)
    values, vectors = values[keep], vectors[:, keep]
    root = np.sqrt(values)
    basis = columns @ (vectors / root)
    return basis, 1.0 - 1.0 / np.sqrt(1.0 + values), vectors * (root / (1.0 + values))


@dataclass(frozen=True)
class Offsets:
    """What is taken out beside a model: offsets of logs, then the spans of other columns.

    direction  (C, m) each cell's part of its log's column, which has length one
    log        (C,) 0 ... `count` - 1;  norm (count,)
    spans      of each an orthonormal basis (N, r) and the shares (r,) that are taken along it: of
               shared effects what their size allows, of others all

    Columns B are as large as their standard deviations. The covariance I + B B' has the inverse
    root I - Q (1 - 1/sqrt(1 + D)) Q', where Q D Q' = B B'.
    """

    direction: FloatArray
    log: IntArray
    norm: FloatArray
    spans: tuple[tuple[FloatArray, FloatArray | None], ...] = ()

    @classmethod
    def of(cls, cells: Cells, white: Callable[[FloatArray], FloatArray]) -> Offsets:
        """The offsets of waveforms; a number per revolution has no offset that is free."""
        log = np.unique(cells.log, return_inverse=True)[1]
        columns = white(cells.level)
        norm = np.sqrt(np.bincount(log, (columns**2).sum(axis=1)))
        offsets = cls(columns / np.maximum(norm, 1e-300)[log][:, None], log, norm)
        if cells.shared is None or not len(cells.shared):
            return offsets
        flat = stacked(offsets.without(white(cells.shared.columns) * cells.shared.sd))
        return replace(offsets, spans=(shrinkage(flat)[:2],))

    def beside(self, columns: FloatArray) -> Offsets:
        """With the span of other whitened `columns` (C, m, k), which are used up."""
        before = np.linalg.norm(stacked(columns), axis=0)
        left = self.without(columns)
        del columns
        # columns of which this share of the norm is left beside the offsets are offsets; twice as
        # much takes for offsets what is seen to 0.06 % beside them
        left[..., np.linalg.norm(stacked(left), axis=0) <= 3e-4 * before] = 0.0
        return replace(self, spans=(*self.spans, (orthonormal(left), None)))

    @property
    def taken(self) -> int:
        """How many of them are of waveforms, and free."""
        return int((self.norm > 0.0).sum())

    def products(self, x: FloatArray) -> FloatArray:
        """Inner products of x (C, m, k) with each log's direction, (count, k)."""
        return per_group((np.swapaxes(x, 1, 2) @ self.direction[..., None])[..., 0], self.log)

    def without(self, x: FloatArray) -> FloatArray:
        """x (C, m) or (C, m, k) with all of it taken out."""
        if not x.size:
            return x
        columns = x.reshape(*self.direction.shape, -1)
        level = self.direction[..., None] * self.products(columns)[self.log][:, None, :]
        left = np.subtract(columns, level, out=level).reshape(x.shape)
        for basis, share in self.spans:
            left = projected_out(basis, left, share)
        return left

    def of_logs(self, x: FloatArray) -> FloatArray:
        """The offset of each log (count,) that is nearest to the whitened x (C, m)."""
        return self.products(x[..., None])[:, 0] / np.maximum(self.norm, 1e-300)


@dataclass(frozen=True)
class LeaveOneOut:
    """Normal equations of each manoeuvre, first of their columns the `offsets` of its log.

    There is an offset for each observable; no metric couples two of them. `log` (M,). `prior`:
    precision (p,) of what is known of the other columns' strengths before any manoeuvre, and its
    pull (p,), precision times the mean. A solution theta (M, offsets + p).
    """

    normal: Normal
    log: IntArray
    prior: tuple[FloatArray, FloatArray]
    offsets: int = 1

    def left_out(self) -> FloatArray:
        """Theta: for each manoeuvre the solution of all the others.

        If no other manoeuvre of its log remains, the offset is fitted on the manoeuvre itself,
        with the rest held.
        """
        theta, n = np.empty_like(self.normal.right), self.offsets
        for rows, others, own in self._without_each():
            theta[rows, n:] = solve_scaled(*others)
            theta[rows, :n] = _offsets(*own, theta[rows, n:])
        return theta

    def of_errors(self, of: LeaveOneOut) -> FloatArray:
        """What errors of the columns' strengths add to the losses of another metric, (M,).

        In the mean, with each manoeuvre left out: the other's sum of squares by the covariance
        that all the others leave.
        """
        added, n = np.empty_like(self.normal.square), self.offsets
        for rows, (gram, _), _ in self._without_each():
            spread = solve_scaled(gram[:, None], of.normal.gram[rows, n:, n:])
            added[rows] = np.einsum("mii->m", spread)
        return added

    def _without_each(self) -> Iterator[tuple[slice, Equations, Equations]]:
        """What all the others say of each of some manoeuvres (k of them, at a slice).

        Normal equations of the columns, (k, p, p) and (k, p), the offsets eliminated; and those
        of the offsets, (k, offsets, offsets + p) and (k, offsets): of the manoeuvre's own cells if
        its log has no other.
        """
        normal, n = self.normal, self.offsets
        of_logs = per_group(normal.gram, self.log), per_group(normal.right, self.log)
        eliminated = _without_offsets(*of_logs, n)
        diagonal = np.einsum("mii->mi", normal.gram)
        for start in range(0, self.log.size, _BLOCK):
            rows = slice(start, start + _BLOCK)
            log = self.log[rows]
            gram, right = of_logs[0][log] - normal.gram[rows], of_logs[1][log] - normal.right[rows]
            alone = np.einsum("mii->mi", gram)[:, :n] <= 1e-12 * diagonal[rows, :n]
            where, column = np.nonzero(alone)
            gram[where, column, column] = 0.0
            own = (
                np.where(alone[..., None], normal.gram[rows, :n], gram[:, :n]),
                np.where(alone, normal.right[rows, :n], right[:, :n]),
            )
            gram, right = self._known(
                *(
                    others + of_log.sum(axis=0) - of_log[log]
                    for others, of_log in zip(
                        _without_offsets(gram, right, n), eliminated, strict=True
                    )
                )
            )
            # a column that the offsets take is none
            of_others = diagonal.sum(axis=0) - diagonal[rows]
            seen = np.einsum("mii->mi", gram) > RANK * of_others[:, n:]
            gram = np.where(seen[:, :, None] & seen[:, None, :], gram, 0.0)
            yield rows, (gram, np.where(seen, right, 0.0)), own

    def step_of_all(self, first: int) -> FloatArray:
        """Theta by which the optimum is missed.

        What the `first` columns and the offsets would still move by on all data; nothing at an
        optimum.
        """
        end, n = self.offsets + first, self.offsets
        gram = per_group(self.normal.gram[:, :end, :end], self.log)
        right = per_group(self.normal.right[:, :end], self.log)
        whole = (part.sum(axis=0)[None] for part in _without_offsets(gram, right, n))
        step = solve_scaled(*self._known(*whole))
        theta = np.zeros_like(self.normal.right)
        theta[:, n:end] = step
        theta[:, :n] = _offsets(gram[:, :n], np.zeros_like(right[:, :n]), step)[self.log]
        return theta

    def loss(self, theta: FloatArray) -> FloatArray:
        """Sum of squares of residual - columns theta in each manoeuvre, (M,)."""
        normal = self.normal
        gained = np.einsum("mi,mi->m", theta, 2.0 * normal.right)
        gained -= np.einsum("mi,mij,mj->m", theta, normal.gram, theta)
        sums: FloatArray = np.maximum(normal.square - gained, 0.0)
        return sums

    def _known(self, gram: FloatArray, right: FloatArray) -> Equations:
        """Normal equations (..., p, p), (..., p) without the offsets, with what is known before."""
        precision, pull = (part[: right.shape[-1]] for part in self.prior)
        return gram + np.diag(precision), right + pull


#: normal equations (k, p, p) and (k, p)
Equations = tuple[FloatArray, FloatArray]


def _without_offsets(gram: FloatArray, right: FloatArray, offsets: int) -> Equations:
    """Normal equations (k, p, p) and (k, p) once the first columns are eliminated."""
    size, cross = np.einsum("mii->mi", gram)[:, None, :offsets], gram[:, offsets:, :offsets]
    share = np.divide(cross, size, out=np.zeros_like(cross), where=size > 0)
    return (
        gram[:, offsets:, offsets:] - share @ gram[:, :offsets, offsets:],
        right[:, offsets:] - (share @ right[:, :offsets, None])[..., 0],
    )


def _offsets(gram: FloatArray, right: FloatArray, theta: FloatArray) -> FloatArray:
    """The offsets (k, n) beside strengths theta, by their equations (k, n, n + p) and (k, n)."""
    size, n = np.diagonal(gram, axis1=1, axis2=2), gram.shape[1]
    miss = right - (gram[:, :, n:] @ theta[..., None])[..., 0]
    return np.divide(miss, size, out=np.zeros_like(miss), where=size > 0)
