"""Cases for the nuisance benchmark: what is driven, on which tire, in which world.

    world, seed, carcass --drawn--> one scenario per log (tables, and the TOML of them)

What a seed draws is the same in every world, so that worlds differ by their nuisance alone. Seeds
below 1000 are for choosing thresholds, from 20000 on for reporting, and they are of differing
kinds:

    tuning     a car's tire (215/45 R17) within 20 %, grating outside, 2.5 kHz, 0.8 pm; speeds up
               and down in turn, gentle
    small      from 500 on, for choosing too: a small tire (165/65 R14), grating inside, 1 or 5 kHz,
               0.4 to 1.6 pm; speeds down a staircase, or short stretches with hard changes
    reporting  a heavier, larger tire (255/55 R19), grating inside, 2 or 4 kHz, 0.5 to 1.2 pm;
               speeds up a staircase, hard braking, a long way down, pulses of the throttle
    drawn      from 40000 on, to calibrate: each seed takes one of these three kinds of tire
    checking   from 60000 on, to check a calibration: a van's stiff tire (215/65 R16C), grating
               outside, 3 kHz, 0.6 to 1 pm; short sprints, and a long way up and down
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import tomlkit

from benchmarks.cases import PLANS, planted
from tirelog.errors import UsageError, nearest
from tirelog.simulation import Scenario, scenario_of

Tables = dict[str, Any]
Range = tuple[float, float]

FIRST_SMALL = 500
FIRST_REPORTING = 20000
FIRST_DRAWN = 40000
FIRST_CHECKING = 60000
#: a tire warms by so much within its log [K], so that pressure, k, EJ and L drift together
WARMED_K = 20.0
#: per K: foundation, bending, patch length (beam only: a ring's follows), and absolute pressure
PER_K = {
    "stiffness_per_K": 0.002,
    "bending_per_K": -0.002,
    "patch_length_per_K": -0.00125,
    "pressure_per_K": 0.0034,
}


@dataclass(frozen=True)
class Kind:
    """What seeds of one kind draw from: ranges, and the plans of a log (seconds, speed)."""

    name: str
    radius_m: Range
    bending_N_m2: Range
    foundation_N_m2: Range
    mass_kg_m: Range
    half_length_m: Range
    load_N: Range
    lever_m: Range
    ring_bending_N_m2: Range
    ring_stiffness_N_m2: Range
    width_belt_m: Range
    surface: str
    rates_Hz: tuple[float, ...]
    noise_nm: Range
    roughness: Range
    loads: tuple[float, ...]
    plans: tuple[tuple[tuple[float, float], ...], ...]


TUNING = Kind(
    "tuning",
    radius_m=(0.295, 0.315),
    bending_N_m2=(3.2, 4.8),
    foundation_N_m2=(1.6e6, 2.4e6),
    mass_kg_m=(4.2, 4.8),
    half_length_m=(0.054, 0.062),
    load_N=(3200.0, 3700.0),
    lever_m=(2.5e-4, 3.5e-4),
    ring_bending_N_m2=(1.7, 2.4),
    ring_stiffness_N_m2=(5.5e5, 7.5e5),
    width_belt_m=(0.12, 0.16),
    surface="outer",
    rates_Hz=(2500.0,),
    noise_nm=(0.0008, 0.0008),
    roughness=(0.004, 0.004),
    loads=(1.0, 1.2),
    plans=(
        PLANS["mixed"],
        ((5, 10), (3, 16), (5, 16), (4, 11), (5, 11), (4, 21), (5, 21), (3, 14), (5, 14), (3, 9)),
    ),
)
SMALL = Kind(
    "small",
    radius_m=(0.265, 0.285),
    bending_N_m2=(2.0, 3.2),
    foundation_N_m2=(1.2e6, 1.8e6),
    mass_kg_m=(3.0, 3.8),
    half_length_m=(0.046, 0.054),
    load_N=(2300.0, 2900.0),
    lever_m=(2.0e-4, 3.0e-4),
    ring_bending_N_m2=(1.2, 1.8),
    ring_stiffness_N_m2=(4.5e5, 6.0e5),
    width_belt_m=(0.10, 0.13),
    surface="inner",
    rates_Hz=(1000.0, 5000.0),
    noise_nm=(0.0004, 0.0016),
    roughness=(0.003, 0.007),
    loads=(0.9, 1.25),
    plans=(
        (
            (4, 22),
            (2.5, 17),
            (6, 17),
            (2, 12.5),
            (6, 12.5),
            (1.5, 8.5),
            (5, 8.5),
            (4, 19),
            (4, 19),
            (3, 10),
        ),
        (
            (3, 12),
            (2, 18),
            (3, 18),
            (2, 9),
            (4, 9),
            (3, 20),
            (3, 20),
            (2, 14),
            (4, 14),
            (1.5, 10),
            (3, 10),
            (6, 22),
        ),
    ),
)
REPORTING = Kind(
    "reporting",
    radius_m=(0.345, 0.37),
    bending_N_m2=(6.0, 9.0),
    foundation_N_m2=(2.5e6, 3.4e6),
    mass_kg_m=(6.0, 7.0),
    half_length_m=(0.066, 0.078),
    load_N=(4900.0, 5600.0),
    lever_m=(4.0e-4, 5.5e-4),
    ring_bending_N_m2=(2.4, 3.6),
    ring_stiffness_N_m2=(7.0e5, 9.5e5),
    width_belt_m=(0.15, 0.19),
    surface="inner",
    rates_Hz=(2000.0, 4000.0),
    noise_nm=(0.0005, 0.0012),
    roughness=(0.003, 0.008),
    loads=(0.85, 1.1),
    plans=(
        (
            (5, 8),
            (2.5, 13),
            (5, 13),
            (2.5, 18),
            (5, 18),
            (3, 24),
            (5, 24),
            (4, 10),
            (5, 10),
            (3, 7),
        ),
        (
            (5, 23),
            (8, 15),
            (5, 15),
            (2, 20),
            (2.5, 16.5),
            (2, 20),
            (5, 20),
            (6, 8),
            (5, 8),
            (3, 13),
        ),
    ),
)
CHECKING = Kind(
    "checking",
    radius_m=(0.325, 0.345),
    bending_N_m2=(4.5, 6.5),
    foundation_N_m2=(2.2e6, 3.0e6),
    mass_kg_m=(5.0, 6.2),
    half_length_m=(0.058, 0.068),
    load_N=(3900.0, 4800.0),
    lever_m=(3.0e-4, 4.2e-4),
    ring_bending_N_m2=(2.0, 3.0),
    ring_stiffness_N_m2=(6.5e5, 8.5e5),
    width_belt_m=(0.13, 0.17),
    surface="outer",
    rates_Hz=(3000.0,),
    noise_nm=(0.0006, 0.001),
    roughness=(0.003, 0.009),
    loads=(0.9, 1.3),
    plans=(
        (
            (3, 9),
            (3, 19),
            (2, 19),
            (2, 11),
            (4, 11),
            (3, 21),
            (4, 21),
            (3, 13),
            (5, 13),
            (4, 23),
            (4, 23),
            (5, 10),
        ),
        (
            (4, 8),
            (12, 22),
            (6, 22),
            (14, 9),
            (4, 9),
            (3, 15),
            (6, 15),
            (3, 12),
            (4, 12),
            (2, 16),
        ),
    ),
)


@dataclass
class Drawn:
    """One log as drawn: the tables of its scenario, and what the worlds may draw from."""

    tables: Tables
    random: np.random.Generator
    carcass: str

    @property
    def duration_s(self) -> float:
        return float(sum(m["duration_s"] for m in self.tables["manoeuvres"]))

    @property
    def grating(self) -> Tables:
        channel: Tables = self.tables["channels"]["strain_1"]
        return channel

    def nuisance(self, name: str, **values: Any) -> None:
        self.tables.setdefault("nuisances", {})[name] = values


def _phases(log: Drawn) -> list[float]:
    return [round(float(p), 1) for p in log.random.uniform(0.0, 360.0, 3)]


def _run_out(microstrain: float) -> Callable[[Drawn], None]:
    def change(log: Drawn) -> None:
        sizes = [round(microstrain * share, 3) for share in (1.0, 0.5, 0.27)]
        log.nuisance("run_out", amplitudes_microstrain=sizes, phases_deg=_phases(log))

    return change


def _force_variation(log: Drawn) -> None:
    log.nuisance("force_variation", shares=[0.012, 0.006, 0.004], phases_deg=_phases(log))


def _load_wander(log: Drawn) -> None:
    seconds = round(float(log.random.uniform(2.0, 6.0)), 2)
    log.nuisance("load_wander", share=0.03, time_constant_s=seconds)


def _scatter(share: float) -> Callable[[Drawn], None]:
    def change(log: Drawn) -> None:
        log.tables["road"]["load_scatter"] = share

    return change


def _warming(logged: bool) -> Callable[[Drawn], None]:
    def change(log: Drawn) -> None:
        seconds = round(float(log.random.uniform(0.5, 2.0)) * log.duration_s, 1)
        final = WARMED_K / -math.expm1(-log.duration_s / seconds)
        log.tables["conditions"].update(warm_up_K=round(final, 3), warm_up_time_s=seconds)
        sizes = dict(PER_K)
        if log.carcass == "ring":
            del sizes["patch_length_per_K"]
        log.nuisance("warming", **sizes)
        if logged:
            rate = log.grating["sampling_rate_Hz"]
            for name, kind, noise in (
                ("pressure", "inflation_pressure", 300.0),
                ("warmth", "temperature", 0.1),
            ):
                log.tables["channels"][name] = {
                    "kind": kind,
                    "sampling_rate_Hz": rate,
                    "noise": noise,
                }

    return change


def _radius(log: Drawn) -> None:
    log.nuisance("rolling_radius", error=-0.015, growth=0.02, at_speed_m_s=25.0)


def _colour(log: Drawn) -> None:
    log.grating.update(noise_correlation=0.9, hum=0.003, hum_Hz=50.0, flicker=0.004)


def _interrogator(log: Drawn) -> None:
    log.grating.update(
        noise=0.0003, quantisation=0.001, lost_fraction=0.01, lost_run=20.0, lost_at_flanks=0.3
    )


def _exponent(exponent: float) -> Callable[[Drawn], None]:
    def change(log: Drawn) -> None:
        log.tables["tire"]["patch_load_exponent"] = exponent
        if log.carcass == "ring":
            # on a flat road the patch follows from the ring itself
            log.tables["tire"]["contact"] = "parabola"

    return change


WORLDS: Mapping[str, Callable[[Drawn], None]] = {
    "control": lambda log: None,
    "run_out_3": _run_out(3.0),
    "run_out_30": _run_out(30.0),
    "force_variation": _force_variation,
    "load_wander": _load_wander,
    "scatter_1": _scatter(0.01),
    "scatter_3": _scatter(0.03),
    "warming": _warming(False),
    "warming_logged": _warming(True),
    "radius": _radius,
    "colour": _colour,
    "interrogator": _interrogator,
    "exponent_0.35": _exponent(0.35),
    "exponent_0.8": _exponent(0.8),
}
#: these belong to the wheel: every log of a case has the same
SHARED = ("run_out_3", "run_out_30", "force_variation")
#: of each of these at most one can be in a world
KINDS = (
    ("run_out_3", "run_out_30"),
    ("force_variation",),
    ("load_wander",),
    ("scatter_1", "scatter_3"),
    ("warming", "warming_logged"),
    ("radius",),
    ("colour", "interrogator"),
    ("exponent_0.35", "exponent_0.8"),
)
#: worlds of several nuisances that each seed draws anew
AT_ONCE = {"two": 2, "four": 4}


def kind_of(seed: int) -> Kind:
    """What a seed draws from."""
    if seed >= FIRST_CHECKING:
        return CHECKING
    if seed >= FIRST_DRAWN:
        return (TUNING, SMALL, REPORTING)[seed % 3]
    if seed < FIRST_SMALL:
        return TUNING
    return SMALL if seed < FIRST_REPORTING else REPORTING


def several(count: int, seed: int) -> str:
    """The world of `count` nuisances at once that a seed draws."""
    random = np.random.default_rng([seed, count, 19])
    some = sorted(random.choice(len(KINDS), count, replace=False).tolist())
    return "+".join(KINDS[k][int(random.integers(len(KINDS[k])))] for k in some)


def parts_of(world: str) -> list[str]:
    """The worlds that `world` joins by +.  UsageError for one that is not known."""
    parts = world.split("+")
    for part in parts:
        if part not in WORLDS:
            raise UsageError(
                f"unknown world {part!r}{nearest(part, WORLDS)}; "
                f"allowed are {', '.join((*WORLDS, *AT_ONCE))}, several joined by +; mend it"
            )
    return parts


def _in(random: np.random.Generator, between: Range, digits: int = 4) -> float:
    return float(f"{random.uniform(*between):.{digits}g}")


def _tire(kind: Kind, carcass: str, random: np.random.Generator) -> Tables:
    radius = _in(random, kind.radius_m)
    bending = _in(random, kind.bending_N_m2)
    tire = {
        "name": f"{kind.name} seed",
        "rolling_radius_m": radius,
        "unloaded_radius_m": round(1.025 * radius, 4),
        "foundation_stiffness_N_m2": _in(random, kind.foundation_N_m2),
        "line_mass_kg_m": _in(random, kind.mass_kg_m),
        "patch_half_length_m": _in(random, kind.half_length_m),
        "reference_load_N": _in(random, kind.load_N),
        "lever_arm_m": _in(random, kind.lever_m),
        "flexural_stiffness_N_m2": bending,
    }
    ring_bending = _in(random, kind.ring_bending_N_m2)
    stiffness = _in(random, kind.ring_stiffness_N_m2)
    width = _in(random, kind.width_belt_m)
    if carcass == "ring":
        # the model's hoop force is the setup's pressure times the setup's width
        tire.update(
            width_m=width,
            width_belt_m=width,
            flexural_stiffness_N_m2=ring_bending,
            radial_stiffness_N_m2=stiffness,
            tangential_stiffness_N_m2=_in(random, (0.8 * stiffness, 1.2 * stiffness)),
        )
    return tire


def _drive(kind: Kind, random: np.random.Generator) -> list[Tables]:
    """A plan of the kind, speeds and times varied by up to 6 %."""
    plan = kind.plans[int(random.integers(len(kind.plans)))]
    out, speed, factor = [], plan[0][1], 1.0
    for number, (seconds, to) in enumerate(plan):
        if number == 0 or to != speed:
            factor = 1.0 + 0.06 * float(random.uniform(-1.0, 1.0))
        duration = seconds * (1.0 + 0.06 * float(random.uniform(-1.0, 1.0)))
        out.append({"duration_s": round(duration, 3), "speed_m_s": round(to * factor, 3)})
        speed = to
    return out


@dataclass(frozen=True)
class CaseOf:
    """One case: world, seed, carcass, and what is planted at how much of its ordinary size."""

    world: str
    seed: int
    carcass: str = "beam"
    effect: str = ""
    strength: float = 1.0
    logs: int = 2
    form: str = "exact"

    def tables(self) -> list[Tables]:
        """The tables of each log's scenario."""
        kind = kind_of(self.seed)
        random = np.random.default_rng([self.seed, 16])
        tire = _tire(kind, self.carcass, random)
        rate = kind.rates_Hz[int(random.integers(len(kind.rates_Hz)))]
        noise, roughness = _in(random, kind.noise_nm), _in(random, kind.roughness)
        angle = round(float(random.uniform(0.0, 360.0)), 1)
        turned = int(random.integers(2))  # so that age and water go with the load or against it
        out = []
        for number in range(self.logs):
            share = kind.loads[number % len(kind.loads)]
            tables: Tables = {
                "seed": int(random.integers(2**31)),
                "truth": self.carcass,
                "tire": dict(tire),
                "conditions": {
                    "load_N": round(tire["reference_load_N"] * share, 1),
                    "distance_km": (2000.0, 30000.0)[(number + turned) % 2],
                    "water_depth_mm": (0.0, 1.0)[(number + turned) % 2],
                },
                "road": {"roughness": roughness},
                "manoeuvres": _drive(kind, random),
                "channels": {
                    "strain_1": {
                        "kind": "fbg_strain",
                        "source": "CH1",
                        "surface": kind.surface,
                        "angle_deg": angle,
                        "sampling_rate_Hz": rate,
                        "noise": noise,
                        "quantisation": 1e-4,
                    }
                },
            }
            for part in parts_of(self.world):
                key = sum(part.encode()) * 8 + (0 if part in SHARED else 1 + number)
                WORLDS[part](
                    Drawn(tables, np.random.default_rng([self.seed, 17, key]), self.carcass)
                )
            if self.effect:
                strength = self.strength
                if self.effect == "thermal_drift" and "warm_up_K" in tables["conditions"]:
                    strength /= WARMED_K  # per K if the temperature is known, else per log
                tables["effects"] = [planted_tables(self.effect, strength, self.form)]
            out.append(tables)
        return out

    @property
    def contact(self) -> str | None:
        """The contact of the model that is held against the case; None: the carcass's own."""
        given = self.tables()[0]["tire"].get("contact")
        return "prescribed" if given == "parabola" else None

    def scenarios(self) -> list[Scenario]:
        """One scenario per log."""
        return [scenario_of(tables) for tables in self.tables()]

    def texts(self) -> list[str]:
        """The scenario files of the logs."""
        return [tomlkit.dumps(tables) for tables in self.tables()]


def planted_tables(effect: str, strength: float, form: str = "exact") -> Tables:
    """An [[effects]] table at `strength` times its ordinary size."""
    (one,) = planted([effect], form, strength)
    return {"name": one.name, "form": one.form, **one.parameters}
