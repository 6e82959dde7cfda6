"""The table `inflation` of a recording: a row a stretch of each strain channel, with remarks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from tirelog.estimators.inflation import Inflation, Series, inflation
from tirelog.estimators.strain_channels import strain_channels
from tirelog.recording import Channel, Recording


@dataclass(frozen=True)
class InflationOfChannel:
    """One channel: its stretches, the means behind them, the table's columns, sentences on it."""

    channel: Channel
    inflation: Inflation
    series: Series
    columns: dict[str, Any]
    remarks: tuple[str, ...]


def inflation_of(recording: Recording, ends_Pa: tuple[float, float] | None = None) -> Iterator[InflationOfChannel]:
    """The static test of each strain channel of `recording`."""
    pressures = recording.of_kind("inflation_pressure")
    pressure = pressures[0] if pressures else None
    for channel in strain_channels(recording):
        found, values = inflation(channel, pressure, ends_Pa)
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
            "quality": np.array(["leak" if lost != 0 and lost == lost else "ok" for lost in found.leak], object),
        }
        yield InflationOfChannel(channel, found, values, columns, _remarks(recording, channel, found, pressure, ends_Pa))


def _remarks(
    recording: Recording, channel: Channel, found: Inflation, pressure: Channel | None, ends_Pa: tuple[float, float] | None
) -> tuple[str, ...]:
    """What the summary says of a channel."""
    ramps = int((found.stretch == "ramp").sum())
    leaks = found.leak[np.nan_to_num(found.leak) != 0]
    text = f"{channel.name}: {ramps} ramp(s), {int((found.stretch == 'stop').sum())} stop(s)"
    if np.isfinite(found.slope_1_Pa[0]):
        text += f"; {1e11 * found.slope_1_Pa[0]:.2f} microstrain/bar, straight to {100 * found.nonlinearity[0]:.1f} % of the range"
    if leaks.size:
        text += f"; strain lost at stops {', '.join(f'{1e6 * leak:.1f}' for leak in leaks)} microstrain"
    remarks = [text]
    if pressure is None and ends_Pa is None:
        remarks.append("no inflation_pressure channel: rates in time only; name one in the setup, or give --from and --to in Pa")
    static = recording.setup.tire.static_footprint_length_m
    if static is not None:
        remarks.append(f"static footprint of the setup: {1e3 * static:.1f} mm")
    return tuple(remarks)
