"""Clean logs with one fault or two: which numbers are wrong and marked `ok`.

    world (tire, drive, sensors, seed) --simulate--> clean log, truth of each passage
        --a fault--> CSV, setup --the commands' tables--> rows
        --beside the truth--> rows `ok`, wrong and `ok`, marked, missing

`python -m benchmarks.faults [--suite tuning|reporting] [--logs N] [--seed S] [--only FAULT]
[--both N] [--keep FILE.csv]`, or `--again tests/faults/faulty_logs.csv`, which counts the faults of
the table that the tests hold.

A number is wrong if it is off by more than five of its errors and by more than its table's least
(1 % of a speed, a length, a factor; 0.002 of a slip; 0.1 degrees of a phase shift, whose zero is a
convention: what the rows of a log are off alike counts for nothing). A row is found by its time;
one that is no passage of the truth is wrong as well. The suites differ in tires, drives and seeds.
"""

from __future__ import annotations

import argparse
import secrets
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import tirelog
from benchmarks.cases import planted
from benchmarks.wheel_cases import wheel_scenario
from tirelog.simulation.scenario.schema import Manoeuvre, Road, Scenario, Sensor, TrueTire
from tirelog.simulation.simulate import Simulated, setup_text, simulate
from tirelog.vocabulary.arrays import FloatArray

Random = np.random.Generator
#: a wrong number is off by more than so many of its own errors
MOST_SIGMAS = 5.0


@dataclass(frozen=True)
class Log:
    """A log before it is written: stamps (n,) [s], values (n,) by column, text of its setup.

    `true_s` (n,): when each row was measured by the clock of the truth.
    """

    time_s: FloatArray
    true_s: FloatArray
    columns: dict[str, FloatArray]
    setup: str
    stamped: bool = True

    @property
    def rate_Hz(self) -> float:
        return 1.0 / float(np.median(np.diff(self.time_s)))

    def put(self, column: str, values: FloatArray) -> Log:
        return replace(self, columns={**self.columns, column: values})

    def kept(self, rows: FloatArray) -> Log:
        """The log of these rows, in this order."""
        columns = {name: values[rows] for name, values in self.columns.items()}
        return replace(self, time_s=self.time_s[rows], true_s=self.true_s[rows], columns=columns)


Fault = Callable[[Log, Random], Log]


# ---- The faults: each takes a log and gives another.


def _ranges(log: Log, random: Random, count: int, ms: tuple[float, float]) -> list[slice]:
    """So many stretches of the log, of these lengths, that do not touch."""
    n, out = log.time_s.size, []
    for part in np.array_split(np.arange(n), count):
        size = max(int(random.uniform(*ms) * 1e-3 * log.rate_Hz), 1)
        first = int(random.integers(part[0] + 2, max(part[-1] - size - 2, part[0] + 3)))
        out.append(slice(first, min(first + size, n - 1)))
    return out


def _extent(values: FloatArray) -> float:
    """The range of a signal, without its rarest samples."""
    low, high = np.nanpercentile(values, [0.05, 99.95])
    return float(high - low)


def stretches(
    log: Log, random: Random, *, column: str, count: int, ms: tuple[float, float], how: Any
) -> Log:
    """Stretches of one channel lost, held, interpolated, or a code: `how` is a word or a number."""
    values = log.columns[column].copy()
    for part in _ranges(log, random, count, ms):
        if how == "lost":
            values[part] = np.nan
        elif how == "held":
            values[part] = values[part.start - 1]
        elif how == "interpolated":
            size = part.stop - part.start
            values[part] = np.linspace(values[part.start - 1], values[part.stop], size + 2)[1:-1]
        else:
            values[part] = how
    return log.put(column, values)


def spikes(
    log: Log, random: Random, *, column: str, count: int, samples: int, heights: tuple[float, float]
) -> Log:
    """Spikes of so many samples and heights in ranges of the signal, of either sign."""
    values = log.columns[column].copy()
    extent = _extent(values)
    for first in random.choice(values.size - samples, count, replace=False):
        height = random.uniform(*heights) * extent * random.choice([-1.0, 1.0])
        values[first : first + samples] += height * random.uniform(0.7, 1.0, samples)
    return log.put(column, values)


