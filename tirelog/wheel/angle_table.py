"""The table `wheel-angle`: the encoder's signal, the wheel's speed and its angle (P4 Figs. 4 to 6).

encoder samples of a stretch --wheel angle--> angle within the turn, v_c = r omega at 20 Hz
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from tirelog.data.recording import Recording
from tirelog.errors import UsageError
from tirelog.vocabulary.quality import quality_column
from tirelog.wheel.angle import encoder_of, rolling_radius
from tirelog.wheel.doubts import refuse_steps_by_patch

#: seconds that are told if none are asked for: P4 Fig. 4 shows 100 ms; the table is as long as
#: that
STRETCH_S = 0.1
#: rows of one table: a minute of 10 kHz; twice as many take twice the memory, some 100 MB
MOST_ROWS = 600_000


@dataclass(frozen=True)
class AngleOfLog:
    """The rows of one encoder, and sentences on them."""

    columns: dict[str, Any]
    remarks: tuple[str, ...]


def refuse_stretch(
    from_s: float | None = None, to_s: float | None = None, every: int | None = None
) -> None:
    """UsageError for a stretch that is none."""
    if every is not None and every < 1:
        raise UsageError(f"--every {every}", allowed="1 or more is allowed", do="correct it")
    if any(value is not None and not np.isfinite(value) for value in (from_s, to_s)):
        raise UsageError(
            "--from or --to is no time", allowed="seconds are allowed", do="correct it"
        )
    if from_s is not None and to_s is not None and not to_s > from_s:
        raise UsageError(
            f"--from {from_s:g} --to {to_s:g}",
            allowed="allowed is a stretch that ends after it begins",
            do="swap them",
        )


def wheel_angle_of(
    recording: Recording,
    from_s: float | None = None,
    to_s: float | None = None,
    every: int | None = None,
) -> Iterator[AngleOfLog]:
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
    start = from_s if from_s is not None else (middle if to_s is None else to_s - STRETCH_S)
    stop = to_s if to_s is not None else start + STRETCH_S
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
        "quality": quality_column(wheel.quality(time, time)),
    }
    remarks = [*wheel.remarks, *([radius.remark] if radius.remark else [])]
    yield AngleOfLog(columns, tuple(remarks))
