"""Does a table still say what an earlier one said?"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as File
from typing import Any

from tirelog.api.logs import Path
from tirelog.errors import UsageError
from tirelog.storage.whole import whole_file
from tirelog.tables.check import Difference, as_table, differences, of_like_logs, summary
from tirelog.tables.frame import read_table


@dataclass(frozen=True)
class TableCheck:
    """What moved between two tables, largest first, and sentences on it."""

    differences: tuple[Difference, ...]
    remarks: tuple[str, ...]

    @property
    def columns(self) -> dict[str, Any]:
        """Columns of `tirelog check`: a row per difference."""
        return as_table(list(self.differences))


def check(table: Path, against: Path, tolerance: Mapping[str, float] | None = None) -> TableCheck:
    """The rows of a table that are not as in an earlier one.

    Parameters
    ----------
    table, against : str or os.PathLike
        Tables as files; ``"-"`` is csv on standard input. Rows are matched by the log's path as it
        was typed; if not one path is in both, by the log's file name, which is said.
    tolerance : mapping of str to float, optional
        Absolute ones by column, in place of the columns' own.

    Returns
    -------
    TableCheck
        ``differences``, none if the tables agree; ``columns``; ``remarks``.

    Raises
    ------
    ReadError
        One of them is no table.
    UsageError
        A tolerance for a column that is not there.
    """
    new, old, remark = of_like_logs(read_table(os.fspath(table)), read_table(os.fspath(against)))
    found = differences(new, old, tolerance or {})
    return TableCheck(tuple(found), tuple(line for line in (remark, summary(found)) if line))


def bless(table: Path, against: Path) -> None:
    """A table copied over the one that it is checked against, on purpose.

    Raises
    ------
    UsageError
        The table is standard input, which cannot be copied.
    ReadError
        It is no table; the other one stays.
    """
    if str(table) == "-":
        raise UsageError(
            "--bless wants a file",
            allowed="standard input cannot be copied",
            do="write the table with -o first",
        )
    read_table(os.fspath(table))  # nothing that is no table takes the other's place
    with whole_file(File(against)) as part:
        part.write_bytes(File(table).read_bytes())
