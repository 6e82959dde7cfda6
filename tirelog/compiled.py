"""Compiled kernels: a loop over samples that the benchmark shows to matter is compiled by numba, once for each machine.

    @compiled
    def kernel(samples, ...): ...        plain Python on numpy arrays and scalars; called like any function

The compiled code is cached beside the source, or in the user's cache folder where the installation cannot be written (NUMBA_CACHE_DIR moves
it), so that only the very first call on a machine waits for the compiler.  With NUMBA_DISABLE_JIT=1 the same source runs as plain Python:
slower, and the same numbers.  No fast-math: sums keep their order, so results do not depend on the machine's vector width.

numba takes a quarter of a second to import; modules with kernels are imported inside the functions that need them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

from numba import njit

Kernel = TypeVar("Kernel", bound=Callable[..., object])


def compiled(kernel: Kernel) -> Kernel:
    """The kernel, compiled at its first call for the types it is called with; division by zero gives infinity or NaN, as in numpy."""
    try:
        return cast(Kernel, njit(cache=True, error_model="numpy", nogil=True)(kernel))
    except RuntimeError:  # no folder that could hold the cache: compiled anew in each process
        return cast(Kernel, njit(error_model="numpy", nogil=True)(kernel))
