"""Cells of several observables of one tire under each other, so that one fit sees them all.

Several gratings are members of one fit like several observables, each with a lever arm of its own
(`levers`).

    Cells of each observable, its scale (its noise floor) --joined_cells--> Cells (C, m)
        rows     those of one observable after the other; `part` says whose a row is
        angles   as many as the observable with most; the others' last bins are empty
        values   over the observable's scale: "noise floors", so that sizes may be added up

A question asked of all of them is asked of these; what is fitted, and what is each one's own, is
asked of the cells of each (`base.JointBase.channels`), which stay as they are.

What is one in physics is one here: the parameters, and the manoeuvre. A stretch of driving is one
replicate however many sensors saw it: leaving it out, or flipping its sign, is done to all of them
at once (`one_drive`). What is each observable's own stays so: noise, floor, metric, scatter, the
offset of each log (`log` numbers the logs of each observable apart), and the nuisances: but what a
nuisance does to the tire or the wheel is one to all gratings of it, and only their baselines are
their own.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Conditions
from tirelog.inference.cells.cells import Cells, SharedEffects
from tirelog.inference.cells.pieces import Pieces
from tirelog.physics.effects import Effect
from tirelog.physics.model.laws import LEVER_RATIO
from tirelog.physics.model.model import Model
from tirelog.physics.spectral import Parameter
from tirelog.vocabulary.arrays import FloatArray, IntArray
from tirelog.vocabulary.observables import STRAIN, together

# ---- The lever arm of each grating of one tire, as parameters of the model that all share.
#
# A grating that sits deeper in the tread reads less strain: its lever arm is the model's times a
# ratio of its own, and the first grating's ratio is one. The ratios are parameters of a fit,
# never of
# a model file.


LEVER = "lever_arm_m"
_OWN = "lever_arm_of_"
#: ratios that a fit may come to: gratings on one surface differ by a factor of two at most, and a
#: wrong strain gain by as much again
_LEAST, _MOST = 0.1, 10.0


def ratio_name(member: str) -> str:
    """The parameter that is a grating's lever arm over the first one's."""
    return _OWN + member.replace(".", ":")  # a dot would make it an effect's


def with_ratios(model: Model, cells: Sequence[Cells]) -> Model:
    """The model with a free ratio for every grating beside the first, near what is measured."""
    gratings = [own for own in cells if own.member and own.observable == STRAIN]
    sizes = [float(np.nanstd(own.values)) for own in gratings]
    new = [
        Parameter(
            ratio_name(own.member),
            "1",
            f"lever arm of {own.member} over that of {gratings[0].member}",
            float(np.clip(size / max(sizes[0], 1e-300), 2.0 * _LEAST, 0.5 * _MOST)),
            _LEAST,
            _MOST,
            1.0,
        )
        for own, size in zip(gratings[1:], sizes[1:], strict=True)
    ]
    kept = tuple(p for p in model.base if not p.name.startswith(_OWN))
    return replace(model, base=(*kept, *new)) if LEVER in model.parameters else model


def without_ratios(model: Model) -> Model:
    """The model as a file has it: without the gratings' own lever arms."""
    if not any(p.name.startswith(_OWN) for p in model.base):
        return model
    return replace(model, base=tuple(p for p in model.base if not p.name.startswith(_OWN)))


def at_lever(model: Model, member: str) -> Model:
    """The model with a grating's own lever arm; its ratio is one then, so that twice is once."""
    ratio = model.parameters.get(ratio_name(member))
    if ratio is None:
        return model
    lever = model.parameters[LEVER]
    value = lever.value * ratio.value
    own = replace(lever, value=value, min=min(lever.min, value), max=max(lever.max, value))
    return model.with_parameters({LEVER: own, ratio.name: replace(ratio, value=1.0, se=None)})


