"""The samples around the fronts of a log, cleared of what is not the patch.

Read in pieces, divided by the level, gravity taken off.

Dips, WheelAngle --level, tilt, speed, acceleration at each passage--> Flanks (entries, then exits)
Flanks, half widths --pieces of the channel--> groups of fronts whose samples were read together
                    --angle, a / level - gravity--> owner (s,), angle from the front (s,) [rad],
                                                    level left (s,)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tirelog.data.recording import Channel
from tirelog.vocabulary.arrays import FloatArray, IntArray
from tirelog.wheel.angle import WheelAngle
from tirelog.wheel.fronts.dips import DEGREE, Dips

#: samples read at once (1 MB)
PIECE = 1 << 17


@dataclass(frozen=True)
class Flanks:
    """Both fronts of n passages, shape (2 n,), entries first.

    `angle` at which the front is thought to be, `middle` the patch's middle, `level`, `tilt` of a /
    Omega^2 outside with gravity's part taken off, `gravity` [m/s^2] in the signal, `ahead` the
    vehicle's acceleration, `noise` [m/s^2] of a sample, `level_share` standard error of the level
    for a noise of one, `angle_noise` [rad] of the wheel angle.
    """

    angle: FloatArray
    middle: FloatArray
    level: FloatArray
    tilt: FloatArray
    noise: FloatArray
    level_share: FloatArray
    gravity: float
    ahead: FloatArray
    rate: FloatArray
    angle_noise: FloatArray

    def take(self, which: IntArray) -> Flanks:
        fewer: dict[str, Any] = {
            k: v[which] for k, v in self.__dict__.items() if isinstance(v, np.ndarray)
        }
        return replace(self, **fewer)

    @property
    def passages(self) -> int:
        return int(self.angle.size // 2)

    def moved(self, angle: FloatArray) -> Flanks:
        good = np.isfinite(angle) & (np.abs(angle - self.angle) < 3 * DEGREE)
        return replace(self, angle=np.where(good, angle, self.angle))


def flanks_of(
    dips: Dips, wheel: WheelAngle, channel: Channel, radius_m: float, gravity: float
) -> Flanks:
    middle = 0.5 * (dips.entry_rad + dips.exit_rad)
    level = dips.level - gravity * dips.gravity_level
    tilt = dips.tilt - gravity * dips.gravity_tilt
    time = wheel.angle.time_at(middle)
    span = 0.1
    ahead = (
        radius_m * (wheel.speed_rad_s(time + span / 2) - wheel.speed_rad_s(time - span / 2)) / span
    )
    noise = np.full(middle.size, float(np.median(dips.noise_m_s2)))
    twice = [
        np.tile(x, 2)
        for x in (
            middle,
            level,
            tilt,
            noise,
            dips.level_share,
            np.nan_to_num(ahead),
            wheel.speed_rad_s(time),
            wheel.angle.noise_at(time),
        )
    ]
    middle2, level2, tilt2, noise2, share2, ahead2, rate2, angle2 = twice
    return Flanks(
        np.concatenate([dips.entry_rad, dips.exit_rad]),
        middle2,
        level2,
        tilt2,
        noise2,
        share2,
        gravity,
        ahead2,
        rate2,
        angle2,
    )


def ranges(
    channel: Channel, wheel: WheelAngle, flanks: Flanks, windows: FloatArray
) -> tuple[IntArray, IntArray]:
    """First and last-but-one sample index of each front's window."""
    order = np.argsort(flanks.angle)
    first, last = np.zeros(order.size, np.int64), np.zeros(order.size, np.int64)
    for bound, shift in ((first, -1.0), (last, 1.0)):
        time = wheel.angle.time_at(flanks.angle[order] + shift * windows[order])
        bound[order] = np.ceil(channel.axis.index(np.nan_to_num(time, nan=-1.0)))
    first = np.clip(first, 0, channel.size)
    return first, np.clip(last, first, channel.size)


def groups(
    channel: Channel, first: IntArray, last: IntArray
) -> Iterator[tuple[IntArray, int, FloatArray]]:
    """(rows, index of the first value, values) of the channel, piece by piece.

    Around the sample ranges [first, last), shape (k,); rows whose samples are strewn over more than
    a few pieces are left out.
    """
    order = np.argsort(first, kind="stable")
    at = 0
    while at < order.size:
        start = int(first[order[at]])
        until = at + max(int(np.searchsorted(first[order[at:]], start + PIECE)), 1)
        group = order[at:until]
        at = until
        stop = int(last[group].max(initial=start))
        if stop - start > 4 * PIECE:
            group = group[last[group] - start <= 4 * PIECE]
            stop = int(last[group].max(initial=start))
        if stop > start:
            yield group, start, channel.read(start, stop)[: stop - start]


def normalised(
    values: FloatArray,
    start: int,
    channel: Channel,
    wheel: WheelAngle,
    flanks: Flanks,
    first: IntArray,
    last: IntArray,
) -> tuple[IntArray, FloatArray, FloatArray]:
    """(owner, angle from the owner's front [rad], signal in levels outside), each (s,).

    Of the samples [first, last) of n fronts, which lie in `values` from index `start`.
    """
    sizes = last - first
    owner = np.repeat(np.arange(first.size), sizes)
    index = (
        np.arange(sizes.sum())
        - np.repeat(np.cumsum(sizes) - sizes, sizes)
        + np.repeat(first, sizes)
    )
    theta = wheel.angle.at(channel.axis.at(index.astype(np.float64)))
    phi = theta - flanks.middle[owner]
    a = values[index - start] - flanks.gravity * np.cos(phi)
    if flanks.gravity:
        a = a - np.sign(flanks.gravity) * flanks.ahead[owner] * np.sin(phi)
    scale = flanks.rate[owner] ** 2 * (flanks.level[owner] + flanks.tilt[owner] * phi)
    return owner, theta - flanks.angle[owner], a / scale
