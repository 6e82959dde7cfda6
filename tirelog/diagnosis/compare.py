"""`compare`: a fitted model against logs, error by error, and where and when it fails.

Stacks, Model -> `base.prepare` -> errors, tables, waveforms with the floor's band, residual maps
    -> Comparison
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import PurePath
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Stack
from tirelog.diagnosis.answer import excess_of, rounding_sentences
from tirelog.diagnosis.candidates.assessment import gain_sigmas, out_of_range
from tirelog.diagnosis.candidates.nuisances import (
    form_explains,
    groups_of,
    with_best_nuisances,
    with_form_errors,
)
from tirelog.diagnosis.residual_structure import (
    extra_errors,
    half_angle,
    learnt_residual,
    of_each,
    posterior_checks,
    zones,
)
from tirelog.diagnosis.results import (
    ERRORS,
    Comparison,
    Map,
    Waveforms,
    agreement_sentence,
    contributions,
)
from tirelog.errors import ModelError, UsageError, or_refusal
from tirelog.inference.base import (
    Base,
    bases_by_observable,
    bends,
    joined_like,
    prepare,
    prepare_together,
)
from tirelog.inference.cells.cells import (
    cells_of,
    model_of,
    one_drive,
    predicted,
    without_ratios,
)
from tirelog.inference.cells.pieces import MOST_PIECES, Pieces, pieces_of_logs
from tirelog.inference.fit.cells import centred
from tirelog.inference.floor import UnweightedMetric, at_mean_speed, scatter_columns
from tirelog.inference.measured import without_motion_parameters
from tirelog.inference.metric import per_group
from tirelog.inference.nuisances import shared_by
from tirelog.inference.stacks.cut import Stacks
from tirelog.physics.model.model import Model
from tirelog.physics.spectral import Angles
from tirelog.vocabulary.arrays import FloatArray, IntArray
from tirelog.vocabulary.conditions import SETUP_KEYS
from tirelog.vocabulary.observables import FLOORS, OBSERVABLES, together
from tirelog.vocabulary.quality import Quality, marked, quality_text

#: the stacks of each observable or grating, none if only the pieces are left
Revolutions = Sequence[Sequence[Stack]]
#: what every question is asked of: the stacks of all logs, of several observables or gratings those
#: of each, or their pieces if the revolutions are too many to keep
Measured = Sequence[Stack] | Revolutions | Pieces | Sequence[Pieces]


def measured_pieces(measured: Measured) -> list[Pieces]:
    """The pieces of each observable or grating.  UsageError: there is none."""
    stacks = single_revolutions(measured)
    if not len(measured) or not all(map(len, stacks)):
        raise UsageError(
            "no stack to compare with", allowed="at least one log is needed", do="give one"
        )
    if not stacks:
        return [measured] if isinstance(measured, Pieces) else list(cast(list[Pieces], measured))
    return one_drive([pieces_of_logs(own, MOST_PIECES // len(stacks)) for own in stacks])


def single_revolutions(measured: Measured) -> Revolutions:
    """The stacks of each observable or grating; none if only the pieces are left."""
    if isinstance(measured, Stacks):
        return [measured]
    if isinstance(measured, Pieces) or not measured or isinstance(measured[0], Pieces):
        return []
    return cast(Revolutions, [measured] if isinstance(measured[0], Stack) else measured)


def start(measured: Measured, model: Model) -> Base:
    """The base of every question: cells of all logs, the model fitted.

    UsageError if model and logs do not fit together.
    """
    return start_from(measured_pieces(measured), model)


def start_from(pieces: Sequence[Pieces], model: Model, *, several: bool = True) -> Base:
    """The base of every question about these pieces."""
    if observables_of(pieces) != model.observables:
        raise other_observable(pieces, model)
    model = without_motion_parameters(model)
    cells = [cells_of(part) for part in pieces]
    if len(cells) == 1:
        return prepare(cells[0], model, several=several)
    return prepare_together(cells, [part.manoeuvre for part in pieces], model, several=several)


def observables_of(pieces: Sequence[Pieces]) -> tuple[str, ...]:
    """What was measured, each once."""
    return tuple(dict.fromkeys(part.observable for part in pieces))


def other_observable(pieces: Sequence[Pieces], model: Model) -> UsageError:
    """The error that says that a model and a log do not fit together."""
    given = together(observables_of(pieces))
    return UsageError(
        f"the model predicts {together(model.observables)}, the log gives {given}",
        allowed="both must be the same",
        do=f"take a model for {given} (model new) or another log",
        file=pieces[0].logs[0],
    )


def compare(
    measured: Measured, model: Model, others: Sequence[Model] = (), *, learn: bool = False
) -> Comparison:
    """The model's free parameters fitted to all logs, and the error on manoeuvres left out.

    Beside it the errors with the nuisances that earn a place, which `diagnose` lets in; and the
    rank of the model among the `others`, which are fitted to the same logs. `learn`: also what a
    residual that is learnt would gain.
    """
    pieces = measured_pieces(measured)
    base = start_from(pieces, model)
    beside, with_nuisances = with_best_nuisances(base), None
    if beside is not base:
        came_in = [name for name in groups_of(beside) if name not in groups_of(base)]
        errors = _errors(beside)
        with_nuisances = {"nuisances": came_in} | {name: errors[name] for name in ERRORS}
    with_form = with_form_errors(base, beside if form_explains(beside, base) else None)
    return replace(
        comparison_of(base, single_revolutions(measured)),
        parameters=parameters_of(with_form),
        with_nuisances=with_nuisances,
        extra_errors=of_each(extra_errors, base, "name"),
        checks=of_each(posterior_checks, base, "name"),
        ranking=_ranking([base, *(start_from(pieces, other) for other in others)]),
        learnt=of_each(learnt_residual, base, "learns") if learn else (),
    )


def _ranking(bases: Sequence[Base]) -> tuple[Mapping[str, Any], ...]:
    """The models of several bases of the same logs, best first; none of one alone.

    Rows: `model` (its file or carcass), `rmse_heldout`, `above_scatter`, `reduced_chi2`, the number
    of `free` parameters, `sigmas`. `above_scatter` is the held-out error above the scatter within
    manoeuvres, which depends on the data alone. `sigmas` are the standard errors of the manoeuvres
    by which the model is worse than the best.
    """
    if len(bases) < 2:
        return ()
    # several observables in the floors of the first model: a worse one has larger floors
    bases = [joined_like(base.blocks, bases[0].cells) for base in bases]
    within = min(base.floor.within for base in bases)
    best, *_ = order = sorted(bases, key=lambda base: base.square_held)
    return tuple(
        {
            "model": str(base.given.path or base.model.carcass),
            "rmse_heldout": base.rmse_held,
            "above_scatter": float(np.sqrt(max(base.square_held - within, 0.0))),
            "reduced_chi2": base.reduced_chi2,
            "free": len(base.fit.names),
            "sigmas": gain_sigmas(base.held_plain, best.held_plain),
        }
        for base in order
    )


def comparison_of(base: Base, stacks: Revolutions = ()) -> Comparison:
    """Everything to show of a fitted base; of several observables of each, and in floors of all.

    The table by revolution is empty without the `stacks` that the base was made of.
    """
    bases = bases_by_observable(base, held_by_all=True)
    parts = tuple(map(_comparison_of_one, bases, stacks or [()] * len(bases)))
    if not base.channels:
        return parts[0]
    known, first = contributions(base), parts[0]
    units = {name: p.unit for name, p in base.model.parameters.items()}
    word = "grating" if all(part.member for part in parts) else "observable"
    waves, floor = first.waveforms, base.cells.scales[0]
    shown = {name: getattr(waves, name) / floor for name in ("measured", "predicted", "floor")}
    return replace(
        first,
        waveforms=replace(waves, **shown),
        by_speed=replace(first.by_speed, residual=first.by_speed.residual / floor),
        by_time=replace(first.by_time, residual=first.by_time.residual / floor),
        observable=base.cells.observable,
        unit=FLOORS,
        member="",
        model=without_ratios(base.model),
        **_errors(base),
        tables={},
        remarks=tuple(remarks_of(base)),
        parts=parts,
        contributions=known,
        agreement=agreement_sentence(known, units, word),
    )


def _errors(base: Base) -> dict[str, Any]:
    """The errors of a comparison by the names of its fields."""
    measured, part = base.cells.values - base.fit.beside, base.cells.part
    level = np.array([np.nanmean(measured[part == i]) for i in range(len(base.blocks))])
    about = np.nan_to_num(measured - level[part][:, None])
    spread = base.plain.mean_square((base.plain(about) ** 2).sum())
    spread += base.floor.within
    left = float(np.sqrt(max(base.square_held, 0.0) / spread)) if spread > 0.0 else 1.0
    fitted, held = float(np.sqrt(max(base.square_fit, 0.0))), base.rmse_held
    floor, within = (float(np.sqrt(square)) for square in (base.floor.square, base.floor.within))
    return {
        "rmse": fitted,
        "rmse_heldout": held,
        "noise_floor": floor,
        "noise_floor_within": within,
        "noise_floor_between": float(np.sqrt(base.floor.between)),
        "excess": excess_of(fitted, floor),
        "excess_heldout": None if held is None else excess_of(held, floor),
        "excess_within": excess_of(fitted, within),
        "excess_heldout_within": None if held is None else excess_of(held, within),
        "reduced_chi2": base.reduced_chi2,
        "fit_percent": 100.0 * (1.0 - left),
        "revolutions": int(base.cells.revolutions.sum()),
        "manoeuvres": base.cells.manoeuvres,
        "parameters": parameters_of(base.model),
    }


def _comparison_of_one(base: Base, stacks: Sequence[Stack]) -> Comparison:
    """The comparison of one observable."""
    cells, known = base.cells, OBSERVABLES[base.model.observable]
    # time over all logs, one after the other
    time_s, logs = cells.conditions.time_s, range(int(cells.log.max()) + 1)
    begins = np.cumsum([0.0, *(time_s[cells.log == log].max(initial=0.0) for log in logs)])
    by_time = _map(base, time_s + begins[cells.log], "time_s")
    return Comparison(
        observable=base.model.observable,
        unit=known.unit,
        member=cells.member,
        model=without_ratios(base.model),
        **_errors(base),
        tables=error_tables(base),
        by_revolution=partial(_by_revolution, base, stacks),
        waveforms=_waveforms(base),
        by_speed=_map(base, cells.conditions.speed_m_s, "speed_m_s"),
        by_time=replace(by_time, begins=tuple(begins[1:-1].tolist())),
        half_angle_rad=half_angle(base) if known.waveform else 0.0,
        remarks=tuple(remarks_of(base)),
    )


def parameters_of(model: Model) -> dict[str, dict[str, Any]]:
    """Value, standard error, unit, free or fixed, of every parameter."""
    return {
        name: {k: getattr(p, k) for k in ("value", "se", "se_with_form", "unit", "free")}
        for name, p in model.parameters.items()
    }


def remarks_of(base: Base) -> list[str]:
    """What a person should know of the fit before believing it."""
    if base.channels:
        each = [(part.cells.label, remarks_of(part)) for part in bases_by_observable(base)]
        counted = Counter(remark for _, remarks in each for remark in dict.fromkeys(remarks))
        of_all = {*base.cells.notes, *(remark for remark, n in counted.items() if n > 1)}
        said = [r if r in of_all else f"{name}: {r}" for name, remarks in each for r in remarks]
        return list(dict.fromkeys(said))
    said = [*base.cells.notes, *of_rounding(base)]
    if base.cells.manoeuvres < 2:
        said.append(
            "one manoeuvre: none can be held out from the fit, so there is no held-out error; "
            "drive more of them"
        )
    if not base.fit.settled:
        said.append("the fit did not settle; its parameters may be off; start from other values")
    own = {name: base.model.parameters[name] for name in base.fit.names if "." not in name}
    said += [
        f"{name} is at its bound {p.value:g} {p.unit}; give wider bounds or fix it"
        for name, p in own.items()
        if p.value in (p.min, p.max)
    ]
    return said + out_of_range(base)


def of_rounding(base: Base) -> list[str]:
    """What rounding to the source's steps makes of the errors, if it matters."""
    if base.channels:
        return [
            f"{p.cells.label}: {said}" for p in bases_by_observable(base) for said in of_rounding(p)
        ]
    held = base.square_fit if base.rmse_held is None else base.square_held
    return rounding_sentences(base.model.observable, held, base.floor.square, base.square_rounding)


