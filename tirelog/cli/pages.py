"""Pages to read of commands about models, and rows of the catalogue.

Numbers are in the observable's unit, strain in microstrain.
"""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import typer

import tirelog.api as api
from tirelog.errors import printable
from tirelog.vocabulary.observables import shown, together

if TYPE_CHECKING:
    from tirelog.data.recording import Recording


# ---- The pages of `ingest` and `info`: of a log with a setup, and of one without.


#: topics or columns without numbers that are named
_MOST_OTHERS = 8


def print_contents(inside: api.logs.Contents) -> None:
    """The page, on standard output; whatever is long is the terminal's to wrap."""
    for line in _contents(inside):
        typer.echo(printable(line))


def _contents(inside: api.logs.Contents) -> Iterator[str]:
    """The lines of the page, those about a series indented."""
    many = len(inside.found)
    yield f"{inside.log}: {inside.format}, {many} series" + ("" if many != 1 else " of numbers")
    if inside.start:
        yield f"started {inside.start}"
    stated = any(one.rate_Hz for one in inside.found)
    yield f"time: {inside.time or ('the rate that the file states' if stated else 'none is found')}"
    if not inside.whole:
        yield "only the beginning was read"
    for one in inside.found:
        yield from ("", one.series.source + (f" [{one.unit}]" if one.unit else ""))
        yield f"  {_facts(one)}"
        kind = "kind unknown" if one.guess.kind == "signal" else f"likely {one.guess.kind}"
        unit = "" if one.guess.kind == "signal" else f" in {one.guess.unit}"
        yield f"  {kind}{unit}: {one.guess.reason}"
    if inside.others:
        rest = ", ..." if len(inside.others) > _MOST_OTHERS else ""
        named = ", ".join(inside.others[:_MOST_OTHERS])
        yield from ("", f"without numbers, or too short: {named}{rest}")
    # the setup's name that is found beside the log: its own, packed or not, with .toml
    stem = "log" if inside.log == "-" else re.sub(r"\.(gz|zst|xz)$", "", inside.log)
    beside = re.sub(r"(?<=[^/])\.[^./]*$", "", stem) + ".toml"
    yield from ("", "No setup was given. A first draft, to be checked:")
    yield f"  {shlex.join(['tirelog', 'setup', 'new', inside.log, '-o', beside])}"


def _facts(one: api.logs.FoundSeries) -> str:
    """Range, rate, size and first values."""
    known, lost = one.known, one.samples.size - one.known.size
    if not known.size:
        return f"{one.samples.size:,} samples, all lost"
    facts = (
        f"{known.min():.8g} to {known.max():.8g}",
        f"{one.rate_Hz:,.6g} Hz" if one.rate_Hz else "no rate is known",
        f"{one.samples.size:,} samples read" + (f" ({lost:,} lost)" if lost else ""),
        f"first {', '.join(f'{x:.8g}' for x in known[:3].tolist())}",
        one.series.note,
    )
    return "; ".join(filter(None, facts))


def print_summary(recording: Recording) -> None:
    """The page, on standard output."""
    for line in _summary(recording):
        typer.echo(printable(line))


def _summary(recording: Recording) -> Iterator[str]:
    """The lines of the page, those about a channel indented."""
    about, setup = recording.provenance, recording.setup
    hashed = about.get("sha256")
    size = f", {about['bytes']:,} bytes, sha256 {hashed[:12]}" if hashed else ""
    yield f"{recording.log}: {about.get('format', 'log')}{size}"
    if about.get("start"):
        yield f"started {about['start']}"
    columns = api.logs.channels(recording)
    for values in zip(*columns.values(), strict=True):
        of = dict(zip(columns, values, strict=True))
        yield f"{of['channel']}: {of['kind']}, unit {of['unit']}"
        facts = {n: x for n, x in of.items() if n not in ("log", "channel", "kind", "unit")}
        said = (f"{n} {x:,.6g}" if isinstance(x, float) else f"{n} {x}" for n, x in facts.items())
        yield f"  {', '.join(said)}"
    done = {
        f"repaired in the time axis of {group}: {what}": n
        for group, repairs in about.get("repairs", {}).items()
        for what, n in repairs.items()
    }
    counts = about.get("counts", {}).items()
    done |= {what: n for what, n in counts if not what.startswith("lost_samples")}
    yield from (f"{what}: {n}" for what, n in done.items() if n)
    conditions = {k: v for k, v in setup.conditions.__dict__.items() if v is not None}
    if known := setup.tire.known() | conditions:
        yield "setup: " + ", ".join(f"{k} {v}" for k, v in known.items())


#: letters in a line of a page that no terminal shows
_WIDTH = 110


def print_answer(parts: Iterable[str | api.answers.AnswerTable]) -> None:
    """Lines and tables of an answer to read, on standard output, whose reader may leave."""
    from rich.console import Console

    shown = None if sys.stdout.isatty() else _WIDTH
    out = Console(highlight=False, markup=False, soft_wrap=True, width=shown)
    with out.capture() as made:  # rich itself would end the process with status 1 then
        for part in parts:
            out.print(part if isinstance(part, str) else _table(part))
    sys.stdout.write(made.get())


