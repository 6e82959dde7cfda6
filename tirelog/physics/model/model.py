"""A tire model as a list that a person can read.

A carcass with its numbers, effects with theirs, and nuisances, which are fitted beside the tire. It
is longer than others: to predict is part of a model, and shares what it computes once.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.data.setup import FORM_PRESSURE, FORM_STIFFNESS
from tirelog.errors import ModelError, choices, nearest, or_refusal, refuse_unknown
from tirelog.physics.carcass.numbers import (
    CARCASSES,
    CONTACTS,
    carcass_parameters,
    steady_carcass,
)
from tirelog.physics.effects import BY_ID, Drive, Effect, acting_on, readers, serves
from tirelog.physics.model import laws
from tirelog.physics.model.stages import (
    Active,
    Task,
    impedance,
    loaded_site,
    structure,
    waveform,
)
from tirelog.physics.spectral import BLOCK, MODES, Angles, Parameter
from tirelog.tables.writer import document, table
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import (
    ACCELERATION,
    OBSERVABLES,
    SCALARS,
    WAVEFORMS,
    at_odds,
    together,
)

# ---- An effect of a model, with its own numbers and options.


@dataclass(frozen=True)
class ModelEffect:
    """An effect of a model, with its numbers and options.

    `source` keeps a user's own words (expression, acts_on).
    """

    effect: Effect
    parameters: tuple[Parameter, ...]
    options: Mapping[str, str] = field(default_factory=dict)
    source: Mapping[str, Any] = field(default_factory=dict)

    @property
    def id(self) -> str:
        return self.effect.id

    @classmethod
    def of(cls, effect: Effect) -> ModelEffect:
        """The effect with its start values."""
        return cls(
            effect, effect.parameters, {name: words[0] for name, words in effect.options.items()}
        )

    def values(self, flat: Mapping[str, float]) -> dict[str, Any]:
        """Its own values out of the model's, and the words of its options."""
        return {**{p.name: flat[f"{self.id}.{p.name}"] for p in self.parameters}, **self.options}

    def resolved(self, conditions: Conditions) -> ModelEffect:
        """The entry with `driver = "auto"` settled.

        The driver is temperature if every revolution knows it and it varies, else time.
        """
        if self.options.get("driver") != "auto":
            return self
        varies = (
            conditions.known("temperature_K")
            and len(conditions) > 0
            and np.ptp(conditions.temperature_K) > 0.0
        )
        return replace(
            self, options={**self.options, "driver": "temperature" if varies else "time"}
        )


# ---- What a wheel, its road and the day do beside the tire's physics: words and sizes.
#
# A model file's [nuisances] says of each whether it is fitted beside the model ("on"), never is
# ("off"), or does if it earns its place ("auto", the default), and how large it ordinarily is. A
# size is the standard deviation of an amplitude before anything is measured, not a bound. The
# tire's form has a table of its own, [form], with its numbers once they are fitted.


#: what a model file may say of a nuisance
USES = ("auto", "on", "off")
#: the nuisance that puts an effect of its name into the model
FORM = "form"


@dataclass(frozen=True)
class Nuisance:
    """One nuisance of a model: its use, one of USES, and its sizes."""

    name: str
    description: str
    sizes: tuple[Parameter, ...]
    use: str = "auto"

    def size(self, name: str) -> float:
        """The value of one of its sizes."""
        return next(size.value for size in self.sizes if size.name == name)

    def used(self, use: str) -> Nuisance:
        """The same nuisance with another use."""
        return replace(self, use=use)


def _size(name: str, unit: str, description: str, value: float, high: float) -> Parameter:
    return Parameter(name, unit, description, value, 1e-9, high, probe=value, free=False)


