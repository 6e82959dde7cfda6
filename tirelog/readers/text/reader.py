"""Text logs: what an interrogator or a logger wrote, as blocks of the setup's channels.

    path or stream --source--> whole lines --layout--> Layout --columns--> Columns
                   --parse, two blocks at once--> rows
                       --here: lost samples, stamps, flags--> RawBlock

What happens to a row that is not like the others: a cell that is no number is NaN and counted; a
row of the wrong width keeps its place with NaN if its stamp can be read (or if the log has none);
so does a row of numbers whose stamp cannot; any other is left out, and so is a last row that is cut
off. All of these are losses, which name their first line. Samples that the instrument marks as lost
are NaN and counted.
"""

from __future__ import annotations

import math
import re
from collections import Counter, deque
from collections.abc import Generator, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from tirelog.data.setup import PLAUSIBLE, Setup
from tirelog.errors import ReadError, SetupError
from tirelog.readers.base import (
    MOST_SERIES,
    Group,
    RawBlock,
    ReadReport,
    Series,
    SeriesList,
    days_since,
    long_form,
    of_damaged,
    rate_in_words,
    runs,
    with_stated_units,
)
from tirelog.readers.text.columns import (
    Columns,
    assign_columns,
    clock_columns,
    most_decimals,
    name_of_column,
    numbers_of,
    one_signal,
    placed,
    refuse_long_form,
    resolution_s,
    start_iso,
    stated_unit,
    stated_units,
    successive,
    time_unit,
)
from tirelog.readers.text.layout import (
    LOST_WORDS,
    Layout,
    counts_add_up,
    is_number,
    sniff,
    split_cells,
)
from tirelog.readers.text.parse import LARGEST, TICK_PLACES, Parsed, RowPlan, parse_block
from tirelog.readers.text.peaks import GratingTracker
from tirelog.readers.text.source import LONGEST_LINE_BYTES, ByteSource
from tirelog.readers.text.times import MISSING, ROUNDS_NS, month_first, unwrapped
from tirelog.vocabulary.arrays import FloatArray, IntArray
from tirelog.vocabulary.quality import Quality

#: the name of the one group of a text log: all columns share the row's clock
GROUP = "rows"
#: what a column of times is called in the plan of rows, where columns have several clocks; no
#: channel has a line end in its name
_CLOCK = "clock\n"
#: threads that parse, and blocks that are parsed or wait to be used at one time
_THREADS, _AHEAD = 2, 4
#: what begins again with times of a form
_ROUNDS = {"hms": "midnight", "hhmmss": "midnight", "mmss": "hour"}
#: stamps above this many seconds are kept as whole numbers until the first one is subtracted
_EXACT_ABOVE_S = 1e6


def open_text(source: Path | str | BinaryIO, setup: Setup, log_name: str) -> TextReader:
    """A reader of the text log at a path or in a binary stream (which need not seek).

    ReadError: no text, no rows, none of the setup's channels in it, or a SetupError's reason in a
    log that is damaged. SetupError: `[log] time` names no column.
    """
    opened = ByteSource(source, log_name)
    try:
        return TextReader(opened, setup, log_name)
    except (ReadError, SetupError) as problem:
        damage = opened.damage()
        opened.close()
        if not damage or damage in problem.message:
            raise
        raise of_damaged(damage, problem, log_name) from None


