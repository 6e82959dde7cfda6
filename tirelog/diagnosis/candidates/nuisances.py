"""Nuisances beside the candidates: which of them earn a place, and how large they are.

Base --> each nuisance's shared effects
    --> tests: the flips and the held-out gain of an effect, the share of chi-square's excess
    --> the base with the best, fitted again
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tirelog.diagnosis.answer import NUISANCES_SAID
from tirelog.diagnosis.candidates.assessment import (
    Scores,
    beside_base,
    candidate_effects,
    flip_test,
    gain_and_error,
    quiet_waveforms,
    signatures_of,
)
from tirelog.diagnosis.candidates.naming import explains_noise, worth_it
from tirelog.diagnosis.rules import (
    ALARM_P,
    FEWEST_MANOEUVRES,
    GAIN_SIGMAS,
    LEAST_SHARE_OF_FLOOR,
    NUISANCE_SHARE,
    REST_SHARE,
    TWINS,
)
from tirelog.errors import ModelError
from tirelog.inference.base import (
    Base,
    bases_by_observable,
    refit,
)
from tirelog.inference.cells.cells import SharedEffects, joined_effects, without_ratios
from tirelog.inference.floor import held_out_losses_with, scatter_columns
from tirelog.inference.metric import Offsets, stacked
from tirelog.inference.nuisances import (
    FORM,
    ZERO,
    bound,
    freed,
    frees,
    is_drift,
    shared_by,
    shared_effects,
)
from tirelog.physics.effects import BY_ID
from tirelog.physics.model.model import Model, Nuisance
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.conditions import CONDITIONS
from tirelog.vocabulary.observables import FLOORS, OBSERVABLES, STRAIN, shown


def groups_of(base: Base) -> tuple[str, ...]:
    """The nuisances that a base holds already."""
    shared = () if base.cells.shared is None else base.cells.shared.groups
    linear = [group for group in shared if group != ZERO]  # which no model names
    made_free = [
        n.name
        for n in base.model.nuisances
        if (names := frees(base.model, n.name))
        and _all_free(base.model, names)
        and (n.use == "on" or n.name == FORM or not _all_free(base.given, names))
    ]
    if FORM in made_free and "patch_law" in made_free:
        made_free.remove("patch_law")  # a part of the form
    return (*linear, *made_free)


def newest(base: Base, before: Base) -> str:
    """The nuisance that a base holds beyond those of the base `before` it."""
    return next(name for name in groups_of(base) if name not in groups_of(before))


def _all_free(model: Model, names: Sequence[str]) -> bool:
    return all(name in model.parameters and model.parameters[name].free for name in names)


def allowed_nuisances(base: Base) -> tuple[str, ...]:
    """The nuisances that may come in if they earn their place; not the form if it is there."""
    own = [effect.id for effect in base.model.effects]
    return tuple(n.name for n in base.model.nuisances if n.use == "auto" and n.name not in own)


def alarming_nuisances(base: Base, allowed: Iterable[str]) -> list[tuple[SharedEffects, float]]:
    """The nuisances beside those of the base that repeat and gain, as an effect must.

    Each with its held-out gain, by falling gain. Their size is judged once they are fitted, since
    scatter takes it before.
    """
    held = groups_of(base)
    found = [_effects_of(base, name) for name in allowed if name not in held]
    effects = [x for x in found if x is not None]
    if not effects:
        return []
    taken, residual = beside_base(base)
    scores = [
        Scores.of(base, taken.without(base.white(x.columns * x.sd)), residual) for x in effects
    ]
    _, p = flip_test(scores, base.cells.manoeuvres)
    columns = [[x.columns] for x in effects]
    losses = held_out_losses_with(base.cells, base.white, base.plain, base.fit, columns)
    gains = [gain_and_error(base.held_white, white) for white, _ in losses]
    alarming = [
        (x, gain)
        for x, own, (gain, error) in zip(effects, p, gains, strict=True)
        if own <= ALARM_P and gain > GAIN_SIGMAS * error
    ]
    return sorted(alarming, key=lambda pair: -pair[1])


def _effects_of(base: Base, name: str) -> SharedEffects | None:
    """What a nuisance does to all cells of a base; None if none shows it."""
    each = [shared_effects(one.cells, one.fit, name) for one in base.blocks]
    return joined_effects(base.cells, each)


#: a base with one nuisance more, refitted, and how many amplitudes that has
Rival = tuple[int, Base]


def rival_nuisances(base: Base, allowed: Iterable[str], least: float = 0.0) -> tuple[Rival, ...]:
    """The base with each of the nuisances that may earn a place beside it.

    Those that would remove less than the `least` share of the excess by a linear step are not
    fitted.
    """
    alarming = [
        effects
        for effects, _ in alarming_nuisances(base, allowed)
        if least <= 0.0 or _linear_share(base, effects) >= least
    ]
    # alarming nuisances that are fitted in full, the best first; twice as many take twice as many
    # fits of the whole model
    tried = [(effects, with_nuisance(base, *effects.groups)) for effects in alarming[:2]]
    return tuple(
        (len(effects), refitted)
        for effects, refitted in tried
        if not isinstance(refitted, ModelError)
        and (effects.groups != ("drift",) or _drifts(refitted))
    )


def best_of(base: Base, rivals: Iterable[Rival], least: float = NUISANCE_SHARE) -> Base | None:
    """The base with the nuisance that removes most of chi-square, if one earns its place.

    It removes at `least` so much of what chi-square is above its degrees of freedom.

    A nuisance of fewer amplitudes that does as much comes first: the more there are, the more of
    anything they imitate. And one that leaves most of the excess imitates what it is not.
    """
    enough = least * (base.noise_chi2 - base.fit.freedom)
    rows = [(count, base.noise_chi2 - rival.noise_chi2, rival) for count, rival in rivals]
    most = max((removed for _, removed, _ in rows), default=0.0)
    alike = [row for row in rows if row[1] >= max(enough, TWINS**2 * most)]
    return min(alike, key=lambda row: (row[0], -row[1]))[2] if alike else None


def best_nuisance(base: Base, allowed: Iterable[str], least: float = 0.0) -> Base | None:
    """`best_of` all nuisances that may earn a place; `least` as in `rival_nuisances`."""
    return best_of(base, rival_nuisances(base, allowed, least))


def with_best_nuisances(base: Base) -> Base:
    """The base with every nuisance that earns its place, the best first; itself if none does.

    The tire's form is tried where the others leave more than the floor. Others come in beside it
    only if they end there, since they may stand for a missing effect.
    """
    allowed = allowed_nuisances(base)
    bare = tuple(name for name in allowed if name != FORM)
    plain = _with_best(base, bare)
    if bare == allowed or base.cells.manoeuvres < FEWEST_MANOEUVRES or quiet_waveforms(plain):
        return plain
    formed = _with_best(base, (FORM,) if plain is base else allowed, NUISANCE_SHARE)
    if FORM not in groups_of(formed) or formed.square_held >= plain.square_held:
        return plain
    more = _with_best(formed, bare, NUISANCE_SHARE)
    return more if quiet_waveforms(more) else formed


def form_explains(formed: Base, without: Base) -> bool:
    """Does the tire's form explain what is left without it?"""
    # a form of the tire's own that does not end the search at the floor counts if it leaves less
    # than this share of what is left without it: an unknown effect is no form, though so many
    # numbers fit some of it. Of a ringing they leave 0.18; half the share asks more of a form with
    # sharp edges
    enough = formed.excess < 0.05 * without.excess
    return FORM in groups_of(formed) and (enough or quiet_waveforms(formed))


