"""What a model computes: predictions block by block, and their derivatives.

    Conditions (n,), angles (m,) or (n, m) --blocks of BLOCK revolutions--> `stages.Task`
        --> values (n, m), slopes (p, n, m)

`Predicting` is the half of `Model` that computes; the other half, in `model`, is the list that a
person reads.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.errors import ModelError, or_refusal
from tirelog.physics.carcass.numbers import steady_carcass
from tirelog.physics.effects import BY_ID, Drive, Effect
from tirelog.physics.model.laws import scalar
from tirelog.physics.model.stages import (
    Active,
    Task,
    hub_forces,
    impedance,
    loaded_site,
    structure,
    waveform,
)
from tirelog.physics.spectral import (
    BLOCK,
    MODES,
    Angles,
    ComplexArray,
    Parameter,
    interpolation_shares,
)
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import SCALARS

# ---- Waveforms of many rows that differ in speed alone, computed at a few speeds.
#
#     Drive of n rows, effects that are on --`few_speeds`--> Drive of k speeds, shares (n, k)
#     modes (k, K) --`told_by`--> do they tell what lies between?   rows = shares @ modes
#
# In the speed a waveform is smooth up to the critical one, so a polynomial through the speeds of
# Chebyshev's points holds between them: of speeds between 8 and 20 m/s seventeen leave 1e-10 of it.
# The polynomial is linear in the waveforms, and so as smooth in the parameters as they are.


#: numbers of speeds that are tried; the next where one does not tell what lies between, and each
#: for twice as many rows at least; twice as many take twice as long
COUNTS = (17, 33)


def few_speeds(
    drive: Drive, effects: Iterable[Effect], count: int
) -> tuple[Drive, FloatArray] | None:
    """(`count` speeds instead of the rows (n,), what each row takes of them (n, count)).

    None if something else differs that the effects may read, or if there are too few rows. What
    none of them reads is not known at these speeds.
    """
    columns = {f.name: getattr(drive, f.name) for f in fields(drive)}
    speed = columns["speed_m_s"]
    if speed.shape[0] < 2 * count or drive.load_N.shape[0] > 1:
        return None
    read = {"inflation_pressure_Pa"}
    for effect in effects:
        # what one of the user's own reads nobody knows, and a strain is added angle by angle
        if BY_ID.get(effect.id) is not effect or effect.strain is not None:
            return None
        read |= {*dict(effect.followed), *effect.needs, *effect.instead.values()}
    if any(columns[name].shape[0] > 1 for name in read - {"speed_m_s"}):
        return None
    low, high = float(speed.min()), float(speed.max())
    at = np.cos(np.pi * np.arange(count) / (count - 1))
    others = {
        name: x if x.shape[0] == 1 else np.full((1, 1), np.nan) for name, x in columns.items()
    }
    there = np.asarray(0.5 * (low + high) + 0.5 * (high - low) * at[:, None], dtype=np.float64)
    there[0], there[-1] = high, low  # to the last bit: the highest speed may be refused
    weights = np.where(np.arange(count) % 2 == 0, 1.0, -1.0)
    weights[[0, -1]] *= 0.5
    shares = interpolation_shares(there[:, 0], weights, speed[:, 0])
    return Drive(**others | {"speed_m_s": there}), shares


def told_by(modes: ComplexArray) -> bool:
    """Do waveforms (k, K) at Chebyshev's points tell those between?  False if one is not known."""
    if modes.shape[0] == 1:
        return True
    k = modes.shape[0]
    weight = np.ones(k)
    weight[[0, -1]] = 0.5
    highest = np.cos(np.pi * np.outer([k - 1, k - 2], np.arange(k)) / (k - 1)) * weight
    last = np.abs(highest @ modes).max() * 2.0 / (k - 1)
    # the last two of a polynomial's terms are below this share of the largest: so far it is off.
    # Twice as much is as far below what a log tells
    return bool(last <= 1e-9 * np.abs(modes).max())


#: Step of a central difference over a parameter's size; the stages are smooth, the error is its
#: square. With twice as much it is four times as large, and rounding half as large.
_STEP = 2e-5
#: Observable -> the hook that adds to it at the angles themselves.
_AT_ANGLES = {"strain": "strain", "radial_acceleration": "acceleration"}


