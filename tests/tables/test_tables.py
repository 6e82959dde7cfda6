"""Property and faults: a table says the same in every format, and stands whole under its name or
not at all.
"""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from tirelog.errors import OutputError, ReadError, UsageError
from tirelog.storage.whole import whole_file
from tirelog.tables.writer import FORMATS, TableWriter, read_table
from tirelog.vocabulary.columns import COLUMNS, TABLES, TableColumn, register

PART = {
    "quality": np.array(["ok", "gap;spike", "ok"], dtype=object),
    "log": "a, b.csv",
    "channel": "strain_1",
    "revolution": np.array([0, 1, 2]),
    "time_s": np.array([0.1, 1234.5678901234, 1e-7]),
    "speed_m_s": np.array([14.0000000001234, np.nan, 3.0]),
}
ORDER = ["log", "channel", "revolution", "time_s", "speed_m_s", "quality"]


def write(path: Path) -> pd.DataFrame:
    with TableWriter("speed", path, None, metadata={"inputs": {"a": "00"}}) as table:
        table.write(PART)
        table.write(PART)
    return read_table(path)


@pytest.mark.parametrize("suffix", ["csv", "ndjson", "json", "parquet"])
def test_every_format_says_the_same(tmp_path: Path, suffix: str) -> None:
    frame = write(tmp_path / f"t.{suffix}")
    assert list(frame.columns) == ORDER
    assert frame["log"].tolist() == ["a, b.csv"] * 6
    assert frame["revolution"].tolist() == [0, 1, 2] * 2
    np.testing.assert_allclose(frame["time_s"], np.tile(PART["time_s"], 2), rtol=1e-11)
    np.testing.assert_allclose(frame["speed_m_s"], np.tile(PART["speed_m_s"], 2), rtol=1e-8)
    assert frame["quality"].tolist() == ["ok", "gap;spike", "ok"] * 2
    assert list(tmp_path.iterdir()) == [tmp_path / f"t.{suffix}"]


def test_parquet_carries_units_version_and_inputs(tmp_path: Path) -> None:
    write(tmp_path / "t.parquet")
    schema = pq.read_schema(tmp_path / "t.parquet")
    assert schema.field("speed_m_s").metadata[b"unit"] == b"m/s"
    about = json.loads(schema.metadata[b"tirelog"])
    assert about["inputs"] == {"a": "00"}
    assert about["table"] == "speed"
    assert about["version"]


def test_an_empty_table_has_its_columns(tmp_path: Path) -> None:
    with TableWriter("speed", tmp_path / "t.csv", None):
        pass
    assert (tmp_path / "t.csv").read_text().strip().split(",") == list(TABLES["speed"])


def test_nothing_stands_under_the_name_when_the_work_fails(tmp_path: Path) -> None:
    with (
        pytest.raises(RuntimeError, match="in the middle"),
        TableWriter("speed", tmp_path / "t.csv", None) as table,
    ):
        table.write(PART)
        raise RuntimeError("in the middle")
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_the_older_file(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("older")
    with pytest.raises(OutputError, match="disk is full"), whole_file(tmp_path / "t.csv") as part:
        part.write_text("half")
        raise OSError(28, "No space left on device")
    assert (tmp_path / "t.csv").read_text() == "older"
    assert list(tmp_path.iterdir()) == [tmp_path / "t.csv"]


def test_output_folder_missing(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="folder has to exist"):
        TableWriter("speed", tmp_path / "no" / "t.csv", None)


def test_output_is_a_folder(tmp_path: Path) -> None:
    (tmp_path / "t.csv").mkdir()
    with pytest.raises(OutputError, match="it is a folder"):
        TableWriter("speed", tmp_path / "t.csv", None)


def test_unknown_suffix_and_format(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no format has the suffix '.xls'"):
        TableWriter("speed", tmp_path / "t.xls", None)
    with pytest.raises(UsageError, match="nearest: parquet"):
        TableWriter("speed", None, "parket")


@pytest.mark.parametrize("name", ["t.csv", "t.parquet", "t.json"])
def test_what_is_no_table(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"")
    with pytest.raises(ReadError, match="is not a table"):
        read_table(tmp_path / name)


def test_every_table_is_made_of_known_columns() -> None:
    assert {name for columns in TABLES.values() for name in columns} <= set(COLUMNS)


def test_a_column_is_registered_once() -> None:
    """The second of two would take the place of the first, with its unit, meaning and tolerance."""
    one = TableColumn("share", "1", "float", "of the whole")
    other = TableColumn("share", "", "float", "of the rest")
    assert register([one]) == {"share": one}
    with pytest.raises(ValueError, match="share is registered twice"):
        register([one, other])


@pytest.mark.parametrize("format", FORMATS)
def test_a_later_log_may_say_less(tmp_path: Path, format: str) -> None:
    """What the setup of a later log leaves open is empty there; what only a later one has stands
    nowhere, so it is refused.
    """
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
