"""Faults: a campaign that is killed or told to end leaves no process and no litter."""

import os
import resource
import signal
import subprocess
import sys

import pytest

from tests.campaign.conftest import dataset, make_campaign
from tests.campaign.processes import PATIENCE_S, alive, begun, children, kill_all, stuck, waited_for
from tests.processes import python
from tirelog.campaign.ledger import Folder
from tirelog.cli import run

LINUX = pytest.mark.skipif(
    sys.platform != "linux", reason="what a process has started is read from /proc"
)


@LINUX
@pytest.mark.usefixtures("in_this_process")  # the second run
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP])
def test_an_ended_campaign_leaves_no_process(tmp_path, how):
    manifest = make_campaign(tmp_path, logs=2, seconds=0.5)
    results, parts = tmp_path / "results", "table=speed/log=*/.part.parquet.*.part"
    process = begun(manifest, stuck, "--workers", "2")
    started = []
    try:
        assert waited_for(lambda: process.poll() is not None or len(list(results.glob(parts))) == 2)
        started = children(process.pid)
        assert len(started) >= 2
        process.send_signal(how)
        assert process.wait(PATIENCE_S) == (-how if how is signal.SIGKILL else 128 + how)
        assert waited_for(lambda: not alive(started))
    finally:
        kill_all(process, started)
    said = (tmp_path / "said.txt").read_text()
    if how is signal.SIGKILL:
        assert said == ""
        assert len(list(results.glob(parts))) == 2
        assert run(["campaign", "run", str(manifest), "--quiet"]) == 0
        manifest.write_text(manifest.read_text().replace('"results"', '"undisturbed"'))
        assert run(["campaign", "run", str(manifest), "--quiet"]) == 0
        assert dataset(results) == dataset(tmp_path / "undisturbed")
    else:
        assert said.count("\n") == 1
        assert said.endswith("; nothing was left under the result's name; start it again\n")
    assert not list(results.glob(parts))
    assert not list((results / ".tirelog" / "tmp").iterdir())


@LINUX
def test_a_worker_that_comes_to_life_after_its_parent_has_gone_ends(tmp_path):
    """As if the parent had ended before the worker began."""
    program = (
        "from tirelog.runtime import end_with_parent; end_with_parent(1 << 30); print('alive')"
    )
    assert python(program, status=1).stdout == ""


@pytest.mark.usefixtures("in_this_process")
def test_files_of_other_programs_stay(tmp_path):
    manifest = make_campaign(tmp_path, logs=1, seconds=1.0)
    manifest.write_text(manifest.read_text().replace('"results"', '"."'))
    others = [
        tmp_path / "other" / ".download.part",
        tmp_path / ".notes.part",
        tmp_path / "table=speed" / "log=mine" / f".part.parquet.{os.getpid()}.part",
        tmp_path / "models" / ".beam.toml.12.part",
    ]
    for path in others:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("not a campaign's")
    assert run(["campaign", "run", str(manifest), "--quiet"]) == 0
    assert [path.read_text() for path in others] == ["not a campaign's"] * 4


@pytest.mark.usefixtures("in_this_process")
def test_planted_links_are_not_followed(tmp_path):
    manifest = make_campaign(tmp_path, logs=1, seconds=1.0)
    treasure, hidden = tmp_path / "treasure" / "gold.txt", tmp_path / "results" / ".tirelog"
    treasure.parent.mkdir()
    treasure.write_text("gold")
    hidden.mkdir(parents=True)
    (hidden / "tmp").symlink_to(treasure.parent)
    assert run(["campaign", "run", str(manifest), "--quiet"]) == 0
    assert treasure.read_text() == "gold"
    assert not (hidden / "tmp").is_symlink()
    (hidden / "lock").unlink()
    (hidden / "lock").symlink_to(treasure)
    assert run(["campaign", "run", str(manifest), "--quiet"]) == 2
    (tmp_path / "elsewhere").mkdir()
    manifest.write_text(manifest.read_text().replace('"results"', '"second"'))
    (tmp_path / "second").mkdir()
    (tmp_path / "second" / ".tirelog").symlink_to(tmp_path / "elsewhere")
    assert run(["campaign", "run", str(manifest), "--quiet"]) == 2
    assert treasure.read_text() == "gold"
    assert not list((tmp_path / "elsewhere").iterdir())


def test_a_link_in_the_place_of_a_result_is_replaced(tmp_path):
    (tmp_path / "gold.txt").write_text("gold")
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "summary.csv").symlink_to(tmp_path / "gold.txt")
    Folder(tmp_path / "results").write("summary.csv", b"done")
    assert (tmp_path / "results" / "summary.csv").read_bytes() == b"done"
    assert (tmp_path / "gold.txt").read_text() == "gold"


@pytest.mark.usefixtures("in_this_process")
def test_a_second_run_with_nothing_to_do_changes_no_byte_of_the_summary(tmp_path):
    manifest = make_campaign(tmp_path, logs=1, seconds=1.0)
    # cut off in the middle of a row: words of several kinds, in the order in which they were met
    log = tmp_path / "logs" / "run_0.csv"
    log.write_text(log.read_text()[:-7])
    assert run(["campaign", "run", str(manifest), "--quiet"]) == 3
    first = (tmp_path / "results" / "summary.csv").read_bytes()
    assert b"speed=" in first
    assert first.index(b"speed=") < first.index(b"dissipation=")
    assert run(["campaign", "run", str(manifest), "--quiet"]) == 3
    assert (tmp_path / "results" / "summary.csv").read_bytes() == first


def left_over(output):
    """What is neither a whole part nor the campaign's own."""
    own = ("lock", "hashes.json", "summary.csv", "part.parquet")
    return [
        str(p)
        for p in output.rglob("*")
        if p.is_file() and p.name not in own and p.parent.name != "done"
    ]


def test_files_that_may_not_grow(tmp_path):
    manifest = make_campaign(tmp_path, logs=2)

    command = [sys.executable, "-m", "tirelog", "campaign", "run", str(manifest), "--quiet"]

    def limited():
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    outcome = subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=limited,
    )
    assert outcome.returncode == 2, outcome.stderr
    assert "cannot be written (File too large)" in outcome.stderr
    assert "Traceback" not in outcome.stderr
    assert left_over(tmp_path / "results") == []
    assert subprocess.run(command, check=False).returncode == 0
    assert len(dataset(tmp_path / "results")) == 4
