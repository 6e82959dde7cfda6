"""How large each nuisance is, with errors, and what to do about it: numbers and words.

Base -> amplitudes of the nuisances beside its model (all that stayed together, each other one
        alone beside them), parameters and offsets free -> parts with standard errors
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.diagnosis.candidates.effect_jacobians import candidate_effects, signatures_of
from tirelog.diagnosis.candidates.nuisance_selection import groups_of
from tirelog.diagnosis.wording import NUISANCES_SAID
from tirelog.errors import ModelError, or_refusal
from tirelog.inference.base import Base, JointBase, bases_by_observable
from tirelog.inference.cells.cells import SharedEffects
from tirelog.inference.metric import Offsets, ProjectedOut
from tirelog.inference.nuisances import FORM, ZERO, frees, shared_effects
from tirelog.inference.scatter import scatter_columns
from tirelog.physics.effects import BY_ID
from tirelog.physics.model.model import Nuisance
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.conditions import CONDITIONS
from tirelog.vocabulary.observables import FLOORS, OBSERVABLES, STRAIN, shown

#: parts below so many of their standard errors are not spoken of; nor those below this share of
#: the largest; only the sentence depends on them: with twice as much of either it names fewer
#: parts, and always the largest
_SPOKEN_SIGMAS = 3.0
_SPOKEN_SHARE = 0.2
#: a force variation [of the load] and a run-out [strain] beyond which a wheel wants work: twice
#: what is ordinary at one harmonic, and 100 microstrain
_MUCH_FORCE = 0.02
_MUCH_RUN_OUT = 1e-4
#: an effect may be in the form if that leaves less than this share of its waveforms' square: of
#: what the series cannot follow a half is left; twice the share adds none
_HELD = 0.05
#: below this share of its square an effect is what the other parameters do already; a hundred times
#: as much would leave out ring_curvature
_SEEN = 1e-3
#: factors on a condition in every other manoeuvre, as other logs may have them: they part an effect
#: from the form if twice the share is left
_OTHER_LOGS: Mapping[str, tuple[str, float, float]] = {
    "speed": ("speed_m_s", 0.8, 1.1),
    "load": ("load_N", 0.6, 1.4),
    "inflation pressure": ("inflation_pressure_Pa", 0.7, 1.3),
    "tread age": ("distance_km", 0.3, 3.0),
}
#: ordinary sizes beyond which a nuisance may be misfit: one in 370 is larger by chance; twice as
#: many leave a wheel of 6 % to be balanced for a wrong carcass
_ORDINARY = 3.0
_ORDER = ("first", "second", "third")


@dataclass(frozen=True)
class NuisancePart:
    """One number of a nuisance: value and standard error in its unit, and its ordinary size."""

    name: str
    value: float
    se: float
    unit: str
    ordinary: float

    @property
    def sigmas(self) -> float:
        return abs(self.value) / self.se if self.se > 0.0 else 0.0


@dataclass(frozen=True)
class NuisanceFound:
    """A nuisance with its parts, and whether it stayed beside the model."""

    nuisance: str
    stayed: bool
    parts: tuple[NuisancePart, ...]

    @property
    def largest(self) -> NuisancePart:
        """The part that is largest against its ordinary size."""
        return max(self.parts, key=lambda part: abs(part.value) / part.ordinary)

    def to_json(self) -> dict[str, Any]:
        """Its largest part as size, se and unit; all parts; whether it stayed."""
        most = self.largest
        return {
            "size": most.value, "se": most.se, "unit": most.unit, "what": most.name,
            "stayed": self.stayed,
            "parts": [
                {"name": p.name, "value": p.value, "se": p.se, "unit": p.unit}
                for p in self.parts
            ],
        }  # fmt: skip


def nuisances_found(base: Base) -> tuple[NuisanceFound, ...]:
    """Every nuisance that these data can show, with its size beside the base's model."""
    held = base.cells.shared
    groups = groups_of(base)
    found = [_parameter(base, n) for n in base.model.nuisances if _is_free(base, n, groups)]
    if held is not None:
        value, covariance = _amplitudes(replace(base, cells=replace(base.cells, shared=None)), held)
        found += [
            NuisanceFound(g, True, tuple(_parts(base, held, g, value, covariance)))
            for g in held.groups
            if g != ZERO
        ]
    for nuisance in base.model.nuisances:
        if nuisance.name in groups or nuisance.use == "off":
            continue
        effects = shared_effects(base.cells, base.fit, nuisance.name)
        if effects is not None:
            value, covariance = _amplitudes(base, effects)
            parts = tuple(_parts(base, effects, nuisance.name, value, covariance))
            found.append(NuisanceFound(nuisance.name, False, parts))
    return tuple(found)


