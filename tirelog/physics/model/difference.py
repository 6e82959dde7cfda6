"""A model's parameters as columns, and two models side by side."""

from __future__ import annotations

from typing import Any

from tirelog.physics.model.model import Model


def parameter_rows(model: Model) -> dict[str, list[Any]]:
    """Columns of the table of parameters."""
    named = model.parameters.items()
    return {
        "parameter": [name for name, _ in named],
        "value": [p.value for _, p in named],
        "se": [float("nan") if p.se is None else p.se for _, p in named],
        "unit": [p.unit for _, p in named],
        "min": [p.min for _, p in named],
        "max": [p.max for _, p in named],
        "free": [p.free for _, p in named],
    }


def difference_rows(one: Model, other: Model) -> dict[str, list[Any]]:
    """Parameters of two models side by side; `difference_sigma` if either has a standard error."""
    names = [*one.parameters, *(n for n in other.parameters if n not in one.parameters)]
    rows: dict[str, list[Any]] = {
        "parameter": names,
        "value": [],
        "against": [],
        "difference_sigma": [],
    }
    for name in names:
        a, b = one.parameters.get(name), other.parameters.get(name)
        error = sum((p.se or 0.0) ** 2 for p in (a, b) if p is not None) ** 0.5
        rows["value"].append(a.value if a else float("nan"))
        rows["against"].append(b.value if b else float("nan"))
        rows["difference_sigma"].append(
            (a.value - b.value) / error if a and b and error > 0 else float("nan")
        )
    return rows
