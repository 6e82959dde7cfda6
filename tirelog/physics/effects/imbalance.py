"""A wheel out of balance: at the sensor's place the load is higher or lower by m r omega^2.

A diagnosis does not try it: for one sensor it is aero_load with either sign. Sensors at several
places of one tire have it by the cosine of the angle between them.
"""

from __future__ import annotations

from tirelog.physics.effects.base import Drive, Effect, Values
from tirelog.physics.parameters import Parameter
from tirelog.vocabulary.arrays import FloatArray


def _added_load(v: Values, drive: Drive) -> FloatArray:
    return v["force_N"] * (drive.speed_m_s / 20.0) ** 2


EFFECT = Effect(
    id="imbalance",
    mechanism="a wheel out of balance presses with m r omega^2 when the sensor is down",
    follows=(("speed_m_s", 2),),
    acts_on=("load",),
    parameters=(
        Parameter(
            "force_N",
            "N",
            "m r (20 / R)^2 cos(place), force at 20 m/s when the sensor is at the patch",
            0.0,
            -500.0,
            500.0,
            probe=100.0,
        ),
    ),
    strength=("force_N",),
    source="a rotating mass; 0.1 kg at 0.2 m and R = 0.3 m are 89 N at 20 m/s",
    valid="well below the hop of the wheel (12 to 15 Hz), about 20 m/s",
    valid_range={"speed_m_s": (0.0, 20.0)},
    signature="as a load that grows with speed squared, with either sign",
    tried=False,
    added_load=_added_load,
)
