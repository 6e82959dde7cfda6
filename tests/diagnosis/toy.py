"""A measurement with known truth that shares nothing with the models."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tirelog.cli import run
from tirelog.data.recording import Channel, Conditions, Stack, TimeAxis
from tirelog.inference.cells.cells import Cells, cells_of
from tirelog.inference.cells.pieces import pieces_of
from tirelog.vocabulary.arrays import FloatArray, IntArray


def waveform(phi: FloatArray, width: FloatArray | float = 0.25) -> FloatArray:
    """A dip with shoulders, of unit size."""
    x = (np.mod(phi + np.pi, 2 * np.pi) - np.pi) / width
    return (x**2 - 1.0) * np.exp(-(x**2) / 2)


def channel(
    seed: int, seconds: float = 12.0, rate_Hz: float = 2500.0, noise: float = 0.01
) -> tuple[Channel, FloatArray]:
    """A channel with a wheel that speeds up, and the true passage times."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1.0 / rate_Hz)
    angle = 2 * np.pi * (4.0 * time + 0.05 * time**2) + 1.0
    values = waveform(angle) + noise * random.standard_normal(time.size)
    turns = np.arange(1, int(angle[-1] / (2 * np.pi)))
    passages = np.interp(2 * np.pi * turns, angle, time)
    return Channel.of_array("toy", "strain", values, TimeAxis.uniform(time.size, rate_Hz)), passages


def stack_of(
    values: FloatArray, conditions: Conditions, manoeuvre: IntArray, noise: float, **other: Any
) -> Stack:
    """Revolutions (n, m) of one log at evenly spaced angles; `other`: what is not as usual."""
    n, m = values.shape
    grid = (np.arange(m) + 0.5) * 2 * np.pi / m - np.pi if m > 1 else np.zeros(1)
    usual = {
        "observable": "strain",
        "channel": "made",
        "surface": "outer",
        "radius_m": 0.3,
        "phi_rad": grid,
        "phi_mean": np.tile(grid, (n, 1)),
        "phi_variance": np.zeros((n, m)),
        "count": np.ones((n, m), np.int64),
        "noise": np.full(n, noise),
        "log": np.zeros(n, np.int64),
        "revolution": np.arange(n),
        "regime": np.full(n, "cruise"),
        "logs": ("made",),
    }
    return Stack(
        **usual | {"values": values, "conditions": conditions, "manoeuvre": manoeuvre} | other
    )


def stack(
    seed: int,
    *,
    manoeuvres: int = 6,
    revolutions: int = 12,
    noise: float = 0.01,
    amplitude: float = 0.02,
    baseline: float = 0.005,
    m: int = 128,
) -> Stack:
    """Revolutions whose amplitude, baseline and shift scatter by known amounts."""
    random = np.random.default_rng(seed)
    n = manoeuvres * revolutions
    grid = (np.arange(m) + 0.5) * 2 * np.pi / m - np.pi
    phi = grid + random.uniform(-0.4, 0.4, (n, m)) * 2 * np.pi / m
    size = 1.0 + amplitude * random.standard_normal(n)
    values = size[:, None] * waveform(phi - 0.002 * random.standard_normal((n, 1)))
    values += baseline * random.standard_normal((n, 1)) + noise * random.standard_normal((n, m))
    number = np.repeat(np.arange(manoeuvres), revolutions)
    conditions = Conditions.of(
        n, speed_m_s=10.0 + number, acceleration_m_s2=0.0, time_s=np.arange(n) * 0.2
    )
    named = {"channel": "toy", "logs": ("toy",), "phi_mean": phi}
    return stack_of(values, conditions, number, noise, **named)


def phase_shifts(
    seed: int,
    manoeuvres: int,
    repeats: int,
    shifts: Callable[[Conditions], FloatArray],
    noise: float,
    log: str = "a",
    **drive: Any,
) -> Stack:
    """Phase shifts [rad] of steady drives of one log; `shifts` (n,) are those without noise."""
    random, manoeuvre = np.random.default_rng(seed), np.repeat(np.arange(manoeuvres), repeats)
    values = {
        name: random.uniform(*given, manoeuvres)[manoeuvre] if isinstance(given, tuple) else given
        for name, given in {"speed_m_s": (10.0, 25.0), "acceleration_m_s2": 0.0, **drive}.items()
    }
    driven = Conditions.of(manoeuvre.size, time_s=np.arange(manoeuvre.size) * 0.1, **values)
    measured = shifts(driven)[:, None] + noise * random.standard_normal((manoeuvre.size, 1))
    named = {"observable": "phase_shift", "surface": "inner", "radius_m": 0.305, "logs": (log,)}
    return stack_of(measured, driven, manoeuvre, noise, **named)


def make_cells(stack: Stack) -> Cells:
    """The cells of a stack."""
    return cells_of(pieces_of(stack))


def done(*words: object) -> None:
    """A command, which has to end well."""
    assert run([*map(str, words), "--quiet"]) == 0
