"""The ladders kept beside a model file (MODEL.ladder.json), to compare versions later."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tirelog.errors import ModelError, UsageError
from tirelog.storage.whole import json_of, open_input, whole_file

if TYPE_CHECKING:
    from tirelog.diagnosis.results import Ladder


#: what every step of a kept ladder has, as `json_of` takes it
_STEP: dict[str, Any] = {
    "step": int,
    "effect": str,
    "rmse_fit": float,
    "rmse_heldout": float | None,
    "noise_floor": float,
    "excess_heldout": float | None,
    "p_adjusted": float | None,
    "decision": str,
    "outcome?": str,
}
_LADDER: dict[str, Any] = {
    "steps": [_STEP],
    "observable?": str,
    "unit?": str,
    "verdict?": str,
    "climbed?": str,
    "logs?": [str],
    "remarks?": [str],
    "manoeuvres?": int,
    "manoeuvres_locked?": int,
    "rmse_untouched?": float | None,
    "floor_untouched?": float | None,
}
_PARAMETER = {"value": float, "se": float | None, "unit": str}
#: a ladder of which the page can be made
_WHOLE = _LADDER | {
    "observable": str,
    "unit": str,
    "steps": [_STEP | {"sentence": str, "parameters": {str: _PARAMETER}}],
}


def outcome_of(decision: str) -> str:
    """The outcome of a step by its decision, for files that have no outcome."""
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
        ladders = json_of(path.read_text(encoding="utf-8"), {"ladders": [_LADDER]})["ladders"]
        return [_with_outcomes(entry) for entry in ladders]
    except FileNotFoundError:
        return []
    except (OSError, ValueError) as problem:
        why = str(problem)
    raise ModelError(
        f"is no history of ladders ({why})",
        allowed="it is the file that `tirelog ladder` keeps",
        do="move it away to begin another",
        file=path,
    )


def _with_outcomes(ladder: dict[str, Any]) -> dict[str, Any]:
    for step in ladder["steps"]:
        step.setdefault("outcome", outcome_of(step["decision"]))
    return ladder


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
        with open_input(path) as stream:
            text = stream.read()
        several = json_of(text, {"ladders?": [_WHOLE]}).get("ladders")
        climbed = several[-1] if several else json_of(text, _WHOLE)
        if not climbed["steps"]:
            raise ValueError("it has no steps")
    except (OSError, ValueError) as problem:
        raise UsageError(
            f"is no ladder ({problem})",
            allowed="`tirelog ladder LOG --model M` keeps one beside the model, as M.ladder.json",
            do="give that",
            file=path,
        ) from None
    return _with_outcomes(climbed)
