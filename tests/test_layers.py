"""Property: imports point one way, and start-up imports no science."""

import ast
import subprocess
import sys
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "tirelog"
#: lower layers first; a module imports its own layer and those below
LAYERS = [
    {"errors", "columns", "units", "remote", "compiled", "process"},
    {"recording", "dsp", "files", "documents"},
    {
        "plausibility",
        "setup",
        "convert",
        "readers",
        "spool",
        "stamps",
        "clock",
        "chunks",
        "store_column",
        "store_checks",
        "store",
        "ingest",
        "arrow_columns",
        "csv_rows",
        "tables",
        "regression",
        "overview",
    },
    {"physics"},
    {"estimators"},
    {"discrepancy"},
    {"campaign", "report", "plots"},
    {"cli", "__main__"},
]
LAYER = {name: level for level, names in enumerate(LAYERS) for name in names}


def imported(path: Path) -> set[str]:
    """Names of the parts of tirelog that a module imports."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        modules = (
            [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else [a.name for a in node.names]
            if isinstance(node, ast.Import)
            else []
        )
        found |= {m.split(".")[1] for m in modules if m.startswith("tirelog.")}
    return found


def test_imports_point_down() -> None:
    wrong = []
    for path in PACKAGE.rglob("*.py"):
        part = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        if part in ("__init__", "simulation"):
            continue
        wrong += [f"{path.name} imports {other}" for other in imported(path) if other != "simulation" and LAYER[other] > LAYER[part]]
    assert wrong == []


def test_help_imports_no_science() -> None:
    code = "import sys; from tirelog.cli import run; run(['speed', '--help']); print(sorted(set(sys.modules) & {%r}))"
    heavy = "', '".join(["numpy", "numba", "scipy", "pandas", "pyarrow", "h5py", "matplotlib", "mcap", "tomlkit"])
    out = subprocess.run([sys.executable, "-c", code.replace("%r", f"'{heavy}'")], capture_output=True, text=True, check=True).stdout
    assert out.splitlines()[-1] == "[]"
