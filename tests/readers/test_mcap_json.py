"""Property: numbers taken out of JSON messages of one shape are those of `json`, and a message of
another shape is left to it.
"""

import json
from typing import Any

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tirelog.readers.mcap.json_messages import JsonReader
from tirelog.readers.mcap.json_shapes import read_messages, shape_of
from tirelog.readers.mcap.source import Want
from tirelog.readers.mcap.walk import MessageTable

NUMBER = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False),
    st.integers(-(2**63), 2**63),
    st.decimals(-2000, 2000, places=4, allow_nan=False).map(float),
)
WANTS = [Want("/t:wl[1]", ("wl", 1)), Want("/t:wl[:]", ("wl", slice(None))), Want("/t:n", ("n",))]


def table_of(messages: list[bytes]) -> MessageTable:
    """The messages behind one another, and nothing behind the last."""
    sizes = np.array([len(m) for m in messages], np.int64)
    return MessageTable(
        b"".join(messages), np.cumsum(sizes) - sizes, sizes, np.arange(len(messages))
    )


def message(row: list[float], n: float | None, text: str = 'a "1.5" 2', **style: Any) -> bytes:
    return json.dumps(
        {"name 7": text, "ok": True, "wl": row, "t_ns": 1_700_000_000_000_000_001, "n": n}, **style
    ).encode()


@given(
    st.lists(st.tuples(NUMBER, NUMBER, NUMBER), min_size=1, max_size=12),
    st.booleans(),
    st.sampled_from([None, (",", ":")]),
)
@settings(max_examples=200, deadline=None)
def test_the_numbers_of_json(
    rows: list[tuple[float, ...]], null: bool, separators: tuple[str, str] | None
) -> None:
    data = [
        message(list(row[:2]), None if null and i else row[2], separators=separators)
        for i, row in enumerate(rows)
    ]
    shape = shape_of(data[0], WANTS)
    assert shape is not None
    columns = read_messages(table_of(data), shape)
    plain = all(
        abs(x) < 9e18 and (x == 0 or abs(x) > 1e-80) and abs(x) < 1e80 for row in rows for x in row
    )
    assert columns is not None or not plain
    if columns is not None:
        decoded = [json.loads(d) for d in data]
        np.testing.assert_array_equal(columns[0].values, [d["wl"][1] for d in decoded])
        np.testing.assert_array_equal(columns[1].values, [x for d in decoded for x in d["wl"]])
        np.testing.assert_array_equal(
            columns[2].values, [np.nan if d["n"] is None else float(d["n"]) for d in decoded]
        )
        assert columns[1].lengths is not None
        assert columns[1].lengths.tolist() == [2] * len(rows)


@given(
    st.integers(0, 200), st.integers(0, 255), st.sampled_from(["change", "delete", "insert", "cut"])
)
@settings(max_examples=500, deadline=None)
def test_a_message_that_is_not_alike(at: int, byte: int, how: str) -> None:
    """Whatever is done to the last message, its numbers are those of `json`, or the table is
    refused; nothing behind it is read.
    """
    good = message([1550.1234, -0.5], 17)
    assume(at < len(good))
    middle = {
        "change": bytes([byte]) + good[at + 1 :],
        "delete": good[at + 1 :],
        "insert": bytes([byte]) + good[at:],
        "cut": b"",
    }[how]
    bad = good[:at] + middle
    shape = shape_of(good, WANTS)
    assert shape is not None
    columns = read_messages(table_of([good, bad]), shape)
    if columns is None:
        return
    try:
        decoded = json.loads(bad)
    except ValueError:  # a number that begins with 0: read as what it can only be
        return
    assert [c.values[-1] for c in columns] == [decoded["wl"][1], decoded["wl"][-1], decoded["n"]]
    assert {k: v for k, v in decoded.items() if k not in ("wl", "n", "t_ns")} == {
        "name 7": 'a "1.5" 2',
        "ok": True,
    }


def test_names_and_texts_that_hold_numbers() -> None:
    rows = [
        {"1550.5": {"x1": i / 7}, "note": '-3e5 \\ "2" é', "x": [[i], [2 * i]]} for i in range(9)
    ]
    wants = [Want("/t:1550.5.x1", ("1550.5", "x1")), Want("/t:x[1][0]", ("x", 1, 0))]
    columns = JsonReader().read(table_of([json.dumps(row).encode() for row in rows]), wants)
    assert columns is not None
    np.testing.assert_array_equal(columns[0].values, [i / 7 for i in range(9)])
    np.testing.assert_array_equal(columns[1].values, [2.0 * i for i in range(9)])


def test_what_is_no_shape() -> None:
    for text in (
        "[1, 2]",
        "7",
        '{"a": 1, "a": 2}',
        '{"a": NaN}',
        '{"a": true}',
        '{"b": 1}',
        "{",
        '{"a": "1"}',
    ):
        assert shape_of(text.encode(), [Want("/t:a", ("a",))]) is None


def test_messages_that_look_alike_and_are_not() -> None:
    good = b'{"a": 1550.5, "n": 17}'
    shape = shape_of(good, [Want("/t:n", ("n",))])
    assert shape is not None
    for bad in (
        good + b"}",
        good + good,
        b'{"a": 1550.5, "n": +17}',
        b'{"a": 1550.5, "n": nul}',
        b'{"a": , "n": 17}',
        b'{"a": 1.5, "n": }',
        b"",
    ):
        assert read_messages(table_of([good, bad]), shape) is None
    columns = read_messages(table_of([good, b'{"a": null, "n": -2e1}']), shape)
    assert columns is not None
    assert columns[0].values.tolist() == [17.0, -20.0]
