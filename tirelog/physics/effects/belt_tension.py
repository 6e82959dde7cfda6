"""Pre-tension of the belt from inflation and rotation, T kappa^2.

With the belt's uniform stretch (P3).
"""

from __future__ import annotations

import numpy as np

from tirelog.physics.effects.base import Drive, Effect, Structure, Values
from tirelog.physics.parameters import Parameter
from tirelog.vocabulary.arrays import FloatArray

#: inflation pressure [Pa] at which T0 holds; if a log does not know its own, it is taken to be
#: this
REFERENCE_PRESSURE_PA = 2.2e5


def _structure(v: Values, drive: Drive) -> Structure:
    """T0 grows with the inflation pressure, as p0 b R does; the rotation's share does not."""
    pressure = drive.inflation_pressure_Pa
    inflated = np.where(np.isfinite(pressure), pressure / REFERENCE_PRESSURE_PA, 1.0)
    return Structure(
        tension=v["tension_N"] * inflated + v["tension_mass_kg_m"] * drive.speed_m_s**2
    )


def _baseline(v: Values, drive: Drive) -> FloatArray:
    return v["stretch_s2_m2"] * drive.speed_m_s**2


EFFECT = Effect(
    id="belt_tension",
    mechanism="pre-tension T kappa^2 from inflation and rotation, with the belt's uniform stretch",
    follows=(("inflation_pressure_Pa", 1), ("speed_m_s", 2)),
    acts_on=("structure", "baseline"),
    parameters=(
        Parameter(
            "tension_N",
            "N",
            "T0, tension at standstill and 2.2 bar (p0 b R in P3), in proportion to the pressure",
            0.0,
            0.0,
            2e4,
            probe=200.0,
        ),
        Parameter(
            "tension_mass_kg_m",
            "kg/m",
            "m in T = T0 + m v^2 (rho A in P3)",
            0.0,
            0.0,
            50.0,
            probe=1.0,
        ),
        Parameter(
            "stretch_s2_m2", "s^2/m^2", "a in baseline strain a v^2", 0.0, -1e-6, 1e-6, probe=2e-8
        ),
    ),
    strength=("tension_N", "tension_mass_kg_m", "stretch_s2_m2"),
    source="P3, sigma A = p0 b R + rho A R^2 Omega^2 (errata)",
    valid="tension small against the belt's own stiffness E A",
    signature="even; widens and flattens the waveform, more "
    "at speed; baseline rises with speed squared",
    structure=_structure,
    baseline=_baseline,
)
