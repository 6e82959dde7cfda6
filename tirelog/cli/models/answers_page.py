"""The pages that `compare` and `diagnose` print, and the bars of `ladder`.

Numbers are in the observable's unit, strain in microstrain.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

from tirelog.cli.session import page
from tirelog.cli.text import console_table
from tirelog.errors import printable
from tirelog.vocabulary.observables import shown

if TYPE_CHECKING:
    from rich.console import Console

    from tirelog.api.results import (
        Comparison,
        ComparisonOfLogs,
        DiagnosisOfLogs,
        GratingsFound,
        LadderOfLogs,
        ToldTable,
        TransientComparison,
    )

#: letters in the longest bar of a ladder
_BAR = 40
#: letters in a line of a page that no terminal shows
_WIDTH = 110


def _table(told: ToldTable) -> Any:
    return console_table(told.names, told.rows)


def comparison_page(result: ComparisonOfLogs) -> None:
    """Errors, where they are, parameters; of several observables what each brings."""
    from tirelog.api.results import nuisances_sentence, parameters_table, together_table

    out = page(_WIDTH)
    if not result.parts:
        _errors_page(out, result)
        out.print(_table(parameters_table(result)))
    else:
        out.print(
            f"{result.observable}, fitted together, in {result.unit}: {result.revolutions} "
            f"revolutions, {result.manoeuvres} manoeuvres"
        )
        out.print(_table(together_table(result)))
        out.print(result.agreement)
        known = parameters_table(result)
        out.print(_table(known))
        if not all(part.member for part in result.parts):
            out.print("without an observable: the error that the others alone would leave")
            for part in result.parts:
                out.print("")
                _errors_page(out, part)
    if said := nuisances_sentence(result):
        out.print(said)
    if result.obstacles is not None:
        _hits_page(result.obstacles)


def _errors_page(out: Console, result: Comparison) -> None:
    """The errors of one observable, and where they are."""
    from tirelog.api.results import errors_table, floor_sentences

    _, unit = shown(result.observable, result.unit)
    named = f"{result.observable} of {result.member}" if result.member else result.observable
    out.print(
        f"{named} in {unit}: {result.revolutions} revolutions, {result.manoeuvres} manoeuvres"
    )
    errors = errors_table(result)
    out.print(_table(errors.columns(*errors.names[:-1])))
    for said in floor_sentences(result):
        out.print(said)
    out.print(f"reduced chi-square {result.reduced_chi2:.3g}, fit {result.fit_percent:.2f} %")


def _hits_page(result: TransientComparison) -> None:
    """The hits to read."""
    from tirelog.api.results import hits_table

    out = page(_WIDTH)
    total = result.to_json()
    out.print(
        f"obstacles: {len(result.hits)} hits; the model covers {100.0 * total['covered']:.0f} % "
        "of what they added "
        f"({total['nuisance_parameters']} nuisance numbers: when, phase, level and alignment of "
        "each)"
    )
    told = hits_table(result)
    out.print(_table(told.columns(*told.names[:-2])))


def diagnosis_page(result: DiagnosisOfLogs) -> None:
    """Verdict, ranking, sets, what is left, what to drive, what to type."""
    from tirelog.api.results import errors_sentence, further_sentences, ranking_table

    out = page(_WIDTH)
    out.print(f"{result.verdict.replace('_', ' ').upper()}.  {result.sentence}")
    out.print(result.certainty.sentence)
    out.print(errors_sentence(result))
    ranking = ranking_table(result, most=2)
    out.print(_table(ranking.columns("  effect", "excess removed", "p", "strength")))
    if result.gratings is not None:
        out.print(_gratings(result.gratings))
    for said in further_sentences(result):
        out.print(said)


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
