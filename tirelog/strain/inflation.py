"""Static test: strain against inflation pressure while the tire is filled (P2 4.1, Fig. 15).

    strain (and pressure) of a log at rest --means of 0.1 s--> series
        --rate of the strain--> ramps and stops
        --straight lines--> slope of each, linearity of the whole, strain lost at the stops (air
                            that leaks past the gauge)

P2 fills from 1.7 to 2.3 bar; the strain grows linearly, and drops a little at the two stops where
the gauge is read. Without a pressure channel only rates in time are known.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from operator import itemgetter
from typing import Any

import numpy as np

from tirelog.data.recording import BLOCK_SAMPLES, Channel, Recording
from tirelog.errors import UsageError
from tirelog.strain.passages.find import find_passages
from tirelog.strain.speed import strain_channels
from tirelog.vocabulary.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    Records,
    TableRows,
    records,
)
from tirelog.vocabulary.quality import Quality, marked, quality_column

#: length of a mean [s], half width of the window that tells the rate [means], shortest ramp or stop
#: [means]
MEAN_S, RATE_MEANS, SHORTEST = 0.1, 3, 5

#: a mean of MEAN_S: time, strain and pressure, NaN without; `noise` of a mean of the strain, the
#: same for all
MEANS = np.dtype(
    [("time_s", "f8"), ("strain", "f8"), ("pressure_Pa", "f8"), ("noise", "f8")]
)  # fmt: skip


def means(channel: Channel) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Times, means and standard errors of `channel` in cells of MEAN_S.

    From the start of the log; NaN if a cell holds nothing.
    """
    start = float(channel.axis.at(0.0)) if channel.size else 0.0
    # span of a log whose means are held in memory [s]: a week takes 150 MB; stamps that jump span
    # centuries
    longest_s = 7 * 86400.0
    if channel.axis.duration_s > longest_s:
        raise UsageError(
            f"{channel.name}: the log spans {channel.axis.duration_s / 86400.0:.3g} days",
            allowed=f"an inflation test of up to {longest_s / 86400.0:g} days is allowed",
            do="give the log of the test alone, or mend its stamps",
        )
    cells = max(int(np.ceil((channel.axis.duration_s + 1.0 / channel.axis.rate_Hz) / MEAN_S)), 1)
    sums, origin = np.zeros((3, cells)), np.nan
    for first, values in channel.blocks(BLOCK_SAMPLES):
        good = np.isfinite(values)
        time, values = channel.axis.time(first, first + values.size)[good], values[good]
        cell = np.clip(((time - start) / MEAN_S).astype(np.int64), 0, cells - 1)
        origin = values[0] if np.isnan(origin) and values.size else origin
        for power in range(3):  # of small numbers, which keep the digits of the squares
            sums[power] += np.bincount(cell, (values - origin) ** power, cells)
    count, total, square = sums
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = total / count
        spread = np.sqrt(np.maximum(square / count - mean**2, 0.0))
    error = spread / np.sqrt(np.maximum(count, 1))
    return start + (np.arange(float(cells)) + 0.5) * MEAN_S, mean + np.nan_to_num(origin), error


def series(strain: Channel, pressure: Channel | None) -> Records:
    """The means of a strain channel with the pressure at the same times, (n,) of MEANS."""
    time, values, error = means(strain)
    known = np.isfinite(values) & np.isfinite(error)  # the square of an absurd value is no number
    if known.sum() < 2 * SHORTEST:
        raise UsageError(
            f"{strain.name}: fewer than {2 * SHORTEST * MEAN_S:g} s of strain",
            allowed="an inflation test lasts seconds",
            do="give the whole log",
        )
    noise = np.median(error[known])
    found = records(
        MEANS, time_s=time[known], strain=values[known], pressure_Pa=np.nan, noise=noise
    )
    if pressure is not None:
        when, level, _ = means(pressure)
        told = np.isfinite(level)
        if told.any():
            found["pressure_Pa"] = np.interp(found["time_s"], when[told], level[told])
    return found


def _rates(values: Records, reach: int) -> FloatArray:
    """Rate of the strain at each mean [1/s], over `reach` means to either side."""
    rise, lasting = (
        one[2 * reach :] - one[: -2 * reach]
        for one in (np.pad(values[name], reach, mode="edge") for name in ("strain", "time_s"))
    )
    return np.asarray(rise / np.maximum(lasting, 1e-9), np.float64)


