"""The scenario file: what is driven, by which tire, seen by which sensors, with which effects planted.

    TOML text --tomllib--> tables --fields of the dataclasses below--> Scenario (frozen, validated)

The dataclasses are the schema: a key is allowed if it is a field of its table, a number must lie in the field's range, and what is
unknown is refused with what is allowed and the nearest spelling.  `[[effects]]` tables take the parameters of their effect
(`planted.PLANTABLE`).  Strengths are in the units of the catalogue's own parameters, so that an author can dial an excess.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar

from tirelog.errors import UsageError, nearest
from tirelog.simulation.planted import FORMS, PLANTABLE, Planted

TRUTHS = ("beam", "ring")
CONTACTS = ("flat_road", "parabola")
REGIMES = ("standstill", "cruise", "drive", "coast", "brake")
#: channel kind -> unit in the file that the simulator writes
SOURCE_UNITS = {
    "fbg_strain": "nm",
    "fbg_temperature": "nm",
    "strain": "microstrain",
    "radial_acceleration": "g",
    "wheel_encoder": "V",
    "vehicle_speed": "m/s",
    "longitudinal_acceleration": "m/s^2",
    "temperature": "degC",
    "inflation_pressure": "Pa",
    "vertical_load": "N",
    "longitudinal_force": "N",
}


def _within(default: float | None, low: float, high: float) -> Any:
    """A number in [low, high]."""
    return field(default=default, metadata={"range": (low, high)})


def _one_of(default: str, *allowed: str) -> Any:
    return field(default=default, metadata={"allowed": allowed})


@dataclass(frozen=True)
class TrueTire:
    """[tire].  What the setup says of the tire, and the stiffnesses that only the truth knows.

    Beam: EJ, k, mu, patch half length L = L_ref (F / reference load)^exponent.  Ring (centre line of the belt at the rolling radius): EI,
    k_w, k_v, damping, inflation through `width_belt_m`, tread stiffness of the one-sided contact.  `torsional_stiffness_N_m2` is
    the sidewall's resistance to wind-up (absent: none is simulated).
    """

    name: str = "215/45 R17"
    unloaded_radius_m: float = _within(0.3126, 0.05, 3.0)
    rolling_radius_m: float = _within(0.305, 0.05, 3.0)
    section_height_m: float = _within(0.018, 1e-3, 0.2)
    width_m: float = _within(0.215, 0.01, 2.0)
    section_area_m2: float = _within(6.2e-4, 1e-6, 1.0)
    viscosity_Pa_s: float = _within(2.0e3, 0.0, 1e9)
    static_footprint_length_m: float | None = _within(None, 0.0, 2.0)
    flexural_stiffness_N_m2: float | None = _within(None, 1e-3, 1e4)
    foundation_stiffness_N_m2: float = _within(2.0e6, 1e3, 1e10)
    line_mass_kg_m: float = _within(4.5, 0.0, 1e3)
    patch_half_length_m: float = _within(0.058, 1e-3, 0.4)
    reference_load_N: float = _within(3434.0, 1.0, 1e6)
    patch_load_exponent: float = _within(0.5, 0.0, 3.0)
    lever_arm_m: float = _within(3.0e-4, 0.0, 0.1)
    damping_rate_1_s: float = _within(0.0, 0.0, 1e5)
    contact: str = _one_of("flat_road", *CONTACTS)
    radial_stiffness_N_m2: float = _within(6.3e5, 1e3, 1e9)
    tangential_stiffness_N_m2: float = _within(6.3e5, 1e3, 1e9)
    radial_damping_N_s_m2: float = _within(0.0, 0.0, 1e6)
    tangential_damping_N_s_m2: float = _within(0.0, 0.0, 1e6)
    width_belt_m: float = _within(0.14, 0.01, 2.0)
    tread_stiffness_N_m2: float = _within(8.75e7, 1e5, 1e11)
    torsional_stiffness_N_m2: float | None = _within(None, 1e3, 1e9)


@dataclass(frozen=True)
class TrueConditions:
    """[conditions].  `warm_up_K` is the rise of the tire's temperature, first order with `warm_up_time_s`, from the log's start."""

    load_N: float = _within(3434.0, 1.0, 1e6)
    inflation_pressure_Pa: float = _within(2.2e5, 0.0, 1e8)
    distance_km: float = _within(0.0, 0.0, 1e6)
    water_depth_mm: float = _within(0.0, 0.0, 100.0)
    driven: bool = True
    warm_up_K: float = _within(0.0, -100.0, 200.0)
    warm_up_time_s: float = _within(60.0, 0.1, 1e5)


@dataclass(frozen=True)
class Vehicle:
    """[vehicle].  Longitudinal force of the wheel: half the demand in drive if driven, `brake_share` of it in braking, none in coasting."""

    mass_kg: float = _within(1500.0, 1.0, 1e5)
    brake_share: float = _within(0.25, 0.0, 1.0)
    rolling_drag: float = _within(0.012, 0.0, 1.0)
    air_drag_kg_m: float = _within(0.4, 0.0, 100.0)


@dataclass(frozen=True)
class Road:
    """[road] and repeatability.  `roughness` relative standard deviation of the load along the road, correlated over `correlation_m`;
    `load_scatter` relative standard deviation of the load from manoeuvre to manoeuvre."""

    roughness: float = _within(0.0, 0.0, 0.2)
    correlation_m: float = _within(2.0, 0.2, 100.0)
    load_scatter: float = _within(0.0, 0.0, 0.2)


@dataclass(frozen=True)
class Manoeuvre:
    """[[manoeuvres]].  `duration_s` seconds to `speed_m_s` at constant acceleration, corners rounded over `Scenario.rounding_s`.
    Without `regime` the acceleration decides: |a| < 0.15 m/s^2 cruise, > 0 drive, > -1.5 coast, else brake."""

    duration_s: float = _within(5.0, 0.05, 1e5)
    speed_m_s: float = _within(10.0, 0.0, 120.0)
    regime: str | None = field(default=None, metadata={"allowed": REGIMES})


@dataclass(frozen=True)
class Sensor:
    """[channels.NAME].  One instrument channel.  Noise and quantisation are in `noise` and `quantisation` of the unit that the file
    holds (nm, microstrain, g, V, m/s, ...).  `angle_deg` is the place on the wheel.  `lost_fraction` of the samples is blank, in runs of
    `lost_run` on average; `jitter_s` moves the moment of sampling about its stamp; `delay_s` is the telemetry's.  Encoder:
    `amplitude`, `offset`, `steps`, `signal`, `pitch_error_deg`, `missing_teeth`, `extra_teeth`.  `range` and `bits` clip and digitise."""

    kind: str = ""
    source: str = ""
    sampling_rate_Hz: float = _within(2500.0, 1.0, 1e6)
    angle_deg: float = _within(0.0, -360.0, 360.0)
    surface: str = _one_of("outer", "outer", "inner")
    noise: float = _within(0.0, 0.0, 1e6)
    quantisation: float = _within(0.0, 0.0, 1e6)
    lost_fraction: float = _within(0.0, 0.0, 0.9)
    lost_run: float = _within(1.0, 1.0, 1e4)
    jitter_s: float = _within(0.0, 0.0, 0.1)
    gauge_length_m: float = _within(0.0, 0.0, 0.2)
    lag_s: float = _within(0.0, 0.0, 1.0)
    delay_s: float = _within(0.0, 0.0, 1.0)
    bandwidth_Hz: float | None = _within(None, 1.0, 1e6)
    baseline: float = _within(0.0, -0.1, 0.1)
    reference_wavelength_nm: float = _within(1550.0, 100.0, 1e5)
    strain_gain: float = _within(1.27, 0.1, 100.0)
    thermal_expansion_1_K: float = _within(0.0, -1.0, 1.0)
    temperature_sensitivity_nm_K: float = _within(0.010, 1e-6, 10.0)
    temperature_channel: str | None = None
    range: float | None = _within(None, 1e-9, 1e9)
    bits: int | None = field(default=None, metadata={"range": (4, 32)})
    steps: int = field(default=48, metadata={"range": (2, 10000)})
    signal: str = _one_of("sine", "sine", "square", "counter")
    amplitude: float = _within(1.0, 1e-6, 1e3)
    offset: float = _within(0.0, -1e3, 1e3)
    pitch_error_deg: float = _within(0.0, 0.0, 5.0)
    missing_teeth: tuple[int, ...] = ()
    extra_teeth: tuple[int, ...] = ()


@dataclass(frozen=True)
class Scenario:
    """A whole scenario.  `seed` decides every random number; `grid_points` the fineness of the truth; `knot_s` how often, in seconds of the
    log, the waveform is solved anew; `start_time_s` is added to the stamps of a text log."""

    manoeuvres: tuple[Manoeuvre, ...]
    channels: Mapping[str, Sensor]
    tire: TrueTire = TrueTire()
    conditions: TrueConditions = TrueConditions()
    vehicle: Vehicle = Vehicle()
    road: Road = Road()
    effects: tuple[Planted, ...] = ()
    truth: str = "beam"
    seed: int = 0
    grid_points: int = 2048
    knot_s: float = 0.05
    rounding_s: float = 0.5
    ramp: Mapping[str, Any] = field(default_factory=dict)

    def planted(self, name: str) -> Planted | None:
        """The planted effect of that name, or None."""
        return next((effect for effect in self.effects if effect.name == name), None)

    @property
    def duration_s(self) -> float:
        return sum(m.duration_s for m in self.manoeuvres)


T = TypeVar("T")


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _value(spec: Field[Any], value: Any, table: str, file: str | None) -> Any:
    """`value` as the field wants it, or a UsageError that says what is allowed."""
    wanted, at = str(spec.type), f"{spec.name} = {value!r} in [{table}]"
    if "tuple[int" in wanted:
        if not isinstance(value, list) or not all(isinstance(v, int) and v >= 0 for v in value):
            raise UsageError(f"{at}; allowed is a list of whole numbers from 0; mend it", file=file)
        return tuple(value)
    if "float" in wanted or "int" in wanted:
        low, high = spec.metadata.get("range", (-(2**62), 2**62))
        if not _number(value) or not low <= value <= high or ("int" in wanted and value != int(value)):
            raise UsageError(f"{at}; allowed is a number from {low:g} to {high:g}; mend it", file=file)
        return int(value) if "int" in wanted else float(value)
    if not isinstance(value, bool if "bool" in wanted else str):
        raise UsageError(f"{at}; allowed is {'true or false' if 'bool' in wanted else 'text in quotes'}; mend it", file=file)
    allowed = spec.metadata.get("allowed")
    if allowed and value not in allowed:
        raise UsageError(f"{at}{nearest(str(value), allowed)}; allowed are {', '.join(allowed)}; mend it", file=file)
    return value


def _table(cls: type[T], data: Any, table: str, file: str | None) -> T:
    """A TOML table as the dataclass `cls`."""
    if not isinstance(data, Mapping):
        raise UsageError(f"{table} is not a table; allowed is [{table}] with keys under it; mend it", file=file)
    specs: dict[str, Field[Any]] = {f.name: f for f in fields(cls)}  # type: ignore[arg-type]
    for key in data:
        if key not in specs:
            allowed = ", ".join(specs)
            raise UsageError(f"unknown key {key!r} in [{table}]{nearest(key, specs)}; allowed are {allowed}; mend it", file=file)
    return cls(**{key: _value(specs[key], value, table, file) for key, value in data.items()})


def _planted(data: Any, file: str | None) -> Planted:
    """One [[effects]] table."""
    if not isinstance(data, Mapping) or not isinstance(data.get("name"), str):
        raise UsageError('an [[effects]] table without a name; allowed is name = "..."; add one', file=file)
    name, form = data["name"], data.get("form", "exact")
    if name == "ring_curvature":
        raise UsageError('ring_curvature is the carcass itself; allowed is truth = "ring"; set it (contact = "parabola")', file=file)
    if name not in PLANTABLE:
        raise UsageError(f"unknown effect {name!r}{nearest(name, PLANTABLE)}; allowed are {', '.join(PLANTABLE)}; mend it", file=file)
    if form not in FORMS:
        raise UsageError(f"form = {form!r} of {name}{nearest(str(form), FORMS)}; allowed are {', '.join(FORMS)}; mend it", file=file)
    given = {key: value for key, value in data.items() if key not in ("name", "form")}
    allowed = PLANTABLE[name].parameters
    for key, value in given.items():
        if key not in allowed:
            known = ", ".join(allowed)
            raise UsageError(f"unknown parameter {key!r} of {name}{nearest(key, allowed)}; allowed are {known}; mend it", file=file)
        if not _number(value):
            raise UsageError(f"{key} = {value!r} of {name}; allowed is a finite number; mend it", file=file)
    return Planted(name, form, {**allowed, **{k: float(v) for k, v in given.items()}})


_TABLES = {"tire": TrueTire, "conditions": TrueConditions, "vehicle": Vehicle, "road": Road}
_PLAIN = {"truth": TRUTHS, "seed": (0, 2**62), "grid_points": (256, 65536), "knot_s": (0.005, 0.05), "rounding_s": (0.05, 5.0)}


def _plain(key: str, value: Any, file: str | None) -> Any:
    """A key of the file's own level."""
    allowed = _PLAIN[key]
    if key == "truth":
        if value not in TRUTHS:
            raise UsageError(f"truth = {value!r}{nearest(str(value), TRUTHS)}; allowed are {', '.join(TRUTHS)}; mend it", file=file)
        return value
    low, high = allowed
    whole = key in ("seed", "grid_points")
    if not _number(value) or not low <= value <= high or (whole and value != int(value)) or (key == "grid_points" and value % 2):  # type: ignore[operator]
        even = ", even" if key == "grid_points" else ""
        raise UsageError(f"{key} = {value!r}; allowed is a number from {low:g} to {high:g}{even}; mend it", file=file)
    return int(value) if whole else float(value)


