"""How sure a verdict may be: cases drawn from priors, the table made of them, and how true it is.

    python -m benchmarks.calibration --seeds 40000-40299 -o FILE.csv [--jobs 2]
                                    a row per case as it is done; what is there is not done again
    python -m benchmarks.calibration --fit FILE.csv ... [-o TABLE.toml]
                                    the table of `diagnose`, calibration.toml beside certainty.py;
                                    the shipped one is of benchmarks/rows/calibration.csv
    python -m benchmarks.calibration --report FILE.csv ...
                                    said against what was right; never on a case of the fit

The priors, which a table is true for (`drawn`):

    tire      seeds 40000 to 59999: a car's, a small or a heavy one, a third each, within the
              ranges of `benchmarks.nuisance_worlds`; from 60000 on, to report: a van's, on
              plans of its own. Beam 70 %, ring 30 %
    logs      two of about a minute, of differing load, age and water; the kind's plans, +-6 %
    missing   nothing in 40 % of cases, one effect of the catalogue in 45 %, one that no catalogue
              has in 15 %; at 0.2 to 2 of its ordinary size, evenly in decades; of two forms, the
              catalogue's and another, as likely each
    nuisances 0 to 4 at once in 20, 35, 25, 15 and 5 % of cases, any as likely

What is right stands in `is_right`. Rows of `benchmarks.nuisances` and `benchmarks.hidden` are cases
as well: rows count by the share that the priors give to what is missing in them, and cases of one
drive count as what they tell together.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import tomlkit
from scipy.optimize import minimize

import tirelog
from benchmarks.cases import IN_CATALOGUE, OUTSIDE
from benchmarks.hidden import KINDS as HIDDEN
from benchmarks.hidden import wilson
from benchmarks.nuisance_worlds import FIRST_DRAWN, CaseOf, several
from benchmarks.nuisances import Row, append_rows, names, read_rows, row_of, seeds_of, written
from tirelog.diagnosis import certainty
from tirelog.diagnosis.certainty import CLASSES, NEGLIGIBLE, OF_CLASS, SIGNS, certainty_of, class_of
from tirelog.errors import TirelogError
from tirelog.vocabulary.arrays import FloatArray

#: shares of what is missing, of carcasses, and of so many nuisances at once
MISSING = {"nothing": 0.4, "catalogue": 0.45, "outside": 0.15}
CARCASSES = {"beam": 0.7, "ring": 0.3}
NUISANCES = (0.2, 0.35, 0.25, 0.15, 0.05)
#: strengths against the ordinary ones
WEAKEST, STRONGEST = 0.2, 2.0
FORMS = ("exact", "other")
#: what cases that share tire, log and effect tell of each other, beside their nuisances: half;
#: with none they would count as so many cases, with all as one
_ALIKE = 0.5
#: pseudo-cases, half of them right, and the spread of a slope per spread of its term: as many
#: true cases move them by half
_PSEUDO = 2.0
_SLOPE = 1.0
#: fewest drives that the row of a class is made of; half as many would be no more than the
#: pseudo-cases
_FEWEST = 8
#: what no case had, in words
_LACKING = {"outside": "effect that no catalogue has", "catalogue": "effect of the catalogue"}
#: probabilities that are counted together in a report
_BINS = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0)


def drawn(seed: int) -> CaseOf:
    """The case of a seed: the priors."""
    random = np.random.default_rng([seed, 22])

    def one_of(shares: dict[str, float]) -> str:
        return str(random.choice(list(shares), p=list(shares.values())))

    carcass, missing = one_of(CARCASSES), one_of(MISSING)
    count = int(random.choice(len(NUISANCES), p=NUISANCES))
    low, high = math.log10(WEAKEST), math.log10(STRONGEST)
    strength = float(f"{10.0 ** random.uniform(low, high):.4g}")
    known = {"nothing": ("",), "catalogue": IN_CATALOGUE, "outside": OUTSIDE}[missing]
    effect, form = str(random.choice(known)), str(random.choice(FORMS))
    world = several(count, seed) if count else "control"
    return CaseOf(world, seed, carcass, effect, strength if effect else 1.0, form=form)


def run(seed: int) -> Row:
    """The row of a seed."""
    case = drawn(seed)
    with TemporaryDirectory() as scratch:
        row = row_of(case, "drawn" if case.effect else "", Path(scratch), math.nan)
    if case.effect and class_of(row.status) == "none":
        row = replace(row, planted_excess=excess_of(case))
    return row


def excess_of(case: CaseOf) -> float:
    """What the planted effect leaves beside a refitted model in the control world [floors^2]."""
    try:
        with TemporaryDirectory() as scratch:
            logs, file = written(replace(case, world="control"), Path(scratch))
            model = tirelog.load_model(file)
            found = tirelog.compare(tirelog.measure(logs, model), model)
    except TirelogError:
        return math.nan
    return (found.rmse_heldout or 0.0) ** 2 / found.noise_floor**2 - 1.0


# ---- what is right ------------------------------------------------------------------------------


def is_right(row: Row) -> bool:
    """Is the verdict true as a sentence?

    none     nothing was planted, or less than NEGLIGIBLE
    name     what is named is what was planted, or the sets hold it; nothing else is named
    part     nothing is named that was not planted, alone or in a set
    unknown  what was planted is outside the catalogue
    """
    kind, planted = class_of(row.status), planted_in(row)
    if kind == "none":
        return not planted or row.planted_excess < NEGLIGIBLE
    if kind == "unknown":
        return missing_in(row) == "outside"
    sets = [set(group) for group in json.loads(row.sets)]
    of_truth = {name for group in sets if group & planted for name in group}
    claimed = names(row) | {name for group in sets for name in group}
    true = bool(names(row)) and names(row) <= planted | of_truth
    return true and (planted <= claimed or kind == "part")


def planted_in(row: Row) -> set[str]:
    """The effects that are planted in a case."""
    return set(row.planted.split("+")) - {""}


def missing_in(row: Row) -> str:
    """What is missing in a case, as the priors call it."""
    if not row.planted:
        return "nothing"
    return "outside" if planted_in(row) & set(OUTSIDE) else "catalogue"


def counted(rows: Iterable[Row]) -> list[Row]:
    """The rows that claim something and whose truth is known, each case once."""
    once = {(r.world, r.seed, r.carcass, r.planted, r.size, r.form): r for r in rows}
    return [
        r
        for r in once.values()
        if class_of(r.status)
        and not (class_of(r.status) == "none" and r.planted and math.isnan(r.planted_excess))
    ]


def rows_of(file: Path) -> list[Row]:
    """The cases in a file of this benchmark, of `nuisances` or of `hidden`."""
    with file.open(newline="", encoding="utf-8") as stream:
        rows = csv.DictReader(stream)
        if "verdict" in (rows.fieldnames or ()):
            return [of_hidden(row) for row in rows if row["kind"] not in ("parted",)]
    return read_rows(file)


def of_hidden(row: Mapping[str, str]) -> Row:
    """A row of `benchmarks.hidden`: the numbers of manoeuvres are not in it."""
    excess, after = float(row["excess_over_floor"]) ** 2, float(row["after_over_floor"])
    before = math.sqrt(1.0 + excess)
    return Row(
        row["kind"], int(row["seed"]), "beam", row["planted"], row["kind"], 1.0,
        excess if row["planted"] else 0.0, row["verdict"], row["selected"], row["group"],
        float(row["removed"]), before, after if row["selected"] else before,
        float(row["chi2_before"]), float(row["chi2_after"]), excess, after**2 - 1.0, 0,
        float(row["seconds"]), "", logs=3,
    )  # fmt: skip


# ---- the fit ------------------------------------------------------------------------------------


def tires(rows: Iterable[Row]) -> int:
    """Of how many tires the cases are: a seed draws one, those of `benchmarks.hidden` are one."""
    return len({("one", 0) if row.world in HIDDEN else (row.carcass, row.seed) for row in rows})


def drive(row: Row) -> tuple[object, ...]:
    """Cases of one tire, drive and effect are alike beside their nuisances."""
    return row.seed, row.carcass, row.planted, row.size


def weights(rows: Sequence[Row]) -> FloatArray:
    """Of each row by how many cases it counts: the priors' shares, and what like cases tell."""
    size = Counter(map(drive, rows))
    own = np.array([1.0 / (1.0 + (size[drive(r)] - 1) * _ALIKE) for r in rows])
    missing = [missing_in(r) for r in rows]
    total = {name: sum(o for o, m in zip(own, missing) if m == name) for name in set(missing)}
    raw = own * np.array([MISSING[m] / total[m] for m in missing])
    # weights so uneven are worth fewer cases (Kish)
    return raw * raw.sum() / float((raw**2 / own).sum())


