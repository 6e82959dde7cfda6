"""The page's first section: the answer of a model, before any detail.

Diagnosis, or a comparison alone; the best model's comparison; a ladder
    --> a card: verdict, what it was measured on, how sure, the error falling, what to do next
    --> measured, first and best model at one scale; what each effect adds

Everything is what the commands gave; nothing is estimated here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.diagnosis.answer import NUISANCES_SAID, separation_sentence, strengths
from tirelog.report.figures import (
    GREY,
    INK,
    Figure,
    LogColours,
    band,
    colour_reach,
    dots,
    layout,
    line,
)
from tirelog.report.page import Card, LadderRow, Section
from tirelog.report.sections.models import (
    ANGLE,
    edges,
    logs_of,
    residual_map,
    shown_value,
    where,
    window,
)
from tirelog.vocabulary.conditions import CONDITIONS, SETUP_KEYS

if TYPE_CHECKING:
    from tirelog.diagnosis.diagnose import Diagnosis
    from tirelog.diagnosis.results import Comparison, EffectCurve
    from tirelog.physics.effects import Effect
    from tirelog.report.request import ReportRequest

#: remarks that the card has room for; the sections have all of them
_REMARKS = 3
#: logs whose conditions are told one by one; of more their reach is
_TOLD = 3
#: effects whose curves are drawn
_CURVES = 3
_HEIGHT = 330
#: verdicts that take more than their own word
_WORDS = {
    "too_few": "Too few manoeuvres",
    "partial": "Partly explained",
    "unknown": "Unknown effect",
    "scatter": "Scatter above the floor",
}
NO_MODEL = "No model was held against these logs, so nothing is said of what one would miss."


@dataclass(frozen=True)
class AnswerSection:
    """What the answer is made of.

    compared   the model as it came; `found` its diagnosis, None if none was asked for
    best       the model at the top, None if it is the one that came; `added` its further effects
    climbed    a ladder as its command keeps it
    curves     what effects of the best model add
    """

    compared: Comparison
    found: Diagnosis | None
    best: Comparison | None
    added: Sequence[str]
    climbed: Mapping[str, Any] | None
    curves: Sequence[EffectCurve]
    catalogue: Mapping[str, Effect]


def answer(given: AnswerSection, command: str, made_with: str, colours: LogColours) -> Section:
    """The section.  `command`: what to type next; `made_with`: the command that repeats it."""
    factor, unit = shown_value(given.compared.observable, given.compared.unit)
    rungs, said = _rungs(given, factor)
    card = Card(
        word=_word(given),
        sentence=_sentence(given, factor, unit),
        facts=_facts(given, factor, unit),
        command=command,
        advice=_advice(given),
        rungs=rungs,
        rungs_said=said,
        unit=unit,
    )
    named = [e.effect for e in (given.best or given.compared).model.effects]
    return Section(
        "answer",
        "The answer",
        made_with,
        (),
        [*_before_and_after(given, colours), *_curves(given, colours)],
        folded=False,
        card=card,
        sources=[(effect.id, effect.source) for effect in named],
    )


def without_a_model(seen: Sequence[tuple[str, str]], asked: ReportRequest, said: str) -> Section:
    """The answer if no model was held against the logs: what was `seen`, and how to ask more."""
    advice = ["Make a model, then ask for this page again with --model M.toml."]
    made = asked.make_model() if asked.model is None else asked.command("compare", model=True)
    card = Card(
        "Measured, not yet explained",
        said,
        seen,
        made,
        advice if asked.model is None else (),
    )
    return Section("answer", "The answer", asked.report_command(), folded=False, card=card)


def _word(given: AnswerSection) -> str:
    found = given.found
    if found is None:
        return "Compared"
    word = _WORDS.get(found.verdict, found.verdict.replace("_", " ").capitalize())
    if found.verdict == "ambiguous" and found.ambiguous_groups:
        return f"{word}: {'; '.join(' or '.join(group) for group in found.ambiguous_groups)}"
    return f"{word}: {', '.join(found.selected)}" if found.selected else word


def _sentence(given: AnswerSection, factor: float, unit: str) -> str:
    if given.found is not None:
        return given.found.sentence
    return f"{_error(given.compared, factor, unit)}. What is missing was not asked."


def _error(result: Comparison, factor: float, unit: str) -> str:
    held = result.rmse_heldout
    which = "Error of the fit (none held out)" if held is None else "Held-out error"
    return (
        f"{which} {(result.rmse if held is None else held) * factor:.3g} {unit}, noise floor "
        f"{result.noise_floor * factor:.3g}"
    )


def _facts(given: AnswerSection, factor: float, unit: str) -> list[tuple[str, str]]:
    compared, found = given.compared, given.found
    first = compared.parts[0] if compared.parts else compared
    speed = first.by_speed.axis
    logs = [Path(log).name for log in logs_of(compared)]
    some = ", ".join(logs[:_TOLD]) + (f" and {len(logs) - _TOLD} more" if logs[_TOLD:] else "")
    facts = [
        ("Measured on", f"{compared.observable.replace('_', ' ')} in {some}"),
        (
            "How much",
            f"{compared.revolutions} revolutions in {compared.manoeuvres} "
            f"manoeuvre{'s' if compared.manoeuvres > 1 else ''}, {_reach(speed)} m/s",
        ),
        ("Conditions", _conditions(first)),
    ]
    if found is not None and found.rmse_heldout_before is not None:
        told = f"{found.rmse_heldout_before * factor:.3g}"
        if found.found.came_in:
            told = f"{(compared.rmse_heldout or 0.0) * factor:.3g} → {told}"
        if found.selected and found.rmse_heldout_after is not None:
            told += f" → {found.rmse_heldout_after * factor:.3g}"
        told += (
            f" {unit} on manoeuvres that the fit had not seen; noise floor "
            f"{found.noise_floor * factor:.3g}"
        )
        facts.append(("Error", told))
    if found is not None:
        facts.append(("How sure", _how_sure(found)))
        facts += [
            (effect, _physics(given.catalogue[effect]))
            for effect in found.selected
            if effect in given.catalogue
        ]
        if found.suspects:
            facts.append(("Or the setup", "; ".join(s.said for s in found.suspects)))
    facts.append(("Where it fails", where(first)))
    remarks = compared.remarks
    if remarks:
        more = len(remarks) - _REMARKS
        told = "; ".join(remarks[:_REMARKS]) + (f"; and {more} more below" if more > 0 else "")
        facts.append(("Mind", told))
    return [(term, text) for term, text in facts if text]


def _reach(values: Any) -> str:
    """From the least to the most; one number if they read the same."""
    ends = [f"{float(value):.3g}" for value in (np.min(values), np.max(values))]
    return " to ".join(dict.fromkeys(ends))


def _conditions(result: Comparison) -> str:
    """What the setups say, log by log, or from the least to the most."""
    said = []
    for key in SETUP_KEYS:
        known = [row[key] for row in result.tables["conditions"] if np.isfinite(row[key])]
        if not known:
            continue
        condition = CONDITIONS[key]
        scale, unit = (1e-3, "kPa") if condition.unit == "Pa" else (1.0, condition.unit)
        shown = list(dict.fromkeys(f"{value * scale:.4g}" for value in known))
        reach = (min(known) * scale, max(known) * scale)
        told = ", ".join(shown) if len(shown) <= _TOLD else "{:.4g} to {:.4g}".format(*reach)
        said.append(f"{condition.name or condition.symbol} {told} {unit}")
    return "; ".join(said)


def _how_sure(found: Diagnosis) -> str:
    from tirelog.diagnosis.answer import percent, probability
    from tirelog.diagnosis.candidates.search import removed_errors
    from tirelog.diagnosis.rules import RULES

    errors = removed_errors(found.found)
    told = []
    for c in found.effects:
        if c.selected:
            error = f" ± {100.0 * errors[c.effect]:.2g} %" if c.effect in errors else ""
            p = probability(c.p_adjusted, found.manoeuvres)
            size = strengths(c.strengths)
            told.append(
                f"{c.effect} removes {percent(c.excess_removed)}{error} of the excess, probability "
                f"{p} of being noise" + (f" ({size})" if size else "")
            )
    meaning = next(rule.words for rule in RULES if rule.verdict == found.verdict)
    sure = found.certainty.sentence.removesuffix(".")
    return "; ".join([sure, *told, f"the verdict means: {meaning}"])


def _physics(effect: Effect) -> str:
    return f"{effect.mechanism}: {effect.signature}" if effect.signature else effect.mechanism


def _advice(given: AnswerSection) -> list[str]:
    from tirelog.diagnosis.candidates.separation import drive_sentences

    found = given.found
    if found is None:
        return ["Ask what is missing:"]
    left = str(found.unexplained["sentence"])
    drives = [f"Drive next, {separation_sentence(row)}." for row in found.separating_manoeuvres]
    drives = drives or drive_sentences(found.drive_next)
    return [*([left] if found.verdict in ("unknown", "partial") and left else []), *drives]


def _rungs(given: AnswerSection, factor: float) -> tuple[list[LadderRow], str]:
    """The models on the way, from the ladder or the diagnosis, and what errors these are."""
    climbed, found = given.climbed, given.found
    if climbed is not None:
        taken = [s for s in climbed["steps"] if s["outcome"] != "not_added"]
        rungs = [
            LadderRow(
                "the model as it came" if i == 0 else f"{_sign(s)} {s['effect']}",
                "" if i == 0 else _what(given, s["effect"]),
                (s["rmse_fit"] if s["rmse_heldout"] is None else s["rmse_heldout"]) * factor,
                s["noise_floor"] * factor,
            )
            for i, s in enumerate(taken)
        ]
        return rungs, _climbed_on(climbed, logs_of(given.compared), factor)
    if found is None:
        return [_rung("the model as it came", "", given.compared, factor)], ""
    rungs = [_rung("the model as it came", "", given.compared, factor)]
    if came_in := found.found.came_in:
        said = "; ".join(NUISANCES_SAID[name] for name in came_in)
        rungs.append(_rung(f"+ {' and '.join(came_in)}", said, found.before, factor))
    if found.selected:
        added = " and ".join(found.selected)
        said = "; ".join(_what(given, name) for name in found.selected)
        rungs.append(_rung(f"+ {added}", said, found.after, factor))
    else:  # the floor of the verdict
        rungs[-1] = replace(rungs[-1], floor=found.noise_floor * factor)
    if found.rmse_heldout_before is None:
        return rungs, "The error of the fit: of one manoeuvre none can be held out."
    return rungs, "Held-out error, beside the noise floor (the upright mark)."


def _rung(name: str, said: str, result: Comparison, factor: float) -> LadderRow:
    error = result.rmse if result.rmse_heldout is None else result.rmse_heldout
    return LadderRow(name, said, error * factor, result.noise_floor * factor)


def _sign(step: Mapping[str, Any]) -> str:
    return "without" if step["outcome"] == "removed" else "+"


def _what(given: AnswerSection, effect: str) -> str:
    known = given.catalogue.get(effect)
    return "" if known is None else known.mechanism


def _climbed_on(climbed: Mapping[str, Any], logs: Sequence[str], factor: float) -> str:
    """On what the ladder was climbed, if not on all of these logs' manoeuvres."""
    first = climbed["steps"][0]
    of_fit = first["rmse_heldout"] is None
    said = ["Errors of the fit by the ladder" if of_fit else "Held-out errors of the ladder"]
    of = [Path(str(log)).name for log in climbed.get("logs") or ()]
    if of and sorted(of) != sorted(Path(log).name for log in logs):
        said.append(f"climbed on other logs than these: {', '.join(of)}")
    seen, kept = climbed.get("manoeuvres"), climbed.get("manoeuvres_locked")
    if seen and kept:
        said.append(f"on the {seen} manoeuvres that the search saw; {kept} were locked away")
    text = ", ".join(said) + "."
    if climbed.get("rmse_untouched") is not None:
        text += (
            f" On those that nothing had touched the last model leaves "
            f"{climbed['rmse_untouched'] * factor:.3g}, floor there "
            f"{climbed['floor_untouched'] * factor:.3g}."
        )
    return text


