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
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from tirelog.kernels import compiled
from tirelog.readers.text.digits import POWERS, Bytes, Whole
from tirelog.vocabulary.arrays import IntArray

#: what a byte of a time is: a byte like the pattern's, or a digit of a field
AS_IT_IS, YEAR, MONTH, DAY, HOUR, MINUTE, SECOND, FRACTION = range(8)
#: years that int64 holds in nanoseconds from 1970
_FIRST_YEAR, _LAST_YEAR = 1678, 2261


@compiled
def _days(year: Whole, month: Whole, day: Whole) -> Whole:
    """Days since 1970 of a proleptic Gregorian date.

    Counted in years that begin in March, so that the leap day comes last. Month 13 is the next
    January.
    """
    year -= month <= 2
    month = (month + 9) % 12
    return (
        365 * year + year // 4 - year // 100 + year // 400 + (153 * month + 2) // 5 + day - 719_469
    )


@compiled
def times_alike(
    data: Bytes,
    starts: IntArray,
    pattern: Bytes,
    roles: IntArray,
    dated: bool,
    offset_s: int,
    out: IntArray,
    done: NDArray[np.bool_],
) -> None:
    """Fills `out` (n,) with times [ns] that are written like `pattern` (m,), and `done` (n,).

    From the bytes `starts` (n,) on; False in `done` if one is written otherwise, or is no time.
    `roles` (m,): what each byte is. `dated` ones count from 1970, and lie `offset_s` east of UTC.
    """
    fields = np.empty(8, np.int64)
    decimals = (roles == FRACTION).sum()
    for i in range(starts.size):
        fields[:] = 0
        alike = True
        for k in range(pattern.size):
            byte, role = data[starts[i] + k], roles[k]
            if role == AS_IT_IS:
                alike &= byte == pattern[k]
            else:
                alike &= 48 <= byte <= 57
                fields[role] = fields[role] * 10 + (np.int64(byte) - 48)
        alike &= fields[HOUR] <= 24 and fields[MINUTE] <= 59 and fields[SECOND] <= 60
        seconds = fields[HOUR] * 3600 + fields[MINUTE] * 60 + fields[SECOND] - offset_s
        if dated:
            year, month, day = fields[YEAR], fields[MONTH], fields[DAY]
            alike &= _FIRST_YEAR <= year <= _LAST_YEAR and 1 <= month <= 12 and 1 <= day <= 31
            if day > 28:
                alike &= day <= _days(year, month + 1, 1) - _days(year, month, 1)
            seconds += 86_400 * _days(year, month, day)
        out[i], done[i] = seconds * 1_000_000_000 + fields[FRACTION] * POWERS[9 - decimals], alike


Nanoseconds = NDArray[np.int64]
MISSING = np.iinfo(np.int64).min
#: nanoseconds of a day
DAY_NS = 86_400 * 10**9

_SECOND = r"(?P<sec>\d{1,2})(?:[.,:](?P<frac>\d{1,9})\d*)?"
_CLOCK = rf"(?P<h>\d{{1,2}})(?P<s>[:\-.])(?P<m>\d{{1,2}})(?:(?P=s){_SECOND})?"
_OFFSET = r"\s*(?P<off>Z|[+-]\d{2}:?\d{2})?"
_REST = rf"(?:[T _]+{_CLOCK}{_OFFSET})?"
_FORMS = {
    "iso": re.compile(rf"(?P<Y>\d{{4}})(?P<d>[-/.])(?P<M>\d{{1,2}})(?P=d)(?P<D>\d{{1,2}}){_REST}"),
    "dmy": re.compile(rf"(?P<D>\d{{1,2}})(?P<d>[-/.])(?P<M>\d{{1,2}})(?P=d)(?P<Y>\d{{4}}){_REST}"),
    "hms": re.compile(rf"(?P<h>\d{{1,2}})(?P<s>[:\-])(?P<m>\d{{1,2}})(?P=s){_SECOND}:?"),
}


def form_of(cell: str) -> str | None:
    """The form's name of one cell, None if it is no time."""
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
    """True if dates like 04/14/2022 prove that the month stands first."""
    pairs = [m for cell in cells if (m := _FORMS["dmy"].fullmatch(cell.strip().strip('"')))]
    return any(int(m["M"]) > 12 for m in pairs) and not any(int(m["D"]) > 12 for m in pairs)


