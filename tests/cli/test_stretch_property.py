"""Property: a stretch of a log has the rows of the whole log's table, to the last digit."""

from pathlib import Path

import pandas as pd
import pytest

import tirelog as tirelog_module
from tests.cli.conftest import pulse_rows

SAMPLES = Path(__file__).parents[2] / "sample_data"


def between(table, start, stop):
    inside = (table["time_s"] >= start) & (table["time_s"] < stop)
    return table[inside].reset_index(drop=True)


@pytest.mark.parametrize("name", ["speed", "footprint", "dissipation"])
def test_a_stretch_is_a_part_of_the_table(folder, tirelog, name):
    assert tirelog(name, "log.csv", "-o", "whole.csv").status == 0
    tirelog(name, "log.csv", "--from", "1.2", "--to", "2.5", "-o", "part.csv").ended(0)
    whole, part = pd.read_csv("whole.csv"), pd.read_csv("part.csv")
    assert 5 < len(part) < len(whole) - 5
    pd.testing.assert_frame_equal(part, between(whole, 1.2, 2.5), check_exact=True)


@pytest.mark.parametrize("name", ["slip", "phase_shift", "strain_shift", "grip", "wheel_angle"])
def test_a_notebook_has_the_same_stretch(name):
    log = SAMPLES / ("cleat.csv.gz" if "strain" in name else "encoder.h5")
    log = SAMPLES / "drive.csv.gz" if name == "grip" else log
    function = getattr(tirelog_module, name)
    begin = 10.0 if name == "grip" else 1.0
    whole = function(log, start=begin, stop=begin + 1.9)
    part = function(log, start=begin + 0.5, stop=f"{begin + 1.5}")
    assert len(part) > 0
    pd.testing.assert_frame_equal(part, between(whole, begin + 0.5, begin + 1.5), check_exact=True)


def test_all_tables_of_a_stretch(folder, tirelog):
    tirelog("tables", "log.csv", "-o", "made", "--from", "1", "--to", "2").ended(0)
    for name in ("speed", "footprint", "dissipation"):
        whole = getattr(tirelog_module, name)("log.csv")
        part = pd.read_csv(f"made/{name}.csv")
        assert part["revolution"].tolist() == between(whole, 1.0, 2.0)["revolution"].tolist()


@pytest.mark.parametrize("begin", ["2024-05-01T12:00:01", "2024-05-01 12:00:01.0", "12:00:01"])
def test_a_stamp_is_a_moment_of_the_log(folder, tirelog, begin):
    rows = [row.split(",", 1) for row in pulse_rows()]
    stamped = [f"2024-05-01T12:00:0{float(t):.4f},{rest}" for t, rest in rows]
    (folder / "log.csv").write_text("time_s,CH1,CH2\n" + "\n".join(stamped) + "\n")
    by_stamp = tirelog("speed", "log.csv", "--from", begin, "--to", "2.5").ended(0)
    assert by_stamp.out == tirelog("speed", "log.csv", "--from", "1", "--to", "2.5").out
    if len(begin) > len("12:00:01"):  # with an offset from UTC it is of the log's clock too
        zoned = tirelog("speed", "log.csv", "--from", f"{begin}+02:00", "--to", "2.5")
        assert zoned.out == by_stamp.out
    wrong = tirelog("speed", "log.csv", "--from", "first")
    assert "a stamp such as 2024-05-01T12:00:00" in wrong.err


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("speed log.csv --to=-1", "no sample lies in --to -1"),
        ("speed log.csv --from 3 --to 2", "no sample lies"),
        ("speed log.csv --from nan", "--from nan; allowed are seconds since"),
        ("speed log.csv --from 500ms", "500 ms is 0.5 s"),
        ("speed log.csv --from 1,5", "the decimal sign is a point: 1.5"),
        ("dissipation log.csv --from 1 --fit", "of the whole log"),
        ("footprint log.csv --from 1 --plot p.png", "of the whole log"),
        ("phase-shift log.csv --from 1 --calibrate c.toml", "from whole logs"),
        ("tables log.csv -o made --table inflation --from 1", "no option of inflation"),
    ],
)
def test_a_stretch_that_cannot_be_is_refused(folder, tirelog, words, says):
    done = tirelog(words)
    done.refused(says)
    assert done.out == ""


def test_a_stretch_without_rows_is_an_empty_table(folder, tirelog):
    done = tirelog("speed", "log.csv", "--from", "1", "--to", "1.0001").ended(0)
    assert done.out.count("\n") == 1
