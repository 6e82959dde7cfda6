"""A sheet of an Excel workbook (xlsx, xls, xlsb, ods) as text: the first that has rows of numbers.

Numbers come as digits that make the same double again, dates and times as ISO 8601.
"""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import Any

from tirelog.readers.extra.child import Answer, NoNumbers, one_line

#: rows of numbers that make a sheet a log, and those of a sheet in which they are looked for
_FEWEST_ROWS, _LOOKED_AT = 2, 10_000


def load() -> None:
    """Imports what reads it."""
    import python_calamine  # noqa: F401


def convert(source: Path, target: Path, answer: Answer) -> None:
    """Writes the rows of one sheet to `target`.  NoNumbers: no sheet has rows of numbers."""
    from python_calamine import CalamineWorkbook

    with source.open("rb") as file, CalamineWorkbook.from_filelike(file) as book:
        names = list(book.sheet_names)
        for name in names:
            sheet = book.get_sheet_by_name(name)
            rows = sheet.iter_rows()
            some = [row for row, _ in zip(rows, range(_LOOKED_AT), strict=False)]
            if sum(any(_is_number(cell) for cell in row) for row in some) < _FEWEST_ROWS:
                continue
            with target.open("w", encoding="utf-8", newline="\n") as made:
                for row in some:
                    made.write(_line(row))
                for row in rows:
                    made.write(_line(row))
            others = [one_line(other) for other in names if other != name]
            if others:
                told = ", ".join(others[:5]) + (", ..." if len(others) > 5 else "")
                answer.remarks.append(
                    f"the sheet {one_line(name)} is read, not {told}; "
                    "save another one as a file of its own to read that"
                )
            return
    raise NoNumbers("no sheet has rows of numbers")


def _is_number(cell: object) -> bool:
    return isinstance(cell, int | float) and not isinstance(cell, bool)


def _line(row: list[Any]) -> str:
    return "\t".join(map(_text, row)).rstrip("\t") + "\n"


def _text(cell: object) -> str:
    if isinstance(cell, bool):
        return str(int(cell))
    if isinstance(cell, int | float):
        return repr(cell)
    if isinstance(cell, dt.timedelta):
        return repr(cell.total_seconds())
    if isinstance(cell, dt.datetime | dt.time):
        return cell.isoformat(timespec="microseconds")
    if isinstance(cell, dt.date):
        return cell.isoformat()
    return " ".join(str(cell).split()).replace('"', "'")
