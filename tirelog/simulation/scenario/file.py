"""The scenario file: TOML becomes a validated Scenario, or an error that says what is allowed.

    TOML text --tomllib--> tables
        --fields of the dataclasses in `scenario`, parameters in `planted`--> Scenario (frozen)

What is unknown is refused with what is allowed and the nearest spelling.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import Field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from tirelog.errors import UsageError, nearest, refuse_unknown
from tirelog.simulation.scenario.planted import PLANTABLE, Planted
from tirelog.simulation.scenario.schema import (
    SOURCE_UNITS,
    TRUTHS,
    LoadStep,
    Manoeuvre,
    Nuisances,
    Ramp,
    Road,
    Scenario,
    Sensor,
    TrueConditions,
    TrueTire,
    Vehicle,
)
from tirelog.storage.documents import toml_tables, toml_text

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")
#: what must be left of a stiffness, a length or the pressure when the tire is warm: less is no
#: tire; twice as much would refuse a foundation that loses half
LEAST_WHEN_WARM = 0.3


def _wrong(file: str | None, what: str, allowed: str, *, do: str = "mend it") -> UsageError:
    """The error of a scenario's file."""
    return UsageError(what, allowed=allowed, do=do, file=file)


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _value(spec: Field[Any], value: Any, table: str, file: str | None) -> Any:
    """`value` as the field wants it, or a UsageError that says what is allowed."""
    wanted, at = str(spec.type), f"{spec.name} = {value!r} in [{table}]"
    if "length" in spec.metadata:
        (low, high), most = spec.metadata["range"], spec.metadata["length"]
        if (
            not isinstance(value, list)
            or len(value) > most
            or not all(_number(v) and low <= v <= high for v in value)
        ):
            raise _wrong(
                file, at, f"allowed is a list of at most {most} numbers from {low:g} to {high:g}"
            )
        return tuple(float(v) for v in value)
    if "tuple" in wanted:
        whole = "int" in wanted
        if not isinstance(value, list) or not all(
            _number(v) and v >= 0 and (v == int(v) or not whole) for v in value
        ):
            raise _wrong(
                file, at, f"allowed is a list of {'whole ' if whole else ''}numbers from 0"
            )
        return tuple(int(v) if whole else float(v) for v in value)
    if "float" in wanted or "int" in wanted:
        low, high = spec.metadata.get("range", (-(2**62), 2**62))
        if (
            not _number(value)
            or not low <= value <= high
            or ("int" in wanted and value != int(value))
        ):
            raise _wrong(file, at, f"allowed is a number from {low:g} to {high:g}")
        return int(value) if "int" in wanted else float(value)
    if not isinstance(value, bool if "bool" in wanted else str):
        raise _wrong(
            file, at, f"allowed is {'true or false' if 'bool' in wanted else 'text in quotes'}"
        )
    allowed = spec.metadata.get("allowed")
    if allowed:
        refuse_unknown(value, allowed, at, file=file)
    return value


def _table(cls: type[T], data: Any, table: str, file: str | None) -> T:
    """A TOML table as the dataclass `cls`."""
    if not isinstance(data, Mapping):
        raise _wrong(file, f"{table} is not a table", f"allowed is [{table}] with keys under it")
    specs: dict[str, Field[Any]] = {f.name: f for f in fields(cls)}
    for key in data:
        refuse_unknown(key, specs, f"unknown key {key!r} in [{table}]", file=file)
    return cls(**{key: _value(specs[key], value, table, file) for key, value in data.items()})


def _nuisances(data: Any, file: str | None) -> Nuisances:
    """The table [nuisances]: a table for each of its fields."""
    none = Nuisances()
    known = [f.name for f in fields(Nuisances)]
    if not isinstance(data, Mapping):
        raise _wrong(
            file, "nuisances is not a table", f"allowed are [nuisances.{known[0]}] and the like"
        )
    for key in data:
        refuse_unknown(key, known, f"unknown key {key!r} in [nuisances]", file=file)
    return Nuisances(
        **{
            key: _table(type(getattr(none, key)), table, f"nuisances.{key}", file)
            for key, table in data.items()
        }
    )


def _planted(data: Any, file: str | None) -> Planted:
    """One [[effects]] table."""
    if not isinstance(data, Mapping) or not isinstance(data.get("name"), str):
        raise _wrong(
            file, "an [[effects]] table without a name", 'allowed is name = "..."', do="add one"
        )
    name, form = data["name"], data.get("form", "exact")
    if name == "ring_curvature":
        raise _wrong(
            file,
            "ring_curvature is the carcass itself",
            'allowed is truth = "ring"',
            do='set it (contact = "parabola")',
        )
    refuse_unknown(name, PLANTABLE, f"unknown effect {name!r}", file=file)
    forms = PLANTABLE[name].forms
    refuse_unknown(form, forms, f"form = {form!r} of {name}", file=file)
    given = {key: value for key, value in data.items() if key not in ("name", "form")}
    allowed = PLANTABLE[name].parameters
    for key, value in given.items():
        refuse_unknown(key, allowed, f"unknown parameter {key!r} of {name}", file=file)
        if not _number(value):
            raise _wrong(file, f"{key} = {value!r} of {name}", "allowed is a finite number")
    return Planted(name, form, {**allowed, **{k: float(v) for k, v in given.items()}})


