"""Nuisances that every car has, in the truth: how often `diagnose` takes one for missing physics.

    python -m benchmarks.nuisances [--worlds all|control,radius,run_out_3+warming] [--seeds 1-4]
                                   [--effects none|all|turn|NAME,...] [--sizes small,large]
                                   [--carcass beam,ring] [--jobs 2] [-o FILE.csv]
                                   [--keep DIR [--write-only]]
    python -m benchmarks.nuisances --summary FILE.csv

A case is two logs of about a minute, written as files, measured and diagnosed as a user would. Row
by row into FILE.csv (what is there already is not done again), then rates with 95 % Wilson bounds.
`--keep DIR` leaves each case's scenarios, logs, setups, truths and model.toml in a folder of DIR.
Seeds below 1000 are for choosing thresholds, from 20000 on for reporting, on other tires and plans
(`benchmarks.nuisance_worlds`). `--worlds two` or `four` draws so many nuisances anew for each seed,
`all` is every single one; `--effects turn` plants one effect per seed, the next for the next. An
effect's strength is such that its excess in the control world, beside a refitted model, is 2 to 4
squared floors (small) or 10 to 20 (large).
"""

from __future__ import annotations

import argparse
import csv
import json
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import MISSING, asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

import tirelog
from benchmarks.cases import IN_CATALOGUE
from benchmarks.hidden import wilson
from benchmarks.nuisance_worlds import AT_ONCE, WORLDS, CaseOf, parts_of, planted_tables, several
from tirelog.errors import TirelogError
from tirelog.physics.model.file import new_model
from tirelog.simulation import simulate, write_log

#: squared floors that a planted effect leaves beside the refitted model, by the name of its size
SIZES = {"small": (2.0, 4.0), "large": (10.0, 20.0)}
#: a sentence that says "the noise floor" is contradicted beyond these: held-out error over the
#: floor, reduced chi-square
HELD_OUT_AT_FLOOR, CHI2_AT_FLOOR = 1.05, 1.2
#: a strength is found by at most so many refits, each within this factor of the one before
STEPS, LARGEST_STEP = 5, 20.0
#: least excess that a step in strength is taken from [squared floors]: below it is noise
SEEN = 0.05


@dataclass(frozen=True)
class Row:
    """One case and what was said of it; sizes in squared floors.

    What stands after `sentence` is not in the rows of older runs.
    """

    world: str
    seed: int
    carcass: str
    planted: str
    size: str
    strength: float
    planted_excess: float
    status: str
    named: str
    sets: str
    share: float
    heldout_before: float
    heldout_after: float
    chi2_before: float
    chi2_after: float
    excess: float
    excess_left: float
    manoeuvres: int
    cpu_s: float
    sentence: str
    form: str = "exact"
    logs: int = 2


@dataclass(frozen=True)
class Task:
    """A seed with one planted effect (or none) in several worlds: its strength is found once."""

    worlds: tuple[str, ...]
    seed: int
    carcass: str
    effect: str
    size: str
    keep: str | None
    write_only: bool


def written(case: CaseOf, folder: Path) -> tuple[list[Path], Path]:
    """(logs, model file) of a case, in a folder of its own."""
    folder.mkdir(parents=True, exist_ok=True)
    logs = []
    for number, (text, scenario) in enumerate(
        zip(case.texts(), case.scenarios(), strict=True), start=1
    ):
        (folder / f"scenario_{number}.toml").write_text(text, encoding="utf-8")
        logs.append(write_log(simulate(scenario), folder / f"log_{number}.csv")[0])
    with tirelog.open_log(logs[0]) as log:
        model, _ = new_model(case.carcass, log.setup, contact=case.contact)
    tirelog.save_model(model, folder / "model.toml")
    return logs, folder / "model.toml"


def folder_of(case: CaseOf, size: str) -> str:
    planted = f"{case.effect}_{size}" if case.effect else "none"
    return f"{case.carcass}_{case.world}_{case.seed}_{planted}"


