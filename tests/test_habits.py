"""Property: the type checker is strict, and what it does not see is said."""

import re
import tomllib
from pathlib import Path

from tests.conftest import group_of

ROOT = Path(__file__).parents[1]
#: where an `ignore` hides a mistake in the physics
PIPELINE = ("physics/model/", "physics/moving/")
MOST_IGNORED = 3


def ignored() -> list[tuple[str, str]]:
    """(file, line) of everything that the type checker is told not to see."""
    return [
        (path.relative_to(ROOT / "tirelog").as_posix(), line)
        for path in sorted((ROOT / "tirelog").rglob("*.py"))
        for line in path.read_text(encoding="utf-8").splitlines()
        if "type: ignore" in line
    ]


def test_the_model_s_pipeline_hides_nothing() -> None:
    assert [file for file, _ in ignored() if file.startswith(PIPELINE)] == []


def test_what_is_hidden_elsewhere_is_little_and_has_a_reason() -> None:
    unsaid = [
        f"{file}: {line.strip()}"
        for file, line in ignored()
        if not re.search(r"type: ignore\[[\w,-]+\]  # \w", line)
    ]
    assert unsaid == []
    assert len(ignored()) <= MOST_IGNORED


def test_checks_are_strict() -> None:
    tools = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
    assert tools["mypy"]["strict"] is True
    options = tools["pytest"]["ini_options"]
    assert options["xfail_strict"] is True
    assert options["filterwarnings"][0] == "error"


def test_every_mark_of_a_group_is_one_that_the_scheduler_sees() -> None:
    """Else each worker makes again what the group shares, and nothing says so."""
    marked = [
        path
        for path in sorted((ROOT / "tests").rglob("test_*.py"))
        if "xdist_group(" in path.read_text(encoding="utf-8") and path != Path(__file__)
    ]
    assert len(marked) > 10
    assert [path.name for path in marked if not group_of(path)] == []
