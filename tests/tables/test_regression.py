"""Property: `check` finds what moved beyond its tolerance, and nothing else."""

import numpy as np
import pandas as pd
import pytest

from tirelog.errors import UsageError
from tirelog.tables.frame import differences, of_like_logs, summary


def table(log="a"):
    return pd.DataFrame(
        {
            "log": [log] * 4, "channel": ["s"] * 4, "revolution": range(4),
            "time_s": [0.1, 0.2, 0.3, 0.4], "speed_m_s": [10.0, 11.0, np.nan, 12.0],
            "quality": ["ok", "ok", "gap", "ok"],
        }
    )  # fmt: skip


def test_equal_tables_and_differences_within_a_column_s_tolerance():
    assert differences(table().iloc[::-1], table()) == []  # whatever the order of rows
    moved = table()
    moved["speed_m_s"] += 9e-6
    assert differences(moved, table()) == []
    assert len(differences(moved, table(), {"speed_m_s": 1e-6})) == 3
    with pytest.raises(UsageError, match="no such column"):
        differences(moved, table(), {"sped": 1.0})


def test_what_moved_stands_with_the_largest_first():
    moved = table()
    moved.loc[[0, 3], "speed_m_s"] = 10.5, 14.0
    moved.loc[1, "quality"] = "spike"
    found = differences(moved, table())
    assert [(d.column, d.key.split()[-1]) for d in found] == [
        ("quality", "revolution=1"), ("speed_m_s", "revolution=3"), ("speed_m_s", "revolution=0"),
    ]  # fmt: skip
    assert found[1].excess == pytest.approx(2.0 / (1e-5 + 12e-6), rel=1e-9)


def test_what_only_one_has():
    """Values that appear or disappear, rows and columns."""
    moved = table()
    moved.loc[[0, 2], "speed_m_s"] = np.nan, 11.0
    found = differences(moved, table())
    assert {d.key.split()[-1] for d in found} == {"revolution=0", "revolution=2"}
    found = differences(table().iloc[:3].drop(columns="time_s"), table())
    row = "log=a channel=s revolution=3"
    assert {(d.key, d.column) for d in found} == {("(all rows)", "time_s"), (row, "(row)")}
    moved = table().drop(columns="time_s").assign(slip=0.0).iloc[1:]
    moved.loc[1, "quality"] = "spike"
    assert summary(differences(moved, table())) == (
        "1 values moved beyond their tolerance, 1 rows are missing, 1 columns are new, 1 columns "
        "are missing"
    )


def of_logs(*logs):
    return pd.concat(map(table, logs), ignore_index=True)


@pytest.mark.parametrize(
    ("new", "old", "words"),
    [
        ("here/a.csv.gz", "there/a.csv.gz", "file name"),
        ("here/a.h5", "there/a.csv.gz", "file name without its suffixes"),
    ],
)
def test_the_same_log_from_another_folder_is_the_same_log(new, old, words):
    moved = of_logs(new)
    moved.loc[0, "speed_m_s"] = 10.5
    matched, against, remark = of_like_logs(moved, of_logs(old))
    assert remark.endswith(f"matched by {words}")
    found = differences(matched, against)
    assert [(d.column, d.value) for d in found] == [("speed_m_s", "10.5")]
    assert summary(found) == "1 values moved beyond their tolerance"


@pytest.mark.parametrize(
    ("new", "old"),
    [
        (["a/x.csv", "b.csv"], ["a/x.csv", "c/b.csv"]),  # one log has its path in both
        (["a/x.csv", "b/x.csv"], ["c/x.csv"]),  # two logs of one name
        (["a/x.csv"], ["a/y.csv"]),  # nothing matches either way
    ],
)
def test_paths_stay_the_key_where_names_would_not_do(new, old):
    matched, against, remark = of_like_logs(of_logs(*new), of_logs(*old))
    assert remark == ""
    assert sorted(set(matched["log"])) == new
    assert sorted(set(against["log"])) == old
