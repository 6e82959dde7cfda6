"""Property: a kernel gives what its source gives as plain Python, with or without a cache."""

import json
import os
import shutil
import sys
import tomllib
from pathlib import Path

import pytest

from tests.processes import python
from tirelog import cli
from tirelog.kernels import dispatch
from tirelog.kernels.build import CALLS

ROOT = Path(__file__).parents[1]
SAMPLES = ROOT / "sample_data"

PROGRAM = """
import numpy as np
from tirelog.wheel.pulses import turning_points
points = np.empty(5, np.int64)
count = turning_points(np.array([0, 3, 1, 4], np.float32), 1.0, points)
print(count, points[:count].tolist(), hasattr(turning_points, "py_func"))
"""


@pytest.mark.parametrize("switch", [{"NUMBA_CACHE_DIR": "/proc/nowhere"}, {}])
def test_compiled_is_as_plain_python(tmp_path, switch):
    compiled = python(PROGRAM, **{"NUMBA_CACHE_DIR": str(tmp_path), **switch}).stdout.split()
    plain = python(PROGRAM, NUMBA_DISABLE_JIT="1").stdout.split()
    assert (compiled.pop(), plain.pop()) == ("True", "False")
    assert compiled == plain


def hits(folder: Path, program: str) -> str:
    """What a program prints of modules in a folder, beside which numba keeps its cache."""
    path = os.pathsep.join([str(folder), *sys.path])
    return python(program, without="NUMBA_CACHE_DIR", PYTHONPATH=path).stdout.strip()


def test_a_kernel_whose_called_kernel_was_edited_is_compiled_anew(tmp_path):
    """numba itself looks at the caller's file alone."""
    inner, outer = tmp_path / "inner_kernel.py", tmp_path / "outer_kernel.py"
    head = "from tirelog.kernels import compiled\n"
    outer.write_text(
        head + "from inner_kernel import scale\n@compiled\ndef middle(x):\n    return scale(x)\n"
        "@compiled\ndef whole(x):\n    return middle(x)\n"
    )
    program = (
        "import outer_kernel; print(outer_kernel.whole(2.0), "
        "sum(outer_kernel.whole.jitted.stats.cache_hits.values()))"
    )
    for factor, said in ((3.0, "6.0 0"), (3.0, "6.0 1"), (5.0, "10.0 0"), (5.0, "10.0 1")):
        text = head + f"@compiled\ndef scale(x):\n    return {factor} * x\n"
        if not inner.exists() or inner.read_text() != text:
            inner.write_text(text)
        assert hits(tmp_path, program) == said


def test_a_named_tuple_that_has_another_name_since_is_no_fault_of_the_cache(tmp_path):
    """The cache's index names the types that a kernel takes; an upgrade may rename them."""
    text = (
        "from typing import NamedTuple\nfrom tirelog.kernels import compiled\n"
        "class {0}(NamedTuple):\n    x: float\n"
        "@compiled\ndef whole(room):\n    return 2.0 * room.x\n"
        "print(whole({0}(3.0)), sum(whole.jitted.stats.cache_hits.values()))"
    )
    source = tmp_path / "roomy_kernel.py"
    for name, count in (("Room", 0), ("Room", 1), ("Space", 0), ("Space", 1)):
        if not source.exists() or source.read_text() != text.format(name):
            source.write_text(text.format(name))
        assert hits(tmp_path, "import roomy_kernel") == f"6.0 {count}"


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler here")
@pytest.mark.parametrize("words", ["tables {drive}", "speed {run}", "tables {run}"])
def test_tables_need_no_numba_once_kernels_are_built(tmp_path, words):
    """`run` holds counts of a grating without a twin, which stay counts in memory."""
    setup, run = tmp_path / "setup.toml", tmp_path / "run.h5"
    text = (SAMPLES / "drive.toml").read_text().replace('temperature_channel = "temp_1"\n', "")
    setup.write_text(text)
    drive = str(SAMPLES / "drive.csv.gz")
    assert cli.run(["ingest", drive, "--setup", str(setup), "-o", str(run), "--quiet"]) == 0
    asked = [*words.format(drive=drive, run=run).split(), "-o", str(tmp_path / "out.csv")]
    program = "import sys; from tirelog.cli import run\n"
    program += "print(run(sys.argv[1:]), 'numba' in sys.modules)"
    assert python(program, *asked).stdout.split()[-2:] == ["0", "False"]


def test_an_installation_can_import_the_modules_of_kernels():
    """It has only the packages that the build requires."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    required, others = (
        {text.partition(">=")[0] for text in some}
        for some in (project["build-system"]["requires"], project["project"]["dependencies"])
    )
    modules = sorted({name.partition(":")[0] for name in json.loads(CALLS.read_text())})
    program = "import sys; from importlib import import_module as get\n"
    program += f"for name in {modules}: get(name)\nprint(*sys.modules)"
    loaded = python(program, folder=ROOT).stdout.split()
    assert others & {name.partition(".")[0] for name in loaded} <= required


def copied(tmp_path: Path) -> Path:
    """The package in a folder of its own, with the extension if there is one."""
    package = tmp_path / "tirelog"
    shutil.copytree(dispatch.PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    return package


def of_copy(package: Path, program: str) -> list[str]:
    """The words that a program prints which takes the package from there."""
    folder = package.parent
    return python(program, folder=folder, PYTHONPATH=str(folder)).stdout.split()


def test_an_edited_source_is_not_run_as_it_was(tmp_path):
    """The extension of a folder whose sources differ from those it was made of is not used."""
    package, whole = copied(tmp_path), str(bool(dispatch._loaded()[1]))
    program = "from tirelog.kernels import dispatch as d; print(d.PACKAGE, bool(d._loaded()[1]))"
    assert of_copy(package, program) == [str(package), whole]
    # one has kernels, the other a number that is in one of them
    for name in ("dsp/filters.py", "vocabulary/arrays.py"):
        source, text = package / name, (package / name).read_text()
        source.write_text(text + "\n")
        assert of_copy(package, program) == [str(package), "False"]
        source.write_text(text)
    assert of_copy(package, program) == [str(package), whole]


def test_a_damaged_extension_is_left_aside(tmp_path):
    """Kernels are then compiled when they are first called; no command ends for it."""
    package = copied(tmp_path)
    sources = dispatch.fingerprints(["dsp/filters.py"])
    extension = package / "kernels" / dispatch.EXTENSION.name
    whole = {"extension": extension.name, "sources": sources, "functions": {"a": {}}}
    for table in ({}, [], whole):
        extension.write_bytes(b"no machine code")
        (package / "kernels" / dispatch.TABLE.name).write_text(json.dumps(table))
        assert of_copy(package, PROGRAM)[-1] == "True"
