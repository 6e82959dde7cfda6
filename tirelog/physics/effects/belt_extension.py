"""The belt's stretch under inflation, measured (P2 Fig. 15) or by the gas law (P1 4).

A diagnosis does not try it: with one pressure per log it is the log's own offset.
"""

from __future__ import annotations

from tirelog.physics.effects.base import Drive, Effect, Values
from tirelog.physics.parameters import Parameter
from tirelog.vocabulary.arrays import FloatArray

#: absolute temperature [K] and pressure of the air [Pa] at which a change of temperature counts: a
#: gas of constant volume has p proportional to T; 10 K off is 3 % of the change
ROOM_K, AIR_PA = 293.0, 1.013e5


def _baseline(v: Values, drive: Drive) -> FloatArray:
    """b R / (E A) times the change of pressure."""
    if v["driver:temperature"]:
        change = (v["reference_pressure_Pa"] + AIR_PA) * drive.temperature_K / ROOM_K
    else:
        change = drive.inflation_pressure_Pa - v["reference_pressure_Pa"]
    return v["strain_1_Pa"] * change


EFFECT = Effect(
    id="belt_extension",
    mechanism="the belt's stretch under inflation, p b R / (E A)",
    follows=(("inflation_pressure_Pa", 1), ("temperature_K", 1)),
    acts_on=("baseline",),
    parameters=(
        Parameter(
            "strain_1_Pa", "1/Pa", "b R / (E A), strain per pressure", 0.0, -1e-7, 1e-7, probe=1e-9
        ),
        Parameter(
            "reference_pressure_Pa",
            "Pa",
            "inflation pressure at which the strain counts as none",
            2.2e5,
            0.0,
            2e6,
            probe=2.0e5,
            free=False,
        ),
    ),
    strength=("strain_1_Pa",),
    source="P2 4.1, Fig. 15 (strain grows linearly with the pressure); P1 4",
    valid='a thin ring of constant width; driver = "pressure", or "temperature" where only that is '
    "known (gas of constant volume, from room temperature)",
    signature="the whole waveform rises with the inflation pressure, the same at every speed",
    needs=("inflation_pressure_Pa",),
    instead={"inflation_pressure_Pa": "temperature_K"},
    options={"driver": ("pressure", "temperature")},
    tried=False,
    baseline=_baseline,
)
