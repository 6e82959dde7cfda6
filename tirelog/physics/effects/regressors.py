"""Effects on the phase shift and the patch width, numbers per revolution (P4 IV): terms in rad.

They are linear regressors rather than mechanisms of the waveform. Their order here is that of the
catalogue.
"""

from __future__ import annotations

import numpy as np

from tirelog.physics.effects.base import CATALOGUE_G_M_S2, Drive, Site
from tirelog.physics.effects.definition import effect, number
from tirelog.physics.spectral import Parameter
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import computed_from

_BOTH = computed_from("regressors")
_PHASE = ("phase_shift",)
#: Inflation pressure [Pa] that the regressor `inflation` counts from (P4: 2.0 bar nominal).
NOMINAL_PRESSURE_PA = 2.0e5


def _angle(description: str, bound: float = 0.5) -> Parameter:
    """A number [rad] that starts at zero, of either sign."""
    return number(0.0, -bound, bound, "rad", description, probe=0.01)


@effect(
    "regressor",
    follows=(("speed_m_s", 1),),
    valid_range={"speed_m_s": (10.0, 25.0)},
    observables=_BOTH,
    # what rolling and air do to the phase shift, they do by the force
    stands_for={"phase_shift": ("longitudinal_force_N",)},
    linear_rad=_angle("a in a (v/20) + b (v/20)^2"),
    quadratic_rad=_angle("b in a (v/20) + b (v/20)^2"),
)
def speed_trend(
    drive: Drive, site: Site, observable: str, *, linear_rad: float, quadratic_rad: float
) -> FloatArray:
    """Second-order polynomial of speed: rolling resistance and aerodynamic force.

    Signature: phase shift and width follow speed in quasi-static driving
    Valid: the speeds of the ramp it was learnt on (10 to 25 m/s)
    Source: P4 IV, Fig. 9
    """
    x = drive.speed_m_s / 20.0
    return linear_rad * x + quadratic_rad * x**2


@effect(
    "regressor",
    follows=(("load_N", 1),),
    reads=("load",),
    observables=_PHASE,
    per_relative_load_rad=_angle("a in a (F / F_nominal - 1)"),
    nominal_load_N=number(3500.0, 1.0, 1e6, "N", "F_nominal", free=False),
)
def load_crosstalk(
    drive: Drive,
    site: Site,
    observable: str,
    *,
    per_relative_load_rad: float,
    nominal_load_N: float,
) -> FloatArray:
    """Phase shift that follows the vertical load.

    Signature: a phase shift on a wheel that carries no longitudinal force
    Valid: small changes of load; needs a load that varies (measured, or by load_transfer)
    Source: P4 IV (1)-(3)
    """
    return per_relative_load_rad * (site.load_N / nominal_load_N - 1.0)


@effect(
    "regressor",
    follows=(("speed_m_s", 1),),
    observables=_PHASE,
    delay_s=number(0.0, -0.1, 0.1, "s", "delay of the sensor behind the encoder", probe=1e-3),
)
def telemetry_delay(drive: Drive, site: Site, observable: str, *, delay_s: float) -> FloatArray:
    """Constant delay between encoder and radio-linked sensor, Omega x delay.

    Signature: phase shift in proportion to speed
    Valid: constant delay; cannot be told from the linear part of speed_trend
    Source: P4, errata
    """
    return delay_s * drive.speed_m_s / site.radius_m


@effect(
    "regressor",
    follows=(("acceleration_m_s2", 1),),
    needs=("acceleration_m_s2",),
    observables=_PHASE,
    amplitude_rad=_angle("cosine part over one tooth", 0.1),
    slope_rad=_angle("sine part over one tooth", 0.1),
    phase_per_g_rad=number(
        0.05,
        -1.0,
        1.0,
        "rad",
        "phase shift at 1 g of acceleration, that moves the patch over the teeth",
    ),
    steps=number(48.0, 1.0, 1e4, "1", "teeth of the wheel", free=False),
)
def tooth_pitch(
    drive: Drive,
    site: Site,
    observable: str,
    *,
    amplitude_rad: float,
    slope_rad: float,
    phase_per_g_rad: float,
    steps: float,
) -> FloatArray:
    """Pitch error of the tone wheel, periodic from tooth to tooth.

    Signature: a ripple on the phase shift as the force moves it over the teeth
    Valid: once the encoder's own pitch table has been taken out
    Source: P4, errata
    """
    angle = steps * (phase_per_g_rad * drive.acceleration_m_s2 / CATALOGUE_G_M_S2)
    return amplitude_rad * (np.cos(angle) - 1.0) + slope_rad * np.sin(angle)


@effect(
    "regressor",
    follows=(("inflation_pressure_Pa", 1),),
    valid_range={
        "inflation_pressure_Pa": (NOMINAL_PRESSURE_PA - 0.5e5, NOMINAL_PRESSURE_PA + 0.5e5)
    },
    needs=("inflation_pressure_Pa",),
    observables=_BOTH,
    per_relative_pressure_rad=_angle("a in a (p / 2.0 bar - 1)"),
)
def inflation(
    drive: Drive, site: Site, observable: str, *, per_relative_pressure_rad: float
) -> FloatArray:
    """A softer tire has a longer patch and winds up more.

    Signature: a step from log to log with inflation pressure
    Valid: 0.5 bar around nominal
    Source: P4 V (1.6 and 2.0 bar)
    """
    return per_relative_pressure_rad * (drive.inflation_pressure_Pa / NOMINAL_PRESSURE_PA - 1.0)


@effect(
    "regressor",
    follows=(("longitudinal_force_N", 1),),
    needs=("longitudinal_force_N",),
    observables=_PHASE,
    per_force_rad_N=number(
        0.0,
        -1e-3,
        1e-3,
        "rad/N",
        "1 / (2 pi R^2 k_v), k_v of the sidewalls against winding up",
        probe=1e-5,
    ),
)
def wind_up(drive: Drive, site: Site, observable: str, *, per_force_rad_N: float) -> FloatArray:
    """Sidewalls that the longitudinal force winds up, F_x / (2 pi R^2 k_v).

    Signature: phase shift in proportion to the measured force, also at constant speed
    Valid: a force that is measured; without one per_acceleration_rad_s2_m stands for it, and the
        drag of constant speed is in speed_trend
    Source: P4 III, errata
    """
    return per_force_rad_N * drive.longitudinal_force_N
