"""What a fit measures residuals in.

Weighted by noise and count, nuisances taken out, scatter whitened.

    values (..., n, m) --w--> --free nuisances of each revolution out-->
        --scatter within manoeuvres whitened--> --scatter between manoeuvres whitened-->
        --one offset per log out--> (..., n, m), in which independent unit noise is left

Free nuisances (an offset, amplitude or small shift of each revolution) are projected out. Scatter
is what a real drive adds from revolution to revolution and from manoeuvre to manoeuvre: the load is
a little higher, rises a little over the turn, the baseline moves: D (a + b phi + c phi^2) + rms d
with D = dP / d ln F from the model, random with covariances that are estimated from the residual.
Its directions stay in, at the weight they deserve: (1 + U Lambda U^T)^(-1/2). (Amplitude and width
of the waveform instead of D leave a reduced chi-square of 1.7 on a road of 1 % roughness, D alone
1.09, with phi D 1.016, with phi^2 D 1.012.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tirelog.data.recording import Stack
from tirelog.errors import ModelError
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import SCALARS, WAVEFORMS

#: Nuisances of each revolution that can be taken out.
NUISANCES = ("offset", "amplitude", "shift")
#: Rounds of expectation and maximisation for the scatter.
_ROUNDS = 60
#: A revolution whose load seems to differ by more is a spoilt one, not one under another load.
_LIKELY_LOAD = 0.2


def weights(stack: Stack) -> FloatArray:
    """sqrt(count) / noise, (n, m), 0 where nothing was measured; a stack without a noise figure
    weighs all bins alike.
    """
    noise = np.where(np.isfinite(stack.noise) & (stack.noise > 0), stack.noise, np.nan)
    if np.isnan(noise).all():
        noise = np.full(len(stack), max(float(np.nanstd(stack.values)), 1e-30))
    noise = np.where(np.isnan(noise), np.nanmax(noise), noise)
    measured = np.isfinite(stack.values) & (stack.count > 0)
    if stack.observable not in SCALARS:
        measured &= np.isfinite(stack.phi_mean) & np.isfinite(stack.phi_variance)
    return np.where(measured, np.sqrt(np.maximum(stack.count, 0)) / noise[:, None], 0.0)


@dataclass(frozen=True)
class Scatter:
    """Covariances (4, 4) of load, its rise [1/rad] and bend [1/rad^2] over the turn, and baseline
    (relative; the baseline to the waveform's rms): of a revolution about its manoeuvre, and of
    manoeuvres; the shapes, (n, m) each, that they belong to; and each revolution's likely load,
    (n,), less the one predicted with, relative.
    """

    shapes: tuple[FloatArray, ...]
    within: FloatArray
    between: FloatArray
    load: FloatArray


def scatter_shapes(
    stack: Stack, waveform: FloatArray, by_load: FloatArray
) -> tuple[FloatArray, ...]:
    """What scatter adds per unit of load, its rise and bend, and baseline, (n, m) each; `by_load`
    is D.
    """
    rms = np.sqrt(np.nanmean(waveform**2, axis=1, keepdims=True))
    phi = np.nan_to_num(stack.phi_mean)
    return by_load, phi * by_load, phi**2 * by_load, np.broadcast_to(rms, waveform.shape)


class Metric:
    """The chain above for one stack, at a waveform and its slope by phi, (n, m) each; revolutions
    in `aside` (n,) weigh nothing.

    `bend` is what the values hold beyond the scatter's straight line, (n, m) or 0: to be taken off
    them before they are measured.
    """

    def __init__(
        self,
        stack: Stack,
        waveform: FloatArray,
        slope: FloatArray,
        nuisances: Sequence[str] = (),
        scatter: Scatter | None = None,
        aside: np.ndarray | None = None,
        bend: FloatArray | float = 0.0,
    ) -> None:
        self.bend = bend
        unknown = [kind for kind in nuisances if kind not in NUISANCES]
        if unknown:
            raise ModelError(
                f"unknown nuisance {unknown[0]!r}; allowed are {', '.join(NUISANCES)}; "
                "choose among them"
            )
        self.weight = (
            weights(stack) if aside is None else np.where(aside[:, None], 0.0, weights(stack))
        )
        self._seen = self.weight > 0
        self._log, self._manoeuvre = (
            np.unique(labels, return_inverse=True)[1] for labels in (stack.log, stack.manoeuvre)
        )
        self._steps: list[_Whitener] = []
        shapes = {"offset": np.ones_like(waveform), "amplitude": waveform, "shift": slope}
        if nuisances:
            self._then(self._columns([shapes[kind] for kind in nuisances]), None, None)
        if scatter is not None:
            columns = self._columns(scatter.shapes)
            self._then(columns, None, scatter.within)
            self._then(columns, self._manoeuvre, scatter.between)
        self.offsets = 0
        if stack.observable in WAVEFORMS and "offset" not in nuisances:
            self._then(self._columns([shapes["offset"]]), self._log, None)
            self.offsets = int(self._log.max()) + 1
        self.removed = self.offsets + len(nuisances) * int(self._seen.any(axis=1).sum())

    def __call__(self, values: FloatArray) -> FloatArray:
        """`values` (..., n, m) in the metric."""
        weighted = np.where(self._seen, self.weight * values, 0.0)
        for step in self._steps:
            weighted = step(weighted)
        return weighted

    def _columns(self, shapes: Sequence[FloatArray]) -> FloatArray:
        return np.stack(
            [np.where(self._seen, self.weight * shape, 0.0) for shape in shapes], axis=-1
        )

    def _then(
        self, columns: FloatArray, group: np.ndarray | None, covariance: FloatArray | None
    ) -> None:
        """Adds a step along `columns` as the steps before leave them."""
        moved = np.moveaxis(columns, -1, 0)
        for step in self._steps:
            moved = step(moved)
        self._steps.append(_Whitener(np.moveaxis(moved, 0, -1), group, covariance))


class _Whitener:
    """x -> (1 + U Lambda U^T)^(-1/2) x for the columns U (n, m, k) of each revolution, or of each
    `group` of them together.

    `covariance` None stands for an infinite Lambda: the columns are projected out.
    """

    def __init__(
        self, columns: FloatArray, group: np.ndarray | None, covariance: FloatArray | None
    ) -> None:
        n, _, k = columns.shape
        self._group = np.arange(n) if group is None else group
        self._size = int(self._group.max()) + 1 if n else 0
        gram = self._sum(np.einsum("nmk,nml->nkl", columns, columns))
        size, turn = np.linalg.eigh(gram)
        seen = size > 1e-10 * np.maximum(size.max(axis=1, keepdims=True), 1e-300)
        root = np.sqrt(np.where(seen, size, 1.0))
        to_basis = np.where(seen, 1.0 / root, 0.0)[:, None, :] * turn
        self._basis = np.einsum("nmk,nkl->nml", columns, to_basis[self._group])
        if covariance is None:
            self._gain = np.broadcast_to(-np.eye(k), (self._size, k, k))
            return
        half = np.where(seen, root, 0.0)[:, :, None] * np.swapaxes(turn, 1, 2)
        spread, axes = np.linalg.eigh(np.eye(k) + half @ covariance @ np.swapaxes(half, 1, 2))
        self._gain = (axes * (1.0 / np.sqrt(spread))[:, None, :]) @ np.swapaxes(
            axes, 1, 2
        ) - np.eye(k)

    def _sum(self, rows: FloatArray) -> FloatArray:
        """Sums over the revolutions of each group, (n, ...) to (groups, ...)."""
        if self._size == rows.shape[0]:
            return rows
        total = np.zeros((self._size, *rows.shape[1:]))
        np.add.at(total, self._group, rows)
        return total

    def __call__(self, x: FloatArray) -> FloatArray:
        flat = x.reshape(-1, *x.shape[-2:])
        along = np.einsum("nmk,pnm->npk", self._basis, flat)
        back = np.einsum("nkl,npl->npk", self._gain, self._sum(along))[self._group]
        whitened: FloatArray = (flat + np.einsum("nmk,npk->pnm", self._basis, back)).reshape(
            x.shape
        )
        return whitened


def estimate_scatter(
    metric: Metric, shapes: tuple[FloatArray, ...], residual: FloatArray, manoeuvre: np.ndarray
) -> Scatter:
    """Scatter from what a prediction leaves of the values (n, m), in a metric without scatter.

    A revolution's coefficients by least squares scatter about their manoeuvre's mean by `within` +
    their own error. `between` is how the manoeuvres' means scatter less their own error; what
    `within` leaves in a mean stays in it, since neighbours on one road are correlated, and few
    manoeuvres know it badly, so it is widened by (G - 1) / (G - 3) and taken without correlations,
    which so few would only feign. Negative variances are zero.
    """
    used = metric.weight.any(axis=1)
    columns = np.stack([metric(shape)[used] for shape in shapes], axis=-1)
    error = np.linalg.pinv(np.einsum("nmk,nml->nkl", columns, columns), rcond=1e-9, hermitian=True)
    b = np.einsum("nkl,nl->nk", error, np.einsum("nmk,nm->nk", columns, metric(residual)[used]))
    _, group = np.unique(manoeuvre[used], return_inverse=True)
    count = np.bincount(group).astype(float)
    groups = count.size
    mean = (
        np.stack([np.bincount(group, b[:, k]) for k in range(b.shape[1])], axis=1) / count[:, None]
    )
    rest = b - mean[group]
    noise = error.mean(axis=0)
    within = _excess(rest * np.sqrt(b.shape[0] / max(b.shape[0] - groups, 1)), error)
    means = mean - mean.mean(axis=0)
    between = ((means**2).sum(axis=0) - np.diag(noise) * (groups - 1) * np.mean(1.0 / count)) / max(
        groups - 3, 1
    )
    apart = np.diag(np.maximum(between, 0.0)) if groups > 2 else np.zeros_like(within)
    load = np.zeros(used.size)
    load[used] = np.einsum(
        "kl,nlj,nj->nk", within + apart, np.linalg.pinv(within + apart + error, hermitian=True), b
    )[:, 0]
    return Scatter(shapes, within, apart, np.clip(load, -_LIKELY_LOAD, _LIKELY_LOAD))


def _excess(b: FloatArray, error: FloatArray) -> FloatArray:
    """The covariance (k, k) of what coefficients `b` (n, k) estimate, each with its own error
    covariance (n, k, k): by expectation and maximisation, which weighs the good ones and keeps
    variances positive.
    """
    unit = np.sqrt(np.median(np.einsum("nkk->nk", error), axis=0))
    unit = np.where(unit > 0, unit, 1.0)
    b, error = b / unit, error / np.outer(unit, unit)
    found = b.T @ b / max(b.shape[0], 1)
    for _ in range(_ROUNDS):
        gain = found @ np.linalg.pinv(found + error, hermitian=True)
        likely = np.einsum("nkl,nl->nk", gain, b)
        found = (likely.T @ likely + (found - gain @ found).sum(axis=0)) / b.shape[0]
        found = 0.5 * (found + found.T)
    covariance: FloatArray = found * np.outer(unit, unit)
    return covariance
