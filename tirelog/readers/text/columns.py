"""Which columns of a text log hold what.

The setup's channels, the time, the sample number, the error codes.

    Layout + Setup --names, else shapes of the cells--> Columns

A channel's `source` is a header's name (its unit suffix may be left out; upper and lower case,
blanks and underscores are forgiven if that leaves one column), or `#3`, the third column.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from tirelog.data.setup import ChannelSetup, Setup
from tirelog.errors import ReadError, SetupError, nearest
from tirelog.readers.base import (
    TIME_NAMES,
    date_of,
    is_of_other_quantity,
    is_signal_name,
    is_time_name,
    joined_words,
    long_form,
    name_without_unit,
    rises_as_time,
    signal_column,
    signals_of,
    stated_time_unit,
    unit_by_size,
    words,
)
from tirelog.readers.text.layout import SAMPLE_ROWS, Layout, filled, is_number
from tirelog.readers.text.times import DATED, FORMS, MISSING, fraction_digits, has_clock, one_ns
from tirelog.vocabulary import units
from tirelog.vocabulary.arrays import FloatArray

# ---- The columns of a text log by their names, as a setup writes them.


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
        name_without_unit,
        lambda text: joined_words(name_without_unit(text)),
        lambda text: joined_words(name_without_unit(text.lstrip("#%/ "))),
    ):
        hits = [k for k, text in enumerate(layout.names) if same(text) == same(source)]
        if len(hits) == 1 or (hits and same is str):
            return hits[0]
    return None


def absent(layout: Layout, source: str) -> str:
    """What is wrong with a source that is no column, and which columns there are."""
    if layout.misfit:
        return (
            f"no column {source!r} can be identified: the header has {len(layout.misfit)} names "
            f"and the rows have {layout.width} cells; allowed are #1 to #{layout.width}"
        )
    if not layout.names:
        return f"no column {source!r}: the log has no header; allowed are #1 to #{layout.width}"
    shown = ", ".join(text for text in layout.names[:12] if text) + (
        ", ..." if len(layout.names) > 12 else ""
    )
    return f"no column {source!r}{nearest(source, layout.names)}; the log's columns are {shown}"


# ---- Which column of a text log holds its stamps, in which form and unit.
#
# Layout + Setup --forms of words, names of times, even steps--> column, time of day, form, unit


#: the line above the names of VBOX files, whose times are hours, minutes, seconds without signs
_COLUMN_NAMES = "[column names]"
#: steps of a column without a name differ by less than this share of the usual one if it is taken
#: for the time: loggers without a clock of their own stray by some percent, signals by all
_NEARLY = 0.5


def stamp_columns(
    layout: Layout, setup: Setup, taken: set[int]
) -> tuple[tuple[int | None, int | None, str, float], bool]:
    """((column, column of the time of day, form, seconds per unit) of the stamps, guessed or not).

    Guessed: neither the setup nor a name nor a form of words makes the column a time.
    """
    if setup.log.time:
        column = find_column(layout, setup.log.time)
        if column is None:
            raise SetupError(
                f"[log] time: {absent(layout, setup.log.time)}",
                do="mend time in the setup",
                file=setup.file,
            )
        return _with_clock(layout, setup, column), False
    best: tuple[int, int | None, str, float] | None = None
    distinct = 0
    for column in _time_candidates(layout, taken):
        candidate = _with_clock(layout, setup, column)
        parts = [c for c in candidate[:2] if c is not None]
        seen = len({tuple(row[c] for c in parts) for row in layout.rows if len(row) > max(parts)})
        if seen > distinct:  # of several, the one with the finest stamps
            best, distinct = candidate, seen
    if best is not None and distinct > 1:
        return best, False
    falling = [
        k
        for k, kind in enumerate(layout.kinds[: layout.width])
        if kind == "number" and k < len(layout.names) and k not in taken
        and is_time_name(layout.names[k]) and max(steps_of(layout, k), default=1.0) <= 0.0
        and min(steps_of(layout, k)) < 0.0
    ]  # fmt: skip
    ramps = _ramps(layout, taken)
    if ramps and (ramps[0] == _leading(layout) or len(ramps) == 1):  # of several, none is plain
        alone = ramps[0] == _leading(layout) and not layout.names
        return _with_clock(layout, setup, ramps[0]), not alone
    if best is None and falling:  # the newest first: only the whole log tells
        return _with_clock(layout, setup, falling[0]), False
    return best or (None, None, "number", 1.0), False


def _time_candidates(layout: Layout, taken: set[int]) -> list[int]:
    """Columns that look like stamps.

    Those whose cells are times, then numbers under a name of time, then minutes and seconds, which
    may be those of a lap.
    """
    kinds = layout.kinds[: layout.width]
    found = [k for k, kind in enumerate(kinds) if kind in (*DATED, "hms")]
    named = [
        k
        for k, text in enumerate(layout.names[: len(kinds)])
        if is_time_name(text) and kinds[k] == "number"
    ]
    minutes = [k for k, kind in enumerate(kinds) if kind == "mmss"]
    return found + [k for k in named if k not in taken and ascending(layout, k)] + minutes


def times_alike(layout: Layout) -> list[int]:
    """Columns of times that have one name, but for a number or that of the column behind them.

    None adjoins another; empty if there are fewer than two.
    """
    families: dict[tuple[str, bool], list[int]] = {}
    # pandas writes a name for the second time with .1
    names = [re.sub(r"\.\d+$", "", name) for name in layout.names[: layout.width]]
    for k, name in enumerate(names):
        if layout.kinds[k] == "number" and is_time_name(name) and ascending(layout, k):
            behind = names[k + 1] if k + 1 < len(names) else ""
            own = words(name_without_unit(name))
            plain = [word for word in own if word not in words(name_without_unit(behind))]
            family = " ".join(word for word in plain if not word.isdigit())
            # a lap time before a lap has another start than the time, and no clock of its own
            families.setdefault((family, plain == own), []).append(k)
    found = max(families.values(), key=len, default=[])
    apart = len(found) > 1 and min(b - a for a, b in pairwise(found)) > 1
    return found if apart and not (layout.ragged or layout.counts) else []


def clocks_of_blocks(layout: Layout, setup: Setup) -> dict[int, float]:
    """Columns of times, each the clock of the columns up to the next, and their seconds per unit.

    Empty if one of them serves all, as their stamps are the same or the setup names another.
    """
    times = times_alike(layout)
    if setup.log.time and find_column(layout, setup.log.time) not in times:
        return {}
    factors = {k: time_factor(layout, setup, k) for k in times}
    stamps = [factors[k] * np.array(numbers_of(layout, k), np.float64) for k in times]
    digits = [factors[k] * 10.0 ** -most_decimals(layout.cells(k), layout.decimal) for k in times]
    for own, digit in zip(stamps[1:], digits[1:], strict=True):
        away = np.abs(own - stamps[0])
        if np.nanmax(away, initial=0.0) > 1.01 * max(digit, digits[0]):
            return factors
    return {}


def _leading(layout: Layout) -> int:
    """The first column that is not blank."""
    return next((k for k, kind in enumerate(layout.kinds[: layout.width]) if kind != "blank"), 0)


def _ramps(layout: Layout, taken: set[int]) -> list[int]:
    """Columns that rise as nothing but a time does, the likeliest first.

    In steps that are not whole: the first column, in even ones if it has a name, unless that is of
    another quantity; then any without a name whose steps are nearly equal.
    """
    leading, found = _leading(layout), []
    for k in range(layout.counts_at if layout.counts else layout.width):
        named = layout.name(k) != ""
        if layout.kinds[k] != "number" or k in taken or (named and k != leading):
            continue
        if is_of_other_quantity(layout.name(k), layout.unit(k)):
            continue
        cells = layout.cells(k)
        digit = 10.0 ** -most_decimals(cells, layout.decimal)
        if any("e" in cell.lower() for cell in cells):
            digit = 1e-6 * float(np.median(steps_of(layout, k) or [0.0]))
        if all(layout.decimal not in cell for cell in cells):
            digit = 1.0
        slack = 0.0 if named else _NEARLY
        if k == leading and not layout.names:
            slack = np.inf
        good = all(rises_as_time(part, digit, slack) for part in successive(layout, k))
        found += [k] if good else []
    return found


def numbers_of(layout: Layout, column: int) -> list[float]:
    """The numbers of a column in the sample rows, NaN for what is none."""
    cells = [row[column] if len(row) > column else "" for row in layout.rows]
    return [
        float(cell.replace(layout.decimal, ".")) if is_number(cell, layout.decimal) else np.nan
        for cell in cells
    ]


def successive(layout: Layout, column: int) -> list[FloatArray]:
    """The numbers of a column in rows that follow each other, NaN for what is none.

    The sample rows are those of the head's beginning, and of its end if it has more.
    """
    numbers = np.array(numbers_of(layout, column), np.float64)
    apart = numbers.size == 2 * SAMPLE_ROWS
    return np.split(numbers, [SAMPLE_ROWS] if apart else [])


def steps_of(layout: Layout, column: int) -> list[float]:
    """Differences between the numbers of a column, row by row, where rows follow each other."""
    steps = np.concatenate([np.diff(part) for part in successive(layout, column)])
    found: list[float] = steps[~np.isnan(steps)].tolist()
    return found


def ascending(layout: Layout, column: int) -> bool:
    """True if a number column hardly ever falls."""
    steps = steps_of(layout, column)
    return sum(step >= 0 for step in steps) >= 0.9 * len(steps)


def _with_clock(layout: Layout, setup: Setup, column: int) -> tuple[int, int | None, str, float]:
    """The stamps' column with its form.

    A date alone is joined with the first column of times of day.
    """
    kind = layout.kinds[column]
    dates = [
        k
        for k, other in enumerate(layout.kinds)
        if other in DATED and not any(map(has_clock, layout.cells(k)))
    ]
    if column in dates:
        clock = next((k for k, other in enumerate(layout.kinds) if other == "hms"), None)
        return column, clock, kind, 1.0
    if kind == "hms" and dates and dates[0] < column:
        return dates[0], column, layout.kinds[dates[0]], 1.0
    if kind in FORMS:
        return column, None, kind, 1.0
    if kind == "number" and _COLUMN_NAMES in map(str.lower, layout.preamble):
        return column, None, "hhmmss", 1.0
    return column, None, "number", time_factor(layout, setup, column)


def time_factor(layout: Layout, setup: Setup, column: int) -> float:
    """Seconds per unit of a numeric time column."""
    return units.UNITS[time_unit(layout, setup, column)][1]


def time_unit(layout: Layout, setup: Setup, column: int) -> str:
    """The unit of a numeric time column.

    The setup's, the header's, the name's suffix, by the numbers' size, else seconds.
    """
    if given := setup.log.time_unit:
        units.to_si(given, "time")
        return units.canonical(given) or given
    return stated_unit(layout, column) or unit_by_size(successive(layout, column)[0])


def stated_unit(layout: Layout, column: int) -> str | None:
    """The unit of time that a column's header or name tells, or None."""
    return stated_time_unit(layout.name(column), layout.unit(column))


