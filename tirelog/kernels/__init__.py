"""Loops over samples that the benchmark shows to matter, compiled.

    @compiled
    def kernel(samples, ...): ...        plain Python on numpy arrays and scalars; called like any
                                         function

Kernels are compiled when the package is installed, to an extension of this folder that needs no
compiler and no numba any more (`build`): a command then starts half a second earlier, holds 75 MB
less, and the first one after an installation is as quick as the second. numba compiles what the
extension lacks at its first call, and keeps it beside the source or in the user's cache folder
(`jit`). This happens without a C compiler, after an edit of a kernel's file, and for arguments of
another kind.

With NUMBA_DISABLE_JIT=1 the same source runs as plain Python: slower, and the same numbers. No
fast-math: sums keep their order, so results do not depend on the machine's vector width.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from types import FunctionType
from typing import TypeVar, cast

from tirelog.kernels.dispatch import Kernel

Source = TypeVar("Source", bound=Callable[..., object])


def compiled(source: Source) -> Source:
    """The compiled function, with the same arguments and result.

    Division by zero gives infinity or NaN, as in numpy; other threads go on meanwhile.
    """
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return source
    return cast(Source, Kernel(cast(FunctionType, source)))
