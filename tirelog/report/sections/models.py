"""Sections made of model results: the model against the measurement, the diagnosis, the ladder.

    Comparison, Diagnosis (of `discrepancy`), a ladder as its command keeps it (JSON) --> Section

They carry everything that is shown; this file draws and words it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.diagnosis.answer import AnswerTable, in_unit
from tirelog.diagnosis.candidates.search import removed_errors
from tirelog.diagnosis.results import steps_table
from tirelog.plots.answers import climbed_panel, ranked_panel, wave_marks
from tirelog.plots.answers import edges as edge_lines
from tirelog.plots.record import Panel
from tirelog.report.figures import (
    DASHES,
    GREY,
    INK,
    PALE,
    SYMBOLS,
    Figure,
    LogColours,
    band,
    dots,
    figure,
    heat,
    layout,
    line,
)
from tirelog.report.page import PageTable, Section
from tirelog.vocabulary.observables import shown

if TYPE_CHECKING:
    from tirelog.diagnosis.diagnose import Diagnosis
    from tirelog.diagnosis.results import Comparison, Map

#: units that the page writes otherwise than the tables
_WRITTEN = {"m/s^2": "m/s²"}
#: half lengths of the patch that a waveform or map shows at first
_REACH = 6.0
_ZONES = {
    "entry": "around the entry edge",
    "patch": "inside the patch",
    "exit": "around the exit edge",
    "away": "away from the patch",
}
ANGLE = "angle from the patch centre [deg], entry to exit"


def shown_value(observable: str, unit: str) -> tuple[float, str]:
    """Factor and unit in which the page shows the observable."""
    factor, unit = shown(observable, unit)
    return factor, _WRITTEN.get(unit, unit)


def shown_number(value: Any) -> str:
    """A number as a table cell; nothing if there is none."""
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def page_table(table: AnswerTable) -> PageTable:
    """A table of an answer as the page shows it."""
    header = [word.replace("m/s^2", "m/s²") for word in table.names]
    rows = [[shown_number(cell) for cell in row] for row in table.rows]
    return PageTable(table.caption.replace("m/s^2", "m/s²"), header, rows)


def logs_of(result: Comparison) -> list[str]:
    """The logs that a comparison is about."""
    rows = (row for part in result.parts or (result,) for row in part.tables["conditions"])
    return list(dict.fromkeys(str(row["log"]) for row in rows))


def comparisons(
    result: Comparison, command: str, colours: LogColours | None = None
) -> list[Section]:
    """The section of a comparison; of several observables one of all, and one of each."""
    colours = LogColours(logs_of(result)) if colours is None else colours
    if not result.parts:
        return [comparison(result, command, colours)]
    found = [_together(result, command)]
    for part in result.parts:
        own = comparison(part, command, colours)
        figures = [replace(f, id=f"{f.id}-{part.label}") for f in own.figures]
        named = f"{own.title}: {part.label if part.member else part.label.replace('_', ' ')}"
        found.append(replace(own, id=f"{own.id}-{part.label}", title=named, figures=figures))
    return found


def _together(result: Comparison, command: str) -> Section:
    """One fit of several observables: the error of each, what each knows, whether they agree."""
    return Section(
        "model",
        "Several observables in one fit",
        command,
        [
            f"{result.observable} of one wheel are fitted together, each by its own noise; "
            f"{result.revolutions} revolutions, {result.manoeuvres} manoeuvres.",
            result.agreement,
            *_with_nuisances(result),
            *(f"{remark}." for remark in result.remarks),
        ],
        (),
        [
            page_table(result.together_table()),
            page_table(result.parameters_table()),
        ],
    )


def comparison(result: Comparison, command: str, colours: LogColours) -> Section:
    """The section of a comparison of model and logs.

    Errors beside the floor, waveforms with the floor's band, residual over angle and speed, and
    angle and time.
    """
    factor, unit = shown_value(result.observable, result.unit)
    words = [
        "Error of one revolution's value at one angle, on manoeuvres held out from the fit: "
        f"{in_unit(result.rmse_heldout, factor)} "
        f"{unit}; noise floor {result.noise_floor * factor:.3g}, excess "
        f"{in_unit(result.excess_heldout, factor)}. On the data of the fit: "
        f"{result.rmse * factor:.3g}. Reduced chi-square {result.reduced_chi2:.3g}; "
        f"{result.revolutions} revolutions, {result.manoeuvres} manoeuvres.",
        *_with_nuisances(result),
        where(result),
        *result.floor_sentences(),
        *(f"{remark}." for remark in result.remarks),
    ]
    figures = [
        _waveforms(result, unit, colours),
        _differences(result, factor, unit, colours),
        residual_map("residual-speed", "Residual over angle and speed", result.by_speed, result),
        residual_map("residual-time", "Residual over angle and time", result.by_time, result),
    ]
    return Section(
        "model",
        "The model against the measurement",
        command,
        words,
        figures,
        [
            page_table(result.errors_table(lambda log: Path(log).name)),
            page_table(result.parameters_table(fixed=True)),
        ],
    )


def _with_nuisances(result: Comparison) -> list[str]:
    """What the errors are beside nuisances, if any earns a place."""
    said = result.nuisances_sentence()
    return [f"{said[:1].upper()}{said[1:]}."] if said else []


def where(result: Comparison) -> str:
    """Where the excess is largest, from the comparison's own tables."""
    factor, unit = shown_value(result.observable, result.unit)
    angle = max(result.tables["angle"], key=lambda row: row["excess"])
    speed = max(result.tables["speed"], key=lambda row: row["excess"])
    regime = max(result.tables["regime"], key=lambda row: row["excess"])
    if angle["excess"] == 0.0:
        return "The first model fails nowhere by more than the floor."
    there = _ZONES.get(angle["angle"])
    return (
        "The first model fails most "
        + (f"{there} (excess {angle['excess'] * factor:.3g} {unit}), " if there else "")
        + f"by speed near {speed['speed_m_s']:g} m/s ({speed['excess'] * factor:.3g}), by regime "
        f"in {regime['regime']} ({regime['excess'] * factor:.3g})."
    )


