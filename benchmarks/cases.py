"""Scenarios by a few arguments: cases with planted effects, for self-tests, tutorials and
benchmarks.

    effects, strengths, form, seed, plan, truth --> case(...)
        --> one Scenario a log, ready for `simulate`

A case is what a test engineer would drive to learn something: two to four logs of about a minute,
each under its own load, tread age and water depth, with cruises at several speeds, drive, coast and
brake. Which of the effects are planted changes nothing else in it, so that a case without effects
is a true null.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from tirelog.errors import UsageError, nearest
from tirelog.simulation.scenario.schema import (
    FORMS,
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

#: ordinary strengths: the main parameter and what goes with it, so that the excess is some 3 to 6
#: noise floors
ORDINARY: dict[str, Mapping[str, float]] = {
    "viscous_damping": {"damping_rate_1_s": 40.0},
    "hysteresis": {"loss_factor": 0.06},
    "belt_tension": {"tension_N": 0.0, "tension_mass_kg_m": 3.0, "stretch_s2_m2": 1.0e-7},
    "stiffening": {"cubic_1_m2": 3000.0},
    "pressure_offset": {"offset": 0.12},
    "traction": {"slip_per_g": 0.6, "lever_m": 0.01},
    "edge_impact": {"amplitude": 0.7},
    "rough_contact": {"length": 0.4},
    "water_film": {"amplitude": 0.13},
    "wear": {"amplitude": 0.3, "lever_loss": 0.1},
    "load_transfer": {"coefficient": 0.5},
    "aero_load": {"coefficient": 0.6},
    "thermal_drift": {"drift": 6.0e-5},
    "gauge_length": {"length_m": 0.06},
    "sensor_lag": {"lag_s": 1.2e-4},
    "ring_down": {"amplitude": 1.4e-4},
    "splice": {"amplitude": 9.0e-5},
    "pressure_saddle": {"a": 0.9, "speed_exponent": 2.0},
    "torsion": {"amplitude": 4.0e-5},
    "exit_suction": {"a": 0.15},
    "standing_wave": {"amplitude": 1.4e-4},
    "even_bulge": {"amplitude": 6.0e-5},
}
#: effects of the catalogue that a strain log can show, and effects that no catalogue has
IN_CATALOGUE = tuple(name for name in ORDINARY if PLANTABLE[name].in_catalogue)
OUTSIDE = tuple(name for name in ORDINARY if not PLANTABLE[name].in_catalogue)
#: parameters that are no strength: a fainter case leaves them as they are
_SHAPES = ("lever_m", "position", "width", "time_constant_s", "speed_exponent", "load_exponent")
#: what pairs make sense: each acts on its own place, so that two names can be right
PAIRS = (
    ("viscous_damping", "edge_impact"),
    ("pressure_offset", "aero_load"),
    ("water_film", "load_transfer"),
    ("sensor_lag", "thermal_drift"),
    ("traction", "water_film"),
    ("belt_tension", "wear"),
)

#: the ring that the beam closes to: its own stiffnesses and patch, no hoop force; and, as another
#: form, one under some hoop force
CLOSED = TrueTire(
    contact="parabola",
    flexural_stiffness_N_m2=4.0,
    radial_stiffness_N_m2=2.0e6,
    tangential_stiffness_N_m2=3.0e5,
    width_belt_m=0.0,
)
TENSE = replace(CLOSED, width_belt_m=0.005)
#: relative loads, tread ages [km] and water depths [mm] of the logs of a case, in turn
LOADS = (1.0, 1.2, 0.85, 1.1)
AGES_KM = (2000.0, 30000.0, 16000.0, 38000.0)
WATER_MM = (0.0, 1.0, 0.5, 1.5)

#: (seconds, speed at the end) by plan
PLANS: dict[str, tuple[tuple[float, float], ...]] = {
    "mixed": (
        (7, 9),
        (4, 17),
        (7, 17),
        (7, 12),
        (7, 12),
        (5, 23),
        (7, 23),
        (3.5, 14),
        (6, 14),
        (6.5, 9),
    ),
    "one_speed": ((20, 15),),
    "coast_down": ((4, 24), (50, 9), (6, 9)),
    "short": ((4, 10), (2.5, 16), (4, 16), (4, 11.5), (3, 22), (4, 22), (2, 14), (4, 14)),
}


@dataclass(frozen=True)
class Case:
    """How a case is driven and measured; the planted effects are not in it.

    `scatter` relative standard deviation of the load between manoeuvres, `roughness` within;
    `noise_nm` of the interrogator; `strength` multiplies every planted effect's size; `duration`
    multiplies the plan's times.
    """

    plan: str = "mixed"
    logs: int = 3
    form: str = "exact"
    strength: float = 1.0
    scatter: float = 0.0
    roughness: float = 0.01
    noise_nm: float = 0.0008
    truth: str = "beam"
    surface: str = "outer"
    sampling_rate_Hz: float = 2500.0
    duration: float = 1.0
    channels: Mapping[str, Record] = field(default_factory=dict)


def planted(
    effects: Iterable[str] | Mapping[str, Mapping[str, float]],
    form: str = "exact",
    strength: float = 1.0,
) -> tuple[Planted, ...]:
    """Effects by name at their ordinary size times `strength`, or with the parameters given; those
    outside the catalogue have one form.

    UsageError for an unknown name or form.
    """
    given = effects if isinstance(effects, Mapping) else {name: {} for name in effects}
    if form not in FORMS:
        raise UsageError(
            f"form {form!r}{nearest(form, FORMS)}; allowed are {', '.join(FORMS)}; mend it"
        )
    out = []
    for name, parameters in given.items():
        if name not in ORDINARY:
            raise UsageError(
                f"unknown effect {name!r}{nearest(name, ORDINARY)}; "
                f"allowed are {', '.join(ORDINARY)}; mend it"
            )
        known = PLANTABLE[name].parameters
        values = {**known, **ORDINARY[name], **parameters}
        for size in ORDINARY[name]:
            if size not in _SHAPES:
                values[size] *= strength
        out.append(Planted(name, form if form in PLANTABLE[name].forms else "exact", values))
    return tuple(out)


def case(
    effects: Iterable[str] | Mapping[str, Mapping[str, float]] = (),
    *,
    seed: int,
    how: Case | None = None,
) -> list[Scenario]:
    """One scenario a log.

    `effects` names (ordinary size) or name -> parameters; `ring_curvature` makes the truth a ring
    with the beam's prescribed patch. Different seeds draw different roads, noise, order of speeds
    and places of the sensor.
    """
    how = how or Case()
    if how.plan not in PLANS:
        raise UsageError(
            f"plan {how.plan!r}{nearest(how.plan, PLANS)}; allowed are {', '.join(PLANS)}; mend it"
        )
    names = dict(effects) if isinstance(effects, Mapping) else {name: {} for name in effects}
    curved = names.pop("ring_curvature", None) is not None
    tire = (CLOSED if how.form == "exact" else TENSE) if curved else TrueTire()
    random = np.random.default_rng(seed)
    scenarios = []
    for log in range(how.logs):
        conditions = TrueConditions(
            load_N=3434.0 * LOADS[log % len(LOADS)],
            distance_km=AGES_KM[log % len(AGES_KM)],
            water_depth_mm=WATER_MM[log % len(WATER_MM)],
        )
        sensor = Sensor(
            kind="fbg_strain",
            surface=how.surface,
            angle_deg=float(random.uniform(0.0, 360.0)),
            noise=how.noise_nm,
            sampling_rate_Hz=how.sampling_rate_Hz,
            quantisation=1e-4,
        )
        scenarios.append(
            Scenario(
                manoeuvres=_drive(how, random),
                channels=dict(how.channels) or {"strain_1": sensor},
                tire=tire,
                conditions=conditions,
                road=Road(how.roughness, 2.0, how.scatter),
                effects=planted(names, how.form, how.strength),
                truth="ring" if curved else how.truth,
                seed=int(random.integers(2**31)),
            )
        )
    return scenarios


def _drive(how: Case, random: np.random.Generator) -> tuple[Record, ...]:
    """The plan with speeds and times varied by up to 6 %, so that no two logs lock to the same
    angles.
    """
    parts = []
    speed, factor = PLANS[how.plan][0][1], 1.0
    for number, (seconds, to) in enumerate(PLANS[how.plan]):
        if number == 0 or to != speed:
            factor = 1.0 + 0.06 * float(random.uniform(-1.0, 1.0))
        parts.append(
            Manoeuvre(
                seconds * how.duration * (1.0 + 0.06 * float(random.uniform(-1.0, 1.0))),
                to * factor,
            )
        )
        speed = to
    return tuple(parts)
