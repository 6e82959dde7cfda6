"""Faults: logs that cannot be read do not stop a campaign; a manifest that cannot be used does, with advice."""

import re
import time
from pathlib import Path

import pandas as pd
import pytest

from tests.campaign.conftest import MANIFEST, dataset
from tests.cli.conftest import Command

pytest_plugins: list[str] = []


@pytest.fixture
def tirelog(capfdbinary: pytest.CaptureFixture[bytes]) -> Command:
    from tests.cli.conftest import tirelog as fixture

    return fixture.__wrapped__(capfdbinary)  # type: ignore[attr-defined,no-any-return]


def test_failed_logs_are_kept_with_their_error(manifest: Path, tmp_path: Path, tirelog: Command) -> None:
    logs = tmp_path / "logs"
    (logs / "empty.csv").write_bytes(b"")
    (logs / "binary.csv").write_bytes(bytes(range(256)) * 40)
    (logs / "columns.csv").write_text("a,b\n1,2\n")
    (logs / "cut.csv").write_bytes((logs / "run_0.csv").read_bytes()[:100_001])
    outcome = tirelog("campaign", "run", manifest, "--quiet")
    assert outcome.status == 3
    assert len([line for line in outcome.err.splitlines() if line.startswith("tirelog: error:")]) == 3
    summary = pd.read_csv(tmp_path / "results" / "summary.csv").set_index("name")
    assert summary.loc[["logs_empty.csv", "logs_binary.csv", "logs_columns.csv"], "status"].tolist() == ["failed"] * 3
    assert summary.loc["logs_cut.csv", "status"] == "lost input"
    assert summary.loc["logs_run_3.csv", "status"] == "done"
    assert len(dataset(tmp_path / "results")) == 10
    assert "failed" in tirelog("campaign", "status", manifest).out
    (logs / "empty.csv").write_bytes((logs / "run_1.csv").read_bytes())
    assert tirelog("campaign", "run", manifest, "--quiet", "--only", "*empty.csv").status == 0


def test_a_log_that_fails_later_leaves_no_older_rows(manifest: Path, tmp_path: Path, tirelog: Command) -> None:
    tirelog("campaign", "run", manifest, "--quiet")
    (tmp_path / "logs" / "run_0.csv").write_bytes(b"")
    assert tirelog("campaign", "run", manifest, "--quiet").status == 3
    assert not [name for name in dataset(tmp_path / "results") if "run_0" in name]


BAD = [
    ("logs/*.csv", "logs/*.txt", "matches no log"),
    ("steady_step", "steddy_step", "nearest: steady_step"),
    ("[tables.speed]", "[tables.sped]", "nearest: speed"),
    ("[campaign]", "[campain]", "nearest: campaign"),
    ("conditions.csv", "nothing.csv", "cannot be read"),
    ("[[logs]]", '[[logs]]\nglob = "logs/run_0.csv"\nsetup = "setup.toml"\n[[logs]]', "two logs have the name"),
]


@pytest.mark.parametrize(("old", "new", "words"), BAD)
def test_a_manifest_that_cannot_be_used(manifest: Path, tirelog: Command, old: str, new: str, words: str) -> None:
    manifest.write_text(MANIFEST.replace(old, new, 1))
    outcome = tirelog("campaign", "run", manifest)
    assert outcome.status == 2, outcome.err
    assert re.search(re.escape(words), outcome.err)
    assert "Traceback" not in outcome.err


def test_a_setup_that_fits_only_some_logs(manifest: Path, tmp_path: Path, tirelog: Command) -> None:
    (tmp_path / "logs" / "other.csv").write_text("time_s,X\n0.0,1\n0.1,2\n")
    outcome = tirelog("campaign", "run", manifest, "--quiet")
    assert outcome.status == 3
    assert re.search(r"error: \S*/logs/other\.csv: ", outcome.err)  # the log, though the setup is what does not fit
    assert len(dataset(tmp_path / "results")) == 8


def test_a_scheduler_that_does_not_answer(manifest: Path, tirelog: Command) -> None:
    pytest.importorskip("distributed")
    begun = time.monotonic()
    outcome = tirelog("campaign", "run", manifest, "--scheduler", "tcp://127.0.0.1:1")
    assert outcome.status == 2
    assert "does not answer" in outcome.err
    assert time.monotonic() - begun < 15


def test_output_folder_that_cannot_be_made(manifest: Path, tmp_path: Path, tirelog: Command) -> None:
    (tmp_path / "results").write_text("a file")
    outcome = tirelog("campaign", "run", manifest)
    assert outcome.status == 2
    assert "results" in outcome.err
