"""Numeric constants of the package, halved and doubled: what moves in the tables and answers.

    constants of a part --one at a time, x 0.5 and x 2--> the tables of clean and faulty logs
        --beside those of the constant as it is--> rows that moved, `ok` rows lost and won,
                                                   `ok` rows that became wrong

`python -m benchmarks.constants --part strain --part wheel [--keep FILE.csv] [--page PAGE.md]`, by
default of all parts that make tables; `--answers` compares diagnoses of the hidden sample logs
instead; `--kept FILE.csv` takes an earlier run for the page. A row has
moved if its number changed by more than a tenth of its own error, or its quality. A constant that
only compiled functions read keeps its value in them, and is listed as `compiled`: it is built in.
Worlds and faults are those of `benchmarks.faults`, of a suite and seed of their own.
"""

from __future__ import annotations

import argparse
import ast
import csv
import importlib
import pkgutil
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pandas as pd

import tirelog
from benchmarks import faults
from tirelog.simulation.simulate import simulate

PARTS = ("dsp", "strain", "wheel", "runs", "readers", "data")
FACTORS = (0.5, 2.0)
#: worlds of the tables: kind of log, fault
WORLDS = (
    ("strain", "none"),
    ("strain", "strain_1: spikes 0.3-1 x60 + rows gone 5-60 ms x20"),
    ("strain", "strain_1: hops 20-200 ms 0.3 x15 + strain_1: lost 5-60 ms x20"),
    ("strain", "strain_1: steps 0.05 + vehicle_speed: held 5-60 ms x20"),
    ("wheel", "none"),
    ("wheel", "encoder: held 5-60 ms x20 + acceleration: spikes 1-2 x60"),
)
SEED, WORLD = 20_261_127, 7
SAMPLES = Path(__file__).parents[1] / "sample_data"


@dataclass
class Moved:
    """What became of the rows by one change of one constant; counts of rows in all worlds."""

    module: str
    name: str
    value: str
    factor: float
    read_by: str
    rows: int = 0
    moved: int = 0
    ok_lost: int = 0
    ok_won: int = 0
    wrong_more: int = 0
    refused: int = field(default=0)


@dataclass(frozen=True)
class Constant:
    """A number at the top of a module, and every module that has it by its name."""

    module: str
    name: str
    value: Any
    holders: tuple[ModuleType, ...]
    compiled: bool


def modules(part: str) -> list[ModuleType]:
    """The modules of a part of the package."""
    package = importlib.import_module(f"tirelog.{part}")
    found = pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    return [importlib.import_module(one.name) for one in found]


def constants(part: str) -> Iterator[Constant]:
    """The numeric constants of a part: numbers and plain tuples of numbers."""
    everywhere = [m for name, m in sys.modules.items() if name.startswith("tirelog")]
    for module in modules(part):
        tree = ast.parse(Path(str(module.__file__)).read_text("utf-8"))
        for node in tree.body:
            targets = node.targets if isinstance(node, ast.Assign) else []
            if isinstance(node, ast.AnnAssign):
                targets = [node.target]
            for target in targets:
                name = target.id if isinstance(target, ast.Name) else ""
                value = getattr(module, name, None) if name.lstrip("_").isupper() else None
                numbers = value if isinstance(value, tuple) else (value,)
                if all(type(one) in (int, float) for one in numbers):
                    holders = tuple(m for m in everywhere if getattr(m, name, None) is value)
                    yield Constant(
                        module.__name__,
                        name,
                        value,
                        holders or (module,),
                        only_compiled(tree, name),
                    )


def only_compiled(tree: ast.Module, name: str) -> bool:
    """Whether only compiled functions of the module read the constant."""
    readers = [
        any("compiled" in ast.unparse(d) for d in node.decorator_list)
        for node in tree.body
        if isinstance(node, ast.FunctionDef)
        and any(isinstance(n, ast.Name) and n.id == name for n in ast.walk(node))
    ]
    return bool(readers) and all(readers)


def changed(value: Any, factor: float) -> Any:
    """The constant times the factor; whole numbers stay whole, and at least one."""
    if isinstance(value, tuple):
        return tuple(changed(one, factor) for one in value)
    return max(1, round(value * factor)) if isinstance(value, int) else value * factor


# ---- Tables of logs.


