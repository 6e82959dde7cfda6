"""Kernels compiled by numba when they are first called, and kept on disk.

The compiled code lies beside the source, or in the user's cache folder if the installation cannot
be written (NUMBA_CACHE_DIR moves it).

numba knows a cached kernel by its own file only, and reads what it has cached before it looks
whether that is outdated. A kernel is forgotten here if its file, or one whose kernels it calls, was
edited since: else one whose types have other names by now would end the process.

numba takes half a second to start and 75 MB: who needs no kernel of it does not import it.
"""

from __future__ import annotations

import sys
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from types import FunctionType
from typing import Any, cast

from tirelog.runtime import notice_compiling


def jit(source: FunctionType, files: Collection[Path]) -> Any:
    """numba's function of a source, compiled at its first call for the types of its arguments.

    `files` are those that it is compiled from.
    """
    without_blas()
    from numba import njit

    notice_compiling()
    try:
        made = njit(cache=True, error_model="numpy", nogil=True)(source)
    except RuntimeError:  # no folder that could hold the cache: compiled anew in each process
        return njit(error_model="numpy", nogil=True)(source)
    _forget_outdated(source, files, made)
    return made


def without_blas() -> None:
    """Load numba's array functions without scipy's linear algebra, which they look for then.

    No kernel needs it; one that does has numba import it. It is 16 MB, and 5 to 9 % of a command's
    CPU time (22 November 2026, two shared cores, Python 3.11; `tirelog tables` on a run of 4
    gratings, `speed`, `ingest`).
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


def _forget_outdated(source: FunctionType, files: Collection[Path], made: Any) -> None:
    """Remove the cache's index of a kernel if it is older than a file it was compiled from."""
    code, python = source.__code__, sys.version_info
    if made.stats.cache_path is None:
        return
    name = (
        f"{Path(code.co_filename).stem}.{source.__qualname__}-{code.co_firstlineno}"
        f".py{python.major}{python.minor}{getattr(sys, 'abiflags', '')}"
    )
    index = Path(made.stats.cache_path) / f"{name}.nbi"
    with suppress(OSError):  # there is none, or another process was faster
        if index.stat().st_mtime <= max(file.stat().st_mtime for file in files):
            index.unlink()
