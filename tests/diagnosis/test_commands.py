"""Property: compare, diagnose and ladder from the command line, on a log with a hidden effect."""

import csv
import errno
import io

import pytest

from benchmarks.cases import Case, case
from tests.diagnosis.toy import done
from tirelog.cli import run
from tirelog.inference.stacks import cut as stacks
from tirelog.simulation import simulate, write_log

pytestmark = pytest.mark.xdist_group("hidden logs")  # one worker makes what these tests share


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs")
    scenarios = case(("water_film",), seed=301, how=Case(plan="short", logs=2, duration=0.6))
    for i, scenario in enumerate(scenarios):
        write_log(simulate(scenario), path / f"log_{i}.csv")
    # a fit without a form takes a fifth of the time; one with it is a golden
    done("model", "new", "--setup", path / "log_0.toml", "-o", path / "beam.toml")
    done("model", "set", path / "beam.toml", "form=off", "-o", path / "beam.toml")
    new = ("model", "new", "--observable", "patch_length", "--setup", path / "log_0.toml")
    done(*new, "-o", path / "length.toml")
    return path


def command(folder, name, *more):
    logs = [str(folder / "log_0.csv"), str(folder / "log_1.csv")]
    return run([name, *logs, "--model", str(folder / "beam.toml"), "--quiet", *more])


def rows(capfd):
    return list(csv.DictReader(io.StringIO(capfd.readouterr().out)))


def test_tables_and_picture_of_compare(folder, capfd):
    assert command(folder, "compare", "--by", "regime", "--plot", str(folder / "c.png")) == 0
    assert {row["regime"] for row in rows(capfd)} <= {"cruise", "drive", "coast", "brake"}
    assert (folder / "c.png").stat().st_size > 10_000
    assert command(folder, "compare", "--by", "angle") == 0
    assert {row["angle"] for row in rows(capfd)} == {"entry", "patch", "exit", "away"}
    assert command(folder, "compare", "--by", "regimes") == 2
    assert "nearest: regime" in capfd.readouterr().err


def test_a_ladder_adds_the_hidden_effect_and_saves_the_model_with_it(folder, capfd):
    files = ("--plot", str(folder / "ladder.png"), "--save", str(folder / "top.toml"))
    assert command(folder, "ladder", *files) == 0
    steps = rows(capfd)
    assert [step["effect"] for step in steps[:2]] == ["base", "water_film"]
    assert float(steps[1]["excess_heldout"]) < 0.5 * float(steps[0]["excess_heldout"])
    assert "water_film" in (folder / "top.toml").read_text()


def length(folder, name, *more):
    """The status of a command on the patch lengths of one log."""
    model = str(folder / "length.toml")
    return run([name, str(folder / "log_0.csv"), "--model", model, "--quiet", *more])


def test_a_page_of_lengths_has_a_verdict_and_a_next_command(folder, capfd):
    assert length(folder, "diagnose") == 0
    page = capfd.readouterr().out
    assert page.startswith(("NOTHING MISSING", "TOO FEW", "UNKNOWN", "SCATTER", "MISSING"))
    assert "How often such a verdict is right is not known: " in page
    assert "next: tirelog" in page


def test_a_full_disk_is_said_in_one_line(folder, capfd, monkeypatch):
    def full(**more):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(stacks, "IN_MEMORY", 0)
    monkeypatch.setattr(stacks.tempfile, "TemporaryFile", full)
    assert command(folder, "compare", "--format", "json") == 2
    said = capfd.readouterr().err
    assert said.startswith("tirelog: error: ")
    assert "cannot be put aside (No space left on device)" in said
    assert "set TMPDIR to another folder" in said
    assert said.count("\n") == 1
