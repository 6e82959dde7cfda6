"""What comparisons, diagnoses and ladders give.

Frozen values, JSON by `to_json`, arrays beside for plots and pages.

`Comparison` carries waveforms with the floor's band and the residual as maps; a page that shows it
computes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite
from pathlib import Path, PurePath
from pkgutil import resolve_name
from typing import Any, ClassVar

import numpy as np
from scipy.special import chdtrc

from tirelog.data.recording import Conditions
from tirelog.diagnosis.answer import (
    NUISANCES_SAID,
    PICTURES,
    AnswerRecord,
    AnswerTable,
    in_unit,
    percent,
    plain_fields,
    record_fields,
    strengths,
)
from tirelog.diagnosis.obstacles import TransientComparison
from tirelog.diagnosis.rules import ALARM_P, LEAST_SHARE_OF_FLOOR
from tirelog.errors import UsageError, refuse_unknown
from tirelog.inference.base import Base, bases_by_observable
from tirelog.inference.fit.cells import NULL, errors_of
from tirelog.inference.metric import Offsets
from tirelog.physics.model.model import Model
from tirelog.storage.whole import json_of, open_input
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import shown
from tirelog.vocabulary.tables import BY_OBSTACLE, ERRORS_BY

Rows = list[dict[str, Any]]
#: the errors of a comparison, in the order in which they are shown
ERRORS = ("rmse_heldout", "rmse", "noise_floor", "reduced_chi2")
#: and of a step of a ladder
_STEP_ERRORS = ("rmse_fit", "rmse_heldout", "noise_floor", "excess_heldout")
_ABOVE = "above scatter"


#: caption of the table that says how wrong a model is
_EXTRA = "Least error beside the noise floor at which model and data agree, each by itself"
_CHECKS = "Residuals beside noise"


@dataclass(frozen=True)
class Waveforms:
    """Some cells to look at: measured, predicted, floor.

    (k, m) each, in the observable's unit at angles phi (k, m) [rad]; `labels` (k,), which end with
    the file names of the `logs` (k,); `conditions` that each is driven under.
    """

    phi_rad: FloatArray
    measured: FloatArray
    predicted: FloatArray
    floor: FloatArray
    labels: tuple[str, ...]
    logs: tuple[str, ...]
    conditions: Conditions


@dataclass(frozen=True)
class Map:
    """The residual over an axis (speed [m/s] or time [s], ascending, (k,)) and the angle (m,).

    `residual` is in the observable's unit, `whitened` in standard errors; both are (k, m), NaN if
    there is nothing. Over the time of several logs, one after the other, each but the first begins
    at one of `begins`.
    """

    axis: FloatArray
    axis_name: str
    phi_rad: FloatArray
    residual: FloatArray
    whitened: FloatArray
    begins: tuple[float, ...] = ()


def _size_or_more(own: Mapping[str, Any]) -> float:
    """The size of an extra error; one that no size removes is the largest."""
    return float("inf") if own["size"] is None else float(own["size"])


def _extra_row(own: Mapping[str, Any]) -> list[Any]:
    """A row of the table of extra errors, in the unit in which a person reads it."""
    of, name, size = (own[key] for key in ("of", "name", "size"))
    if of in ("zone", "parameter"):
        name = "change of " * (of == "parameter") + name
    else:
        name = f"worst {of}: {PurePath(name).name if of == 'log' else name}"
    if size is None:
        return [name, "no size does", ""]
    factor, unit = (100.0, "%") if of == "parameter" else shown(own["observable"], own["unit"])
    return [name, size * factor, unit]


@dataclass(frozen=True, repr=False)
class Comparison(AnswerRecord):
    """A fitted model against logs.

    Errors in the observable's unit, for one revolution's value at one angle.

    rmse          on the revolutions of the fit
    rmse_heldout  on manoeuvres that the fit had not seen, each left out in its turn; None if there
                  is but one
    noise_floor   what scatter alone leaves; its part `within` manoeuvres depends on the data alone,
                  that `between` like manoeuvres on the model too: a worse one takes some of its
                  misfit for scatter, so `excess` cannot rank models; `excess_heldout_within` can
    reduced_chi2  per degree of freedom, against noise and scatter alone, of the fitted point

    `with_nuisances`: these errors beside the `nuisances` that earn a place and that the model does
    not have; None if none does.

    excess        the error above the floor, what a better model could still remove on the data of
                  the fit; `excess_heldout` on manoeuvres held out
    excess_within the error above what repeats within manoeuvres, which no model has a say in;
                  by `excess_heldout_within` models of one log can be ranked

    `tables`: rows by angle, speed, regime, conditions; `by_revolution` gives those of a revolution
    each, some at a time, since all are many. `half_angle_rad` is the patch's half length as an
    angle.

    If several observables or gratings (`member`) are fitted together, errors are in their noise
    floors. `parts` has the comparison of each in its own unit, with its tables. `contributions` is
    what each contributes, `agreement` whether they contradict each other. Waveforms and maps are
    those of the first.

    `extra_errors`: how much error beside the noise makes model and data agree; `checks`: how far
    the residuals are from noise; `ranking`: the model among others on the same logs; `learnt`: what
    a residual that is learnt would gain, if asked. All are empty in what `comparison_of` makes.

    `obstacles`: errors hit by hit, None without a [road] or with a model that does not move;
    `aside`: remarks on what was not compared.
    """

    picture = "compare_figure"
    panel = "waveforms"
    apart = (
        *("model", "tables", "by_revolution", "waveforms", "by_speed", "by_time", "member"),
        *("half_angle_rad", "parts", "contributions", "agreement", "obstacles", "aside"),
    )

    observable: str
    unit: str
    model: Model
    rmse: float
    rmse_heldout: float | None
    noise_floor: float
    noise_floor_within: float
    noise_floor_between: float
    excess: float
    excess_heldout: float | None
    excess_within: float
    excess_heldout_within: float | None
    reduced_chi2: float
    fit_percent: float
    revolutions: int
    manoeuvres: int
    parameters: Mapping[str, Mapping[str, Any]]
    tables: Mapping[str, Rows]
    by_revolution: Callable[[], Iterator[Rows]]
    waveforms: Waveforms
    by_speed: Map
    by_time: Map
    half_angle_rad: float
    remarks: tuple[str, ...] = ()
    member: str = ""
    parts: tuple[Comparison, ...] = ()
    contributions: tuple[Contribution, ...] = ()
    agreement: str = ""
    with_nuisances: Mapping[str, Any] | None = None
    obstacles: TransientComparison | None = None
    aside: tuple[str, ...] = ()
    extra_errors: tuple[Mapping[str, Any], ...] = ()
    checks: tuple[Mapping[str, Any], ...] = ()
    ranking: tuple[Mapping[str, Any], ...] = ()
    learnt: tuple[Mapping[str, Any], ...] = ()

    @property
    def label(self) -> str:
        """What it is called beside others: the grating, else the observable."""
        return self.member or self.observable

    def to_json(self) -> dict[str, Any]:
        """The numbers, in the observable's unit; with obstacles their part under `transients`."""
        fields = record_fields(self)
        if self.parts:
            key = "gratings" if all(part.member for part in self.parts) else "observables"
            fields[key] = {part.label: part.to_json() for part in self.parts}
            for known in self.contributions:
                fields[key][known.observable]["contribution"] = record_fields(known)
            fields["agreement"] = self.agreement
        return fields | ({"transients": self.obstacles.to_json()} if self.obstacles else {})

    @property
    def headline(self) -> str:
        """Errors, floor, and how much was measured."""
        factor, unit = shown(self.observable, self.unit)
        return (
            f"{self.observable} in {unit}: {self._measured}, held-out error "
            f"{in_unit(self.rmse_heldout, factor)}, noise floor {in_unit(self.noise_floor, factor)}"
        )

    def below(self) -> tuple[list[AnswerTable], list[str]]:
        """Errors and parameters; nuisances, agreement, and what a reader should know."""
        errors = self.together_table() if self.parts else self.errors_table()
        said = [text for text in (self.nuisances_sentence(), self.agreement) if text]
        return [errors, self.parameters_table(), *self.wrongness()], [*said, *self.notes]

    def wrongness(self) -> list[AnswerTable]:
        """How wrong the model is: its rank, extra errors, what a learnt residual gains."""
        factor, unit = shown(self.observable, self.unit)
        ranks = [
            [r["model"], in_unit(r["rmse_heldout"], factor), r["above_scatter"] * factor]
            + [r["sigmas"], r["reduced_chi2"], r["free"]]
            for r in self.ranking
        ]
        extra = [_extra_row(own) for own in self._worst_errors() if own["size"] != 0.0]
        residuals = [
            [c["name"], c["measured"], f"{c['low']:.3g} to {c['high']:.3g}"] for c in self.checks
        ]
        learnt = [
            [r["learns"], in_unit(r["rmse_heldout"], shown(r["observable"], "")[0])]
            + [percent(r["excess_removed"]), r["sigmas"], r["weights"]]
            for r in self.learnt
        ]
        names = ["model", "held out", _ABOVE, "sigma worse", "chi-square", "free parameters"]
        tables = (
            AnswerTable(f"Models on the same logs, best first [{unit}]", names, ranks),
            AnswerTable(_EXTRA, ["", "at least", "unit"], extra),
            AnswerTable(_CHECKS, ["residuals", "measured", "noise gives"], residuals),
            AnswerTable(
                f"What a learnt residual gains [{unit}]; it names no effect",
                ["learns over", "held out", "excess removed", "sigma better", "weights"],
                learnt,
            ),
        )
        return [table for table in tables if table.rows]

    def page(self) -> list[str | AnswerTable]:
        """What a terminal shows: errors, where they are, parameters; of several what each brings.

        Of logs that met an obstacle also what the model says of each hit.
        """
        head = f"{self.observable}, fitted together, in {self.unit}: {self._measured}"
        together = [head, self.together_table(), self.agreement] if self.parts else []
        page = [*(together or self._errors_page()), self.parameters_table()]
        if not all(part.member for part in self.parts):
            page.append("without an observable: the error that the others alone would leave")
            page += [line for part in self.parts for line in ("", *part._errors_page())]
        page += filter(None, [self.nuisances_sentence()])
        page += [part for table in self.wrongness() for part in (table.caption, table)]
        return page if self.obstacles is None else page + self.obstacles.page()

    def _worst_errors(self) -> list[Mapping[str, Any]]:
        """The extra errors of zones and parameters, and the largest of each kind of condition."""
        kinds: dict[tuple[str, ...], list[Mapping[str, Any]]] = {}
        for own in self.extra_errors:
            name = own["name"] if own["of"] in ("zone", "parameter") else ""
            kinds.setdefault((own["of"], own["observable"], name), []).append(own)
        return [max(alike, key=_size_or_more) for alike in kinds.values()]

    @property
    def _measured(self) -> str:
        return f"{self.revolutions} revolutions, {self.manoeuvres} manoeuvres"

    def _errors_page(self) -> list[str | AnswerTable]:
        """The errors of one observable, and where they are."""
        named = f"{self.observable} of {self.member}" if self.member else self.observable
        errors, unit = self.errors_table(), shown(self.observable, self.unit)[1]
        return [
            f"{named} in {unit}: {self._measured}",
            errors.columns(*errors.names[:-1]),
            *self.floor_sentences(),
            f"reduced chi-square {self.reduced_chi2:.3g}, fit {self.fit_percent:.2f} %",
        ]

    def by(self, name: str) -> Iterator[list[dict[str, Any]]]:
        """Rows of the errors by revolution, angle, speed, ... (`ERRORS_BY`), part by part.

        UsageError: no such table, or one of obstacles where there are none.
        """
        refuse_unknown(name, ERRORS_BY, f"no table of errors by {name!r}", do="choose one")
        if name not in BY_OBSTACLE:
            return self._rows(name)
        if self.obstacles is None:
            steady = [word for word in ERRORS_BY if word not in BY_OBSTACLE]
            raise UsageError(
                f"--by {name} is for a coupled_ring model and logs whose setup has a [road]",
                allowed=f"allowed here are {', '.join(steady)}",
                do="choose one, or add the [road]",
            )
        return iter([self.obstacles.rows()])

    def _rows(self, name: str) -> Iterator[Rows]:
        """A table, of several observables under each other, each row with its name and unit."""
        for part in self.parts:
            whose = {"observable": part.observable, "grating": part.member, "unit": part.unit}
            known = {key: value for key, value in whose.items() if value}
            yield from ([known | row for row in some] for some in part._rows(name))
        if not self.parts:
            yield from self.by_revolution() if name == "revolution" else [self.tables[name]]

    def rows(self) -> list[dict[str, Any]]:
        """One row: the numbers of `to_json` that are neither lists nor tables."""
        return [{name: v for name, v in self.to_json().items() if not isinstance(v, dict | list)}]

    def draw(self, path: Path) -> list[Path]:
        """The pictures as files: the first observable's at `path`, of others and of hits beside it.

        Those beside it come back.
        """
        beside: list[Path] = resolve_name(f"{PICTURES}:draw_compare")(self, path)
        if self.obstacles is not None:
            beside.append(path.with_stem(f"{path.stem}_transient"))
            resolve_name(f"{PICTURES}:draw_transient")(self.obstacles, beside[-1])
        return beside

    @property
    def notes(self) -> tuple[str, ...]:
        """All that a reader should know before believing the numbers."""
        hits = self.obstacles.remarks if self.obstacles is not None else ()
        return (*self.aside, *self.remarks, *hits)

    def held_out_errors(self, factor: float) -> list[float | str]:
        """Error, that above `within`, floor and excess on manoeuvres held out; dashes of none."""
        names = ("rmse_heldout", "excess_heldout_within", "noise_floor", "excess_heldout")
        found = [getattr(self, name) for name in names]
        return ["-" if value is None else value * factor for value in found]

    def floor_sentences(self) -> list[str]:
        """Which of the errors rank models, and which depend on the model."""
        factor, _ = shown(self.observable, self.unit)
        within, between = self.noise_floor_within * factor, self.noise_floor_between * factor
        return [
            f"{_ABOVE}: the error above the scatter within manoeuvres, {within:.3g}. That scatter "
            "depends on the data alone, so this column ranks models, held out.",
            f"floor: with the scatter between like manoeuvres, {between:.3g}. That part depends on "
            "the model, since a worse one takes misfit for scatter: do not rank models by excess.",
            "Errors are those of one revolution at one angle.",
        ]

    def errors_table(self, log_name: Callable[[str], str] = str) -> AnswerTable:
        """Errors of a comparison: of all, by angle, speed, regime and log."""
        factor, unit = shown(self.observable, self.unit)
        names = ("rmse", "excess_within", "noise_floor", "excess")
        fitted = [getattr(self, name) * factor for name in names]
        rows: list[list[Any]] = [
            ["all, fitted", *fitted, self.revolutions],
            ["all, held out", *self.held_out_errors(factor), None],
        ]
        for name in ("angle", "speed", "regime", "conditions"):
            for row in self.tables[name]:
                part = (
                    log_name(row["log"])
                    if name == "conditions"
                    else row.get("angle") or row.get("regime") or f"{row['speed_m_s']:g} m/s"
                )
                errors = (row[key] * factor for key in names)
                rows.append([f"  {part}", *errors, row["revolutions"]])
        columns = ["", "rmse", _ABOVE, "floor", "excess", "revolutions"]
        return AnswerTable(f"Where the error is [{unit}]", columns, rows)

    def parameters_table(self, fixed: bool = False) -> AnswerTable:
        """The free parameters as fitted, with the `fixed` ones if asked for.

        Of several observables with the error that the others leave if one is left out.
        """
        gratings = all(part.member for part in self.parts)  # each of similar sensors knows the same
        known = () if gratings else self.contributions

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
            for name, p in self.parameters.items()
            if p["free"] or fixed
        ]
        caption = "Parameters as fitted"
        if known:
            caption += "; without an observable: the error that the others alone would leave"
        without = (f"without {one.observable}" for one in known)
        names = ["parameter", "value", "error", "with form", "unit", *without]
        return AnswerTable(caption, names, rows)

    def together_table(self) -> AnswerTable:
        """Errors of one fit of several observables: of all and of each, each in its unit."""
        rows: list[list[Any]] = [
            ["all", self.rmse, *self.held_out_errors(1.0), self.reduced_chi2, self.unit]
        ]
        for part in self.parts:
            factor, unit = shown(part.observable, part.unit)
            errors = (part.rmse * factor, *part.held_out_errors(factor))
            rows.append([f"  {part.label}", *errors, part.reduced_chi2, unit])
        names = ["", "rmse", "held out", _ABOVE, "floor", "excess", "chi-square", "unit"]
        return AnswerTable("Errors of each observable", names, rows)

    def nuisances_sentence(self) -> str:
        """The errors with the nuisances that earn a place, and without; "" of none."""
        beside = self.with_nuisances
        if beside is None:
            return ""
        factor, unit = shown(self.observable, self.unit)

        def errors(of: Mapping[str, Any]) -> str:
            held, fitted, floor, chi2 = (of[name] for name in ERRORS)
            return (
                f"held out {in_unit(held, factor)} {unit}, fit {fitted * factor:.3g}, noise floor "
                f"{floor * factor:.3g}, reduced chi-square {chi2:.3g}"
            )

        named = " and ".join(NUISANCES_SAID[name] for name in beside["nuisances"])
        without = {name: getattr(self, name) for name in ERRORS}
        return (
            f"with {named} in the fit: {errors(beside)}; without: {errors(without)}. A missing "
            "effect can look like that: `tirelog diagnose` tells which"
        )


