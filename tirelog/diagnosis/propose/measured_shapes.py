"""Free shapes, measured: in which frame the leftover stands still, and by which law it grows.

ground -> hats along each frame's coordinate, under every law -> what each explains
    -> the best held out: the ceiling of any single form in that frame, and an effect as it is
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tirelog.diagnosis.candidates.assessment import gain_and_error
from tirelog.diagnosis.candidates.effect_jacobians import ANGLES, hats_on
from tirelog.diagnosis.propose.formulas import typical
from tirelog.diagnosis.propose.grammar import GivenLaw, laws
from tirelog.diagnosis.propose.ground import Ground
from tirelog.errors import ModelError, or_refusal
from tirelog.inference.base import Base
from tirelog.inference.floor import held_out_losses
from tirelog.inference.metric import side_by_side
from tirelog.physics.model.model import ModelEffect
from tirelog.physics.model.user_effects import FRAMES, effect_by_shape
from tirelog.vocabulary.arrays import FloatArray

#: nodes in each frame's unit: as close as a strain at the speeds of a car can bend, 3 mm along the
#: tread at the patch; half as many lose a ringing of 300 Hz, twice as many measure noise
_PATCH = np.unique(np.r_[-18:-3:1.0, np.arange(-25, 26) * 0.12, 3.12:18.1:1.0])
_TIMES = np.r_[0:0.03:0.0007, 0.03:0.06:0.0014, 0.06:0.41:0.01]
_DISTANCES = np.r_[0:0.3:0.007, 0.3:0.6:0.014, 0.6:3.1:0.06]
_PRESSED = np.r_[-1.95:1.96:0.15]
NODES: Mapping[tuple[str, str], FloatArray] = {
    ("wheel_angle", ""): ANGLES,
    ("patch", ""): _PATCH,
    ("time_since_exit", ""): _TIMES,
    ("distance_since_exit", ""): _DISTANCES,
    ("time_before_entry", ""): _TIMES,
    ("distance_before_entry", ""): _DISTANCES,
    ("patch", "contact_pressure"): _PRESSED,
    ("speed", "load"): np.zeros(0),
}
#: nodes over the range of speeds for what acts on the load: it is smooth; twice as many share the
#: same cells, and each is known half as well
_SPEEDS = 6
#: heights that are likely before anything is measured: of a waveform in roots of the mean square
#: that is left, of a pressure in mean pressures, of a load in mean loads.  They hold back what
#: the base does as well; doubled, no shape that is seen changes
_LIKELY = {"": 10.0, "contact_pressure": 1.0, "load": 0.3}
#: small amplitudes of a hat for its response; twice as much doubles the share of the response that
#: is not linear in it
_PROBE = {"contact_pressure": 0.02, "load": 20.0}
#: shapes that are tried on held-out manoeuvres, the best of each frame first; twice as many take
#: twice as long
_TRIED = 4


@dataclass(frozen=True)
class MeasuredShape:
    """A free shape along a frame's coordinate, times a law.

    `values` (k,) at `nodes` (k,) with their standard errors `band` (k,), in the unit of what it
    acts on (of a pressure in mean pressures); `removed` the mean square [unit^2] that it removes on
    manoeuvres left out, `gain` over its error there.
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
        nodes, values = ([float(f"{x:.6g}") for x in given] for given in (self.nodes, self.values))
        effect = effect_by_shape(name, self.acts_on, self.frame, self.law, nodes, values)
        source = {
            "shape": "empirical",
            "acts_on": self.acts_on,
            "frame": self.frame,
            "law": self.law,
            "nodes": nodes,
            "values": values,
        }
        return ModelEffect(effect, effect.parameters, {}, source)


@dataclass(frozen=True)
class _Hats:
    """Hats along one frame: nodes (k,), columns (C, m, k) in the observable's unit per height."""

    frame: str
    acts_on: str
    nodes: FloatArray
    columns: FloatArray
    likely: float


def measured_shapes(ground: Ground, full: Ground) -> list[MeasuredShape]:
    """The best shapes by what they remove held out, each frame's best law; none if all fail.

    `ground` may be of fewer cells than `full`, on which they are judged.
    """
    given = laws(typical(full.base))
    factors = np.stack([ground.law(law.text, law.numbers) for law in given])
    ranked: list[tuple[float, tuple[str, str], GivenLaw]] = []
    for key in NODES:
        own = or_refusal(_hats)(ground, *key)
        if isinstance(own, ModelError):
            continue
        worth = ground.worth(ground.of_cells(own.columns), factors, own.nodes.size)
        explained = [
            _solved(worth.scores[i].sum(axis=0), worth.gram[i], own.likely)[0]
            for i in range(len(given))
        ]
        ranked += [(e, key, law) for e, law in zip(explained, given, strict=True)]
    ranked.sort(key=lambda row: -row[0])
    best: dict[tuple[str, str], GivenLaw] = {}
    for _, key, law in ranked:
        best.setdefault(key, law)
    asked = list(best.items())[:_TRIED]
    # the runner-up laws of the best frame: an exponent by what is held out
    asked += [(key, law) for _, key, law in ranked[:3] if key == asked[0][0]][1:]
    tried = [_measured(full, key, law) for key, law in asked]
    found = [shape for shape in tried if not isinstance(shape, ModelError)]
    return sorted(found, key=lambda shape: -shape.removed)


