"""Shallower tread: the exit side carries more, and the lever arm is shorter (P3 Figs. 5, 6)."""

from __future__ import annotations

from tirelog.physics.effects.base import Drive, Effect, Site, Values
from tirelog.physics.parameters import Parameter
from tirelog.physics.pressure import bell
from tirelog.physics.spectral import ComplexArray
from tirelog.vocabulary.arrays import FloatArray

#: Distance [km] after which the tread counts as worn: A = distance / 40000.
LIFE_KM = 40000.0


def _pressure(v: Values, drive: Drive, site: Site) -> ComplexArray:
    height = v["amplitude"] * (drive.distance_km / LIFE_KM) * site.mean_pressure
    return bell(
        height, v["position"] * site.half_length_m, v["width"] * site.half_length_m, site.radius_m
    )


def _lever(v: Values, drive: Drive) -> FloatArray:
    return 1.0 - v["lever_loss"] * (drive.distance_km / LIFE_KM)


EFFECT = Effect(
    id="wear",
    mechanism="shallower tread: exit side carries more, shorter lever arm",
    follows=(("distance_km", 1),),
    acts_on=("contact_pressure", "sensor"),
    parameters=(
        Parameter(
            "amplitude",
            "1",
            "a in a A F/(2L) exp(-((xi - x0 L)/(s L))^2/2), A = distance/40000 km",
            0.0,
            0.0,
            5.0,
            probe=0.3,
        ),
        Parameter("lever_loss", "1", "b in the lever arm y (1 - b A)", 0.0, -1.0, 1.0, probe=0.2),
        Parameter(
            "position", "1", "x0, place of the added pressure over L", 0.85, 0.3, 1.3, probe=0.85
        ),
        Parameter("width", "1", "s, its width over L", 0.18, 0.03, 1.0, probe=0.18),
    ),
    strength=("amplitude", "lever_loss"),
    source="P3 Figs. 5, 6 (no equation is given there; errata)",
    valid="up to the tread's life, about 40,000 km",
    valid_range={"distance_km": (0.0, LIFE_KM)},
    signature="exit side heavier than the entry side, the "
    "same at every speed, growing with distance",
    needs=("distance_km",),
    pressure=_pressure,
    lever=_lever,
)
