"""Tables to read, on a terminal: columns as wide as their widest cell."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Any


def console_table(
    names: Sequence[str], rows: Iterable[Sequence[Any]], left: Collection[int] = (0,)
) -> Any:
    """A table for a `page`: numbers with four digits, nothing for None; `left` columns of words."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    for i, name in enumerate(names):
        table.add_column(name, justify="left" if i in left else "right")
    for row in rows:
        table.add_row(
            *(f"{v:.4g}" if isinstance(v, float) else "" if v is None else str(v) for v in row)
        )
    return table


def aligned(rows: Iterable[tuple[str, ...]], indent: str = "  ") -> str:
    """Rows of text in columns, all to the left, as a text."""
    rows = list(rows)
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))] if rows else []
    return "\n".join(
        (indent + "  ".join(cell.ljust(w) for cell, w in zip(row, widths))).rstrip() for row in rows
    )
