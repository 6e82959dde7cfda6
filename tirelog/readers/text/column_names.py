"""The columns of a text log by their names, as a setup writes them."""

from __future__ import annotations

import re

from tirelog.errors import nearest
from tirelog.readers.text.layout import Layout


def find_column(layout: Layout, source: str) -> int | None:
    """The column of a source, None if there is none."""
    if match := re.fullmatch(r"#(\d+)", source.strip()):
        column = int(match[1]) - 1
        return column if 0 <= column < max(layout.width, len(layout.kinds)) else None
    if not source.strip():
        return None
    for same in (
        str,
        str.strip,
        bare,
        lambda text: loose(bare(text)),
        lambda text: loose(bare(text.lstrip("#%/ "))),
    ):
        hits = [k for k, text in enumerate(layout.names) if same(text) == same(source)]
        if len(hits) == 1 or (hits and same is str):
            return hits[0]
    return None


def bare(name: str) -> str:
    """A name without the unit in brackets behind it."""
    return re.sub(r"\s*[\[(][^\[\]()]*[\])]\s*$", "", name).strip()


def loose(name: str) -> str:
    """A name in lower case, without blanks, underscores, points and hyphens."""
    return re.sub(r"[\s_.\-]+", "", name).lower()


def words(name: str) -> list[str]:
    """The words of a name in lower case: RunningTime_s is running, time, s."""
    return [word.lower() for word in re.findall(r"[^\W\d_]?[^\W\d_A-Z]+|[A-Z]+|\d+", name)]


def absent(layout: Layout, source: str) -> str:
    """What is wrong with a source that is no column, and which columns there are."""
    if layout.misfit:
        return (
            f"no column {source!r} can be told: the header has {len(layout.misfit)} names and "
            f"the rows have {layout.width} cells; allowed are #1 to #{layout.width}"
        )
    if not layout.names:
        return f"no column {source!r}: the log has no header; allowed are #1 to #{layout.width}"
    shown = ", ".join(text for text in layout.names[:12] if text) + (
        ", ..." if len(layout.names) > 12 else ""
    )
    return f"no column {source!r}{nearest(source, layout.names)}; the log's columns are {shown}"
