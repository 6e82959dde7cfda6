"""The scenario file: TOML becomes a validated Scenario, or an error that says what is allowed.

TOML text --`storage.schema`, the dataclasses in `scenario`, `planted`--> Scenario (frozen)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from tirelog.errors import UsageError
from tirelog.simulation.scenario.schema import (
    PLANTABLE,
    LoadStep,
    Manoeuvre,
    Nuisances,
    Planted,
    Ramp,
    Road,
    Scenario,
    Sensor,
    TrueConditions,
    TrueTire,
    Vehicle,
)
from tirelog.storage.schema import (
    FINITE,
    TEXT,
    Document,
    Entries,
    FilePlace,
    Named,
    Table,
    kinds_of,
    table_of,
    words,
)
from tirelog.storage.whole import toml_text

#: what must be left of a stiffness, a length or the pressure when the tire is warm: less is no
#: tire; twice as much would refuse a foundation that loses half
LEAST_WHEN_WARM = 0.3


#: a drive of so long [s], and so many samples of one channel, are simulated at most: a sample takes
#: up to 140 bytes, so that 850 MB suffice (ten minutes at 10 kHz); twice as many would take 1.7 GB
LONGEST_S = 7200.0
MOST_SAMPLES = 6_000_000
_PLAIN = ("truth", "seed", "grid_points", "knot_s", "step_s", "rounding_s")


class _Effect:
    """One [[effects]] table."""

    allowed = 'allowed is name = "..." of an effect'

    def read(self, value: Any, place: FilePlace) -> Planted:
        name = value.get("name") if isinstance(value, Mapping) else None
        if not isinstance(name, str):
            raise place.error(
                "an [[effects]] table without a name", 'allowed is name = "..."', "add one"
            )
        if name == "ring_curvature":
            raise (place / "name").error(
                "ring_curvature is the carcass itself",
                'allowed is truth = "ring"',
                'set it (contact = "parabola")',
            )
        words(*PLANTABLE).read(name, place / "name")
        planted = PLANTABLE[name]
        numbers = dict.fromkeys(planted.parameters, FINITE)
        given = Table({"name": TEXT, "form": words(*planted.forms), **numbers}).read(value, place)
        del given["name"]
        form = given.pop("form", "exact")
        return Planted(name, form, {**planted.parameters, **given})


_SCENARIO = Table(
    {
        **{name: kinds_of(Scenario)[name] for name in _PLAIN},
        "tire": table_of(TrueTire),
        "conditions": table_of(TrueConditions),
        "vehicle": table_of(Vehicle),
        "road": table_of(Road),
        "nuisances": Table(
            {f.name: table_of(type(getattr(Nuisances(), f.name))) for f in fields(Nuisances)},
            Nuisances,
        ),
        "manoeuvres": Entries(table_of(Manoeuvre)),
        "channels": Named(table_of(Sensor, "kind")),
        "effects": Entries(_Effect()),
        "ramp": table_of(Ramp),
        "load_steps": Entries(table_of(LoadStep)),
    }
)


def scenario_of(data: Mapping[str, Any], file: str | None = None) -> Scenario:
    """The scenario in TOML tables `data`.  UsageError for anything that is not allowed."""
    return _scenario(Document("", UsageError, "a scenario", file), data)


def load_scenario(path: Path | str) -> Scenario:
    """The scenario file at `path`."""
    text = toml_text(path, UsageError, what="a scenario", advice="give another")
    document = Document(text, UsageError, "a scenario", str(path))
    return _scenario(document, document.tables)


def _scenario(document: Document, data: Mapping[str, Any]) -> Scenario:
    """The scenario of the document's tables."""
    place = FilePlace(document)
    values = _SCENARIO.read(data, place)
    place.refuse(
        (
            not values.get("manoeuvres"),
            "manoeuvres",
            "no manoeuvres",
            "a drive is a list of [[manoeuvres]] with duration_s and speed_m_s",
            "add one",
        ),
        (
            not values.get("channels"),
            "channels",
            "no channels",
            'a log has at least one [channels.NAME] with kind = "..."',
            "add one",
        ),
    )
    steps = sorted(values.pop("load_steps", ()), key=lambda step: float(step.time_s))
    scenario = Scenario(**values, load_steps=tuple(steps))
    if scenario.road.file:
        # a profile stands beside its scenario
        profile = Path(str(document.file or "")).parent / scenario.road.file
        scenario = replace(scenario, road=replace(scenario.road, file=str(profile.resolve())))
    _check(scenario, place)
    return scenario


