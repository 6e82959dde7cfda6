"""Faults: what killed processes leave beside their outputs is removed by the next command there."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from tirelog.cli import run

LOG = Path(__file__).parents[2] / "sample_data" / "drive.csv.gz"
#: begins an output of its argument's name, and then waits
BEGUN = """
import sys, time
from tirelog.storage.whole import whole_file
with whole_file(sys.argv[1]):
    print("begun", flush=True)
    time.sleep(600.0)
"""


def begun(output):
    """A process that has begun an output."""
    command = [sys.executable, "-c", BEGUN, str(output)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "begun\n"
    assert list(output.parent.glob(".*.part"))
    return process


def ended(process):
    process.kill()
    process.communicate()


def test_a_later_command_of_one_process_sweeps_its_folder_anew(tmp_path):
    """What a living process has begun stays until it ends."""
    words = ["tables", str(LOG), "-o", str(tmp_path), "--table", "speed", "--quiet"]
    assert run(words) == 0
    other = begun(tmp_path / "footprint.csv")
    try:
        assert run(words) == 0
        assert len(list(tmp_path.glob(".*.part"))) == 1
    finally:
        ended(other)
    assert run(words) == 0
    assert list(tmp_path.glob(".*.part")) == []


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_a_process_that_is_killed_during_the_command_leaves_nothing(tmp_path):
    pipe, setup = tmp_path / "pipe", LOG.with_name("drive.toml")
    os.mkfifo(pipe)
    other = begun(tmp_path / "other.csv")

    def feed() -> None:
        ended(other)
        pipe.write_bytes(LOG.read_bytes())

    timer = threading.Timer(1.0, feed)
    timer.start()
    output = tmp_path / "speed.csv"
    assert run(["speed", str(pipe), "--setup", str(setup), "-o", str(output), "--quiet"]) == 0
    timer.join()
    assert list(tmp_path.glob(".*.part")) == []
    assert output.exists()