def with_form_errors(base: Base, formed: Base | None = None) -> Model:
    """The fitted model; its parameters have `se_with_form`, each in its own unit.

    With the form's numbers free within their prior (`formed`, if that was fitted already) the same
    log gives other values. The error is the root of their distance squared and their own variance.
    Parameters have none if the observable shows no form, or the model's form is off. Nor if the fit
    leaves more than noise and no form was fitted: there the form would stand for what is missing.
    """
    model, own = base.model, frees(base.model, FORM)
    if not own or any(n.name == FORM and n.use == "off" for n in model.nuisances):
        return model
    if own[0] in base.fit.names:
        formed = base
    elif formed is None and quiet_waveforms(base):
        found = refit(base, freed(model, [FORM]), several=True)
        formed = None if isinstance(found, ModelError) else found.with_scatter_estimated
    if formed is None:
        return model
    se = dict(zip(formed.fit.names, formed.fit.known.se.tolist(), strict=True))
    own_of = {name: p for name, p in model.parameters.items() if name in se}
    moved = {name: formed.model.values[name] - p.value for name, p in own_of.items()}
    return model.with_parameters(
        {
            name: replace(p, se_with_form=float(np.hypot(se[name], moved[name])))
            for name, p in own_of.items()
        }
    )


def _with_best(base: Base, allowed: Sequence[str], least: float = 0.0) -> Base:
    """The base with the best of the allowed nuisances, one after the other, up to the form."""
    if base.cells.manoeuvres < FEWEST_MANOEUVRES or quiet_waveforms(base):
        return base
    more = best_nuisance(base, allowed, least)
    if more is None:
        return base
    better = more.with_scatter_estimated
    return better if newest(more, base) == FORM else _with_best(better, allowed, least)


