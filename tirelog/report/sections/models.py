"""Sections made of model results: the answer, the model's errors, the diagnosis, the ladder.

    Comparison, Diagnosis, a ladder as its command keeps it (JSON) --> Section

The answer is the page's first section. Its card has the verdict, the data, the certainty, the
errors of the models, and what to do next. Its figure has measured, first and best model at one
scale. Everything is what the commands gave; nothing is estimated here. The file is longer than
others, since each answer has its section.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tirelog.diagnosis.answer import (
    NUISANCES_SAID,
    AnswerTable,
    in_unit,
    percent,
    probability,
    separation_sentence,
)
from tirelog.diagnosis.candidates.search import removed_errors
from tirelog.diagnosis.candidates.separation import drive_sentences
from tirelog.diagnosis.diagnose import Diagnosis
from tirelog.diagnosis.obstacles import TransientComparison
from tirelog.diagnosis.results import Comparison, Map, steps_table
from tirelog.inference.measured import TransientLog
from tirelog.physics.effects import Effect
from tirelog.plots.answers import (
    climbed_panel,
    differences,
    over_angle,
    ranked_panel,
    waveforms,
)
from tirelog.plots.record import SYMBOLS, Panel, band, dots, heat, line
from tirelog.report.page import (
    DASHES,
    GREY,
    INK,
    PALE,
    Card,
    Figure,
    LogColours,
    ReportRequest,
    Section,
    figure,
    log_colours,
)
from tirelog.vocabulary.conditions import CONDITIONS, SETUP_KEYS
from tirelog.vocabulary.observables import shown

#: remarks and logs' conditions that the card has room for; the sections and tables have all of them
_SHOWN = 3
#: verdicts that take more than their own word
_WORDS = {
    "too_few": "Too few manoeuvres",
    "partial": "Partly explained",
    "unknown": "Unknown effect",
    "scatter": "Scatter above the floor",
}
#: a model on the way, as a card has it
Rung = dict[str, Any]
NO_MODEL = "No model was compared with these logs, so its errors are not known."


def shown_value(observable: str, unit: str) -> tuple[float, str]:
    """Factor and unit in which the page shows the observable."""
    factor, unit = shown(observable, unit)
    return factor, unit.replace("m/s^2", "m/s²")


def logs_of(result: Comparison) -> list[str]:
    """The logs that a comparison is about."""
    rows = (row for part in result.parts or (result,) for row in part.tables["conditions"])
    return list(dict.fromkeys(str(row["log"]) for row in rows))


@dataclass(frozen=True)
class AnswerSection:
    """What the answer is made of.

    compared   the model as given; `found` its diagnosis, None if none was asked for
    best       the model at the top, None if it is the one that came; `added` its further effects
    climbed    a ladder as its command keeps it
    """

    compared: Comparison
    found: Diagnosis | None
    best: Comparison | None
    added: Sequence[str]
    climbed: Mapping[str, Any] | None
    catalogue: Mapping[str, Effect]


def answer(given: AnswerSection, command: str, made_with: str, colours: LogColours) -> Section:
    """The section.  `command`: what to type next; `made_with`: the command that repeats it."""
    factor, unit = shown_value(given.compared.observable, given.compared.unit)
    first, named = given.compared, (given.best or given.compared).model.effects
    rungs, rungs_said = _rungs(given, factor)
    if given.found is None:
        which = (
            "Error of the fit (none held out)" if first.rmse_heldout is None else "Held-out error"
        )
        word, sentence = (
            "Compared",
            f"{which} {rungs[0]['error']:.3g} {unit}, noise floor {rungs[0]['floor']:.3g}. What "
            "is missing was not asked.",
        )
    else:
        word, sentence = _word(given.found, given.catalogue), given.found.sentence
    facts, advice = _facts(given, factor, unit), _advice(given.found)
    return Section(
        "answer",
        "The answer",
        made_with,
        (),
        _before_and_after(given, colours),
        folded=False,
        card=Card(word, sentence, facts, command, advice, rungs, rungs_said, unit),
        sources=[(one.id, one.effect.source) for one in named],
    )


def without_a_model(seen: Sequence[tuple[str, str]], asked: ReportRequest, said: str) -> Section:
    """The answer if no model was held against the logs: what was `seen`, and how to ask more."""
    lacks = asked.model is None
    card = Card(
        "Measured, not yet explained",
        said,
        seen,
        asked.make_model() if lacks else asked.command("compare", model=True),
        ["Make a model, then ask for this page again with --model M.toml."] if lacks else (),
    )
    return Section("answer", "The answer", asked.report_command(), folded=False, card=card)


def _word(found: Diagnosis, catalogue: Mapping[str, Effect]) -> str:
    """The verdict and, in words, what it names: an effect's mechanism, and its id."""
    word = _WORDS.get(found.verdict, found.verdict.replace("_", " ").capitalize())
    if found.verdict == "ambiguous":
        return f"{word}: {'; '.join(' or '.join(group) for group in found.ambiguous_groups)}"
    named = [
        f"{catalogue[name].mechanism} ({name})" if name in catalogue else name
        for name in found.selected
    ]
    return f"{word}: {', '.join(named)}" if named else word