@dataclass(frozen=True)
class Candidate:
    """One row of the ranking.

    `strengths`: name -> value, se, unit of the effect's parameters after its refit (or of the
    linear fit).
    """

    effect: str
    rank: int
    excess_removed: float
    p_adjusted: float
    selected: bool
    group: tuple[str, ...]
    statistic: float
    strengths: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


@dataclass(frozen=True)
class LadderStep:
    """One row of a ladder.

    `outcome` is start, added, removed or not_added, `decision` the same with its reason;
    `parameters` name -> value, se, unit.
    """

    step: int
    effect: str
    rmse_fit: float
    rmse_heldout: float | None
    noise_floor: float
    excess_heldout: float | None
    p_adjusted: float | None
    outcome: str
    decision: str
    sentence: str
    parameters: Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True, repr=False)
class Ladder(AnswerRecord):
    """Steps from the base model to the floor, and the model at the top.

    With its error on manoeuvres reserved for the end.

    The errors of the steps are those of `compare` on the `manoeuvres` that the search saw;
    `manoeuvres_locked` others were kept from it, and `rmse_untouched` is the last model's error on
    them.
    """

    picture = "ladder_figure"
    panel = "steps"

    observable: str
    unit: str
    steps: tuple[LadderStep, ...]
    model: Model
    verdict: str
    rmse_untouched: float | None
    floor_untouched: float | None
    revolutions: int
    manoeuvres: int
    logs: tuple[str, ...]
    manoeuvres_locked: int = 0
    remarks: tuple[str, ...] = ()

    def rows(self) -> list[dict[str, Any]]:
        """The table, one dict per step, parameters as `name` and `name_se` columns at the end."""
        result = []
        for step in self.steps:
            row = {name: value for name, value in vars(step).items() if name != "parameters"}
            for name, p in step.parameters.items():
                row |= {name: p["value"], f"{name}_se": p["se"]}
            result.append(plain_fields(row))
        return result

    @property
    def headline(self) -> str:
        """The verdict at the top, and how many steps lead there."""
        return f"{self.verdict.replace('_', ' ')}: {len(self.steps)} steps"

    def below(self) -> tuple[list[AnswerTable], Sequence[str]]:
        """The steps, and what a reader should know."""
        return [steps_table(self.to_json())], self.remarks


