"""Which manoeuvre to drive next, so that rivals part.

    rivals, each refitted --> predictions on a list of allowed manoeuvres
        --> what no refit of the second can imitate of the first, old and new data together
        --> separation in standard errors, repeats until it reaches 3

Two effects that stay alike in shape on every manoeuvre of the list (cosine above `LIKE`) cannot be
separated by driving; a note lists them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.special import ndtr

from tirelog.data.recording import Conditions
from tirelog.diagnosis.candidates.assessment import (
    candidate_effects,
    gain_sigmas,
    with_candidate,
)
from tirelog.diagnosis.candidates.naming import Step
from tirelog.diagnosis.candidates.search import SearchResult
from tirelog.errors import ModelError, or_refusal
from tirelog.inference.base import Base, bases_by_observable
from tirelog.inference.cells.cells import linearised, model_of, predicted
from tirelog.inference.fit.cells import free_names
from tirelog.inference.metric import Offsets, orthonormal, projected_out, stacked
from tirelog.inference.nuisances import shared_by
from tirelog.inference.stacks.manoeuvres import CRUISE_M_S2
from tirelog.physics.model.model import Model
from tirelog.vocabulary.conditions import CONDITIONS

#: separation that is aimed at [standard errors]: taken for another effect once in 740; doubled, it
#: takes four times the runs.  Revolutions of a planned stretch, angles and speeds of the plan
WANTED_SIGMA = 3.0
_REVOLUTIONS = 40
_ANGLES = 128
_SPEEDS = 6
#: a planned stretch that is as long has been driven if a log is
_LONG_S = 60.0


@dataclass(frozen=True)
class CandidateManoeuvre:
    """Something a driver can be asked for.

    Speeds [m/s] passed through, acceleration [m/s^2], a factor on the load, values of other
    conditions by field.
    """

    name: str
    speed_m_s: tuple[float, float]
    acceleration_m_s2: float = 0.0
    load: float = 1.0
    time_s: float = 30.0
    values: Mapping[str, float] = field(default_factory=dict)

    def minutes(self, radius_m: float, repeats: int = 1) -> float:
        """Time that so many runs take, on a wheel of this rolling radius."""
        speed = 0.5 * sum(self.speed_m_s)
        revolutions = 2.0 * np.pi * radius_m * _REVOLUTIONS / speed
        ramp = abs(self.speed_m_s[1] - self.speed_m_s[0]) / (abs(self.acceleration_m_s2) or np.inf)
        # time that a stretch takes beside itself [s]: to come to it; with another load, pressure,
        # water or tread to come to that. Doubled, what needs no stop is advised sooner
        once = 600.0 if self.load != 1.0 or self.values else 0.0
        once += self.time_s if self.time_s > _LONG_S else 0.0
        return float(once + repeats * (20.0 + max(revolutions, ramp))) / 60.0


ALLOWED = (
    CandidateManoeuvre("cruise at 8 m/s", (8.0, 8.0)),
    CandidateManoeuvre("cruise at 15 m/s", (15.0, 15.0)),
    CandidateManoeuvre("cruise at 25 m/s", (25.0, 25.0)),
    CandidateManoeuvre("coast down 25 to 9 m/s", (25.0, 9.0), -0.5),
    CandidateManoeuvre("drive 9 to 25 m/s at 2 m/s^2", (9.0, 25.0), 2.0),
    CandidateManoeuvre("brake 25 to 9 m/s at 4 m/s^2", (25.0, 9.0), -4.0),
    CandidateManoeuvre("cruise at 15 m/s with 40 % more load", (15.0, 15.0), load=1.4),
    CandidateManoeuvre("cruise at 15 m/s after ten minutes", (15.0, 15.0), time_s=600.0),
    *(
        CandidateManoeuvre(
            asked.name, (asked.speed_m_s, asked.speed_m_s), values={name: asked.value}
        )
        for name, condition in CONDITIONS.items()
        if (asked := condition.proposed) is not None
    ),
)


def planned(base: Base, manoeuvre: CandidateManoeuvre) -> Conditions:
    """The conditions of a planned stretch, about those of the logs so far."""
    c = base.cells.conditions
    speed = np.linspace(*manoeuvre.speed_m_s, _SPEEDS)
    load = float(np.mean(c.load_N)) * manoeuvre.load
    if not np.isfinite(load):
        load = base.model.values.get("load_N", np.nan) * manoeuvre.load
    asked = {
        "speed_m_s": speed,
        "acceleration_m_s2": manoeuvre.acceleration_m_s2,
        "time_s": manoeuvre.time_s,
        "load_N": load,
        # a slip that was measured goes along with the acceleration, as it did so far
        "slip": manoeuvre.acceleration_m_s2
        * float(c.slip @ c.acceleration_m_s2 / max(float((c.acceleration_m_s2**2).sum()), 1e-12)),
        **manoeuvre.values,
    }
    kept = {name: float(np.mean(getattr(c, name))) for name in CONDITIONS if name not in asked}
    return Conditions.of(_SPEEDS, **kept, **asked)


def driven(base: Base, manoeuvre: CandidateManoeuvre) -> bool:
    """Do the logs hold such a manoeuvre already, under the same conditions?"""
    c, number = base.cells.conditions, base.cells.manoeuvre
    if manoeuvre.time_s > _LONG_S and not np.any(c.time_s >= manoeuvre.time_s):
        return False
    wanted = dict(manoeuvre.values)
    if manoeuvre.load != 1.0:
        wanted["load_N"] = manoeuvre.load * float(np.median(c.load_N))
    alike = np.ones(len(base.cells), bool)
    # share of the plan that speed, load, age or water must come within: cells average over a band
    # of speed; twice as wide calls more stretches driven, and advises fewer
    same = 0.1
    for name, value in wanted.items():
        alike &= np.abs(getattr(c, name) - value) <= same * max(abs(value), 1e-9)
    low, high = sorted(manoeuvre.speed_m_s)
    for one in np.unique(number[alike]):
        cells = alike & (number == one)
        speed, acceleration = c.speed_m_s[cells], float(np.mean(c.acceleration_m_s2[cells]))
        if low == high:
            there = np.abs(speed - low).min() <= same * low and abs(acceleration) < CRUISE_M_S2
        else:
            passed = min(speed.max(), high) - max(speed.min(), low)
            ratio = acceleration / manoeuvre.acceleration_m_s2
            # most of the range, at an acceleration no further off than by this factor
            there = passed >= 0.7 * (high - low) and 0.4 <= ratio <= 1.0 / 0.4
        if there:
            return True
    return False


@or_refusal
def separations(base: Base, first: Model, second: Model) -> list[dict[str, Any]]:
    """How far every allowed manoeuvre that no log holds parts `first` from `second`, best first.

    `first` is taken as true, and parted from any refit of `second` beside the base's nuisances.
    What repeats on the wheel has one amplitude in the logs so far and on the planned stretch.
    """
    names = free_names(second, base.cells)
    groups = () if base.cells.shared is None else base.cells.shared.groups
    cells = replace(base.cells, shared=None)
    shared = shared_by(cells, base.fit, groups)
    mine = predicted(first, cells)
    theirs, jacobian = linearised(second, cells, names, {})
    parts = [np.nan_to_num(mine - theirs)[..., None], jacobian]
    parts += [] if shared is None else [shared.columns]
    taken = Offsets.of(cells, base.white)
    old = stacked(taken.without(base.white(np.concatenate(parts, axis=-1))))
    if shared is not None:  # how large an amplitude is before anything is measured
        ordinary = np.diag(1.0 / shared.sd)
        old = np.vstack([old, np.pad(ordinary, ((0, 0), (old.shape[1] - len(shared), 0)))])
    phi = np.asarray((np.arange(_ANGLES) + 0.5) * (2.0 * np.pi / _ANGLES) - np.pi, dtype=np.float64)
    noise = np.sqrt(
        base.floor.within * _ANGLES / base.cells.phi.shape[1] / (_REVOLUTIONS / _SPEEDS)
    )

    @or_refusal
    def row_of(manoeuvre: CandidateManoeuvre) -> dict[str, Any] | None:
        """How far it parts the two; None if what a nuisance would do there is not known."""
        conditions = planned(base, manoeuvre)
        ours = first.predict(conditions, phi, surface=base.cells.surface)
        other, slopes = second.linearised(conditions, phi, names, surface=base.cells.surface)
        shift = np.gradient(other, phi, axis=1)[..., None] * np.eye(_SPEEDS)[:, None, :]
        # what a load other than planned would do
        loaded = replace(conditions, load_N=conditions.load_N * 1.01)
        slope = (first.predict(loaded, phi, surface=base.cells.surface) - ours) / 0.01
        between = np.where(np.isfinite(slope), slope, ours)[..., None]
        columns = [(ours - other)[..., None], np.moveaxis(slopes, 0, -1)]
        if shared is not None:
            # the planned stretch as cells of the first log, as far as nuisances ask for them
            zeros, none = np.zeros(other.shape), np.zeros(_SPEEDS, np.int64)
            there = replace(
                cells, values=other, phi=phi + zeros, phi_variance=zeros, conditions=conditions,
                log=none, manoeuvre=none, revolutions=none + _REVOLUTIONS // _SPEEDS,
                moved=zeros[:, 0], shared=None,
            )  # fmt: skip
            fit = replace(base.fit, prediction=other, cells=there)
            stretch = shared_by(there, fit, groups, cells)
            if stretch is None or stretch.names != shared.names:
                return None
            columns.append(stretch.columns)
        new = np.concatenate([*columns, np.ones_like(between), shift, between], axis=-1) / noise
        new = stacked(new)
        both = np.vstack([np.pad(old, ((0, 0), (0, new.shape[1] - old.shape[1]))), new])
        left = projected_out(orthonormal(both[:, 1:]), both[:, 0])[old.shape[0] :]
        sigma, rest = float(np.linalg.norm(left)), float(left.std() * noise)
        return {
            "manoeuvre": manoeuvre.name, "separation_sigma": sigma, "rest": rest, "plan": manoeuvre
        }  # fmt: skip

    floor = np.sqrt(base.floor.square)
    asked = (row_of(manoeuvre) for manoeuvre in ALLOWED if not driven(base, manoeuvre))
    rows = [row for row in asked if isinstance(row, dict)]
    known = [r for r in rows if np.isfinite(r["separation_sigma"]) and r["rest"] > floor / 9.0]
    return sorted(known, key=lambda row: -row["separation_sigma"])


def first_waveform(base: Base) -> tuple[Base, Callable[[Model], Model]]:
    """The base of the observable that the list is searched in, and what makes a model one of it."""
    if not base.channels:
        return base, lambda model: model
    first = max(bases_by_observable(base), key=lambda part: part.cells.phi.shape[1])
    return first, partial(model_of, observable=first.cells.observable, member=first.cells.member)


def advise(
    base: Base, rivals: Sequence[tuple[str, Model]]
) -> tuple[list[dict[str, Any]], list[str]]:
    """The best manoeuvres for the first rival against each other one, and notes.

    The notes say when no drive on the list parts two rivals.
    """
    base, of_one = first_waveform(base)
    if base.cells.phi.shape[1] == 1:
        return [], [
            "the list of manoeuvres is searched for waveforms only: compare the rivals there."
        ]
    rows, notes = [], []
    (name, model), *others = [(name, of_one(model)) for name, model in rivals]
    for other, rival in others:
        found = separations(base, model, rival)
        if isinstance(found, ModelError):
            notes.append(f"Not tested, what tells {name} from {other}: {found.what}.")
            continue
        useful = [row for row in found if row["separation_sigma"] >= 1.0]
        if not useful:
            notes.append(
                f"no manoeuvre on the list that these logs do not hold separates {name} from "
                f"{other}. Drive with another load, pressure, water depth or tread."
            )
        for row in useful[:3]:
            plan, sigma = row["plan"], row["separation_sigma"]
            repeats = math.ceil((WANTED_SIGMA / sigma) ** 2)
            minutes = plan.minutes(base.cells.radius_m, repeats)
            rows.append(
                {
                    "manoeuvre": plan.name, "separates": [name, other],
                    "separation_sigma": sigma, "repeats": repeats, "minutes": minutes,
                }
            )  # fmt: skip
    return rows, notes


# ---- What to drive next: the manoeuvre that makes the verdict's probability grow fastest.
#
#     the verdict's probability -> how likely each rival is instead
#     rivals: other effects that were refitted, effects that these logs cannot show since what they
#             follow is the same throughout
#         -> `separation`: how far each manoeuvre on the list parts the two, refitted
#         -> by how much the probability of naming the right one grows, per minute of driving
#
# With the verdict at the odds exp(l) against a rival, and s standard errors between the two on a
# planned stretch, the log of the odds will have moved by +-s^2/2 on the average, with the standard
# deviation s. The right one is then the likelier one with
#
#     P = p Phi((s^2/2 + l) / s) + (1 - p) Phi((s^2/2 - l) / s),   p = 1 / (1 + exp(-l))
#
# in place of max(p, 1 - p). What the logs hold already is not on the list.


#: a growth of the probability below this is not worth a drive; at half of it a tenth of what is
#: advised would be for rivals that are as good as excluded
LEAST_GAIN = 0.005


@dataclass(frozen=True)
class Rival:
    """What else may be: its name, the model that has the verdict's, and that of the rival.

    `first` is taken as true and parted from any refit of `second`; `mass` and `verdict_mass` are
    the probabilities of the rival and of the verdict.
    """

    name: str
    of: str
    first: Model
    second: Model
    mass: float
    verdict_mass: float

    def gain(self, sigma: float, repeats: int) -> float:
        """What so many runs that part by `sigma` each add to the probability of being right."""
        return expected_gain(self.verdict_mass, self.mass, sigma * repeats**0.5)


def probability_after(odds_log: float, sigma: float) -> float:
    """P that the likelier of two is the right one, once a stretch parts them by `sigma`."""
    p = 1.0 / (1.0 + math.exp(-odds_log))
    if sigma <= 0.0:
        return max(p, 1.0 - p)
    right = ndtr((0.5 * sigma**2 + np.array([odds_log, -odds_log])) / sigma)
    return float(p * right[0] + (1.0 - p) * right[1])


def expected_gain(verdict: float, rival: float, sigma: float) -> float:
    """By how much P(right) grows if two of these probabilities are parted by `sigma`."""
    both = verdict + rival
    if verdict <= 0.0 or rival <= 0.0:
        return 0.0
    return both * probability_after(math.log(verdict / rival), sigma) - max(verdict, rival)


def drive_next(
    found: SearchResult, verdict: str, probability: float | None
) -> list[dict[str, Any]]:
    """Manoeuvres by the expected growth of the verdict's probability per minute, best first.

    Rows: manoeuvre, repeats, minutes of all of them, gain, gain_per_minute, separates (pairs), and
    the separation_sigma of the first pair and run. Each row also holds whether the probability at
    the start is calibrated or even odds. There is no row if nothing on the list is worth it.
    """
    # a verdict without a calibration is taken to be as likely as not
    p = 0.5 if probability is None else probability
    base, rivals = _rivals(found, verdict, p)
    parted: dict[str, tuple[CandidateManoeuvre, list[tuple[Rival, float]]]] = {}
    for rival in rivals[:4]:  # rivals that are asked about at most
        rows = separations(base, rival.first, rival.second)
        for row in [] if isinstance(rows, ModelError) else rows:
            _, pairs = parted.setdefault(row["manoeuvre"], (row["plan"], []))
            pairs.append((rival, row["separation_sigma"]))
    result: list[dict[str, Any]] = []
    for plan, pairs in parted.values():
        # so often that the likeliest rival is parted: what is driven in part settles nothing
        most = 20  # runs of one manoeuvre
        _, likeliest = max(pairs, key=lambda pair: pair[0].gain(pair[1], most))
        repeats = int(np.clip(math.ceil((WANTED_SIGMA / max(likeliest, 1e-9)) ** 2), 1, most))
        gains = [(rival.gain(sigma, repeats), rival, sigma) for rival, sigma in pairs]
        gain, minutes = sum(own for own, _, _ in gains), plan.minutes(base.cells.radius_m, repeats)
        if gain < LEAST_GAIN:
            continue
        gains.sort(key=lambda row: -row[0])
        result.append(
            {
                "manoeuvre": plan.name,
                "repeats": repeats,
                "minutes": minutes,
                "gain": gain,
                "gain_per_minute": gain / minutes,
                "separates": [[r.of, r.name] for own, r, _ in gains if own >= 0.5 * LEAST_GAIN],
                "separation_sigma": gains[0][2],
                "calibrated": probability is not None,
            }
        )
    return sorted(result, key=lambda row: -row["gain_per_minute"])[:3]  # that are named


def _rivals(found: SearchResult, verdict: str, p: float) -> tuple[Base, list[Rival]]:
    """What the verdict may be taken for, and the base that it is measured from."""
    silent = verdict == "nothing_missing"
    named = [s for s in found.steps if s.named is not None and not silent]
    step = named[0] if named else found.steps[0]
    base, of_one = first_waveform(step.before)
    # where loads or other conditions are in doubt, these come before any effect
    if base.cells.phi.shape[1] == 1 or verdict in ("unknown", "scatter"):
        return base, []
    if verdict == "too_few":
        some = step.contenders[:3]
        mass = 1.0 / max(len(some), 1)
        rivals = [
            Rival(r.id, some[0].id, some[0].base.model, r.base.model, mass, mass) for r in some[1:]
        ]
    else:
        rivals = _hidden(found, p) if silent else _instead(step, p)
    return base, [replace(r, first=of_one(r.first), second=of_one(r.second)) for r in rivals]


def _instead(step: Step, p: float) -> list[Rival]:
    """Other effects that were refitted: those of a set as likely each, others by their loss."""
    if step.named is None:
        return []
    best = step.named.base
    others = [r for r in step.contenders if r.id != step.named.id and r.established]
    share = p / (1 + sum(r.id in step.group for r in others))
    # of what is not in the set, and of what was not refitted at all
    losses = {r.id: max(gain_sigmas(r.base.held_white, best.held_white), 0.0) for r in others}
    weight = {name: math.exp(-0.5 * sigmas**2) for name, sigmas in losses.items()}
    rest = (1.0 - p) / (1.0 + sum(w for name, w in weight.items() if name not in step.group))
    mass = {n: share if n in step.group else rest * w for n, w in weight.items()}
    return [Rival(r.id, step.named.id, best.model, r.base.model, mass[r.id], share) for r in others]


def _hidden(found: SearchResult, p: float) -> list[Rival]:
    """Effects that these logs cannot show: as likely as before anything was measured."""
    model, reasons = found.before.model, found.steps[0].reasons
    effects = candidate_effects(model)
    # the probability that any effect of the catalogue is missing, before anything is measured: as
    # in the priors of the calibration
    mass = 0.45 / max(len(effects), 1)
    shown = {
        effect.id: with_candidate(
            model, effect, {q.name: q.probe for q in effect.parameters if q.name in effect.strength}
        )
        for effect in effects
        if effect.id in reasons
    }
    return [Rival("nothing", name, first, model, mass, p) for name, first in shown.items()]


def drive_sentences(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Each row as a sentence."""
    said = []
    for row in rows:
        times = "once" if row["repeats"] == 1 else f"{row['repeats']} times"
        pairs = "; ".join(f"{one} from {other}" for one, other in row["separates"])
        points, rate = 100.0 * row["gain"], 100.0 * row["gain_per_minute"]
        odds = "" if row["calibrated"] else ", counted from even odds"
        said.append(
            f"To be surer, drive: {row['manoeuvre']}, {times} ({row['minutes']:.1f} min). It tells "
            f"{pairs}; of 100 such verdicts {points:.1f} more would be right ({rate:.2g} per "
            f"minute{odds})."
        )
    return said
