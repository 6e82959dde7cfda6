"""The catalogue of effects, in chapters by the stage that they enter.

An effect is a function with `@effect` in one of them (`base.effect`).
"""

from __future__ import annotations

from collections.abc import Iterable

from tirelog.physics.effects import contact, structure, waveform
from tirelog.physics.effects.base import Drive, Effect, Site, Structure, Values, acting_on

#: Every effect of the catalogue, in the contract's order: that of the chapters and of their lines.
CATALOGUE: tuple[Effect, ...] = tuple(
    found
    for chapter in (structure, contact, waveform)
    for found in vars(chapter).values()
    if isinstance(found, Effect)
)
BY_ID = {effect.id: effect for effect in CATALOGUE}


def conditions_read(effects: Iterable[Effect]) -> set[str] | None:
    """Conditions that effects of the catalogue follow or need.

    None if one is the user's own, of which nobody knows.
    """
    read = set[str]()
    for effect in effects:
        if effect != BY_ID.get(effect.id):
            return None
        read |= {*dict(effect.followed), *effect.needs, *effect.instead.values()}
    return read


def readers(effect: Effect, observable: str) -> list[Effect]:
    """The effects of the catalogue beside which `effect` acts on an observable.

    None for an observable on which it acts by itself, or not at all.
    """
    if effect.acts_in(observable, ()):
        return []
    return [
        other
        for other in CATALOGUE
        if observable in other.observables and effect.acts_in(observable, [other])
    ]


def serves(effect: Effect) -> dict[str, str]:
    """The observables that an effect acts on, in words.

    With the effects that it needs beside it there, if it does not act by itself.
    """
    said = {name: name for name in effect.reaches}
    for name in effect.observables:
        if beside := [other.id for other in readers(effect, name)]:
            said[name] = f"{name} (beside {' or '.join(beside)})"
    return said


__all__ = [
    "BY_ID",
    "CATALOGUE",
    "Drive",
    "Effect",
    "Site",
    "Structure",
    "Values",
    "acting_on",
    "conditions_read",
    "readers",
    "serves",
]
