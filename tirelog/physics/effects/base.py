"""What an effect is: plain data, and the hooks by which it enters the pipeline's stages.

Hooks are pure functions of the effect's own parameter values `v`, of the conditions `drive` and,
after the load stage, of the `site`. Columns have shape (n, 1), or (1, 1) if they are the same
for all revolutions; modes (n or 1, K).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from inspect import cleandoc, getfullargspec
from pkgutil import resolve_name
from typing import Any

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.errors import ModelError
from tirelog.physics.pressure import legendre_modes
from tirelog.physics.spectral import MODES, ComplexArray, Parameter
from tirelog.vocabulary.arrays import FloatArray, IntArray
from tirelog.vocabulary.conditions import CONDITIONS, ConditionValues
from tirelog.vocabulary.observables import OBSERVABLES, computed_from

#: numbers by name, and the words of options
Values = Mapping[str, Any]
#: The 9.81 in the forms "a acceleration/9.81" of the catalogue: a scale by convention, not gravity
#: (that is `units.STANDARD_GRAVITY_M_S2`); coefficients in model files are per this.
CATALOGUE_G_M_S2 = 9.81
#: absolute temperature at which a rise of temperature counts as none [K]
ROOM_K = 293.0

#: Stages an effect can act on, in the contract's words.
ACTS_ON = (
    "load", "contact_pressure", "structure", "baseline", "sensor", "regressors",
    "foundation_stiffness", "strain", "radial_acceleration",
)  # fmt: skip
_LOAD, _PRESSURE = ("load", "load"), ("contact_pressure", "contact_pressure")
#: Observables of the tire alone; those with regressors of their own an effect has to ask for.
WITHOUT_REGRESSORS = tuple(name for name in OBSERVABLES if name not in computed_from("regressors"))
#: Hook -> (the stage it enters in a model file's words, what of it an observable `reads`).
ENTERS: Mapping[str, tuple[str, str]] = {
    "load": _LOAD,
    "added_load": _LOAD,
    "pressure": _PRESSURE,
    "tilt": _PRESSURE,
    "kernel": _PRESSURE,
    "traction": _PRESSURE,
    "structure": ("structure (foundation_stiffness)", "structure"),
    "stretch": ("structure", "stretch"),
    "transfer": ("sensor", "sensor"),
    "gain": ("sensor", "sensor"),
    "lever": ("sensor", "lever_arm"),
    "shortening": ("sensor", "lever_arm"),
    "baseline": ("baseline", "baseline"),
    "strain": ("strain", "strain"),
    "acceleration": ("radial_acceleration", "radial_acceleration"),
    "regressor": ("regressors", "regressors"),
}
#: Hook -> (the stage it enters, the observables that are computed from that stage).
REACH: Mapping[str, tuple[str, tuple[str, ...]]] = {
    hook: (stage, computed_from(read)) for hook, (stage, read) in ENTERS.items()
}


def acting_on(observable: str) -> list[str]:
    """The stages by which effects act on an observable, in a model file's words."""
    return list(dict.fromkeys(stage for stage, reached in REACH.values() if observable in reached))


@dataclass(frozen=True)
class Drive(ConditionValues):
    """The conditions as columns: each (n, 1), or (1, 1) if all revolutions share the value.

    NaN if it is not known.
    """

    @classmethod
    def of(cls, conditions: Conditions) -> Drive:
        return cls(**{f.name: _column(getattr(conditions, f.name)) for f in fields(cls)})

    def take(self, rows: slice | IntArray) -> Drive:
        """Some of the revolutions; shared columns stay shared."""
        columns = {f.name: getattr(self, f.name) for f in fields(self)}
        return Drive(**{name: c if c.shape[0] == 1 else c[rows] for name, c in columns.items()})

    def distinct(self, names: Iterable[str]) -> tuple[Drive, IntArray]:
        """Revolutions that differ in these columns, each once, and which of them each is (n,)."""
        n = max(getattr(self, f.name).shape[0] for f in fields(self))
        apart = [column for name in names if (column := getattr(self, name)).shape[0] > 1]
        seen = np.hstack([np.nan_to_num(x, nan=-np.inf) for x in apart] or [np.zeros((n, 1))])
        _, first, rows = np.unique(seen, axis=0, return_index=True, return_inverse=True)
        return self.take(first), np.asarray(rows.ravel(), dtype=np.int64)


