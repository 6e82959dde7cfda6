"""Faults: tables' files that go too far, or say what they may not, are refused by line."""

import time

import pytest

from tirelog.data.setup import parse_setup
from tirelog.errors import SetupError, printable
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
