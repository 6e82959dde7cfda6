"""Property: the truth imports none of the models and estimators, and none of them imports the
truth: the wall.
"""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import tirelog

PACKAGE = Path(tirelog.__file__).parent
MODELS = tuple(
    f"tirelog.{folder}"
    for folder in ("physics", "wheel", "strain", "products", "inference", "diagnosis")
)


def imported(path: Path) -> set[str]:
    """Absolute names of all modules (and of what is taken from them) that a file imports, wherever
    the import stands.
    """
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
            base = ".".join(parts[: len(parts) - node.level]) + "." if node.level else ""
            module = f"{base}{node.module or ''}".rstrip(".")
            names |= {module} | {f"{module}.{alias.name}" for alias in node.names}
    return names


def files(folder: str) -> list[Path]:
    return sorted((PACKAGE / folder).rglob("*.py"))


def crossing(folder: str, forbidden: tuple[str, ...]) -> dict[str, set[str]]:
    found = {}
    for path in files(folder):
        bad = {
            name
            for name in imported(path)
            if any(name == f or name.startswith(f + ".") for f in forbidden)
        }
        if bad:
            found[str(path.relative_to(PACKAGE))] = bad
    return found


def test_the_truth_imports_no_model() -> None:
    assert len(files("simulation")) > 10
    assert crossing("simulation", MODELS) == {}


@pytest.mark.parametrize("folder", ["physics", "wheel", "strain", "inference", "diagnosis"])
def test_no_model_imports_the_truth(folder: str) -> None:
    assert files(folder)
    assert crossing(folder, ("tirelog.simulation",)) == {}


def test_the_wall_sees_every_form_of_import(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bad = tmp_path / "tirelog" / "simulation" / "bad.py"
    bad.parent.mkdir(parents=True)
    bad.write_text(
        "def f():\n    from tirelog import physics\n    from ..inference.stacks.cut import x\n"
        "    import tirelog.strain.speed\n"
    )
    monkeypatch.setitem(globals(), "PACKAGE", tmp_path / "tirelog")
    found = crossing("simulation", MODELS)["simulation/bad.py"]
    assert {"tirelog.physics", "tirelog.inference.stacks.cut", "tirelog.strain.speed"} <= found
