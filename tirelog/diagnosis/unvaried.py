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
from tirelog.vocabulary.conditions import CONDITIONS, SETUP_KEYS

#: a range below this share of the largest value is none
_SAME = 0.02


def not_varied(conditions: Conditions, effects: Iterable[Effect]) -> str:
    """The sentence, '' where there is nothing to say."""
    same: list[str] = []
    unknown: list[str] = []
    who: list[str] = []
    candidates = list(effects)
    for field in SETUP_KEYS:
        followers = [
            effect.id for effect in candidates if field in [name for name, _ in effect.followed]
        ]
        values = getattr(conditions, field)
        known = bool(np.isfinite(values).all())
        if not followers or (known and np.ptp(values) > _SAME * np.abs(values).max()):
            continue
        condition = CONDITIONS[field]
        (same if known else unknown).append(
            f"{condition.name} {np.mean(values):.6g} {condition.unit}" if known else condition.name
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
