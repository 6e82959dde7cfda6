"""Run every benchmark of `bench`, one process each, and say which failed.

`python -m benchmarks chain model` runs some; `--minutes 60` makes the logs of the goals.
"""

import argparse
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.bench import BENCHMARKS, Sizes
from benchmarks.measure import apart

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(BENCHMARKS))
    parser.add_argument("--minutes", type=float, default=Sizes.minutes)
    parser.add_argument("--logs", type=int, default=Sizes.logs)
    asked = parser.parse_args()
    failed = []
    for name in asked.names or BENCHMARKS:
        print(f"== {name}", flush=True)
        with TemporaryDirectory(prefix="tirelog-") as folder:
            try:
                apart(BENCHMARKS[name], Path(folder), Sizes(asked.minutes, asked.logs))
            except Exception as problem:
                print(problem)
                failed.append(name)
    if failed:
        sys.exit(f"failed: {', '.join(failed)}")
