"""The belt's own viscosity, E + eta d/dt of P1 (22) in bending.

A diagnosis does not try it: what it does to the strain of a beam, at 8 to 24 m/s, has a cosine of
0.7 with viscous_damping and of -0.8 to -0.9 with pressure_offset, and a third name for an odd part
would make logs ambiguous that have one now. Whoever knows the rubber adds it.
"""

from __future__ import annotations

from tirelog.physics.effects.base import Drive, Effect, Structure, Values
from tirelog.physics.parameters import Parameter


def _structure(v: Values, drive: Drive) -> Structure:
    return Structure(retardation=v["retardation_s"])


EFFECT = Effect(
    id="belt_viscosity",
    mechanism="viscosity of the belt in bending, EJ (1 + tau d/dt) w'''' (Kelvin-Voigt)",
    follows=(("speed_m_s", 1),),
    acts_on=("structure",),
    parameters=(
        Parameter(
            "retardation_s",
            "s",
            "tau = eta / E of the belt's material in bending",
            0.0,
            0.0,
            0.1,
            probe=1e-4,
        ),
    ),
    strength=("retardation_s",),
    source="P1 (22); steady, d/dt = c d/dxi (errata)",
    valid="bending waves slower than 1 / tau",
    signature="odd about the patch centre and in proportion to speed, like viscous damping, with "
    "more of its short waves",
    tried=False,
    structure=_structure,
)
