"""Faults: the n-th system call fails, and a command undoes or says what it lost."""

import _pyio
import builtins
import contextlib
import errno
import io
import os
import shutil
import signal
import tempfile
from pathlib import Path

import pytest

from tests.campaign.conftest import dataset, make_campaign
from tests.cli.conftest import SETUP, pulse_rows
from tirelog.campaign import runner
from tirelog.cli import run

CALLS = ("open", "read", "write", "fsync", "replace", "mkdir")
#: in turn: a full disk, a disk that fails
ERRORS = (errno.ENOSPC, errno.EIO)


@contextlib.contextmanager
def failing(nth):
    """The calls of the system so far, of which the n-th fails (0: none does)."""
    calls: list[str] = []
    patch = pytest.MonkeyPatch()

    def failing_as(name, real):
        def call(*given, **more):
            if not str(given[0]).startswith("/proc/"):  # whose processes differ each time
                calls.append(name)
                if len(calls) == nth:
                    code = ERRORS[nth % len(ERRORS)]
                    raise OSError(code, os.strerror(code))
            return real(*given, **more)

        return call

    for name in CALLS:
        patch.setattr(os, name, failing_as(name, getattr(os, name)))
    patch.setattr(builtins, "open", _pyio.open)
    patch.setattr(io, "open", _pyio.open)
    try:
        yield calls
    finally:
        patch.undo()


@pytest.fixture
def log(tmp_path, monkeypatch):
    """A log with its setup and a model, in a folder that holds temporary files, too."""
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    path = tmp_path / "log.csv"
    path.write_text("time_s,CH1,CH2\n" + "\n".join(pulse_rows(2.0, 12.0)) + "\n")
    more = (
        "section_height_m = 0.018\n[conditions]\nload_N = 3434.0\ninflation_pressure_Pa = 2.2e5\n"
    )
    (tmp_path / "log.toml").write_text(SETUP.replace("[channels", f"{more}[channels", 1))
    model = ["model", "new", "--carcass", "beam", "--setup", str(path.with_suffix(".toml"))]
    assert run([*model, "-o", str(tmp_path / "m.toml"), "--quiet"]) == 0
    return path


def steps(many, at_most):
    """Some of the calls 1 to `many`, spread over all, the last among them."""
    return range(many, 0, -many // at_most)


@pytest.mark.parametrize(
    ("command", "at_most"),
    [
        (["ingest", "log.csv", "-o", "out.h5"], 20),
        (["speed", "log.csv", "-o", "out.csv"], 40),
        (["speed", "log.csv", "-o", "out.parquet"], 12),
        (["model", "fit", "log.csv", "--model", "m.toml", "-o", "out.toml"], 4),
        (["report", "log.csv", "-o", "out.html"], 6),
    ],
    ids=lambda given: "-".join(given[:2]) if isinstance(given, list) else "",
)
def test_an_output_is_whole_or_not_there(log, monkeypatch, capfd, command, at_most):
    monkeypatch.chdir(log.parent)
    command = [*command, "--quiet"]
    output, inputs = Path(command[-2]), {path.name for path in Path().iterdir()}
    with failing(0) as calls:
        assert run(command) == 0
    for nth in steps(len(calls), at_most):
        output.unlink(missing_ok=True)
        if older := nth % 4 > 1:
            output.write_text("older")
        capfd.readouterr()
        with failing(nth):
            status = run(command)
        said = capfd.readouterr().err
        assert status in (0, 2, 3, 4), (nth, said)
        assert "Traceback" not in said
        left = {path.name for path in Path().iterdir()} - inputs
        if status in (0, 3):
            assert left == {output.name}
            assert output.stat().st_size > 200
        else:
            assert said.count("\n") == 1, said
            assert left == ({output.name} if older else set())
            assert not older or output.read_text() == "older"
        shutil.rmtree("tmp")  # a folder that cannot be removed is swept by the next command
        Path("tmp").mkdir()


def test_a_campaign_goes_on_where_the_system_failed(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(
        runner, "_on_processes", lambda tasks, workers: (runner.make_tables(task) for task in tasks)
    )
    command = ["campaign", "run", str(make_campaign(tmp_path, logs=2)), "--quiet"]
    output = tmp_path / "results"
    with failing(0) as calls:
        assert run(command) == 0
    want = dataset(output)
    for nth in steps(len(calls), 8):
        shutil.rmtree(output)
        with failing(nth):
            status = run(command)
        said = capfd.readouterr().err
        assert status in (0, 2, 3, 4), (nth, said)
        assert "Traceback" not in said
        left = dataset(output) if output.exists() else {}
        assert left.items() <= want.items()
        assert run(command) == 0
        assert dataset(output) == want


def test_signals_that_interrupt_calls_change_nothing(log, monkeypatch):
    monkeypatch.chdir(log.parent)
    outputs = [Path("calm.csv"), Path("interrupted.csv")]
    for output, interval_s in zip(outputs, (0.0, 2e-4), strict=True):
        before = signal.signal(signal.SIGALRM, lambda *_: None)
        signal.setitimer(signal.ITIMER_REAL, interval_s, interval_s)
        try:
            assert run(["speed", "log.csv", "-o", str(output), "--quiet"]) == 0
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, before)
    assert outputs[0].read_text() == outputs[1].read_text()