def _is_free(base: Base, nuisance: Nuisance, groups: Sequence[str]) -> bool:
    return nuisance.name in groups and bool(frees(base.model, nuisance.name))


def _parameter(base: Base, nuisance: Nuisance) -> NuisanceFound:
    """A nuisance that is parameters of the model: their changes from the values given."""
    given = (base.given or base.model).values
    parts = []
    for name in frees(base.model, nuisance.name):
        fitted = base.model.parameters[name]
        ordinary = nuisance.sizes[0].value if fitted.prior is None else fitted.prior[1]
        own = nuisance.sizes[0].name if fitted.prior is None else name.partition(".")[2]
        change = fitted.value - given.get(name, 0.0)
        parts.append(NuisancePart(own, change, fitted.se or 0.0, "1", ordinary))
    return NuisanceFound(nuisance.name, True, tuple(parts))


def _amplitudes(base: Base, effects: SharedEffects) -> tuple[FloatArray, FloatArray]:
    """Posterior means (K,) and covariance (K, K), base parameters and offsets free."""
    other = ProjectedOut.of(Offsets.of(base.cells, base.white), base.white(base.fit.moving))
    columns = other.without(base.white(effects.columns * effects.sd))
    flat = columns.reshape(-1, len(effects))
    residual = other.without(base.white(np.nan_to_num(base.cells.values - base.fit.prediction)))
    covariance = np.linalg.inv(np.eye(len(effects)) + flat.T @ flat)
    scale = max(1.0, base.fit.reduced_chi2)
    value = effects.sd * (covariance @ (flat.T @ residual.ravel()))
    return value, covariance * effects.sd[:, None] * effects.sd * scale


def _parts(
    base: Base, effects: SharedEffects, group: str, value: FloatArray, covariance: FloatArray
) -> list[NuisancePart]:
    """The numbers of one nuisance; cosine and sine of a harmonic are one."""
    se = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    own = [i for i, name in enumerate(effects.group) if name == group]
    if group != "wheel":
        return [
            NuisancePart(
                effects.names[i], float(value[i]), float(se[i]), _unit(base, effects.names[i]),
                float(effects.sd[i]),
            )
            for i in own
        ]  # fmt: skip
    at = {effects.names[i]: i for i in own}
    parts = []
    for cosine, c in at.items():
        if " cos " not in cosine:
            continue
        s = at[cosine.replace(" cos ", " sin ")]
        what, place = cosine.split(" cos ")
        size = float(np.hypot(value[c], value[s]))
        error = float(np.hypot(value[c] * se[c], value[s] * se[s]) / max(size, 1e-300))
        name = f"{what} at the {_ORDER[int(place[0]) - 1]} harmonic{_of_log(place[1:])}"
        parts.append(NuisancePart(name, size, error, _unit(base, what), float(effects.sd[c])))
    return parts


def _of_log(place: str) -> str:
    return f" of{place}" if place else ""


def _unit(base: Base, name: str) -> str:
    """The unit of a part: the observable's for what adds to it, else a share."""
    adds = _plain(name).startswith(("run-out", "baseline"))
    return observed(base, name)[1] if adds else "1"


def _plain(name: str) -> str:
    """The name of a part without its observable, which it has before it if there are several."""
    return name.rpartition(": ")[2]


def observed(base: Base, name: str = "") -> tuple[str, str]:
    """What a base is of, and its unit; of several observables that of a part by its name."""
    own = name.rpartition(": ")[0] or base.cells.observable
    if name and own not in OBSERVABLES and base.cells.together is not None:
        own = STRAIN  # a grating's, or all gratings'
    return own, OBSERVABLES[own].unit if own in OBSERVABLES else FLOORS


