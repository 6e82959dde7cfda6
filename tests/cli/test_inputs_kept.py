"""Faults: no command writes on what it was given to read."""

import os
import warnings

import pytest

from tests.cli.conftest import commands
from tirelog.cli.app import command

#: command lines that would write on their log, setup, model or another input (names that are links
#: end in _link)
OVERWRITES = {
    "the log by another path": "speed log.csv -o made/../log.csv",
    "the log by a link": "footprint log.csv -o log_link --format csv",
    "the log by a hard link": "dissipation log.csv -o log_hard.csv",
    "the second log": "speed log.csv more.csv --setup log.toml -o more.csv",
    "a log in the tables' folder": "tables made/speed.csv --setup log.toml -o made",
    "the setup beside": "speed log.csv -o log.toml --format csv",
    "the setup given": "inflation more.csv --setup log.toml -o log.toml --format csv",
    "the log by a picture": "footprint log.png --setup log.toml --plot log.png",
    "the log by a calibration": "phase-shift log.csv --calibrate log.csv",
    "the scenario by the truth": "simulate s.csv.truth.json -o s.csv",
    "the log by a fit": "model fit log.csv --model m.toml -o log.csv",
    "the setup by a fit": "model fit log.csv --model m.toml -o log.toml",
    "a model that is a log too": "model fit log.csv --model log_link -o log.csv",
    "the model by the ladder": "ladder log.csv --model m.toml --save m.toml",
    "the model by a proposal": "propose log.csv --model m.toml -o m.toml",
    "the model by a document": "compare log.csv --model m.toml -o m.toml --format json",
    "the model by a diagnosis": "diagnose log.csv --model m.toml -o m.toml --format json",
    "the setup by a model": "model new --setup log.toml -o log.toml",
    "the setup by a page": "report log.csv -o log.toml",
    "the picture by a model": "model pressure m.toml more.csv --pitch 1 --load 1 -o more.csv",
}


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
OVERWRITES |= {path: words for path, words in OWN.items() if words}
OVERWRITES["plot"] = "plot log.png --setup log.toml -o log.png"  # whose output is a picture


@pytest.mark.parametrize("name", OVERWRITES)
def test_an_input_is_never_an_output(folder, tirelog, name):
    (folder / "made").mkdir()
    for other in ("more.csv", "log.png", "made/speed.csv", "s.csv.truth.json", "s.h5"):
        (folder / other).write_bytes((folder / "log.csv").read_bytes())
    (folder / "log_link").symlink_to("log.csv")
    os.link(folder / "log.csv", folder / "log_hard.csv")
    (folder / "m.toml").write_text("# a model\n")
    for table in ("t.csv", "u.csv"):
        (folder / table).write_text("log,channel,revolution,time_s,quality\na,b,0,1.0,ok\n")
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    tirelog(OVERWRITES[name]).refused("no output takes the place of an input")
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


TWO_OUTPUTS = {
    "a table and a picture": "footprint log.csv -o p.png --plot p.png",
    "by another path": "footprint log.csv -o made/../p.png --plot ./p.png",
    "by a link": "footprint log.csv -o p_link --plot p.png",
    "by a folder's link": "footprint log.csv -o made/p.png --plot same/p.png",
    "an answer and a picture": "compare log.csv --model m -o p.png --plot p.png",
    "a table and a model": "ladder log.csv --model m -o b.toml --save b.toml",
}


@pytest.mark.parametrize("name", TWO_OUTPUTS)
def test_two_outputs_are_never_one_file(folder, tirelog, name):
    (folder / "made").mkdir()
    (folder / "same").symlink_to("made")
    (folder / "p_link").symlink_to("p.png")
    (folder / "m").write_text("")
    before = sorted(folder.rglob("*"))
    tirelog(f"{TWO_OUTPUTS[name]} --format csv").refused("is given for two outputs")
    assert sorted(folder.rglob("*")) == before


def test_two_outputs_may_both_go_nowhere(folder, tirelog):
    outcome = tirelog("phase-shift", "log.csv", "-o", "/dev/null", "--calibrate", "/dev/null")
    assert "two outputs" not in outcome.err


def test_a_new_model_takes_no_setup_s_place(folder, tirelog):
    setup = (folder / "log.toml").read_text()
    tirelog("model", "new", "-o", "log.toml").refused("is no model file")
    assert (folder / "log.toml").read_text() == setup
    for _ in range(2):  # a model may be replaced
        assert tirelog("model", "new", "-o", "beam.toml").status == 0


def test_an_unreadable_log_leaves_the_older_table(folder, tirelog):
    assert tirelog("speed", "log.csv", "-o", "t.csv").status == 0
    assert tirelog("tables", "log.csv", "-o", "made", "--table", "speed").status == 0
    table = (folder / "t.csv").read_bytes()
    (folder / "log.csv").write_bytes(b"\x00\x01nothing of ours" * 40)
    for arguments in (
        ["speed", "log.csv", "-o", "t.csv"],
        ["tables", "log.csv", "-o", "made", "--table", "speed"],
    ):
        outcome = tirelog(*arguments).ended(4)
        assert outcome.out == ""
    assert (folder / "t.csv").read_bytes() == table == (folder / "made" / "speed.csv").read_bytes()
    assert tirelog("speed", "log.csv", "-o", "new.csv").status == 4
    assert not (folder / "new.csv").exists()


def test_a_log_that_cannot_be_read_does_not_stop_the_others(folder, tirelog):
    (folder / "bad.csv").write_bytes(b"")
    outcome = tirelog("speed nope.csv bad.csv log.csv --setup log.toml").ended(
        3, "error: nope.csv: cannot be read (No such file or directory)", "error: bad.csv: is empty"
    )
    assert outcome.out.splitlines()[1].startswith("log.csv,strain_1,0,")


def test_credentials_are_in_no_message(folder, tirelog):
    outcome = tirelog(
        "speed 'nosuch://me:s3cr3t@host/a.csv?X-Amz-Signature=s3cr3t' --setup log.toml"
    )
    assert outcome.status == 2
    assert "nosuch://...: is an address" in outcome.err
    assert "s3cr3t" not in outcome.err + outcome.out


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
