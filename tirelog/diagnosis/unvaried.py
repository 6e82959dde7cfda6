"""What these logs do not vary, and which effects follow it.

Said with every diagnosis, since no statistic can.

conditions of the cells, the catalogue's `follows`
    -> one sentence, or none where everything that effects follow varies
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.physics.effects import Effect

#: the catalogue's word -> field of the conditions, words and unit to say it with
_FOLLOWED = {
    "load": ("load_N", "load", "N"),
    "pressure": ("inflation_pressure_Pa", "inflation pressure", "Pa"),
    "distance": ("distance_km", "tread distance", "km"),
    "water depth": ("water_depth_mm", "water depth", "mm"),
}
#: a range below this share of the largest value is none
_SAME = 0.02


def not_varied(conditions: Conditions, effects: Iterable[Effect]) -> str:
    """The sentence, '' where there is nothing to say."""
    same: list[str] = []
    unknown: list[str] = []
    who: list[str] = []
    candidates = list(effects)
    for word, (field, name, unit) in _FOLLOWED.items():
        followers = [
            effect.id
            for effect in candidates
            if word in [part.strip() for part in effect.follows.split(",")]
        ]
        values = getattr(conditions, field)
        known = bool(np.isfinite(values).all())
        if not followers or (known and np.ptp(values) > _SAME * np.abs(values).max()):
            continue
        (same if known else unknown).append(
            f"{name} {np.mean(values):.6g} {unit}" if known else name
        )
        who += [name for name in followers if name not in who]
    if not who:
        return ""
    parts = ([f"the same throughout: {', '.join(same)}"] if same else []) + (
        [f"not known: {', '.join(unknown)}"] if unknown else []
    )
    said = "; ".join(parts)
    return (
        f"{said[0].upper()}{said[1:]}. What follows them ({', '.join(who)}) shows here by its "
        "shape at most; logs that differ in them would tell more."
    )
