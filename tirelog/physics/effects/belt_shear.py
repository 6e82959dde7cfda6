"""A belt that yields in shear between its plies: Timoshenko's beam (P1 (21)).

With l^2 = EJ / (G A) the bending force EJ q^4 w is EJ q^4 w / (1 + l^2 q^2), and what bends is the
cross-section's rotation, so that the strain is y w'' / (1 + l^2 q^2). P1 drops it. A diagnosis does
not try it: it is even as gauge_length is, and what a name more costs is not counted.
"""

from __future__ import annotations

from tirelog.physics.effects.base import Drive, Effect, Structure, Values
from tirelog.physics.parameters import Parameter


def _structure(v: Values, drive: Drive) -> Structure:
    return Structure(shear=v["length_m"] ** 2)


EFFECT = Effect(
    id="belt_shear",
    mechanism="a belt that yields in shear, EJ q^4 / (1 + l^2 q^2) (Timoshenko)",
    follows=(),
    acts_on=("structure",),
    # even in the length: a fit must start away from zero
    parameters=(Parameter("length_m", "m", "l = sqrt(EJ / (G A))", 0.005, 0.0, 0.1, probe=0.01),),
    strength=("length_m",),
    source="P1 (21) with its shear term; Timoshenko's beam on Winkler's foundation",
    valid="l well below the patch length; rotary inertia is left out",
    valid_range={"length_m": (0.0, 0.03)},
    signature="even; rounds the strain and deepens the dent, more of the short waves",
    tried=False,
    structure=_structure,
)
