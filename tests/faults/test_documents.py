"""Faults: tables' files that go too far, or say what they may not, are refused by line."""

import time

import pytest

from tirelog.data.setup import parse_setup
from tirelog.errors import SetupError, printable
from tirelog.storage.schema import (
    Document,
)
from tirelog.storage.whole import DEEPEST, json_value, toml_tables


def test_what_is_as_deep_as_allowed_is_read():
    assert json_value("[" * DEEPEST + "]" * DEEPEST)
    with pytest.raises(ValueError, match="nested"):
        json_value("[" * (DEEPEST + 1) + "]" * (DEEPEST + 1))
    assert toml_tables(f"a = {2**63 - 1}\nb = {-(2**63)}", SetupError, file="s.toml") == {
        "a": 2**63 - 1,
        "b": -(2**63),
    }


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("/tire:µm ε ²", "/tire:µm ε ²"),
        ("a\nb\r\tc", r"a\nb\r\tc"),
        ("\x1b]0;title\x07\x9b31m", r"\x1b]0;title\x07\x9b31m"),
        ("\u202egnp.\u2066", r"\u202egnp.\u2066"),
        ("a\u2028b\udcff", r"a\u2028b\xff"),
    ],
)
def test_a_message_is_one_line_that_a_terminal_does_not_obey(text, shown):
    assert printable(text) == shown
    assert str(SetupError(f"no column {text}", file="a.csv")) == f"a.csv: no column {shown}"


TEXT = """seed = 1
"quoted name" = 2
[tire]
width.height = 3 # width.depth = 4
inner = { radius = 5 }
[[logs]]
glob = "a"
[logs.tags]
driver = "b"
[[logs]]
glob = "c"
[ channels . "front left" ]
kind = "strain"
"""
LINES = {
    ("seed",): 1,
    ("quoted name",): 2,
    ("tire",): 3,
    ("tire", "width"): 4,
    ("tire", "width", "height"): 4,
    ("tire", "inner", "radius"): 5,
    ("tire", "absent"): 3,
    ("logs",): 6,
    ("logs", 0, "glob"): 7,
    ("logs", 0, "tags", "driver"): 9,
    ("logs", 1): 10,
    ("logs", 1, "glob"): 11,
    ("logs", 1, "absent"): 10,
    ("channels", "front left", "kind"): 13,
    ("absent",): None,
}


@pytest.mark.parametrize(("path", "line"), LINES.items())
def test_the_line_of_a_key_or_of_the_table_around_it(path, line):
    assert Document(TEXT, SetupError, "a file").line(path) == line


@pytest.mark.parametrize(
    "line",
    [
        f"name = ['{'x' * 900_000}']",
        f"{'k' * 900_000} = 1",
        f"text = '''\n[a{' ' * 900_000}x'''",
        f"seed = [{'1, ' * 300_000}]",
        f"name = '''\n{'[[a]] ' * 150_000}\n'''",
    ],
)
def test_a_hostile_line_costs_no_time_and_no_long_message(line):
    began = time.process_time()
    with pytest.raises(SetupError) as refused:
        parse_setup(line)
    assert len(str(refused.value)) < 500
    assert time.process_time() - began < 5.0
