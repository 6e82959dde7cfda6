"""What commands about models print: pages to read, and rows of the catalogue.

Numbers are in the observable's unit, strain in microstrain.
"""

from __future__ import annotations

import re
import shlex
import sys
import textwrap
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import tirelog.api as api
from tirelog.cli.session import aligned, console_table, page
from tirelog.errors import printable
from tirelog.vocabulary.observables import shown, together

if TYPE_CHECKING:
    from rich.console import Console

    from tirelog.data.recording import Recording


# ---- The pages that `ingest` and `info` print: of a log with a setup, and of one without.


#: columns of a page: as wide as a terminal, and no wider than one reads with ease
_WIDEST = 100
#: topics or columns without numbers that are named
_MOST_OTHERS = 8


def print_contents(inside: api.setups.Contents) -> None:
    """The page, on standard output; nothing is cut off, however narrow the terminal."""
    console = page(_WIDEST)
    width = max(min(console.width, _WIDEST), 40)

    def line(text: str, indent: int = 0) -> None:
        for part in textwrap.wrap(
            printable(text),
            width,
            initial_indent=" " * indent,
            subsequent_indent=" " * (indent + 2),
            break_on_hyphens=False,
        ):
            console.print(part)

    many = len(inside.found)
    line(f"{inside.log}: {inside.format}, {many} series" + ("" if many != 1 else " of numbers"))
    if inside.start:
        line(f"started {inside.start}")
    stated = any(one.rate_Hz for one in inside.found)
    line(f"time: {inside.time or ('the rate that the file states' if stated else 'none is found')}")
    if not inside.whole:
        line("only the beginning was looked at")
    for one in inside.found:
        console.print()
        line(one.series.source + (f" [{one.unit}]" if one.unit else ""))
        line(_facts(one), 2)
        line(_likely(one), 2)
    if inside.others:
        console.print()
        rest = ", ..." if len(inside.others) > _MOST_OTHERS else ""
        line(f"without numbers, or too short: {', '.join(inside.others[:_MOST_OTHERS])}{rest}")
    console.print()
    line("No setup was given. A first one, to be mended:")
    line(shlex.join(["tirelog", "setup", "new", inside.log, "-o", _beside(inside.log)]), 2)


def _beside(log: str) -> str:
    """The setup's name that is found beside the log: its own, packed or not, with .toml."""
    stem = "log" if log == "-" else re.sub(r"\.(gz|zst|xz)$", "", log)
    return re.sub(r"(?<=[^/])\.[^./]*$", "", stem) + ".toml"


def _facts(one: api.setups.FoundSeries) -> str:
    """Range, rate, size and first values."""
    known = one.known
    if not known.size:
        return f"{one.samples.size:,} samples, all of them lost"
    rate = f"{one.rate_Hz:,.6g} Hz" if one.rate_Hz else "no rate is known"
    lost = one.samples.size - known.size
    first = ", ".join(f"{x:.8g}" for x in known[:3].tolist())
    facts = [
        f"{known.min():.8g} to {known.max():.8g}",
        rate,
        f"{one.samples.size:,} samples looked at" + (f" ({lost:,} lost)" if lost else ""),
        f"first {first}",
    ]
    return "; ".join(facts + ([one.series.note] if one.series.note else []))


def _likely(one: api.setups.FoundSeries) -> str:
    if one.guess.kind == "signal":
        return f"kind unknown: {one.guess.reason}"
    return f"likely {one.guess.kind} in {one.guess.unit}: {one.guess.reason}"


#: columns of a page that no terminal shows
_SUMMARY_WIDTH = 160


def _stacked(console: Console, cells: dict[str, list[str]]) -> None:
    """Channel by channel, for a terminal that is narrower than the table: nothing is cut off."""
    for row in zip(*cells.values(), strict=True):
        of = dict(zip(cells, row, strict=True))
        console.print(f"{of.pop('channel')}: {of.pop('kind')}, unit {of.pop('unit')}")
        told = [f"{name} {text}" for name, text in of.items()]
        for line in textwrap.wrap(", ".join(told), max(console.width - 2, 20)):
            console.print(f"  {line}")


