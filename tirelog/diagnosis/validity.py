"""Where logs or fitted numbers leave the ranges in which a model's effects are valid."""

from __future__ import annotations

import numpy as np

from tirelog.inference.base import FittedChannel
from tirelog.physics.carcass.numbers import steady_carcass
from tirelog.vocabulary.conditions import CONDITIONS


def out_of_range(base: FittedChannel) -> list[str]:
    """A remark for each range of an effect of the fitted model that is left; none if it is off.

    A log's conditions are judged by the means of like revolutions, which is what is fitted; one
    that is not known leaves no range.
    """
    model, cells = base.model, base.cells
    flat, carcass = model.values, steady_carcass(model.carcass)
    said = []
    for entry in model.effects:
        effect, values = entry.effect, entry.values(flat)
        if not effect.is_on(values, carcass):
            continue
        for name, bounds in effect.valid_range.items():
            low, high = float(bounds[0]), float(bounds[1])
            condition = CONDITIONS.get(name)
            if condition is None:
                unit = next(p.unit for p in entry.parameters if p.name == name)
                if not low <= values[name] <= high:
                    said.append(
                        f"{effect.id} is valid for {name} {_range(low, high, unit)}; "
                        f"it stands at {values[name]:.4g}"
                    )
                continue
            x = getattr(cells.conditions, name)
            outside = int(cells.revolutions[(x < low) | (x > high)].sum())
            if outside:
                said.append(
                    f"{effect.id} is valid for {condition.name} "
                    f"{_range(low, high, condition.unit)}; {outside} of "
                    f"{int(cells.revolutions.sum())} revolutions are outside, by the means of like "
                    "ones"
                )
    return said


def _range(low: float, high: float, unit: str) -> str:
    """`from 2 to 40 m/s`, or one bound if there is no other."""
    after = "" if unit == "1" else f" {unit}"
    upper = "" if np.isinf(high) else f"to {high:g}{after}"
    lower = "" if np.isinf(low) else f"from {low:g}" + ("" if upper else after)
    return f"{lower} {upper}".strip() if lower else f"up {upper}"
