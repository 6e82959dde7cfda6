"""Lines of a text log cut into cells.

line --time of day in front--> --separators, unless within quotes--> cells
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from contextlib import suppress

#: for `str.translate`: a number stays one, whatever its digits
DIGITS_ALIKE = dict.fromkeys(map(ord, "123456789"), "0")
#: a time of day that ends with a colon and stands before the first separator
TIMED = re.compile(r"^\d{1,2}[-:]\d{1,2}[-:]\d{1,2}(\.\d+)?:\s")


def split_cells(line: str, separator: str, timed: bool = False) -> list[str]:
    """A line's cells, without blanks and quotes around them.

    A separator behind the last cell makes one more, blank cell.
    """
    if timed and (match := TIMED.match(line)):
        line = (
            line[: match.end()].rstrip().rstrip(":")
            + (separator if separator != " " else " ")
            + line[match.end() :]
        )
    cells = line.split() if separator == " " else _apart(line, separator)
    return [cell.strip().strip('"') for cell in cells]


def _apart(line: str, separator: str) -> list[str]:
    """What stands between separators, those inside of quotes left alone."""
    pieces = line.split(separator)
    if '"' in line and any(piece.count('"') % 2 for piece in pieces):
        with suppress(csv.Error):
            cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
            if len(cells) > 1:  # else the quotes are around the whole line
                return cells
    return pieces


class LineCells(dict[int, list[str]]):
    """The cells of lines by their numbers, cut when they are asked for.

    alike  the lines with each digit as a 0: rows of numbers are mostly like a row before
    """

    def __init__(self, lines: list[str], separator: str, timed: bool) -> None:
        super().__init__()
        self._lines, self._how = lines, (separator, timed)
        self.alike = "\n".join(lines).translate(DIGITS_ALIKE).split("\n")

    def enclose(self, number: int, width: int) -> bool:
        """True if a line of `width` cells has separators within them."""
        many = self._lines[number].count(self._how[0])  # counted first, as cells are cut slowly
        return many >= width - self._how[1] and any(self._how[0] in cell for cell in self[number])

    def __missing__(self, number: int) -> list[str]:
        cells = self[number] = split_cells(self._lines[number], *self._how)
        return cells


def filled(cells: Sequence[str]) -> int:
    """Number of cells up to the last one that is not empty."""
    return max((k + 1 for k, cell in enumerate(cells) if cell), default=0)
