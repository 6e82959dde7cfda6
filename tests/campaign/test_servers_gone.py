"""Faults: a scheduler that dies in the midst of a campaign leaves logs open; one run after it is
back ends with all of them done.
"""

import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.campaign.conftest import dataset, make_campaign
from tests.campaign.processes import PATIENCE_S, waited_for
from tirelog.cli import run

LOGS = 12


def states(output: Path) -> list[str]:
    rows = (output / "summary.csv").read_text().splitlines()[1:]
    return [row.split(",")[2] for row in rows]


@contextmanager
def dask_cluster(port: int) -> Iterator[subprocess.Popen[bytes]]:
    """The process of a scheduler at a port, with one worker."""
    place = f"tcp://127.0.0.1:{port}"
    words = {
        "scheduler": ("--host", "127.0.0.1", "--port", str(port), "--no-dashboard"),
        "worker": (place, "--nthreads", "1", "--no-nanny", "--no-dashboard"),
    }
    both = [
        subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.dask_{name}", *more],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for name, more in words.items()
    ]
    try:
        yield both[0]
    finally:
        for process in both:
            process.kill()
            process.wait()


@pytest.mark.slow
def test_a_scheduler_that_is_killed(tmp_path: Path) -> None:
    """In processes of their own: a client of a scheduler that is gone goes on trying."""
    pytest.importorskip("distributed")
    manifest, output = make_campaign(tmp_path, logs=LOGS, seconds=1.0), tmp_path / "results"
    assert run(["campaign", "run", str(manifest), "--quiet"]) == 0
    want = dataset(output)
    output.rename(tmp_path / "whole")
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    words = ["-m", "tirelog", "campaign", "run", str(manifest), "--quiet"]
    command = [sys.executable, *words, "--scheduler", f"tcp://127.0.0.1:{port}"]

    def answers() -> bool:
        with socket.socket() as one:
            return one.connect_ex(("127.0.0.1", port)) == 0

    with dask_cluster(port) as scheduler:
        assert waited_for(answers)
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as first:
            # only where tables are: what is being written beside them comes and goes
            assert waited_for(lambda: len(list(output.glob("table=*/*/part.parquet"))) >= 4)
            scheduler.kill()
            said = first.communicate(timeout=PATIENCE_S)[1]
    assert first.returncode == 2
    assert said.count("\n") == 1
    assert "finished logs are kept" in said
    with dask_cluster(port):
        assert waited_for(answers)
        assert subprocess.run(command, check=False, timeout=PATIENCE_S).returncode == 0
    assert states(output) == ["done"] * LOGS
    assert dataset(output) == want
