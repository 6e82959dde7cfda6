"""The thermal state of a rolling tire: its losses warm it, and warmth changes its losses.

    C dT/dt = P(T, p, v) - G T        (p + p_air) in proportion to the absolute temperature

T is the rise of one mean temperature of tire and air above the surroundings [K]. P is the power
that the model dissipates [W], C the heat capacity [J/K], G the cooling [W/K]; 8 kg of rubber have
some 15,000 J/K. Effects that follow temperature or pressure (`warm_hysteresis`,
`inflated_sidewalls`, `belt_tension`) take part.

T and P depend on each other: P at the last T gives the next T, until it no longer moves. Of a log
with a temperature channel C and G are fitted, with P at the measured temperature; then T is linear
in P. The tire may begin warm: what it is above the surroundings then is fitted too, since the log
knows its own rise only. The errors hold for residuals that hang together, by a jackknife over
twelve stretches of time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict

import numpy as np
from scipy.optimize import least_squares

from tirelog.data.recording import Conditions
from tirelog.data.setup import Tire
from tirelog.errors import ModelError, UsageError
from tirelog.physics.model.forces import force_columns
from tirelog.physics.model.model import Model
from tirelog.vocabulary.arrays import FloatArray

#: pressure of the air around the tire [Pa]
AIR_PA = 1.013e5


def warm_columns(
    model: Model,
    drive: Conditions,
    capacity_J_K: float,
    cooling_W_K: float,
    ambient_K: float,
    start_K: float = 0.0,
) -> dict[str, FloatArray]:
    """Columns of `tirelog model warm`, (n,): state and losses at the times of the drive.

    start_K      of the tire above the surroundings

    drive        in order of time; its `temperature_K` is not used, and a pressure that varies is
                 taken as measured
    ModelError   the model dissipates nothing, or warmth and losses do not settle
    UsageError   a number that is not above 0
    """
    if not (capacity_J_K > 0.0 and cooling_W_K > 0.0 and ambient_K > 0.0):
        raise UsageError(
            f"heat capacity {capacity_J_K:g} J/K, cooling {cooling_W_K:g} W/K, {ambient_K:g} K",
            allowed="numbers above 0 are allowed",
            do="correct them",
        )
    rise, cold_Pa = np.zeros(len(drive)), drive.inflation_pressure_Pa
    if not drive.known("inflation_pressure_Pa"):
        cold_Pa = np.full(len(drive), model.values.get("inflation_pressure_Pa", np.nan))
    measured = np.ptp(cold_Pa) > 0.0
    for _ in range(50):
        pressure = cold_Pa if measured else (cold_Pa + AIR_PA) * (1.0 + rise / ambient_K) - AIR_PA
        rows = _losses(model, drive, rise, pressure)
        power, before = rows["dissipated_power_W"], rise
        rise = risen(drive.time_s, power, capacity_J_K, cooling_W_K, start_K)
        if np.abs(rise - before).max() < 1e-3:
            break
    else:
        raise ModelError(
            "warmth and losses do not settle",
            allowed="losses that fall with temperature are allowed, or a stronger cooling",
            do="correct --cooling, or the model's effects of temperature",
        )
    kept = ("speed_m_s", "load_N", "inflation_pressure_Pa", "dissipated_power_W")
    return {
        "time_s": drive.time_s,
        "temperature_K": rise,
        "measured_temperature_K": drive.temperature_K + start_K,
        **{name: rows[name] for name in (*kept, "rolling_resistance_N")},
    }


def _losses(
    model: Model, drive: Conditions, rise: FloatArray, pressure_Pa: FloatArray
) -> dict[str, FloatArray]:
    """`model forces` at a temperature and a pressure."""
    given = asdict(drive) | {"temperature_K": rise, "inflation_pressure_Pa": pressure_Pa}
    rows = force_columns(model, Conditions(**given), Tire())
    if not np.max(rows["dissipated_power_W"]) > 1e-6:
        raise ModelError(
            "the model dissipates nothing",
            allowed="losses are needed, such as those of viscous_damping or hysteresis",
            do="add one with `tirelog model add MODEL hysteresis --set loss_factor=0.1 -o NEW`",
        )
    return rows


def risen(
    time_s: FloatArray,
    power_W: FloatArray,
    capacity_J_K: float,
    cooling_W_K: float,
    start_K: float,
) -> FloatArray:
    """T [K] (n,) from `start_K` on, for a power that is its mean between each two times."""
    rise = np.full(time_s.size, start_K)
    faded = np.exp(-np.diff(time_s) * (cooling_W_K / capacity_J_K))
    level = 0.5 * (power_W[1:] + power_W[:-1]) / cooling_W_K
    for i, (share, end) in enumerate(zip(faded, level, strict=True)):
        rise[i + 1] = end + (rise[i] - end) * share
    return rise


def fitted_heat(
    model: Model, drive: Conditions, given: Mapping[str, float]
) -> dict[str, tuple[float, float]]:
    """(Value, standard error) of `heat_capacity` [J/K], `cooling` [W/K] and `start` [K].

    By the drive's warmth; `start` is the tire's temperature above the surroundings when the drive
    begins. A number that is `given` is kept, with an error of 0.

    UsageError: the drive has no temperature, or one that does not determine them.
    """
    changed = float(np.ptp(drive.temperature_K))
    if not changed > 0.0:  # NaN of none
        raise UsageError(
            "no temperature that changes",
            allowed="a log with a channel of kind temperature is needed to fit them",
            do="give --heat-capacity and --cooling",
        )
    pressure = drive.inflation_pressure_Pa
    power = _losses(model, drive, drive.temperature_K, pressure)["dissipated_power_W"]
    mean = float(power.mean())
    start = {
        "heat_capacity": mean * float(np.ptp(drive.time_s)) / changed,
        "cooling": 0.5 * mean / changed,
    }
    names = [name for name in start if name not in given]

    def heat(x: FloatArray) -> dict[str, float]:
        logs = dict(zip(names, x[2:], strict=True))
        return {
            name: given[name] if name in given else float(value * np.exp(logs[name]))
            for name, value in start.items()
        } | {"start": float(x[1])}

    def off(x: FloatArray) -> FloatArray:
        of = heat(x)
        rise = risen(drive.time_s, power, of["heat_capacity"], of["cooling"], of["start"])
        return np.asarray(rise - of["start"] + x[0] - drive.temperature_K)

    # the first number is the error of the first reading, off which the others are
    found = least_squares(off, np.zeros(len(names) + 2), max_nfev=200)
    whole, moves = found.jac.T @ found.jac, []
    for rows in np.array_split(np.arange(len(drive)), blocks := 12):
        own = found.jac[rows]
        moves.append(np.linalg.pinv(whole - own.T @ own) @ (own.T @ found.fun[rows]))
    errors = np.sqrt((blocks - 1) * np.var(moves, axis=0))
    # logarithms: an error of 1 is the number itself
    if not (found.success and np.all(errors[2:] < 1.0) and np.all(errors[2:] > 0.0)):
        raise UsageError(
            f"a temperature that does not determine {' and '.join(names)}",
            allowed="a log is needed that warms up, at speeds that change",
            do="give --heat-capacity and --cooling",
        )
    of, relative = heat(found.x), dict(zip(names, errors[2:], strict=True))
    return {
        name: (value, float(errors[1]) if name == "start" else value * float(relative.get(name, 0)))
        for name, value in of.items()
    }


def thinned(drive: Conditions, most: int = 400) -> Conditions:
    """Means over at most so many equal stretches of time; the first starts at time 0."""
    time_s = drive.time_s - drive.time_s[0]
    width = time_s[-1] / most if len(drive) > most else 0.0
    stretch = np.arange(len(drive)) if width == 0.0 else np.minimum(time_s // width, most - 1)
    _, index, count = np.unique(stretch, return_inverse=True, return_counts=True)
    given = asdict(drive) | {"time_s": time_s}
    return Conditions(**{name: np.bincount(index, x) / count for name, x in given.items()})