def _column(values: FloatArray) -> FloatArray:
    same = values.size > 0 and bool(
        np.all((values == values[0]) | (np.isnan(values) & np.isnan(values[0])))
    )
    return np.asarray(values[:1] if same else values, dtype=np.float64).reshape(-1, 1)


@dataclass(frozen=True)
class Site:
    """The place where the load acts: F [N] and half length L [m] of the patch.

    Both are (n or 1, 1), on a tread of radius R. A form is that at the reference load [N].
    """

    load_N: FloatArray
    half_length_m: FloatArray
    radius_m: float
    reference_load_N: float

    @property
    def q(self) -> FloatArray:
        """Wave numbers [1/m], shape (K,)."""
        return np.arange(MODES) / self.radius_m

    @property
    def mean_pressure(self) -> FloatArray:
        """F / (2 L) [N/m]."""
        return self.load_N / (2.0 * self.half_length_m)

    @cached_property
    def legendre(self) -> FloatArray:
        """`legendre_modes` of the patch, (8, n or 1, K)."""
        return legendre_modes(self.half_length_m, self.radius_m)


@dataclass(frozen=True)
class Structure:
    """Changes of the carcass by effects; those of several effects add up.

    tension [N]             T in T q^2
    damping_rate [1/s]      omega_d in 2 mu omega_d c w'
    loss                    eta in k (1 + i eta)
    stiffening              the foundation's relative change
    added_stiffness [N/m^2] to the foundation
    retardation [s]         tau in EJ (1 + tau d/dt), of the belt in bending
    shear [m^2]             l^2 in EJ q^4 / (1 + l^2 q^2), of the belt in shear
    by_waves                logarithm of a factor on the static stiffness, of each mode (K,)
    cubic [1/m^2]           k3 in k (1 + k3 w^2)
    ring                    share of a closed ring, and ring_tangential [N/m^2] that share times its
                            k_v
    """

    tension: FloatArray | float = 0.0
    damping_rate: FloatArray | float = 0.0
    loss: FloatArray | float = 0.0
    stiffening: FloatArray | float = 0.0
    added_stiffness: FloatArray | float = 0.0
    cubic: FloatArray | float = 0.0
    ring: float = 0.0
    ring_tangential: float = 0.0
    retardation: FloatArray | float = 0.0
    shear: FloatArray | float = 0.0
    by_waves: FloatArray | float = 0.0

    def __add__(self, other: Structure) -> Structure:
        return Structure(
            **{f.name: getattr(self, f.name) + getattr(other, f.name) for f in fields(self)}
        )


#: what an effect follows: (condition's field, power), ...
Follows = tuple[tuple[str, float], ...]
#: (values, drive) -> column; (values, drive, site) -> column or modes.
DriveHook = Callable[[Values, Drive], FloatArray]
SiteHook = Callable[[Values, Drive, Site], "FloatArray | ComplexArray"]


