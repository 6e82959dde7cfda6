"""Sections made of model results: the answer, the model's errors, the diagnosis, the ladder.

    Comparison, Diagnosis, a ladder as its command keeps it (JSON) --> Section

The answer is the page's first section. Its card has the verdict, the data, the certainty, the
errors of the models, and what to do next. Its figures have what the first and the best model leave
at one scale. Everything is what the commands gave; nothing is estimated here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tirelog.diagnosis.answer import NUISANCES_SAID, in_unit, separation_sentence
from tirelog.diagnosis.candidates.search import removed_errors
from tirelog.diagnosis.candidates.separation import drive_sentences
from tirelog.diagnosis.diagnose import Diagnosis
from tirelog.diagnosis.obstacles import TransientComparison
from tirelog.diagnosis.residual_structure import suspect_sentence
from tirelog.diagnosis.results import Comparison, steps_table
from tirelog.physics.effects import Effect
from tirelog.plots.answers import (
    before_and_after,
    climbed_panel,
    differences,
    ranked_panel,
    residual_map,
    waveforms,
)
from tirelog.plots.record import SYMBOLS
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

#: remarks and logs that the card has room for; the sections and tables have all of them
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


def logs_of(result: Comparison) -> list[str]:
    """The logs that a comparison is about."""
    rows = (row for part in result.parts or (result,) for row in part.tables["conditions"])
    return list(dict.fromkeys(str(row["log"]) for row in rows))


def answer(
    compared: Comparison,
    found: Diagnosis | None,
    catalogue: Mapping[str, Effect],
    command: str,
    made_with: str,
    colours: LogColours,
) -> Section:
    """The section of a comparison, and of a diagnosis if one was asked for.

    `command`: what to type next; `made_with`: the command that repeats it.
    """
    factor, unit = shown(compared.observable, compared.unit)
    rungs, advice = _rungs(compared, found, catalogue, factor), ["Ask what is missing:"]
    if found is None or found.rmse_heldout_before is None:
        errors = "The error of the fit: of one manoeuvre none can be held out."
    else:
        errors = "Error on manoeuvres that the fit had not seen."
    figures, word = _first_and_best(compared, found, colours), "Compared"
    sentence = f"{compared.headline}. What is missing was not asked."
    if found is not None:
        word, sentence = _word(found, catalogue), found.sentence
        unexplained = str(found.unexplained["sentence"])
        drives = [f"Drive next, {separation_sentence(row)}." for row in found.separating_manoeuvres]
        advice = [unexplained] * (found.verdict in ("unknown", "partial"))
        advice += drives or drive_sentences(found.drive_next)
    facts = _facts(compared, found, catalogue)
    card = Card(word, sentence, facts, command, advice, rungs, errors, unit)
    return Section("answer", "The answer", made_with, (), figures, folded=False, card=card)


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


def _facts(
    compared: Comparison, found: Diagnosis | None, catalogue: Mapping[str, Effect]
) -> list[tuple[str, str]]:
    first = compared.parts[0] if compared.parts else compared
    speeds = f"{first.by_speed.axis.min():.3g} to {first.by_speed.axis.max():.3g} m/s"
    logs, remarks = [Path(log).name for log in logs_of(compared)], compared.remarks
    more_logs = f" and {len(logs) - _SHOWN} more" if logs[_SHOWN:] else ""
    more = f"; and {len(remarks) - _SHOWN} more below" if remarks[_SHOWN:] else ""
    facts = [
        (
            "Measured on",
            f"{compared.observable.replace('_', ' ')} in {', '.join(logs[:_SHOWN])}{more_logs}",
        ),
        (
            "How much",
            f"{compared.revolutions} revolutions in {compared.manoeuvres} "
            f"manoeuvre{'s' if compared.manoeuvres > 1 else ''}, {speeds}",
        ),
        ("Conditions", _conditions(first)),
    ]
    if found is not None:
        known = [catalogue[name] for name in found.selected if name in catalogue]
        chosen = [row for row in found.ranking_table().rows if str(row[0]).startswith("* ")]
        sure = [
            f"{name[2:]} removes {removed}"
            + (f" ± {error:.1f} %" if error is not None else "")
            + f" of the excess; chance alone does so with p {p}."
            for name, removed, error, p, _ in chosen
        ]
        facts.append(("How sure", " ".join([f"{found.certainty.count}.", *sure])))
        facts += [(effect.id, _physics(effect)) for effect in known]
        facts.append(("Or the setup", "; ".join(map(suspect_sentence, found.suspects))))
    facts += [("Where it fails", where(first)), ("Mind", "; ".join(remarks[:_SHOWN]) + more)]
    return [(term, text) for term, text in facts if text]


def _conditions(result: Comparison) -> str:
    """What the setups say, from the least to the most."""
    said = []
    for key in SETUP_KEYS:
        known = [row[key] for row in result.tables["conditions"] if np.isfinite(row[key])]
        if known:
            condition = CONDITIONS[key]
            scale, unit = (1e-3, "kPa") if condition.unit == "Pa" else (1.0, condition.unit)
            ends = dict.fromkeys(f"{value * scale:.4g}" for value in (min(known), max(known)))
            said.append(f"{condition.name or condition.symbol} {' to '.join(ends)} {unit}")
    return "; ".join(said)


def _physics(effect: Effect) -> str:
    return f"{effect.mechanism}: {effect.signature}" if effect.signature else effect.mechanism


def _rungs(
    compared: Comparison, found: Diagnosis | None, catalogue: Mapping[str, Effect], factor: float
) -> list[Rung]:
    """The models on the way to the best one."""

    def rung(name: str, said: str, one: Comparison) -> Rung:
        error = one.rmse if one.rmse_heldout is None else one.rmse_heldout
        floor = one.noise_floor * factor
        return {"name": name, "said": said, "error": error * factor, "floor": floor}

    rungs = [rung("your model", "", compared)]
    if found is None:
        return rungs
    if came_in := found.found.came_in:
        said = "; ".join(NUISANCES_SAID[name] for name in came_in)
        rungs.append(rung(f"+ {' and '.join(came_in)}", said, found.before))
    if found.selected:
        known = (catalogue[name].mechanism for name in found.selected if name in catalogue)
        rungs.append(rung(f"+ {' and '.join(found.selected)}", "; ".join(known), found.after))
    else:  # the floor of the verdict
        rungs[-1]["floor"] = found.noise_floor * factor
    return rungs


def _first_and_best(
    compared: Comparison, found: Diagnosis | None, colours: LogColours
) -> list[Figure]:
    """What the first and the best model leave, at one scale, and the best one's waveforms."""
    added = () if found is None else (*found.found.came_in, *found.selected)
    models = [compared] if found is None or not added else [compared, found.after]
    models = [one.parts[0] if one.parts else one for one in models]
    has = ", ".join(effect.id for effect in models[0].model.effects)
    named = [f"the first model{', with ' if has else ''}{has}"]
    named += [f"the best model, with {', '.join(added)} added"] * bool(added)
    panels, several = before_and_after(models), len(models) > 1
    titles = [f"Left by {name}" for name in named] if len(panels) > 1 else []
    titles.append(f"What {' and '.join(named)} leave")
    said = f"Measured less predicted {compared.observable.replace('_', ' ')}"
    figures = [
        figure(f"answer-left-{i}", title, f"{said}: {panel.title}.", panel, half=several and i < 2)
        for i, (title, panel) in enumerate(zip(titles, panels, strict=True))
    ]
    return figures + (waves(models[-1], colours, "answer-") if several else [])


