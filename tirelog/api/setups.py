"""Setups: what is in a log that nobody has described, a first draft, and what is left to do."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as File
from typing import Any

from tirelog.api.logs import Path, as_setup
from tirelog.data.setup import Setup
from tirelog.drafts import contents as inside
from tirelog.drafts.contents import Contents, FoundSeries
from tirelog.drafts.setup import Finding, SetupDraft, draft, findings
from tirelog.errors import UsageError
from tirelog.runs.ingest import open_recording
from tirelog.storage.whole import whole_file
from tirelog.tables.check import Difference, as_table, differences, of_like_logs, summary
from tirelog.tables.frame import read_table

__all__ = [
    "Contents", "FoundSeries", "SetupCheck", "check_setup", "contents", "contents_rows",
    "draft_setup",
]  # fmt: skip

#: a log is looked into as far as its first blocks; twice as many take twice as long
_BLOCKS = 48


@dataclass(frozen=True)
class SetupCheck:
    """What a setup makes of its log.

    channels   (name, kind, rate [Hz], duration [s]) of each
    findings   what is implausible, missing, unused or still guessed
    lost       is something of the log lost
    """

    channels: tuple[tuple[str, str, float, float], ...]
    findings: tuple[Finding, ...]
    lost: bool

    @property
    def implausible(self) -> bool:
        """True if the setup says of a channel what no tire can read."""
        return any(one.about == "implausible" for one in self.findings)


def contents(log: Path) -> inside.Contents:
    """What is in a log without a setup: its series of numbers, with ranges and likely kinds.

    Raises
    ------
    ReadError
        Nothing of the log could be read.
    """
    return inside.contents(os.fspath(log))


def contents_rows(found: inside.Contents) -> dict[str, Any]:
    """Columns of `tirelog info` of a log without a setup: a row per series."""
    return inside.rows(found)


def draft_setup(log: Path, output: Path | None = None) -> SetupDraft:
    """A first setup of a log, from what it holds; what is guessed is marked.

    Parameters
    ----------
    log : str or os.PathLike
        A log without a setup.
    output : str or os.PathLike, optional
        The setup file to write.

    Returns
    -------
    SetupDraft
        ``text`` (TOML), the numbers of ``channels`` and of ``guesses``.

    Raises
    ------
    ReadError
        Nothing of the log could be read.
    """
    made = draft(os.fspath(log), None if output is None else os.fspath(output))
    if output is not None:
        with whole_file(File(output)) as part:
            part.write_text(made.text, encoding="utf-8")
    return made


def check_setup(log: Path, setup: Path | Setup | None = None) -> SetupCheck:
    """What is implausible, missing, unused or still guessed in the setup of a log.

    Parameters
    ----------
    log : str or os.PathLike
        The log.
    setup : str, os.PathLike or Setup, optional
        Its setup; without it the TOML file beside it.

    Returns
    -------
    SetupCheck
        ``findings``, sentences by what they are about; ``channels``; ``implausible``; ``lost``.

    Raises
    ------
    ReadError, SetupError
        The log cannot be read, or the setup is none.

    Examples
    --------
    >>> import tirelog
    >>> tirelog.check_setup("sample_data/drive.csv.gz").channels[0]
    ('strain_1', 'fbg_strain', 2500.0, 39.9996)
    """
    name = os.fspath(log)
    with open_recording(name, as_setup(setup), blocks=_BLOCKS, check=False) as recording:
        found = findings(recording, name)
        channels = tuple(
            (name, channel.kind, channel.axis.rate_Hz, channel.axis.duration_s)
            for name, channel in recording.channels.items()
        )
        return SetupCheck(channels, tuple(found), bool(recording.losses))


# ---- Does a table still say what an earlier one said?


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