def steps_table(climbed: Mapping[str, Any]) -> AnswerTable:
    """The steps of a ladder, as its JSON has them.

    Of each step the parameters that it brought: the first all, a further one what it added.
    """
    factor, unit = shown(climbed["observable"], climbed["unit"])
    rows = []
    for step in climbed["steps"]:
        added = str(step["effect"]).split(" and ")
        own = {
            name: p
            for name, p in step["parameters"].items()
            if step["step"] == 0 or name.split(".")[0] in added
        }
        sizes = ("-" if step[k] is None else step[k] * factor for k in _STEP_ERRORS)
        shares = (step["p_adjusted"], step["decision"], strengths(own))
        rows.append([str(step["step"]), step["effect"], *sizes, *shares])
    errors = [f"{name} [{unit}]" for name in ("fitted", "held out", "floor", "excess")]
    names = ["step", "effect", *errors, "p, adjusted", "decision", "its parameters"]
    return AnswerTable("Steps of the ladder", names, rows)


#: what every step of a ladder's JSON has, as `json_of` takes it
_STEP: dict[str, Any] = {
    "step": int,
    "effect": str,
    "rmse_fit": float,
    "rmse_heldout": float | None,
    "noise_floor": float,
    "excess_heldout": float | None,
    "p_adjusted": float | None,
    "outcome": str,
    "decision": str,
    "sentence": str,
    "parameters": {str: {"value": float, "se": float | None, "unit": str}},
}
_LADDER: dict[str, Any] = {
    "steps": [_STEP],
    "observable": str,
    "unit": str,
    "verdict?": str,
    "logs?": [str],
    "remarks?": [str],
    "manoeuvres?": int,
    "manoeuvres_locked?": int,
    "rmse_untouched?": float | None,
    "floor_untouched?": float | None,
}


