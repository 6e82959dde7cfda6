"""Property: a campaign's result depends on bytes, setups, options and version, and on nothing else."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd

from tests.campaign.conftest import MANIFEST, dataset, make_campaign
from tests.cli.conftest import SETUP
from tirelog.cli import run
from tirelog.setup import parse_setup


def call(*arguments: object) -> int:
    return run([str(a) for a in arguments])


def test_tables_of_every_log_read_as_one(manifest: Path, tmp_path: Path) -> None:
    assert call("campaign", "run", manifest, "--quiet") == 0
    table = pd.read_parquet(tmp_path / "results" / "table=speed")
    good = table[table["quality"] == "ok"]
    speeds = good.groupby("log", observed=True)["speed_m_s"].median()
    np.testing.assert_allclose(speeds, [9.0, 10.0, 11.0, 12.0], rtol=2e-3)
    summary = pd.read_csv(tmp_path / "results" / "summary.csv")
    assert summary["status"].tolist() == ["done"] * 4
    assert summary["driver"].tolist() == ["ben", "anna", "ben", "anna"]
    assert (summary["peak_memory_MB"] < 400).all()


def test_nothing_is_done_twice_and_what_changed_is_done_again(manifest: Path, tmp_path: Path) -> None:
    call("campaign", "run", manifest, "--quiet")
    parts = {path: path.stat().st_mtime_ns for path in (tmp_path / "results").rglob("part.parquet")}
    assert len(parts) == 8

    def touched() -> set[str]:
        return {p.parent.name for p in (tmp_path / "results").rglob("part.parquet") if p.stat().st_mtime_ns != parts.get(p)}

    call("campaign", "run", manifest, "--quiet")
    assert touched() == set()
    log = tmp_path / "logs" / "run_2.csv"
    log.write_bytes(log.read_bytes()[:-2000])
    call("campaign", "run", manifest, "--quiet")
    assert touched() == {"log=logs_run_2.csv"}
    manifest.write_text(MANIFEST.replace("0.1", "0.2"))
    call("campaign", "run", manifest, "--quiet")
    assert len(touched()) == 4


def test_a_missing_part_is_made_again(manifest: Path, tmp_path: Path) -> None:
    call("campaign", "run", manifest, "--quiet")
    want = dataset(tmp_path / "results")
    (tmp_path / "results/table=speed/log=logs_run_1.csv/part.parquet").unlink()
    call("campaign", "run", manifest, "--quiet")
    assert dataset(tmp_path / "results") == want


def remove(folder: Path) -> None:
    for path in sorted(folder.rglob("*"), reverse=True):
        path.unlink() if path.is_file() else path.rmdir()


def test_one_worker_or_two_give_the_same_bytes(manifest: Path, tmp_path: Path) -> None:
    assert call("campaign", "run", manifest, "--quiet") == 0
    want = dataset(tmp_path / "results")
    remove(tmp_path / "results")
    assert call("campaign", "run", manifest, "--quiet", "--workers", 2) == 0
    assert dataset(tmp_path / "results") == want


def test_killed_at_any_moment_and_resumed(tmp_path: Path) -> None:
    """The same folder, undisturbed and killed at random moments: the same dataset, bit for bit."""
    manifest = make_campaign(tmp_path, logs=10)
    results = tmp_path / "results"
    assert call("campaign", "run", manifest, "--quiet") == 0
    want = dataset(results)
    remove(results)
    rng = np.random.default_rng(1)
    killed = 0
    for _ in range(4):
        process = subprocess.Popen([sys.executable, "-m", "tirelog", "campaign", "run", str(manifest), "--quiet"], start_new_session=True)
        before = len(list(results.rglob("part.parquet")))
        while process.poll() is None and len(list(results.rglob("part.parquet"))) == before:
            time.sleep(0.01)
        time.sleep(0.1 * rng.random())
        killed += process.poll() is None
        subprocess.run(["pkill", "-KILL", "-s", str(process.pid)], check=False)
        process.wait()
    assert killed >= 3
    assert call("campaign", "run", manifest, "--quiet") == 0
    assert dataset(results) == want
    assert not list((results / ".tirelog" / "tmp").iterdir())


def test_one_run_at_a_time(manifest: Path, tmp_path: Path) -> None:
    holder = subprocess.Popen(
        [sys.executable, "-c", "from tirelog.campaign.folder import folder_at; import time, sys\n"
         "with folder_at(sys.argv[1]).held(): print('held', flush=True); time.sleep(60)", str(tmp_path / "results")],
        stdout=subprocess.PIPE,
    )  # fmt: skip
    assert holder.stdout is not None
    assert holder.stdout.readline() == b"held\n"
    assert call("campaign", "run", manifest, "--quiet") == 2
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    assert call("campaign", "run", manifest, "--quiet") == 0  # the lock did not outlive its holder


def test_conditions_of_the_campaign_are_in_the_setup(manifest: Path) -> None:
    from tirelog.campaign.manifest import load_manifest
    from tirelog.estimators.makers import MAKERS

    campaign = load_manifest(manifest, {name: maker.options for name, maker in MAKERS.items()})
    assert [log.setup.conditions.load_N for log in campaign.logs if log.setup] == [3000.0, 3100.0, 3200.0, 3300.0]
    assert parse_setup(campaign.logs[0].setup.text).conditions.load_N == 3000.0
    assert parse_setup(SETUP).channels == campaign.logs[0].setup.channels
