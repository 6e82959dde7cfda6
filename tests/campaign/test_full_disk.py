"""Faults: a full disk stops a campaign, half-writes nothing and is not held against logs."""

import os
import resource
import subprocess
import sys

import pytest

from tests.campaign.conftest import MANIFEST, dataset, make_campaign

TIRELOG = (sys.executable, "-m", "tirelog", "campaign", "run")


@pytest.fixture
def small_disk(tmp_path):
    """A disk of 3 MB."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=3m", "tmpfs", str(place)]
    if os.geteuid() or subprocess.run(mount, check=False).returncode:
        pytest.skip("only root may mount a small disk")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def left_over(output):
    """What is neither a whole part nor the campaign's own."""
    own = ("lock", "hashes.json", "summary.csv", "part.parquet")
    return [
        str(p)
        for p in output.rglob("*")
        if p.is_file() and p.name not in own and p.parent.name != "done"
    ]


@pytest.mark.slow
def test_a_full_disk_and_room_again(small_disk, tmp_path):
    manifest = make_campaign(tmp_path, logs=4, seconds=20.0)
    assert subprocess.run([*TIRELOG, str(manifest), "--quiet"], check=False).returncode == 0
    want = dataset(tmp_path / "results")
    manifest.write_text(MANIFEST.replace('"results"', f'"{small_disk}/results"'))
    # for two logs and a bit, the temporary run of none, the ledger of none
    for room_kB in (500, 400, 150, 0):
        fill = ["dd", "if=/dev/zero", f"of={small_disk}/ballast", "bs=1024"]
        subprocess.run([*fill, f"count={3072 - room_kB}"], check=False, capture_output=True)
        outcome = subprocess.run(
            [*TIRELOG, str(manifest), "--quiet"], capture_output=True, text=True, check=False
        )
        assert outcome.returncode == 2, outcome.stderr
        assert outcome.stderr.count("\n") == 1
        assert "the disk is full; make room" in outcome.stderr
        assert left_over(small_disk / "results") == []
        (small_disk / "ballast").unlink()
    assert subprocess.run([*TIRELOG, str(manifest), "--quiet"], check=False).returncode == 0
    assert dataset(small_disk / "results") == want


def test_files_that_may_not_grow(tmp_path):
    manifest = make_campaign(tmp_path, logs=2)

    def limited():
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    outcome = subprocess.run(
        [*TIRELOG, str(manifest), "--quiet"],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=limited,
    )
    assert outcome.returncode == 2, outcome.stderr
    assert "cannot be written (File too large)" in outcome.stderr
    assert "Traceback" not in outcome.stderr
    assert left_over(tmp_path / "results") == []
    assert subprocess.run([*TIRELOG, str(manifest), "--quiet"], check=False).returncode == 0
    assert len(dataset(tmp_path / "results")) == 4
