"""The machine code of compiled kernels, kept on disk: made once by numba, loaded by llvmlite alone.

    kernel, arguments --Entry on file?--> llvmlite loads it --> called by ctypes, with numba's own calling convention
                      --else-- numba compiles it --> an object file in the cache, a checksum and a line of JSON before it

The cache is NUMBA_CACHE_DIR, else beside the source (__pycache__), else in the user's cache folder; an entry's name holds what it was made
of and for: the kernel and those it calls, types, processor, versions.  Where anything of this does not work, numba's own way does: slower
to start, and the same code.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib.util
import json
import os
import platform
import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import cache, cached_property
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from tirelog.compiled import CompiledKernel

Entry = Callable[[Sequence[Any]], Any]

_OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True}
_NUMBERS: dict[str, Any] = {
    "?": ctypes.c_uint8, "b": ctypes.c_int8, "B": ctypes.c_uint8, "h": ctypes.c_int16, "H": ctypes.c_uint16, "i": ctypes.c_int32,
    "I": ctypes.c_uint32, "l": ctypes.c_int64, "L": ctypes.c_uint64, "f": ctypes.c_float, "d": ctypes.c_double,
}  # fmt: skip
#: functions of numba's runtime that machine code may call; without them it does not allocate
_RUNTIME = {"NRT_MemInfo_alloc_aligned": "MemInfo_alloc_aligned", "NRT_MemInfo_call_dtor": "MemInfo_call_dtor"}
#: what needs the interpreter, or more of numba
_FOREIGN = ("Py", "_Py", "numba", "NRT")
#: an entry that says that the kernel is one for numba
_UNFIT = b"{}\n"


class _Unfit(Exception):
    """This kernel needs more of numba than is kept."""


def entry(kernel: CompiledKernel, arguments: Sequence[Any]) -> Entry:
    """The kernel's machine code for arguments like these."""
    try:
        types = "(" + ",".join(_type(value) for value in arguments) + ")"
        file = _file(kernel, types)
    except (_Unfit, OSError, ImportError):
        return _by_numba(kernel)
    kept = _read(file)
    if kept is None:
        try:
            kept = _made(kernel, arguments)
        except _Unfit:
            kept = _UNFIT
        _write(file, kept)
    return _by_numba(kernel) if kept == _UNFIT else _Loaded(kept, kernel).call


def _by_numba(kernel: CompiledKernel) -> Entry:
    """The kernel as numba calls it, with numba's own cache."""
    from numba import njit

    _dispatcher(kernel)  # numba learns what a kernel is that is called by another
    try:
        whole = njit(cache=True, **_OPTIONS)(kernel.function)
    except RuntimeError:  # no folder that could hold the cache: compiled anew in each process
        whole = njit(**_OPTIONS)(kernel.function)
    return lambda arguments: whole(*arguments)


# ---- what an entry is known by


def _type(value: Any) -> str:
    """An argument's type in a word."""
    if isinstance(value, np.ndarray):
        if value.dtype.hasobject or value.dtype.names:
            raise _Unfit
        flags = value.flags
        layout = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
        return f"{value.dtype.str}{value.ndim}{layout}{'w' if flags.writeable else 'r'}{'' if flags.aligned else 'u'}"
    if isinstance(value, tuple):
        return "(" + ",".join(_type(item) for item in value) + ")"
    return _number(value)


def _number(value: Any) -> str:
    """A number's type as numpy's letter."""
    if isinstance(value, bool):
        return "?"
    if isinstance(value, int) and -(2**63) <= value < 2**63:
        return "l"
    if isinstance(value, float):
        return "d"
    if isinstance(value, np.generic) and value.dtype.char in _NUMBERS:
        return value.dtype.char
    raise _Unfit


@cache
def _processor() -> str:
    """What the machine code is for, and made by."""
    import llvmlite
    import llvmlite.binding as llvm

    found = importlib.util.find_spec("numba")
    if found is None or found.origin is None:
        raise _Unfit
    version = Path(found.origin).with_name("_version.py").read_bytes()
    features = llvm.get_host_cpu_features().flatten()
    parts = (platform.machine(), llvm.get_host_cpu_name(), features, llvmlite.__version__, np.__version__, sys.version)
    return hashlib.sha256(repr((*parts, version)).encode()).hexdigest()


def _file(kernel: CompiledKernel, types: str) -> Path:
    """Where the entry is kept."""
    key = hashlib.sha256(f"{kernel.fingerprint} {types} {_processor()}".encode()).hexdigest()[:20]
    return _folder(kernel.function.__code__.co_filename) / f"{kernel.name}-{key}.code"