@dataclass(frozen=True)
class Effect:
    """One physical mechanism.

    id, mechanism              as in the catalogue
    follows                    the conditions by which it grows, each (field, power of it), ()
                               for none
    acts_on                    the stages it enters
    reads                      stages that it reads ("load" of a regressor): if nothing else reads
                               them, an effect on them acts through this one alone
    parameters                 numbers with unit, bounds, start; `strength` names those that are all
                               zero when it is off
    needs                      fields of Conditions without which it cannot be computed
    also_at_zero               carcasses on which something of it acts also when its strength is
                               zero
    instead                    a field of `needs` -> another that serves as well
    stands_for                 observable -> conditions that it replaces there: it is not tried
                               where they are measured
    options                    words a model file may choose from, the first by default
    beam_only                  True for what a ring is already, or does not have
    tried                      False if a diagnosis does not try it by itself, since its shape is
                               nearly another's: whoever knows of it adds it to the model
    source, valid, signature   where it comes from, where it holds, what it looks like in a waveform
    constraints                gives rows (q, p), floor (q,): rows @ numbers + floor, in standard
                               deviations, is negative by chance only
    valid_range                what of `valid` is a number: condition's field or parameter ->
                               (lowest, highest), in its unit; comparisons remark when it is left
    hooks                      load: relative change of F; added_load [N]; pressure: modes to add
                               [N/m]; tilt: a in p (1 - a xi/L); kernel: transfer of a convolution
                               of p; traction: modes of tau [N/m] and its lever [m]; structure;
                               stretch: how far tau pulls a beam along, of each mode [m^2/N];
                               baseline [strain]; transfer: sensor's transfer; gain: sensor's
                               factor; lever: the same of the lever arm, so for strain alone,
                               and shortening: its loss [m]; strain: added
                               waveform at (drive, site, phi); acceleration [m/s^2]: likewise;
                               regressor: added to a number per revolution
    """

    id: str
    mechanism: str
    follows: Follows
    acts_on: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    strength: tuple[str, ...]
    source: str
    valid: str
    signature: str
    valid_range: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    constraints: Callable[[], tuple[FloatArray, FloatArray]] | None = None
    reads: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    also_at_zero: tuple[str, ...] = ()
    instead: Mapping[str, str] = field(default_factory=dict)
    stands_for: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    options: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    observables: tuple[str, ...] = WITHOUT_REGRESSORS
    beam_only: bool = False
    tried: bool = True
    load: DriveHook | None = None
    added_load: DriveHook | None = None
    tilt: DriveHook | None = None
    pressure: SiteHook | None = None
    kernel: SiteHook | None = None
    traction: Callable[[Values, Drive, Site], tuple[ComplexArray, float] | None] | None = None
    structure: Callable[[Values, Drive], Structure] | None = None
    stretch: SiteHook | None = None
    baseline: DriveHook | None = None
    transfer: SiteHook | None = None
    gain: DriveHook | None = None
    lever: DriveHook | None = None
    shortening: DriveHook | None = None
    strain: Callable[[Values, Drive, Site, FloatArray], FloatArray] | None = None
    acceleration: Callable[[Values, Drive, Site, FloatArray], FloatArray] | None = None
    regressor: Callable[[Values, Drive, Site, str], FloatArray] | None = None

    @property
    def followed(self) -> Follows:
        """The conditions that it follows as (field, power)."""
        return tuple((name, float(power)) for name, power in self.follows)

    @property
    def follows_said(self) -> str:
        """The conditions that it follows, in words: `speed^2, water depth`."""
        followed, parts = dict(self.followed), []
        for name, power in followed.items():
            other = CONDITIONS.get(self.instead.get(name, ""))
            parts.append(
                CONDITIONS[name].word
                + ("" if power == 1 else f"^{power:g}")
                + (
                    f" ({other.word}, where it is measured)"
                    if other is not None and other.field not in followed
                    else ""
                )
            )
        return ", ".join(parts) or "nothing"

    @property
    def reaches(self) -> tuple[str, ...]:
        """Those of its `observables` that are computed from a stage which it enters.

        On the others it acts on nothing, unless another effect reads that stage (`acts_in`).
        """
        return tuple(name for name in self.observables if self.acts_in(name, ()))

    @property
    def enters(self) -> frozenset[str]:
        """The stages that its hooks enter, as observables and effects read them."""
        return frozenset(
            stage for hook, (_, stage) in ENTERS.items() if getattr(self, hook) is not None
        )

    def acts_in(self, observable: str, beside: Iterable[Effect]) -> bool:
        """True if it acts on an observable in a model with the effects `beside` it."""
        # the observable is computed from its own stages, and from those that what is added reads
        read = frozenset(OBSERVABLES[observable].reads).union(*(e.reads for e in beside))
        return observable in self.observables and bool(self.enters & read)

    def is_on(self, values: Values, carcass: str = "beam") -> bool:
        """False if its strength is zero.

        The model is then the same as without it, to the last bit.
        """
        return (
            not self.strength
            or carcass in self.also_at_zero
            or any(values[name] != 0.0 for name in self.strength)
        )

    def missing(self, conditions: Conditions) -> list[str]:
        """Fields of the conditions that it needs and some revolution lacks."""
        lacking = [name for name in self.needs if not conditions.known(name)]
        return [
            name
            for name in lacking
            if name not in self.instead or not conditions.known(self.instead[name])
        ]

    def checked(self) -> Effect:
        """Itself; ModelError if its description contradicts itself."""
        names = [parameter.name for parameter in self.parameters]
        stages = dict.fromkeys(stage for _, stage in ENTERS.values())
        try:
            powers = dict(self.followed)
            ranges = {k: (float(low), float(high)) for k, (low, high) in self.valid_range.items()}
        except (AttributeError, TypeError, ValueError):
            raise self._wrong(
                f"follows {self.follows!r}, valid_range {self.valid_range!r}",
                'allowed are pairs (condition, power) such as (("speed_m_s", 2),), and a pair '
                '(lowest, highest) by name such as {"speed_m_s": (2.0, 40.0)}',
            ) from None
        unknown = [name for name in powers if name not in CONDITIONS]
        unknown += [name for name in ranges if name not in (*CONDITIONS, *names)]
        empty = [name for name, (low, high) in ranges.items() if not low <= high]
        for wrong, what, allowed in (
            (
                len(set(names)) != len(names)
                or not set(self.strength) <= set(names)
                or not set(self.acts_on) <= set(ACTS_ON),
                f"parameters {names}, strength {list(self.strength)}, acts on {list(self.acts_on)}",
                f"allowed are distinct parameters, a strength among them, and {', '.join(ACTS_ON)}",
            ),
            (
                not set(self.reads) <= set(stages),
                f"reads {', '.join(map(str, self.reads))}",
                f"allowed are {', '.join(stages)}",
            ),
            (
                unknown,
                f"{', '.join(map(repr, unknown))} is not a condition",
                f"allowed are {', '.join(CONDITIONS)}, and in valid_range its parameters",
            ),
            (
                not np.isfinite(list(powers.values())).all(),
                f"follows {self.follows!r}",
                "allowed are finite powers",
            ),
            (
                empty,
                f"valid_range of {', '.join(empty)} ends before it begins",
                "allowed is (lowest, highest)",
            ),
        ):
            if wrong:
                raise self._wrong(what, allowed)
        for parameter in self.parameters:
            parameter.checked(f"{self.id}.{parameter.name}")
        return self

    def _wrong(self, what: str, allowed: str) -> ModelError:
        return ModelError(f"effect {self.id}: {what}", allowed=allowed, do="correct the effect")


