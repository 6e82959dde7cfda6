"""Faults: what cannot be used or shown is said, and nothing is left half-written."""

import pandas as pd
import pytest

from tests.report.test_page import data, numbers


def test_a_model_that_does_not_suit_the_log_is_named(folder, tirelog):
    new = "model new --carcass ring --observable radial_acceleration -o M.toml"
    assert tirelog(new).status == 0
    tirelog("report", "log.csv", "--model", "M.toml", "-o", "page.html").ended(0)
    page = (folder / "page.html").read_text()
    assert "the model against the measurement: " in page
    assert '<section id="diagnosis">' not in page


def test_a_hostile_channel_of_a_table_is_no_link_in_a_figure(folder, tirelog):
    assert tirelog("speed", "log.csv", "-o", "speed.csv").status == 0
    rows = pd.read_csv(folder / "speed.csv")
    rows["channel"] = '<a href="https://evil.example">x</a>'
    rows.to_csv(folder / "speed.csv", index=False)
    assert tirelog("report", "log.csv", "--table", "speed.csv", "-o", "page.html").status == 0
    names = [t["name"] for t in data(folder / "page.html")["figures"]["speed-0"]["traces"]]
    assert names == ['&lt;a href="https://evil.example"&gt;x&lt;/a&gt;']
    assert '<a href="https://evil' not in (folder / "page.html").read_text()


def test_a_campaign_s_tables_are_drawn_without_its_logs(folder, tirelog):
    manifest = (
        '[campaign]\nname = "c"\noutput = "results"\n[[logs]]\nglob = "*.csv"\n[tables.speed]\n'
        "[tables.footprint]\n"
    )
    (folder / "manifest.toml").write_text(manifest)
    assert tirelog("campaign", "run", "manifest.toml", "--quiet").status == 0
    tirelog("report", "--campaign", "results", "-o", "page.html").ended(0)
    part = next((folder / "results").glob("table=speed/log=*/part.parquet"))
    rows = pd.read_parquet(part)
    rows = rows[rows["quality"] == "ok"]
    drawn = numbers(data(folder / "page.html")["figures"]["speed-0"]["traces"][0]["y"])
    assert drawn == pytest.approx(rows["speed_m_s"].to_numpy(), rel=1e-6)
    page = (folder / "page.html").read_text()
    assert "1 logs: 1 done" in page
    assert "what was recorded, and the signals: no log was given" in page
