"""Where gratings stand on the wheel: by the setup, or by the delay between their passages.

    passages of the first grating -> theta(t), a spline through whole turns
    passages of another at times t -> theta(t) modulo a turn: by so much it stands behind the first

Both pass the same patch, so that wind-up and whatever moves the patch's centre cancel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline

from tirelog.data.recording import Recording
from tirelog.errors import UsageError
from tirelog.inference.stacks.spooled import Stacks
from tirelog.vocabulary.arrays import FloatArray

#: turns of an unbroken run that a spline is laid through; of two a bend is not known; twice as
#: many leave shorter runs without places
_LEAST_TURNS = 4
#: a time between two passages that is farther than this share off what the speed says is no turn;
#: twice as much would take a turn and a half for one
_ONE_TURN = 0.3
#: a setup and passages that differ by more [deg] contradict each other: passages tell 0.1 degrees,
#: a tape on the belt some millimetres, which are one; half as much would doubt honest tapes
_DOUBT_DEG = 3.0


@dataclass
class Places:
    """What is known of one grating's angle [rad]: of each log by the setup, and by its passages.

    `behind`: the angles behind the first grating, one for each passage of every log.
    """

    name: str
    given: list[float] = field(default_factory=list)
    behind: list[FloatArray] = field(default_factory=list)

    def add(self, recording: Recording, number: int, own: Stacks, first: Stacks) -> None:
        """One more log, number `number`: what its setup and its passages say."""
        degrees = (
            recording.setup.channels[self.name].angle_deg
            if (self.name in recording.setup.channels)
            else None
        )
        if degrees is not None:
            self.given.append(float(np.radians(degrees)))
        if own is not first:
            self.behind.append(_behind(_passages(own, number), _passages(first, number)))

    @property
    def measured(self) -> tuple[float, float, int]:
        """Angle behind the first [rad], its standard error, passages that tell it."""
        angles = np.concatenate([np.zeros(0), *self.behind])
        if angles.size < 2:
            return np.nan, np.nan, angles.size
        middle = float(np.angle(np.exp(1j * angles).mean()))
        off = np.angle(np.exp(1j * (angles - middle)))
        middle += float(np.median(off))
        spread = 1.4826 * float(np.median(np.abs(off - np.median(off))))
        return middle % (2.0 * np.pi), 1.2533 * spread / np.sqrt(angles.size), angles.size


def places_of(gratings: Sequence[Places]) -> tuple[tuple[float, ...], list[str]]:
    """The angle of each grating on the wheel [rad], and sentences on where each comes from.

    The setup's angle goes before the passages'.  UsageError: neither tells one.
    """
    first = gratings[0]
    zero = first.given[0] if first.given else 0.0
    known = [one for one in gratings[1:] if one.given and np.isfinite(one.measured[0])]
    if not first.given and known:
        zero = known[0].given[0] - known[0].measured[0]
    angles, said = [zero], []
    for one in gratings[1:]:
        behind, error, passages = one.measured
        told = (
            f"{np.degrees(behind):.2f} ± {max(np.degrees(error), 0.01):.2f} degrees behind "
            f"{first.name} by {passages} passages"
        )
        if one.given:
            angles.append(one.given[0])
            off = np.degrees(np.angle(np.exp(1j * (one.given[0] - zero - behind))))
            if np.isfinite(off) and abs(off) > _DOUBT_DEG:
                stands = np.degrees((one.given[0] - zero) % (2.0 * np.pi))
                said.append(
                    f"{one.name} stands {told}, by the setup's angle_deg {stands:.1f}; the setup's "
                    "is taken: mend it if the channels are on one clock"
                )
        elif np.isfinite(behind):
            angles.append(zero + behind)
            said.append(f"{one.name} stands {told}; give angle_deg in the setup if you know better")
        else:
            raise UsageError(
                f"no passage tells where {one.name} stands on the wheel",
                allowed="its passages between those of the first grating tell it, or the setup",
                do=f"give angle_deg in [channels.{one.name}]",
            )
    return tuple(angles), said


def _passages(stacks: Stacks, number: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(times [s], angular speeds [rad/s], ordinals) of the passages of one log."""
    parts = [s for s in stacks.outlines() if s.log.size and s.log[0] == number]
    none = np.zeros(0)
    time = np.concatenate([none, *(s.conditions.time_s for s in parts)])
    spin = np.concatenate([none, *(s.conditions.speed_m_s / s.radius_m for s in parts)])
    ordinal = np.concatenate([none, *(s.revolution for s in parts)])
    order = np.argsort(time)
    return time[order], spin[order], ordinal[order]


def _behind(
    own: tuple[FloatArray, FloatArray, FloatArray], first: tuple[FloatArray, FloatArray, FloatArray]
) -> FloatArray:
    """Angle of the wheel at each passage of a grating since the first one's, [rad], (k,)."""
    time, spin, ordinal = first
    if time.size < _LEAST_TURNS:
        return np.zeros(0)
    step = np.diff(time)
    turn = (np.diff(ordinal) == 1) & (
        np.abs(step * 0.5 * (spin[1:] + spin[:-1]) / (2.0 * np.pi) - 1.0) < _ONE_TURN
    )
    found = []
    for run in np.split(np.arange(time.size), np.flatnonzero(~turn) + 1):
        if run.size < _LEAST_TURNS:
            continue
        within = own[0][(own[0] >= time[run[0]]) & (own[0] <= time[run[-1]])]
        course = CubicSpline(time[run], 2.0 * np.pi * np.arange(run.size))
        found.append(np.asarray(course(within)) % (2.0 * np.pi))
    return np.concatenate([np.zeros(0), *found])