def most_decimals(cells: Sequence[str], decimal: str) -> int:
    """The most decimals of these cells; 0 for whole numbers."""
    return max(
        (
            len(cell.split(decimal)[1])
            for cell in cells
            if cell.count(decimal) == 1 and "e" not in cell.lower()
        ),
        default=0,
    )


#: a channel of edges has no column: its stamps are the signal
EDGES = "edges"
_NUMBER_NAMES = re.compile(
    r"(line|sample|frame|scan|row|record|packet)?[ _]*"
    r"(no\.?|nr\.?|number|counter|count|index|idx|#)"
    r"|sample|frame|scan|record|n",
    re.I,
)
#: last columns that rows leave out if they are blank
_REMARKS = re.compile(r"comments?|remarks?|notes?|kommentare?|bemerkung(en)?", re.I)
#: words of names of columns of error codes: Error status, CH1_error, FaultBits
_ERROR_WORDS = {"error", "errors", "errorcode", "errorcodes", "errorstatus", "fault", "faults"}
#: a bracket behind a name that holds letters, so that it may be meant for a unit
_STRANGE_UNIT = re.compile(r"\S\s*[\[(]\s*([^\[\]()]*[^\W\d_%][^\[\]()]*|%)\s*[\])]$")


@dataclass(frozen=True)
class Columns:
    """Column indices, from 0.

    `values` channel -> column; `peaks` channels that are found by wavelength; `missing` channel ->
    why its column is not there; `time` the column of the stamps and `clock` a second one with the
    time of day if `time` holds the date alone; `form` their form ('number' with `time_factor`
    seconds per unit); `number` the sample number; `errors` the column of error codes; `edges`
    channels whose samples are the rows themselves, each at its stamp; `guessed` is true if nothing
    but the stamps' even steps makes that column the time; `clocks` the columns of times and their
    seconds per unit, if the columns up to the next one have each their own: then `time` is None.
    """

    values: dict[str, int]
    peaks: tuple[str, ...] = ()
    missing: dict[str, str] = field(default_factory=dict)
    time: int | None = None
    clock: int | None = None
    form: str = "number"
    time_factor: float = 1.0
    number: int | None = None
    errors: int | None = None
    edges: tuple[str, ...] = ()
    guessed: bool = False
    clocks: dict[int, float] = field(default_factory=dict)

    def time_of(self, channel: str) -> int:
        """The column of times, of `clocks`, that a channel's column has."""
        before = [k for k in self.clocks if k < self.values[channel]]
        return max(before, default=min(self.clocks))


