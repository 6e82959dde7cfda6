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


def plan_of(more="", a="1550.5000", head="{}"):
    row = ",".join([head, a, "2.5", *more])
    log = ",".join(["time_s", "A", "B", *more]) + "\n"
    log += "".join(row.format(i) + "\n" for i in range(8))
    return open_text(io.BytesIO(log.encode()), SETUP, "log")._plan


def same(plan, one, other):
    assert one.size == other.size
    for column in other.values:
        np.testing.assert_array_equal(one.values[column], other.values[column])
    np.testing.assert_array_equal(one.stamps, other.stamps)
    assert sorted(one.bad_cells) == sorted(other.bad_cells)
    assert sorted(one.bad_rows) == sorted(other.bad_rows)


@pytest.mark.parametrize(
    "text", ["99999999999.5", "1e999999", "1e99999999", "-1e30", "inf", "sNaN", "", "nan"]
)
def test_a_time_beyond_all_times_is_no_readable_time(text):
    rows = "".join(f"{at},1550.5,2.5\n" for at in ("1700000000.5", text, "1700000001.5"))
    found = parse_block(plan_of(head="1700000{}00.5"), rows.encode())
    assert found.bad_rows == [(1, "no readable time")]


PLAN = plan_of()


@pytest.mark.parametrize("text", ["+", ".", "-.", "e5", "1e", "1e+", ".e1", "--1", "٣"])
def test_what_is_no_number(text):
    found = parse_block(PLAN, f"0,1550.5,2.5\n1,1550.5,{text}\n2,1550.5,2.5\n".encode())
    assert np.isnan(found.values[2]).tolist() == [False, True, False]
    assert [line for line, _ in found.bad_cells] == [1]


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


def test_a_separator_in_a_cell_that_nobody_wants():
    block = "".join(f"{i:02d},1550.5,2.5,{'ab' if i != 7 else 'a,b'}\n" for i in range(20)).encode()
    plan = plan_of(more="x")
    parsed = parse_block(plan, block)
    assert parsed.bad_rows == [(7, "not 4 cells")]
    assert np.isnan(parsed.values[2]).tolist() == [i == 7 for i in range(20)]


def test_a_bad_cell_behind_a_row_without_a_time_is_told_once():
    block = b"0.1,1550.0,0.5\noops,1550.0,0.5\n0.3,1550.0,bad\n"
    parsed = parse_block(plan_of(), block)
    assert parsed.bad_rows == [(1, "no readable time")]
    assert parsed.bad_cells == [(2, "'bad'")]
    assert parsed.size == 3
    assert np.isnan(parsed.stamps).tolist() == [False, True, False]


@given(st.lists(st.text(alphabet=" \t\rab1.", max_size=8), max_size=6))
@settings(max_examples=150, deadline=None)
def test_runs_of_blanks(lines):
    text = "\n".join(lines).encode() + b"\n"
    want = re.sub(rb"[ \t]+", b" ", re.sub(rb"(?m)^[ \t]+|[ \t]+(?=\r?$)", b"", text))
    assert single_blanks(text) == want
