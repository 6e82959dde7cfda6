"""Closed form: layouts that instruments write, each read back to the numbers that stand in it."""

from pathlib import Path

import numpy as np
import pytest

from tests.readers.text_logs import read, setup_of
from tirelog.errors import ReadError, SetupError
from tirelog.readers.base import date_of
from tirelog.runs.ingest import open_recording
from tirelog.vocabulary.quality import Quality

TWO = {"a": "A", "b": "B"}
#: a channel that loses no value to a grating's rules
W = {"w": {"kind": "temperature", "source": "W"}}
A = np.array([1550.1234, 1550.25, np.nan, 1549.5])
B = np.array([1542.0, np.nan, 1542.5, 1542.25])
T = np.array([0.0, 0.5, 1.0, 1.5])
SAMPLES = Path(__file__).parents[2] / "sample_data"


def check(text, channels=TWO, log="", start=None):
    reader, block = read(text, channels, log)
    np.testing.assert_array_equal(block.values["a"], A)
    np.testing.assert_array_equal(block.values["b"], B)
    np.testing.assert_allclose(block.stamps_s, T, rtol=0, atol=1e-9)
    assert reader.report.start == start
    assert reader.report.losses == []
    return reader, block


PLAIN = {
    "units in brackets below": "t;A;B;\n[s];[nm];[nm];\n0;1550.1234;1542;\n0.5;1550.25;;\n"
    "1;;1542.5;\n1.5;1549.5;1542.25;\n",
    "other order, more columns": "B,x,time [ms],A\n1542,7,0,1550.1234\n,7,500,1550.25\n"
    "1542.5,7,1000,\n1542.25,7,1500,1549.5\n",
    "quoted words with commas": 't,note,A,B\n0,"on, off",1550.1234,1542\n'
    '0.5,"a ""b"", c",1550.25,\n1,5" wheel,,1542.5\n1.5,,1549.5,1542.25\n',
    "other quotes, and commas in names": "'t','left, outer','A','B'\n'0','1,5','1550,1234','1542'\n"
    "'0,5','1,5','1550,25',''\n'1','1,5','','1542,5'\n'1,5','1,5','1549,5','1542,25'\n",
    "quotes around whole lines": '"t;A;B"\n"0;1550.1234;1542"\n"0.5;1550.25;0"\n"1;;1542.5"\n'
    '"1.5;1549.5;1542.25"\n',
}
#: what no program can know from the bytes, each with the [log] that says it
TOLD = {
    "bars": (
        "time_s|A|B\n0|1550.1234|1542\n0.5|1550.25|\n1||1542.5\n1.5|1549.5|1542.25\n",
        'separator = "|"',
    ),
    "a row of numbers that is no sample": (
        "17;1;2\ntime_s;A;B\n0;1550,1234;1542\n0,5;1550,25;\n1;;1542,5\n1,5;1549,5;1542,25\n",
        'header_rows = 2\ndecimal = ","',
    ),
    "numbers above rows without names": (
        "3;4711;4712\n0;1550.1234;1542\n0.5;1550.25;\n1;;1542.5\n1.5;1549.5;1542.25\n",
        'header_rows = 1\ncolumns = ["time_s", "A", "B"]',
    ),
    "other names": (
        "t;x;A\n0;1550.1234;1542\n0.5;1550.25;\n1;;1542.5\n1.5;1549.5;1542.25\n",
        'columns = ["time_s", "A", "B"]',
    ),
}
LAYOUTS = {name: (text, "") for name, text in PLAIN.items()} | TOLD


@pytest.mark.parametrize("name", LAYOUTS)
def test_layouts_that_are_recognised_or_said(name):
    reader, _ = check(LAYOUTS[name][0], log=LAYOUTS[name][1])
    assert reader.groups[0].channels == ("a", "b")