def assign_columns(layout: Layout, setup: Setup, name: str) -> Columns:
    """The columns of the setup's channels.

    ReadError if none is there; SetupError if `[log] time` names no column.
    """
    values: dict[str, int] = {}
    missing: dict[str, str] = {}
    peaks, edges = [], []
    for channel, what in setup.channels.items():
        if _is_edges(layout, what):
            edges.append(channel)
            continue
        if by_wavelength(layout, what):
            peaks.append(channel)
            continue
        column = find_column(layout, what.source)
        if column is None:
            missing[channel] = absent(layout, what.source)
        else:
            values[channel] = column
    refuse_long_form(layout, name)
    if not values and not peaks and not edges:
        raise ReadError(
            "; ".join(dict.fromkeys(missing.values())) + "; mend source in the setup", file=name
        )
    clocks = {} if peaks or edges else clocks_of_blocks(layout, setup)
    if clocks and values:
        taken = {*values.values(), *clocks}
        errors = next(iter(_error_columns(layout, taken)), None)
        return Columns(values, missing=missing, errors=errors, clocks=clocks)
    (time, clock, form, factor), guessed = stamp_columns(layout, setup, set(values.values()))
    if edges and not guessed and time is None:
        time = _of_edges(layout, name)
        factor = time_factor(layout, setup, time)
    if edges and time is not None and form == "number":
        _check_edges(layout, setup, time)
    number = _sample_number(layout, {*values.values(), time})
    errors = next(iter(_error_columns(layout, {*values.values(), time, clock, number})), None)
    return Columns(
        values, tuple(peaks), missing, time, clock, form, factor, number, errors, tuple(edges),
        guessed,
    )  # fmt: skip


