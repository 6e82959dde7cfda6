"""Faults: tables' files that go too far, or say what they may not, are refused by line."""

import time

import pytest

from tirelog.data.setup import load_setup, parse_setup
from tirelog.errors import ModelError, SetupError, TirelogError, UsageError, printable
from tirelog.physics.model.file import load_model as read
from tirelog.simulation.scenario.schema import load_scenario
from tirelog.storage.schema import (
    Document,
)
from tirelog.storage.whole import DEEPEST, json_value, toml_tables
from tirelog.wheel.calibration import read_calibration

FILES = {
    "setup": load_setup,
    "calibration": read_calibration,
    "scenario": load_scenario,
    "model": read,
}
HOSTILE = {
    "lists 500 deep": "a = " + "[" * 500 + "]" * 500,
    "lists 5,000 deep": "a = " + "[" * 5000 + "]" * 5000,
    "tables 500 deep": "[" + ".".join("a" * 500) + "]\nb = 1",
    "a key of 300,000 parts": ".".join("a" * 300_000) + " = 1",
    "a key of 100,000 parts in quotes": 'c = {"a b"' + ". 'a b'" * 100_000 + " = 1}",
    "tables in tables": "a = " + "{b = " * 100 + "1" + "}" * 100,
    "an integer of 400 digits": "[tire]\nunloaded_radius_m = 1" + "0" * 400,
    "an integer of 5,000 digits": "[tire]\nunloaded_radius_m = 1" + "0" * 5000,
    "a hexadecimal integer of 5,000 digits": "[parameters]\nload_N = 0x1" + "0" * 5000,
    "a list of such integers": "[phase_shift]\ncovariance = [[1" + "0" * 400 + "]]",
    "not TOML": "a = = 1",
    "two megabytes": "#" * (2 << 20),
    "a value where a table is expected": "tire = 1\nconditions = 1\nchannels = []\n"
    "model = 3\nparameters = 4\nphase_shift = 5",
    "a value where a list is expected": "effects = 1\nmanoeuvres = [{}]\n"
    'channels = {a = {kind = "strain"}}',
    "a table where a word is expected": "[model]\ncarcass = {a = 1}\nobservable = [1]\n"
    "[channels.a]\nkind = []\nsource = {}",
}


@pytest.mark.parametrize("what", HOSTILE)
@pytest.mark.parametrize("kind", FILES)
def test_every_file_of_tables_is_refused_with_its_name(tmp_path, kind, what):
    path = tmp_path / "x.toml"
    path.write_text(HOSTILE[what])
    with pytest.raises((SetupError, UsageError, ModelError)) as caught:
        FILES[kind](path)
    assert str(caught.value).startswith(str(path))
    assert caught.value.exit_status == 2
    assert caught.value.message.count(";") >= 1
    assert len(str(caught.value)) < 2000
    assert caught.value.line == 1 or what != "not TOML"


def test_a_file_of_tables_that_is_no_file(tmp_path):
    for load in FILES.values():
        with pytest.raises(TirelogError, match="cannot be read"):
            load(tmp_path)


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
