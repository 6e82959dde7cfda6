"""Property: a campaign's result depends on bytes, setups, options and version alone."""

import json
import shutil
import signal
import subprocess
import sys
from dataclasses import fields

import numpy as np
import pandas as pd
import pytest

from tests.campaign.conftest import MANIFEST, dataset, make_campaign
from tests.cli.conftest import SETUP
from tests.diagnosis.toy import stack
from tirelog.campaign.ledger import Folder, pieces_bytes, read_pieces
from tirelog.cli import run
from tirelog.data.setup import parse_setup
from tirelog.inference.cells.pieces import joined_pieces, pieces_of


def call(*arguments):
    return run([str(a) for a in arguments])


def test_tables_of_every_log_read_as_one_whatever_the_workers(manifest, tmp_path):
    assert call("campaign", "run", manifest, "--quiet") == 0
    table = pd.read_parquet(tmp_path / "results" / "table=speed")
    good = table[table["quality"] == "ok"]
    speeds = good.groupby("log", observed=True)["speed_m_s"].median()
    np.testing.assert_allclose(speeds, [9.0, 10.0, 11.0, 12.0], rtol=2e-3)
    summary = pd.read_csv(tmp_path / "results" / "summary.csv")
    assert summary["status"].tolist() == ["done"] * 4
    assert summary["driver"].tolist() == ["ben", "anna", "ben", "anna"]
    assert (summary["peak_memory_MB"] < 400).all()
    want = dataset(tmp_path / "results")
    shutil.rmtree(tmp_path / "results")
    assert call("campaign", "run", manifest, "--quiet", "--workers", 2) == 0
    assert dataset(tmp_path / "results") == want


def test_what_changed_or_is_gone_is_done_again_and_nothing_else(
    manifest, tmp_path, in_this_process
):
    results = tmp_path / "results"
    call("campaign", "run", manifest, "--quiet")
    parts = {path: path.stat().st_mtime_ns for path in results.rglob("part.parquet")}
    assert len(parts) == 8

    def touched():
        now = {p: p.stat().st_mtime_ns for p in results.rglob("part.parquet")}
        return {p.parent.name for p in now if now[p] != parts.get(p)}

    call("campaign", "run", manifest, "--quiet")
    assert touched() == set()
    want = dataset(results)
    (results / "table=speed/log=logs_run_2.csv/part.parquet").unlink()
    call("campaign", "run", manifest, "--quiet")
    assert dataset(results) == want
    log = tmp_path / "logs" / "run_2.csv"
    log.write_bytes(log.read_bytes()[:-2000])
    call("campaign", "run", manifest, "--quiet")
    assert touched() == {"log=logs_run_2.csv"}
    manifest.write_text(MANIFEST.replace("0.1", "0.2"))
    call("campaign", "run", manifest, "--quiet")
    assert len(touched()) == 4