class TextReader:
    """An open text log (`tirelog.readers.base.LogReader`)."""

    def __init__(self, source: ByteSource, setup: Setup, name: str) -> None:
        self.name, self._source = name, source
        self.layout = placed(sniff(source.head(), name, setup.log))
        self.columns = assign_columns(self.layout, setup, name)
        setup, said = with_stated_units(setup, stated_units(self.layout, self.columns))
        self.setup = setup
        self._plan = _plan(self.layout, self.columns)
        self.report = ReadReport(
            format="text" if source.kind == "plain" else f"text, {source.kind}"
        )
        self.report.start = start_iso(self.layout, self.columns, self._plan.us, setup)
        self.report.remarks += said + _about_names(self.layout, self.columns) + _about_time(self)
        self.report.losses += self.layout.losses
        self.report.losses += [
            f"channel {channel}: {why}" for channel, why in self.columns.missing.items()
        ]
        channels = [c for c in setup.channels if c not in self.columns.missing]
        self._tracker = (
            GratingTracker({c: setup.channels[c] for c in self.columns.peaks})
            if self.columns.peaks
            else None
        )
        self.groups = self._groups(channels)
        self._origin: int | float | None = None
        self._last_ns: int | None = None
        self._bad: dict[str, list[tuple[int, str]]] = {"row": [], "cell": []}
        self._seen: set[str] = set()
        self._signal = one_signal(self.layout)

    def _groups(self, channels: list[str]) -> tuple[Group, ...]:
        """All channels, or those of each clock if their columns have several."""
        columns, layout = self.columns, self.layout
        if not columns.clocks:
            return (self._group(tuple(channels)),)
        members: dict[int, list[str]] = {}
        for channel in channels:
            members.setdefault(columns.time_of(channel), []).append(channel)
        self._times = list(members)
        return tuple(
            Group(
                f"{GROUP}_{time + 1}",
                tuple(own),
                stamp_resolution_s=resolution_s(layout, replace(columns, time=time)),
            )
            for time, own in members.items()
        )

    def _group(self, channels: tuple[str, ...]) -> Group:
        columns, layout = self.columns, self.layout
        counted = False
        if columns.number is not None:
            parts = [k for k in (columns.time, columns.clock) if k is not None]
            stamps = [
                tuple(row[k] for k in parts)
                for row in layout.rows
                if len(row) > max(parts, default=0)
            ]
            counted = not parts or len(set(stamps)) < 0.7 * len(stamps)
        rate = rate_in_words(layout.preamble)
        return Group(
            GROUP, channels, rate, resolution_s(layout, columns), counted,
            edges=bool(columns.edges),
        )  # fmt: skip

    def blocks(self) -> Iterator[RawBlock]:
        """All rows, block by block."""
        try:
            rows, line = 0, self.layout.first_line
            with closing(self._parsed()) as blocks:
                for parsed in blocks:
                    self._bad["row"] += [(line + at, what) for at, what in parsed.bad_rows]
                    self._bad["cell"] += [(line + at, what) for at, what in parsed.bad_cells]
                    line += parsed.lines
                    if parsed.size:
                        rows += parsed.size
                        block = self._block(parsed)
                        if self.columns.clocks:
                            yield from self._by_clock(block, parsed)
                        else:
                            yield block
            self._finish(rows, line)
        finally:
            self._source.close()

    def _parsed(self) -> Generator[Parsed]:
        """Parsed blocks in order, while others are read and used.

        Parsing leaves the interpreter's lock.
        """
        waiting: deque[Future[Parsed]] = deque()
        with ThreadPoolExecutor(_THREADS, "tirelog-text") as pool:
            for block in self._source.blocks(self.layout.skip, returns=self.layout.returns):
                if self._signal:
                    self._check_signal(block, *self._signal)
                waiting.append(pool.submit(parse_block, self._plan, self._whole(block)))
                if len(waiting) == _AHEAD:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()

    def _check_signal(self, block: bytes, column: int, signal: str) -> None:
        """ReadError: a row is not of the signal that the first rows name."""
        layout = self.layout
        spelt = re.escape(signal).encode(layout.encoding, "replace")
        cell = re.compile(rb"(?:^|[,;|\s])[\"' ]*" + spelt + rb"[\"' ]*(?=[,;|\s]|$)", re.MULTILINE)
        if len(cell.findall(block)) >= block.count(b"\n"):
            return
        others = Counter[str]()
        for line in block.decode(layout.encoding, "replace").splitlines():
            cells = split_cells(line.replace(layout.quote, '"'), layout.separator, layout.timed)
            other = cells[column] if len(cells) == layout.width else ""
            if other not in ("", signal, *layout.names[column : column + 1]):
                others[other] += 1
        for other, rows in others.most_common(1):
            if rows > 1:  # one is a damaged cell
                raise long_form({signal, other}, layout.name(column), self.name)

    def _whole(self, block: bytes) -> bytes:
        """The block without a last row that is cut off."""
        if block.endswith(b"\n"):
            return block
        start = block.rfind(b"\n") + 1
        last = block[start:].decode(self.layout.encoding, errors="replace")
        if not (self._source.problem or cut_off(self.layout, last)):
            return block
        self.report.counts["rows_cut_off"] = 1
        return block[:start]

    def _block(self, parsed: Parsed) -> RawBlock:
        values = {channel: parsed.values[column] for channel, column in self.columns.values.items()}
        flags: list[tuple[str, int, int, Quality]] = []
        before = self.report.counts.get("rows", 0)
        for channel in self.columns.edges:
            values[channel] = np.arange(before, before + parsed.size, dtype=np.float64)
        if self._tracker:
            found, flags = self._tracker.follow(parsed)
            values |= found
        self._seen |= {
            channel for channel in self.columns.peaks if not np.isnan(values[channel]).all()
        }
        if parsed.errors is not None:
            flags += self._errors(parsed.errors)
        self._count("rows", parsed.size)
        channels = (channel for group in self.groups for channel in group.channels)
        ordered = {channel: values[channel] for channel in channels}
        return RawBlock(GROUP, ordered, self._stamps(parsed), parsed.number, tuple(flags))

    def _by_clock(self, block: RawBlock, parsed: Parsed) -> Iterator[RawBlock]:
        """The block's channels clock by clock, without rows that hold nothing of them."""
        stamps_of = [parsed.values[time] * self.columns.clocks[time] for time in self._times]
        if self._origin in (None, np.inf):
            firsts = [stamps[~np.isnan(stamps)][:1] for stamps in stamps_of]
            self._origin = float(np.concatenate(firsts).min(initial=np.inf))
        for group, stamps in zip(self.groups, stamps_of, strict=True):
            lost = [np.isnan(block.values[channel]) for channel in group.channels]
            kept = ~(np.isnan(stamps) & np.logical_and.reduce(lost))
            before = np.append(0, np.cumsum(kept)).tolist()
            yield RawBlock(
                group.name,
                {channel: block.values[channel][kept] for channel in group.channels},
                stamps[kept] - self._origin,
                flags=tuple(
                    (channel, before[start], before[stop], word)
                    for channel, start, stop, word in block.flags
                    if channel in group.channels
                ),
            )

    def _stamps(self, parsed: Parsed) -> FloatArray | None:
        """Seconds from the log's first stamp."""
        stamps, factor = parsed.stamps, self.columns.time_factor
        if stamps is None:
            return None
        known = ~np.isnan(stamps) if stamps.dtype == np.float64 else stamps != MISSING
        if not known.any():
            return np.full(stamps.size, np.nan)
        if stamps.dtype == np.float64:
            self._origin = float(stamps[known][0]) if self._origin is None else self._origin
            return np.asarray((stamps - self._origin) * factor, np.float64)
        ticks = np.asarray(stamps, np.int64)
        if round_ns := ROUNDS_NS.get(self.columns.form):
            ticks, turns = unwrapped(ticks, self._last_ns, round_ns)
            self._count(f"{_ROUNDS[self.columns.form]}_rollovers", turns)
            self._last_ns = int(ticks[known][-1])
        self._origin = int(ticks[known][0]) if self._origin is None else self._origin
        second = 10**self._plan.tick_places if self.columns.form == "number" else 10**9
        since = np.where(known, ticks - int(self._origin), 0)
        return np.where(known, since * (factor / second), np.nan)

    def _errors(self, codes: IntArray) -> list[tuple[str, int, int, Quality]]:
        """Sample ranges whose rows carry error codes, for every channel.

        The codes do not say whose they are.
        """
        self._count("rows_with_error_codes", int((codes > 0).sum()))
        self._count("error_codes", int(codes.sum()))
        return [
            (channel, start, stop, Quality.ERROR_CODE)
            for start, stop in runs(codes > 0)
            for group in self.groups
            for channel in group.channels
        ]

    def _count(self, what: str, number: int) -> None:
        if number:
            self.report.counts[what] = self.report.counts.get(what, 0) + number

    def _finish(self, rows: int, line: int) -> None:
        """The report, once all is read, which `line` is the first one behind."""
        report = self.report
        if "rows_cut_off" in report.counts:
            report.losses.append(f"line {line}: the last row is cut off and was left out")
        for what, one, several in (
            ("row", "1 row does not parse", "rows do not parse"),
            ("cell", "1 cell is no number", "cells are no numbers"),
        ):
            bad = self._bad[what]
            self._count(f"bad_{what}s", len(bad))
            if bad:
                sentence = one if len(bad) == 1 else f"{len(bad)} {several}"
                report.losses.append(f"{sentence} (first in line {min(bad)[0]}: {min(bad)[1]})")
        said = filter(None, map(_PROMISE.fullmatch, self.layout.preamble))
        promised = max((int(n) for one in said for n in re.findall(r"\d+", one[1])), default=0)
        if rows + len(self._bad["row"]) < promised:
            report.losses.append(
                f"the header promises {promised} samples and {rows} are there: the file is cut "
                "off; copy it again"
            )
        if self._source.endless:
            report.losses.append(
                f"line {line} has no end within {LONGEST_LINE_BYTES >> 20} MB; the rest was not "
                "read"
            )
        if self._source.problem:
            report.damage = self._source.problem
            report.losses.append(f"{self._source.problem}; the rows before it were read")
        if not rows:
            raise ReadError(
                "; ".join(report.losses or ["holds no rows"]) + "; check the recording",
                file=self.name,
            )
        listed = self._plan.listed(max(map(len, self.layout.rows)))
        peaks = [peak for k in listed for peak in numbers_of(self.layout, k)]
        for channel in self.columns.peaks:
            if self._tracker and channel not in self._seen:
                why = self._tracker.why_silent(channel, peaks)
                report.losses.append(f"channel {channel}: {why}")


