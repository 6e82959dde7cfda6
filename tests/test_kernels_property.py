"""Property: every compiled kernel of the package gives what the same source gives as plain Python.

The kernels are found in the package; `kernel_inputs` has what each is called with. One that is not
registered there fails, and so does an entry whose kernel is gone. Results, and every array that is
handed over, agree to the bit, signs of zero included. No kernel has fast-math, so no sum is
reordered; but one with a power, a sine or the like takes it from another library when compiled, and
is allowed a rounding (`rounds`).
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from copy import deepcopy
from functools import cache
from importlib import import_module
from inspect import getsource
from pathlib import Path
from textwrap import dedent
from typing import Any

import numpy as np
import pytest

from tests.kernel_inputs import UNSET, inputs
from tirelog.kernels.dispatch import Kernel

numba = pytest.importorskip("numba")
if numba.config.DISABLE_JIT:
    pytest.skip("compiling is switched off: both are plain Python", allow_module_level=True)

PACKAGE = Path(__file__).parents[1] / "tirelog"
#: of the largest number in the array: rounding of one operation, some thousand times over
ROUNDING = 1e-12
#: functions that numpy, Python and the compiler each take from a library of their own
ELEMENTARY = {"sin", "cos", "tan", "exp", "arctan", "arccos", "inv"}


def decorated() -> Iterator[tuple[str, str]]:
    """(module, function) of every function of the package that is marked as compiled."""
    for path in sorted(PACKAGE.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if not re.search(r"@\w*\.?(compiled|n?jit|vectorize|guvectorize)\b", text):
            continue
        module = ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)
        for node in ast.walk(ast.parse(text)):
            for mark in getattr(node, "decorator_list", ()):
                name = ast.unparse(mark).split("(")[0].split(".")[-1]
                if name in ("compiled", "njit", "jit", "vectorize", "guvectorize"):
                    yield module, node.name  # type: ignore[attr-defined]


@cache
def kernels() -> dict[str, Any]:
    """Every kernel by its name in the package, as `strain.dissipation.revolution_sums`."""
    return {
        f"{module}.{name}".removeprefix("tirelog."): getattr(import_module(module), name)
        for module, name in decorated()
    }


def rounds(kernel: Any) -> bool:
    """True if a kernel takes powers, elementary functions or complex products."""
    nodes = list(ast.walk(ast.parse(dedent(getsource(kernel.py_func)))))
    called = {ast.unparse(node.func).split(".")[-1] for node in nodes if isinstance(node, ast.Call)}
    return (
        any(isinstance(node, ast.Pow) for node in nodes)
        or bool(called & ELEMENTARY)
        or "Complex" in str(kernel.py_func.__annotations__)
    )


def test_every_kernel_is_found_and_has_inputs() -> None:
    found = kernels()
    assert len(found) > 50
    assert [name for name, kernel in found.items() if not hasattr(kernel, "py_func")] == []
    modules = {name.rpartition(".")[0] for name in found}
    there = {
        f"{module}.{name}"
        for module in modules
        for name, value in vars(import_module(f"tirelog.{module}")).items()
        if isinstance(value, Kernel) and value.py_func.__module__ == f"tirelog.{module}"
    }
    assert there == set(found)
    assert set(found) - set(inputs()) == set(), "register inputs in tests/kernel_inputs.py"
    assert set(inputs()) - set(found) == set()
    assert set(found) >= UNSET


@pytest.mark.parametrize("name", sorted(kernels()))
def test_a_compiled_kernel_is_as_plain_python(name: str) -> None:
    kernel = kernels()[name]
    rounded = rounds(kernel)
    for number, given in enumerate(inputs()[name]):
        compiled, plain = deepcopy(given), deepcopy(given)
        made = kernel(*compiled)
        with np.errstate(all="ignore"):  # division by zero is infinity in both
            expected = kernel.py_func(*plain)
        where = f"{name}, inputs {number}"
        if name in UNSET:  # room that is not filled yet
            made, expected = shapes(made), shapes(expected)
        agree(made, expected, f"{where}: result", rounded)
        for k, (one, other) in enumerate(zip(compiled, plain, strict=True)):
            agree(one, other, f"{where}: argument {k}", rounded)


def shapes(made: Any) -> Any:
    """Shapes and types of arrays that have not been filled."""
    if isinstance(made, tuple):
        return tuple(shapes(part) for part in made)
    return str(made.dtype), *made.shape


def agree(made: Any, expected: Any, where: str, rounded: bool) -> None:
    """Fail unless both are the same; `rounded` numbers within ROUNDING of the largest."""
    if isinstance(expected, tuple):
        assert isinstance(made, tuple), where
        assert len(made) == len(expected), where
        for k, (one, other) in enumerate(zip(made, expected, strict=True)):
            agree(one, other, f"{where}[{k}]", rounded)
        return
    if expected is None or isinstance(expected, str):
        assert made == expected, where
        return
    one, other = np.asarray(made), np.asarray(expected)
    assert one.shape == other.shape, where
    if other.dtype.names is not None:
        assert one.dtype == other.dtype, where
        for field in other.dtype.names:
            agree(one[field], other[field], f"{where}.{field}", rounded)
    elif other.dtype.kind in "fc":
        large = np.abs(other[np.isfinite(other)]).max(initial=0.0) if rounded else 0.0
        limits = {"rtol": ROUNDING, "atol": ROUNDING * large} if rounded else {"rtol": 0.0}
        np.testing.assert_allclose(one, other, err_msg=where, equal_nan=True, **limits)
        if not rounded:
            for part in ("real", "imag"):
                a, b = getattr(one, part), getattr(other, part)
                known = ~np.isnan(b)
                np.testing.assert_array_equal(
                    np.signbit(a)[known], np.signbit(b)[known], err_msg=f"{where}: sign of zero"
                )
    else:
        np.testing.assert_array_equal(one, other, err_msg=where)