def scenario_of(data: Mapping[str, Any], file: str | None = None) -> Scenario:
    """The scenario in TOML tables `data`.  UsageError for anything that is not allowed."""
    known = [*_PLAIN, *_TABLES, "manoeuvres", "channels", "effects", "ramp"]
    for key in data:
        if key not in known:
            raise UsageError(f"unknown key {key!r}{nearest(key, known)}; allowed are {', '.join(known)}; mend it", file=file)
    values: dict[str, Any] = {key: _plain(key, data[key], file) for key in _PLAIN if key in data}
    values.update({key: _table(cls, data.get(key, {}), key, file) for key, cls in _TABLES.items()})
    manoeuvres = data.get("manoeuvres", [])
    channels = data.get("channels", {})
    if not isinstance(manoeuvres, list) or not (manoeuvres or "ramp" in data):
        raise UsageError("no manoeuvres; a drive is a list of [[manoeuvres]] with duration_s and speed_m_s; add one", file=file)
    if not isinstance(channels, Mapping) or not channels:
        raise UsageError('no channels; a log has at least one [channels.NAME] with kind = "..."; add one', file=file)
    values["manoeuvres"] = tuple(_table(Manoeuvre, m, "manoeuvres", file) for m in manoeuvres)
    values["channels"] = {name: _table(Sensor, c, f"channels.{name}", file) for name, c in channels.items()}
    values["effects"] = tuple(_planted(e, file) for e in data.get("effects", []))
    if "ramp" in data:
        values["ramp"] = dict(data["ramp"])
    scenario = Scenario(**values)
    _check(scenario, file)
    return scenario