def _linear_share(base: Base, effects: SharedEffects) -> float:
    """The share of chi-square's excess that a nuisance removes by one linear step."""
    noise = base.noise
    taken = Offsets.of(base.cells, noise).beside(noise(base.fit.moving))
    columns = stacked(taken.without(noise(effects.columns * effects.sd)))
    residual = base.cells.values - base.fit.prediction - base.fit.beside
    left = taken.without(noise(np.nan_to_num(residual))).ravel()
    excess, slopes = float(left @ left) - base.fit.freedom, columns.T @ left
    step = np.linalg.solve(np.eye(len(effects)) + columns.T @ columns, slopes)
    removed = float((2.0 * slopes - columns.T @ (columns @ step)) @ step)
    return removed / excess if excess > 0.0 else 0.0


def _drifts(base: Base) -> bool:
    """Is the drift beside this base one?"""
    held = base.cells.shared
    if held is None:
        return False
    own = np.flatnonzero(np.array(held.group) == "drift")
    return is_drift(held.of_groups(["drift"]), base.fit.amplitudes[own])


def with_nuisance(base: Base, name: str) -> Base | ModelError:
    """The base with a nuisance beside its model, fitted again, or why that cannot be."""
    if frees(base.model, name):
        return refit(base, freed(base.model, [name]), several=name == FORM)
    shared = [
        SharedEffects.joined([one.cells.shared, shared_effects(one.cells, one.fit, name)])
        for one in base.blocks
    ]
    return refit(base, base.model, shared=shared)


def with_nuisances(base: Base, groups: Sequence[str]) -> Base | ModelError:
    """The base with these nuisances and no other beside its model, fitted again, or why not."""
    shared = [shared_by(one.cells, one.fit, groups) for one in base.blocks]
    return refit(base, _free_of_law(base, groups), shared=shared)


def needed_nuisances(base: Base) -> tuple[str, ...]:
    """Those of the base's nuisances that are always on, or without which it would be worse.

    By their size, as an effect's, or by their share of chi-square's excess, as they came in: if
    loads scatter, what a wheel does is sure, and small beside the floor.
    """
    groups = list(groups_of(base))
    always = [n.name for n in base.model.nuisances if n.use == "on"]
    for group in [g for g in groups if g not in always]:
        kept = [g for g in groups if g != group]
        held = [one.cells.shared for one in base.blocks]
        shared = [own.of_groups(kept) if own else None for own in held]
        less = refit(base, _free_of_law(base, kept), shared=shared)
        if isinstance(less, ModelError) or worth_it(less, base):
            continue
        gain, error = gain_and_error(less.held_white, base.held_white)
        if not (gain > GAIN_SIGMAS * error and explains_noise(less, base)):
            base, groups = less, kept
    return tuple(groups)


def _free_of_law(base: Base, groups: Sequence[str]) -> Model:
    """The base's model with the parameters of these nuisances free, of the others as given."""
    model = base.model
    for name in (n for n in groups_of(base) if frees(model, n) and n not in groups):
        model = bound(model, base.given, name)
    return freed(model, groups)


def with_nuisances_on(base: Base) -> Model:
    """The base's model, which asks for its nuisances from now on, as a file has it."""
    model = without_ratios(base.model)
    for group in groups_of(base):
        model = model.with_nuisance(group, "on")
    return model


