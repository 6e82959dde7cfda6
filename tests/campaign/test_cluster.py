"""Property: a Dask cluster that loses a worker gives the bytes of this machine. Faults: a scheduler
that does not answer, or dies, leaves logs open, and one run after it is back ends with all done.
"""

import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.campaign.conftest import dataset, make_campaign
from tests.campaign.processes import PATIENCE_S, begun, dying_on_the_first, dying_once, waited_for
from tirelog.campaign import runner
from tirelog.cli import run

distributed = pytest.importorskip("distributed")
pytestmark = pytest.mark.slow


def whole(manifest: Path) -> dict[str, bytes]:
    """What a campaign gives on this machine; nothing of it stays."""
    results = manifest.parent / "results"
    assert run(["campaign", "run", str(manifest), "--quiet"]) == 0
    found = dataset(results)
    shutil.rmtree(results)
    return found


def test_a_cluster_that_loses_a_worker_gives_the_same_bytes(tmp_path, monkeypatch):
    manifest = make_campaign(tmp_path, logs=8)
    want = whole(manifest)
    monkeypatch.setenv("TIRELOG_TEST_GATE", str(tmp_path))
    monkeypatch.setattr(runner, "make_tables", dying_once)
    monkeypatch.setattr(runner, "ANSWER_S", PATIENCE_S)
    slow = dict.fromkeys(("connect", "tcp"), f"{PATIENCE_S:.0f}s")  # of a busy machine
    how = {"threads_per_worker": 1, "dashboard_address": None, "host": "127.0.0.1"}
    with (
        pytest.importorskip("dask").config.set({"distributed.comm.timeouts": slow}),
        distributed.LocalCluster(n_workers=3, **how) as cluster,
    ):
        words = ["campaign", "run", str(manifest), "--quiet"]
        assert run([*words, "--scheduler", cluster.scheduler_address]) == 0
    assert (tmp_path / "died").exists()
    assert dataset(tmp_path / "results") == want


def test_a_scheduler_that_does_not_answer(manifest: Path) -> None:
    """In a process of its own: a client that found nothing goes on trying beside later tests."""
    with socket.socket() as deaf:  # a port of our own that takes no connection
        deaf.bind(("127.0.0.1", 0))
        scheduler = f"tcp://127.0.0.1:{deaf.getsockname()[1]}"
        process = begun(manifest, dying_on_the_first, "--scheduler", scheduler)
        assert process.wait(PATIENCE_S) == 2
    assert "does not answer" in (manifest.parent / "said.txt").read_text()


@contextmanager
def dask_cluster(port: int) -> Iterator[subprocess.Popen[bytes]]:
    """The process of a scheduler at a port, once it answers, with one worker."""
    words = {
        "scheduler": ("--host", "127.0.0.1", "--port", str(port), "--no-dashboard"),
        "worker": (f"tcp://127.0.0.1:{port}", "--nthreads", "1", "--no-nanny", "--no-dashboard"),
    }
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    both = [
        subprocess.Popen([sys.executable, "-m", f"distributed.cli.dask_{name}", *more], **silent)
        for name, more in words.items()
    ]

    def answers() -> bool:
        with socket.socket() as one:
            return one.connect_ex(("127.0.0.1", port)) == 0

    try:
        assert waited_for(answers)
        yield both[0]
    finally:
        for process in both:
            process.kill()
            process.wait()


def test_a_scheduler_that_is_killed(tmp_path: Path) -> None:
    """In processes of their own: a client of a scheduler that is gone goes on trying."""
    manifest, output = make_campaign(tmp_path, logs=12, seconds=1.0), tmp_path / "results"
    want = whole(manifest)
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    words = ["-m", "tirelog", "campaign", "run", str(manifest), "--quiet"]
    command = [sys.executable, *words, "--scheduler", f"tcp://127.0.0.1:{port}"]
    with (
        dask_cluster(port) as scheduler,
        subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as first,
    ):
        # only where tables are: what is being written beside them comes and goes
        assert waited_for(lambda: len(list(output.glob("table=*/*/part.parquet"))) >= 4)
        scheduler.kill()
        said = first.communicate(timeout=PATIENCE_S)[1]
    assert first.returncode == 2
    assert said.count("\n") == 1
    assert "finished logs are kept" in said
    with dask_cluster(port):
        assert subprocess.run(command, check=False, timeout=PATIENCE_S).returncode == 0
    assert (output / "summary.csv").read_text().count(",done,") == 12
    assert dataset(output) == want