def refuse_long_form(layout: Layout, name: str) -> None:
    """ReadError: the rows hold one signal after the other, named in a column of words."""
    column, signals = signals_of(*_names_and_kinds(layout), layout.cells)
    if signals:
        raise long_form(signals, layout.name(column) or f"#{column + 1}", name)


def one_signal(layout: Layout) -> tuple[int, str] | None:
    """The column of words that names the signal of each row, and its one name in the sample rows.

    None if there is none. Rows of another signal may follow, in a table that is sorted by it.
    """
    named = signal_column(*_names_and_kinds(layout))
    if named is None or layout.kinds[named] != "text":
        return None
    seen = {*layout.cells(named)}
    by_name = len(seen) == 1 and is_signal_name(layout.name(named))
    return (named, seen.pop()) if by_name else None


def _names_and_kinds(layout: Layout) -> tuple[list[str], Sequence[str]]:
    """The name and the kind of each column."""
    return [layout.name(k) for k in range(layout.width)], layout.kinds[: layout.width]


def clock_columns(layout: Layout, setup: Setup) -> tuple[set[int], str]:
    """(columns of times, sample numbers and error codes, the time's name for a reader or '').

    Those that no channel of the setup need name.
    """
    (time, clock, _, _), _ = stamp_columns(layout, setup, set())
    number = _sample_number(layout, {time})
    errors = _error_columns(layout, {time, clock, number})
    taken = {k for k in (time, clock, number, *errors, *times_alike(layout)) if k is not None}
    if time is None:
        return taken, ""
    return taken, name_of_column(layout, time)


def name_of_column(layout: Layout, column: int) -> str:
    """How a setup names a column: by its header if that is the only such, else #1, #2, ..."""
    name = layout.name(column)
    return name if name and find_column(layout, name) == column else f"#{column + 1}"


