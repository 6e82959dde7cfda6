"""A sensor whose sensitivity follows its temperature.

A diagnosis does not try it: the lever arm takes most of it, and on a drive that warms while it gets
faster the rest has a cosine of 0.8 with belt_tension (docs/second_forms.md).
"""

from __future__ import annotations

from tirelog.physics.effects.base import Drive, Effect, Values
from tirelog.physics.parameters import Parameter
from tirelog.vocabulary.arrays import FloatArray


def _gain(v: Values, drive: Drive) -> FloatArray:
    return 1.0 + v["gain_1_K"] * drive.temperature_K


EFFECT = Effect(
    id="warm_gain",
    mechanism="a sensor whose gain follows the temperature, 1 + a dT",
    follows=(("temperature_K", 1),),
    acts_on=("sensor",),
    parameters=(
        Parameter("gain_1_K", "1/K", "a, relative change per kelvin", 0.0, -0.02, 0.02, probe=1e-3),
    ),
    strength=("gain_1_K",),
    source="data sheets of accelerometers and gauges: 0.0001 to 0.001 per kelvin",
    valid="the straight part of a sensor's curve",
    valid_range={"gain_1_K": (-0.003, 0.003)},
    signature="the whole waveform grows or shrinks with the temperature",
    needs=("temperature_K",),
    tried=False,
    gain=_gain,
)
