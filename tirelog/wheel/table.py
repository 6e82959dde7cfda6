"""A calibration applied to a log.

Its zero if the log has none of its own, and the rows of the `phase-shift` table.

Passages, Calibration --no zero stretch in the log--> Passages with the calibration's zero
Passages, Calibration --clean, force maps--> columns of the table, words
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from tirelog.data.recording import Recording
from tirelog.vocabulary.quality import Quality, marked, quality_column
from tirelog.wheel.calibration import Calibration, Cleaned, clean_passages, quasi_static
from tirelog.wheel.forces import predict_force
from tirelog.wheel.phase_shift import EdgeTimes, measure_phase_shift

#: quasi-static passages that a zero needs, within the calibration's range of speed: their mean is
#: known to 0.35 of one's scatter, that of twice as many to 0.25
LEAST_ZERO = 8


def measure_with(
    calibration: Calibration | None, recording: Recording, zero: str = "auto", forces: bool = False
) -> Iterator[EdgeTimes]:
    """`measure_phase_shift`, with the calibration's zero if the log has none and none is named."""
    for passages in measure_phase_shift(recording, zero, forces):
        yield with_zero(passages, calibration) if calibration and zero == "auto" else passages


def with_zero(p: EdgeTimes, calibration: Calibration) -> EdgeTimes:
    """The passages with the calibration's zero, if their log has none.

    As they are if it has one, or too few quasi-static passages.

    If no force is transmitted the phase shift is what the calibration's speed map says: the
    quasi-static passages, at whatever speed the map knows, give the wheel angle at which it is
    zero.
    """
    if np.isfinite(p.zero_speed_m_s):
        return p
    middle = p.entry_deg + p.width_deg / 2
    change = calibration.shift(p.speed_m_s, calibration.reference_speed_m_s)
    with np.errstate(invalid="ignore"):
        inside = (p.speed_m_s > calibration.shift.low_m_s - 0.5) & (
            p.speed_m_s < calibration.shift.high_m_s + 0.5
        )
    rows = quasi_static(p) & inside & np.isfinite(middle)
    if rows.sum() < LEAST_ZERO:
        told = (
            f"and fewer than {LEAST_ZERO} quasi-static passages within the calibration's range "
            "of speed"
        )
        return replace(p, without_zero=f"{p.without_zero}; {told}")
    zero = float(np.median((middle - change)[rows]))
    speeds = f"{p.speed_m_s[rows].min():.1f} to {p.speed_m_s[rows].max():.1f} m/s"
    return replace(
        p,
        shift_deg=middle - zero,
        quality=p.quality & ~np.uint32(Quality.NO_ZERO),
        zero_speed_m_s=calibration.reference_speed_m_s,
        remarks=(
            *p.remarks,
            f"zero of the phase shift: the calibration's, by {rows.sum()} quasi-static passages "
            f"at {speeds}",
        ),
        without_zero="",
    )


def table(p: EdgeTimes, calibration: Calibration | None) -> Mapping[str, object]:
    """The columns of the `phase-shift` table for one accelerometer of one log.

    Rows from whose phase shift the calibration's telemetry delay was removed carry the word
    `delay_removed`.
    """
    n = p.time_s.size
    nothing = np.full(n, np.nan)
    cleaned = (
        clean_passages(p, calibration)
        if calibration
        else Cleaned(nothing, nothing, nothing, np.zeros(n, bool))
    )
    quality = p.quality | marked(cleaned.extrapolated, Quality.EXTRAPOLATED)
    if calibration and calibration.has_delay:
        quality |= marked(np.isfinite(cleaned.shift_deg), Quality.DELAY_REMOVED)
    columns: dict[str, object] = {
        "log": p.log,
        "channel": p.channel,
        "revolution": np.arange(n),
        "time_s": p.time_s,
        "speed_m_s": p.speed_m_s,
        "entry_angle_deg": p.entry_deg,
        "exit_angle_deg": p.exit_deg,
        "patch_width_deg": p.width_deg,
        "patch_width_se_deg": p.width_se_deg,
        "phase_shift_deg": p.shift_deg,
        "phase_shift_se_deg": p.shift_se_deg,
        "patch_width_detrended_deg": cleaned.width_deg,
        "phase_shift_detrended_deg": cleaned.shift_deg,
        "phase_shift_corrected_deg": cleaned.corrected_deg,
    }
    if calibration and calibration.vertical:
        force, se, outside = predict_force(calibration.vertical, cleaned.width_deg, p.width_se_deg)
        columns |= {"vertical_force_N": force, "vertical_force_se_N": se}
        quality |= marked(outside, Quality.EXTRAPOLATED)
    if calibration and calibration.longitudinal:
        shift = cleaned.corrected_deg if np.isfinite(calibration.crosstalk) else cleaned.shift_deg
        force, se, outside = predict_force(calibration.longitudinal, shift, p.shift_se_deg)
        columns |= {"longitudinal_force_N": force, "longitudinal_force_se_N": se}
        quality |= marked(outside, Quality.EXTRAPOLATED)
    return {**columns, "quality": quality_column(quality)}


def by_time(parts: Sequence[Mapping[str, object]]) -> dict[str, object]:
    """The rows of all accelerometers of one log in the order of time.

    As many values per turn as accelerometers (P4, on arrays of sensors).
    """
    long = [
        {
            name: np.broadcast_to(np.asarray(column), np.asarray(part["time_s"]).shape)
            for name, column in part.items()
        }
        for part in parts
    ]
    order = np.argsort(np.concatenate([part["time_s"] for part in long]), kind="stable")
    return {name: np.concatenate([part[name] for part in long])[order] for name in long[0]}
