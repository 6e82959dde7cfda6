"""Rows of tables, part by part: what commands write, and what the DataFrames are made of.

    open log --parts_of, parts_of_drive--> Part (rows of a channel, remarks) --> files, DataFrames

No table is held in memory here, and pandas is not needed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path as File
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.api.logs import Path
from tirelog.data.recording import Recording
from tirelog.errors import UsageError, refuse_unknown
from tirelog.products import (
    MAKERS,
    OF_A_DRIVE,
    Part,
    checked,
    phase_shift_parts,
    tables_of,
    with_channels,
)
from tirelog.vocabulary.tables import LOG_TABLES, STRETCH
from tirelog.vocabulary.units import likely_number

__all__ = [
    "Part", "calibrated", "calibration_notes", "checked_options", "parts_of", "parts_of_drive",
    "refuse_other_tables", "save_calibration",
]  # fmt: skip

if TYPE_CHECKING:
    from tirelog.wheel.calibration import Calibration


def checked_options(name: str, options: Mapping[str, Any]) -> Mapping[str, Mapping[str, Any]]:
    """The given settings (None left out) by the table's name, before any log is opened.

    UsageError: no such table or option, or a value that no log can be made a table with.
    """
    ends = [end.name for end in STRETCH if options.get(end.name) is not None]
    given = {option: value for option, value in options.items() if value is not None}
    wanted = checked({name: {k: v for k, v in given.items() if k not in ends}})
    table = LOG_TABLES[name]
    for option in ends:
        known = [one.name for one in table.asked]
        refuse_unknown(option, known, f"no option of {name} is called {option!r}")
        if table.given(given) != name:
            raise UsageError(f"{table.given(given)} is of the whole log", do=f"leave {option} out")
    return wanted


def refuse_other_tables(names: Collection[str]) -> None:
    """UsageError: one of these is the name of no table."""
    for name in names:
        refuse_unknown(name, MAKERS, f"--table {name}", do="choose among them")


# ---- A stretch of a log: its rows are those of the whole log's table.


def stretch_s(recording: Recording, options: Mapping[str, Any]) -> dict[str, float]:
    """The ends of a stretch that are given, `start` and `stop` [s], as times of the log's tables.

    UsageError: one is no time, or no sample of the log lies between them.
    """
    ends = {
        end.name: _seconds(recording, options[end.name], end.flag)
        for end in STRETCH
        if options.get(end.name) is not None
    }
    if not ends:
        return ends
    axes = [channel.axis for channel in recording.channels.values() if channel.size]
    first = min((float(axis.at(0.0)) for axis in axes), default=0.0)
    last = max((float(axis.at(float(axis.size - 1))) for axis in axes), default=0.0)
    start, stop = ends.get("start", first), ends.get("stop", math.inf)
    if not (start < stop and start <= last and stop > first):
        given = " ".join(f"{e.flag} {ends[e.name]:g}" for e in STRETCH if e.name in ends)
        raise UsageError(
            f"no sample lies in {given}",
            allowed=f"the log goes from {first:g} s to {last:g} s",
            do="give other times",
            file=recording.log,
        )
    return ends


#: an offset from UTC behind a time of day
_OFFSET = re.compile(r"(:\d\d(?:[.,]\d+)?) ?(?:Z|[+-]\d\d:?\d\d)$")


def _seconds(recording: Recording, given: Any, option: str) -> float:
    """A time in seconds since the first sample: a number as it is, a stamp less the first one."""
    with suppress(ValueError, TypeError):
        if math.isfinite(seconds := float(given)):
            return seconds
    from tirelog.readers.text.times import MISSING, form_of, one_ns  # 0.1 s, for stamps alone

    begun, text = str(recording.provenance.get("start") or ""), str(given)
    if bool(_OFFSET.search(begun)) != bool(_OFFSET.search(text)):  # both are of the log's clock
        begun, text = (_OFFSET.sub(r"\1", stamp) for stamp in (begun, text))
    form, of_begin = form_of(text), form_of(begun)
    stamps = [one_ns(a, b) if b else MISSING for a, b in ((text, form), (begun, of_begin))]
    if MISSING in stamps:
        raise UsageError(
            f"{option} {text}",
            allowed="allowed are seconds since the first sample"
            + (f", or a stamp such as {begun}" if of_begin else ""),
            do=likely_number(text) or "correct it",
            file=recording.log,
        )
    after_s = (stamps[0] - stamps[1]) / 1e9
    return after_s % 86_400.0 if form == "hms" else after_s  # a time of day is within one day


def _of_stretch(
    recording: Recording, wanted: Mapping[str, Any], ends: Mapping[str, float], **how: Any
) -> Iterator[Part]:
    """The rows of the `wanted` tables from `start` on and before `stop` [s]."""
    own = {
        name: {**options, **ends} if LOG_TABLES[name].stretch == "own" else options
        for name, options in wanted.items()
    }
    made = tables_of(recording, own, **how)
    return (_within(part, ends) for part in made) if ends else made


def _within(part: Part, ends: Mapping[str, float]) -> Part:
    """The part with the rows of a stretch alone."""
    time = np.asarray(part.columns.get("time_s", ()))
    rows = (time >= ends.get("start", -math.inf)) & (time < ends.get("stop", math.inf))
    columns = {
        name: np.asarray(column)[rows] if np.ndim(column) else column
        for name, column in part.columns.items()
    }
    return replace(part, columns=columns)


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
    `tables_of` and `stretch_s`.
    """
    wanted = checked_options(name, options)
    ends = stretch_s(recording, options)
    one = with_channels(recording, channels, wanted) if channels else recording
    return _of_stretch(one, wanted, ends, refused_first=refused_first)