def print_summary(recording: Recording) -> None:
    """The page, on standard output."""

    console = page(_SUMMARY_WIDTH)
    about = recording.provenance
    size = (
        f", {about['bytes']:,} bytes, sha256 {about['sha256'][:12]}" if about.get("sha256") else ""
    )
    console.print(printable(f"{recording.log}: {about.get('format', 'log')}{size}"))
    if about.get("start"):
        console.print(printable(f"started {about['start']}"))
    rows = {name: v for name, v in api.logs.channels(recording).items() if name != "log"}
    cells = {
        name: [f"{x:,.6g}" if isinstance(x, float) else printable(str(x)) for x in values]
        for name, values in rows.items()
    }
    across = sum(max(map(len, (name, *texts))) + 2 for name, texts in cells.items())
    if across > console.width:
        _stacked(console, cells)
    else:
        left = [i for i, name in enumerate(cells) if name in ("channel", "kind", "unit")]
        console.print(console_table(list(cells), zip(*cells.values(), strict=True), left))
    repairs = {
        f"{group}: {what}": n
        for group, done in about.get("repairs", {}).items()
        for what, n in done.items()
        if n
    }
    for what, n in repairs.items():
        console.print(printable(f"repaired in the time axis of {what}: {n}"))
    for what, n in about.get("counts", {}).items():
        if n and not what.startswith("lost_samples"):
            console.print(printable(f"{what}: {n}"))
    tire, conditions = recording.setup.tire, recording.setup.conditions
    known = {
        **tire.known(),
        **{k: v for k, v in conditions.__dict__.items() if v is not None},
    }
    if known:
        console.print(printable("setup: " + ", ".join(f"{k} {v}" for k, v in known.items())))


#: letters in the longest bar of a ladder
_BAR = 40
#: letters in a line of a page that no terminal shows
_WIDTH = 110


def _table(table: api.answers.AnswerTable) -> Any:
    return console_table(table.names, table.rows)


def comparison_page(result: api.answers.Comparison) -> None:
    """Errors, where they are, parameters; of several observables what each brings."""
    out = page(_WIDTH)
    if not result.parts:
        _errors_page(out, result)
        out.print(_table(result.parameters_table()))
    else:
        out.print(
            f"{result.observable}, fitted together, in {result.unit}: {result.revolutions} "
            f"revolutions, {result.manoeuvres} manoeuvres"
        )
        out.print(_table(result.together_table()))
        out.print(result.agreement)
        known = result.parameters_table()
        out.print(_table(known))
        if not all(part.member for part in result.parts):
            out.print("without an observable: the error that the others alone would leave")
            for part in result.parts:
                out.print("")
                _errors_page(out, part)
    if said := result.nuisances_sentence():
        out.print(said)
    if result.obstacles is not None:
        _hits_page(result.obstacles)


def _errors_page(out: Console, result: api.answers.Comparison) -> None:
    """The errors of one observable, and where they are."""
    _, unit = shown(result.observable, result.unit)
    named = f"{result.observable} of {result.member}" if result.member else result.observable
    out.print(
        f"{named} in {unit}: {result.revolutions} revolutions, {result.manoeuvres} manoeuvres"
    )
    errors = result.errors_table()
    out.print(_table(errors.columns(*errors.names[:-1])))
    for said in result.floor_sentences():
        out.print(said)
    out.print(f"reduced chi-square {result.reduced_chi2:.3g}, fit {result.fit_percent:.2f} %")


def _hits_page(result: api.answers.TransientComparison) -> None:
    """The hits to read."""
    out = page(_WIDTH)
    total = result.to_json()
    out.print(
        f"obstacles: {len(result.hits)} hits; the model covers {100.0 * total['covered']:.0f} % "
        "of what they added "
        f"({total['nuisance_parameters']} nuisance numbers: when, phase, level and alignment of "
        "each)"
    )
    hits = result.hits_table()
    out.print(_table(hits.columns(*hits.names[:-2])))


