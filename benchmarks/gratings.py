"""Several gratings in one fit: does `diagnose` part wheel from road, and find a bad grating?

    python -m benchmarks.gratings [--kinds null,wheel,...] [--seeds 20000:20010] [-o results.csv]
    python -m benchmarks.gratings --summary results.csv     rates with Wilson intervals

A case is two logs of about a minute of a tire with three gratings at drawn angles (those of
`benchmarks.nuisance_worlds`, with its tires and plans). Kinds:

    null       nothing
    wheel      force variation, run-out or a splice, by the seed: fixed to the wheel
    road       an effect of the catalogue, the next for the next seed: fixed to the road
    both       the same effect under force variation
    bad        one grating averages over a length, lags or is slow, as one that comes off does
    bad_wheel  the same under force variation

Seeds below 1000 are for choosing, from 20000 on for reporting, on other tires and plans. An
effect has FRACTION of its ordinary strength.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.case_rows import run_or_sum_up
from benchmarks.cases import IN_CATALOGUE
from benchmarks.hidden import wilson
from benchmarks.nuisance_worlds import CaseOf, planted_tables
from tirelog.diagnosis.diagnose import diagnose
from tirelog.inference.measured import measured_gratings
from tirelog.physics.model.file import new_model
from tirelog.simulation import scenario_of, simulate, to_recording

KINDS = ("null", "wheel", "road", "both", "bad", "bad_wheel")
GRATINGS = 3
#: of an effect's ordinary strength: some five squared floors
FRACTION = 0.5
#: least angle between two gratings [deg]
APART = 40.0
#: what is wrong with a bad grating: of its own, from and to
FAULTS = {
    "gauge_length_m": (0.012, 0.03),
    "lag_s": (1e-4, 3e-4),
    "bandwidth_Hz": (150.0, 400.0),
}
WHEELS = ("force_variation", "run_out_3", "run_out_30", "splice")


@dataclass(frozen=True)
class Row:
    """One case and what was said of it."""

    kind: str
    seed: int
    what: str
    verdict: str
    named: str
    sets: str
    wheel: bool
    frames: str
    bad: str
    alone: str
    left_out: str
    reduced_chi2: float
    seconds: float


def _angles(draw: np.random.Generator) -> list[float]:
    """Three angles on the wheel, no two near each other."""
    while True:
        angles = draw.uniform(0.0, 360.0, GRATINGS)
        off = np.abs((angles[:, None] - angles + 180.0) % 360.0 - 180.0)
        if off[np.triu_indices(GRATINGS, 1)].min() >= APART:
            return [round(float(angle), 1) for angle in angles]


def tables_of(kind: str, seed: int) -> tuple[list[dict[str, Any]], str, str]:
    """(tables of each log's scenario, what is planted, the bad grating)."""
    draw = np.random.default_rng([seed, 22])
    wheel = WHEELS[seed % len(WHEELS)] if kind == "wheel" else ""
    turning = "force_variation" if kind in ("both", "bad_wheel") else "control"
    world = wheel if wheel not in ("", "splice") else turning
    effect = IN_CATALOGUE[seed % len(IN_CATALOGUE)] if kind in ("road", "both") else ""
    tables = CaseOf(world, seed, "beam", effect, FRACTION).tables()
    angles = _angles(draw)
    bad = f"g{int(draw.integers(GRATINGS)) + 1}" if kind.startswith("bad") else ""
    key = sorted(FAULTS)[seed % len(FAULTS)]
    low, high = FAULTS[key]
    fault = float(low * (high / low) ** draw.uniform())
    for log in tables:
        one = log["channels"].pop("strain_1")
        for number, angle in enumerate(angles, start=1):
            own = {**one, "source": f"CH{number}", "angle_deg": angle}
            if f"g{number}" == bad:
                own[key] = fault
            log["channels"][f"g{number}"] = own
        if wheel == "splice":
            log["effects"] = [planted_tables("splice", FRACTION)]
    return tables, wheel or effect or (f"{key}={fault:.2g}" if bad else ""), bad


def run(kind: str, seed: int) -> Row:
    """One case from the scenario to the verdict."""
    tables, what, bad = tables_of(kind, seed)
    logs = [to_recording(simulate(scenario_of(log)), f"log_{i}") for i, log in enumerate(tables, 1)]
    model, _ = new_model("beam", logs[0].setup)
    begun = time.process_time()
    measured = measured_gratings(logs, ("all",))
    found = diagnose(measured.revolutions, model)
    seconds = time.process_time() - begun
    told = found.gratings
    assert told is not None
    return Row(
        kind,
        seed,
        what,
        found.verdict,
        "+".join(found.selected),
        ";".join("+".join(group) for group in found.ambiguous_groups),
        any(n.nuisance == "wheel" and n.stayed for n in found.nuisances),
        " ".join(f"{f.frame}:{f.size:.2g}" for f in told.frames if f.matters),
        bad,
        "+".join(told.alone),
        "+".join(told.set_apart),
        found.reduced_chi2_after,
        seconds,
    )


def parted(row: dict[str, str]) -> bool:
    """Is what is fixed to the wheel said of the wheel, and what to the road of the road?"""
    named = set(row["named"].split("+")) - {""}
    sets = [set(group.split("+")) for group in row["sets"].split(";") if group]
    right = row["what"] in named or any(row["what"] in s and len(s) <= 2 for s in sets)
    if row["kind"] == "wheel":
        by_shape = "wheel:" in row["frames"] and "road:" not in row["frames"]
        return not named and by_shape
    return right and (row["wheel"] == "True") == (row["kind"] == "both")


def summary(rows: Iterable[dict[str, str]]) -> Iterator[str]:
    """Rates over all, with what failed."""
    rows = list(rows)
    asked: tuple[tuple[str, tuple[str, ...], Any], ...] = (
        ("wheel and road parted", ("wheel", "road", "both"), parted),
        ("contradiction found", ("bad", "bad_wheel"), lambda r: r["alone"] == r["bad"]),
        ("no false contradiction", ("null", "wheel", "road", "both"), lambda r: not r["alone"]),
        ("nothing missing", ("null", "bad", "bad_wheel"), lambda r: not r["named"]),
    )
    for name, kinds, good in asked:
        some = [r for r in rows if r["kind"] in kinds]
        yield f"{name:26s} {wilson(sum(map(good, some)), len(some))}"
        for r in some:
            if not good(r):
                yield (
                    f"    not: {r['kind']}/{r['seed']} {r['what']}: {r['verdict']} {r['named']}; "
                    f"{r['frames']}; alone {r['alone'] or '-'} of {r['bad'] or '-'}"
                )
    seconds = sorted(float(r["seconds"]) for r in rows)
    if seconds:
        yield f"CPU {seconds[len(seconds) // 2]:.1f} s each (median), {seconds[-1]:.1f} s at most"


if __name__ == "__main__":
    run_or_sum_up(__doc__, KINDS, "20000:20010", Row, run, summary)
