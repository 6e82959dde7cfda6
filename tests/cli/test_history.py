"""Property and faults: the ladders kept beside a model are shown as they were, and a damaged
history is said, not overwritten.
"""

import csv
import io
import json
from pathlib import Path

import pytest

from .conftest import Command

STEP = {
    "rmse_fit": 2e-6,
    "rmse_heldout": 2.1e-6,
    "noise_floor": 2e-6,
    "excess_heldout": 6e-7,
    "p_adjusted": None,
    "decision": "start",
}
LADDER = {"climbed": "2026-01-02T03:04:05+00:00", "observable": "strain", "verdict": "at_the_floor"}


@pytest.fixture
def model(folder: Path, tirelog: Command) -> Path:
    assert (
        tirelog(
            "model", "new", "--carcass", "beam", "--setup", "log.toml", "-o", "beam.toml"
        ).status
        == 0
    )
    return folder / "beam.toml"


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
    rows = list(
        csv.DictReader(
            io.StringIO(tirelog("model", "show", model, "--history", "--format", "csv").out)
        )
    )
    assert [(r["climbed"][:7], r["step"], r["effect"], r["p_adjusted"]) for r in rows] == [
        ("2026-01", "0", "base", ""), ("2026-01", "1", "wear", "0.001"),
        ("2026-02", "0", "base", ""),
    ]  # fmt: skip
    assert "wear" in tirelog("model", "show", model, "--history").out


@pytest.mark.parametrize(
    "content", ["", "{}", '{"ladders": [{"steps": [{"step": 0}]}]}', '{"ladders": 3}', "[1]"]
)
def test_a_damaged_history(model: Path, tirelog: Command, content: str) -> None:
    model.with_suffix(".ladder.json").write_text(content)
    outcome = tirelog("model", "show", model, "--history")
    assert outcome.status == 2
    assert "is no history of ladders" in outcome.err


def test_no_history_yet(model: Path, tirelog: Command) -> None:
    outcome = tirelog("model", "show", model, "--history")
    assert outcome.status == 2
    assert "no ladder was climbed" in outcome.err