def _about_names(layout: Layout, columns: Columns) -> list[str]:
    """What was done about a header that is not as wide as the rows."""
    if layout.counter:
        return [
            "the header has one name fewer than the rows have cells; the first cell is taken for "
            "a row number without a name"
        ]
    if layout.misfit:
        names, cells = len(layout.misfit), layout.width
        some = (
            "gratings are found by wavelength, name other columns"
            if columns.peaks
            else "name columns"
        )
        return [
            f"the header's names are not used: it has {names} and the rows have {cells} cells; "
            f"{some} #1 to #{cells}"
        ]
    return []


def _about_time(reader: TextReader) -> list[str]:
    """What was taken for the time though nothing names it so."""
    time, layout, log = reader.columns.time, reader.layout, reader.setup.log
    if time is None:
        return []
    name = layout.name(time)
    by_size = log.time_unit is None and stated_unit(layout, time) is None
    since = days_since(successive(layout, time)[0])
    if reader.columns.form == "number" and by_size and since:
        return [
            f"column #{time + 1}{f' {name!r}' if name else ''} is taken for days since {since} "
            'dates; if it is none of them write time_unit = "s" under [log] in the setup'
        ]
    if not reader.columns.guessed:
        return []
    unit = time_unit(layout, reader.setup, time)
    return [
        f"column #{time + 1}{f' {name!r}' if name else ''} rises in even steps and is taken for "
        f"the time in {unit}; if it is none, name another as time under [log] in the setup"
    ]


