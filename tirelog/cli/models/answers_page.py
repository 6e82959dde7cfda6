"""The pages that `compare` and `diagnose` print, and the bars of `ladder`.

Numbers are in the observable's unit, strain in microstrain.
"""

from __future__ import annotations

import sys
from math import isfinite
from typing import TYPE_CHECKING, Any

from tirelog.cli.session import page
from tirelog.cli.text import console_table
from tirelog.errors import printable
from tirelog.vocabulary.observables import shown

if TYPE_CHECKING:
    from rich.console import Console

    from tirelog.api.results import (
        Candidate,
        Comparison,
        ComparisonOfLogs,
        DiagnosisOfLogs,
        GratingsFound,
        LadderOfLogs,
        TransientComparison,
    )

#: letters in the longest bar of a ladder
_BAR = 40
#: letters in a line of a page that no terminal shows
_WIDTH = 110


def _held_out(result: Comparison, factor: float) -> list[float | str]:
    """Error, floor and excess on manoeuvres held out; dashes if none could be."""
    if result.rmse_heldout is None or result.excess_heldout is None:
        return ["-", result.noise_floor * factor, "-"]
    return [
        result.rmse_heldout * factor,
        result.noise_floor * factor,
        result.excess_heldout * factor,
    ]


def comparison_page(result: ComparisonOfLogs) -> None:
    """Errors, where they are, parameters; of several observables what each brings."""
    if result.parts:
        _together_page(result)
    else:
        out = page(_WIDTH)
        _errors_page(out, result)
        parameters = [
            [n, p["value"], p["se"], p["unit"]] for n, p in result.parameters.items() if p["free"]
        ]
        out.print(console_table(["parameter", "value", "error", "unit"], parameters))
    if result.obstacles is not None:
        _hits_page(result.obstacles)


def _together_page(result: Comparison) -> None:
    """One fit of several observables: errors of all and of each, what each knows, agreement."""
    out = page(_WIDTH)
    out.print(
        f"{result.observable}, fitted together, in {result.unit}: {result.revolutions} "
        f"revolutions, {result.manoeuvres} manoeuvres"
    )
    rows: list[list[Any]] = [
        ["all", result.rmse, *_held_out(result, 1.0), result.reduced_chi2, result.unit]
    ]
    for part in result.parts:
        factor, unit = shown(part.observable, part.unit)
        errors = [part.rmse * factor, *_held_out(part, factor)]
        rows.append([f"  {part.label}", *errors, part.reduced_chi2, unit])
    names = ["", "rmse", "held out", "floor", "excess", "chi-square", "unit"]
    out.print(console_table(names, rows))
    out.print(result.agreement)
    gratings = all(part.member for part in result.parts)
    known = result.contributions if not gratings else ()  # of like sensors each knows the same
    parameters = [
        [n, p["value"], p["se"], p["unit"]] + [_without(k.error_without.get(n)) for k in known]
        for n, p in result.parameters.items()
        if p["free"]
    ]
    without = [f"without {k.observable}" for k in known]
    out.print(console_table(["parameter", "value", "error", "unit", *without], parameters))
    if gratings:
        return
    out.print("without an observable: the error that the others alone would leave")
    for part in result.parts:
        out.print("")
        _errors_page(out, part)


def _named(result: Comparison) -> str:
    return f"{result.observable} of {result.member}" if result.member else result.observable


def _without(error: float | None) -> float | str | None:
    return "not known" if error is not None and not isfinite(error) else error


def _errors_page(out: Console, result: Comparison) -> None:
    """The errors of one observable, and where they are."""
    factor, unit = shown(result.observable, result.unit)
    out.print(
        f"{_named(result)} in {unit}: {result.revolutions} revolutions, {result.manoeuvres} "
        "manoeuvres"
    )
    rows: list[list[Any]] = [
        ["all, fitted", result.rmse * factor, result.noise_floor * factor, result.excess * factor],
        ["all, held out", *_held_out(result, factor)],
    ]
    for name in ("angle", "speed", "regime", "conditions"):
        for row in result.tables[name]:
            label = (
                row["log"]
                if name == "conditions"
                else row.get("angle") or row.get("regime") or f"{row['speed_m_s']:g} m/s"
            )
            rows.append(
                [
                    f"  {label}",
                    row["rmse"] * factor,
                    row["noise_floor"] * factor,
                    row["excess"] * factor,
                ]
            )
    out.print(console_table(["", "rmse", "floor", "excess"], rows))
    out.print(f"reduced chi-square {result.reduced_chi2:.3g}, fit {result.fit_percent:.2f} %")
    out.print(
        f"floor: {result.noise_floor_within * factor:.3g} within manoeuvres, "
        f"{result.noise_floor_between * factor:.3g} between them "
        "as this model sees them (a worse model takes some of its misfit for scatter); "
        "errors are those of one revolution at one angle"
    )