# ---- An effect from the function that computes it: `@effect`, with its numbers by `number`.
#
#     @effect(
#         "gain",
#         follows=(("temperature_K", 1),),
#         needs=("temperature_K",),
#         gain_1_K=number(0.0, -0.02, 0.02, "1/K", "a, relative change per kelvin", probe=1e-3),
#     )
#     def warm_gain(drive: Drive, *, gain_1_K: float) -> FloatArray:
#         """A sensor whose gain follows the temperature, 1 + a dT.
#
#         Signature: the whole waveform grows or shrinks with the temperature
#         Valid: the straight part of a sensor's curve
#         Source: data sheets of accelerometers and gauges
#
#         What else a reader of the code should know; the catalogue does not repeat it.
#         """
#         return 1.0 + gain_1_K * drive.temperature_K
#
# The function's name is the effect's id. The first paragraph of its docstring is the mechanism. A
# text after a label goes on in lines that are indented.


def number(
    value: float,
    low: float,
    high: float,
    unit: str,
    description: str,
    *,
    probe: float | None = None,
    free: bool = True,
    prior: tuple[float, float] | None = None,
) -> Parameter:
    """A number of an effect; the keyword that gives it becomes its name.

    Its start value, bounds, unit and meaning. `probe` is the start value unless that is zero; the
    rest is as in `Parameter`.
    """
    typical = value if probe is None else probe
    return Parameter("", unit, description, value, low, high, typical, free, prior=prior)


