"""Faults: a history of ladders that is damaged or missing is said, not overwritten."""

import pytest

DAMAGED = ["", "{}", '{"ladders": [{"steps": [{"step": 0}]}]}', '{"ladders": 3}', "[1]"]
DEEP = [
    "[" * 100_000,
    '{"ladders": ' * 500,
    '{"ladders": [1' + "0" * 400 + "]}",
    "[" * 40 + "]" * 40,
]


@pytest.mark.parametrize("content", [*DAMAGED, *DEEP])
def test_a_damaged_history(model, tirelog, content):
    model.with_suffix(".ladder.json").write_text(content)
    tirelog("model", "show", model, "--history").refused("is no history of ladders")


def test_no_history_yet(model, tirelog):
    tirelog("model", "show", model, "--history").refused("no ladder was climbed")
