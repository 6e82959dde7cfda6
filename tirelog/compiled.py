"""Compiled kernels: a loop over samples that the benchmark shows to matter is compiled by numba, once for each machine.

    @compiled
    def kernel(samples, ...): ...        plain Python on numpy arrays, numbers and tuples of them; called like any function

The first call on a machine waits for the compiler, and the machine code is kept (`machine_code`); later processes load that without
importing numba, which would cost half a second and 80 MB.  Kernels may call kernels of other modules: what is kept is known by the code of
all of them, and by the constants that they use.  With NUMBA_DISABLE_JIT=1 the same source runs as plain Python: slower, and the same
numbers.  No fast-math: sums keep their order, so results do not depend on the machine's vector width.
"""

from __future__ import annotations

import functools
import hashlib
import inspect
import os
from collections.abc import Callable
from threading import RLock
from types import CodeType, FunctionType
from typing import TYPE_CHECKING, Any, TypeVar, cast

if TYPE_CHECKING:
    from tirelog.machine_code import Entry

Kernel = TypeVar("Kernel", bound=Callable[..., object])

_ARRAY_FLAGS = 0x1 | 0x2 | 0x100 | 0x400  # C and Fortran order, aligned, writeable
_LOCK = RLock()


def compiled(kernel: Kernel) -> Kernel:
    """The kernel, compiled at its first call for the types it is called with; division by zero gives infinity or NaN, as in numpy.

    A returned array is the caller's own.
    """
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return kernel
    assert isinstance(kernel, FunctionType)
    return cast(Kernel, CompiledKernel(kernel))


class CompiledKernel:
    """A kernel with the machine code for each set of types that it was called with."""

    def __init__(self, function: FunctionType) -> None:
        self.function = function
        self._ready: dict[tuple[Any, ...], Entry] = {}
        functools.update_wrapper(self, function)

    @property
    def name(self) -> str:
        return f"{self.function.__module__}.{self.function.__qualname__}"

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        if named or len(arguments) != self.function.__code__.co_argcount:
            bound = inspect.signature(self.function).bind(*arguments, **named)
            bound.apply_defaults()
            arguments = bound.args
        kinds = tuple([_kind(value) for value in arguments])
        entry = self._ready.get(kinds)
        if entry is None:
            with _LOCK:
                entry = self._ready.get(kinds) or self._made_ready(kinds, arguments)
        return entry(arguments)

    def _made_ready(self, kinds: tuple[Any, ...], arguments: tuple[Any, ...]) -> Entry:
        """The machine code for these types: kept from an earlier process, or made now."""
        from tirelog import machine_code

        self._ready[kinds] = entry = machine_code.entry(self, arguments)
        return entry

    @functools.cached_property
    def fingerprint(self) -> str:
        """Changes with whatever the kernel is compiled from: its code, the constants it uses, and the kernels it calls."""
        seen: dict[int, CompiledKernel] = {}
        _collect(self, seen)
        parts = sorted(f"{k.name} {_own_print(k.function)}" for k in seen.values())
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _kind(value: Any) -> Any:
    """What the machine code depends on in an argument."""
    try:
        return value.dtype, value.ndim, value.flags.num & _ARRAY_FLAGS
    except AttributeError:
        return tuple([_kind(item) for item in value]) if isinstance(value, tuple) else type(value)


def _used(function: FunctionType) -> dict[str, Any]:
    """The globals and cells that a function names, with those of the functions inside it."""
    names: set[str] = set()
    waiting = [function.__code__]
    while waiting:
        code = waiting.pop()
        names |= set(code.co_names)
        waiting += [const for const in code.co_consts if isinstance(const, CodeType)]
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    return {name: function.__globals__[name] for name in names if name in function.__globals__} | {n: c.cell_contents for n, c in cells}


def _collect(kernel: CompiledKernel, seen: dict[int, CompiledKernel]) -> None:
    """`kernel` and all that it calls."""
    if id(kernel) not in seen:
        seen[id(kernel)] = kernel
        for value in _used(kernel.function).values():
            if isinstance(value, CompiledKernel):
                _collect(value, seen)


def _own_print(function: FunctionType) -> str:
    """The function's code and the constants it reads, as text that is the same in every process."""
    constants: list[tuple[Any, ...]] = []
    for name, value in sorted(_used(function).items()):
        if hasattr(value, "tobytes"):  # an array, or a number of numpy's
            constants.append((name, str(value.dtype), getattr(value, "shape", ()), value.tobytes()))
        elif isinstance(value, (bool, int, float, complex, str, bytes, tuple)):
            constants.append((name, repr(value)))
    return repr((_code_print(function.__code__), constants, function.__defaults__))


def _code_print(code: CodeType) -> tuple[Any, ...]:
    consts = tuple(_code_print(const) if isinstance(const, CodeType) else repr(const) for const in code.co_consts)
    return code.co_code, consts, code.co_names, code.co_varnames
