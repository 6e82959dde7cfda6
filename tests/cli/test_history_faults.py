"""Faults: a history of ladders that is damaged or missing is said, not overwritten."""

from pathlib import Path

import pytest

from tests.cli.conftest import Command

DAMAGED = ["", "{}", '{"ladders": [{"steps": [{"step": 0}]}]}', '{"ladders": 3}', "[1]"]
DEEP = [
    "[" * 100_000,
    '{"ladders": ' * 500,
    '{"ladders": [1' + "0" * 400 + "]}",
    "[" * 40 + "]" * 40,
]


@pytest.mark.parametrize("content", [*DAMAGED, *DEEP])
def test_a_damaged_history(model: Path, tirelog: Command, content: str) -> None:
    model.with_suffix(".ladder.json").write_text(content)
    outcome = tirelog("model", "show", model, "--history")
    assert outcome.status == 2
    assert "is no history of ladders" in outcome.err


def test_no_history_yet(model: Path, tirelog: Command) -> None:
    outcome = tirelog("model", "show", model, "--history")
    assert outcome.status == 2
    assert "no ladder was climbed" in outcome.err