def _hits_page(result: TransientComparison) -> None:
    """The hits to read."""
    out = page(_WIDTH)
    factor, unit = shown(result.observable, result.unit)
    total = result.to_json()
    out.print(
        f"obstacles: {len(result.hits)} hits; the model covers {100.0 * total['covered']:.0f} % "
        "of what they added "
        f"({total['nuisance_parameters']} nuisance numbers: when, phase, level and alignment of "
        "each)"
    )
    names = ["added", "missed", "rmse", "rmse_steady", "noise_floor", "excess"]
    rows = [
        [
            f"  {row['log']} at {row['time_s']:.4f} +- {row['time_se_s']:.1g} s",
            row["speed_m_s"],
            *(row[name] * factor for name in names),
        ]
        for row in result.tables["hit"]
    ]
    words = [f"in {unit}", "m/s", "added", "missed", "rmse", "steady", "floor", "excess"]
    out.print(console_table(words, rows))


def diagnosis_page(result: DiagnosisOfLogs) -> None:
    """Verdict, ranking, sets, what is left, what to drive, what to type."""
    from tirelog.api.results import drive_sentences, in_unit, percent, probability

    out = page(_WIDTH)
    factor, unit = shown(result.before.observable, result.before.unit)
    out.print(f"{result.verdict.replace('_', ' ').upper()}.  {result.sentence}")
    out.print(result.certainty.sentence)
    error = (
        f"held-out error {in_unit(result.rmse_heldout_before, factor)} -> "
        f"{in_unit(result.rmse_heldout_after, factor)} {unit}, "
    )
    if result.rmse_heldout_before is None:
        error = f"error of the fit {in_unit(result.before.rmse, factor)} {unit}, none held out, "
    out.print(
        f"{error}noise floor {result.noise_floor * factor:.3g}; {result.revolutions} "
        f"revolutions, {result.manoeuvres} manoeuvres"
    )
    rows = [
        [
            ("* " if c.selected else "  ") + c.effect,
            percent(c.excess_removed),
            probability(c.p_adjusted, result.manoeuvres),
            _strength(c),
        ]
        for c in result.effects
    ]
    out.print(console_table(["  effect", "excess removed", "p", "strength"], rows))
    if result.gratings is not None:
        out.print(_gratings(result.gratings))
    for group in result.ambiguous_groups:
        out.print(f"cannot be told apart here: {', '.join(group)}")
    for row in result.separating_manoeuvres:
        times = "once" if row["repeats"] == 1 else f"{row['repeats']} times"
        out.print(
            f"to part {' from '.join(row['separates'])}: {row['manoeuvre']}, {times} "
            f"({row['separation_sigma']:.1f} sigma a run)"
        )
    for said in drive_sentences(result.drive_next):
        out.print(said)
    for note in result.notes:
        out.print(note)
    out.print(result.unexplained["sentence"])
    if result.after.agreement:
        out.print(result.after.agreement)
    for effect, reason in result.not_tested.items():
        out.print(f"not tested: {effect}: {reason}")
    out.print(f"next: {result.next_command}")


def _gratings(found: GratingsFound) -> Any:
    """Which grating says what: angle, what it alone shows, each named effect as it has it."""
    rows: list[list[Any]] = []
    own = {frame.frame: frame for frame in found.frames}
    for name, angle in zip(found.names, found.angles_deg, strict=True):
        frame = own.get(name)
        row = [f"  {name}", f"{angle:.1f}", f"{frame.size:.3g}" if frame else "-"]
        for s in found.strengths:
            if name in found.asked:
                i = found.asked.index(name)
                row.append(f"{s.values[i]:.4g} +- {s.errors[i]:.2g}")
            else:
                row.append("left out")
        rows.append(row)
    return console_table(
        ["  grating", "angle [deg]", "alone [floors^2]", *(s.parameter for s in found.strengths)],
        rows,
    )


def _strength(candidate: Candidate) -> str:
    """The first two strengths with their errors.

    A dash if there was no refit, since a linear step may be no number of physics.
    """
    parts = []
    for name, s in list(candidate.strengths.items())[:2]:
        if s["se"] is None:
            return "-"
        error = f"+- {s['se']:.2g}" if isfinite(s["se"]) else "(not determined alone)"
        parts.append(
            f"{name} {s['value']:.4g} {error}" + (f" {s['unit']}" if s["unit"] != "1" else "")
        )
    return ", ".join(parts) or "-"


def ladder_bars(result: LadderOfLogs) -> None:
    """The held-out error as bars that shrink, the floor marked, on standard error."""
    factor, unit = shown(result.observable, result.unit)
    errors = [
        step.rmse_fit if step.rmse_heldout is None else step.rmse_heldout for step in result.steps
    ]
    largest = max(errors)
    for step, error in zip(result.steps, errors, strict=True):
        length = max(1, round(_BAR * error / largest))
        floor = min(_BAR - 1, round(_BAR * step.noise_floor / largest))
        bar = "".join("|" if i == floor else "#" if i < length else " " for i in range(_BAR))
        _line(f"{step.step:2d} {step.effect:18s} {bar} {error * factor:.3g} {unit}")
        _line(f"   {step.sentence}")
    for remark in result.remarks:
        _line(f"   {remark}")
    if result.rmse_untouched is not None:
        error, floor_there = (
            result.rmse_untouched * factor,
            (result.floor_untouched or 0.0) * factor,
        )
        _line(
            f"   on manoeuvres that nothing had touched: {error:.3g} {unit}, floor "
            f"{floor_there:.3g}"
        )


def _line(text: str) -> None:
    """A line of the bars, as any terminal may show it."""
    sys.stderr.write(f"{printable(text)}\n")