def _facts(given: AnswerSection, factor: float, unit: str) -> list[tuple[str, str]]:
    compared, found = given.compared, given.found
    first = compared.parts[0] if compared.parts else compared
    ends = (np.min(first.by_speed.axis), np.max(first.by_speed.axis))
    speeds = " to ".join(dict.fromkeys(f"{float(speed):.3g}" for speed in ends))
    logs = [Path(log).name for log in logs_of(compared)]
    some = ", ".join(logs[:_SHOWN]) + (f" and {len(logs) - _SHOWN} more" if logs[_SHOWN:] else "")
    facts = [
        ("Measured on", f"{compared.observable.replace('_', ' ')} in {some}"),
        (
            "How much",
            f"{compared.revolutions} revolutions in {compared.manoeuvres} "
            f"manoeuvre{'s' if compared.manoeuvres > 1 else ''}, {speeds} m/s",
        ),
        ("Conditions", _conditions(first)),
    ]
    if found is not None:
        known = [name for name in found.selected if name in given.catalogue]
        facts.append(("How sure", _how_sure(found)))
        facts += [(name, _physics(given.catalogue[name])) for name in known]
        facts.append(("Or the setup", "; ".join(s.said for s in found.suspects)))
    more = len(compared.remarks) - _SHOWN
    remarks = "; ".join(compared.remarks[:_SHOWN]) + (
        f"; and {more} more below" if more > 0 else ""
    )
    facts += [("Where it fails", where(first)), ("Mind", remarks)]
    return [(term, text) for term, text in facts if text]


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
        told = ", ".join(shown) if len(shown) <= _SHOWN else "{:.4g} to {:.4g}".format(*reach)
        said.append(f"{condition.name or condition.symbol} {told} {unit}")
    return "; ".join(said)


def _how_sure(found: Diagnosis) -> str:
    """What the section of the diagnosis says at length, in short sentences."""
    errors, told = removed_errors(found.found), [f"{found.certainty.count}."]
    for c in found.effects:
        if c.selected:
            error = f" ± {100.0 * errors[c.effect]:.1f} %" if c.effect in errors else ""
            p = f"p = {probability(c.p_adjusted, found.manoeuvres)}".replace("= <=", "<=")
            told.append(
                f"{c.effect} removes {percent(c.excess_removed)}{error} of the excess; chance "
                f"alone does so with {p}."
            )
    return " ".join(told)


def _physics(effect: Effect) -> str:
    return f"{effect.mechanism}: {effect.signature}" if effect.signature else effect.mechanism


def _advice(found: Diagnosis | None) -> list[str]:
    if found is None:
        return ["Ask what is missing:"]
    left = str(found.unexplained["sentence"])
    drives = [f"Drive next, {separation_sentence(row)}." for row in found.separating_manoeuvres]
    drives = drives or drive_sentences(found.drive_next)
    return [*([left] if found.verdict in ("unknown", "partial") and left else []), *drives]


