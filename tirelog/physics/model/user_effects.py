"""A user's own effects.

By expression in a model file, by a Python file, or by an installed package (entry points
"tirelog.effects").

What an expression means depends on `acts_on`:
    contact_pressure      a pressure [N/m] added to p, that is then rescaled to carry the load; may
                          read xi, phi, L, R
    strain                a strain added to the waveform; may read xi, phi, L, R
    radial_acceleration   [m/s^2], outward, added to the waveform of an accelerometer; may read xi,
                          phi, L, R
    foundation_stiffness  [N/m^2] added to k;  baseline  a strain added all around;  load  [N] added
                          to F
    sensor                the waveform is multiplied by 1 + expression
"""

from __future__ import annotations

import ast
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial, reduce
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import numpy as np

from tirelog.errors import ModelError, TirelogError, nearest, or_refusal, refuse_unknown
from tirelog.physics.effects import BY_ID, Drive, Effect, Site, Structure, Values
from tirelog.physics.spectral import GRID, Parameter, grid_angles, to_modes
from tirelog.storage.whole import bounded_input
from tirelog.vocabulary import conditions
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import OBSERVABLES

# ---- A user's formula in a model file.
#
# It is parsed into a tree and computed by walking it, never executed as Python: at first with ones,
# so that a node that is not allowed is refused when the formula is read.
#
# Allowed: numbers, names, + - * / ** %, comparisons, `and`/`or`/`not` (also & | ~), `a if c else
# b`, and numpy's elementary functions by their plain names. Everything is computed in floating
# point, so no exponent grows beyond it.


#: letters of a formula, and how deep it may be nested: far above what a person writes, far below
#: what the parser's own recursion takes
LONGEST, DEEPEST = 1000, 40
_ELEMENTARY: tuple[Callable[..., Any], ...] = (
    np.sin, np.cos, np.tan, np.arcsin, np.arccos, np.arctan, np.arctan2, np.sinh, np.cosh, np.tanh,
    np.arcsinh, np.arccosh, np.arctanh, np.exp, np.exp2, np.expm1, np.log, np.log2, np.log10,
    np.log1p, np.sqrt, np.cbrt, np.square, np.abs, np.sign, np.floor, np.ceil, np.minimum,
    np.maximum, np.where, np.clip, np.hypot, np.heaviside, np.sinc,
)  # fmt: skip
FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    function.__name__: function for function in _ELEMENTARY
} | {"abs": np.abs}
#: how many arguments each takes; a third one of a function of two numbers would be numpy's array to
#: write into
ARGUMENTS = {name: getattr(function, "nin", 1) for name, function in FUNCTIONS.items()}
ARGUMENTS |= {"where": 3, "clip": 3}
CONSTANTS = {"pi": np.pi, "e": np.e}
_OPERATORS: Mapping[type, Callable[..., Any]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide,
    ast.Pow: np.power, ast.Mod: np.mod, ast.USub: np.negative, ast.UAdd: np.positive,
    ast.BitAnd: np.logical_and, ast.BitOr: np.logical_or, ast.Invert: np.logical_not,
    ast.And: np.logical_and, ast.Or: np.logical_or, ast.Not: np.logical_not,
    ast.Lt: np.less, ast.LtE: np.less_equal, ast.Gt: np.greater, ast.GtE: np.greater_equal,
    ast.Eq: np.equal, ast.NotEq: np.not_equal,
}  # fmt: skip


@dataclass(frozen=True)
class Expression:
    """A parsed formula: its text and the names that it reads."""

    text: str
    names: frozenset[str]
    tree: ast.expr

    def __call__(self, values: Mapping[str, Any]) -> np.ndarray:
        """The formula's value if the names have these values (arrays that broadcast).

        ModelError if it is not finite.
        """
        with np.errstate(all="ignore"):
            value = _value(self.tree, self.text, {**CONSTANTS, **values}, 0)
            result = np.asarray(value, dtype=np.float64)
        if not np.isfinite(result).all():
            raise ModelError(
                f"expression {self.text!r} is not finite everywhere",
                allowed="a finite number at every angle and condition is allowed",
                do="guard it with where(), clip() or a comparison",
            )
        return result


def parse_expression(text: str, allowed: frozenset[str] | set[str]) -> Expression:
    """The parsed formula `text` over the `allowed` names.

    ModelError for anything else, with what is allowed.
    """
    if len(text) > LONGEST:
        raise ModelError(
            f"expression of {len(text)} characters",
            allowed=f"up to {LONGEST} are allowed",
            do="shorten it",
        )
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as problem:
        raise ModelError(
            f"expression {text!r} is not a formula ({getattr(problem, 'msg', problem)})",
            allowed="numbers, names, operators and calls are allowed",
            do="correct it",
        ) from None
    names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)} & allowed
    formula = Expression(text, frozenset(names), tree)
    with np.errstate(all="ignore"):
        _value(tree, text, dict.fromkeys(allowed, 1.0) | CONSTANTS, 0)
    return formula


