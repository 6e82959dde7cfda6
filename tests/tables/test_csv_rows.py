"""Property: csv is the same to the byte by the compiled loop and by arrow, and what the loop cannot
write it leaves.
"""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from tirelog.errors import UsageError
from tirelog.tables import writer as tables
from tirelog.tables.csv_kernel import AT_ONCE, WHOLE, Rows, Words
from tirelog.tables.writer import TableWriter

ROWS = 3 * AT_ONCE + 17


def by(
    path: Path, columns: dict[str, object], loop: bool, monkeypatch: pytest.MonkeyPatch
) -> bytes:
    """The csv of two parts, the second of few rows; by the `loop` or by arrow."""
    monkeypatch.setattr(tables, "_loop_at_hand", lambda: loop)
    with TableWriter("speed", path, "csv") as table:
        table.write(columns)
        table.write(
            {
                name: values[:3] if isinstance(values, np.ndarray) else values
                for name, values in columns.items()
            }
        )
    assert table.rows == ROWS + 3
    return path.read_bytes()


def by_both(
    folder: Path, columns: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> tuple[bytes, bytes, int]:
    """The csv by the loop and by arrow alone, and the rows that the loop did not leave to arrow."""
    rows: list[int] = []
    by_arrow = TableWriter._rows
    monkeypatch.setattr(
        TableWriter,
        "_rows",
        lambda table, some: (rows.append(some.num_rows), by_arrow(table, some)),
    )
    compiled = by(folder / "loop.csv", columns, True, monkeypatch)
    left = sum(rows)
    return compiled, by(folder / "arrow.csv", columns, False, monkeypatch), ROWS + 3 - left


def numbers(seed: int) -> dict[str, np.ndarray]:
    """Numbers of all sizes that the loop writes with twelve digits, by how they come about."""
    rng = np.random.default_rng(seed)
    sign = rng.choice([-1.0, 1.0], ROWS)
    return {
        "any": sign * 10 ** rng.uniform(-10.9, 8.9, ROWS),
        "few_digits": sign * rng.integers(0, 1000, ROWS) * 10.0 ** rng.integers(-10, 6, ROWS),
        "about_powers": 10.0 ** rng.integers(-10, 9, ROWS)
        * (1 + rng.integers(-3, 4, ROWS) * 2.0**-52),
        "halves": (rng.integers(10**8, 10**9, ROWS) + 0.5) * 10.0 ** rng.integers(-15, -1, ROWS),
        "nines": sign * (1 - 10 ** rng.uniform(-16, -7, ROWS)) * 10.0 ** rng.integers(-9, 9, ROWS),
        "lost": np.where(rng.random(ROWS) < 0.3, np.nan, sign * rng.random(ROWS)),
        "zeros": np.where(rng.random(ROWS) < 0.5, 0.0, -0.0),
        "even": np.full(ROWS, 14.0),
    }


def test_numbers(tmp_path, monkeypatch):
    found = numbers(8001)
    columns = {f"{name}{unit}": values for name, values in found.items() for unit in ("", "_s")}
    # a name of the vocabulary in seconds has twelve digits
    monkeypatch.setattr(tables, "_digits", lambda name: 12 if name.endswith("_s") else 9)
    compiled, arrow, looped = by_both(tmp_path, columns, monkeypatch)
    assert compiled == arrow
    assert looped == ROWS + 3
    for form in (b"e-10,", b",0.000001,", b",-0,", b",100000000,"):
        assert form in compiled


def test_other_columns(tmp_path, monkeypatch):
    rng = np.random.default_rng(8002)
    texts = np.array(["ok", "gap;spike", None, "", "Reifen ü", 7], object)
    columns = {
        "log": "one.csv",
        "channel": np.broadcast_to(np.array("strain_1", object), ROWS),
        "revolution": np.arange(ROWS) - 20,
        "time_s": rng.random(ROWS) * 1e4,
        "speed_m_s": rng.integers(-5, 5, ROWS),
        "quality": texts[rng.integers(0, texts.size, ROWS)],
        "steady": rng.random(ROWS) < 0.5,
        "rows": np.where(rng.random(ROWS) < 0.5, np.nan, rng.integers(-(2**53) + 1, 2**53, ROWS)),
        "single": rng.random(ROWS).astype(np.float32),
    }
    compiled, arrow, looped = by_both(tmp_path, columns, monkeypatch)
    assert compiled == arrow
    assert looped == ROWS + 3


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("speed_m_s", 2e10), ("speed_m_s", -3e17), ("speed_m_s", 9e-15), ("speed_m_s", np.inf),
        ("speed_m_s", 5e-324), ("time_s", 9e-12), ("revolution", 2.0**53),
        ("quality", 'of "marks"'), ("quality", "a,b"), ("quality", "two\n" "lines"),
        ("steady", np.nan),
    ],
)  # fmt: skip
def test_what_the_loop_leaves_to_arrow(tmp_path, monkeypatch, name, value):
    column = np.full(
        ROWS, "ok" if name == "quality" else 0.25 if name != "revolution" else 1.0, object
    )
    column[[0, AT_ONCE + 3]] = value
    columns = {
        "time_s": np.arange(ROWS) * 0.1,
        name: column if name == "quality" else column.astype(float),
    }
    if name == "steady":
        columns["steady"] = np.where(np.isnan(columns["steady"]), np.nan, 1.0)
    compiled, arrow, looped = by_both(tmp_path, columns, monkeypatch)
    assert compiled == arrow
    assert looped < ROWS


@given(some.floats(1e-11, 1e9, exclude_max=True), some.sampled_from([9, 12]))
@settings(max_examples=300, deadline=None)
def test_digits_are_those_of_the_rounded_number(value, digits):
    """A number is written as the nearest of so many digits, with no digit too many."""
    text = bytes(Rows([(digits, np.array([value]))]).written(slice(0, 1))).decode()
    assert text.endswith("\n")
    assert abs(float(text) / value - 1) < 0.5001 * 10.0 ** (1 - digits)
    assert len(text.strip().split("e")[0].replace(".", "").strip("0")) <= digits


def test_whole_numbers_and_words_end_where_they_should():
    rows = Rows(
        [(WHOLE, np.array([0, -1, 10, 99, 2**53 - 1])), Words(["", "ä"], np.array([0, 1, 0, 1, 1]))]
    )
    assert bytes(rows.written(slice(0, 5))).decode() == "0,\n-1,ä\n10,\n99,ä\n9007199254740991,ä\n"
    assert rows.written(slice(2, 2)).size == 0


@pytest.mark.parametrize("loop", [True, False])
def test_columns_that_change_are_refused(tmp_path, monkeypatch, loop):
    monkeypatch.setattr(tables, "_loop_at_hand", lambda: loop)
    with (
        pytest.raises(UsageError, match="has b, which the logs before have not"),
        TableWriter("new", tmp_path / "t.csv", None) as table,
    ):
        table.write({"a": np.zeros(3)})
        table.write({"b": np.zeros(3)})