# ---- How large each nuisance is, with errors, and what to do about it: numbers and words.
#
# Base -> amplitudes of the nuisances beside its model (all that stayed together, each other one
#         alone beside them), parameters and offsets free -> parts with standard errors


#: an effect may be in the form if that leaves less than this share of its waveforms' square: of
#: what the series cannot follow a half is left; twice the share adds none
_HELD = 0.05


@dataclass(frozen=True)
class NuisancePart:
    """One number of a nuisance: value and standard error in its unit, and its ordinary size."""

    name: str
    value: float
    se: float
    unit: str
    ordinary: float

    @property
    def sizes(self) -> float:
        """Its size in ordinary ones."""
        return abs(self.value) / self.ordinary


@dataclass(frozen=True)
class NuisanceFound:
    """A nuisance with its parts, and whether it stayed beside the model."""

    nuisance: str
    stayed: bool
    parts: tuple[NuisancePart, ...]

    @property
    def largest(self) -> NuisancePart:
        """The part that is largest against its ordinary size."""
        return max(self.parts, key=lambda part: part.sizes)

    def to_json(self) -> dict[str, Any]:
        """Its largest part as size, se and unit; all parts; whether it stayed."""
        most = self.largest
        parts = [{n: x for n, x in vars(p).items() if n != "ordinary"} for p in self.parts]
        return {
            "size": most.value, "se": most.se, "unit": most.unit, "what": most.name,
            "stayed": self.stayed, "parts": parts,
        }  # fmt: skip


def nuisances_found(base: Base) -> tuple[NuisanceFound, ...]:
    """Every nuisance that these data can show, with its size beside the base's model."""
    held, groups = base.cells.shared, groups_of(base)
    own = [n for n in base.model.nuisances if n.name in groups and frees(base.model, n.name)]
    found = [_parameter(base, n) for n in own]
    if held is not None:
        known = _amplitudes(replace(base, cells=replace(base.cells, shared=None)), held)
        found += [
            NuisanceFound(group, True, _parts(base, held, group, *known))
            for group in held.groups
            if group != ZERO
        ]
    others = [n.name for n in base.model.nuisances if n.name not in groups and n.use != "off"]
    for name in others:
        effects = _effects_of(base, name)
        if effects is not None:
            parts = _parts(base, effects, name, *_amplitudes(base, effects))
            found.append(NuisanceFound(name, False, parts))
    return tuple(found)


def _parameter(base: Base, nuisance: Nuisance) -> NuisanceFound:
    """A nuisance that is parameters of the model: their changes from the values given."""
    given, parts = base.given.values, []
    for name in (n for n in frees(base.model, nuisance.name) if n in base.fit.names):
        fitted, usual = base.model.parameters[name], nuisance.sizes[0]
        own, ordinary = usual.name, usual.value
        if fitted.prior is not None:
            own, ordinary = name.partition(".")[2], fitted.prior[1]
        change = fitted.value - given.get(name, 0.0)
        parts.append(NuisancePart(own, change, fitted.se or 0.0, "1", ordinary))
    return NuisanceFound(nuisance.name, True, tuple(parts))


def _amplitudes(base: Base, effects: SharedEffects) -> tuple[FloatArray, FloatArray]:
    """Posterior means (K,) and standard errors (K,), base parameters and offsets free."""
    taken, residual = beside_base(base)
    flat = stacked(taken.without(base.white(effects.columns * effects.sd)))
    covariance = np.linalg.inv(np.eye(len(effects)) + flat.T @ flat)
    variance = np.diag(covariance) * max(1.0, base.fit.reduced_chi2)
    value = effects.sd * (covariance @ (flat.T @ residual.ravel()))
    return value, effects.sd * np.sqrt(np.maximum(variance, 0.0))


