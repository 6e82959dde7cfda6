"""Golden copies of all that the sample logs give: tables, fits, verdicts; for a change that is to
move no number.

    python -m benchmarks.goldens write FOLDER       every table, fit, comparison and verdict of the
                                                    sample logs
    python -m benchmarks.goldens compare OLD NEW    each number that differs by more than the
                                                    tolerance

A golden is made by the commands, so that the package behind them may change. The verdicts of `make
hidden` are compared too where both folders hold a `hidden.csv` (python -m benchmarks.hidden -o
FOLDER/hidden.csv).
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import shutil
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

SAMPLES = Path(__file__).resolve().parents[1] / "sample_data"
STRAIN = (
    "drive.csv.gz",
    "drive_messages.mcap",
    "cleat.csv.gz",
    "hidden_1.csv.gz",
    "hidden_2.csv.gz",
    "unknown_1.csv.gz",
    "unknown_2.csv.gz",
)
WHEEL = ("encoder.h5", "encoder_ramp.h5", "cleat.csv.gz")
#: carcass, logs that are compared together, observable
QUESTIONS = {
    "hidden_beam": ("beam", ("hidden_1.csv.gz", "hidden_2.csv.gz"), None),
    "hidden_ring": ("ring", ("hidden_1.csv.gz", "hidden_2.csv.gz"), None),
    "unknown_beam": ("beam", ("unknown_1.csv.gz", "unknown_2.csv.gz"), None),
    "drive_beam": ("beam", ("drive.csv.gz",), None),
    "drive_ring": ("ring", ("drive.csv.gz",), None),
    "drive_patch": ("beam", ("drive.csv.gz",), "patch_length"),
    "drive_dissipation": ("beam", ("drive.csv.gz",), "dissipation_factor"),
    "cleat_coupled": ("coupled_ring", ("cleat.csv.gz",), None),
    "encoder_beam": ("beam", ("encoder.h5", "encoder_ramp.h5"), "radial_acceleration"),
    "encoder_shift": ("beam", ("encoder.h5",), "phase_shift"),
}
#: relative and absolute; a number below the second counts as zero
TOLERANCE = (1e-6, 1e-9)
#: seconds and paths are no results
LEFT_OUT = ("seconds", "version", "file", "path")


def tirelog(folder: Path, *arguments: str) -> None:
    """A command beside the samples; what it says and its status are golden too."""
    done = subprocess.run(
        [sys.executable, "-m", "tirelog", *arguments], cwd=folder, capture_output=True, text=True
    )
    words = [w for w in arguments if w not in ("--quiet",)]
    with (folder / "statuses.txt").open("a") as stream:
        stream.write(f"{' '.join(words)}: {done.returncode}\n")


def write(folder: Path) -> None:
    """All goldens of the sample logs, two commands at a time."""
    folder.mkdir(parents=True, exist_ok=True)
    for sample in SAMPLES.iterdir():
        if sample.is_file():
            shutil.copy(sample, folder)
    tasks: list[list[tuple[str, ...]]] = []
    for log in STRAIN:
        stem = log.split(".")[0]
        tasks += [
            [(t, log, "-o", f"{stem}.{t}.csv")] for t in ("speed", "footprint", "dissipation")
        ]
    tasks += [[("speed", log, "-o", f"{log.split('.')[0]}.speed.csv")] for log in WHEEL]
    tasks += [
        [
            (
                "phase-shift",
                "encoder_ramp.h5",
                "--calibrate",
                "calibration.toml",
                "-o",
                "ramp.phase_shift.csv",
            ),
            (
                "phase-shift",
                "encoder.h5",
                "--calibration",
                "calibration.toml",
                "-o",
                "encoder.phase_shift.csv",
            ),
        ],
        [("phase-shift", "encoder.h5", "-o", "encoder_alone.phase_shift.csv")],
        [("inflation", "inflation.csv.gz", "-o", "inflation.inflation.csv")],
        [
            ("ingest", "drive.csv.gz", "-o", "drive_run.h5"),
            ("footprint", "drive_run.h5", "-o", "run.footprint.csv"),
        ],
    ]
    for name, (carcass, logs, observable) in QUESTIONS.items():
        setup = logs[0].split(".")[0] + ".toml"
        model = f"{name}.model.toml"
        chosen = ("--observable", observable) if observable else ()
        tasks.append(
            [
                ("model", "new", "--carcass", carcass, "--setup", setup, *chosen, "-o", model),
                ("compare", *logs, "--model", model, "-o", f"{name}.compare.json"),
                ("compare", *logs, "--model", model, "--by", "speed", "-o", f"{name}.by_speed.csv"),
                ("diagnose", *logs, "--model", model, "-o", f"{name}.diagnose.json"),
                ("model", "fit", *logs, "--model", model, "-o", f"{name}.fitted.toml"),
                *(
                    ()
                    if carcass == "coupled_ring"
                    else [("ladder", *logs, "--model", model, "-o", f"{name}.ladder.csv")]
                ),
            ]
        )
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda commands: [tirelog(folder, *c, "--quiet") for c in commands], tasks))
    lines = sorted((folder / "statuses.txt").read_text().splitlines())
    (folder / "statuses.txt").write_text("\n".join(lines) + "\n")


def values(path: Path) -> Iterator[tuple[str, str]]:
    """Every value of a golden with the place where it stands."""
    if path.suffix == ".json":
        yield from _leaves("", json.loads(path.read_text()))
    elif path.suffix == ".csv":
        with path.open(newline="") as stream:
            for number, row in enumerate(csv.DictReader(stream)):
                yield from (
                    (f"row {number} {name}", value)
                    for name, value in row.items()
                    if not name.startswith(LEFT_OUT)
                )
    else:
        yield from ((f"line {n}", line) for n, line in enumerate(path.read_text().splitlines()))


def _leaves(place: str, value: object) -> Iterator[tuple[str, str]]:
    if isinstance(value, dict):
        for name, part in value.items():
            if not str(name).startswith(LEFT_OUT):
                yield from _leaves(f"{place}.{name}", part)
    elif isinstance(value, list):
        for number, part in enumerate(value):
            yield from _leaves(f"{place}[{number}]", part)
    else:
        yield place, "" if value is None else str(value)


def same(old: str, new: str) -> bool:
    """Equal, or numbers within the tolerance."""
    if old == new:
        return True
    try:
        a, b = float(old), float(new)
    except ValueError:
        return False
    return math.isclose(a, b, rel_tol=TOLERANCE[0], abs_tol=TOLERANCE[1]) or (
        math.isnan(a) and math.isnan(b)
    )


def compare(old: Path, new: Path) -> int:
    """Print what differs; how many files do."""
    made = [
        p
        for p in sorted(old.iterdir())
        if p.suffix in (".csv", ".json") or p.name == "statuses.txt" or ".fitted." in p.name
    ]
    made = [p for p in made if ".truth." not in p.name]
    wrong = 0
    for path in made:
        other = new / path.name
        if not other.is_file():
            print(f"{path.name}: missing")
            wrong += 1
            continue
        before, after = dict(values(path)), dict(values(other))
        moved = [k for k in before if k in after and not same(before[k], after[k])]
        gone, added = sorted(set(before) - set(after)), sorted(set(after) - set(before))
        if moved or gone or added:
            wrong += 1
            print(
                f"{path.name}: {len(moved)} of {len(before)} values moved, {len(gone)} gone, "
                f"{len(added)} new"
            )
            for place in moved[:6]:
                print(f"    {place}: {before[place]} -> {after[place]}")
            for place in [*gone[:3], *added[:3]]:
                print(f"    {'gone' if place in before else 'new'}: {place}")
    print(f"{len(made)} goldens, {wrong} differ")
    return wrong


def main() -> int:
    """Write goldens, or compare two folders of them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    verbs = parser.add_subparsers(dest="verb", required=True)
    verbs.add_parser("write").add_argument("folder", type=Path)
    two = verbs.add_parser("compare")
    two.add_argument("old", type=Path)
    two.add_argument("new", type=Path)
    options = parser.parse_args()
    if options.verb == "write":
        write(options.folder)
        return 0
    return 1 if compare(options.old, options.new) else 0


if __name__ == "__main__":
    sys.exit(main())
