"""An answer about logs and a model: one frozen record, which everybody renders, and its words.

    Comparison, Diagnosis, Ladder, Proposal, FitOfLogs, TireForm
        headline, tables, sentences  -> terminal, notebook, page
        figure                       -> file, notebook
        to_json                      -> programs

Numbers of a table stand in the unit in which a person reads them; whoever shows one rounds them.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from math import isfinite, sqrt
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.diagnosis.candidates.assessment import least_p
from tirelog.diagnosis.rules import QUIET_FLOORS
from tirelog.physics.effects import Effect
from tirelog.physics.model.model import Model
from tirelog.tables.writer import document, table
from tirelog.vocabulary.conditions import CONDITIONS, SETUP_KEYS
from tirelog.vocabulary.observables import OBSERVABLES, WAVEFORMS, shown

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: the module of the pictures, which loads a library of plots: only when one is drawn
PICTURES = "tirelog.plots.answers"


@dataclass(frozen=True)
class AnswerTable:
    """A small table to read: words and numbers, None for nothing.

    colours   of each row the number of its colour in the figures, if they stand for something there
    """

    caption: str
    names: Sequence[str]
    rows: Sequence[Sequence[Any]]
    colours: Sequence[int] = ()

    def columns(self, *names: str) -> AnswerTable:
        """The table with these columns alone."""
        at = [self.names.index(name) for name in names]
        return AnswerTable(self.caption, names, [[row[i] for i in at] for row in self.rows])


class AnswerRecord:
    """What every answer has: a headline, tables and sentences below it, and a figure.

    `picture` and `panel`: functions of `plots.answers` that take the answer: its figure,
    and the main panel of that. `apart`: fields that stand in no JSON.
    """

    picture: ClassVar[str]
    panel: ClassVar[str]
    apart: ClassVar[tuple[str, ...]] = ("model",)

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        raise NotImplementedError

    def below(self) -> tuple[Sequence[AnswerTable], Sequence[str]]:
        """What a notebook shows below the headline: tables, and sentences."""
        return (), ()

    def to_json(self) -> dict[str, Any]:
        """The answer as plain values by name (`record_fields`)."""
        return record_fields(self)

    def plot(self, path_or_axes: str | Path | Axes | None = None) -> Any:
        """The figure.

        path_or_axes  a file to write it to as well (.png, .svg, .pdf), or axes that get its main
                      panel alone

        UsageError: no picture has the path's suffix.
        """
        if path_or_axes is not None and not isinstance(path_or_axes, str | Path):
            panel = resolve_name(f"{PICTURES}:{self.panel}")(self)
            resolve_name("tirelog.plots.record:draw_panel")(path_or_axes, panel)
            return path_or_axes.figure
        figure = resolve_name(f"{PICTURES}:{self.picture}")(self)
        if path_or_axes is not None:
            resolve_name("tirelog.plots.record:write")(figure, Path(path_or_axes))
        return figure

    def draw(self, path: Path) -> list[Path]:
        """The pictures as files: the first at `path`; those beside it come back."""
        self.plot(path)
        return []

    def __repr__(self) -> str:
        return self.headline

    def _repr_html_(self) -> str:
        tables, sentences = self.below()
        return document(self.headline, [table(t.names, t.rows) for t in tables], sentences)


def in_unit(error: float | None, factor: float) -> str:
    """An error to read, times `factor`; a dash if there is none."""
    return "-" if error is None else f"{error * factor:.3g}"


def excess_of(rmse: float, floor: float) -> float:
    """sqrt(rmse^2 - floor^2), zero if the error lies below the floor."""
    return float(np.sqrt(max(rmse**2 - floor**2, 0.0)))


def record_fields(record: Any) -> dict[str, Any]:
    """A dataclass as plain values by name: its fields but those `apart`, and those in `also`.

    What is in `also` are properties.
    """
    names = (*(own.name for own in fields(record)), *getattr(record, "also", ()))
    apart = getattr(record, "apart", ())
    return plain_fields({name: getattr(record, name) for name in names if name not in apart})


def plain_fields(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values by name as JSON takes them (`plain_values`)."""
    return {str(name): plain_values(value) for name, value in values.items()}