def _parts(
    base: Base, effects: SharedEffects, group: str, value: FloatArray, se: FloatArray
) -> tuple[NuisancePart, ...]:
    """The numbers of one nuisance; cosine and sine of a harmonic are one."""
    at = {effects.names[i]: i for i, name in enumerate(effects.group) if name == group}
    parts = []
    shown_as = [name for name in at if group != "wheel" or " cos " in name]
    for name in shown_as:
        i, said = at[name], name
        number, error = float(value[i]), float(se[i])
        if group == "wheel":
            s = at[name.replace(" cos ", " sin ")]
            number = float(np.hypot(value[i], value[s]))
            error = float(np.hypot(value[i] * se[i], value[s] * se[s]) / max(number, 1e-300))
            name, place = name.split(" cos ")
            order = {"1": "first", "2": "second", "3": "third"}[place[0]]
            of_log = f" of{place[1:]}" if place[1:] else ""
            said = f"{name} at the {order} harmonic{of_log}"
        # the observable's for what adds to it, else a share
        unit = observed(base, name)[1] if _adds(name) else "1"
        parts.append(NuisancePart(said, number, error, unit, float(effects.sd[i])))
    return tuple(parts)


def _adds(name: str) -> bool:
    """Does a part add to the observable?"""
    return _plain(name).startswith(("run-out", "baseline"))


def _plain(name: str) -> str:
    """The name of a part without its observable, which it has before it if there are several."""
    return name.rpartition(": ")[2]


def observed(base: Base, name: str = "") -> tuple[str, str]:
    """What a base is of, and its unit; of several observables that of a part by its name."""
    own = name.rpartition(": ")[0] or base.cells.observable
    if name and own not in OBSERVABLES and base.cells.parts:
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
    doubts = ["the model leaves a rest"] * fails
    doubts += [f"{name} is at its bound" for name in dict.fromkeys([*base.fit.held, *at_bound])]
    return [_sentence(nuisance, base, doubts) for nuisance in found if nuisance.stayed]


def explained_by_nuisances(
    found: Sequence[NuisanceFound], given: Base, base: Base, came_in: Sequence[str]
) -> tuple[float, list[str]]:
    """(share of the excess that nuisances explain together, each with its largest part in words).

    given, base  without the nuisances that `came_in` and with them

    The share is of the held-out mean square above the floor; 0 and none if it is too small to
    matter.
    """
    floor = base.floor.square
    excess, left = given.square_held - floor, max(base.square_held - floor, 0.0)
    if not came_in or excess <= LEAST_SHARE_OF_FLOOR * floor or left > (1.0 - REST_SHARE) * excess:
        return 0.0, []
    parts = {
        one.nuisance: "above all " * bool(one.parts[1:]) + _said(one.largest, base)
        for one in found
        if one.stayed
    }
    words = [f"{NUISANCES_SAID[name]} ({parts[name]})" for name in came_in if name in parts]
    return 1.0 - left / excess, words


def scatter_sentences(base: Base) -> list[str]:
    """What the noise floor mostly is, if that is what loads that scatter would do; else nothing."""
    said = []
    for part in bases_by_observable(base):
        scatter, wander = part.floor.scatter, 100.0 * part.floor.scatter.wander_sd
        by_load = replace(scatter, baseline_square=np.zeros_like(scatter.baseline_square))
        columns = scatter_columns(part.cells, part.fit)
        square = part.plain.weights**2 * np.nan_to_num(by_load.square(columns))
        if float(square.sum()) / part.plain.weight > 0.5 * part.floor.square:
            of = f"Of {part.cells.label}: " if base.channels else ""
            within = f" and by {wander:.2g} % within" if wander > 0.0 else ""
            said.append(
                f"{of}Most of the noise floor is as if loads scattered by "
                f"{100.0 * scatter.load_sd:.2g} % between manoeuvres{within}."
            )
    return said


def held_by_form(base: Base) -> dict[str, list[str]]:
    """Effects that the form of a base may hold, and the conditions that each follows.

    A form follows none of them. Of several observables as the first waveform shows it.
    """
    base = max(bases_by_observable(base), key=lambda part: part.cells.phi.shape[1])
    if FORM not in groups_of(base):
        return {}
    slopes, of_form = base.white(base.fit.jacobian), frees(base.model, FORM)
    others = [i for i, name in enumerate(base.fit.names) if name not in of_form]
    offsets = Offsets.of(base.cells, base.white)
    without, with_it = (offsets.beside(x) for x in (slopes[..., others], slopes))
    held = {}
    for effect in candidate_effects(base.model):
        signatures = signatures_of(base, effect)
        if isinstance(signatures, ModelError):
            continue
        columns = base.white(signatures[0].columns)
        seen, left = (float((taken.without(columns) ** 2).sum()) for taken in (without, with_it))
        # below this share of its square an effect is what the other parameters do already; a
        # hundred times as much would leave out ring_curvature
        if seen > 1e-3 * float((columns**2).sum()) and left < _HELD * seen:
            held[effect.id] = [CONDITIONS[name].name for name, _ in effect.followed]
    return held


