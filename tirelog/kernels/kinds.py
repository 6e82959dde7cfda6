"""Kinds of arguments: what a kernel is compiled for, as a key, as text, and by an example.

An array's kind is its type, its number of dimensions, its order in memory and whether it may be
written; a tuple's the kinds of its parts, and a named tuple's its class beside them.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from importlib import import_module
from typing import Any, TypeAlias

import numpy as np

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
    if first is tuple:
        return {"tuple": [_spelled(part) for part in rest]}
    if isinstance(first, type):
        return {"named": _name(first), "parts": [_spelled(part) for part in rest]}
    if first == _BY_DTYPE and isinstance(first, str):
        return {"scalar": _type(rest[0])}
    dimensions, order, writeable = rest
    return {"array": _type(first), "dimensions": dimensions, "order": order, "written": writeable}


def _type(dtype: np.dtype[Any]) -> Any:
    """An array's type as text, or that of its rows with the place of each field."""
    if dtype.fields is None:
        return dtype.str
    return {
        "names": list(dtype.fields),
        "formats": [_type(field[0]) for field in dtype.fields.values()],
        "offsets": [field[1] for field in dtype.fields.values()],
        "itemsize": dtype.itemsize,
        "aligned": dtype.isalignedstruct,
    }


def _dtype(told: Any) -> np.dtype[Any]:
    if isinstance(told, str):
        return np.dtype(told)
    fields: Any = {**told, "formats": [_dtype(one) for one in told["formats"]]}
    aligned = bool(fields.pop("aligned"))
    made: np.dtype[Any] = np.dtype(fields, align=aligned)
    return made


def _name(of: type) -> str:
    return f"{of.__module__}:{of.__qualname__}"


def examples(text: str) -> tuple[Any, ...]:
    """Arguments of the kinds that a text of `spelled` tells.

    ValueError: of a kind that no example can be made of.
    """
    return tuple(_example(told) for told in json.loads(text))


def _example(told: Any) -> Any:
    if isinstance(told, str):
        return _EXAMPLES[told]
    if "tuple" in told:
        return tuple(_example(part) for part in told["tuple"])
    if "named" in told:
        module, _, name = told["named"].partition(":")
        return getattr(import_module(module), name)(*(_example(part) for part in told["parts"]))
    if "scalar" in told:
        return np.zeros(1, _dtype(told["scalar"]))[0]
    if "array" not in told:
        raise ValueError(f"no example of {told}")
    order, dimensions = told["order"], told["dimensions"]
    # every second of four, along each dimension, is in no order
    shape = (4,) * dimensions if order == "A" else (2,) * dimensions
    array = np.zeros(shape, _dtype(told["array"]), order="F" if order == "F" else "C")
    if order == "A":
        array = array[(slice(None, None, 2),) * dimensions]
    array.flags.writeable = told["written"]
    return array