def strength_of(task: Task) -> tuple[float, float]:
    """(strength in ordinary ones, its excess in squared floors) of a planted effect.

    In the control world, beside a refitted model; the excess wanted is drawn by seed and effect.
    """
    low, high = SIZES[task.size]
    share = np.random.default_rng([task.seed, 18, sum(task.effect.encode())]).uniform()
    wanted = low * (high / low) ** share
    strength, best, before = 1.0, (1.0, float("nan")), (0.0, 0.0)
    for _ in range(STEPS):
        case = CaseOf("control", task.seed, task.carcass, task.effect, strength)
        try:
            with tempfile.TemporaryDirectory() as scratch:
                logs, model = written(case, Path(scratch))
                read = tirelog.load_model(model)
                found = tirelog.compare(tirelog.measure(logs, read), read)
        except TirelogError:
            strength *= 0.5
            continue
        excess = (found.rmse_heldout or 0.0) ** 2 / found.noise_floor**2 - 1.0
        if not abs(excess - wanted) >= abs(best[1] - wanted):
            best = strength, excess
        if low <= excess <= high and abs(excess / wanted - 1.0) < 0.2:
            break
        # an excess grows as the square of a small effect, and less of a large one
        power, here = 2.0, (np.log(strength), np.log(max(excess, SEEN)))
        if before != (0.0, 0.0) and here[0] != before[0]:
            power = float(np.clip((here[1] - before[1]) / (here[0] - before[0]), 0.7, 4.0))
        before = here
        step = (wanted / max(excess, SEEN)) ** (1.0 / power)
        strength *= float(np.clip(step, 1.0 / LARGEST_STEP, LARGEST_STEP))
    return best


def run(task: Task) -> list[Row]:
    """The rows of a task; a case that cannot be driven has the status `refused`."""
    strength, excess = strength_of(task) if task.effect else (0.0, 0.0)
    rows = []
    for world in task.worlds:
        case = CaseOf(world, task.seed, task.carcass, task.effect, strength)
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(task.keep or scratch) / folder_of(case, task.size)
            size = task.size if case.effect else ""
            rows.append(row_of(case, size, folder, excess, write_only=task.write_only))
    return rows


def row_of(
    case: CaseOf, size: str, folder: Path, excess: float, *, write_only: bool = False
) -> Row:
    """A case measured and diagnosed as a user would, in a folder of its own."""
    nan = float("nan")
    row = Row(
        case.world, case.seed, case.carcass, case.effect, size,
        case.strength if case.effect else 0.0, excess, "written", "", "[]", nan, nan, nan, nan,
        nan, nan, nan, 0, nan, "", case.form, case.logs,
    )  # fmt: skip
    try:
        logs, file = written(case, folder)
        if write_only:
            return row
        begun = time.process_time()
        model = tirelog.load_model(file)
        found = tirelog.diagnose(tirelog.measure(logs, model), model)
        seconds = time.process_time() - begun
    except TirelogError as problem:
        return replace(row, status="refused", sentence=str(problem))
    floor = found.noise_floor
    before, after = (
        (r or nan) / floor for r in (found.rmse_heldout_before, found.rmse_heldout_after)
    )
    if not found.selected:
        after = before
    left, was = (max(x**2 - 1.0, 0.0) for x in (after, before))
    return replace(
        row,
        status=found.verdict,
        named="+".join(found.selected),
        sets=json.dumps(found.ambiguous_groups),
        share=1.0 - left / was if was > 0 else 0.0,
        heldout_before=before,
        heldout_after=after,
        chi2_before=found.reduced_chi2_before,
        chi2_after=found.reduced_chi2_after,
        excess=before**2 - 1.0,
        excess_left=after**2 - 1.0,
        manoeuvres=found.manoeuvres,
        cpu_s=seconds,
        sentence=found.sentence,
    )


# ---- what the rows say --------------------------------------------------------------------------


def names(row: Row) -> set[str]:
    return set(row.named.split("+")) - {""}


def right(row: Row) -> bool:
    """The truth is named, or stands in a set of at most two."""
    sets = json.loads(row.sets)
    return row.planted in names(row) or any(row.planted in s and len(s) <= 2 for s in sets)


def false_names(row: Row) -> set[str]:
    """What is named and not planted; a set with the truth in it counts as the truth."""
    apart = {name for s in json.loads(row.sets) if row.planted in s for name in s}
    return names(row) - {row.planted} - apart


