"""Faults: a file that is given as another kind of file is called by its name, with what to type."""

import re

import pytest

from tests.cli.test_printed_commands import SCENARIO

#: (command, the file and what it is, what is needed, what to do with it)
CASES = (
    ("compare log.csv --model log.toml", "log.toml: is a setup; a model", "model new --setup"),
    ("compare log.toml --model m.toml", "log.toml: is a setup; a log", "--setup"),
    ("compare m.toml --model m.toml", "m.toml: is a model; a log", "--model"),
    ("speed m.toml", "m.toml: is a model; a log", "--model"),
    ("speed log.toml", "log.toml: is a setup; a log", "--setup"),
    ("info m.toml", "m.toml: is a model; a log", "--model"),
    ("setup new log.toml", "log.toml: is a setup; a log", "--setup"),
    ("speed log.csv --setup m.toml", "m.toml: is a model; a setup", "--model"),
    ("speed log.csv --setup s.toml", "s.toml: is a scenario; a setup", "simulate s.toml"),
    ("model show log.toml", "log.toml: is a setup; a model", "model new --setup log.toml"),
    ("simulate log.toml -o made.csv", "log.toml: is a setup; a scenario", "--setup"),
    ("campaign run m.toml", "m.toml: is a model; a manifest", "--model"),
    ("compare log.csv --model c.toml", "c.toml: is a manifest; a model", "campaign run c.toml"),
)


@pytest.mark.parametrize(("words", "role", "use"), CASES, ids=[case[0] for case in CASES])
def test_a_file_in_the_wrong_role_is_named(folder, tirelog, words, role, use):
    (folder / "s.toml").write_text(SCENARIO)
    (folder / "c.toml").write_text('[campaign]\noutput = "o"\n[[logs]]\nglob = "*.csv"\n')
    assert tirelog("model", "new", "--setup", "log.toml", "-o", "m.toml").status == 0
    outcome = tirelog(*words.split())
    outcome.refused(f"{role} is needed here", use)
    assert len(outcome.err.split("error:")) == 2


def test_who_has_no_model_is_told_what_makes_one(folder, tirelog):
    outcome = tirelog("compare", "log.csv").ended(2)
    found = re.search(r"`tirelog (model new [^`]*)` makes a model", outcome.err)
    assert found
    words = found[1].replace("SETUP.toml", "log.toml").split()
    assert tirelog(*words).status == 0


def test_a_setup_without_a_radius_is_named_by_its_file(folder, tirelog):
    setup = (folder / "log.toml").read_text()
    lines = [line for line in setup.splitlines() if "radius" not in line]
    (folder / "log.toml").write_text("\n".join(lines))
    tirelog("speed", "log.csv").refused("log.toml: the setup has no radius")
    assert "file" not in tirelog("info", "log.csv").out.split("setup:")[-1]


def test_passages_are_counted_as_they_are(folder, tirelog):
    assert tirelog("model", "new", "--setup", "log.toml", "-o", "m.toml").status == 0
    rows = (folder / "log.csv").read_text().splitlines()
    (folder / "log.csv").write_text("\n".join(rows[:1200]) + "\n")
    outcome = tirelog("compare", "log.csv", "--model", "m.toml").ended(
        2, "3 passages in channel strain_1; at least 8 in a row are needed"
    )
    assert "0 whole" not in outcome.err
