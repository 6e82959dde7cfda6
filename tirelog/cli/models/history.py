"""The ladders kept beside a model file (MODEL.ladder.json), to compare versions later."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tirelog.errors import ModelError
from tirelog.storage.documents import json_value

_STEP = (
    "step",
    "effect",
    "rmse_fit",
    "rmse_heldout",
    "noise_floor",
    "excess_heldout",
    "p_adjusted",
    "decision",
)


def history_file(model: Path) -> Path:
    """Where a model's ladders are kept."""
    return model.with_suffix(".ladder.json")


def read_history(model: Path) -> list[dict[str, Any]]:
    """The ladders climbed from a model, oldest first; none if there is no file.

    ModelError: the file is damaged.
    """
    path = history_file(model)
    try:
        ladders = json_value(path.read_text(encoding="utf-8"))["ladders"]
        if all(set(_STEP) <= set(step) for entry in ladders for step in entry["steps"]):
            return list(ladders)
    except FileNotFoundError:
        return []
    except (OSError, ValueError, KeyError, TypeError):
        pass
    raise ModelError(
        "is no history of ladders",
        allowed="it is the file that `tirelog ladder` keeps",
        do="move it away to begin another",
        file=path,
    )


def history_rows(model: Path) -> dict[str, list[Any]]:
    """A row per step of every ladder.  ModelError: none was climbed yet."""
    ladders = read_history(model)
    if not ladders:
        raise ModelError(
            "no ladder was climbed from it yet",
            do=f"`tirelog ladder LOG... --model {model}` climbs one",
            file=model,
        )
    rows = [(entry, step) for entry in ladders for step in entry["steps"]]
    about = {
        key: [str(entry.get(key, "")) for entry, _ in rows]
        for key in ("climbed", "observable", "verdict")
    }
    nothing = float("nan")
    return about | {
        key: [nothing if step[key] is None else step[key] for _, step in rows] for key in _STEP
    }


def history_page(rows: dict[str, list[Any]]) -> str:
    """The same to read: a line per step, errors in the observable's unit."""
    lines, last = [], ""
    for i, climbed in enumerate(rows["climbed"]):
        if climbed != last:
            lines.append(f"{climbed}  {rows['observable'][i]}  {rows['verdict'][i]}")
            last = climbed
        error, floor = rows["rmse_heldout"][i], rows["noise_floor"][i]
        held_out = "-" if error != error else f"{error:.4g}"
        lines.append(
            f"  {rows['step'][i]}  {rows['effect'][i]:20} held-out error {held_out}, floor "
            f"{floor:.4g}  {rows['decision'][i]}"
        )
    return "\n".join(lines)
