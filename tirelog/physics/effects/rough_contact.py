"""Asperities that smear the edges of the pressure.

The pressure p is convolved with exp(-|xi| / (s L)) (outlook (ii) of P1 and P2).
"""

from __future__ import annotations

from tirelog.physics.effects.base import Drive, Effect, Site, Values
from tirelog.physics.parameters import Parameter
from tirelog.physics.pressure import smear
from tirelog.vocabulary.arrays import FloatArray


def _kernel(v: Values, drive: Drive, site: Site) -> FloatArray:
    return smear(v["length"] * site.half_length_m, site.radius_m)


EFFECT = Effect(
    id="rough_contact",
    mechanism="asperities that smear the edges of the pressure",
    follows=(),
    acts_on=("contact_pressure",),
    # the response is even in s: at zero a fit has no slope to follow, so it starts away from it
    parameters=(
        Parameter("length", "1", "s in the kernel exp(-abs(xi)/(s L))", 0.1, 0.0, 1.0, probe=0.1),
    ),
    strength=("length",),
    source="P1, P2, outlook (ii)",
    valid="smearing shorter than the patch",
    signature="even; rounds the waveform at both edges; hardly to be told from gauge_length",
    kernel=_kernel,
)