def one_drive(parts: Sequence[Pieces]) -> list[Pieces]:
    """The pieces of each observable, with the manoeuvres of the first in all of them.

    Each sensor finds manoeuvres for itself, and some revolutions later. One of another observable
    becomes the one that most of its revolutions are nearest to in time, of the first observable
    that the log has.
    """
    found: list[Pieces] = []
    #: times [s] and manoeuvres of each log's pieces, of the first observable that it has
    of_log: dict[str, tuple[FloatArray, IntArray]] = {}
    free = 0
    for part in parts:
        own, time = np.empty(len(part), np.int64), part.conditions.time_s
        for manoeuvre in np.unique(part.manoeuvre):
            rows = np.flatnonzero(part.manoeuvre == manoeuvre)
            log = part.logs[part.log[rows[0]]]
            if log not in of_log:
                own[rows], free = free, free + 1
                continue
            nearest = np.abs(time[rows][:, None] - of_log[log][0]).argmin(axis=1)
            number = of_log[log][1][nearest]
            own[rows] = int(np.bincount(number, part.number[rows]).argmax())
        for number in np.unique(part.log).tolist():
            rows = np.flatnonzero(part.log == number)
            of_log.setdefault(part.logs[number], (time[rows], own[rows]))
        found.append(replace(part, manoeuvre=own))
    return found


def joined_cells(
    parts: Sequence[Cells], scales: Sequence[float], drive: Sequence[IntArray]
) -> Cells:
    """The cells of several observables as one.

    scales  (n,) of each observable [its unit];  drive  of each the manoeuvre of its rows, numbered
            through all observables
    """
    width = max(part.phi.shape[1] for part in parts)
    names = tuple(dict.fromkeys(name for part in parts for name in part.logs))

    def joined(name: str, empty: float | None, power: int = 0) -> NDArray[Any]:
        rows = [getattr(part, name) for part in parts]
        if empty is not None:
            each = zip(rows, scales, strict=True)
            rows = [in_bins(own / scale**power, width, empty) for own, scale in each]
        return np.concatenate(rows)

    rows: dict[str, Any] = {
        f.name: joined(f.name, **f.metadata) for f in fields(Cells) if f.metadata
    }
    logs = [np.array([names.index(log) for log in part.logs]) for part in parts]
    rows |= {
        "log": np.concatenate(
            [i * len(names) + own[part.log] for i, (part, own) in enumerate(zip(parts, logs))]
        ),
        "manoeuvre": np.unique(np.concatenate(list(drive)), return_inverse=True)[1],
        "part": np.repeat(np.arange(len(parts)), [len(part) for part in parts]),
    }
    cells = replace(
        parts[0],
        observable=together(
            f"{name} of {n} gratings" if n > 1 else name
            for name, n in Counter(part.observable for part in parts).items()
        ),
        conditions=Conditions.concatenate([part.conditions for part in parts]),
        cell=np.zeros(0, np.int64),
        logs=names * len(parts),
        notes=tuple(dict.fromkeys(note for part in parts for note in part.notes)),
        shared=None,
        parts=tuple(replace(part.take(np.zeros(0, np.int64)), shared=None) for part in parts),
        scales=tuple(float(scale) for scale in scales),
        member="",
        place_rad=np.nan,
        **rows,
    )
    return replace(cells, shared=joined_effects(cells, [part.shared for part in parts]))


def of_all(cells: Cells, each: Sequence[FloatArray], empty: float = 0.0) -> FloatArray:
    """What is of each observable's cells, in its unit, (c, m) or (c, m, k), of all cells as one."""
    width = cells.phi.shape[1]
    rows = [in_bins(x / s, width, empty) for x, s in zip(each, cells.scales, strict=True)]
    return rows[0] if len(rows) == 1 else np.concatenate(rows)


def in_bins(x: FloatArray, width: int, empty: float) -> FloatArray:
    """x (C, m) or (C, m, k) with so many angles, those that it lacks empty."""
    if x.shape[1] == width:
        return x
    more = [(0, 0), (0, width - x.shape[1]), (0, 0)][: x.ndim]
    return np.pad(x, more, constant_values=empty)


def embedded(cells: Cells, part: int, x: FloatArray) -> FloatArray:
    """What is of one observable's cells, in its unit, (c, m) or (c, m, k), among all cells."""
    result = np.zeros((*cells.phi.shape, *x.shape[2:]))
    result[cells.part == part, : x.shape[1]] = x / cells.scales[part]
    return result


