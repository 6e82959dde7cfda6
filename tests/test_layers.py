"""Property: imports point one way, and start-up imports no science."""

import ast
import subprocess
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

import pytest

from tirelog.cli.app import command

pytestmark = pytest.mark.xdist_group("layers")  # one worker makes what these tests share

PACKAGE = Path(__file__).parents[1] / "tirelog"
#: a folder or file imports only itself and what stands before it
ORDER = (
    "version",
    "errors",
    "runtime",
    "process_pool",
    "kernels",
    "vocabulary",
    "storage",
    "data",
    "dsp",
    "readers",
    "runs",
    "tables",
    "physics",
    "simulation",
    "wheel",
    "strain",
    "products",
    "drafts",
    "inference",
    "diagnosis",
    "plots",
    "report",
    "campaign",
    "api",
    "cli",
    "__main__",
)


def modules() -> dict[str, Path]:
    """Every module of the package with its file, by dotted name without the package's own."""
    names = {
        ".".join(p.relative_to(PACKAGE).with_suffix("").parts): p for p in PACKAGE.rglob("*.py")
    }
    return {
        name.removesuffix(".__init__"): path for name, path in names.items() if name != "__init__"
    }


@cache
def imports(path: Path) -> tuple[ast.Import | ast.ImportFrom, ...]:
    """A module's statements of import, anywhere in it; parsed once for all tests."""
    nodes = ast.walk(ast.parse(path.read_text()))
    return tuple(node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom))


def imported(path: Path, known: Iterable[str]) -> set[str]:
    """The modules of tirelog that a module imports, anywhere in it."""
    found = set()
    for node in imports(path):
        if isinstance(node, ast.ImportFrom) and f"{node.module}.".startswith("tirelog."):
            module = str(node.module).removeprefix("tirelog").removeprefix(".")
            within = {a.name: f"{module}.{a.name}".removeprefix(".") for a in node.names}
            found |= {name if name in known else module for name in within.values()} - {""}
        elif isinstance(node, ast.Import):
            found |= {
                a.name.removeprefix("tirelog.") for a in node.names if a.name.startswith("tirelog.")
            }
    return found


def test_no_import_is_relative() -> None:
    assert [p for p in modules().values() for n in imports(p) if getattr(n, "level", 0)] == []


def test_imports_point_down() -> None:
    known = modules()
    wrong = []
    for name, path in known.items():
        own = ORDER.index(name.split(".")[0])
        wrong += [
            f"{name} imports {m}"
            for m in imported(path, known)
            if ORDER.index(m.split(".")[0]) > own
        ]
    assert wrong == []


def test_the_models_and_the_truth_do_not_know_each_other() -> None:
    known = modules()
    apart = {"physics", "wheel", "strain", "products", "inference", "diagnosis"}
    for name, path in known.items():
        rooms = {m.split(".")[0] for m in imported(path, known)}
        assert not (name.startswith("simulation") and rooms & apart), name
        assert not (name.split(".")[0] in apart and "simulation" in rooms), name


def test_no_two_modules_need_each_other() -> None:
    """A topological order of all modules exists; else the circle is named."""
    known = modules()
    try:
        list(
            TopologicalSorter(
                {name: imported(path, known) - {name} for name, path in known.items()}
            ).static_order()
        )
    except CycleError as circle:
        pytest.fail(" -> ".join(circle.args[1]))


#: what the command line sees of the package: what words mean, how files are read and written whole,
#: and the one door to everything else
SEEN_BY_COMMANDS = {
    *("cli", "api", "version", "errors", "runtime"),
    *("vocabulary", "storage", "data", "tables"),
}


def test_the_command_line_sees_the_api_and_nothing_behind_it() -> None:
    """So a notebook has whatever a command has: not even a type comes from behind the door."""
    known = modules()
    for name, path in known.items():
        if name.split(".")[0] == "cli":
            rooms = {m.split(".")[0] for m in imported(path, known)}
            assert rooms <= SEEN_BY_COMMANDS, name
            roots = {ast.unparse(node).split()[1].split(".")[0] for node in imports(path)}
            assert not roots & {"numpy", "scipy", "pandas", "numba"}, name


def test_commands_do_not_reckon() -> None:
    """A module that a command is in parses, asks and shows: it has no arithmetic."""

    def below(parsed: Any) -> Iterator[Any]:
        for one in getattr(parsed, "commands", {}).values():
            yield from below(one)
        yield parsed

    callbacks = [one.callback for one in below(command()) if one.callback is not None]
    homes = {callback.__module__.removeprefix("tirelog.") for callback in callbacks}
    assert {"cli.answers", "cli.files", "cli.model"} <= homes
    reckoned = ast.Sub | ast.Mult | ast.Div | ast.Pow | ast.Mod | ast.FloorDiv | ast.MatMult
    wrong = [
        f"{name}:{node.lineno}"
        for name in sorted(homes)
        for node in ast.walk(ast.parse(modules()[name].read_text()))
        if isinstance(node, ast.BinOp) and isinstance(node.op, reckoned)
    ]
    assert wrong == []


def test_help_imports_no_science() -> None:
    code = (
        "import sys; from tirelog.cli import run; run(['speed', '--help']); "
        "print(sorted(set(sys.modules) & {%r}))"
    )
    heavy = "', '".join(
        ["numpy", "numba", "scipy", "pandas", "pyarrow", "h5py", "matplotlib", "mcap", "tomlkit"]
    )
    out = subprocess.run(
        [sys.executable, "-c", code.replace("%r", f"'{heavy}'")],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert out.splitlines()[-1] == "[]"


def test_no_module_imports_scipy_stats() -> None:
    """It takes half of a second; the tails of distributions are in `scipy.special`."""
    wrong = [
        name
        for name, path in modules().items()
        for node in imports(path)
        if "scipy.stats" in ast.unparse(node) or "from scipy import stats" in ast.unparse(node)
    ]
    assert wrong == []


def test_a_long_file_says_why() -> None:
    silent = [
        name
        for name, path in modules().items()
        if len((text := path.read_text()).splitlines()) > 800
        and "longer than others" not in " ".join((ast.get_docstring(ast.parse(text)) or "").split())
    ]
    assert silent == []
