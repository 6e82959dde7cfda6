"""The table `grip`: how much of the patch still adheres, and what friction that is (P2 3, 4.2).

    slip onset x_s and length 2 L of a passage --(15)--> adhesion share a = (x_s + L) / 2 L
        --(13), (17)--> friction used and left

With C_x = r 2 gamma L f_s, x_s = L (1 - 2 r |sigma|), so that r |sigma| = 1 - a, and the traction
of (13) sums to

    |F_x| / F = 3 f_s (1 - a) a^2 + f_d (2 - 3 u + u^3) / 4,      u = x_s / L = 2 a - 1

The strain has the size of the traction alone, since drive and a lever of one sign look like braking
and a lever of the other; the sign of F_x, positive in drive, is that of the car's acceleration.
What is left is counted from the largest that this can be. The brush is P2's: friction and stiffness
are given, not measured, and a road that is smoother than they say leaves less.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from tirelog.data.recording import Recording
from tirelog.errors import UsageError
from tirelog.physics.brush import STATIC_FRICTION
from tirelog.strain.footprint.slip_onset import FrictionRatio
from tirelog.strain.footprint.table import footprints_of
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.quality import OK

#: L ~ F^0.5, as model files start with (`patch_load_exponent`): a patch that is 1 % longer carries
#: 2 % more; an exponent twice as large halves that
LOAD_EXPONENT = 0.5
#: standard error of that exponent: tires have some 0.35 to 0.8; twice as much doubles the error of
#: a force away from the usual one
EXPONENT_SD = 0.15
#: acceleration [m/s^2] from which its sign is that of the traction: a grade of 6 % asks for as much
#: the other way; twice as much leaves the force of gentle driving without its sign
SIGN_M_S2 = 0.6
_COPIED = ("log", "channel", "revolution", "time_s", "speed_m_s", "slip_onset_reason", "quality")


@dataclass(frozen=True)
class GripOfChannel:
    """One channel's rows, and sentences on them."""

    columns: dict[str, Any]
    remarks: tuple[str, ...]


def grip_of(
    recording: Recording,
    static_friction: float = STATIC_FRICTION,
    sliding_friction: float | None = None,
    stiffness_ratio: float = 1.0,
    load_exponent: float = LOAD_EXPONENT,
) -> Iterator[GripOfChannel]:
    """The grip that each passage shows.  UsageError: as `footprints_of`.

    The onset is looked for with the ratio of the frictions; without a `sliding_friction` it is that
    of the setup, or the usual one.
    """
    load = recording.setup.conditions.load_N
    ratio = None if sliding_friction is None else sliding_friction / static_friction
    for found in footprints_of(recording, ratio):
        friction = found.footprint.friction
        sliding = static_friction * friction.value
        columns = grip_columns(
            found.columns,
            static_friction,
            sliding,
            stiffness_ratio,
            load_exponent,
            load,
            found.passages.acceleration_m_s2,
            static_friction * friction.se,
        )
        told = int(np.isfinite(columns["adhesion_share"]).sum())
        remarks = [
            f"{found.channel.name}: an onset of slip in {told} of {len(found.passages)} passages; "
            f"friction by P2 (13) with {static_friction:g} sticking, {sliding:.3g} sliding "
            f"and {stiffness_ratio:g} times the stiffness of (17)"
        ]
        if load is None:
            remarks.append("no forces: the setup's [conditions] has no load_N")
        else:
            remarks.append(
                f"forces take the passage of median length to carry {load:g} N, and the length to "
                f"grow as load^{load_exponent:g}"
            )
            unsigned = told - int(np.isfinite(columns["longitudinal_force_N"]).sum())
            if unsigned:
                remarks.append(
                    f"{unsigned} longitudinal forces are empty: below {SIGN_M_S2:g} m/s^2 the "
                    "acceleration does not tell drive from braking"
                )
        yield GripOfChannel(columns, (*found.remarks, *remarks))


