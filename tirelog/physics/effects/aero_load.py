"""Load that follows speed squared (P4 IV); the patch length follows the load."""

from __future__ import annotations

from tirelog.physics.effects.base import Drive, Effect, Values
from tirelog.physics.parameters import Parameter
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import OBSERVABLES


def _load(v: Values, drive: Drive) -> FloatArray:
    return v["coefficient"] * (drive.speed_m_s / 30.0) ** 2


EFFECT = Effect(
    id="aero_load",
    mechanism="load follows speed squared, and the patch length follows the load",
    follows=(("speed_m_s", 2),),
    acts_on=("load",),
    parameters=(
        Parameter("coefficient", "1", "a in F (1 + a (v/30)^2)", 0.0, -0.9, 2.0, probe=0.05),
    ),
    strength=("coefficient",),
    source="P4 IV",
    valid="the wheel stays on the road",
    signature="even; the waveform grows and widens with speed squared",
    observables=tuple(OBSERVABLES),
    load=_load,
)