HALF_DAY = ["11:59:59.0 {}M", "11:59:59.5 {}M", "12:00:00.0 {}M", "12:00:00.5 {}M"]
#: stamps half a second apart, their resolution, the start that is told
STAMPS = {
    "iso": ([f"2022-04-14T13:00:0{s}" for s in ("0.0", "0.5", "1.0", "1.5")], 0.1,
            "2022-04-14T13:00:00.0"),
    "iso with offset": ([f"2022-04-14T23:59:{s:04.1f}+02:00" for s in (58, 58.5, 59, 59.5)], 0.1,
                        "2022-04-14T23:59:58.0+02:00"),
    "iso with blank": ([f"2022-04-14 13:00:0{s}" for s in ("0", "0.500", "1", "1.5")], 1e-3,
                       "2022-04-14T13:00:00"),
    "slashes": ([f"14/04/2022 23:59:{s}" for s in ("59.000000", "59.500000")]
                + [f"15/04/2022 00:00:{s}" for s in ("00.000000", "00.500000")], 1e-6,
                "2022-04-14T23:59:59.000000"),
    "hours of half a day": ([f"14/04/2022 {s}".format("AAPP"[k]) for k, s in enumerate(HALF_DAY)],
                            0.1, "2022-04-14T11:59:59.0"),
    "iso, hours of half a day": (["2022-04-14 11:59:59 p.m.", "2022-04-14 11:59:59.5 p.m.",
                                  "2022-04-15 12:00:00 a.m.", "2022-04-15 12:00:00.500 a.m."],
                                 1e-3, "2022-04-14T11:59:59 p.m."),
    "dashes": ([f"16-07-2015 10:00:{s} " for s in ("00.000", "00.500", "01.000", "01.500")], 1e-3,
               "2015-07-16T10:00:00.000"),
    "no date, half a day": ([s.format("PPAA"[k]) for k, s in enumerate(HALF_DAY)], 0.1, None),
    "minutes, past the hour": (["59:59.0", "59:59.5", "00:00.0", "00:00.5"], 0.1, None),
    "minutes of a timer": (["59:59.0", "59:59.5", "60:00.0", "60:00.5"], 0.1, None),
    "minutes with commas": (["00:58,5", "00:59,0", "00:59,5", "01:00,0"], 0.1, None),
}  # fmt: skip
#: columns A and B, whose lost peaks are blank
CELLS = (["1550.1234", "1550.25", "", "1549.5"], ["1542", "", "1542.5", "1542.25"])


@pytest.mark.parametrize("name", STAMPS)
def test_stamps_of_dates_and_times(name):
    stamps, resolution, start = STAMPS[name]
    rows = "".join(";".join(row) + "\n" for row in zip(stamps, *CELLS))
    reader, _ = check("when;A;B\n" + rows, start=start)
    assert reader.groups[0].stamp_resolution_s == pytest.approx(resolution)


def test_day_first_unless_a_field_proves_the_month_first():
    rows = "12/31/2021 23:59:59.5,1550\n01/01/2022 00:00:00.5,1551\n"
    _, block = read("time,A\n" + rows, {"a": "A"})
    np.testing.assert_allclose(block.stamps_s, [0.0, 1.0], atol=1e-9)


def test_date_and_time_in_two_columns():
    text = "Samples per Second\t2\nLocal Date\tLocal Time\tSample\tA\tB\n"
    times = ["23:59:59.0", "23:59:59.5", "00:00:00.0", "00:00:00.5"]
    dates = ["16-07-2015", "16-07-2015", "17-07-2015", "17-07-2015"]
    peaks = (["1550,1234", "1550,25", "", "1549,5"], ["1542,0", "", "1542,5", "1542,25"])
    text += "".join("\t".join(row) + "\n" for row in zip(dates, times, "1234", *peaks))
    reader, block = check(text, start="2015-07-16T23:59:59.0")
    assert reader.groups[0].rate_Hz == 2.0
    np.testing.assert_array_equal(block.number, [1, 2, 3, 4])


def test_research_logger_without_header_runs_past_midnight():
    times = ["23-59-59.000000", "23-59-59.500000", "00-00-00.000000", "00-00-00.500000"]
    cells = zip(times, ["1550.1234", "1550.25", "0", "1549.5"], ["1542", "0", "1542.5", "1542.25"])
    text = "".join(f"{t}: {a}, {b}\n" for t, a, b in cells)
    reader, _ = check(text, {"a": "#2", "b": "#3"})
    assert reader.report.counts["midnight_rollovers"] == 1


def test_one_second_stamps_with_line_numbers_count_by_line():
    rows = [
        f"2022-04-14T13:00:{i // 20:02d}+02:00\t\t{i + 1}\t"
        f"0;0;{int(i == 5)};{3 * (i in (5, 6))}\t{100 + i / 10}"
        for i in range(60)
    ]
    text = "Date\tTime\tLinenumber\tError status\tW-N-01\n" + "\n".join(rows) + "\n"
    reader, block = read(text, {"w": "W-N-01"}, kind="strain", unit="microstrain")
    group = reader.groups[0]
    assert (group.counted, group.stamp_resolution_s) == (True, 1.0)
    np.testing.assert_array_equal(block.number, np.arange(1, 61))
    np.testing.assert_array_equal(block.values["w"], 100 + np.arange(60) / 10)
    assert reader.report.counts["rows_with_error_codes"] == 2
    assert reader.report.counts["error_codes"] == 3
    assert block.flags == (("w", 5, 7, Quality.ERROR_CODE),)