class Predicting:
    """Predictions of a model that has these."""

    observable: str
    carcass: str
    contact: str
    base: tuple[Parameter, ...]
    effects: tuple[Any, ...]  # of `ModelEffect`, which stands beside the model

    if TYPE_CHECKING:

        @property
        def parameters(self) -> dict[str, Parameter]: ...
        @property
        def values(self) -> dict[str, float]: ...
        def resolved(self, conditions: Conditions) -> Any: ...
        def missing_conditions(self, conditions: Conditions) -> dict[str, list[str]]: ...
        def known(self, names: Any) -> None: ...

    def predict(
        self,
        conditions: Conditions,
        phi_rad: FloatArray | Angles | None = None,
        *,
        surface: str = "outer",
        phi_variance: FloatArray | None = None,
        values: Mapping[str, float] | None = None,
        observable: str | None = None,
        modes: int | None = None,
        each: bool = False,
    ) -> FloatArray:
        """What the sensor reads, shape (n, m): revolutions x angles.

        An observable of one number per revolution gives (n, 1).

        phi_rad (m,) or (n, m) [rad], NaN gives NaN; phi_variance, same shapes [rad^2], adds f''/2
        times it; or `Angles` of both, made once for many predictions. `values` replaces values by
        full name without a check of bounds. `observable` may also be displacement [m], inward,
        tangential_displacement [m] (NaN of a beam), strain_slope [1/m], strain_curvature [1/m^2],
        contact_pressure [N/m] (its modes carry the load exactly and ripple by some parts in a
        thousand beside its kinks), shear_traction [N/m], positive in braking, or frame_acceleration
        [m/s^2], gravity and the vehicle's acceleration in what a radial accelerometer reads.
        `modes` leaves out the waves shorter than the circumference over that number (P3's n_mode).
        `each`: every row by itself, to the bit what it is without those beside it. surface 'outer'
        (groove, minimum in the patch) or 'inner' (liner, maximum). ModelError: speed at or above
        the critical one, load not above zero, patch longer than the circumference, a condition that
        an effect needs is not known.
        """
        observable = observable or self.observable
        flat = {**self.values, **(values or {})}
        angles = None if observable in SCALARS else self._angles(phi_rad, phi_variance)
        result = np.empty((len(conditions), 1 if angles is None else angles.phi_rad.shape[1]))
        for rows, task, shares in self._parts(conditions, flat, observable, surface, each=each):
            part = None if angles is None else angles.take(rows)
            result[rows] = _predicted(task, observable, surface, part, modes, shares)
        return result

    def linearised(
        self,
        conditions: Conditions,
        phi_rad: FloatArray | Angles | None,
        names: Sequence[str],
        *,
        surface: str = "outer",
        phi_variance: FloatArray | None = None,
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
        angles = None if observable in SCALARS else self._angles(phi_rad, phi_variance)
        model, n, m = (
            self.resolved(conditions),
            len(conditions),
            1 if angles is None else angles.phi_rad.shape[1],
        )
        base, slopes = np.empty((n, m)), np.empty((len(names), n, m))
        for rows, task, shares in self._parts(conditions, flat, observable, surface, also=names):
            part = None if angles is None else angles.take(rows)
            here = _computed(task, observable, surface, part)
            base[rows] = _evaluated(here, part, shares)
            for i, name in enumerate(names):
                slopes[i, rows] = _evaluated(
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
        beside: Computed | None,
    ) -> Computed:
        """The derivative by one parameter, forward of what is computed `beside` it if given."""
        step = _STEP * max(abs(flat[name]), abs(self.parameters[name].probe) * 0.1)

        @or_refusal
        def at(moved: float) -> Computed:
            """What is computed with the value moved by so many steps."""
            base, active = self._split({**flat, name: flat[name] + moved * step})
            end = replace(task, base=base, active=active, near=task)
            return _computed(end, observable, surface, angles)

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

    def _angles(
        self, phi_rad: FloatArray | Angles | None, phi_variance: FloatArray | None
    ) -> Angles:
        if isinstance(phi_rad, Angles):
            return phi_rad
        if phi_rad is None:
            raise ModelError(
                f"a waveform ({self.observable}) needs angles",
                allowed="phi_rad of shape (m,) or (n, m) is allowed",
                do="give it",
            )
        return Angles(phi_rad, phi_variance)

    def _split(self, flat: Mapping[str, float]) -> tuple[dict[str, float], tuple[Active, ...]]:
        """The carcass's values, and the effects that are on, in the order of their ids."""
        active = (
            Active(e.effect, e.values(flat)) for e in sorted(self.effects, key=lambda e: e.id)
        )
        return {p.name: flat[p.name] for p in self.base}, tuple(
            a for a in active if a.effect.is_on(a.values, steady_carcass(self.carcass))
        )

    def _parts(
        self,
        conditions: Conditions,
        flat: Mapping[str, float],
        observable: str,
        surface: str,
        also: Sequence[str] = (),
        each: bool = False,
    ) -> Iterator[tuple[slice, Task, FloatArray | None]]:
        """`_tasks`, or all rows in one task of few speeds, and the shares that rows have of them.

        That is if they tell the rows' strain; None for a task of the rows themselves.
        """
        apart = each or observable != "strain" or len(conditions) < 2 * COUNTS[0]
        for count in () if apart else COUNTS:
            task = self._task(conditions, flat, also)
            on = {a.effect.id for a in task.active} | {name.split(".")[0] for name in also}
            acting = [e.effect for e in self.effects if e.id in on]
            few = few_speeds(task.drive, acting, count)
            if few is None:
                break
            task = replace(task, drive=few[0])
            modes, _ = waveform(task, observable, _lever(task, surface))
            if told_by(modes):
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
        on = {a.effect.id for a in active} | {name.split(".")[0] for name in also if "." in name}
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
        out = np.empty((len(conditions), 1))
        for rows, task in self._tasks(conditions, self.values):
            out[rows] = loaded_site(task)[0].half_length_m
        return out[:, 0]

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

    def hub_forces(self, conditions: Conditions) -> tuple[FloatArray, FloatArray]:
        """(F_x, F_z) [N] on the hub, each (n,): F_x positive in braking, F_z up.

        For rings (P3, errata).
        """
        if steady_carcass(self.carcass) != "ring":
            raise ModelError(
                "a beam has no hub",
                allowed='hub forces are for carcass = "ring"',
                do="make such a model",
            )
        out = np.empty((2, len(conditions)))
        for rows, task in self._tasks(conditions, self.values):
            out[:, rows] = hub_forces(task)
        return out[0], out[1]


def _lever(task: Task, surface: str) -> float:
    if surface not in ("outer", "inner"):
        raise ModelError(
            f"unknown surface {surface!r}",
            allowed="allowed are outer, inner",
            do="choose one of them",
        )
    return task.base["lever_arm_m"] if surface == "inner" else -task.base["lever_arm_m"]


#: modes (n or 1, K) and what is added to them at the angles (n or 1, m or 1) of one block; of a
#: number per revolution no modes, and that number
Computed = tuple[ComplexArray | float, FloatArray | float]


def _computed(task: Task, observable: str, surface: str, angles: Angles | None) -> Computed:
    """What the sensor reads in one block, as modes and what is added to them."""
    lever = _lever(task, surface)
    if angles is None:
        return 0.0, scalar(task, observable, lever)
    modes, level = waveform(task, observable, lever)
    return modes, level + _added(task, observable, angles)


def _evaluated(
    computed: Computed, angles: Angles | None, shares: FloatArray | None = None
) -> FloatArray | float:
    """What is computed, at the angles; `shares` (n, k): rows are so much of what the task has."""
    modes, level = computed
    if angles is None:
        return level
    return angles.evaluate(np.asarray(modes), shares) + _of_rows(level, shares)


def _predicted(
    task: Task,
    observable: str,
    surface: str,
    angles: Angles | None,
    highest: int | None = None,
    shares: FloatArray | None = None,
) -> FloatArray | float:
    """What the sensor reads in one block: the waveform and what is added to it.

    `highest` is the mode that is the last of a waveform; None: all.
    """
    modes, level = _computed(task, observable, surface, angles)
    if highest is not None and angles is not None:
        modes = np.where(np.arange(MODES) <= highest, modes, 0.0)
    return _evaluated((modes, level), angles, shares)


def _of_rows(level: FloatArray | float, shares: FloatArray | None) -> FloatArray | float:
    """What a task of few speeds adds (k or 1, 1), of each row (n or 1, 1)."""
    if shares is None or np.ndim(level) == 0 or np.shape(level)[0] == 1:
        return level
    return shares @ level


def _added(task: Task, observable: str, angles: Angles) -> FloatArray | float:
    """What effects add at the angles themselves, in the mean over the samples of each bin.

    These are a user's own, `acts_on = "strain"` or "radial_acceleration".
    """
    total: FloatArray | float = 0.0
    hook = _AT_ANGLES.get(observable, "")
    for a in task.having(hook) if hook else ():
        site, at = loaded_site(task)[0], getattr(a.effect, hook)
        total = total + angles.mean(partial(at, a.values, task.drive, site))
    return total
