"""Property: a store elsewhere gives the same results as this machine, killed or not."""

import socket
import subprocess
import sys
import time

import pandas as pd
import pytest

from tests.campaign.conftest import MANIFEST, dataset, make_campaign
from tests.campaign.processes import PATIENCE_S, killed_in_the_midst, patient
from tirelog.campaign import runner
from tirelog.campaign.ledger import Folder
from tirelog.cli import run
from tirelog.storage import remote

s3fs = pytest.importorskip("s3fs")


@pytest.fixture
def bucket(monkeypatch):
    """An S3 bucket on this machine, which may be slow to answer."""
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
    s3fs.S3FileSystem.clear_instance_cache()
    name = f"campaign-{port}"
    s3fs.S3FileSystem().mkdir(name)
    yield f"s3://{name}"
    server.stop()
    s3fs.S3FileSystem.clear_instance_cache()


def test_logs_and_tables_in_s3(bucket, manifest, tmp_path, monkeypatch):
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


def test_what_is_not_there_and_who_may_not_ask(bucket, manifest, tmp_path, monkeypatch, capfd):
    setup = str(tmp_path / "setup.toml")
    assert run(["speed", f"{bucket}/nothing.csv", "--setup", setup]) == 4
    assert "cannot be reached" in capfd.readouterr().err
    words = ["speed", str(tmp_path / "logs" / "run_1.csv"), "--setup", setup]
    assert run([*words, "-o", "s3://no-such-bucket/t.csv"]) == 2
    assert "cannot be reached" in capfd.readouterr().err
    # nobody has told who asks: no variables, no files, and what was remembered is forgotten
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    monkeypatch.setenv("HOME", str(tmp_path))
    s3fs.S3FileSystem.clear_instance_cache()
    assert run(["speed", f"{bucket}/run_1.csv", "--setup", setup]) == 4
    assert "credentials" in capfd.readouterr().err


@pytest.fixture
def far(bucket, tmp_path):
    """(manifest here, the same with logs, setup and output in the store, its output there)."""
    here, store = make_campaign(tmp_path, logs=5), s3fs.S3FileSystem()
    for path in [*(tmp_path / "logs").iterdir(), tmp_path / "setup.toml"]:
        store.put(str(path), f"{bucket}/{path.relative_to(tmp_path)}")
    text = MANIFEST
    for name in ("results", "logs/*.csv", "setup.toml"):
        text = text.replace(f'"{name}"', f'"{bucket}/{name}"')
    (tmp_path / "far.toml").write_text(text)
    return here, tmp_path / "far.toml", f"{bucket}/results"


def there(results, to):
    """Every file of the dataset in a store, with its bytes."""
    s3fs.S3FileSystem.clear_instance_cache()
    s3fs.S3FileSystem().get(results, str(to), recursive=True)
    return dataset(to)


def written(results):
    """When each file in a store was written, but for the summary."""
    store = s3fs.S3FileSystem(use_listings_cache=False)
    names = [name for name in store.find(results) if "summary" not in name]
    return {name: store.info(name)["LastModified"] for name in names}


@pytest.mark.slow
def test_a_store_as_source_and_target(far, tmp_path):
    here, manifest, results = far
    assert run(["campaign", "run", str(here), "--quiet"]) == 0
    assert run(["campaign", "run", str(manifest), "--quiet", "--workers", "2"]) == 0
    assert len(there(results, tmp_path / "there")) == 10
    for table in ("speed", "dissipation"):
        ours, theirs = (
            pd.read_parquet(tmp_path / folder / f"table={table}").drop(columns="log")
            for folder in ("results", "there")
        )
        pd.testing.assert_frame_equal(ours, theirs, check_exact=True)
    assert (tmp_path / "there" / "summary.csv").read_text().count(",done,") == 5
    before = written(results)
    assert not [name for name in before if "lock" in name or name.endswith(".part")]
    time.sleep(1.1)
    assert run(["campaign", "run", str(manifest), "--quiet"]) == 0
    assert written(results) == before  # nothing was done twice
    words = [sys.executable, "-m", "tirelog", "campaign", "status", str(manifest)]
    assert "5 done" in subprocess.run(words, capture_output=True, text=True, check=True).stdout


@pytest.mark.slow
def test_killed_and_resumed(far, tmp_path):
    _, manifest, results = far
    assert run(["campaign", "run", str(manifest), "--quiet"]) == 0
    want = there(results, tmp_path / "whole")
    s3fs.S3FileSystem().rm(results, recursive=True)
    for tickets, later_s in ((1, 0.0), (1, 0.2), (2, 0.1)):
        killed_in_the_midst(manifest, tickets, later_s, tmp_path / "gate")
    assert run(["campaign", "run", str(manifest), "--quiet"]) == 0
    assert there(results, tmp_path / "resumed") == want
    assert not Folder(results).temporary.exists()


def test_a_host_that_does_not_answer(manifest, monkeypatch, capfd):
    s3fs.S3FileSystem.clear_instance_cache()
    silent = socket.create_server(("127.0.0.1", 0))  # takes the connection and says nothing
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{silent.getsockname()[1]}")
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "test")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "test")
    monkeypatch.setattr(remote, "ANSWER_S", 0.5)
    manifest.write_text(MANIFEST.replace('"results"', '"s3://bucket/results"'))
    assert run(["campaign", "run", str(manifest), "--quiet"]) == 2
    assert "no answer within 0.5 s" in capfd.readouterr().err
    silent.close()