def inflation_stretches(values: Records) -> tuple[BoolArray, IntArray]:
    """Whether each stretch is a ramp, and the first mean of each, plus the end.

    Short ones go to their neighbours.
    """
    direction = np.sign(values["strain"][-1] - values["strain"][0]) or 1.0
    reach = RATE_MEANS
    # a ramp runs at more than this share of the fast rate, which four fifths of all rates stay
    # below; twice as much cuts the slow ends off a ramp, half as much takes leaks of an eighth of
    # the rate for one
    ramp_share = 0.25
    for _ in range(2):  # the fast rate is known better by the wider window
        rate = _rates(values, reach)
        fast = float(np.quantile(direction * rate, 0.8))
        # standard errors of a rate that the border between ramp and stop is above: the rate is
        # taken over as many means as that needs.  With half as many noise makes ramps of stops
        wider = 5.0 * values["noise"][0] / (np.sqrt(2.0) * MEAN_S * ramp_share * max(fast, 1e-300))
        reach = int(np.clip(np.ceil(wider), RATE_MEANS, max(rate.size // 8, RATE_MEANS)))
    ramp = direction * rate > ramp_share * fast if fast > 0 else np.zeros(rate.size, bool)
    while True:
        edges = np.concatenate([[0], np.flatnonzero(np.diff(ramp)) + 1, [ramp.size]])
        length = np.diff(edges)
        short = int(np.argmin(length))
        if length.size < 2 or length[short] >= SHORTEST:
            return ramp[edges[:-1]], _settled(values, edges) if reach > RATE_MEANS else edges
        ramp = ramp.copy()
        ramp[edges[short] : edges[short + 1]] ^= True


def _line(x: FloatArray, y: FloatArray, noise: float) -> tuple[float, float, float]:
    """Slope, its standard error and largest residual over the range of y.

    The error is of the residuals or of the noise, what is larger; NaN if x does not change.
    """
    if x.size < 3 or not np.isfinite(x).all() or np.ptp(x) <= 0:
        return float("nan"), float("nan"), float("nan")
    centred = x - x.mean()
    slope = float(centred @ y / (centred @ centred))
    residual = y - y.mean() - slope * centred
    scatter = max(float(np.sqrt((residual**2).sum() / (x.size - 2))), noise)
    range_ = float(np.ptp(y))
    return (
        slope,
        scatter / float(np.sqrt(centred @ centred)),
        float(np.abs(residual).max()) / range_ if range_ > 0 else float("nan"),
    )


def _settled(values: Records, edges: IntArray) -> IntArray:
    """`edges` of stretches put to the kinks of the strain, which a wide window sees late."""
    settled = edges.copy()
    for k in range(1, edges.size - 1):
        kinks = _kinked(values[edges[k - 1] : edges[k + 1]], values["time_s"][edges[k : k + 1]])[1]
        place = int(np.searchsorted(values["time_s"], kinks[0]))
        settled[k] = np.clip(place, settled[k - 1] + 1, edges[k + 1] - 1)
    return settled


def _kinked(
    values: Records, kinks_s: FloatArray
) -> tuple[float, FloatArray, FloatArray, FloatArray]:
    """A line with kinks through the means `values`: straight pieces that hang together.

    Its chi-square, the times of its kinks, which start at `kinks_s`, its level at its ends and
    kinks, and the design: columns for its levels, then for the kinks' places.
    """
    time, strain = values["time_s"] - values["time_s"][0], values["strain"]
    kinks, margin = kinks_s - values["time_s"][0], 2.0 * MEAN_S
    # rounds in which the kinks settle; mere numerics
    for _ in range(20):
        nodes = np.concatenate([[0.0], kinks, time[-1:]])
        hats = np.column_stack([np.interp(time, nodes, one) for one in np.eye(nodes.size)])
        level = np.linalg.lstsq(hats, strain, rcond=None)[0]
        slopes = np.diff(level) / np.maximum(np.diff(nodes), 1e-9)
        slope = slopes[np.searchsorted(kinks, time, side="right")]
        design = np.column_stack([hats, -slope[:, None] * hats[:, 1:-1]])
        move = np.linalg.lstsq(design, strain, rcond=None)[0][nodes.size :]
        # no kink passes another, or leaves the means
        fence = np.concatenate([[margin], 0.5 * (kinks[1:] + kinks[:-1]), [time[-1] - margin]])
        kinks = np.clip(kinks + move, fence[:-1], np.maximum(fence[1:], fence[:-1]))
    left = strain - hats @ level
    noise = float(values["noise"][0])
    chi2 = float(left @ left) / noise**2 if noise > 0 else 0.0
    return chi2, kinks + values["time_s"][0], level, design


def _lost(values: Records, before: int, low: int, high: int, after: int) -> tuple[float, float]:
    """(strain lost at the stop [low, high), its standard error); 0 if it is not sure.

    From the kink at which the ramp before ends to that at which the one after begins.  `before` and
    `after` are where the stretches beside the stop begin and end, `low` and `high` without one.
    """
    time, direction = values["time_s"], np.sign(values["strain"][-1] - values["strain"][0]) or 1.0
    # the far ends of the ramps may be some means of the next stop
    off = [min(RATE_MEANS, many // 3) for many in (low - before, after - high)]
    # means of the ramp on either side that a stop's kinks are seen by: so little of a ramp is
    # straight whatever the compressor does; twice as many tell them better, and count on it for 6 s
    beside_stop = 30
    first, stop = max(before + off[0], low - beside_stop), min(after - off[1], high + beside_stop)
    beside = (before < low, after > high)
    edges = [k for k, there in zip((low, high), beside, strict=True) if there]
    part = values[first:stop]
    line = _kinked(part, time[edges])
    if high - low >= 2 * SHORTEST:  # what falls at once and then stays is no straight line
        middles = range(low + 2, high - 1, max((high - low) // SHORTEST, 1))
        lines = [_kinked(part, time[sorted([*edges, k])]) for k in middles]
        bent = min(lines, key=itemgetter(0))
        # what a further kink within a stop must take off chi-square: chance does so once in 10^5
        # stops; half as much, once in 1000
        line = bent if bent[0] < line[0] - 25.0 else line
    _, _, level, design = line
    left = part["strain"] - design[:, : level.size] @ level
    spare = max(left.size - design.shape[1], 1)
    scatter = max(float(part["noise"][0]), float(np.sqrt(left @ left / spare)))
    # the stop begins and ends at a kink, or where the means do
    begin, end = int(beside[0]), level.size - 1 - beside[1]
    inverse = np.linalg.pinv(design)
    lost = float(level[begin] - level[end])
    error = scatter * float(np.linalg.norm(inverse[begin] - inverse[end]))
    # a leak is one that exceeds so many of its standard errors: chance makes none in a million
    # stops; with twice as many, leaks up to twice as large are reported as 0
    return (lost if direction * lost > 5.0 * error else 0.0), error


def _row(
    values: Records, name: str, low: int, high: int, around: tuple[int, int]
) -> dict[str, float | str]:
    """The table's columns of one stretch of the means [low, high).

    `around`: where the stretches beside it begin and end.
    """
    part, noise = values[low:high], float(values["noise"][0])
    time, strain, pressure = part["time_s"], part["strain"], part["pressure_Pa"]
    rate, _, bent = _line(time, strain, noise)
    slope = slope_se = leak = leak_se = float("nan")
    if name == "stop":
        bent = slope
        leak, leak_se = _lost(values, around[0], low, high, around[1])
    elif np.isfinite(pressure).any():
        slope, slope_se, bent = _line(pressure, strain, noise)
    return {
        "stretch": name,
        "time_s": float(time[0] - 0.5 * MEAN_S),
        "duration_s": float(time[-1] - time[0] + MEAN_S),
        "inflation_pressure_Pa": float(pressure.mean()),
        "pressure_change_Pa": float(pressure[-1] - pressure[0]),
        "strain": float(strain.mean()),
        "strain_se": noise / np.sqrt(strain.size),
        "strain_change": float(strain[-1] - strain[0]),
        "strain_slope_1_Pa": slope,
        "strain_slope_se_1_Pa": slope_se,
        "strain_rate_1_s": rate,
        # largest deviation of the strain from its straight line on the pressure (on time, without
        # pressure) as a share of its range
        "nonlinearity": bent,
        "leak": leak,
        "leak_se": leak_se,
    }


def inflation(strain: Channel, pressure: Channel | None) -> tuple[dict[str, Any], Records]:
    """The static test of one strain channel: the table's columns, and the means behind them.

    The rows are the whole, then its ramps and stops.
    """
    values = series(strain, pressure)
    ramps, edges = inflation_stretches(values)
    rows = [_row(values, "whole", 0, values.size, (0, values.size))]
    fences = [0, *edges.tolist(), values.size]
    for k, ramp in enumerate(ramps.tolist()):
        before, low, high, after = fences[k : k + 4]
        rows.append(_row(values, "ramp" if ramp else "stop", low, high, (before, after)))
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}, values


# ---- The `inflation` table: one row per ramp and stop of each strain channel, and one for the
# whole.
#
# Recording --no drive, no strain that goes to and fro--> `inflation` --> columns, sentences


@dataclass(frozen=True)
class InflationOfChannel(TableRows):
    """The table's rows of one channel, and the means behind them."""

    channel: Channel
    series: Records


def inflation_of(recording: Recording) -> Iterator[InflationOfChannel]:
    """The static test of each strain channel of `recording`."""
    pressure = next(iter(recording.of_kind("inflation_pressure")), None)
    for channel in strain_channels(recording):
        _refuse_drive(recording, channel)
        found, values = inflation(channel, pressure)
        _refuse_to_and_fro(recording, channel, found)
        n = found["stretch"].size
        columns: dict[str, Any] = {
            "log": np.full(n, recording.log, object),
            "channel": np.full(n, channel.name, object),
            "revolution": np.full(n, np.nan),
            "time_s": found["time_s"],
            "speed_m_s": np.zeros(n),
            **found,
            "quality": quality_column(marked(np.nan_to_num(found["leak"]) != 0, Quality.LEAK)),
        }
        remarks = _remarks(recording, channel, found, pressure)
        yield InflationOfChannel(columns, remarks, channel, values)


def _refuse_drive(recording: Recording, channel: Channel) -> None:
    """UsageError if the wheel turns: what a passage does to the strain is no ramp and no stop."""
    # radius [m] that tells turns if the setup has none: only whether there are any matters
    radius = recording.setup.tire.rolling_radius_m or recording.setup.tire.unloaded_radius_m or 0.3
    passages = find_passages(channel, radius)
    # whole turns from which a log is a drive: two may be a kink of the filling and its leaks
    if passages.turn_after.sum() >= 3:
        raise UsageError(
            f"no inflation test: the wheel turns, {channel.name} passes the patch {len(passages)}"
            " times",
            allowed="allowed is a log of a tire at rest while it is filled or emptied",
            do="use `tirelog speed` for this one",
            file=recording.log,
        )


def _refuse_to_and_fro(recording: Recording, channel: Channel, found: dict[str, Any]) -> None:
    """UsageError if the strain goes up and down.

    Filling or emptying takes it one way, apart from leaks.
    """
    change = found["strain_change"]
    way, most = (
        float(np.abs(change[1:]).sum()),
        float(np.ptp(np.concatenate([[0.0], np.cumsum(change[1:])]))),
    )
    # way of the strain over its range, and stretches that are needed to say so.  Filling with leaks
    # at stops: 1.1, filling and emptying: 2; vibration: 10.  Twice as much would take some of that
    # for a test
    if change.size - 1 >= 8 and way > 4.0 * most:
        raise UsageError(
            f"no inflation test: the strain of {channel.name} goes up and down, {way / most:.0f}"
            " times its range in all",
            allowed="allowed is a log of a tire at rest while it is filled or emptied",
            do="give that",
            file=recording.log,
        )


def _remarks(
    recording: Recording,
    channel: Channel,
    found: dict[str, Any],
    pressure: Channel | None,
) -> tuple[str, ...]:
    """What the summary says of a channel."""
    names = found["stretch"].tolist()
    leaks = found["leak"][np.nan_to_num(found["leak"]) != 0]
    text = f"{channel.name}: {names.count('ramp')} ramp(s), {names.count('stop')} stop(s)"
    if np.isfinite(found["strain_slope_1_Pa"][0]):
        text += (
            f"; {1e11 * found['strain_slope_1_Pa'][0]:.2f} microstrain/bar, straight to "
            f"{100 * found['nonlinearity'][0]:.1f} % of the range"
        )
    if leaks.size:
        text += (
            f"; strain lost at stops {', '.join(f'{1e6 * leak:.1f}' for leak in leaks)} microstrain"
        )
    static = recording.setup.tire.static_footprint_length_m
    remarks = [text]
    if pressure is None:
        remarks.append(
            "no inflation_pressure channel: rates in time only; name one in the setup, or divide "
            "strain_change by the change of the pressure"
        )
    if static is not None:
        remarks.append(f"static footprint of the setup: {1e3 * static:.1f} mm")
    return tuple(remarks)
