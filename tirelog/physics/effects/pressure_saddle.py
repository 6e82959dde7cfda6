"""Shoulders of the patch that carry more than its middle, as an under-inflated tire's do.

A diagnosis does not try it: patch length and stiffness take two thirds of it, and what is left has
a cosine of 0.6 with that of stiffening (docs/second_forms.md).
"""

from __future__ import annotations

from tirelog.physics.effects.base import Drive, Effect, Site, Values
from tirelog.physics.parameters import Parameter
from tirelog.physics.pressure import saddled_parabola
from tirelog.vocabulary.arrays import FloatArray


def _pressure(v: Values, drive: Drive, site: Site) -> FloatArray:
    size = v["a"] * (drive.speed_m_s / 20.0) ** v["speed_exponent"]
    return size * saddled_parabola(site.load_N, site.half_length_m, site.radius_m)


EFFECT = Effect(
    id="pressure_saddle",
    mechanism="shoulders of the patch carry more, p (1 + a (v/20)^n (xi^2/L^2 - 1/5))",
    follows=(("speed_m_s", 1),),
    acts_on=("contact_pressure",),
    parameters=(
        Parameter("a", "1", "a in p (1 + a (v/20)^n (xi^2/L^2 - 1/5))", 0.0, -1.2, 5.0, probe=0.3),
        Parameter(
            "speed_exponent", "1", "n, power of the speed", 0.0, 0.0, 4.0, probe=1.0, free=False
        ),
    ),
    strength=("a",),
    source="Clark (ed.), Mechanics of Pneumatic Tires, 1981: measured contact pressures",
    valid="a from -1.2 (no pressure is negative) to 5 (none in the middle)",
    valid_range={"a": (-1.2, 5.0)},
    signature="even; two humps inside the edges, a flat or lifted middle",
    tried=False,
    pressure=_pressure,
)
