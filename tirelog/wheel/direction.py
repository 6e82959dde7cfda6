"""Which way the wheel rolled after a standstill, if its one-track encoder does not show it.

    stretches, a vehicle speed with a sign --mean over each stretch--> ways (1, -1)
    wheel angle, placings --what nothing tells--> untold (stretches,)

A turning point that the signal shows and the tone wheel's own pattern are used before
(`dsp.encoder.teeth`, `dsp.encoder.pitch`); what is left is told by the vehicle's speed, if it has a
sign, or by a speed at which nobody drives backwards.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tirelog.data.recording import Channel
from tirelog.dsp.encoder.angle import AngleFunction
from tirelog.dsp.encoder.pitch import Placing, StretchSums
from tirelog.dsp.encoder.teeth import FASTEST_BACK_Hz

#: a wheel that turns this fast, in turns per second, on both sides of a hole in its signal did not
#: stand in it: 1 m/s on a car; doubled, more holes count as standstills and cost a direction
ROLLING_TURNS_S = 0.5
#: a mean speed below this [m/s] tells no direction; doubled, a car that creeps at 0.3 m/s
#: has none
CREEP_M_S = 0.15
#: samples of the vehicle's speed read at once
PIECE = 1 << 17


def ways_of(stretches: Sequence[StretchSums], vehicle: Channel | None) -> dict[int, int]:
    """The direction of stretches, by number, that a vehicle speed [m/s] tells.

    None of them if it never falls below zero: it has no sign.
    """
    ways: dict[int, int] = {}
    if vehicle is None or len(stretches) < 2:
        return ways
    for stretch in stretches:
        first, last = (
            int(i) for i in vehicle.axis.index(np.array([stretch.begin_s, stretch.end_s]))
        )
        total, known = 0.0, 0
        for at in range(first, last + 1, PIECE):
            values = vehicle.read(at, min(at + PIECE, last + 1))
            total, known = total + float(np.nansum(values)), known + int(np.isfinite(values).sum())
        if abs(total) > CREEP_M_S * known:
            ways[stretch.number] = 1 if total > 0 else -1
    return ways if -1 in ways.values() else {}


def untold_stretches(angle: AngleFunction, placings: Sequence[Placing]) -> np.ndarray:
    """Stretches after a standstill whose direction nothing tells, shape (n,).

    Neither the tone wheel, nor the vehicle, nor the speed.
    """
    untold = np.zeros(len(placings), bool)
    for number in range(1, len(placings)):
        low, high = np.searchsorted(angle.stretch, [number, number + 1])
        beside = np.abs(angle.rate_rad_s[[max(low - 1, 0), min(low, angle.stretch.size - 1)]])
        if beside.min() > ROLLING_TURNS_S * 2 * np.pi:  # a hole in the signal, and no standstill
            untold[number] = untold[number - 1]
            continue
        fast = bool(np.any(np.abs(angle.rate_rad_s[low:high]) > FASTEST_BACK_Hz * 2 * np.pi))
        untold[number] = not (placings[number].told or fast)
    return untold
