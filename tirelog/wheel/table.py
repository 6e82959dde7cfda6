"""A calibration applied to a log.

Its zero if the log has none of its own, and the rows of the `phase-shift` table.

Passages, Calibration --no zero stretch in the log--> Passages with the calibration's zero
Passages, Calibration --clean, force maps--> columns of the table, words
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from tirelog.data.recording import Recording
from tirelog.dsp.filters import UNLIKE_SPEED, unlike_neighbours
from tirelog.errors import UsageError
from tirelog.vocabulary.arrays import TableRows
from tirelog.vocabulary.quality import Quality, marked, quality_column
from tirelog.wheel.angle import SPEED_WINDOW_S, encoder_of, rolling_radius, turns_of
from tirelog.wheel.calibration import (
    Calibration,
    clean_passages,
    predict_force,
    quasi_static,
)
from tirelog.wheel.phase_shift import EdgeTimes, measure_phase_shift, refuse_steps_by_patch
from tirelog.wheel.rolling import WheelTurns, off_clock

# ---- The table `wheel-angle`: the encoder's signal, the wheel's speed and its angle (P4 Figs. 4
# to 6).
#
# encoder samples of a stretch --wheel angle--> angle within the turn, v_c = r omega at 20 Hz


#: seconds that are written if none are asked for: P4 Fig. 4 shows 100 ms; the table is as long as
#: that
STRETCH_S = 0.1
#: rows of one table: a minute of 10 kHz; twice as many take twice the memory, some 100 MB
MOST_ROWS = 600_000


def refuse_every(every: int | None = None) -> None:
    """UsageError: not even every sample."""
    if every is not None and every < 1:
        raise UsageError(f"--every {every}", allowed="1 or more is allowed", do="correct it")


def wheel_angle_of(
    recording: Recording,
    start: float | None = None,
    stop: float | None = None,
    every: int | None = None,
) -> Iterator[TableRows]:
    """The wheel's angle at each sample of the encoder, or each `every`-th, of a stretch [s].

    By default 0.1 s from the middle of the log on.  SetupError: no encoder, or
    an accelerometer's patch shows that it has other steps.  DataLoss: no teeth.
    UsageError: no sample lies there, or more than MOST_ROWS do.
    """
    channel, wheel = encoder_of(recording)
    refuse_steps_by_patch(recording, wheel)
    radius = rolling_radius(recording, wheel)
    ends = channel.axis.at(0.0), channel.axis.at(float(channel.size - 1))
    middle = 0.5 * (float(ends[0]) + float(ends[1]))
    start = start if start is not None else (middle if stop is None else stop - STRETCH_S)
    stop = stop if stop is not None else start + STRETCH_S
    first, last = (
        int(np.clip(np.ceil(float(channel.axis.index(time))), 0, channel.size))
        for time in (start, stop)
    )
    step = every or 1
    rows = len(range(first, last, step))
    if not 0 < rows <= MOST_ROWS:
        raise UsageError(
            f"{start:g} to {stop:g} s hold {rows} samples",
            allowed=f"1 to {MOST_ROWS} are allowed; the log goes from {float(ends[0]):g} to "
            f"{float(ends[1]):g} s",
            do="give another --from and --to, or --every 10",
            file=recording.log,
        )
    time = channel.axis.time(first, last)[::step]
    angle = wheel.angle.at(time)
    columns = {
        "log": recording.log,
        "channel": channel.name,
        "revolution": np.floor(np.nan_to_num(angle) / (2.0 * np.pi)).astype(np.int64),
        "time_s": time,
        "speed_m_s": wheel.speed_rad_s(time) * radius.radius_m,
        "encoder_signal": channel.read(first, last)[::step],
        "turned_deg": np.degrees(angle) % 360.0,
        "quality": quality_column(
            # before the first tooth and behind the last there is no angle
            wheel.quality(time, time) | marked(np.isnan(angle), Quality.EDGE_OF_LOG)
        ),
    }
    remarks = [*wheel.remarks, *([radius.remark] if radius.remark else [])]
    yield TableRows(columns, tuple(remarks))


# ---- The `speed` table of a log whose encoder tells the speed: one row per turn of the wheel.
#
# Recording --wheel angle, an accelerometer's patch doubts its steps--> columns of the table


def encoder_speed(recording: Recording) -> tuple[Mapping[str, Any], WheelTurns, list[str]]:
    """(columns of the `speed` table, the turns, remarks): one row per turn of the wheel.

    For a log without a sensor that passes the patch.

    `time_s` is the middle of the turn, `speed_m_s` the wheel's speed low-passed at 20 Hz.
    `period_s` is the turn's duration; its two halves give `acceleration_m_s2`. The
    standard error holds angle noise and the radius' error. SetupError: an accelerometer's patch
    shows that the setup's steps are not those of a turn.
    """
    channel, wheel = encoder_of(recording)
    refuse_steps_by_patch(recording, wheel)
    radius = rolling_radius(recording, wheel)
    time, turns = turns_of(wheel, radius.radius_m)
    off = off_clock(channel.axis, turns.begin_s, turns.end_s)
    turns = replace(turns, quality=turns.quality | marked(off, Quality.IMPLAUSIBLE))
    mended = wheel.mended(time - 0.5 * SPEED_WINDOW_S, time + 0.5 * SPEED_WINDOW_S)
    rate = wheel.speed_rad_s(time)
    noise = np.sqrt(2.0) * wheel.angle.noise_at(time) / SPEED_WINDOW_S
    share = 0.0 if np.isnan(radius.se_m) else radius.se_m / radius.radius_m
    speed = rate * radius.radius_m
    unlike = unlike_neighbours(speed, turns.quality, UNLIKE_SPEED * np.abs(speed))
    share = np.hypot(share, channel.axis.rate_error)
    columns = {
        "log": recording.log,
        "channel": channel.name,
        "revolution": np.arange(time.size),
        "time_s": time,
        "speed_m_s": speed,
        "period_s": turns.end_s - turns.begin_s,
        "speed_se_m_s": np.hypot(noise * radius.radius_m, share * rate * radius.radius_m),
        "acceleration_m_s2": turns.acceleration_m_s2,
        "quality": quality_column(turns.quality | unlike | marked(mended, Quality.GAP)),
    }
    return columns, turns, [*wheel.remarks, *([radius.remark] if radius.remark else [])]


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
    n, quality = p.time_s.size, p.quality
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
        "patch_width_detrended_deg": np.full(n, np.nan),
        "phase_shift_detrended_deg": np.full(n, np.nan),
        "phase_shift_corrected_deg": np.full(n, np.nan),
    }
    if calibration is not None:
        cleaned = clean_passages(p, calibration)
        columns["patch_width_detrended_deg"] = cleaned["width_deg"]
        columns["phase_shift_detrended_deg"] = cleaned["shift_deg"]
        columns["phase_shift_corrected_deg"] = cleaned["corrected_deg"]
        outside, removed = cleaned["outside"], np.isfinite(cleaned["shift_deg"])
        for name, force, x, x_se in (
            ("vertical", calibration.vertical, cleaned["width_deg"], p.width_se_deg),
            (
                "longitudinal",
                calibration.longitudinal,
                cleaned[calibration.force_column],
                p.shift_se_deg,
            ),
        ):
            if force is not None:
                values, se, beyond = predict_force(force, x, x_se)
                columns |= {f"{name}_force_N": values, f"{name}_force_se_N": se}
                outside = outside | beyond
        quality = quality | marked(outside, Quality.EXTRAPOLATED)
        quality |= marked(removed & calibration.has_delay, Quality.DELAY_REMOVED)
    return {**columns, "quality": quality_column(quality)}
