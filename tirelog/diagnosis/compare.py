"""`compare`: a fitted model against logs, error by error, and where and when it fails.

Stacks, Model -> `base.prepare` -> errors, tables, waveforms with the floor's band, residual maps
    -> Comparison
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import PurePath
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Stack
from tirelog.diagnosis.answer import excess_of, rounding_sentences
from tirelog.diagnosis.candidates.assessment import out_of_range
from tirelog.diagnosis.candidates.nuisances import (
    form_explains,
    groups_of,
    with_best_nuisances,
    with_form_errors,
)
from tirelog.diagnosis.residual_structure import half_angle
from tirelog.diagnosis.results import (
    ERRORS,
    Comparison,
    ErrorTables,
    Map,
    Rows,
    Waveforms,
    agreement_sentence,
    contributions,
)
from tirelog.errors import ModelError, UsageError, or_refusal
from tirelog.inference.base import (
    Base,
    FittedChannel,
    JointBase,
    bases_by_observable,
    bends,
    prepare,
    prepare_together,
)
from tirelog.inference.cells.cells import cells_of
from tirelog.inference.cells.joint import (
    JointPieces,
    JointStacks,
    model_of,
    predicted,
    without_ratios,
)
from tirelog.inference.cells.pieces import MOST_PIECES, Pieces, pieces_of_logs
from tirelog.inference.fit.cells import centred
from tirelog.inference.floor import UnweightedMetric, at_mean_speed
from tirelog.inference.measured import without_motion_parameters
from tirelog.inference.nuisances import shared_by
from tirelog.inference.scatter import scatter_columns
from tirelog.physics.model.file import unit_remarks
from tirelog.physics.model.model import Model
from tirelog.vocabulary.arrays import FloatArray, IntArray
from tirelog.vocabulary.conditions import SETUP_KEYS
from tirelog.vocabulary.observables import FLOORS, OBSERVABLES, STRAIN, together
from tirelog.vocabulary.quality import Quality, marked, quality_text

#: cells whose waveforms are shown, and rows of the residual's map, at most; only pictures and the
#: JSON depend on them
_SHOWN = 4
_MAP_ROWS = 24


#: what every question is asked of: the stacks of all logs, or their pieces if the revolutions
#: are too many to keep
Measured = Sequence[Stack] | Pieces | JointStacks | JointPieces


def measured_pieces(measured: Measured) -> Pieces | JointPieces:
    """The pieces of all logs.  UsageError: there is none."""
    if not len(measured):
        raise UsageError(
            "no stack to compare with", allowed="at least one log is needed", do="give one"
        )
    if isinstance(measured, JointStacks):
        room = MOST_PIECES // len(measured.parts)
        parts = [pieces_of_logs(part, room) for part in measured.parts]
        return JointPieces.of(parts, measured.places)
    return measured if isinstance(measured, Pieces | JointPieces) else pieces_of_logs(measured)


def single_revolutions(measured: Measured) -> Sequence[Stack] | JointStacks:
    """The stacks; none if only the pieces are left."""
    return () if isinstance(measured, Pieces | JointPieces) else measured


def start(measured: Measured, model: Model) -> Base:
    """The base of every question: cells of all logs, the model fitted.

    UsageError if model and logs do not fit together.
    """
    return start_from(measured_pieces(measured), model)


def start_from(pieces: Pieces | JointPieces, model: Model, *, several: bool = True) -> Base:
    """The base of every question about these pieces."""
    if observables_of(pieces) != model.observables:
        raise other_observable(pieces, model)
    model = without_motion_parameters(model)
    if isinstance(pieces, JointPieces):
        cells = [cells_of(part) for part in pieces.parts]
        if pieces.places:
            cells = [
                replace(own, member=name, place_rad=place)
                for own, name, place in zip(cells, pieces.members, pieces.places, strict=True)
            ]
        drive = [part.manoeuvre for part in pieces.parts]
        return prepare_together(cells, drive, model, several=several)
    return prepare(cells_of(pieces), model, several=several)


def observables_of(pieces: Pieces | JointPieces) -> tuple[str, ...]:
    """What was measured."""
    return pieces.observables if isinstance(pieces, JointPieces) else (pieces.observable,)


def other_observable(pieces: Pieces | JointPieces, model: Model) -> UsageError:
    """The error that says that a model and a log do not fit together."""
    given = together(observables_of(pieces))
    return UsageError(
        f"the model predicts {together(model.observables)}, the log gives {given}",
        allowed="both must be the same",
        do=f"take a model for {given} (model new) or another log",
        file=pieces.logs[0],
    )


def compare(measured: Measured, model: Model) -> Comparison:
    """The model's free parameters fitted to all logs, and the error on manoeuvres left out.

    Beside it the errors with the nuisances that earn a place, which `diagnose` lets in.
    """
    base = start(measured, model)
    result, beside = comparison_of(base, single_revolutions(measured)), with_best_nuisances(base)
    formed = beside if form_explains(beside, base) else None
    result = replace(result, parameters=parameters_of(with_form_errors(base, formed)))
    if beside is base:
        return result
    names = [name for name in groups_of(beside) if name not in groups_of(base)]
    errors = {name: getattr(comparison_of(beside), name) for name in ERRORS}
    return replace(result, with_nuisances={"nuisances": names, **errors})


def comparison_of(base: Base, stacks: Sequence[Stack] | JointStacks = ()) -> Comparison:
    """Everything to show of a fitted base.

    The table by revolution is empty without the `stacks` that the base was made of.
    """
    if isinstance(base, JointBase):
        return _comparison_of_several(base, stacks)
    assert not isinstance(stacks, JointStacks)
    return _comparison_of_one(base, stacks)


def _comparison_of_several(base: JointBase, stacks: Sequence[Stack] | JointStacks) -> Comparison:
    """The comparison of each observable, and in floors that of all."""
    of_parts = stacks.parts if isinstance(stacks, JointStacks) else [()] * len(base.channels)
    parts = tuple(
        _comparison_of_one(part, own)
        for part, own in zip(bases_by_observable(base, held_by_all=True), of_parts, strict=True)
    )
    known = contributions(base)
    units = {name: p.unit for name, p in base.model.parameters.items()}
    word = "grating" if all(part.member for part in parts) else "observable"
    said = agreement_sentence(known, units, word)
    cells = base.cells
    assert cells.together is not None
    first = _in_floors(parts[0], cells.together.scales[0])
    spread = base.plain.mean_square((base.plain(_about_level(base)) ** 2).sum()) + base.floor.within
    return replace(
        first,
        observable=cells.observable,
        unit=FLOORS,
        member="",
        model=without_ratios(base.model),
        **_errors(base, spread),
        revolutions=int(cells.revolutions.sum()),
        manoeuvres=cells.manoeuvres,
        parameters=parameters_of(base.model),
        tables=_tables_of_several(parts),
        remarks=tuple(remarks_of(base)),
        parts=parts,
        contributions=known,
        agreement=said,
    )


def _errors(base: Base, spread: float) -> dict[str, Any]:
    """The errors of a comparison; `spread` is the mean square of what was measured."""
    return {
        "rmse": float(np.sqrt(max(base.square_fit, 0.0))),
        "rmse_heldout": base.rmse_held,
        "noise_floor": float(np.sqrt(base.floor.square)),
        "noise_floor_within": float(np.sqrt(base.floor.within)),
        "noise_floor_between": float(np.sqrt(base.floor.between)),
        "reduced_chi2": base.reduced_chi2,
        "fit_percent": 100.0 * (1.0 - float(np.sqrt(max(base.square_held, 0.0) / spread)))
        if spread > 0
        else 0.0,
    }


def _in_floors(part: Comparison, floor: float) -> Comparison:
    """A comparison whose waveforms and maps are over its noise floor."""
    waves = part.waveforms
    return replace(
        part,
        waveforms=replace(
            waves,
            measured=waves.measured / floor,
            predicted=waves.predicted / floor,
            floor=waves.floor / floor,
        ),
        by_speed=replace(part.by_speed, residual=part.by_speed.residual / floor),
        by_time=replace(part.by_time, residual=part.by_time.residual / floor),
    )


def _about_level(base: JointBase) -> FloatArray:
    """The measured values about the mean of their observable, (C, m)."""
    values = base.cells.values - base.fit.beside
    mean = [float(np.nanmean(values[base.cells.part == i])) for i in range(len(base.channels))]
    about: FloatArray = np.nan_to_num(values - np.array(mean)[base.cells.part][:, None])
    return about


def _tables_of_several(parts: Sequence[Comparison]) -> ErrorTables:
    """The tables of each observable under each other, each row with its name and unit."""

    def named(part: Comparison, rows: Rows) -> Rows:
        whose = {"observable": part.observable} | ({"grating": part.member} if part.member else {})
        return [whose | {"unit": part.unit} | row for row in rows]

    def by_revolution() -> Iterator[Rows]:
        for part in parts:
            for rows in part.tables.parts("revolution"):
                yield named(part, rows)

    small = {
        name: [row for part in parts for row in named(part, part.tables[name])]
        for name in ("angle", "speed", "regime", "conditions")
    }
    return ErrorTables(small, {"revolution": by_revolution})


def _comparison_of_one(base: Base, stacks: Sequence[Stack]) -> Comparison:
    """The comparison of one observable."""
    measured = base.cells.values - base.fit.beside
    spread = (
        base.plain.mean_square((base.plain(measured - np.nanmean(measured)) ** 2).sum())
        + base.floor.within
    )
    waveform = OBSERVABLES[base.model.observable].waveform
    time_s, begins = _running_time(base)
    return Comparison(
        observable=base.model.observable,
        unit=OBSERVABLES[base.model.observable].unit,
        member=base.cells.member,
        model=without_ratios(base.model),
        **_errors(base, spread),
        revolutions=int(base.cells.revolutions.sum()),
        manoeuvres=base.cells.manoeuvres,
        parameters=parameters_of(base.model),
        tables=error_tables(base, stacks),
        waveforms=_waveforms(base),
        by_speed=_map(base, base.cells.conditions.speed_m_s, "speed_m_s"),
        by_time=replace(_map(base, time_s, "time_s"), begins=begins),
        half_angle_rad=half_angle(base) if waveform else 0.0,
        remarks=tuple(remarks_of(base)),
    )


def parameters_of(model: Model) -> dict[str, dict[str, Any]]:
    """Value, standard error, unit, free or fixed, of every parameter."""
    return {
        name: {k: getattr(p, k) for k in ("value", "se", "se_with_form", "unit", "free")}
        for name, p in model.parameters.items()
    }


def remarks_of(base: FittedChannel) -> list[str]:
    """What a person should know of the fit before believing it."""
    if isinstance(base, JointBase):
        each = [(part.cells.label, remarks_of(part)) for part in bases_by_observable(base)]
        counted = Counter(remark for _, remarks in each for remark in dict.fromkeys(remarks))
        return list(
            dict.fromkeys(
                remark if counted[remark] > 1 or remark in base.cells.notes else f"{name}: {remark}"
                for name, remarks in each
                for remark in remarks
            )
        )
    said = [*base.cells.notes, *unit_remarks(base.model), *of_rounding(base)]
    if base.cells.manoeuvres < 2:
        said.append(
            "one manoeuvre: none can be held out from the fit, so there is no held-out error; "
            "drive more of them"
        )
    measured = np.nanmean(base.cells.values, axis=0)
    expected = np.nanmean(base.fit.prediction, axis=0)
    good = np.isfinite(measured) & np.isfinite(expected)
    if good.sum() > 8 and base.cells.observable == STRAIN:
        skew = float(np.mean((measured[good] - measured[good].mean()) ** 3))
        wanted = "inner" if skew > 0 else "outer"
        if wanted != base.cells.surface:
            place, word = ("a maximum", "inner") if skew > 0 else ("a minimum", "outer")
            said.append(
                f"the strain has {place} in the patch, as on the {word} surface; the setup says "
                f"{base.cells.surface}; "
                f'write surface = "{word}" if that is where the grating is'
            )
    if not base.fit.settled:
        said.append("the fit did not settle; its parameters may be off; start from other values")
    for name in base.fit.names:
        p = base.model.parameters[name]
        if p.value in (p.min, p.max) and "." not in name:
            said.append(
                f"{name} stands at its bound {p.value:g} {p.unit}; give wider bounds or fix it"
            )
    return said + out_of_range(base)


def of_rounding(base: FittedChannel) -> list[str]:
    """What rounding to the source's steps makes of the errors, if it matters."""
    if isinstance(base, JointBase):
        return [
            f"{p.cells.label}: {said}" for p in bases_by_observable(base) for said in of_rounding(p)
        ]
    if isinstance(base, Base) and base.cells.manoeuvres > 1:
        held = base.square_held
    else:
        held = base.square_fit
    return rounding_sentences(base.model.observable, held, base.floor.square, base.square_rounding)