#: every nuisance with its ordinary sizes.  The force variation is 50 to 100 N peak to peak of a
#: passenger tire; 20 K warm a closed tire's gas by 7 %; a rolling radius is known to 1 or 2 %.
#: A size twice as large gives a nuisance more of what it shares with an effect, and costs power
NUISANCES = (
    Nuisance(
        "wheel",
        "run-out and force variation at harmonics 1 to 3 of the wheel",
        (
            _size("run_out", "strain", "strain at one harmonic", 3e-5, 1e-2),
            _size("force", "1", "force variation at one harmonic over the load", 0.01, 0.5),
        ),
    ),
    Nuisance(
        "drift",
        "patch length, stiffnesses and baseline move along a log",
        (
            _size("relative", "1", "change of a length or stiffness along a log", 0.03, 1.0),
            _size("baseline", "1", "change of the baseline over the waveform's rms", 0.1, 10.0),
        ),
    ),
    Nuisance(
        "rolling",
        "the rolling radius is not the setup's, and follows speed and load",
        (_size("radius", "1", "relative error; its change up to 25 m/s", 0.02, 0.5),),
    ),
    Nuisance(
        "patch_law",
        "the patch grows with another power of the load",
        (_size("exponent", "1", "error of the exponent", 0.2, 2.0),),
    ),
    Nuisance(
        "pressure_law",
        "the patch shrinks with another power of the inflation pressure",
        (_size("exponent", "1", "error of the exponent", 0.3, 2.0),),
    ),
    Nuisance(
        FORM,
        "contact pressure and stiffness of the tire that no formula describes",
        (
            _size(
                "pressure",
                "1",
                "a shape of the pressure over the mean pressure",
                FORM_PRESSURE,
                3.0,
            ),
            _size("stiffness", "1", "change of the stiffness at a wavelength", FORM_STIFFNESS, 2.0),
        ),
    ),
)
BY_NAME = {nuisance.name: nuisance for nuisance in NUISANCES}


# ---- The model itself.

#: Step of a central difference over a parameter's size; the stages are smooth, the error is its
#: square. With twice as much it is four times as large, and rounding half as large.
_STEP = 2e-5