def read_ladder(path: Path) -> dict[str, Any]:
    """A ladder's JSON as `ladder -o FILE.json` writes it.  UsageError: the file is none."""
    try:
        with open_input(path) as stream:
            climbed: dict[str, Any] = json_of(stream.read(), _LADDER)
        if not climbed["steps"]:
            raise ValueError("it has no steps")
    except (OSError, ValueError) as problem:
        raise UsageError(
            f"is no ladder ({problem})",
            allowed="`tirelog ladder LOG --model M -o FILE.json` writes one",
            do="give that",
            file=path,
        ) from None
    return climbed


# ---- What each observable of one fit knows, and whether they contradict each other.
#
#     whitened slopes J_i and residual r_i of each observable at the fit to all
#         -> information I_i = J_i' J_i, pull g_i = J_i' r_i, all together I and 0
#         -> directions in which I is 1: there the observable knows the share s of it, and pulls
#         with
#            the variance s (1 - s) if all are right
#         -> chi-square of what it wants against what the others want, g^2 / (s (1 - s)) summed over
#            the directions that both know (the "parameter goodness of fit" of Maltoni and Schwetz,
#            Phys. Rev. D 68 (2003) 033020, in its linear form)
#         -> the error of each parameter if the observable were left out
#
# A parameter that one observable alone can see is no matter of agreement. What chance does not
# explain may still be too small to matter: a contradiction is reported if the observable would be
# nearer
# to its floor by as much as an effect must remove.


