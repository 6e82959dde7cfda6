"""What the process of a command is told about itself before it begins."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time

#: glibc's number for the most heaps (malloc.h, M_ARENA_MAX)
_MOST_HEAPS = -8
#: Linux's number for "send me this signal when my parent ends" (sys/prctl.h, PR_SET_PDEATHSIG)
_SIGNAL_WITH_PARENT = 1
#: elsewhere the parent is looked for so often [s]
_LOOK_S = 0.5


def one_thread() -> None:
    """One thread for the linear algebra under numpy, for commands whose matrices are small and many; a number that the user has set stays.

    With more, the library's threads wait for each other in busy loops: the same wall time at several times the CPU time.
    To be called before numpy is imported.
    """
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")


def one_heap() -> None:
    """One heap for all threads: what one has freed serves the next.  To be called before the first thread is started.

    With a heap for each, those of the readers keep up to 80 MB that the estimators then take once more.  Other libraries than glibc have
    no such number, or no such habit.
    """
    if sys.platform == "linux" and "MALLOC_ARENA_MAX" not in os.environ:
        import ctypes

        library = ctypes.CDLL(None)
        if hasattr(library, "mallopt"):
            library.mallopt(_MOST_HEAPS, 1)


def end_with_parent(parent: int) -> None:
    """End this process as soon as the one that started it, `parent`, has ended, however that came about.

    A worker waits for its next task without end, and holds 200 MB, where its parent was killed.
    """
    if sys.platform == "linux":
        import ctypes

        library = ctypes.CDLL(None)
        if hasattr(library, "prctl") and library.prctl(_SIGNAL_WITH_PARENT, int(signal.SIGKILL)) == 0:
            if os.getppid() != parent:  # it ended before it could be asked for
                os._exit(1)
            return
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    """End this process when `parent` is no longer its parent."""
    while os.getppid() == parent:
        time.sleep(_LOOK_S)
    os._exit(1)
