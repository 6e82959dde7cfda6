"""The ladders kept beside a model file (MODEL.ladder.json), to compare versions later."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tirelog.errors import ModelError, UsageError
from tirelog.storage.documents import json_value
from tirelog.storage.whole import whole_file

if TYPE_CHECKING:
    from tirelog.diagnosis.results import Ladder

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


def _outcome(decision: str) -> str:
    """The outcome of a step that was kept when its decision alone said it."""
    first = ("start", "removed", "added")
    return next((word for word in first if decision.startswith(word)), "not_added")


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
            for step in (step for entry in ladders for step in entry["steps"]):
                step.setdefault("outcome", _outcome(str(step["decision"])))
            return list(ladders)
    except FileNotFoundError:
        return []
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
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


def remember(ladder: Ladder, model: Path) -> None:
    """The ladder, appended to those kept beside the model's file.  ModelError as `read_history`."""
    past = read_history(model)
    entry = {"climbed": datetime.now(UTC).isoformat(timespec="seconds")} | ladder.to_json()
    with whole_file(history_file(model)) as part:
        part.write_text(json.dumps({"ladders": [*past, entry]}, indent=1) + "\n", encoding="utf-8")


def read_ladder(path: Path) -> dict[str, Any]:
    """The last ladder of the file that `ladder` keeps beside the model, or a ladder's own JSON.

    UsageError: neither.
    """
    try:
        found = json_value(path.read_text(encoding="utf-8"))
        climbed = found["ladders"][-1] if "ladders" in found else found
        needed = {*_STEP, "sentence", "parameters"}
        whole = bool(climbed["steps"]) and all(needed <= set(step) for step in climbed["steps"])
        if whole and isinstance(climbed["observable"], str) and isinstance(climbed["unit"], str):
            return dict(climbed)
    except (OSError, ValueError, KeyError, IndexError, TypeError):
        pass
    raise UsageError(
        "is no ladder",
        allowed="`tirelog ladder LOG --model M` keeps one beside the model, as M.ladder.json",
        do="give that",
        file=path,
    )
