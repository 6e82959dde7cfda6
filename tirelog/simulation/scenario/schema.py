"""What a scenario holds.

What is driven, by which tire, seen by which sensors, with which effects planted.

These records are the scenario file's schema (`load_scenario` reads it): a key is allowed if its
table lists it, and a number must lie in the key's range. Strengths of effects are in the
units of the catalogue's own parameters.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from tirelog.errors import UsageError
from tirelog.storage.schema import (
    FINITE,
    FLAG,
    TEXT,
    Document,
    Entries,
    FilePlace,
    FunctionKind,
    KeyKind,
    Named,
    Record,
    Table,
    key,
    number,
    numbers,
    table_of,
    words,
)
from tirelog.storage.whole import toml_text

# ---- What can be planted in a log: the effects of the catalogue and some that no catalogue has.
#
# Each has a main parameter (its first, the strength) and shape parameters. `form = "exact"` follows
# the catalogue's form; `form = "other"` is a second, equally honest one (another wedge, pulse,
# kernel) of about the same size and 20 to 40 % another shape. What the other form of some effects
# does to the strain is nearly the same once the model has been fitted; these, and effects that no
# diagnosis tries, have a form "apart": another mechanism that is really another shape
# (docs/second_forms.md).


FORMS = ("exact", "other", "apart")
_EXACT, _USUAL, _APART = ("exact",), ("exact", "other"), ("exact", "apart")


@dataclass(frozen=True)
class Plantable:
    """One effect that a scenario can plant.

    Its parameters with their ordinary values. An effect that no diagnosis tries has `where` it
    shows (entry, patch, exit, away) and the parity about the patch centre.
    """

    parameters: Mapping[str, float]
    where: str = ""
    parity: str = ""
    forms: tuple[str, ...] = _USUAL

    @property
    def in_catalogue(self) -> bool:
        return not self.where


@dataclass(frozen=True)
class Planted:
    """An effect in a scenario: its name, form and all its parameters."""

    name: str
    form: str = "exact"
    parameters: Mapping[str, float] = field(default_factory=dict)

    def __getitem__(self, parameter: str) -> float:
        return self.parameters[parameter]

    @property
    def other(self) -> bool:
        return self.form == "other"

    @property
    def apart(self) -> bool:
        return self.form == "apart"


PLANTABLE: dict[str, Plantable] = {
    "viscous_damping": Plantable({"damping_rate_1_s": 60.0}),
    "hysteresis": Plantable({"loss_factor": 0.15}),
    "belt_tension": Plantable({"tension_N": 0.0, "tension_mass_kg_m": 1.0, "stretch_s2_m2": 0.0}),
    "stiffening": Plantable({"cubic_1_m2": 1000.0}),
    "pressure_offset": Plantable({"offset": 0.15}),
    "traction": Plantable(
        {
            "slip_per_g": 0.3,
            "lever_m": 0.01,
            "static_friction": 0.8,
            "sliding_friction": 0.6,
            "slip_stiffness_ratio": 1.0,
        }
    ),
    "edge_impact": Plantable({"amplitude": 0.4, "position": 1.0, "width": 0.05}, forms=FORMS),
    "rough_contact": Plantable({"length": 0.1}, forms=FORMS),
    "water_film": Plantable({"amplitude": 0.1, "length": 0.4}),
    "wear": Plantable({"amplitude": 0.3, "lever_loss": 0.0, "position": 0.85, "width": 0.18}),
    "load_transfer": Plantable({"coefficient": 0.3}),
    "aero_load": Plantable({"coefficient": 0.15}),
    "thermal_drift": Plantable({"drift": 5.0e-5, "stiffness": 0.0, "time_constant_s": 30.0}),
    "gauge_length": Plantable({"length_m": 0.01}, forms=FORMS),
    "sensor_lag": Plantable({"lag_s": 2.0e-4}, forms=FORMS),
    "imbalance": Plantable({"force_N": 100.0}, forms=_APART),
    "tread_pitch": Plantable({"strain_m_N": 1.5e-9}, forms=_APART),
    "belt_extension": Plantable(
        {"strain_1_Pa": 2.0e-9, "reference_pressure_Pa": 2.0e5}, forms=_APART
    ),
    "warm_gain": Plantable({"gain_1_K": 1.0e-3}, forms=_APART),
    "sensor_tilt": Plantable({"tilt_rad": 0.05}, forms=_APART),
    "cavity_resonance": Plantable(
        {"amplitude": 6.0e-5, "frequency_Hz": 210.0, "decay_s": 0.03}, forms=_APART
    ),
    "speed_trend": Plantable({"linear_rad": 0.004, "quadratic_rad": 0.008}),
    "load_crosstalk": Plantable({"per_relative_load_rad": 0.02}),
    "telemetry_delay": Plantable({"delay_s": 5.0e-4}, forms=_EXACT),
    "tooth_pitch": Plantable({"error_deg": 0.3}, forms=_EXACT),
    "inflation": Plantable({"exponent": 0.3}),
    "ring_down": Plantable(
        {"amplitude": 6.0e-5, "frequency_Hz": 90.0, "decay_s": 0.015, "speed_exponent": 1.0},
        "exit",
        "mixed",
        forms=_EXACT,
    ),
    "splice": Plantable(
        {"amplitude": 6.0e-5, "angle_deg": 100.0, "width_deg": 6.0, "speed_exponent": 0.0},
        "away",
        "mixed",
        forms=_EXACT,
    ),
    "pressure_saddle": Plantable(
        {"a": 0.3, "speed_exponent": 1.0, "load_exponent": 0.0}, "patch", "even", forms=_APART
    ),
    "torsion": Plantable(
        {"amplitude": 6.0e-5, "width_m": 0.12, "speed_exponent": 0.0},
        "patch",
        "odd",
        forms=_EXACT,
    ),
    "exit_suction": Plantable(
        {"a": 0.1, "s": 0.3, "speed_exponent": 1.0}, "exit", "mixed", forms=_EXACT
    ),
    "standing_wave": Plantable(
        {"amplitude": 6.0e-5, "wavelength_m": 0.16, "decay_m": 0.2, "speed_exponent": 3.0},
        "exit",
        "mixed",
        forms=_APART,
    ),
    "even_bulge": Plantable(
        {"amplitude": 4.0e-5, "width_m": 0.25, "speed_exponent": 2.0},
        "away",
        "even",
        forms=_EXACT,
    ),
}


#: EJ of a scenario that gives none, by its truth [N m^2]
BENDING_N_M2 = {"beam": 4.0, "ring": 2.0}
TRUTHS = ("beam", "ring", "coupled_ring")
CONTACTS = ("flat_road", "parabola")
ROADS = ("flat", "step", "cleat", "sine", "profile")
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
    "lateral_acceleration": "m/s^2",
    "temperature": "degC",
    "inflation_pressure": "Pa",
    "vertical_load": "N",
    "longitudinal_force": "N",
}


def _record(name: str, meaning: str, /, **keys: tuple[KeyKind | None, Any]) -> type[Record]:
    """The records of one table: their name, what the table means, its keys."""
    return type(name, (Record,), {"keys": keys, "__doc__": meaning, "__module__": __name__})


TrueTire = _record(
    "TrueTire",
    """[tire]. What the setup says of the tire, and the stiffnesses that only the truth knows.

    Beam: EJ, k, mu, patch half length L = L_ref (F / reference load)^exponent. Ring (centre line of
    the belt at the rolling radius): EI, k_w, k_v, damping, inflation through `width_belt_m`, tread
    stiffness of the one-sided contact. `torsional_stiffness_N_m2` is the sidewall's resistance to
    wind-up (absent: none is simulated), `slip_stiffness_N` the force per slip by which beam and
    ring turn faster than they roll in drive and slower in braking (absent: as planted traction
    slips, or not at all). Coupled ring: the ring's, with damping by rate, on a hub
    (`hub_mass_kg`, `hub_inertia_kg_m2`), rubbing by `bristle_stiffness_N_m2` and `friction`; k_v
    resists its wind-up.
    """,
    name=(TEXT, "215/45 R17"),
    unloaded_radius_m=(number(0.05, 3.0), 0.3126),
    rolling_radius_m=(number(0.05, 3.0), 0.305),
    section_height_m=(number(1e-3, 0.2), 0.018),
    width_m=(number(0.01, 2.0), 0.215),
    section_area_m2=(number(1e-6, 1.0), 6.2e-4),
    viscosity_Pa_s=(number(0.0, 1e9), 2.0e3),
    static_footprint_length_m=(number(0.0, 2.0), None),
    flexural_stiffness_N_m2=(number(1e-3, 1e4), None),
    foundation_stiffness_N_m2=(number(1e3, 1e10), 2.0e6),
    line_mass_kg_m=(number(0.0, 1e3), 4.5),
    patch_half_length_m=(number(1e-3, 0.4), 0.058),
    reference_load_N=(number(1.0, 1e6), 3434.0),
    patch_load_exponent=(number(0.0, 3.0), 0.5),
    lever_arm_m=(number(0.0, 0.1), 3.0e-4),
    damping_rate_1_s=(number(0.0, 1e5), 0.0),
    contact=(words(*CONTACTS), "flat_road"),
    radial_stiffness_N_m2=(number(1e3, 1e9), 6.3e5),
    tangential_stiffness_N_m2=(number(1e3, 1e9), 6.3e5),
    radial_damping_N_s_m2=(number(0.0, 1e6), 0.0),
    tangential_damping_N_s_m2=(number(0.0, 1e6), 0.0),
    width_belt_m=(number(0.0, 2.0), 0.14),
    tread_stiffness_N_m2=(number(1e5, 1e11), 8.75e7),
    torsional_stiffness_N_m2=(number(1e3, 1e9), None),
    slip_stiffness_N=(number(1e3, 1e9), None),
    hub_mass_kg=(number(0.1, 1e4), 20.0),
    hub_inertia_kg_m2=(number(1e-3, 1e4), 0.8),
    bristle_stiffness_N_m2=(number(0.0, 1e10), 1.9e6),
    friction=(number(0.0, 5.0), 0.8),
)


TrueConditions = _record(
    "TrueConditions",
    """The table [conditions] of a scenario.

    `warm_up_K` is the rise of the tire's temperature, first order with `warm_up_time_s`, from the
    log's start.
    """,
    load_N=(number(1.0, 1e6), 3434.0),
    inflation_pressure_Pa=(number(0.0, 1e8), 2.2e5),
    distance_km=(number(0.0, 1e6), 0.0),
    water_depth_mm=(number(0.0, 100.0), 0.0),
    driven=(FLAG, True),
    warm_up_K=(number(-100.0, 200.0), 0.0),
    warm_up_time_s=(number(0.1, 1e5), 60.0),
)


Vehicle = _record(
    "Vehicle",
    """The table [vehicle] of a scenario.

    Longitudinal force of the wheel: half the demand in drive if driven, `brake_share` of it in
    braking, none in coasting. `suspension_damping_N_s_m` holds the coupled ring's hub against a
    body at rest. In a curve the belt leans on the road by `roll_deg_per_g`, towards positive
    `lateral_m` where the lateral acceleration is positive.
    """,
    mass_kg=(number(1.0, 1e5), 1500.0),
    brake_share=(number(0.0, 1.0), 0.25),
    rolling_drag=(number(0.0, 1.0), 0.012),
    air_drag_kg_m=(number(0.0, 100.0), 0.4),
    suspension_damping_N_s_m=(number(0.0, 1e6), 0.0),
    roll_deg_per_g=(number(-10.0, 10.0), 0.0),
)


Road = _record(
    "Road",
    """The table [road] of a scenario, and how the load varies along it.

    `roughness` relative standard deviation of the load along the road, correlated over
    `correlation_m`; `load_scatter` relative standard deviation of the load from manoeuvre to
    manoeuvre.

    What is rolled over (coupled ring only), in the words of a setup's [road]: `kind` "flat"; "step"
    (`height_m` over `ramp_m`); "cleat" (`height_m`, `length_m` at its foot, ramps of `ramp_m`
    within it); "sine" (`amplitude_m` (1 - cos(2 pi x/`wavelength_m`))); "profile" (`file`: two
    columns, distance and height, beside the scenario). It begins `position_m` after the log's
    start, and comes again every `spacing_m` (a cleat or a profile).
    """,
    roughness=(number(0.0, 0.2), 0.0),
    correlation_m=(number(0.2, 100.0), 2.0),
    load_scatter=(number(0.0, 0.2), 0.0),
    kind=(words(*ROADS), "flat"),
    height_m=(number(-1.0, 1.0), None),
    length_m=(number(0.0, 100.0), None),
    ramp_m=(number(0.0, 100.0), None),
    amplitude_m=(number(-1.0, 1.0), None),
    wavelength_m=(number(0.0, 1e4, above=True), None),
    file=(TEXT, None),
    position_m=(number(0.0, 1e6), None),
    spacing_m=(number(0.0, 1e6), None),
)


#: harmonics of the wheel that run-out and force variation may have
WHEEL_HARMONICS = 3


RunOut = _record(
    "RunOut",
    """The table [nuisances.run_out] of a scenario: strain that goes round with the wheel.

    The h-th harmonic adds amplitude cos(h (wheel angle) - phase) to every strain channel, whatever
    the road does: a bent rim, a splice far away, an eccentric hub.
    """,
    amplitudes_microstrain=(numbers(0.0, 1e3, WHEEL_HARMONICS), ()),
    phases_deg=(numbers(-360.0, 360.0, WHEEL_HARMONICS), ()),
)


ForceVariation = _record(
    "ForceVariation",
    """The table [nuisances.force_variation] of a scenario: load that varies with the wheel's turn.

    The load is multiplied by 1 + sum of share cos(h (wheel angle) - phase).
    """,
    shares=(numbers(0.0, 0.1, WHEEL_HARMONICS), ()),
    phases_deg=(numbers(-360.0, 360.0, WHEEL_HARMONICS), ()),
)


LoadWander = _record(
    "LoadWander",
    """The table [nuisances.load_wander] of a scenario: grade and wind.

    The load is multiplied by 1 + an Ornstein-Uhlenbeck process of standard deviation `share`,
    which forgets within `time_constant_s`. Scatter from manoeuvre to manoeuvre is
    [road] load_scatter.
    """,
    share=(number(0.0, 0.1), 0.0),
    time_constant_s=(number(1.0, 1e4), 3.0),
)


Warming = _record(
    "Warming",
    """The table [nuisances.warming] of a scenario: what the tire's temperature changes.

    Relative changes per K of `warm_up_K` under [conditions]: foundation (the ring's both
    stiffnesses), bending stiffness, prescribed patch length, inflation pressure; `strain_per_K` is
    the baseline's. Setups tell the pressure of the log's start; a channel of kind
    inflation_pressure or temperature follows.
    """,
    stiffness_per_K=(number(-0.02, 0.02), 0.0),
    bending_per_K=(number(-0.02, 0.02), 0.0),
    patch_length_per_K=(number(-0.02, 0.02), 0.0),
    pressure_per_K=(number(-0.02, 0.02), 0.0),
    strain_per_K=(number(-1e-4, 1e-4), 0.0),
)


RollingRadius = _record(
    "RollingRadius",
    """The table [nuisances.rolling_radius] of a scenario: the setup's radius is not the true one.

    True rolling radius = the setup's (1 + `error`) (1 + `growth` (v/`at_speed_m_s`)^2): the belt is
    longer at speed, so that the wheel turns less.
    """,
    error=(number(-0.1, 0.1), 0.0),
    growth=(number(0.0, 0.1), 0.0),
    at_speed_m_s=(number(1.0, 120.0), 25.0),
)


Nuisances = _record(
    "Nuisances",
    """The table [nuisances] of a scenario: what every car has and no model of the tire holds.

    Absent: none. Faults of an instrument (coloured noise, hum, digits, lost peaks) are keys of its
    channel. Scatter of the load is a key of the road, the patch's exponent one of the tire.
    """,
    run_out=(table_of(RunOut), RunOut()),
    force_variation=(table_of(ForceVariation), ForceVariation()),
    load_wander=(table_of(LoadWander), LoadWander()),
    warming=(table_of(Warming), Warming()),
    rolling_radius=(table_of(RollingRadius), RollingRadius()),
)


Manoeuvre = _record(
    "Manoeuvre",
    """A manoeuvre, from [[manoeuvres]].

    `duration_s` seconds to `speed_m_s` at constant acceleration, corners rounded over
    `Scenario.rounding_s`. Without `regime` the acceleration decides: |a| < 0.15 m/s^2 cruise, > 0
    drive, > -1.5 coast, else brake. In a curve the vehicle has `lateral_m_s2` to the left.
    """,
    duration_s=(number(0.05, 1e5), 5.0),
    speed_m_s=(number(0.0, 120.0), 10.0),
    regime=(words(*REGIMES), None),
    lateral_m_s2=(number(-15.0, 15.0), 0.0),
)


Sensor = _record(
    "Sensor",
    """A sensor, from [channels.NAME].

    One instrument channel. `noise` and `quantisation` are in the unit that the file holds (nm,
    microstrain, g, V, m/s, ...). The noise is white, or forgets its last sample by
    `noise_correlation` (first order, the same size); `hum` is the amplitude of a sine at `hum_Hz`,
    with half of it at the double; `flicker` the standard deviation over the log of 1/f noise;
    `road_noise` that of white noise at 20 m/s, which the road makes and grows with speed squared.
    `angle_deg` is the place on the wheel, `lateral_m` that across the tread. `lost_fraction` of the
    samples is blank, in runs of `lost_run` on average; a grating also loses the share
    `lost_at_flanks` of the samples at which strain changes along the tread by more than half of the
    most. `delay_s` is the telemetry's; `range` and `bits` clip and digitise.
    Encoder: `steps`, `signal`, `amplitude`, `offset`, `pitch_error_deg` (drawn by `pitch_seed`).
    """,
    kind=(words(*SOURCE_UNITS), ""),
    source=(TEXT, ""),
    sampling_rate_Hz=(number(1.0, 1e6), 2500.0),
    angle_deg=(number(-360.0, 360.0), 0.0),
    surface=(words("outer", "inner"), "outer"),
    noise=(number(0.0, 1e6), 0.0),
    noise_correlation=(number(0.0, 0.999), 0.0),
    hum=(number(0.0, 1e6), 0.0),
    hum_Hz=(number(0.1, 1e5), 50.0),
    flicker=(number(0.0, 1e6), 0.0),
    road_noise=(number(0.0, 1e6), 0.0),
    quantisation=(number(0.0, 1e6), 0.0),
    lost_fraction=(number(0.0, 0.9), 0.0),
    lost_run=(number(1.0, 1e4), 1.0),
    lost_at_flanks=(number(0.0, 0.9), 0.0),
    gauge_length_m=(number(0.0, 0.2), 0.0),
    lag_s=(number(0.0, 1.0), 0.0),
    delay_s=(number(0.0, 1.0), 0.0),
    bandwidth_Hz=(number(1.0, 1e6), None),
    baseline=(number(-0.1, 0.1), 0.0),
    reference_wavelength_nm=(number(100.0, 1e5), 1550.0),
    strain_gain=(number(0.1, 100.0), 1.27),
    thermal_expansion_1_K=(number(-1.0, 1.0), 0.0),
    temperature_sensitivity_nm_K=(number(1e-6, 10.0), 0.010),
    temperature_channel=(TEXT, None),
    range=(number(1e-9, 1e9), None),
    bits=(number(4, 32, whole=True), None),
    steps=(number(2, 10000, whole=True), 48),
    signal=(words("sine", "square", "counter"), "sine"),
    amplitude=(number(1e-6, 1e3), 1.0),
    offset=(number(-1e3, 1e3), 0.0),
    pitch_error_deg=(number(0.0, 5.0), 0.0),
    pitch_seed=(number(0, 2**31, whole=True), 0),
    lateral_m=(number(-0.5, 0.5), 0.0),
)


Ramp = _record(
    "Ramp",
    """The table [ramp] of a scenario.

    A static inflation test: from `start_Pa` at `begin_s` to `end_Pa` at `end_s`, with stops of
    `stop_length_s` at which `leak_Pa` is lost; every grating's strain grows by `strain_per_Pa`,
    times 1 + bend x rise.
    """,
    start_Pa=(number(0.0, 1e8), 1.7e5),
    end_Pa=(number(0.0, 1e8), 2.3e5),
    begin_s=(number(0.0, 1e5), 1.0),
    end_s=(number(0.1, 1e5), 13.0),
    stops_s=(numbers(0.0), ()),
    stop_length_s=(number(0.05, 1e4), 1.0),
    leak_Pa=(number(0.0, 1e6), 0.0),
    strain_per_Pa=(number(-1e-5, 1e-5), 1.0e-8),
    bend_1_Pa=(number(-1e-4, 1e-4), 0.0),
)


def _planted(value: Any, place: FilePlace) -> Planted:
    """The effect of one [[effects]] table."""
    name = value.get("name") if isinstance(value, Mapping) else None
    place.refuse(
        (
            not isinstance(name, str),
            "",
            "an [[effects]] table without a name",
            'allowed is name = "..."',
            "add one",
        ),
        (
            name == "ring_curvature",
            "name",
            "ring_curvature is the carcass itself",
            'allowed is truth = "ring"',
            'set it (contact = "parabola")',
        ),
    )
    name = words(*PLANTABLE).read(name, place / "name")
    planted = PLANTABLE[name]
    numbers = dict.fromkeys(planted.parameters, FINITE)
    given = Table({"name": TEXT, "form": words(*planted.forms), **numbers}).read(value, place)
    numbers_given = {key: given[key] for key in given if key in planted.parameters}
    return Planted(name, given.get("form", "exact"), {**planted.parameters, **numbers_given})


@dataclass(frozen=True)
class Scenario:
    """A whole scenario.

    `seed` decides every random number; `grid_points` the fineness of the truth; `knot_s` how often,
    in seconds of the log, the waveform is solved anew (beam and ring); `step_s` the coupled ring's
    step in time, with an element of the belt for every eight of the grid's points.
    """

    manoeuvres: tuple[Record, ...] = key(Entries(table_of(Manoeuvre)), ())
    channels: Mapping[str, Record] = field(
        default_factory=dict, metadata={"kind": Named(table_of(Sensor, "kind"))}
    )
    tire: Record = key(table_of(TrueTire), TrueTire())
    conditions: Record = key(table_of(TrueConditions), TrueConditions())
    vehicle: Record = key(table_of(Vehicle), Vehicle())
    road: Record = key(table_of(Road), Road())
    nuisances: Record = key(table_of(Nuisances), Nuisances())
    effects: tuple[Planted, ...] = key(
        Entries(FunctionKind('allowed is name = "..." of an effect', _planted)), ()
    )
    truth: str = key(words(*TRUTHS), "beam")
    seed: int = key(number(0, 2**62, whole=True), 0)
    grid_points: int = key(number(256, 65536, whole=True), 2048)
    knot_s: float = key(number(0.005, 0.05), 0.05)
    step_s: float = key(number(1e-7, 1e-2), 2.5e-5)
    rounding_s: float = key(number(0.05, 5.0), 0.5)
    ramp: Record | None = key(table_of(Ramp))

    def planted(self, name: str) -> Planted | None:
        """The planted effect of that name, or None."""
        return next((effect for effect in self.effects if effect.name == name), None)

    def late_s(self, sensor: Record) -> float:
        """Delay [s] of a channel's values behind their stamps: its own, and planted telemetry's."""
        delay = self.planted("telemetry_delay")
        of_telemetry = delay is not None and sensor.kind == "radial_acceleration"
        return sensor.delay_s + (delay["delay_s"] if delay and of_telemetry else 0.0)

    @property
    def duration_s(self) -> float:
        return sum(m.duration_s for m in self.manoeuvres)


# ---- The scenario file: TOML becomes a validated Scenario, or an error that says what is allowed.


def load_scenario(path: Path | str) -> Scenario:
    """The scenario file at `path`."""
    text = toml_text(path, UsageError, what="a scenario", advice="give another")
    return scenario_of(None, str(path), text)


def scenario_of(
    tables: Mapping[str, Any] | None, file: str | None = None, text: str = ""
) -> Scenario:
    """The scenario in TOML `tables`, or in a file's `text`.

    UsageError for anything that is not allowed.
    """
    document = Document(text, UsageError, "a scenario", file)
    data, place = document.tables if tables is None else tables, FilePlace(document)
    scenario: Scenario = table_of(Scenario).read(data, place)
    place.refuse(
        (
            not scenario.manoeuvres,
            "manoeuvres",
            "no manoeuvres",
            "a drive is a list of [[manoeuvres]] with duration_s and speed_m_s",
            "add one",
        ),
        (
            not scenario.channels,
            "channels",
            "no channels",
            'a log has at least one [channels.NAME] with kind = "..."',
            "add one",
        ),
    )
    road = scenario.road
    if road.file:
        # a profile lies beside its scenario
        profile = Path(str(document.file or "")).parent / road.file
        road = replace(road, file=str(profile.resolve()))
    scenario = replace(scenario, road=road)
    _check(scenario, place)
    return scenario


def _check(scenario: Scenario, place: FilePlace) -> None:
    """What one table alone cannot say."""
    # a sample takes up to 140 bytes, so that 850 MB suffice (ten minutes at 10 kHz)
    longest_s, most_samples = 7200.0, 6_000_000
    fastest = max(sensor.sampling_rate_Hz for sensor in scenario.channels.values())
    names = [effect.name for effect in scenario.effects]
    twice = next((name for name in names if names.count(name) > 1), None)
    coupled = scenario.truth == "coupled_ring"
    place.refuse(
        (
            scenario.grid_points % 2,
            "grid_points",
            f"grid_points = {scenario.grid_points}",
            "allowed is an even number",
            "",
        ),
        (
            scenario.duration_s > longest_s or scenario.duration_s * fastest > most_samples,
            "",
            f"a log of {scenario.duration_s:.6g} s at {fastest:g} Hz is too long to be simulated",
            f"allowed are {longest_s:g} s and {most_samples:.0e} samples of a channel",
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
            not coupled and scenario.road.kind != "flat",
            "road",
            f'[road] kind = "{scenario.road.kind}" needs a tire that moves',
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


def _overlap(ramp: Record) -> bool:
    """Whether stops of a ramp overlap or lie outside of it."""
    stops = sorted(ramp.stops_s)
    ends = [ramp.begin_s, *(s + ramp.stop_length_s for s in stops)]
    return any(a >= b for a, b in zip(ends, [*stops, ramp.end_s], strict=True))


def _check_nuisances(scenario: Scenario, place: FilePlace) -> None:
    """What the tables under [nuisances] alone cannot say."""
    nuisances, warm_up = scenario.nuisances, scenario.conditions.warm_up_K
    run_out, force, warming = nuisances.run_out, nuisances.force_variation, nuisances.warming
    what = "a [ramp]" if scenario.ramp is not None else 'truth = "coupled_ring"'
    least_left = 0.3  # of a stiffness, a length or the pressure: less is no tire
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
                least < least_left,
                "warming",
                f"{name} = {getattr(warming, name)!r} in [nuisances.warming] leaves {least:g} of "
                f"it after warm_up_K = {warm_up:g}",
                f"allowed is {least_left:g} at least",
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
            scenario.vehicle.roll_deg_per_g,
            "vehicle",
            f"roll_deg_per_g {with_truth}, whose belt has no width",
            'allowed is truth = "ring" or "beam"',
            "remove it",
        ),
        (
            scenario.grid_points % 8,
            "grid_points",
            f"grid_points = {scenario.grid_points} {with_truth}",
            "allowed are multiples of 8",
            "",
        ),
    )