def held_sentences(held: Mapping[str, Sequence[str]]) -> list[str]:
    """What the form may hold beside the tire's own, and what may part it; none if nothing."""
    alone = [name for name, by in held.items() if not by]
    return [
        f"The tire's own form may hold {name}, which follows {' and '.join(by)}: logs that differ "
        "more in that may part them."
        for name, by in held.items()
        if by
    ] + [
        f"The tire's own form may hold {', '.join(alone)}. Add what is known of them to the model."
    ] * bool(alone)


def _parted_by(nuisance: str, base: Base, effect: str = "") -> str:
    """What parts a nuisance from an effect that looks like it."""
    followed = BY_ID[effect].followed if effect in BY_ID else ()
    varied = [CONDITIONS[name].name for name, _ in followed] or ["speed", "load"]
    measured = bool(np.isfinite(base.cells.conditions.temperature_K).all())
    several = any(c.cells.member for c in base.channels)
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
    most = max((part.sizes for part in found.parts), default=0.0)
    # parts below so many of their standard errors are not spoken of, nor those below this share of
    # the largest; with twice as much of either a sentence names fewer parts, always the largest
    told = [
        part
        for part in found.parts
        if abs(part.value) >= 3.0 * part.se > 0.0 and part.sizes > 0.2 * most
    ] or [found.largest]
    said = ", ".join(_said(part, base) for part in told)
    # a force variation [of the load] and a run-out [strain] beyond which a wheel wants work: twice
    # what is ordinary at one harmonic, and 100 microstrain
    much = any(
        part.value > (0.02 if "force" in part.name else 1e-4)
        for part in told
        if part.unit in ("1", "strain", "m/m")
    )
    tells = {
        "wheel": "balance the wheel or mount the tire anew" if much else "within what wheels do",
        "drift": "as of a tire that warms or loses pressure",
        "rolling": "give the setup's [tire] the radius that a measured way shows",
        "patch_law": "or what went along with the load, such as the pressure",
        "pressure_law": "or what went along with the pressure, such as the load",
        FORM: "see `tirelog form`",
    }[found.nuisance]
    if found.nuisance == "drift" and any(_plain(p.name).startswith("baseline") for p in told):
        tells += (
            ". A baseline that moves is what thermal_drift does, too: "
            f"{_parted_by('drift', base)} parts them"
        )
    if found.nuisance in ("patch_law", "pressure_law"):
        (part,) = found.parts
        said = f"the load acts as to another power, {part.value:+.2g} ± {part.se:.1g}"
        for parameter in frees(base.model, found.nuisance):
            exponent = base.model.values[parameter]
            said = f"{parameter} is {exponent:.3g} ± {part.se:.1g}, not {exponent - part.value:.3g}"
    # beyond three ordinary sizes a nuisance may be misfit: one in 370 is larger by chance; twice as
    # many leave a wheel of 6 % to be balanced for a wrong carcass
    if most > 3.0:
        doubts = [*doubts, f"it is {most:.2g} times its ordinary size"]
    if doubts:
        tells = f"no finding, since {' and '.join(doubts)}: misfit of the model may be in it"
    return f"The fit includes {NUISANCES_SAID[found.nuisance]}: {said}; {tells}."


def _said(part: NuisancePart, base: Base) -> str:
    if part.unit == "1" and not _adds(part.name):
        sign = "" if _plain(part.name).startswith("force") else "+"
        return f"{part.name} {100.0 * part.value:{sign}.2g} ± {100.0 * part.se:.1g} %"
    factor, unit = shown(*observed(base, part.name))
    return f"{part.name} {part.value * factor:.2g} ± {part.se * factor:.1g} {unit}"