@dataclass(frozen=True)
class World:
    """A log on disk and its truth."""

    kind: str
    log: faults.Log
    path: Path
    truth: dict[str, np.ndarray]


def worlds(folder: Path) -> list[World]:
    """The logs, written once."""
    out = []
    made = {}
    for number, (kind, name) in enumerate(WORLDS):
        if kind not in made:
            make = faults._strain_world if kind == "strain" else faults.wheel_world
            made[kind] = simulate(make(WORLD, reporting=False))
        simulated = made[kind]
        log, random = faults.log_of(simulated), np.random.default_rng([SEED, number])
        for part in name.split(" + "):
            log = faults.FAULTS[kind][part](log, random)
        own = folder / str(number)
        own.mkdir()
        channel = faults.STRAIN if kind == "strain" else faults.ACCELERATION
        passages = simulated.truth["channels"][channel]["passages"]
        truth = {key: np.array(value, float) for key, value in passages.items()}
        out.append(World(kind, log, faults.written(log, own), truth))
    return out


Answer = dict[tuple[int, str], tuple[pd.DataFrame | None, int]]


def tables(given: list[World]) -> Answer:
    """(world, table) -> its rows, None if refused, and how many are wrong and `ok`."""
    out: Answer = {}
    for number, world in enumerate(given):
        for table, meaning in faults.TABLES[world.kind].items():
            try:
                made = getattr(tirelog, table)(world.path)
                rows = made if isinstance(made, pd.DataFrame) else made[0]
                wrong = faults.judged(world.log, rows, world.truth, meaning).wrong
            except Exception:  # half of a constant may be no sense at all
                rows, wrong = None, 0
            out[number, table] = rows, wrong
    return out


def beside(given: list[World], usual: Answer, new: Answer, moved: Moved) -> None:
    """What differs between two answers, added to `moved`."""
    for (number, table), (rows, wrong) in usual.items():
        other, other_wrong = new[number, table]
        if rows is None:
            continue
        moved.rows += len(rows)
        if other is None:
            moved.refused += 1
            continue
        meaning = faults.TABLES[given[number].kind][table]
        value, errors = meaning.number, meaning.errors
        both = rows.merge(other, on=["channel", "revolution"], how="outer", suffixes=("", "_new"))
        se = np.sqrt(sum(np.nan_to_num(both[e].to_numpy(float)) ** 2 for e in errors if e in both))
        off = np.abs(both[f"{value}_new"] - both[value]).to_numpy(float)
        ok, now = both["quality"] == "ok", both["quality_new"] == "ok"
        gone = both[value].isna() != both[f"{value}_new"].isna()
        moved.moved += int(np.sum((off > 0.1 * se) | gone | (ok != now)))
        moved.ok_lost += int(np.sum(ok & ~now))
        moved.ok_won += int(np.sum(~ok & now))
        moved.wrong_more += other_wrong - wrong


# ---- Answers about models.

#: models of the hidden sample logs whose diagnoses are compared
CARCASSES = ("beam", "ring")


def diagnoses(folder: Path) -> dict[str, dict[str, Any]]:
    """carcass -> the diagnosis of a hidden sample log, as its JSON has it."""
    out = {}
    for carcass in CARCASSES:
        log = SAMPLES / "hidden_1.csv.gz"
        model = tirelog.new_model(carcass, setup=log.with_name("hidden_1.toml"))
        try:
            out[carcass] = tirelog.diagnose(tirelog.measure(log), model).to_json()
        except Exception as problem:  # as above
            out[carcass] = {"verdict": type(problem).__name__}
    return out


def answers_beside(usual: dict[str, Any], new: dict[str, Any], moved: Moved) -> None:
    """Verdicts and names that differ count as moved, and as wrong; errors by a tenth of a floor."""
    for carcass, found in usual.items():
        other = new[carcass]
        moved.rows += 1
        names = ("verdict", "selected", "ambiguous_groups")
        worse = any(found.get(name) != other.get(name) for name in names)
        keys = ("rmse_heldout_before", "rmse_heldout_after", "noise_floor")
        errors = [(found.get(k) or 0.0, other.get(k) or 0.0) for k in keys]
        far = any(abs(a - b) > 0.1 * found["noise_floor"] for a, b in errors)
        moved.moved += int(worse or far)
        moved.wrong_more += int(worse)


