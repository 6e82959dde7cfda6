"""Closed form: the least extra error at which model and data agree, of errors of known size."""

from types import SimpleNamespace

import numpy as np
import pytest

from tirelog.diagnosis.residual_structure import extra_errors
from tirelog.inference.metric import Whitener

CELLS, ANGLES, NOISE = 40, 128, 2e-6


def base_of(left, slope=None):
    """A base of strain that leaves `left` (C, m), with white noise and one parameter of value 2."""
    phi = np.tile(np.linspace(-np.pi, np.pi, ANGLES), (CELLS, 1))
    cells = SimpleNamespace(
        phi=phi, values=left, observable="strain", member="", label="strain", logs=("a", "b"),
        log=np.arange(CELLS) // (CELLS // 2), regime=np.full(CELLS, "cruise"),
        conditions=SimpleNamespace(speed_m_s=np.where(np.arange(CELLS) % 2, 9.0, 21.0)),
    )  # fmt: skip
    none = np.zeros((CELLS, ANGLES, 0))
    fit = SimpleNamespace(
        prediction=np.zeros_like(left), beside=np.zeros_like(left), freedom=float(left.size),
        names=("stiffness",) if slope is not None else (),
        moving=none if slope is None else np.broadcast_to(slope[:, None], (CELLS, ANGLES, 1)),
    )  # fmt: skip
    model = SimpleNamespace(
        values={"radius_m": 0.3, "stiffness": 2.0}, beside=(), half_length_m=lambda c: 0.06
    )
    noise = Whitener(np.full(left.shape, 1.0 / NOISE), none, np.zeros((CELLS, 0)))
    return SimpleNamespace(cells=cells, fit=fit, model=model, noise=noise)


def noise(seed=3):
    return NOISE * np.random.default_rng(seed).standard_normal((CELLS, ANGLES))


def sizes(base):
    return {(row["of"], row["name"]): row["size"] for row in extra_errors(base)}


def test_noise_needs_none():
    assert set(sizes(base_of(noise())).values()) == {0.0}


def test_an_error_in_one_zone_is_found_there_in_its_size():
    left = noise()
    patch = np.abs(np.linspace(-np.pi, np.pi, ANGLES)) <= 0.1
    left[:, patch] += 5e-6 * np.random.default_rng(4).standard_normal((CELLS, int(patch.sum())))
    found = sizes(base_of(left))
    # the least: two standard deviations of chi-square below the size that was planted
    assert found["zone", "patch"] == pytest.approx(5e-6, rel=0.3)
    assert found["zone", "patch"] < 5.2e-6
    assert found["zone", "entry"] == found["zone", "away"] == 0.0


def test_an_error_of_one_log_is_found_in_that_log():
    left = noise()
    left[CELLS // 2 :] *= 3.0
    found = sizes(base_of(left))
    assert found["log", "a"] == 0.0
    assert found["log", "b"] == pytest.approx(np.sqrt(8.0) * NOISE, rel=0.05)


def test_a_parameter_that_changes_from_cell_to_cell_is_found_by_its_scatter():
    slope = 1e-5 * np.sin(np.linspace(-np.pi, np.pi, ANGLES))
    scatter = np.tile([0.5, -0.5], CELLS // 2)  # of a value of two: a quarter
    found = sizes(base_of(noise() + scatter[:, None] * slope, slope))
    # of 40 cells 40 s^2 / w^2 is left, and so much may be beside what this noise has
    may_be = CELLS * ANGLES + 2.0 * np.sqrt(2.0 * CELLS * ANGLES) - (noise() ** 2).sum() / NOISE**2
    wanted = 0.25 * np.sqrt(CELLS / (CELLS + may_be))
    assert found["parameter", "stiffness"] == pytest.approx(wanted, rel=0.05)
    # an odd slope explains nothing even
    even = 1e-5 * np.cos(np.linspace(-np.pi, np.pi, ANGLES))
    assert sizes(base_of(noise() + even, slope))["parameter", "stiffness"] is None
