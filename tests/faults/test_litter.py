"""Faults: what killed processes leave beside their outputs is removed by the next command there."""

import subprocess
import sys
from pathlib import Path

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
