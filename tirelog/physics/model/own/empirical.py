"""An effect without a formula: a measured shape along one coordinate, times a law.

    [[effects]]
    name = "proposed"
    shape = "empirical"
    acts_on = "strain"            # or radial_acceleration, contact_pressure, load
    frame = "time_since_exit"     # what the shape stands still in, see FRAMES
    law = "speed / 20"            # how it grows, over conditions alone; "1" for always the same
    nodes = [0.0, 0.002, 0.004]   # ascending, in the frame's unit
    values = [0.0, 8e-5, -3e-5]   # at the nodes, straight lines between them, nothing outside
    parameters = { amplitude = { value = 1.0, min = -10.0, max = 10.0 } }

A shape is numbers only: nothing in it is executed. Its values have the unit of what it acts on; of
a contact pressure they are shares of the mean pressure F / (2 L).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tirelog.errors import ModelError, nearest
from tirelog.physics.effects import Effect
from tirelog.physics.model.own.expression import Expression, parse_expression
from tirelog.physics.model.own.user_effects import CONDITIONS, PLACES, effect_by_formula
from tirelog.physics.parameters import Parameter
from tirelog.vocabulary.arrays import FloatArray

#: nodes of a shape: a turn at 1 degree has 360 of them; twice as many resolve what no strain shows
MOST_NODES = 720
#: values and nodes are physical quantities in SI: what is larger is a fault of the file
LARGEST = 1e12
#: keys of a table in a model file, besides its name
KEYS = ("shape", "acts_on", "frame", "law", "nodes", "values")
AMPLITUDE = Parameter("amplitude", "", "factor on the measured shape", 1.0, -10.0, 10.0, probe=1.0)


@dataclass(frozen=True)
class ShapeFrame:
    """A coordinate in which a shape may stand still.

    `coordinate` in the language of expressions, its `unit`, `words` for a sentence; `acts_on` the
    stages that it is for; `periodic` [rad] if it closes on itself.
    """

    name: str
    coordinate: str
    unit: str
    words: str
    acts_on: tuple[str, ...] = ("strain", "radial_acceleration")
    periodic: float | None = None


#: distance since the exit edge, and to the entry edge, in the language of expressions [m]
FROM_EXIT_M = "((xi - L) % (2 * pi * R))"
TO_ENTRY_M = "((-L - xi) % (2 * pi * R))"
FRAMES: Mapping[str, ShapeFrame] = {
    frame.name: frame
    for frame in (
        ShapeFrame("wheel_angle", "phi", "rad", "along the wheel's angle", periodic=2.0 * np.pi),
        ShapeFrame(
            "patch", "xi / L", "1", "along the patch (xi / L)",
            ("strain", "radial_acceleration", "contact_pressure"),
        ),
        ShapeFrame(
            "time_since_exit", f"{FROM_EXIT_M} / speed", "s", "in the time since the exit edge"
        ),
        ShapeFrame("distance_since_exit", FROM_EXIT_M, "m", "in the distance since the exit edge"),
        ShapeFrame(
            "time_before_entry", f"{TO_ENTRY_M} / speed", "s", "in the time before the entry edge"
        ),
        ShapeFrame(
            "distance_before_entry", TO_ENTRY_M, "m", "in the distance before the entry edge"
        ),
        ShapeFrame("speed", "speed", "m/s", "along the speed", ("load",)),
    )
}  # fmt: skip
ACTS_ON = tuple(dict.fromkeys(stage for frame in FRAMES.values() for stage in frame.acts_on))


@dataclass(frozen=True)
class Shape:
    """Straight lines between values at nodes, along a frame's coordinate, times a law."""

    text: str
    coordinate: Expression
    law: Expression
    nodes: FloatArray
    values: FloatArray
    period: float | None
    in_mean_pressures: bool

    @property
    def names(self) -> frozenset[str]:
        """What it reads."""
        more = {"load", "L"} if self.in_mean_pressures else set()
        return self.coordinate.names | self.law.names | more | {AMPLITUDE.name}

    def __call__(self, values: Mapping[str, Any]) -> FloatArray:
        """The amplitude times law and shape where the names have these values."""
        at = self.coordinate(values)
        if self.period is None:
            shape = np.interp(at, self.nodes, self.values, left=0.0, right=0.0)
        else:
            shape = np.interp(at, self.nodes, self.values, period=self.period)
        result = values[AMPLITUDE.name] * self.law(values) * shape
        if self.in_mean_pressures:
            result = result * np.asarray(values["load"]) / (2.0 * np.asarray(values["L"]))
        return np.asarray(result, dtype=np.float64)


def effect_by_shape(
    name: str,
    acts_on: str,
    frame: str,
    law: str,
    nodes: Any,
    values: Any,
    amplitude: Parameter = AMPLITUDE,
) -> Effect:
    """The effect of a measured shape: `values` at ascending `nodes`, two lists of numbers.

    ModelError if place, frame, law or numbers are not allowed.
    """
    known = FRAMES.get(frame)
    if known is None or acts_on not in known.acts_on:
        allowed = {n: f for n, f in FRAMES.items() if known is None or acts_on in f.acts_on}
        raise ModelError(
            f"effect {name!r}: a shape along {frame!r} that acts on {acts_on!r}"
            f"{nearest(frame, FRAMES) if known is None else ''}",
            allowed=[f"{n} ({' '.join(f.acts_on)})" for n, f in (allowed or FRAMES).items()],
            do="choose one",
        )
    at, heights = _numbers(name, "nodes", nodes), _numbers(name, "values", values)
    if at.size != heights.size or not 2 <= at.size <= MOST_NODES or np.any(np.diff(at) <= 0.0):
        raise ModelError(
            f"effect {name!r}: {at.size} nodes and {heights.size} values are no shape",
            allowed=f"2 to {MOST_NODES} ascending nodes, and a value for each, are allowed",
            do="correct them",
        )
    places = {"load"} if acts_on != "load" else set()
    coordinate = parse_expression(known.coordinate, {*PLACES, *CONDITIONS})
    formula = Shape(
        f"a measured shape {known.words}, times {law}",
        coordinate,
        parse_expression(law, {*CONDITIONS, *places}),
        at,
        heights,
        known.periodic,
        acts_on == "contact_pressure",
    )
    return effect_by_formula(name, acts_on, formula, (amplitude,))


def _numbers(name: str, key: str, given: Any) -> FloatArray:
    """A list of finite numbers as an array.  ModelError: it is something else."""
    good = isinstance(given, list | tuple | np.ndarray) and len(given) <= MOST_NODES
    good = good and all(
        isinstance(x, int | float) and not isinstance(x, bool) and abs(x) <= LARGEST for x in given
    )
    if not good:
        raise ModelError(
            f"effect {name!r}: {key} are no list of numbers",
            allowed=f"up to {MOST_NODES} finite numbers are allowed",
            do="correct them",
        )
    return np.asarray(given, dtype=np.float64)
