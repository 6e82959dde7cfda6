"""Momentum of the arriving tread: a pressure pulse at the entry edge (outlook (i) of P1 and P2)."""

from __future__ import annotations

from tirelog.physics.effects.base import Drive, Effect, Site, Values
from tirelog.physics.parameters import Parameter
from tirelog.physics.pressure import bell
from tirelog.physics.spectral import ComplexArray


def _pressure(v: Values, drive: Drive, site: Site) -> ComplexArray:
    # arriving momentum mu c w_t is mu c^2 w': by the option the pulse grows with the square
    law = 2.0 if v["speed_law:squared"] else 1.0
    height = v["amplitude"] * site.mean_pressure * (drive.speed_m_s / 20.0) ** law
    return bell(
        height, -v["position"] * site.half_length_m, v["width"] * site.half_length_m, site.radius_m
    )


EFFECT = Effect(
    id="edge_impact",
    mechanism="momentum of the tread arriving: a pressure pulse at the entry edge",
    follows=(("speed_m_s", 1),),
    acts_on=("contact_pressure",),
    parameters=(
        Parameter(
            "amplitude",
            "1",
            "a in a F/(2L) (v/20)^n exp(-((xi + x0 L)/(s L))^2/2), n = 1, or 2 if squared",
            0.0,
            0.0,
            20.0,
            probe=0.5,
        ),
        Parameter("position", "1", "x0, place of the pulse over L", 1.0, 0.5, 1.5, probe=1.0),
        Parameter("width", "1", "s, width of the pulse over L", 0.05, 0.02, 0.5, probe=0.05),
    ),
    strength=("amplitude",),
    source="P1, P2, outlook (i)",
    valid='pulses narrower than the patch; speed_law = "linear", or "squared" as momentum that '
    "arrives with the speed has it",
    signature="a kink at the entry edge that grows with speed",
    options={"speed_law": ("linear", "squared")},
    pressure=_pressure,
)
