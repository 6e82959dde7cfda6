"""Errors of the ranking.

How well the share of the excess that an effect removes is known, by the scatter of manoeuvres.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tirelog.diagnosis.sign_flips import gain_and_error

if TYPE_CHECKING:
    from tirelog.diagnosis.search import Found


def removed_errors(found: Found) -> dict[str, float]:
    """Effect -> standard error of the share of the excess that it removes alone.

    The excess is the held-out mean-square error above the floor. The share is a ratio of sums over
    manoeuvres, gain over excess; its error is that of the sum of (gain - share x excess). Known for
    the candidates that were refitted in the first step; empty if there is no excess to share.
    """
    base = found.steps[0].before
    floor = (found.after if found.named else found.before).floor
    excess = (
        base.held_plain
        - (base.plain.bias + (floor.square - base.floor.within) * base.plain.weight)
        / base.held_plain.size
    )
    if excess.sum() <= 0.0:
        return {}
    errors = {}
    for rival in found.steps[0].contenders:
        share = float((base.held_plain - rival.base.held_plain).sum() / excess.sum())
        _, error = gain_and_error(base.held_plain, rival.base.held_plain + share * excess)
        errors[rival.id] = error / float(excess.sum())
    return errors
