"""A tire model as a list that a person can read: a carcass with its numbers, and effects with theirs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from tirelog.errors import ModelError, nearest
from tirelog.physics.carcass import CARCASSES, CONTACTS, OBSERVABLES, SCALARS, WAVEFORMS, carcass_parameters
from tirelog.physics.effects import BY_ID, Drive, Effect
from tirelog.physics.parameters import Parameter
from tirelog.physics.pipeline import Active, Task, hub_forces, loaded_site, waveform
from tirelog.physics.scalars import scalar
from tirelog.physics.spectral import MODES, Angles, FloatArray
from tirelog.recording import Conditions

#: Revolutions computed at once: their modes stay in the processor's cache.
BLOCK = 96
#: Step of a central difference over a parameter's size; the stages are smooth, the error is its square.
_STEP = 2e-5


@dataclass(frozen=True)
class ModelEffect:
    """An effect as it stands in a model: with its numbers and options; `source` keeps a user's own words (expression, acts_on)."""

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
        return cls(effect, effect.parameters, {name: words[0] for name, words in effect.options.items()})

    def values(self, flat: Mapping[str, float]) -> dict[str, float]:
        """Its own values out of the model's, with its options as `option:word` switches."""
        own = {p.name: flat[f"{self.id}.{p.name}"] for p in self.parameters}
        for name, words in self.effect.options.items():
            own |= {f"{name}:{word}": float(self.options[name] == word) for word in words}
        return own

    def resolved(self, conditions: Conditions) -> ModelEffect:
        """With `driver = "auto"` settled: temperature where every revolution knows it and it varies, else time."""
        if self.options.get("driver") != "auto":
            return self
        varies = conditions.known("temperature_K") and len(conditions) > 0 and np.ptp(conditions.temperature_K) > 0.0
        return replace(self, options={**self.options, "driver": "temperature" if varies else "time"})


