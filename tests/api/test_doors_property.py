"""Property: what a command does a notebook does in one call, with the same result."""

from pathlib import Path

import pandas as pd
import pytest

import tirelog
from tests.cli.conftest import SETUP, Command
from tirelog.tables.frame import read_table

ENCODER = Path(__file__).parents[2] / "sample_data" / "encoder_ramp.h5"


def test_a_log_is_ingested_drafted_and_checked(folder: Path, command: Command) -> None:
    told = tirelog.ingest("log.csv", "run.h5")
    assert command("ingest", "log.csv", "-o", "by_command.h5").status == 0
    assert told.losses == []
    assert (
        tirelog.speed("run.h5")
        .drop(columns="log")
        .equals(tirelog.speed("by_command.h5").drop(columns="log"))
    )
    found = tirelog.check_setup("log.csv")
    said = command("setup", "check", "log.csv").out.splitlines()
    assert [line.split(":")[0] for line in said] == [
        *(name for name, *_ in found.channels),
        *(one.about for one in found.findings),
    ]
    assert not found.implausible
    (folder / "wrong.toml").write_text(SETUP.replace('"nm"', '"um"'))
    assert tirelog.check_setup("log.csv", "wrong.toml").implausible
    draft = tirelog.draft_setup("log.csv", "draft.toml")
    assert command("setup", "new", "log.csv", "-o", "drafted.toml").status == 0
    drafted = (folder / "drafted.toml").read_text()
    assert (folder / "draft.toml").read_text() == draft.text
    assert draft.text.replace("draft.toml", "drafted.toml") == drafted


def test_a_calibration_is_learnt_and_applied(folder: Path, command: Command) -> None:
    learning = ("phase-shift", str(ENCODER), "--calibrate", "c.toml", "-o", "p.parquet")
    assert command(*learning).status == 0
    learnt = tirelog.calibrate(ENCODER)
    tirelog.save_calibration(learnt, "own.toml")
    assert (folder / "own.toml").read_text() == (folder / "c.toml").read_text()
    table = tirelog.phase_shift(ENCODER, calibration=learnt)
    pd.testing.assert_frame_equal(table, read_table("p.parquet"), check_dtype=False)
    assert table.phase_shift_detrended_deg.notna().any()


def test_pictures_of_tables(folder: Path) -> None:
    tirelog.plot_table("footprint", "log.csv", "p.png")
    assert (folder / "p.png").read_bytes().startswith(b"\x89PNG")
    for name in ("speed", "footprint", "dissipation"):
        shown = tirelog.plot_table(name, "log.csv")
        assert shown._repr_png_().startswith(b"\x89PNG")  # in a notebook
    for given, says in (
        (("slip", {}), "has no picture"),
        (("footprint", {"cut_off": "auto"}), "nearest: cutoff"),
        (("footprnt", {}), "nearest: footprint"),
    ):
        with pytest.raises(tirelog.TirelogError, match=says):
            tirelog.plot_table(given[0], "log.csv", "x.png", **given[1])
    assert not (folder / "x.png").exists()


def test_a_campaign_is_run_and_asked(folder: Path, command: Command) -> None:
    (folder / "c.toml").write_text(
        '[campaign]\nname = "c"\noutput = "made"\n[[logs]]\nglob = "log.csv"\n[tables.speed]\n'
    )
    assert tirelog.campaign_status("c.toml").count("open") == 1
    said: list[str] = []
    done = tirelog.run_campaign("c.toml", progress=said.append)
    assert (done.logs, done.worked, done.failed, done.lost) == (1, 1, (), ())
    assert any(done.summary in sentence for sentence in said)
    assert tirelog.campaign_status("c.toml").count("done") == 1
    assert "1 done, 0 failed, 0 open" in command("campaign", "status", "c.toml").out


def test_a_report_is_written_or_refused(folder: Path) -> None:
    said = tirelog.write_report("log.csv", "r.html")
    assert said[0].startswith("r.html: ")
    page = (folder / "r.html").read_text()
    assert "tirelog report log.csv -o report.html" in page
    for given, says in (
        ({}, "nothing to report on"),
        ({"logs": "log.csv"}, "nothing to write"),
        ({"logs": "log.csv", "output": "r.pdf"}, "the page is HTML"),
    ):
        with pytest.raises(tirelog.TirelogError, match=says):
            tirelog.write_report(**given)


def test_tables_that_differ_are_told(folder: Path, command: Command) -> None:
    table = tirelog.speed("log.csv")
    table.to_csv("old.csv", index=False)
    table.assign(speed_m_s=table.speed_m_s * 1.01).to_csv("new.csv", index=False)
    found = tirelog.check("new.csv", "old.csv")
    assert {one.column for one in found.differences} == {"speed_m_s"}
    assert tirelog.check("old.csv", "old.csv").differences == ()
    outcome = command("check", "new.csv", "--against", "old.csv", "-o", "moved.parquet")
    assert outcome.status == 1
    moved = pd.DataFrame(found.columns)
    assert read_table("moved.parquet")["column"].tolist() == moved["column"].tolist()
