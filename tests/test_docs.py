"""Property: the reference pages and README's tables are what the registers give."""

import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
GENERATE = runpy.run_path(str(ROOT / "docs" / "generate.py"))
MADE: dict[Path, str] = GENERATE["made"]()


@pytest.mark.parametrize("path", MADE, ids=lambda path: path.name)
def test_a_made_page_is_what_the_registers_give(path: Path) -> None:
    assert path.read_text() == MADE[path], "run: make docs"


def test_a_section_that_is_missing_is_said() -> None:
    with pytest.raises(SystemExit, match="quality words"):
        GENERATE["readme"]("# no such section\n")