def _check(scenario: Scenario, place: FilePlace) -> None:
    """What one table alone cannot say."""
    fastest = max(sensor.sampling_rate_Hz for sensor in scenario.channels.values())
    names = [effect.name for effect in scenario.effects]
    twice = next((name for name in names if names.count(name) > 1), None)
    coupled = scenario.truth == "coupled_ring"
    moving = "[[load_steps]]" if scenario.load_steps else f'[road] kind = "{scenario.road.kind}"'
    place.refuse(
        (
            scenario.grid_points % 2,
            "grid_points",
            f"grid_points = {scenario.grid_points}",
            "allowed is an even number",
            "",
        ),
        (
            scenario.duration_s > LONGEST_S or scenario.duration_s * fastest > MOST_SAMPLES,
            "",
            f"a log of {scenario.duration_s:.6g} s at {fastest:g} Hz is too long to be simulated",
            f"allowed are {LONGEST_S:g} s and {MOST_SAMPLES:.0e} samples of a channel",
            "drive less, sample slower, or simulate several logs",
        ),
        (twice, "effects", f"effect {twice!r} is planted twice", "allowed is once", "remove one"),
        (
            scenario.ramp is not None and _overlap(scenario.ramp),
            "ramp",
            "stops of the [ramp] overlap or lie outside",
            "allowed are stops between begin_s and end_s",
            "mend them",
        ),
    )
    _check_nuisances(scenario, place / "nuisances")
    if coupled:
        _check_coupled(scenario, place)
    place.refuse(
        (
            not coupled and (scenario.load_steps or scenario.road.kind != "flat"),
            "load_steps" if scenario.load_steps else "road",
            f"{moving} needs a tire that moves",
            'allowed is truth = "coupled_ring"',
            "set it",
        )
    )
    for name, sensor in scenario.channels.items():
        twin = sensor.temperature_channel
        kind = scenario.channels[twin].kind if twin and twin in scenario.channels else ""
        (place / "channels" / name).refuse(
            (
                twin is not None and kind != "fbg_temperature",
                "temperature_channel",
                f"temperature_channel {twin!r} of {name}",
                "allowed is a channel of kind fbg_temperature",
                "",
            )
        )


def _overlap(ramp: Ramp) -> bool:
    """Whether stops of a ramp overlap or lie outside of it."""
    stops = sorted(ramp.stops_s)
    ends = [ramp.begin_s, *(s + ramp.stop_length_s for s in stops)]
    return any(a >= b for a, b in zip(ends, [*stops, ramp.end_s], strict=True))


def _check_nuisances(scenario: Scenario, place: FilePlace) -> None:
    """What the tables under [nuisances] alone cannot say."""
    nuisances, warm_up = scenario.nuisances, scenario.conditions.warm_up_K
    run_out, force, warming = nuisances.run_out, nuisances.force_variation, nuisances.warming
    what = "a [ramp]" if scenario.ramp is not None else 'truth = "coupled_ring"'
    harmonics = (
        ("run_out", run_out.amplitudes_microstrain, run_out.phases_deg),
        ("force_variation", force.shares, force.phases_deg),
    )
    shares = ("stiffness_per_K", "bending_per_K", "patch_length_per_K", "pressure_per_K")
    left = {name: 1.0 + getattr(warming, name) * warm_up for name in shares}
    place.refuse(
        (
            nuisances != Nuisances()
            and (scenario.truth == "coupled_ring" or scenario.ramp is not None),
            "",
            f"[nuisances] with {what}",
            'allowed is a drive with truth = "beam" or "ring"',
            "remove one",
        ),
        *(
            (
                len(phases) > len(sizes),
                name,
                f"{len(phases)} phases_deg for {len(sizes)} harmonics in [nuisances.{name}]",
                "allowed is one for each",
                "remove some",
            )
            for name, sizes, phases in harmonics
        ),
        (
            warming.patch_length_per_K
            and scenario.truth == "ring"
            and scenario.tire.contact == "flat_road",
            "warming",
            f"patch_length_per_K = {warming.patch_length_per_K!r} in [nuisances.warming] of a ring "
            "on a flat road, whose patch follows from pressure and stiffness",
            'allowed is 0, or contact = "parabola"',
            "",
        ),
        *(
            (
                least < LEAST_WHEN_WARM,
                "warming",
                f"{name} = {getattr(warming, name)!r} in [nuisances.warming] leaves {least:g} of "
                f"it after warm_up_K = {warm_up:g}",
                f"allowed is {LEAST_WHEN_WARM:g} at least",
                "lower one",
            )
            for name, least in left.items()
        ),
    )


#: effects that a tire in motion knows: on the load, the sensors and the telemetry
_MOVING = (
    "load_transfer",
    "aero_load",
    "gauge_length",
    "sensor_lag",
    "telemetry_delay",
    "tooth_pitch",
)


def _check_coupled(scenario: Scenario, place: FilePlace) -> None:
    """What a tire in motion cannot do."""
    what = "a [ramp]" if scenario.ramp is not None else 'contact = "parabola"'
    with_truth = 'with truth = "coupled_ring"'
    place.refuse(
        *(
            (
                effect.name not in _MOVING
                or (effect.form != "exact" and effect.name in ("gauge_length", "sensor_lag")),
                "effects",
                f"effect {effect.name!r} in its form {effect.form!r} {with_truth}",
                f"allowed are {', '.join(_MOVING)} as the catalogue has them",
                "remove it",
            )
            for effect in scenario.effects
        ),
        (
            scenario.tire.contact == "parabola" or scenario.ramp is not None,
            "ramp" if scenario.ramp is not None else "tire",
            f"{what} {with_truth}",
            'allowed is truth = "ring" or "beam"',
            "remove it",
        ),
        (
            scenario.tire.slip_stiffness_N is not None,
            "tire",
            f"slip_stiffness_N {with_truth}, which slips on its bristles",
            'allowed is truth = "ring" or "beam"',
            "remove it, or give bristle_stiffness_N_m2",
        ),
        (
            scenario.grid_points % 8,
            "grid_points",
            f"grid_points = {scenario.grid_points} {with_truth}",
            "allowed are multiples of 8",
            "",
        ),
    )
