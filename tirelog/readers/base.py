"""Bytes to raw blocks: one reader per file format, none of which holds a whole file.

    open_log(path, setup) -> LogReader
        .groups    the channels that share one sample clock, known before the first block
        .blocks()  RawBlock after RawBlock, in the order of the file, for any of the groups
        .report    what was lost, repaired or doubted; complete once the blocks are read to the end

Values are in the *source's* unit, NaN where a sample is blank or no number. `tirelog.runs` finds
lost peaks among them (0 and -1 in all formats), scales to SI and builds the time axis from the
stamps.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tirelog.data.setup import PLAUSIBLE, ChannelSetup, Setup
from tirelog.errors import ReadError, TirelogError
from tirelog.vocabulary import units
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.kinds import KINDS, WAVELENGTH_KINDS
from tirelog.vocabulary.quality import Quality


def without_lost_peaks(values: FloatArray, channel: ChannelSetup) -> FloatArray:
    """Recorded values (n,) with NaN for lost peaks: 0, or what is no wavelength when scaled."""
    if channel.kind not in WAVELENGTH_KINDS:
        return values
    good = values > 0.0
    if channel.scaled:
        factor, offset = channel.scaling
        good = (values != 0.0) & (factor * values + offset > 0.0)
    return values if good.all() else np.where(good, values, np.nan)


def runs(marked: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """(first, behind) of each run of marked samples."""
    edges = np.flatnonzero(np.diff(marked.astype(np.int8), prepend=0, append=0)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


@dataclass(frozen=True)
class Group:
    """Channels sampled together.

    `channels` are names of the setup; `rate_Hz` is what the file itself says (None: the setup or
    the stamps must tell); `stamp_resolution_s` the step of the file's stamps (0 if it is as fine
    as the samples); `counted` is true if the sample number in the file, not the stamp, is the
    clock; `edges` if a sample is an edge at its stamp, and no clock is behind them; `start_s` is
    when samples without stamps begin in the log; `time_example` how a setup could name their times.
    """

    name: str
    channels: tuple[str, ...]
    rate_Hz: float | None = None
    stamp_resolution_s: float = 0.0
    counted: bool = False
    edges: bool = False
    start_s: float = 0.0
    time_example: str = '"#1" (its column)'


@dataclass(frozen=True)
class RawBlock:
    """Some consecutive samples of a group.

    `values[channel]` shape (n,), source unit, NaN where lost; `stamps_s` shape (n,) seconds from
    the first stamp of the log, or None if the file has no stamps; `number` shape (n,) the file's
    own sample numbers (gaps in them are lost samples), or None; `flags` (channel, start, stop,
    word): doubted samples of this block.
    """

    group: str
    values: Mapping[str, FloatArray]
    stamps_s: FloatArray | None = None
    number: FloatArray | None = None
    flags: tuple[tuple[str, int, int, Quality], ...] = ()


@dataclass
class ReadReport:
    """What the reader met.

    `losses` make status 3; each of `remarks` is shown once; `counts` (bad rows, ...) go into the
    provenance. `damage` is the loss by which any row may hold what was never written;
    `passed_over` names what a converted log has beside numbers.
    """

    format: str = ""
    start: str | None = None  # absolute start of the log, ISO 8601, if the file tells it
    losses: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    damage: str = ""
    passed_over: list[str] = field(default_factory=list)


def of_damaged(damage: str, problem: TirelogError, log: str) -> ReadError:
    """The error in place of a `problem` of a damaged log, whose setup may be right."""
    return ReadError(
        f"{damage}; what could be read does not go with its setup: {problem.what}",
        do="copy the log again",
        file=log,
    )


class LogReader(Protocol):
    """An open log."""

    report: ReadReport
    setup: Setup  # as given, with the units that the file itself states

    @property
    def groups(self) -> tuple[Group, ...]:
        """The channels that share one sample clock."""
        ...

    def blocks(self) -> Iterator[RawBlock]:
        """All blocks, once."""
        ...


# ---- What instruments call their sampling rate, wherever a file keeps it.
#
# An attribute, a field, a variable beside the data.


#: name -> True if the value is a period in seconds, False if it is a rate in Hz
RATES = {
    "sampling_rate_Hz": False,
    "sample_rate_Hz": False,
    "sampling_rate": False,
    "sampling_frequency": False,
    "sample_rate": False,
    "SampleRate": False,
    "samplingrate": False,
    "sampling_freq": False,
    "fs": False,
    "rate": False,
    "dt": True,
    "wf_increment": True,
    "wf_dt": True,
    "sampling_interval": True,
    "sample_interval": True,
    "sampling_period": True,
    "sampling_period_s": True,
    "dt_s": True,
}


#: a rate or a period in words, and the number and unit behind it: "data_rate = 2000.0 Hz",
#: "Samples per Second<tab>1", "sampled at 1024", "Delta_X<tab>0.001"
_BEHIND = (
    r"\s*(?:[\[(][^\])]*[\])])?\s*(?:[A-Za-z ]{0,40}[:=]|\bis\b|\bof\b)?[\s,;]*"
    r"\"?(\d+(?:[.,]\d*)?(?:e[+-]?\d+)?)(?![\d.]|,\d|e[+-]?\d)"
)
_IN_WORDS = (
    re.compile(
        r"(?:samples? per second|sampl\w*[ _]?(?:rate|freq(?:uency)?)|sampl(?:ed|ing) at"
        r"|(?:data|acquisition|output|scan|scanning|logging|update)[ _]?(?:rate|frequency|freq)"
        r"|(?<!baud )(?<!bit )(?<!heart )(?<![^\W_])rate\b|\bfs\b)"
        + _BEHIND
        + r"\s*(MHz|k?Hz|k?S/s)?",
        re.I,
    ),
    re.compile(
        r"(?:delta_x|\bdt\b|sampl\w*[ _](?:interval|period|time))"
        + _BEHIND
        + r"\s*(ns|us|µs|ms|s)?\b",
        re.I,
    ),
)
_FACTORS = {"mhz": 1e6, "khz": 1e3, "ks/s": 1e3, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}


def rate_in_words(lines: Iterable[str]) -> float | None:
    """The sampling rate [Hz] that the lines of a preamble tell, or None."""
    for line in lines:
        for pattern, is_period in zip(_IN_WORDS, (False, True), strict=True):
            if match := pattern.search(line):
                number = float(match[1].replace(",", "."))
                number *= _FACTORS.get((match[2] or "").lower(), 1.0)
                if (rate := rate_Hz(number, is_period)) is not None:
                    return rate
    return None


def rate_Hz(value: float | None, is_period: bool) -> float | None:
    """The rate [Hz] that a number states, or None if it states none that is possible."""
    if value is None or not 1e-9 < value < 1e12:
        return None
    return 1.0 / value if is_period else value


# ---- What a series means as a time, whatever format it has.
#
# name, unit, numbers --> is it a time, in which unit, and since when does it count


TIME_NAMES = re.compile(
    r"(date[ /_]?time|time ?stamp|timestamp.*|.*\btime\b.*|time_.*|.*_time"
    r"|t|t[_ ](s|sec|min|[mnuµμ]s)|sec|seconds|zeit|tempo)",
    re.I,
)
#: words that make a name one of a time, however they are joined: RunningTime_s, elapsed_ms
_TIME_WORDS = {
    *("time", "timestamp", "elapsed", "runtime", "uptime", "zeit", "millis", "micros"),
    *("filetime", "epoch"),
}
#: whole names of times, without blanks and underscores: of LabVIEW, of Arduino sketches
_TIMES = {"xvalue", "ms", "us", "ns", "msec", "usec"}
#: last words of a time's name that tell its unit, beside the units themselves
_UNIT_WORDS = {"msec": "ms", "millis": "ms", "milliseconds": "ms", "usec": "us", "micros": "us",
               "microseconds": "us", "nanos": "ns", "nanoseconds": "ns"}  # fmt: skip
_TIME_UNITS = {"s", "sec", "ms", "us", "µs", "μs", "ns", "min", "h"}
#: words in names of what may rise as evenly as a time does, and is none
_OTHER_WORDS = {
    *("distance", "dist", "odometer", "odo", "mileage", "km", "strecke", "weg", "position", "pos"),
    *("lat", "latitude", "lon", "lng", "long", "longitude", "alt", "altitude", "height", "depth"),
    *("angle", "winkel", "heading", "azimuth", "yaw", "pitch", "roll", "turns", "revolutions"),
    *("speed", "velocity", "rpm", "drehzahl", "acc", "accel", "acceleration", "force", "kraft"),
    *("load", "torque", "moment", "strain", "stress", "pressure", "druck", "wavelength", "level"),
    *("temp", "temperature", "temperatur", "volume", "mass", "weight", "fuel", "flow", "energy"),
    *("power", "charge", "voltage", "frequency"),
}
#: times whose unit is known from the instrument alone: Xsens sensors count microseconds
_KNOWN_UNITS = {"sampletimefine": "us"}
#: dates begin here, in 1990; smaller stamps count from some start
EARLIEST_DATE_S = 631_152_000
#: sizes of stamps that are dates: least and most, their unit, seconds from where they count to
#: 1970. FILETIME counts from 1601 (here from 1981 on), .NET from the year 1 (from 1997 to 2092)
_DATES = (
    (1.2e17, 1.6e17, "100ns", 11_644_473_600),
    (6.3e17, 6.6e17, "100ns", 62_135_596_800),
    (1e17, 1e19, "ns", 0),
    (1e14, 1e17, "us", 0),
    (1e11, 1e14, "ms", 0),
    (EARLIEST_DATE_S, 1e11, "s", 0),
)
#: sizes of days that are dates, and since when they count: from 1954 to 2119 and from 1916 to 2190;
#: twice as wide finds no more logs of gratings
_DAYS = (
    (20_000.0, 80_000.0, "1900, as spreadsheets write"),
    (700_000.0, 800_000.0, "the year 0, as MATLAB writes"),
)


def name_without_unit(name: str) -> str:
    """A name without the unit in brackets behind it."""
    return re.sub(r"\s*[\[(][^\[\]()]*[\])]\s*$", "", name).strip()


def joined_words(name: str) -> str:
    """A name in lower case, without blanks, underscores, points and hyphens."""
    return re.sub(r"[\s_.\-]+", "", name).lower()


def words(name: str) -> list[str]:
    """The words of a name in lower case: RunningTime_s is running, time, s."""
    return [word.lower() for word in re.findall(r"[^\W\d_]?[^\W\d_A-Z]+|[A-Z]+|\d+", name)]


def is_time_name(name: str) -> bool:
    """True for the names of times, as programs join their words."""
    plain = name_without_unit(name).lstrip("#%/ ")
    return bool(
        TIME_NAMES.fullmatch(plain)
        or _TIME_WORDS.intersection(words(plain))
        or joined_words(plain) in _TIMES
    )


def is_of_other_quantity(name: str, unit: str) -> bool:
    """True if a name is of anything but time: by the unit beside it ('' if none is), or its words.

    Its last word may be the unit. A name that says nothing, such as Channel_1, may be of a time.
    """
    own = words(name_without_unit(name))
    named = units.canonical(unit) if unit else None
    # of one letter only the metre: others are as often numbers of channels or the t of a time
    if named is None and len(own) > 1 and (len(own[-1]) > 1 or own[-1] == "m"):
        named = units.canonical(own[-1])
    if named is not None:
        return units.UNITS[named][0] != "time"
    return bool(_OTHER_WORDS.intersection(own))


#: words of names of columns that say which signal a row is of
_SIGNAL_WORDS = {
    *("name", "channel", "kanal", "signal", "sensor", "variable", "parameter", "topic"),
    *("quantity", "metric", "series"),
}


def is_signal_name(name: str) -> bool:
    """True if a name holds nothing but words for the name of a signal."""
    return bool(own := {*words(name)}) and own <= _SIGNAL_WORDS


def several_signals(signals: Collection[str], column: str) -> str:
    """What is wrong with rows that hold some signals one after the other, named in a column."""
    return (
        f"its rows hold {len(signals)} signals one after the other, by column {column!r}: "
        f"{', '.join(sorted(signals)[:5])}"
    )


def long_form(signals: Collection[str], column: str, log: str = "") -> ReadError:
    """What to say of a log whose rows hold some signals one after the other."""
    return ReadError(
        several_signals(signals, column),
        allowed="allowed is a column per signal",
        do="pivot it first, e.g. with pandas: table.pivot(index=TIME, columns=NAME, values=VALUE)",
        file=log,
    )


def signal_column(names: Sequence[str], kinds: Sequence[str]) -> int | None:
    """The column of a long table that may name signals, by names and kinds of all its columns.

    Of kind `text`, or `number` by its name. None if there are more columns than a time, a name and
    a value.
    """
    numbers = [k for k, kind in enumerate(kinds) if kind == "number"]
    named = [k for k, kind in enumerate(kinds) if kind == "text"]
    if not named and len(numbers) == 3:
        named = [k for k in numbers if is_signal_name(names[k])]
    others = len({*numbers} - {*named})
    return named[0] if len(named) == 1 and others <= 2 else None


def signals_of(
    names: Sequence[str], kinds: Sequence[str], cells_of: Callable[[int], Sequence[str]]
) -> tuple[int, set[str]]:
    """(the column that names a signal in each row, these signals); none if there is one signal.

    `cells_of` gives cells of a column from a log's begin and its end. Beside more columns than a
    time and a value only names that take turns count: an index or a unit may be among these.
    """
    column, wide = signal_column(names, kinds), False
    if column is None:
        named = [k for k, kind in enumerate(kinds) if kind == "text" and is_signal_name(names[k])]
        column, wide = named[0] if len(named) == 1 else None, True
    if column is None:
        return -1, set()
    cells, of_words = cells_of(column), kinds[column] == "text"
    by_name = is_signal_name(names[column]) and not wide
    # a name that comes once is a damaged cell
    first, seen = cells[: len(cells) // 2], {c for c, n in Counter(cells).items() if c and n > 1}
    many = len(seen)
    if not of_words:  # in turns, or whole ones sorted: else they are what is measured
        in_turns = len({*first[:many]}) == many and first[many:] == first[:-many]
        one_by_one = sum(a != b for a, b in pairwise(cells)) == many - 1
        by_name = in_turns or (by_name and one_by_one and all(map(str.isdigit, seen)))
    in_turn = sum(a != b for a, b in pairwise(first)) > 0.5 * len(first)
    found = (by_name or (in_turn and of_words)) and 2 <= many <= 0.3 * len(first)
    return column, seen if found else set()


def stated_time_unit(name: str, unit: str) -> str | None:
    """The unit of time that is stated beside a name ('' if none is), or in it; else None."""
    if not unit:
        last = words(name)[-1:] or [""]
        unit = _KNOWN_UNITS.get(joined_words(name)) or _UNIT_WORDS.get(last[0], "")
        unit = unit or (last[0] if last[0] in _TIME_UNITS else "")
    known = units.canonical(unit) if unit else None
    return known if known and units.UNITS[known][0] == "time" else None


def unit_by_size(stamps: FloatArray) -> str:
    """The unit of some stamps (n,) without one: that of dates is known by their size; else s.

    NaN for those that are not known.
    """
    if days_since(stamps):
        return "d"
    first = next((stamp for stamp in stamps.tolist() if stamp == stamp), 0.0)
    return next((unit for least, most, unit, _ in _DATES if least < first < most), "s")


def days_since(stamps: FloatArray) -> str:
    """Since when stamps (n,) count days, if they can only be days; else ''.

    Their size is that of today's dates, and as seconds they would follow each other faster than
    any instrument samples.
    """
    stamps = stamps[np.isfinite(stamps)]
    shortest_s = 1.0 / PLAUSIBLE["sampling_rate_Hz"].high
    if stamps.size < 2 or not 0.0 < np.diff(stamps).mean() < shortest_s:
        return ""
    least, most = stamps.min(), stamps.max()
    return next((since for low, high, since in _DAYS if low <= least <= most <= high), "")


def date_of(stamp: float, unit: str) -> str | None:
    """The date of a stamp in ISO 8601; None if it is too small to be one."""
    for least, most, of_unit, before_s in _DATES:
        since_s = stamp / round(1.0 / units.UNITS[of_unit][1]) - before_s
        if of_unit == unit and least < stamp < most and since_s > EARLIEST_DATE_S:
            with suppress(OverflowError, ValueError, OSError):
                return datetime.fromtimestamp(since_s, UTC).isoformat()
    return None


def rises_as_time(numbers: FloatArray, digit: float, slack: float) -> bool:
    """True if numbers (n,) of a last `digit` rise as nothing but a time does.

    Their steps are even to the digit, or differ by less than the share `slack` of the usual one.
    Whole numbers count rows, unless they are as large as dates.
    """
    steps = np.diff(numbers)
    steps = steps[np.isfinite(steps)]
    if steps.size < 2 or steps.min() <= 0.0 or (digit >= 1.0 and unit_by_size(numbers) == "s"):
        return False
    # a step of floats is off by as much as they are rounded
    digit = max(digit, float(np.spacing(np.nanmax(np.abs(numbers)))))
    return bool(np.ptp(steps) <= max(2.01 * digit, slack * float(np.median(steps))))


# ---- What a log holds that a channel of a setup could name: one entry per column, field or
# dataset.


#: entries of one log; more are not listed
MOST_SERIES = 500


@dataclass(frozen=True)
class Series:
    """A source as a setup names it; `window_nm` for a grating among peaks; `note` for a reader.

    `place` is another name of it, such as #3.
    """

    source: str
    window_nm: tuple[float, float] | None = None
    note: str = ""
    place: str = ""


@dataclass(frozen=True)
class SeriesList:
    """All series of a log; `time` names what tells their times, '' if nothing does by name.

    `others` are topics, columns or datasets that hold no numbers, or too few for a signal;
    `unread` are sentences on those whose numbers cannot be read.
    """

    series: tuple[Series, ...]
    time: str = ""
    others: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()


# ---- The unit that a log itself states, in a header or an attribute.
#
# It is the default of a channel whose setup names none.


#: RaceCapture's `"name"|"unit"|lowest|highest|rate`
_BARS = re.compile(r'"?([^"|]+)"?\|"?([^"|]*)"?(?:\|-?[\d.]*){3}')


def split_unit(name: str) -> tuple[str, str]:
    """(`WL 1`, `nm`) of `WL 1[nm]` or `WL 1 (nm)`; the unit is empty if the name has none."""
    if barred := _BARS.fullmatch(name):
        return barred[1], barred[2]
    match = re.fullmatch(r"(.*?)\s*[\[(]([^\[\]()]*)[\])]\s*", name)
    if match and match[1] and units.canonical(match[2]) is not None:
        return match[1], match[2]
    return name, ""


def unit_in_source(source: str) -> str:
    """The unit behind the name in a source, '' if there is none; an index in brackets is none."""
    return split_unit(re.sub(r"\[[\d\s,:]+\]$", "", source))[1]


def with_stated_units(setup: Setup, stated: Mapping[str, str]) -> tuple[Setup, list[str]]:
    """(the setup with the units that the log states, what to say about them).

    Only channels without a unit take it.
    """
    channels, said = dict(setup.channels), []
    for name, spelt in stated.items():
        channel = channels[name]
        unit = units.canonical(spelt)
        if channel.scaled:  # the log's unit is that of what is recorded, not what the scale gives
            if channel.unit is None and unit is not None and _fits(unit, channel):
                said.append(
                    f"channel {name}: scale and offset are taken to give {channel.source_unit!r}, "
                    f"not the file's {spelt!r}; write unit in the setup"
                )
            continue
        if channel.unit is None and not KINDS[channel.kind].quantities:
            word = "".join(letter for letter in spelt if letter.isprintable()).strip()
            channels[name] = replace(channel, unit=unit or word[: units.MOST_LETTERS] or None)
        elif channel.unit is None and unit is not None and _fits(unit, channel):
            channels[name] = replace(channel, unit=unit)
        elif sentence := _contradiction(channel, spelt, unit):
            said.append(f"channel {name}: {sentence}")
    return replace(setup, channels=channels), said


def _fits(unit: str, channel: ChannelSetup) -> bool:
    return units.UNITS[unit][0] in KINDS[channel.kind].quantities


def _contradiction(channel: ChannelSetup, spelt: str, unit: str | None) -> str:
    """What to say if the log's unit is not the one that is used; else ''.

    Also '' if the log says nothing.
    """
    used = channel.source_unit
    if channel.unit is None:
        if unit == "1" and units.UNITS[used][1] == 1.0 and KINDS[channel.kind].unit == "":
            return ""  # [-] over strain
        wrong = (
            f"is none of {' or '.join(KINDS[channel.kind].quantities)}" if unit else "is not known"
        )
        return (
            f"the file gives the unit {spelt!r}, which {wrong}; {used!r} is taken; "
            "write unit in the setup"
        )
    if unit is None or units.UNITS[unit] == units.UNITS[units.canonical(used) or unit]:
        return ""
    return (
        f"the file gives the unit {spelt!r} and the setup {used!r}; the setup's is used; "
        f"write unit = {spelt!r} in the setup if the file is right"
    )
