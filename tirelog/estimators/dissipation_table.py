"""The tables of the command `dissipation`: a row a revolution, its moving averages sorted by speed, and the regressions on speed.

Recording --passages, dissipation--> columns --power, force, coefficient where the setup gives what they need--> table
rows of constant speed --straight lines in the speed, errors by stretch--> Regression
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tirelog.estimators.dissipation import AVERAGED, STEADY_STEP_M_S, Dissipation, dissipation
from tirelog.estimators.held import released
from tirelog.estimators.passages import Passages
from tirelog.estimators.speed import begin, speed_words
from tirelog.estimators.strain_channels import rotating
from tirelog.recording import BLOCK_SAMPLES, Channel, FloatArray, IntArray, Recording
from tirelog.tables import quality_column

#: rows of constant speed that a regression needs
LEAST_ROWS = 8


@dataclass(frozen=True)
class DissipationOfChannel:
    """One channel: what was found, the table's columns, sentences on it."""

    channel: Channel
    passages: Passages
    dissipation: Dissipation
    columns: dict[str, Any]
    remarks: tuple[str, ...]


def dissipation_of(
    recording: Recording, steady_step_m_s: float = STEADY_STEP_M_S, averaged: int = AVERAGED, block_samples: int = BLOCK_SAMPLES
) -> Iterator[DissipationOfChannel]:
    """The dissipation of each strain channel of `recording`."""
    said = False
    for channel, passages in rotating(recording):
        found = dissipation_of_channel(recording, channel, passages, steady_step_m_s, averaged, block_samples)
        del channel  # before the next one takes its place in memory
        yield replace(found, remarks=()) if said and not passages.doubt else found
        said |= not passages.doubt


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
        speed_words(passages),
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
    remarks = (passages.doubt,) if passages.doubt else _remarks(recording)
    return DissipationOfChannel(released(channel), passages, found, columns, remarks)


def _with_viscosity(recording: Recording, found: Dissipation, speed_m_s: FloatArray) -> dict[str, FloatArray]:
    """Power eta P_d, rolling resistance power / speed, and its coefficient, where viscosity, area and load are known (P1 27)."""
    tire, load = recording.setup.tire, recording.setup.conditions.load_N
    if tire.viscosity_Pa_s is None or tire.area_m2 is None:
        return {}
    power = tire.viscosity_Pa_s * found.specific_power_m3_s2
    with np.errstate(invalid="ignore", divide="ignore"):
        force = power / speed_m_s
    more = {"power_W": power, "rolling_resistance_N": force}
    return more | ({"rolling_resistance_coefficient": force / load} if load is not None else {})


def _remarks(recording: Recording) -> tuple[str, ...]:
    """What the setup left open."""
    tire = recording.setup.tire
    remarks = []
    if tire.area_m2 is None:
        remarks.append(
            "no section area in the setup: no specific power; give section_area_m2, or section_height_m and width_m, under [tire]"
        )
    elif tire.section_area_m2 is None:
        remarks.append(f"section area taken as section height x width = {tire.area_m2:.4g} m^2; section_area_m2 under [tire] overrides it")
    if tire.viscosity_Pa_s is not None and tire.area_m2 is not None:
        remarks.append("power as P1 (27) prints it, for membrane strain; in pure bending a grating on the liner reads three times too much")
    return tuple(remarks)


@dataclass(frozen=True)
class Regression:
    """quantity = intercept + slope x speed over `rows` revolutions of constant speed in `stretches` stretches.

    Standard errors hold with revolutions of one stretch correlated (sums over stretches), or from the residuals where there are fewer
    than four; `scatter`: standard deviation of the residuals.
    """

    quantity: str
    intercept: float
    intercept_se: float
    slope: float
    slope_se: float
    scatter: float
    rows: int
    stretches: int
    slowest_m_s: float
    fastest_m_s: float


def regression(quantity: str, speed_m_s: FloatArray, values: FloatArray, stretch: IntArray) -> Regression | None:
    """The straight line of `values` on `speed_m_s` (n,) over the rows with a `stretch`; None where there are too few or one speed only."""
    good = (stretch >= 0) & np.isfinite(values) & np.isfinite(speed_m_s)
    v, y, group = speed_m_s[good], values[good], stretch[good]
    if v.size < LEAST_ROWS or np.ptp(v) < 1e-6 * np.abs(v).max():
        return None
    design = np.column_stack([np.ones_like(v), v - v.mean()])
    inverse = np.linalg.inv(design.T @ design)
    coefficients = inverse @ (design.T @ y)
    residual = y - design @ coefficients
    scatter = float(np.sqrt((residual**2).sum() / (v.size - 2)))
    names, place = np.unique(group, return_inverse=True)
    if names.size >= 4:
        scores = np.zeros((names.size, 2))
        np.add.at(scores, place, design * residual[:, None])
        covariance = inverse @ (scores.T @ scores) @ inverse * (names.size / (names.size - 1))
    else:
        covariance = inverse * scatter**2
    to_zero = np.array([1.0, -v.mean()])
    return Regression(
        quantity,
        float(coefficients @ to_zero),
        float(np.sqrt(to_zero @ covariance @ to_zero)),
        float(coefficients[1]),
        float(np.sqrt(covariance[1, 1])),
        scatter,
        int(v.size),
        int(names.size),
        float(v.min()),
        float(v.max()),
    )


def clean(found: DissipationOfChannel) -> IntArray:
    """The stretch of each row, -1 where the row has a quality word or its speed is not constant."""
    good = np.array([not words for words in found.dissipation.quality], dtype=bool)
    return np.where(good, found.dissipation.stretch, -1)


def regression_columns(log: str, found: DissipationOfChannel) -> dict[str, Any] | None:
    """The regressions of factor and specific power on speed as rows of a table; None where there are too few revolutions."""
    stretch = clean(found)
    lines = [
        regression(name, found.passages.speed_m_s, found.columns[name], stretch)
        for name in ("dissipation_factor_1_m", "specific_power_m3_s2")
    ]
    kept = [line for line in lines if line is not None]
    if not kept:
        return None
    names = ("quantity", "intercept", "intercept_se", "slope", "slope_se", "scatter", "rows", "stretches", "slowest_m_s", "fastest_m_s")
    columns = {name: np.array([getattr(line, name) for line in kept]) for name in names}
    return {"log": log, "channel": found.channel.name} | columns


def by_speed(found: DissipationOfChannel) -> dict[str, Any]:
    """The rows of constant speed sorted by speed: the table behind P1 Fig. 11."""
    rows = np.flatnonzero(found.dissipation.stretch >= 0)
    rows = rows[np.argsort(found.passages.speed_m_s[rows], kind="stable")]
    return {name: column[rows] for name, column in found.columns.items()}
