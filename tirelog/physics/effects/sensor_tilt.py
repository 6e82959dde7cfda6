"""An accelerometer that is glued askew reads a share of the tangential acceleration.

In a steadily turning belt that keeps its length the tangential acceleration's modes are -i / n of
the radial ones (position R + u_r outwards, u_r = -u_t': a_r = omega^2 (1 - n^2) U and
a_t = i omega^2 (n^2 - 1) / n U); of gravity and the vehicle's acceleration, which alone have n = 1,
they are +i. A diagnosis does not try it: sensor_lag and pressure_offset are odd about the patch
too, and what a name more costs is not counted.
"""

from __future__ import annotations

import numpy as np

from tirelog.physics.effects.base import Drive, Effect, Site, Values
from tirelog.physics.parameters import Parameter
from tirelog.physics.spectral import MODES, ComplexArray


def _transfer(v: Values, drive: Drive, site: Site) -> ComplexArray:
    n = np.arange(MODES)
    along = np.zeros((1, MODES), dtype=np.complex128)
    along[0, 1:] = -1j / n[1:]
    along[0, 1] = 1j
    return 1.0 + v["tilt_rad"] * along


EFFECT = Effect(
    id="sensor_tilt",
    mechanism="an accelerometer askew in the wheel's plane: a_r + tilt a_t",
    follows=(("acceleration_m_s2", 1),),
    acts_on=("sensor",),
    parameters=(
        Parameter(
            "tilt_rad",
            "rad",
            "tilt of its axis towards the direction of rolling on",
            0.0,
            -0.5,
            0.5,
            probe=0.05,
        ),
    ),
    strength=("tilt_rad",),
    source="kinematics of a turning belt of constant length (P3 w = -dv/dtheta)",
    valid="tilts of some degrees; without the mean, which AC coupling takes",
    valid_range={"tilt_rad": (-0.2, 0.2)},
    signature="odd about the patch centre, and gravity turned by the tilt",
    observables=("radial_acceleration",),
    tried=False,
    transfer=_transfer,
)