@dataclass(frozen=True)
class Fitted:
    """One class of verdicts: the rows, what each counts, and the logistic."""

    rows: Sequence[Row]
    weight: FloatArray
    intercept: float
    slopes: dict[str, dict[str, float]]


def fitted(rows: Sequence[Row], weight: FloatArray, terms: Sequence[str]) -> Fitted:
    """The logistic of a class in these terms, each of its sign, shrunk.

    A term that is known of less than half of the rows, or the same in all, stays out; rows that it
    is not known of are as in the middle.
    """
    right = np.array([is_right(r) for r in rows], float)
    columns: list[FloatArray] = []
    known: dict[str, dict[str, float]] = {}
    for name in terms:
        value = np.array([r.marks.terms[name] for r in rows])
        there = np.isfinite(value)
        if weight[there].sum() < 0.5 * weight.sum():
            continue
        low, high = np.quantile(value[there], [0.02, 0.98])
        value = np.clip(value, low, high)
        centre = float(np.average(value[there], weights=weight[there]))
        value[~there] = centre
        spread = math.sqrt(float(np.average((value - centre) ** 2, weights=weight)))
        if spread <= 0.0:
            continue
        limits = {"low": float(low), "high": float(high)}
        known[name] = {"centre": centre, "spread": spread, **limits}
        columns.append((value - centre) / spread)
    x = np.stack([np.ones(len(rows)), *columns], axis=1)

    def loss(b: FloatArray) -> tuple[float, FloatArray]:
        logit = x @ b
        p = 1.0 / (1.0 + np.exp(-logit))
        total = float((weight * (np.logaddexp(0.0, logit) - right * logit)).sum())
        slope = x.T @ (weight * (p - right))
        # a right and a wrong pseudo-case where all terms are at their centres
        even = 1.0 / (1.0 + math.exp(-b[0]))
        total += _PSEUDO * (float(np.logaddexp(0.0, b[0])) - 0.5 * float(b[0]))
        slope[0] += _PSEUDO * (even - 0.5)
        total += 0.5 * float((b[1:] ** 2).sum()) / _SLOPE**2
        slope[1:] += b[1:] / _SLOPE**2
        return total, slope

    signs = [SIGNS[name] for name in known]
    bounds = [(None, None), *((0.0, None) if s > 0 else (None, 0.0) for s in signs)]
    found = minimize(loss, np.zeros(x.shape[1]), jac=True, method="L-BFGS-B", bounds=bounds).x
    slopes = {
        name: {
            "centre": known[name]["centre"],
            "slope": float(b) / known[name]["spread"],
            "low": known[name]["low"],
            "high": known[name]["high"],
        }
        for name, b in zip(known, found[1:], strict=True)
    }
    return Fitted(rows, weight, float(found[0]), slopes)


