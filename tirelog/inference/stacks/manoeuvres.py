"""Contiguous stretches of one regime: the unit of replication.

    speed (n,), time (n,) of one log's revolutions -> acceleration (n,) -> regime (n,)
        -> manoeuvre (n,) 0, 1, 2, ...

Neighbouring revolutions share road, load and warmth; a test that flips their signs one by one
raises alarms on nothing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tirelog.vocabulary.arrays import FloatArray

#: size of the acceleration [m/s^2] below which a stretch is a cruise; twice as much calls a gentle
#: coasting down a cruise
CRUISE_M_S2 = 0.2
#: deceleration [m/s^2] from which it is braking rather than coasting; twice as much calls ordinary
#: braking coasting
BRAKE_M_S2 = 1.5
#: a stretch shorter than this many revolutions belongs to its neighbour; twice as many join short
#: brakings to what is beside them
SHORTEST = 4
#: revolutions to either side over which an acceleration is the slope of the speed; twice as many
#: tell it to a third of the error, and round its steps off over twice as long
_HALF_WINDOW = 3


def accelerations(time_s: FloatArray, speed_m_s: FloatArray) -> FloatArray:
    """Acceleration (n,) [m/s^2]: slope of the speed over +-3 revolutions."""
    n = time_s.size
    if n < 3:
        return np.zeros(n)
    low = np.clip(np.arange(n) - _HALF_WINDOW, 0, n - 1)
    high = np.clip(np.arange(n) + _HALF_WINDOW, 0, n - 1) + 1
    sums = [
        np.concatenate([[0.0], np.cumsum(x)])
        for x in (time_s, speed_m_s, time_s**2, time_s * speed_m_s)
    ]
    t, v, tt, tv = (s[high] - s[low] for s in sums)
    count = high - low
    spread = tt - t * t / count
    slope: FloatArray = (tv - t * v / count) / np.where(spread > 0, spread, 1.0)
    return slope


def regimes(acceleration_m_s2: FloatArray) -> NDArray[np.str_]:
    """'cruise', 'drive', 'coast' or 'brake' for each revolution."""
    a = acceleration_m_s2
    return np.select(
        [np.abs(a) < CRUISE_M_S2, a > 0, a > -BRAKE_M_S2], ["cruise", "drive", "coast"], "brake"
    ).astype(np.str_)


def segment(
    regime: NDArray[np.str_], breaks: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.str_]]:
    """The manoeuvre (n,), numbered from 0, and the regime (n,) of each revolution.

    `breaks[i]` True: a gap lies before revolution i.

    A stretch below `SHORTEST` joins the longer of its neighbours that no gap parts from it. Between
    two gaps it joins the stretch before it, and the first of a log the one after it: so few
    revolutions are no manoeuvre, and none is left out. Each joining leaves one stretch less, so it
    ends.
    """
    regime, breaks = regime.copy(), breaks.copy()
    while True:
        start = np.flatnonzero(np.r_[True, (regime[1:] != regime[:-1]) | breaks[1:]])
        length = np.diff(np.r_[start, regime.size])
        short = np.flatnonzero(length < SHORTEST)
        if not short.size or start.size == 1:
            break
        i = short[np.argmin(length[short])]
        before = length[i - 1] if i > 0 and not breaks[start[i]] else -1
        after = length[i + 1] if i + 1 < start.size and not breaks[start[i + 1]] else -1
        joins_before = before >= after if max(before, after) >= 0 else i > 0
        regime[start[i] : start[i] + length[i]] = (
            regime[start[i] - 1] if joins_before else regime[start[i + 1]]
        )
        breaks[start[i] if joins_before else start[i + 1]] = False
    return np.repeat(np.arange(start.size), length), regime
