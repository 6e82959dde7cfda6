"""Processes that share independent work: the channels of tables, the trials of a fit.

    numbers, in their order --to whichever process is free--> answers, in the numbers' order

Threads would wait for each other: numpy's short calls and Python's own hold the interpreter's lock
for two thirds of a channel's time. A process that is forked has all that its parent has at hand,
and starts in milliseconds. If a process is stopped or meets an error, its parent does the work
again, so errors are those of one process.

It stays for the time that it saves: `tirelog tables` of 10 minutes, wall (CPU) seconds, medians of
3 (23 November 2026, two cores, Python 3.11):

    log                           threads      processes
    16 gratings                   2.36 (3.41)  1.64 (2.86)
    16 gratings, driven with slip 3.48 (5.08)  2.35 (4.11)
    16 gratings of a ring         2.67 (3.94)  2.00 (3.42)
    4 gratings                    0.77 (1.07)  0.68 (0.98)
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager, suppress
from typing import Any, TypeVar

from tirelog.runtime import end_with_parent, processes, share_work

Made = TypeVar("Made")

#: a process can only be forked safely there, and talks by semaphores, which are kept in memory
POSSIBLE = sys.platform == "linux" and os.access("/dev/shm", os.W_OK)
#: what a process makes of its numbers, the last one counts
_MAKERS: list[Callable[[int], Any]] = []


@contextmanager
def ending_pool(
    workers: int, method: str, begin: Callable[..., None], *given: Any
) -> Iterator[ProcessPoolExecutor]:
    """A pool of processes, each of which begins with `begin(parent, *given)`.

    None outlives the block, whatever it is at. `method`: how they start, "fork" or "spawn".
    """
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context(method)
    pool = ProcessPoolExecutor(workers, context, begin, (os.getpid(), *given))
    try:
        yield pool
    finally:
        for worker in set(multiprocessing.active_children()) - others:
            worker.kill()  # the pool would wait for what they have begun
        pool.shutdown(cancel_futures=True)


def in_processes(count: int, workers: int, make: Callable[[int], Made]) -> Generator[Made]:
    """`make(number)` for all numbers below `count`, in their order, by so many processes.

    What a process has not brought to its end is made in this one.
    """
    with ending_pool(min(workers, count), "fork", _begin, make) as pool:
        with warnings.catch_warnings():
            # Python warns of other threads: that of a terminal's line, and no process needs it
            warnings.simplefilter("ignore", DeprecationWarning)
            answers: deque[Future[Made]] = deque()
            with suppress(BrokenProcessPool):  # one has ended already: the rest is made here
                for number in range(count):
                    answers.append(pool.submit(_made, number))
        for number in range(count):
            try:  # also of what was not given to any
                made = answers.popleft().result()
            except Exception:  # its process has ended, or met what this one meets too, and says
                made = make(number)
            yield made


def shares(count: int) -> bool:
    """True if so many independent tasks are shared by processes."""
    return min(processes(), count) > 1 and POSSIBLE


def shared_out(count: int, make: Callable[[int], Made], allowed: bool = True) -> Iterator[Made]:
    """`make(number)` for all numbers below `count`, in their order, by the processes at hand.

    By this one alone if others are not `allowed`, or there is nothing to share. What `make` leaves
    behind beside its answer goes with its process, so no number may count on what was made of
    another.
    """
    if not (allowed and shares(count)):
        yield from map(make, range(count))
        return
    with closing(in_processes(count, processes(), make)) as answers:
        yield from answers


def made_apart(jobs: Sequence[Callable[[], Made]]) -> list[Made]:
    """Results of independent jobs, in their order, by `shared_out`."""
    return list(shared_out(len(jobs), lambda number: jobs[number]()))


def _begin(parent: int, make: Callable[[int], Any]) -> None:
    """Prepare a forked process, before anything else in it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # its parent hears of it
    for asked in (signal.SIGTERM, signal.SIGHUP):  # nothing of its own is to be put in order
        signal.signal(asked, signal.SIG_DFL)
    end_with_parent(parent)
    share_work(False)
    _MAKERS.append(make)


def _made(number: int) -> Any:
    return _MAKERS[-1](number)
