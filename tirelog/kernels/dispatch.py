"""Kinds of arguments: what a kernel is compiled for, as a key, as text, and by an example.

An array's kind is its type, its number of dimensions, its order in memory and whether it may be
written; a named tuple's its class and the kinds of its parts.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Collection, Iterable
from contextlib import suppress
from functools import cache, update_wrapper
from hashlib import blake2b
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from pkgutil import resolve_name
from threading import Lock
from types import FunctionType
from typing import Any, TypeAlias

import numpy as np
from numpy.lib.format import descr_to_dtype, dtype_to_descr

from tirelog.runtime import notice_compiling

# ---- The extension that kernels were compiled to when the package was installed.
#
#     _built.EXT   one function for each kernel and kind of arguments
#     _built.json  their names, and of which sources it was made
#
# It is used if all of its sources are as they were, to the byte: not after an edit of one of them
# in a folder that the package is installed from.


#: the folder of the package, in which sources are named by their paths
PACKAGE = Path(__file__).resolve().parents[1]
#: the extension's name as a module, which names the function that sets it up
MODULE = "_built"
#: the extension of the Python that runs; the longest name is that of this version alone
EXTENSION = PACKAGE / "kernels" / f"{MODULE}{max(EXTENSION_SUFFIXES, key=len)}"
#: names of its functions, and hashes of its sources
TABLE = PACKAGE / "kernels" / f"{MODULE}.json"


def function(kernel: str, kinds: str) -> Callable[..., Any] | None:
    """The function of a `kernel` for arguments of these `kinds`; None if there is none."""
    with _LOCK:  # threads that call their first kernels at the same time
        module, symbols = _loaded()
    symbol = symbols.get(kernel, {}).get(kinds)
    return None if symbol is None else getattr(module, symbol)


def fingerprints(sources: Iterable[str]) -> dict[str, str]:
    """A hash of each source, by its path in the package."""
    return {
        name: blake2b((PACKAGE / name).read_bytes(), digest_size=16).hexdigest()
        for name in sorted(sources)
    }


_LOCK = Lock()


@cache
def _loaded() -> tuple[Any, dict[str, dict[str, str]]]:
    """The extension and its functions' names by kernel; none if it is out of date."""
    with suppress(OSError, ValueError, KeyError, TypeError, ImportError):
        table = json.loads(TABLE.read_text(encoding="utf-8"))
        made_of: dict[str, str] = table["sources"]
        if table["extension"] == EXTENSION.name and fingerprints(made_of) == made_of:
            # under a name without a dot, which is that of the function that sets it up
            spec = spec_from_file_location(MODULE, EXTENSION)
            if spec is not None and spec.loader is not None:
                module = module_from_spec(spec)
                spec.loader.exec_module(module)
                return module, dict(table["functions"])
    return None, {}


# ---- Kernels compiled by numba when they are first called, and kept on disk.
#
# The compiled code lies beside the source, or in the user's cache folder if the installation cannot
# be written (NUMBA_CACHE_DIR moves it).
#
# numba knows a cached kernel by its own file only, and reads what it has cached before it looks
# whether that is outdated. A kernel is forgotten here if its file, or one whose kernels it calls,
# was edited since: else one whose types have other names by now would end the process.
#
# numba takes half a second to start and 75 MB: who needs no kernel of it does not import it.


def jit(source: FunctionType, files: Collection[Path]) -> Any:
    """numba's function of a source, compiled at its first call for the types of its arguments.

    `files` are those that it is compiled from.
    """
    from numba import njit

    try:
        made = njit(cache=True, error_model="numpy", nogil=True)(source)
    except RuntimeError:  # no folder that could hold the cache: compiled anew in each process
        notice_compiling()
        return njit(error_model="numpy", nogil=True)(source)
    # the cache's index of the kernel is removed if it is older than a file it was made from
    code, python = source.__code__, sys.version_info
    name = (
        f"{Path(code.co_filename).stem}.{source.__qualname__}-{code.co_firstlineno}"
        f".py{python.major}{python.minor}{getattr(sys, 'abiflags', '')}"
    )
    index = Path(str(made.stats.cache_path)) / f"{name}.nbi"
    edited = max(file.stat().st_mtime for file in files)
    if not index.exists() or index.stat().st_mtime <= edited:
        notice_compiling()
        index.unlink(missing_ok=True)
    return made


