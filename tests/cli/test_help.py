"""Property: every command's help has examples that it takes, and words for its values."""

from pathlib import Path

import pytest
import typer

from tests.cli.conftest import commands
from tirelog.cli.app import EXAMPLES, GROUPS, RARE, command

SAMPLES = Path(__file__).parents[2] / "sample_data"


ALL = dict(commands(command()))


def told(one, path):
    """The help of a command."""
    with one.make_context(path, [], resilient_parsing=True) as context:
        return one.get_help(context)


@pytest.mark.parametrize("name", sorted(command().commands))
def test_a_command_alone_is_what_it_is_among_all(name):
    alone = command(name)
    assert list(alone.commands) == [name]
    for path, one in commands(alone):
        assert told(one, path) == told(ALL[path], path)
        assert [p.name for p in one.params] == [p.name for p in ALL[path].params]


@pytest.mark.parametrize("asked", ["", "tabels", "--help"])
def test_what_is_no_command_is_looked_for_among_all(asked):
    assert list(command(asked).commands) == list(command().commands)


def test_an_error_of_options_points_to_the_help_of_its_command(tirelog):
    """Whatever option of whatever command has no value, or is unknown."""
    for path, one in ALL.items():
        options = {p.opts[0] for p in one.params if p.param_type_name == "option" and not p.is_flag}
        for option in ("--bogus", *sorted(options)):
            done = tirelog(*path.split(), "x", option).ended(2)
            assert f"; see tirelog {path} --help" in done.err, done.err


def help_of(tirelog, *path):
    return tirelog(*path, "-h").out


def test_every_command_stands_once_under_a_heading():
    listed = [name for names in GROUPS.values() for name in names]
    rare = [path for path in RARE if " " not in path]
    assert sorted((*listed, *rare)) == sorted(command().commands)
    assert sorted(EXAMPLES) == sorted(ALL)


def test_rare_commands_are_callable_and_not_listed(tirelog):
    lists = help_of(tirelog) + help_of(tirelog, "model")
    for path in RARE:
        assert f"\n  {path.split()[-1]} " not in lists
        assert help_of(tirelog, *path.split()).startswith(f"Usage: tirelog {path} [OPTIONS]")
    assert "slip, grip, strain-shift" in " ".join(help_of(tirelog, "tables").split())


def test_usage_has_no_braces(tirelog):
    for path in ALL:
        usage = help_of(tirelog, *path.split()).split("\n\n")[0]
        assert "{" not in usage, usage
    assert help_of(tirelog, "footprint").startswith("Usage: tirelog footprint [OPTIONS] LOG...\n")


def test_help_names_values_and_shows_examples(tirelog):
    for path, one in ALL.items():
        for parameter in one.params:
            assert getattr(parameter, "is_flag", False) or parameter.metavar, (path, parameter.name)
    shown = help_of(tirelog, "speed")
    assert "--setup SETUP" in shown
    assert "<" not in shown
    assert "tirelog speed drive.csv.gz -o speed.csv" in shown


def test_the_list_of_commands_is_whole_and_in_groups(tirelog):
    shown = help_of(tirelog)
    assert [line[:-1] for line in shown.splitlines() if line[:-1] in GROUPS] == list(GROUPS)
    assert "..." not in shown.split("Logs:")[1]


def test_commands_share_their_options():
    """What one calls --quiet, -o or --setup no other calls otherwise; --quiet have all."""
    said = {}
    for path, one in ALL.items():
        options = {p.name: p for p in one.params if p.param_type_name == "option"}
        assert "--quiet" in options["quiet"].opts, path
        assert ("format" in options) <= ("output" in options), path
        for name, option in options.items():
            said.setdefault(name, set()).add(tuple(sorted(option.opts)))
            if name in ("setup", "quiet", "plot", "effects"):
                said.setdefault(f"{name} says", set()).add(option.help)
    assert {name: flags for name, flags in said.items() if len(flags) > 1} == {}


def completed(path, name, beginning):
    parameter = next(one for one in ALL[path].params if one.name == name)
    items = parameter.shell_complete(typer.Context(ALL[path]), beginning)
    return [item.value for item in items]


def test_values_are_completed():
    assert completed("speed", "format", "c") == ["csv"]
    assert "water_film" in completed("effects", "name", "water")
    assert completed("model new", "preset", "P3") == ["P3"]
    assert completed("tables", "table", "sp") == ["speed"]
    assert completed("plot", "kind", "po") == ["polar"]