def diagnosis_page(result: api.answers.Diagnosis) -> None:
    """Verdict, ranking, sets, what is left, what to drive, what to type."""
    out = page(_WIDTH)
    out.print(f"{result.verdict.replace('_', ' ').upper()}.  {result.sentence}")
    out.print(result.certainty.sentence)
    out.print(result.errors_sentence())
    ranking = result.ranking_table(most=2)
    out.print(_table(ranking.columns("  effect", "excess removed", "p", "strength")))
    if result.gratings is not None:
        out.print(_gratings(result.gratings))
    for said in result.further_sentences():
        out.print(said)


def _gratings(found: api.answers.GratingsFound) -> Any:
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


def ladder_bars(result: api.answers.Ladder) -> None:
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


def proposal_page(result: api.answers.Proposal, command: str) -> None:
    """The proposal to read."""
    out = page(_WIDTH)
    out.print(f"{result.status.upper()}.  {result.sentence}")
    for term in result.terms:
        out.print(f"\n{term.name}, acts on {term.formula.acts_on}: {term.formula.words}")
        out.print(f"  {term.formula.expression}")
        for name, number in term.numbers.items():
            error = number["se"]
            told = "not determined" if error is None else f"{error:.2g}"
            unit = "" if number["unit"] in ("", "1") else f" {number['unit']}"
            out.print(f"  {name} = {number['value']:.5g} +- {told}{unit}")
    sentences = result.sentences()
    if sentences:
        out.print("")
    for sentence in sentences:
        out.print(sentence)
    if command:
        out.print(f"next: {command}")


def _unit(unit: str) -> str:
    return "" if unit in ("", "1") else unit


def _cells(p: Any) -> tuple[str, ...]:
    error = "" if p.se is None else f"+- {p.se:.2g}"
    state = f"free in [{p.min:g}, {p.max:g}]" if p.free else "fixed"
    return p.name, f"{p.value:.6g}", error, _unit(p.unit), state, p.description


def model_page(model: api.models.Model) -> str:
    """The model as a person reads it."""

    road = {"flat_road": ", on a flat road", "point": ", under a point load"}.get(model.contact, "")
    parts = [
        f"{together(model.observables)} of a {model.carcass}{road}",
        aligned(_cells(p) for p in model.base),
    ]
    for e in model.effects:
        options = "".join(f", {key} = {word}" for key, word in e.options.items())
        parts += [
            f"{e.id}: {e.effect.mechanism}{options}",
            aligned(_cells(p) for p in e.parameters) or "  no parameters",
        ]
    if model.effects_file is not None:
        parts.append(f"own effects from {model.effects_file}")
    if not model.effects:
        parts.append("no effects; `tirelog effects` lists what can be added")
    if facts := api.models.carcass_facts(model):
        parts.append("from these numbers (P1 (2)-(5))")
        parts.append(
            aligned((name, f"{x:.6g}", unit, what) for name, (x, unit, what) in facts.items())
        )
    return "\n".join(parts)


def difference_page(rows: dict[str, list[Any]]) -> str:
    """The differences of two models to read."""
    header = ("parameter", "value", "against", "difference in sigma")
    body = (
        (
            name,
            *("-" if v != v else f"{v:.6g}" for v in (value, against)),
            "" if sigma != sigma else f"{sigma:+.1f}",
        )
        for name, value, against, sigma in zip(*rows.values())
    )
    return aligned([header, *body], indent="")


def fit_page(fitted: api.answers.FitOfLogs) -> str:
    """What a fit found."""
    result = fitted.found
    parameters = [result.model.parameters[name] for name in result.names]
    rows = [
        (
            full,
            f"{value:.6g}",
            f"+- {se:.2g}"
            if se < float("inf")
            else "no error"
            if full in result.at_bound
            else "not determined",
            ""
            if p.se_with_form is None
            else f"with form +- {p.se_with_form:.2g}"
            if p.se_with_form < float("inf")
            else "not determined with a form",
            _unit(p.unit),
        )
        for full, value, se, p in zip(result.names, result.values, result.se, parameters)
    ]
    lines = [
        f"{result.revolutions} revolutions, reduced chi-square {result.reduced_chi2:.3f}",
        aligned(rows),
    ]
    lines += [f"correlation {r:+.3f} between {a} and {b}" for a, b, r in result.correlations]
    lines += [f"{name} stands at a bound" for name in result.at_bound]
    return "\n".join([*lines, *fitted.doubts])


