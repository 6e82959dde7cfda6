"""Faults: without what only POSIX systems have, every output is there, byte by byte."""

import os
import re
from pathlib import Path

import pytest

from tests.campaign.conftest import dataset, make_campaign
from tests.cli.test_printed_commands import SCENARIO
from tests.diagnosis.periodic import write_log
from tests.processes import python
from tirelog.cli import run

ROOT = Path(__file__).parents[2]
HIDDEN = ROOT / "tests" / "faults" / "without_posix"
#: what writes in ways of its own: by every writer of tables, by several workers, several files
GROUPS = {
    "tables": """speed log.csv -o O/speed.csv
speed log.csv -o O/speed.parquet
speed log.csv -o O/speed.ndjson
speed log.csv -o O/speed.json
tables log.csv -o O/tables --workers 2
dissipation log.csv -o O/d.csv --plot O/d.png
check O/speed.csv --against O/speed.csv -o O/moved.csv""",
    "logs": """ingest log.csv -o O/run.h5
speed O/run.h5 -o O/speed.csv
info log.csv -o O/info.json --format json
setup new log.csv -o O/setup.toml
simulate scenario.toml -o O/made.mcap
report log.csv -o O/page.html""",
    "models": """model new --setup log.toml -o O/m.toml
model add O/m.toml water_film -o O/m.toml
model fit log.csv --model beam.toml -o O/fitted.toml
compare log.csv --model beam.toml -o O/compare.json --format json
ladder log.csv --model beam.toml -o O/ladder.csv --save O/better.toml""",
}
#: imports every module, as a command may
IMPORTS = """import importlib, pkgutil, tirelog
for module in pkgutil.walk_packages(tirelog.__path__, "tirelog."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
"""
RUN = """import sys
from tirelog.cli import run
for line in sys.argv[1].splitlines():
    assert run(line.split()) == 0, line
"""


def without_posix(program, folder, *words):
    """Run a program of Python that finds nothing that only POSIX has; it ends with status 0."""
    seen = os.pathsep.join(map(str, (HIDDEN, ROOT)))
    python(program, *words, folder=folder, PYTHONPATH=seen)


def outputs(folder):
    """Every file with its bytes, without the time at which it was made."""
    when = re.compile(rb"20\d\d-\d\d-\d\d[T ]\d\d:\d\d")
    return {
        str(path.relative_to(folder)): when.sub(b"", path.read_bytes())
        for path in folder.rglob("*")
        if path.is_file() and path.suffix != ".h5"  # a run holds when it was made; it is read back
    }


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a log, a scenario and a model of one free parameter, made the working one."""
    monkeypatch.chdir(tmp_path)
    write_log(tmp_path / "log.csv", 3, "box", manoeuvres=2, seconds=1.0)
    (tmp_path / "scenario.toml").write_text(SCENARIO.replace("duration_s = 2", "duration_s = 1"))
    assert run(["model", "new", "--setup", "log.toml", "-o", "beam.toml"]) == 0
    model = re.sub(r"\{value = ([^,]+),.*\}", r"\1", (tmp_path / "beam.toml").read_text())
    lever = "lever_arm_m = {value = 3e-4, min = 0.0, max = 0.02}"
    (tmp_path / "beam.toml").write_text(re.sub(r"lever_arm_m = \S+", lever, model))
    return tmp_path


@pytest.mark.parametrize("group", GROUPS)
def test_every_output_is_there_without_what_only_posix_has(folder, group):
    (folder / "O").mkdir()
    for line in GROUPS[group].splitlines():
        assert run(line.split()) == 0, line
    usual = outputs(folder / "O")
    (folder / "O").rename(folder / "usual")
    (folder / "O").mkdir()
    without_posix(RUN, folder, GROUPS[group])
    made = outputs(folder / "O")
    assert made.keys() == usual.keys()
    assert [name for name in made if made[name] != usual[name]] == []


def test_every_module_is_imported_without_what_only_posix_has(tmp_path):
    without_posix(IMPORTS, tmp_path)


def test_a_campaign_runs_without_what_only_posix_has(tmp_path):
    manifest = make_campaign(tmp_path, logs=2, seconds=1.0)
    words = ["campaign", "run", str(manifest), "--quiet"]
    without_posix(RUN, tmp_path, " ".join(words))
    made = dataset(tmp_path / "results")
    (tmp_path / "results").rename(tmp_path / "hidden")
    assert run(words) == 0
    assert dataset(tmp_path / "results") == made
    assert len(made) == 4
