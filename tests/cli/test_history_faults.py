"""Faults: a history of ladders that is damaged is refused, not overwritten."""

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
    outcome = tirelog("ladder", "log.csv", "--model", model, "--quiet")
    assert outcome.status == 2
    assert "is no history of ladders" in outcome.err
    assert model.with_suffix(".ladder.json").read_text() == content