@cache
def _folder(source: str) -> Path:
    """A folder that can be written."""
    beside = Path(source).with_name("__pycache__")
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "tirelog"
    for folder in [Path(chosen)] if chosen else [beside, home]:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK) or any(folder.glob("*.code")):
            return folder
    raise _Unfit


def _read(file: Path) -> bytes | None:
    """An entry, None where there is none or its checksum, the first 32 bytes, is wrong."""
    try:
        whole = file.read_bytes()
    except OSError:
        return None
    return whole[32:] if hashlib.sha256(whole[32:]).digest() == whole[:32] else None


def _write(file: Path, kept: bytes) -> None:
    """The whole entry at once: other processes may be doing the same."""
    try:
        handle, name = tempfile.mkstemp(dir=file.parent, suffix=".part")
        with os.fdopen(handle, "wb") as part:
            part.write(hashlib.sha256(kept).digest() + kept)
        os.replace(name, file)
    except OSError:
        pass  # made again by the next process


# ---- made by numba


@cache
def _known_to_numba() -> None:
    """Tell numba that a kernel that is called by another is its own kind of function."""
    from numba import types
    from numba.extending import typeof_impl

    from tirelog.compiled import CompiledKernel

    @typeof_impl.register(CompiledKernel)
    def _(value: CompiledKernel, context: Any) -> Any:
        return types.Dispatcher(_dispatcher(value))


_DISPATCHERS: dict[CompiledKernel, Any] = {}


def _dispatcher(kernel: CompiledKernel) -> Any:
    """The kernel as numba compiles it."""
    from numba import njit

    _known_to_numba()
    if kernel not in _DISPATCHERS:
        _DISPATCHERS[kernel] = njit(**_OPTIONS)(kernel.function)
    return _DISPATCHERS[kernel]


def _made(kernel: CompiledKernel, arguments: Sequence[Any]) -> bytes:
    """The entry: what it is called and returns as a line of JSON, and the object file."""
    import numba

    dispatcher = _dispatcher(kernel)
    signature = tuple(numba.typeof(value) for value in arguments)
    dispatcher.compile(signature)
    overload = dispatcher.overloads[signature]
    about = {"symbol": overload.fndesc.mangled_name, "returns": _returned(overload.signature.return_type)}
    try:
        return json.dumps(about).encode() + b"\n" + _object_file(overload.library, about["symbol"])
    except (AttributeError, RuntimeError, TypeError) as changed:  # another numba than those this was written for
        raise _Unfit from changed


def _object_file(library: Any, symbol: str) -> bytes:
    """The library's machine code with `symbol` as the only way in, and nothing that it does not need."""
    import llvmlite.binding as llvm

    module = llvm.parse_bitcode(library._final_module.as_bitcode())
    for function in module.functions:
        if not function.is_declaration and function.name != symbol:
            function.linkage = "internal"
    machine = _target_machine()
    passes = llvm.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    passes.run(module, llvm.create_pass_builder(machine, llvm.PipelineTuningOptions()))
    outside = {f.name for f in module.functions if f.is_declaration and not f.name.startswith("llvm.")} - set(_RUNTIME)
    if any(name.startswith(_FOREIGN) or llvm.address_of_symbol(name) is None for name in outside):
        raise _Unfit
    return bytes(machine.emit_object(module))


def _returned(type: Any) -> Any:
    """A returned type in JSON: null, a number's letter, [dtype, dimensions] of an array, or {"tuple": [...]}."""
    from numba import types
    from numba.np.numpy_support import as_dtype

    if isinstance(type, types.NoneType):
        return None
    if isinstance(type, (types.Boolean, types.Integer, types.Float)):
        return as_dtype(type).char
    if isinstance(type, types.Array) and type.layout == "C":
        return [as_dtype(type.dtype).str, type.ndim]
    if isinstance(type, (types.UniTuple, types.Tuple)):
        return {"tuple": [_returned(item) for item in type]}
    raise _Unfit


# ---- loaded


