"""Golden verdicts: 80 simulated cases of `diagnose`, for a change that is to move no verdict.

    python -m benchmarks.golden_cases [--jobs 2]     rewrite tests/golden/answers/cases.csv

40 cases are of `benchmarks.hidden`, 20 of `benchmarks.nuisances`, 20 of `benchmarks.form_cases`.
They are regressions and no figures: their seeds and tires are those for choosing thresholds.
tests/golden/test_cases.py does each again and compares. A verdict that moves on purpose is listed
in CHANGELOG.md under "Numbers changed".
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import tempfile
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from benchmarks import form_cases, hidden, nuisances
from benchmarks.goldens import ANSWERS
from benchmarks.nuisance_worlds import CaseOf
from tirelog.runtime import one_thread
from tirelog.simulation.scenario.schema import Manoeuvre

GOLDEN = ANSWERS / "cases.csv"
WORDS = ("verdict", "named", "sets")
#: errors in noise floors
NUMBERS = ("before", "after", "chi2_before", "chi2_after")
COLUMNS = ("suite", "case", *WORDS, *NUMBERS)
#: relative: a minimiser stops where its square is flat, and machines differ so
TOLERANCE = 1e-3
#: kind of `benchmarks.hidden` and what is planted; the seed is the number of the line
HIDDEN = """\
null, null, null, null2, null2, scatter, scatter,
single viscous_damping, single hysteresis, single belt_tension, single stiffening,
single pressure_offset, single traction, single edge_impact, single rough_contact,
single water_film, single wear, single load_transfer, single aero_load, single thermal_drift,
single gauge_length, single sensor_lag, single ring_down,
strong water_film, strong stiffening, weak edge_impact, weak aero_load, other traction,
other edge_impact, faint wear, faint hysteresis,
pair viscous_damping+edge_impact, pair water_film+load_transfer, pair belt_tension+wear,
outside torsion, outside exit_suction, outside standing_wave, outside even_bulge,
twin gauge_length, parted hysteresis"""
#: carcass, world, and effect with its strength
NUISANCE = """\
beam run_out_3, beam run_out_30, beam force_variation, beam load_wander, beam scatter_3,
beam warming, beam warming_logged, beam radius, beam colour, beam interrogator, ring control,
ring run_out_3+warming, beam control water_film 0.5, beam run_out_30 water_film 0.5,
beam load_wander edge_impact 0.7, beam warming traction 0.7, beam radius aero_load 0.7,
beam colour sensor_lag 0.7,
beam scatter_1+warming load_transfer 0.7, ring control edge_impact 0.7"""
#: carcass, form and effect
FORM = """\
beam flat none, beam saddle none, beam shear_layer none, beam shifted none, beam smooth none,
beam flat water_film, beam flat aero_load, beam flat edge_impact, beam saddle hysteresis,
beam saddle load_transfer, beam saddle sensor_lag, beam shear_layer water_film,
beam shear_layer aero_load, beam shifted edge_impact, beam shifted pressure_offset,
beam smooth viscous_damping, beam trapezoid load_transfer, beam trapezoid wear,
beam trapezoid edge_impact, beam parabola none"""
#: first seeds, and the tire of the forms
SEEDS = {"hidden": 800, "nuisances": 40}
TIRE = 9


class Found(NamedTuple):
    """What `diagnose` concludes of a case."""

    verdict: str
    named: str
    sets: str
    before: float
    after: float
    chi2_before: float
    chi2_after: float


def listed() -> Iterator[tuple[str, str]]:
    """(suite, case) of all 80; a case is its words and its seed."""
    for suite, text in (("hidden", HIDDEN), ("nuisances", NUISANCE), ("forms", FORM)):
        for number, case in enumerate(text.replace("\n", " ").split(",")):
            seed = SEEDS[suite] + number if suite in SEEDS else TIRE
            yield suite, f"{case.strip()} {seed}"


def outcome(suite: str, case: str) -> Found:
    """A case simulated and diagnosed."""
    one_thread()
    *words, seed = case.split()
    return {"hidden": _hidden, "nuisances": _nuisances, "forms": _forms}[suite](words, int(seed))


def _hidden(words: list[str], seed: int) -> Found:
    """Two logs of a case, each stretch driven for six tenths of its time."""
    planted = tuple(words[1].split("+")) if len(words) > 1 else ()
    logs = []
    for log in hidden.scenarios(words[0], planted, seed)[:2]:
        drive = tuple(Manoeuvre(0.6 * m.duration_s, m.speed_m_s) for m in log.manoeuvres)
        logs.append(replace(log, manoeuvres=drive))
    found = hidden.diagnosed(logs)
    before, after = found.rmse_heldout_before, found.rmse_heldout_after
    return Found(
        *(found.verdict, "+".join(found.selected), json.dumps(found.ambiguous_groups)),
        *(before / found.noise_floor, after / found.noise_floor),
        *(found.reduced_chi2_before, found.reduced_chi2_after),
    )


def _nuisances(words: list[str], seed: int) -> Found:
    carcass, world, effect, strength = (*words, "", "1")[:4]
    case = CaseOf(world, seed, carcass, effect, float(strength))
    with tempfile.TemporaryDirectory() as scratch:
        row = nuisances.row_of(case, "", Path(scratch) / "case", math.nan)
    return Found(
        *(row.status, row.named, row.sets),
        *(row.heldout_before, row.heldout_after, row.chi2_before, row.chi2_after),
    )


def _forms(words: list[str], tire: int) -> Found:
    carcass, form, effect = words
    row = form_cases.Row("tuning", form, effect.replace("none", ""), tire, carcass)
    row = form_cases.run(form_cases.Task(row, "diagnose", None, write_only=False))
    return Found(
        *(row.verdict, row.selected, row.groups),
        *(row.heldout_before, row.heldout_after, row.chi2_before, row.chi2_after),
    )


def moved(golden: Mapping[str, str], now: Found) -> list[str]:
    """What of a case is no longer its golden."""
    found = now._asdict()
    words = [name for name in WORDS if golden[name] != found[name]]
    pairs = {name: (float(golden[name]), float(found[name])) for name in NUMBERS}
    numbers = [
        name
        for name, (old, new) in pairs.items()
        if not (math.isclose(old, new, rel_tol=TOLERANCE) or (math.isnan(old) and math.isnan(new)))
    ]
    return [f"{name}: {golden[name]} -> {found[name]}" for name in (*words, *numbers)]


def read() -> list[dict[str, str]]:
    """The golden rows."""
    with GOLDEN.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def main() -> None:
    """Write the golden rows anew."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    cases = list(listed())
    with ProcessPoolExecutor(options.jobs) as pool:
        rows = list(pool.map(outcome, *zip(*cases, strict=True)))
    with GOLDEN.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(COLUMNS)
        for case, row in zip(cases, rows, strict=True):
            shown = [f"{value:.7g}" if isinstance(value, float) else value for value in row]
            writer.writerow([*case, *shown])
    print(f"{len(rows)} cases in {GOLDEN.name}")


if __name__ == "__main__":
    main()
