"""The self-test of `diagnose` on wheels with an in-tire accelerometer (P4), truth by a ring.

    python -m benchmarks.wheel_hidden [--kinds null,belt_tension,...] [--seeds 1000:1004]
                                      [-o results.csv]      one row per case, as it is done
    python -m benchmarks.wheel_hidden --summary results.csv rates with Wilson intervals

A case is two logs of a minute, at 2.0 and 1.6 bar, of a tire that is drawn: stiffnesses, belt and
tread 0.6 to 1.6 times the ordinary ones, a belt narrower than the setup's tire. `shift_` kinds are
of the phase shift, with the forces measured, `width_` kinds of the patch width, `together_` kinds
of strain, acceleration and phase shift in one fit; the others of the acceleration.
`inflated_sidewalls` and `width_inflation` hide what the pressure does beside the belt's tension: it
stiffens the sidewalls, so that the patch follows the pressure by more than its ring says. Widths at
two pressures do not tell by how much it should: a ring whose belt is wider does the same (of these
tires none can be told from a null by width and growth in a quarter of the cases). So `width_` kinds
know the tire: its ring is fitted to the acceleration of the first log, and held. Seeds below 1000
are for choosing, from 1000 on for reporting.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.case_rows import run_or_sum_up
from benchmarks.hidden import wilson
from benchmarks.wheel_cases import TORSIONAL_STIFFNESS_N_M2, Instruments, wheel_channels
from tirelog.data.recording import Recording
from tirelog.diagnosis.compare import measured_pieces, start_from
from tirelog.diagnosis.diagnose import diagnose
from tirelog.diagnosis.results import Candidate
from tirelog.inference.measured import measured_together
from tirelog.physics.model.file import new_model
from tirelog.physics.model.model import Model
from tirelog.simulation import simulate, to_recording
from tirelog.simulation.scenario.schema import (
    PLANTABLE,
    Manoeuvre,
    Planted,
    Road,
    Scenario,
    Sensor,
    TrueConditions,
    TrueTire,
)
from tirelog.storage.schema import Record

PRESSURES_PA = (2.0e5, 1.6e5)
SPEEDS_M_S = (10.0, 20.0, 12.0, 22.0, 15.0, 24.0)
#: sizes of effects other than the simulator's ordinary ones
SIZES = {"belt_tension": {"tension_mass_kg_m": 3.0}}
#: effects whose numbers hang on nothing that the model holds (a belt's mass, a lever arm)
COMPARED = ("telemetry_delay",)
WAVEFORM = (
    "load_transfer", "belt_tension", "traction", "viscous_damping", "hysteresis", "edge_impact",
    "stiffening", "aero_load", "rough_contact", "pressure_offset", "inflated_sidewalls",
)  # fmt: skip
SHIFT = ("shift_wind_up", "shift_telemetry_delay")
#: power of the pressure with which the sidewalls of `inflation` stiffen: all of a radial tire's
#: stiffness is the pressure's if it is one
STIFFENS = 0.7
WIDTH = ("width_inflation",)
TOGETHER = tuple(f"together_{name}" for name in WAVEFORM)
KINDS = (
    "null", "scatter", *WAVEFORM, "shift_null", *SHIFT, "width_null", *WIDTH, "together_null",
    "together_scatter", *TOGETHER,
)  # fmt: skip
NULLS = ("null", "scatter", "shift_null", "width_null", "together_null", "together_scatter")
ALL = ("strain", "radial_acceleration", "phase_shift")


@dataclass(frozen=True)
class Row:
    """One case and what was said of it."""

    kind: str
    seed: int
    verdict: str
    named: str
    excess_over_floor: float
    reduced_chi2: float
    ranking: str
    seconds: float
    #: of what is planted, if it is named by the same numbers: off by so many standard errors
    pulls: str = ""


def _planted(kind: str) -> str:
    """The effect that a kind of case hides; null and scatter for none."""
    for prefix in ("shift_", "width_", "together_"):
        kind = kind.removeprefix(prefix)
    return kind


def scenarios(kind: str, seed: int) -> Iterator[Scenario]:
    """The two logs of a case."""
    draw = np.random.default_rng(seed)
    speeds = draw.uniform(0.95, 1.05, len(SPEEDS_M_S)) * SPEEDS_M_S
    plan: list[Record] = []
    for i, speed in enumerate(speeds):
        if i:
            hurry = abs(speed - speeds[i - 1]) / draw.uniform(1.5, 3.0)
            plan.append(Manoeuvre(float(max(2.0, hurry)), float(speed), None))
        plan.append(Manoeuvre(7.0, float(speed), None))
    other = draw.uniform(0.6, 1.6, 4)
    usual = TrueTire()
    shift, several = kind.startswith("shift_"), kind.startswith("together_")
    tire = replace(
        usual,
        torsional_stiffness_N_m2=TORSIONAL_STIFFNESS_N_M2 if kind == "shift_wind_up" else None,
        flexural_stiffness_N_m2=float(2.0 * other[0]),
        radial_stiffness_N_m2=float(usual.radial_stiffness_N_m2 * other[1]),
        tangential_stiffness_N_m2=float(usual.tangential_stiffness_N_m2 * other[2]),
        tread_stiffness_N_m2=float(usual.tread_stiffness_N_m2 * other[3]),
        width_belt_m=float(draw.uniform(0.11, 0.16)),
    )
    name = _planted(kind)
    effects: tuple[Planted, ...] = ()
    if name in PLANTABLE and kind not in WIDTH:
        sizes = {**PLANTABLE[name].parameters, **SIZES.get(name, {})}
        effects = (Planted(name, "exact", sizes),)
    channels = wheel_channels(Instruments(forces=shift))
    if several:
        channels["strain"] = Sensor(
            "fbg_strain", sampling_rate_Hz=2500.0, angle_deg=200.0, noise=0.0008
        )
    elif not (shift or kind.startswith("width_")):
        del channels["encoder"]
    for number, pressure in enumerate(PRESSURES_PA):
        stiffens = kind in WIDTH or name == "inflated_sidewalls"
        stiffer = (pressure / PRESSURES_PA[0]) ** (STIFFENS if stiffens else 0.0)
        yield Scenario(
            manoeuvres=tuple(plan),
            channels=channels,
            tire=replace(
                tire,
                radial_stiffness_N_m2=tire.radial_stiffness_N_m2 * stiffer,
                tangential_stiffness_N_m2=tire.tangential_stiffness_N_m2 * stiffer,
            ),
            truth="ring",
            conditions=TrueConditions(inflation_pressure_Pa=pressure),
            road=Road(0.01, load_scatter=0.01 if name == "scatter" else 0.0),
            effects=effects,
            seed=seed + 500_000 * number,
        )


def _of_known_tire(model: Model, log: Recording) -> Model:
    """The model with the ring that the acceleration of a log shows, held."""
    ring, _ = new_model("ring", log.setup, observable="radial_acceleration")
    seen = measured_together([log], ("radial_acceleration",)).revolutions
    fit = start_from(measured_pieces(seen), ring).fit
    known = {name: fit.model.values[name] for name in fit.names if name in model.parameters}
    model = model.with_values(known)
    return model.with_parameters({name: model.parameters[name].fixed() for name in known})


def run(kind: str, seed: int) -> Row:
    """One case from the scenario to the verdict."""
    logs = [
        to_recording(simulate(log), f"log_{i + 1}") for i, log in enumerate(scenarios(kind, seed))
    ]
    observables: tuple[str, ...] = ("radial_acceleration",)
    if kind.startswith("shift_"):
        observables = ("phase_shift",)
    elif kind.startswith("width_"):
        observables = ("patch_width",)
    elif kind.startswith("together_"):
        observables = ALL
    begun = time.process_time()
    model, _ = new_model("ring", logs[0].setup, observable=observables)
    if kind.startswith("width_"):
        model = _of_known_tire(model, logs[0])
    found = diagnose(measured_together(logs, observables).revolutions, model)
    excess = max(found.rmse_heldout_before**2 / found.noise_floor**2 - 1.0, 0.0)
    return Row(
        kind,
        seed,
        found.verdict,
        "+".join(found.selected),
        float(np.sqrt(excess)),
        found.reduced_chi2_before,
        " ".join(f"{c.effect}:{c.excess_removed:.3f}" for c in found.effects[:3]),
        time.process_time() - begun,
        _pulls(_planted(kind), found.effects),
    )


def _pulls(name: str, effects: Iterable[Candidate]) -> str:
    """How far off each number of the planted effect is, in its standard errors, as `name:pull`."""
    true = PLANTABLE[name].parameters if name in COMPARED else {}
    told = next((c.strengths for c in effects if c.effect == name and c.selected), {})
    return " ".join(
        f"{number}:{(told[number]['value'] - true[number]) / told[number]['se']:.2f}"
        for number in true
        if number in told and told[number]["se"]
    )


def summary(rows: Iterable[dict[str, str]]) -> Iterator[str]:
    """Rates by kind, and over all."""
    rows = list(rows)
    nulls = [r for r in rows if r["kind"] in NULLS]
    yield "nulls, nothing missing   " + wilson(
        sum(r["verdict"] == "nothing_missing" for r in nulls), len(nulls)
    )
    single = [r for r in rows if r not in nulls]
    right = [r for r in single if r["named"] == _planted(r["kind"])]
    yield "effects, named           " + wilson(len(right), len(single))
    yield "of these, named alone    " + wilson(
        sum(r["verdict"] == "missing" for r in right), len(single)
    )
    false = [r for r in rows if r["named"] and r not in right]
    yield "false names              " + wilson(len(false), len(rows))
    for r in rows:
        if r not in right and (r in single or r["verdict"] != "nothing_missing"):
            yield f"  not: {r['kind']}/{r['seed']}: {r['verdict']} {r['named']} ({r['ranking']})"
    pulls = [
        (r["kind"], pull.split(":")[0], abs(float(pull.split(":")[1])))
        for r in rows
        for pull in (r.get("pulls") or "").split()
    ]
    for kind, number in sorted({pull[:2] for pull in pulls}):
        sizes = [size for *what, size in pulls if tuple(what) == (kind, number)]
        within = sum(size < 2.0 for size in sizes)
        yield f"{kind}, {number} within 2 standard errors   " + wilson(within, len(sizes))
    seconds = sorted(float(r["seconds"]) for r in rows)
    if seconds:
        yield f"CPU {seconds[len(seconds) // 2]:.1f} s each (median), {seconds[-1]:.1f} s at most"


if __name__ == "__main__":
    run_or_sum_up(__doc__, KINDS, "1000:1004", Row, run, summary)
