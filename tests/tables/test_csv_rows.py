"""Property: a number of a csv table has the digits of its rounded value, and none too many."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as some

from tirelog.tables.writer import TableWriter


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
