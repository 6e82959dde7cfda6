"""Property: a log counts once, whatever its name and packing; shared parts are said."""

import gzip
from itertools import islice
from pathlib import Path

import pytest

from tests.cli.conftest import tirelog

pytestmark = pytest.mark.xdist_group("logs once")  # one worker makes what these tests share

__all__ = ["tirelog"]

SAMPLES = Path(__file__).parents[2] / "sample_data"
#: lines of a sample log that hold some 80 revolutions
_LINES = 25_000


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """A folder with the begin of a log, its copies, half of it and another one; a model of them."""
    folder = tmp_path_factory.mktemp("once")
    setup = (SAMPLES / "hidden_1.toml").read_text()
    first, second = [], []
    for lines, name in ((first, "hidden_1"), (second, "hidden_2")):
        with gzip.open(SAMPLES / f"{name}.csv.gz", "rt") as stream:
            lines += islice(stream, _LINES)
    # half from the middle on, below the two lines of preamble and header
    half = first[:3] + first[3:][_LINES // 2 :]
    for name, lines in (("a", first), ("copy", first), ("half", half), ("other", second)):
        (folder / f"{name}.csv").write_text("".join(lines))
        (folder / f"{name}.toml").write_text(setup)
    packed = gzip.compress((folder / "a.csv").read_bytes(), compresslevel=1)
    (folder / "packed.csv.gz").write_bytes(packed)
    (folder / "packed.toml").write_text(setup)
    return folder


@pytest.fixture
def folder(logs, monkeypatch):
    monkeypatch.chdir(logs)
    return logs


@pytest.fixture
def model(folder, tirelog):
    if not (folder / "m.toml").exists():
        assert tirelog("model", "new", "--setup", "a.toml", "-o", "m.toml").status == 0
    return "m.toml"


POOLING = {
    "compare": ["compare", "--model", "m.toml"],
    "diagnose": ["diagnose", "--model", "m.toml"],
    "ladder": ["ladder", "--model", "m.toml"],
    "propose": ["propose", "--model", "m.toml"],
    "fit": ["model", "fit", "--model", "m.toml", "-o", "fitted.toml"],
    "report": ["report", "--model", "m.toml", "-o", "page.html"],
}


@pytest.mark.parametrize("name", POOLING)
def test_a_copy_of_a_log_is_refused(folder, tirelog, model, name):
    tirelog(*POOLING[name], "a.csv", "packed.csv.gz").refused(
        "packed.csv.gz: holds the same samples of strain_1 as a.csv"
    )
    assert not (folder / "fitted.toml").exists()
    assert not (folder / "page.html").exists()


def test_logs_of_two_tires_are_noticed(folder, tirelog, model):
    setup = (folder / "other.toml").read_text()
    (folder / "wider.toml").write_text(setup.replace("0.305", "0.295").replace("0.3126", "0.3"))
    (folder / "wider.csv").write_text((folder / "other.csv").read_text())
    outcome = tirelog("compare", "a.csv", "wider.csv", "--model", model)
    assert "wider.csv: a radius of 0.295 m, and of 0.305 m in a.csv" in outcome.err + outcome.out
    alike = tirelog("compare", "a.csv", "other.csv", "--model", model)
    assert "a radius of" not in alike.err + alike.out


@pytest.mark.parametrize("again", ["a.csv", "./a.csv", "copy.csv", "run.h5"])
def test_the_name_does_not_matter(folder, tirelog, model, again):
    if again == "run.h5":
        assert tirelog("ingest", "a.csv", "-o", "run.h5").status == 0
    tirelog("compare", "a.csv", again, "--model", model).refused(f"{again}: holds the same samples")


def test_a_stretch_of_another_log_is_said(folder, tirelog, model):
    outcome = tirelog("compare", "a.csv", "half.csv", "--model", model, "--format", "json").ended(
        0, "half.csv: 100 % of its samples are in a.csv too and count twice"
    )
    assert "half.csv: 100 % of its samples" in outcome.out
    outcome = tirelog("compare", "half.csv", "a.csv", "--model", model)
    assert "a.csv: 50 % of its samples are in half.csv too" in outcome.err


def test_of_other_logs_nothing_is_said(folder, tirelog, model):
    outcome = tirelog("compare", "a.csv", "other.csv", "--model", model).ended(0)
    assert "samples" not in outcome.err


def test_a_table_says_that_its_rows_stand_twice(folder, tirelog):
    outcome = tirelog("speed", "a.csv", "packed.csv.gz", "other.csv").ended(0)
    assert outcome.err.count("holds the same samples as") == 1
    assert "packed.csv.gz: holds the same samples as a.csv; their rows come twice" in outcome.err