# ---- figures -------------------------------------------------------------------------------------


def _before_and_after(given: AnswerSection, colours: LogColours) -> list[Figure]:
    """Measured and both models, what each leaves, and the residual's maps; one scale each."""
    first, best = (
        one.parts[0] if one is not None and one.parts else one
        for one in (given.compared, given.best)
    )
    assert first is not None
    factor, unit = shown_value(first.observable, first.unit)
    named = [(_before(given), first, {"color": GREY, "dash": "dash", "width": 2})]
    if best is not None:
        added = ", ".join(given.added) or "the effects"
        named.append((f"best model, with {added} added", best, {"color": INK, "width": 2}))
    reach = max(colour_reach(one.by_speed.residual * factor) for _, one, _ in named)
    maps = [
        replace(
            residual_map(f"answer-map-{i}", f"Left by the {name}", one.by_speed, one, reach),
            half=len(named) > 1,
        )
        for i, (name, one, _) in enumerate(named)
    ]
    if first.by_speed.phi_rad.size < 2:
        return maps
    return [*_waves(named, factor, unit, colours), *maps]


def _before(given: AnswerSection) -> str:
    has = [effect.id for effect in given.compared.model.effects]
    return f"first model, with {', '.join(has)}" if has else "first model"


_Named = tuple[str, "Comparison", dict[str, Any]]