@dataclass(frozen=True)
class Model:
    """A forward model; immutable: every change gives another one.

    observable  what it predicts, `beside` what else if it is fitted to several
    carcass     beam, ring or coupled_ring; contact 'prescribed' (patch_half_length_m), 'flat_road'
                (rings), or 'point' (the load of P1 (2), on one line across the tread)
    base        parameters of carcass and load; effects with theirs, distinct ids
    nuisances   what may be fitted beside the model, with their ordinary sizes
    document    the TOML it was read from, so that comments survive; path where it lies
    effects_file  the Python file with the user's own effects that it was read with
    """

    observable: str
    carcass: str
    contact: str
    base: tuple[Parameter, ...]
    effects: tuple[ModelEffect, ...] = ()
    nuisances: tuple[Nuisance, ...] = NUISANCES
    document: str | None = None
    path: Path | None = None
    beside: tuple[str, ...] = ()
    effects_file: Path | None = None

    def __repr__(self) -> str:
        road = " on a flat road" if self.contact == "flat_road" else ""
        effects = ", ".join(effect.id for effect in self.effects) or "none"
        return (
            f"Model of {together(self.observables)}: {self.carcass}{road}, {len(self.free)} free "
            f"parameters, effects: {effects}"
        )

    def _repr_html_(self) -> str:
        """The parameters as a notebook shows them."""
        rows = [
            (name, p.value, p.se, p.unit, "free" if p.free else "fixed", p.description)
            for name, p in self.parameters.items()
        ]
        names = ["parameter", "value", "error", "unit", "", "what it is"]
        return document(repr(self), [table(names, rows)])

    # ---- making and changing ---------------------------------------------------------------------

    @classmethod
    def new(
        cls,
        carcass: str = "beam",
        observable: str | Sequence[str] = "strain",
        contact: str | None = None,
        **values: float,
    ) -> Model:
        """A model without effects, at its start values or those given.

        A ring is on a flat road unless `contact` is another. Of several observables, which
        are to be fitted together, the first leads.
        """
        _one_of("carcass", carcass, CARCASSES)
        observables = observables_known(observable)
        contact = contact or ("prescribed" if carcass == "beam" else "flat_road")
        _one_of("contact", contact, CONTACTS)
        if carcass == "beam" and contact == "flat_road":
            raise ModelError(
                'contact = "flat_road" needs the geometry of a ring',
                allowed='"prescribed" and "point" are allowed for a beam',
                do='take carcass = "ring"',
            )
        if carcass == "coupled_ring" and contact != "flat_road":
            raise ModelError(
                "a coupled ring needs a tread on the road",
                allowed='contact = "flat_road" is allowed',
                do='leave contact out, or take carcass = "ring"',
            )
        base = carcass_parameters(
            carcass, *observables, flat_road=contact == "flat_road", point=contact == "point"
        )
        lead, *beside = observables
        return cls(lead, carcass, contact, base, beside=tuple(beside)).with_values(values)

    def with_values(
        self, values: Mapping[str, float | str], *, se: Mapping[str, float] | None = None
    ) -> Model:
        """The model with other values by name ("effect.parameter" for an effect's).

        Of an effect's choice ("stiffening.law") the value is one of its words. ModelError for
        unknown names, other words, and values outside their bounds.
        """
        words = self._words
        self.known(name for name in values if name not in words)
        for name in words.keys() & values:
            _one_of(name, str(values[name]), words[name])

        numbers = {name: p for name, p in self.parameters.items() if name in values}
        moved = self.with_parameters(
            {name: p.at(values[name], se=(se or {}).get(name)) for name, p in numbers.items()}
        )
        effects = tuple(
            replace(
                e,
                options={k: str(values.get(f"{e.id}.{k}", word)) for k, word in e.options.items()},
            )
            for e in moved.effects
        )
        return replace(moved, effects=effects)

    def with_parameters(self, parameters: Mapping[str, Parameter]) -> Model:
        """Other parameters (bounds, free or fixed) by full name."""
        self.known(parameters)
        base = tuple(parameters.get(p.name, p) for p in self.base)
        effects = tuple(
            replace(
                e, parameters=tuple(parameters.get(f"{e.id}.{p.name}", p) for p in e.parameters)
            )
            for e in self.effects
        )
        return replace(self, base=base, effects=effects)

    def with_effect(self, effect: str | Effect | ModelEffect, **values: float | str) -> Model:
        """The model with one effect more, at its start values or those given.

        ModelError if the effect is unknown, in the model already, or not for this model.
        """
        if isinstance(effect, str):
            refuse_unknown(
                effect,
                BY_ID,
                f"unknown effect {effect!r}",
                do="list: `tirelog effects`",
                error=ModelError,
            )
            effect = BY_ID[effect]
        added = effect if isinstance(effect, ModelEffect) else ModelEffect.of(effect)
        model = self.with_entry(added)
        return model.with_values({f"{added.id}.{name}": value for name, value in values.items()})

    def with_nuisance(self, name: str, use: str) -> Model:
        """The model with another use of a nuisance: auto, on or off."""
        known = [nuisance.name for nuisance in self.nuisances]
        _one_of("nuisance", name, known)
        _one_of(f"use of the nuisance {name}:", use, USES)
        changed = tuple(n.used(use) if n.name == name else n for n in self.nuisances)
        kept = tuple(e for e in self.effects if use != "off" or e.id != name)
        return replace(self, nuisances=changed, effects=kept)

    def with_entry(self, added: ModelEffect, beside: Sequence[ModelEffect] = ()) -> Model:
        """The model with one effect more.

        `beside` are effects that will be in the model too: what acts on the load of a phase shift
        acts through load_crosstalk, whichever of the two comes first.

        ModelError if it is in the model already, or not for this model.
        """
        self._accept(added, [e.effect for e in (*self.effects, *beside)])
        return replace(self, effects=(*self.effects, added))

    def without_effect(self, *effects: str) -> Model:
        """The model without one or several effects.

        ModelError if it has no such effect, or if one that stays acts through one that goes.
        """
        held = [e.id for e in self.effects]
        for effect in effects:
            if effect not in held:
                raise ModelError(
                    f"the model has no effect {effect!r}{nearest(effect, held)}",
                    allowed=f"it has: {', '.join(held) or 'none'}",
                    do="name one of them",
                )
        kept = tuple(e for e in self.effects if e.id not in effects)
        idle = [e.id for e in kept if not self.acted_on_by(e.effect, [k.effect for k in kept])]
        if idle:
            raise ModelError(
                f"without {', '.join(effects)}, {', '.join(idle)} would act on nothing in a model "
                f"of {together(self.observables)}",
                allowed="effects that act on something are allowed",
                do=f"remove {', '.join(idle)} first",
            )
        return replace(self, effects=kept)

    def _accept(self, added: ModelEffect, beside: Sequence[Effect]) -> None:
        already = added.id in [e.id for e in self.effects]
        if not already and not self.acted_on_by(added.effect, beside):
            raise idle_effect(added.effect, self.observable)
        for wrong, what, allowed, do in (
            (
                already,
                f"the model has the effect {added.id!r} already",
                "each effect once is allowed",
                "change its parameters instead",
            ),
            (
                any(n.name == added.id and n.use == "off" for n in self.nuisances),
                f'[{added.id}] has use = "off" and numbers',
                'numbers are allowed with "auto" and "on"',
                "remove the numbers, or take another use",
            ),
            (
                added.effect.beam_only and steady_carcass(self.carcass) == "ring",
                f"{added.id}: the carcass is a ring already, which keeps its length",
                f'{added.id} is for carcass = "beam"',
                "leave it out",
            ),
        ):
            if wrong:
                raise ModelError(what, allowed=allowed, do=do)

    def resolved(self, conditions: Conditions) -> Model:
        """The model with what depends on the whole data (thermal_drift's driver) settled.

        Do so once before parts of the data are predicted.
        """
        return replace(self, effects=tuple(e.resolved(conditions) for e in self.effects))

    # ---- reading ---------------------------------------------------------------------------------

    @property
    def observables(self) -> tuple[str, ...]:
        """All that it predicts; more than one if they are fitted together."""
        return (self.observable, *self.beside)

    def acted_on_by(self, effect: Effect, beside: Iterable[Effect]) -> bool:
        """Does an effect act on any of its observables, with the effects `beside` it?"""
        others = tuple(beside)
        return any(effect.acts_in(observable, others) for observable in self.observables)

    def acts_on(self, effect: Effect, observable: str) -> bool:
        """True if an effect that it holds acts on one of its observables.

        A phase shift that is fitted together with a waveform also follows the belt: the angle is
        read from the fronts of an acceleration, which a leaning belt moves. Alone a phase shift
        says nothing of the belt.
        """
        held = [entry.effect for entry in self.effects]
        if effect.acts_in(observable, held):
            return True
        belt = observable == "phase_shift" and any(o in WAVEFORMS for o in self.observables)
        return belt and effect.acts_in(ACCELERATION, held)

    @cached_property
    def parameters(self) -> dict[str, Parameter]:
        """All parameters by full name, in the file's order."""
        own = {p.name: p for p in self.base}
        return own | {f"{e.id}.{p.name}": p for e in self.effects for p in e.parameters}

    @property
    def values(self) -> dict[str, float]:
        """All values by full name."""
        return {name: p.value for name, p in self.parameters.items()}

    @property
    def _words(self) -> dict[str, tuple[str, ...]]:
        """The words that each choice of an effect may be, by full name."""
        return {
            f"{e.id}.{name}": words
            for e in self.effects
            for name, words in e.effect.options.items()
        }

    @property
    def free(self) -> list[str]:
        """Names of the parameters that a fit moves."""
        return [name for name, p in self.parameters.items() if p.free]

    @property
    def ac_coupled(self) -> bool:
        """Is it of an accelerometer whose mean level is removed?"""
        return bool(self.values.get("coupling_Hz"))

    def missing_conditions(self, conditions: Conditions) -> dict[str, list[str]]:
        """Effect -> fields of the conditions that it needs and some revolution lacks."""
        lacking = {e.id: e.effect.missing(conditions) for e in self.effects}
        return {name: fields for name, fields in lacking.items() if fields}

    def known(self, names: Any) -> None:
        """ModelError for a name that is none of the parameters."""
        for name in names:
            if name not in self.parameters:
                near, listed = choices(name, [*self.parameters, *self._words])
                raise ModelError(
                    f"the model has no parameter {name!r}{near}",
                    allowed=listed,
                    do="list: `tirelog model show MODEL`",
                )

    # ---- predicting ------------------------------------------------------------------------------

    def predict(
        self,
        conditions: Conditions,
        phi_rad: FloatArray | Angles | None = None,
        *,
        surface: str = "outer",
        values: Mapping[str, float] | None = None,
        observable: str | None = None,
        modes: int | None = None,
        each: bool = False,
    ) -> FloatArray:
        """What the sensor reads, shape (n, m): revolutions x angles.

        An observable of one number per revolution gives (n, 1).

        phi_rad (m,) or (n, m) [rad], NaN gives NaN; or `Angles`, made once for many predictions and
        with the variance of the samples in each bin. `values` replaces values by full name without
        a check of bounds. `observable` may also be

            displacement             [m], inward
            tangential_displacement  [m], NaN of a beam
            strain_slope             [1/m]; strain_curvature [1/m^2]
            contact_pressure         [N/m]; its modes carry the load exactly, and ripple by some
                                     parts in a thousand at its kinks
            shear_traction           [N/m], positive in braking
            frame_acceleration       [m/s^2], gravity and the vehicle's acceleration in what a
                                     radial accelerometer reads

        `modes` leaves out the waves shorter than the circumference over that number (P3's n_mode).
        `each`: every row by itself, to the bit what it is without those beside it. surface 'outer'
        (groove, minimum in the patch) or 'inner' (liner, maximum). ModelError: speed at or above
        the critical one, load not above zero, patch longer than the circumference, a condition that
        an effect needs is not known.
        """
        observable = observable or self.observable
        flat = {**self.values, **(values or {})}
        angles = None if observable in SCALARS else self._angles(phi_rad)
        result = np.empty((len(conditions), 1 if angles is None else angles.phi_rad.shape[1]))
        for rows, task, shares in self._parts(conditions, flat, observable, surface, each=each):
            part = None if angles is None else angles.take(rows)
            waves, level = laws.computed(task, observable, surface, part)
            if modes is not None:
                waves = np.where(np.arange(MODES) <= modes, waves, 0.0)
            result[rows] = laws.evaluated((waves, level), part, shares)
        return result

    def linearised(
        self,
        conditions: Conditions,
        phi_rad: FloatArray | Angles | None,
        names: Sequence[str],
        *,
        surface: str = "outer",
        values: Mapping[str, float] | None = None,
        observable: str | None = None,
        rough: bool = False,
    ) -> tuple[FloatArray, FloatArray]:
        """`predict`, and its derivatives by the parameters `names`, (len(names), n, m).

        Central differences of the stages that each parameter touches; forward ones if `rough`, in
        half the time and with an error of some 1e-5 instead of 1e-9: enough to descend by.
        """
        self.known(names)
        observable = observable or self.observable
        flat = {**self.values, **(values or {})}
        angles = None if observable in SCALARS else self._angles(phi_rad)
        model, n, m = (
            self.resolved(conditions),
            len(conditions),
            1 if angles is None else angles.phi_rad.shape[1],
        )
        base, slopes = np.empty((n, m)), np.empty((len(names), n, m))
        for rows, task, shares in self._parts(conditions, flat, observable, surface, also=names):
            part = None if angles is None else angles.take(rows)
            here = laws.computed(task, observable, surface, part)
            base[rows] = laws.evaluated(here, part, shares)
            for i, name in enumerate(names):
                slopes[i, rows] = laws.evaluated(
                    model._slope(
                        task, flat, name, observable, surface, part, here if rough else None
                    ),
                    part,
                    shares,
                )
        return base, slopes

    def _slope(
        self,
        task: Task,
        flat: dict[str, float],
        name: str,
        observable: str,
        surface: str,
        angles: Angles | None,
        beside: laws.Computed | None,
    ) -> laws.Computed:
        """The derivative by one parameter, forward of what is computed `beside` it if given."""
        step = _STEP * max(abs(flat[name]), abs(self.parameters[name].probe) * 0.1)

        @or_refusal
        def at(moved: float) -> laws.Computed:
            """What is computed with the value moved by so many steps."""
            base, active = self._split({**flat, name: flat[name] + moved * step})
            end = replace(task, base=base, active=active, near=task)
            return laws.computed(end, observable, surface, angles)

        width = 2.0 * step if beside is None else step
        high, low = at(1.0), at(-1.0) if beside is None else beside
        if isinstance(high, ModelError):  # at the edge of what is computed: the slope within
            high, low, width = at(0.0), at(-1.0), step
        elif isinstance(low, ModelError):
            low, width = at(0.0), step
        if isinstance(high, ModelError):
            raise high
        if isinstance(low, ModelError):
            raise low
        return (high[0] - low[0]) / width, (high[1] - low[1]) / width

    def _angles(self, phi_rad: FloatArray | Angles | None) -> Angles:
        if isinstance(phi_rad, Angles):
            return phi_rad
        if phi_rad is None:
            raise ModelError(
                f"a waveform ({self.observable}) needs angles",
                allowed="phi_rad of shape (m,) or (n, m) is allowed",
                do="give it",
            )
        return Angles(phi_rad)

    def _split(self, flat: Mapping[str, float]) -> tuple[dict[str, float], tuple[Active, ...]]:
        """The carcass's values, and the effects that are on, in the order of their ids."""
        carcass = steady_carcass(self.carcass)
        every = ((e.effect, e.values(flat)) for e in sorted(self.effects, key=lambda e: e.id))
        active = tuple((own, values) for own, values in every if own.is_on(values, carcass))
        return {p.name: flat[p.name] for p in self.base}, active

    def _parts(
        self,
        conditions: Conditions,
        flat: Mapping[str, float],
        observable: str,
        surface: str,
        also: Sequence[str] = (),
        each: bool = False,
    ) -> Iterator[tuple[slice, Task, FloatArray | None]]:
        """`_tasks`, or all rows in one task of few speeds with their shares of these.

        That is if they tell the rows' strain; None for a task of the rows themselves.
        """
        apart = each or observable != "strain" or len(conditions) < 2 * laws.COUNTS[0]
        for count in () if apart else laws.COUNTS:
            task = self._task(conditions, flat, also)
            on = {effect.id for effect, _ in task.active} | {name.split(".")[0] for name in also}
            acting = [e.effect for e in self.effects if e.id in on]
            few = laws.few_speeds(task.drive, acting, count)
            if few is None:
                break
            task = replace(task, drive=few[0])
            modes, _ = waveform(task, observable, laws.lever_arm(task, surface))
            if laws.told_by(modes):
                yield slice(0, len(conditions)), task, few[1]
                return
        for rows, task in self._tasks(conditions, flat, also):
            yield rows, task, None

    def _tasks(
        self, conditions: Conditions, flat: Mapping[str, float], also: Sequence[str] = ()
    ) -> Iterator[tuple[slice, Task]]:
        """(rows, task) block by block.  ModelError as of `_task`."""
        task = self._task(conditions, flat, also)
        for start in range(0, len(conditions), BLOCK):
            rows = slice(start, min(start + BLOCK, len(conditions)))
            yield rows, replace(task, drive=task.drive.take(rows), memo={})

    def _task(
        self, conditions: Conditions, flat: Mapping[str, float], also: Sequence[str] = ()
    ) -> Task:
        """The task of all rows.

        ModelError if an effect that is on, or has a parameter in `also`, lacks a condition.
        """
        model = self.resolved(conditions)
        base, active = model._split(flat)
        on = {effect.id for effect, _ in active} | {name.split(".")[0] for name in also}
        for effect, lacking in self.missing_conditions(conditions).items():
            if effect in on:
                raise ModelError(
                    f"effect {effect!r} needs {', '.join(lacking)}",
                    allowed="the log must know it",
                    do="give it in the setup's [conditions] or as a channel",
                )
        if len(conditions) and not conditions.known("speed_m_s"):
            raise ModelError(
                "a revolution has no speed",
                allowed="every revolution needs one",
                do="leave it out of the stack",
            )
        return Task(
            steady_carcass(self.carcass),
            self.contact == "flat_road",
            base,
            active,
            Drive.of(conditions),
            point=self.contact == "point",
        )

    def half_length_m(self, conditions: Conditions) -> FloatArray:
        """L of the patch, shape (n,), after the effects on the load."""
        return self.predict(conditions, observable="patch_length")[:, 0] / 2.0

    def site_loads_N(self, conditions: Conditions) -> FloatArray:
        """F on the patch, shape (n,), after the effects on the load."""
        out = np.empty((len(conditions), 1))
        for rows, task in self._tasks(conditions, self.values):
            out[rows] = loaded_site(task)[0].load_N
        return out[:, 0]

    def static_stiffness(self, conditions: Conditions) -> FloatArray:
        """Load per length over deflection [N/m^2] of belt and foundation at rest, by mode (K,).

        Under the conditions of the first row, its speed apart.
        """
        at_rest = replace(conditions.take(slice(0, 1)), speed_m_s=np.full(1, 1e-3))
        _, task = next(self._tasks(at_rest, self.values))
        return np.asarray(np.real(impedance(task, structure(task)))[0])


