"""Rate-independent loss that falls as the rubber warms (P1 1: hysteresis falls with temperature).

A diagnosis does not try it: in a log that hardly warms it is `hysteresis`.
"""

from __future__ import annotations

import numpy as np

from tirelog.physics.effects.base import Drive, Effect, Structure, Values
from tirelog.physics.parameters import Parameter


def _structure(v: Values, drive: Drive) -> Structure:
    return Structure(loss=v["loss_factor"] * np.exp(-v["fall_1_K"] * drive.temperature_K))


EFFECT = Effect(
    id="warm_hysteresis",
    mechanism="rate-independent loss that falls with temperature, k (1 + i eta exp(-b dT))",
    follows=(("temperature_K", 1),),
    acts_on=("structure",),
    parameters=(
        Parameter(
            "loss_factor", "1", "eta, loss factor at the reference", 0.0, 0.0, 1.0, probe=0.1
        ),
        Parameter(
            "fall_1_K",
            "1/K",
            "b, share of the loss that a kelvin takes (rubber: some 0.01)",
            0.01,
            -0.1,
            0.1,
            probe=0.01,
        ),
    ),
    strength=("loss_factor",),
    source="P1 1, 3.2",
    valid="changes of temperature of some tens of kelvin, away from the glass transition",
    valid_range={"loss_factor": (0.0, 0.5), "temperature_K": (-40.0, 80.0)},
    signature="odd about the patch centre like hysteresis, weaker the warmer the tire is",
    needs=("temperature_K",),
    tried=False,
    structure=_structure,
)