def _running_time(base: Base) -> tuple[FloatArray, tuple[float, ...]]:
    """Time over all logs, one after the other, (C,), and where each but the first begins."""
    c = base.cells
    ends = np.array(
        [c.conditions.time_s[c.log == log].max(initial=0.0) for log in range(int(c.log.max()) + 1)]
    )
    begins = np.concatenate([[0.0], np.cumsum(ends)])
    time_s: FloatArray = c.conditions.time_s + begins[c.log]
    return time_s, tuple(begins[1:-1].tolist())


def _residual(base: Base) -> tuple[FloatArray, FloatArray]:
    """Residual of the cells in the observable's unit, and in standard errors of noise and scatter.

    (C, m) each, with the shift removed; NaN if empty.
    """
    good = base.plain.weights > 0
    left = np.nan_to_num(base.cells.values - base.fit.prediction - base.fit.beside)
    residual = np.where(good, base.plain(left) / np.where(good, base.plain.weights, 1.0), np.nan)
    return residual, residual / np.where(good, np.sqrt(_floor_square(base)), 1.0)


def _floor_square(base: Base) -> FloatArray:
    """Variance of a cell by its noise and by the scatter between like cells, (C, m)."""
    between = base.floor.scatter.square(scatter_columns(base.cells, base.fit))
    both: FloatArray = base.cells.within + between
    return both


