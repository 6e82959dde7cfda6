"""Settings of the process: threads, allocator, garbage, work shared with others, its end.

And who hears of what takes long.
"""

from __future__ import annotations

import gc
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from typing import NoReturn

#: glibc's number for the most heaps (malloc.h, M_ARENA_MAX)
_MOST_HEAPS = -8
#: glibc's numbers for the free bytes at the end of the heap that go back to the system, and for the
#: size of an array that has memory of its own (malloc.h, M_TRIM_THRESHOLD, M_MMAP_THRESHOLD); and
#: what is set: a block of waveforms is 1.5 MB, and twenty of them are at work at a time
_TRIM, _OWN_MEMORY = -1, -3
_TRIM_BYTES, _OWN_MEMORY_BYTES = 1 << 26, 1 << 22
#: the parent is looked for so often [s]
_LOOK_S = 0.5
#: processes that share what is independent of each other, if there are as many cores: twice as many
#: take twice the memory beside that of the command
_MOST_PROCESSES = 2
#: containers that are made before garbage is looked for among the new ones: some 10 MB
_COLLECT_AFTER = 50_000


def one_thread() -> None:
    """Set one thread for the linear algebra under numpy; a number that the user has set stays.

    Matrices are small and many here. With more threads the library's wait for each other in busy
    loops. `tirelog diagnose` of two logs took 6.9 s of wall and 9.8 s of CPU time with two threads,
    6.1 s of both with one. The import of numpy took 0.2 s of CPU more (23 November 2026, two shared
    cores, Python 3.11). To be called before numpy is imported.
    """
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")


def one_heap() -> None:
    """One heap for all threads: what one has freed serves the next.

    To be called before the first thread is started.

    With a heap for each, those of the readers keep up to 80 MB that the estimators then take once
    more. Other libraries than glibc have no such number, or no such habit.
    """
    if "MALLOC_ARENA_MAX" not in os.environ:
        _set_allocator({_MOST_HEAPS: 1})


@cache
def keep_freed() -> None:
    """Keep freed memory, up to 64 MB, for the next array.

    For fits, which predict the same block of waveforms some thousand times. Otherwise each array of
    a megabyte comes anew from the system, page by page. This takes a third of a prediction's time
    (blocks of 96 revolutions, 2026-11; a joint diagnose takes a fifth less).
    """
    if not {"MALLOC_TRIM_THRESHOLD_", "MALLOC_MMAP_THRESHOLD_"} & set(os.environ):
        _set_allocator({_TRIM: _TRIM_BYTES, _OWN_MEMORY: _OWN_MEMORY_BYTES})


def _set_allocator(numbers: Mapping[int, int]) -> None:
    """Numbers of glibc's allocator; elsewhere there is nothing to set."""
    if sys.platform == "linux":
        import ctypes

        library = ctypes.CDLL(None)
        for number, value in numbers.items():
            if hasattr(library, "mallopt"):
                library.mallopt(number, value)


def few_collections() -> None:
    """Look for garbage in cycles seldom: arrays are never in one, and imports make none.

    With Python's own threshold, 700, what is imported is gone through some twenty times.
    """
    gc.set_threshold(_COLLECT_AFTER)


def leave(status: int) -> NoReturn:
    """End the process without a last search for garbage.

    With `few_collections` a fifth of the CPU time of a command on a short log: 1.63 s, and 1.27 s
    with both (23 November 2026, two shared cores, Python 3.11; `tirelog tables`, 10 minutes of one
    grating at 1 kHz).
    """
    gc.freeze()
    sys.exit(status)


#: processes that share work now
_PROCESSES = [1]


def share_work(wanted: bool = True) -> None:
    """Let processes share independent work, as many as there are cores; or not.

    For a command, which has the machine for itself: what a library or a campaign's worker does
    stays in one process.
    """
    cores = len(os.sched_getaffinity(0)) if sys.platform == "linux" else 1
    _PROCESSES[0] = min(_MOST_PROCESSES, cores) if wanted else 1


def processes() -> int:
    """How many processes share work."""
    return _PROCESSES[0]


def end_with_parent(parent: int) -> None:
    """End this process at most half a second after its `parent` has ended.

    However that came about. If its parent was killed, a worker would else wait for its next task
    without end, and hold 200 MB.
    """
    if os.getppid() != parent:  # it ended before it could be looked for
        os._exit(1)
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    """End this process when `parent` is no longer its parent."""
    while os.getppid() == parent:
        time.sleep(_LOOK_S)
    os._exit(1)


#: who hears what the process is doing that takes long
_HEAR: list[Callable[[str], None]] = []
#: what ends sooner needs no notice [s]
PATIENCE_S = 2.0


@contextmanager
def hearing(hear: Callable[[str], None]) -> Iterator[None]:
    """Call `hear` with each notice about slow work while open."""
    _HEAR.append(hear)
    try:
        yield
    finally:
        _HEAR.remove(hear)


def notice(text: str) -> None:
    """Give a sentence about slow work to every listener."""
    for hear in tuple(_HEAR):
        hear(text)


@contextmanager
def noticed_wait(text: str) -> Iterator[None]:
    """Give a notice if the work while open takes longer than two seconds."""
    timer = threading.Timer(PATIENCE_S, notice, [text])
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


@cache
def notice_compiling() -> None:
    """Give a notice, once, that kernels are compiled now."""
    notice(
        "compiling kernels, which takes half a minute and is kept for later commands; a C compiler "
        "at the installation avoids it"
    )
