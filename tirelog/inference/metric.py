"""What is beside the model, in a metric: one free offset per log, and shared random effects.

    Cells, metric -> a log's column is 1 in its own cells, 0 elsewhere: whitened, one array (C, m)
                     for all logs together
                  -> the columns of the shared effects, each as large as its standard deviation

What a log's baseline stands at is nobody's physics. A metric couples no two manoeuvres and a
manoeuvre belongs to one log, so the columns of two logs never meet: each is projected out alone,
and the number of logs costs neither memory nor time. A shared effect is not projected out but
shrunk by what its standard deviation allows: the sum of squares left is the least one that
amplitudes can leave, their own squares in standard deviations counted with it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

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


def in_blocks(operator: Callable[[slice, FloatArray], FloatArray], x: FloatArray) -> FloatArray:
    """operator(rows, x[rows]) for all cells of x (C, m) or (C, m, k), some at a time.

    It gets x with columns; what it needs besides its result stays small.
    """
    columns = x.reshape(*x.shape[:2], math.prod(x.shape[2:]))
    result = np.empty(columns.shape)
    for start in range(0, x.shape[0], _BLOCK):
        rows = slice(start, start + _BLOCK)
        result[rows] = operator(rows, columns[rows])
    return result.reshape(x.shape)


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

    def beside(self, more: Normal, crossed: FloatArray) -> Normal:
        """With the columns of another (M, k) behind its own.

        `crossed` (M, p, k): products of its columns with the other's.
        """
        upper = np.concatenate([self.gram, crossed], axis=2)
        lower = np.concatenate([np.swapaxes(crossed, 1, 2), more.gram], axis=2)
        right = np.concatenate([self.right, more.right], axis=1)
        return Normal(np.concatenate([upper, lower], axis=1), right, self.square)

    @classmethod
    def joined(cls, parts: Sequence[Normal]) -> Normal:
        """Those of successive manoeuvres as one."""
        return cls(
            *(
                np.concatenate([getattr(part, name) for part in parts])
                for name in ("gram", "right", "square")
            )
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


#: prior sd of what is taken out of a cell. Shift [rad]: free against what the matched filter
#: leaves. Amplitude, relative: gains differ by less; doubling it doubles the lever arm's error, and
#: no other's. Offset, relative to the waveform's rms: anything; 1e8 would cost the others their
#: digits
_FREE_SD = {"shift": 0.05, "amplitude": 0.1, "offset": 1e4}


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
    def values(self) -> int:
        """The number of values that count."""
        return int((self.inverse_sd > 0).sum())

    @property
    def removed(self) -> float:
        """Degrees of freedom that the shrinkage takes out of chi-square.

        As the expectation under the covariance is one per value.
        """
        return float((self.shrink > 0.999999).sum())

    def __call__(self, x: FloatArray) -> FloatArray:
        """Whitened x, shape (C, m) or (C, m, k); NaN in empty bins is allowed."""
        if x.size == 0:
            return x
        x = in_blocks(self._of_cells, x)
        coupled = zip(self.groups, self.group_basis, self.group_shrink, strict=True)
        for rows, basis, shrink in coupled:
            x[rows] = projected_out(basis, x[rows], shrink)
        return x

    def _of_cells(self, rows: slice, x: FloatArray) -> FloatArray:
        """The operator of single cells on some of them."""
        inverse, basis = self.inverse_sd[rows, :, None], self.basis[rows]
        x = np.where(inverse > 0, x * inverse, 0.0)
        return x - basis @ (self.shrink[rows, :, None] * (np.swapaxes(basis, 1, 2) @ x))

    def only(self, rows: NDArray[np.bool_]) -> Whitener:
        """The operator on these cells alone; no manoeuvre's scatter couples them with others."""
        return replace(self, inverse_sd=np.where(rows[:, None], self.inverse_sd, 0.0))

    def some(self, rows: NDArray[np.int64]) -> Whitener:
        """The operator of some manoeuvres alone, whose cells are the ascending `rows`."""
        own = np.flatnonzero(np.isin([group[0] for group in self.groups], rows))
        return Whitener(
            self.inverse_sd[rows],
            self.basis[rows],
            self.shrink[rows],
            tuple(np.searchsorted(rows, self.groups[i]) for i in own),
            tuple(self.group_basis[i] for i in own),
            tuple(self.group_shrink[i] for i in own),
        )

    def with_manoeuvres(
        self, manoeuvre: NDArray[np.int64], columns: FloatArray, sd: FloatArray
    ) -> Whitener:
        """The whitener with random effects of manoeuvres.

        `columns` (C, m, k) in the observable's unit per unit of effect, `sd` (k,).
        """
        white = Whitener(self.inverse_sd, self.basis, self.shrink)(columns) * sd
        groups = [np.flatnonzero(manoeuvre == number) for number in range(int(manoeuvre.max()) + 1)]
        found = [np.linalg.svd(stacked(white[rows]), full_matrices=False) for rows in groups]
        bases = tuple(basis for basis, _, _ in found)
        shrinks = tuple(1.0 - 1.0 / np.sqrt(1.0 + size**2) for _, size, _ in found)
        return Whitener(self.inverse_sd, self.basis, self.shrink, tuple(groups), bases, shrinks)


