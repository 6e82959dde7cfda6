"""Faults: pipes without a writer and kernels that compile are waited for, with a notice."""

import os
import sys
import threading
from pathlib import Path
from shutil import copy

import pytest

from tests.processes import python
from tests.test_compiled import copied
from tirelog.cli import run
from tirelog.runtime import hearing

SAMPLES = Path(__file__).parents[2] / "sample_data"
NOTICE = "is a pipe; waiting for what writes to it"

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")


@pytest.fixture
def work(tmp_path, monkeypatch):
    """A folder with a log, its setup, a model and a table, and little patience."""
    for name in ("drive.csv.gz", "drive.toml"):
        (tmp_path / name).write_bytes((SAMPLES / name).read_bytes())
    monkeypatch.chdir(tmp_path)
    assert run(["model", "new", "--preset", "P1", "-o", "model.toml", "--quiet"]) == 0
    assert run(["speed", "drive.csv.gz", "-o", "speed.csv", "--quiet"]) == 0
    monkeypatch.setattr("tirelog.runtime.PATIENCE_S", 0.05, raising=False)
    return tmp_path


def run_on(words, file, opened, *, before):
    """The status of a command; what `file` holds is written once a notice is given."""
    heard, data = threading.Event(), Path(file).read_bytes()

    def write():
        if not before:
            heard.wait(30.0)
        with opened() as pipe:
            heard.wait(30.0)
            pipe.write(data)

    threading.Thread(target=write, daemon=True).start()
    with hearing(lambda text: heard.set()):
        return run(words.split())


def run_on_pipe(words, file, *, before=False):
    """As `run_on`, of `pipe.csv`."""
    os.mkfifo("pipe.csv")
    return run_on(words, file, lambda: open("pipe.csv", "wb"), before=before)


@pytest.mark.parametrize(
    ("words", "file", "silent"),
    [
        ("speed pipe.csv --setup drive.toml", "drive.csv.gz", False),
        ("speed pipe.csv --setup drive.toml", "drive.csv.gz", True),
        ("speed drive.csv.gz --setup pipe.csv", "drive.toml", False),
        ("speed drive.csv.gz --setup pipe.csv", "drive.toml", True),
        ("model show pipe.csv", "model.toml", False),
        ("check pipe.csv --against speed.csv", "speed.csv", False),
    ],
)
def test_a_pipe_without_a_writer_or_a_word_is_noticed(work, capfd, words, file, silent):
    assert run_on_pipe(words, file, before=silent) == 0
    said = capfd.readouterr().err
    assert said.count(NOTICE) == 1
    assert "pipe.csv: is a pipe" in said


@pytest.mark.parametrize(
    ("words", "file"),
    [
        ("speed - --setup drive.toml", "drive.csv.gz"),
        ("check - --against speed.csv", "speed.csv"),
        ("info -", "drive.csv.gz"),
    ],
)
def test_a_silent_standard_input_is_noticed_and_waited_for(work, capfd, monkeypatch, words, file):
    read, write = os.pipe()
    monkeypatch.setattr(sys, "stdin", open(read, encoding="utf-8"))  # noqa: SIM115
    assert run_on(words, file, lambda: os.fdopen(write, "wb"), before=True) == 0
    assert capfd.readouterr().err.count("standard input: is silent; waiting for what writes") == 1


def test_a_quiet_command_waits_without_a_notice(work, capfd):
    assert run_on_pipe("speed pipe.csv --setup drive.toml --quiet", "drive.csv.gz") == 0
    assert capfd.readouterr().err == ""


def test_a_regular_file_gives_no_notice(work, capfd, monkeypatch):
    monkeypatch.setattr("tirelog.runtime.PATIENCE_S", 0.0, raising=False)
    assert run(["speed", "drive.csv.gz", "-o", "again.csv"]) == 0
    assert NOTICE not in capfd.readouterr().err


def test_compiling_is_noticed_once(tmp_path):
    package = copied(tmp_path)
    for built in (package / "kernels").glob("_built*"):
        built.unlink()
    for file in ("inflation.csv.gz", "inflation.toml"):
        copy(SAMPLES / file, tmp_path)
    program, words = "from tirelog.cli import main; main()", ("inflation", "inflation.csv.gz")
    done = python(program, *words, folder=tmp_path, PYTHONPATH=str(tmp_path))
    assert done.stderr.count("compiling kernels") == 1