@pytest.mark.usefixtures("in_this_process")
def test_one_run_at_a_time(tmp_path):
    manifest = make_campaign(tmp_path, logs=1, seconds=1.0)
    program = (
        "from tirelog.campaign.ledger import Folder; import sys\n"
        "with Folder(sys.argv[1]).held(): print('held', flush=True); sys.stdin.read()"
    )
    command = [sys.executable, "-c", program, str(tmp_path / "results")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as holder:
        assert holder.stdout.readline() == b"held\n"
        assert call("campaign", "run", manifest, "--quiet") == 2
        holder.send_signal(signal.SIGKILL)
    assert call("campaign", "run", manifest, "--quiet") == 0  # the lock did not outlive its holder


def test_conditions_of_the_campaign_are_in_the_setup(manifest):
    from tirelog.campaign.manifest import load_manifest

    campaign = load_manifest(manifest)
    loads = [log.setup.conditions.load_N for log in campaign.logs if log.setup]
    assert loads == [3000.0, 3100.0, 3200.0, 3300.0]
    assert parse_setup(campaign.logs[0].setup.text).conditions.load_N == 3000.0
    assert parse_setup(SETUP).channels == campaign.logs[0].setup.channels


def test_models_that_come_later_change_no_table(manifest, tmp_path, capfd, in_this_process):
    call("campaign", "run", manifest, "--quiet")
    tables = dataset(tmp_path / "results")
    new = ("model", "new", "--carcass", "beam", "--setup", tmp_path / "setup.toml")
    assert call(*new, "-o", tmp_path / "beam.toml") == 0
    manifest.write_text(MANIFEST + '[[models]]\nfile = "beam.toml"\ncommands = ["compare"]\n')
    assert call("campaign", "run", manifest, "--only", "*run_1*") == 0
    assert "they need a run without --only" in capfd.readouterr().err
    assert not (tmp_path / "results" / "models").exists()
    assert call("campaign", "run", manifest, "--quiet") == 0
    assert dataset(tmp_path / "results") == tables
    result = json.loads((tmp_path / "results" / "models" / "beam" / "compare.json").read_text())
    assert (result["logs"], result["logs_used"], result["cells_used"]) == (4, 4, result["cells"])
    before = (tmp_path / "results" / "models" / "beam" / "compare.json").stat().st_mtime_ns
    assert call("campaign", "run", manifest, "--quiet") == 0
    assert (tmp_path / "results" / "models" / "beam" / "compare.json").stat().st_mtime_ns == before
    summary = pd.read_csv(tmp_path / "results" / "summary.csv")
    assert summary["rows"].notna().all()


def test_a_model_is_diagnosed_over_all_logs(tmp_path, capfd, in_this_process):
    manifest = make_campaign(tmp_path, logs=2)
    model, setup = tmp_path / "lengths.toml", tmp_path / "setup.toml"
    new = ("model", "new", "--observable", "patch_length", "--setup", setup, "-o", model)
    assert call(*new, "--quiet") == 0
    asked = MANIFEST.split("[tables")[0]
    asked += '[[models]]\nfile = "lengths.toml"\ncommands = ["diagnose"]\n'
    manifest.write_text(asked)
    assert call("campaign", "run", manifest) == 0
    results = tmp_path / "results" / "models" / "lengths" / "diagnose.json"
    found = json.loads(results.read_text())
    assert (found["logs"], found["logs_used"]) == (2, 2)
    assert f"diagnose.json: {found['verdict']}" in capfd.readouterr().err


def test_status_and_dry_run_do_not_wait_for_a_run(manifest, tmp_path, capfd):
    with Folder(tmp_path / "results").held():
        assert call("campaign", "status", manifest) == 0
        assert "4 open" in capfd.readouterr().out
        assert call("campaign", "run", manifest, "--dry-run") == 0
        assert capfd.readouterr().out.count("speed, dissipation") == 4


def test_logs_that_left_the_manifest_are_named(manifest, tmp_path, capfd, in_this_process):
    call("campaign", "run", manifest, "--quiet")
    (tmp_path / "logs" / "run_3.csv").unlink()
    assert call("campaign", "run", manifest) == 0
    assert "does not have: logs_run_3.csv;" in capfd.readouterr().err


def test_a_thinned_share_spans_the_speeds_and_files_give_the_same_bits():
    pieces = joined_pieces([pieces_of(stack(seed, manoeuvres=12, m=32)) for seed in (1, 2)])
    again = read_pieces(pieces_bytes(pieces))
    for f in fields(pieces):
        if f.name != "conditions":
            np.testing.assert_array_equal(getattr(again, f.name), getattr(pieces, f.name))
    few = pieces.thinned(6)
    assert len(few) == 6
    assert few.coefficients.shape[0] == few.number.sum()
    speed, all_speeds = few.conditions.speed_m_s, np.sort(pieces.conditions.speed_m_s)
    assert np.ptp(speed) > 0.6 * np.ptp(all_speeds)
    assert set(pieces.thinned(6, turn=1).conditions.speed_m_s) != set(speed)
    assert pieces.thinned(10**6) is pieces