Kind: TypeAlias = Any

#: Python's numbers and those of numpy that are compiled alike
_SIMPLE: dict[type, str] = {
    bool: "bool",
    np.bool_: "bool",
    int: "int",
    np.int64: "int",
    float: "float",
    np.float64: "float",
    type(None): "none",
}
#: an argument of each of these kinds
_EXAMPLES: dict[str, object] = {"bool": True, "int": 1, "float": 1.0, "none": None}
#: begins the kind of any other number, and of a row of a structured array
_BY_DTYPE = "scalar"


def kind_of(given: Any) -> Kind:
    """The kind of an argument: what can be looked up quickly."""
    of = type(given)
    if of is np.ndarray:
        flags = given.flags
        order = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
        return given.dtype, given.ndim, order, flags.writeable
    simple = _SIMPLE.get(of)
    if simple is not None:
        return simple
    if isinstance(given, tuple):
        return of, *map(kind_of, given)
    # a number of numpy, or a row of a structured array; of all else there is no second of its kind
    return (_BY_DTYPE, given.dtype) if isinstance(given, np.generic) else of


def spelled(kinds: Iterable[Kind]) -> str:
    """The kinds of a call's arguments as one text, which `examples` reads."""
    return json.dumps([_spelled(kind) for kind in kinds])


def _spelled(kind: Kind) -> Any:
    if isinstance(kind, str):
        return kind
    if isinstance(kind, type):
        return {"other": _name(kind)}
    first, *rest = kind
    if isinstance(first, type):
        return {"named": _name(first), "parts": [_spelled(part) for part in rest]}
    if first == _BY_DTYPE and isinstance(first, str):
        return {"scalar": dtype_to_descr(rest[0])}
    dimensions, order, writeable = rest
    array = dtype_to_descr(first)
    return {"array": array, "dimensions": dimensions, "order": order, "written": writeable}


def _name(of: type) -> str:
    return f"{of.__module__}:{of.__qualname__}"


def examples(text: str) -> tuple[Any, ...]:
    """Example arguments of the kinds in a text of `spelled`.

    ValueError: of a kind that no example can be made of.
    """
    return tuple(_example(told) for told in json.loads(text))


def _example(told: Any) -> Any:
    if isinstance(told, str):
        return _EXAMPLES[told]
    if "named" in told:
        return resolve_name(told["named"])._make(map(_example, told["parts"]))
    if "scalar" in told:
        return np.zeros(1, descr_to_dtype(told["scalar"]))[0]
    if "array" not in told:
        raise ValueError(f"no example of {told}")
    order, dimensions = told["order"], told["dimensions"]
    # every second of four, along each dimension, is in no order
    shape = (4,) * dimensions if order == "A" else (2,) * dimensions
    array = np.zeros(shape, descr_to_dtype(told["array"]), order="F" if order == "F" else "C")
    if order == "A":
        array = array[(slice(None, None, 2),) * dimensions]
    array.flags.writeable = told["written"]
    return array


# ---- A kernel, which is called like the function that it is made of.
#
# arguments --their kinds--> the extension's function for these, else numba's


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
        there = function(self.name, spelled(kinds))
        return self.jitted if there is None else there

    @property
    def jitted(self) -> Any:
        if self._jitted is None:
            self._jitted = jit(self.py_func, self.sources)
        return self._jitted

    @property
    def sources(self) -> frozenset[Path]:
        own = frozenset({Path(self.py_func.__code__.co_filename)})
        called = (self.py_func.__globals__.get(name) for name in self.py_func.__code__.co_names)
        return own.union(*(other.sources for other in called if isinstance(other, Kernel)))

    @property
    def _numba_type_(self) -> Any:
        """Its type for numba in a kernel that calls it (protocol of foreign types)."""
        from numba.core import types

        return types.Dispatcher(self.jitted)
