"""What a tire is driven under: beyond it a number is in another unit, and is refused."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.errors import ModelError, UsageError
from tirelog.physics.model.model import Model

#: A tire at less than this [Pa] stands on its rim, and bar, psi and kPa taken for Pa all lie below
#: it: a fifth of it would let 1000 (kPa) pass, twice as much is 0.1 bar, which sand and snow are
#: driven at.
LEAST_PRESSURE_PA = 5e3
#: Speeds [m/s] and accelerations [m/s^2] that a tire is driven at; beyond them a number is in
#: another unit. Twice as much lets a speed in km/h pass for m/s up to 400 km/h.
FASTEST_M_S, HARDEST_M_S2 = 200.0, 100.0
#: least, most and unit of each condition; a time of 1e7 s is a third of a year, a change of 300 K
#: would burn the rubber
_DRIVEN = {
    "speed_m_s": (0.0, FASTEST_M_S, "m/s"),
    "acceleration_m_s2": (-HARDEST_M_S2, HARDEST_M_S2, "m/s^2"),
    "time_s": (0.0, 1e7, "s"),
    "temperature_K": (-300.0, 300.0, "K of change"),
    "slip": (-1.0, 1.0, "(positive in braking)"),
}


def check_pressure(pressure_Pa: float | None) -> None:
    """ModelError for an inflation pressure that is none in Pa; nothing at all (0) is allowed."""
    if pressure_Pa is not None and not (pressure_Pa == 0.0 or pressure_Pa >= LEAST_PRESSURE_PA):
        raise ModelError(
            f"inflation_pressure_Pa = {pressure_Pa:g} is no tire's pressure in Pa",
            allowed=f"0, or {LEAST_PRESSURE_PA:g} and more, is allowed",
            do="write it in Pa (2.2 bar is 2.2e5)",
        )


def check_model(model: Model) -> None:
    """ModelError for a model whose inflation pressure is none in Pa."""
    check_pressure(model.values.get("inflation_pressure_Pa"))


def check_conditions(conditions: Conditions, called: Mapping[str, str] | None = None) -> None:
    """UsageError for conditions that no tire is driven under, ModelError for such a pressure.

    What is not known (NaN) passes, but for the speed. `called`: how the user gave a condition.
    """
    backwards = ~(np.asarray(conditions.speed_m_s) >= 0.0)
    if backwards.any():
        raise UsageError(
            f"{(called or {}).get('speed_m_s', 'speed_m_s')} "
            f"{float(conditions.speed_m_s[backwards][0]):g}",
            allowed="allowed is a speed of 0 m/s or more, forwards",
            do="give that",
        )
    for name, (low, high, unit) in _DRIVEN.items():
        values = np.asarray(getattr(conditions, name))
        outside = (values < low) | (values > high)
        if outside.any():
            name = (called or {}).get(name, name)
            raise UsageError(
                f"{name} {float(values[outside][0]):g}",
                allowed=f"{low:g} to {high:g} {unit} is allowed",
                do="correct it",
            )
    for pressure in np.unique(conditions.inflation_pressure_Pa):
        check_pressure(None if np.isnan(pressure) else float(pressure))