def _waves(named: Sequence[_Named], factor: float, unit: str, colours: LogColours) -> list[Figure]:
    """The waveform on which the models differ most, and what each leaves of it."""
    last = named[-1][1]
    common = [
        label
        for label in last.waveforms.labels
        if all(label in one.waveforms.labels for _, one, _ in named)
    ]
    if not common:
        return []

    def at(one: Comparison, label: str) -> int:
        return one.waveforms.labels.index(label)

    def apart(label: str) -> float:
        left = [_left(one, at(one, label)) for _, one, _ in named]
        return float(np.nanmean((left[0] - (left[-1] if len(left) > 1 else 0.0)) ** 2))

    label = max(common, key=apart)
    i, said = at(last, label), label
    colour = colours(last.waveforms.logs[i])
    phi = np.rad2deg(last.waveforms.phi_rad[i])
    floor = 2.0 * factor * last.waveforms.floor[i]
    measured = last.waveforms.measured[i] * factor
    waves = [dots(phi, measured, f"measured, {said}", colour, marker={"size": 5})]
    left = band(phi, -floor, floor, "two noise floors", GREY)
    left[1]["showlegend"] = True
    for name, one, style in named:
        k = at(one, label)
        angle = np.rad2deg(one.waveforms.phi_rad[k])
        waves.append(line(angle, one.waveforms.predicted[k] * factor, name, INK, line=style))
        left.append(line(angle, _left(one, k) * factor, f"left by the {name}", INK, line=style))
    shape = {
        "xrange": window(last.half_angle_rad),
        "lines": edges(last.half_angle_rad),
        "height": _HEIGHT,
    }
    models = " and ".join(name for name, _, _ in named)
    return [
        Figure(
            "answer-waves",
            f"Measured, and the {models}: {said}",
            "Measured mean of like revolutions (points) and predictions (lines); dashed upright "
            "lines: the patch's edges.",
            waves,
            layout(ANGLE, f"{last.observable} [{unit}]", **shape),
            half=True,
        ),
        Figure(
            "answer-left",
            f"The same, measured less predicted: {said}",
            "What each model leaves of this waveform, with two noise floors as a band about zero.",
            left,
            layout(ANGLE, f"residual [{unit}]", **shape),
            half=True,
        ),
    ]


