"""Sidewalls that the inflation pressure stiffens, k (p / p_ref)^m, beside the belt's tension."""

from __future__ import annotations

from tirelog.physics.effects.base import Drive, Effect, Structure, Values
from tirelog.physics.parameters import Parameter

#: inflation pressure [Pa] at which the model's own stiffnesses hold (P4: 2.0 bar nominal)
REFERENCE_PRESSURE_PA = 2.0e5


def _structure(v: Values, drive: Drive) -> Structure:
    ratio = drive.inflation_pressure_Pa / REFERENCE_PRESSURE_PA
    return Structure(stiffening=ratio ** v["exponent"] - 1.0)


EFFECT = Effect(
    id="inflated_sidewalls",
    mechanism="sidewalls that the inflation pressure stiffens, k (p / 2.0 bar)^m",
    follows=(("inflation_pressure_Pa", 1),),
    acts_on=("structure",),
    parameters=(
        Parameter(
            "exponent",
            "1",
            "m in k (p / 2.0 bar)^m; 0: sidewalls of rubber alone, 1: of pressure alone",
            0.0,
            -1.0,
            3.0,
            probe=0.3,
        ),
    ),
    strength=("exponent",),
    source="P3, K_w and K_v of sidewalls under pressure; P4 V (1.6 and 2.0 bar)",
    valid="logs of several pressures; the belt's tension follows the pressure anyway",
    signature="from log to log: at low pressure a longer patch and wider flanks than by the belt's "
    "tension",
    needs=("inflation_pressure_Pa",),
    structure=_structure,
    observables=("strain", "radial_acceleration"),
)