def _hats(ground: Ground, frame: str, acts_on: str) -> _Hats:
    """The hats of a frame on the ground's cells.  ModelError if they cannot be computed."""
    known = FRAMES[frame]
    nodes = NODES[frame, acts_on]
    if acts_on == "contact_pressure":
        unit = np.eye(nodes.size)[1:-1]
        inner = [_response(ground, acts_on, frame, nodes, row) for row in unit]
        ends = [np.zeros_like(inner[0])]
        return _Hats(frame, acts_on, nodes, np.stack(ends + inner + ends, -1), _LIKELY[acts_on])
    coordinate = ground.expression(known.coordinate, {})
    if acts_on == "load":
        nodes = np.linspace(float(coordinate.min()), float(coordinate.max()), _SPEEDS)
        whole = np.array([0.0, 1e3])
        change = _response(ground, acts_on, frame, whole, np.ones(2))
        columns = change[..., None] * hats_on(coordinate, nodes)
        likely = _LIKELY[acts_on] * float(np.mean(ground.values["load"]))
        return _Hats(frame, acts_on, nodes, columns, likely)
    if known.periodic is None:
        reach = float(coordinate.max())
        nodes = nodes[: int(np.searchsorted(nodes, reach)) + 1] if nodes[0] == 0.0 else nodes
    shape = ground.residual.shape
    below, above = (
        hats_on(np.broadcast_to(at, shape), nodes, known.periodic)
        for at in ground.at_ends(known.coordinate, {})
    )
    columns = 0.5 * (below + above)
    if known.periodic is not None:  # the last node is the first
        columns[..., 0] += columns[..., -1]
        columns, nodes = columns[..., :-1], nodes[:-1]
    return _Hats(frame, acts_on, nodes, columns, _LIKELY[""] * ground.missing)


def _response(
    ground: Ground, acts_on: str, frame: str, nodes: FloatArray, values: FloatArray
) -> FloatArray:
    """The change of the prediction by a shape of these values, per unit of them, (C, m)."""
    probe = _PROBE[acts_on]
    effect = effect_by_shape(
        "probe_", acts_on, frame, "1", nodes.tolist(), (probe * values).tolist()
    )
    return ground.response(effect, probe)


def _solved(
    scores: FloatArray, gram: FloatArray, likely: float
) -> tuple[float, FloatArray, FloatArray]:
    """(explained, heights (k,), their covariance (k, k)) from products with the residual (k,)."""
    values, vectors = np.linalg.eigh(gram)
    inverse = 1.0 / (np.maximum(values, 0.0) + likely**-2)
    along = vectors.T @ scores
    heights = vectors @ (inverse * along)
    return float((inverse * along**2).sum()), heights, (vectors * inverse) @ vectors.T


@or_refusal
def _measured(full: Ground, key: tuple[str, str], law: GivenLaw) -> MeasuredShape:
    """One shape on all cells, and what it removes from manoeuvres left out."""
    base, own = full.base, _hats(full, *key)
    factor = full.law(law.text, law.numbers)
    left = side_by_side(
        lambda some: full.coupled(full.of_cells(factor[:, None, None] * some)), [own.columns]
    ).reshape(-1, own.nodes.size)
    along = left.T @ full.residual.ravel()
    explained, heights, covariance = _solved(along, left.T @ left, own.likely)
    removed, gain = _held_out(base, own.columns * factor[:, None, None])
    rest = max((full.square - explained) / max(base.fit.freedom, 1.0), 1.0)
    acts_on = own.acts_on or base.model.observable
    return MeasuredShape(
        own.frame,
        acts_on,
        law.written() or "1",
        own.nodes,
        heights,
        np.sqrt(np.maximum(np.diag(covariance), 0.0) * rest),
        removed,
        gain,
    )


def _held_out(base: Base, columns: FloatArray) -> tuple[float, float]:
    """(mean square [unit^2] that free columns remove held out, gain over its error)."""
    held_white, held_plain = held_out_losses(base.cells, base.white, base.plain, base.fit, columns)
    gain, error = gain_and_error(base.held_white, held_white)
    removed = float((base.held_plain - held_plain).sum()) / base.plain.weight
    return removed, gain / error if error > 0.0 else 0.0


def without_twins(shapes: Sequence[MeasuredShape]) -> list[MeasuredShape]:
    """The best of each frame, by falling removal."""
    best: dict[tuple[str, str], MeasuredShape] = {}
    for shape in shapes:
        best.setdefault((shape.frame, shape.acts_on), shape)
    return list(best.values())