@pytest.mark.parametrize("log", ["", 'time = "#1"'])
@pytest.mark.parametrize("stamp", ["{:.1f}", "2024-03-12 13:00:{:04.1f}"])
def test_the_newest_row_first_is_told(log, stamp, tmp_path):
    rows = [f"{stamp.format(i / 10)},{10 + i % 7}\n" for i in range(300, 0, -1)]
    (tmp_path / "l.csv").write_text("Time,W\n" + "".join(rows))
    opened = open_recording(str(tmp_path / "l.csv"), setup_of(W, log))
    with pytest.raises(ReadError, match=r"the rows run backwards in time; .*; sort them"), opened:
        pass
    (tmp_path / "l.csv").write_text("Time,W\n" + "".join(sorted(rows)))
    with open_recording(str(tmp_path / "l.csv"), setup_of(W, log)) as recording:
        assert recording.channels["w"].axis.rate_Hz == pytest.approx(10.0)


def test_a_lap_time_beside_the_time_is_not_the_time():
    rows = "".join(f"0:{i % 20:02d}.0,{i},{100 + i}\n" for i in range(60))
    np.testing.assert_array_equal(read(f"lap,time_s,W\n{rows}", W)[1].stamps_s, np.arange(60.0))


@pytest.mark.parametrize("header", ["Time", "Time [s]"])
def test_seconds_of_a_day_stay_seconds(header):
    """12:36 is 45363 s after midnight: no log of seconds rises by less than a microsecond."""
    rows = "".join(f"{45363 + k / 1e5:.5f},{100 + k}\n" for k in range(500))
    reader, block = read(f"{header},W\n{rows}", W)
    np.testing.assert_allclose(block.stamps_s, np.arange(500) / 1e5, rtol=0, atol=1e-9)
    assert reader.report.remarks == []


CODES = dict.fromkeys(("Error status", "CH1_error", "FaultBits", "errorCode"), 2)


@pytest.mark.parametrize(("name", "codes"), [*CODES.items(), ("default range", 0), ("terrors", 0)])
def test_error_codes_are_named_by_a_whole_word(name, codes):
    rows = "".join(f"{i / 10:.4f},{int(i in (5, 9))},{100 + i}\n" for i in range(60))
    reader, block = read(f"time,{name},W\n{rows}", W)
    assert reader.report.counts.get("rows_with_error_codes", 0) == codes
    assert len(block.flags) == codes


@pytest.mark.parametrize("time", ["Time  1 - default sample rate", "Time error (s)"])
def test_the_time_and_a_channel_are_no_error_codes(time):
    """The first is what HBM catman calls its time."""
    rows = "".join(f"{i / 10:.4f}\t{100 + i}\n" for i in range(60))
    _, block = read(f"{time}\tservo error\n{rows}", {"w": "servo error"}, kind="temperature")
    np.testing.assert_allclose(block.stamps_s, np.arange(60) / 10, atol=1e-12)
    assert block.flags == ()


@pytest.mark.parametrize("said", ["", "\tbrakes on"])
def test_labview_leaves_out_remarks_that_are_not_made(said):
    """Its header ends with a column `Comment`, which rows have only if there is one."""
    head = "LabVIEW Measurement\t\nWriter_Version\t2\n***End_of_Header***\t\n\t\n"
    head += "Channels\t2\t\t\nDelta_X\t0.1\t0.1\t\n***End_of_Header***\t\t\t\n"
    rows = [f"{i / 10:.6f}\t{100 + i}\t{200 + i}" for i in range(60)]
    rows[7] += said
    text = head + "X_Value\tWL1\tWL2\tComment\n" + "\n".join(rows) + "\n"
    reader, block = read(text, {"WL1": "WL1", "WL2": "WL2"}, kind="temperature")
    np.testing.assert_array_equal(block.values["WL1"], 100 + np.arange(60))
    np.testing.assert_array_equal(block.values["WL2"], 200 + np.arange(60))
    np.testing.assert_allclose(block.stamps_s, np.arange(60) / 10, atol=1e-12)
    assert reader.report.remarks == reader.report.losses == []


def test_a_header_that_does_not_fit_is_not_needed_for_gratings():
    rows = "".join(f"{i / 10},{1550 + i / 1e4},{1542 + i / 1e4}\n" for i in range(60))
    two = {"a": "A", "b": {"source": "B", "reference_wavelength_nm": 1542}}
    reader, block = read("time,x,A,B\n" + rows, two)
    np.testing.assert_allclose(block.values["b"], 1542 + np.arange(60) / 1e4, atol=1e-9)
    assert "gratings are found by wavelength" in reader.report.remarks[0]


