"""What a prediction works on.

One block of revolutions, the numbers, the effects that are on, and what was computed before.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Concatenate, ParamSpec, TypeVar, cast

from tirelog.physics.effects.base import Drive, Effect, Values

More = ParamSpec("More")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Active:
    """An effect that is on, with its own values."""

    effect: Effect
    values: Values


@dataclass(frozen=True)
class Task:
    """What to compute: the carcass and its numbers, the effects that are on (by id), the
    conditions, the observable.
    """

    carcass: str
    flat_road: bool
    base: Mapping[str, float]
    active: Sequence[Active]
    drive: Drive
    memo: dict[Any, Any] = field(default_factory=dict)

    def having(self, *hooks: str) -> list[Active]:
        """The effects that enter by one of these hooks."""
        return [
            a for a in self.active if any(getattr(a.effect, hook) is not None for hook in hooks)
        ]

    def hooks(
        self, hook: Callable[[Effect], Callable[Concatenate[Values, Drive, More], Result] | None]
    ) -> dict[str, Callable[More, Result]]:
        """One hook of the effects that have it, by their ids, given their values and conditions.

        `hook` names it by what it takes from an effect, as in `task.hooks(lambda e: e.gain)`: so
        its type is checked where it is called. What remains to be given is the site and what
        follows it.
        """
        return {
            a.effect.id: partial(found, a.values, self.drive)
            for a in self.active
            if (found := hook(a.effect)) is not None
        }

    def key(self, names: Sequence[str] | None, *hooks: str) -> tuple[Any, ...]:
        """What a stage reads: the named base values (all for None) and the values of the effects
        with these hooks.
        """
        base = (
            tuple(self.base.items())
            if names is None
            else tuple(self.base.get(name) for name in names)
        )
        return base, tuple((a.effect.id, *a.values.values()) for a in self.having(*hooks))

    def once(self, stage: str, key: tuple[Any, ...], compute: Callable[[], Result]) -> Result:
        """The stage's result, from the memo where the same values were read before."""
        if (stage, key) not in self.memo:
            self.memo[stage, key] = compute()
        return cast(Result, self.memo[stage, key])