def _table(answer: api.answers.AnswerTable) -> Any:
    """A table of a page: numbers with four digits, nothing for None; nothing is cut off."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    for i, name in enumerate(answer.names):
        table.add_column(name, justify="right" if i else "left", overflow="fold")
    for row in answer.rows:
        cells = (f"{v:.4g}" if isinstance(v, float) else v for v in row)
        table.add_row(*("" if v is None else str(v) for v in cells))
    return table


def aligned(rows: Iterable[tuple[str, ...]], indent: str = "  ") -> str:
    """Rows of text in columns, all to the left, as a text."""
    rows = list(rows)
    widths = [max(map(len, column)) for column in zip(*rows)]
    return "\n".join(
        (indent + "  ".join(cell.ljust(w) for cell, w in zip(row, widths))).rstrip() for row in rows
    )


def diagnosis_page(result: api.answers.Diagnosis) -> Iterator[str | api.answers.AnswerTable]:
    """Verdict, ranking, sets, what is left, what to drive, what to type."""
    yield f"{result.verdict.replace('_', ' ').upper()}.  {result.sentence}"
    yield result.certainty.sentence
    yield result.errors_sentence()
    yield result.ranking_table(most=2).columns("  effect", "excess removed", "p", "strength")
    if result.gratings is not None:
        yield _gratings(result.gratings)
    yield from result.further_sentences()


def _gratings(found: api.answers.GratingsFound) -> api.answers.AnswerTable:
    """A row per grating: its angle, and its size alone."""
    own = {frame.frame: f"{frame.size:.3g}" for frame in found.frames}
    rows = [
        [f"  {name}", f"{angle:.1f}", own.get(name, "-")]
        for name, angle in zip(found.names, found.angles_deg, strict=True)
    ]
    return api.answers.AnswerTable(
        "Gratings", ["  grating", "angle [deg]", "alone [floors^2]"], rows
    )


def ladder_steps(result: api.answers.Ladder) -> Iterator[str]:
    """A line for each step: its error, the floor, and what was decided."""
    factor, unit = shown(result.observable, result.unit)
    for step in result.steps:
        error = step.rmse_fit if step.rmse_heldout is None else step.rmse_heldout
        yield (
            f"{step.step:2d} {step.effect}: {error * factor:.3g} {unit}, floor "
            f"{step.noise_floor * factor:.3g}. {step.sentence}"
        )
    if result.rmse_untouched is not None:
        yield (
            f"on manoeuvres reserved for the end: {result.rmse_untouched * factor:.3g} {unit}, "
            f"floor {(result.floor_untouched or 0.0) * factor:.3g}"
        )


def proposal_page(result: api.answers.Proposal, command: str) -> Iterator[str]:
    """The proposal to read: formulas with their numbers, and what else a reader should know."""
    yield f"{result.status.upper()}.  {result.headline}"
    for term in result.terms:
        yield f"\n{term.name}, acts on {term.formula.acts_on}: {term.formula.words}"
        yield f"  {term.formula.expression}"
        for name, number in term.numbers.items():
            error = "not determined" if number["se"] is None else f"{number['se']:.2g}"
            value = f"{number['value']:.5g} +- {error} {_unit(number['unit'])}"
            yield f"  {name} = {value}".rstrip()
    yield from result.below()[1]
    if command:
        yield f"next: {command}"


def _unit(unit: str) -> str:
    return "" if unit in ("", "1") else unit


def _cells(p: Any) -> tuple[str, ...]:
    """Name, value, error, unit, bounds and meaning of a parameter."""
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
        parts.append("no effects; list: `tirelog effects`")
    if facts := api.models.carcass_facts(model):
        parts.append("derived from these numbers")
        parts.append(
            aligned((name, f"{x:.6g}", unit, what) for name, (x, unit, what) in facts.items())
        )
    return "\n".join(parts)


def rows_page(rows: dict[str, list[Any]]) -> str:
    """Rows of a table to read, below the names of its columns."""
    body = (
        ["-" if x != x else f"{x:.6g}" if isinstance(x, float) else str(x) for x in row]
        for row in zip(*rows.values())
    )
    return aligned([tuple(rows), *map(tuple, body)], indent="")


def fit_page(fitted: api.answers.FitOfLogs) -> Iterator[str | api.answers.AnswerTable]:
    """The result of a fit, and of a fit to obstacles."""
    answer, learned = fitted.to_json(), fitted.learned
    known = {**fitted.found.model.parameters, **fitted.model.parameters}
    rows = []
    for name, p in answer["parameters"].items():
        error = "not determined" if p["se"] is None else f"+- {p['se']:.2g}"
        with_form, form = known[name].se_with_form, ""
        if with_form is not None:
            form = f"+- {with_form:.2g}" if with_form < float("inf") else "not determined"
        rows.append([f"  {name}", f"{p['value']:.6g}", error, form, _unit(p["unit"])])
    names = ("  parameter", "value", "error", "with form", "unit")
    yield fitted.headline
    yield api.answers.AnswerTable("Parameters as fitted", names, rows)
    yield from (f"correlation {r:+.3f} between {a} and {b}" for a, b, r in answer["correlations"])
    yield from (said for said in fitted.below()[1] if said not in fitted.remarks)
    if learned is not None:
        less = 100.0 * (1.0 - learned.after / learned.before)
        yield f"{learned.hits} hits on obstacles; the error of the response fell by {less:.0f} %"


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
        rows.append(("diagnose", "does not test it; add it to the model yourself"))
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