#: a line of a preamble that says how many samples follow, of each channel
_PROMISE = re.compile(
    r"[#%/\" ]*(?:samples|(?:number|no\.?|count) of (?:samples|points|rows|records|data points)"
    r"|num_?samples|sample count|record length)\"?\s*[:=,;\t]([\d\s,;\"]+)",
    re.I,
)


def cut_off(layout: Layout, line: str) -> bool:
    """True if a last line without its newline is shorter than the rows before it.

    In cells, in peaks, or in its last decimals.
    """
    cells = split_cells(line.replace(layout.quote, '"'), layout.separator, layout.timed)
    usual = layout.rows[:-1]
    if not usual:
        return len(cells) < layout.width
    if layout.counts:
        if not counts_add_up(cells, layout.counts_at, layout.counts):
            return True
    elif not layout.ragged and len(cells) < layout.width - (
        layout.kinds[layout.width - 1] == "blank"
    ):
        return True
    last, column = cells[-1], len(cells) - 1
    if layout.kinds[min(column, len(layout.kinds) - 1)] != "number" or (
        last and last.lower() in LOST_WORDS
    ):
        return False
    if not is_number(last, layout.decimal):
        return True
    others = [
        row[column] for row in usual if len(row) > column and is_number(row[column], layout.decimal)
    ]
    others = [cell for cell in others if cell not in ("0", "-1")]
    if last in ("0", "-1") and all(len(cell.split(layout.decimal)[0]) > 2 for cell in others):
        return False  # a lost peak among wavelengths
    lengths = {most_decimals([cell], layout.decimal) for cell in others}
    return len(lengths) == 1 and most_decimals([last], layout.decimal) < lengths.pop()


