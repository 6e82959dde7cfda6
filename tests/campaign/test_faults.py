"""Faults: logs that cannot be read do not stop a campaign; a useless manifest does."""

import json
from dataclasses import asdict, replace

import numpy as np
import pandas as pd
import pytest

from tests.campaign.conftest import MANIFEST, dataset
from tests.campaign.processes import PATIENCE_S, begun, dying_on_the_first
from tests.diagnosis.toy import stack
from tirelog.campaign.ledger import (
    Entry,
    Folder,
    Ledger,
    _entry,
    json_table,
    pieces_bytes,
    read_pieces,
)
from tirelog.campaign.manifest import load_manifest
from tirelog.campaign.runner import plan_tasks
from tirelog.cli.session import campaign_progress
from tirelog.errors import TirelogError
from tirelog.inference.cells.pieces import pieces_of
from tirelog.wheel.calibration import Calibration, SpeedMap, write_calibration


@pytest.mark.usefixtures("in_this_process")
def test_a_log_that_is_mended_is_worked_on_anew(manifest, tmp_path, tirelog):
    """What is said of such logs is golden: tests/golden/uses/campaigns.toml."""
    logs = tmp_path / "logs"
    (logs / "empty.csv").write_bytes(b"")
    (logs / "cut.csv").write_bytes((logs / "run_0.csv").read_bytes()[:100_001])
    assert tirelog("campaign", "run", manifest, "--quiet").status == 3
    summary = pd.read_csv(tmp_path / "results" / "summary.csv").set_index("name")["status"]
    assert summary["logs_empty.csv"] == "failed"
    assert summary["logs_cut.csv"] == "lost input"
    assert summary["logs_run_3.csv"] == "done"
    assert len(dataset(tmp_path / "results")) == 10
    (logs / "empty.csv").write_bytes((logs / "run_1.csv").read_bytes())
    assert tirelog("campaign", "run", manifest, "--quiet", "--only", "*empty.csv").status == 0


@pytest.mark.usefixtures("in_this_process")
def test_a_log_that_fails_later_leaves_no_older_rows(manifest, tmp_path, tirelog):
    tirelog("campaign", "run", manifest, "--quiet")
    (tmp_path / "logs" / "run_0.csv").write_bytes(b"")
    assert tirelog("campaign", "run", manifest, "--quiet").status == 3
    assert not [name for name in dataset(tmp_path / "results") if "run_0" in name]


@pytest.mark.slow
def test_only_the_log_that_ends_its_workers_stays_open(manifest, tmp_path):
    assert begun(manifest, dying_on_the_first, "--workers", "2").wait(PATIENCE_S) == 3
    summary = pd.read_csv(tmp_path / "results" / "summary.csv").set_index("name")
    assert summary["status"].tolist() == ["open", "done", "done", "done"]
    assert "died twice" in (tmp_path / "said.txt").read_text()
    assert len(dataset(tmp_path / "results")) == 6


MAP = SpeedMap(0.01, 0.0, np.zeros((2, 2)), 5.0, 20.0, 0.05, 60)
FLAT = Calibration(10.0, MAP, MAP, 30.0, 0.0, 0.01, 0.0, 1e-5)


@pytest.mark.parametrize(("cell", "driven"), [("yes", True), ("0", False)])
def test_a_wheel_is_driven_or_not(manifest, tmp_path, cell, driven):
    (tmp_path / "conditions.csv").write_text(f"log,driven\nrun_0.csv,{cell}\n")
    assert load_manifest(manifest).logs[0].setup.conditions.driven is driven


def test_a_calibration_is_beside_the_manifest_and_its_content_counts(
    manifest, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path.parent)
    manifest.write_text(MANIFEST + '[tables.phase-shift]\ncalibration = "cal.toml"\n')
    with pytest.raises(TirelogError, match=r"cal\.toml"):
        load_manifest(manifest)

    def keys():
        campaign = load_manifest(manifest)
        assert campaign.tables["phase-shift"]["calibration"] == str(tmp_path / "cal.toml")
        return [task.key for task in plan_tasks(campaign, Ledger(Folder(campaign.output)))]

    write_calibration(tmp_path / "cal.toml", FLAT)
    before = keys()
    assert keys() == before
    write_calibration(tmp_path / "cal.toml", replace(FLAT, patch_width_deg=31.0))
    assert not set(before) & set(keys())


def test_pieces_that_were_cut_are_damaged_and_no_defect():
    whole = pieces_bytes(pieces_of(stack(1)))
    for size in (0, 1, len(whole) // 2, len(whole) - 40):
        with pytest.raises(ValueError):
            read_pieces(whole[:size])


def test_an_entry_of_the_ledger_that_was_damaged_is_made_again():
    whole = asdict(
        Entry("a.csv", "a.csv", "key", rows={"speed": 3}, quality={"speed": {"ok": 3}}, seconds=1.5)
    )
    assert _entry(json.dumps(whole).encode()) == Entry(**whole)
    assert _entry(json.dumps(whole | {"seconds": 1}).encode()) is not None
    wrong = [{"rows": 1}, {"rows": []}, {"quality": {"speed": 1}}, {"losses": "x"}]
    for other in (*wrong, {"error": None}, {"more": 1}, {"seconds": "1"}):
        assert _entry(json.dumps(whole | other).encode()) is None


@pytest.mark.parametrize("data", [b"[" * 100_000, b"9" * 5000, b"[]", b"\xff"])
def test_a_file_of_ours_that_was_damaged_is_an_empty_one(data):
    assert json_table(data) == {}


def test_a_log_s_name_does_not_reach_the_terminal_as_it_is(capsys):
    campaign_progress(quiet=False, logs=2)(
        Entry("a\x1b[31m\n.csv", "a", "key", rows={"speed": 3}), 1, 2
    )
    assert capsys.readouterr().err.startswith("tirelog: 1/2 a\\x1b[31m\\n.csv: 3 rows")
