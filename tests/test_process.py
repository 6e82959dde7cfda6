"""Property: what a process is told about itself holds."""

import os

import pytest

from tests.processes import python

#: a command to its end, and how many threads it has left
COMMAND = """
import os, sys
import tirelog.runtime
tirelog.runtime.leave = lambda status: print(
    "numpy" in sys.modules, len(os.listdir("/proc/self/task"))
)
from tirelog.cli import main
sys.argv = ["tirelog", "info", "no such log.csv"]
main()
"""


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="no list of threads")
def test_a_command_has_one_thread() -> None:
    """A second one would be that of the linear algebra: busy, and of no use."""
    assert python(COMMAND, without="_NUM_THREADS").stdout.split() == ["True", "1"]
