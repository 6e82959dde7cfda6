"""A family of strain logs, so that no figure of speed is that of one log.

A designed subset and no full factorial: each level (surface, pulse, traction, noise, rate, number
of gratings, lost peaks, constant or mixed speed) comes with several levels of every other. Truths
are finite differences of beam and ring, and pulses that no carcass has.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tests.strain.conftest import beam_pulse, lopsided
from tests.strain.strain_truth import Beam, Ring

RADIUS_M, GAIN = 0.305, 1.27
#: samples made at a time, whatever the number of gratings
BLOCK_VALUES = 1 << 19
#: strain of the pulses that are of no carcass
HEIGHT = 1e-3
#: grid of a truth's waves [m]; straight lines between leave 0.02 pm
STEP_M = 2.5e-4
#: the wheel is driven with this slip in the last of the log's quarters, and in no other
SLIP, DRIVEN_FROM = 0.12, 0.75


@dataclass(frozen=True)
class Case:
    """A log of the family: `truth` of `even`, `lopsided`, `beam`, `driven` or `ring`.

    `speeds_m_s`: between which the speed goes to and fro once a minute; `lost`: share of samples
    without a peak.
    """

    name: str
    truth: str
    surface: str
    gratings: int
    rate_Hz: float
    noise_pm: float
    speeds_m_s: tuple[float, float]
    lost: float = 0.0
    seed: int = 1


MIXED, STEADY = (8.0, 20.0), (14.0, 14.0)
FAMILY = (
    Case("even", "even", "outer", 16, 2500.0, 0.8, MIXED),
    Case("lopsided", "lopsided", "inner", 16, 2500.0, 4.0, MIXED),
    Case("lopsided-8pm", "lopsided", "outer", 4, 1000.0, 8.0, STEADY),
    Case("lopsided-fast", "lopsided", "outer", 4, 10_000.0, 0.8, MIXED, 0.01),
    Case("beam", "beam", "outer", 16, 2500.0, 0.8, STEADY),
    Case("beam-4pm", "beam", "inner", 4, 2500.0, 4.0, MIXED, 0.01),
    Case("beam-one-fast", "beam", "inner", 1, 10_000.0, 8.0, MIXED),
    Case("driven", "driven", "outer", 16, 2500.0, 0.8, MIXED),
    Case("driven-4pm", "driven", "inner", 4, 2500.0, 4.0, STEADY),
    Case("driven-slow", "driven", "outer", 16, 1000.0, 0.8, MIXED, 0.01),
    Case("ring", "ring", "inner", 16, 2500.0, 4.0, MIXED, 0.01),
    Case("ring-fast", "ring", "outer", 16, 10_000.0, 0.8, STEADY),
    Case("ring-one-slow", "ring", "outer", 1, 1000.0, 8.0, MIXED),
)

Pulse = Callable[[np.ndarray, np.ndarray], np.ndarray]


class Waves:
    """A truth's strain over the turn at some speeds, for quick looking up."""

    def __init__(self, pulse: Pulse, speeds_m_s: tuple[float, float], height: float) -> None:
        low, high = speeds_m_s
        count = round(2 * np.pi * RADIUS_M / STEP_M)
        self._low, self._span = low, max(high - low, 1e-9)
        speeds = np.linspace(low, high, 13 if high > low else 1)
        xi = (np.arange(count + 1) / count - 0.5) * 2 * np.pi * RADIUS_M
        self._waves = height * np.array([pulse(xi, np.full(xi.size, v)) for v in speeds])

    def at(self, turns: np.ndarray, speed_m_s: np.ndarray) -> np.ndarray:
        """Strain of an inner grating (maximum in the patch), which is down at whole `turns`."""
        wide = self._waves.shape[1] - 1
        place = np.mod(turns + 0.5, 1.0) * wide
        column = np.minimum(place.astype(np.int64), wide - 1)
        share = place - column
        if len(self._waves) == 1:
            wave = self._waves[0]
            return wave[column] * (1 - share) + wave[column + 1] * share
        level = (speed_m_s - self._low) / self._span * (len(self._waves) - 1)
        row = np.clip(level.astype(np.int64), 0, len(self._waves) - 2)
        up = level - row
        return (1 - up) * (
            self._waves[row, column] * (1 - share) + self._waves[row, column + 1] * share
        ) + up * (
            self._waves[row + 1, column] * (1 - share) + self._waves[row + 1, column + 1] * share
        )