def _residual(base: Base) -> tuple[FloatArray, FloatArray]:
    """Residual of the cells in the observable's unit, and in standard errors of noise and scatter.

    (C, m) each, with the shift removed; NaN if empty.
    """
    good = base.plain.weights > 0
    left = np.nan_to_num(base.cells.values - base.fit.prediction - base.fit.beside)
    residual = np.where(good, base.plain(left) / np.where(good, base.plain.weights, 1.0), np.nan)
    return residual, residual / np.where(good, _floor(base), 1.0)


def _floor(base: Base) -> FloatArray:
    """Standard deviation of a cell by its noise and the scatter between like cells, (C, m)."""
    between = base.floor.scatter.square(scatter_columns(base.cells, base.fit))
    return np.asarray(np.sqrt(base.cells.within + between))


def _waveforms(base: Base) -> Waveforms:
    """Four cells, at most, that span the speeds."""
    c, speed = base.cells, base.cells.conditions.speed_m_s
    places = np.linspace(0, speed.size - 1, min(4, speed.size)).round().astype(int)
    chosen = np.unique(np.argsort(speed)[places])
    chosen = chosen[np.argsort(speed[chosen])]
    logs = tuple(PurePath(c.logs[c.log[i]]).name for i in chosen)
    return Waveforms(
        phi_rad=c.phi[chosen],
        measured=c.values[chosen],
        predicted=(base.fit.prediction + base.fit.beside)[chosen],
        floor=_floor(base)[chosen],
        labels=tuple(
            f"{speed[i]:.1f} m/s, {c.regime[i]}, {log}" for i, log in zip(chosen, logs, strict=True)
        ),
        logs=logs,
        conditions=c.conditions.take(chosen),
    )


