"""Cells of a time column to nanoseconds, a whole column at once.

    cells (bytes)
        --grouped by length, digits at fixed places--> int64 ns since 1970 or since midnight,
                                                       MISSING where unreadable

Forms, each recognized on its own cells (see `form_of`):
    iso   2022-04-14T13:00:00.123+02:00, 2022-04-14 13:00:00,5, also a date alone
          -> ns since 1970, UTC if there is an offset
    dmy   14/04/2022 13:00:00.5, 14-04-2022, 14.04.2022 13:00 (day first; or month first, if a
          field above 12 proves it)
    hms   13:00:00.5, 13-00-00.5 (also with a trailing colon)
          -> ns since midnight
    basic 20220414T130000.5
    hhmmss 130000.50 as a number
    mmss  59:30.5, minutes and seconds with decimals, as spreadsheets show times
          -> ns since the full hour, or since a timer's start
A time of day may be one of twelve hours: 01:00:00.5 PM.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.vocabulary.arrays import IntArray

Nanoseconds = NDArray[np.int64]
Bytes = NDArray[np.uint8]
#: in place of a time that cannot be read
MISSING = np.iinfo(np.int64).min
#: what a byte of a time is: a byte like the pattern's, or a digit of a field
AS_IT_IS, YEAR, MONTH, DAY, HOUR, MINUTE, SECOND, FRACTION, HALF_DAY_HOUR, UNUSED = range(10)
#: years that int64 holds in nanoseconds from 1970
_FIRST_YEAR, _LAST_YEAR = 1678, 2261


def bytes_of(block: Any) -> Bytes:
    """The bytes of a block as an array."""
    return np.frombuffer(block, np.uint8)


def times_alike(
    cells: Bytes, pattern: Bytes, roles: IntArray, dated: bool, offset_s: int
) -> tuple[Nanoseconds, NDArray[np.bool_]]:
    """(times [ns] of cells that are written like `pattern` (m,), which cells are), shapes (n,).

    cells: (n, m). Times that cannot be are MISSING.
    `roles` (m,): what each byte is; hours of half a day count from 12, and minutes may be more
    than 59 if there are no hours. `dated` ones count from 1970. `offset_s` is subtracted: times lie
    so far east of UTC, or before noon.
    """
    digits = cells - np.uint8(48)  # other letters lie beyond 9
    as_written = np.where(roles == AS_IT_IS, cells == pattern, digits <= 9)

    def field(role: int) -> IntArray:
        number = np.zeros(len(cells), np.int64)
        for k in np.flatnonzero(roles == role):
            number = number * 10 + digits[:, k]
        return number

    hour, minute, second = field(HOUR), field(MINUTE), field(SECOND)
    possible = (hour <= 24) & (second <= 60)
    if HALF_DAY_HOUR in roles:
        half = field(HALF_DAY_HOUR)
        possible &= (half >= 1) & (half <= 12)
        hour = half % 12
    if HOUR in roles or HALF_DAY_HOUR in roles:
        possible &= minute <= 59
    seconds = hour * 3600 + minute * 60 + second - offset_s
    if dated:
        year, month, day = field(YEAR), field(MONTH), field(DAY)
        months = (12 * (year - 1970) + month - 1).astype("M8[M]")
        days = months.astype("M8[D]") + (day - 1)
        possible &= (year >= _FIRST_YEAR) & (year <= _LAST_YEAR) & (month >= 1) & (month <= 12)
        possible &= (day >= 1) & (days.astype("M8[M]") == months)
        seconds += 86_400 * days.astype(np.int64)
    decimals = np.count_nonzero(roles == FRACTION)
    time_ns = seconds * 1_000_000_000 + field(FRACTION) * 10 ** (9 - decimals)
    alike: NDArray[np.bool_] = np.logical_and.reduce(as_written, axis=1)
    return np.where(possible, time_ns, MISSING), alike


#: nanoseconds after which times of a form begin again
ROUNDS_NS = {"hms": 86_400 * 10**9, "hhmmss": 86_400 * 10**9, "mmss": 3_600 * 10**9}
#: forms that hold a date
DATED = ("iso", "basic", "dmy")

_SECOND = r"(?P<sec>\d{1,2})(?:[.,:](?P<frac>\d{1,9})(?P<more>\d*))?"
_HALF = r"(?:\s*(?P<half>[AaPp])\.?[Mm]\.?)?"
_CLOCK = rf"(?P<h>\d{{1,2}})(?P<s>[:\-.])(?P<m>\d{{1,2}})(?:(?P=s){_SECOND})?{_HALF}"
_DIGITS = r"(?P<h>\d{2})(?P<m>\d{2})(?P<sec>\d{2})(?:[.,](?P<frac>\d{1,9})(?P<more>\d*))?"
_OFFSET = r"\s*(?P<off>Z|[+-]\d{2}:?\d{2})?"
_REST = rf"(?:[T _]+{_CLOCK}{_OFFSET})?"
FORMS = {
    "iso": re.compile(rf"(?P<Y>\d{{4}})(?P<d>[-/.])(?P<M>\d{{1,2}})(?P=d)(?P<D>\d{{1,2}}){_REST}"),
    "basic": re.compile(rf"(?P<Y>\d{{4}})(?P<M>\d{{2}})(?P<D>\d{{2}})[T_ ]{_DIGITS}{_OFFSET}"),
    "hhmmss": re.compile(_DIGITS),
    "dmy": re.compile(rf"(?P<D>\d{{1,2}})(?P<d>[-/.])(?P<M>\d{{1,2}})(?P=d)(?P<Y>\d{{4}}){_REST}"),
    "hms": re.compile(rf"(?P<h>\d{{1,2}})(?P<s>[:\-])(?P<m>\d{{1,2}})(?P=s){_SECOND}{_HALF}:?"),
    "mmss": re.compile(r"(?P<m>\d{1,3}):(?P<sec>\d{2})[.,](?P<frac>\d{1,9})(?P<more>\d*)"),
}


def _matched(cell: str) -> tuple[str, re.Match[str]] | None:
    """(form, match) of one cell, None if it is no time."""
    text = cell.strip().strip('"')
    found = ((name, pattern.fullmatch(text)) for name, pattern in FORMS.items())
    return next(((name, match) for name, match in found if match), None)


def form_of(cell: str) -> str | None:
    """The form's name of one cell, None if it is no time, or a number that may be one."""
    found = _matched(cell)
    if not found or found[0] == "hhmmss":
        return None
    # digits alone may be a number of any kind
    return None if found[0] == "basic" and one_ns(cell, "basic") == MISSING else found[0]


