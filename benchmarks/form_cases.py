"""Tires whose form no model has: what `diagnose` and `footprint` say, through the command line.

    python -m benchmarks.form_cases --suite tuning|reporting [--forms all|flat,saddle,...]
                                    [--effects none|all|aero_load,...] [--tires 1-5]
                                    [--carcass beam|ring] [--jobs 2] [-o FILE.csv]
                                    [--only diagnose|footprint] [--keep DIR [--write-only]]
    python -m benchmarks.form_cases --summary FILE.csv
    python -m benchmarks.form_cases --list

A case is two logs of about a minute (`benchmarks.form_worlds`), with a fresh model of their setup.
Row by row into FILE.csv; what is there already is not done again. `all` of the forms are those of
the suite's spectral truth (tense_ring and solid_belt are asked for by name, and have fewer
effects: `benchmarks.form_solved`), `all` of the effects include none. `--keep DIR` leaves logs,
setups, truth.json, model.toml and what the commands wrote in a folder of DIR. Commands run in
processes of their own, so that their CPU and memory are theirs; `tirelog` is that of the
PYTHONPATH.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import numpy as np

from benchmarks.form_solved import EFFECTS_SOLVED, solved_case
from benchmarks.form_worlds import EFFECTS, FORMS, case_of, write_case

NAN = float("nan")
#: effects whose names stand for the same constant part of a tire's form: a name among them is
#: no false name where the form has it
OF_FORM = {
    "shifted": {"pressure_offset"},
    "leaning_saddle": {"pressure_offset"},
    "shear_layer": {"belt_tension"},
    "flat_shear": {"belt_tension"},
}


@dataclass(frozen=True)
class Row:
    """A case and what was said of it; errors held out in floors, lengths against the truth."""

    suite: str
    form: str
    effect: str
    tire: int
    carcass: str
    status: int = 0
    verdict: str = ""
    selected: str = ""
    groups: str = "[]"
    heldout_before: float = NAN
    heldout_after: float = NAN
    floor: float = NAN
    chi2_before: float = NAN
    chi2_after: float = NAN
    ranking: str = ""
    cpu_s: float = NAN
    peak_MB: float = NAN
    length_rows: int = 0
    length_ok: int = 0
    length_ratio: float = NAN
    length_error: float = NAN
    within_1: float = NAN
    within_2: float = NAN
    length_trend: float = NAN
    trend_sigmas: float = NAN
    footprint_cpu_s: float = NAN

    @property
    def key(self) -> tuple[str, str, str, int, str]:
        return self.suite, self.form, self.effect, self.tire, self.carcass


@dataclass(frozen=True)
class Task:
    """A case to do, and how much of it."""

    row: Row
    only: str
    keep: str | None
    write_only: bool


def command(arguments: list[str], output: Path) -> tuple[int, float, float]:
    """(exit status, CPU seconds, peak memory [MB]) of a command of tirelog."""
    with output.open("wb") as out, output.with_suffix(".err").open("wb") as errors:
        process = subprocess.Popen(
            [sys.executable, "-m", "tirelog", *arguments], stdout=out, stderr=errors
        )
        _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024.0


def run(task: Task) -> Row:
    """A case written, diagnosed and measured."""
    row = task.row
    with tempfile.TemporaryDirectory() as scratch:
        name = f"{row.suite}_{row.form}_{row.effect or 'none'}_{row.tire}_{row.carcass}"
        folder = Path(task.keep or scratch) / name
        draw = solved_case if row.form in EFFECTS_SOLVED else case_of
        logs = write_case(draw(row.suite, row.form, row.effect, row.tire), folder)
        setup = folder / "log_1.csv.toml"
        model = folder / "model.toml"
        made = ["model", "new", "--carcass", row.carcass, "--setup", str(setup), "-o", str(model)]
        status, _, _ = command(made, folder / "new.txt")
        if status or task.write_only:
            return replace(row, status=status, verdict="" if status else "written")
        paths = [str(log) for log in logs]
        if task.only != "footprint":
            row = _diagnosed(row, paths, model, folder)
        if task.only != "diagnose":
            row = _measured(row, paths, folder)
    return row


def _diagnosed(row: Row, logs: list[str], model: Path, folder: Path) -> Row:
    """The row with what `diagnose` says."""
    output = folder / "diagnosis.json"
    asked = ["diagnose", *logs, "--model", str(model), "--format", "json", "--quiet"]
    status, seconds, peak = command(asked, output)
    row = replace(row, status=status, cpu_s=seconds, peak_MB=peak)
    if status:
        return replace(row, verdict="failed")
    said = json.loads(output.read_text("utf-8"))
    floor = said["noise_floor"]
    after = said["rmse_heldout_after"] if said["selected"] else said["rmse_heldout_before"]
    number = _number
    return replace(
        row,
        verdict=said["verdict"],
        selected="+".join(said["selected"]),
        groups=json.dumps(said["ambiguous_groups"]),
        heldout_before=number(said["rmse_heldout_before"]) / floor,
        heldout_after=number(after) / floor,
        floor=floor,
        chi2_before=number(said.get("reduced_chi2_before")),
        chi2_after=number(said.get("reduced_chi2_after")),
        ranking=" ".join(
            f"{e['effect']}:{number(e['excess_removed']):.3f}" for e in said["effects"][:3]
        ),
    )


def _number(value: float | None) -> float:
    return NAN if value is None else float(value)


def _measured(row: Row, logs: list[str], folder: Path) -> Row:
    """The row with what `footprint` says of the length, of rows marked ok.

    The error is that of the noise and that of the form, added in squares, as the docs prescribe.
    The trend is the change of told over true from the slowest to the fastest third of a log, the
    larger one of the two: each log has an error of form of its own.
    """
    output = folder / "footprint.csv"
    status, seconds, _ = command(
        ["footprint", *logs, "--quiet", "-o", str(output)], folder / "f.txt"
    )
    row = replace(row, footprint_cpu_s=seconds)
    if status or not output.exists():
        return replace(row, status=status or 1)
    truth = {log["log"]: log for log in json.loads((folder / "truth.json").read_text())["logs"]}
    table, all_rows = [], 0
    with output.open(newline="") as stream:
        for given in csv.DictReader(stream):
            all_rows += 1
            if given["quality"] != "ok" or not given["length_m"]:
                continue
            log = truth[Path(given["log"]).name]
            told, time = float(given["length_m"]), float(given["time_s"])
            true = float(np.interp(time, log["time_s"], log["length_m"]))
            parts = [float(given.get(c) or 0.0) for c in ("length_se_m", "length_form_se_m")]
            row_of_log = float(list(truth).index(log["log"]))
            error = math.hypot(*parts) / true
            table.append((told / true, error, float(given["speed_m_s"]), row_of_log))
    row = replace(row, length_rows=all_rows, length_ok=len(table))
    if len(table) < 12:
        return row
    ratio, error, speed, number = np.array(table).T
    trends = []
    for own in (number == k for k in np.unique(number) if np.sum(number == k) >= 12):
        slow, fast = np.quantile(speed[own], [1 / 3, 2 / 3])
        ends = [ratio[own & (speed <= slow)], ratio[own & (speed >= fast)]]
        trends.append(float(np.median(ends[1]) - np.median(ends[0])))
    trend = max(trends, key=abs, default=NAN)
    beyond = np.abs(ratio - 1.0) / np.maximum(error, 1e-12)
    middle = float(np.median(error))
    return replace(
        row,
        length_ratio=float(np.median(ratio)),
        length_error=middle,
        within_1=float(np.mean(beyond <= 1.0)),
        within_2=float(np.mean(beyond <= 2.0)),
        length_trend=trend,
        trend_sigmas=abs(trend) / middle,
    )


# ---- what the rows say --------------------------------------------------------------------------


def wilson(hits: int, of: int) -> str:
    """hits/of with its 95 % Wilson interval."""
    if not of:
        return "none"
    z, p = 1.96, hits / of
    centre, half = p + z * z / (2 * of), z * math.sqrt(p * (1 - p) / of + z * z / (4 * of * of))
    low, high = (max(0.0, (centre + s * half) / (1 + z * z / of)) for s in (-1, 1))
    return f"{hits}/{of} = {100 * p:.0f} % [{100 * low:.0f}, {100 * high:.0f}]"


def names(row: Row) -> set[str]:
    return set(row.selected.split("+")) - {""}


def right(row: Row) -> bool:
    """The planted effect is named, or stands in a set of at most two."""
    sets = json.loads(row.groups)
    return row.effect in names(row) or any(row.effect in s and len(s) <= 2 for s in sets)


def alone(row: Row) -> bool:
    """It is named, and nothing beside it but what the form is made of."""
    return right(row) and not false_names(row)


def false_names(row: Row) -> set[str]:
    """Names that are neither planted, nor in a set with what is, nor the form's own."""
    beside = {name for s in json.loads(row.groups) if row.effect in s for name in s}
    return names(row) - {row.effect} - beside - OF_FORM.get(row.form, set())


