"""Results as a notebook shows them: plain HTML, every text escaped."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

from tirelog.errors import printable


def document(title: str, tables: Iterable[str], remarks: Iterable[str] = ()) -> str:
    """A title, tables, and remarks below them."""
    notes = "".join(f"<li>{_text(remark)}</li>" for remark in remarks)
    return f"<p><b>{_text(title)}</b></p>{''.join(tables)}" + (f"<ul>{notes}</ul>" if notes else "")


def table(names: Sequence[str], rows: Iterable[Iterable[Any]]) -> str:
    """A table with a row of names on top."""
    head = "".join(f"<th>{_text(name)}</th>" for name in names)
    body = "".join(f"<tr>{''.join(f'<td>{_text(cell)}</td>' for cell in row)}</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _text(cell: Any) -> str:
    """A cell to read: four digits of a number, nothing if there is none."""
    if cell is None:
        return ""
    return escape(printable(f"{cell:.4g}" if isinstance(cell, float) else str(cell)))
