"""The lever arm of each grating of one tire, as parameters of the model that all share.

A grating that sits deeper in the tread reads less strain: its lever arm is the model's times a
ratio of its own, and the first grating's ratio is one. The ratios are parameters of a fit, never of
a model file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from tirelog.inference.cells.cells import Cells
from tirelog.physics.model.model import Model
from tirelog.physics.parameters import Parameter
from tirelog.vocabulary.observables import STRAIN

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
    new = []
    for own, size in zip(gratings[1:], sizes[1:], strict=True):
        start = float(np.clip(size / max(sizes[0], 1e-300), 2.0 * _LEAST, 0.5 * _MOST))
        new.append(
            Parameter(
                ratio_name(own.member),
                "1",
                f"lever arm of {own.member} over that of {gratings[0].member}",
                start,
                _LEAST,
                _MOST,
                1.0,
            )
        )
    kept = tuple(p for p in model.base if not p.name.startswith(_OWN))
    return replace(model, base=(*kept, *new)) if LEVER in model.parameters else model


def without_ratios(model: Model) -> Model:
    """The model as a file has it: without the gratings' own lever arms."""
    if not any(p.name.startswith(_OWN) for p in model.base):
        return model
    return replace(model, base=tuple(p for p in model.base if not p.name.startswith(_OWN)))


def ratio_of(model: Model, member: str, values: Mapping[str, float] | None = None) -> float:
    """A grating's lever arm over the model's; 1 for the first, and for what is none."""
    name = ratio_name(member)
    if not member or name not in model.parameters:
        return 1.0
    return float((values or {}).get(name, model.parameters[name].value))


def at_lever(model: Model, member: str) -> Model:
    """The model with a grating's own lever arm; its ratio is one then, so that twice is once."""
    ratio = ratio_of(model, member)
    if ratio == 1.0:
        return model
    lever = model.parameters[LEVER]
    value = lever.value * ratio
    own = replace(lever, value=value, min=min(lever.min, value), max=max(lever.max, value))
    one = replace(model.parameters[ratio_name(member)], value=1.0, se=None)
    return model.with_parameters({LEVER: own, one.name: one})


def own_values(
    model: Model, member: str, values: Mapping[str, float] | None
) -> dict[str, float] | None:
    """Values for the model `at_lever`, of values for the model that all gratings share."""
    if not values:
        return None
    own = {k: v for k, v in values.items() if not k.startswith(_OWN)}
    if (LEVER in own or ratio_name(member) in values) and LEVER in model.parameters:
        lever = own.get(LEVER, model.parameters[LEVER].value)
        own[LEVER] = lever * ratio_of(model, member, values)
    return own
