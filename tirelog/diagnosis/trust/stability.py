"""Does the verdict stand if one log, or one tire, is left out?  And what does each say alone?

    answers without each log, or tire -> Stability: where the verdict is another one
    answers of each alone             -> Each: verdicts and names counted, p adjusted over them

`by_group` asks for them.

What is pooled says one thing of tires that may differ; each alone says whether they do. Over many
tires some alarm by chance: the adjusted p (Benjamini and Hochberg 1995) holds the share of false
ones among those that are said to lack something at `FALSE_DISCOVERIES`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from tirelog.diagnosis.answer import plain_fields
from tirelog.vocabulary.arrays import FloatArray

#: share of false ones among tires that are said to lack something; doubled, twice as many
FALSE_DISCOVERIES = 0.05
#: verdicts that say that something is missing
_LACKS = ("missing", "ambiguous", "partial", "unknown")
#: groups that a sentence names; of more their number
_TOLD = 4


@dataclass(frozen=True)
class GroupVerdict:
    """What was said of some of the logs.

    `group`: the log or tire that was left out, or alone; `verdict` "" if it could not be asked,
    `problem` why. `p`: how likely chance alone is to look so; None if nothing was tested.
    """

    group: str
    logs: tuple[str, ...]
    verdict: str
    selected: tuple[str, ...] = ()
    ambiguous_groups: tuple[tuple[str, ...], ...] = ()
    p: float | None = None
    probability: float | None = None
    problem: str = ""

    @property
    def tested(self) -> bool:
        """Was anything tested: it could be asked, and there were manoeuvres enough?"""
        return self.verdict not in ("", "too_few")

    @property
    def said(self) -> str:
        """The verdict and its names."""
        names = " or ".join(self.selected) if self.verdict == "ambiguous" else ""
        names = names or " and ".join(self.selected)
        return self.verdict.replace("_", " ") + (f" ({names})" if names else "")


@dataclass(frozen=True)
class Stability:
    """The verdicts without each log, or tire, in turn.

    `by`: log or tire; `whole`: what is said of all of them.
    """

    by: str
    whole: GroupVerdict
    without: tuple[GroupVerdict, ...]

    @property
    def changed(self) -> tuple[GroupVerdict, ...]:
        """Where another thing is said."""
        return tuple(a for a in self.without if a.tested and not alike(a, self.whole))

    @property
    def sentence(self) -> str:
        """Whether the verdict stands, where it does not, and where it cannot be told."""
        changed, untold = self.changed, [a for a in self.without if not a.tested]
        told = len(self.without) - len(untold)
        if changed:
            each = "; ".join(f"without {a.group} it is {a.said}" for a in changed[:_TOLD])
            more = f"; and {len(changed) - _TOLD} more" if len(changed) > _TOLD else ""
            said = (
                f"The verdict hangs on single {self.by}s, {len(changed)} of {told}: {each}{more}."
            )
        else:
            said = (
                f"The verdict stands: it is the same without any one of {told} {self.by}s."
                if told
                else f"Whether the verdict hangs on single {self.by}s cannot be told."
            )
        if untold:
            reasons = "; ".join(
                f"without {a.group}: {a.problem or 'too few manoeuvres are left'}"
                for a in untold[:_TOLD]
            )
            rest = f"; and {len(untold) - _TOLD} more" if len(untold) > _TOLD else ""
            said += f" Not to be told: {reasons}{rest}."
        return said

    def to_json(self) -> dict[str, Any]:
        rows = [
            asdict(a) | {"same": alike(a, self.whole) if a.tested else None} for a in self.without
        ]
        return plain_fields({"by": self.by, "sentence": self.sentence, "without": rows})


def alike(one: GroupVerdict, other: GroupVerdict) -> bool:
    """Do two answers say the same?  Verdict and names; "missing" beside "ambiguous" is another."""
    return one.verdict == other.verdict and set(one.selected) == set(other.selected)


@dataclass(frozen=True)
class Each:
    """What each log, or tire, says alone, before anything is pooled."""

    by: str
    answers: tuple[GroupVerdict, ...]

    @property
    def adjusted(self) -> tuple[float | None, ...]:
        """p of each, adjusted over those of which there is one."""
        given = benjamini_hochberg([a.p for a in self.answers if a.p is not None]).tolist()
        left = iter(given)
        return tuple(None if a.p is None else next(left) for a in self.answers)

    @property
    def lacking(self) -> tuple[GroupVerdict, ...]:
        """Those of which something is missing, with p adjusted over all of them."""
        return tuple(
            a
            for a, q in zip(self.answers, self.adjusted, strict=True)
            if a.verdict in _LACKS and q is not None and q <= FALSE_DISCOVERIES
        )

    @property
    def inclusion(self) -> dict[str, float]:
        """Of each effect that is named somewhere the share of those asked that name it."""
        asked = [a for a in self.answers if a.tested]
        named = Counter(name for a in self.lacking for name in a.selected)
        return {name: n / len(asked) for name, n in named.most_common()}

    @property
    def sentence(self) -> str:
        """How many lack something, which effect how often, and whether they say the same."""
        asked = [a for a in self.answers if a.tested]
        lacking, count = self.lacking, len(asked)
        if not asked:
            return f"No {self.by} alone has manoeuvres enough for a test."
        chance = [a for a in asked if a.verdict in _LACKS and a not in lacking]
        by_name = Counter(name for a in lacking for name in a.selected)
        names = ", ".join(f"{name} in {n}" for name, n in by_name.most_common())
        said = (
            f"Each {self.by} alone: something is missing in {len(lacking)} of {count}"
            f"{f', {names}' if names else ''} (at most {100.0 * FALSE_DISCOVERIES:.0f} % of them "
            "by chance)"
        )
        if chance:
            said += (
                f"; {len(chance)} more {'alarms' if len(chance) == 1 else 'alarm'}, no more than "
                f"chance does among {count}"
            )
        if len({(a.verdict in _LACKS, frozenset(a.selected)) for a in asked}) > 1:
            said += f"; the {self.by}s do not say the same: what is pooled is their mean"
        return f"{said}."

    def to_json(self) -> dict[str, Any]:
        rows = [
            asdict(a) | {"p_adjusted": q, "lacking": a in self.lacking}
            for a, q in zip(self.answers, self.adjusted, strict=True)
        ]
        return plain_fields(
            {
                "by": self.by,
                "sentence": self.sentence,
                "inclusion": self.inclusion,
                "each": rows,
            }
        )


def benjamini_hochberg(p: Sequence[float]) -> FloatArray:
    """p adjusted so that those below q are false in a share of q at most, (n,)."""
    given = np.asarray(p, dtype=np.float64)
    order = np.argsort(given)[::-1]
    by_rank = given[order] * given.size / np.arange(given.size, 0, -1)
    adjusted = np.empty(given.size)
    adjusted[order] = np.minimum(np.minimum.accumulate(by_rank), 1.0)
    return adjusted
