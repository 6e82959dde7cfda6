"""The ranking of all effects that were tried: shares of the excess, strengths, and their errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tirelog.diagnosis.candidates.assessment import Assessed
from tirelog.diagnosis.candidates.search import Found
from tirelog.diagnosis.candidates.sign_flips import gain_and_error
from tirelog.diagnosis.results import Candidate
from tirelog.diagnosis.rules import LEAST_SHARE_OF_FLOOR


def ranking_of(
    found: Found, selected: Sequence[str], excess: float, floor: float, share_of_all: float
) -> tuple[Candidate, ...]:
    """All candidates of the first step.

    Those named later follow with what they did when they were named. If one effect was selected its
    share is `share_of_all`, so that the table and the sentence say one number.
    """
    first = found.steps[0]
    refitted = {r.id: r for r in first.contenders}
    rows: list[tuple[Assessed, float, Mapping[str, Any]]] = []
    tested = [
        a for a in first.assessed if a.id not in first.reasons or a.id in selected
    ]  # a failed refit is no number
    for a in tested:
        removed = (
            refitted[a.id].base.square_held
            if a.id in refitted
            else first.before.square_held - a.removed
        )
        unphysical = a.signature.one_sided and a.strengths[0] < 0.0 and a.id not in refitted
        shared = excess > LEAST_SHARE_OF_FLOOR * floor and not unphysical
        share = (first.before.square_held - removed) / excess if shared else 0.0
        share = share_of_all if tuple(selected) == (a.id,) else share
        rows.append((a, float(np.clip(share, 0.0, 1.0)), _strengths(found, a, refitted)))
    later = [s.named for s in found.steps[1:] if s.named is not None]
    p = {r.id: r.assessed.p for r in later}
    order = [r.id for r in first.contenders] + [a.id for a in tested if a.id not in refitted]
    order = list(selected) + [name for name in order if name not in selected]
    groups = {s.named.id: s.group for s in found.steps if s.named is not None}
    by_id = {a.id: (a, share, strengths) for a, share, strengths in rows}
    return tuple(
        Candidate(
            effect=name,
            rank=i + 1,
            excess_removed=by_id[name][1],
            p_adjusted=p.get(name, by_id[name][0].p),
            selected=name in selected,
            group=tuple(g for g in groups.get(name, ()) if g != name),
            statistic=by_id[name][0].statistic,
            strengths=by_id[name][2],
        )
        for i, name in enumerate(n for n in order if n in by_id)
    )


def _strengths(found: Found, a: Assessed, refitted: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The effect's parameters with errors and units.

    From the final model, its own refit, or the linear fit.
    """
    for model in (found.after.model, *([refitted[a.id].base.model] if a.id in refitted else [])):
        own = {n.split(".")[1]: q for n, q in model.parameters.items() if n.startswith(f"{a.id}.")}
        if own:
            return {
                name: {"value": q.value, "se": q.se, "se_with_form": q.se_with_form, "unit": q.unit}
                for name, q in own.items()
                if q.free
            }
    units = {q.name: q.unit for q in a.signature.effect.parameters}
    return {
        n: {"value": float(v), "se": None, "unit": units[n]}
        for n, v in zip(a.signature.strengths, a.strengths, strict=True)
    }


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
