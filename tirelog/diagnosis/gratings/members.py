"""Each grating of several at the parameters of one fit, fitted or held to it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from tirelog.diagnosis.gratings.found import WHEEL
from tirelog.inference.base import FittedChannel, TogetherBase, apart, fit_together
from tirelog.inference.cells.cells import cells_of
from tirelog.inference.cells.levers import LEVER, without_ratios
from tirelog.inference.cells.together import PiecesTogether, model_of
from tirelog.inference.fit.cells import Problem, finish
from tirelog.inference.nuisances import shared_by
from tirelog.vocabulary.arrays import FloatArray, IntArray

#: means of like revolutions that each grating is asked on: thirty tell a twentieth of a squared
#: floor and take a third of a second; twice as many tell no more that matters
_ASKED = 30


@dataclass(frozen=True)
class Member:
    """One grating at the parameters of a fit to several.

    channel    its cells, metric, floor, and the fit, whose residual is without what is `beside`
    place_rad  its angle on the wheel;  manoeuvre (C,) of its cells, numbered through all gratings
    shared     columns (C, m, K) of the random effects that all gratings share, each as large as
               its standard deviation
    wheel      does what is beside the model hold the wheel's nuisance?
    """

    name: str
    channel: FittedChannel
    place_rad: float
    manoeuvre: IntArray
    shared: FloatArray
    wheel: bool


def members_of(base: TogetherBase) -> Iterator[Member]:
    """The gratings of one fit, one after the other."""
    cells, shared, layout = base.cells, base.cells.shared, base.cells.together
    assert layout is not None
    for i, part in enumerate(apart(base)):
        if not part.cells.member:
            continue
        rows = np.flatnonzero(cells.part == i)
        columns = np.zeros((*part.cells.phi.shape, 0))
        if shared is not None:
            columns = shared.columns[rows][:, : layout.widths[i]] * shared.sd * layout.scales[i]
        yield Member(
            part.cells.member,
            part,
            part.cells.place_rad,
            cells.manoeuvre[rows],
            columns,
            shared is not None and WHEEL in shared.groups,
        )


def members_held(pieces: PiecesTogether, fitted: TogetherBase) -> Iterator[Member]:
    """More gratings than were fitted, one after the other, held to what the fit says.

    Its parameters and what its nuisances do are as they are; each grating has its own lever arm.
    """
    shared = fitted.cells.shared
    groups = () if shared is None else shared.groups
    found = dict(zip(() if shared is None else shared.names, fitted.fit.amplitudes, strict=True))
    model = without_ratios(fitted.model)
    model = replace(model, nuisances=tuple(n.used("auto") for n in model.nuisances))
    free = [name for name in model.free if name != LEVER]
    held = model.with_parameters({name: model.parameters[name].fixed() for name in free})
    rows = [np.linspace(0, len(p) - 1, min(_ASKED, len(p))).round() for p in pieces.parts]
    parts = [p.take(np.unique(r.astype(int))) for p, r in zip(pieces.parts, rows, strict=True)]
    pieces = replace(pieces, parts=tuple(parts))
    number = np.unique(pieces.manoeuvre, return_inverse=True)[1]
    ends = np.cumsum([len(part) for part in pieces.parts])[:-1]
    for part, place, name, manoeuvre in zip(
        pieces.parts, pieces.places, pieces.members, np.split(number, ends), strict=True
    ):
        if not name:
            continue
        cells = replace(cells_of(part), place_rad=place)
        one = model_of(held, part.observable)
        (channel,) = fit_together([cells], one, several=False)
        beside = shared_by(channel.cells, channel.fit, groups)
        if beside is not None:  # baselines of single gratings are in no other's
            does = beside.columns @ np.array([found.get(own, 0.0) for own in beside.names])
            cells = replace(cells, values=cells.values - does)
            (channel,) = fit_together([cells], one, several=False)
        anew = channel.model.with_parameters(
            {n: replace(channel.model.parameters[n], free=True) for n in free}
        )
        names = tuple(n for n in (*free, LEVER) if n in anew.parameters)
        (fit,) = finish([Problem(channel.cells, channel.white)], anew, names, True)
        yield Member(
            name,
            replace(channel, fit=fit, cells=fit.cells),
            place,
            manoeuvre,
            np.zeros((*cells.phi.shape, 0)),
            WHEEL in groups,
        )
