"""Faults: a scheduler or a store that dies in the midst of a campaign leaves logs open, and one run
after it is back ends with all of them done.
"""

import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.campaign.conftest import MANIFEST, dataset, in_this_process, make_campaign
from tests.campaign.processes import PATIENCE_S, waited_for
from tests.campaign.test_elsewhere import bucket
from tirelog.cli import run

__all__ = ["bucket", "in_this_process"]

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
    assert "what is done is kept" in said
    with dask_cluster(port):
        assert waited_for(answers)
        assert subprocess.run(command, check=False, timeout=PATIENCE_S).returncode == 0
    assert states(output) == ["done"] * LOGS
    assert dataset(output) == want


@pytest.mark.usefixtures("in_this_process")
@pytest.mark.parametrize("answer", ["500 Internal Server Error", "403 Forbidden"])
def test_a_store_that_dies(
    bucket: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    answer: str,
) -> None:
    """It dies at the 20th of some 60 ranges that are read, in the midst of a log."""
    import s3fs
    from moto.moto_server.werkzeug_app import DomainDispatcherApplication as Application

    make_campaign(tmp_path, logs=LOGS, seconds=1.0)
    for path in (tmp_path / "logs").iterdir():
        s3fs.S3FileSystem().put(str(path), f"{bucket}/logs/{path.name}")
    manifest = tmp_path / "far.toml"
    manifest.write_text(MANIFEST.replace('"logs/*.csv"', f'"{bucket}/logs/*.csv"'))
    s3fs.S3FileSystem.clear_instance_cache()
    monkeypatch.setenv("AWS_MAX_ATTEMPTS", "1")
    monkeypatch.setattr(s3fs.S3FileSystem, "retries", 1)
    monkeypatch.setattr(s3fs.S3FileSystem, "default_block_size", 1 << 14)
    words = ["campaign", "run", str(manifest), "--quiet"]
    usual, ranges = Application.__call__, 0

    def dying(self: Any, environ: dict[str, Any], start: Any) -> Any:
        nonlocal ranges
        ranges += environ["REQUEST_METHOD"] == "GET" and "/logs/run" in environ["PATH_INFO"]
        if ranges < 20:
            return usual(self, environ, start)
        start(answer, [("Content-Type", "text/plain")])
        return [b"no"]

    with monkeypatch.context() as dead:
        dead.setattr(Application, "__call__", dying)
        assert run(words) == 2
    said = capfd.readouterr().err
    assert said.count("\n") == 1
    assert "logs in a row failed for a reason outside of them" in said
    assert run(words) == 0, capfd.readouterr().err
    assert states(tmp_path / "results") == ["done"] * LOGS
    assert len(dataset(tmp_path / "results")) == 2 * LOGS