def quiet(row: Row) -> bool:
    """Nothing is planted: nothing is missing, or only what the form is made of."""
    return row.verdict == "nothing_missing" or (
        row.verdict == "missing" and bool(names(row)) and not false_names(row)
    )


def summary(rows: list[Row]) -> Iterator[str]:
    """Rates by suite, carcass and form, and by effect."""
    for suite, carcass in sorted({(r.suite, r.carcass) for r in rows}):
        some = [r for r in rows if (r.suite, r.carcass) == (suite, carcass) and r.verdict]
        some = [r for r in some if r.verdict != "written"]
        if some:
            yield f"\n{suite}, compared with a {carcass}: {len(some)} diagnoses"
            yield from _rates("form", lambda r: r.form, some)
            yield from _rates("effect", lambda r: r.effect or "none", some)
            wrong = [r for r in some if false_names(r) or (r.effect and not right(r))]
            for r in wrong:
                yield (
                    f"    {r.form} {r.effect or 'none'} {r.tire}: {r.verdict} "
                    f"{r.selected or '-'} {r.groups if r.groups != '[]' else ''} "
                    f"({r.heldout_before:.2f} -> {r.heldout_after:.2f} floors; {r.ranking})"
                )
            for label, values in (("CPU s", [r.cpu_s for r in some]),
                                  ("peak MB", [r.peak_MB for r in some])):  # fmt: skip
                middle, most = np.nanmedian(values), np.nanmax(values)
                yield f"    {label} per diagnosis: median {middle:.0f}, at most {most:.0f}"
        told = [r for r in rows if (r.suite, r.carcass) == (suite, carcass) and r.length_rows]
        if told:
            yield f"\n{suite}: length of {len(told)} pairs of logs, rows marked ok"
            yield (
                f"{'form':18s}{'ok/rows':>16s}{'told/true':>18s}{'error':>8s}"
                f"{'in 1':>7s}{'in 2':>7s}{'trend':>9s}"
            )
            for form in _in_order(r.form for r in told):
                of = [r for r in told if r.form == form]
                ok, all_rows = sum(r.length_ok for r in of), sum(r.length_rows for r in of)
                seen = [r for r in of if r.length_ok >= 12]
                line = f"{form:18s}{f'{ok}/{all_rows}':>16s}"
                if seen:
                    ratios = [r.length_ratio for r in seen]
                    weights = [r.length_ok for r in seen]
                    one, two = (
                        100 * np.average([getattr(r, k) for r in seen], weights=weights)
                        for k in ("within_1", "within_2")
                    )
                    trend = max((r.length_trend for r in seen), key=abs)
                    line += (
                        f"{f'{min(ratios):.3f}..{max(ratios):.3f}':>18s}"
                        f"{100 * np.median([r.length_error for r in seen]):7.2f}%"
                        f"{one:6.0f}%{two:6.0f}%{100 * trend:+8.2f}%"
                    )
                yield line