def whitener(
    cells: Cells, discrepancy: float = 0.0, scattered: FloatArray | None = None
) -> Whitener:
    """The operator of single cells: noise, shift and the random effects of revolutions.

    `discrepancy` [unit^2] is the mean square that the model at hand misses. It is added to the
    noise, so that a model that is wrong in shape does not buy shape with amplitude only because
    amplitude scatters from revolution to revolution. `scattered` (C, m), if any, is what else
    scatters from cell to cell, at one standard deviation.
    """
    inverse = np.where(
        np.isfinite(cells.values) & np.isfinite(cells.sd),
        1.0 / np.sqrt(cells.sd**2 + discrepancy),
        0.0,
    )
    C, m = inverse.shape
    if m == 1:
        return Whitener(inverse, np.zeros((C, 1, 0)), np.zeros((C, 0)))
    scale, vectors = np.linalg.eigh(cells.random_cov)
    root = vectors * np.sqrt(np.maximum(scale, 0.0))[:, None, :]
    prior = np.array([_FREE_SD[name] for name in cells.free])
    columns = np.concatenate([cells.random @ root, prior * cells.taken], axis=-1)
    if scattered is not None:
        columns = np.concatenate([columns, scattered[..., None]], axis=-1)
    basis, size, _ = np.linalg.svd(np.nan_to_num(columns) * inverse[..., None], full_matrices=False)
    return Whitener(inverse, basis, 1.0 - 1.0 / np.sqrt(1.0 + size**2))


#: columns of which this share of the norm is left beside the offsets are offsets; twice as much
#: takes for offsets what is seen to 0.06 % beside them
_NOTHING = 3e-4


