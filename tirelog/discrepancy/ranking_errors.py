"""Errors of the ranking: how well the share of the excess that an effect removes is known, by the scatter of manoeuvres."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tirelog.discrepancy.selection import gain_and_error

if TYPE_CHECKING:
    from tirelog.discrepancy.diagnosis import Found


def removed_errors(found: Found) -> dict[str, float]:
    """Effect -> standard error of the share of the held-out excess mean-square error that it removes alone.

    Known for the candidates that were refitted in the first step; empty where there is no excess to share.
    """
    first = found.steps[0]
    floor = (found.after if found.named else found.before).floor.square
    excess = first.before.square_held - floor
    if excess <= 0.0:
        return {}
    errors = {}
    for rival in first.contenders:
        _, error = gain_and_error(first.before.held_plain, rival.base.held_plain)
        errors[rival.id] = error / first.before.plain.weight / excess
    return errors
