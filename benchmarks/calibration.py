"""How sure a verdict may be: cases drawn from priors, the table made of them, and how true it is.

    python -m benchmarks.calibration --seeds 40000-40299 -o FILE.csv [--jobs 2]
                                    a row per case as it is done; what is there is not done again
    python -m benchmarks.calibration --fit FILE.csv ... [-o TABLE.toml]
                                    the table of `diagnose`, calibration.toml beside certainty.py;
                                    the shipped one is of benchmarks/rows/calibration.csv
    python -m benchmarks.calibration --report FILE.csv ...
                                    right cases against the table's bound; never on its own cases

The priors, which a table is true for (`drawn`):

    tire      seeds 40000 to 59999: a car's, a small or a heavy one, a third each, within the
              ranges of `benchmarks.nuisance_worlds`; from 60000 on, to report: a van's, on
              plans of its own. Beam 70 %, ring 30 %
    logs      two of about a minute, of differing load, age and water; the kind's plans, +-6 %
    missing   nothing in 40 % of cases, one effect of the catalogue in 45 %, one that no catalogue
              has in 15 %; at 0.2 to 2 of its ordinary size, evenly in decades; of two forms, the
              catalogue's and another, as likely each
    nuisances 0 to 4 at once in 20, 35, 25, 15 and 5 % of cases, any as likely

`is_right` says what is right. Rows of `benchmarks.nuisances` and `benchmarks.hidden` are cases as
well. A tire and drive counts once: further rows of it tell less than a new tire.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from datetime import date
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import tomlkit

import tirelog
from benchmarks.cases import IN_CATALOGUE, OUTSIDE
from benchmarks.hidden import KINDS as HIDDEN
from benchmarks.hidden import wilson
from benchmarks.nuisance_worlds import FIRST_DRAWN, CaseOf, several
from benchmarks.nuisances import Row, append_rows, names, read_rows, row_of, seeds_of, written
from tirelog.diagnosis import certainty
from tirelog.diagnosis.certainty import CLASSES, certainty_of, class_of
from tirelog.diagnosis.rules import SECOND_LEAST
from tirelog.errors import TirelogError

#: shares of what is missing, of carcasses, and of so many nuisances at once
MISSING = {"nothing": 0.4, "catalogue": 0.45, "outside": 0.15}
CARCASSES = {"beam": 0.7, "ring": 0.3}
NUISANCES = (0.2, 0.35, 0.25, 0.15, 0.05)
#: strengths against the ordinary ones
WEAKEST, STRONGEST = 0.2, 2.0
FORMS = ("exact", "other")
#: fewest cases that the row of a class is made of: of 8 right ones the least share is 63 %, of half
#: as many 40 %
_FEWEST = 8
#: what no case had, in words
_LACKING = {"outside": "effect that no catalogue has", "catalogue": "effect of the catalogue"}


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

    none     nothing was planted, or less than SECOND_LEAST [squared floors]
    name     what is named is what was planted, or the sets hold it; nothing else is named
    part     nothing is named that was not planted, alone or in a set
    unknown  what was planted is outside the catalogue
    """
    kind, planted = class_of(row.status), planted_in(row)
    if kind == "none":
        return not planted or row.planted_excess < SECOND_LEAST
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
    """Tire, drive and effect of a case, which others share in other worlds."""
    return row.seed, row.carcass, row.planted, row.size


def table(rows: Iterable[Row], today: date) -> tomlkit.TOMLDocument:
    """The table of all classes of which there are enough cases."""
    some = list({drive(row): row for row in counted(rows)}.values())
    out = tomlkit.document()
    out.add(tomlkit.comment("made by `python -m benchmarks.calibration --fit`; do not edit"))
    out["date"] = today.isoformat()
    out["cases"], out["tires"] = len(some), tires(some)
    out["seeds"] = ranges({r.seed for r in some})
    out["priors"] = {"missing": MISSING, "carcasses": CARCASSES, "nuisances": list(NUISANCES)}
    for kind in CLASSES:
        own = [r for r in some if class_of(r.status) == kind]
        manoeuvres = [r.manoeuvres for r in own if r.manoeuvres]
        if len(own) < _FEWEST or not manoeuvres:
            continue
        lacking = set(MISSING) - {missing_in(r) for r in some} - {"nothing"}
        out[kind] = {
            "cases": len(own),
            "tires": tires(own),
            "right": sum(map(is_right, own)),
            "carcasses": sorted({r.carcass for r in own}),
            "manoeuvres": [min(manoeuvres), max(manoeuvres)],
            "lacking": [_LACKING[name] for name in sorted(lacking)],
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


def _claimed(row: Row, known: dict[str, Any]) -> float | None:
    """The least share of right verdicts by the table; None without cases of this kind."""
    return certainty_of(row.status, row.carcass, row.manoeuvres, known).probability


def report(rows: Iterable[Row], known: dict[str, Any]) -> Iterator[str]:
    """The bound of each kind beside what was right, on cases that the table was not made of."""
    used = {s for text in known["seeds"] for s in seeds_of(text)}
    fresh = counted(r for r in rows if r.seed not in used)
    yield f"{len(fresh)} cases that the table of {known['date']} was not made of"
    for kind in CLASSES:
        own = [r for r in fresh if class_of(r.status) == kind]
        bounds = [p for r in own if (p := _claimed(r, known)) is not None]
        if own:
            claim = f"at least {100.0 * min(bounds):.0f} %" if bounds else "nothing"
            yield f"  {kind}: claimed {claim}, right {wilson(sum(map(is_right, own)), len(own))}"


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