def _rungs(given: AnswerSection, factor: float) -> tuple[list[Rung], str]:
    """The models on the way, from the ladder or the diagnosis, and what errors these are."""

    def rung(name: str, said: str, error: float, held_out: float | None, floor: float) -> Rung:
        shown_error = (error if held_out is None else held_out) * factor
        return {"name": name, "said": said, "error": shown_error, "floor": floor * factor}

    def of(name: str, said: str, one: Comparison) -> Rung:
        return rung(name, said, one.rmse, one.rmse_heldout, one.noise_floor)

    def physics(*effects: str) -> str:
        known = (given.catalogue.get(name) for name in effects)
        return "; ".join("" if one is None else one.mechanism for one in known)

    climbed, found, start = given.climbed, given.found, "your model"
    if climbed is not None:
        steps = [s for s in climbed["steps"] if s["outcome"] != "not_added"]
        names = [
            f"{'without' if s['outcome'] == 'removed' else '+'} {s['effect']}" for s in steps[1:]
        ]
        said = ["", *(physics(s["effect"]) for s in steps[1:])]
        rungs = [
            rung(name, what, s["rmse_fit"], s["rmse_heldout"], s["noise_floor"])
            for name, what, s in zip([start, *names], said, steps, strict=True)
        ]
        return rungs, _climbed_on(climbed, logs_of(given.compared))
    rungs = [of(start, "", given.compared)]
    if found is None:
        return rungs, ""
    if came_in := found.found.came_in:
        what = "; ".join(NUISANCES_SAID[name] for name in came_in)
        rungs.append(of(f"+ {' and '.join(came_in)}", what, found.before))
    if found.selected:
        name = f"+ {' and '.join(found.selected)}"
        rungs.append(of(name, physics(*found.selected), found.after))
    else:  # the floor of the verdict
        rungs[-1]["floor"] = found.noise_floor * factor
    if found.rmse_heldout_before is None:
        return rungs, "The error of the fit: of one manoeuvre none can be held out."
    return rungs, "Error on manoeuvres that the fit had not seen."


def _climbed_on(climbed: Mapping[str, Any], logs: Sequence[str]) -> str:
    """On what the ladder was climbed, if not on all of these logs' manoeuvres."""
    of_fit = climbed["steps"][0]["rmse_heldout"] is None
    said = ["Errors of the fit by the ladder" if of_fit else "Held-out errors of the ladder"]
    of = [Path(str(log)).name for log in climbed.get("logs") or ()]
    if of and sorted(of) != sorted(Path(log).name for log in logs):
        said.append(f"climbed on other logs than these: {', '.join(of)}")
    seen, kept = climbed.get("manoeuvres"), climbed.get("manoeuvres_locked")
    if seen and kept:
        said.append(f"on the {seen} manoeuvres that the search saw; {kept} were locked away")
    return ", ".join(said) + "."


def _before_and_after(given: AnswerSection, colours: LogColours) -> list[Figure]:
    """Measured and both models, what each leaves, and the residual's maps; one scale each."""
    has = ", ".join(effect.id for effect in given.compared.model.effects)
    models = {f"first model, with {has}" if has else "first model": given.compared}
    if given.best is not None:
        models[f"best model, with {', '.join(given.added) or 'the effects'} added"] = given.best
    named = {name: one.parts[0] if one.parts else one for name, one in models.items()}
    first = next(iter(named.values()))
    factor, unit = shown_value(first.observable, first.unit)
    reach = max(_colour_reach(one.by_speed.residual * factor) for one in named.values())
    maps = [
        replace(
            residual_map(f"answer-map-{i}", f"Left by the {name}", one.by_speed, one, reach),
            half=len(named) > 1,
        )
        for i, (name, one) in enumerate(named.items())
    ]
    if first.by_speed.phi_rad.size < 2:
        return maps
    return [*_waves(named, factor, unit, colours), *maps]


