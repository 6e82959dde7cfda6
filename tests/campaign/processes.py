"""Campaigns as processes of their own: begun, held up at a known place, and killed with all that
they have started.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path

import psutil

from tirelog.campaign.ledger import Entry, Folder
from tirelog.campaign.manifest import LogTask
from tirelog.campaign.runner import make_tables
from tirelog.storage.whole import whole_file

#: a busy machine may take so long [s] for what takes one second
PATIENCE_S = 240.0
_ENDED = (psutil.STATUS_ZOMBIE, psutil.STATUS_DEAD)


def waited_for(event: Callable[[], bool]) -> bool:
    """Whether `event` has come, at last."""
    end = time.monotonic() + PATIENCE_S
    while not event():
        if time.monotonic() > end:
            return False
        time.sleep(0.01)
    return True


# ---- what a worker does instead of `make_tables` -------------------------------------------------


def stuck(task: LogTask) -> Entry:
    """A worker's task that has begun to write its table, and never ends."""
    name = f"table=speed/log={task.name}/part.parquet"
    with whole_file(Folder(task.output).place(name)) as part:
        part.write_bytes(b"half of a table")
        while True:
            time.sleep(1.0)


def dying_on_the_first(task: LogTask) -> Entry:
    """A worker's task; whoever gets the first log dies of it, while its neighbours are at work."""
    if task.name.endswith("run_0.csv"):
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.5)  # a neighbour is at work whenever the first one's worker dies
    return make_tables(task)


# ---- the campaign --------------------------------------------------------------------------------

_PROGRAM = """
import sys
from tests.campaign import processes
from tirelog.campaign import runner
from tirelog.cli import main
runner.make_tables = getattr(processes, sys.argv.pop(1))
main()
"""


def begun(
    manifest: Path, work: Callable[[LogTask], Entry], *options: str
) -> "subprocess.Popen[bytes]":
    """`campaign run` in a process of its own, whose workers do `work`; what it says goes to
    `said.txt`.
    """
    words = [sys.executable, "-c", _PROGRAM, work.__name__]
    words += ["campaign", "run", str(manifest), "--quiet", *options]
    with (manifest.parent / "said.txt").open("wb") as said:
        return subprocess.Popen(words, stderr=said, cwd=Path(__file__).parents[2])


# ---- what a process has started ------------------------------------------------------------------


def children(pid: int) -> list[psutil.Process]:
    """What `pid` has started, and what those have started."""
    return psutil.Process(pid).children(recursive=True)


def alive(started: list[psutil.Process]) -> list[psutil.Process]:
    """Those of `children` that have not ended; one that was given a number later is none."""
    return [one for one in started if one.is_running() and one.status() not in _ENDED]


def kill_all(process: "subprocess.Popen[bytes]", known: Iterable[psutil.Process] = ()) -> None:
    """SIGKILL for the process, what it has started and what was `known` of that, and for nobody
    else.
    """
    started = [*known, *(children(process.pid) if process.poll() is None else ())]
    process.kill()
    process.wait()
    for one in alive(started):
        with suppress(psutil.NoSuchProcess):
            one.kill()
    assert waited_for(lambda: not alive(started))