def _value(node: ast.AST, text: str, values: Mapping[str, Any], depth: int) -> Any:
    """The value of a part of a formula; ModelError for what may not be in one."""
    if depth > DEEPEST:
        raise ModelError(
            f"expression {text!r} is nested deeper than {DEEPEST}",
            allowed="a flatter one is allowed",
            do="split it",
        )
    if isinstance(node, ast.Name):
        if node.id not in values:
            raise ModelError(
                f"expression {text!r} uses the name {node.id!r}{nearest(node.id, values)}",
                allowed=f"allowed here are {', '.join(sorted(values))} and the functions "
                f"{', '.join(FUNCTIONS)}",
                do="use one of them",
            )
        return values[node.id]
    number = node.value if isinstance(node, ast.Constant) else None
    if isinstance(number, int | float) and type(number) is not bool and abs(number) < 1e300:
        return number
    call = node if isinstance(node, ast.Call) and not node.keywords else None
    called = call.func.id if call is not None and isinstance(call.func, ast.Name) else ""
    operators = node.ops if isinstance(node, ast.Compare) else [getattr(node, "op", None)]
    known = called in FUNCTIONS or all(type(operator) in _OPERATORS for operator in operators)
    if not known and not isinstance(node, ast.IfExp):
        raise ModelError(
            f"expression {text!r} uses {called or type(node).__name__}, which is not allowed",
            allowed="allowed are finite numbers, names, + - * / ** %, comparisons, and/or/not, a "
            f"if c else b, and the functions {', '.join(FUNCTIONS)}",
            do="write it with these",
        )
    # a starred argument is refused as a node of its own
    parts = ast.iter_child_nodes(node) if call is None else call.args
    if call is not None and len(call.args) != ARGUMENTS[called]:
        raise ModelError(
            f"expression {text!r} gives {called}() {len(call.args)} arguments",
            allowed=f"allowed are {ARGUMENTS[called]}",
            do="correct it",
        )
    operands = [
        _value(part, text, values, depth + 1) for part in parts if isinstance(part, ast.expr)
    ]
    terms = [np.asarray(operand, dtype=np.float64) for operand in operands]
    if isinstance(node, ast.Compare):
        pairs = zip(node.ops, terms, terms[1:])
        return reduce(np.logical_and, (_OPERATORS[type(op)](a, b) for op, a, b in pairs))
    if isinstance(node, ast.BoolOp):
        return reduce(_OPERATORS[type(node.op)], terms)
    if isinstance(node, ast.BinOp | ast.UnaryOp):
        return _OPERATORS[type(node.op)](*terms)
    return FUNCTIONS[called](*terms) if called else np.where(*terms)


# ---- An effect by a formula.


#: name in an expression -> field of the conditions
CONDITIONS = {c.symbol: c.field for c in conditions.CONDITIONS.values() if c.in_expressions}
PLACES = ("xi", "phi", "L", "R", "load")
EXPRESSION_ACTS_ON = (
    "contact_pressure",
    "foundation_stiffness",
    "strain",
    "baseline",
    "load",
    "sensor",
    "radial_acceleration",
)
_WAVES = ("contact_pressure", "strain", "radial_acceleration")


def effect_by_expression(
    name: str, acts_on: str, expression: str, parameters: tuple[Parameter, ...]
) -> Effect:
    """The effect that a model file describes; it acts on one of EXPRESSION_ACTS_ON.

    ModelError if name or formula are not allowed.
    """
    places = PLACES if acts_on in _WAVES else ()
    formula = parse_expression(expression, {*places, *CONDITIONS, *(p.name for p in parameters)})
    return effect_by_formula(name, acts_on, formula, parameters)


def effect_by_formula(
    name: str, acts_on: str, formula: Expression | Shape, parameters: tuple[Parameter, ...]
) -> Effect:
    """The effect that acts on a place as a formula says.

    ModelError if its name or a parameter's is not allowed.
    """
    taken = {*PLACES, *CONDITIONS, *FUNCTIONS, "pi", "e"}
    clash = [p.name for p in parameters if p.name in taken or not p.name.isidentifier()]
    if name in BY_ID or not name.replace("-", "_").isidentifier() or clash:
        raise ModelError(
            f"effect {name!r} with parameters {[p.name for p in parameters]}: "
            f"{', '.join(clash) or name} is taken or no plain name",
            allowed="allowed are names that no effect, function or condition has",
            do="rename it",
        )
    return Effect(
        id=name,
        mechanism=f"by expression: {formula.text}",
        follows=tuple((CONDITIONS[n], 1.0) for n in sorted(formula.names & set(CONDITIONS))),
        acts_on=("structure" if acts_on == "foundation_stiffness" else acts_on,),
        parameters=parameters,
        strength=_strength(formula, parameters),
        source="the model file",
        valid="as its author says",
        signature="as its author says",
        observables=tuple(OBSERVABLES),
        needs=tuple(CONDITIONS[n] for n in sorted(formula.names & set(CONDITIONS)) if n != "speed"),
        **_hook(acts_on, formula),
    ).checked()


