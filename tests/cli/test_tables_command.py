"""Property: `tirelog tables` writes what the single commands write, by any workers."""

import pytest

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


def test_a_log_without_rotation_leaves_nothing(folder, tirelog):
    rows = [f"{k / RATE_HZ:.4f},1550.0001,1542.0" for k in range(5000)]
    (folder / "log.csv").write_text("time_s,CH1,CH2\n" + "\n".join(rows) + "\n")
    outcome = tirelog("tables", "log.csv", "-o", "made")
    assert (outcome.status, list((folder / "made").glob("*"))) == (2, [])
    assert "the wheel does not turn" in outcome.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--table", "sped"], "nearest: speed"),
        (["--table", "phase-shift"], "no channel for phase-shift"),
        (["--format", "xlsx"], "allowed are csv"),
        (["--workers", "0"], "--workers"),
    ],
)
def test_usage(folder, tirelog, arguments, words):
    outcome = tirelog("tables", "log.csv", "-o", "made", *arguments).ended(2)
    assert words in outcome.err.replace("\n", " ")


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
    assert tirelog("speed", "more.csv", "bad.csv").out == ""


def test_a_log_without_a_setup_is_refused_alone(folder, tirelog):
    (folder / "bare.csv").write_bytes((folder / "log.csv").read_bytes())
    outcome = tirelog("speed", "log.csv", "bare.csv")
    assert (outcome.status, outcome.out) == (3, tirelog("speed", "log.csv").out)
    assert "error: bare" in outcome.err
    (folder / "broken.toml").write_text("[tire\n")
    outcome = tirelog("speed", "log.csv", "bare.csv", "--setup", "broken.toml")
    assert (outcome.status, outcome.out) == (2, "")
    assert outcome.err.count("error:") == 1
