"""Nuisances beside the candidates: which of them earn a place, and how large they are.

Base -> each nuisance's shared effects -> the flips and the held-out gain that an effect must show,
        and the share of chi-square's excess that it removes -> the base with the best, fitted again
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tirelog.diagnosis.candidates.assessment import Scores, flip_test, gain_and_error, nuisance
from tirelog.diagnosis.candidates.at_noise_floor import quiet_waveforms
from tirelog.diagnosis.candidates.naming import worth_it
from tirelog.diagnosis.rules import (
    ALARM_P,
    FEWEST_MANOEUVRES,
    GAIN_SIGMAS,
    NUISANCE_SHARE,
    TWINS,
)
from tirelog.errors import ModelError
from tirelog.inference.base import Base, FittedChannel, refit, with_scatter_estimated
from tirelog.inference.cells.cells import SharedEffects
from tirelog.inference.cells.joint import without_ratios
from tirelog.inference.floor import held_out_losses_with
from tirelog.inference.metric import Offsets, ProjectedOut, per_group
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
from tirelog.physics.model.model import Model

#: alarming nuisances that are fitted in full, the best first; twice as many take twice as many
#: fits of the whole model
_MOST_REFITTED = 2
#: a form of the tire's own that does not end the search at the floor counts if it leaves less than
#: this share of what is left without it: an unknown effect is no form, though so many numbers fit
#: some of it. Of a ringing they leave 0.18; half the share asks more of a form with sharp edges
_FORM_LEAVES = 0.05


@dataclass(frozen=True)
class AssessedNuisance:
    """A nuisance with its evidence: family-wise p, held-out gain and its error.

    Its size is judged once it is fitted: what scatters takes it for its own before.
    """

    effects: SharedEffects
    p: float
    gain: float
    gain_error: float

    @property
    def group(self) -> str:
        return self.effects.group[0]

    @property
    def alarms(self) -> bool:
        """It repeats and gains, as an effect must."""
        return self.p <= ALARM_P and self.gain > GAIN_SIGMAS * self.gain_error


def groups_of(base: Base) -> tuple[str, ...]:
    """The nuisances that a base holds already."""
    shared = () if base.cells.shared is None else base.cells.shared.groups
    linear = (group for group in shared if group != ZERO)  # which no model names
    given = base.given or base.model
    made_free = [
        n.name
        for n in base.model.nuisances
        if (names := frees(base.model, n.name))
        and _all_free(base.model, names)
        and (n.use == "on" or n.name == FORM or not _all_free(given, names))
    ]
    if FORM in made_free and "patch_law" in made_free:
        made_free.remove("patch_law")  # a part of the form
    return (*linear, *made_free)


def _all_free(model: Model, names: Sequence[str]) -> bool:
    return all(name in model.parameters and model.parameters[name].free for name in names)


def allowed_nuisances(base: Base) -> tuple[str, ...]:
    """The nuisances that may come in if they earn their place; not the form if it is there."""
    own = [effect.id for effect in base.model.effects]
    return tuple(n.name for n in base.model.nuisances if n.use == "auto" and n.name not in own)


def assess_nuisances(base: Base, allowed: Iterable[str]) -> list[AssessedNuisance]:
    """Every nuisance that the base does not hold, by falling gain."""
    missing = [name for name in allowed if name not in groups_of(base)]
    found = [shared_effects(base.cells, base.fit, name) for name in missing]
    effects = [x for x in found if x is not None]
    if not effects:
        return []
    other = nuisance(base)
    residual = other.without(
        base.white(np.nan_to_num(base.cells.values - base.fit.prediction, copy=False))
    )
    scores = []
    for x in effects:
        left = other.without(base.white(x.columns * x.sd))
        flat = left.reshape(-1, left.shape[-1])
        by_manoeuvre = per_group(
            (np.swapaxes(left, 1, 2) @ residual[..., None])[..., 0], base.cells.manoeuvre
        )
        scores.append(Scores(by_manoeuvre, flat.T @ flat))
    _, p = flip_test(scores, base.cells.manoeuvres)
    losses = held_out_losses_with(
        base.cells, base.white, base.plain, base.fit, [[x.columns] for x in effects]
    )
    assessed = []
    for x, own, (held_white, _) in zip(effects, p, losses, strict=True):
        gain, error = gain_and_error(base.held_white, held_white)
        assessed.append(AssessedNuisance(x, float(own), gain, error))
    return sorted(assessed, key=lambda a: -a.gain)


@dataclass(frozen=True)
class RefittedNuisance:
    """A base with one nuisance more, refitted: what of chi-square it removes, its amplitudes."""

    removed: float
    amplitudes: int
    base: Base


def rival_nuisances(
    base: Base, allowed: Iterable[str], least: float = 0.0
) -> tuple[RefittedNuisance, ...]:
    """The base with each of the nuisances that may earn a place beside it.

    Those that would remove less than the `least` share of the excess by a linear step are not
    fitted.
    """
    found = []
    alarming = [
        a
        for a in assess_nuisances(base, allowed)
        if a.alarms and (least <= 0.0 or _linear_share(base, a.effects) >= least)
    ]
    for a in alarming[:_MOST_REFITTED]:
        refitted = with_nuisance(base, a.effects)
        if isinstance(refitted, ModelError) or (a.group == "drift" and not _drifts(refitted)):
            continue
        removed = base.noise_chi2 - refitted.noise_chi2
        found.append(RefittedNuisance(removed, len(a.effects), refitted))
    return tuple(found)


def best_of(
    base: Base, rivals: Iterable[RefittedNuisance], least: float = NUISANCE_SHARE
) -> Base | None:
    """The base with the nuisance that removes most of chi-square, if one earns its place.

    It removes at `least` so much of what chi-square is above its degrees of freedom.

    A nuisance of fewer amplitudes that does as much comes first: the more there are, the more of
    anything they imitate. And one that leaves most of the excess imitates what it is not.
    """
    enough = least * (base.noise_chi2 - base.fit.freedom)
    tried = [rival for rival in rivals if rival.removed >= enough]
    if not tried:
        return None
    most = max(rival.removed for rival in tried)
    alike = [rival for rival in tried if rival.removed >= TWINS**2 * most]
    return min(alike, key=lambda rival: (rival.amplitudes, -rival.removed)).base


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
    enough = formed.excess < _FORM_LEAVES * without.excess
    return FORM in groups_of(formed) and (enough or quiet_waveforms(formed))


def with_form_errors(base: FittedChannel, formed: FittedChannel | None = None) -> Model:
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
    elif formed is None and isinstance(base, Base) and quiet_waveforms(base):
        found = refit(base, freed(model, [FORM]), several=True)
        formed = None if isinstance(found, ModelError) else found.settled
    if formed is None:
        return model
    errors = {}
    for name, se in zip(formed.fit.names, formed.fit.known.se.tolist(), strict=True):
        if (parameter := model.parameters.get(name)) is not None:
            moved = formed.model.values[name] - parameter.value
            errors[name] = replace(parameter, se_with_form=float(np.hypot(se, moved)))
    return model.with_parameters(errors)


def _with_best(base: Base, allowed: Sequence[str], least: float = 0.0) -> Base:
    """The base with the best of the allowed nuisances, one after the other, up to the form."""
    while base.cells.manoeuvres >= FEWEST_MANOEUVRES and not quiet_waveforms(base):
        more = best_nuisance(base, allowed, least)
        if more is None:
            break
        base = with_scatter_estimated(more)
        if groups_of(more)[-1] == FORM:
            break
    return base


def _linear_share(base: Base, effects: SharedEffects) -> float:
    """The share of chi-square's excess that a nuisance removes by one linear step."""
    noise = base.noise
    other = ProjectedOut.of(Offsets.of(base.cells, noise), noise(base.fit.moving))
    columns = other.without(noise(effects.columns * effects.sd)).reshape(-1, len(effects))
    residual = base.cells.values - base.fit.prediction - base.fit.beside
    left = other.without(noise(np.nan_to_num(residual))).ravel()
    excess = float(left @ left) - base.fit.freedom
    slopes = columns.T @ left
    step = np.linalg.solve(np.eye(len(effects)) + columns.T @ columns, slopes)
    removed = float((2.0 * slopes - columns.T @ (columns @ step)) @ step)
    return removed / excess if excess > 0.0 else 0.0


