"""A kernel, which is called like the function that it is made of.

arguments --their kinds--> the extension's function for these, else numba's
"""

from __future__ import annotations

from collections.abc import Callable
from functools import update_wrapper
from pathlib import Path
from types import FunctionType
from typing import Any

from tirelog.kernels import built
from tirelog.kernels.kinds import Kind, kind_of, spelled


class Kernel:
    """A compiled function.

    py_func  the function as it is written
    jitted   as numba compiles it; imports numba
    sources  the files that it is compiled from, its own and those of the kernels that it calls
    """

    def __init__(self, source: FunctionType) -> None:
        update_wrapper(self, source)
        self.py_func = source
        self._made: dict[tuple[Kind, ...], Callable[..., Any]] = {}
        self._jitted: Any = None

    @property
    def name(self) -> str:
        """`module:function`."""
        return f"{self.py_func.__module__}:{self.py_func.__qualname__}"

    def __call__(self, *given: Any) -> Any:
        kinds = tuple(map(kind_of, given))
        made = self._made.get(kinds)
        if made is None:
            made = self._made[kinds] = self._found(kinds)
        return made(*given)

    def __reduce__(self) -> str:
        return self.py_func.__qualname__

    def _found(self, kinds: tuple[Kind, ...]) -> Callable[..., Any]:
        text = spelled(kinds)
        there = built.function(self.name, text)
        if there is None:
            built.note_missed(self.name, text)
        return self.jitted if there is None else there

    @property
    def jitted(self) -> Any:
        if self._jitted is None:
            from tirelog.kernels.jit import jit

            self._jitted = jit(self.py_func, self.sources)
        return self._jitted

    @property
    def sources(self) -> frozenset[Path]:
        own = frozenset({Path(self.py_func.__code__.co_filename)})
        called = (self.py_func.__globals__.get(name) for name in self.py_func.__code__.co_names)
        return own.union(*(other.sources for other in called if isinstance(other, Kernel)))

    @property
    def _numba_type_(self) -> Any:
        """What numba takes it for in a kernel that calls it (its protocol for foreign types)."""
        from numba.core import types

        return types.Dispatcher(self.jitted)
