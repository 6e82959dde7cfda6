"""The package's sources, parsed once: their tests are marked `xdist_group("sources")`."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "tirelog"


@cache
def sources() -> dict[str, tuple[str, ast.Module]]:
    """Text and syntax tree of each file of the package, by its path in it."""
    texts = {
        path.relative_to(PACKAGE).as_posix(): path.read_text(encoding="utf-8")
        for path in sorted(PACKAGE.rglob("*.py"))
    }
    return {file: (text, ast.parse(text)) for file, text in texts.items()}


@cache
def nodes() -> list[tuple[str, ast.AST]]:
    """(file, node) of everything in these trees."""
    return [(file, node) for file, (_, tree) in sources().items() for node in ast.walk(tree)]
