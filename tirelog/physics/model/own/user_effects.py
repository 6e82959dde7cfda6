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

import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from errno import ENOENT
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from tirelog.errors import ModelError, TirelogError, refuse_unknown
from tirelog.physics.effects import BY_ID, Drive, Effect, Site, Structure
from tirelog.physics.effects.base import Values
from tirelog.physics.model.own.expression import FUNCTIONS, parse_expression
from tirelog.physics.parameters import Parameter
from tirelog.physics.spectral import grid_angles, to_modes
from tirelog.storage.documents import LARGEST_BYTES
from tirelog.storage.let_run import let_run, may_run
from tirelog.storage.remote import open_input
from tirelog.storage.whole import taken_as_input
from tirelog.vocabulary import conditions
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import OBSERVABLES

ENTRY_POINTS = "tirelog.effects"
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
    """The effect that a model file describes.

    ModelError if name, place or formula are not allowed.
    """
    refuse_unknown(
        acts_on,
        EXPRESSION_ACTS_ON,
        f"effect {name!r} acts on {acts_on!r}",
        do="choose one",
        error=ModelError,
    )
    places = PLACES if acts_on in _WAVES else ()
    formula = parse_expression(expression, {*places, *CONDITIONS, *(p.name for p in parameters)})
    return effect_by_formula(name, acts_on, formula, parameters)


class Formula(Protocol):
    """What a user's effect computes: its words, the names that it reads, and its values."""

    @property
    def text(self) -> str: ...
    @property
    def names(self) -> frozenset[str]: ...
    def __call__(self, values: Mapping[str, Any]) -> FloatArray: ...


def effect_by_formula(
    name: str, acts_on: str, formula: Formula, parameters: tuple[Parameter, ...]
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
            allowed="allowed are names that are no effect, function or condition",
            do="rename it",
        )
    return Effect(
        id=name,
        mechanism=f"by expression: {formula.text}",
        follows=tuple((CONDITIONS[n], 1.0) for n in sorted(formula.names & set(CONDITIONS))),
        acts_on=(_STAGE.get(acts_on, acts_on),),
        parameters=parameters,
        strength=_strength(formula, parameters),
        source="the model file",
        valid="as its author says",
        signature="as its author says",
        observables=tuple(OBSERVABLES),
        needs=tuple(CONDITIONS[n] for n in sorted(formula.names & set(CONDITIONS)) if n != "speed"),
        **_hook(acts_on, formula),
    ).checked()


_STAGE = {"foundation_stiffness": "structure"}


def _hook(acts_on: str, formula: Formula) -> dict[str, Any]:
    def column(v: Values, drive: Drive) -> FloatArray:
        return np.atleast_2d(formula(_names(v, drive)))

    def pressure(v: Values, drive: Drive, site: Site) -> Any:
        return to_modes(
            np.atleast_2d(
                _spread(formula(_names(v, drive, site, grid_angles())), grid_angles().size)
            )
        )

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


def _spread(values: FloatArray, size: int) -> FloatArray:
    """Values that do not depend on xi, all around."""
    return (
        np.broadcast_to(values, (*values.shape[:-1], size))
        if values.ndim and values.shape[-1] == 1
        else np.broadcast_to(values, np.broadcast_shapes(values.shape, (1, size)))
    )


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


def _strength(formula: Formula, parameters: tuple[Parameter, ...]) -> tuple[str, ...]:
    """The parameter that switches the formula off at zero; all of them if none does so alone."""
    rng = np.random.default_rng(0)
    size = 64
    trial: dict[str, Any] = {name: rng.uniform(0.5, 1.5, size) for name in (*CONDITIONS, *PLACES)}
    trial |= {"xi": np.linspace(-2.0, 2.0, size), "phi": np.linspace(-2.0, 2.0, size)}
    trial |= {p.name: p.probe for p in parameters}
    for p in parameters:
        with np.errstate(all="ignore"):
            try:
                if not np.any(formula({**trial, p.name: 0.0})):
                    return (p.name,)
            except ModelError:
                continue
    return tuple(p.name for p in parameters)


def effects_of_file(path: Path, *, asked: bool = True) -> dict[str, Effect]:
    """The effects that a Python file defines: every module-level `Effect`.

    The file is the user's own and is executed. If it was not asked for by the user but named by a
    model file, it has to be one that the user had run before, byte by byte.
    """
    code = _code(path, asked)
    namespace: dict[str, Any] = {"__name__": f"tirelog_effects_{path.stem}", "__file__": str(path)}
    try:
        exec(compile(code, str(path), "exec"), namespace)
    except (Exception, SystemExit) as problem:
        raise _failed(problem, path) from problem
    return _collected([value for value in namespace.values() if isinstance(value, Effect)], path)


