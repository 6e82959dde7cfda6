"""Models, effects and fits as a page to read, and as rows of a table."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from tirelog.cli.text import aligned
from tirelog.vocabulary.observables import together

if TYPE_CHECKING:
    from tirelog.api.models import Effect, Model
    from tirelog.api.results import FitOfLogs, Learned


def _unit(unit: str) -> str:
    return "" if unit in ("", "1") else unit


def _cells(p: Any) -> tuple[str, ...]:
    error = "" if p.se is None else f"+- {p.se:.2g}"
    state = f"free in [{p.min:g}, {p.max:g}]" if p.free else "fixed"
    return p.name, f"{p.value:.6g}", error, _unit(p.unit), state, p.description


def model_page(model: Model) -> str:
    """The model as a person reads it."""
    from tirelog.api.models import carcass_facts

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
    if facts := carcass_facts(model):
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


def fit_page(fitted: FitOfLogs) -> str:
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


def learned_page(learned: Learned) -> str:
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


def effect_page(effect: Effect) -> str:
    """One effect of the catalogue."""
    from tirelog.api.models import serves

    rows: list[tuple[str, ...]] = [
        ("follows", effect.follows_said),
        ("acts on", ", ".join(effect.acts_on)),
        ("for", ", ".join(serves(effect).values())),
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


def catalogue_page(effects: Iterable[Effect]) -> str:
    """The catalogue, two lines per effect."""
    lines = []
    for e in effects:
        lines.append(f"{e.id}: {e.mechanism}")
        lines.append(
            f"  acts on {', '.join(e.acts_on)}; follows {e.follows_said}; "
            f"{', '.join(p.name for p in e.parameters)}; {e.source}"
        )
    return "\n".join(lines)


def catalogue_rows(effects: Iterable[Effect]) -> dict[str, list[Any]]:
    """Columns of the catalogue's table."""
    from tirelog.api.models import serves

    effects = list(effects)
    return {
        "effect": [e.id for e in effects],
        "mechanism": [e.mechanism for e in effects],
        "follows": [e.follows_said for e in effects],
        "acts_on": [" ".join(e.acts_on) for e in effects],
        "observables": [" ".join(serves(e)) for e in effects],
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