def _check(scenario: Scenario, file: str | None) -> None:
    """What one table alone cannot say."""
    names = [effect.name for effect in scenario.effects]
    for name in names:
        if names.count(name) > 1:
            raise UsageError(f"effect {name!r} is planted twice; allowed is once; remove one", file=file)
    for name, sensor in scenario.channels.items():
        if sensor.kind not in SOURCE_UNITS:
            known = ", ".join(SOURCE_UNITS)
            raise UsageError(f"kind {sensor.kind!r} of {name}{nearest(sensor.kind, SOURCE_UNITS)}; allowed are {known}; mend it", file=file)
        twin = sensor.temperature_channel
        if twin is not None and (twin not in scenario.channels or scenario.channels[twin].kind != "fbg_temperature"):
            raise UsageError(f"temperature_channel {twin!r} of {name}; allowed is a channel of kind fbg_temperature; mend it", file=file)


def load_scenario(path: Path | str) -> Scenario:
    """The scenario file at `path`."""
    try:
        return scenario_of(tomllib.loads(Path(path).read_text(encoding="utf-8")), str(path))
    except OSError as problem:
        raise UsageError(f"cannot be read ({problem.strerror}); a scenario is a TOML file; give another", file=path) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as problem:
        raise UsageError(f"not TOML ({problem}); a scenario is a TOML file in UTF-8; mend it", file=path) from None