def hops(
    log: Log, random: Random, *, column: str, count: int, height: float, ms: tuple[float, float]
) -> Log:
    """The level moves by ranges of the signal for some milliseconds, or for good with (0, 0)."""
    values = log.columns[column].copy()
    extent = _extent(values)
    for part in _ranges(log, random, count, ms if ms[1] else (1.0, 1.0)):
        stop = part.stop if ms[1] else values.size
        values[part.start : stop] += height * extent * random.choice([-1.0, 1.0])
    return log.put(column, values)


def clipped(log: Log, random: Random, *, column: str, share: float, low: bool = True) -> Log:
    """What lies beyond a share of the pulse's height, below or above the usual level, is cut."""
    values = log.columns[column]
    usual = np.nanmedian(values)
    limit = usual + share * (np.nanpercentile(values, 0.02 if low else 99.98) - usual)
    cut = np.maximum(values, limit) if low else np.minimum(values, limit)
    return log.put(column, cut)


def steps(log: Log, random: Random, *, column: str, share: float) -> Log:
    """Quantisation by a share of the signal's range."""
    step = share * _extent(log.columns[column])
    return log.put(column, np.round(log.columns[column] / step) * step)


def hum(log: Log, random: Random, *, column: str, hertz: float, share: float) -> Log:
    """A sine of an amplitude in ranges of the signal."""
    phase = random.uniform(0.0, 2.0 * np.pi)
    wave = np.sin(2.0 * np.pi * hertz * log.time_s + phase)
    return log.put(column, log.columns[column] + share * _extent(log.columns[column]) * wave)


def walk(log: Log, random: Random, *, column: str, share: float) -> Log:
    """A random walk that ends about a share of the signal's range away."""
    values = log.columns[column]
    steps_ = random.standard_normal(values.size) / np.sqrt(values.size)
    return log.put(column, values + share * _extent(values) * np.cumsum(steps_))


def gain(log: Log, random: Random, *, column: str, factor: float) -> Log:
    """From the middle on the channel shows a part of what it should: its sensor comes loose."""
    values = log.columns[column].copy()
    middle = values.size // 2
    usual = np.nanmedian(values)
    values[middle:] = usual + factor * (values[middle:] - usual)
    return log.put(column, values)


def noise(log: Log, random: Random, *, column: str, share: float) -> Log:
    """White noise of a share of the signal's range."""
    values = log.columns[column]
    more = share * _extent(values) * random.standard_normal(values.size)
    return log.put(column, values + more)


def bursts(
    log: Log,
    random: Random,
    *,
    column: str,
    count: int,
    ms: tuple[float, float],
    heights: tuple[float, float],
) -> Log:
    """Bursts of an electric disturbance: a decaying oscillation."""
    values = log.columns[column].copy()
    extent = _extent(values)
    for part in _ranges(log, random, count, ms):
        at = np.arange(part.stop - part.start)
        wave = np.exp(-3.0 * at / at.size) * np.cos(random.uniform(0.5, 2.5) * at)
        values[part] += random.uniform(*heights) * extent * wave
    return log.put(column, values)


def smoothed(log: Log, random: Random, *, column: str, samples: int) -> Log:
    """A running mean of so many samples: an instrument of less bandwidth."""
    kernel = np.full(samples, 1.0 / samples)
    return log.put(column, np.convolve(log.columns[column], kernel, "same"))


def repeated(log: Log, random: Random, *, column: str, share: float) -> Log:
    """A share of the samples are the one before."""
    values = log.columns[column].copy()
    for at in np.sort(random.choice(values.size - 1, int(share * values.size), replace=False)) + 1:
        values[at] = values[at - 1]
    return log.put(column, values)


def slower(log: Log, random: Random, *, column: str, times: int) -> Log:
    """The instrument gives every so-manieth sample, and the logger holds it."""
    at = np.arange(log.time_s.size) // times * times
    return log.put(column, log.columns[column][at])


def swapped(log: Log, random: Random, *, one: str, other: str) -> Log:
    """Two columns change places from the middle on."""
    a, b = log.columns[one].copy(), log.columns[other].copy()
    middle = a.size // 2
    a[middle:], b[middle:] = log.columns[other][middle:], log.columns[one][middle:]
    return log.put(one, a).put(other, b)


