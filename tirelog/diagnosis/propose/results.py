"""What `propose` gives: frozen, with its sentences and JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tirelog.diagnosis.answer import AnswerRecord, AnswerTable, plain_fields
from tirelog.diagnosis.diagnose import Diagnosis
from tirelog.diagnosis.propose.measured_shapes import MeasuredShape
from tirelog.diagnosis.rules import GAIN_SIGMAS
from tirelog.diagnosis.wording import percent, probability
from tirelog.physics.model.model import Model
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import shown


@dataclass(frozen=True)
class FoundFormula:
    """One way to write a term.

    `expression` and `acts_on` as in a model file, `words` and `law` to read ("1": always the same),
    `left` the mean square error [unit^2] held out with it.
    """

    expression: str
    acts_on: str
    words: str
    law: str
    left: float


@dataclass(frozen=True)
class Term:
    """One proposed effect.

    `name` in the model, the `formula` that stands for it, and those `as_good`, simplest first;
    `numbers`: value, se, unit by name; `p` over the `tried` forms of the whole grammar.
    """

    name: str
    formula: FoundFormula
    as_good: tuple[FoundFormula, ...]
    numbers: Mapping[str, Mapping[str, Any]]
    p: float
    tried: int

    @property
    def stages(self) -> tuple[str, ...]:
        """Where it acts; several if these data cannot tell."""
        every = (self.formula, *self.as_good)
        return tuple(dict.fromkeys(formula.acts_on for formula in every))


@dataclass(frozen=True)
class Locked:
    """Errors on manoeuvres that nothing had touched: before, after, and the floor there [unit]."""

    manoeuvres: int
    before: float
    after: float
    floor: float

    @property
    def share(self) -> float | None:
        """The share of the excess that is removed there; None if there was none."""
        before = self.before**2 - self.floor**2
        if before <= 0.0:
            return None
        return 1.0 - max(self.after**2 - self.floor**2, 0.0) / before


@dataclass(frozen=True, repr=False)
class Proposal(AnswerRecord):
    """What is unknown, written down; or why there is nothing to propose.

    status      "formula", "shape" (a measured shape stands for it) or "nothing"
    reason      why there is nothing to propose; empty otherwise
    terms       the formulas, each beside those before it
    shapes      measured shapes, the best first: what one form in that frame can remove at most
    written     names of the effects that `model` has more than the model that was asked about
    model       with them, fitted on the manoeuvres that were seen; None without a proposal
    rmse_heldout_before, rmse_heldout_after, noise_floor  on the manoeuvres that were seen
    nearest     effects of the catalogue and the share of the excess that each removes
    separating_manoeuvres  what to drive, so that formulas that are as good part
    asked       the measured shape was asked for: formulas may do as well
    leading_before, leading_after  (m,) the leading shape of what is left, at `phi_rad` (m,)
    """

    drawn_by = "propose"
    panel = "shape"

    status: str
    reason: str
    diagnosis: Diagnosis | None
    terms: tuple[Term, ...]
    shapes: tuple[MeasuredShape, ...]
    written: tuple[str, ...]
    model: Model | None
    locked: Locked | None
    observable: str
    unit: str
    rmse_heldout_before: float | None
    rmse_heldout_after: float | None
    noise_floor: float | None
    manoeuvres: int
    nearest: tuple[tuple[str, float], ...]
    separating_manoeuvres: tuple[Mapping[str, Any], ...]
    notes: tuple[str, ...]
    phi_rad: FloatArray
    leading_before: FloatArray
    leading_after: FloatArray
    asked: bool = False

    @property
    def sentence(self) -> str:
        """The answer in one sentence."""
        if self.status == "nothing":
            return f"Nothing to propose: {self.reason}"
        factor, unit = shown(self.observable, self.unit)
        if self.status == "formula":
            what = "; and ".join(_said(term.formula) for term in self.terms)
        else:
            shape = self.shapes[0]
            law = "" if shape.law == "1" else f", times {shape.law}"
            why = "" if self.asked else ", since no formula does as well"
            what = f"a measured shape {shape.words}{law}{why}"
        locked = self.locked
        if locked is None or locked.share is None:
            return f"Proposed: {what}."
        return (
            f"Proposed: {what}. On {locked.manoeuvres} manoeuvres that nothing had touched it "
            f"removes {percent(locked.share)} of the excess: {locked.before * factor:.3g} -> "
            f"{locked.after * factor:.3g} {unit} at a floor of {locked.floor * factor:.3g}."
        )

    def sentences(self) -> list[str]:
        """What else a reader should know, in words."""
        said = []
        for term in self.terms if self.status == "formula" else ():
            p = probability(term.p, self.manoeuvres)
            said.append(f"{term.name}: probability {p} of being chance over {term.tried} forms.")
            if len(term.stages) > 1:
                said.append(
                    f"{term.name}: it acts on {' or '.join(term.stages)}; these data "
                    "cannot tell which."
                )
            if term.as_good:
                others = "; ".join(formula.expression for formula in term.as_good)
                said.append(f"{term.name}: as good held out: {others}.")
        before, floor = self.rmse_heldout_before, self.noise_floor
        wanted = self.status != "nothing" and bool(self.shapes)
        if wanted and before is not None and floor is not None:
            excess = before**2 - floor**2
            best = self.shapes[0]
            if excess > 0.0 and best.gain > GAIN_SIGMAS:
                said.append(
                    f"A free shape {best.words}, times {best.law}, removes "
                    f"{percent(min(best.removed / excess, 1.0))} of the excess held out: no single "
                    "form in that frame removes more."
                )
        if self.status != "nothing" and self.nearest:
            near = ", ".join(f"{name} {percent(share)}" for name, share in self.nearest)
            said.append(f"Nearest effects of the catalogue: {near} of the excess.")
        for row in self.separating_manoeuvres:
            first, second = row["separates"]
            said.append(f"{row['manoeuvre']} x{row['repeats']} would part {first} from {second}.")
        return [*said, *self.notes]

    def to_json(self) -> dict[str, Any]:
        """Everything but the arrays of the picture and the whole diagnosis."""
        return plain_fields(
            {
                "status": self.status,
                "sentence": self.sentence,
                "reason": self.reason,
                "verdict": self.diagnosis.verdict if self.diagnosis else "too_few",
                "observable": self.observable,
                "unit": self.unit,
                "terms": [_term(term) for term in self.terms],
                "shapes": [_shape(shape) for shape in self.shapes],
                "written": self.written,
                "rmse_heldout_before": self.rmse_heldout_before,
                "rmse_heldout_after": self.rmse_heldout_after,
                "noise_floor": self.noise_floor,
                "manoeuvres": self.manoeuvres,
                "locked": None
                if self.locked is None
                else {
                    "manoeuvres": self.locked.manoeuvres,
                    "rmse_before": self.locked.before,
                    "rmse_after": self.locked.after,
                    "noise_floor": self.locked.floor,
                    "share_removed": self.locked.share,
                },
                "nearest": [
                    {"effect": name, "excess_removed": share} for name, share in self.nearest
                ],
                "separating_manoeuvres": self.separating_manoeuvres,
                "notes": self.notes,
            }
        )

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        return self.sentence

    def below(self) -> tuple[list[AnswerTable], list[str]]:
        """The numbers of the formulas, if there are any; what else a reader should know."""
        return [self.terms_table()] if self.terms else [], self.sentences()

    def terms_table(self) -> AnswerTable:
        """The numbers of the formulas that are proposed."""
        rows: list[list[Any]] = []
        for term in self.terms:
            words = [term.name, term.formula.acts_on, term.formula.expression]
            for name, n in term.numbers.items():
                error = "not determined" if n["se"] is None else n["se"]
                rows.append([*words, name, n["value"], error, n["unit"]])
                words = ["", "", ""]
        names = ["effect", "acts on", "expression", "number", "value", "error", "unit"]
        return AnswerTable("Numbers of the formulas", names, rows)


def _said(formula: FoundFormula) -> str:
    law = "always the same" if formula.law == "1" else f"growing as {formula.law}"
    return f"{formula.words}, {law}, acting on {formula.acts_on}"


def _formula(formula: FoundFormula) -> dict[str, Any]:
    return {name: getattr(formula, name) for name in FoundFormula.__dataclass_fields__}


def _term(term: Term) -> dict[str, Any]:
    return {
        "name": term.name,
        **_formula(term.formula),
        "stages": term.stages,
        "parameters": term.numbers,
        "p": term.p,
        "tried": term.tried,
        "as_good": [_formula(formula) for formula in term.as_good],
    }


def _shape(shape: MeasuredShape) -> dict[str, Any]:
    return {name: getattr(shape, name) for name in MeasuredShape.__dataclass_fields__}
