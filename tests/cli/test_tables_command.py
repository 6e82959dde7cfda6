"""Property: `tables` writes what the single commands write, of all, one channel, a stretch."""

from pathlib import Path

import pandas as pd
import pytest

import tirelog as tirelog_module
from tests.cli.conftest import RATE_HZ, SETUP, pulse_rows
from tirelog.errors import ReadError

THREE = ("speed", "footprint", "dissipation")
GRATINGS = 4


@pytest.fixture
def several(folder):
    """The folder with a second log of several gratings, of which the first is lost."""
    rows = [row.split(",") for row in pulse_rows(6.0, 13.0)]
    lines, shift = ["time_s," + ",".join(f"G{k}" for k in range(GRATINGS))], int(RATE_HZ * 0.03)
    for i in range(GRATINGS * shift, len(rows)):
        later = (rows[i - k * shift][1] for k in range(1, GRATINGS))
        lines.append(",".join([rows[i][0], "0", *later]))
    (folder / "more.csv").write_text("\n".join(lines) + "\n")
    channel = (
        '[channels.G{0}]\nkind = "fbg_strain"\nsource = "G{0}"\nunit = "nm"\n'
        "reference_wavelength_nm = 1550.0\n"
    )
    setup = (
        SETUP[: SETUP.index("[channels")]
        + '[log]\ntime = "time_s"\n'
        + "".join(channel.format(k) for k in range(GRATINGS))
    )
    (folder / "more.toml").write_text(setup)
    return folder


@pytest.mark.parametrize("workers", ["1", "3"])
def test_the_rows_are_those_of_the_single_commands(several, tirelog, workers):
    line = f"tables log.csv more.csv -o made/now --workers {workers}"
    assert tirelog(line).status == 0
    made = {path.name: path.read_bytes() for path in (several / "made" / "now").iterdir()}
    for name in THREE:
        assert tirelog(f"{name} log.csv more.csv -o {name}.csv").status == 0
    assert made == {f"{name}.csv": (several / f"{name}.csv").read_bytes() for name in THREE}


def test_one_table_in_another_format(several, tirelog):
    assert tirelog("tables more.csv -o made --table speed --format parquet").status == 0
    assert tirelog("speed", "more.csv", "-o", "speed.parquet").status == 0
    assert tirelog("check", "made/speed.parquet", "--against", "speed.parquet").status == 0
    assert [p.name for p in (several / "made").iterdir()] == ["speed.parquet"]


def test_a_remark_is_said_once(several, tirelog):
    setup = (several / "log.toml").read_text().replace("rolling_radius_m = 0.305\n", "")
    (several / "log.toml").write_text(setup)
    said = tirelog("tables", "log.csv", "-o", "made").err
    assert said.count("no rolling radius in the setup") == 1


def test_a_channel_that_fails_is_not_waited_for(several, tirelog, monkeypatch):
    from tirelog.strain.passages import find as passage_surface

    found = passage_surface.find_passages

    def fails(channel, radius_m):
        if channel.name == "G0":
            raise ReadError("is damaged; G0 cannot be read; copy the log again", file="more.csv")
        return found(channel, radius_m)

    monkeypatch.setattr(passage_surface, "find_passages", fails)
    outcome = tirelog("tables", "more.csv", "-o", "made", "--workers", "2")
    assert (outcome.status, list((several / "made").glob("*"))) == (4, [])
    assert "G0 cannot be read" in outcome.err


@pytest.fixture
def swapped(several):
    """The folder with a second log whose setup names the wrong surface of its last grating."""
    setup = (several / "more.toml").read_text()
    (several / "more.toml").write_text(setup + 'surface = "inner"\n')
    return several


@pytest.mark.parametrize(
    ("name", "logs"), [("speed", ("log.csv", "more.csv")), ("dissipation", ("more.csv", "log.csv"))]
)
def test_of_two_logs_the_refused_one_is_left_out_and_the_other_whole(swapped, tirelog, name, logs):
    alone = tirelog(name, "log.csv")
    both = tirelog(name, *logs)
    assert both.out == alone.out
    assert both.status == 3
    assert [line for line in both.err.splitlines() if "error: " in line] == [
        "tirelog: error: more.csv: channel G3 shows a minimum, as the outer surface (groove) does "
        'in the patch, and its setup says inner; the two must agree; write surface = "outer"'
    ]
    assert tirelog(name, *logs, "-o", "both.csv").status == 3
    assert (swapped / "both.csv").read_text() == alone.out


def test_of_three_logs_the_refused_one_is_left_out_of_all_tables(swapped, tirelog):
    (swapped / "third.csv").write_bytes((swapped / "log.csv").read_bytes())
    (swapped / "third.toml").write_bytes((swapped / "log.toml").read_bytes())
    assert tirelog("tables", "log.csv", "third.csv", "-o", "two").status == 0
    outcome = tirelog("tables", "log.csv", "more.csv", "third.csv", "-o", "three").ended(3)
    assert outcome.err.count("error: more.csv: channel G3 shows a minimum") == 1
    for name in THREE:
        two, three = (swapped / folder / f"{name}.csv" for folder in ("two", "three"))
        assert three.read_bytes() == two.read_bytes()


@pytest.mark.parametrize("arguments", [("speed",), ("tables",)])
def test_if_every_log_is_refused_nothing_is_written(swapped, tirelog, arguments):
    (swapped / "bad.csv").write_bytes((swapped / "log.csv").read_bytes())
    (swapped / "bad.toml").write_text('[channels.x]\nkind = "no such"\n')
    (swapped / "old").write_text("kept")
    out = "new" if arguments == ("tables",) else "old"
    tirelog(*arguments, "more.csv", "bad.csv", "-o", out, "--format", "csv").refused(
        "error: more.csv: channel G3", "error: bad.toml"
    )
    assert (swapped / "old").read_text() == "kept"
    assert not (swapped / "new").exists() or not list((swapped / "new").iterdir())
    for table in THREE:  # the first channels of a log alone have rows before the last is refused
        assert tirelog(table, "more.csv", "bad.csv").out == tirelog(table, "more.csv").out == ""


# ---- one channel --------------------------------------------------------------------------------


SAMPLES = Path(__file__).parents[2] / "sample_data"


@pytest.mark.parametrize("name", ["speed", "footprint", "dissipation"])
def test_one_of_two_channels(name, several, tirelog):
    for output, channel in (("all.csv", ()), ("one.csv", ("--channel", "G1"))):
        assert tirelog(name, "more.csv", "-o", output, *channel).status == 0
    whole, one = pd.read_csv("all.csv"), pd.read_csv("one.csv")
    assert set(whole.channel) >= {"G1", "G2", "G3"}
    own = whole[whole.channel == "G1"].reset_index(drop=True)
    pd.testing.assert_frame_equal(one, own, rtol=1e-6)


def test_all_tables_of_one_channel(several, tirelog):
    assert tirelog("tables", "more.csv", "-o", "made", "--channel", "G1").status == 0
    for table in ("speed", "footprint", "dissipation"):
        assert set(pd.read_csv(f"made/{table}.csv").channel) == {"G1"}


def test_the_rows_of_a_phase_shift_are_of_the_accelerometer(tirelog):
    chosen = tirelog("phase-shift", SAMPLES / "encoder.h5", "--channel", "acceleration").ended(0)
    assert chosen.out == tirelog("phase-shift", SAMPLES / "encoder.h5").out
    assert tirelog("phase-shift", SAMPLES / "encoder.h5", "--channel", "encoder").status == 2


# ---- a stretch of a log -------------------------------------------------------------------------


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
