"""The residual beside a base and its nuisances, and what columns are worth there.

    base -> whitened residual, the base's Jacobian, offsets and nuisances taken out: r (C, m)
    columns (C, m, k) -> the same -> scores by manoeuvre, Gram

The operator is one of single cells, then one that couples cells. A law multiplies whole cells, so
it passes the first: what a form is worth under every law follows from a few products per cell,
with the coupling's low rank. With the coupling M, of an orthonormal U and a small H,

    M x = x - U (1 - H) U'x,   |M x|^2 = |x|^2 - |F'x|^2,   F F' = U (1 - H'H) U'
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tirelog.diagnosis.candidates.assessment import nuisance
from tirelog.errors import ModelError
from tirelog.inference.base import Base, change_to
from tirelog.inference.metric import ProjectedOut, Whitener
from tirelog.physics.effects import Effect
from tirelog.physics.model.expression import parse_expression
from tirelog.physics.model.model import ModelEffect
from tirelog.physics.model.user_effects import CONDITIONS, PLACES
from tirelog.vocabulary.arrays import FloatArray

#: cells of which the coupling is kept as a low rank, and on which the grammar is scanned: the time
#: goes with them, and 60 span 20 manoeuvres
FEW_CELLS = 60
#: eigenvalues of a coupling below this are directions that it leaves alone
_ALONE = 1e-10


@dataclass(frozen=True)
class Gain:
    """What columns are worth under each of some laws.

    scores (L, M, k) of each manoeuvre, gram (L, k, k), size (L, k): squared length of the columns
    before anything is taken out.
    """

    scores: FloatArray
    gram: FloatArray
    size: FloatArray


class Ground:
    """The residual that a base leaves, and expressions on its cells."""

    def __init__(self, base: Base) -> None:
        self.base = base
        cells, model = base.cells, base.model
        self.taken: ProjectedOut = nuisance(base)
        white = base.white
        self._cell = Whitener(white.inverse_sd, white.basis, white.shrink)
        C = len(cells)
        self._coupling = replace(
            white,
            inverse_sd=np.ones_like(white.inverse_sd),
            basis=np.zeros((*white.inverse_sd.shape, 0)),
            shrink=np.zeros((C, 0)),
        )
        measured = np.where(np.isfinite(cells.values), cells.values - base.fit.prediction, 0.0)
        self.residual: FloatArray = self.coupled(self.of_cells(measured))
        beside = cells.values - base.fit.prediction - base.fit.beside
        #: root mean square of what base and nuisances leave, in the observable's unit
        self.missing = float(np.sqrt(np.nanmean(beside**2)))
        self.manoeuvres = cells.manoeuvres
        self.values: dict[str, Any] = {
            name: getattr(cells.conditions, column)[:, None] for name, column in CONDITIONS.items()
        }
        radius = model.values["radius_m"]
        phi = np.nan_to_num(cells.phi)
        spread = np.sqrt(np.nan_to_num(np.maximum(cells.phi_variance, 0.0)))
        self._bins = [{"phi": at, "xi": at * radius} for at in (phi - spread, phi + spread)]
        load = cells.conditions.load_N[:, None]
        self.values |= {
            "phi": phi,
            "xi": phi * radius,
            "L": model.half_length_m(cells.conditions)[:, None],
            "R": radius,
            "load": np.where(np.isfinite(load), load, model.values.get("load_N", np.nan)),
        }

    @property
    def square(self) -> float:
        """The residual's whitened sum of squares."""
        return float((self.residual**2).sum())

    def of_cells(self, columns: FloatArray) -> FloatArray:
        """Columns (C, m) or (C, m, k) by the metric of single cells; a law may multiply cells."""
        return self._cell(np.ascontiguousarray(columns))

    def coupled(self, whitened: FloatArray) -> FloatArray:
        """What couples cells, on columns `of_cells`: nuisances, offsets, base taken out."""
        return self.taken.without(self._coupling(whitened.copy()))

    def response(self, effect: Effect, probe: float) -> FloatArray:
        """The change of the prediction by an effect, per unit of its `probe`, (C, m).

        ModelError if the model cannot be computed with it.
        """
        change = change_to(self.base, self.base.model.with_effect(ModelEffect.of(effect)))
        if isinstance(change, ModelError):
            raise change
        return np.nan_to_num(change) / probe

    def expression(self, text: str, numbers: Mapping[str, Any]) -> FloatArray:
        """An expression's values on the cells; numbers of shape (S, 1, 1) give (S, C, m)."""
        formula = parse_expression(text, {*PLACES, *CONDITIONS, *numbers})
        return formula({**self.values, **numbers})

    def in_bins(self, text: str, numbers: Mapping[str, Any]) -> FloatArray:
        """The same in the mean over the samples of each bin, as the model predicts it."""
        below, above = self.at_ends(text, numbers)
        return np.asarray(0.5 * (below + above))

    def at_ends(self, text: str, numbers: Mapping[str, Any]) -> tuple[FloatArray, FloatArray]:
        """An expression a standard deviation of the samples' angles to either side of a bin."""
        formula = parse_expression(text, {*PLACES, *CONDITIONS, *numbers})
        below, above = (formula({**self.values, **at, **numbers}) for at in self._bins)
        return below, above

    def law(self, text: str, numbers: Mapping[str, float]) -> FloatArray:
        """A law's factor on each cell, (C,)."""
        return np.broadcast_to(self.expression(text, numbers), (len(self.base.cells), 1))[:, 0]

    # ---- the coupling as a low rank --------------------------------------------------------------

    @cached_property
    def _low_rank(self) -> tuple[FloatArray, FloatArray]:
        """(U (N, R), H (R, R)): outside of U the coupling does nothing, within it is H."""
        shape = self.residual.shape
        size = int(np.prod(shape))
        parts = [self.taken.basis]
        offsets = self.taken.offsets
        if offsets.count:
            own = np.zeros((*shape, offsets.count))
            own[np.arange(shape[0]), :, offsets.log] = offsets.direction
            parts.append(own.reshape(size, -1))
        if offsets.shared is not None:
            parts.append(offsets.shared.basis)
        for rows, basis in zip(self._coupling.groups, self._coupling.group_basis, strict=True):
            whole = np.zeros((*shape, basis.shape[1]))
            whole[rows] = basis.reshape(rows.size, -1, basis.shape[1])
            parts.append(whole.reshape(size, -1))
        columns = np.concatenate(parts, axis=1)
        norm = np.linalg.norm(columns, axis=0)
        basis, found, _ = np.linalg.svd(columns[:, norm > 0] / norm[norm > 0], full_matrices=False)
        basis = basis[:, found > _ALONE * found[0]] if found.size else basis
        image = self.coupled(basis.reshape(*shape, -1)).reshape(size, -1)
        return basis, basis.T @ image

    @cached_property
    def _products(self) -> FloatArray:
        """[F | Z] (C, m, R + M): the length that the coupling takes, and scores by manoeuvre."""
        basis, inner = self._low_rank
        values, vectors = np.linalg.eigh(np.eye(inner.shape[0]) - inner.T @ inner)
        taken = basis @ (vectors * np.sqrt(np.maximum(values, 0.0)))
        shape = self.residual.shape
        scores = np.zeros((*shape, self.manoeuvres))
        scores[np.arange(shape[0]), :, self.base.cells.manoeuvre] = self.residual
        flat = scores.reshape(-1, self.manoeuvres)
        along = basis.T @ flat
        flat = flat - basis @ (along - inner.T @ along)
        return np.concatenate([taken, flat], axis=1).reshape(*shape, -1)

    def without(self, whitened: FloatArray) -> FloatArray:
        """`coupled` of columns (C, m, k), as (N, k); of few cells by the low rank, which is quick.

        That grows with cells times manoeuvres: of many logs it would not fit in memory.
        """
        if len(self.base.cells) > FEW_CELLS:
            return self.coupled(whitened).reshape(-1, whitened.shape[-1])
        basis, inner = self._low_rank
        flat = whitened.reshape(basis.shape[0], -1)
        along = basis.T @ flat
        return np.asarray(flat - basis @ (along - inner @ along), dtype=np.float64)

    def worth(self, columns: FloatArray, factors: FloatArray, together: int = 1) -> Gain:
        """What columns `of_cells` (C, m, S together) are worth under each law, factors (L, C).

        Every `together` neighbouring columns are judged as one: scores (L S, M, together).
        """
        C, _, K = columns.shape
        products = np.swapaxes(self._products, 1, 2) @ columns
        rank = products.shape[1] - self.manoeuvres
        L, S = factors.shape[0], K // together
        summed = np.tensordot(factors, products, axes=(1, 0))
        pairs = columns.reshape(C, -1, S, together)
        inner = np.einsum("cmsi,cmsj->csij", pairs, pairs)
        whole = np.tensordot(factors**2, inner, axes=(1, 0))
        taken = summed[:, :rank].reshape(L, rank, S, together)
        gram = whole - np.einsum("lrsi,lrsj->lsij", taken, taken)
        scores = np.moveaxis(summed[:, rank:].reshape(L, self.manoeuvres, S, together), 1, 2)
        return Gain(
            scores.reshape(L * S, self.manoeuvres, together),
            gram.reshape(L * S, together, together),
            np.einsum("lsii->lsi", whole).reshape(L * S, together),
        )
