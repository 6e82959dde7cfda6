"""What answers say, once: rows and sentences for a terminal, a notebook and a page.

Numbers stand in the unit in which a person reads them; whoever shows a table rounds them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING, Any

from tirelog.diagnosis.candidates.drive_next import drive_sentences
from tirelog.diagnosis.candidates.nuisance_sizes import held_sentences
from tirelog.diagnosis.candidates.ranking import removed_errors
from tirelog.diagnosis.results import ERRORS, Comparison, in_unit
from tirelog.diagnosis.wording import NUISANCES_SAID, percent, probability
from tirelog.vocabulary.observables import shown

if TYPE_CHECKING:
    from tirelog.diagnosis.diagnose import Diagnosis
    from tirelog.diagnosis.obstacles.compare import TransientComparison
    from tirelog.diagnosis.propose.results import Proposal

_ABOVE = "above scatter"
_ERRORS = ("rmse_fit", "rmse_heldout", "noise_floor", "excess_heldout")


@dataclass(frozen=True)
class ToldTable:
    """A small table to read: words and numbers, None for nothing."""

    caption: str
    names: Sequence[str]
    rows: Sequence[Sequence[Any]]

    def columns(self, *names: str) -> ToldTable:
        """The table with these columns alone."""
        at = [self.names.index(name) for name in names]
        return ToldTable(self.caption, names, [[row[i] for i in at] for row in self.rows])


def held_out(result: Comparison, factor: float) -> list[float | str]:
    """Error, error above `within`, floor and excess on manoeuvres held out; dashes if none is."""
    names = ("rmse_heldout", "excess_heldout_within", "noise_floor", "excess_heldout")
    found = [getattr(result, name) for name in names]
    return ["-" if value is None else value * factor for value in found]


def floor_sentences(result: Comparison) -> list[str]:
    """Which of the errors rank models, and which depend on the model."""
    factor, _ = shown(result.observable, result.unit)
    within, between = result.noise_floor_within * factor, result.noise_floor_between * factor
    return [
        f"{_ABOVE}: the error above the scatter within manoeuvres, {within:.3g}. That scatter "
        "depends on the data alone, so this column ranks models, held out.",
        f"floor: with the scatter between like manoeuvres, {between:.3g}. That part depends on the "
        "model, since a worse one takes misfit for scatter: do not rank models by excess.",
        "Errors are those of one revolution at one angle.",
    ]


def errors_table(result: Comparison, log_name: Callable[[str], str] = str) -> ToldTable:
    """Errors of a comparison: of all, by angle, speed, regime and log."""
    factor, unit = shown(result.observable, result.unit)
    names = ("rmse", "excess_within", "noise_floor", "excess")
    fitted = [getattr(result, name) * factor for name in names]
    rows: list[list[Any]] = [
        ["all, fitted", *fitted, result.revolutions],
        ["all, held out", *held_out(result, factor), None],
    ]
    for name in ("angle", "speed", "regime", "conditions"):
        for row in result.tables[name]:
            part = (
                log_name(row["log"])
                if name == "conditions"
                else row.get("angle") or row.get("regime") or f"{row['speed_m_s']:g} m/s"
            )
            errors = (row[key] * factor for key in names)
            rows.append([f"  {part}", *errors, row["revolutions"]])
    columns = ["", "rmse", _ABOVE, "floor", "excess", "revolutions"]
    return ToldTable(f"Where the error is [{unit}]", columns, rows)


def parameters_table(result: Comparison, fixed: bool = False) -> ToldTable:
    """The free parameters as fitted, with the `fixed` ones if asked for.

    Of several observables with the error that the others leave if one is left out.
    """
    gratings = all(part.member for part in result.parts)  # each of like sensors knows the same
    known = () if gratings else result.contributions

    def error(value: float | None) -> float | str | None:
        return "not known" if value is not None and not isfinite(value) else value

    rows = [
        [
            name,
            p["value"],
            p["se"] if p["free"] else "fixed",
            p["se_with_form"],
            p["unit"],
            *(error(k.error_without.get(name)) for k in known),
        ]
        for name, p in result.parameters.items()
        if p["free"] or fixed
    ]
    without = [f"without {one.observable}" for one in known]
    caption = "Parameters as fitted"
    if known:
        caption += "; without an observable: the error that the others alone would leave"
    return ToldTable(caption, ["parameter", "value", "error", "with form", "unit", *without], rows)


def together_table(result: Comparison) -> ToldTable:
    """Errors of one fit of several observables: of all and of each, each in its unit."""
    rows: list[list[Any]] = [
        ["all", result.rmse, *held_out(result, 1.0), result.reduced_chi2, result.unit]
    ]
    for part in result.parts:
        factor, unit = shown(part.observable, part.unit)
        errors = (part.rmse * factor, *held_out(part, factor))
        rows.append([f"  {part.label}", *errors, part.reduced_chi2, unit])
    names = ["", "rmse", "held out", _ABOVE, "floor", "excess", "chi-square", "unit"]
    return ToldTable("Errors of each observable", names, rows)


def hits_table(result: TransientComparison, log_name: Callable[[str], str] = str) -> ToldTable:
    """The obstacles hit by hit: what each added, what of it the model misses, errors and floor."""
    factor, unit = shown(result.observable, result.unit)
    sizes = ("added", "missed", "rmse", "rmse_steady", "noise_floor", "excess")
    rows = [
        [
            f"  {log_name(row['log'])} at {row['time_s']:.4f} +- {row['time_se_s']:.1g} s",
            row["speed_m_s"],
            *(row[name] * factor for name in sizes),
            f"{100.0 * row['covered']:.0f}",
            row["quality"],
        ]
        for row in result.tables["hit"]
    ]
    words = ("m/s", "added", "missed", "rmse", "steady", "floor", "excess", "covered [%]")
    return ToldTable(f"Hit by hit, in {unit}", [f"in {unit}", *words, "quality"], rows)


def ranking_table(result: Diagnosis, most: int | None = None) -> ToldTable:
    """The candidates by what they remove, the selected with a star; at most so many strengths."""
    errors = removed_errors(result.found)
    rows = [
        [
            ("* " if c.selected else "  ") + c.effect,
            percent(c.excess_removed),
            100.0 * errors[c.effect] if c.effect in errors else None,
            probability(c.p_adjusted, result.manoeuvres),
            strengths(c.strengths, most),
        ]
        for c in result.effects
    ]
    names = ["  effect", "excess removed", "standard error [%]", "p", "strength"]
    return ToldTable("Ranking of the candidates", names, rows)


def strengths(found: Mapping[str, Mapping[str, Any]], most: int | None = None) -> str:
    """Strengths with their errors; a dash without a refit: a linear step may be no physics."""
    parts = []
    for name, s in list(found.items())[:most]:
        if s["se"] is None:
            return "-"
        error = f"+- {s['se']:.2g}" if isfinite(s["se"]) else "(not determined alone)"
        if (with_form := s.get("se_with_form")) is not None:
            beside = (
                f"with form {with_form:.2g}"
                if isfinite(with_form)
                else "not determined with a form"
            )
            error += f" ({beside})"
        unit = f" {s['unit']}" if s["unit"] != "1" else ""
        parts.append(f"{name} {s['value']:.4g} {error}{unit}")
    return ", ".join(parts) or "-"


def errors_sentence(result: Diagnosis) -> str:
    """Errors before and after, the floor, and how much was measured."""
    factor, unit = shown(result.before.observable, result.before.unit)
    error = (
        f"held-out error {in_unit(result.rmse_heldout_before, factor)} -> "
        f"{in_unit(result.rmse_heldout_after, factor)} {unit}"
    )
    if result.rmse_heldout_before is None:
        error = f"error of the fit {in_unit(result.before.rmse, factor)} {unit}, none held out"
    elif (given := result.found.given) is not None and result.found.came_in:
        named = " and ".join(NUISANCES_SAID[name] for name in result.found.came_in)
        error += f" (both with {named}; {in_unit(given.rmse_held, factor)} without)"
    return (
        f"{error}, noise floor {result.noise_floor * factor:.3g}; {result.revolutions} "
        f"revolutions, {result.manoeuvres} manoeuvres"
    )


def nuisances_sentence(result: Comparison) -> str:
    """The errors of a comparison with the nuisances that earn a place, and without; "" of none."""
    beside = result.with_nuisances
    if beside is None:
        return ""
    factor, unit = shown(result.observable, result.unit)

    def errors(of: Mapping[str, Any]) -> str:
        held, fitted, floor, chi2 = (of[name] for name in ERRORS)
        return (
            f"held out {in_unit(held, factor)} {unit}, fit {fitted * factor:.3g}, noise floor "
            f"{floor * factor:.3g}, reduced chi-square {chi2:.3g}"
        )

    named = " and ".join(NUISANCES_SAID[name] for name in beside["nuisances"])
    without = {name: getattr(result, name) for name in ERRORS}
    return (
        f"with {named} in the fit: {errors(beside)}; without: {errors(without)}. A missing effect "
        "can look like that: `tirelog diagnose` tells which"
    )


def further_sentences(result: Diagnosis) -> list[str]:
    """What a diagnosis says beside its verdict and ranking, and what to do next."""
    return [
        *(f"cannot be told apart here: {', '.join(group)}" for group in result.ambiguous_groups),
        *map(separation_sentence, result.separating_manoeuvres),
        *drive_sentences(result.drive_next),
        *result.notes,
        *held_sentences(result.form_may_hold),
        str(result.unexplained["sentence"]),
        *([result.after.agreement] if result.after.agreement else []),
        *(f"not tested: {effect}: {reason}" for effect, reason in result.not_tested.items()),
        f"next: {result.next_command}",
    ]


def separation_sentence(row: Mapping[str, Any]) -> str:
    """A manoeuvre that parts rivals."""
    times = "once" if row["repeats"] == 1 else f"{row['repeats']} times"
    return (
        f"to part {' from '.join(row['separates'])}: {row['manoeuvre']}, {times} "
        f"({row['separation_sigma']:.1f} sigma a run)"
    )


def steps_table(climbed: Mapping[str, Any]) -> ToldTable:
    """The steps of a ladder, as its JSON has them."""
    factor, unit = shown(climbed["observable"], climbed["unit"])
    rows = [
        [
            str(step["step"]),
            step["effect"],
            *("-" if step[k] is None else step[k] * factor for k in _ERRORS),
            step["p_adjusted"],
            step["decision"],
            strengths(_own(step)),
        ]
        for step in climbed["steps"]
    ]
    errors = [f"{name} [{unit}]" for name in ("fitted", "held out", "floor", "excess")]
    names = ["step", "effect", *errors, "p, adjusted", "decision", "its parameters"]
    return ToldTable("Steps of the ladder", names, rows)


def _own(step: Mapping[str, Any]) -> Mapping[str, Any]:
    """The parameters that a step brought: the first all, a further one those of what it added."""
    found: Mapping[str, Any] = step["parameters"]
    if step["step"] == 0:
        return found
    names = str(step["effect"]).split(" and ")
    return {name: p for name, p in found.items() if name.split(".")[0] in names}


def terms_table(result: Proposal) -> ToldTable:
    """The numbers of the formulas that are proposed."""
    rows: list[list[Any]] = []
    for term in result.terms:
        words = [term.name, term.formula.acts_on, term.formula.expression]
        for name, n in term.numbers.items():
            error = "not determined" if n["se"] is None else n["se"]
            rows.append([*words, name, n["value"], error, n["unit"]])
            words = ["", "", ""]
    names = ["effect", "acts on", "expression", "number", "value", "error", "unit"]
    return ToldTable("Numbers of the formulas", names, rows)