def _waveforms(base: Base) -> Waveforms:
    """Cells that span the speeds."""
    c = base.cells
    order = np.argsort(c.conditions.speed_m_s)
    chosen = np.unique(
        order[np.linspace(0, order.size - 1, min(_SHOWN, order.size)).round().astype(int)],
        return_index=False,
    )
    chosen = chosen[np.argsort(c.conditions.speed_m_s[chosen])]
    logs = tuple(PurePath(c.logs[c.log[i]]).name for i in chosen)
    labels = tuple(
        f"{c.conditions.speed_m_s[i]:.1f} m/s, {c.regime[i]}, {log}"
        for i, log in zip(chosen, logs, strict=True)
    )
    return Waveforms(
        c.phi[chosen],
        c.values[chosen],
        (base.fit.prediction + base.fit.beside)[chosen],
        np.sqrt(_floor_square(base))[chosen],
        labels,
        logs,
        c.conditions.take(chosen),
    )


def _map(base: Base, axis: FloatArray, name: str) -> Map:
    """Residual averaged over like cells, ascending along the axis."""
    residual, whitened = _residual(base)
    edges = np.linspace(axis.min(), axis.max() + 1e-9, min(_MAP_ROWS, axis.size) + 1)
    row = np.clip(np.searchsorted(edges, axis, side="right") - 1, 0, edges.size - 2)
    used = np.unique(row)
    phi = np.nanmean(base.cells.phi, axis=0)

    def mean(x: FloatArray, power: float) -> FloatArray:
        rows = [x[row == r] for r in used]
        count = [np.maximum(np.isfinite(part).sum(axis=0), 1) for part in rows]
        return np.stack(
            [np.nansum(part, axis=0) / n**power for part, n in zip(rows, count, strict=True)]
        )

    centre = np.array([axis[row == r].mean() for r in used])
    return Map(centre, name, phi, mean(residual, 1.0), mean(whitened, 0.5))