def _waves(
    named: Mapping[str, Comparison], factor: float, unit: str, colours: LogColours
) -> list[Figure]:
    """The waveform on which the models differ most, and what each leaves of it."""
    every, last = list(named.values()), list(named.values())[-1]
    labels = [one.waveforms.labels for one in every]
    common = [label for label in labels[-1] if all(label in known for known in labels)]
    if not common:
        return []

    def left(one: Comparison, label: str) -> Any:
        i = one.waveforms.labels.index(label)
        return one.waveforms.measured[i] - one.waveforms.predicted[i]

    def parted(label: str) -> float:
        other = left(last, label) if len(every) > 1 else 0.0
        return float(np.nanmean((left(every[0], label) - other) ** 2))

    label = max(common, key=parted)
    i = labels[-1].index(label)
    phi, floor = np.rad2deg(last.waveforms.phi_rad[i]), 2.0 * factor * last.waveforms.floor[i]
    measured, colour = (
        last.waveforms.measured[i] * factor,
        colours[Path(last.waveforms.logs[i]).name],
    )
    waves = [dots(phi, measured, f"measured, {label}", colour, marker={"size": 5})]
    rest = [band(phi, -floor, floor, "two noise floors", GREY)]
    looks = ({"color": GREY, "dash": "dash", "width": 2}, {"color": INK, "width": 2})
    for (name, one), look in zip(named.items(), looks, strict=False):
        k = one.waveforms.labels.index(label)
        angle, predicted = np.rad2deg(one.waveforms.phi_rad[k]), one.waveforms.predicted[k] * factor
        waves.append(line(angle, predicted, name, INK, line=look))
        rest.append(line(angle, left(one, label) * factor, f"left by the {name}", INK, line=look))
    return [
        figure(
            "answer-waves",
            f"Measured, and the {' and '.join(named)}: {label}",
            "Measured mean of similar revolutions (points) and predictions (lines); dashed upright "
            "lines: the patch's edges.",
            over_angle(last, f"{last.observable} [{unit}]", waves),
            half=True,
            height=330,
        ),
        figure(
            "answer-left",
            f"The same, measured less predicted: {label}",
            "What each model leaves of this waveform, with two noise floors as a band about zero.",
            over_angle(last, f"residual [{unit}]", rest),
            half=True,
            height=330,
        ),
    ]


def comparisons(
    result: Comparison, command: str, colours: LogColours | None = None
) -> list[Section]:
    """The section of a comparison; of several observables one of all, and one of each."""
    colours = log_colours(logs_of(result)) if colours is None else colours
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
            result.together_table(),
            result.parameters_table(),
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
    waves = result.waveforms
    looks = styles(waves.logs, colours)
    figures = [
        figure(
            "waveforms",
            "Waveforms",
            "Measured means of similar revolutions (points), the model (lines) and two noise "
            f"floors about it (bands) at {'; '.join(waves.labels)}; dashed lines: the patch's "
            "edges.",
            waveforms(result, (factor, unit), looks),
            height=520,
        ),
        figure(
            "differences",
            "What the model leaves of these waveforms",
            f"Measured less predicted {result.observable} of the same waveforms, {unit}, with two "
            "noise floors as bands about zero.",
            differences(result, (factor, unit), looks),
            height=460,
        ),
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
            result.errors_table(lambda log: Path(log).name),
            result.parameters_table(fixed=True),
        ],
    )


def _with_nuisances(result: Comparison) -> list[str]:
    """What the errors are beside nuisances, if any earns a place."""
    said = result.nuisances_sentence()
    return [f"{said[:1].upper()}{said[1:]}."] if said else []


