"""The tables of the command `dissipation`.

A row per revolution, its moving averages sorted by speed, and the regressions on speed.

Recording --passages, dissipation--> columns
    --power, force, coefficient if the setup gives what they need--> table
rows of constant speed
    --`dissipation.regression`: lines through the means of their stretches--> regressions
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tirelog.data.recording import BLOCK_SAMPLES, Channel, Recording
from tirelog.runs.in_memory import released
from tirelog.strain.dissipation import (
    AVERAGED,
    COLUMNS,
    STEADY_STEP_M_S,
    Dissipation,
    dissipation,
    regression,
)
from tirelog.strain.passages.find import Passages
from tirelog.strain.speed import PassageRows, begin, speed_quality
from tirelog.vocabulary.arrays import FloatArray, IntArray
from tirelog.vocabulary.quality import good, quality_column

#: distance from the neutral axis, in heights of the strip, at which P1 (27) is right in pure
#: bending: 12 (y/h)^2 = 1
RIGHT_LEVER = 12.0**-0.5


@dataclass(frozen=True)
class DissipationOfChannel(PassageRows):
    """The table's rows of one channel, and the dissipation behind them."""

    dissipation: Dissipation


def dissipation_of_channel(
    recording: Recording,
    channel: Channel,
    passages: Passages,
    steady_step_m_s: float = STEADY_STEP_M_S,
    averaged: int = AVERAGED,
    block_samples: int = BLOCK_SAMPLES,
) -> DissipationOfChannel:
    """The dissipation of one strain channel of `recording`."""
    found = dissipation(
        channel,
        passages,
        recording.setup.tire.area_m2,
        speed_quality(passages),
        steady_step_m_s=steady_step_m_s,
        averaged=averaged,
        block_samples=block_samples,
    )
    columns = begin(recording.log, passages) | {
        "dissipation_factor_1_m": found.factor_1_m,
        "dissipation_factor_se_1_m": found.factor_se_1_m,
        "specific_power_m3_s2": found.specific_power_m3_s2,
        "steady": found.steady,
        "dissipation_factor_mean_1_m": found.factor_mean_1_m,
        "specific_power_mean_m3_s2": found.specific_power_mean_m3_s2,
    }
    columns |= _with_viscosity(recording, found, passages.speed_m_s)
    columns["quality"] = quality_column(found.quality)
    remarks = (passages.doubt,) if passages.doubt else _remarks(recording, channel.surface)
    return DissipationOfChannel(columns, remarks, released(channel), passages, found)


def _with_viscosity(
    recording: Recording, found: Dissipation, speed_m_s: FloatArray
) -> dict[str, FloatArray]:
    """Power eta P_d of the strip under the grating, and that over speed and over load.

    No columns without viscosity and area; the last one only if the load is known.

    P1 (27) is the power of one strip of the belt, of the given section and viscosity, under one
    grating: of a whole tire's rolling resistance (some 1 % of the load) it is a part that only the
    true section, viscosity and lever arm would tell.
    """
    tire, load = recording.setup.tire, recording.setup.conditions.load_N
    if tire.viscosity_Pa_s is None or tire.area_m2 is None:
        return {}
    power = tire.viscosity_Pa_s * found.specific_power_m3_s2
    with np.errstate(invalid="ignore", divide="ignore"):
        force = power / speed_m_s
    more = {"strip_power_W": power, "strip_rolling_resistance_N": force}
    return more | (
        {"strip_rolling_resistance_coefficient": force / load} if load is not None else {}
    )


def _remarks(recording: Recording, surface: str | None) -> tuple[str, ...]:
    """What the setup left open, and what a power in watts holds for."""
    tire = recording.setup.tire
    remarks = []
    if tire.area_m2 is None:
        remarks.append(
            "no section area in the setup: no specific power; give section_area_m2, or "
            "section_height_m and width_m, under [tire]"
        )
    elif tire.section_area_m2 is None:
        remarks.append(
            f"section area taken as section height x width = {tire.area_m2:.4g} m^2; "
            "section_area_m2 under [tire] overrides it"
        )
    if tire.viscosity_Pa_s is not None and tire.area_m2 is not None:
        remarks.append(
            "the powers and resistances in W and N are of the strip under the grating alone, "
            "with the setup's viscosity (P1 27)"
        )
        remarks.append(_in_bending(surface, tire.section_height_m))
    return tuple(remarks)


def _in_bending(surface: str | None, height_m: float | None) -> str:
    """What P1 (27) reads of a strip that bends and does not stretch.

    For a strip of height h: 12 (y / h)^2 of its power, y off the neutral axis.

    The strain at z is then z / y times the grating's, so that P1 (25) is eta A h^2 / (12 y^2) int
    (d eps_m / ds)^2 ds; (27) leaves the factor out.
    """
    text = "P1 (27) is exact for membrane strain; in pure bending "
    if surface == "inner":
        return (
            f"{text}a grating on the liner, half the strip's height from its neutral axis, reads "
            "three times too much"
        )
    right = f" = {1e3 * RIGHT_LEVER * height_m:.1f} mm" if height_m is not None else ""
    return (
        f"{text}a grating in a groove reads 12 (y/h)^2 of the power, y its distance from the "
        "neutral axis, h the strip's height: "
        f"right at y = 0.29 h{right}, too little nearer the axis (33 times too little at y = "
        "0.05 h, as in P2)"
    )


def clean_rows(found: DissipationOfChannel) -> IntArray:
    """The stretch of each row, -1 if a quality word spoils the row or its speed is not constant."""
    return np.where(good(found.dissipation.quality), found.dissipation.stretch, -1)


def regressions(
    log: str, found: DissipationOfChannel
) -> tuple[dict[str, Any] | None, tuple[str, ...]]:
    """(regressions of factor and specific power on speed, why there are none).

    The regressions are rows of a table; None if there are too few revolutions.
    """
    stretch = clean_rows(found)
    lines = [
        regression(name, found.passages.speed_m_s, found.columns[name], stretch)
        for name in ("dissipation_factor_1_m", "specific_power_m3_s2")
    ]
    kept = [line for line in lines if line is not None]
    if not kept:
        return None, (
            f"{found.channel.name}: no regression: too few revolutions of constant speed, "
            "or one speed",
        )
    columns = {name: np.array([line[name] for line in kept]) for name in COLUMNS}
    return {"log": log, "channel": found.channel.name} | columns, ()


def by_speed(found: DissipationOfChannel) -> dict[str, Any]:
    """The rows of constant speed sorted by speed: the table behind P1 Fig. 11."""
    rows = np.flatnonzero(found.dissipation.stretch >= 0)
    rows = rows[np.argsort(found.passages.speed_m_s[rows], kind="stable")]
    return {name: column[rows] for name, column in found.columns.items()}