def waves(result: Comparison, colours: LogColours, prefix: str = "") -> list[Figure]:
    """Waveforms, measured and predicted, and what is left of them."""
    looks, said = styles(result.waveforms.logs, colours), "; ".join(result.waveforms.labels)
    return [
        figure(
            f"{prefix}waveforms",
            "Waveforms",
            "Measured means of similar revolutions (points), the model (lines) and two noise "
            f"floors about it (bands) at {said}; dashed lines: the patch's edges.",
            waveforms(result, looks),
            height=520,
        ),
        figure(
            f"{prefix}differences",
            "What the model leaves of these waveforms",
            f"Measured less predicted {result.observable} of the same waveforms, with two noise "
            "floors as bands about zero.",
            differences(result, looks),
            height=460,
        ),
    ]


def _sentence(text: str) -> str:
    """The text with its first letter as a sentence begins."""
    return f"{text[:1].upper()}{text[1:]}"


def comparisons(
    result: Comparison, command: str, colours: LogColours | None = None
) -> list[Section]:
    """The section of a comparison; of several observables one of all, and one of each."""
    colours = log_colours(logs_of(result)) if colours is None else colours
    if not result.parts:
        return [comparison(result, command, colours)]
    words = [
        f"{result.observable} of one wheel are fitted together, each by its own noise; "
        f"{result.revolutions} revolutions, {result.manoeuvres} manoeuvres.",
        result.agreement,
        *map(_sentence, filter(None, [result.nuisances_sentence()])),
        *(f"{remark}." for remark in result.remarks),
    ]
    tables = [result.together_table(), result.parameters_table()]
    title = "Several observables in one fit"
    found = [Section("model", title, command, words, (), tables)]
    for part in result.parts:
        own = comparison(part, command, colours)
        figures = [replace(f, id=f"{f.id}-{part.label}") for f in own.figures]
        named = f"{own.title}: {part.label if part.member else part.label.replace('_', ' ')}"
        found.append(replace(own, id=f"{own.id}-{part.label}", title=named, figures=figures))
    return found