def test_zero_is_a_reading_where_no_peak_is_read():
    text = "t,E,S\n0.0,0,-1\n0.1,1,0\n0.2,-1,5\n"
    encoder = {"kind": "wheel_encoder", "source": "E", "steps": 48}
    _, block = read(text, {"e": encoder, "s": {"source": "S", "kind": "strain"}})
    np.testing.assert_array_equal(block.values["e"], [0, 1, -1])
    np.testing.assert_array_equal(block.values["s"], [-1, 0, 5])


def test_names_are_forgiven_but_not_guessed():
    text = "time_s,WL 1[nm],WL 2[nm],Strain_X\n0.0,1550,1551,1\n0.1,1550,1551,2\n"
    reader, _ = read(text, {"a": "WL 1", "b": "wl_2", "c": "strain x"})
    assert reader.columns.values == {"a": 1, "b": 2, "c": 3}
    reader, block = read(text, {"a": "WL 1", "b": "WL 9"})
    assert list(block.values) == ["a"]
    assert "no column 'WL 9' (nearest: WL" in reader.report.losses[0]
    with pytest.raises(ReadError, match=r"no column 'foo'.*the log's columns are time_s, WL 1"):
        read(text, {"a": "foo"})


def test_the_time_column_is_the_setups_where_it_names_one():
    text = "time_s,clock,A\n0.0,10.0,1550\n0.1,10.5,1551\n"
    _, block = read(text, {"a": "A"}, 'time = "clock"\ntime_unit = "ms"')
    np.testing.assert_allclose(block.stamps_s, [0, 0.0005], atol=1e-12)
    with pytest.raises(SetupError, match=r"\[log\] time: no column 'tme_s' \(nearest: time_s\)"):
        read(text, {"a": "A"}, 'time = "tme_s"')


def test_of_two_stamps_the_finer_one_is_taken():
    rows = [f"2020-01-01 10:00:0{i // 2}\t{i / 2}\t1550\n" for i in range(3)]
    _, block = read("Timestamp\tTime [s]\tA\n" + "".join(rows), {"a": "A"})
    np.testing.assert_allclose(block.stamps_s, [0, 0.5, 1], atol=1e-12)


def test_blank_cells_left_out_at_the_end_of_rows_keep_the_columns():
    rows = [("1550.1234", "1542.0"), ("1550.25", ""), ("", "1542.5"), ("1549.5", "1542.25")] * 10
    lines = (",".join([f"{i / 2:.1f}", *row]).rstrip(",") + "\n" for i, row in enumerate(rows))
    two = {"a": "A", "b": {"source": "B", "reference_wavelength_nm": 1549.0}}
    reader, block = read("time_s,A,B\n" + "".join(lines), two)
    np.testing.assert_array_equal(block.values["a"], np.tile(A, 10))
    np.testing.assert_array_equal(block.values["b"], np.tile(B, 10))
    assert reader.report.losses == []


@pytest.mark.parametrize("names", [1, 8])
def test_a_header_that_names_too_few_or_too_many_columns(names):
    i = np.arange(40)
    header = "\t".join(["Timestamp", "Time [s]", *(f"WL {k + 1}[nm]" for k in range(names))])
    rows = [
        f"2020-01-01 10:00:{k // 4:02d}\t{k // 4}\t{1560 + k / 1000:.3f}\t1550.500\t1540.{k:03d}\t"
        for k in i
    ]
    two = {
        "a": {"source": "WL 3", "reference_wavelength_nm": 1540.0},
        "b": {"source": "WL 1", "reference_wavelength_nm": 1560.0},
    }
    _, block = read("\n".join([header, *rows]) + "\n", two)
    np.testing.assert_allclose(block.values["a"], 1540 + i / 1000)
    np.testing.assert_allclose(block.values["b"], 1560 + i / 1000)
    np.testing.assert_array_equal(block.stamps_s, i // 4)


def test_an_encoding_that_is_given_spells_the_columns():
    text = "time_s;\u00c3\u00a9\n0;1.5\n1;2.5\n".encode("cp1252")  # as UTF-8 it would spell \u00e9
    channels = {"a": {"kind": "strain", "unit": "ue", "source": "\u00c3\u00a9"}}
    _, block = read(text, channels, 'encoding = "cp1252"')
    np.testing.assert_array_equal(block.values["a"], [1.5, 2.5])
    with pytest.raises(ReadError):
        read(text, channels)


STAMPED = [(1.77e9, "s"), (1.77e12, "ms"), (1.77e15, "us"), (1.77e18, "ns")]
TICKS = [(134_144_736_000_000_000, "100ns"), (639_055_968_000_000_000, "100ns")]  # FILETIME, .NET


@pytest.mark.parametrize(("stamp", "unit"), [*STAMPED, *TICKS])
def test_the_date_of_a_stamp_by_its_size(stamp, unit):
    assert date_of(stamp, unit) == "2026-02-02T02:40:00+00:00"
    assert date_of(12.0, unit) is None