@dataclass(frozen=True)
class Offsets:
    """The cells' parts of the offsets of their logs, and shared effects if there are any.

    `direction` (C, m): each cell's part of its log's column, which has length one; `log` (C,) 0
    ... `count` - 1; `norm` (count,).
    """

    direction: FloatArray
    log: IntArray
    norm: FloatArray
    shared: RandomEffects | None = None

    @classmethod
    def of(cls, cells: Cells, white: Callable[[FloatArray], FloatArray]) -> Offsets:
        """The offsets of waveforms; a number per revolution has no offset that is free."""
        log = np.unique(cells.log, return_inverse=True)[1]
        alone = cells.phi.shape[1] == 1
        if alone and cells.shared is None:
            return cls(np.zeros_like(cells.phi), log, np.zeros(0))
        columns = np.zeros_like(cells.phi) if alone else white(cells.level)
        norm = np.sqrt(np.bincount(log, (columns**2).sum(axis=1)))
        offsets = cls(columns / np.maximum(norm, 1e-300)[log][:, None], log, norm)
        if cells.shared is None or not len(cells.shared):
            return offsets
        sized = white(cells.shared.columns) * cells.shared.sd
        level = offsets.products(sized) / np.maximum(norm, 1e-300)[:, None]
        return replace(
            offsets, shared=RandomEffects.of(offsets._levelled(sized), cells.shared.sd, level)
        )

    @property
    def count(self) -> int:
        return self.norm.size

    @property
    def taken(self) -> int:
        """How many of them are of waveforms, and free."""
        return int((self.norm > 0.0).sum())

    def products(self, x: FloatArray) -> FloatArray:
        """Inner products of x (C, m, k) with each log's direction, (count, k)."""
        result = np.zeros((self.count, x.shape[-1]))
        np.add.at(result, self.log, (np.swapaxes(x, 1, 2) @ self.direction[..., None])[..., 0])
        return result

    def without(self, x: FloatArray) -> FloatArray:
        """x (C, m) or (C, m, k) with offsets taken out and shared effects shrunk."""
        x = self._levelled(x)
        if self.shared is None:
            return x
        return projected_out(self.shared.basis, x, self.shared.shrink)

    def _levelled(self, x: FloatArray) -> FloatArray:
        """x (C, m) or (C, m, k) with the offsets taken out."""
        if not self.count or not x.size:
            return x
        columns = x.reshape(*self.direction.shape, -1)
        level = self.direction[..., None] * self.products(columns)[self.log][:, None, :]
        return np.subtract(columns, level, out=level).reshape(x.shape)

    def fit(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Offset of each log (count,) and amplitudes (K,) nearest to the whitened x (C, m)."""
        if not self.count:
            return np.zeros(0), np.zeros(0)
        offsets = self.products(x[..., None])[:, 0] / np.maximum(self.norm, 1e-300)
        if self.shared is None:
            return offsets, np.zeros(0)
        sized = self.shared.fit(self._levelled(x))
        return offsets - self.shared.level @ sized, sized * self.shared.sd


@dataclass(frozen=True)
class RandomEffects:
    """Shared effects in a metric, offsets taken out: the root of their inverse covariance.

    With columns B, as large as their standard deviations, the covariance I + B B' has the inverse
    root I - Q (1 - 1/sqrt(1 + D)) Q', Q D Q' = B B': `basis` Q (N, r) and `shrink` (r,). `turn`
    (K, r) gives the amplitudes in standard deviations from Q' x; `sd` (K,); `level` (count, K) the
    part of each column that is an offset.
    """

    basis: FloatArray
    shrink: FloatArray
    turn: FloatArray
    sd: FloatArray
    level: FloatArray

    @classmethod
    def of(cls, columns: FloatArray, sd: FloatArray, level: FloatArray) -> RandomEffects:
        """columns (C, m, K), whitened, offsets taken out, times their standard deviations."""
        flat = columns.reshape(-1, columns.shape[-1])
        values, vectors = np.linalg.eigh(flat.T @ flat)
        keep = values > RANK * max(float(values[-1]), 1e-300)
        values, vectors = values[keep], vectors[:, keep]
        root = np.sqrt(values)
        return cls(
            flat @ (vectors / root),
            1.0 - 1.0 / np.sqrt(1.0 + values),
            vectors * (root / (1.0 + values)),
            sd,
            level,
        )

    def fit(self, x: FloatArray) -> FloatArray:
        """Amplitudes (K,) in standard deviations, from x (C, m) with offsets taken out."""
        return np.asarray(self.turn @ (self.basis.T @ x.ravel()), dtype=np.float64)


@dataclass(frozen=True)
class ProjectedOut:
    """What is projected out of residual and signatures.

    The offsets, and the span of other whitened columns beside them.
    """

    offsets: Offsets
    basis: FloatArray

    @classmethod
    def of(cls, offsets: Offsets, columns: FloatArray) -> ProjectedOut:
        """`columns` (C, m, k) whitened; they are used up."""
        before = np.linalg.norm(stacked(columns), axis=0)
        left = offsets.without(columns)
        del columns
        left[..., np.linalg.norm(stacked(left), axis=0) <= _NOTHING * before] = 0.0
        return cls(offsets, orthonormal(left))

    def without(self, x: FloatArray) -> FloatArray:
        """x (C, m) or (C, m, k) with all of it taken out."""
        return projected_out(self.basis, self.offsets.without(x))


@dataclass(frozen=True)
class LeaveOneOut:
    """Normal equations of each manoeuvre, first of their columns the offset of its log.

    `log` (M,). `prior`: precision (p,) of what is known of the columns' strengths before any
    manoeuvre, and its pull (p,), precision times the mean; zero for the offset. A solution theta
    (M, p) has the offset first.
    """

    normal: Normal
    log: IntArray
    prior: tuple[FloatArray, FloatArray]

    def left_out(self) -> FloatArray:
        """Theta (M, p): for each manoeuvre the solution of all the others.

        If no other manoeuvre of its log remains, the offset is fitted on the manoeuvre itself,
        with the rest held.
        """
        theta = np.empty_like(self.normal.right)
        for rows, gram, right, level in self._without_each():
            own = theta[rows]
            own[:, 1:] = solve_scaled(gram, right)
            miss = level[:, -1] - (level[:, 1:-1] * own[:, 1:]).sum(axis=1)
            own[:, 0] = np.divide(miss, level[:, 0], np.zeros_like(miss), where=level[:, 0] > 0)
        return theta

    def of_errors(self, of: LeaveOneOut) -> FloatArray:
        """What errors of the columns' strengths add to the losses of another metric, (M,).

        In the mean, with each manoeuvre left out: the other's sum of squares by the covariance
        that all the others leave.
        """
        added = np.empty_like(self.normal.square)
        for rows, gram, _, _ in self._without_each():
            spread = solve_scaled(gram[:, None], of.normal.gram[rows, 1:, 1:])
            added[rows] = np.einsum("mii->m", spread)
        return added

    def _without_each(self) -> Iterator[tuple[slice, FloatArray, FloatArray, FloatArray]]:
        """What all the others say of each of some manoeuvres (n of them, at a slice).

        Normal equations of the columns, (n, p - 1, p - 1) and (n, p - 1), the offset eliminated;
        and those of the offset, (n, p + 1), the right side last: of the manoeuvre's own cells if
        its log has no other.
        """
        normal = self.normal
        gram_of_log, right_of_log = self._of_logs()
        of_logs = _without_offset(gram_of_log, right_of_log)
        whole = [part.sum(axis=0) for part in of_logs]
        diagonal = np.einsum("mii->i", normal.gram)[1:]
        for start in range(0, self.log.size, _BLOCK):
            rows = slice(start, start + _BLOCK)
            log, own = self.log[rows], normal.gram[rows]
            gram, right = gram_of_log[log] - own, right_of_log[log] - normal.right[rows]
            alone = gram[:, 0, 0] <= 1e-12 * own[:, 0, 0]
            gram[alone, 0, 0] = 0.0
            level = np.where(
                alone[:, None],
                np.concatenate([own[:, 0], normal.right[rows, :1]], axis=1),
                np.concatenate([gram[:, 0], right[:, :1]], axis=1),
            )
            gram, right = (
                others + all_logs - of_log[log]
                for others, all_logs, of_log in zip(
                    _without_offset(gram, right), whole, of_logs, strict=True
                )
            )
            gram, right = self._known(gram, right)
            # a column that the offsets take is none
            seen = np.einsum("mii->mi", gram) > RANK * (diagonal - np.einsum("mii->mi", own)[:, 1:])
            gram = np.where(seen[:, :, None] & seen[:, None, :], gram, 0.0)
            yield rows, gram, np.where(seen, right, 0.0), level

    def step_of_all(self, first: int) -> FloatArray:
        """Theta (M, p) by which the optimum is missed.

        What the `first` columns and the offsets would still move by on all data; nothing at an
        optimum.
        """
        some = slice(first + 1)
        gram_of_log, right_of_log = self._of_logs()
        gram, right = _without_offset(gram_of_log[:, some, some], right_of_log[:, some])
        theta = np.zeros_like(self.normal.right)
        step = solve_scaled(*self._known(gram.sum(axis=0)[None], right.sum(axis=0)[None]))[0]
        theta[:, 1 : first + 1] = step
        level, size = gram_of_log[:, 0, 1 : first + 1] @ step, gram_of_log[:, 0, 0]
        offset = -np.divide(level, size, np.zeros_like(size), where=size > 0)
        theta[:, 0] = offset[self.log]
        return theta

    def loss(self, theta: FloatArray) -> FloatArray:
        """Sum of squares of residual - columns theta in each manoeuvre, (M,)."""
        normal = self.normal
        gained = np.einsum("mi,mi->m", theta, 2.0 * normal.right)
        gained -= np.einsum("mi,mij,mj->m", theta, normal.gram, theta)
        sums: FloatArray = np.maximum(normal.square - gained, 0.0)
        return sums

    def _of_logs(self) -> tuple[FloatArray, FloatArray]:
        """The normal equations of each log."""
        return per_group(self.normal.gram, self.log), per_group(self.normal.right, self.log)

    def _known(self, gram: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Normal equations (..., p, p), (..., p) without the offset, with what is known before."""
        precision, pull = (part[1 : 1 + right.shape[-1]] for part in self.prior)
        return gram + np.diag(precision), right + pull


def _without_offset(gram: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Normal equations (K, p, p) and (K, p) once the first column of each is eliminated."""
    cross, size = gram[:, 1:, 0], gram[:, :1, 0]
    share = np.divide(cross, size, out=np.zeros_like(cross), where=size > 0)
    return (
        gram[:, 1:, 1:] - cross[:, :, None] * share[:, None, :],
        right[:, 1:] - share * right[:, :1],
    )
