"""A static test: the tire at rest is inflated, with stops at which the gauge is read and some air leaks (P2 4.1, Fig. 15).

Ramp --pressure(t)--> pressure [Pa]; strain of every grating grows with it
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tirelog.simulation.scenario import Ramp

FloatArray = NDArray[np.float64]

#: step of the pressure's course [s]
_STEP_S = 0.005


def pressure(ramp: Ramp, time_s: FloatArray) -> FloatArray:
    """Inflation pressure [Pa] at `time_s`: constant, a steady rise with stops in it, constant.  Each stop loses `leak_Pa`."""
    grid = np.arange(0.0, ramp.end_s + _STEP_S, _STEP_S)
    rising = (grid >= ramp.begin_s).astype(float)
    leaking = np.zeros_like(grid)
    for stop in ramp.stops_s:
        held = (grid >= stop) & (grid < stop + ramp.stop_length_s)
        rising[held] = 0.0
        leaking += held * ramp.leak_Pa / ramp.stop_length_s
    climbed = np.cumsum(rising) * _STEP_S
    lost = np.cumsum(leaking) * _STEP_S
    rate = (ramp.end_Pa - ramp.start_Pa + lost[-1]) / max(climbed[-1], _STEP_S)
    return np.asarray(np.interp(time_s, grid, ramp.start_Pa + rate * climbed - lost), float)


def strain(ramp: Ramp, time_s: FloatArray) -> FloatArray:
    """Strain against the start of the ramp: slope times the pressure's rise, and its square by `bend_1_Pa`."""
    rise = pressure(ramp, time_s) - ramp.start_Pa
    return ramp.strain_per_Pa * rise * (1.0 + ramp.bend_1_Pa * rise)
