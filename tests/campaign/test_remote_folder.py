"""Property: a campaign whose logs and output are in a store gives what one on this machine gives,
killed or not.
"""

import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from tests.campaign.conftest import MANIFEST, dataset, make_campaign
from tests.campaign.processes import killed_in_the_midst
from tests.campaign.test_elsewhere import bucket  # noqa: F401
from tirelog.campaign.ledger import Folder
from tirelog.cli import run
from tirelog.storage import remote


def store() -> Any:
    import s3fs

    return s3fs.S3FileSystem()


def there(root: str) -> dict[str, bytes]:
    """Every object of the dataset."""
    system = store()
    system.invalidate_cache()
    return {
        name.removeprefix(root.removeprefix("s3://") + "/"): system.cat_file(name)
        for name in system.find(root)
        if name.endswith(".parquet")
    }


@pytest.fixture
def far(bucket: str, tmp_path: Path) -> tuple[Path, Path, str]:  # noqa: F811
    """(manifest here, the same campaign's manifest with logs, setup and output in the store, its
    output there).
    """
    here = make_campaign(tmp_path, logs=5)
    for path in (tmp_path / "logs").iterdir():
        store().put(str(path), f"{bucket}/logs/{path.name}")
    store().put(str(tmp_path / "setup.toml"), f"{bucket}/setup.toml")
    text = MANIFEST.replace('"results"', f'"{bucket}/results"').replace(
        '"logs/*.csv"', f'"{bucket}/logs/*.csv"'
    )
    (tmp_path / "far.toml").write_text(text.replace('"setup.toml"', f'"{bucket}/setup.toml"'))
    return here, tmp_path / "far.toml", f"{bucket}/results"


def rows(parts: dict[str, bytes]) -> dict[str, Any]:
    """Table and number of the log -> its rows."""
    import io

    import pyarrow.parquet as pq

    found = {}
    for name, data in parts.items():
        table, log, _ = name.split("/")
        found[table, log[-5]] = pq.read_table(io.BytesIO(data)).to_pydict()
    return found


@pytest.mark.slow
def test_a_store_as_source_and_target(far: tuple[Path, Path, str], tmp_path: Path) -> None:
    here, manifest, results = far
    assert run(["campaign", "run", str(here), "--quiet"]) == 0
    assert run(["campaign", "run", str(manifest), "--quiet", "--workers", "2"]) == 0
    made = there(results)
    assert rows(made) == rows(dataset(tmp_path / "results"))
    assert len(made) == 10
    assert store().cat_file(f"{results}/summary.csv").count(b",done,") == 5
    assert not [name for name in store().find(results) if "lock" in name or name.endswith(".part")]
    written = {
        name: store().info(name)["LastModified"]
        for name in store().find(results)
        if "summary" not in name
    }
    time.sleep(1.1)
    assert run(["campaign", "run", str(manifest), "--quiet"]) == 0
    assert {
        name: store().info(name)["LastModified"] for name in written
    } == written  # nothing was done twice
    assert "5 done" in _status(manifest)


def _status(manifest: Path) -> str:
    words = [sys.executable, "-m", "tirelog", "campaign", "status", str(manifest)]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout


@pytest.mark.slow
def test_killed_and_resumed(far: tuple[Path, Path, str], tmp_path: Path) -> None:
    _, manifest, results = far
    assert run(["campaign", "run", str(manifest), "--quiet"]) == 0
    want = there(results)
    store().rm(results, recursive=True)
    for tickets, later_s in ((1, 0.0), (1, 0.2), (2, 0.1)):
        killed_in_the_midst(manifest, tickets, later_s, tmp_path / "gate")
    assert run(["campaign", "run", str(manifest), "--quiet"]) == 0
    assert there(results) == want
    folder = Folder(results)
    assert not folder.temporary.exists()


def test_a_host_that_does_not_answer(manifest, monkeypatch, capfd):
    pytest.importorskip("s3fs").S3FileSystem.clear_instance_cache()
    silent = socket.create_server(("127.0.0.1", 0))  # takes the connection and says nothing
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{silent.getsockname()[1]}")
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "test")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "test")
    monkeypatch.setattr(remote, "ANSWER_S", 0.5)
    manifest.write_text(MANIFEST.replace('"results"', '"s3://bucket/results"'))
    assert run(["campaign", "run", str(manifest), "--quiet"]) == 2
    assert "no answer within 0.5 s" in capfd.readouterr().err
    silent.close()
