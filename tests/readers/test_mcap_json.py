"""Property: the numbers of JSON messages, read together, are those of `json`."""

import json
from typing import Any

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tirelog.readers.mcap.decode import ChannelDecoder
from tirelog.readers.mcap.fields import FieldColumn, RequestedField
from tirelog.readers.mcap.records import MessageTable

NUMBER = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False),
    st.integers(-(2**63), 2**63),
    st.decimals(-2000, 2000, places=4, allow_nan=False).map(float),
)
WANTS = [
    RequestedField("/t:wl[1]", ("wl", 1)),
    RequestedField("/t:wl[:]", ("wl", slice(None))),
    RequestedField("/t:n", ("n",)),
]


def columns_of(messages: list[bytes], wants: list[RequestedField]) -> list[FieldColumn]:
    sizes = np.array([len(m) for m in messages], np.int64)
    table = MessageTable(
        b"".join(messages), np.cumsum(sizes) - sizes, sizes, np.arange(len(messages))
    )
    (columns,) = ChannelDecoder("/t", "json", None).read(table, wants)
    return columns


def message(row: list[float], n: float | None, **style: Any) -> bytes:
    return json.dumps(
        {"name 7": 'a "1.5" 2', "ok": True, "wl": row, "t_ns": 1_700_000_000_000_000_001, "n": n},
        **style,
    ).encode()


@given(
    st.lists(st.tuples(NUMBER, NUMBER, NUMBER), min_size=1, max_size=12),
    st.booleans(),
    st.sampled_from([None, (",", ":")]),
)
@settings(max_examples=100, deadline=None)
def test_the_numbers_of_json(
    rows: list[tuple[float, ...]], null: bool, separators: tuple[str, str] | None
) -> None:
    data = [
        message(list(row[:2]), None if null and i else row[2], separators=separators)
        for i, row in enumerate(rows)
    ]
    columns = columns_of(data, WANTS)
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
@settings(max_examples=200, deadline=None)
def test_a_damaged_message_gives_its_numbers_or_none(at: int, byte: int, how: str) -> None:
    good = message([1550.1234, -0.5], 17)
    assume(at < len(good))
    middle = {
        "change": bytes([byte]) + good[at + 1 :],
        "delete": good[at + 1 :],
        "insert": bytes([byte]) + good[at:],
        "cut": b"",
    }[how]
    bad = good[:at] + middle
    column = columns_of([good, bad], WANTS[2:])[0].values
    try:
        decoded = json.loads(bad)
    except ValueError:  # no JSON, such as a byte of a name that is no UTF-8
        assert column[0] == 17
        assert np.isnan(column[1]) or column[1] == 17
        return
    truth = decoded.get("n") if isinstance(decoded, dict) else None
    assert column[0] == 17
    if isinstance(truth, int | float):
        assert column[1] == truth
    else:
        assert np.isnan(column[1])


def test_names_and_texts_that_hold_numbers() -> None:
    rows = [
        {"1550.5": {"x1": i / 7}, "note": '-3e5 \\ "2" é', "x": [[i], [2 * i]]} for i in range(9)
    ]
    wants = [
        RequestedField("/t:1550.5.x1", ("1550.5", "x1")),
        RequestedField("/t:x[1][0]", ("x", 1, 0)),
    ]
    columns = columns_of([json.dumps(row).encode() for row in rows], wants)
    np.testing.assert_array_equal(columns[0].values, [i / 7 for i in range(9)])
    np.testing.assert_array_equal(columns[1].values, [2.0 * i for i in range(9)])
