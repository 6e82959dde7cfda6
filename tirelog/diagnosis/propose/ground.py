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

from tirelog.diagnosis.candidates.assessment import (
    ANGLES,
    beside_base,
    gain_sigmas,
    hats_on,
    mean_drop,
)
from tirelog.diagnosis.propose.grammar import Law, laws
from tirelog.inference.base import Base, with_fewer_cells
from tirelog.inference.cells.cells import predicted
from tirelog.inference.floor import held_out_losses
from tirelog.inference.metric import Whitener, side_by_side, stacked
from tirelog.physics.effects import Effect
from tirelog.physics.model.file import shape_entry
from tirelog.physics.model.model import ModelEffect
from tirelog.physics.model.user_effects import (
    CONDITIONS,
    FRAMES,
    PLACES,
    parse_expression,
)
from tirelog.vocabulary.arrays import FloatArray

#: cells of which the coupling is kept as a low rank, and on which the grammar is scanned: the time
#: goes with them, and 60 span 20 manoeuvres
FEW_CELLS = 60


def typical(base: Base) -> dict[str, float]:
    """A round value of each condition that varies in the cells and is known, by symbol."""
    # a condition varies if its range is above this share of its largest value; acceleration [m/s^2]
    # and temperature [K] above these. Half of it takes the scatter of a cruise for a variation
    share, ranges = 0.05, {"acceleration": 0.3, "temperature": 1.0}
    found = {}
    for symbol, column in {**CONDITIONS, "load": "load_N"}.items():
        size = np.abs(values := getattr(base.cells.conditions, column))
        varies = np.ptp(values) > max(share * size.max(), ranges.get(symbol, 0.0))
        if symbol not in ("time", "speed") and np.isfinite(values).all() and varies:
            found[symbol] = float(f"{size.mean() or size.max():.1e}")
    return found


#: scores, gram, size: see `Ground.worth`
Worth = tuple[FloatArray, FloatArray, FloatArray]