def _map(base: Base, axis: FloatArray, name: str) -> Map:
    """Residual averaged over like cells, ascending along the axis, in 24 rows at most."""
    residual, whitened = _residual(base)
    edges = np.linspace(axis.min(), axis.max() + 1e-9, min(24, axis.size) + 1)
    row = np.clip(np.searchsorted(edges, axis, side="right") - 1, 0, edges.size - 2)
    row = np.unique(row, return_inverse=True)[1]
    number = np.maximum(per_group(np.isfinite(residual).astype(float), row), 1.0)
    means = per_group(np.nan_to_num(residual), row) / number
    errors = per_group(np.nan_to_num(whitened), row) / np.sqrt(number)
    centres = np.bincount(row, axis) / np.bincount(row)
    return Map(centres, name, np.nanmean(base.cells.phi, axis=0), means, errors)


# ---- tables --------------------------------------------------------------------------------------


def error_tables(base: Base) -> dict[str, list[dict[str, Any]]]:
    """Rows of rmse, noise_floor and excess by angle, speed, regime, conditions."""
    c, conditions, plain = base.cells, base.cells.conditions, base.plain
    share = plain.weights**2
    # what the model leaves of each value above `within`, without what noise does
    left = plain(np.nan_to_num(c.values - base.fit.prediction - base.fit.beside)) ** 2 - plain.noise
    within = share * np.where(share > 0, c.within, 0.0)

    def row(
        where: NDArray[np.bool_], about: dict[str, Any], between: float = base.floor.between
    ) -> dict[str, Any]:
        """Errors of some values, those of a mask (C, 1) or (1, m)."""
        chosen, weight = np.broadcast_to(where, share.shape), (share * where).sum()
        repeats, above = ((x * where).sum() / weight for x in (within, left))
        rmse, floor = (float(np.sqrt(max(repeats + x, 0.0))) for x in (above, between))
        return about | {
            "rmse": rmse,
            "noise_floor": floor,
            "excess": excess_of(rmse, floor),
            "excess_within": float(np.sqrt(max(above, 0.0))),
            "revolutions": int(c.revolutions[chosen.any(axis=1)].sum()),
        }

    band = np.floor(conditions.speed_m_s / 2.0) * 2.0 + 1.0
    by_angle = base.floor.between_by_angle if c.phi.shape[1] > 1 else np.array([base.floor.between])
    of_logs = {
        log: {name: float(np.mean(getattr(conditions, name)[c.log == log])) for name in SETUP_KEYS}
        for log in dict.fromkeys(c.log.tolist())
    }
    return {
        "angle": [
            row(zone[None], {"angle": name}, float(by_angle[zone].mean()))
            for name, zone in zones(base)
        ],
        "speed": [
            row((band == speed)[:, None], {"speed_m_s": speed})
            for speed in np.unique(band).tolist()
        ],
        "regime": [
            row((c.regime == regime)[:, None], {"regime": str(regime)})
            for regime in dict.fromkeys(c.regime.tolist())
        ],
        "conditions": [
            row((c.log == log)[:, None], {"log": c.logs[log], **means})
            for log, means in of_logs.items()
        ],
    }


