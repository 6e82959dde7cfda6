"""Faults and properties of compiled kernels: the same as plain Python, kept from process to process, and never stale."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from tirelog import machine_code
from tirelog.compiled import CompiledKernel, compiled

SHIFT = 3.0
WEIGHTS = np.array([0.5, 2.0])


@compiled
def scaled(x, i):
    return x[i] * WEIGHTS[1]


@compiled
def everything(x, n, flag, pair):
    scratch = np.empty((x.size, 2))
    for i in range(x.size):
        scratch[i, 0] = scaled(x, i) + n * pair[0] + SHIFT
        scratch[i, 1] = i
    out = scratch[:, 0] + scratch[:, 1]
    return out, scratch, flag, n, (x.size, pair[1]), np.exp(out[0])


@compiled
def refuses(x):
    if x[0] < 0:
        raise ValueError("below zero")
    return x[0]


@compiled
def by_name(x, factor=2.0):
    for i in range(x.size):
        x[i] *= factor


@compiled
def waves(x):
    out = np.zeros((x.size, 2), np.complex128)
    for i in range(x.size):
        out[i, 0] = np.cos(x[i]) + 1j * np.sin(x[i])
    return out


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    machine_code._folder.cache_clear()
    yield tmp_path
    machine_code._folder.cache_clear()


def anew(kernel):
    """The kernel as another process has it."""
    return CompiledKernel(kernel.function)


@pytest.mark.parametrize("x", [np.arange(5.0), np.arange(10.0)[::2], np.zeros(1), np.arange(4, dtype=np.float32)])
def test_a_kernel_is_the_same_as_plain_python_made_and_loaded(x):
    expected = everything.function(x, 2, True, (0.5, 7))
    for _ in range(2):
        found = anew(everything)(x, 2, np.bool_(True), (np.float64(0.5), 7))
        for got, wanted in zip(found[:2], expected[:2], strict=True):
            np.testing.assert_allclose(got, wanted, rtol=1e-15)
        assert found[2:5] == expected[2:5]
        assert found[2] is True
        assert found[5] == pytest.approx(expected[5])


def test_complex_arrays_come_back():
    np.testing.assert_allclose(anew(waves)(np.arange(3.0))[:, 0], np.exp(1j * np.arange(3.0)))


def test_an_error_is_raised_as_it_is():
    assert refuses(np.ones(1)) == 1.0
    with pytest.raises(ValueError, match="below zero"):
        refuses(-np.ones(1))


def test_arguments_by_name_and_defaults():
    x = np.ones(3)
    by_name(x=x)
    by_name(x, factor=5.0)
    assert x.tolist() == [10.0] * 3
    with pytest.raises(TypeError):
        by_name(x, 1.0, 2.0)


def test_memory_is_given_back():
    kernel = anew(everything)
    x = np.zeros(1_000_000)
    kernel(x, 0, False, (0.0, 0))
    with open("/proc/self/statm") as file:
        before = int(file.read().split()[1])
    for _ in range(30):
        kernel(x, 0, False, (0.0, 0))
    with open("/proc/self/statm") as file:
        grown = int(file.read().split()[1]) - before
    assert grown * 4096 < 3 * 24_000_000


def test_a_changed_constant_or_called_kernel_is_another_entry(monkeypatch):
    before = anew(everything).fingerprint
    assert anew(everything).fingerprint == before
    monkeypatch.setitem(everything.function.__globals__, "SHIFT", 4.0)
    changed = anew(everything).fingerprint
    monkeypatch.setitem(everything.function.__globals__, "WEIGHTS", np.array([0.5, 3.0]))
    assert len({before, changed, anew(everything).fingerprint}) == 3


@pytest.mark.parametrize("harm", [lambda b: b[: len(b) // 2], lambda b: b"", lambda b: b[:200] + b"\0" * 64 + b[264:]])
def test_a_damaged_entry_is_made_anew(own_cache, harm):
    assert anew(scaled)(np.ones(2), 1) == 2.0
    (file,) = own_cache.glob("*scaled*.code")
    whole = file.read_bytes()
    file.write_bytes(harm(whole))
    assert anew(scaled)(np.ones(2), 1) == 2.0
    assert len(file.read_bytes()) == len(whole)


def test_a_cache_that_cannot_be_written_only_costs_time(monkeypatch):
    monkeypatch.setattr(machine_code.tempfile, "mkstemp", lambda **_: (_ for _ in ()).throw(OSError("full")))
    assert anew(scaled)(np.ones(2), 1) == 2.0


PROGRAM = """
import sys
import numpy as np
from tirelog.estimators.passage_kernels import turning_points
points = np.empty(5, np.int64)
print(turning_points(np.array([0, 3, 1, 4], np.float32), 1.0, points), "numba" in sys.modules)
"""


def run(own_cache, **more):
    environment = {"NUMBA_CACHE_DIR": str(own_cache), "PATH": "", **more}
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, env=environment, check=True)
    return done.stdout.split()


def test_the_second_process_does_without_numba(own_cache):
    assert run(own_cache) == ["4", "True"]
    assert run(own_cache) == ["4", "False"]


def test_plain_python_where_it_is_switched_off(own_cache):
    assert run(own_cache, NUMBA_DISABLE_JIT="1") == ["4", "False"]
    assert not list(own_cache.glob("*.code"))
