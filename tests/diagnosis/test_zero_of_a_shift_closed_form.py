"""Each log counts its phase shift from a zero of its own: what only tells logs apart is no
evidence."""

import numpy as np
import pytest

from tests.diagnosis.test_together_closed_form import NOISE, SPEEDS, R
from tirelog.data.recording import Conditions, Stack
from tirelog.diagnosis.candidates.assessment import zeros
from tirelog.diagnosis.diagnose import diagnose
from tirelog.inference.base import prepare
from tirelog.inference.cells.cells import make_cells
from tirelog.physics import Model

LOGS, REPEATS = 2, 12


def shift(step_rad=0.0, delay_s=0.0, seed=3):
    """Two logs at two pressures, of eight manoeuvres each; the second begins elsewhere."""
    rng = np.random.default_rng(seed)
    which = np.repeat(np.arange(LOGS * SPEEDS.size), REPEATS)
    n, log = which.size, which // SPEEDS.size
    speed = np.tile(SPEEDS, LOGS)[which]
    values = step_rad * log + delay_s * speed / R + NOISE["phase_shift"] * rng.standard_normal(n)
    zero = np.zeros((n, 1))
    return Stack(
        observable="phase_shift", channel="a", surface="outer", radius_m=R,
        values=values[:, None], phi_rad=np.zeros(1), phi_mean=zero, phi_variance=zero,
        count=np.ones((n, 1), int), noise=np.full(n, NOISE["phase_shift"]),
        conditions=Conditions.of(
            n, speed_m_s=speed, acceleration_m_s2=np.where(which % 2, 1.0, -1.0),
            time_s=np.arange(n) * 0.1, inflation_pressure_Pa=np.where(log, 1.6e5, 2.0e5),
        ),
        log=log, manoeuvre=which, revolution=np.arange(n), regime=np.full(n, "cruise"),
        logs=("a", "b"),
    )  # fmt: skip


MODEL = Model.new("ring", "phase_shift", radius_m=R)


@pytest.mark.parametrize("step_rad", [0.0, 2e-3])
def test_a_step_from_log_to_log_is_the_zeros(step_rad):
    found = diagnose([shift(step_rad)], MODEL)
    assert not found.selected
    assert "inflation" in found.not_tested


def test_what_moves_within_the_logs_is_named_beside_it():
    found = diagnose([shift(2e-3, delay_s=5e-4)], MODEL)
    assert set(found.selected) & {"telemetry_delay", "speed_trend"}


def test_each_log_has_a_level_and_a_waveform_none():
    cells = make_cells(shift())
    columns = zeros(cells)
    assert columns.shape == (len(cells), 1, LOGS)
    assert np.array_equal(columns.sum(axis=-1)[:, 0], np.ones(len(cells)))
    base = prepare(cells, MODEL)
    assert np.array_equal(columns[..., 0][:, 0] > 0, base.cells.log == 0)