def comparison(result: Comparison, command: str, colours: LogColours) -> Section:
    """The section of a comparison of model and logs.

    Errors beside the floor, waveforms with the floor's band, residual over angle and speed, and
    angle and time.
    """
    factor, _ = shown(result.observable, result.unit)
    words = [
        f"{_sentence(result.headline)}, excess {in_unit(result.excess_heldout, factor)}. On the "
        f"data of the fit: {result.rmse * factor:.3g}. Reduced chi-square "
        f"{result.reduced_chi2:.3g}.",
        *map(_sentence, filter(None, [result.nuisances_sentence()])),
        where(result),
        *result.floor_sentences(),
        *(f"{remark}." for remark in result.remarks),
    ]
    maps = [
        figure(
            f"residual-{name}",
            f"Residual over angle and {name}",
            f"Measured less predicted {result.observable} as colour, blue below and red above "
            f"zero, over the wheel angle and {name} from {map_.axis.min():.4g} to "
            f"{map_.axis.max():.4g}.",
            residual_map(map_, result),
        )
        for name, map_ in (("speed", result.by_speed), ("time", result.by_time))
    ]
    tables = [result.errors_table(lambda log: Path(log).name), result.parameters_table(fixed=True)]
    title = "The model against the measurement"
    return Section("model", title, command, words, [*waves(result, colours), *maps], tables)


def where(result: Comparison) -> str:
    """Where the map of the residual is largest, and at which speed and regime the excess is."""
    factor, unit = shown(result.observable, result.unit)
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


def diagnosis(result: Diagnosis, command: str) -> Section:
    """The section of a diagnosis: what the command's answer says, and the ranking as a figure."""
    tables, said = result.below()
    verdict = f"{result.verdict.replace('_', ' ').capitalize()}. {result.headline}"
    words, ranked = [verdict, *map(_sentence, said)], result.effects
    if not ranked:
        return Section("diagnosis", "The diagnosis", command, words, (), tables)
    best = ", ".join(f"{c.effect} {100 * c.excess_removed:.1f} %" for c in ranked[:5])
    alt = (
        f"Share of the excess that each effect removes alone: {best}. Error bars, one standard "
        "error, where the effect was refitted."
    )
    panel = ranked_panel(ranked, removed_errors(result.found), (INK, PALE))
    height = 140 + 24 * len(ranked)
    drawn = figure("ranking", "Which effect is missing", alt, panel, height=height)
    return Section("diagnosis", "The diagnosis", command, words, [drawn], tables)


def ladder_section(climbed: Mapping[str, Any], command: str) -> Section:
    """The error falling to the floor, from the last ladder that its command kept."""
    factor, unit = shown(climbed["observable"], climbed["unit"])
    taken = [step for step in climbed["steps"] if step["outcome"] != "not_added"]
    held = [in_unit(step["rmse_heldout"], factor) for step in taken]
    fallen = (
        f"Held-out error {' → '.join(held)} {unit}: {', '.join(s['effect'] for s in taken)}; "
        f"noise floor of the last model {taken[-1]['noise_floor'] * factor:.3g}."
    )
    logs = ", ".join(Path(str(log)).name for log in climbed.get("logs") or ())
    on = f"Climbed on {climbed.get('manoeuvres')} manoeuvres{f' of {logs}' if logs else ''}."
    words = [fallen, on, *(step["sentence"] for step in climbed["steps"])]
    words += [f"{remark}." for remark in climbed.get("remarks", ())]
    if climbed.get("rmse_untouched") is not None:
        words.append(
            f"On manoeuvres reserved for the end: {climbed['rmse_untouched'] * factor:.3g} "
            f"{unit}, floor there {climbed['floor_untouched'] * factor:.3g}."
        )
    panel = climbed_panel(climbed, (PALE, INK, INK, GREY))
    drawn = figure("ladder-steps", "The error falling to the floor", fallen, panel)
    return Section("ladder", "The ladder", command, words, [drawn], [steps_table(climbed)])


def obstacles(result: TransientComparison, command: str) -> Section:
    """What obstacles added, and what of it the model misses, hit by hit."""
    said = f"{_sentence(str(result.page()[0]))}. They are kept apart from the steady revolutions."
    words = [said, *(f"{remark}." for remark in result.remarks)]
    table = result.hits_table(lambda log: Path(log).name)
    return Section("obstacles", "Obstacles", command, words, (), [table])