def learned_page(learned: api.answers.FittedMotion) -> str:
    """What obstacles told."""
    found = [learned.model.parameters[name] for name in learned.names]
    rows = [
        (p.name, f"{p.value:.6g}", "" if p.se is None else f"+- {p.se:.2g}", _unit(p.unit))
        for p in found
    ]
    less = 100.0 * (1.0 - learned.after / learned.before)
    return "\n".join(
        [
            f"{learned.hits} hits on obstacles; the error of the answer to them fell by "
            f"{less:.0f} %",
            aligned(rows),
        ]
    )


def effect_page(effect: api.models.Effect) -> str:
    """One effect of the catalogue."""

    rows: list[tuple[str, ...]] = [
        ("follows", effect.follows_said),
        ("acts on", ", ".join(effect.acts_on)),
        ("for", ", ".join(api.models.serves(effect).values())),
        ("needs", ", ".join(effect.needs) or "nothing beyond speed"),
        ("signature", effect.signature),
        ("valid", effect.valid),
        ("source", effect.source),
    ]
    rows += [(f"option {name}", " | ".join(words)) for name, words in effect.options.items()]
    if not effect.tried:
        rows.append(("diagnose", "does not try it; add it to the model if you know of it"))
    numbers = [
        (
            p.name,
            f"start {p.value:g}",
            f"[{p.min:g}, {p.max:g}]",
            _unit(p.unit),
            p.description + ("" if p.free else " (fixed)"),
        )
        for p in effect.parameters
    ]
    return "\n".join(
        [
            f"{effect.id}: {effect.mechanism}",
            aligned(rows),
            "  parameters",
            aligned(numbers, indent="    "),
        ]
    )


def catalogue_page(effects: Iterable[api.models.Effect]) -> str:
    """The catalogue, two lines per effect."""
    lines = []
    for e in effects:
        lines.append(f"{e.id}: {e.mechanism}")
        lines.append(
            f"  acts on {', '.join(e.acts_on)}; follows {e.follows_said}; "
            f"{', '.join(p.name for p in e.parameters)}; {e.source}"
        )
    return "\n".join(lines)


def catalogue_rows(effects: Iterable[api.models.Effect]) -> dict[str, list[Any]]:
    """Columns of the catalogue's table."""

    effects = list(effects)
    return {
        "effect": [e.id for e in effects],
        "mechanism": [e.mechanism for e in effects],
        "follows": [e.follows_said for e in effects],
        "acts_on": [" ".join(e.acts_on) for e in effects],
        "observables": [" ".join(api.models.serves(e)) for e in effects],
        "parameters": [" ".join(p.name for p in e.parameters) for e in effects],
        "needs": [" ".join(e.needs) for e in effects],
        "source": [e.source for e in effects],
        "valid": [e.valid for e in effects],
        "signature": [e.signature for e in effects],
    }


def history_page(rows: dict[str, list[Any]]) -> str:
    """The same to read: a line per step, errors in the observable's unit."""
    lines, last = [], ""
    for i, climbed in enumerate(rows["climbed"]):
        if climbed != last:
            lines.append(f"{climbed}  {rows['observable'][i]}  {rows['verdict'][i]}")
            last = climbed
        error, floor = rows["rmse_heldout"][i], rows["noise_floor"][i]
        held_out = "-" if error != error else f"{error:.4g}"
        lines.append(
            f"  {rows['step'][i]}  {rows['effect'][i]:20} held-out error {held_out}, floor "
            f"{floor:.4g}  {rows['decision'][i]}"
        )
    return "\n".join(lines)
