"""Property: a channel's tables are the same to the bit, whoever makes them."""

import os
import signal
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tirelog.data.recording import Scaled
from tirelog.process_pool import POSSIBLE
from tirelog.products import Part, tables_of
from tirelog.runs.ingest import open_recording
from tirelog.strain.footprint import footprint

DRIVE = Path(__file__).parents[2] / "sample_data" / "drive.csv.gz"
TABLES = ("speed", "footprint", "dissipation")

pytestmark = pytest.mark.skipif(not POSSIBLE, reason="no process is forked here")


SCALE, LOST = 1e-8, -(1 << 31)


@contextmanager
def one_grating():
    """A grating of a log, as counts that each process reads for itself."""
    with open_recording(str(DRIVE)) as log:
        name = next(name for name, one in log.channels.items() if one.kind == "fbg_strain")
        strain = log.channels[name].read()
        counts = np.where(np.isnan(strain), LOST, np.nan_to_num(strain) / SCALE).astype(np.int32)
        samples = Scaled(lambda start, stop: counts[start:stop], SCALE, 0.0, LOST)
        channel = replace(log.channels[name], samples=samples, at_hand=True)
        yield replace(log, channels={name: channel})


def same(one, other):
    assert len(one) == len(other) > 1
    for part, its in zip(one, other, strict=True):
        assert (part.table, tuple(part.remarks)) == (its.table, tuple(its.remarks))
        assert part.columns.keys() == its.columns.keys()
        for column, values in part.columns.items():
            np.testing.assert_array_equal(values, its.columns[column], err_msg=column)


def gratings(log, count):
    """The log with its grating so many times."""
    ((name, one),) = log.channels.items()
    names = [f"{name}_{n}" for n in range(count)]
    return replace(log, channels={name: replace(one, name=name) for name in names})


def test_processes_give_the_rows_of_one():
    order = TABLES[::-1]
    with one_grating() as one:
        log, wanted = gratings(one, 2), {name: {} for name in order}
        alone = list(tables_of(log, wanted))
        shared = list(tables_of(log, wanted, 2, processes=True))
    assert [part.table for part in shared] == [*order, *order]
    assert all(part.found is not None for part in alone)
    assert all(part.found is None for part in shared)  # by processes indeed
    same(alone, shared)


@pytest.mark.parametrize("how", [signal.SIGTERM, None])
def test_a_process_that_is_stopped_at_a_form_keeps_it_from_nobody(monkeypatch, how):
    """Its parent learns the form in its place, and starts from where it would have."""
    parent, settled = os.getpid(), footprint.choose_form

    def mortal(channel, passages, *, like=None):
        if channel.name.endswith("_1") and os.getpid() != parent:
            if how is None:
                raise MemoryError
            os.kill(os.getpid(), how)
        return settled(channel, passages, like=like)

    with one_grating() as one:
        log = gratings(one, 3)
        wanted = {"footprint": {}}
        alone = [Part(p.table, p.columns, p.remarks) for p in tables_of(log, wanted)]
        before = signal.signal(signal.SIGTERM, stopped)
        monkeypatch.setattr(footprint, "choose_form", mortal)
        try:
            shared = list(tables_of(log, wanted, 2, processes=True))
        finally:
            signal.signal(signal.SIGTERM, before)
    same(alone, shared)


def stopped(number, frame):
    raise KeyboardInterrupt