@dataclass(frozen=True, eq=False)
class KeywordHook:
    """A hook of `Effect`, by a function that takes its values by keyword.

    `names` are the numbers and options that the function reads; `home` is where another process
    finds the hook: module:effect.hook.
    """

    function: Callable[..., Any]
    names: Sequence[str]
    home: str

    def __call__(self, v: Values, drive: Drive, *more: Any) -> Any:
        return self.function(drive, *more, **{name: v[name] for name in self.names})

    def __reduce__(self) -> tuple[Callable[[str], Any], tuple[str]]:
        """How it goes to another process: there the function's name is the effect's."""
        return resolve_name, (self.home,)


def texts_of(function: Callable[..., Any]) -> dict[str, str]:
    """What a function's docstring says of its effect: mechanism, signature, valid and source."""
    text = cleandoc(function.__doc__ or "")
    mechanism = " ".join(text.partition("\n\n")[0].split()).removesuffix(".")
    labelled = re.findall(r"^(Signature|Valid|Source): (.*(?:\n +.*)*)", text, re.MULTILINE)
    texts = {"mechanism": mechanism[:1].lower() + mechanism[1:]}
    texts |= dict.fromkeys(("signature", "valid", "source"), "")
    return texts | {label.lower(): " ".join(words.split()) for label, words in labelled}


def effect(
    hook: str, *, follows: Follows = (), strength: tuple[str, ...] | None = None, **given: Any
) -> Callable[[Callable[..., Any]], Effect]:
    """A decorator: the `Effect` whose `hook` the function computes.

    The function takes by place what the hook is given after the values (conditions, site, ...), and
    by keyword the numbers and options that it reads. `given` are the effect's numbers; functions of
    the same form for its other hooks, by the hook's name; and other fields of `Effect`. `strength`
    is, unless given, the free numbers that start at zero.
    """
    numbers = {
        name: replace(value, name=name)
        for name, value in given.items()
        if isinstance(value, Parameter)
    }
    fields = {name: value for name, value in given.items() if name not in numbers}
    known = [*numbers, *fields.get("options", {})]
    if strength is None:
        strength = tuple(p.name for p in numbers.values() if p.value == 0.0 and p.free)

    def made(function: Callable[..., Any]) -> Effect:
        home = f"{function.__module__}:{function.__qualname__}"
        functions = {hook: function} | {name: fields[name] for name in ENTERS if name in fields}
        hooks = {}
        for name, each in functions.items():
            spec = getfullargspec(each)
            names = known if spec.varkw else spec.kwonlyargs
            hooks[name] = KeywordHook(each, names, f"{home}.{name}")
        read = {name for each in hooks.values() for name in each.names}
        if read != set(known):
            raise ModelError(
                f"effect {function.__name__}: its functions read {', '.join(sorted(read))}, its "
                f"numbers and options are {', '.join(known)}",
                allowed="each of these is read, and nothing else",
                do="correct the effect",
            )
        return Effect(
            id=function.__name__,
            follows=follows,
            acts_on=tuple(dict.fromkeys(ENTERS[name][0].split()[0] for name in hooks)),
            parameters=tuple(numbers.values()),
            strength=strength,
            **fields | hooks | texts_of(function),
        )

    return made
