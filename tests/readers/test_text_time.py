"""Property: a whole column of times is read as each of its cells is read alone, and as Python reads
it.
"""

import re
from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tirelog.readers.text import times
from tirelog.readers.text.times import MISSING, column_ns, one_ns

LAYOUTS = {
    "iso": [
        "9999-99-99T99:99:99.999",
        "9999/99/99 99-99-99,9",
        "9999-9-9",
        "2099-19-39",
        "9999-99-99T99:99Z",
        "9999-99-99 99:99:99.123456789123+02:00",
        "9999-99-99 99:99:99.9 AM",
        "9999-99-99 99:99:99.9 PM",
    ],
    "dmy": ["99/99/9999 99:99:99.9", "9.9.9999 9:99:99", "99-99-9999"],
    "hms": ["99:99:99.99999", "9-99-99", "99:99:99.9:", "noon", "", "99:99:99 PM", "9:99:99am"],
    "basic": ["20991939T999999.999", "19990909_999999", "20991939 999999,9Z"],
    "hhmmss": ["999999.99", "999999"],
    "mmss": ["99:99.9999", "999:99,9", "9:99.9", "99:99"],
}


def by_regex(cell: str, form: str, us: bool = False) -> int:
    """As `one_ns`, by the groups of the form's pattern."""
    match = times.FORMS[form].fullmatch(cell.strip().strip('"'))
    if not match:
        return MISSING
    part = match.groupdict()
    days = 0
    if form in times.DATED:
        month, day = (part["D"], part["M"]) if us and form == "dmy" else (part["M"], part["D"])
        if not 1678 <= int(part["Y"]) <= 2261:  # what int64 holds whole
            return MISSING
        try:
            days = int(
                (
                    np.datetime64(f"{part['Y']}-{int(month):02d}-{int(day):02d}")
                    - np.datetime64("1970-01-01")
                ).astype(int)
            )
        except ValueError:
            return MISSING
    hour, minute, second = (int(part.get(key) or 0) for key in ("h", "m", "sec"))
    if hour > 24 or (minute > 59 and form != "mmss") or second > 60:
        return MISSING
    if part.get("half"):
        if not 1 <= hour <= 12:
            return MISSING
        hour %= 12
    seconds = hour * 3600 + minute * 60 + second - times._offset_s(part)
    return (days * 86_400 + seconds) * 10**9 + int((part["frac"] or "0").ljust(9, "0"))


def read(cells: list[str], form: str, us: bool) -> list[int]:
    text = ",".join(cells).encode("latin-1") + b"\n"
    stops = np.cumsum([len(cell) + 1 for cell in cells]) - 1
    return column_ns(
        np.frombuffer(text, np.uint8), stops - [len(cell) for cell in cells], stops, form, us
    ).tolist()


@pytest.mark.parametrize("form", LAYOUTS)
@given(st.data())
@settings(max_examples=150, deadline=None)
def test_a_column_is_its_cells(form: str, data: st.DataObject) -> None:
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    layouts = data.draw(st.lists(st.sampled_from(LAYOUTS[form]), min_size=1, max_size=3))
    cells = []
    for _ in range(data.draw(st.integers(1, 60))):
        cell = re.sub(
            "9",
            lambda _: str(rng.integers(0, rng.choice([2, 6, 10]))),
            layouts[int(rng.integers(len(layouts)))],
        )
        if cell and rng.random() < 0.05:
            at = int(rng.integers(len(cell)))
            cell = cell[:at] + str(rng.choice(["x", ":", "-", "/", "+"])) + cell[at + 1 :]
        cells.append(cell)
    us = data.draw(st.booleans())
    assert read(cells, form, us) == [one_ns(cell, form, us) for cell in cells]
    assert read(cells, form, us) == [by_regex(cell, form, us) for cell in cells]


def test_times_behind_words_of_many_kinds_are_read() -> None:
    words = [chr(65 + i % 26) * (1 + i // 26) for i in range(200)]
    last = ["2024-05-17 10:00:00", "2024-05-17 10:00:00.25"]
    found = read([*words, *last], "iso", False)
    assert found[:200] == [MISSING] * 200
    assert found[200] == one_ns(last[0], "iso") > 0
    assert found[201] - found[200] == 250_000_000


@pytest.mark.parametrize(
    ("date", "there"),
    [("2023-02-29", 0), ("2024-02-29", 1), ("2100-02-29", 0), ("2023-04-31", 0), ("2023-12-31", 1)],
)
def test_days_that_the_calendar_has(date: str, there: int) -> None:
    cells = ["2024-05-17", date, "2024-05-18"]
    assert (read(cells, "iso", False)[1] != MISSING) == there
    assert (one_ns(date, "iso") != MISSING) == there


@given(st.datetimes(min_value=datetime(1700, 1, 1), max_value=datetime(2250, 1, 1)))
@settings(max_examples=300, deadline=None)
def test_python_knows_the_same_calendar(time: datetime) -> None:
    time = time.replace(tzinfo=UTC)
    since = time - datetime(1970, 1, 1, tzinfo=UTC)
    want = (since.days * 86_400 + since.seconds) * 10**9 + since.microseconds * 1000
    assert read([f"{time:%Y-%m-%dT%H:%M:%S.%f}Z"] * 3, "iso", False) == [want] * 3


@given(st.datetimes(min_value=datetime(1700, 1, 1), max_value=datetime(2250, 1, 1)))
@settings(max_examples=300, deadline=None)
def test_python_knows_the_same_hours_of_half_a_day(time: datetime) -> None:
    clock = ((time.hour * 60 + time.minute) * 60 + time.second) * 10**6 + time.microsecond
    cell = f"{(time.hour + 11) % 12 + 1:02d}:{time:%M:%S.%f} {'AP'[time.hour >= 12]}M"
    assert datetime.strptime(cell, "%I:%M:%S.%f %p").time() == time.time()
    assert read([cell] * 3, "hms", False) == [1000 * clock] * 3
