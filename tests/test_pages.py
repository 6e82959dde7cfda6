"""Property: the project's pages name files, folders and commands that are there."""

import re
from pathlib import Path

import pytest

from tests.test_layers import ORDER

ROOT = Path(__file__).parents[1]
HOWTOS = [f"docs/howto/{name}.md" for name in ("effect", "condition", "observable", "table")]
PAGES = ["CONTRIBUTING.md", "docs/architecture.md", "docs/howto/text_layout.md", *HOWTOS]
#: a path with a suffix that the project has; `drive.csv.gz` and `kernels.py` alone are no paths
NAMED = re.compile(r"\b((?:tirelog|tests|docs|benchmarks)/[\w/]+\.(?:py|md|csv|toml))\b")
#: made by who follows a page (tests/data/test_howtos.py)
NEW = {"tirelog/strain/strain_range.py"}


def text_of(page: str) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


@pytest.mark.parametrize("page", PAGES)
def test_every_file_that_a_page_names_is_there(page: str) -> None:
    named = set(NAMED.findall(text_of(page)))
    assert len(named) >= 3
    assert [name for name in sorted(named - NEW) if not (ROOT / name).is_file()] == []


def test_every_target_that_a_page_names_is_in_the_makefile() -> None:
    targets = set(re.findall(r"^([\w-]+):", text_of("Makefile"), re.MULTILINE))
    named = set(re.findall(r"`make ([\w-]+)", text_of("CONTRIBUTING.md")))
    assert len(named) >= 6
    assert named <= targets


def test_the_picture_of_the_folders_is_the_order_that_is_tested() -> None:
    text = text_of("docs/architecture.md")
    picture = re.findall(r"^    (\w+)(?:/|\.py)  ", text, re.MULTILINE)
    assert picture == [name for name in ORDER if name != "__main__"]


def test_every_file_that_the_errata_name_is_there() -> None:
    """By the end of its path."""
    named = set(re.findall(r"`([\w/]+\.py)", text_of("docs/errata.md")))
    assert len(named) > 30
    files = [f"/{p.relative_to(ROOT)}" for top in ("tirelog", "tests") for p in files_of(top)]
    assert [n for n in sorted(named) if not any(file.endswith(f"/{n}") for file in files)] == []


def files_of(folder: str) -> list[Path]:
    return list((ROOT / folder).rglob("*.py"))