def _left(one: Comparison, i: int) -> Any:
    return one.waveforms.measured[i] - one.waveforms.predicted[i]


def _curves(given: AnswerSection, colours: LogColours) -> list[Figure]:
    """What each effect adds, with its band, beside what the measurement leaves for it."""
    last = given.best or given.compared
    one = last.parts[0] if last.parts else last
    factor, unit = shown_value(one.observable, one.unit)
    figures: list[Figure] = []
    for curve in given.curves[:_CURVES]:
        of_angle = bool(curve.label)
        x = np.rad2deg(curve.along) if of_angle else curve.along
        added, error = curve.added * factor, 2.0 * curve.error * factor
        colour: int | str = colours(curve.log) if of_angle else GREY
        said = f", {curve.label}" if of_angle else ""
        known = bool(np.isfinite(error).all())
        floor = 2.0 * curve.floor * factor
        traces = band(x, added - floor, added + floor, "two noise floors", GREY)
        if known:
            traces += band(x, added - error, added + error, "two standard errors of it", INK)
        for trace in traces[1::2]:
            trace["showlegend"] = True
        traces.append(
            dots(x, curve.measured * factor, "measured less all else", colour, marker={"size": 5})
        )
        traces.append(line(x, added, f"{curve.effect} as fitted", INK, line={"width": 2}))
        physics = given.catalogue.get(curve.effect)
        alt = (
            f"What {curve.effect} adds to the prediction{said} (line)"
            + ", two noise floors about it (pale band)"
            + (", two standard errors of its own parameters (dark band)" if known else "")
            + ", and what is measured less everything else that the model predicts (points)."
            + (f" {_physics(physics)[:1].upper()}{_physics(physics)[1:]}." if physics else "")
        )
        shape = layout(
            ANGLE if of_angle else "speed [m/s]",
            f"added {one.observable} [{unit}]",
            **(
                {"xrange": window(one.half_angle_rad), "lines": edges(one.half_angle_rad)}
                if of_angle
                else {}
            ),
        )
        title = f"What {curve.effect} adds{said}"
        figures.append(Figure(f"answer-effect-{len(figures)}", title, alt, traces, shape))
    return figures
