"""Viscous damping of the foundation, 2 mu omega_d dw/dt.

P1 (2), with the errata's sign in the direction of passing.
"""

from __future__ import annotations

from tirelog.physics.effects.base import Drive, Effect, Structure, Values
from tirelog.physics.parameters import Parameter


def _structure(v: Values, drive: Drive) -> Structure:
    return Structure(damping_rate=v["damping_rate_1_s"])


EFFECT = Effect(
    id="viscous_damping",
    mechanism="damping of the foundation, 2 mu omega_d dw/dt",
    follows=(("speed_m_s", 1),),
    acts_on=("structure",),
    parameters=(
        Parameter(
            "damping_rate_1_s", "1/s", "omega_d in 2 mu omega_d dw/dt", 0.0, 0.0, 1e4, probe=60.0
        ),
    ),
    strength=("damping_rate_1_s",),
    source="P1 (2); errata: sign of the damping term, four exact roots instead of (7)-(12)",
    valid="any damping below the critical speed; on a ring the radial foundation is damped",
    signature="odd about the patch centre, the exit side lags; grows in proportion to speed",
    structure=_structure,
)