@dataclass(frozen=True)
class Model:
    """A forward model; immutable: every change gives another one.

    observable  what it predicts; carcass 'beam' or 'ring'; contact 'prescribed' (patch_half_length_m) or 'flat_road' (ring only)
    base        parameters of carcass and load; effects with theirs, distinct ids
    document    the TOML it was read from, so that comments survive; path where it lies
    """

    observable: str
    carcass: str
    contact: str
    base: tuple[Parameter, ...]
    effects: tuple[ModelEffect, ...] = ()
    document: str | None = None
    path: Path | None = None

    # ---- making and changing ----------------------------------------------------------------------------------------------

    @classmethod
    def new(cls, carcass: str = "beam", observable: str = "strain", contact: str | None = None, **values: float) -> Model:
        """A model without effects with start values, those given replaced.  A ring stands on a flat road unless `contact` says otherwise."""
        _one_of("carcass", carcass, CARCASSES)
        _one_of("observable", observable, OBSERVABLES)
        contact = contact or ("flat_road" if carcass == "ring" else "prescribed")
        _one_of("contact", contact, CONTACTS)
        if carcass == "beam" and contact == "flat_road":
            raise ModelError(
                'contact = "flat_road" needs the geometry of a ring; "prescribed" is allowed for a beam; take carcass = "ring"'
            )
        base = carcass_parameters(carcass, observable, flat_road=contact == "flat_road")
        return cls(observable, carcass, contact, base).with_values(values)

    @classmethod
    def load(cls, path: str | Path, *, catalogue: Mapping[str, Effect] | None = None) -> Model:
        """Reads a model file (contract, "Model file"); ModelError names file, line and what is allowed."""
        from tirelog.physics.model_file import read

        return read(Path(path), catalogue=catalogue)

    def save(self, path: str | Path) -> None:
        """Writes the model file, whole or not at all, with the comments of the file it was read from."""
        from tirelog.physics.model_file import write

        write(self, Path(path))

    def with_values(self, values: Mapping[str, float], *, se: Mapping[str, float] | None = None) -> Model:
        """Other values by name ("effect.parameter" for an effect's); ModelError for unknown names and values outside their bounds."""
        self._known(values)

        def changed(owner: str, parameters: tuple[Parameter, ...]) -> tuple[Parameter, ...]:
            keys = [owner + p.name for p in parameters]
            return tuple(p.at(values[key], se=(se or {}).get(key)) if key in values else p for key, p in zip(keys, parameters))

        effects = tuple(replace(e, parameters=changed(f"{e.id}.", e.parameters)) for e in self.effects)
        return replace(self, base=changed("", self.base), effects=effects)

    def with_parameters(self, parameters: Mapping[str, Parameter]) -> Model:
        """Other parameters (bounds, free or fixed) by full name."""
        self._known(parameters)
        base = tuple(parameters.get(p.name, p) for p in self.base)
        effects = tuple(replace(e, parameters=tuple(parameters.get(f"{e.id}.{p.name}", p) for p in e.parameters)) for e in self.effects)
        return replace(self, base=base, effects=effects)

    def with_effect(self, effect: str | Effect | ModelEffect, **values: float) -> Model:
        """The model with one effect more, at its start values or those given; ModelError if unknown, twice, or not for this model."""
        if isinstance(effect, str):
            if effect not in BY_ID:
                raise ModelError(
                    f"unknown effect {effect!r}{nearest(effect, BY_ID)}; allowed are {', '.join(BY_ID)}; see `tirelog effects`"
                )
            effect = BY_ID[effect]
        added = effect if isinstance(effect, ModelEffect) else ModelEffect.of(effect)
        self._accept(added)
        model = replace(self, effects=(*self.effects, added))
        return model.with_values({f"{added.id}.{name}": value for name, value in values.items()})

    def without_effect(self, effect: str) -> Model:
        """The model without an effect."""
        if effect not in [e.id for e in self.effects]:
            held = ", ".join(e.id for e in self.effects) or "none"
            raise ModelError(
                f"the model has no effect {effect!r}{nearest(effect, [e.id for e in self.effects])}; it has: {held}; name one of them"
            )
        return replace(self, effects=tuple(e for e in self.effects if e.id != effect))

    def _accept(self, added: ModelEffect) -> None:
        if added.id in [e.id for e in self.effects]:
            raise ModelError(f"the model has the effect {added.id!r} already; each effect once is allowed; change its parameters instead")
        if self.observable not in added.effect.observables:
            raise ModelError(
                f"effect {added.id!r} does nothing to {self.observable}; it is for {', '.join(added.effect.observables)}; choose another effect"
            )
        if added.id == "ring_curvature" and self.carcass == "ring":
            raise ModelError('the carcass is a ring already; ring_curvature is for carcass = "beam"; leave it out')

    def resolved(self, conditions: Conditions) -> Model:
        """With what depends on the whole data (thermal_drift's driver) settled: do so once before parts of it are predicted."""
        return replace(self, effects=tuple(e.resolved(conditions) for e in self.effects))

    # ---- reading ------------------------------------------------------------------------------------------------------------

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
    def free(self) -> list[str]:
        """Names of the parameters that a fit moves."""
        return [name for name, p in self.parameters.items() if p.free]

    def missing_conditions(self, conditions: Conditions) -> dict[str, list[str]]:
        """Effect -> fields of the conditions that it needs and some revolution lacks."""
        lacking = {e.id: e.effect.missing(conditions) for e in self.effects}
        return {name: fields for name, fields in lacking.items() if fields}

    def _known(self, names: Any) -> None:
        for name in names:
            if name not in self.parameters:
                raise ModelError(
                    f"the model has no parameter {name!r}{nearest(name, self.parameters)}; it has {', '.join(self.parameters)}; use one of them"
                )

    # ---- predicting -----------------------------------------------------------------------------------------------------------

    def predict(
        self,
        conditions: Conditions,
        phi_rad: FloatArray | None = None,
        *,
        surface: str = "outer",
        phi_variance: FloatArray | None = None,
        values: Mapping[str, float] | None = None,
        observable: str | None = None,
    ) -> FloatArray:
        """What the sensor reads, shape (n, m): revolutions x angles; for a number per revolution (n, 1).

        phi_rad (m,) or (n, m) [rad], NaN gives NaN; phi_variance, same shapes [rad^2], adds f''/2 times it.  `values` replaces values by
        full name without a check of bounds.  `observable` may also be displacement [m], inward, or contact_pressure [N/m].
        surface 'outer' (groove, minimum in the patch) or 'inner' (liner, maximum).  ModelError: speed at or above the critical one,
        load not above zero, patch longer than the circumference, a condition that an effect needs is not known.
        """
        wave, level, _ = self.parts(
            conditions, phi_rad, surface=surface, phi_variance=phi_variance, values=values, observable=observable, slope=False
        )
        return wave + level

    def parts(
        self,
        conditions: Conditions,
        phi_rad: FloatArray | None,
        *,
        surface: str = "outer",
        phi_variance: FloatArray | None = None,
        values: Mapping[str, float] | None = None,
        observable: str | None = None,
        slope: bool = True,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """`predict` as waveform (n, m), in proportion to the lever arm for strain, what is added to it (n, m or 1), and with `slope` the
        waveform's derivative by phi (n, m), else empty."""
        observable = observable or self.observable
        flat = {**self.values, **(values or {})}
        angles = None if observable in SCALARS else self._angles(phi_rad, phi_variance)
        n, m = len(conditions), 1 if angles is None else angles.phi_rad.shape[1]
        wide = any(e.effect.strain is not None for e in self.effects)
        wave, level = np.empty((n, m)), np.zeros((n, m if wide else 1))
        steep = np.empty((n, m) if slope else (0, 0))
        for rows, task in self._tasks(conditions, flat):
            wave[rows], level[rows], part = _parts(task, observable, surface, None if angles is None else angles.take(rows), slope)
            if slope:
                steep[rows] = part
        return wave, level, steep

    def jacobian(
        self,
        conditions: Conditions,
        phi_rad: FloatArray | None,
        names: Sequence[str],
        *,
        surface: str = "outer",
        phi_variance: FloatArray | None = None,
        values: Mapping[str, float] | None = None,
        observable: str | None = None,
    ) -> FloatArray:
        """Derivatives of `predict` by the parameters `names`, shape (len(names), n, m); central differences of the stages a parameter touches."""
        return self.linearised(
            conditions, phi_rad, names, surface=surface, phi_variance=phi_variance, values=values, observable=observable
        )[1]

    def linearised(
        self,
        conditions: Conditions,
        phi_rad: FloatArray | None,
        names: Sequence[str],
        *,
        surface: str = "outer",
        phi_variance: FloatArray | None = None,
        values: Mapping[str, float] | None = None,
        observable: str | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        """`predict` and `jacobian` together, sharing their stages."""
        self._known(names)
        observable = observable or self.observable
        flat = {**self.values, **(values or {})}
        angles = None if observable in SCALARS else self._angles(phi_rad, phi_variance)
        model, n, m = self.resolved(conditions), len(conditions), 1 if angles is None else angles.phi_rad.shape[1]
        base, slopes = np.empty((n, m)), np.empty((len(names), n, m))
        for rows, task in self._tasks(conditions, flat, also=names):
            part = None if angles is None else angles.take(rows)
            wave, level, _ = _parts(task, observable, surface, part, False)
            base[rows] = wave + level
            for i, name in enumerate(names):
                slopes[i, rows] = model._slope(task, flat, name, observable, surface, part)
        return base, slopes

    def _slope(self, task: Task, flat: dict[str, float], name: str, observable: str, surface: str, angles: Angles | None) -> FloatArray:
        step = _STEP * max(abs(flat[name]), abs(self.parameters[name].probe) * 0.1)
        ends = []
        for value in (flat[name] + step, flat[name] - step):
            moved = {**flat, name: value}
            base, active = self._split(moved)
            ends.append(replace(task, base=base, active=active))
        if angles is None:
            up, down = (scalar(end, observable, _lever(end, surface)) for end in ends)
            return (up - down) / (2.0 * step)
        (up, level_up), (down, level_down) = (waveform(end, observable, _lever(end, surface)) for end in ends)
        added_up, added_down = (_added_strain(end, observable, angles.phi_rad) for end in ends)
        level = (level_up - level_down + added_up - added_down) / (2.0 * step)
        return level if up is down else angles.evaluate((up - down) / (2.0 * step)) + level

    def _angles(self, phi_rad: FloatArray | None, phi_variance: FloatArray | None) -> Angles:
        if phi_rad is None:
            raise ModelError(f"a waveform ({self.observable}) needs angles; phi_rad of shape (m,) or (n, m) is allowed; give it")
        return Angles(phi_rad, phi_variance)

    def _split(self, flat: Mapping[str, float]) -> tuple[dict[str, float], tuple[Active, ...]]:
        """The carcass's values, and the effects that are on, in the order of their ids."""
        active = (Active(e.effect, e.values(flat)) for e in sorted(self.effects, key=lambda e: e.id))
        return {p.name: flat[p.name] for p in self.base}, tuple(a for a in active if a.effect.is_on(a.values))

    def _tasks(self, conditions: Conditions, flat: Mapping[str, float], also: Sequence[str] = ()) -> Any:
        """(rows, task) block by block; refuses conditions that effects which are on, or have parameters in `also`, need and do not find."""
        model = self.resolved(conditions)
        base, active = model._split(flat)
        on = {a.effect.id for a in active} | {name.split(".")[0] for name in also if "." in name}
        for effect, lacking in self.missing_conditions(conditions).items():
            if effect in on:
                raise ModelError(
                    f"effect {effect!r} needs {', '.join(lacking)}; the log must know it; give it in the setup's [conditions] or as a channel"
                )
        if len(conditions) and not conditions.known("speed_m_s"):
            raise ModelError("a revolution has no speed; every revolution needs one; leave it out of the stack")
        drive = Drive.of(conditions)
        for start in range(0, len(conditions), BLOCK):
            rows = slice(start, min(start + BLOCK, len(conditions)))
            yield rows, Task(self.carcass, self.contact == "flat_road", base, active, drive.take(rows))

    # ---- what the wheel feels ---------------------------------------------------------------------------------------------------

    def half_length_m(self, conditions: Conditions) -> FloatArray:
        """L of the patch, shape (n,), after the effects on the load."""
        out = np.empty((len(conditions), 1))
        for rows, task in self._tasks(conditions, self.values):
            out[rows] = loaded_site(task)[0].half_length_m
        return out[:, 0]

    def hub_forces(self, conditions: Conditions) -> tuple[FloatArray, FloatArray]:
        """(F_x, F_z) [N] on the hub, each (n,): F_x positive in braking, F_z up.  For a ring (P3, errata)."""
        if self.carcass != "ring":
            raise ModelError('a beam has no hub; hub forces are for carcass = "ring"; make such a model')
        out = np.empty((2, len(conditions)))
        for rows, task in self._tasks(conditions, self.values):
            out[:, rows] = hub_forces(task)
        return out[0], out[1]


def _lever(task: Task, surface: str) -> float:
    _one_of("surface", surface, ("outer", "inner"))
    return task.base["lever_arm_m"] if surface == "inner" else -task.base["lever_arm_m"]


def _parts(task: Task, observable: str, surface: str, angles: Angles | None, slope: bool) -> tuple[Any, Any, Any]:
    """Waveform, what is added to it, and with `slope` the waveform's derivative by phi, of one block."""
    if angles is None:
        return scalar(task, observable, _lever(task, surface)), 0.0, 0.0
    modes, level = waveform(task, observable, _lever(task, surface))
    steep = angles.evaluate(modes * (1j * np.arange(MODES))) if slope else 0.0
    return angles.evaluate(modes), level + _added_strain(task, observable, angles.phi_rad), steep


def _added_strain(task: Task, observable: str, phi_rad: FloatArray) -> FloatArray | float:
    """Strain that effects add at the angles themselves (a user's own, `acts_on = "strain"`)."""
    total: FloatArray | float = 0.0
    if observable == "strain":
        for a in task.having("strain"):
            total = total + a.effect.strain(a.values, task.drive, loaded_site(task)[0], phi_rad)  # type: ignore[misc]
    return total


def _one_of(what: str, word: str, allowed: Sequence[str]) -> None:
    if word not in allowed:
        raise ModelError(f"unknown {what} {word!r}{nearest(word, allowed)}; allowed are {', '.join(allowed)}; choose one of them")


__all__ = ["BLOCK", "WAVEFORMS", "Model", "ModelEffect"]
