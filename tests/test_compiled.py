"""Property: a compiled kernel gives what the same source gives as plain Python, wherever its cache can or cannot be kept."""

import os
import subprocess
import sys

import pytest

PROGRAM = """
import numpy as np
from tirelog.estimators.passage_kernels import turning_points
points = np.empty(5, np.int64)
count = turning_points(np.array([0, 3, 1, 4], np.float32), 1.0, points)
print(count, points[:count].tolist(), hasattr(turning_points, "py_func"))
"""


def told(**more: str) -> str:
    """What the program prints in a process of its own."""
    environment = {**os.environ, **more}
    return subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, env=environment, check=True).stdout


@pytest.mark.parametrize("switch", [{"NUMBA_CACHE_DIR": "/proc/nowhere"}, {}])
def test_compiled_is_as_plain_python(tmp_path, switch):
    compiled = told(**{"NUMBA_CACHE_DIR": str(tmp_path), **switch})
    plain = told(NUMBA_DISABLE_JIT="1")
    assert compiled.split()[-1] == "True"
    assert plain.split()[-1] == "False"
    assert compiled.split()[:-1] == plain.split()[:-1]