# ---- tables --------------------------------------------------------------------------------------


def error_tables(base: Base, stacks: Sequence[Stack]) -> ErrorTables:
    """Rows of rmse, noise_floor and excess by angle, speed, regime, conditions.

    By revolution there is one row each, made when it is asked for.
    """
    c = base.cells
    tables = {"angle": _by_angle(base)}
    band = np.floor(c.conditions.speed_m_s / 2.0) * 2.0 + 1.0
    groups: dict[str, tuple[list[str], Callable[[int], dict[str, Any]]]] = {
        "speed": ([f"{v:g}" for v in band], lambda i: {"speed_m_s": float(band[i])}),
        "regime": ([str(r) for r in c.regime], lambda i: {"regime": str(c.regime[i])}),
        "conditions": ([str(int(n)) for n in c.log], lambda i: _log_conditions(base, i)),
    }
    for name, (labels, describe) in groups.items():
        tables[name] = [
            _row(base, np.array(labels) == label, describe(labels.index(label)))
            for label in dict.fromkeys(labels)
        ]
    tables["speed"].sort(key=lambda row: row["speed_m_s"])
    return ErrorTables(tables, {"revolution": lambda: _by_revolution(base, stacks)})


def _log_conditions(base: Base, cell: int) -> dict[str, Any]:
    c = base.cells.conditions
    rows = base.cells.log == base.cells.log[cell]
    return {"log": base.cells.logs[base.cells.log[cell]]} | {
        name: float(np.mean(getattr(c, name)[rows])) for name in SETUP_KEYS
    }