def _in_order(values: Iterator[str]) -> list[str]:
    return list(dict.fromkeys(values))


def _rates(head: str, of: Callable[[Row], str], rows: list[Row]) -> Iterator[str]:
    """A line per form or effect, and one of all."""
    yield (
        f"{head:18s}{'nulls: quiet':26s}{'nulls: false name':26s}{'named or in a set of 2':26s}"
        f"{'named, nothing false':26s}{'false name':26s}{'before':>8s}{'after':>8s}"
    )
    for value in [*_in_order(of(r) for r in rows), "all"]:
        some = [r for r in rows if value in ("all", of(r))]
        nulls = [r for r in some if not r.effect]
        planted = [r for r in some if r.effect]
        rates = [
            (quiet, nulls),
            (lambda r: bool(false_names(r)), nulls),
            (right, planted),
            (alone, planted),
            (lambda r: bool(false_names(r)), planted),
        ]
        line = "".join(f"{wilson(sum(map(good, x)), len(x)):26s}" for good, x in rates)
        middle = [np.nanmedian([getattr(r, k) for r in some]) for k in _HELDOUT]
        yield f"{value:18s}{line}{middle[0]:8.2f}{middle[1]:8.2f}"


_HELDOUT = ("heldout_before", "heldout_after")


# ---- rows in a file -----------------------------------------------------------------------------