def _hook(acts_on: str, formula: Expression | Shape) -> dict[str, Any]:
    def column(v: Values, drive: Drive) -> FloatArray:
        return np.atleast_2d(formula(_names(v, drive)))

    def pressure(v: Values, drive: Drive, site: Site) -> Any:
        values = np.atleast_2d(formula(_names(v, drive, site, grid_angles())))
        # what does not depend on xi is the same all around
        return to_modes(np.broadcast_to(values, np.broadcast_shapes(values.shape, (1, GRID))))

    def at_angles(v: Values, drive: Drive, site: Site, phi_rad: FloatArray) -> FloatArray:
        empty = np.isnan(
            phi_rad
        )  # bins without a sample have no angle, and that is no fault of the formula
        values = formula(_names(v, drive, site, np.where(empty, 0.0, phi_rad)))
        return np.atleast_2d(np.where(empty, np.nan, values))

    hooks: dict[str, dict[str, Any]] = {
        "contact_pressure": {"pressure": pressure},
        "strain": {"strain": at_angles},
        "radial_acceleration": {"acceleration": at_angles},
        "foundation_stiffness": {
            "structure": lambda v, drive: Structure(added_stiffness=column(v, drive))
        },
        "baseline": {"baseline": column},
        "load": {"added_load": column},
        "sensor": {"gain": lambda v, drive: 1.0 + column(v, drive)},
    }
    return hooks[acts_on]


def _names(
    v: Values, drive: Drive, site: Site | None = None, phi_rad: FloatArray | None = None
) -> dict[str, Any]:
    values: dict[str, Any] = dict(v) | {
        name: getattr(drive, column) for name, column in CONDITIONS.items()
    }
    if site is not None and phi_rad is not None:
        values |= {
            "phi": phi_rad,
            "xi": phi_rad * site.radius_m,
            "L": site.half_length_m,
            "R": site.radius_m,
            "load": site.load_N,
        }
    return values


def _strength(formula: Expression | Shape, parameters: tuple[Parameter, ...]) -> tuple[str, ...]:
    """The parameter that switches the formula off at zero; all of them if none does so alone."""
    rng = np.random.default_rng(0)
    size = 64
    trial: dict[str, Any] = {name: rng.uniform(0.5, 1.5, size) for name in (*CONDITIONS, *PLACES)}
    trial |= {"xi": np.linspace(-2.0, 2.0, size), "phi": np.linspace(-2.0, 2.0, size)}
    trial |= {p.name: p.probe for p in parameters}
    tried = or_refusal(formula)
    names = tuple(p.name for p in parameters)
    for name in names:
        found = tried({**trial, name: 0.0})
        if not isinstance(found, ModelError) and not np.any(found):
            return (name,)
    return names


def effects_of_file(path: Path) -> dict[str, Effect]:
    """The effects that a Python file defines: every module-level `Effect`.

    The file is the user's own and is executed: no file that somebody else may have written names
    it.
    """
    try:
        code = bounded_input(path)
    except (OSError, ValueError) as problem:
        raise ModelError(
            f"cannot be read ({getattr(problem, 'strerror', None) or problem})",
            allowed="a Python file with effects is allowed",
            do="give its path",
            file=path,
        ) from None
    namespace: dict[str, Any] = {"__name__": f"tirelog_effects_{path.stem}", "__file__": str(path)}
    try:
        exec(compile(code, str(path), "exec"), namespace)
    except (Exception, SystemExit) as problem:
        raise _failed(problem, path) from problem
    return _collected([value for value in namespace.values() if isinstance(value, Effect)], path)


def _failed(problem: BaseException, path: object, what: str = "") -> ModelError:
    """A ModelError for what a user's own Python raised, with its line."""
    told = (
        "calls sys.exit"
        if isinstance(problem, SystemExit)
        else f"{type(problem).__name__}: {problem}"
    )
    frames = traceback.walk_tb(problem.__traceback__)
    lines = [line for frame, line in frames if frame.f_code.co_filename == str(path)]
    return ModelError(
        f"{what}{told}",
        allowed="Python that runs and returns is allowed",
        do="correct it",
        file=path,
        # the line that is no Python, or the last one of the file that was at work
        line=getattr(problem, "lineno", None) or (lines[-1] if lines else None),
    )


