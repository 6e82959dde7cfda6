"""A wave behind the exit that stands on the road, as near the critical speed.

A diagnosis does not try it: its cosine with viscous_damping is 0.6 (docs/second_forms.md), and a
wave of any length would name what `propose` describes.
"""

from __future__ import annotations

import numpy as np

from tirelog.physics.effects.base import Drive, Effect, Site, Values
from tirelog.physics.effects.shapes import behind, faded
from tirelog.physics.parameters import Parameter
from tirelog.vocabulary.arrays import FloatArray


def _strain(v: Values, drive: Drive, site: Site, phi_rad: FloatArray) -> FloatArray:
    late = behind(site, phi_rad, site.half_length_m)
    size = v["amplitude"] * (drive.speed_m_s / 20.0) ** v["speed_exponent"]
    wave = np.exp(-late / v["decay_m"]) * np.sin(2.0 * np.pi * late / v["wavelength_m"])
    strain: FloatArray = size * wave * faded(site, late)
    return strain


EFFECT = Effect(
    id="standing_wave",
    mechanism="a wave behind the exit edge, fixed to the road, that grows towards critical speed",
    follows=(("speed_m_s", 3),),
    acts_on=("strain",),
    parameters=(
        Parameter(
            "amplitude",
            "1",
            "A in A (v/20)^n exp(-s/d) sin(2 pi s/lambda), s = xi - L",
            0.0,
            -1e-2,
            1e-2,
            probe=6e-5,
        ),
        Parameter("wavelength_m", "m", "lambda along the tread", 0.16, 0.03, 0.6, probe=0.16),
        Parameter("decay_m", "m", "d, length in which it dies away", 0.2, 0.02, 2.0, probe=0.2),
        Parameter(
            "speed_exponent", "1", "n, power of the speed", 3.0, 0.0, 8.0, probe=3.0, free=False
        ),
    ),
    strength=("amplitude",),
    source="Gardner and Worswick 1951; Soedel, J. Sound Vib. 41, 1975",
    valid="below the critical speed; it dies away within a turn",
    valid_range={"wavelength_m": (0.03, 0.6)},
    signature="waves behind the exit alone, of one length along the tread at every speed",
    tried=False,
    strain=_strain,
)
