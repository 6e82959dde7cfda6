"""The `inflation` table: one row per ramp and stop of each strain channel, and one for the whole.

Recording --no drive, no strain that goes to and fro--> `inflation` --> columns, sentences
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from tirelog.data.recording import Channel, Recording
from tirelog.errors import UsageError
from tirelog.strain.channels import strain_channels
from tirelog.strain.inflation import Inflation, InflationSeries, inflation
from tirelog.strain.passages.find import find_passages
from tirelog.vocabulary.quality import Quality, marked, quality_column

#: whole turns from which a log is a drive: two may be a kink of the filling and its leaks
FEWEST_TURNS = 3
#: radius [m] that tells turns if the setup has none: only whether there are any matters
ANY_RADIUS_M = 0.3
#: way of the strain over its range, and stretches that are needed to say so.  Filling with leaks at
#: stops: 1.1, filling and emptying: 2; vibration: 10.  Twice as much would take some of that for a
#: test
MOST_TO_AND_FRO, FEWEST_STRETCHES = 4.0, 8


@dataclass(frozen=True)
class InflationOfChannel:
    """One channel: its stretches, the means behind them, the table's columns, sentences on it."""

    channel: Channel
    inflation: Inflation
    series: InflationSeries
    columns: dict[str, Any]
    remarks: tuple[str, ...]


def refuse_one_end(from_Pa: float | None = None, to_Pa: float | None = None) -> None:
    """UsageError for one end of a ramp without the other, or two that are the same."""
    if (from_Pa, to_Pa) != (None, None) and (None in (from_Pa, to_Pa) or from_Pa == to_Pa):
        raise UsageError(
            "--from and --to (from_Pa and to_Pa) go together and differ",
            allowed="allowed are two pressures in Pa",
            do="e.g. --from 1.7e5 --to 2.3e5",
        )


def inflation_of(
    recording: Recording, from_Pa: float | None = None, to_Pa: float | None = None
) -> Iterator[InflationOfChannel]:
    """The static test of each strain channel of `recording`.

    `from_Pa` and `to_Pa`: inflation pressures [Pa] at both ends of a ramp that no channel records.
    """
    refuse_one_end(from_Pa, to_Pa)
    ends_Pa = None if from_Pa is None or to_Pa is None else (from_Pa, to_Pa)
    pressures = recording.of_kind("inflation_pressure")
    pressure = pressures[0] if pressures else None
    for channel in strain_channels(recording):
        _refuse_drive(recording, channel)
        found, values = inflation(channel, pressure, ends_Pa)
        _refuse_to_and_fro(recording, channel, found)
        n = found.stretch.size
        columns: dict[str, Any] = {
            "log": np.full(n, recording.log, object),
            "channel": np.full(n, channel.name, object),
            "revolution": np.full(n, np.nan),
            "time_s": found.time_s,
            "speed_m_s": np.zeros(n),
            "stretch": found.stretch,
            "duration_s": found.duration_s,
            "inflation_pressure_Pa": found.pressure_Pa,
            "pressure_change_Pa": found.pressure_change_Pa,
            "strain": found.strain,
            "strain_se": found.strain_se,
            "strain_change": found.strain_change,
            "strain_slope_1_Pa": found.slope_1_Pa,
            "strain_slope_se_1_Pa": found.slope_se_1_Pa,
            "strain_rate_1_s": found.rate_1_s,
            "nonlinearity": found.nonlinearity,
            "leak": found.leak,
            "leak_se": found.leak_se,
            "quality": quality_column(
                marked((found.leak != 0) & ~np.isnan(found.leak), Quality.LEAK)
            ),
        }
        yield InflationOfChannel(
            channel, found, values, columns, _remarks(recording, channel, found, pressure, ends_Pa)
        )


def _refuse_drive(recording: Recording, channel: Channel) -> None:
    """UsageError if the wheel turns: what a passage does to the strain is no ramp and no stop."""
    radius = (
        recording.setup.tire.rolling_radius_m
        or recording.setup.tire.unloaded_radius_m
        or ANY_RADIUS_M
    )
    passages = find_passages(channel, radius)
    if passages.turn_after.sum() >= FEWEST_TURNS:
        raise UsageError(
            f"no inflation test: the wheel turns, {channel.name} passes the patch {len(passages)}"
            " times",
            allowed="allowed is a log of a tire at rest while it is filled or emptied",
            do="use `tirelog speed` for this one",
            file=recording.log,
        )


def _refuse_to_and_fro(recording: Recording, channel: Channel, found: Inflation) -> None:
    """UsageError if the strain goes up and down.

    Filling or emptying takes it one way, apart from leaks.
    """
    change = found.strain_change
    way, most = (
        float(np.abs(change[1:]).sum()),
        float(np.ptp(np.concatenate([[0.0], np.cumsum(change[1:])]))),
    )
    if change.size - 1 >= FEWEST_STRETCHES and way > MOST_TO_AND_FRO * most:
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
    found: Inflation,
    pressure: Channel | None,
    ends_Pa: tuple[float, float] | None,
) -> tuple[str, ...]:
    """What the summary says of a channel."""
    ramps = int((found.stretch == "ramp").sum())
    leaks = found.leak[np.nan_to_num(found.leak) != 0]
    text = f"{channel.name}: {ramps} ramp(s), {int((found.stretch == 'stop').sum())} stop(s)"
    if np.isfinite(found.slope_1_Pa[0]):
        text += (
            f"; {1e11 * found.slope_1_Pa[0]:.2f} microstrain/bar, straight to "
            f"{100 * found.nonlinearity[0]:.1f} % of the range"
        )
    if leaks.size:
        text += (
            f"; strain lost at stops {', '.join(f'{1e6 * leak:.1f}' for leak in leaks)} microstrain"
        )
    remarks = [text]
    if pressure is None and ends_Pa is None:
        remarks.append(
            "no inflation_pressure channel: rates in time only; name one in the setup, or give "
            "--from and --to in Pa"
        )
    static = recording.setup.tire.static_footprint_length_m
    if static is not None:
        remarks.append(f"static footprint of the setup: {1e3 * static:.1f} mm")
    return tuple(remarks)
