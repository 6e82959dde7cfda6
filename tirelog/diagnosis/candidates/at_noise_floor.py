"""Where logs or fitted numbers leave the ranges in which a model's effects are valid."""

from __future__ import annotations

import numpy as np

from tirelog.diagnosis.rules import ERROR_SIGMAS, QUIET_CHI2, QUIET_FLOORS
from tirelog.inference.base import Base, FittedChannel, JointBase, bases_by_observable
from tirelog.physics.carcass.numbers import steady_carcass
from tirelog.vocabulary.conditions import CONDITIONS

# ---- Whether what a model leaves is the noise floor.


def at_noise_floor(base: Base, floor_square: float) -> bool:
    """Is what the model leaves the noise floor?  By the held-out error and by chi-square.

    Of a held-out error goes what chance adds to it, since few manoeuvres decide the parameters, and
    of a chi-square: that of the 64 values of a number per revolution is above 1.2 in one of eight
    logs in which nothing is missing. Of several observables each has to be at its own: the mean of
    three hides what one is above it.
    """
    if isinstance(base, JointBase) and not all(
        at_noise_floor(part, part.floor.square)
        for part in bases_by_observable(base, held_by_all=True)
    ):
        return False
    if base.reduced_chi2 > QUIET_CHI2 + ERROR_SIGMAS * np.sqrt(2.0 / base.fit.freedom):
        return False
    above = base.square_held - QUIET_FLOORS**2 * floor_square
    if above <= 0.0:
        return True
    mean, spread = base.of_errors
    return above <= mean + ERROR_SIGMAS * spread


def quiet_waveforms(base: Base) -> bool:
    """Is what the model leaves of the waveforms the noise floor?

    Of a number per revolution it may be more: no nuisance of wheel, road or day acts on one.
    """
    parts = bases_by_observable(base, held_by_all=True)
    waveforms = [part for part in parts if part.cells.phi.shape[1] > 1]
    if len(waveforms) == len(parts):
        return at_noise_floor(base, base.floor.square)
    return all(at_noise_floor(part, part.floor.square) for part in waveforms)


def out_of_range(base: FittedChannel) -> list[str]:
    """A remark for each range of an effect of the fitted model that is left; none if it is off.

    A log's conditions are judged by the means of like revolutions, which is what is fitted; one
    that is not known leaves no range.
    """
    model, cells = base.model, base.cells
    flat, carcass = model.values, steady_carcass(model.carcass)
    said = []
    for entry in model.effects:
        effect, values = entry.effect, entry.values(flat)
        if not effect.is_on(values, carcass):
            continue
        for name, bounds in effect.valid_range.items():
            low, high = float(bounds[0]), float(bounds[1])
            condition = CONDITIONS.get(name)
            if condition is None:
                unit = next(p.unit for p in entry.parameters if p.name == name)
                if not low <= values[name] <= high:
                    said.append(
                        f"{effect.id} is valid for {name} {_range(low, high, unit)}; "
                        f"it stands at {values[name]:.4g}"
                    )
                continue
            x = getattr(cells.conditions, name)
            outside = int(cells.revolutions[(x < low) | (x > high)].sum())
            if outside:
                said.append(
                    f"{effect.id} is valid for {condition.name} "
                    f"{_range(low, high, condition.unit)}; {outside} of "
                    f"{int(cells.revolutions.sum())} revolutions are outside, by the means of like "
                    "ones"
                )
    return said


def _range(low: float, high: float, unit: str) -> str:
    """`from 2 to 40 m/s`, or one bound if there is no other."""
    after = "" if unit == "1" else f" {unit}"
    upper = "" if np.isinf(high) else f"to {high:g}{after}"
    lower = "" if np.isinf(low) else f"from {low:g}" + ("" if upper else after)
    return f"{lower} {upper}".strip() if lower else f"up {upper}"