#: a drive of so long [s], and so many samples of one channel, are simulated at most: a sample takes
#: up to 140 bytes, so that 850 MB suffice (ten minutes at 10 kHz); twice as many would take 1.7 GB
LONGEST_S = 7200.0
MOST_SAMPLES = 6_000_000
_TABLES = {"tire": TrueTire, "conditions": TrueConditions, "vehicle": Vehicle, "road": Road}
_PLAIN = {
    "truth": TRUTHS,
    "seed": (0, 2**62),
    "grid_points": (256, 65536),
    "knot_s": (0.005, 0.05),
    "rounding_s": (0.05, 5.0),
    "step_s": (1e-7, 1e-2),
}


def _plain(key: str, value: Any, file: str | None) -> Any:
    """A key of the file's own level."""
    allowed = _PLAIN[key]
    if key == "truth":
        refuse_unknown(value, TRUTHS, f"truth = {value!r}", file=file)
        return value
    low, high = allowed
    whole = key in ("seed", "grid_points")
    if (
        not _number(value)
        or not low <= value <= high
        or (whole and value != int(value))
        or (key == "grid_points" and value % 2)
    ):
        even = ", even" if key == "grid_points" else ""
        raise _wrong(
            file, f"{key} = {value!r}", f"allowed is a number from {low:g} to {high:g}{even}"
        )
    return int(value) if whole else float(value)


def scenario_of(data: Mapping[str, Any], file: str | None = None) -> Scenario:
    """The scenario in TOML tables `data`.  UsageError for anything that is not allowed."""
    lists = ("manoeuvres", "channels", "effects", "ramp", "load_steps")
    known = [*_PLAIN, *_TABLES, "nuisances", *lists]
    for key in data:
        refuse_unknown(key, known, f"unknown key {key!r}", file=file)
    values: dict[str, Any] = {key: _plain(key, data[key], file) for key in _PLAIN if key in data}
    values.update({key: _table(cls, data.get(key, {}), key, file) for key, cls in _TABLES.items()})
    values["nuisances"] = _nuisances(data.get("nuisances", {}), file)
    manoeuvres = data.get("manoeuvres", [])
    channels = data.get("channels", {})
    if not isinstance(manoeuvres, list) or not manoeuvres:
        raise _wrong(
            file,
            "no manoeuvres",
            "a drive is a list of [[manoeuvres]] with duration_s and speed_m_s",
            do="add one",
        )
    if not isinstance(channels, Mapping) or not channels:
        raise _wrong(
            file,
            "no channels",
            'a log has at least one [channels.NAME] with kind = "..."',
            do="add one",
        )
    values["manoeuvres"] = tuple(_table(Manoeuvre, m, "manoeuvres", file) for m in manoeuvres)
    values["channels"] = {
        name: _table(Sensor, c, f"channels.{name}", file) for name, c in channels.items()
    }
    effects = data.get("effects", [])
    if not isinstance(effects, list):
        raise _wrong(file, "effects is not a list", "allowed are [[effects]] with a name")
    values["effects"] = tuple(_planted(e, file) for e in effects)
    if "ramp" in data:
        values["ramp"] = _table(Ramp, data["ramp"], "ramp", file)
    steps = data.get("load_steps", [])
    if not isinstance(steps, list):
        raise _wrong(
            file, "load_steps is not a list", "allowed are [[load_steps]] with time_s and load_N"
        )
    values["load_steps"] = tuple(
        sorted(
            (_table(LoadStep, s, "load_steps", file) for s in steps), key=lambda step: step.time_s
        )
    )
    if values["road"].file:
        # a profile stands beside its scenario
        values["road"] = replace(
            values["road"], file=str((Path(file or "").parent / values["road"].file).resolve())
        )
    scenario = Scenario(**values)
    _check(scenario, file)
    return scenario