def has_clock(cell: str) -> bool:
    """False for a date alone."""
    found = _matched(cell)
    return bool(found and found[1].groupdict().get("h"))


def fraction_digits(cell: str) -> int:
    """Decimals of a time's seconds."""
    found = _matched(cell)
    return len(found[1]["frac"] or "") if found else 0


def month_first(cells: list[str]) -> bool:
    """True if dates like 04/14/2022 prove that the month comes first."""
    pairs = [m for cell in cells if (m := FORMS["dmy"].fullmatch(cell.strip().strip('"')))]
    return any(int(m["M"]) > 12 for m in pairs) and not any(int(m["D"]) > 12 for m in pairs)


def one_ns(cell: str, form: str, us: bool = False) -> int:
    """Nanoseconds of one cell, MISSING if it is not of this form.

    `us` reads the month first.
    """
    data = bytes_of(cell.strip().strip('"').encode("latin-1", "replace"))
    return int(column_ns(data, np.zeros(1, np.int64), np.array([data.size]), form, us)[0])


def _offset_s(part: Mapping[str, str | None]) -> int:
    """Seconds to take off a time: by `+02:00` it lies so far east of UTC; PM is 12 hours on."""
    text, noon_s = part.get("off"), 43_200 * ((part.get("half") or "").lower() == "p")
    if not text or text == "Z":
        return -noon_s
    digits = text[1:].replace(":", "")
    east_s = int(digits[:2]) * 3600 + int(digits[2:]) * 60
    return (east_s if text[0] == "+" else -east_s) - noon_s


def column_ns(
    data: NDArray[np.uint8],
    starts: NDArray[np.int64],
    stops: NDArray[np.int64],
    form: str,
    us: bool = False,
) -> Nanoseconds:
    """Nanoseconds of the cells data[starts:stops], shape (n,).

    Cells of one length mostly share one punctuation, so that a digit's place is found once, in the
    first cell of a punctuation. Cells of very many kinds, as words are, go one by one.
    """
    out = np.full(starts.size, MISSING, np.int64)
    lengths = stops - starts
    left = np.flatnonzero(lengths)
    # fractions of all lengths beside hours, minutes and seconds of one digit or two are 72 kinds;
    # with more passes a column of words takes longer
    for _ in range(72):
        if not left.size:
            return out
        cell = data[starts[left[0]] : stops[left[0]]]
        match = FORMS[form].fullmatch(cell.tobytes().decode("latin-1"))
        done = np.zeros(left.size, bool)
        done[0] = True
        if match:
            same = np.flatnonzero(lengths[left] == cell.size)
            cells = data[starts[left[same], None] + np.arange(cell.size)]
            roles, offset_s = _roles(match, us and form == "dmy"), _offset_s(match.groupdict())
            values, alike = times_alike(cells, cell, roles, form in DATED, offset_s)
            out[left[same[alike]]] = values[alike]
            done[same[alike]] = True
        left = left[~done]
    for i in left.tolist():
        if FORMS[form].fullmatch(data[starts[i] : stops[i]].tobytes().decode("latin-1")):
            out[i] = column_ns(data, starts[i : i + 1], stops[i : i + 1], form, us)[0]
    return out


def _roles(match: re.Match[str], us: bool) -> NDArray[np.int64]:
    """What each byte of a time is."""
    parts = match.groupdict()
    fields = {
        "Y": YEAR,
        "M": DAY if us else MONTH,
        "D": MONTH if us else DAY,
        "h": HALF_DAY_HOUR if parts.get("half") else HOUR,
        "m": MINUTE,
        "sec": SECOND,
        "frac": FRACTION,
        "more": UNUSED,
    }
    roles = np.full(len(match[0]), AS_IT_IS, np.int64)
    for key, text in parts.items():
        if key in fields and text is not None:
            roles[match.start(key) : match.end(key)] = fields[key]
    return roles


def unwrapped(ns: Nanoseconds, last_ns: int | None, round_ns: int) -> tuple[Nanoseconds, int]:
    """(times that begin again after `round_ns` made to run on past it, how often they did).

    After a day, past midnight, or after an hour. They follow `last_ns`, the last time before.
    """
    known = np.flatnonzero(ns != MISSING)
    if not known.size:
        return ns, 0
    values = ns[known]
    before = 0 if last_ns is None else last_ns // round_ns * round_ns
    previous = np.concatenate([[values[0] if last_ns is None else last_ns - before], values[:-1]])
    step = values - previous
    # stamps that fall back by more than half a day have passed midnight; those that leap by as much
    # fell back over it
    turns = np.cumsum((step < -round_ns // 2).astype(np.int64) - (step > round_ns // 2))
    out = ns.copy()
    out[known] = values + before + turns * round_ns
    return out, int(turns.max(initial=0))
