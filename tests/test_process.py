"""Property: what a process is told about itself holds."""

import os

import pytest

from tests.processes import python

PROGRAM = """
import ctypes, sys, threading
from tirelog.runtime import one_heap
if sys.argv[1] == "told":
    one_heap()
held = []
for _ in range(4):
    thread = threading.Thread(target=lambda: held.append([bytes(600) for _ in range(1000)]))
    thread.start()
    thread.join()
ctypes.CDLL(None).malloc_stats()
"""


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


@pytest.mark.skipif(
    not hasattr(os, "confstr") or "glibc" not in (os.confstr("CS_GNU_LIBC_VERSION") or ""),
    reason="no glibc",
)
@pytest.mark.parametrize(("told", "one"), [("told", True), ("untold", False)])
def test_threads_share_one_heap(told: str, one: bool) -> None:
    said = python(PROGRAM, told, without="MALLOC_").stderr
    assert (said.count("Arena ") == 1) == one
