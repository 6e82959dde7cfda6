"""A row per case of a benchmark, written as it is done, and rates of rows that were kept."""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any


def run_or_sum_up(
    description: str | None,
    kinds: Sequence[str],
    seeds: str,
    row: type[Any],
    run: Callable[[str, int], Any],
    summary: Callable[[Iterable[dict[str, str]]], Iterator[str]],
) -> None:
    """The command line of a benchmark whose case is a kind of world and a seed.

    kinds, seeds ("first:last+1") are what runs by default; `row` the dataclass that `run` gives.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--kinds", default=",".join(kinds))
    parser.add_argument("--seeds", default=seeds, help="first:last+1")
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--summary", type=Path)
    options = parser.parse_args()
    if options.summary:
        with options.summary.open(newline="") as stream:
            print("\n".join(summary(csv.DictReader(stream))))
        return
    first, last = (int(x) for x in options.seeds.split(":"))
    rows = []
    stream = options.output.open("a", newline="") if options.output else sys.stdout
    writer = csv.DictWriter(stream, [field.name for field in fields(row)])
    if not options.output or stream.tell() == 0:
        writer.writeheader()
    for seed in range(first, last):
        for kind in options.kinds.split(","):
            done = asdict(run(kind, seed))
            rows.append({name: str(value) for name, value in done.items()})
            writer.writerow(done)
            stream.flush()
    print("\n".join(summary(rows)))