def window(half_angle_rad: float) -> list[float]:
    """The angles [deg] that a figure shows at first."""
    reach = min(np.rad2deg(_REACH * half_angle_rad), 180.0) if half_angle_rad > 0 else 180.0
    return [-reach, reach]


def edges(half_angle_rad: float) -> list[float]:
    """The patch's edges [deg]."""
    return [-np.rad2deg(half_angle_rad), np.rad2deg(half_angle_rad)] if half_angle_rad > 0 else []


def styles(logs: Sequence[str], colours: LogColours) -> list[tuple[int, str, str]]:
    """(number of the colour, dash, symbol) of each waveform, by the log that it is of.

    Of several logs the colour is the log's, and lines and symbols tell its waveforms apart.
    """
    if len(set(logs)) < 2:
        return [(i, DASHES[0], SYMBOLS[i % len(SYMBOLS)]) for i in range(len(logs))]
    own = [logs[:i].count(log) for i, log in enumerate(logs)]
    return [
        (colours(log), DASHES[k % len(DASHES)], SYMBOLS[k % len(SYMBOLS)])
        for log, k in zip(logs, own, strict=True)
    ]


def over_angle(result: Comparison, y: str, **more: Any) -> dict[str, Any]:
    """The layout of what stands over the angle, with the patch's edges."""
    half = result.half_angle_rad
    return layout(ANGLE, y, xrange=window(half), lines=edges(half), **more)


def _waveforms(result: Comparison, unit: str, colours: LogColours) -> Figure:
    """Measured and predicted waveforms, with two noise floors about the prediction."""
    alt = (
        "Measured means of like revolutions (points), the model (lines) and two noise floors "
        "about it (bands) at "
        f"{'; '.join(result.waveforms.labels)}; dashed lines: the "
        "patch's edges."
    )
    half, factor = result.half_angle_rad, shown_value(result.observable, result.unit)[0]
    marks = wave_marks(result, factor, styles(result.waveforms.logs, colours))
    panel = Panel(
        ANGLE,
        f"{result.observable} [{unit}]",
        [*marks, *edge_lines(half)],
        limits=(window(half), None),
    )
    return figure("waveforms", "Waveforms", alt, panel, height=520)


def _differences(result: Comparison, factor: float, unit: str, colours: LogColours) -> Figure:
    """The same waveforms, measured less predicted, so that the floor's band can be seen."""
    waves, lines = result.waveforms, []
    bands: list[dict[str, Any]] = []
    for i, (said, (colour, dash, _)) in enumerate(
        zip(waves.labels, styles(waves.logs, colours), strict=True)
    ):
        phi, floor = np.rad2deg(waves.phi_rad[i]), 2.0 * factor * waves.floor[i]
        bands = band(phi, -floor, floor, f"two floors, {said}", colour) + bands
        left = (waves.measured[i] - waves.predicted[i]) * factor
        lines.append(line(phi, left, said, colour, line={"dash": dash}))
    alt = (
        f"Measured less predicted {result.observable} of the same waveforms, {unit}, with two "
        "noise floors as bands about zero."
    )
    title, shape = (
        "What the model leaves of these waveforms",
        over_angle(result, f"residual [{unit}]", height=460),
    )
    return Figure("differences", title, alt, bands + lines, shape)


