"""Load that follows the longitudinal acceleration (P4 V); the patch length follows the load."""

from __future__ import annotations

from tirelog.physics.effects.base import CATALOGUE_G_M_S2, Drive, Effect, Values
from tirelog.physics.parameters import Parameter
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import OBSERVABLES


def _load(v: Values, drive: Drive) -> FloatArray:
    return v["coefficient"] * drive.acceleration_m_s2 / CATALOGUE_G_M_S2


EFFECT = Effect(
    id="load_transfer",
    mechanism="load follows the longitudinal acceleration, and the patch length follows the load",
    follows=(("acceleration_m_s2", 1),),
    acts_on=("load",),
    parameters=(
        Parameter(
            "coefficient", "1", "a in F (1 + a acceleration/9.81)", 0.0, -2.0, 2.0, probe=0.25
        ),
    ),
    strength=("coefficient",),
    source="P4 V",
    valid="the wheel stays on the road; positive on a rear wheel, negative on a front wheel",
    signature="even; the waveform grows and widens with acceleration",
    needs=("acceleration_m_s2",),
    observables=tuple(OBSERVABLES),
    load=_load,
)