def _row(base: Base, rows: FloatArray, description: dict[str, Any]) -> dict[str, Any]:
    """Errors over some cells."""
    index = np.flatnonzero(rows)
    plain = UnweightedMetric.of(_some(base, index))
    residual = np.nan_to_num(base.cells.values - base.fit.prediction - base.fit.beside)[index]
    share = plain.weights**2
    within = float(
        (share * np.where(share > 0, base.cells.within[index], 0.0)).sum() / plain.weight
    )
    left = plain.mean_square((plain(residual) ** 2).sum())
    return description | _sizes(left, within, base.floor.between, base.cells.revolutions[index])


def _sizes(left: float, within: float, between: float, revolutions: IntArray) -> dict[str, Any]:
    """The errors of a row of a table, of the mean squares that a model leaves above `within`."""
    rmse, floor = (float(np.sqrt(max(within + more, 0.0))) for more in (left, between))
    return {
        "rmse": rmse, "noise_floor": floor, "excess": excess_of(rmse, floor),
        "excess_within": float(np.sqrt(max(left, 0.0))), "revolutions": int(revolutions.sum()),
    }  # fmt: skip


def _some(base: Base, index: NDArray[np.int64]) -> Any:
    from tirelog.inference.fit.cells import take_cells

    return take_cells(base.cells, index)


def _by_angle(base: Base) -> list[dict[str, Any]]:
    """Errors by part of the turn: entry, patch, exit, away."""
    if base.cells.phi.shape[1] == 1:
        return [_row(base, np.ones(len(base.cells), bool), {"angle": "all"})]
    edge, phi = half_angle(base), np.nanmean(base.cells.phi, axis=0)
    zones = {
        "entry": (phi >= -1.5 * edge) & (phi < -0.5 * edge),
        "patch": np.abs(phi) <= 0.5 * edge,
        "exit": (phi > 0.5 * edge) & (phi <= 1.5 * edge),
        "away": np.abs(phi) > 1.5 * edge,
    }
    residual, _ = _residual(base)
    share = base.plain.weights**2
    bias = share * np.where(share > 0, base.cells.sd, 0.0) ** 2
    bias = bias + share * np.einsum(
        "cmi,cij,cmj->cm", base.cells.random, base.cells.random_cov, base.cells.random
    )
    rows = []
    for name, zone in zones.items():
        total = share[:, zone].sum()
        left = ((share * np.nan_to_num(residual) ** 2)[:, zone].sum() - bias[:, zone].sum()) / total
        within = (share * np.where(share > 0, base.cells.within, 0.0))[:, zone].sum() / total
        between = float(base.floor.between_by_angle[zone].mean())
        rows.append({"angle": name} | _sizes(left, within, between, base.cells.revolutions))
    return rows


def _by_revolution(base: Base, stacks: Sequence[Stack]) -> Iterator[list[dict[str, Any]]]:
    """One row per revolution, stack by stack.

    The rms of measured less predicted, the offset of its log and its own shift taken out.
    """
    first = 0
    for stack in stacks:
        yield _revolutions(base, stack, base.cells.cell[first : first + len(stack)])
        first += len(stack)


