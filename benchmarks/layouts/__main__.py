"""`python -m benchmarks.layouts [--real FOLDER] [--only WORD]`.

Prints a row per file; status 1 if one is not read right.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from benchmarks.layouts import crossed, extras, meaning
from benchmarks.layouts.generated import cases
from benchmarks.layouts.judge import Verdict, judged


def generated(only: str) -> Iterator[tuple[str, str, Verdict]]:
    """(source, layout, verdict) of every generated file."""
    for case in (*cases(), *extras.cases(), *meaning.cases(), *crossed.cases()):
        if only not in f"{case.source} {case.layout}":
            continue
        if not case.can_be_made:
            yield case.source, case.layout, Verdict(skipped=f"{case.needs} is not installed")
        else:
            with tempfile.TemporaryDirectory(prefix="layouts-") as folder:
                yield case.source, case.layout, judged(case, Path(folder))


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.layouts", description=__doc__)
    parser.add_argument("--real", type=Path, help="folder of real logs that are at hand")
    parser.add_argument("--only", default="", help="cases whose source or layout has this word")
    asked = parser.parse_args()
    rows = list(generated(asked.only))
    if asked.real:
        from benchmarks.layouts.at_hand import real

        rows += [row for row in real(asked.real) if asked.only in f"{row[0]} {row[1]}"]
    print(f"{'source':28s} {'layout':58s} {'rows':>7s} {'rate Hz':>9s}  read")
    for source, layout, verdict in rows:
        read = f"skipped: {verdict.skipped}" if verdict.skipped else "right"
        read = f"WRONG: {verdict.wrong}" if verdict.wrong else read
        told = "" if verdict.wrong or not verdict.told else f": {verdict.told}"
        size = (
            f"{verdict.rows:7d} {verdict.rate_Hz:9.6g}" if verdict.rows else f"{'-':>7s} {'-':>9s}"
        )
        print(f"{source:28s} {layout:58s} {size}  {read}{told[:160]}")
    wrong = sum(bool(verdict.wrong) for _, _, verdict in rows)
    skipped = sum(bool(verdict.skipped) for _, _, verdict in rows)
    told = f", {skipped} skipped" if skipped else ""
    print(f"{len(rows)} files, {len(rows) - wrong - skipped} read right{told}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
