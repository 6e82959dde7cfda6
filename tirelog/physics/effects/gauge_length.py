"""A grating averages the strain over its length."""

from __future__ import annotations

import numpy as np

from tirelog.physics.effects.base import Drive, Effect, Site, Values
from tirelog.physics.parameters import Parameter
from tirelog.vocabulary.arrays import FloatArray


def _transfer(v: Values, drive: Drive, site: Site) -> FloatArray:
    return np.sinc(site.q * (v["length_m"] / (2.0 * np.pi)))[None, :]


EFFECT = Effect(
    id="gauge_length",
    mechanism="a grating averages over its length",
    follows=(),
    acts_on=("sensor",),
    # even in the length: a fit must start away from zero
    parameters=(
        Parameter(
            "length_m",
            "m",
            "length of the grating (fixed if it is known)",
            0.01,
            0.0,
            0.2,
            probe=0.01,
        ),
    ),
    strength=("length_m",),
    source="fibre Bragg gratings of finite length",
    valid="lengths below the patch length",
    signature="even; rounds the waveform; hardly to be told from rough_contact",
    transfer=_transfer,
)