def _by_revolution(base: Base, stacks: Sequence[Stack]) -> Iterator[list[dict[str, Any]]]:
    """One row per revolution, stack by stack.

    The rms of measured less predicted, the offset of its log and its own shift taken out.
    """
    ends = np.cumsum([len(stack) for stack in stacks])
    for stack, end in zip(stacks, ends.tolist(), strict=True):
        yield _revolutions(base, stack, base.cells.cell[end - len(stack) : end])


def _revolutions(base: Base, stack: Stack, cell: NDArray[np.int64]) -> list[dict[str, Any]]:
    """The rows of the revolutions of one stack, which are in these cells, (n,)."""
    angles = None
    if stack.phi_rad.size > 1:
        turned = stack.phi_mean - base.cells.moved[cell][:, None]
        angles = Angles(turned, stack.phi_variance)
    left_out, cell = cell < 0, np.maximum(cell, 0)  # of a log that many others left no room
    model = base.model
    if model.beside:
        model = model_of(model, stack.observable, base.cells.member)
    predicted = _of_each(model, stack, angles) + base.fit.beside[cell]
    left, direction = stack.values - predicted, base.plain.basis[cell]
    left[~np.isfinite(left)] = np.nan
    size = np.nansum(left[..., None] * direction, axis=1, keepdims=True)
    left = left - (direction * size).sum(axis=-1)
    beyond, c = np.isnan(left).all(axis=1), stack.conditions
    rmse, known = np.full(len(stack), np.nan), ~(left_out | beyond)
    rmse[known] = np.sqrt(np.nanmean(left[known] ** 2, axis=1))
    words = marked(left_out, Quality.LEFT_OUT) | marked(beyond, Quality.BEYOND_MODEL)
    floor = np.sqrt(np.nanmean(base.cells.within, axis=1) + base.floor.between)[cell]
    floor[left_out] = np.nan
    return [
        {
            "log": stack.logs[stack.log[i]], "channel": stack.channel,
            "revolution": int(stack.revolution[i]), "time_s": float(c.time_s[i]),
            "speed_m_s": float(c.speed_m_s[i]), "regime": str(stack.regime[i]),
            "manoeuvre": int(stack.manoeuvre[i]), "rmse": float(rmse[i]),
            "noise_floor": float(floor[i]),
            "quality": quality_text(int(words[i])),
        }
        for i in range(len(stack))
    ]  # fmt: skip


