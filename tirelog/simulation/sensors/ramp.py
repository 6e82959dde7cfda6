"""A static test: the tire at rest is inflated (P2 4.1, Fig. 15).

With stops at which the gauge is read and some air leaks.

Ramp --pressure(t)--> pressure [Pa]; strain of every grating grows with it
"""

from __future__ import annotations

import numpy as np

from tirelog.simulation.scenario.schema import Ramp
from tirelog.vocabulary.arrays import FloatArray


def pressure(ramp: Ramp, time_s: FloatArray) -> FloatArray:
    """Inflation pressure [Pa] at `time_s`: constant, a steady rise with stops in it, constant.

    Each stop loses `leak_Pa`.
    """
    corners, values = [ramp.begin_s], [ramp.start_Pa]
    stops = sorted(ramp.stops_s)
    rising = ramp.end_s - ramp.begin_s - len(stops) * ramp.stop_length_s
    rate = (ramp.end_Pa - ramp.start_Pa + len(stops) * ramp.leak_Pa) / rising
    for stop in stops:
        held = values[-1] + rate * (stop - corners[-1])
        corners += [stop, stop + ramp.stop_length_s]
        values += [held, held - ramp.leak_Pa]
    return np.asarray(np.interp(time_s, [*corners, ramp.end_s], [*values, ramp.end_Pa]), float)


def strain(ramp: Ramp, time_s: FloatArray) -> FloatArray:
    """Strain against the start of the ramp.

    Slope times the pressure's rise, and its square by `bend_1_Pa`.
    """
    rise = pressure(ramp, time_s) - ramp.start_Pa
    return ramp.strain_per_Pa * rise * (1.0 + ramp.bend_1_Pa * rise)
