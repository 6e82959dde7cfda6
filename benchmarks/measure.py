"""Time and memory of whole processes, as the operating system counts them."""

import os
import subprocess
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from typing import TypeVar

Result = TypeVar("Result")


@dataclass(frozen=True)
class Cost:
    """Wall and CPU seconds and peak memory [MB] of one process with its children."""

    wall_s: float
    cpu_s: float
    peak_MB: float

    def __str__(self) -> str:
        return f"{self.wall_s:7.2f} s wall  {self.cpu_s:7.2f} s cpu  {self.peak_MB:6.0f} MB"


def cost(command: list[str], *, one_core: bool = False) -> Cost:
    """Run `command` with its output thrown away; it has to succeed. `one_core` keeps it on one."""
    # modules are kept compiled, as on a user's machine, whatever the shell of the benchmark says
    kept = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    begun = time.perf_counter()
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=kept
    )
    if one_core:  # before it has begun any thread or process, which follow it
        os.sched_setaffinity(process.pid, {min(os.sched_getaffinity(0))})
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"{command} ended with {process.returncode}")
    return Cost(
        time.perf_counter() - begun, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024
    )


def apart(function: Callable[..., Result], *arguments: object) -> Result:
    """What `function` gives in a process of its own.

    The peak memory of a command is at least that of the process that starts it, which so stays
    small.
    """
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(function, *arguments).result()


def median(costs: list[Cost]) -> Cost:
    """The run with the median wall time."""
    return sorted(costs, key=lambda c: c.wall_s)[len(costs) // 2]
