"""Contact pressure heavier towards the entry edge, p (1 - a xi / L) (P1 3.2; P2 below (12))."""

from __future__ import annotations

import numpy as np

from tirelog.physics.effects.base import Drive, Effect, Values
from tirelog.physics.parameters import Parameter
from tirelog.vocabulary.arrays import FloatArray


def _tilt(v: Values, drive: Drive) -> FloatArray:
    return np.full((1, 1), v["offset"])


EFFECT = Effect(
    id="pressure_offset",
    mechanism="contact pressure heavier towards the entry edge",
    follows=(),
    acts_on=("contact_pressure",),
    parameters=(Parameter("offset", "1", "a in p (1 - a xi / L)", 0.0, -0.95, 0.95, probe=0.1),),
    strength=("offset",),
    source="P1 3.2; P2 below (12)",
    valid="abs(a) < 1, else the pressure pulls",
    valid_range={"offset": (-1.0, 1.0)},
    signature="odd about the patch centre, the same at every speed",
    tilt=_tilt,
)
