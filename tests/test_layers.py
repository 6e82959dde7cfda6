"""Property: imports point one way, and start-up imports no science."""

import ast
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from typing import Any

import pytest

from tests.processes import python
from tests.sources import nodes, sources
from tirelog.cli.app import command

pytestmark = pytest.mark.xdist_group("sources")  # one worker parses the package, once
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


@cache
def modules() -> dict[str, str]:
    """Every module of the package with its file, by dotted name without the package's own."""
    names = {file.removesuffix(".py").replace("/", "."): file for file in sources()}
    del names["__init__"]
    return {name.removesuffix(".__init__"): file for name, file in names.items()}


@cache
def imports() -> dict[str, list[ast.Import | ast.ImportFrom]]:
    """The statements of import of each module, anywhere in it."""
    found: dict[str, list[ast.Import | ast.ImportFrom]] = {file: [] for file in sources()}
    for file, node in nodes():
        if isinstance(node, ast.Import | ast.ImportFrom):
            found[file].append(node)
    return {name: found[file] for name, file in modules().items()}


def imported(name: str) -> set[str]:
    """The modules of tirelog that a module imports, anywhere in it."""
    known, found = modules(), set()
    for node in imports()[name]:
        if isinstance(node, ast.ImportFrom) and f"{node.module}.".startswith("tirelog."):
            module = str(node.module).removeprefix("tirelog").removeprefix(".")
            within = {a.name: f"{module}.{a.name}".removeprefix(".") for a in node.names}
            found |= {name if name in known else module for name in within.values()} - {""}
        elif isinstance(node, ast.Import):
            own = (a.name for a in node.names if a.name.startswith("tirelog."))
            found |= {name.removeprefix("tirelog.") for name in own}
    return found


def rooms(name: str) -> set[str]:
    """The top folders or files that a module imports of."""
    return {module.split(".")[0] for module in imported(name)}


def test_imports_point_down() -> None:
    wrong = [
        f"{name} imports {room}"
        for name in modules()
        for room in rooms(name)
        if ORDER.index(room) > ORDER.index(name.split(".")[0])
    ]
    assert wrong == []


def test_the_models_and_the_truth_do_not_know_each_other() -> None:
    apart = {"physics", "wheel", "strain", "products", "inference", "diagnosis"}
    for name in modules():
        assert not (name.startswith("simulation") and rooms(name) & apart), name
        assert not (name.split(".")[0] in apart and "simulation" in rooms(name)), name


def test_no_two_modules_need_each_other() -> None:
    """A topological order of all modules exists; else the circle is named."""
    needs = {name: imported(name) - {name} for name in modules()}
    try:
        list(TopologicalSorter(needs).static_order())
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
    for name in modules():
        if name.split(".")[0] == "cli":
            assert rooms(name) <= SEEN_BY_COMMANDS, name
            roots = {ast.unparse(node).split()[1].split(".")[0] for node in imports()[name]}
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
        for node in ast.walk(sources()[modules()[name]][1])
        if isinstance(node, ast.BinOp) and isinstance(node.op, reckoned)
    ]
    assert wrong == []


def test_help_imports_no_science() -> None:
    code = "import sys; from tirelog.cli import run; run(['speed', '--help']); print(*sys.modules)"
    heavy = {"numpy", "numba", "scipy", "pandas", "pyarrow", "h5py", "matplotlib", "mcap"}
    loaded = python(code).stdout.splitlines()[-1].split()
    assert "tirelog.cli" in loaded
    assert (heavy | {"tomlkit"}).isdisjoint(loaded)


def test_a_long_file_says_why() -> None:
    silent = [
        file
        for file, (text, tree) in sources().items()
        if len(text.splitlines()) > 800
        and "longer than others" not in " ".join((ast.get_docstring(tree) or "").split())
    ]
    assert silent == []