def _of_each(model: Model, stack: Stack, angles: Angles | None) -> FloatArray:
    """The prediction of each revolution, (n, m); NaN of those that the model cannot compute."""
    computed = or_refusal(partial(model.predict, surface=stack.surface, each=True))
    found = computed(stack.conditions, angles)
    if not isinstance(found, ModelError):
        return found
    result = np.full(stack.values.shape, np.nan)
    for i in range(len(stack)):
        own = None if angles is None else angles.take(slice(i, i + 1))
        one = computed(stack.conditions.take(np.array([i])), own)
        result[i] = np.nan if isinstance(one, ModelError) else one[0]
    return result


# ---- A fitted model against manoeuvres reserved for the end: the one number to believe.


def locked_away(
    pieces: list[Pieces], first: int, every: int, least: float
) -> tuple[list[Pieces], list[Pieces]]:
    """(what a search may see, what nothing touches): each so many-th manoeuvre from the `first`.

    Nothing is locked away if fewer than `least` would be left.
    """
    numbers = manoeuvres_of(pieces)
    chosen = numbers[first::every]
    if numbers.size - chosen.size < least:
        return pieces, []
    masks = [np.isin(part.manoeuvre, chosen) for part in pieces]
    seen = [part.take(~mask) for part, mask in zip(pieces, masks, strict=True)]
    return seen, [part.take(mask) for part, mask in zip(pieces, masks, strict=True)]


