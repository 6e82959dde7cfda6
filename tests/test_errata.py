"""Property: the page of errata names files that are there, and is where the code says it is."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "errata.md").read_text(encoding="utf-8")


def test_every_file_that_the_page_names_is_there() -> None:
    named = set(re.findall(r"`([\w/]+\.py)", PAGE))
    files = [
        path.relative_to(ROOT).as_posix()
        for top in ("tirelog", "tests")
        for path in (ROOT / top).rglob("*.py")
    ]
    assert len(named) > 30
    assert [
        name
        for name in sorted(named)
        if not any(file.endswith(f"/{name}") or file == name for file in files)
    ] == []


def test_a_table_row_has_the_cells_of_its_head() -> None:
    lines = [line for line in PAGE.splitlines() if line.startswith("|")]
    heads = [i for i, line in enumerate(lines) if line.startswith("| ---")]
    assert len(heads) == 4
    for first, after in zip(heads, [*(i - 1 for i in heads[1:]), len(lines)], strict=True):
        assert {line.count("|") for line in lines[first - 1 : after]} == {lines[first].count("|")}


def test_every_paper_s_equation_has_a_section_and_the_code_points_there() -> None:
    for paper in ("P1", "P2", "P3", "P4"):
        assert f"* **{paper}**: " in PAGE
    assert "docs/errata.md" in (ROOT / "tirelog" / "physics" / "__init__.py").read_text(
        encoding="utf-8"
    )