#: a direction of which an observable knows less than this share, or the others do, is no matter of
#: agreement: one of the two is thirty times as far off there.  Doubling it changes nothing seen
_BOTH_KNOW = 1e-3


@dataclass(frozen=True)
class Contribution:
    """What one observable brings to a fit of several.

    error_without  standard error of each free parameter if it were left out; inf: not determined
    chi2, freedom, p  of what it wants of the parameters against what the others want
    size           squared floors by which it would be nearer to its floor alone
    pulls          the parameters that differ most, if it contradicts the others: each as it wants
                   it `alone`, and as the `others` want it, with errors
    """

    apart: ClassVar = ("observable",)
    also: ClassVar = ("contradicts",)

    observable: str
    error_without: Mapping[str, float]
    chi2: float
    freedom: int
    p: float
    size: float
    pulls: tuple[Mapping[str, Any], ...] = ()

    @property
    def contradicts(self) -> bool:
        """More than chance does, and enough to matter."""
        return self.p <= ALARM_P and self.size > LEAST_SHARE_OF_FLOOR


def contributions(base: Base) -> tuple[Contribution, ...]:
    """What each observable of the base brings."""
    cells, fit = base.cells, base.fit
    if not fit.names:
        labels = [part.cells.label for part in base.channels]
        return tuple(Contribution(label, {}, 0.0, 0, 1.0, 0.0) for label in labels)
    offsets = Offsets.of(cells, base.white)
    slopes = offsets.without(base.white(fit.moving))
    left = np.where(np.isfinite(cells.values), cells.values - fit.prediction, 0.0)
    residual = offsets.without(base.white(left))
    scale, p = max(1.0, fit.reduced_chi2), slopes.shape[-1]
    norm = np.linalg.norm(slopes.reshape(-1, p), axis=0)
    size, norm = np.where(norm > 0.0, norm, np.inf), np.where(norm > 0.0, norm, 0.0)
    parts, found = bases_by_observable(base), []
    known = [np.flatnonzero(cells.part == i) for i in range(len(parts))]
    flat = [slopes[rows].reshape(-1, p) / size for rows in known]
    pull = [x.T @ residual[rows].ravel() for x, rows in zip(flat, known, strict=True)]
    information = [x.T @ x for x in flat]
    values, vectors = np.linalg.eigh(np.sum(information, axis=0))
    good = values > NULL * max(float(values[-1]), 1e-300)  # what nothing shows is left out
    root = vectors[:, good] / np.sqrt(values[good])
    for i, part in enumerate(parts):
        share, turn = np.linalg.eigh(root.T @ information[i] @ root)
        both = (share > _BOTH_KNOW) & (share < 1.0 - _BOTH_KNOW)
        along, s = turn[:, both].T @ (root.T @ pull[i]), share[both]
        chi2, freedom = float((along**2 / (s * (1.0 - s))).sum()) / scale, int(both.sum())
        step = root @ (turn[:, both] @ (along / s)) / size
        others = np.concatenate([x for k, x in enumerate(flat) if k != i]) * norm
        without = errors_of(others, scale).se
        one = Contribution(
            observable=part.cells.label,
            error_without=dict(zip(fit.names, without.tolist(), strict=True)),
            chi2=chi2,
            freedom=freedom,
            p=float(chdtrc(freedom, chi2)) if freedom else 1.0,
            size=_size(part, step),
        )
        if one.contradicts:
            back = root @ (turn[:, both] @ (-along / (1.0 - s))) / size
            alone = errors_of(flat[i] * norm, scale).se
            values = np.array([base.model.values[name] for name in fit.names])
            sigmas = np.abs(step - back) / np.hypot(alone, without)
            # standard errors by which a parameter differs that is named, and how many are at most;
            # with twice as many, contradictions are reported without the parameter that makes them
            named = [k for k in np.argsort(-sigmas, kind="stable") if sigmas[k] >= 3.0][:3]
            pulls = tuple(
                {
                    "parameter": fit.names[k], "alone": values[k] + step[k], "alone_se": alone[k],
                    "others": values[k] + back[k], "others_se": without[k], "sigmas": sigmas[k],
                }
                for k in named
            )  # fmt: skip
            one = replace(one, pulls=pulls)
        found.append(one)
    return tuple(found)