def manoeuvres_of(pieces: Sequence[Pieces]) -> IntArray:
    """The numbers of all manoeuvres, each once, ascending."""
    return np.unique(np.concatenate([part.manoeuvre for part in pieces]))


@or_refusal
def untouched(after: Base, locked: Sequence[Pieces]) -> tuple[float, float]:
    """(rmse of the model on the locked manoeuvres, the floor there), or why it has no error there.

    Of several observables both are in floors: the root mean square over the observables, weighted
    by their revolutions.
    """
    parts, scales = bases_by_observable(after), after.cells.scales
    known = [
        (_on_locked_of_one(part, own), scale, own.number.sum())
        for part, own, scale in zip(parts, locked, scales, strict=True)
        if len(own)
    ]
    squares = [np.square(errors) / scale**2 for errors, scale, _ in known]
    weights = [float(number) for _, _, number in known]
    rmse, floor = np.sqrt(np.average(squares, axis=0, weights=weights)).tolist()
    return rmse, floor


def _on_locked_of_one(after: Base, locked: Pieces) -> tuple[float, float]:
    """The same of one observable in its unit; its offsets are as fitted on the others."""
    cells = cells_of(locked)
    for _ in range(3):
        cells, _farthest = centred(cells, predicted(after.model, cells))
    cells = at_mean_speed(cells, replace(after.fit, prediction=predicted(after.model, cells)))
    fit = replace(after.fit, prediction=predicted(after.model, cells))
    plain = UnweightedMetric.of(cells)
    known = dict(zip(np.unique(after.cells.log).tolist(), after.fit.offsets, strict=False))
    offsets = np.array([known.get(log, 0.0) for log in cells.log.tolist()])
    beside = shared_by(cells, fit, groups_of(after), after.cells)
    nuisances = np.zeros(cells.values.shape)
    if beside is not None:
        cells = replace(cells, shared=beside)
        nuisances = beside.columns @ after.fit.amplitudes + bends(cells, fit, after.cells)
    left = plain(np.nan_to_num(cells.values - fit.prediction - offsets[:, None] - nuisances))
    share = plain.weights**2
    within = float((share * np.where(share > 0, cells.within, 0.0)).sum() / plain.weight)
    rmse = float(np.sqrt(max(within + plain.mean_square((left**2).sum()), 0.0)))
    return rmse, float(np.sqrt(within + after.floor.between))