def joined_effects(cells: Cells, effects: Sequence[SharedEffects | None]) -> SharedEffects | None:
    """The shared effects of each member's cells as those of all, those of one name as one."""
    if not cells.parts:
        return effects[0]
    joined = SharedEffects.joined(
        None if own is None else replace(own, columns=embedded(cells, i, own.columns))
        for i, own in enumerate(effects)
    )
    if joined is None:
        return None
    kept = [joined.names.index(name) for name in dict.fromkeys(joined.names)]
    of_name = np.equal.outer(joined.names, [joined.names[k] for k in kept]).astype(np.float64)
    return replace(joined.of(kept), columns=joined.columns @ of_name)


def named(effects: SharedEffects, model: Model, cells: Cells) -> SharedEffects:
    """The shared effects of one observable's cells, by names that tell whose they are.

    What a grating alone has is its own; all else is the tire's or the wheel's, and one to all
    gratings. Those of an observable that is alone have no name before theirs.
    """

    def own(name: str) -> str:
        # amplitudes whose names begin so are a grating's own
        of_one = not cells.member or name.startswith("baseline")
        before = cells.label if of_one else cells.observable
        alone = not model.beside and not (cells.member and of_one)
        return name if alone or ": " in name else f"{before}: {name}"

    return replace(effects, names=tuple(map(own, effects.names)))


# ---- what a model says of them -------------------------------------------------------------------


def predicted(
    model: Model,
    cells: Cells,
    *,
    conditions: Conditions | None = None,
    values: Mapping[str, float] | None = None,
) -> FloatArray:
    """What a model predicts of one observable's cells, (C, m), under their conditions or others."""
    one = _seen_by(model, cells)
    own = {_called(name, cells): value for name, value in (values or {}).items()}
    return one.predict(
        cells.conditions if conditions is None else conditions,
        values=_known(one, own),
        surface=cells.surface,
        observable=cells.observable,
        **cells.angles,
    )


def linearised(
    model: Model,
    cells: Cells,
    names: Sequence[str],
    values: Mapping[str, float],
    *,
    rough: bool = False,
) -> tuple[FloatArray, FloatArray]:
    """Prediction (C, m) and Jacobian (C, m, p), `rough` as of `Model.linearised`."""
    one = _seen_by(model, cells)
    own = {_called(name, cells): value for name, value in values.items()}
    asked = _known(one, {_called(name, cells): k for k, name in enumerate(names)})
    prediction, slopes = one.linearised(
        cells.conditions,
        names=list(asked),
        values=_known(one, own),
        rough=rough,
        surface=cells.surface,
        observable=cells.observable,
        **cells.angles,
    )
    jacobian = np.zeros((*cells.phi.shape, len(names)))
    jacobian[..., list(asked.values())] = np.moveaxis(slopes, 0, -1)
    return prediction, jacobian


def _seen_by(model: Model, cells: Cells) -> Model:
    """The model as the observable or grating of these cells sees it."""
    several = model.beside or cells.member
    return model_of(model, cells.observable, cells.member) if several else model


def _called(name: str, cells: Cells) -> str:
    """A parameter of the model that all members share, as it is called in that of one of them."""
    return LEVER_RATIO if name == ratio_name(cells.member) else name


def _known(one: Model, numbers: dict[str, Any]) -> dict[str, Any]:
    """What is given by name, of the parameters that the model of one member has."""
    return {name: number for name, number in numbers.items() if name in one.parameters}


def lacking(effect: Effect, model: Model, cells: Cells) -> list[str]:
    """What an effect needs to be known, and some revolution that it acts on does not know."""
    acts = not model.beside or model.acts_on(effect, cells.observable)
    return effect.missing(cells.conditions) if acts else []


def model_of(model: Model, observable: str, member: str = "") -> Model:
    """The model as one observable sees it: without the effects that do nothing to it.

    What such an effect needs to be known of a log, this observable's logs need not know. Of several
    gratings `member` is the one whose lever arm it has.
    """
    kept = tuple(e for e in model.effects if model.acts_on(e.effect, observable))
    own = (replace(p, name=LEVER_RATIO) for p in model.base if p.name == ratio_name(member))
    base = (*without_ratios(model).base, *own)
    return replace(model, observable=observable, beside=(), effects=kept, base=base)
