"""Property: the ladders kept beside a model are shown as they were."""

import json
from pathlib import Path

from tests.cli.conftest import Command

STEP = {
    "rmse_fit": 2e-6,
    "rmse_heldout": 2.1e-6,
    "noise_floor": 2e-6,
    "excess_heldout": 6e-7,
    "p_adjusted": None,
    "decision": "start",
}

LADDER = {"climbed": "2026-01-02T03:04:05+00:00", "observable": "strain", "verdict": "at_the_floor"}


def test_every_step_of_every_ladder(model: Path, tirelog: Command) -> None:
    first = LADDER | {
        "steps": [
            STEP | {"step": 0, "effect": "base"},
            STEP | {"step": 1, "effect": "wear", "p_adjusted": 0.001, "decision": "added"},
        ]
    }
    again = LADDER | {
        "climbed": "2026-02-02T03:04:05+00:00",
        "steps": [STEP | {"step": 0, "effect": "base"}],
    }
    model.with_suffix(".ladder.json").write_text(json.dumps({"ladders": [first, again]}))
    rows = json.loads(tirelog("model", "show", model, "--history", "--format", "json").out)
    assert [(r["climbed"][:7], r["step"], r["effect"], r["p_adjusted"]) for r in rows] == [
        ("2026-01", 0, "base", None), ("2026-01", 1, "wear", 0.001), ("2026-02", 0, "base", None),
    ]  # fmt: skip
    assert "wear" in tirelog("model", "show", model, "--history").out