def parts_of_drive(
    recording: Recording,
    names: Sequence[str] = (),
    channels: Collection[str] = (),
    ends: Mapping[str, Any] = {},
    *,
    workers: int = 1,
    refused_first: bool = False,
    processes: bool = False,
) -> tuple[Iterator[Part], list[str]]:
    """(The rows of several tables, all that suit the log by default, those that do not suit it).

    `ends` are those of a stretch, `start` and `stop`, if given. With `processes` the workers are
    processes where they can be: for a caller that takes rows and remarks alone, and has no threads
    of its own at work.

    UsageError: no such table, or the log suits none.
    """
    refuse_other_tables(names)
    wanted = names or tuple(OF_A_DRIVE)
    one = with_channels(recording, channels, wanted) if channels else recording
    suited = [name for name in wanted if MAKERS[name].suits(one)]
    if not suited:
        raise UsageError(
            f"no channel for {' or '.join(wanted)}",
            allowed="see `tirelog info`",
            do="name one in the setup",
            file=recording.log,
        )
    for name in suited:
        checked_options(name, ends)
    made = _of_stretch(
        one, {name: {} for name in suited}, stretch_s(recording, ends), workers=workers,
        refused_first=refused_first, processes=processes,
    )  # fmt: skip
    return made, [name for name in names if name not in suited]


def calibrated(parts: Iterable[Part], *, forces: bool = False) -> tuple[Calibration, list[Part]]:
    """(The calibration by passages of accelerometers, their rows with it applied).

    `parts` are those of a phase-shift table, with the option `forces` that keeps what maps of
    forces are learnt from. UsageError as `calibrate`.
    """
    from tirelog.wheel.calibration import calibrate

    found = [part.found[0] for part in parts]
    learnt = calibrate(found, forces)
    logs = dict.fromkeys(passages.log for passages in found)
    of_each = ([p for p in found if p.log == log] for log in logs)
    return learnt, [part for own in of_each for part in phase_shift_parts(own, learnt)]


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
    """Remarks for the reader of a phase-shift table on its calibration, or on having none."""
    if calibration is None:
        return (
            "no calibration: the detrended and corrected columns are empty; learn one with "
            "--calibrate FILE",
        )
    from tirelog.wheel.calibration import Calibration, read_calibration

    if not isinstance(calibration, Calibration):
        calibration = read_calibration(File(calibration))
    return (calibration.delay_remark,) if calibration.has_delay else ()
