"""Property: a table says the same in every format, in columns that are known."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from tirelog.errors import UsageError
from tirelog.tables.frame import read_table
from tirelog.tables.writer import TableWriter
from tirelog.vocabulary.columns import ALL, COLUMNS
from tirelog.vocabulary.tables import TABLE_FORMATS

#: three rows of the speed table, of a log whose name holds a comma
PART = {
    "quality": np.array(["ok", "gap;spike", "ok"], dtype=object),
    "log": "a, b.csv",
    "channel": "strain_1",
    "revolution": np.array([0, 1, 2]),
    "time_s": np.array([0.1, 1234.5678901234, 1e-7]),
    "speed_m_s": np.array([14.0000000001234, np.nan, 3.0]),
}
ORDER = ["log", "channel", "revolution", "time_s", "speed_m_s", "quality"]


def write(path):
    with TableWriter("speed", path, None, metadata={"inputs": {"a": "00"}}) as table:
        table.write(PART)
        table.write(PART)
    return read_table(path)


@pytest.mark.parametrize("suffix", ["csv", "ndjson", "json", "parquet"])
def test_every_format_says_the_same(tmp_path, suffix):
    frame = write(tmp_path / f"t.{suffix}")
    assert list(frame.columns) == ORDER
    assert frame["log"].tolist() == ["a, b.csv"] * 6
    assert frame["revolution"].tolist() == [0, 1, 2] * 2
    np.testing.assert_allclose(frame["time_s"], np.tile(PART["time_s"], 2), rtol=1e-11)
    np.testing.assert_allclose(frame["speed_m_s"], np.tile(PART["speed_m_s"], 2), rtol=1e-8)
    assert frame["quality"].tolist() == ["ok", "gap;spike", "ok"] * 2
    assert list(tmp_path.iterdir()) == [tmp_path / f"t.{suffix}"]


def test_parquet_carries_units_version_and_inputs(tmp_path):
    write(tmp_path / "t.parquet")
    schema = pq.read_schema(tmp_path / "t.parquet")
    assert schema.field("speed_m_s").metadata[b"unit"] == b"m/s"
    about = json.loads(schema.metadata[b"tirelog"])
    assert about["inputs"] == {"a": "00"}
    assert about["table"] == "speed"
    assert about["version"]


def test_a_column_is_registered_once():
    """The second of two would take the place of the first, with its unit, meaning and tolerance."""
    assert [column.name for column in ALL] == list(COLUMNS)


@pytest.mark.parametrize("format", TABLE_FORMATS)
def test_a_later_log_may_say_less(tmp_path, format):
    """What the setup of a later log leaves open is empty there."""
    full = {
        "log": "a.csv",
        "revolution": np.arange(3),
        "strip_power_W": np.array([1.0, 2.0, 3.0]),
        "quality": np.array(["ok"] * 3, object),
    }
    less = {
        name: value for name, value in full.items() if name not in ("strip_power_W", "quality")
    } | {"log": "b.csv"}
    out = tmp_path / f"t.{format}"
    with TableWriter("dissipation", out, format) as table:
        table.write(full)
        table.write(less)
    read = read_table(out)
    assert read["strip_power_W"].isna().tolist() == [False] * 3 + [True] * 3
    assert (read["quality"].fillna("") == "").tolist() == [False] * 3 + [True] * 3
    assert read["log"].tolist() == ["a.csv"] * 3 + ["b.csv"] * 3
    with (
        pytest.raises(UsageError, match=r"b\.csv: has strip_power_W, quality, which"),
        TableWriter("dissipation", out, format) as table,
    ):
        table.write(less | {"log": "a.csv"})
        table.write(full | {"log": "b.csv"})
    assert read_table(out).equals(read)


@given(
    some.lists(some.floats(1e-11, 1e9, exclude_max=True), min_size=1, max_size=9),
    some.sampled_from([("speed_m_s", 9), ("time_s", 12)]),
)
@settings(max_examples=100, deadline=None)
def test_digits_are_those_of_the_rounded_number(tmp_path_factory, values, column):
    name, digits = column
    path = tmp_path_factory.mktemp("rows") / "t.csv"
    with TableWriter("speed", path, None) as table:
        table.write({name: np.array(values)})
    header, *rows = path.read_text().splitlines()
    assert header == name
    for text, value in zip(rows, values, strict=True):
        assert abs(float(text) / value - 1) < 0.5001 * 10.0 ** (1 - digits)
        assert len(text.split("e")[0].replace(".", "").strip("0")) <= digits


def test_rows_of_many_parts_are_all_there(tmp_path):
    count = 50_001
    with TableWriter("speed", tmp_path / "t.csv", None) as table:
        table.write({"log": "a.csv", "revolution": np.arange(count), "quality": "ok"})
        table.write({"log": "b.csv", "revolution": np.arange(0), "quality": "ok"})
    rows = (tmp_path / "t.csv").read_text().splitlines()
    assert rows[1:] == [f"a.csv,{k},ok" for k in range(count)]
    assert table.rows == count