def rows_gone(
    log: Log, random: Random, *, count: int, ms: tuple[float, float], renumbered: bool = False
) -> Log:
    """Rows that the logger dropped; `renumbered`: their stamps go on as if there were none."""
    kept = np.ones(log.time_s.size, bool)
    for part in _ranges(log, random, count, ms):
        kept[part] = False
    cut = log.kept(np.flatnonzero(kept))
    return replace(cut, time_s=log.time_s[: cut.time_s.size]) if renumbered else cut


def rows_swapped(log: Log, random: Random, *, count: int) -> Log:
    """Neighbouring rows that change places."""
    order = np.arange(log.time_s.size)
    for at in random.choice(order.size // 2 - 1, count, replace=False) * 2:
        order[at], order[at + 1] = order[at + 1], order[at]
    return log.kept(order)


def jitter(log: Log, random: Random, *, ms: float, rate: bool) -> Log:
    """Stamps that scatter about the samples' true times; with or without the rate in the setup."""
    time = np.sort(log.time_s + 1e-3 * ms * random.standard_normal(log.time_s.size))
    return replace(log, time_s=time, setup=log.setup if rate else _without_rate(log.setup))


def clock(log: Log, random: Random, *, fast: float, seconds: float, count: int) -> Log:
    """The stamps run fast by a share for some seconds, so many times."""
    step = np.diff(log.time_s, prepend=log.time_s[0])
    for part in _ranges(log, random, count, (1e3 * seconds, 1e3 * seconds)):
        step[part] *= 1.0 - fast
    return replace(log, time_s=np.cumsum(step), setup=_without_rate(log.setup))


def stalls(log: Log, random: Random, *, count: int, ms: tuple[float, float]) -> Log:
    """The clock stands still for some milliseconds and then catches up."""
    time = log.time_s.copy()
    for part in _ranges(log, random, count, ms):
        time[part] = time[part.start]
    return replace(log, time_s=time)


def _without_rate(setup: str) -> str:
    return "\n".join(line for line in setup.splitlines() if "sampling_rate_Hz" not in line) + "\n"


def setup_says(log: Log, random: Random, *, old: str, new: str) -> Log:
    """The setup has something else than what was measured."""
    if old not in log.setup:
        raise ValueError(f"the setup has no {old!r}")
    return replace(log, setup=log.setup.replace(old, new))


def wrong_rate(log: Log, random: Random, *, factor: float) -> Log:
    """No stamps, and a rate in the setup that is not the instrument's."""
    rate = f"sampling_rate_Hz = {log.rate_Hz:g}"
    new = f"sampling_rate_Hz = {factor * log.rate_Hz:g}"
    setup = log.setup.replace(rate, new).replace('time = "time_s"\n', "")
    time = np.arange(log.true_s.size) / (factor * log.rate_Hz)
    return replace(log, time_s=time, stamped=False, setup=setup)


def scaled(log: Log, random: Random, *, column: str, factor: float) -> Log:
    """The channel in another unit than the setup's."""
    return log.put(column, factor * log.columns[column])


STRAIN, TWIN, SPEED = "strain_1", "temp_1", "vehicle_speed"
ENCODER, ACCELERATION = "encoder", "acceleration"
_SHORT, _LONG = (1.0, 4.0), (5.0, 60.0)


def _of(column: str) -> dict[str, Fault]:
    """What may happen to any channel that is sampled quickly."""
    on = partial(partial, column=column)
    return {
        "lost 1-4 ms x40": on(stretches, count=40, ms=_SHORT, how="lost"),
        "lost 5-60 ms x20": on(stretches, count=20, ms=_LONG, how="lost"),
        "held 1-4 ms x40": on(stretches, count=40, ms=_SHORT, how="held"),
        "held 5-60 ms x20": on(stretches, count=20, ms=_LONG, how="held"),
        "interpolated 2-10 ms x40": on(stretches, count=40, ms=(2.0, 10.0), how="interpolated"),
        "interpolated 5-60 ms x20": on(stretches, count=20, ms=_LONG, how="interpolated"),
        "code 9999 x60": on(stretches, count=60, ms=(0.0, 0.0), how=9999.0),
        "code -999.25 10-40 ms x20": on(stretches, count=20, ms=(10.0, 40.0), how=-999.25),
        "code 9999 0.3 s x5": on(stretches, count=5, ms=(300.0, 300.0), how=9999.0),
        "zero 10-40 ms x20": on(stretches, count=20, ms=(10.0, 40.0), how=0.0),
        "spikes 0.3-1 x60": on(spikes, count=60, samples=1, heights=(0.3, 1.0)),
        "spikes 1-2 x60": on(spikes, count=60, samples=1, heights=(1.0, 2.0)),
        "spikes 3-10 x60": on(spikes, count=60, samples=1, heights=(3.0, 10.0)),
        "spikes of 3 samples 0.3-2 x40": on(spikes, count=40, samples=3, heights=(0.3, 2.0)),
        "bursts 6 ms x20": on(bursts, count=20, ms=(6.0, 6.0), heights=(0.5, 2.0)),
        "bursts 20 ms x15": on(bursts, count=15, ms=(15.0, 25.0), heights=(0.3, 1.0)),
        "hops for good 0.1 x5": on(hops, count=5, height=0.1, ms=(0.0, 0.0)),
        "hops for good 1 x5": on(hops, count=5, height=1.0, ms=(0.0, 0.0)),
        "hops 20-200 ms 0.3 x15": on(hops, count=15, height=0.3, ms=(20.0, 200.0)),
        "hops 20-200 ms 2 x15": on(hops, count=15, height=2.0, ms=(20.0, 200.0)),
        "noise 0.05": on(noise, share=0.05),
        "steps 0.01": on(steps, share=0.01),
        "steps 0.05": on(steps, share=0.05),
        "steps 0.2": on(steps, share=0.2),
        "hum 50 Hz 0.03": on(hum, hertz=50.0, share=0.03),
        "hum 50 Hz 0.15": on(hum, hertz=50.0, share=0.15),
        "hum 400 Hz 0.05": on(hum, hertz=400.0, share=0.05),
        "walk 0.5": on(walk, share=0.5),
        "gain 0.5 from the middle": on(gain, factor=0.5),
        "clipped below at 0.5": on(clipped, share=0.5),
        "clipped below at 0.8": on(clipped, share=0.8),
        "clipped above at 0.5": on(clipped, share=0.5, low=False),
        "mean of 7 samples": on(smoothed, samples=7),
        "repeated 0.1": on(repeated, share=0.1),
        "a quarter of the rate, held": on(slower, times=4),
    }


#: what may happen to a log as a whole
WHOLE: dict[str, Fault] = {
    "none": lambda log, random: log,
    "rows gone 1-4 ms x10": partial(rows_gone, count=10, ms=_SHORT),
    "rows gone 5-60 ms x20": partial(rows_gone, count=20, ms=_LONG),
    "rows gone 1-4 ms x10, renumbered": partial(rows_gone, count=10, ms=_SHORT, renumbered=True),
    "rows gone 5-60 ms x10, renumbered": partial(rows_gone, count=10, ms=_LONG, renumbered=True),
    "rows swapped x40": partial(rows_swapped, count=40),
    "stamps jitter 0.1 ms": partial(jitter, ms=0.1, rate=False),
    "stamps jitter 0.4 ms": partial(jitter, ms=0.4, rate=False),
    "stamps jitter 0.4 ms, rate known": partial(jitter, ms=0.4, rate=True),
    "clock 20 % fast 1 s x3": partial(clock, fast=0.2, seconds=1.0, count=3),
    "clock stalls 5-60 ms x10": partial(stalls, count=10, ms=_LONG),
    "rate 0.8": partial(wrong_rate, factor=0.8),
}
_TWIN = (
    "lost 5-60 ms x20", "held 5-60 ms x20", "code 9999 x60", "spikes 0.3-1 x60", "spikes 3-10 x60",
    "hops for good 1 x5", "hops 20-200 ms 2 x15", "steps 0.2", "hum 50 Hz 0.15", "walk 0.5",
)  # fmt: skip
_VEHICLE = (*_TWIN, "held 5-60 ms x20", "gain 0.5 from the middle", "noise 0.05")


def _chosen(column: str, names: Iterable[str]) -> dict[str, Fault]:
    return {f"{column}: {name}": _of(column)[name] for name in names}


#: by kind of log: fault -> what it does
FAULTS: dict[str, dict[str, Fault]] = {
    "strain": {
        **WHOLE,
        **{f"{STRAIN}: {name}": fault for name, fault in _of(STRAIN).items()},
        **_chosen(TWIN, _TWIN),
        **_chosen(SPEED, _VEHICLE),
        "columns swapped from the middle": partial(swapped, one=STRAIN, other=TWIN),
        "vehicle speed in km/h": partial(scaled, column=SPEED, factor=3.6),
        "radius 0.27 for 0.305": partial(
            setup_says, old="rolling_radius_m = 0.305", new="rolling_radius_m = 0.27"
        ),
    },
    "wheel": {
        **{name: fault for name, fault in WHOLE.items() if "jitter 0." not in name},
        **{f"{ACCELERATION}: {name}": fault for name, fault in _of(ACCELERATION).items()},
        **{f"{ENCODER}: {name}": fault for name, fault in _of(ENCODER).items()},
        **_chosen(SPEED, _VEHICLE),
        "rows of the encoder late 2 ms": lambda log, random: log.put(
            ENCODER, np.roll(log.columns[ENCODER], int(0.002 * log.rate_Hz))
        ),
    },
}


# ---- The worlds.


def _strain_world(number: int, reporting: bool) -> Scenario:
    """A drive of about 20 s; the worlds of the two suites differ in tire, drive and seed."""
    random = np.random.default_rng((90_000 if reporting else 10_000) + number)
    tires = (
        {"truth": "ring"},
        {"truth": "beam", "effects": planted(("torsion", "exit_suction"))},
        {"truth": "ring", "effects": planted(("even_bulge",))},
    )
    world: dict[str, Any] = tires[number % 3] if reporting else {"truth": "beam"}
    speeds = random.uniform(8.0, 24.0, 3) if reporting else (10.0, 18.0, 13.0)
    parts = []
    for speed in speeds:
        parts += [Manoeuvre(2.0, float(speed)), Manoeuvre(5.0, float(speed))]
    common: dict[str, Any] = {"sampling_rate_Hz": 2500.0, "angle_deg": 150.0}
    return Scenario(
        manoeuvres=tuple(parts),
        channels={
            STRAIN: Sensor(
                "fbg_strain",
                temperature_channel=TWIN,
                noise=0.0008,
                quantisation=1e-4,
                surface="outer",
                thermal_expansion_1_K=2e-5,
                **common,
            ),
            TWIN: Sensor(
                "fbg_temperature",
                reference_wavelength_nm=1542.0,
                noise=0.0008,
                quantisation=1e-4,
                **common,
            ),
            SPEED: Sensor("vehicle_speed", noise=0.02, sampling_rate_Hz=2500.0),
        },
        tire=TrueTire(static_footprint_length_m=0.126),
        road=Road(0.01, 2.0, 0.0),
        seed=int(random.integers(2**31)),
        **world,
    )


def wheel_world(number: int, reporting: bool) -> Scenario:
    """A wheel with encoder and accelerometer, both and the vehicle's speed at 10 kHz."""
    seed = (95_000 if reporting else 15_000) + number
    made = wheel_scenario("ramp" if reporting else "dynamic", seed=seed)
    random = np.random.default_rng(seed)
    speeds = random.uniform(8.0, 22.0, 3) if reporting else (10.0, 20.0, 12.0)
    parts = []
    for speed in speeds:
        parts += [Manoeuvre(2.0, float(speed)), Manoeuvre(3.0, float(speed))]
    fast = {ENCODER: made.channels[ENCODER], ACCELERATION: made.channels[ACCELERATION]}
    speed_ = Sensor("vehicle_speed", noise=0.02, sampling_rate_Hz=1e4)
    return replace(made, manoeuvres=tuple(parts), channels={**fast, SPEED: speed_})


def log_of(simulated: Simulated) -> Log:
    """The clean log."""
    sources = {name: name for name in simulated.scenario.channels}
    setup = setup_text(simulated.scenario, sources, "time_s")
    stamp = next(iter(simulated.stamp_s.values()))
    return Log(np.asarray(stamp), np.asarray(stamp), dict(simulated.channels), setup)


def written(log: Log, folder: Path) -> Path:
    path = folder / "log.csv"
    stamps = {"time_s": log.time_s} if log.stamped else {}
    pd.DataFrame({**stamps, **log.columns}).to_csv(path, index=False, float_format="%.7f")
    path.with_suffix(".toml").write_text(log.setup, encoding="utf-8")
    return path


# ---- What comes of it.


@dataclass(frozen=True)
class Meaning:
    """What a table's number is: its column, its error columns, its name in the truth, its least
    error that counts, and whether that is a share of the truth.

    `anywhere`: rows need not be passages of the truth; `relative_to_zero`: what all rows are off
    alike is a convention.
    """

    number: str
    errors: tuple[str, ...]
    truth: str
    least: float
    is_share: bool = True
    anywhere: bool = False
    relative_to_zero: bool = False


_SPEED = Meaning("speed_m_s", ("speed_se_m_s",), "speed_m_s", 0.01)
_FACTOR = "dissipation_factor_1_m"
#: kind of log: table -> what its number is
TABLES: dict[str, dict[str, Meaning]] = {
    "strain": {
        "speed": _SPEED,
        "footprint": Meaning(
            "length_m", ("length_se_m", "length_form_se_m"), "contact_length_m", 0.01
        ),
        "dissipation": Meaning(_FACTOR, ("dissipation_factor_se_1_m",), _FACTOR, 0.01),
        "slip": Meaning("slip", ("slip_se",), "slip", 0.002, is_share=False),
    },
    "wheel": {
        # an encoder's turns begin anywhere, and lie between the passages
        "speed": replace(_SPEED, anywhere=True),
        # a log's zero is its first low constant speed, another one if a fault lies there
        "phase_shift": Meaning(
            "phase_shift_deg", ("phase_shift_se_deg",), "phase_shift_deg", 0.1,
            is_share=False, relative_to_zero=True,
        ),
    },
}  # fmt: skip


@dataclass
class Count:
    """Rows of one table under one fault, of so many passages of the truth; `worst`: the largest
    error that counts, in units of the least; `refused`: logs that gave no table; `covered`: rows
    `ok` within one and two of their errors.
    """

    passages: int = 0
    ok: int = 0
    wrong: int = 0
    marked: int = 0
    refused: int = 0
    worst: float = 0.0
    covered: tuple[int, int] = (0, 0)

    def add(self, other: Count) -> None:
        self.passages += other.passages
        self.ok += other.ok
        self.wrong += other.wrong
        self.marked += other.marked
        self.refused += other.refused
        self.worst = max(self.worst, other.worst)
        one, two = np.add(self.covered, other.covered)
        self.covered = (int(one), int(two))


def judged(log: Log, rows: pd.DataFrame, truth: dict[str, FloatArray], table: Meaning) -> Count:
    """One table of a log beside the truth."""
    count = Count(passages=truth["time_s"].size)
    values = rows[table.number].to_numpy(float)
    ok = (rows["quality"] == "ok").to_numpy() & np.isfinite(values)
    count.ok, count.marked = int(ok.sum()), int((~ok).sum())
    if not ok.any():
        return count
    # the place of a row among those of the log, whose stamps may jump and repeat
    order = np.argsort(log.time_s, kind="stable")
    time = np.interp(rows["time_s"].to_numpy(float)[ok], log.time_s[order], log.true_s[order])
    after = np.clip(np.searchsorted(truth["time_s"], time), 1, truth["time_s"].size - 1)
    nearer = time - truth["time_s"][after - 1] < truth["time_s"][after] - time
    at = after - nearer
    right = truth[table.truth][at]
    if table.anywhere:
        right = np.interp(time, truth["time_s"], truth[table.truth])
    errors = [rows[e].to_numpy(float)[ok] for e in table.errors if e in rows]
    se = np.sqrt(sum(np.nan_to_num(error) ** 2 for error in errors))
    off = values[ok] - right
    off = np.abs(off - np.median(off) if table.relative_to_zero else off)
    unit = table.least * (np.abs(right) if table.is_share else 1.0)
    wrong = (off > MOST_SIGMAS * se) & (off > unit)
    if not table.anywhere:  # a row half a turn from any passage is no passage
        wrong |= np.abs(time - truth["time_s"][at]) > 0.3 * np.median(np.diff(truth["time_s"]))
    count.wrong = int(wrong.sum())
    count.covered = (int(np.sum(off < se)), int(np.sum(off < 1.96 * se)))
    count.worst = float((off / unit)[wrong].max(initial=0.0))
    return count


def _run(kind: str, number: int, reporting: bool, names: list[str], seed: int) -> list[Any]:
    """[(fault, table, Count)] of one world."""
    world = (_strain_world if kind == "strain" else wheel_world)(number, reporting)
    simulated = simulate(world)
    passages = simulated.truth["channels"][STRAIN if kind == "strain" else ACCELERATION]["passages"]
    truth = {key: np.array(value, float) for key, value in passages.items()}
    log, out = log_of(simulated), []
    for name in names:
        random = np.random.default_rng([seed, number, sum(map(ord, name))])
        faulty = log
        for part in name.split(" + "):
            faulty = FAULTS[kind][part](faulty, random)
        with tempfile.TemporaryDirectory(prefix="faults-") as folder:
            path = written(faulty, Path(folder))
            for table, meaning in TABLES[kind].items():
                try:
                    made = getattr(tirelog, table)(path)
                    rows = made if isinstance(made, pd.DataFrame) else made[0]
                    count = judged(faulty, rows, truth, meaning)
                except tirelog.TirelogError:
                    count = Count(passages=truth["time_s"].size, refused=1)
                out.append((name, table, count))
    return out


def counted(
    kind: str, suite: str, logs: int, names: list[str], seed: int, processes: int = 2
) -> dict[tuple[str, str], Count]:
    """(fault, table) -> the counts of so many worlds."""
    total: dict[tuple[str, str], Count] = {}
    with ProcessPoolExecutor(processes) as pool:
        jobs = [
            pool.submit(_run, kind, number, suite == "reporting", names[part::2], seed)
            for number in range(logs)
            for part in range(2)
        ]
        for job in jobs:
            for name, table, count in job.result():
                total.setdefault((name, table), Count()).add(count)
    return total


#: what is run for a table that is held
HELD = {"suite": "tuning", "logs": 1, "seed": 9}


def held(path: Path) -> pd.DataFrame:
    """The table of a file, of which `kind`, `fault` and `table` are the index."""
    return pd.read_csv(path).set_index(["kind", "fault", "table"])


def table_of(kinds: dict[str, list[str]], suite: str, logs: int, seed: int) -> pd.DataFrame:
    """The counts of so many logs under the faults of each kind, printed as they come."""
    rows = []
    for kind, names in kinds.items():
        for (name, table), count in counted(kind, suite, logs, names, seed).items():
            rows.append({"kind": kind, "fault": name, "table": table, **vars(count)})
            one, two = (part / max(count.ok, 1) for part in rows[-1].pop("covered"))
            print(
                f"{kind:6s} {name:45s} {table:12s} ok {count.ok:5d} of {count.passages:5d}"
                f"  wrong {count.wrong:5d}  worst {count.worst:9.3g}  marked {count.marked:5d}"
                f"  refused {count.refused}  within 1 and 1.96 errors {one:.2f} {two:.2f}",
                flush=True,
            )
    return pd.DataFrame(rows).set_index(["kind", "fault", "table"])


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.faults", description=__doc__)
    parser.add_argument("--suite", choices=("tuning", "reporting"), default="tuning")
    parser.add_argument("--kind", choices=tuple(FAULTS), action="append")
    parser.add_argument("--logs", type=int, default=3)
    parser.add_argument("--seed", type=int, help="another one each time unless given")
    parser.add_argument("--only", action="append", help="a fault, or a part of its name")
    parser.add_argument("--both", type=int, default=0, help="so many pairs of faults as well")
    parser.add_argument("--keep", type=Path, help="a CSV file for the table")
    parser.add_argument("--again", type=Path, help="a CSV file whose faults are counted anew")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    if asked.again:
        faults = held(asked.again).reset_index().groupby("kind", sort=False)["fault"].unique()
        table = table_of({kind: list(some) for kind, some in faults.items()}, **HELD)
        table.to_csv(asked.again, float_format="%.3g")
        return 0
    seed = secrets.randbelow(2**31) if asked.seed is None else asked.seed
    print(f"seed {seed}, suite {asked.suite}, {asked.logs} logs a fault", flush=True)
    kinds = {}
    for kind in asked.kind or FAULTS:
        names = [n for n in FAULTS[kind] if not asked.only or any(o in n for o in asked.only)]
        random = np.random.default_rng(seed)
        names += [" + ".join(random.choice(names, 2, replace=False)) for _ in range(asked.both)]
        kinds[kind] = names
    table = table_of(kinds, asked.suite, asked.logs, seed)
    wrong, ok = int(table["wrong"].sum()), int(table["ok"].sum())
    print(f"{wrong} of {ok} `ok` rows are wrong: {1e3 * wrong / max(ok, 1):.2f} in 1000")
    if asked.keep:
        table.to_csv(asked.keep)
    return 0


if __name__ == "__main__":
    sys.exit(main())
