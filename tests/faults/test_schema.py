"""Faults: what a file of tables may not say is refused with its line, whatever the file's kind."""

import time

import pytest

from tirelog.errors import SetupError
from tirelog.storage.schema import (
    FLAG,
    LINE,
    Document,
    Entries,
    Named,
    Table,
    number,
    numbers,
    words,
)

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


FILE = Table(
    {
        "seed": number(0, 5, whole=True),
        "radius": number(0.0, 2.0, above=True),
        "stops": numbers(0.0, most=2),
        "name": LINE,
        "driven": FLAG,
        "sign": words(".", ","),
        "logs": Entries(Table({"glob": LINE}, needed=("glob",))),
        "channels": Named(Table({"kind": words("strain", "load")})),
    }
)
WRONG = {
    "seed = 1.5": "s:1: seed = 1.5; allowed is a whole number from 0 to 5; mend it",
    "seed = true": "s:1: seed = True; allowed is a whole number from 0 to 5; mend it",
    "radius = 0.0": "s:1: radius = 0.0; allowed is a number above 0 to 2; mend it",
    "radius = nan": "s:1: radius = nan; allowed is a number above 0 to 2; mend it",
    "stops = [1, 2, 3]": "s:1: stops = [1, 2, 3]; allowed is a list of at most 2 numbers from 0; "
    "mend it",
    "stops = [true]": "s:1: stops = [True]; allowed is a list of at most 2 numbers from 0; mend it",
    'name = " "': "s:1: name = ' '; allowed is text of one line in quotes; mend it",
    "driven = 1": "s:1: driven = 1; allowed is true or false; mend it",
    "sign = 3": "s:1: sign = 3; allowed are '.', ','; choose one",
    "sed = 1": "s:1: unknown key 'sed' in a file (nearest: seed); allowed are seed, radius, stops, "
    "name, driven, sign, logs, channels; correct or remove it",
    "logs = 1": "s:1: logs is not a list of tables; allowed are entries that begin with [[logs]]; "
    "mend it",
    "\n[[logs]]": "s:2: [[logs]] number 1 has no glob; allowed is text of one line in quotes; "
    "add it",
    '[[logs]]\nglob = "a"\n[[logs]]\nglob = 3': "s:4: glob = 3 in [[logs]] number 2; allowed is "
    "text of one line in quotes; mend it",
    "channels = 1": "s:1: [channels] is not a table; allowed is a table with names of your own "
    "under it; mend it",
    "[channels]\na = 1": "s:2: [channels.a] is not a table; allowed are kind under it; mend it",
    '[channels.a]\nkind = "strian"': "s:2: kind = 'strian' in [channels.a] (nearest: strain); "
    "allowed are strain, load; choose one",
}


@pytest.mark.parametrize(("text", "said"), WRONG.items())
def test_a_value_that_is_not_allowed(text, said):
    with pytest.raises(SetupError) as refused:
        Document(text, SetupError, "a file", "s").read(FILE)
    assert str(refused.value) == said


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
        Document(line, SetupError, "a file", "s").read(FILE)
    assert len(str(refused.value)) < 500
    assert time.process_time() - began < 5.0