def _check(scenario: Scenario, file: str | None) -> None:
    """What one table alone cannot say."""
    fastest = max(sensor.sampling_rate_Hz for sensor in scenario.channels.values())
    if scenario.duration_s > LONGEST_S or scenario.duration_s * fastest > MOST_SAMPLES:
        raise _wrong(
            file,
            f"a log of {scenario.duration_s:.6g} s at {fastest:g} Hz is too long to be simulated",
            f"allowed are {LONGEST_S:g} s and {MOST_SAMPLES:.0e} samples of a channel",
            do="drive less, sample slower, or simulate several logs",
        )
    names = [effect.name for effect in scenario.effects]
    for name in names:
        if names.count(name) > 1:
            raise _wrong(
                file, f"effect {name!r} is planted twice", "allowed is once", do="remove one"
            )
    ramp = scenario.ramp
    if ramp is not None:
        stops = sorted(ramp.stops_s)
        ends = [ramp.begin_s, *(s + ramp.stop_length_s for s in stops)]
        if any(a >= b for a, b in zip(ends, [*stops, ramp.end_s], strict=True)):
            raise _wrong(
                file,
                "stops of the [ramp] overlap or lie outside",
                "allowed are stops between begin_s and end_s",
                do="mend them",
            )
    _check_nuisances(scenario, file)
    if scenario.truth == "coupled_ring":
        _check_coupled(scenario, file)
    elif scenario.load_steps or scenario.road.kind != "flat":
        what = "[[load_steps]]" if scenario.load_steps else f'[road] kind = "{scenario.road.kind}"'
        raise _wrong(
            file,
            f"{what} needs a tire that moves",
            'allowed is truth = "coupled_ring"',
            do="set it",
        )
    for name, sensor in scenario.channels.items():
        if sensor.kind not in SOURCE_UNITS:
            known = ", ".join(SOURCE_UNITS)
            raise _wrong(
                file,
                f"kind {sensor.kind!r} of {name}{nearest(sensor.kind, SOURCE_UNITS)}",
                f"allowed are {known}",
            )
        twin = sensor.temperature_channel
        if twin is not None and (
            twin not in scenario.channels or scenario.channels[twin].kind != "fbg_temperature"
        ):
            raise _wrong(
                file,
                f"temperature_channel {twin!r} of {name}",
                "allowed is a channel of kind fbg_temperature",
            )


def _check_nuisances(scenario: Scenario, file: str | None) -> None:
    """What the tables under [nuisances] alone cannot say."""
    nuisances = scenario.nuisances
    if nuisances != Nuisances() and (scenario.truth == "coupled_ring" or scenario.ramp is not None):
        what = "a [ramp]" if scenario.ramp is not None else 'truth = "coupled_ring"'
        raise _wrong(
            file,
            f"[nuisances] with {what}",
            'allowed is a drive with truth = "beam" or "ring"',
            do="remove one",
        )
    run_out, force = nuisances.run_out, nuisances.force_variation
    for name, sizes, phases in (
        ("run_out", run_out.amplitudes_microstrain, run_out.phases_deg),
        ("force_variation", force.shares, force.phases_deg),
    ):
        if len(phases) > len(sizes):
            raise _wrong(
                file,
                f"{len(phases)} phases_deg for {len(sizes)} harmonics in [nuisances.{name}]",
                "allowed is one for each",
                do="remove some",
            )
    warming = nuisances.warming
    if (
        warming.patch_length_per_K
        and scenario.truth == "ring"
        and scenario.tire.contact == "flat_road"
    ):
        raise _wrong(
            file,
            f"patch_length_per_K = {warming.patch_length_per_K!r} in [nuisances.warming] of a ring "
            "on a flat road, whose patch follows from pressure and stiffness",
            'allowed is 0, or contact = "parabola"',
        )
    for key in ("stiffness_per_K", "bending_per_K", "patch_length_per_K", "pressure_per_K"):
        least = 1.0 + getattr(warming, key) * scenario.conditions.warm_up_K
        if least < LEAST_WHEN_WARM:
            raise _wrong(
                file,
                f"{key} = {getattr(warming, key)!r} in [nuisances.warming] leaves {least:g} of it "
                f"after warm_up_K = {scenario.conditions.warm_up_K:g}",
                f"allowed is {LEAST_WHEN_WARM:g} at least",
                do="lower one",
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


def _check_coupled(scenario: Scenario, file: str | None) -> None:
    """What a tire in motion cannot do."""
    for effect in scenario.effects:
        if effect.name not in _MOVING or (
            effect.form != "exact" and effect.name in ("gauge_length", "sensor_lag")
        ):
            what = f"effect {effect.name!r} in its form {effect.form!r}"
            known = ", ".join(_MOVING)
            raise _wrong(
                file,
                f'{what} with truth = "coupled_ring"',
                f"allowed are {known} as the catalogue has them",
                do="remove it",
            )
    if scenario.tire.contact == "parabola" or scenario.ramp is not None:
        what = "a [ramp]" if scenario.ramp is not None else 'contact = "parabola"'
        raise _wrong(
            file,
            f'{what} with truth = "coupled_ring"',
            'allowed is truth = "ring" or "beam"',
            do="remove it",
        )
    if scenario.tire.slip_stiffness_N is not None:
        raise _wrong(
            file,
            'slip_stiffness_N with truth = "coupled_ring", which slips on its bristles',
            'allowed is truth = "ring" or "beam"',
            do="remove it, or give bristle_stiffness_N_m2",
        )
    if scenario.grid_points % 8:
        raise _wrong(
            file,
            f'grid_points = {scenario.grid_points} with truth = "coupled_ring"',
            "allowed are multiples of 8",
        )


def load_scenario(path: Path | str) -> Scenario:
    """The scenario file at `path`."""
    text = toml_text(path, UsageError, what="a scenario", advice="give another")
    return scenario_of(toml_tables(text, UsageError, file=path), str(path))
