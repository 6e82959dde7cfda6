"""Property: the pages for whoever works on the project name files, folders and commands that are
there.
"""

import re
from pathlib import Path

import pytest

from tests.test_layers import ORDER

ROOT = Path(__file__).parents[1]
#: those that a test follows are looked at there (tests/data/test_howtos.py): they name new files
PAGES = ["CONTRIBUTING.md", "docs/architecture.md", "docs/howto/text_layout.md"]
#: a path with a suffix that the project has; `drive.csv.gz` and `kernels.py` alone are no paths
NAMED = re.compile(r"\b((?:tirelog|tests|docs|benchmarks)/[\w/]+\.(?:py|md|csv|toml))\b")


@pytest.mark.parametrize("page", PAGES)
def test_every_file_that_a_page_names_is_there(page: str) -> None:
    named = set(NAMED.findall((ROOT / page).read_text(encoding="utf-8")))
    assert len(named) >= 6
    assert [name for name in sorted(named) if not (ROOT / name).is_file()] == []


def test_every_target_that_a_page_names_is_in_the_makefile() -> None:
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    named = set(re.findall(r"`make ([\w-]+)", (ROOT / "CONTRIBUTING.md").read_text("utf-8")))
    assert len(named) >= 6
    assert named <= targets


def test_the_picture_of_the_folders_is_the_order_that_is_tested() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    picture = re.findall(r"^    (\w+)(?:/|\.py)  ", text, re.MULTILINE)
    assert picture == [name for name in ORDER if name != "__main__"]