def table(rows: Iterable[Row], today: date) -> tomlkit.TOMLDocument:
    """The table of all classes of which there are enough cases."""
    some = counted(rows)
    weight = weights(some)
    out = tomlkit.document()
    out.add(tomlkit.comment("made by `python -m benchmarks.calibration --fit`; do not edit"))
    out["date"] = today.isoformat()
    out["cases"], out["tires"] = len(some), tires(some)
    out["seeds"] = ranges({r.seed for r in some})
    out["priors"] = {"missing": MISSING, "carcasses": CARCASSES, "nuisances": list(NUISANCES)}
    for kind in CLASSES:
        at = [i for i, r in enumerate(some) if class_of(r.status) == kind]
        own = [some[i] for i in at]
        count = len({drive(r) for r in own})
        manoeuvres = [r.manoeuvres for r in own if r.manoeuvres]
        if count < _FEWEST or not manoeuvres:
            continue
        found = fitted(own, weight[at], OF_CLASS[kind])
        lacking = set(MISSING) - {missing_in(r) for r in some} - {"nothing"}
        effective = min(float(weight[at].sum()), count)
        # of n cases; and what no case had may be right as well as wrong
        most = (effective + 1.0) / (effective + 2.0)
        most = min(most, 1.0 - 0.5 * sum(MISSING[name] for name in lacking))
        out[kind] = {
            "cases": len(own),
            "tires": tires(own),
            "right": sum(map(is_right, own)),
            "effective": round(effective, 1),
            "most": math.floor(1000.0 * most) / 1000.0,
            "carcasses": sorted({r.carcass for r in own}),
            "manoeuvres": [min(manoeuvres), max(manoeuvres)],
            "lacking": [_LACKING[name] for name in sorted(lacking)],
            "intercept": round(found.intercept, 4),
            "terms": {
                name: {key: round(value, 4) for key, value in term.items()}
                for name, term in found.slopes.items()
            },
        }
    return out


