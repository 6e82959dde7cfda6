"""The table `strain-shift`: P4's regressors by a strain sensor and the wheel's encoder.

    footprint's entry and exit times --wheel angle at them--> fronts in wheel angle
        --P4 section III--> patch width, shift of the patch's middle against its zero

P1 and P2 end with a phonic wheel beside the gratings: its speed stands beside that of the passages,
and the shift is what a longitudinal force does to the patch's place, as P4 measures it by an
accelerometer. The sensor's own angle is not known; the zero is the mean over the first passages
that are good, so that only changes count.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from tirelog.data.recording import Recording
from tirelog.strain.footprint.footprint import footprints_of
from tirelog.vocabulary.quality import OK
from tirelog.wheel.angle import encoder_of, rolling_radius

#: passages whose middle is the zero of the shift: with one its error would be in all rows; twice as
#: many would reach into the first manoeuvre of a short log
ZERO_PASSAGES = 8


@dataclass(frozen=True)
class StrainShiftOfChannel:
    """One channel's rows, and sentences on them."""

    columns: dict[str, Any]
    remarks: tuple[str, ...]


def strain_shift_of(recording: Recording) -> Iterator[StrainShiftOfChannel]:
    """Width and shift of the patch in wheel angle at each passage.

    SetupError: no encoder.  DataLoss: it shows no teeth.  UsageError: no patch comes round.
    """
    _, wheel = encoder_of(recording)
    radius = rolling_radius(recording, wheel)
    said = [*wheel.remarks, *([radius.remark] if radius.remark else [])]
    for found in footprints_of(recording):
        table = found.columns
        entry, exit_ = (np.asarray(table[name], float) for name in ("entry_time_s", "exit_time_s"))
        angles = [wheel.angle.at(time) for time in (entry, exit_)]
        middle = 0.5 * (angles[0] + angles[1])
        good = (np.asarray(table["quality"]) == OK) & np.isfinite(middle)
        first = np.flatnonzero(good)[:ZERO_PASSAGES]
        # whole turns apart: the mean direction, then what each differs from it
        zero = np.angle(np.exp(1j * middle[first]).mean()) if first.size else np.nan
        shift = np.angle(np.exp(1j * (middle - zero)))
        time = np.asarray(table["time_s"], float)
        noise = np.sqrt(0.5) * wheel.angle.noise_at(time)
        shared = np.sqrt(0.5) * wheel.angle.shared_noise_at(time)
        speed = np.asarray(table["speed_m_s"], float)
        times = np.asarray(table["length_se_m"], float) / np.where(speed > 0.0, speed, np.nan)
        rate = wheel.speed_rad_s(time)
        error = np.hypot(np.hypot(noise, shared), 0.5 * times * rate)
        columns = {
            name: table[name]
            for name in ("log", "channel", "revolution", "time_s", "speed_m_s", "quality")
        } | {
            "entry_angle_deg": np.degrees(angles[0]) % 360.0,
            "exit_angle_deg": np.degrees(angles[1]) % 360.0,
            "patch_width_deg": np.degrees(angles[1] - angles[0]),
            "patch_width_se_deg": np.degrees(np.hypot(2.0 * noise, times * rate)),
            "phase_shift_deg": np.degrees(shift),
            "phase_shift_se_deg": np.degrees(error),
            "wheel_speed_m_s": rate * radius.radius_m,
        }
        channel = found.channel.name
        remark = (
            f"{channel}: zero of the phase shift from the first {first.size} good passages"
            if first.size
            else f"{channel}: no good passage, so the phase shift has no zero"
        )
        yield StrainShiftOfChannel(columns, (*said, *found.remarks, remark))
        said = []
