"""Property: what a learnt residual gains on manoeuvres held out, and that it names nothing (P3)."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

import tirelog
from tests.diagnosis.planted import HALF_M, MODEL, stack
from tirelog.diagnosis.compare import start
from tirelog.diagnosis.residual_structure import learnt_residual
from tirelog.inference.measured import MeasuredLogs

SIZE = 3e-5


def bump(xi, speed, power):
    """Strain in the middle of the patch, no effect's form."""
    return SIZE * (speed / 20.0) ** power * np.exp(-0.5 * ((xi - 0.3 * HALF_M) / 0.02) ** 2)


@pytest.mark.parametrize(("power", "over"), [(0.0, "angle"), (2.0, "angle, speed")])
def test_what_repeats_is_learnt_from_the_other_manoeuvres(power, over):
    base = start([stack(partial(bump, power=power))], MODEL)
    rows = {row["learns"]: row for row in learnt_residual(base)}
    floor = np.sqrt(base.floor.square)
    assert list(rows)[:2] == ["angle", "angle, speed"]
    assert rows[over]["excess_removed"] > 0.85
    assert rows[over]["sigmas"] > 2.0
    assert 0.95 * floor < rows[over]["rmse_heldout"] < 1.1 * floor < base.rmse_held
    if over != "angle":
        assert rows["angle"]["excess_removed"] < 0.75


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_of_noise_nothing_is_learnt(seed):
    base = start([stack(seed=seed, m=64)], MODEL)
    for row in learnt_residual(base):
        assert row["sigmas"] < 2.0
        assert row["rmse_heldout"] > 0.97 * base.rmse_held


def test_it_is_there_only_if_asked_and_changes_no_name():
    logs = MeasuredLogs([stack(partial(bump, power=1.0), manoeuvres=5, revolutions=4, m=64)])
    plain, learnt = (tirelog.compare(logs, MODEL, learn=asked) for asked in (False, True))
    assert plain.learnt == ()
    assert "learnt residual" in learnt.wrongness()[-1].caption
    assert [row["weights"] for row in learnt.to_json()["learnt"]][:2] == [31, 93]
    assert plain.model.values == learnt.model.values
    assert plain.rmse_heldout == learnt.rmse_heldout