def truths(case: Case) -> tuple[Waves, Waves, float, float]:
    """Waves of free rolling and under drive, half length and slip onset [m].

    NaN for what the truth has not.
    """
    speeds, nan = case.speeds_m_s, float("nan")
    if case.truth in ("even", "lopsided"):
        waves = Waves(beam_pulse if case.truth == "even" else lopsided, speeds, HEIGHT)
        return waves, waves, nan, nan
    if case.truth == "ring":
        ring = Ring()
        waves = Waves(ring, speeds, 1.0)
        return waves, waves, ring.half_length_m, nan
    free = Beam(speeds=speeds)
    waves = Waves(free, speeds, 1.0)
    if case.truth == "beam":
        return waves, waves, free.half_length_m, nan
    driven = replace(free, slip=SLIP, _cache={})
    return waves, Waves(driven, speeds, 1.0), free.half_length_m, driven.onset_m


def blocks(case: Case, minutes: float) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Stamps (n,) and strains (n, gratings) of an inner grating with noise, stretch by stretch."""
    free, driven, _, _ = truths(case)
    rng = np.random.default_rng(case.seed)
    low, high = case.speeds_m_s
    total = int(minutes * 60 * case.rate_Hz)
    step, travelled = max(BLOCK_VALUES // case.gratings, 1), 0.0
    drives_from = int(DRIVEN_FROM * total)
    noise = case.noise_pm * 1e-3 / 1550.0 * GAIN
    for start in range(0, total, step):
        count = np.arange(start, min(start + step, total))
        t = count / case.rate_Hz
        speed = 0.5 * (low + high) + 0.5 * (high - low) * np.sin(2 * np.pi * t / 60)
        x = travelled + np.cumsum(speed) / case.rate_Hz
        travelled = float(x[-1])
        turns = x / (2 * np.pi * RADIUS_M)
        strain = np.empty((t.size, case.gratings))
        for i in range(case.gratings):
            strain[:, i] = free.at(turns + i / case.gratings, speed)
            late = count >= drives_from
            if case.truth == "driven" and late.any():
                strain[late, i] = driven.at(turns[late] + i / case.gratings, speed[late])
        strain += noise * rng.standard_normal(strain.shape)
        if case.lost:
            strain[rng.random(strain.shape) < case.lost] = np.nan
        yield t, strain


def write(case: Case, path: Path, minutes: float) -> int:
    """The log `path` with its setup beside it; how many passages there are to be found, about."""
    channels = [f"CH{i // 4 + 1}_FBG{i % 4 + 1}" for i in range(case.gratings)]
    setup = (
        "[tire]\nrolling_radius_m = 0.305\nunloaded_radius_m = 0.3126\n"
        "section_height_m = 0.018\nwidth_m = 0.215\n"
        f'[log]\ntime = "time_s"\nsampling_rate_Hz = {case.rate_Hz}\n'
    )
    for name in channels:
        setup += (
            f'[channels.{name}]\nkind = "fbg_strain"\nsource = "{name}"\nunit = "nm"\n'
            f'reference_wavelength_nm = 1550.0\nstrain_gain = {GAIN}\nsurface = "{case.surface}"\n'
        )
    path.with_suffix(".toml").write_text(setup)
    sign = -1.0 if case.surface == "outer" else 1.0
    with path.open("wb") as out:
        out.write(("time_s," + ",".join(channels) + "\n").encode())
        for t, strain in blocks(case, minutes):
            out.write(_lines(t, 1550.0 * (1 + sign * strain / GAIN)))
    mean = 0.5 * sum(case.speeds_m_s)
    return int(case.gratings * minutes * 60 * mean / (2 * np.pi * RADIUS_M))


def _lines(time_s: np.ndarray, wavelengths_nm: np.ndarray) -> bytes:
    """Rows of text, every number with four decimals; a lost peak is blank."""
    values = np.column_stack([time_s, wavelengths_nm])
    lost = np.isnan(values)
    counts = np.rint(np.where(lost, 0.0, values) * 1e4).astype(np.int64)
    text = np.empty((*counts.shape, 10), np.uint8)
    for place in (8, 7, 6, 5, 3, 2, 1, 0):
        counts, digit = np.divmod(counts, 10)
        text[:, :, place] = digit + 48
    text[:, :, 4], text[:, :, 9] = ord("."), ord(",")
    text[:, -1, 9] = ord("\n")
    for place, least in ((0, 1000.0), (1, 100.0), (2, 10.0)):  # stamps without leading zeros
        text[time_s < least, 0, place] = 0
    text[:, :, :9][lost] = 0
    return text[text != 0].tobytes()