def one_ns(cell: str, form: str, us: bool = False) -> int:
    """Nanoseconds of one cell, MISSING if it is not of this form.

    `us` reads the month first.
    """
    match = _FORMS[form].fullmatch(cell.strip().strip('"'))
    if not match:
        return MISSING
    part = match.groupdict()
    days = 0
    if form != "hms":
        month, day = (part["D"], part["M"]) if us and form == "dmy" else (part["M"], part["D"])
        try:
            days = int(
                (
                    np.datetime64(f"{part['Y']}-{int(month):02d}-{int(day):02d}")
                    - np.datetime64("1970-01-01")
                ).astype(int)
            )
        except ValueError:
            return MISSING
    hour, minute, second = (int(part[key] or 0) for key in ("h", "m", "sec"))
    if hour > 24 or minute > 59 or second > 60:
        return MISSING
    seconds = hour * 3600 + minute * 60 + second - _offset_s(part.get("off"))
    ns = (days * 86_400 + seconds) * 10**9 + int((part["frac"] or "0").ljust(9, "0"))
    return ns if abs(ns) <= -(MISSING + 1) else MISSING


def _offset_s(text: str | None) -> int:
    """Seconds east of UTC of `Z` or `+02:00`."""
    if not text or text == "Z":
        return 0
    digits = text[1:].replace(":", "")
    return (1 if text[0] == "+" else -1) * (int(digits[:2]) * 3600 + int(digits[2:]) * 60)


def column_ns(
    data: NDArray[np.uint8],
    starts: NDArray[np.int64],
    stops: NDArray[np.int64],
    form: str,
    us: bool = False,
) -> Nanoseconds:
    """Nanoseconds of the cells data[starts:stops], shape (n,).

    Cells of one length mostly share one layout, so that a digit's place is read once, from the
    first cell; cells that do not have punctuation like that one are read one by one.
    """
    out = np.full(starts.size, MISSING, np.int64)
    lengths = stops - starts
    alike = lengths.size and (lengths == lengths[0]).all()
    for length in lengths[:1] if alike else np.unique(lengths):
        rows = np.flatnonzero(lengths == length)
        cell = data[starts[rows[0]] : stops[rows[0]]]
        match = _FORMS[form].fullmatch(cell.tobytes().decode("latin-1"))
        done = np.zeros(rows.size, bool)
        if match:
            values = np.empty(rows.size, np.int64)
            offset_s = _offset_s(match.groupdict().get("off"))
            times_alike(
                data,
                starts[rows],
                cell,
                _roles(match, us and form == "dmy"),
                form != "hms",
                offset_s,
                values,
                done,
            )
            out[rows[done]] = values[done]
        for i in rows[~done] if length else ():
            out[i] = one_ns(data[starts[i] : stops[i]].tobytes().decode("latin-1"), form, us)
    return out


def _roles(match: re.Match[str], us: bool) -> NDArray[np.int64]:
    """What each byte of a time is."""
    fields = {
        "Y": YEAR,
        "M": DAY if us else MONTH,
        "D": MONTH if us else DAY,
        "h": HOUR,
        "m": MINUTE,
        "sec": SECOND,
        "frac": FRACTION,
    }
    roles = np.full(len(match[0]), AS_IT_IS, np.int64)
    for key, text in match.groupdict().items():
        if key in fields and text is not None:
            roles[match.start(key) : match.end(key)] = fields[key]
    return roles


def unwrap_midnight(ns: Nanoseconds, last_ns: int | None) -> tuple[Nanoseconds, int]:
    """(times of day made to run on past midnight, number of midnights met).

    They follow `last_ns`, the last time before.
    """
    known = np.flatnonzero(ns != MISSING)
    if not known.size:
        return ns, 0
    values = ns[known]
    before = 0 if last_ns is None else last_ns // DAY_NS * DAY_NS
    previous = np.concatenate([[values[0] if last_ns is None else last_ns - before], values[:-1]])
    step = values - previous
    # stamps that fall back by more than half a day have passed midnight; those that leap by as much
    # fell back over it
    turns = np.cumsum((step < -DAY_NS // 2).astype(np.int64) - (step > DAY_NS // 2))
    out = ns.copy()
    out[known] = values + before + turns * DAY_NS
    return out, int(turns.max(initial=0))