def _revolutions(base: Base, stack: Stack, cell: NDArray[np.int64]) -> list[dict[str, Any]]:
    """The rows of the revolutions of one stack, which are in these cells, (n,)."""
    waves = stack.phi_rad.size > 1
    angles: dict[str, Any] = (
        {
            "phi_rad": stack.phi_mean - base.cells.moved[cell][:, None],
            "phi_variance": stack.phi_variance,
        }
        if waves
        else {"phi_rad": None}
    )
    left_out = cell < 0  # of a log that many others left no room
    cell = np.maximum(cell, 0)
    model = base.model
    if model.beside:
        model = model_of(model, stack.observable, base.cells.member)
    predicted = _of_each(model, stack, angles) + base.fit.beside[cell]
    left = np.where(
        np.isfinite(stack.values) & np.isfinite(predicted), stack.values - predicted, np.nan
    )
    direction = base.plain.direction[cell]
    size = np.nansum(left[..., None] * direction, axis=1, keepdims=True)
    left = left - (direction * size).sum(axis=-1)
    beyond = np.isnan(left).all(axis=1)
    rmse = np.full(len(stack), np.nan)
    known = ~(left_out | beyond)
    rmse[known] = np.sqrt(np.nanmean(left[known] ** 2, axis=1))
    words = marked(left_out, Quality.LEFT_OUT) | marked(beyond, Quality.BEYOND_MODEL)
    floor = np.where(
        left_out, np.nan, np.sqrt(np.nanmean(base.cells.within, axis=1) + base.floor.between)[cell]
    )
    c = stack.conditions
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


def _of_each(model: Model, stack: Stack, angles: Mapping[str, Any]) -> FloatArray:
    """The prediction of each revolution, (n, m); NaN of those that the model cannot compute."""
    computed = or_refusal(partial(model.predict, surface=stack.surface, each=True))
    found = computed(stack.conditions, **angles)
    if not isinstance(found, ModelError):
        return found
    result = np.full(stack.values.shape, np.nan)
    for i in range(len(stack)):
        own = {name: None if all_ is None else all_[i : i + 1] for name, all_ in angles.items()}
        one = computed(stack.conditions.take(np.array([i])), **own)
        if not isinstance(one, ModelError):
            result[i] = one[0]
    return result


# ---- A fitted model against manoeuvres that nothing had touched: the one number to believe.


Measurement = TypeVar("Measurement", Pieces, JointPieces, Pieces | JointPieces)


def locked_away(
    pieces: Measurement, first: int, every: int, least: int
) -> tuple[Measurement, Measurement | None]:
    """(what a search may see, what nothing touches): each so many-th manoeuvre from the `first`.

    Nothing is locked away if fewer than `least` would be left.
    """
    numbers = np.unique(pieces.manoeuvre)
    chosen = numbers[first::every]
    if numbers.size - chosen.size < least:
        return pieces, None
    mask = np.isin(pieces.manoeuvre, chosen)
    return pieces.take(~mask), pieces.take(mask)


@or_refusal
def untouched(after: Base, locked: Pieces | JointPieces) -> tuple[float, float] | ModelError:
    """(rmse of the model on the locked manoeuvres, the floor there), or why it has none there.

    The offsets are as fitted on the others. Of several observables both are in floors.
    """
    if isinstance(locked, JointPieces):
        return _untouched_several(after, locked)
    cells = cells_of(locked)
    for _ in range(3):
        cells, _farthest = centred(cells, _fit_on(after, cells).prediction)
    cells = at_mean_speed(cells, _fit_on(after, cells))
    fit = _fit_on(after, cells)
    plain = UnweightedMetric.of(cells)
    offsets = np.zeros(len(cells))
    if after.fit.offsets.size:
        seen = np.unique(after.cells.log)
        offsets = np.array(
            [
                after.fit.offsets[np.searchsorted(seen, log)] if log in seen else 0.0
                for log in cells.log
            ]
        )
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


def _untouched_several(after: Base, locked: JointPieces) -> tuple[float, float]:
    """The root mean square over the observables, weighted by their revolutions."""
    layout = after.cells.together
    assert layout is not None
    squares, weights = [], []
    for part, own, scale in zip(
        bases_by_observable(after), locked.parts, layout.scales, strict=True
    ):
        if len(own):
            there = untouched(part, own)
            if isinstance(there, ModelError):
                raise there
            squares.append(np.square(there) / scale**2)
            weights.append(float(own.number.sum()))
    rmse, floor = np.sqrt(np.average(squares, axis=0, weights=weights)).tolist()
    return rmse, floor


def _fit_on(after: Base, cells: Any) -> Any:
    """The fitted model's prediction on other cells."""
    return replace(
        after.fit,
        prediction=predicted(after.model, cells),
    )
