"""Cells of a time column to nanoseconds, a whole column at once.

    cells (bytes) --grouped by length, digits at fixed places--> int64 ns since 1970 or since midnight, MISSING where unreadable

Forms, each recognized on its own cells (see `form_of`):
    iso   2022-04-14T13:00:00.123+02:00, 2022-04-14 13:00:00,5, also a date alone        -> ns since 1970, UTC where an offset stands
    dmy   14/04/2022 13:00:00.5, 14-04-2022, 14.04.2022 13:00 (day first; or month first, where a field above 12 proves it)
    hms   13:00:00.5, 13-00-00.5 (also with a trailing colon)                           -> ns since midnight
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

Nanoseconds = NDArray[np.int64]
MISSING = np.iinfo(np.int64).min
DAY_NS = 86_400 * 10**9

_CLOCK = r"(?P<h>\d{1,2})(?P<s>[:\-.])(?P<m>\d{1,2})(?:(?P=s)(?P<sec>\d{1,2})(?:[.,:](?P<frac>\d{1,9})\d*)?)?"
_OFFSET = r"\s*(?P<off>Z|[+-]\d{2}:?\d{2})?"
_FORMS = {
    "iso": re.compile(rf"(?P<Y>\d{{4}})(?P<d>[-/.])(?P<M>\d{{1,2}})(?P=d)(?P<D>\d{{1,2}})(?:[T _]+{_CLOCK}{_OFFSET})?"),
    "dmy": re.compile(rf"(?P<D>\d{{1,2}})(?P<d>[-/.])(?P<M>\d{{1,2}})(?P=d)(?P<Y>\d{{4}})(?:[T _]+{_CLOCK}{_OFFSET})?"),
    "hms": re.compile(r"(?P<h>\d{1,2})(?P<s>[:\-])(?P<m>\d{1,2})(?P=s)(?P<sec>\d{1,2})(?:[.,:](?P<frac>\d{1,9})\d*)?:?"),
}


def form_of(cell: str) -> str | None:
    """The form's name of one cell, None where it is no time."""
    cell = cell.strip().strip('"')
    return next((name for name, pattern in _FORMS.items() if pattern.fullmatch(cell)), None)


def has_clock(cell: str) -> bool:
    """False for a date alone."""
    form = form_of(cell)
    match = form and _FORMS[form].fullmatch(cell.strip().strip('"'))
    return bool(match and match["h"])


def fraction_digits(cell: str) -> int:
    """Decimals of a time's seconds."""
    form = form_of(cell)
    match = form and _FORMS[form].fullmatch(cell.strip().strip('"'))
    return len(match["frac"] or "") if match else 0


def month_first(cells: list[str]) -> bool:
    """True where dates like 04/14/2022 prove that the month stands first."""
    pairs = [m for cell in cells if (m := _FORMS["dmy"].fullmatch(cell.strip().strip('"')))]
    return any(int(m["M"]) > 12 for m in pairs) and not any(int(m["D"]) > 12 for m in pairs)


def one_ns(cell: str, form: str, us: bool = False) -> int:
    """Nanoseconds of one cell, MISSING where it is not of this form; `us` reads the month first."""
    match = _FORMS[form].fullmatch(cell.strip().strip('"'))
    if not match:
        return MISSING
    part = match.groupdict()
    days = 0
    if form != "hms":
        month, day = (part["D"], part["M"]) if us and form == "dmy" else (part["M"], part["D"])
        try:
            days = int((np.datetime64(f"{part['Y']}-{int(month):02d}-{int(day):02d}") - np.datetime64("1970-01-01")).astype(int))
        except ValueError:
            return MISSING
    hour, minute, second = (int(part[key] or 0) for key in ("h", "m", "sec"))
    if hour > 24 or minute > 59 or second > 60:
        return MISSING
    seconds = hour * 3600 + minute * 60 + second - _offset_s(part.get("off"))
    return (days * 86_400 + seconds) * 10**9 + int((part["frac"] or "0").ljust(9, "0"))


def _offset_s(text: str | None) -> int:
    """Seconds east of UTC of `Z` or `+02:00`."""
    if not text or text == "Z":
        return 0
    digits = text[1:].replace(":", "")
    return (1 if text[0] == "+" else -1) * (int(digits[:2]) * 3600 + int(digits[2:]) * 60)