def _drifts(base: Base) -> bool:
    """Is the drift beside this base one?"""
    held = base.cells.shared
    if held is None:
        return False
    own = [i for i, group in enumerate(held.group) if group == "drift"]
    return is_drift(held.of_groups(["drift"]), base.fit.amplitudes[own])


def with_nuisance(base: Base, effects: SharedEffects) -> Base | ModelError:
    """The base with a nuisance beside its model, fitted again, or why that cannot be."""
    (name,) = effects.groups
    if frees(base.model, name):
        return refit(base, freed(base.model, [name]), several=name == FORM)
    held = [] if base.cells.shared is None else [base.cells.shared]
    return _beside(base, SharedEffects.joined([*held, effects]), base.model)


def with_nuisances(base: Base, groups: Sequence[str]) -> Base | ModelError:
    """The base with these nuisances and no other beside its model, fitted again, or why not."""
    return _beside(base, shared_by(base.cells, base.fit, groups), _free_of_law(base, groups))


def needed_nuisances(base: Base) -> tuple[str, ...]:
    """Those of the base's nuisances that are always on, or without which it would be worse."""
    groups = list(groups_of(base))
    always = [n.name for n in base.model.nuisances if n.use == "on"]
    for group in [g for g in groups if g not in always]:
        kept = [g for g in groups if g != group]
        shared = base.cells.shared.of_groups(kept) if base.cells.shared else None
        less = _beside(base, shared, _free_of_law(base, kept))
        if not isinstance(less, ModelError) and not _earns_it(less, base):
            base, groups = less, kept
    return tuple(groups)


def _earns_it(less: Base, more: Base) -> bool:
    """Does what `more` has beside the model, and `less` has not, earn its place there?

    By its size, as an effect does, or by its share of chi-square's excess, as it came in: if
    loads scatter, what a wheel does is sure, and small beside the floor.
    """
    gain, error = gain_and_error(less.held_white, more.held_white)
    removed = less.noise_chi2 - more.noise_chi2
    surely = gain > GAIN_SIGMAS * error
    return worth_it(less, more) or (
        surely and removed >= NUISANCE_SHARE * (less.noise_chi2 - less.fit.freedom) > 0.0
    )


def _free_of_law(base: Base, groups: Sequence[str]) -> Model:
    """The base's model with the parameters of these nuisances free, of the others as given."""
    model = base.model
    for name in groups_of(base):
        if frees(model, name) and name not in groups:
            model = bound(model, base.given or base.model, name)
    return freed(model, groups)


def _beside(base: Base, shared: SharedEffects | None, model: Model) -> Base | ModelError:
    raw = None if base.raw is None else replace(base.raw, shared=shared)
    return refit(replace(base, cells=replace(base.cells, shared=shared), raw=raw), model)


def with_nuisances_on(base: Base) -> Model:
    """The base's model, which asks for its nuisances from now on, as a file has it."""
    model = without_ratios(base.model)
    for group in groups_of(base):
        model = model.with_nuisance(group, "on")
    return model