def _is_edges(layout: Layout, channel: ChannelSetup) -> bool:
    """True for an encoder whose edges' times are all that the log holds."""
    named = channel.kind == "wheel_encoder" and channel.source == EDGES
    return named and find_column(layout, EDGES) is None


def _of_edges(layout: Layout, name: str) -> int:
    """The column of the edges' times if none is named as a time: the first that only rises.

    ReadError: there is none.
    """
    for k, kind in enumerate(layout.kinds[: layout.width]):
        steps = steps_of(layout, k)
        if kind == "number" and steps and min(steps) >= 0.0 and max(steps) > 0.0:
            return k
    raise ReadError(
        "source = 'edges', and no column rises as the times of edges do",
        allowed="allowed is a column of times",
        do='write time = "#1" under [log] in the setup',
        file=name,
    )


def _check_edges(layout: Layout, setup: Setup, time: int) -> None:
    """SetupError: the times of the edges are whole numbers, and nothing says of what."""
    whole = all(layout.decimal not in row[time] for row in layout.rows if len(row) > time)
    if whole and setup.log.time_unit is None and stated_unit(layout, time) is None:
        raise SetupError(
            "the times of the edges are whole numbers without a unit",
            allowed="allowed are s, ms, us, ns",
            do='write time_unit = "us" under [log]',
            file=setup.file,
        )


def placed(layout: Layout) -> Layout:
    """The layout with each name on the column that it names.

    Without names if that is uncertain.

    A header one name shorter than the rows begins one to the right of an unnamed row number. R
    writes it so, and pandas reads it so. One that ends with a column of remarks, as LabVIEW's does,
    may be a name longer: a remark that is not made is not even a blank cell. Any other difference
    may be a separator too many or too few anywhere, and every column behind it would be its
    neighbour.
    """
    names = layout.names
    if not names or layout.ragged or layout.counts or len(names) == layout.width:
        return _lone_mark(layout)
    blank = layout.kinds[layout.width - 1] == "blank"
    behind = layout.kinds[len(names) : layout.width]
    if behind and all(kind == "blank" for kind in behind):  # separators behind the last cell
        return layout
    if len(names) == layout.width + 1 and _REMARKS.fullmatch(name_without_unit(names[-1])):
        return replace(layout, width=len(names), kinds=(*layout.kinds[: layout.width], "blank"))
    if len(names) == layout.width - blank - 1 and _is_row_number(layout):
        more = ("",) * blank
        return replace(
            layout, names=("", *names, *more), units=("", *layout.units, *more), counter=True
        )
    # a list of peaks behind fewer names: what comes first is first
    kept = names[:1] if len(names) < layout.width - 1 else ()
    fill = ("",) * (layout.width - 1) if kept else ()
    return replace(
        layout, names=kept + fill, units=layout.units[:1] + fill if kept else (), misfit=names
    )


def _lone_mark(layout: Layout) -> Layout:
    """The layout without a lone `#` that is no name.

    A lone `#` names a row number; over anything else it is the mark of a comment, and the names
    behind it are one too far right.
    """
    if (
        layout.ragged
        or layout.names[:1] not in (("#",), ("%",), ("//",))
        or _whole_and_rising(layout, 0)
    ):
        return layout
    return replace(layout, names=(), units=(), misfit=layout.names)


def _is_row_number(layout: Layout) -> bool:
    """True if the first column counts rows without a name of its own.

    As far as the cells show, the name that would be its own is that of the second column.
    """
    first, kinds = name_without_unit(layout.names[0]), layout.kinds
    if not _whole_and_rising(layout, 0) or _NUMBER_NAMES.fullmatch(first):
        return False
    steps = steps_of(layout, 0)
    counts = sum(step == 1 for step in steps) >= 0.5 * len(steps)
    return counts and not (
        TIME_NAMES.fullmatch(first) and kinds[1] == "number" and not ascending(layout, 1)
    )


def _whole_and_rising(layout: Layout, column: int) -> bool:
    """True for whole numbers of which each is larger than the one before."""
    cells = layout.cells(column)
    return all(re.fullmatch(r"\d{1,18}", cell) for cell in cells) and all(
        step > 0 for step in steps_of(layout, column)
    )


