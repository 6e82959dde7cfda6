"""Property: one run after an outage gives the result of an undisturbed one."""

import errno
import os
import tempfile
from pathlib import Path

import pandas as pd
import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, rule, run_state_machine_as_test

from tests.campaign.conftest import dataset, make_campaign
from tests.cli.conftest import pulse_rows
from tirelog.campaign import runner
from tirelog.campaign.ledger import Ledger
from tirelog.cli import run

pytestmark = pytest.mark.usefixtures("in_this_process")


def refusing(what):
    def refused(*_, **__):
        raise OSError(what, os.strerror(what))

    return refused


def campaign(manifest, *options):
    return run(["campaign", "run", str(manifest), "--quiet", *options])


def states(manifest):
    return list(pd.read_csv(manifest.parent / "results" / "summary.csv")["status"])


@pytest.mark.parametrize("what", [errno.EIO, errno.EMFILE, errno.ENOSPC, errno.ETIMEDOUT])
def test_what_the_machine_refuses_stays_open_and_is_tried_again(tmp_path, monkeypatch, what, capfd):
    manifest = make_campaign(tmp_path, logs=2, seconds=0.5)
    with monkeypatch.context() as broken:
        broken.setattr(runner, "open_recording", refusing(what))
        assert campaign(manifest) == 3
    assert capfd.readouterr().err.count("stays open") == 2
    assert states(manifest) == ["open", "open"]
    assert campaign(manifest) == 0
    assert states(manifest) == ["done", "done"]


def test_logs_that_cannot_be_looked_at_stay_open_and_what_is_done_stays(
    tmp_path, monkeypatch, capfd
):
    manifest = make_campaign(tmp_path, logs=2, seconds=0.5)
    assert campaign(manifest) == 0
    with monkeypatch.context() as broken:
        broken.setattr(Ledger, "sha256", refusing(errno.ETIMEDOUT))
        assert campaign(manifest) == 3
    assert capfd.readouterr().err.count("stays open") == 2
    assert states(manifest) == ["done", "done"]
    assert campaign(manifest) == 0


class Disturbed(RuleBasedStateMachine):
    """A campaign of two short logs to which things happen."""

    def __init__(self):
        super().__init__()
        self.place = tempfile.TemporaryDirectory()
        self.manifest = make_campaign(Path(self.place.name), logs=2, seconds=0.5)
        self.logs = 2

    @rule()
    def run(self):
        assert campaign(self.manifest) == 0

    @rule(number=st.sampled_from([errno.EIO, errno.EMFILE, errno.ETIMEDOUT]))
    def outage(self, number):
        with pytest.MonkeyPatch.context() as broken:
            broken.setattr(runner, "open_recording", refusing(number))
            campaign(self.manifest)

    @rule(after=st.integers(0, 1))
    def kill(self, after):
        def killed(tasks, workers):
            yield from map(runner.make_tables, tasks[:after])
            raise KeyboardInterrupt

        with pytest.MonkeyPatch.context() as broken:
            broken.setattr(runner, "_on_processes", killed)
            campaign(self.manifest)

    @rule(which=st.integers(0, 1), speed=st.integers(8, 16))
    def edit(self, which, speed):
        self._write(which, speed)

    @rule(speed=st.integers(8, 16))
    def add(self, speed):
        if self.logs < 4:
            self._write(self.logs, speed)
            self.logs += 1

    def _write(self, which, speed):
        rows = "\n".join(pulse_rows(0.5, float(speed)))
        log = self.manifest.parent / "logs" / f"run_{which}.csv"
        log.write_text(f"time_s,CH1,CH2\n{rows}\n")

    @rule()
    def retry(self):
        campaign(self.manifest, "--retry-failed")

    def teardown(self):
        assert campaign(self.manifest) == 0
        mended = dataset(self.manifest.parent / "results")
        text = self.manifest.read_text().replace('"results"', '"fresh"')
        self.manifest.write_text(text)
        assert campaign(self.manifest) == 0
        assert mended == dataset(self.manifest.parent / "fresh")
        self.place.cleanup()


@pytest.mark.slow
def test_one_run_mends_what_happened():
    run_state_machine_as_test(  # type: ignore[no-untyped-call]
        Disturbed,
        settings=settings(
            max_examples=6,
            stateful_step_count=6,
            deadline=None,
            derandomize=True,
            suppress_health_check=list(HealthCheck),
        ),
    )
