"""Does the manoeuvre that `diagnose` advises settle it?  It is driven in simulation.

    python -m benchmarks.drive_next [--kinds one_speed,dry,one_load] [--seeds 1500:1510]
                                    [-o FILE.csv]
    python -m benchmarks.drive_next --summary FILE.csv

    one_speed  hysteresis or viscous damping, faint, on logs of one speed: a set of two
    dry        a water film, and no log saw water: nothing is missing that they could show
    one_load   an effect of the catalogue, faint, on short cruises alone

The manoeuvre that `drive_next` names first is driven as often as it says, as one more log of the
same tire, and all logs are diagnosed again; settled if the truth is named alone then. A case whose
first verdict is settled already, or that gets no advice, is counted apart. Seeds below 1500 are for
choosing, from 1500 on for reporting.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from benchmarks.case_rows import run_or_sum_up
from benchmarks.cases import Case, case
from benchmarks.hidden import TWINS, diagnosed, one_speed, wilson
from tirelog.diagnosis.candidates.separation import ALLOWED, CandidateManoeuvre
from tirelog.simulation.scenario.schema import Manoeuvre, Scenario
from tirelog.storage.schema import Record

KINDS = ("one_speed", "dry", "one_load")
#: effects that short cruises leave in doubt, in turn, at a fifth of their ordinary size
_FAINT = ("viscous_damping", "sensor_lag", "gauge_length", "aero_load", "load_transfer")
_FAINTNESS = 0.2


@dataclass(frozen=True)
class Row:
    """One case: what was said, what was driven, and what was said then."""

    kind: str
    seed: int
    planted: str
    verdict: str
    named: str
    sets: str
    probability: float
    advised: str
    repeats: int
    minutes: float
    gain: float
    verdict_after: str
    named_after: str
    probability_after: float


def logs_of(kind: str, seed: int) -> tuple[str, list[Scenario]]:
    """(what is planted, its logs)."""
    number = seed * 1000 + 500 + KINDS.index(kind)
    if kind == "one_speed":
        planted = ("hysteresis", "viscous_damping")[seed % 2]
        logs = case({planted: TWINS[planted]}, seed=number, how=Case(logs=2))
        return planted, [replace(log, manoeuvres=one_speed(log.seed)[:12]) for log in logs]
    if kind == "dry":
        logs = case(("water_film",), seed=number, how=Case(plan="short", logs=2))
        dry = [replace(log.conditions, water_depth_mm=0.0) for log in logs]
        return "water_film", [
            replace(log, conditions=own) for log, own in zip(logs, dry, strict=True)
        ]
    planted = _FAINT[seed % len(_FAINT)]
    how = Case(plan="short", logs=2, strength=_FAINTNESS)
    logs = case((planted,), seed=number, how=how)
    same = [replace(log.conditions, load_N=3434.0) for log in logs]
    return planted, [replace(log, conditions=own) for log, own in zip(logs, same, strict=True)]


def driven_log(advised: CandidateManoeuvre, repeats: int, logs: list[Scenario]) -> Scenario:
    """One more log of the same tire: the manoeuvre, as often, with lifts of the foot between."""
    first, last = advised.speed_m_s
    long_s = advised.time_s + 20.0 if advised.time_s > 60.0 else 20.0
    parts: list[Record] = []
    for _ in range(repeats):
        if first == last:
            parts += [Manoeuvre(long_s, first), Manoeuvre(1.5, first - 1.0), Manoeuvre(1.5, first)]
        else:
            ramp = abs((last - first) / advised.acceleration_m_s2)
            back = abs(last - first) / 2.5
            parts += [Manoeuvre(4.0, first), Manoeuvre(ramp, last), Manoeuvre(4.0, last)]
            parts += [Manoeuvre(back, first)]
    load = sum(log.conditions.load_N for log in logs) / len(logs) * advised.load
    conditions = replace(logs[0].conditions, load_N=load, **advised.values)
    return replace(logs[0], manoeuvres=tuple(parts), conditions=conditions, seed=logs[0].seed + 77)


def run(kind: str, seed: int) -> Row:
    """One case: asked, driven, asked again."""
    planted, logs = logs_of(kind, seed)
    found = diagnosed(logs)
    nan = float("nan")
    p = found.certainty.probability
    row = Row(
        kind, seed, planted, found.verdict, "+".join(found.selected),
        json.dumps(found.ambiguous_groups), nan if p is None else p,
        "", 0, 0.0, 0.0, "", "", nan,
    )  # fmt: skip
    if not found.drive_next:
        return row
    best = found.drive_next[0]
    advised = next(m for m in ALLOWED if m.name == best["manoeuvre"])
    again = diagnosed([*logs, driven_log(advised, int(best["repeats"]), logs)])
    q = again.certainty.probability
    return replace(
        row,
        advised=advised.name,
        repeats=int(best["repeats"]),
        minutes=best["minutes"],
        gain=best["gain"],
        verdict_after=again.verdict,
        named_after="+".join(again.selected),
        probability_after=nan if q is None else q,
    )


def _alone(row: dict[str, str], after: str = "") -> bool:
    """Is the truth named alone?"""
    return row[f"named{after}"] == row["planted"] and row[f"verdict{after}"] != "ambiguous"


def summary(rows: Iterable[dict[str, str]]) -> Iterator[str]:
    """How often what was advised settles it."""
    rows = list(rows)
    for kind in (*KINDS, "all"):
        own = [r for r in rows if kind in (r["kind"], "all")]
        if not own:
            continue
        open_ = [r for r in own if not _alone(r)]
        told = [r for r in open_ if r["advised"]]
        settled = sum(_alone(r, "_after") for r in told)
        yield (
            f"{kind}: {len(own)} cases, {len(own) - len(open_)} settled before, "
            f"{len(open_) - len(told)} open without advice; what was advised settles "
            f"{wilson(settled, len(told))} (80 %)"
        )
        for r in told:
            if not _alone(r, "_after"):
                yield (
                    f"    {r['planted']}/{r['seed']}: {r['advised']} x{r['repeats']}: "
                    f"{r['verdict_after']} {r['named_after']}"
                )


if __name__ == "__main__":
    run_or_sum_up(__doc__, KINDS, "1500:1510", Row, run, summary)
