"""Faults: a table stands whole under its name or not at all, and what is no table is refused."""

import pytest

from tests.tables.speed_rows import PART
from tirelog.errors import OutputError, ReadError
from tirelog.storage.whole import whole_file
from tirelog.tables.frame import read_table
from tirelog.tables.writer import TableWriter


def test_nothing_stands_under_the_name_when_the_work_fails(tmp_path):
    with (
        pytest.raises(RuntimeError, match="in the middle"),
        TableWriter("speed", tmp_path / "t.csv", None) as table,
    ):
        table.write(PART)
        raise RuntimeError("in the middle")
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_the_older_file(tmp_path):
    (tmp_path / "t.csv").write_text("older")
    with pytest.raises(OutputError, match="disk is full"), whole_file(tmp_path / "t.csv") as part:
        part.write_text("half")
        raise OSError(28, "No space left on device")
    assert (tmp_path / "t.csv").read_text() == "older"
    assert list(tmp_path.iterdir()) == [tmp_path / "t.csv"]


@pytest.mark.parametrize("name", ["t.csv", "t.parquet", "t.json"])
def test_what_is_no_table(tmp_path, name):
    (tmp_path / name).write_bytes(b"")
    with pytest.raises(ReadError, match="is not a table"):
        read_table(tmp_path / name)