def idle_effect(effect: Effect, observable: str) -> ModelError:
    """The refusal of an effect that acts on nothing in a model of an observable."""
    stages = f"what acts on {observable}: {', '.join(acting_on(observable))}"
    what = f"effect {effect.id!r} {why_idle(effect, observable)}"
    beside = " or ".join(other.id for other in readers(effect, observable))
    more = f"; and {', '.join(effect.acts_on)} beside {beside}" if beside else ""
    one = f"add {beside} as well, or leave {effect.id} out"
    do = one if beside else "choose one of them, or another effect"
    return ModelError(what, allowed=f"{stages}{more}", do=do)


def why_idle(effect: Effect, observable: str) -> str:
    """Why an effect acts on nothing in a model, as a clause about the effect."""
    on = ", ".join(effect.acts_on)
    if readers(effect, observable):
        return f"acts on {on}, which nothing in this model of {observable} reads"
    serving = ", ".join(serves(effect).values()) or "no observable"
    return f"acts on {on} and does nothing to {observable}, it is for {serving}"


def observables_known(given: str | Sequence[str]) -> tuple[str, ...]:
    """One observable or several.

    ModelError: one is none, or they are not to be fitted together.
    """
    names = (given,) if isinstance(given, str) else tuple(given)
    for name in names:
        _one_of("observable", name, tuple(OBSERVABLES))
    wrong = at_odds(names) if names else "no observable is given"
    if wrong:
        raise ModelError(
            f"observable = {', '.join(names)}: {wrong}",
            allowed="allowed are one observable, or several of different data, such as strain, "
            "radial_acceleration and phase_shift",
            do="leave one out" if names else "give one",
        )
    return names