def where(result: Comparison) -> str:
    """Where the map of the residual is largest, and at which speed and regime the excess is."""
    factor, unit = shown_value(result.observable, result.unit)
    speed = max(result.tables["speed"], key=lambda row: row["excess"])
    regime = max(result.tables["regime"], key=lambda row: row["excess"])
    if speed["excess"] == 0.0:
        return "The first model fails nowhere by more than the floor."
    most, phi, edge = "", result.by_speed.phi_rad, result.half_angle_rad
    if phi.size > 1:
        size = factor * np.sqrt(np.mean(result.by_speed.residual**2, axis=0))
        sides = {
            "ahead of the entry edge": phi < -edge,
            "inside the patch": np.abs(phi) <= edge,
            "behind the exit edge": phi > edge,
        }
        largest = {name: float(size[side].max()) for name, side in sides.items() if side.any()}
        first, *others = sorted(largest.items(), key=lambda one: -one[1])
        then = " and ".join(f"{name} ({value:.3g})" for name, value in others)
        most = f"The first model fails most {first[0]} ({first[1]:.3g} {unit}), then {then}. "
    return (
        f"{most}The excess is largest at speeds near {speed['speed_m_s']:g} m/s "
        f"({speed['excess'] * factor:.3g} {unit}) and in {regime['regime']} "
        f"({regime['excess'] * factor:.3g})."
    )


def styles(logs: Sequence[str], colours: LogColours) -> list[tuple[int, str, str]]:
    """(number of the colour, dash, symbol) of each waveform, by the log that it is of.

    Of several logs the colour is the log's, and lines and symbols tell its waveforms apart.
    """
    if len(set(logs)) < 2:
        return [(i, DASHES[0], SYMBOLS[i % len(SYMBOLS)]) for i in range(len(logs))]
    own = [logs[:i].count(log) for i, log in enumerate(logs)]
    return [
        (colours[Path(log).name], DASHES[k % len(DASHES)], SYMBOLS[k % len(SYMBOLS)])
        for log, k in zip(logs, own, strict=True)
    ]


def _colour_reach(values: Any) -> float:
    """Where the colours of a map end: one odd cell does not bleach the rest."""
    known = np.abs(values[np.isfinite(values)])
    return float(np.percentile(known, 99.5)) if known.size else 1.0


def residual_map(
    id: str, title: str, found: Map, result: Comparison, reach: float | None = None
) -> Figure:
    """The residual, measured less predicted, over an axis and the angle.

    Colours go to `reach` in the page's unit.
    """
    factor, unit = shown_value(result.observable, result.unit)
    along = {"speed_m_s": ("speed", "m/s"), "time_s": ("time", "s")}[found.axis_name]
    name, residual = "{} [{}]".format(*along), found.residual * factor
    said, label = f"Measured less predicted {result.observable} in {unit}", f"residual [{unit}]"
    if found.phi_rad.size < 2:
        marks = [dots(found.axis, residual[:, 0], "residual", INK)]
        ends = None if reach is None else (-1.1 * reach, 1.1 * reach)
        panel = Panel(name, label, marks, limits=(None, ends))
        return figure(id, title, f"{said} against {name}.", panel)
    alt = (
        f"{said} as colour, blue below and red above zero, over the wheel angle and {along[0]} "
        f"from {found.axis.min():.4g} to {found.axis.max():.4g}."
    )
    most = _colour_reach(residual) if reach is None else reach
    colours = heat(np.rad2deg(found.phi_rad), found.axis, residual, label, "signed", 0.0, most)
    return figure(id, title, alt, over_angle(result, name, [colours]))


def diagnosis(result: Diagnosis, command: str) -> Section:
    """The section of a diagnosis.

    Verdict, ranking, sets that are not separated, what is unexplained, the next manoeuvre and
    command.
    """
    errors = result.errors_sentence()
    words = [
        f"{result.verdict.replace('_', ' ').capitalize()}. {result.sentence}",
        result.certainty.sentence,
        f"{errors[:1].upper()}{errors[1:]}.",
        *(f"{said[:1].upper()}{said[1:]}" for said in result.further_sentences()),
    ]
    tables, ranked = [result.ranking_table()], result.effects
    if not ranked:
        return Section("diagnosis", "The diagnosis", command, words, (), tables)
    best = ", ".join(f"{c.effect} {100 * c.excess_removed:.1f} %" for c in ranked[:5])
    alt = (
        f"Share of the excess that each effect removes alone: {best}. Error bars, one standard "
        "error, where the effect was refitted."
    )
    bars = ranked_panel(ranked, removed_errors(result.found), (INK, PALE))
    panel, height = replace(bars, x="share of the excess removed alone [%]"), 140 + 24 * len(ranked)
    drawn = figure("ranking", "Which effect is missing", alt, panel, height=height)
    return Section("diagnosis", "The diagnosis", command, words, [drawn], tables)


