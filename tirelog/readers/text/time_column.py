"""Which column of a text log holds its stamps, in which form and unit.

Layout + Setup --forms of words, names of times, even steps--> column, time of day, form, unit
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise

import numpy as np

from tirelog.data.bounds import PLAUSIBLE
from tirelog.data.setup import Setup
from tirelog.errors import SetupError
from tirelog.readers.rates import unit_by_size
from tirelog.readers.text.column_names import absent, bare, find_column, loose, words
from tirelog.readers.text.layout import SAMPLE_ROWS, Layout
from tirelog.readers.text.times import has_clock
from tirelog.vocabulary import units

TIME_NAMES = re.compile(
    r"(date[ /_]?time|time ?stamp|timestamp.*|.*\btime\b.*|time_.*|.*_time"
    r"|t|t[_ ](s|sec|min|[mnuµμ]s)|sec|seconds|zeit|tempo)",
    re.I,
)
#: words that make a name one of a time, however they are joined: RunningTime_s, elapsed_ms
_TIME_WORDS = {"time", "timestamp", "elapsed", "runtime", "uptime", "zeit", "millis", "micros"}
#: whole names of times, without blanks and underscores: of LabVIEW, of Arduino sketches
_TIMES = {"xvalue", "ms", "us", "ns", "msec", "usec"}
#: last words of a time's name that tell its unit, beside the units themselves
_UNIT_WORDS = {"msec": "ms", "millis": "ms", "milliseconds": "ms", "usec": "us", "micros": "us",
               "microseconds": "us", "nanos": "ns", "nanoseconds": "ns"}  # fmt: skip
_TIME_UNITS = {"s", "sec", "ms", "us", "µs", "μs", "ns", "min", "h"}
#: times whose unit is known from the instrument alone: Xsens sensors count microseconds
_KNOWN_UNITS = {"sampletimefine": "us"}
#: days since 1900 from 1954 to 2119; twice as wide finds no more logs of gratings
_DAYS = (20_000.0, 80_000.0)
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
        and _is_time_name(layout.names[k]) and _falls(layout, k)
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
    found = [k for k, kind in enumerate(kinds) if kind in ("iso", "dmy", "hms")]
    named = [
        k
        for k, text in enumerate(layout.names[: len(kinds)])
        if _is_time_name(text) and kinds[k] == "number"
    ]
    minutes = [k for k, kind in enumerate(kinds) if kind == "mmss"]
    return found + [k for k in named if k not in taken and ascending(layout, k)] + minutes


def _is_time_name(name: str) -> bool:
    """True for the names of times, as programs join their words."""
    plain = bare(name).lstrip("#%/ ")
    return bool(
        TIME_NAMES.fullmatch(plain)
        or _TIME_WORDS.intersection(words(plain))
        or loose(plain) in _TIMES
    )


def _leading(layout: Layout) -> int:
    """The first column that is not blank."""
    return next((k for k, kind in enumerate(layout.kinds[: layout.width]) if kind != "blank"), 0)


def _ramps(layout: Layout, taken: set[int]) -> list[int]:
    """Columns that rise as nothing but a time does, the likeliest first.

    In steps that are not whole: the first column, in even ones if it has a name, whatever that is;
    then any without a name whose steps are nearly equal.
    """
    leading, found = _leading(layout), []
    for k in range(layout.counts_at if layout.counts else layout.width):
        named = k < len(layout.names) and layout.names[k] != ""
        cells = [row[k] for row in layout.rows if len(row) > k]
        steps = steps_of(layout, k) if layout.kinds[k] == "number" and k not in taken else []
        whole = all(layout.decimal not in cell for cell in cells)
        if whole or len(steps) < 2 or min(steps) <= 0.0 or (named and k != leading):
            continue
        usual, spread = float(np.median(steps)), max(steps) - min(steps)
        exponents = any("e" in cell.lower() for cell in cells)
        digit = 1e-6 * usual if exponents else 10.0 ** -most_decimals(cells, layout.decimal)
        if k == leading:
            good = not layout.names or spread <= 2.01 * digit
        else:
            good = spread <= max(2.01 * digit, _NEARLY * usual)
        found += [k] if good else []
    return found


def numbers_of(layout: Layout, column: int) -> list[float]:
    """The numbers of a column in the sample rows, NaN for what is none."""
    numbers = []
    for row in layout.rows:
        number = float("nan")
        with suppress(ValueError):
            number = (
                float(row[column].replace(layout.decimal, ".")) if len(row) > column else number
            )
        numbers.append(number)
    return numbers


def steps_of(layout: Layout, column: int) -> list[float]:
    """Differences between the numbers of a column, row by row.

    The sample rows are those of the head's beginning and of its end; the step between the two parts
    is left out.
    """
    numbers = numbers_of(layout, column)
    steps = [b - a for a, b in pairwise(numbers)]
    if len(numbers) == 2 * SAMPLE_ROWS:
        del steps[SAMPLE_ROWS - 1]
    return [step for step in steps if step == step]


def ascending(layout: Layout, column: int) -> bool:
    """True if a number column hardly ever falls."""
    steps = steps_of(layout, column)
    return sum(step >= 0 for step in steps) >= 0.9 * len(steps)


def _falls(layout: Layout, column: int) -> bool:
    """True if a number column falls and never rises."""
    steps = steps_of(layout, column)
    return bool(steps) and max(steps) <= 0.0 and min(steps) < 0.0


def _with_clock(layout: Layout, setup: Setup, column: int) -> tuple[int, int | None, str, float]:
    """The stamps' column with its form.

    A date alone is joined with the first column of times of day.
    """
    kind = layout.kinds[column]
    if kind in ("iso", "dmy"):
        if any(has_clock(row[column]) for row in layout.rows if len(row) > column):
            return column, None, kind, 1.0
        clock = next((k for k, other in enumerate(layout.kinds) if other == "hms"), None)
        return column, clock, kind, 1.0
    if kind == "hms":
        date = [k for k, other in enumerate(layout.kinds[:column]) if other in ("iso", "dmy")]
        days = [
            k for k in date if not any(has_clock(row[k]) for row in layout.rows if len(row) > k)
        ]
        return (days[0], column, layout.kinds[days[0]], 1.0) if days else (column, None, "hms", 1.0)
    if kind == "mmss":
        return column, None, "mmss", 1.0
    return column, None, "number", time_factor(layout, setup, column)


def time_factor(layout: Layout, setup: Setup, column: int) -> float:
    """Seconds per unit of a numeric time column.

    By the setup's `time_unit`, the header's unit, the name's suffix, the numbers' size, else
    seconds.
    """
    if setup.log.time_unit:
        return units.to_si(setup.log.time_unit, "time")[0]
    unit = stated_unit(layout, column)
    if unit is None and counts_days(layout, column):
        unit = "d"
    if unit is None:  # a date in ms, us or ns since 1970 is known by its size
        cells = [row[column] for row in layout.rows if len(row) > column]
        numbers = [float(cell) for cell in cells if re.fullmatch(r"\d{1,19}", cell)]
        unit = unit_by_size(numbers[0]) if numbers else "s"
    return units.UNITS[unit][1]


def counts_days(layout: Layout, column: int) -> bool:
    """True if these can only be days since 1900, as spreadsheets store dates.

    Their size is that of today's dates, and as seconds they would follow each other faster than
    any instrument samples.
    """
    first, last = _DAYS
    steps = steps_of(layout, column)
    numbers = numbers_of(layout, column)
    return bool(
        steps and min(numbers) >= first and max(numbers) <= last
        and 0.0 < sum(steps) < len(steps) / PLAUSIBLE["sampling_rate_Hz"].high
    )  # fmt: skip


def stated_unit(layout: Layout, column: int) -> str | None:
    """The unit of time that a column's header or name tells, or None."""
    unit = layout.units[column] if column < len(layout.units) else ""
    if not unit and column < len(layout.names):
        name = layout.names[column]
        last = words(name)[-1:] or [""]
        unit = _KNOWN_UNITS.get(loose(name)) or _UNIT_WORDS.get(last[0], "")
        unit = unit or (last[0] if last[0] in _TIME_UNITS else "")
    known = units.canonical(unit) if unit else None
    return known if known and units.UNITS[known][0] == "time" else None


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
