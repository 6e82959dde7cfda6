"""Property: the library's way gives the careful way's very numbers."""

import io
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.readers.text_logs import setup_of
from tirelog.readers.text.parse import normalized, odd_rows, parse_block, single_blanks
from tirelog.readers.text.reader import open_text

SETUP = setup_of({"a": "A", "b": {"source": "B", "kind": "strain", "unit": "strain"}})


def plan_of(head="{}"):
    rows = "".join(f"{head.format(i)},1550.5000,2.5\n" for i in range(8))
    return open_text(io.BytesIO(f"time_s,A,B\n{rows}".encode()), SETUP, "log")._plan


def same(plan, one, other):
    assert one.size == other.size
    for column in other.values:
        np.testing.assert_array_equal(one.values[column], other.values[column])
    np.testing.assert_array_equal(one.stamps, other.stamps)
    assert sorted(one.bad_cells) == sorted(other.bad_cells)
    assert sorted(one.bad_rows) == sorted(other.bad_rows)


ODD = "0 -1 0.0000 -1.0000 NaN nan null - inf oops 1550,5"
PIECE = st.one_of(
    st.sampled_from(["", "1.5 ", " 1550.0001", "x\ry", *ODD.split()]),
    st.decimals(-2000, 2000, places=4, allow_nan=False, allow_infinity=False).map(str),
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.from_regex(r"[+-]?(\d{1,20}(\.\d{0,12})?|\.\d{1,12})([eE][+-]?\d{1,3})?", fullmatch=True),
)

ROW = st.one_of(st.lists(PIECE, min_size=3, max_size=3), st.lists(PIECE, min_size=1, max_size=5))


HEADS = ["{}", "17000000{}.25", "2024-05-01T12:49:0{}.5"]


@given(st.lists(ROW, min_size=1, max_size=30), st.integers(0, 2), st.sampled_from(HEADS))
@settings(max_examples=200, deadline=None)
def test_anything_at_all_is_what_the_careful_way_reads(rows, often, head):
    """Both ways agree on samples, on losses and on their lines."""
    plan = plan_of(head=head)
    good = "".join(f"{head.format(i % 8)},1550.1234,-0.25\n" for i in range(40 * often))
    block = "".join(",".join(row) + "\n" + good for row in rows).encode()
    same(plan, parse_block(plan, block), odd_rows(plan, 0, normalized(plan.layout, block)))


@pytest.mark.parametrize("place", range(len("000.0000,1550.0000,0.00000")))
def test_any_other_byte_in_a_row(place):
    rows = "".join(f"{i:03d}.{i:04d},1550.{i:04d},0.{i:05d}\n" for i in range(50)).encode()
    at, plan = 37 * (len(rows) // 50) + place, plan_of()
    for byte in b"/:- e\x00\xff,.\r":
        block = rows[:at] + bytes([byte]) + rows[at + 1 :]
        same(plan, parse_block(plan, block), odd_rows(plan, 0, normalized(plan.layout, block)))


@given(st.lists(st.text(alphabet=" \t\rab1.", max_size=8), max_size=6))
@settings(max_examples=150, deadline=None)
def test_runs_of_blanks(lines):
    text = "\n".join(lines).encode() + b"\n"
    want = re.sub(rb"[ \t]+", b" ", re.sub(rb"(?m)^[ \t]+|[ \t]+(?=\r?$)", b"", text))
    assert single_blanks(text) == want
