"""Corrections of the phase shift and the patch width, numbers per revolution (P4 IV).

Terms added to them, in rad.

They are linear regressors rather than mechanisms of the waveform, so they share this file.
"""

from __future__ import annotations

import numpy as np

from tirelog.physics.effects.base import CATALOGUE_G_M_S2, Drive, Effect, Site, Values
from tirelog.physics.parameters import Parameter
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import computed_from

_BOTH = computed_from("regressors")
_PHASE = ("phase_shift",)
#: Inflation pressure [Pa] that the regressor `inflation` counts from (P4: 2.0 bar nominal).
NOMINAL_PRESSURE_PA = 2.0e5


def _angle(name: str, description: str, bound: float = 0.5) -> Parameter:
    return Parameter(name, "rad", description, 0.0, -bound, bound, probe=0.01)


def _speed(v: Values, drive: Drive, site: Site, observable: str) -> FloatArray:
    x = drive.speed_m_s / 20.0
    return v["linear_rad"] * x + v["quadratic_rad"] * x**2


def _crosstalk(v: Values, drive: Drive, site: Site, observable: str) -> FloatArray:
    return v["per_relative_load_rad"] * (site.load_N / v["nominal_load_N"] - 1.0)


def _wind_up(v: Values, drive: Drive, site: Site, observable: str) -> FloatArray:
    return v["per_force_rad_N"] * drive.longitudinal_force_N


def _delay(v: Values, drive: Drive, site: Site, observable: str) -> FloatArray:
    return v["delay_s"] * drive.speed_m_s / site.radius_m


def _pitch(v: Values, drive: Drive, site: Site, observable: str) -> FloatArray:
    angle = v["phase_per_g_rad"] * drive.acceleration_m_s2 / CATALOGUE_G_M_S2
    return v["amplitude_rad"] * (np.cos(v["steps"] * angle) - 1.0) + v["slope_rad"] * np.sin(
        v["steps"] * angle
    )


def _inflation(v: Values, drive: Drive, site: Site, observable: str) -> FloatArray:
    return v["per_relative_pressure_rad"] * (
        drive.inflation_pressure_Pa / NOMINAL_PRESSURE_PA - 1.0
    )


SPEED_TREND = Effect(
    id="speed_trend",
    mechanism="second-order polynomial of speed: rolling resistance and aerodynamic force",
    follows=(("speed_m_s", 1),),
    acts_on=("regressors",),
    parameters=(
        _angle("linear_rad", "a in a (v/20) + b (v/20)^2"),
        _angle("quadratic_rad", "b in a (v/20) + b (v/20)^2"),
    ),
    strength=("linear_rad", "quadratic_rad"),
    source="P4 IV, Fig. 9",
    valid="the speeds of the ramp it was learnt on (10 to 25 m/s)",
    valid_range={"speed_m_s": (10.0, 25.0)},
    signature="phase shift and width follow speed in quasi-static driving",
    observables=_BOTH,
    # what rolling and air do to the phase shift, they do by the force
    stands_for={"phase_shift": ("longitudinal_force_N",)},
    regressor=_speed,
)
LOAD_CROSSTALK = Effect(
    id="load_crosstalk",
    mechanism="phase shift that follows the vertical load",
    follows=(("load_N", 1),),
    acts_on=("regressors",),
    parameters=(
        _angle("per_relative_load_rad", "a in a (F / F_nominal - 1)"),
        Parameter("nominal_load_N", "N", "F_nominal", 3500.0, 1.0, 1e6, probe=3500.0, free=False),
    ),
    strength=("per_relative_load_rad",),
    source="P4 IV (1)-(3)",
    valid="small changes of load; needs a load that varies (measured, or by load_transfer)",
    signature="a phase shift on a wheel that carries no longitudinal force",
    reads=("load",),
    observables=_PHASE,
    regressor=_crosstalk,
)
WIND_UP = Effect(
    id="wind_up",
    mechanism="sidewalls that the longitudinal force winds up, F_x / (2 pi R^2 k_v)",
    follows=(("longitudinal_force_N", 1),),
    acts_on=("regressors",),
    parameters=(
        Parameter(
            "per_force_rad_N",
            "rad/N",
            "1 / (2 pi R^2 k_v), k_v of the sidewalls against winding up",
            0.0,
            -1e-3,
            1e-3,
            probe=1e-5,
        ),
    ),
    strength=("per_force_rad_N",),
    source="P4 III, errata",
    valid="a force that is measured; without one per_acceleration_rad_s2_m stands for it, and the "
    "drag of constant speed is in speed_trend",
    signature="phase shift in proportion to the measured force, also at constant speed",
    needs=("longitudinal_force_N",),
    observables=_PHASE,
    regressor=_wind_up,
)
TELEMETRY_DELAY = Effect(
    id="telemetry_delay",
    mechanism="constant delay between encoder and radio-linked sensor, Omega x delay",
    follows=(("speed_m_s", 1),),
    acts_on=("regressors",),
    parameters=(
        Parameter(
            "delay_s", "s", "delay of the sensor behind the encoder", 0.0, -0.1, 0.1, probe=1e-3
        ),
    ),
    strength=("delay_s",),
    source="P4, errata",
    valid="constant delay; cannot be told from the linear part of speed_trend",
    signature="phase shift in proportion to speed",
    observables=_PHASE,
    regressor=_delay,
)
TOOTH_PITCH = Effect(
    id="tooth_pitch",
    mechanism="pitch error of the tone wheel, periodic from tooth to tooth",
    follows=(("acceleration_m_s2", 1),),
    acts_on=("regressors",),
    parameters=(
        _angle("amplitude_rad", "cosine part over one tooth", 0.1),
        _angle("slope_rad", "sine part over one tooth", 0.1),
        Parameter(
            "phase_per_g_rad",
            "rad",
            "phase shift at 1 g of acceleration, that moves the patch over the teeth",
            0.05,
            -1.0,
            1.0,
            probe=0.05,
        ),
        Parameter("steps", "1", "teeth of the wheel", 48.0, 1.0, 1e4, probe=48.0, free=False),
    ),
    strength=("amplitude_rad", "slope_rad"),
    source="P4, errata",
    valid="once the encoder's own pitch table has been taken out",
    signature="a ripple on the phase shift as the force moves it over the teeth",
    needs=("acceleration_m_s2",),
    observables=_PHASE,
    regressor=_pitch,
)
INFLATION = Effect(
    id="inflation",
    mechanism="a softer tire has a longer patch and winds up more",
    follows=(("inflation_pressure_Pa", 1),),
    acts_on=("regressors",),
    parameters=(_angle("per_relative_pressure_rad", "a in a (p / 2.0 bar - 1)"),),
    strength=("per_relative_pressure_rad",),
    source="P4 V (1.6 and 2.0 bar)",
    valid="0.5 bar around nominal",
    valid_range={
        "inflation_pressure_Pa": (NOMINAL_PRESSURE_PA - 0.5e5, NOMINAL_PRESSURE_PA + 0.5e5)
    },
    signature="a step from log to log with inflation pressure",
    needs=("inflation_pressure_Pa",),
    observables=_BOTH,
    regressor=_inflation,
)
