"""Faults: no command writes on what it was given to read."""

import warnings

import pytest

from tests.cli.conftest import commands
from tirelog.cli.app import command

#: what a command asks for beside its first input
ASKED = {
    "model": "--model m.toml", "against": "--against u.csv", "speed": "--speed 12",
    "new_depth": "--new-depth 0.008", "depth": "--depth 0.003",
    "picture": "more.csv", "pitch": "--pitch 0.005", "load": "--load 3000",
}  # fmt: skip
INPUTS = {
    "logs": "log.csv",
    "log": "log.csv",
    "table": "t.csv",
    "scenario": "s.h5",
    "model": "m.toml",
}


def onto_its_input(path, one):
    """The command line that would write on its own first input; '' if there is none."""
    first, *others = [p.name for p in one.params if p.required or p.name in INPUTS] or [""]
    if first not in INPUTS or "output" not in [p.name for p in one.params]:
        return ""
    more = " ".join(ASKED[name] for name in others if name in ASKED)
    return f"{path} {INPUTS[first]} {more} -o {INPUTS[first]}"


OWN = {path: onto_its_input(path, one) for path, one in commands(command()) if path != "tables"}
OWN["plot"] = ""  # whose output is a picture


@pytest.mark.parametrize("words", [words for words in OWN.values() if words])
def test_an_input_is_never_an_output(folder, tirelog, words):
    """Further ones, links and pairs of outputs: tests/golden/uses/options.toml."""
    (folder / "s.h5").write_bytes((folder / "log.csv").read_bytes())
    (folder / "m.toml").write_text("# a model\n")
    for table in ("t.csv", "u.csv"):
        (folder / table).write_text("log,channel,revolution,time_s,quality\na,b,0,1.0,ok\n")
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    tirelog(words).refused("no output takes the place of an input")
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


def test_two_outputs_may_both_go_nowhere(folder, tirelog):
    outcome = tirelog("phase-shift", "log.csv", "-o", "/dev/null", "--calibrate", "/dev/null")
    assert "two outputs" not in outcome.err


@pytest.mark.filterwarnings("default")  # the tests' own rule would make an error of it
def test_a_library_s_warning_is_no_message(folder, tirelog, monkeypatch):
    def warns(*_):
        warnings.warn("overflow encountered", RuntimeWarning, stacklevel=1)

    shown: list[object] = []
    monkeypatch.setattr("tirelog.cli.pages.print_summary", warns)
    monkeypatch.setattr(warnings, "showwarning", lambda *what, **_: shown.append(what))
    assert tirelog("info", "log.csv").status == 0
    assert shown == []
    assert tirelog("info", "log.csv", "--debug").status == 0
    assert len(shown) == 1