def residual_map(
    id: str, title: str, found: Map, result: Comparison, reach: float | None = None
) -> Figure:
    """The residual, measured less predicted, over an axis and the angle.

    Colours go to `reach` in the page's unit.
    """
    factor, unit = shown_value(result.observable, result.unit)
    name = {"speed_m_s": "speed [m/s]", "time_s": "time [s]"}[found.axis_name]
    phi = np.rad2deg(found.phi_rad)
    alt = (
        f"Measured less predicted {result.observable} in {unit} as colour, blue below and red "
        "above zero, over the wheel angle and "
        f"{name.split(' [')[0]} from {found.axis.min():.4g} to {found.axis.max():.4g}."
    )
    if phi.size < 2:
        traces = [dots(found.axis, found.residual[:, 0] * factor, "residual", INK)]
        ends = None if reach is None else (-1.1 * reach, 1.1 * reach)
        alt = f"Measured less predicted {result.observable} in {unit} against {name}."
        return Figure(id, title, alt, traces, layout(name, f"residual [{unit}]", yrange=ends))
    colours = heat(phi, found.axis, found.residual * factor, f"residual [{unit}]", reach)
    return Figure(id, title, alt, [colours], over_angle(result, name))


def diagnosis(result: Diagnosis, command: str) -> Section:
    """The section of a diagnosis.

    Verdict, ranking, sets that cannot be told apart, what is unexplained, the next manoeuvre and
    command.
    """
    errors = result.errors_sentence()
    words = [
        f"{result.verdict.replace('_', ' ').capitalize()}. {result.sentence}",
        result.certainty.sentence,
        f"{errors[:1].upper()}{errors[1:]}.",
        *(f"{said[:1].upper()}{said[1:]}" for said in result.further_sentences()),
    ]
    ranked = result.effects
    figures = [_ranking(ranked, removed_errors(result.found))] if ranked else []
    tables = [page_table(result.ranking_table())]
    return Section("diagnosis", "The diagnosis", command, words, figures, tables)


def _ranking(ranked: Sequence[Any], errors: Mapping[str, float]) -> Figure:
    """Shares of the excess as lying bars, the best on top; the selected in another colour."""
    best = ", ".join(f"{c.effect} {100 * c.excess_removed:.1f} %" for c in ranked[:5])
    alt = (
        f"Share of the excess that each effect removes alone: {best}. Error bars, one standard "
        "error, where the effect was refitted."
    )
    axis_title = "share of the excess removed alone [%]"
    panel = replace(ranked_panel(ranked, errors, (INK, PALE)), x=axis_title)
    height = 140 + 24 * len(ranked)
    return figure("ranking", "Which effect is missing", alt, panel, height=height)


def ladder_section(climbed: Mapping[str, Any], command: str) -> Section:
    """The error falling to the floor, from the last ladder that its command kept."""
    factor, unit = shown_value(climbed["observable"], climbed["unit"])
    steps = [step for step in climbed["steps"] if step["outcome"] != "not_added"]
    names = [step["effect"] for step in steps]
    held, floor = (
        [_times(step[name], factor) for step in steps] for name in ("rmse_heldout", "noise_floor")
    )
    words = [step["sentence"] for step in climbed["steps"]] + [
        f"{remark}." for remark in climbed.get("remarks", ())
    ]
    words.insert(0, _fallen(held, floor, unit, names))
    if climbed.get("rmse_untouched") is not None:
        words.append(
            f"On manoeuvres that nothing had touched: {climbed['rmse_untouched'] * factor:.3g} "
            f"{unit}, floor there {climbed['floor_untouched'] * factor:.3g}."
        )
    said = [
        f"{n} {h:.3g} {unit}" if h == h else f"{n} none" for n, h in zip(names, held, strict=True)
    ]
    alt = f"Held-out error falling to the floor: {', '.join(said)}"
    alt += f"; noise floor {floor[-1]:.3g} {unit}."
    panel = climbed_panel(climbed, (factor, unit), (PALE, INK, INK, GREY))
    figures = [figure("ladder-steps", "The error falling to the floor", alt, panel)]
    return Section(
        "ladder", "The ladder", command, words, figures, [page_table(steps_table(climbed))]
    )


def _fallen(held: Sequence[float], floor: Sequence[float], unit: str, names: Sequence[str]) -> str:
    """The ladder in a sentence."""
    ends = [f"{error:.3g}" if error == error else "none" for error in (held[0], held[-1])]
    if len(names) == 1:
        return f"No effect was added: held-out error {ends[0]} {unit}, noise floor {floor[0]:.3g}."
    return (
        f"Held-out error {ends[0]} → {ends[1]} {unit} by {', '.join(names[1:])}; noise floor of "
        f"the last model {floor[-1]:.3g}."
    )


def _times(error: float | None, factor: float) -> float:
    """An error in the page's unit; not a number if there is none."""
    return float("nan") if error is None else error * factor
