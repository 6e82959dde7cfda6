"""Text to the strain tables on every log of the family, beside the plain script and the same script
reading with polars; cost per passage, gain of the second core (the same command kept on one, with
one worker), share of the search for slip onsets.

TIRELOG_BENCH_MINUTES sets the length of the logs (default 2, when starting up is most of it; 10 and
60 are those of the goals), TIRELOG_BENCH_TURNS how often all take turns (default 3; medians of CPU
time count), TIRELOG_BENCH_CASES which logs (default all).
"""

import importlib.util
import os
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np

from benchmarks.family import FAMILY, RADIUS_M, Case, blocks, write
from benchmarks.measure import Cost, apart, cost, median
from tirelog.data.recording import Channel, TimeAxis
from tirelog.strain.footprint import footprint as footprints
from tirelog.strain.passages.find import find_passages

TIRELOG = str(Path(sys.executable).parent / "tirelog")
LIBRARIES = ("pandas", "polars") if importlib.util.find_spec("polars") else ("pandas",)
#: a grating of at most so many minutes is enough to tell a share
SHARE_MINUTES = 2.0


def main() -> None:
    minutes = float(os.environ.get("TIRELOG_BENCH_MINUTES", "2"))
    turns = int(os.environ.get("TIRELOG_BENCH_TURNS", "3"))
    chosen = os.environ.get("TIRELOG_BENCH_CASES", "").split()
    if "polars" not in LIBRARIES:
        print("polars is not installed: no column for it")
    print(
        f"{minutes:g} min, {turns} turns: wall and CPU seconds; how many times the plain script "
        "takes as long"
    )
    print(
        f"{'log':15}{'passages':>9}{'plain s':>13}{'polars s':>13}{'tirelog s':>13}{'MB':>5}"
        f"{'x wall':>8}{'x CPU':>7}{'x polars':>9}{'us/passage':>11}{'2 cores':>8}{'onsets':>8}"
    )
    ratios = []
    with tempfile.TemporaryDirectory() as name:
        _warm(Path(name))
        for case in FAMILY:
            if not chosen or case.name in chosen:
                ratios.append(_one(case, Path(name), minutes, turns))
    for label, pick in (("worst", np.nanmin), ("median", np.nanmedian)):
        wall, cpu, polars, cores = (pick(column) for column in zip(*ratios, strict=True))
        print(
            f"{label:6} {wall:.2f} x wall  {cpu:.2f} x CPU  {polars:.2f} x polars in wall  "
            f"{cores:.2f} x on the second core"
        )


def _warm(folder: Path) -> None:
    """Compile what is not in the cache yet, outside of what is measured."""
    log = folder / "warm.csv"
    driven = next(case for case in FAMILY if case.truth == "driven")
    apart(write, driven, log, 0.7)
    cost([TIRELOG, "tables", str(log), "-o", str(folder / "warm")])


def _one(case: Case, folder: Path, minutes: float, turns: int) -> tuple[float, ...]:
    """A line on one log; how often the plain script takes as long, and one core as two."""
    log, out = folder / f"{case.name}.csv", folder / "out"
    passages = apart(write, case, log, minutes)
    ours = [TIRELOG, "tables", str(log), "-o", str(out)]
    scripts = {
        library: [
            *(sys.executable, "-m", "benchmarks.plain_script", str(log), f"{out}.csv"),
            *(case.surface, library),
        ]
        for library in LIBRARIES
    }
    commands = {**scripts, "tirelog": ours}
    if case.gratings >= 4:
        commands["one"] = [*ours, "--workers", "1"]
    costs: dict[str, list[Cost]] = {name: [] for name in commands}
    for _ in range(turns):  # in turns: what else the machine does meets all of them
        for name, command in commands.items():
            costs[name].append(cost(command, one_core=name == "one"))
    log.unlink()
    told = {name: median(some) for name, some in costs.items()}
    plain, mine = told["pandas"], told["tirelog"]
    nan = float("nan")
    polars = told.get("polars", Cost(nan, nan, nan))
    cores = told["one"].wall_s / mine.wall_s if "one" in told else nan
    share = apart(onset_share, case, min(minutes, SHARE_MINUTES))
    print(
        f"{case.name:15}{passages:9d}{plain.wall_s:7.2f}{plain.cpu_s:6.2f}{polars.wall_s:7.2f}"
        f"{polars.cpu_s:6.2f}{mine.wall_s:7.2f}{mine.cpu_s:6.2f}{mine.peak_MB:5.0f}"
        f"{plain.wall_s / mine.wall_s:8.2f}{plain.cpu_s / mine.cpu_s:7.2f}"
        f"{polars.wall_s / mine.wall_s:9.2f}{1e6 * mine.cpu_s / passages:11.0f}{cores:8.2f}"
        f"{100 * share:6.0f} %",
        flush=True,
    )
    return plain.wall_s / mine.wall_s, plain.cpu_s / mine.cpu_s, polars.wall_s / mine.wall_s, cores


def onset_share(case: Case, minutes: float) -> float:
    """Share of the footprint's CPU time that seeking slip onsets takes, on one grating."""
    one = replace(case, gratings=1)
    strain = np.concatenate([strain[:, 0] for _, strain in blocks(one, minutes)])
    channel = Channel.of_array(
        "grating",
        "strain",
        strain if case.surface == "inner" else -strain,
        TimeAxis.uniform(strain.size, case.rate_Hz),
        surface=case.surface,
    )
    passages = find_passages(channel, RADIUS_M)
    called_by = vars(footprints)
    seek, spent = called_by["find_onsets"], 0.0

    def timed(*asked: object) -> None:
        nonlocal spent
        begun = time.process_time()
        seek(*asked)
        spent += time.process_time() - begun

    with mock.patch.dict(called_by, find_onsets=timed):
        begun = time.process_time()
        footprints.footprint(channel, passages)
        return spent / (time.process_time() - begun)


if __name__ == "__main__":
    main()
