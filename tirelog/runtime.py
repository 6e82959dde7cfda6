"""Settings of the process (threads, allocator, end with its parent), and compiled kernels.

A loop over samples that the benchmark shows to matter is compiled by numba, once for each machine.

    @compiled
    def kernel(samples, ...): ...        plain Python on numpy arrays and scalars; called like any
                                         function

The compiled code is cached beside the source, or in the user's cache folder if the installation
cannot be written (NUMBA_CACHE_DIR moves it), so that only the very first call on a machine waits
for the compiler. With NUMBA_DISABLE_JIT=1 the same source runs as plain Python: slower, and the
same numbers. No fast-math: sums keep their order, so results do not depend on the machine's vector
width.

numba knows a cached kernel by its own file only, and reads what it has cached before it looks
whether that is outdated. A kernel is forgotten here if its file, or one whose kernels it calls, was
edited since: else one whose types have other names by now would end the process.

numba takes half a second to start and 110 MB; modules with kernels are imported inside the
functions that need them.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, NoReturn, TypeVar, cast

#: glibc's number for the most heaps (malloc.h, M_ARENA_MAX)
_MOST_HEAPS = -8
#: glibc's numbers for the free bytes at the end of the heap that go back to the system, and for the
#: size of an array that has memory of its own (malloc.h, M_TRIM_THRESHOLD, M_MMAP_THRESHOLD); and
#: what is set: a block of waveforms is 1.5 MB, and twenty of them are at work at a time
_TRIM, _OWN_MEMORY = -1, -3
_TRIM_BYTES, _OWN_MEMORY_BYTES = 1 << 26, 1 << 22
#: Linux's number for "send me this signal when my parent ends" (sys/prctl.h, PR_SET_PDEATHSIG)
_SIGNAL_WITH_PARENT = 1
#: elsewhere the parent is looked for so often [s]
_LOOK_S = 0.5
#: containers that are made before garbage is looked for among the new ones: some 10 MB
_COLLECT_AFTER = 50_000


def one_thread() -> None:
    """Set one thread for the linear algebra under numpy.

    For commands whose matrices are small and many; a number that the user has set stays.

    With more, the library's threads wait for each other in busy loops: the same wall time at
    several times the CPU time. To be called before numpy is imported.
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
    """What one array has freed, up to 64 MB, serves the next, for the rest of the process.

    For fits, which predict the same block of waveforms some thousand times: else each array of a
    megabyte comes anew from the system, page by page, which is a third of a prediction's time
    (measured with blocks of 96 revolutions, 2026-11; a joint diagnose takes a fifth less).
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
    """End the process without going through all that is left, which it gives back anyway.

    With `few_collections` a fifth of the CPU time of a command on a short log: 1.63 s, and 1.27 s
    with both (23 November 2026, two shared cores, Python 3.11; `tirelog tables`, 10 minutes of one
    grating at 1 kHz).
    """
    gc.freeze()
    sys.exit(status)


def end_with_parent(parent: int) -> None:
    """End this process as soon as the one that started it, `parent`, has ended.

    However that came about. If its parent was killed, a worker would else wait for its next task
    without end, and hold 200 MB.
    """
    if sys.platform == "linux":
        import ctypes

        library = ctypes.CDLL(None)
        if (
            hasattr(library, "prctl")
            and library.prctl(_SIGNAL_WITH_PARENT, int(signal.SIGKILL)) == 0
        ):
            if os.getppid() != parent:  # it ended before it could be asked for
                os._exit(1)
            return
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    """End this process when `parent` is no longer its parent."""
    while os.getppid() == parent:
        time.sleep(_LOOK_S)
    os._exit(1)


Kernel = TypeVar("Kernel", bound=Callable[..., object])

#: what a compiled kernel carries: the source files that it is compiled from
_SOURCES = "tirelog_sources"


def compiled(kernel: Kernel) -> Kernel:
    """The kernel, compiled at its first call for the types it is called with.

    Division by zero gives infinity or NaN, as in numpy.
    """
    _numba_without_blas()
    from numba import njit

    try:
        made = njit(cache=True, error_model="numpy", nogil=True)(kernel)
    except RuntimeError:  # no folder that could hold the cache: compiled anew in each process
        made = njit(error_model="numpy", nogil=True)(kernel)
    if made is not kernel:  # else compiling is switched off
        _forget_outdated(kernel, made)
    return cast(Kernel, made)


def _numba_without_blas() -> None:
    """Load numba's array functions without scipy's linear algebra, which they look for then.

    No kernel needs it; one that does has numba import it. It keeps the tables of an hour's run
    within their 300 MB: 294 MB, else 310; and every command costs 5 to 9 % less CPU (22 November
    2026, two shared cores, Python 3.11; `tirelog tables` on a run of 4 gratings, `speed`,
    `ingest`).
    """
    blas = "scipy.linalg.cython_blas"
    if blas in sys.modules or "numba.np.arraymath" in sys.modules:
        return
    modules = cast(dict[str, Any], sys.modules)
    modules[blas] = None  # for Python: not there (its reference, 5.3.1 "The module cache")
    try:
        import numba.np.arraymath  # noqa: F401
    finally:
        del modules[blas]


def _forget_outdated(kernel: Any, made: Any) -> None:
    """Remove the cache's index of a kernel if it is older than a file it was compiled from."""
    own = Path(kernel.__code__.co_filename)
    called = (kernel.__globals__.get(name) for name in kernel.__code__.co_names)
    sources = frozenset({own}).union(*(_sources_of(other) for other in called))
    setattr(made, _SOURCES, sources)
    if made.stats.cache_path is None:
        return
    line, python = kernel.__code__.co_firstlineno, sys.version_info
    name = f"{own.stem}.{kernel.__qualname__}-{line}.py{python.major}{python.minor}{sys.abiflags}"
    index = Path(made.stats.cache_path) / f"{name}.nbi"
    with suppress(OSError):  # there is none, or another process was faster
        if index.stat().st_mtime <= max(source.stat().st_mtime for source in sources):
            index.unlink()


def _sources_of(called: Any) -> frozenset[Path]:
    """The files of what a kernel calls.

    Another kernel, or a plain function that numba was taught to compile.
    """
    plain = {Path(called.__code__.co_filename)} if hasattr(called, "__code__") else ()
    sources: frozenset[Path] = getattr(called, _SOURCES, frozenset(plain))
    return sources


def hear_of_compiling(told: Callable[[bool], None]) -> Callable[[], None]:
    """Have it told when kernels begin to be compiled, and when they are; what ends that."""
    if "numba" not in sys.modules:
        return lambda: None
    from numba.core import event

    class Compiling(event.Listener):
        """Told by numba when it begins, and when it has done."""

        def on_start(self, event: object) -> None:
            told(True)

        def on_end(self, event: object) -> None:
            told(False)

    listener = Compiling()
    event.register("numba:compile", listener)
    return lambda: event.unregister("numba:compile", listener)
