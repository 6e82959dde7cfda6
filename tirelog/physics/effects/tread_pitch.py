"""Blocks of the tread bend the belt between them while they are pressed on the road.

Waves of the pressure much shorter than 1 / lambda of P1 bend the belt by themselves: EJ q^4 w =
a p cos, so that the strain under the sensor is y a p / (EJ q^2). The pattern turns with the tire,
so one sensor always reads the same phase. A diagnosis does not try it: patch length, stiffness and
lever arm take half of it, and what a name more costs is not counted (docs/second_forms.md).
"""

from __future__ import annotations

import numpy as np

from tirelog.physics.effects.base import Drive, Effect, Site, Values
from tirelog.physics.parameters import Parameter
from tirelog.vocabulary.arrays import FloatArray


def _strain(v: Values, drive: Drive, site: Site, phi_rad: FloatArray) -> FloatArray:
    x = phi_rad * site.radius_m / site.half_length_m
    return v["strain_m_N"] * (1.5 * site.mean_pressure) * np.maximum(1.0 - x * x, 0.0)


EFFECT = Effect(
    id="tread_pitch",
    mechanism="bending between the tread's blocks, strain in proportion to the pressure above",
    follows=(("load_N", 1),),
    acts_on=("strain",),
    parameters=(
        Parameter(
            "strain_m_N",
            "m/N",
            "y a cos(phase) P^2 / (4 pi^2 EJ), strain per line load, for blocks of pitch P",
            0.0,
            -1e-7,
            1e-7,
            probe=1e-9,
        ),
    ),
    strength=("strain_m_N",),
    source="P1 (2) at waves shorter than 1 / lambda, with a pressure a p cos(2 pi s / P)",
    valid="pitches well below 2 pi / lambda; pressure of the parabola",
    signature="even, inside the patch alone, the same at every speed, of either sign",
    tried=False,
    strain=_strain,
)
