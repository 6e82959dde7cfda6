"""The metric in which residuals are judged.

One linear operator per manoeuvre that makes repeatable noise white.

    x (C, m, k) -> x / sd -> per cell: shift removed, shrunk along the random effects of revolutions
                          -> per manoeuvre: shrunk along the random effects of manoeuvres
                -> (C, m, k)

With columns B of covariance T the covariance I + B T B' has the inverse root

    I - Q (1 - 1/sqrt(1 + D)) Q',  Q D Q' = B T B':

a small singular value decomposition per cell or manoeuvre, no N x N matrix. Infinite variance
removes a direction. Empty bins become zero.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tirelog.inference.cells.cells import Cells
from tirelog.inference.metric.projection import in_blocks
from tirelog.vocabulary.arrays import FloatArray

#: prior sd of what is taken out of a cell. Shift [rad]: free against what the matched filter
#: leaves. Amplitude, relative: gains differ by less; doubling it doubles the lever arm's error, and
#: no other's. Offset, relative to the waveform's rms: anything; 1e8 would cost the others their
#: digits
_FREE_SD = {"shift": 0.05, "amplitude": 0.1, "offset": 1e4}


@dataclass(frozen=True)
class Whitener:
    """What whitens cells: noise, and shrinkage along correlated errors.

    `inverse_sd` (C, m), zero if empty; per cell basis (C, m, k) and shrinkage (C, k); the same per
    manoeuvre, rows of its cells. `of_manoeuvre`: the manoeuvre of each such group, ascending, if
    one of them has several (each observable's own); None if they are the manoeuvres in order.
    """

    inverse_sd: FloatArray
    basis: FloatArray
    shrink: FloatArray
    groups: tuple[NDArray[np.int64], ...] = ()
    group_basis: tuple[FloatArray, ...] = ()
    group_shrink: tuple[FloatArray, ...] = ()
    of_manoeuvre: NDArray[np.int64] | None = None

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
        flat = x.ndim == 2
        x = x[..., None] if flat else x
        x = in_blocks(self._of_cells, x)
        for rows, basis, shrink in zip(
            self.groups, self.group_basis, self.group_shrink, strict=True
        ):
            part = x[rows].reshape(-1, x.shape[-1])
            x[rows] = (part - basis @ (shrink[:, None] * (basis.T @ part))).reshape(
                rows.size, -1, x.shape[-1]
            )
        return x[..., 0] if flat else x

    def _of_cells(self, rows: slice, x: FloatArray) -> FloatArray:
        """The operator of single cells on some of them."""
        inverse, basis = self.inverse_sd[rows, :, None], self.basis[rows]
        x = np.where(inverse > 0, x * inverse, 0.0)
        return x - basis @ (self.shrink[rows, :, None] * (np.swapaxes(basis, 1, 2) @ x))

    def only(self, rows: NDArray[np.bool_]) -> Whitener:
        """The operator on these cells alone; no manoeuvre's scatter couples them with others."""
        return replace(self, inverse_sd=np.where(rows[:, None], self.inverse_sd, 0.0))

    def some(self, rows: NDArray[np.int64], manoeuvres: slice) -> Whitener:
        """The operator of some manoeuvres alone, whose cells are the ascending `rows`."""
        of = self.of_manoeuvre
        if of is not None:
            ends = np.searchsorted(of, [manoeuvres.start, manoeuvres.stop]).tolist()
            manoeuvres = slice(*ends)
        groups = tuple(np.searchsorted(rows, group) for group in self.groups[manoeuvres])
        return Whitener(
            self.inverse_sd[rows],
            self.basis[rows],
            self.shrink[rows],
            groups,
            self.group_basis[manoeuvres],
            self.group_shrink[manoeuvres],
            None if of is None else of[manoeuvres],
        )

    def with_manoeuvres(
        self, manoeuvre: NDArray[np.int64], columns: FloatArray, sd: FloatArray
    ) -> Whitener:
        """The whitener with random effects of manoeuvres.

        `columns` (C, m, k) in the observable's unit per unit of effect, `sd` (k,).
        """
        white = Whitener(self.inverse_sd, self.basis, self.shrink)(columns) * sd
        groups, bases, shrinks = [], [], []
        for number in range(int(manoeuvre.max()) + 1):
            rows = np.flatnonzero(manoeuvre == number)
            basis, size, _ = np.linalg.svd(
                white[rows].reshape(-1, white.shape[-1]), full_matrices=False
            )
            groups.append(rows)
            bases.append(basis)
            shrinks.append(1.0 - 1.0 / np.sqrt(1.0 + size**2))
        return Whitener(
            self.inverse_sd, self.basis, self.shrink, tuple(groups), tuple(bases), tuple(shrinks)
        )


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