def column_ns(data: NDArray[np.uint8], starts: NDArray[np.int64], stops: NDArray[np.int64], form: str, us: bool = False) -> Nanoseconds:
    """Nanoseconds of the cells data[starts:stops], shape (n,).

    Cells of one length mostly share one layout, so that a digit's place is read once, from the first cell; cells that do not have
    punctuation like that one are read one by one.
    """
    out = np.full(starts.size, MISSING, np.int64)
    lengths = stops - starts
    for length in np.unique(lengths[lengths > 0]):
        rows = np.flatnonzero(lengths == length)
        cells = data[starts[rows][:, None] + np.arange(length)]
        done = np.zeros(rows.size, bool)
        fast = _fixed(cells, form, us)
        if fast is not None:
            done, values = fast
            out[rows[done]] = values[done]
        for i in np.flatnonzero(~done):
            out[rows[i]] = one_ns(cells[i].tobytes().decode("latin-1"), form, us)
    return out


def _fixed(cells: NDArray[np.uint8], form: str, us: bool) -> tuple[NDArray[np.bool_], Nanoseconds] | None:
    """(cells laid out like the first one, their ns), or None where the first one is no time.  `cells` shape (n, length)."""
    pattern = cells[0].tobytes().decode("latin-1")
    match = _FORMS[form].fullmatch(pattern)
    if not match:
        return None
    places = {key: match.span(key) for key, text in match.groupdict().items() if text is not None}
    digit = np.zeros(cells.shape[1], bool)
    for key, (start, stop) in places.items():
        digit[start:stop] = key not in ("d", "s", "off")
    alike = (cells[:, ~digit] == cells[0, ~digit]).all(axis=1)
    alike &= ((cells[:, digit] >= 48) & (cells[:, digit] <= 57)).all(axis=1)

    def number(key: str) -> Nanoseconds:
        value = np.zeros(cells.shape[0], np.int64)
        for place in range(*places.get(key, (0, 0))):
            value = value * 10 + (cells[:, place].astype(np.int64) - 48)
        return value

    hour, minute, second = number("h"), number("m"), number("sec")
    alike &= (hour <= 24) & (minute <= 59) & (second <= 60)
    seconds = hour * 3600 + minute * 60 + second - _offset_s(match.groupdict().get("off"))
    if form != "hms":
        month, day = (number("D"), number("M")) if us and form == "dmy" else (number("M"), number("D"))
        alike &= (month >= 1) & (month <= 12) & (day >= 1) & (day <= 31)
        seconds = seconds + 86_400 * _days(number("Y"), month, day)
    digits = places["frac"][1] - places["frac"][0] if "frac" in places else 0
    return alike, seconds * 10**9 + number("frac") * 10 ** (9 - digits)


def _days(year: Nanoseconds, month: Nanoseconds, day: Nanoseconds) -> Nanoseconds:
    """Days since 1970 of proleptic Gregorian dates (counted in years that begin in March, so that the leap day comes last)."""
    year = year - (month <= 2)
    month = (month + 9) % 12
    return 365 * year + year // 4 - year // 100 + year // 400 + (153 * month + 2) // 5 + day - 719_469


def unwrap_midnight(ns: Nanoseconds, last_ns: int | None) -> tuple[Nanoseconds, int]:
    """(times of day made to run on past midnight, number of midnights met), following `last_ns`, the last time before."""
    known = np.flatnonzero(ns != MISSING)
    if not known.size:
        return ns, 0
    values = ns[known]
    before = 0 if last_ns is None else last_ns // DAY_NS * DAY_NS
    previous = np.concatenate([[values[0] if last_ns is None else last_ns - before], values[:-1]])
    step = values - previous
    # stamps that fall back by more than half a day have passed midnight; those that leap by as much fell back over it
    turns = np.cumsum((step < -DAY_NS // 2).astype(np.int64) - (step > DAY_NS // 2))
    out = ns.copy()
    out[known] = values + before + turns * DAY_NS
    return out, int(turns.max(initial=0))
