"""The air in the tire, struck at the entry edge, rings at its first mode around the cavity.

A diagnosis does not try it: it would stand for any ringing of a fixed frequency, which `diagnose`
describes and `propose` writes down.
"""

from __future__ import annotations

import numpy as np

from tirelog.physics.effects.base import Drive, Effect, Site, Values
from tirelog.physics.effects.shapes import ROOM_K, behind, faded
from tirelog.physics.parameters import Parameter
from tirelog.vocabulary.arrays import FloatArray

#: slower than this the time since the entry counts as at this speed [m/s]
_SLOWEST_M_S = 0.2


def _strain(v: Values, drive: Drive, site: Site, phi_rad: FloatArray) -> FloatArray:
    along = behind(site, phi_rad, -site.half_length_m)
    late = along / np.maximum(drive.speed_m_s, _SLOWEST_M_S)
    # the speed of sound goes with the root of the absolute temperature
    frequency = v["frequency_Hz"] * np.sqrt(1.0 + np.nan_to_num(drive.temperature_K) / ROOM_K)
    swing = np.exp(-late / v["decay_s"]) * np.sin(2.0 * np.pi * frequency * late)
    size = v["amplitude"] * (drive.speed_m_s / 20.0)
    strain: FloatArray = size * swing * faded(site, along)
    return strain


EFFECT = Effect(
    id="cavity_resonance",
    mechanism="the tire's air rings after the entry edge, f = c / (2 pi R_mean)",
    follows=(("speed_m_s", 1), ("temperature_K", 0.5)),
    acts_on=("strain",),
    parameters=(
        Parameter(
            "amplitude",
            "1",
            "A in A (v/20) exp(-t/T) sin(2 pi f t), t from the entry edge",
            0.0,
            -1e-2,
            1e-2,
            probe=5e-5,
        ),
        Parameter("frequency_Hz", "Hz", "f at 20 degC", 210.0, 120.0, 350.0, probe=210.0),
        Parameter("decay_s", "s", "T", 0.03, 0.002, 0.5, probe=0.03),
    ),
    strength=("amplitude",),
    source="Sakata, Morimura and Ide 1990, Thompson 1995 (Tire Science and Technology 18, 23)",
    valid="passenger tires, 180 to 260 Hz; contact splits the mode in two, of which this is one",
    valid_range={"frequency_Hz": (180.0, 260.0)},
    signature="ringing behind the entry of one frequency at every speed, higher when warm",
    tried=False,
    strain=_strain,
)
