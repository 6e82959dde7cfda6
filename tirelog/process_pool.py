"""What is independent, worked on by processes of their own: the tables' channels, trials of a fit.

    channels, in their order
        --a number down each pipe, as soon as its process is free-->
        process: passages, form (asked for: where others may start from), tables
        --Parts up the pipe-->
    Parts, in the channels' order

Threads would wait for each other: numpy's short calls and Python's own hold the interpreter's lock
for two thirds of a channel's time. A process that is forked has all that its parent has at hand,
and starts in milliseconds. What a process does not bring to its end, because it was stopped or
because of an error, its parent does again itself, so that errors are those of one process.

It stays for what it buys: `tirelog tables` of 10 minutes, wall (CPU) seconds, threads and
processes: 16 gratings 2.36 (3.41) and 1.64 (2.86), driven with slip 3.48 (5.08) and 2.35 (4.11), of
a ring 2.67 (3.94) and 2.00 (3.42), 4 gratings 0.77 (1.07) and 0.68 (0.98) (medians of 3; 23
November 2026, two cores, Python 3.11).
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, suppress
from multiprocessing.connection import Connection, Pipe, wait
from typing import Any, TypeVar

from tirelog.runtime import end_with_parent, processes, share_work

Made = TypeVar("Made")

#: what a process says of the number that it works on
ASKS, TOLD, MADE, FAILED = "asks", "told", "made", "failed"
#: a process can only be forked safely there
POSSIBLE = sys.platform == "linux" and hasattr(os, "fork")


class PipeLink:
    """How a process that works on a number hears of those before it, and tells of its own."""

    def __init__(self, pipe: Connection, number: int) -> None:
        self._pipe, self._number, self._told = pipe, number, False

    def ask(self) -> Any:
        """The first that was told of a number before this one; None if there is none."""
        self._pipe.send((ASKS, self._number, None))
        return self._pipe.recv()

    def tell(self, what: Any) -> None:
        """What is told of this number; only the first time counts."""
        if not self._told:
            self._told = True
            self._pipe.send((TOLD, self._number, what))


class LocalLink:
    """A `PipeLink` of the process that keeps what is told."""

    def __init__(self, before: Any) -> None:
        self._before = before
        self.told: list[Any] = []

    def ask(self) -> Any:
        return self._before

    def tell(self, what: Any) -> None:
        self.told.append(what)


def in_processes(
    count: int,
    processes: int,
    make: Callable[[int, PipeLink | LocalLink], Made],
) -> Generator[Made]:
    """`make(number, wire)` for all numbers below `count`, in their order, by `processes`.

    What a process has not brought to its end is made in this one.
    """
    pipes: dict[Connection, int] = {}
    told: dict[int, Any] = {}
    asking: dict[int, Connection] = {}
    done: dict[int, Made | None] = {}
    at_work: dict[Connection, int] = {}
    waiting = iter(range(count))

    def next_one(pipe: Connection) -> None:
        number = next(waiting, None)
        if number is None:
            at_work.pop(pipe, None)
            return
        at_work[pipe] = number
        with suppress(OSError):  # it has ended, and is found out below
            pipe.send(number)

    def settle(number: int, what: Any) -> None:
        told.setdefault(number, what)
        for asker in sorted(asking):
            ready, before = _first_told(told, asker)
            if ready:
                with suppress(OSError):
                    asking.pop(asker).send(before)

    def lost(pipe: Connection) -> None:
        """A process has ended: what it was at is made here."""
        number = at_work.pop(pipe, None)
        pipe.close()
        _end(pipes.pop(pipe))
        if number is not None:
            asking.pop(number, None)
            done[number] = None

    try:
        for _ in range(min(processes, count)):
            ours, theirs = Pipe()
            with warnings.catch_warnings():
                # Python warns of other threads: that of a terminal's line, and no process needs it
                warnings.simplefilter("ignore", DeprecationWarning)
                process = os.fork()
            if not process:
                _serve(theirs, [ours, *pipes], make)
            theirs.close()
            pipes[ours] = process
        for pipe in list(pipes):
            next_one(pipe)
        for number in range(count):
            while number not in done and at_work:
                for ready in wait(list(at_work)):
                    assert isinstance(ready, Connection)
                    try:
                        word, whose, what = ready.recv()
                        if word == ASKS:
                            known, before = _first_told(told, whose)
                            if known:
                                ready.send(before)
                            else:
                                asking[whose] = ready
                        elif word == TOLD:
                            settle(whose, what)
                        else:
                            done[whose] = what
                            if word == MADE:
                                settle(whose, None)
                            next_one(ready)
                    except (EOFError, OSError, pickle.UnpicklingError):
                        lost(ready)
            made = done.pop(number, None)
            if made is None:
                here = LocalLink(_first_told(told, number)[1])
                made = make(number, here)
                settle(number, next(iter(here.told), None))
            yield made
    finally:
        for pipe, process in pipes.items():
            pipe.close()
            _end(process)


def shares(count: int) -> bool:
    """Whether so many independent things are shared out over processes."""
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
    with closing(in_processes(count, processes(), lambda number, wire: (make(number),))) as answers:
        for (answer,) in answers:
            yield answer


def made_apart(jobs: Sequence[Callable[[], Made]]) -> list[Made]:
    """What independent jobs come to, in their order, as `shared_out` makes it."""
    return list(shared_out(len(jobs), lambda number: jobs[number]()))


def _first_told(told: dict[int, Any], number: int) -> tuple[bool, Any]:
    """(whether it is known, the first that is not None of the numbers before this one)."""
    for before in range(number):
        if before not in told:
            return False, None
        if told[before] is not None:
            return True, told[before]
    return True, None


def _end(process: int) -> None:
    """End a process that may have ended."""
    with suppress(ProcessLookupError):
        os.kill(process, signal.SIGKILL)
    with suppress(ChildProcessError):
        os.waitpid(process, 0)


def _serve(
    pipe: Connection, others: list[Connection], make: Callable[[int, PipeLink | LocalLink], Any]
) -> None:
    """What a process does: numbers down the pipe, answers up; it never comes back from here."""
    try:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # its parent hears of it
        for asked in (signal.SIGTERM, signal.SIGHUP):  # nothing of its own is to be put in order
            signal.signal(asked, signal.SIG_DFL)
        end_with_parent(os.getppid())
        share_work(False)
        for other in others:
            other.close()
        while True:
            number = pipe.recv()
            try:
                answer = MADE, number, make(number, PipeLink(pipe, number))
            except Exception:  # its parent meets the same, and says it
                answer = FAILED, number, None
            pipe.send(answer)
    finally:
        os._exit(0)
