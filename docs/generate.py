"""Reference pages and README tables from the registers of the package.

    python docs/generate.py             writes them (also: make docs)
    tests/test_docs.py                  the committed ones are what the registers give

`PAGES` are whole files; a section of README.md stands between two comments that name it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path

from tirelog.vocabulary.quality import OK, Quality

ROOT = Path(__file__).resolve().parents[1]
NOTE = "<!-- made by `make docs` from {}; change that file -->"


def quality_section() -> str:
    """The words and what they say, as README.md shows them."""
    rows = [(f"`{flag.word}`", flag.sentence) for flag in sorted(Quality, key=_word)]
    return table(("quality word", "what it says of the row"), rows)


def quality_page() -> str:
    """The words with the tables they stand in and what their rows are good for."""
    rows = [
        (
            f"`{flag.word}`",
            flag.sentence,
            ", ".join(f"`{name}`" for name in flag.tables),
            "; ".join(use.value for use in flag.good_for) or "no",
        )
        for flag in sorted(Quality, key=_word)
    ]
    return f"""{NOTE.format("tirelog/vocabulary/quality.py")}
# Quality words

The column `quality` of a table is `{OK}`, or words in alphabetical order joined by `;`: what is
wrong inside the patch window of that row. The row stays in the table with all that could be told.
Unless the last column says otherwise, it is left out of pictures, moving averages, regressions,
calibrations, and of the numbers per revolution that are compared with a model. A word that is not
in this list, in a table of another version or tool, is kept and counted, and its row left out too.

{table(("word", "what it says of the row", "tables", "the row is used nevertheless"), rows)}
"""


def _word(flag: Quality) -> str:
    return flag.word


def table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """A Markdown table."""
    lines = [head, ("---",) * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


PAGES: Mapping[str, Callable[[], str]] = {"docs/quality_words.md": quality_page}
README_SECTIONS: Mapping[str, Callable[[], str]] = {"quality words": quality_section}


def readme(text: str) -> str:
    """README.md with each of its sections as the registers give it."""
    for name, made in README_SECTIONS.items():
        begin, end = f"<!-- {name}: made by `make docs` -->\n", f"\n<!-- end of {name} -->"
        if len(re.findall(f"{re.escape(begin)}.*?{re.escape(end)}", text, re.S)) != 1:
            raise SystemExit(f"README.md: not one section {name!r} between its two comments")
        before, rest = text.split(begin)
        text = before + begin + made() + end + rest.split(end)[1]
    return text


def made() -> dict[Path, str]:
    """Every file that is made, with its text."""
    page = ROOT / "README.md"
    return {ROOT / name: text() for name, text in PAGES.items()} | {page: readme(page.read_text())}


if __name__ == "__main__":
    for path, text in made().items():
        path.write_text(text)