def nuisance_sentences(
    found: Sequence[NuisanceFound], base: Base, *, fails: bool = False
) -> list[str]:
    """What the fit includes beside the model, in words, and what to do about it.

    `fails`: the model leaves a rest that no effect explains. Then, at a bound or beyond ordinary
    sizes nothing is concluded, since a nuisance takes what it can of any misfit.
    """
    values = [(name, base.model.parameters[name]) for name in base.fit.names]
    at_bound = [name for name, p in values if p.value != 0.0 and p.value in (p.min, p.max)]
    doubts = ["the model leaves a rest"] if fails else []
    doubts += [f"{name} is at its bound" for name in dict.fromkeys([*base.fit.held, *at_bound])]
    return [_sentence(nuisance, base, doubts) for nuisance in found if nuisance.stayed]


def scatter_sentences(base: Base) -> list[str]:
    """What the noise floor mostly is, if that is what loads that scatter would do; else nothing."""
    if isinstance(base, JointBase):
        each = [(part.cells.label, scatter_sentences(part)) for part in bases_by_observable(base)]
        return [f"Of {name}: {said}" for name, sentences in each for said in sentences]
    scatter = base.floor.scatter
    columns = scatter_columns(base.cells, base.fit)
    by_load = replace(scatter, baseline_square=np.zeros_like(scatter.baseline_square))
    square = base.plain.weights**2 * np.nan_to_num(by_load.square(columns))
    if float(square.sum()) / base.plain.weight <= 0.5 * base.floor.square:
        return []
    within = f" and by {100.0 * scatter.wander_sd:.2g} % within" if scatter.wander_sd > 0.0 else ""
    return [
        "Most of the noise floor is as if loads scattered by "
        f"{100.0 * scatter.load_sd:.2g} % between manoeuvres{within}."
    ]


def held_by_form(base: Base) -> dict[str, list[str]]:
    """Effects that the form of a base may hold, and in what other logs would differ to part them.

    Of several observables as the first waveform shows it.
    """
    base = max(bases_by_observable(base), key=lambda part: part.cells.phi.shape[1])
    if FORM not in groups_of(base):
        return {}
    found = _left_by_form(base, base.cells.conditions)
    held: dict[str, list[str]] = {name: [] for name, left in found.items() if left < _HELD}
    every_other = base.cells.manoeuvre % 2 == 0
    for word, (field, low, high) in _OTHER_LOGS.items() if held else ():
        values = getattr(base.cells.conditions, field) * np.where(every_other, low, high)
        there = _left_by_form(base, replace(base.cells.conditions, **{field: values}), list(held))
        for name, left in there.items():
            held[name] += [word] * (left > 2.0 * _HELD)
    return held


def _left_by_form(
    base: Base, conditions: Conditions, names: Sequence[str] | None = None
) -> dict[str, float]:
    """Share of each effect's square that the form leaves of what the other parameters leave."""
    cells = replace(base.cells, conditions=conditions)
    moved = or_refusal(partial(base.model.linearised, names=base.fit.names))(
        conditions, surface=cells.surface, observable=cells.observable, **cells.angles
    )
    if isinstance(moved, ModelError):
        return {}
    slopes = base.white(np.moveaxis(moved[1], 0, -1))
    of_form = frees(base.model, FORM)
    others = [i for i, name in enumerate(base.fit.names) if name not in of_form]
    offsets = Offsets.of(cells, base.white)
    without, with_it = (ProjectedOut.of(offsets, x) for x in (slopes[..., others], slopes))
    shares = {}
    there = replace(base, cells=cells, fit=replace(base.fit, prediction=moved[0]))
    for effect in candidate_effects(base.model):
        if names is not None and effect.id not in names:
            continue
        signatures = signatures_of(there, effect)
        if isinstance(signatures, ModelError):
            continue
        columns = base.white(signatures[0].columns)
        seen = float((without.without(columns) ** 2).sum())
        if seen > _SEEN * float((columns**2).sum()):
            shares[effect.id] = float((with_it.without(columns) ** 2).sum()) / seen
    return shares


def held_sentences(held: Mapping[str, Sequence[str]]) -> list[str]:
    """What the form may hold beside the tire's own, and what would part it; none if nothing."""
    alone = [name for name, by in held.items() if not by]
    said = [
        f"The tire's own form may hold {name}: logs that differ more in {' or '.join(by)} part "
        "them."
        for name, by in held.items()
        if by
    ]
    return said + [
        f"The tire's own form may hold {', '.join(alone)}: no drive parts them. Add what is "
        "known of them to the model."
    ] * bool(alone)


