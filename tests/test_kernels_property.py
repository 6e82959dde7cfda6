"""Property: every compiled kernel of the package gives what its source gives as plain Python."""

from __future__ import annotations

import ast
import json
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

from tests.kernel_calls import called, calls
from tirelog.kernels.build import CALLS
from tirelog.kernels.dispatch import Kernel, examples, kind_of, spelled

numba = pytest.importorskip("numba")
if numba.config.DISABLE_JIT:
    pytest.skip("compiling is switched off: both are plain Python", allow_module_level=True)

pytestmark = pytest.mark.xdist_group("kernels")  # commands run once
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
    """Every kernel by its name in the package, as `strain.dissipation.derivative`."""
    return {
        f"{module}.{name}".removeprefix("tirelog."): getattr(import_module(module), name)
        for module, name in decorated()
    }


def within(kernel: Kernel) -> set[Kernel]:
    """A kernel and those that it calls."""
    names = kernel.py_func.__code__.co_names
    inner = (kernel.py_func.__globals__.get(name) for name in names)
    return {kernel}.union(*(within(one) for one in inner if isinstance(one, Kernel)))


def rounds(kernel: Kernel) -> bool:
    """True if it takes powers, elementary functions or complex products."""
    return any(
        isinstance(node, ast.Pow)
        or (isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in ELEMENTARY)
        or "Complex" in str(one.py_func.__annotations__)
        for one in within(kernel)
        for node in ast.walk(ast.parse(dedent(getsource(one.py_func))))
    )


def test_a_compiled_kernel_is_as_plain_python() -> None:
    found, seen = kernels(), set()
    assert len(found) > 50
    assert [name for name, kernel in found.items() if not isinstance(kernel, Kernel)] == []

    def plain(kernel: Kernel, *given: Any) -> Any:
        seen.add(kernel.name.removeprefix("tirelog.").replace(":", "."))
        return kernel.py_func(*given)

    for (name, _), tried in calls().items():
        kernel = found[name.removeprefix("tirelog.").replace(":", ".")]
        rounded = rounds(kernel)
        for number, given in enumerate(tried):
            one, other = deepcopy(given), deepcopy(given)
            made = kernel(*one)
            with called(plain), np.errstate(all="ignore"):  # division by zero is infinity in both
                expected = plain(kernel, *other)
            where = f"{name}, call {number}"
            agree(made, expected, f"{where}: result", rounded)
            agree(one, other, f"{where}: arguments", rounded)
    assert set(found) - seen == set(), "no call in tests/kernel_calls.py comes to these"


def test_kernels_that_are_compiled_ahead_are_those_that_commands_call() -> None:
    ahead = json.loads(CALLS.read_text())
    assert set(ahead) <= {name for name, _ in calls()}
    for kinds in (kinds for told in ahead.values() for kinds in told):
        assert spelled(map(kind_of, examples(json.dumps(kinds)))) == json.dumps(kinds)


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
        if one.shape == () and rounded:  # one number of a state may be the difference of others
            agree(np.array(one.tolist()), np.array(other.tolist()), where, rounded)
            return
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
