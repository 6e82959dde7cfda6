"""What a rest may go with: everything that a cell is driven under, and which of it moves together.

Base -> factors by name, (C,) each: powers of the speed, conditions that vary, single logs
"""

from __future__ import annotations

import numpy as np

from tirelog.inference.base import Base
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.conditions import CONDITIONS

#: exponents of speed that are tested: each is one more candidate for chance
EXPONENTS = (0.0, 1.0, 2.0)
#: single logs that a remainder may follow: each is one more factor that may fit by chance; the
#: family-wise p counts them all, so that twice as many ask more of each
MOST_LOGS = 4
#: a quantity is named in place of a log from this share of its statistic on; half as much would
#: name a quantity that explains half of what the log does
_NAMED_FIRST = 0.95
#: two quantities that move together beyond this correlation are not told apart: a fifth of the one
#: in size is its own then; at 0.96 it would be 28 %
_TOGETHER = 0.98
#: a rest is looked at over powers of the speed, and over the size of what has a sign
SPEED = CONDITIONS["speed_m_s"].symbol
SIGNED = tuple(c.symbol for c in CONDITIONS.values() if c.signed)


def factors_of(base: Base) -> dict[str, FloatArray]:
    """What a cell is driven under, (C,) each, by name; what does not vary is left out."""
    c = base.cells.conditions
    result = {f"{SPEED}^{e:g}": (c.speed_m_s / 20.0) ** e for e in EXPONENTS}
    if base.fit.stuck:  # no parameter takes a level beside what follows speed
        result |= {name: x - x.mean() for name, x in result.items() if np.ptp(x) > 0.0}
    for name, condition in CONDITIONS.items():
        values = getattr(c, name)
        if condition.symbol == SPEED:
            continue  # by its powers, above
        if np.isfinite(values).all() and np.ptp(values) > 1e-3 * np.abs(values).max():
            result[condition.symbol] = (
                values - (0.0 if condition.signed else values.mean())
            ) / np.abs(values).max()
    logs = np.unique(base.cells.log)
    for number in logs[: MOST_LOGS if logs.size > 2 else logs.size - 1]:
        result[f"log {number}"] = (base.cells.log == number) - float(
            np.mean(base.cells.log == number)
        )
    return result


def best_factor(factors: dict[str, FloatArray], statistic: FloatArray) -> int:
    """The factor that explains most.

    A quantity is preferred to the log itself if it explains nearly as much.
    """
    best = int(np.argmax(statistic))
    names = list(factors)
    if names[best].startswith("log "):
        near = [
            i
            for i, name in enumerate(names)
            if not name.startswith("log ") and statistic[i] >= _NAMED_FIRST * statistic[best]
        ]
        best = max(near, key=lambda i: statistic[i]) if near else best
    return best


def gone_along(factors: dict[str, FloatArray], name: str) -> tuple[str, ...]:
    """Other quantities that went along with the factor `name` in these cells.

    It could be any of them.
    """
    mine = factors[name]
    if name.startswith(SPEED) or np.ptp(mine) == 0.0:
        return ()
    others = [
        n
        for n, x in factors.items()
        if n != name and not n.startswith((SPEED, "log ")) and np.ptp(x) > 0.0
    ]
    return tuple(n for n in others if abs(float(np.corrcoef(mine, factors[n])[0, 1])) > _TOGETHER)
