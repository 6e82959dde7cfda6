"""Arbitrary waveforms through every command of a model: `python -m benchmarks.fuzz.waveforms
[--cases N] [--seed S] [--only N]`.

Each case is a strain log of a shape that repeats with the wheel and that no tire model has made.
Its commands end with status 0 and an answer, or the case failed. Prints a row per case and the
counts; status 1 if a case failed. A seed and a case's number make the same case again.
"""

from __future__ import annotations

import argparse
import secrets
import sys
import tempfile
from pathlib import Path

from tests.diagnosis.periodic import COMMANDS, SHAPES, failures, write_log

#: what is made new in turn: as many beams as users have
_CARCASSES = ("beam", "beam", "beam", "ring")


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fuzz.waveforms")
    parser.add_argument("--cases", type=int, default=50)
    parser.add_argument("--seed", type=int, help="another one each time unless given")
    parser.add_argument("--only", type=int, help="number of the one case to carry out")
    asked = parser.parse_args()
    seed = secrets.randbelow(2**31) if asked.seed is None else asked.seed
    print(f"seed {seed}", flush=True)
    numbers = range(asked.cases) if asked.only is None else [asked.only]
    shapes, failed = list(SHAPES), 0
    for number in numbers:
        shape, carcass = shapes[number % len(shapes)], _CARCASSES[number % len(_CARCASSES)]
        with tempfile.TemporaryDirectory(prefix="waveform-") as folder:
            write_log(Path(folder) / "log.csv", seed + number, shape, manoeuvres=5, seconds=1.5)
            found = failures(Path(folder), carcass)
        failed += bool(found)
        print(f"{number:4d} {shape:18s} {carcass:5s} {'; '.join(found) or 'answered'}", flush=True)
    commands = ", ".join(COMMANDS)
    print(f"{len(numbers) - failed} of {len(numbers)} logs answered by each of {commands}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
