"""Faults: standard streams that are closed, full or left, signals, and names that are not UTF-8."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import pytest

from tests.cli.conftest import SETUP, pulse_rows

HEADER = "time_s,CH1,CH2\n"
#: a busy machine may take so long [s] for what takes one second
PATIENCE_S = 240


def shell(line, **environment):
    """A command line whose `tirelog` is this one."""
    line = line.replace("tirelog", f"{sys.executable} -m tirelog")
    return subprocess.run(
        ["bash", "-c", line], capture_output=True, check=False, env={**os.environ, **environment}
    )


@pytest.mark.parametrize(
    ("line", "status", "words"),
    [
        ("tirelog effects >&-", 2, b"standard output: cannot be written (Bad file descriptor)"),
        ("tirelog info - --setup log.toml <&-", 4, b"-: cannot be read (Bad file descriptor)"),
        ("tirelog info log.csv nope.csv -o t.csv <&- >&- 2>&-", 3, b""),
        ("tirelog effects > /dev/full", 2, b"standard output: cannot be written (No space left"),
    ],
)
def test_streams_that_are_closed_or_full(folder, line, status, words):
    if "/dev/full" in line and not Path("/dev/full").exists():
        pytest.skip("no such device here")
    done = shell(line)
    assert done.returncode == status, done.stderr
    assert words in done.stderr
    assert done.stderr.count(b"\n") == bool(words)


@pytest.mark.parametrize("line", ["effects | true", "speed log.csv log.csv log.csv | head -1"])
def test_a_reader_that_leaves_is_no_error(folder, line):
    done = shell(f"tirelog {line}; exit ${{PIPESTATUS[0]}}")
    assert done.returncode == 0
    assert b"rror" not in done.stderr


def test_names_that_are_not_utf8(folder):
    os.rename(folder / "log.csv", os.fsencode(folder) + b"/l\xf6g.csv")
    done = shell("tirelog info l*g.csv --setup log.toml", PYTHONIOENCODING="ascii", LC_ALL="C")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(b"l\\xf6g.csv: text")


@pytest.mark.parametrize(
    ("words", "how"),
    [
        ("speed - --setup log.toml -o made", signal.SIGTERM),
        ("speed - --setup log.toml -o made", signal.SIGHUP),
        ("ingest - --setup log.toml -o made", signal.SIGINT),
        ("ingest - --setup log.toml -o made", signal.SIGKILL),
    ],
)
def test_what_stops_a_command_leaves_no_result(folder, words, how):
    """Rows that never end come on standard input; the process is stopped while it writes."""
    (folder / "tmp").mkdir()
    format = ["--format", "csv"] if words.startswith("speed") else []
    process = subprocess.Popen(
        [sys.executable, "-m", "tirelog", *words.split(), *format],
        stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        env={**os.environ, "TMPDIR": str(folder / "tmp")},
    )  # fmt: skip
    assert process.stdin is not None
    process.stdin.write((HEADER + "\n".join(pulse_rows(60.0)) + "\n").encode())
    process.stdin.flush()
    deadline = time.monotonic() + PATIENCE_S
    while not list(folder.glob("tmp/tirelog-*")) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert list(folder.glob(".made.*.part"))
    process.send_signal(how)
    _, err = process.communicate()
    assert process.returncode == (-how if how is signal.SIGKILL else 128 + how)
    assert not (folder / "made").exists()
    if how is not signal.SIGKILL:
        said = "interrupted" if how is signal.SIGINT else f"stopped ({how.name})"
        left = "nothing was left under the result's name; start it again"
        assert err == f"tirelog: error: {said}; {left}\n".encode()
        assert sorted(path.name for path in folder.rglob("*")) == ["log.csv", "log.toml", "tmp"]


def test_a_named_pipe_is_read_once(folder):
    os.mkfifo(folder / "pipe")
    done = shell(f"cat log.csv > pipe & timeout {PATIENCE_S} tirelog info pipe --setup log.toml")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(b"pipe: text")
    with h5py.File(folder / "log.h5", "w") as file:  # HDF5 seeks: it is copied
        for name, column in (("CH1", 1), ("CH2", 2)):
            file[name] = [float(row.split(",")[column]) for row in pulse_rows(0.5)]
            file[name].attrs["sampling_rate_Hz"] = 2500.0
    (folder / "pipe.toml").write_text(SETUP.replace('time = "time_s"', ""))
    done = shell(f"cat log.h5 > pipe & timeout {PATIENCE_S} tirelog info pipe")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(b"pipe: hdf5")


def test_what_cannot_be_read_is_no_failed_write(folder, tirelog):
    if not Path("/proc/self/mem").exists():
        pytest.skip("no such file here")
    outcome = tirelog("info", "/proc/self/mem", "--setup", "log.toml").ended(4)
    said = "tirelog: error: /proc/self/mem: cannot be read (Input/output error)"
    assert outcome.err.startswith(said)