class Ground:
    """The residual that a base leaves, and expressions on its cells."""

    def __init__(self, base: Base) -> None:
        self.base = base
        cells, model = base.cells, base.model
        self.taken, self.residual = beside_base(base)
        white, ones = base.white, np.ones_like(base.white.inverse_sd)
        self._cell = Whitener(white.inverse_sd, white.basis, white.shrink)
        self._coupling = replace(
            white, inverse_sd=ones, basis=ones[..., None][..., :0], shrink=ones[:, :0]
        )
        beside = cells.values - base.fit.prediction - base.fit.beside
        #: root mean square of what base and nuisances leave, in the observable's unit
        self.missing = float(np.sqrt(np.nanmean(beside**2)))
        self.manoeuvres = cells.manoeuvres
        radius, phi = model.values["radius_m"], np.nan_to_num(cells.phi)
        spread = np.sqrt(np.nan_to_num(np.maximum(cells.phi_variance, 0.0)))
        self._bins = [{"phi": at, "xi": at * radius} for at in (phi - spread, phi + spread)]
        load = cells.conditions.load_N[:, None]
        self.values: dict[str, Any] = {
            **{name: getattr(cells.conditions, of)[:, None] for name, of in CONDITIONS.items()},
            "phi": phi,
            "xi": phi * radius,
            "L": model.half_length_m(cells.conditions)[:, None],
            "R": radius,
            "load": np.where(np.isfinite(load), load, model.values.get("load_N", np.nan)),
        }

    @property
    def few(self) -> Ground:
        """The ground itself, or of many cells that of some, on which the grammar is scanned."""
        many = len(self.base.cells) > FEW_CELLS
        return Ground(with_fewer_cells(self.base, FEW_CELLS)) if many else self

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
        model = self.base.model.with_effect(ModelEffect.of(effect))
        return np.nan_to_num(predicted(model, self.base.cells) - self.base.fit.prediction) / probe

    def expression(self, text: str, numbers: Mapping[str, Any]) -> FloatArray:
        """An expression's values on the cells; numbers of shape (S, 1, 1) give (S, C, m)."""
        formula = parse_expression(text, {*PLACES, *CONDITIONS, *numbers})
        return formula({**self.values, **numbers})

    def in_bins(self, text: str, numbers: Mapping[str, Any]) -> FloatArray:
        """The same in the mean over the samples of each bin, as the model predicts it."""
        return np.asarray(0.5 * sum(self.at_ends(text, numbers)))

    def at_ends(self, text: str, numbers: Mapping[str, Any]) -> tuple[FloatArray, FloatArray]:
        """An expression a standard deviation of the samples' angles to either side of a bin."""
        below, above = (self.expression(text, {**at, **numbers}) for at in self._bins)
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
        parts, own = [basis for basis, _ in self.taken.spans], self.taken
        offsets = np.zeros((*shape, own.norm.size))
        offsets[np.arange(shape[0]), :, own.log] = own.direction
        parts.append(offsets.reshape(size, -1))
        for rows, basis in zip(self._coupling.groups, self._coupling.group_basis, strict=True):
            whole = np.zeros((*shape, basis.shape[1]))
            whole[rows] = basis.reshape(rows.size, -1, basis.shape[1])
            parts.append(whole.reshape(size, -1))
        columns = np.concatenate(parts, axis=1)
        norm = np.linalg.norm(columns, axis=0)
        basis, found, _ = np.linalg.svd(columns[:, norm > 0] / norm[norm > 0], full_matrices=False)
        # eigenvalues of a coupling below this are directions that it leaves alone
        basis = basis[:, found > 1e-10 * found[0]] if found.size else basis
        return basis, basis.T @ self.coupled(basis.reshape(*shape, -1)).reshape(size, -1)

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
        """`coupled` of columns (C, m, k), as (N, k)."""
        return stacked(self.coupled(whitened))

    def worth(self, columns: FloatArray, factors: FloatArray, together: int = 1) -> Worth:
        """What columns `of_cells` (C, m, S together) are worth under each law, factors (L, C).

        Every `together` neighbouring columns are judged as one, k = together.

        Returned are the scores (L S, M, k) of each manoeuvre and the gram (L S, k, k). The last is
        the squared length (L S, k) of the columns before the projection.
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
        return (
            scores.reshape(L * S, self.manoeuvres, together),
            gram.reshape(L * S, together, together),
            np.einsum("lsii->lsi", whole).reshape(L * S, together),
        )


# ---- Free shapes, measured: in which frame the leftover does not move, and by which law it grows.
#
# ground -> hats along each frame's coordinate, under every law -> what each explains
#     -> the best held out: the ceiling of any single form in that frame, and an effect as it is


#: nodes in each frame's unit: as close as a strain at the speeds of a car can bend, 3 mm along the
#: tread at the patch; half as many lose a ringing of 300 Hz, twice as many measure noise
_PATCH = np.unique(np.r_[-18:-3:1.0, np.arange(-25, 26) * 0.12, 3.12:18.1:1.0])
_TIMES = np.r_[0:0.03:0.0007, 0.03:0.06:0.0014, 0.06:0.41:0.01]
_DISTANCES = np.r_[0:0.3:0.007, 0.3:0.6:0.014, 0.6:3.1:0.06]
NODES: Mapping[str, FloatArray] = {
    "wheel_angle": ANGLES,
    "patch": _PATCH,
    "time_since_exit": _TIMES,
    "distance_since_exit": _DISTANCES,
    "time_before_entry": _TIMES,
    "distance_before_entry": _DISTANCES,
}
#: height that is likely before anything is measured, in roots of the mean square that is left. It
#: holds back what the base does as well; doubled, no shape that is seen changes
_LIKELY = 10.0


@dataclass(frozen=True)
class MeasuredShape:
    """A free shape of the waveform along a frame's coordinate, times a law.

    `values` (k,) at `nodes` (k,) with their standard errors `band` (k,), in the unit of the
    observable that it `acts_on`; `removed` the mean square [unit^2] that it removes on manoeuvres
    left out, `gain` over its error there.
    """

    frame: str
    acts_on: str
    law: str
    nodes: FloatArray
    values: FloatArray
    band: FloatArray
    removed: float
    gain: float

    @property
    def words(self) -> str:
        return FRAMES[self.frame].words

    def entry(self, name: str) -> ModelEffect:
        """The shape as an effect of a model, which a model file can hold."""
        own = (self.nodes, self.values)
        return shape_entry(name, self.acts_on, self.frame, self.law, own)


def measured_shapes(ground: Ground, full: Ground) -> list[MeasuredShape]:
    """The best shape of each frame, by falling removal held out.

    `ground` may be of fewer cells than `full`, on which they are judged.
    """
    given, likely = laws(typical(full.base)), _LIKELY * ground.missing
    factors = np.stack([ground.law(law.text, law.numbers) for law in given])
    ranked: list[tuple[float, str, Law]] = []
    for frame in NODES:
        nodes, columns = _hats(ground, frame)
        scores, gram, _ = ground.worth(ground.of_cells(columns), factors, nodes.size)
        explained = [_solved(scores[i].sum(axis=0), gram[i], likely)[0] for i in range(len(given))]
        ranked += [(e, frame, law) for e, law in zip(explained, given, strict=True)]
    ranked.sort(key=lambda row: -row[0])
    best: dict[str, Law] = {}
    for _, frame, law in ranked:
        best.setdefault(frame, law)
    # shapes that are tried on held-out manoeuvres, the best of each frame first; twice as many take
    # twice as long
    asked = list(best.items())[:4]
    # the runner-up laws of the best frame: an exponent by what is held out
    asked += [(frame, law) for _, frame, law in ranked[:3] if frame == asked[0][0]][1:]
    found = sorted((_measured(full, *one) for one in asked), key=lambda shape: shape.removed)
    by_frame = {shape.frame: shape for shape in found}
    return sorted(by_frame.values(), key=lambda shape: -shape.removed)


def _hats(ground: Ground, frame: str) -> tuple[FloatArray, FloatArray]:
    """Hats along one frame: nodes (k,), columns (C, m, k) per height."""
    known, nodes = FRAMES[frame], NODES[frame]
    if nodes[0] == 0.0:  # from an edge on: no farther than the data reach
        reach = float(ground.expression(known.coordinate, {}).max())
        nodes = nodes[: int(np.searchsorted(nodes, reach)) + 1]
    ends = (np.broadcast_to(x, ground.residual.shape) for x in ground.at_ends(known.coordinate, {}))
    below, above = (hats_on(x, nodes, known.periodic) for x in ends)
    columns = 0.5 * (below + above)
    if known.periodic is not None:  # the last node is the first
        columns[..., 0] += columns[..., -1]
        columns, nodes = columns[..., :-1], nodes[:-1]
    return nodes, columns


def _solved(
    scores: FloatArray, gram: FloatArray, likely: float
) -> tuple[float, FloatArray, FloatArray]:
    """(explained, heights (k,), their covariance (k, k)) from products with the residual (k,)."""
    values, vectors = np.linalg.eigh(gram)
    inverse = 1.0 / (np.maximum(values, 0.0) + likely**-2)
    along = vectors.T @ scores
    heights = vectors @ (inverse * along)
    return float((inverse * along**2).sum()), heights, (vectors * inverse) @ vectors.T


def _measured(full: Ground, frame: str, law: Law) -> MeasuredShape:
    """One shape on all cells, and what it removes from manoeuvres left out."""
    base, (nodes, columns) = full.base, _hats(full, frame)
    factor = full.law(law.text, law.numbers)[:, None, None]
    left = stacked(side_by_side(lambda some: full.coupled(full.of_cells(factor * some)), [columns]))
    along = left.T @ full.residual.ravel()
    explained, heights, covariance = _solved(along, left.T @ left, _LIKELY * full.missing)
    white, plain = held_out_losses(base.cells, base.white, base.plain, base.fit, columns * factor)
    rest = max((full.square - explained) / max(base.fit.freedom, 1.0), 1.0)
    return MeasuredShape(
        frame=frame,
        acts_on=base.model.observable,
        law=law.written() or "1",
        nodes=nodes,
        values=heights,
        band=np.sqrt(np.maximum(np.diag(covariance), 0.0) * rest),
        removed=mean_drop(base, plain),
        gain=gain_sigmas(base.held_white, white),
    )