def of_size(row: Row) -> bool:
    """Is what was planted as large as it should be, to a tenth?"""
    if not row.planted:
        return False
    low, high = SIZES[row.size]
    return 0.9 * low <= row.planted_excess <= 1.1 * high


def contradicted(row: Row) -> bool:
    """Is the floor claimed at an error or a chi-square that is more, and this is not said?"""
    more = row.heldout_after > HELD_OUT_AT_FLOOR and "held out it is" not in row.sentence
    return row.status == "nothing_missing" and (more or row.chi2_after > CHI2_AT_FLOOR)


def shown(row: Row) -> str:
    """The line of the table that a row counts in: several nuisances by their number."""
    parts = row.world.count("+") + 1
    return row.world if parts == 1 else f"{parts} at once"


def summary(rows: list[Row]) -> Iterator[str]:
    """Rates by carcass and world, for logs without and with a planted effect."""
    for carcass in sorted({row.carcass for row in rows}):
        driven = [
            r for r in rows if r.carcass == carcass and r.status not in ("refused", "written")
        ]
        nulls, planted = [r for r in driven if not r.planted], [r for r in driven if of_size(r)]
        missed = {(r.seed, r.planted, r.size) for r in driven if r.planted and not of_size(r)}
        if nulls:
            yield f"\n{carcass}, nothing planted"
            yield from _table(
                nulls,
                ("nothing missing", lambda r: r.status == "nothing_missing"),
                ("false name", lambda r: bool(names(r))),
                ("sentence contradicted", contradicted),
            )
        for size in sorted({row.size for row in planted}, reverse=True):
            low, high = SIZES[size]
            yield f"\n{carcass}, one effect of {low:g} to {high:g} squared floors"
            some = [r for r in planted if r.size == size]
            yield from _table(
                some,
                ("right, or in a set of two", right),
                ("false name beside or instead", lambda r: bool(false_names(r))),
                ("sentence contradicted", contradicted),
            )
            wrong: dict[str, list[str]] = {}
            for row in some:
                if not right(row) or false_names(row):
                    wrong.setdefault(row.planted, []).append(
                        f"{row.world}: {row.status} {row.named}"
                    )
            for name, cases in sorted(wrong.items()):
                of = sum(r.planted == name for r in some)
                yield f"    {name}: {len(cases)} of {of} wrong, as {'; '.join(cases[:4])}"
        if missed:
            each = "; ".join(f"{p} {size} ({seed})" for seed, p, size in sorted(missed))
            yield f"    left out, since no strength gave the size: {each}"
        said: dict[str, int] = {}
        for row in nulls:
            for name in names(row):
                said[f"{row.world}: {name}"] = said.get(f"{row.world}: {name}", 0) + 1
        if said:
            yield "    falsely named: " + ", ".join(f"{k} x{n}" for k, n in sorted(said.items()))
    refused = [r for r in rows if r.status == "refused"]
    if refused:
        yield f"\n{len(refused)} cases could not be driven, as {refused[0].world} "
        yield f"    {refused[0].planted} {refused[0].seed}: {refused[0].sentence}"
    seconds = sorted(r.cpu_s for r in rows if np.isfinite(r.cpu_s))
    if seconds:
        middle = seconds[len(seconds) // 2]
        yield f"\n{len(seconds)} diagnoses, {middle:.1f} s of CPU each, {seconds[-1]:.1f} s at most"


def _table(rows: list[Row], *columns: tuple[str, Callable[[Row], bool]]) -> Iterator[str]:
    """A line per world and one for all, with the median excess and chi-square."""
    head = "".join(f"{name:38s}" for name, _ in columns)
    yield f"{'world':34s}{head}{'excess':>9s}{'chi2':>9s}"
    order = {world: number for number, world in enumerate(WORLDS)}
    known = sorted({shown(r) for r in rows}, key=lambda w: (order.get(w, len(order)), w))
    for world in [*known, "all"]:
        of = [r for r in rows if world in ("all", shown(r))]
        rates = "".join(f"{wilson(sum(map(good, of)), len(of)):38s}" for _, good in columns)
        excess, chi2 = (
            float(np.median([getattr(r, k) for r in of])) for k in ("excess", "chi2_before")
        )
        yield f"{world:34s}{rates}{excess:9.2f}{chi2:9.2f}"


# ---- rows in a file -----------------------------------------------------------------------------


def read_rows(path: Path) -> list[Row]:
    """The rows of an earlier run; columns that it did not have yet are as their defaults."""
    with path.open(newline="", encoding="utf-8") as stream:
        return [
            Row(
                **{
                    f.name: _PARSE[str(f.type)](row[f.name])
                    for f in fields(Row)
                    if f.name in row or f.default is MISSING
                }
            )
            for row in csv.DictReader(stream)
        ]


_PARSE: dict[str, Callable[[str], Any]] = {"str": str, "int": int, "float": float}


def seeds_of(text: str) -> range:
    """1-4 is 1, 2, 3, 4; one number is that alone."""
    first, _, last = text.partition("-")
    return range(int(first), int(last or first) + 1)


def tasks_of(options: argparse.Namespace, done: Iterable[Row]) -> list[Task]:
    """What is still to do."""
    known = {(r.world, r.seed, r.carcass, r.planted, r.size) for r in done}
    given = options.worlds.split(",")
    worlds = [w for name in given for w in (WORLDS if name == "all" else [name])]
    for world in worlds:
        if world not in AT_ONCE:
            parts_of(world)
    named = {"none": [""], "all": list(IN_CATALOGUE)}.get(
        options.effects, ["" if e == "none" else e for e in options.effects.split(",")]
    )
    out = []
    for seed in seeds_of(options.seeds):
        turn = [IN_CATALOGUE[seed % len(IN_CATALOGUE)]]
        effects = turn if options.effects == "turn" else named
        for effect in effects:
            if effect:
                planted_tables(effect, 1.0)  # refused at once if there is none of that name
        for carcass in options.carcass.split(","):
            for effect in effects:
                for size in options.sizes.split(",") if effect else [""]:
                    drawn = [several(AT_ONCE[w], seed) if w in AT_ONCE else w for w in worlds]
                    left = [w for w in drawn if (w, seed, carcass, effect, size) not in known]
                    keep = str(options.keep) if options.keep else None
                    # a strength is found once for all worlds; without one each goes alone
                    out += [
                        Task(some, seed, carcass, effect, size, keep, options.write_only)
                        for some in ([tuple(left)] if effect else [(w,) for w in left])
                        if some
                    ]
    return out


def main() -> None:
    """Run cases, or sum up what has run."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--worlds", default="all")
    parser.add_argument("--seeds", default="20000-20001")
    parser.add_argument("--effects", default="none")
    parser.add_argument("--sizes", default="small")
    parser.add_argument("--carcass", default="beam")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--write-only", action="store_true")
    parser.add_argument("--summary", type=Path)
    options = parser.parse_args()
    if options.write_only and not options.keep:
        parser.error("--write-only needs --keep DIR")
    if options.summary:
        print("\n".join(summary(read_rows(options.summary))))
        return
    rows = read_rows(options.output) if options.output and options.output.exists() else []
    try:
        tasks = tasks_of(options, rows)
    except TirelogError as problem:
        parser.error(str(problem))
    with ProcessPoolExecutor(options.jobs) as pool:
        for some in pool.map(run, tasks):
            rows += some
            for row in some:
                print(
                    f"{row.carcass} {row.world} {row.seed} {row.planted or 'none'}: {row.status} "
                    f"{row.named} (excess {row.excess:.2f}, chi2 {row.chi2_before:.2f})",
                    flush=True,
                )
            if options.output:
                append_rows(options.output, some)
    if not options.write_only:
        print("\n".join(summary(rows)))


def append_rows(path: Path, rows: Iterable[Row]) -> None:
    """Add rows to a file; a new one gets its head, an older one keeps the columns that it has."""
    names = [f.name for f in fields(Row)]
    if path.exists() and path.stat().st_size:
        with path.open(newline="", encoding="utf-8") as stream:
            names = next(csv.reader(stream))
    with path.open("a", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, names, extrasaction="ignore")
        if stream.tell() == 0:
            writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


if __name__ == "__main__":
    main()