def ladder_section(climbed: Mapping[str, Any], command: str) -> Section:
    """The error falling to the floor, from the last ladder that its command kept."""
    factor, unit = shown_value(climbed["observable"], climbed["unit"])
    steps = [step for step in climbed["steps"] if step["outcome"] != "not_added"]
    names, floors = [s["effect"] for s in steps], [s["noise_floor"] * factor for s in steps]
    held = [
        "none" if s["rmse_heldout"] is None else f"{s['rmse_heldout'] * factor:.3g}" for s in steps
    ]
    fallen = f"No effect was added: held-out error {held[0]} {unit}, noise floor {floors[0]:.3g}."
    if len(names) > 1:
        fallen = (
            f"Held-out error {held[0]} → {held[-1]} {unit} by {', '.join(names[1:])}; noise floor "
            f"of the last model {floors[-1]:.3g}."
        )
    words = (
        [fallen]
        + [step["sentence"] for step in climbed["steps"]]
        + [f"{remark}." for remark in climbed.get("remarks", ())]
    )
    if climbed.get("rmse_untouched") is not None:
        words.append(
            f"On manoeuvres reserved for the end: {climbed['rmse_untouched'] * factor:.3g} "
            f"{unit}, floor there {climbed['floor_untouched'] * factor:.3g}."
        )
    said = (n if h == "none" else f"{n} {h} {unit}" for n, h in zip(names, held, strict=True))
    drawn = figure(
        "ladder-steps",
        "The error falling to the floor",
        f"Held-out error falling to the floor: {', '.join(said)}; noise floor {floors[-1]:.3g} "
        f"{unit}.",
        climbed_panel(climbed, (factor, unit), (PALE, INK, INK, GREY)),
    )
    return Section("ladder", "The ladder", command, words, [drawn], [steps_table(climbed)])


# ---- Logs that met an obstacle: how well the model answers it, hit by hit.


def not_answered(logs: Sequence[TransientLog], carcass: str, command: str) -> Section:
    """The hits that were found, if the model does not move."""
    hits = sum(log.hits_s.size for log in logs)
    text = (
        f"{hits} hits on an obstacle; answer, comparison and diagnosis leave their revolutions "
        f"out. A {carcass} says nothing of an obstacle; a model with carcass = "
        '"coupled_ring" does.'
    )
    rows = [
        [
            Path(log.log).name,
            log.road.kind,
            str(log.hits_s.size),
            ", ".join(f"{time:.3f}" for time in log.hits_s),
        ]
        for log in logs
    ]
    table = AnswerTable("Obstacles", ["log", "kind", "hits", "at [s]"], rows)
    return Section("obstacles", "Obstacles", command, [text], (), [table])


def obstacles(result: TransientComparison, command: str) -> Section:
    """What obstacles added, and what of it the model misses, hit by hit."""
    factor, unit = shown_value(result.observable, result.unit)
    total = result.to_json()
    words = [
        f"{len(result.hits)} hits on an obstacle, kept apart from the steady revolutions. The "
        f"model covers {100.0 * total['covered']:.0f} % of what they added: "
        f"{total['added'] * factor:.3g} {unit}, of which {total['missed'] * factor:.3g} is missed; "
        f"noise floor {total['noise_floor'] * factor:.3g}.",
        f"The prediction has {total['nuisance_parameters']} nuisance numbers (when, phase, level "
        "and alignment of each hit), which the errors are charged for.",
        *(f"{remark}." for remark in result.remarks),
    ]
    table = result.hits_table(lambda log: Path(log).name)
    return Section("obstacles", "Obstacles", command, words, (), [table])
