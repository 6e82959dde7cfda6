"""The process's standard streams and the signals that end it, as every command may rely on them.

standard output   closed, full or of another encoding: an OutputError or an escaped letter, never a
                  crash
SIGTERM, SIGHUP   unwind like an interrupt, so that what is not finished is removed
"""

from __future__ import annotations

import io
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

from tirelog.storage.whole import output_error

#: signals that end a process from outside; a shell shows 128 more than their number as the status
_ENDINGS = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))


class Stopped(KeyboardInterrupt):
    """A signal to end the process."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.status = 128 + number


@contextmanager
def endings_unwind() -> Iterator[None]:
    """While open, SIGTERM and SIGHUP raise Stopped, once; an ignored one (`nohup`) stays so."""

    def stop(number: int, _: FrameType | None) -> None:
        for ending in mine:
            signal.signal(ending, signal.SIG_IGN)  # the second must not disturb the sweeping
        raise Stopped(number)

    here = threading.current_thread() is threading.main_thread()
    mine = [number for number in _ENDINGS if here and signal.getsignal(number) is signal.SIG_DFL]
    for number in mine:
        signal.signal(number, stop)
    try:
        yield
    finally:
        for number in mine:
            signal.signal(number, signal.SIG_DFL)


class _Out(io.FileIO):
    """Standard output's bytes.

    What cannot be written is an OutputError, a reader that leaves is not.
    """

    def write(self, data: Any) -> int:
        try:
            return super().write(data)
        except BrokenPipeError:
            raise
        except OSError as problem:
            raise output_error("standard output", problem) from problem


def open_streams() -> None:
    """Standard streams that are there, whoever started the process.

    To be called before any file is opened.

    A closed one is replaced by the null device in the direction that fails, or the next file that
    is opened would take its number.
    """
    for number, way in ((0, os.O_WRONLY), (1, os.O_RDONLY), (2, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, way)
    if sys.stdin is None:
        sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115
    if sys.stderr is None:
        sys.stderr = open(2, "w", encoding="utf-8", errors="backslashreplace", closefd=False)  # noqa: SIM115
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    stream = io.BufferedWriter(_Out(1, "w", closefd=False))
    sys.stdout = io.TextIOWrapper(stream, encoding, "backslashreplace", line_buffering=os.isatty(1))


def drop_output() -> None:
    """Point standard output at nothing, so that no flush at exit complains."""
    with suppress(OSError, ValueError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)
