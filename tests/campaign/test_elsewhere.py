"""Property: a Dask cluster that loses a worker, and a store elsewhere, give the same results as
this machine.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from tests.campaign.conftest import dataset, make_campaign
from tests.campaign.processes import PATIENCE_S, dying_once, patient
from tests.campaign.test_campaign import remove
from tirelog.campaign import runner
from tirelog.cli import run
from tirelog.storage import remote


@contextmanager
def local_cluster(distributed: Any, workers: int) -> Iterator[Any]:
    """A Dask cluster on this machine that waits for a busy one."""
    import dask

    slow = f"{PATIENCE_S:.0f}s"
    with (
        dask.config.set(
            {"distributed.comm.timeouts.connect": slow, "distributed.comm.timeouts.tcp": slow}
        ),
        distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
        ) as cluster,
    ):
        yield cluster


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_gives_the_same_bytes(tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed")
    manifest = make_campaign(tmp_path, logs=8)
    results = tmp_path / "results"
    assert run(["campaign", "run", str(manifest), "--quiet"]) == 0
    want = dataset(results)
    remove(results)
    monkeypatch.setenv("TIRELOG_TEST_GATE", str(tmp_path))
    monkeypatch.setattr(runner, "make_tables", dying_once)
    monkeypatch.setattr(runner, "ANSWER_S", PATIENCE_S)
    with local_cluster(distributed, 3) as cluster:
        words = ["campaign", "run", str(manifest), "--quiet"]
        assert run([*words, "--scheduler", cluster.scheduler_address]) == 0
    assert (tmp_path / "died").exists()
    assert dataset(results) == want


@pytest.fixture
def bucket(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """An S3 bucket on this machine, which may be slow to answer."""
    pytest.importorskip("s3fs")
    monkeypatch.setattr(remote, "ANSWER_S", PATIENCE_S)
    monkeypatch.setattr(runner, "make_tables", patient)
    server_of = pytest.importorskip("moto.server")
    server = server_of.ThreadedMotoServer(ip_address="127.0.0.1", port=0)
    server.start()
    host, port = server.get_host_and_port()
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "test")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "test")
    monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    import s3fs

    s3fs.S3FileSystem.clear_instance_cache()
    name = f"campaign-{port}"
    s3fs.S3FileSystem().mkdir(name)
    yield f"s3://{name}"
    server.stop()
    s3fs.S3FileSystem.clear_instance_cache()


def test_logs_and_tables_in_s3(bucket, manifest, tmp_path, monkeypatch):
    import s3fs

    monkeypatch.chdir(tmp_path)
    store = s3fs.S3FileSystem()
    store.put("logs/run_1.csv", f"{bucket}/run_1.csv")
    words = ["speed", f"{bucket}/run_1.csv", "--setup", "setup.toml"]
    assert run([*words, "-o", f"{bucket}/speed.parquet"]) == 0
    assert run(["speed", "logs/run_1.csv", "--setup", "setup.toml", "-o", "speed.parquet"]) == 0
    store.get(f"{bucket}/speed.parquet", "there.parquet")
    here, there = (
        pd.read_parquet(name).drop(columns="log") for name in ("speed.parquet", "there.parquet")
    )
    pd.testing.assert_frame_equal(here, there, check_exact=True)


def test_what_is_not_there_and_a_bucket_that_is_not(bucket, manifest, tmp_path, capfd):
    setup = str(tmp_path / "setup.toml")
    assert run(["speed", f"{bucket}/nothing.csv", "--setup", setup]) == 4
    assert "cannot be reached" in capfd.readouterr().err
    words = ["speed", str(tmp_path / "logs" / "run_1.csv"), "--setup", setup]
    assert run([*words, "-o", "s3://no-such-bucket/t.csv"]) == 2
    assert "cannot be reached" in capfd.readouterr().err


def without_credentials(monkeypatch: pytest.MonkeyPatch, home: Path) -> None:
    """Nobody has told who asks: no variables, no files, and what was remembered is forgotten."""
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    monkeypatch.setenv("HOME", str(home))
    import s3fs

    s3fs.S3FileSystem.clear_instance_cache()


def test_no_credentials(bucket, manifest, tmp_path, monkeypatch, capfd):
    without_credentials(monkeypatch, tmp_path)
    assert run(["speed", f"{bucket}/run_1.csv", "--setup", str(tmp_path / "setup.toml")]) == 4
    assert "credentials" in capfd.readouterr().err
