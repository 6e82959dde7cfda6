"""Hydrodynamic wedge ahead of the entry edge (outlook (iv) of P1 and P2)."""

from __future__ import annotations

from tirelog.physics.effects.base import Drive, Effect, Site, Values
from tirelog.physics.parameters import Parameter
from tirelog.physics.pressure import wedge
from tirelog.physics.spectral import ComplexArray


def _pressure(v: Values, drive: Drive, site: Site) -> ComplexArray:
    height = (
        v["amplitude"] * site.mean_pressure * (drive.speed_m_s / 20.0) ** 2 * drive.water_depth_mm
    )
    return wedge(height, -site.half_length_m, v["length"] * site.half_length_m, site.radius_m)


EFFECT = Effect(
    id="water_film",
    mechanism="hydrodynamic wedge ahead of the entry edge",
    follows=(("speed_m_s", 2), ("water_depth_mm", 1)),
    acts_on=("contact_pressure",),
    parameters=(
        Parameter(
            "amplitude",
            "1/mm",
            "a in a F/(2L) (v/20)^2 depth u exp(1 - u)",
            0.0,
            0.0,
            20.0,
            probe=0.1,
        ),
        Parameter("length", "1", "s in u = (-L - xi)/(s L)", 0.4, 0.05, 2.0, probe=0.4),
    ),
    strength=("amplitude",),
    source="P1, P2, outlook (iv)",
    valid="below the onset of full aquaplaning",
    signature="lift ahead of the entry edge that grows with speed squared and water depth",
    needs=("water_depth_mm",),
    pressure=_pressure,
)
