"""Rows of tables, part by part: what commands write, and what the DataFrames are made of.

    open log --parts_of, parts_of_drive--> Part (rows of a channel, remarks) --> files, DataFrames
                                           --table_picture--> a picture

No table is held in memory here, and pandas is not needed.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path as File
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from tirelog.api.logs import Path
from tirelog.data.recording import Recording
from tirelog.errors import UsageError, refuse_unknown
from tirelog.products import (
    OF_A_DRIVE,
    Part,
    checked,
    phase_shift_parts,
    tables_of,
    with_channels,
)
from tirelog.vocabulary.tables import LogTable

__all__ = [
    "Part", "calibrated", "calibration_notes", "checked_options", "parts_of", "parts_of_drive",
    "refuse_other_tables", "save_calibration", "table_picture",
]  # fmt: skip

if TYPE_CHECKING:
    from tirelog.wheel.calibration import Calibration


def checked_options(name: str, options: Mapping[str, Any]) -> Mapping[str, Mapping[str, Any]]:
    """The options that are given, None left out, by the table's name; nothing has been opened yet.

    UsageError: no such table or option, or a value that no log can be made a table with.
    """
    return checked({name: {k: v for k, v in options.items() if v is not None}})


def refuse_other_tables(names: Collection[str]) -> None:
    """UsageError: one of these is no table of a drive."""
    for name in names:
        refuse_unknown(name, OF_A_DRIVE, f"--table {name}", do="choose among them")


def parts_of(
    recording: Recording,
    name: str,
    options: Mapping[str, Any],
    channels: Collection[str] = (),
    *,
    refused_first: bool = False,
) -> Iterator[Part]:
    """The rows of one table of an open log, part by part, of these channels or of all.

    `options` of None are not given. A part without columns has remarks alone. UsageError as
    `tables_of`.
    """
    wanted = checked_options(name, options)
    one = with_channels(recording, channels, wanted) if channels else recording
    return tables_of(one, wanted, refused_first=refused_first)


def parts_of_drive(
    recording: Recording,
    names: Sequence[str] = (),
    channels: Collection[str] = (),
    *,
    workers: int = 1,
    refused_first: bool = False,
    processes: bool = False,
) -> tuple[Iterator[Part], list[str]]:
    """(The rows of several tables, all that suit the log by default, those that do not suit it).

    With `processes` the workers are processes where they can be: for who takes rows and remarks
    alone, and has no threads of its own at work.

    UsageError: no such table, or the log suits none.
    """
    refuse_other_tables(names)
    wanted = names or tuple(OF_A_DRIVE)
    one = with_channels(recording, channels, wanted) if channels else recording
    suited = [name for name in wanted if OF_A_DRIVE[name].suits(one)]
    if not suited:
        raise UsageError(
            f"no channel for {' or '.join(wanted)}",
            allowed="see `tirelog info`",
            do="name one in the setup",
            file=recording.log,
        )
    empty: dict[str, dict[str, Any]] = {name: {} for name in suited}
    made = tables_of(one, empty, workers, refused_first=refused_first, processes=processes)
    return made, [name for name in names if name not in suited]


@contextmanager
def table_picture(
    table: LogTable, path: Path | None, kind: str = ""
) -> Iterator[Callable[[Recording, Part], None]]:
    """What hears of each part while its log is open; the picture is written to `path` at the end.

    Without a path, or a part, none is drawn. UsageError: the table has no picture, or none of that
    kind (default: its first); what hears says so of a log that it cannot be drawn of.
    """
    if path is not None and not table.picture:
        raise UsageError(f"{table.name} has no picture", do="draw its rows")
    kinds = [kind or next(iter(table.pictures))] if table.pictures else []
    for one in kinds:
        refuse_unknown(one, table.pictures, f"no picture is called {one!r}", do="choose one")
    kept = list[Any]()

    def keep(recording: Recording, part: Part) -> None:
        if path is not None and table.sketch:
            kept.append(resolve_name(table.sketch)(recording, part, *(kinds or [""])))
        elif path is not None:
            kept.append((recording, part))

    yield keep
    if path is not None and kept:
        resolve_name(table.picture)(kept, File(path), *kinds)


def calibrated(
    parts: Iterable[Part], *, forces: bool = False, by_time: bool = False
) -> tuple[Calibration, list[Part]]:
    """(What passages of accelerometers teach, their rows with that applied).

    `parts` are those of a phase-shift table, with the option `forces` that keeps what maps of
    forces are learnt from. UsageError as `calibrate`.
    """
    from tirelog.wheel.calibration import calibrate

    found = [passages for part in parts for passages in part.found.passages]
    learnt = calibrate(found, forces)
    logs = dict.fromkeys(passages.log for passages in found)
    of_each = ([p for p in found if p.log == log] for log in logs)
    return learnt, [part for own in of_each for part in phase_shift_parts(own, learnt, by_time)]


def save_calibration(calibration: Calibration, path: Path) -> None:
    """The calibration as a file for `phase_shift` and ``--calibration``, whole or not at all.

    Parameters
    ----------
    calibration : Calibration
        As `calibrate` gives it.
    path : str or os.PathLike
        The file to write (TOML).

    Returns
    -------
    None

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    from tirelog.wheel.calibration import write_calibration

    write_calibration(File(path), calibration)


def calibration_notes(calibration: Path | Calibration | None) -> tuple[str, ...]:
    """What a reader of a phase-shift table must know of its calibration, or of having none."""
    if calibration is None:
        return (
            "no calibration: the detrended and corrected columns are empty; learn one with "
            "--calibrate FILE",
        )
    from tirelog.wheel.calibration import Calibration, read_calibration

    if not isinstance(calibration, Calibration):
        calibration = read_calibration(File(calibration))
    return (calibration.delay_remark,) if calibration.has_delay else ()
