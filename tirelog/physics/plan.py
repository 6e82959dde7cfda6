"""Which test of a tire determines which number of its model: a staged plan of identification.

    static    patch length, and approach of the hub to the road, at a stand under several loads
    modal     natural frequencies and damping in the air and on the road, up to 300 Hz
    cleat     the spindle's force over a cleat, in time
    driving   what the sensor in the tread reads over a revolution, at several conditions

Each test gives the model's prediction y with an error. With its slopes J over the free numbers the
information is sum J^T J / error^2, and stages add up. Before the first, the bounds of a number are
all that is known of it, a box of standard deviation (max - min) / sqrt(12). The inverse of the sum
is the covariance (Cramer and Rao) of a fit to all stages up to there, if the model is right. The
slopes hold for small errors only: read a large error as "not determined".

As in the identification of structural tire models (Gipser, FTire; Gallrein and Baecker, CDTire).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.data.setup import Tire, parse_road
from tirelog.errors import ModelError, or_refusal
from tirelog.physics.model.forces import force_columns
from tirelog.physics.model.model import Model
from tirelog.physics.moving.ring import modes_of_model
from tirelog.physics.moving.transient import course_of, driven, passage_columns
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import SCALARS

#: values (k,) that a test reads, and their errors
Read = tuple[FloatArray, FloatArray]


def _static(model: Model, conditions: Conditions) -> Read:
    """Patch length to 1 mm and approach to 0.1 mm, at half to one and a half of the load."""
    loads = model.values["load_N"] * np.linspace(0.5, 1.5, 5)
    stands = {"speed_m_s": 0.1, "load_N": loads, "acceleration_m_s2": 0.0, "slip": 0.0}
    rows = force_columns(model, _like(conditions, loads.size, stands), Tire())
    both = np.concatenate([rows["patch_length_m"], rows["hub_approach_m"]])
    errors = np.repeat([1e-3, 1e-4], loads.size)
    return both[np.isfinite(both)], errors[np.isfinite(both)]


def _modal(model: Model, conditions: Conditions) -> Read:
    """Frequencies to 0.5 %, damping ratios to 0.005."""
    found = [mode for _, mode in modes_of_model(model)]
    frequencies = np.array([mode.frequency_Hz for mode in found])
    # a round tire in the air has each mode twice, turned: a test sees one
    once = np.append(True, np.abs(np.diff(frequencies)) > 1e-6 * frequencies[1:])
    frequencies = frequencies[once]
    ratios = np.array([mode.damping_ratio for mode in found])[once]
    errors = np.concatenate([0.005 * frequencies, np.full(ratios.size, 0.005)])
    return np.concatenate([frequencies, ratios]), errors


def _cleat(model: Model, conditions: Conditions) -> Read:
    """Forces on the spindle over a cleat of 10 mm by 20 mm at 8 m/s, to 2 % of the largest."""
    speed_m_s, road = 8.0, parse_road("cleat,height_m=0.01,length_m=0.02")
    course = course_of(road, None, speed_m_s, model.values["load_N"], (), None)
    motion = driven(model, _like(conditions, 1, {"speed_m_s": speed_m_s}), course)
    columns = passage_columns(motion, [180.0], "outer")
    forces = [columns[f"spindle_{way}_N"] for way in ("vertical", "longitudinal")]
    off = np.concatenate([force - np.mean(force) for force in forces])
    return off, np.full(off.size, 0.02 * np.abs(off).max())


def _driving(model: Model, conditions: Conditions) -> Read:
    """64 places of a revolution, to 1 % of the largest value; their mean is not measured."""
    if model.observable in SCALARS:
        read = model.predict(conditions)
    else:
        read = model.predict(conditions, 2.0 * np.pi * ((np.arange(64) + 0.5) / 64 - 0.5))
        read = read - read.mean(axis=1, keepdims=True)
    return read.ravel(), np.full(read.size, 0.01 * np.abs(read).max())


def _like(conditions: Conditions, n: int, given: Mapping[str, Any]) -> Conditions:
    """`n` rows of the first of the conditions, with other values of some."""
    return Conditions.of(n, **{**{k: v[0] for k, v in asdict(conditions).items()}, **given})


#: name, what is measured, and what a model predicts of it
STAGES: tuple[tuple[str, str, Callable[..., Read]], ...] = (
    ("static", "patch length and approach of the hub at a stand, five loads", _static),
    ("modal", "natural frequencies and damping up to 300 Hz", _modal),
    ("cleat", "forces on the spindle over a cleat", _cleat),
    ("driving", "the sensor over a revolution at each condition", _driving),
)


def plan_rows(model: Model, conditions: Conditions) -> tuple[dict[str, list[Any]], list[str]]:
    """Columns of `tirelog model plan`, a row per free number, and remarks.

    Standard errors in the number's unit, before the first stage and after each. A stage that the
    model does not have leaves what was known before. `determined_by` is the stage from which on the
    error is below a tenth of the value, or empty.

    conditions   of driving
    ModelError   no number is free
    """
    names = model.free
    if not names:
        raise ModelError(
            "the model has no free parameter",
            allowed="one at least is needed",
            do="free one with `tirelog model set MODEL NAME=free`",
        )
    numbers = [model.parameters[name] for name in names]
    information = np.diag([12.0 / (number.max - number.min) ** 2 for number in numbers])
    errors, remarks = {"bounds": _errors(information)}, []
    for stage, measured, predict in STAGES:
        slopes = _slopes(model, names, partial(predict, conditions=conditions))
        if isinstance(slopes, ModelError):
            remarks.append(f"{stage}: no such test of this model ({slopes.what})")
        else:
            information = information + slopes @ slopes.T
            remarks.append(f"{stage}: {measured}")
        errors[stage] = _errors(information)
    limits = np.array([0.1 * abs(number.value) for number in numbers])
    by = [
        next((stage for stage, found in errors.items() if found[i] < limits[i]), "")
        for i in range(len(names))
    ]
    lacking = [name for name, stage in zip(names, by, strict=True) if not stage]
    if lacking:
        remarks.append(
            f"not determined to a tenth: {', '.join(lacking)}; fix them at known values, or drive "
            "at other speeds, loads or accelerations"
        )
    rows = {
        "parameter": names,
        "value": [number.value for number in numbers],
        "unit": [number.unit for number in numbers],
        **{f"se_{stage}": found.tolist() for stage, found in errors.items()},
        "determined_by": by,
    }
    return rows, remarks


def _errors(information: FloatArray) -> FloatArray:
    """Standard errors, by way of numbers in units of their own information."""
    scale = 1.0 / np.sqrt(np.diagonal(information))
    inverse = np.linalg.pinv(information * np.outer(scale, scale), rcond=1e-14, hermitian=True)
    return np.asarray(scale * np.sqrt(np.diagonal(inverse)))


@or_refusal
def _slopes(model: Model, names: Sequence[str], predict: Callable[[Model], Read]) -> FloatArray:
    """Slopes by each number within its bounds, over the errors, (p, k).  ModelError: no test."""
    slopes, (values, errors) = [], predict(model)
    for name in names:
        number = model.parameters[name]
        # small, or natural frequencies that cross would change places
        step = 1e-4 * max(abs(number.value), 0.1 * abs(number.probe))
        ends = max(number.value - step, number.min), min(number.value + step, number.max)
        low, high = (predict(model.with_values({name: end}))[0] for end in ends)
        if not low.size == high.size == values.size:
            raise ModelError(f"a test whose number of values changes with {name}")
        slopes.append((high - low) / (ends[1] - ends[0]) / errors)
    return np.array(slopes)
