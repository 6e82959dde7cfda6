"""Threads of the linear algebra under numpy: one, for commands whose matrices are small and many.

With more, the library's threads wait for each other in busy loops: the same wall time at several times the CPU time.
"""

from __future__ import annotations

import os


def one_thread() -> None:
    """To be called before numpy is imported; a number that the user has set stays."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
