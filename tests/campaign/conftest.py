"""A small campaign: pulse logs at different speeds, some of them broken, and its manifest."""

from pathlib import Path

import pytest

from tests.cli.conftest import SETUP, pulse_rows
from tests.cli.conftest import tirelog as tirelog
from tirelog.campaign import runner
from tirelog.campaign.runner import make_tables

MANIFEST = """[campaign]
name = "test"
output = "results"
[[logs]]
glob = "logs/*.csv"
setup = "setup.toml"
conditions = "conditions.csv"
[tables.speed]
[tables.dissipation]
steady_step = 0.1
"""


def make_campaign(folder: Path, logs: int = 4, seconds: float = 3.0) -> Path:
    """The manifest of a campaign in `folder`."""
    (folder / "logs").mkdir()
    for number in range(logs):
        rows = pulse_rows(seconds, 9.0 + number)
        (folder / "logs" / f"run_{number}.csv").write_text(
            "time_s,CH1,CH2\n" + "\n".join(rows) + "\n"
        )
    (folder / "setup.toml").write_text(SETUP)
    rows = [
        f"run_{number}.csv,{3000 + 100 * number},{'anna' if number % 2 else 'ben'}"
        for number in range(logs)
    ]
    (folder / "conditions.csv").write_text("log,load_N,driver\n" + "\n".join(rows) + "\n")
    (folder / "m.toml").write_text(MANIFEST)
    return folder / "m.toml"


def dataset(output: Path) -> dict[str, bytes]:
    """Every file of the dataset with its bytes; what lies beside it must not be there."""
    assert list(output.rglob("*.part")) == []
    return {
        str(path.relative_to(output)): path.read_bytes()
        for path in sorted(output.rglob("*.parquet"))
    }


@pytest.fixture
def manifest(tmp_path):
    return make_campaign(tmp_path)


@pytest.fixture
def in_this_process(monkeypatch):
    """Campaigns whose logs are worked on here, as a worker takes two seconds to begin."""
    monkeypatch.setattr(
        runner, "_on_processes", lambda tasks, workers: (make_tables(task) for task in tasks)
    )
