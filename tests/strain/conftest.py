"""Drives with known truth; seeds of tests are from 1000 on: none was used for tuning."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
import pytest

from tirelog.cli import run
from tirelog.data.recording import Channel, TimeAxis

RADIUS_M = 0.305
CIRCUMFERENCE_M = 2 * np.pi * RADIUS_M
#: strain of 1 pm at 1550 nm with the papers' gain
PICOMETRE = 1.27 * 1e-3 / 1550.0
STEP_S = 1e-4


def trapezium(xi_m: np.ndarray, steep_m: float = 0.023, slow_m: float = 0.023) -> np.ndarray:
    """A flat-topped pulse of height 1 and 110 mm; how far its entry and exit edges reach."""
    return 0.5 * (np.tanh((xi_m + 0.055) / steep_m) - np.tanh((xi_m - 0.055) / slow_m))


def shoulders(xi_m: np.ndarray, entry: float = 0.30, leave: float = 0.22) -> np.ndarray:
    """Humps beside the patch of these heights."""
    before = entry * np.exp(-(((xi_m + 0.105) / 0.035) ** 2))
    return before + leave * np.exp(-(((xi_m - 0.11) / 0.04) ** 2))


def beam_pulse(xi_m: np.ndarray, speed_m_s: np.ndarray) -> np.ndarray:
    """A flat-topped pulse of height 1, uneven shoulders, an odd part that grows with speed."""
    odd = 0.03 * speed_m_s / 20.0 * xi_m / 0.05 * np.exp(-((xi_m / 0.06) ** 2))
    return trapezium(xi_m) - shoulders(xi_m) + odd


def ring_pulse(xi_m: np.ndarray, speed_m_s: np.ndarray) -> np.ndarray:
    """Two humps at the edges of the patch, deep shoulders, ripples around the whole turn."""
    places = ((1.0, -0.035, 0.03), (0.9, 0.035, 0.03), (-0.5, -0.11, 0.04), (-0.45, 0.11, 0.04))
    humps = sum(height * np.exp(-(((xi_m - at) / wide) ** 2)) for height, at, wide in places)
    return humps + 0.04 * np.cos(5 * xi_m / RADIUS_M) + 0.0 * speed_m_s


def lopsided(xi_m: np.ndarray, speed_m_s: np.ndarray) -> np.ndarray:
    """A pulse of no brush and no carcass: steep at its begin, slow at its end."""
    beside = 0.35 * np.exp(-(((xi_m + 0.10) / 0.03) ** 2))
    beside += 0.15 * np.exp(-(((xi_m - 0.12) / 0.05) ** 2))
    return trapezium(xi_m, 0.015, 0.032) * (1 - 1.5 * xi_m) - beside


@dataclass(frozen=True)
class Drive:
    """`channel`, its samples `values`, and the truth: `time_s` and signed `speed_m_s`."""

    channel: Channel
    values: np.ndarray
    time_s: np.ndarray
    speed_m_s: np.ndarray

    def with_values(
        self, values: np.ndarray, axis: TimeAxis | None = None, **more: object
    ) -> Channel:
        """The channel with other samples, and what else is different."""
        if axis is None and values.size == self.values.size:
            axis = self.channel.axis
        own = {"name": self.channel.name, "kind": self.channel.kind, "values": values}
        own["axis"] = axis or TimeAxis.uniform(values.size, self.channel.axis.rate_Hz)
        return Channel.of_array(**own | {"surface": self.channel.surface} | more)

    def nearest(self, time_s: np.ndarray) -> np.ndarray:
        """Index of the true passage nearest to each time."""
        return np.abs(time_s[:, None] - self.time_s[None, :]).argmin(axis=1)


def make_drive(
    knots_s: Sequence[float],
    speeds_m_s: Sequence[float],
    *,
    seed: int,
    noise_pm: float = 0.8,
    rate_Hz: float = 2500.0,
    height: float = 8e-4,
    drift: float = 6e-5,
    start_turns: float = 0.4,
    surface: str = "outer",
    pulse: Callable[[np.ndarray, np.ndarray], np.ndarray] = beam_pulse,
) -> Drive:
    """A drive with the speed linear between knots."""
    rng = np.random.default_rng(seed)
    fine = np.arange(0.0, knots_s[-1], STEP_S)
    speed = np.interp(fine, knots_s, speeds_m_s)
    distance = start_turns * CIRCUMFERENCE_M + np.concatenate(
        [[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * STEP_S)]
    )
    time = np.arange(int(knots_s[-1] * rate_Hz)) / rate_Hz
    at, how_fast = np.interp(time, fine, distance), np.interp(time, fine, speed)
    xi = (at + 0.5 * CIRCUMFERENCE_M) % CIRCUMFERENCE_M - 0.5 * CIRCUMFERENCE_M
    sign = -1.0 if surface == "outer" else 1.0
    values = sign * height * pulse(xi, np.abs(how_fast)) + drift * (1 - np.exp(-time / 60.0))
    values = values + rng.normal(0.0, noise_pm * PICOMETRE, time.size)
    turns = distance / CIRCUMFERENCE_M
    crossed = np.flatnonzero(np.floor(turns[1:]) != np.floor(turns[:-1]))
    target = np.maximum(np.floor(turns[crossed]), np.floor(turns[crossed + 1]))
    share = (target - turns[crossed]) / (turns[crossed + 1] - turns[crossed])
    passed = fine[crossed] + share * STEP_S
    # a passage cut by the log's ends is not there to be found
    reach = 0.16 / np.maximum(np.abs(np.interp(passed, fine, speed)), 0.05)
    whole = (passed - reach > 0) & (passed + reach < time[-1])
    channel = Channel.of_array(
        "grating", "strain", values, TimeAxis.uniform(values.size, rate_Hz), surface=surface
    )
    return Drive(channel, values, passed[whole], np.interp(passed, fine, speed)[whole])


def without_rows(drive, kept):
    """The channel of a drive of which only the rows `kept` (n,) bool were written."""
    rows = np.flatnonzero(kept)
    first = np.flatnonzero(np.diff(rows, prepend=-2) > 1)
    rate = drive.channel.axis.rate_Hz
    axis = TimeAxis(rows.size, rate, first, rows[first] / rate, np.full(first.size, 1.0 / rate))
    return drive.with_values(drive.values[rows], axis)


@pytest.fixture(scope="session")
def radius_m():
    return RADIUS_M


@pytest.fixture
def command(tmp_path, monkeypatch, capfdbinary):
    """(status, table or None, standard error) of a command on a `log.csv` of these columns."""

    def call(columns, setup, name, *arguments):
        monkeypatch.chdir(tmp_path)
        pd.DataFrame(columns).to_csv("log.csv", index=False)
        (tmp_path / "log.toml").write_text(setup)
        status = run([name, "log.csv", *arguments])
        out, err = capfdbinary.readouterr()
        return status, pd.read_csv(io.BytesIO(out)) if out.strip() else None, err.decode()

    return call