def _plan(layout: Layout, columns: Columns) -> RowPlan:
    own = {f"{_CLOCK} {time + 1}": time for time in columns.clocks}
    columns = replace(columns, values=columns.values | own)
    time = columns.time or 0  # a form of stamp is there only with a column of stamps
    stamps = [row[time] for row in layout.rows if len(row) > time]
    us = columns.form == "dmy" and month_first(stamps)
    exact, tick_places = False, TICK_PLACES
    if columns.form == "number" and columns.time is not None:
        first = next((stamp for stamp in stamps if is_number(stamp, layout.decimal)), "0")
        size = abs(float(first.replace(layout.decimal, ".")))
        exact = size * columns.time_factor > _EXACT_ABOVE_S
        if exact:  # as many decimals as int64 holds of twice the first stamp
            most = LARGEST / (2.0 * min(size, LARGEST))
            tick_places = min(TICK_PLACES, math.floor(math.log10(most)))
            exact = tick_places >= most_decimals(stamps, layout.decimal)
    behind = [
        layout.counts_at + layout.counts - 1 if layout.counts else -1,
        columns.time,
        columns.clock,
        columns.number,
        columns.errors,
    ]
    return RowPlan(
        layout,
        columns,
        us,
        exact,
        max(k for k in behind if k is not None) + 1,
        tick_places=tick_places,
    )


# ---- The columns of a text log, and the gratings in a list of peaks.


#: peaks further apart than this are of two gratings [nm]; those of a fibre lie 5 to 40 nm apart
_APART_NM = 1.0
#: share of the rows in which a grating has its peak
_OFTEN = 0.3


def columns(source: ByteSource, log: str) -> SeriesList:
    """The columns of numbers, or the gratings of a list of peaks.  ReadError: no rows."""
    try:
        layout = placed(sniff(source.head(), log))
    finally:
        source.close()
    refuse_long_form(layout, log)
    taken, time = clock_columns(layout, Setup())
    if layout.counts or layout.ragged or layout.misfit:
        found = _gratings(layout, layout.counts_at + layout.counts, taken)
        if found:
            return SeriesList(found, time)
    kinds = layout.kinds[: layout.width]
    numbers = [k for k, kind in enumerate(kinds) if kind == "number" and k not in taken]
    series = [Series(name_of_column(layout, k), place=f"#{k + 1}") for k in numbers]
    others = tuple(
        name_of_column(layout, k)
        for k, kind in enumerate(kinds)
        if kind == "text" and k not in taken
    )
    return SeriesList(tuple(series[:MOST_SERIES]), time, others)


def _gratings(layout: Layout, begin: int, taken: set[int]) -> tuple[Series, ...]:
    """The gratings whose peaks stand in the sample rows, by wavelength."""
    widest = max(map(len, layout.rows))
    listed = [numbers_of(layout, k) for k in range(begin, widest) if k not in taken]
    written = PLAUSIBLE["reference_wavelength_nm"]
    values = np.sort([peak for column in listed for peak in column if written.holds(peak)])
    if not values.size:
        return ()
    groups = np.split(values, np.flatnonzero(np.diff(values) > _APART_NM) + 1)
    often = [group for group in groups if group.size >= _OFTEN * len(layout.rows)]
    middles = [float(np.median(group)) for group in often]
    series = []
    for k, middle in enumerate(middles):
        gaps = [abs(middle - other) for j, other in enumerate(middles) if j != k]
        reach = min([3.0, *(0.45 * gap for gap in gaps)])
        window = (round(middle - reach, 3), round(middle + reach, 3))
        series.append(Series(f"peak_{middle:.0f}nm", window, "found by wavelength"))
    return tuple(series[:MOST_SERIES])