def stated_units(layout: Layout, columns: Columns) -> dict[str, str]:
    """What the header says about the unit of each channel, as it is spelt there."""
    stated = {}
    for channel, column in columns.values.items():
        name, unit = layout.name(column), layout.unit(column)
        unknown = _STRANGE_UNIT.search(name)  # a unit that is known has been removed from the name
        if unit or unknown:
            stated[channel] = unit or (unknown[1] if unknown else "")
    lengths = {unit for unit in layout.units if _is_length(unit)}
    if len(lengths) == 1:
        stated |= dict.fromkeys(columns.peaks, lengths.pop())
    return stated


def _is_length(unit: str) -> bool:
    name = units.canonical(unit) if unit else None
    return name is not None and units.UNITS[name][0] == "length"


def by_wavelength(layout: Layout, channel: ChannelSetup) -> bool:
    """True if a grating has to be found by wavelength.

    Its rows hold a varying number of peaks or its column has no name.
    """
    if not channel.kind.startswith("fbg_") or channel.source.startswith("#"):
        return False
    unnamed = bool(layout.misfit)
    if (
        layout.counts > 0
        or (layout.ragged and not _keeps_places(layout))
        or (unnamed and not layout.ragged)
    ):
        return True
    return channel.window_nm is not None and (
        layout.ragged or find_column(layout, channel.source) is None
    )


def _keeps_places(layout: Layout) -> bool:
    """True if rows are shorter only as blank cells at their ends are left out.

    Others hold blanks inside of them.
    """
    blanks = any("" in row[: filled(row)] for row in layout.rows)
    return blanks and max(map(filled, layout.rows)) <= len(layout.names)


def _sample_number(layout: Layout, taken: set[int | None]) -> int | None:
    """The column of sample numbers: whole numbers under such a name that rise by one step."""
    for k, text in enumerate(layout.names[: layout.width]):
        if (
            k in taken
            or layout.kinds[k] != "number"
            or not _NUMBER_NAMES.fullmatch(name_without_unit(text))
        ):
            continue
        cells = layout.cells(k)
        if not all(re.fullmatch(r"\d+", cell) for cell in cells):
            continue
        steps = [int(b) - int(a) for a, b in pairwise(cells)]
        usual = max(set(steps), key=steps.count, default=1)
        if usual > 0 and steps.count(usual) >= 0.8 * len(steps):
            return k
    return None


def _error_columns(layout: Layout, taken: Collection[int | None]) -> list[int]:
    """The columns of error codes: a whole word of their names says so, not a part of "default"."""
    return [
        k
        for k, name in enumerate(layout.names)
        if k not in taken and _ERROR_WORDS.intersection(words(name))
    ]


def resolution_s(layout: Layout, columns: Columns) -> float:
    """The step of the stamps [s] as written in the sample rows; 0 if the log has none, or many."""
    if columns.time is None:
        return 0.0
    shown = columns.time if columns.clock is None else columns.clock
    texts = layout.cells(shown)
    if columns.form == "number":
        return columns.time_factor * 10.0 ** -most_decimals(texts, layout.decimal)
    return 10.0 ** -max(map(fraction_digits, texts), default=0)


def start_iso(layout: Layout, columns: Columns, us: bool, setup: Setup) -> str | None:
    """The first stamp in ISO 8601, if it tells a date."""
    if columns.form == "number" and columns.time is not None:
        numbers = successive(layout, columns.time)[0]
        first = next(iter(numbers[~np.isnan(numbers)].tolist()), 0.0)
        return date_of(first, time_unit(layout, setup, columns.time))
    rows = [row for row in layout.rows if len(row) > max(columns.time or 0, columns.clock or 0)]
    if columns.time is None or columns.form not in DATED or not rows:
        return None
    row, shown = rows[0], columns.time if columns.clock is None else columns.clock
    parts = [
        one_ns(row[columns.time], columns.form, us),
        one_ns(row[shown], "hms") if columns.clock is not None else 0,
    ]
    if MISSING in parts:
        return None
    if columns.form == "iso" and columns.clock is None:  # as written, with its offset
        return re.sub(r"[ _]+(?=\d)", "T", row[columns.time], count=1).replace(",", ".")
    text = str(np.datetime64(sum(parts), "ns"))
    return text[: 19 + (digits + 1 if (digits := fraction_digits(row[shown])) else 0)]