def refuse_frictions(
    static_friction: float = STATIC_FRICTION,
    sliding_friction: float | None = None,
    stiffness_ratio: float = 1.0,
    load_exponent: float = LOAD_EXPONENT,
) -> None:
    """UsageError for numbers that no brush has."""
    for option, value, low, high in (
        ("--static-friction", static_friction, 0.05, 3.0),
        ("--sliding-friction", sliding_friction, 0.05, 3.0),
        ("--stiffness-ratio", stiffness_ratio, 0.1, 100.0),
        ("--load-exponent", load_exponent, 0.05, 2.0),
    ):
        if value is not None and not low <= value <= high:
            raise UsageError(
                f"{option} {value:g}", allowed=f"{low:g} to {high:g} is allowed", do="correct it"
            )
    if sliding_friction is not None:
        FrictionRatio.given(sliding_friction / static_friction)


def friction_used(
    adhesion: FloatArray, static_friction: float, sliding_friction: float
) -> FloatArray:
    """|F_x| / F of P2 (13) if a share of the patch adheres, shape of `adhesion`."""
    u = 2.0 * adhesion - 1.0
    stick = 3.0 * static_friction * (1.0 - adhesion) * adhesion**2
    slide: FloatArray = sliding_friction * (2.0 - 3.0 * u + u**3) / 4.0
    return stick + slide


def grip_columns(
    footprint: dict[str, Any],
    static_friction: float,
    sliding_friction: float,
    stiffness_ratio: float,
    load_exponent: float,
    load_N: float | None,
    acceleration_m_s2: FloatArray,
    sliding_se: float = 0.0,
) -> dict[str, Any]:
    """Columns of the table from those of the table `footprint`, shape (n,).

    The strain shows the size of the traction; its sign is that of the acceleration (n,).
    """
    length, onset = (np.asarray(footprint[n], float) for n in ("length_m", "slip_onset_m"))
    length_se, onset_se = (
        np.asarray(footprint[n], float) for n in ("length_se_m", "slip_onset_se_m")
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        raw = onset / length + 0.5
        share = np.clip(raw, 0.0, 1.0)
        share_se = np.hypot(onset_se, onset / length * length_se) / length
        used = friction_used(share, static_friction, sliding_friction)
        step = 1e-4
        slope = (
            friction_used(share + step, static_friction, sliding_friction)
            - friction_used(share - step, static_friction, sliding_friction)
        ) / (2.0 * step)
        by_sliding = friction_used(share, 0.0, 1.0) * sliding_se
        every = np.linspace(0.0, 1.0, 1001)
        most = friction_used(every, static_friction, sliding_friction)
        peak = every[np.argmax(most)]
        # beyond the peak more slip gives less: nothing is left
        left = np.where(share > peak, 1.0 - used / most.max(), 0.0)
        left = np.where(np.isfinite(share), left, np.nan)
    columns = {name: footprint[name] for name in _COPIED} | {
        "adhesion_share": share,
        "adhesion_share_se": share_se,
        "brush_slip": (1.0 - share) / stiffness_ratio,
        "friction_used": used,
        "friction_used_se": np.hypot(slope * share_se, by_sliding),
        "grip_left": left,
    }
    if load_N is None:
        return columns
    good = (np.asarray(footprint["quality"]) == OK) & np.isfinite(length)
    usual = float(np.median(length[good])) if good.any() else np.nan
    force = load_N * (length / usual) ** (1.0 / load_exponent)
    columns["vertical_force_N"] = force
    by_exponent = np.abs(np.log(length / usual)) * EXPONENT_SD / load_exponent**2
    columns["vertical_force_se_N"] = force * np.hypot(
        length_se / length / load_exponent, by_exponent
    )
    with np.errstate(invalid="ignore"):
        sure = np.abs(acceleration_m_s2) >= SIGN_M_S2
    sign = np.where(sure, np.sign(acceleration_m_s2), np.nan)
    columns["longitudinal_force_N"] = sign * used * force
    columns["longitudinal_force_se_N"] = np.abs(sign) * np.hypot(
        columns["friction_used_se"] * force, used * columns["vertical_force_se_N"]
    )
    return columns