def ranges(seeds: Iterable[int]) -> list[str]:
    """Numbers as runs: 1, 2, 3, 7 are 1-3, 7."""
    runs: list[list[int]] = []
    for seed in sorted(seeds):
        if runs and seed == runs[-1][1] + 1:
            runs[-1][1] = seed
        else:
            runs.append([seed, seed])
    return [f"{a}-{b}" if b > a else f"{a}" for a, b in runs]


# ---- the report ---------------------------------------------------------------------------------


def report(rows: Iterable[Row], known: dict[str, Any]) -> Iterator[str]:
    """What was said against what was right, on cases that the table was not made of."""
    fitted_on = {s for text in known["seeds"] for s in seeds_of(text)}
    fresh = counted(r for r in rows if r.seed not in fitted_on)
    said = [(r, certainty_of(r.marks, known).probability) for r in fresh]
    told = [(r, p) for r, p in said if p is not None]
    yield (
        f"{len(fresh)} cases that the table of {known['date']} was not made of, {len(told)} with "
        "a probability"
    )
    if not told:
        return
    p = np.array([q for _, q in told])
    right = np.array([is_right(r) for r, _ in told], float)
    which = np.digitize(p, _BINS[1:-1])
    error = 0.0
    for i in np.unique(which):
        mine = which == i
        error += mine.mean() * abs(p[mine].mean() - right[mine].mean())
        yield (
            f"  said {100 * p[mine].min():.0f} to {100 * p[mine].max():.0f} %, "
            f"{100 * p[mine].mean():.1f} in the mean: right "
            f"{wilson(int(right[mine].sum()), int(mine.sum()))}"
        )
    yield f"calibration error {error:.3f} (at most 0.05); Brier {np.mean((p - right) ** 2):.3f}"
    sure = p >= 0.9
    yield f"said 90 % or more: right {wilson(int(right[sure].sum()), int(sure.sum()))} (88 %)"
    for kind in CLASSES:
        mine = np.array([class_of(r.status) == kind for r, _ in told])
        if mine.any():
            yield (
                f"  {kind}: said {100 * p[mine].mean():.1f} %, right "
                f"{wilson(int(right[mine].sum()), int(mine.sum()))}"
            )


def main() -> None:
    """Run cases, make the table, or report."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", default=f"{FIRST_DRAWN}-{FIRST_DRAWN + 3}")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--fit", type=Path, nargs="+")
    parser.add_argument("--report", type=Path, nargs="+")
    options = parser.parse_args()
    if options.fit or options.report:
        rows = [row for file in options.fit or options.report for row in rows_of(file)]
        if options.fit:
            beside = Path(certainty.__file__).parent / certainty.TABLE
            out = options.output or beside
            out.write_text(tomlkit.dumps(table(rows, date.today())), encoding="utf-8")
            print(f"{out} made of {len(counted(rows))} cases; then: make reference")
        else:
            print("\n".join(report(rows, certainty.calibration())))
        return
    done = read_rows(options.output) if options.output and options.output.exists() else []
    known = {row.seed for row in done}
    with ProcessPoolExecutor(options.jobs) as pool:
        for row in pool.map(run, [s for s in seeds_of(options.seeds) if s not in known]):
            print(
                f"{row.seed} {row.carcass} {row.world} {row.planted or 'none'}: {row.status} "
                f"{row.named} {'right' if is_right(row) else 'wrong'}",
                flush=True,
            )
            if options.output:
                append_rows(options.output, [row])


if __name__ == "__main__":
    main()
