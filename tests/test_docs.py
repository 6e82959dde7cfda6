"""Property: the reference pages and the tables in pages are what the registers give."""

import re
import runpy
from pathlib import Path

import pytest

from tirelog.version import __version__
from tirelog.vocabulary.columns import COLUMNS

ROOT = Path(__file__).parents[1]
GENERATE = runpy.run_path(str(ROOT / "docs" / "generate.py"))
MADE = GENERATE["made"]()


@pytest.mark.parametrize("path", MADE, ids=lambda path: path.name)
def test_a_made_page_is_what_the_registers_give(path: Path) -> None:
    assert path.read_text() == MADE[path], "run: make reference"


def test_a_section_that_is_missing_is_said() -> None:
    with pytest.raises(SystemExit, match="channel kinds"):
        GENERATE["filled"]("docs/setup.md", "# no such section\n")


def test_every_standard_error_is_explained() -> None:
    text = (ROOT / "docs" / "standard_errors.md").read_text(encoding="utf-8")
    explained = text.split("## What is in them")[1]
    columns = [name for name in COLUMNS if re.search(r"_se(_|$)", name)]
    assert len(columns) > 10
    assert [name for name in columns if f"`{name}`" not in explained] == []


def test_the_readme_fits_on_a_screen_and_begins_with_its_two_commands() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 120
    first = re.search(r"^```sh\n(.*?)^```", text, re.M | re.S)
    assert first is not None
    assert [" ".join(line.split()[:2]) for line in first[1].splitlines()] == [
        "make demo",
        "make test",
    ]


def test_every_page_and_picture_that_a_page_names_is_there() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    named = [
        (page, target)
        for page in pages
        for target in re.findall(
            r"\]\(([\w./-]+\.(?:md|png))(?:#[\w-]*)?\)", page.read_text("utf-8")
        )
    ]
    assert len(named) > 80
    assert [(str(p), t) for p, t in named if not (p.parent / t).is_file()] == []


def test_every_page_is_in_the_site_s_contents() -> None:
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    listed = {
        name
        for block in re.findall(r"```\{toctree\}\n(.*?)```", index, re.S)
        for name in re.findall(r"^[\w/]+$", block, re.M)
    }
    pages = {
        p.relative_to(ROOT / "docs").with_suffix("").as_posix()
        for p in (ROOT / "docs").rglob("*.md")
    }
    assert pages - {"index"} == listed


def test_the_citation_has_the_package_s_version_and_licence() -> None:
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"version: {__version__}\n" in cited
    assert "license: MIT\n" in cited
    assert (ROOT / "LICENSE").read_text(encoding="utf-8").startswith("MIT License")