def _watched(effect: Effect, origin: object) -> Effect:
    """The effect, whose functions say whose they are when they fail."""
    what = f" of the effect {effect.id!r}: "
    watched: dict[str, Any] = {
        f.name: partial(_called, hook, f.name + what, origin)
        for f in fields(effect)
        if callable(hook := getattr(effect, f.name))
    }
    return replace(effect, **watched)


def _called(function: Callable[..., Any], what: str, origin: object, *arguments: Any) -> Any:
    """What a user's function returns; an error of it is raised as a ModelError."""
    try:
        return function(*arguments)
    except (TirelogError, MemoryError):
        raise
    except (Exception, SystemExit) as problem:
        raise _failed(problem, origin, what) from problem


def installed_effects() -> dict[str, Effect]:
    """The effects of installed packages.

    Entry points of the group "tirelog.effects", each an Effect or a list of them.
    """
    found: dict[str, Effect] = {}
    for point in entry_points(group="tirelog.effects"):
        value = point.load()
        found |= _collected(
            list(value) if isinstance(value, list | tuple) else [value], point.value
        )
    return found


def catalogue_with(path: Path | None = None) -> Mapping[str, Effect]:
    """The whole catalogue of effects by id.

    Our own, installed packages', and those of the Python file at `path`.
    """
    return {**BY_ID, **installed_effects(), **(effects_of_file(path) if path else {})}


def effect_called(name: str, path: Path | None = None) -> Effect:
    """The effect of this name in the whole catalogue.  ModelError: there is none."""
    catalogue = catalogue_with(path)
    refuse_unknown(
        name, catalogue, f"unknown effect {name!r}", do="list: `tirelog effects`", error=ModelError
    )
    return catalogue[name]


def own_effects(path: Path | None = None) -> list[Effect]:
    """Effects that are candidates beside our own: installed packages' and those of a file."""
    return [effect for name, effect in catalogue_with(path).items() if name not in BY_ID]


def _collected(effects: list[Any], origin: object) -> dict[str, Effect]:
    found: dict[str, Effect] = {}
    for effect in effects:
        if not isinstance(effect, Effect):
            raise ModelError(
                f"gives {type(effect).__name__}",
                allowed="tirelog.physics.Effect is allowed",
                do="correct it",
                file=origin,
            )
        if effect.id in BY_ID or effect.id in found:
            raise ModelError(
                f"effect {effect.id!r} exists already",
                allowed="a new name is allowed",
                do="rename it",
                file=origin,
            )
        found[effect.id] = _watched(effect.checked(), origin)
    if not found:
        raise ModelError(
            "has no effect",
            allowed="at least one tirelog.physics.Effect at module level is needed",
            do="define it",
            file=origin,
        )
    return found


# ---- An effect without a formula: a measured shape along one coordinate, times a law.
#
#     [[effects]]
#     name = "proposed"
#     shape = "empirical"
#     acts_on = "strain"            # or radial_acceleration, contact_pressure, load
#     frame = "time_since_exit"     # where the shape is fixed, see FRAMES
#     law = "speed / 20"            # how it grows, over conditions alone; "1" for always the same
#     nodes = [0.0, 0.002, 0.004]   # ascending, in the frame's unit
#     values = [0.0, 8e-5, -3e-5]   # at the nodes, straight lines between them, nothing outside
#     parameters = { amplitude = { value = 1.0, min = -10.0, max = 10.0 } }
#
# A shape is numbers only: nothing in it is executed. Its values have the unit of what it acts on;
# of
# a contact pressure they are shares of the mean pressure F / (2 L).


#: nodes of a shape: a turn at 1 degree has 360 of them; twice as many resolve what no strain shows
MOST_NODES = 720
#: values and nodes are physical quantities in SI: what is larger is a fault of the file
LARGEST = 1e12
#: keys of a table in a model file, besides its name
SHAPE_KEYS = ("shape", "acts_on", "frame", "law", "nodes", "values")
AMPLITUDE = Parameter("amplitude", "", "factor on the measured shape", 1.0, -10.0, 10.0, probe=1.0)


@dataclass(frozen=True)
class ShapeFrame:
    """A coordinate along which a shape may be fixed.

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
            "patch", "xi / L", "1", "along the patch",
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
SHAPE_ACTS_ON = tuple(dict.fromkeys(stage for frame in FRAMES.values() for stage in frame.acts_on))


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
    nodes: Sequence[float] | FloatArray,
    values: Sequence[float] | FloatArray,
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
    at, heights = (np.asarray(given, dtype=np.float64) for given in (nodes, values))
    if at.size != heights.size or not 2 <= at.size <= MOST_NODES or np.any(np.diff(at) <= 0.0):
        raise ModelError(
            f"effect {name!r}: {at.size} nodes and {heights.size} values do not make a shape",
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