def _code(path: Path, asked: bool) -> bytes:
    """The file's content, which may run.  ModelError: it cannot be read, or may not."""
    try:
        if not asked and not path.is_file():  # a model file names no device and no pipe
            raise FileNotFoundError(ENOENT, "no such file")
        with open_input(path) as stream:
            code = stream.read(LARGEST_BYTES + 1)
    except (OSError, ValueError) as problem:  # ValueError: a NUL in the name
        raise ModelError(
            f"cannot be read ({getattr(problem, 'strerror', None) or problem})",
            allowed="a Python file with effects is allowed",
            do="give its path" if asked else "bring it there, or give its path with --effects",
            file=path,
        ) from None
    if len(code) > LARGEST_BYTES:
        raise ModelError(
            f"is larger than {LARGEST_BYTES >> 20} MB",
            allowed="a Python file with effects is allowed",
            do="leave its data in a file beside it",
            file=path,
        )
    if asked:
        let_run(code, str(path))
    elif not may_run(code):
        raise ModelError(
            "is Python that you have not let run on this machine, or that has changed since",
            allowed="a model file may name it, only you can let it run",
            do=f"read it, then give --effects {path} once",
            file=path,
        )
    taken_as_input(path)
    return code


def _failed(problem: BaseException, path: object, what: str = "") -> ModelError:
    """A ModelError for what a user's own Python raised, with its line."""
    told = (
        "calls sys.exit"
        if isinstance(problem, SystemExit)
        else f"{type(problem).__name__}: {problem}"
    )
    return ModelError(
        f"{what}{told}",
        allowed="Python that runs and returns is allowed",
        do="correct it",
        file=path,
        line=_line(problem, path),
    )


def _line(problem: BaseException, path: object) -> int | None:
    """The last line of the file that was at work, or the one that is no Python."""
    frames = traceback.walk_tb(problem.__traceback__)
    lines = [line for frame, line in frames if frame.f_code.co_filename == str(path)]
    return getattr(problem, "lineno", None) or (lines[-1] if lines else None)


@dataclass(frozen=True)
class _Hook:
    """A user's function; what it raises is the user's to mend, and is told so."""

    function: Callable[..., Any]
    what: str
    origin: object

    def __call__(self, *arguments: Any) -> Any:
        try:
            return self.function(*arguments)
        except (TirelogError, MemoryError):
            raise
        except (Exception, SystemExit) as problem:
            raise _failed(problem, self.origin, self.what) from problem


def _watched(effect: Effect, origin: object) -> Effect:
    """The effect, whose functions say whose they are when they fail."""
    hooks = {f.name: value for f in fields(effect) if callable(value := getattr(effect, f.name))}
    what = f" of the effect {effect.id!r}: "
    watched: dict[str, Any] = {
        name: _Hook(hook, name + what, origin) for name, hook in hooks.items()
    }
    return replace(effect, **watched)


def installed_effects() -> dict[str, Effect]:
    """The effects of installed packages.

    Entry points of the group "tirelog.effects", each an Effect or a list of them.
    """
    found: dict[str, Effect] = {}
    for point in entry_points(group=ENTRY_POINTS):
        value = point.load()
        found |= _collected(
            list(value) if isinstance(value, list | tuple) else [value], point.value
        )
    return found


def catalogue_with(path: Path | None = None, *, asked: bool = True) -> Mapping[str, Effect]:
    """The whole catalogue of effects by id.

    Our own, installed packages', and those of the Python file at `path`, `asked` as for
    `effects_of_file`.
    """
    own = effects_of_file(path, asked=asked) if path else {}
    return {**BY_ID, **installed_effects(), **own}


def effect_called(name: str, path: Path | None = None, *, asked: bool = True) -> Effect:
    """The effect of this name in the whole catalogue.  ModelError: there is none."""
    catalogue = catalogue_with(path, asked=asked)
    refuse_unknown(
        name, catalogue, f"unknown effect {name!r}", do="see `tirelog effects`", error=ModelError
    )
    return catalogue[name]


def own_effects(path: Path | None = None, *, asked: bool = True) -> list[Effect]:
    """Effects that are candidates beside our own: installed packages' and those of a file."""
    catalogue = catalogue_with(path, asked=asked)
    return [effect for name, effect in catalogue.items() if name not in BY_ID]


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
