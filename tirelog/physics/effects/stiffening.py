"""A foundation that hardens with deflection, k (1 + k3 w^2) (outlook (iii) of P1 and P2).

Or one that softens, k (1 - k3 w^2), as a sidewall that buckles outwards; a diagnosis tries the
hardening one.
"""

from __future__ import annotations

from tirelog.physics.effects.base import Drive, Effect, Structure, Values
from tirelog.physics.parameters import Parameter


def _structure(v: Values, drive: Drive) -> Structure:
    return Structure(cubic=-v["cubic_1_m2"] if v["law:softens"] else v["cubic_1_m2"])


EFFECT = Effect(
    id="stiffening",
    mechanism="foundation that hardens with deflection, k (1 + k3 w^2)",
    follows=(("load_N", 1),),
    acts_on=("structure",),
    parameters=(
        Parameter("cubic_1_m2", "1/m^2", "k3 in k (1 +- k3 w^2)", 0.0, 0.0, 1e5, probe=3e3),
    ),
    strength=("cubic_1_m2",),
    source="P1, P2, outlook (iii)",
    valid='k3 w^2 up to about 10; law = "hardens", or "softens" as long as the foundation does not '
    "give way (k3 w^2 below about 1/3)",
    signature="even; the patch centre is held back, more at high load",
    options={"law": ("hardens", "softens")},
    structure=_structure,
)