def plain_values(value: Any) -> Any:
    """The same without numpy types, tuples as lists, not-a-number and infinity as None.

    A dataclass becomes what its `to_json` says, or its `record_fields`.
    """
    if is_dataclass(value):
        return value.to_json() if hasattr(value, "to_json") else record_fields(value)
    if isinstance(value, Mapping):
        return plain_fields(value)
    if isinstance(value, list | tuple):
        return [plain_values(v) for v in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain_values(value.tolist())
    return None if isinstance(value, float) and not isfinite(value) else value


# ---- Sentences: facts of a diagnosis in, text out.
#
# The only place where a diagnosis is put into words.


# Printed with every diagnosis, since no statistic can.
#
# conditions of the cells, the catalogue's `follows`
#     -> one sentence, or none if everything that effects follow varies


def not_varied(conditions: Conditions, effects: Sequence[Effect]) -> str:
    """The sentence, '' if there is nothing to say."""
    parts: dict[str, list[str]] = {"constant": [], "not known": []}
    who = dict[str, None]()
    for field in SETUP_KEYS:
        followers = [e.id for e in effects if field in [name for name, _ in e.followed]]
        values, condition = getattr(conditions, field), CONDITIONS[field]
        known = bool(np.isfinite(values).all())
        # a range below this share of the largest value is none: what follows the square of it then
        # changes by 4 %; doubled, by 8 %
        if not followers or (known and np.ptp(values) > 0.02 * np.abs(values).max()):
            continue
        value = f" {np.mean(values):.6g} {condition.unit}" if known else ""
        parts["constant" if known else "not known"].append(f"{condition.name}{value}")
        who |= dict.fromkeys(followers)
    said = "; ".join(f"{word}: {', '.join(names)}" for word, names in parts.items() if names)
    if not who:
        return ""
    return (
        f"{_capital(said)}. Effects that follow them ({', '.join(who)}) can be recognised only by "
        "their shape. Add logs with other values."
    )


_WHERE = {
    "entry": "at the entry edge",
    "patch": "in the patch",
    "exit": "behind the exit edge",
    "away": "away from the patch",
}
_SHAPELESS = "is not shown to repeat from manoeuvre to manoeuvre, or is too small to matter"
#: wrong conditions look like missing physics, and are likelier
FIRST_CHECK = "First check what the setups say of load, pressure, water depth and radius."
#: nuisances as a part of a sentence
NUISANCES_SAID = {
    "wheel": "the wheel's own run-out and force variation",
    "drift": "a drift",
    "rolling": "another rolling radius",
    "patch_law": "another patch law",
    "pressure_law": "another law of the pressure",
    "form": "a form of its own",
}
_PARITY = {
    "even": "even about the patch centre",
    "odd": "odd about the patch centre",
    "mixed": "neither even nor odd",
}


#: the verdict in one sentence, by its kind
_SENTENCES = {
    "nothing_missing": "Nothing is missing that this data could show: what the model{beside} leaves"
    " is the noise floor{above}.",
    "nothing_else": "{taken}; nothing else is missing that these data could show{above}.",
    "scatter": "{before}What is left {repeats} from manoeuvre to manoeuvre, and is more than "
    "noise: {size} ({errors}).{like_load}{goes_with} {check}",
    "small": "What is left repeats, but is too small to matter: {errors}. {check}",
    "too_few": "Too few manoeuvres for a test ({manoeuvres}): candidates are ranked, none is "
    "claimed.",
    "unknown": "{lacks}. No effect of the catalogue explains it. {check}",
    "unknown_and_near": "{lacks}. No effect of the catalogue explains it; the nearest, {nearest}, "
    "explains {near}. {check}",
    "unknown_and_doubt": "{lacks}. {nearest} would explain {near} of the excess, but "
    "{doubt}, so none is named. {check}",
    "ambiguous": "Missing is {sets}: these data do not decide which; {each}.",
    "or_nuisance": "{missing}, or {places}: these data do not decide which; {removes} of "
    "the excess.",
    "partial": "{explains} repeats{where} and has no name yet. {check}",
    "shapeless": f"{{explains}} has no name: {_SHAPELESS}. {{check}}",
    "form": "{explains} repeats and is within what a somewhat different form of {names} would "
    "leave. {check}",
    "missing": "{missing}: {removes} of the excess.",
    "missing_and_scatter": "{missing}: {removes} of the excess that repeats; {left} beside it do "
    "not repeat from manoeuvre to manoeuvre. {check}",
}


def sentence_of(facts: Mapping[str, Any]) -> str:
    """The verdict in one sentence; what is no physics first if conditions may be wrong."""
    names, one, share = " and ".join(facts["selected"]), len(facts["selected"]) == 1, facts["share"]
    before, floor, scatter, left = (facts[n] for n in ("before", "floor", "scatter", "unexplained"))
    factor, unit = shown(facts["observable"], facts["unit"])
    squares = max(before, 0.0) / floor if floor > 0.0 else 0.0
    floors, above = sqrt(squares), ""
    if floors > QUIET_FLOORS:
        above = (
            f"; held out it is {floors:.3g} floors, no more than {facts['manoeuvres']} manoeuvres "
            "leave uncertain in its parameters"
        )
    beside = " and ".join(NUISANCES_SAID[name] for name in facts["beside"])
    suspected = "; or ".join(facts["suspects"])
    rest = "partial" if left.get("significant") else "shapeless"
    nearest, near = left.get("nearest_effect"), left.get("nearest_share") or 0.0
    unnamed = "unknown_and_near" if near < facts["enough"] else "unknown_and_doubt"
    of_nuisances, by_nuisances = facts["taken"]
    taken = (
        f"{_capital(' and '.join(by_nuisances))} {'explain' if by_nuisances[1:] else 'explains'} "
        f"{percent(of_nuisances)} of the excess"
        if by_nuisances
        else ""
    )
    kinds = {
        "nothing_missing": "nothing_else" if taken else "nothing_missing",
        "unknown": unnamed if nearest else "unknown",
        "scatter": "small" if left.get("significant") else "scatter",
        "ambiguous": "ambiguous" if facts["groups"] else "or_nuisance",
        "partial": "form" if share >= 0.9 else rest,
        "missing": "missing" if facts["total"] >= facts["explained"] else "missing_and_scatter",
    }
    return _SENTENCES[kinds.get(facts["verdict"], facts["verdict"])].format(
        names=names,
        missing=f"{names} {'is' if one else 'are'} missing",
        removes=f"{'it removes' if one else 'they remove'} {percent(share)}",
        explains=f"{names} {'explains' if one else 'explain'} {percent(share)} of the excess; the "
        f"other {percent(1 - share)}",
        manoeuvres=facts["manoeuvres"],
        lacks="The model misses something that repeats: "
        f"{sqrt(max(squares - 1.0, 0.0)):.2g} times the noise floor",
        nearest=nearest,
        near=percent(near),
        doubt="its strength does not differ from zero here"
        if nearest in facts["unestablished"]
        else "that is not beyond doubt",
        errors=f"held out {floors:.2f} floors, reduced chi-square {facts['chi2']:.3g}",
        above=above,
        beside=f" with {beside} beside it" if beside else "",
        taken=taken,
        before=f"{taken}. " * bool(taken),
        left=f"{max(facts['after'] - floor, 0.0) ** 0.5 * factor:.3g} {unit}",
        where=f" {_WHERE[left['where']]}" if left.get("where") else "",
        sets="; ".join(" or ".join(group) for group in facts["groups"]),
        each=", ".join(
            f"{name} removes {percent(facts['shares'][name])} of the excess"
            for group in facts["groups"]
            for name in group
            if name in facts["shares"]
        ),
        places=" and ".join(
            f"in place of {effect} {NUISANCES_SAID[nuisance]}"
            for nuisance, effect in facts["or_nuisance"]
        ),
        check=f"Or the conditions are wrong: {suspected}." if suspected else FIRST_CHECK,
        size=f"{scatter['size'] * factor:.3g} {unit}" if scatter else "",
        repeats="is not shown to repeat" if scatter and scatter["follows"] else "does not repeat",
        like_load=" It looks like a load that changes." * bool(scatter and scatter["like_load"]),
        goes_with=_goes_with(scatter) if scatter else "",
    )


def _capital(text: str) -> str:
    """The text with its first letter as a sentence begins."""
    return text[:1].upper() + text[1:]


def _goes_with(scatter: Mapping[str, Any]) -> str:
    """What goes with what does not repeat."""
    follows, grows = scatter["follows"], scatter["grows"]
    if not follows:
        return " Nothing that the logs hold is found to go with it."
    if follows.startswith("log "):
        log = int(follows[4:]) + 1
        return f" It is {'larger' if grows else 'smaller'} in log {log} than in the others."
    return f" It {'grows' if grows else 'falls'} with {follows}{_or_those(scatter['together'])}."


def percent(share: float) -> str:
    """A share as the table of the ranking prints it."""
    return f"{100.0 * share:.1f} %"


def probability(p: float, manoeuvres: int) -> str:
    """A p-value for a reader.

    If it is the least that so many manoeuvres allow, it is at most that.
    """
    return f"<= {p:.2g}" if p <= 2.0 * least_p(manoeuvres) else f"{p:.2g}"


def strengths(found: Mapping[str, Mapping[str, Any]], most: int | None = None) -> str:
    """Strengths with their errors; a dash without a refit: a linear step may be no physics."""
    parts = []
    for name, s in list(found.items())[:most]:
        if s["se"] is None:
            return "-"
        error = f"+- {s['se']:.2g}" if isfinite(s["se"]) else "(correlated)"
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


def separation_sentence(row: Mapping[str, Any]) -> str:
    """A manoeuvre that parts rivals."""
    times = "once" if row["repeats"] == 1 else f"{row['repeats']} times"
    return (
        f"to part {' from '.join(row['separates'])}: {row['manoeuvre']}, {times} "
        f"({row['separation_sigma']:.1f} sigma a run)"
    )


def rounding_sentences(observable: str, held: float, floor: float, rounding: float) -> list[str]:
    """What to say, if anything, of mean squares beside what rounding leaves in single values."""
    factor, unit = OBSERVABLES[observable].shown_factor, OBSERVABLES[observable].shown_unit
    size = f"{rounding**0.5 * factor:.3g} {unit}"
    # an error is below what rounding leaves from this share of its mean square on: 5 % in size,
    # more than chance does on a short log. Half of it would pass copied values by
    if rounding > 0.0 and min(held, floor) < 0.9 * rounding:
        return [
            f"the held-out error is {max(held, 0.0) ** 0.5 * factor:.3g} {unit} at a floor of "
            f"{floor**0.5 * factor:.3g}, and the steps of the values alone leave {size}. "
            "Samples are not independent: the noise is far below a step, or values were copied, "
            "interpolated or made. The error does not measure the model then; log finer steps"
        ]
    # share of the floor's mean square from which on rounding is named; doubling it would name it
    # never
    if rounding > 0.5 * floor:
        return [
            f"{percent(rounding / floor)} of the floor's mean square is rounding: the steps of the "
            f"values leave {size}. Smaller changes are not seen; log finer steps"
        ]
    return []


def unexplained_sentence(facts: Mapping[str, Any], few: bool) -> str:
    """What remains, in physical words."""
    if few:
        return "Whether what remains repeats cannot be tested on so few manoeuvres."
    if not facts["significant"]:
        return f"What remains {_SHAPELESS}."
    if facts.get("contradicts"):
        return (
            f"What remains repeats: {facts['observable']} contradicts the others on what they "
            "share."
        )
    rings, in_time, where = facts["frequency_Hz"], facts["in_time"], facts["where"]
    parts = (
        f"in {facts['observable']}" if facts.get("observable") else "",
        _WHERE[where] if where else "",
        _PARITY[facts["parity"]] if where and not in_time else "",
        _following(facts),
        "fixed in the time since that edge" if in_time and not rings else "",
        "as a change of the contact pressure would be"
        if facts["in_pressure"] and not rings
        else "",
    )
    said = f"What remains repeats: {', '.join(filter(None, parts))}."
    if facts["nearest_effect"]:
        share = percent(facts["nearest_share"])
        said += f" The nearest effect is {facts['nearest_effect']}: {share} of the excess."
    return said


def _following(facts: Mapping[str, Any]) -> str:
    """What a remainder follows, with what went along with it; "" if that is not known."""
    follows = str(facts["follows"] or "")
    if facts["frequency_Hz"]:
        return f"ringing at {facts['frequency_Hz']:.0f} Hz, fixed in time"
    if follows == "nothing":
        return "much the same at every speed"
    if facts["speed_exponent"] is not None:
        return f"growing as speed to the power {facts['speed_exponent']:g}"
    if follows.startswith("log "):
        return f"other in log {int(follows[4:]) + 1} than in the others"
    return f"following {follows}{_or_those(facts['together'])}" if follows else ""


def _or_those(along: Sequence[str]) -> str:
    """What moved together with a quantity, so that it could be any of them."""
    return f" (or {' or '.join(along)}, which went along with it)" if along else ""


def next_command(
    verdict: str,
    selected: Sequence[str],
    *,
    model: Model,
    logs: Sequence[str],
    beside: Sequence[str] = (),
    large_rest: bool = False,
    grating: str = "",
) -> str:
    """The command to type next.

    `beside`: nuisances that the model does not ask for yet; `large_rest`: something of size repeats
    beside what is named; `grating`: one of several that were asked, for what takes one alone.
    """
    file = str(model.path) if model.path else "MODEL.toml"
    stem = file.removesuffix(".toml")
    file = shlex.quote(file)
    own = f" --effects {shlex.quote(str(model.effects_file))}" if model.effects_file else ""
    # more logs than these are not spelled out in a command; twice as many make a line that few
    # terminals show whole
    given = shlex.join(logs) if len(logs) <= 12 else "LOG..."
    # a shape is sought in one waveform: `propose` refuses a model of several observables
    one_waveform = model.observable in WAVEFORMS and len(model.observables) == 1
    if (verdict == "unknown" or large_rest) and one_waveform:
        one = f" --channel {shlex.quote(grating)}" if grating else ""
        better = shlex.quote(f"{stem}+proposed.toml")
        return f"tirelog propose {given} --model {file}{own} -o {better}{one}"
    if (verdict in ("missing", "partial", "ambiguous") and selected) or beside:
        adds = []
        parts = [("add", name, name) for name in selected]
        parts += [("set", name, f"{name}=on") for name in beside]
        for word, name, change in parts:
            stem = f"{stem}+{name}"
            longer = shlex.quote(f"{stem}.toml")
            adds.append(f"tirelog model {word} {file} {change}{own} -o {longer}")
            file = longer
        return " && ".join([*adds, f"tirelog model fit {given} --model {file}{own} -o {file}"])
    compare = f"tirelog compare {given} --model {file}{own}"
    if verdict == "too_few":
        return f"tirelog diagnose {given} MORE_LOGS --model {file}{own}"
    return f"{compare} --plot residual.png" if verdict in ("unknown", "scatter") else compare
