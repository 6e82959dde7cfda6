"""Slip onsets of a driven and braked wheel, truth by a ring or a beam: errors and what covers them.

    python -m benchmarks.slip_onsets [--kinds ring_2pm_30mm,...] [--seeds 1000:1004]
                                     [-o results.csv]            one row per log, as it is done
    python -m benchmarks.slip_onsets --summary results.csv       by kind

A log is a minute and a half at steady speeds and between them, of one grating with a noise in pm,
traction on a lever in mm; its tire and its slip per g are drawn. Seeds below 1000 are for choosing,
from 1000 on for reporting.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from benchmarks.case_rows import run_or_sum_up
from tirelog.simulation import simulate, to_recording
from tirelog.simulation.scenario.schema import (
    Manoeuvre,
    Planted,
    Scenario,
    Sensor,
    TrueConditions,
    TrueTire,
)
from tirelog.strain.footprint.footprint import footprint
from tirelog.strain.passages.find import find_passages

KINDS = tuple(
    f"{truth}_{noise}pm_{lever}mm"
    for truth, (noise, lever) in product(("ring", "beam"), ((0.8, 10), (2, 30), (4, 18)))
)
ACCELERATIONS_M_S2 = (2.0, -2.0, 3.0, -3.0, 1.2, -1.2)
STEP_M_S = 8.0
#: an onset so far off is grossly wrong [m]
GROSS_M = 0.005


@dataclass(frozen=True)
class Row:
    """One log: passages that slip, onsets told, those beyond 1.96 standard errors and grossly off.

    `rms_mm` their error, `se_mm` its median standard error, `false`: onsets where nothing slips.
    """

    kind: str
    seed: int
    slipping: int
    told: int
    outside: int
    gross: int
    false: int
    rms_mm: float
    se_mm: float


def scenario(kind: str, seed: int) -> Scenario:
    """One log; its tire is drawn as those of `wheel_hidden` are."""
    truth, noise, lever = kind.split("_")
    draw = np.random.default_rng(seed)
    other, belt_m = draw.uniform(0.6, 1.6, 4), draw.uniform(0.11, 0.16)
    usual = TrueTire()
    bending = 2.0 if truth == "ring" else 4.0
    tire = replace(
        usual,
        flexural_stiffness_N_m2=float(bending * other[0]),
        radial_stiffness_N_m2=float(usual.radial_stiffness_N_m2 * other[1]),
        tangential_stiffness_N_m2=float(usual.tangential_stiffness_N_m2 * other[2]),
        tread_stiffness_N_m2=float(usual.tread_stiffness_N_m2 * other[3]),
        width_belt_m=float(belt_m),
    )
    plan = [Manoeuvre(20.0, 12.0, None)]
    for acceleration in ACCELERATIONS_M_S2:
        speed = plan[-1].speed_m_s + float(np.copysign(STEP_M_S, acceleration))
        plan += [Manoeuvre(STEP_M_S / abs(acceleration), speed, None), Manoeuvre(5.0, speed, None)]
    slips = {
        "slip_per_g": float(draw.uniform(0.35, 0.9)),
        "lever_m": 1e-3 * float(lever.removesuffix("mm")),
        "static_friction": 0.8,
        "sliding_friction": 0.6,
    }
    sensor = Sensor(
        "fbg_strain", sampling_rate_Hz=2500.0, noise=1e-3 * float(noise.removesuffix("pm"))
    )
    return Scenario(
        manoeuvres=tuple(plan),
        channels={"strain": sensor},
        tire=tire,
        truth=truth,
        conditions=TrueConditions(inflation_pressure_Pa=2.2e5),
        effects=(Planted("traction", "exact", slips),),
        seed=seed,
    )


def run(kind: str, seed: int) -> Row:
    """One log from the scenario to its errors."""
    simulated = simulate(scenario(kind, seed))
    recording = to_recording(simulated, "log")
    channel = recording.channels["strain"]
    passages = find_passages(channel, recording.setup.tire.radius_m)
    found = footprint(channel, passages).slip
    true = simulated.truth["channels"]["strain"]["passages"]
    nearest = np.abs(np.array(true["time_s"])[:, None] - passages.time_s).argmin(axis=0)
    onset = np.array([np.nan if x is None else x for x in true["slip_onset_m"]])[nearest]
    error, told = found["onset_m"] - onset, np.isfinite(found["onset_m"])
    known = told & np.isfinite(onset)
    pulls = np.abs(error[known]) / found["onset_se_m"][known]
    return Row(
        kind,
        seed,
        int(np.isfinite(onset).sum()),
        int(known.sum()),
        int(np.sum(pulls > 1.96)),
        int(np.sum(np.abs(error[known]) > GROSS_M)),
        int((told & ~known).sum()),
        1e3 * float(np.sqrt(np.mean(error[known] ** 2))) if known.any() else float("nan"),
        1e3 * float(np.median(found["onset_se_m"][known])) if known.any() else float("nan"),
    )


def summary(rows: Iterable[dict[str, str]]) -> Iterator[str]:
    """Onsets told, within their errors, and grossly off, by kind."""
    rows = list(rows)
    for kind in KINDS:
        own = [r for r in rows if r["kind"] == kind]
        slipping, told, outside, gross, false = (
            sum(int(r[name]) for r in own)
            for name in ("slipping", "told", "outside", "gross", "false")
        )
        if not own:
            continue
        within = f"{100 * (1 - outside / told):.1f} %" if told else "-"
        yield (
            f"{kind:16}{len(own):4} logs {told:6} of {slipping} onsets told, {outside} beyond 1.96 "
            f"errors ({within} within), {gross} off by more than 5 mm, {false} false"
        )


if __name__ == "__main__":
    run_or_sum_up(__doc__, KINDS, "1000:1004", Row, run, summary)
