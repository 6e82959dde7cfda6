"""Property: a column of times is read as each cell is alone, and as Python reads it."""

import re
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

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


def read(cells, form, us):
    text = ",".join(cells).encode("latin-1") + b"\n"
    stops = np.cumsum([len(cell) + 1 for cell in cells]) - 1
    starts = stops - [len(cell) for cell in cells]
    return column_ns(np.frombuffer(text, np.uint8), starts, stops, form, us).tolist()


@pytest.mark.parametrize("form", LAYOUTS)
@given(st.data())
@settings(max_examples=80, deadline=None)
def test_a_column_is_its_cells(form, data):
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    layouts = data.draw(st.lists(st.sampled_from(LAYOUTS[form]), min_size=1, max_size=3))
    cells = []
    for _ in range(data.draw(st.integers(1, 60))):
        layout = layouts[int(rng.integers(len(layouts)))]
        cell = re.sub("9", lambda _: str(rng.integers(0, rng.choice([2, 6, 10]))), layout)
        if cell and rng.random() < 0.05:
            at = int(rng.integers(len(cell)))
            cell = cell[:at] + str(rng.choice(["x", ":", "-", "/", "+"])) + cell[at + 1 :]
        cells.append(cell)
    us = data.draw(st.booleans())
    assert read(cells, form, us) == [one_ns(cell, form, us) for cell in cells]


def test_times_behind_words_of_many_kinds_are_read():
    words = [chr(65 + i % 26) * (1 + i // 26) for i in range(200)]
    last = ["2024-02-29 10:00:00", "2024-02-29 10:00:00.25"]
    found = read([*words, *last], "iso", False)
    assert found[:200] == [MISSING] * 200
    assert found[200] == one_ns(last[0], "iso") > 0
    assert found[201] - found[200] == 250_000_000


MOMENTS = st.datetimes(min_value=datetime(1700, 1, 1), max_value=datetime(2250, 1, 1))
#: form, month first, and how Python writes it
WRITTEN = [
    ("iso", False, "%Y-%m-%dT%H:%M:%S.%fZ"),
    ("iso", False, "%Y/%m/%d %I-%M-%S,%f %p"),
    ("dmy", False, "%d.%m.%Y %H:%M:%S.%f"),
    ("dmy", True, "%m/%d/%Y %H:%M:%S.%f"),
    ("hms", False, "%I:%M:%S.%f %p"),
    ("hms", False, "%H-%M-%S.%f"),
    ("mmss", False, "%M:%S,%f"),
]


def ns_since(time, form):
    """Nanoseconds since 1970, of the day or of the hour."""
    since = time - datetime(1970, 1, 1, tzinfo=UTC)
    whole = {"hms": timedelta(days=1), "mmss": timedelta(hours=1)}.get(form)
    return (since % whole if whole else since) // timedelta(microseconds=1) * 1000


@pytest.mark.parametrize(("form", "us", "written"), WRITTEN)
@given(MOMENTS)
@settings(max_examples=80, deadline=None)
def test_python_knows_the_same_calendar_and_hours(form, us, written, time):
    time = time.replace(tzinfo=UTC)
    assert read([time.strftime(written)] * 3, form, us) == [ns_since(time, form)] * 3


@given(MOMENTS, st.integers(-14 * 60, 14 * 60))
@settings(max_examples=80, deadline=None)
def test_offsets_are_those_of_python(time, minutes):
    there = time.replace(tzinfo=timezone(timedelta(minutes=minutes)))
    assert read([there.isoformat()] * 3, "iso", False) == [ns_since(there, "iso")] * 3


@pytest.mark.parametrize(
    ("form", "cell"),
    [
        ("iso", "2024-05-17 25:00:00"), ("iso", "2024-05-17 10:60:00"),
        ("iso", "2024-05-17 10:00:61"), ("iso", "1677-05-17"), ("iso", "2262-05-17"),
        ("iso", "2023-02-29"), ("iso", "2100-02-29"), ("iso", "2023-04-31"),
        ("hms", "13:00:00 PM"), ("hms", "0:00:00 AM"), ("dmy", "31/04/2024 10:00:00"),
        ("mmss", "10:61"),
    ],
)  # fmt: skip
def test_a_time_that_no_clock_shows_is_none(form, cell):
    assert read([cell] * 3, form, False) == [MISSING] * 3
    assert one_ns(cell, form) == MISSING
