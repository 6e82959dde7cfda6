"""The `speed` table of a log whose encoder tells the speed: one row per turn of the wheel.

Recording --wheel angle, an accelerometer's patch doubts its steps--> columns of the table
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tirelog.data.recording import Recording
from tirelog.vocabulary.quality import quality_column
from tirelog.wheel.angle import SPEED_WINDOW_S, encoder_of, rolling_radius, turns_of
from tirelog.wheel.doubts import refuse_steps_by_patch
from tirelog.wheel.rolling import WheelTurns


def encoder_speed(recording: Recording) -> tuple[Mapping[str, Any], WheelTurns, list[str]]:
    """(columns of the `speed` table, the turns, remarks): one row per turn of the wheel.

    For a log without a sensor that passes the patch.

    `time_s` is the middle of the turn, `speed_m_s` the wheel's speed low-passed at 20 Hz,
    `period_s` the turn's duration, `acceleration_m_s2` from the durations of its two halves. The
    standard error holds angle noise and the radius' error. SetupError: an accelerometer's patch
    shows that the setup's steps are not those of a turn.
    """
    channel, wheel = encoder_of(recording)
    refuse_steps_by_patch(recording, wheel)
    radius = rolling_radius(recording, wheel)
    time, turns = turns_of(wheel, radius.radius_m)
    rate = wheel.speed_rad_s(time)
    noise = np.sqrt(2.0) * wheel.angle.noise_at(time) / SPEED_WINDOW_S
    share = 0.0 if np.isnan(radius.se_m) else radius.se_m / radius.radius_m
    columns = {
        "log": recording.log,
        "channel": channel.name,
        "revolution": np.arange(time.size),
        "time_s": time,
        "speed_m_s": rate * radius.radius_m,
        "period_s": turns.end_s - turns.begin_s,
        "speed_se_m_s": np.hypot(noise * radius.radius_m, share * rate * radius.radius_m),
        "acceleration_m_s2": turns.acceleration_m_s2,
        "quality": quality_column(turns.quality),
    }
    return columns, turns, [*wheel.remarks, *([radius.remark] if radius.remark else [])]