_PARSE: dict[str, Callable[[str], object]] = {"str": str, "int": int, "float": float}


def read_rows(path: Path) -> list[Row]:
    """The rows of an earlier run."""
    with path.open(newline="", encoding="utf-8") as stream:
        return [
            Row(**{f.name: _PARSE[str(f.type)](row[f.name]) for f in fields(Row) if f.name in row})  # type: ignore[arg-type]
            for row in csv.DictReader(stream)
        ]


def append_row(path: Path, row: Row) -> None:
    """Add a row to a file; a new one gets its head."""
    with path.open("a", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, [f.name for f in fields(Row)])
        if stream.tell() == 0:
            writer.writeheader()
        writer.writerow(
            {k: f"{v:.6g}" if isinstance(v, float) else v for k, v in asdict(row).items()}
        )


def tasks_of(options: argparse.Namespace, done: list[Row]) -> list[Task]:
    """What is still to do.  SystemExit for a form or an effect that is not known."""
    forms = list(FORMS[options.suite]) if options.forms == "all" else options.forms.split(",")
    effects = ["none", *EFFECTS] if options.effects == "all" else options.effects.split(",")
    known_forms = [*FORMS[options.suite], *EFFECTS_SOLVED]
    for given, known in ((forms, known_forms), (effects, ["none", *EFFECTS])):
        for name in given:
            if name not in known:
                sys.exit(f"unknown {name!r}; allowed are {', '.join(known)}")
    first, _, last = options.tires.partition("-")
    keys = {row.key for row in done}
    rows = [
        Row(options.suite, form, "" if effect == "none" else effect, tire, options.carcass)
        for tire in range(int(first), int(last or first) + 1)
        for form in forms
        for effect in effects
        if effect == "none" or effect in EFFECTS_SOLVED.get(form, EFFECTS)
    ]
    keep = str(options.keep) if options.keep else None
    return [
        Task(row, options.only, keep, options.write_only) for row in rows if row.key not in keys
    ]


def main() -> None:
    """Run cases, or sum up what has run."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--suite", choices=list(FORMS), default="tuning")
    parser.add_argument("--forms", default="all")
    parser.add_argument("--effects", default="all")
    parser.add_argument("--tires", default="1")
    parser.add_argument("--carcass", choices=("beam", "ring"), default="beam")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", choices=("both", "diagnose", "footprint"), default="both")
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--write-only", action="store_true")
    parser.add_argument("--summary", type=Path)
    parser.add_argument("--list", action="store_true")
    options = parser.parse_args()
    if options.write_only and not options.keep:
        parser.error("--write-only needs --keep DIR")
    if options.list:
        for suite, forms in FORMS.items():
            print(f"{suite}: {', '.join(forms)}")
        print(f"effects: none, {', '.join(EFFECTS)}")
        for form, effects in EFFECTS_SOLVED.items():
            print(f"in both suites, by name: {form} with none, {', '.join(effects)}")
        return
    if options.summary:
        print("\n".join(summary(read_rows(options.summary))))
        return
    rows = read_rows(options.output) if options.output and options.output.exists() else []
    with ProcessPoolExecutor(options.jobs) as pool:
        for row in pool.map(run, tasks_of(options, rows)):
            rows.append(row)
            print(
                f"{row.suite} {row.form} {row.effect or 'none'} {row.tire} {row.carcass}: "
                f"{row.verdict} {row.selected} ({row.heldout_before:.2f} -> "
                f"{row.heldout_after:.2f} floors, length {row.length_ratio:.3f}, "
                f"{row.cpu_s:.0f} s)",
                flush=True,
            )
            if options.output:
                append_row(options.output, row)
    if not options.write_only:
        print("\n".join(summary(rows)))


if __name__ == "__main__":
    main()