def _one_of(what: str, word: str, allowed: Sequence[str]) -> None:
    refuse_unknown(
        word, allowed, f"unknown {what} {word!r}", do="choose one of them", error=ModelError
    )


# ---- A model's parameters as columns, and two models side by side.


def parameter_rows(model: Model) -> dict[str, list[Any]]:
    """Columns of the table of parameters."""
    named = model.parameters.items()
    return {
        "parameter": [name for name, _ in named],
        "value": [p.value for _, p in named],
        "se": [float("nan") if p.se is None else p.se for _, p in named],
        "unit": [p.unit for _, p in named],
        "min": [p.min for _, p in named],
        "max": [p.max for _, p in named],
        "free": [p.free for _, p in named],
    }


def difference_rows(one: Model, other: Model) -> dict[str, list[Any]]:
    """Parameters of two models side by side; `difference_sigma` if either has a standard error."""
    names = list(one.parameters | other.parameters)
    pairs = [(one.parameters.get(name), other.parameters.get(name)) for name in names]
    values = [[p.value if p else np.nan for p in pair] for pair in pairs]
    errors = [sum((p.se or 0.0) ** 2 for p in pair if p) ** 0.5 for pair in pairs]
    sigmas = [(a - b) / e if e > 0.0 else np.nan for (a, b), e in zip(values, errors, strict=True)]
    value, against = zip(*values, strict=True)
    rows = names, list(value), list(against), sigmas
    return dict(zip(("parameter", "value", "against", "difference_sigma"), rows, strict=True))