def _target_machine() -> Any:
    """This processor, for one use: an engine keeps what it is given."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_default_triple()
    features = llvm.get_host_cpu_features().flatten()
    return target.create_target_machine(llvm.get_host_cpu_name(), features, 3, "default", "jitdefault", jit=True)


@cache
def _runtime() -> Any:
    """numba's memory runtime: an extension module that stands alone, loaded without the package around it."""
    import llvmlite.binding as llvm

    found = importlib.util.find_spec("numba")
    assert found is not None
    assert found.origin is not None
    folder = Path(found.origin).parent / "core" / "runtime"
    path = next(folder / f"_nrt_python{end}" for end in EXTENSION_SUFFIXES if (folder / f"_nrt_python{end}").exists())
    loader = ExtensionFileLoader("numba.core.runtime._nrt_python", str(path))
    spec = importlib.util.spec_from_loader(loader.name, loader)
    assert spec is not None
    runtime = sys.modules.get(loader.name) or importlib.util.module_from_spec(spec)
    for symbol, name in _RUNTIME.items():
        llvm.add_symbol(symbol, runtime.c_helpers[name])
    return runtime


class _Loaded:
    """An entry in memory."""

    def __init__(self, kept: bytes, kernel: CompiledKernel) -> None:
        import llvmlite.binding as llvm

        header, _, code = kept.partition(b"\n")
        about = json.loads(header)
        _runtime()
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target_machine())
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        self._engine.finalize_object()
        self._address = self._engine.get_function_address(about["symbol"])
        self._kernel = kernel
        self._returns = about["returns"]
        self._function: Any = None

    @cached_property
    def _result(self) -> type[ctypes.Structure]:
        return type("Result", (ctypes.Structure,), {"_fields_": [("value", _c_type(self._returns))]})

    def call(self, arguments: Sequence[Any]) -> Any:
        """The kernel's result for `arguments`, which are of the types that the entry was made for."""
        if self._function is None:
            kinds = [kind for value in arguments for kind in _c_types(value)]
            self._function = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, *kinds)(self._address)
        passed: list[Any] = []
        for value in arguments:
            _pass(value, passed)
        result, problem = self._result(), ctypes.c_void_p()
        status = self._function(ctypes.addressof(result), ctypes.addressof(problem), *passed)
        if status != 0:
            return _by_numba(self._kernel)(arguments)  # which raises what the kernel raised
        return None if self._returns is None else _taken(result.value, self._returns)


def _c_types(value: Any) -> list[Any]:
    """An argument's parts as numba passes them: of an array owner, parent, items, bytes an item, data, shape, strides."""
    if isinstance(value, np.ndarray):
        return [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_ssize_t, ctypes.c_ssize_t, ctypes.c_void_p, *[ctypes.c_ssize_t] * 2 * value.ndim]
    if isinstance(value, tuple):
        return [kind for item in value for kind in _c_types(item)]
    return [_NUMBERS[_number(value)]]


def _pass(value: Any, passed: list[Any]) -> None:
    """Append an argument's parts."""
    if isinstance(value, np.ndarray):
        passed += (None, None, value.size, value.itemsize, value.__array_interface__["data"][0], *value.shape, *value.strides)
    elif isinstance(value, tuple):
        for item in value:
            _pass(item, passed)
    else:
        passed.append(value.item() if isinstance(value, np.generic) else value)


def _c_type(returns: Any) -> Any:
    """The C type of what is returned."""
    if returns is None:
        return ctypes.c_void_p
    if isinstance(returns, str):
        return _NUMBERS[returns]
    if isinstance(returns, dict):
        parts = [(f"_{k}", _c_type(item)) for k, item in enumerate(returns["tuple"])]
        return type("Tuple", (ctypes.Structure,), {"_fields_": parts})
    many = ctypes.c_ssize_t * returns[1]
    parts = [("owner", ctypes.c_void_p), ("parent", ctypes.c_void_p), ("size", ctypes.c_ssize_t), ("item", ctypes.c_ssize_t),
             ("data", ctypes.c_void_p), ("shape", many), ("strides", many)]  # fmt: skip
    return type("Array", (ctypes.Structure,), {"_fields_": parts})


def _taken(value: Any, returns: Any) -> Any:
    """What was returned, as Python's; arrays are copied and given back."""
    if isinstance(returns, str):
        return bool(value) if returns == "?" else value
    if isinstance(returns, dict):
        return tuple([_taken(getattr(value, f"_{k}"), item) for k, item in enumerate(returns["tuple"])])
    array = np.empty(tuple(value.shape), np.dtype(returns[0]))
    if array.size:
        ctypes.memmove(array.ctypes.data, value.data, array.nbytes)
    if value.owner:
        count = ctypes.c_size_t.from_address(value.owner)
        count.value -= 1
        if count.value == 0:
            ctypes.CFUNCTYPE(None, ctypes.c_void_p)(_runtime().c_helpers["MemInfo_call_dtor"])(value.owner)
    return array