def tried(
    part: str, usual: Any, make: Callable[[], Any], differ: Callable[[Any, Any, Moved], None]
) -> Iterator[Moved]:
    """Each constant of a part, halved and doubled."""
    for constant in list(constants(part)):
        for factor in FACTORS:
            value = changed(constant.value, factor)
            moved = Moved(
                constant.module.removeprefix("tirelog."),
                constant.name,
                str(constant.value),
                factor,
                "compiled" if constant.compiled else "python",
            )
            if not constant.compiled and value != constant.value:
                for holder in constant.holders:
                    setattr(holder, constant.name, value)
                try:
                    differ(usual, make(), moved)
                finally:
                    for holder in constant.holders:
                        setattr(holder, constant.name, constant.value)
            yield moved


PAGE = """# Constants and what they decide

Each number at the top of a module was halved and doubled, one at a time, on {logs} logs with known
truth: {clean} clean ones, and {faulty} with two faults each. `python -m benchmarks.constants` did
so on {date}. A row has moved if its quality changed, or its number by more than a tenth of its
error.

{many} constants were tried, and {some} of them moved a row. A cell holds the counts for half and
double: rows that moved, `ok` rows lost and won, and the growth of wrong `ok` rows. The last
column counts the tables that were refused.

| module | constant | value | moved | lost | won | wrong | refused |
| --- | --- | --- | --- | --- | --- | --- | --- |
{rows}

The others moved nothing here. They are sizes of blocks, limits of memory, or decide in other logs:
{others}.
"""


def page_of(found: list[Moved]) -> str:
    """The page: a row per constant that decides something in these logs, and the others' names."""
    pairs: dict[tuple[str, str, str], list[Moved]] = {}
    for moved in found:
        if moved.read_by == "python":
            pairs.setdefault((moved.module, moved.name, moved.value), []).append(moved)
    counts = ("moved", "ok_lost", "ok_won", "wrong_more", "refused")
    rows, others = [], []
    for (module, name, value), both in pairs.items():
        cells = [" / ".join(str(getattr(m, count)) for m in both) for count in counts]
        if any(int(getattr(m, count)) for m in both for count in counts):
            short = value if len(value) < 24 else f"{value[:20]}..."
            rows.append(f"| {module} | `{name}` | {short} | {' | '.join(cells)} |")
        else:
            others.append(f"`{module}.{name}`")
    clean = sum(fault == "none" for _, fault in WORLDS)
    return PAGE.format(
        date=f"{datetime.now(UTC):%Y-%m-%d}",
        logs=len(WORLDS),
        clean=clean,
        faulty=len(WORLDS) - clean,
        many=len(pairs),
        some=len(rows),
        rows="\n".join(rows),
        others=", ".join(others),
    )


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.constants", description=__doc__)
    parser.add_argument("--part", action="append", help="of the package; several times")
    parser.add_argument("--answers", action="store_true", help="diagnoses in place of tables")
    parser.add_argument("--keep", type=Path, help="a CSV file for the table")
    parser.add_argument("--page", type=Path, help="a Markdown file for the page")
    parser.add_argument("--kept", type=Path, help="the table of an earlier run, for the page")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    if asked.kept:
        kept = pd.read_csv(asked.kept, dtype={"value": str}).to_dict("records")
        asked.page.write_text(page_of([Moved(**row) for row in kept]), encoding="utf-8")
        return 0
    found: list[Moved] = []
    with tempfile.TemporaryDirectory(prefix="constants-") as scratch:
        folder = Path(scratch)
        given = [] if asked.answers else worlds(folder)
        make = (lambda: diagnoses(folder)) if asked.answers else (lambda: tables(given))
        usual = make()

        def differ(before: Any, after: Any, moved: Moved) -> None:
            if asked.answers:
                answers_beside(before, after, moved)
            else:
                beside(given, before, after, moved)

        for part in asked.part or (("inference", "diagnosis") if asked.answers else PARTS):
            for moved in tried(part, usual, make, differ):
                found.append(moved)
                print(*asdict(moved).values(), sep="\t", flush=True)
    if asked.keep:
        with asked.keep.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(asdict(found[0])))
            writer.writeheader()
            writer.writerows(map(asdict, found))
    if asked.page:
        asked.page.write_text(page_of(found), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
