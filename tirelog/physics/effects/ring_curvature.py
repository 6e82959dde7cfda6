"""A closed ring in place of the straight beam.

P3 without inflation; errata: undamped, its rotation cancels.
"""

from __future__ import annotations

from tirelog.physics.effects.base import Drive, Effect, Structure, Values
from tirelog.physics.parameters import Parameter


def _structure(v: Values, drive: Drive) -> Structure:
    return Structure(
        ring=v["fraction"], ring_tangential=v["fraction"] * v["tangential_stiffness_N_m2"]
    )


EFFECT = Effect(
    id="ring_curvature",
    mechanism="a closed ring in place of the straight beam",
    follows=(),
    acts_on=("structure",),
    parameters=(
        Parameter(
            "fraction",
            "1",
            "share of the ring's response: 0 the beam, 1 the ring",
            1.0,
            0.0,
            1.0,
            probe=1.0,
        ),
        Parameter(
            "tangential_stiffness_N_m2",
            "N/m^2",
            "k_v, tangential foundation of the ring",
            3e5,
            1e3,
            1e9,
            probe=3e5,
            free=False,
        ),
    ),
    strength=("fraction",),
    source="P3, Z_n of the errata",
    valid="an inextensible belt; a beam model only (a ring carcass is one already)",
    signature="even; adds a slow wave around the whole revolution, no trend with speed",
    structure=_structure,
)