def _size(part: Base, step: FloatArray) -> float:
    """Squared floors by which the observable's error falls if the parameters move by a step."""
    left = part.cells.values - part.fit.prediction - part.fit.beside
    moved = left - np.nan_to_num(part.fit.moving) @ step
    before, after = (float((part.plain(np.nan_to_num(x)) ** 2).sum()) for x in (left, moved))
    return (before - after) / part.plain.weight / part.floor.square


def agreement_sentence(
    found: tuple[Contribution, ...], units: Mapping[str, str], word: str = "observable"
) -> str:
    """Whether the observables agree, in words; `units` of the parameters, `word` for one."""
    wrong = [one for one in found if one.contradicts]
    sharing = [one for one in found if one.freedom]
    if not sharing:
        return f"No parameter is known by more than one {word}: nothing can contradict."
    if not wrong:
        told = ", ".join(
            f"{one.observable} against the others {one.chi2:.3g} of {one.freedom}"
            for one in sharing
        )
        if any(one.p <= ALARM_P for one in found):
            told += "; what chance does not explain of it is too small to matter"
        alone = " and ".join(one.observable for one in found if not one.freedom)
        own = f" {alone} shares no parameter that it can tell." if alone else ""
        return f"The {word}s agree on what they share (chi-square of {told}).{own}"
    said, many = [], len(wrong)
    if word == "grating" and many > 1:  # a wheel's force variation makes all differ
        wrong = [max(wrong, key=lambda one: one.size)]
        said = [f"{many} of {len(found)} gratings differ from the others"]
    for one in wrong:
        pulls = "; ".join(
            "{parameter} {alone:.4g} ± {alone_se:.2g} alone, {others:.4g} ± {others_se:.2g} by the "
            "others".format(**pull)
            + (f" [{unit}]" if (unit := units.get(pull["parameter"], "1")) != "1" else "")
            for pull in one.pulls
        )
        said.append(
            f"{one.observable} contradicts the others (chi-square {one.chi2:.3g} of "
            f"{one.freedom}){': ' if pulls else ''}{pulls}"
        )
    if word == "grating":
        return (
            f"{'. '.join(said)}. It may be the wheel's force variation, something missing, or the "
            "grating: diagnose tells them apart."
        )
    return (
        f"{'. '.join(said)}. Each alone would fit better: something is missing that is not the "
        "same in all, or a channel's scale or place is wrong."
    )