def _parted_by(nuisance: str, base: Base, effect: str = "") -> str:
    """What parts a nuisance from an effect that looks like it."""
    followed = BY_ID[effect].followed if effect in BY_ID else ()
    varied = [CONDITIONS[name].name for name, _ in followed] or ["speed", "load"]
    measured = bool(np.isfinite(base.cells.conditions.temperature_K).all())
    several = isinstance(base, JointBase) and any(c.cells.member for c in base.channels)
    another = "a further" if several else "a second"
    return {
        "wheel": f"{another} grating at another angle of the wheel",
        "drift": "the same manoeuvres in another order"
        + ("" if measured else ", or a measured temperature"),
        "rolling": "a measured way, which gives the rolling radius",
        "patch_law": "a log at a third load",
        "pressure_law": "a log at a third pressure",
        FORM: f"a log that differs more in {' and '.join(varied)}",
    }[nuisance]


def alike_sentences(
    alike: Sequence[tuple[str, str]], selected: Sequence[str], stayed: Sequence[str], base: Base
) -> list[str]:
    """Where a nuisance and an effect do nearly the same: the one not taken, and what parts them."""
    said = []
    for nuisance, effect in alike:
        name, parts = NUISANCES_SAID[nuisance], f"{_parted_by(nuisance, base, effect)} parts them"
        if nuisance in stayed and effect not in selected:
            said.append(f"In place of {name}, {effect} would do nearly as well: {parts}.")
        elif effect in selected and nuisance not in stayed:
            said.append(f"In place of {effect}, {name} would do nearly as well: {parts}.")
    return said


def _sentence(found: NuisanceFound, base: Base, doubts: Sequence[str]) -> str:
    most = max((abs(part.value) / part.ordinary for part in found.parts), default=0.0)
    told = [
        part
        for part in found.parts
        if part.sigmas >= _SPOKEN_SIGMAS and abs(part.value) / part.ordinary > _SPOKEN_SHARE * most
    ] or [found.largest]
    sizes, tells = _reading(found, told, base)
    if most > _ORDINARY:
        doubts = [*doubts, f"it is {most:.2g} times its ordinary size"]
    if doubts:
        tells = f"no finding, since {' and '.join(doubts)}: misfit of the model may be in it"
    return f"The fit includes {NUISANCES_SAID[found.nuisance]}: {sizes}; {tells}."


def _reading(found: NuisanceFound, told: Sequence[NuisancePart], base: Base) -> tuple[str, str]:
    """The sizes of a nuisance in words, and what they tell if the model is right."""
    said = ", ".join(_said(part, base) for part in told)
    if found.nuisance == "wheel":
        much = any(
            part.value > (_MUCH_FORCE if "force" in part.name else _MUCH_RUN_OUT)
            for part in told
            if part.unit in ("1", "strain", "m/m")
        )
        return said, "balance the wheel or mount the tire anew" if much else "within what wheels do"
    if found.nuisance == "drift":
        tells = "as of a tire that warms or loses pressure"
        if any(_plain(part.name).startswith("baseline") for part in told):
            tells += (
                ". A baseline that moves is what thermal_drift does, too: "
                f"{_parted_by('drift', base)} parts them"
            )
        return said, tells
    if found.nuisance == "rolling":
        return said, "give the setup's [tire] the radius that a measured way shows"
    if found.nuisance == FORM:
        return said, "see `tirelog form`"
    (part,) = found.parts
    (parameter,) = frees(base.model, found.nuisance) or (None,)
    if parameter is None:
        said = f"the load acts as to another power, {part.value:+.2g} ± {part.se:.1g}"
    else:
        exponent = base.model.values[parameter]
        said = f"{parameter} is {exponent:.3g} ± {part.se:.1g}, not {exponent - part.value:.3g}"
    law, other = ("pressure", "load") if found.nuisance == "pressure_law" else ("load", "pressure")
    return said, f"or what went along with the {law}, such as the {other}"


def _said(part: NuisancePart, base: Base) -> str:
    if part.unit == "1" and not _plain(part.name).startswith(("run-out", "baseline")):
        sign = "" if _plain(part.name).startswith("force") else "+"
        return f"{part.name} {100.0 * part.value:{sign}.2g} ± {100.0 * part.se:.1g} %"
    factor, unit = shown(*observed(base, part.name))
    return f"{part.name} {part.value * factor:.2g} ± {part.se * factor:.1g} {unit}"
