"""Property: the way for rows that are alike to the byte gives the very numbers of the general one, or steps aside."""

import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tirelog.readers.text import open_text
from tirelog.readers.text_fixed import fixed
from tirelog.readers.text_rows import Plan
from tirelog.readers.text_table import table

from .text_logs import read, setup_of

SETUP = setup_of({"a": {"source": "A"}, "b": {"source": "B", "kind": "strain", "unit": "strain"}})


def plan_of(separator: str = ",", decimal: str = ".", more: str = "") -> Plan:
    names = separator.join(["time_s", "A", "B", *more])
    row = separator.join(["{}", f"1550{decimal}5", f"2{decimal}5", *more])
    log = names + "\n" + "".join(row.format(i) + "\n" for i in range(8))
    return open_text(io.BytesIO(log.encode()), SETUP, "log")._plan


@given(
    st.integers(1, 8), st.integers(0, 8), st.integers(1, 8), st.integers(0, 7), st.integers(1, 40),
    st.sampled_from([(",", "."), (";", ","), ("\t", ".")]), st.sampled_from(["\n", "\r\n"]), st.integers(0, 2**32),
)  # fmt: skip
@settings(max_examples=200, deadline=None)
def test_the_same_numbers(
    whole: int, behind: int, whole_b: int, behind_b: int, rows: int, marks: tuple[str, str], end: str, seed: int
) -> None:
    separator, decimal = marks
    rng = np.random.default_rng(seed)

    def number(before: int, after: int) -> str:
        digits = "".join(map(str, rng.integers(0, 10, before + after)))
        return digits[:before] + (decimal + digits[before:] if after else "")

    lines = [separator.join([f"{i:0{whole}d}"[-8:], number(whole, behind), number(whole_b, behind_b)]) for i in range(rows)]
    block = "".join(line + end for line in lines).encode()
    plan = plan_of(separator, decimal)
    quick, general = fixed(plan, block, rows), table(plan, block, rows)
    assert (quick is None) == (whole + behind > 15 or len({len(line) for line in lines}) > 1 or len(lines[0] + end) < 16)
    if quick is not None:
        assert quick.size == rows
        for column in general.values:
            np.testing.assert_array_equal(quick.values[column], general.values[column])
        np.testing.assert_array_equal(quick.stamps, general.stamps)


GOOD = "".join(f"{i:03d}.{i:04d},1550.{i:04d},0.{i:05d}\n" for i in range(50))


@pytest.mark.parametrize("place", range(len("000.0000,1550.0000,0.00000")))
@pytest.mark.parametrize("byte", [b"/", b":", b"-", b" ", b"e", b"\x00", b"\xff", b",", b"."])
def test_any_other_byte_in_a_row_is_left_to_the_general_way(place: int, byte: bytes) -> None:
    block = bytearray(GOOD.encode())
    length = len(block) // 50
    at = 37 * length + place
    changed = block[at : at + 1] != byte
    block[at : at + 1] = byte
    assert (fixed(plan_of(), bytes(block), 50) is None) == changed


def test_a_separator_in_a_cell_that_nobody_wants() -> None:
    block = "".join(f"{i:02d},1550.5,2.5,{'ab' if i != 7 else ',b'}\n" for i in range(20)).encode()
    assert fixed(plan_of(more="xy"), block, 20) is None
    plan = plan_of(more="x")
    assert fixed(plan, block, 20) is None
    assert fixed(plan, block.replace(b",,b", b",ab"), 20) is not None


def test_a_block_takes_this_way_in_a_log(monkeypatch: pytest.MonkeyPatch) -> None:
    from tirelog.readers import text_parse

    log = ("time_s,A,B\n" + GOOD).encode()
    _, quick = read(log, SETUP)
    monkeypatch.setattr(text_parse, "table", lambda *_: pytest.fail("the general way was taken"))
    read(log, SETUP)
    monkeypatch.undo()
    monkeypatch.setattr(text_parse, "fixed", lambda *_: None)
    _, general = read(log, SETUP)
    for name in quick.values:
        np.testing.assert_array_equal(quick.values[name], general.values[name])
