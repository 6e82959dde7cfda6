"""What a scenario holds.

What is driven, by which tire, seen by which sensors, with which effects planted.

These dataclasses are the scenario file's schema (`load_scenario` reads it): a key is allowed if it
is a field of its table, and a number must lie in the field's range. Strengths of effects are in the
units of the catalogue's own parameters.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from tirelog.errors import UsageError
from tirelog.storage.schema import (
    FINITE,
    TEXT,
    Document,
    Entries,
    FilePlace,
    Named,
    Table,
    key,
    kinds_of,
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
_USUAL, _ALL, _APART = ("exact", "other"), FORMS, ("exact", "apart")


@dataclass(frozen=True)
class Plantable:
    """One effect that a scenario can plant.

    Its parameters with their ordinary values, and for those that no diagnosis tries where they show
    (entry, patch, exit, away) and the parity about the patch centre; `fixed` is the name of the
    parameter that is a frequency, or ''; `forms`.
    """

    parameters: Mapping[str, float]
    in_catalogue: bool = True
    where: str = ""
    parity: str = ""
    fixed: str = ""
    forms: tuple[str, ...] = _USUAL


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


def _outside(
    where: str,
    parity: str,
    parameters: Mapping[str, float],
    fixed: str = "",
    forms: tuple[str, ...] = ("exact",),
) -> Plantable:
    return Plantable(parameters, False, where, parity, fixed, forms)


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
    "edge_impact": Plantable({"amplitude": 0.4, "position": 1.0, "width": 0.05}, forms=_ALL),
    "rough_contact": Plantable({"length": 0.1}, forms=_ALL),
    "water_film": Plantable({"amplitude": 0.1, "length": 0.4}),
    "wear": Plantable({"amplitude": 0.3, "lever_loss": 0.0, "position": 0.85, "width": 0.18}),
    "load_transfer": Plantable({"coefficient": 0.3}),
    "aero_load": Plantable({"coefficient": 0.15}),
    "thermal_drift": Plantable({"drift": 5.0e-5, "stiffness": 0.0, "time_constant_s": 30.0}),
    "gauge_length": Plantable({"length_m": 0.01}, forms=_ALL),
    "sensor_lag": Plantable({"lag_s": 2.0e-4}, forms=_ALL),
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
    "telemetry_delay": Plantable({"delay_s": 5.0e-4}, forms=("exact",)),
    "tooth_pitch": Plantable({"error_deg": 0.3}, forms=("exact",)),
    "inflation": Plantable({"exponent": 0.3}),
    "ring_down": _outside(
        "exit",
        "mixed",
        {"amplitude": 6.0e-5, "frequency_Hz": 90.0, "decay_s": 0.015, "speed_exponent": 1.0},
        "frequency_Hz",
    ),
    "splice": _outside(
        "away",
        "mixed",
        {"amplitude": 6.0e-5, "angle_deg": 100.0, "width_deg": 6.0, "speed_exponent": 0.0},
    ),
    "pressure_saddle": _outside(
        "patch", "even", {"a": 0.3, "speed_exponent": 1.0, "load_exponent": 0.0}, forms=_APART
    ),
    "torsion": _outside(
        "patch", "odd", {"amplitude": 6.0e-5, "width_m": 0.12, "speed_exponent": 0.0}
    ),
    "exit_suction": _outside("exit", "mixed", {"a": 0.1, "s": 0.3, "speed_exponent": 1.0}),
    "standing_wave": _outside(
        "exit",
        "mixed",
        {"amplitude": 6.0e-5, "wavelength_m": 0.16, "decay_m": 0.2, "speed_exponent": 3.0},
        forms=_APART,
    ),
    "even_bulge": _outside(
        "away", "even", {"amplitude": 4.0e-5, "width_m": 0.25, "speed_exponent": 2.0}
    ),
}


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
    "temperature": "degC",
    "inflation_pressure": "Pa",
    "vertical_load": "N",
    "longitudinal_force": "N",
}


def _within(default: float | None, low: float, high: float) -> Any:
    """A number in [low, high]."""
    return key(number(low, high), default)


def _whole(default: int | None, low: int, high: int) -> Any:
    """A whole number in [low, high]."""
    return key(number(low, high, whole=True), default)


def _list_within(low: float, high: float, length: int) -> Any:
    """At most `length` numbers in [low, high]."""
    return key(numbers(low, high, length), ())


def _one_of(default: str | None, *allowed: str) -> Any:
    return key(words(*allowed), default)


@dataclass(frozen=True)
class TrueTire:
    """[tire]. What the setup says of the tire, and the stiffnesses that only the truth knows.

    Beam: EJ, k, mu, patch half length L = L_ref (F / reference load)^exponent. Ring (centre line of
    the belt at the rolling radius): EI, k_w, k_v, damping, inflation through `width_belt_m`, tread
    stiffness of the one-sided contact. `torsional_stiffness_N_m2` is the sidewall's resistance to
    wind-up (absent: none is simulated), `slip_stiffness_N` the force per slip by which beam and
    ring turn faster than they roll in drive and slower in braking (absent: as planted traction
    slips, or not at all). Coupled ring: the ring's, with damping by rate, on a hub
    (`hub_mass_kg`, `hub_inertia_kg_m2`), rubbing by `bristle_stiffness_N_m2` and `friction`; k_v
    resists its wind-up.
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
    width_belt_m: float = _within(0.14, 0.0, 2.0)
    tread_stiffness_N_m2: float = _within(8.75e7, 1e5, 1e11)
    torsional_stiffness_N_m2: float | None = _within(None, 1e3, 1e9)
    slip_stiffness_N: float | None = _within(None, 1e3, 1e9)
    hub_mass_kg: float = _within(20.0, 0.1, 1e4)
    hub_inertia_kg_m2: float = _within(0.8, 1e-3, 1e4)
    bristle_stiffness_N_m2: float = _within(1.9e6, 0.0, 1e10)
    friction: float = _within(0.8, 0.0, 5.0)


@dataclass(frozen=True)
class TrueConditions:
    """The table [conditions] of a scenario.

    `warm_up_K` is the rise of the tire's temperature, first order with `warm_up_time_s`, from the
    log's start.
    """

    load_N: float = _within(3434.0, 1.0, 1e6)
    inflation_pressure_Pa: float = _within(2.2e5, 0.0, 1e8)
    distance_km: float = _within(0.0, 0.0, 1e6)
    water_depth_mm: float = _within(0.0, 0.0, 100.0)
    driven: bool = True
    warm_up_K: float = _within(0.0, -100.0, 200.0)
    warm_up_time_s: float = _within(60.0, 0.1, 1e5)


@dataclass(frozen=True)
class Vehicle:
    """The table [vehicle] of a scenario.

    Longitudinal force of the wheel: half the demand in drive if driven, `brake_share` of it in
    braking, none in coasting. `suspension_damping_N_s_m` holds the coupled ring's hub against a
    body that stands still.
    """

    mass_kg: float = _within(1500.0, 1.0, 1e5)
    brake_share: float = _within(0.25, 0.0, 1.0)
    rolling_drag: float = _within(0.012, 0.0, 1.0)
    air_drag_kg_m: float = _within(0.4, 0.0, 100.0)
    suspension_damping_N_s_m: float = _within(0.0, 0.0, 1e6)


@dataclass(frozen=True)
class Road:
    """The table [road] of a scenario, and how the load varies along it.

    `roughness` relative standard deviation of the load along the road, correlated over
    `correlation_m`; `load_scatter` relative standard deviation of the load from manoeuvre to
    manoeuvre.

    What is rolled over (coupled ring only), in the words of a setup's [road]: `kind` "flat"; "step"
    (`height_m` over `ramp_m`); "cleat" (`height_m`, `length_m` at its foot, ramps of `ramp_m`
    within it); "sine" (`amplitude_m` (1 - cos(2 pi x/`wavelength_m`))); "profile" (`file`: two
    columns, distance and height, beside the scenario). It begins `position_m` after the log's
    start, and comes again every `spacing_m` (a cleat or a profile).
    """

    roughness: float = _within(0.0, 0.0, 0.2)
    correlation_m: float = _within(2.0, 0.2, 100.0)
    load_scatter: float = _within(0.0, 0.0, 0.2)
    kind: str = _one_of("flat", *ROADS)
    height_m: float | None = _within(None, -1.0, 1.0)
    length_m: float | None = _within(None, 0.0, 100.0)
    ramp_m: float | None = _within(None, 0.0, 100.0)
    amplitude_m: float | None = _within(None, -1.0, 1.0)
    wavelength_m: float | None = _within(None, 0.0, 1e4)
    file: str | None = None
    position_m: float | None = _within(None, 0.0, 1e6)
    spacing_m: float | None = _within(None, 0.0, 1e6)


@dataclass(frozen=True)
class LoadStep:
    """A step of the load, from [[load_steps]] (coupled ring only).

    From `time_s` on the wheel carries `load_N`, reached within `rise_s`.
    """

    time_s: float = _within(0.0, 0.0, 1e5)
    load_N: float = _within(3434.0, 1.0, 1e6)
    rise_s: float = _within(0.02, 1e-3, 1e3)


#: harmonics of the wheel that run-out and force variation may have
WHEEL_HARMONICS = 3


@dataclass(frozen=True)
class RunOut:
    """The table [nuisances.run_out] of a scenario: strain that goes round with the wheel.

    The h-th harmonic adds amplitude cos(h (wheel angle) - phase) to every strain channel, whatever
    the road does: a bent rim, a splice far away, an eccentric hub.
    """

    amplitudes_microstrain: tuple[float, ...] = _list_within(0.0, 1e3, WHEEL_HARMONICS)
    phases_deg: tuple[float, ...] = _list_within(-360.0, 360.0, WHEEL_HARMONICS)


@dataclass(frozen=True)
class ForceVariation:
    """The table [nuisances.force_variation] of a scenario: load that varies with the wheel's turn.

    The load is multiplied by 1 + sum of share cos(h (wheel angle) - phase).
    """

    shares: tuple[float, ...] = _list_within(0.0, 0.1, WHEEL_HARMONICS)
    phases_deg: tuple[float, ...] = _list_within(-360.0, 360.0, WHEEL_HARMONICS)


@dataclass(frozen=True)
class LoadWander:
    """The table [nuisances.load_wander] of a scenario: grade and wind.

    The load is multiplied by 1 + an Ornstein-Uhlenbeck process of standard deviation `share`,
    which forgets within `time_constant_s`. Scatter from manoeuvre to manoeuvre is
    [road] load_scatter.
    """

    share: float = _within(0.0, 0.0, 0.1)
    time_constant_s: float = _within(3.0, 1.0, 1e4)


@dataclass(frozen=True)
class Warming:
    """The table [nuisances.warming] of a scenario: what the tire's temperature changes.

    Relative changes per K of `warm_up_K` under [conditions]: foundation (the ring's both
    stiffnesses), bending stiffness, prescribed patch length, inflation pressure; `strain_per_K` is
    the baseline's. Setups tell the pressure of the log's start; a channel of kind
    inflation_pressure or temperature follows.
    """

    stiffness_per_K: float = _within(0.0, -0.02, 0.02)
    bending_per_K: float = _within(0.0, -0.02, 0.02)
    patch_length_per_K: float = _within(0.0, -0.02, 0.02)
    pressure_per_K: float = _within(0.0, -0.02, 0.02)
    strain_per_K: float = _within(0.0, -1e-4, 1e-4)


@dataclass(frozen=True)
class RollingRadius:
    """The table [nuisances.rolling_radius] of a scenario: the setup's radius is not the true one.

    True rolling radius = the setup's (1 + `error`) (1 + `growth` (v/`at_speed_m_s`)^2): the belt is
    longer at speed, so that the wheel turns less.
    """

    error: float = _within(0.0, -0.1, 0.1)
    growth: float = _within(0.0, 0.0, 0.1)
    at_speed_m_s: float = _within(25.0, 1.0, 120.0)


@dataclass(frozen=True)
class Nuisances:
    """The table [nuisances] of a scenario: what every car has and no model of the tire tells.

    Absent: none. What an instrument does (coloured noise, hum, digits, lost peaks) stands with its
    channel, scatter of the load with the road, the patch's exponent with the tire.
    """

    run_out: RunOut = RunOut()
    force_variation: ForceVariation = ForceVariation()
    load_wander: LoadWander = LoadWander()
    warming: Warming = Warming()
    rolling_radius: RollingRadius = RollingRadius()


@dataclass(frozen=True)
class Manoeuvre:
    """A manoeuvre, from [[manoeuvres]].

    `duration_s` seconds to `speed_m_s` at constant acceleration, corners rounded over
    `Scenario.rounding_s`. Without `regime` the acceleration decides: |a| < 0.15 m/s^2 cruise, > 0
    drive, > -1.5 coast, else brake.
    """

    duration_s: float = _within(5.0, 0.05, 1e5)
    speed_m_s: float = _within(10.0, 0.0, 120.0)
    regime: str | None = _one_of(None, *REGIMES)


@dataclass(frozen=True)
class Sensor:
    """A sensor, from [channels.NAME].

    One instrument channel. `noise` and `quantisation` are in the unit that the file holds (nm,
    microstrain, g, V, m/s, ...). The noise is white, or forgets its last sample by
    `noise_correlation` (first order, the same size); `hum` is the amplitude of a sine at `hum_Hz`,
    with half of it at the double; `flicker` the standard deviation over the log of 1/f noise.
    `angle_deg` is the place on the wheel. `lost_fraction` of the samples is blank, in runs of
    `lost_run` on average; a grating also loses the share `lost_at_flanks` of the samples at which
    strain changes along the tread by more than half of the most. `jitter_s` moves the moment of
    sampling about its stamp; `delay_s` is the telemetry's; `range` and `bits` clip and digitise.
    `coupling_Hz` is the high-pass of an AC-coupled instrument (first order; 0: none).
    Encoder:
    `steps`, `signal`, `amplitude`, `offset`, `pitch_error_deg` (drawn by `pitch_seed`),
    `missing_teeth`, `extra_teeth`.
    """

    kind: str = _one_of("", *SOURCE_UNITS)
    source: str = ""
    sampling_rate_Hz: float = _within(2500.0, 1.0, 1e6)
    angle_deg: float = _within(0.0, -360.0, 360.0)
    surface: str = _one_of("outer", "outer", "inner")
    noise: float = _within(0.0, 0.0, 1e6)
    noise_correlation: float = _within(0.0, 0.0, 0.999)
    hum: float = _within(0.0, 0.0, 1e6)
    hum_Hz: float = _within(50.0, 0.1, 1e5)
    flicker: float = _within(0.0, 0.0, 1e6)
    quantisation: float = _within(0.0, 0.0, 1e6)
    lost_fraction: float = _within(0.0, 0.0, 0.9)
    lost_run: float = _within(1.0, 1.0, 1e4)
    lost_at_flanks: float = _within(0.0, 0.0, 0.9)
    jitter_s: float = _within(0.0, 0.0, 0.1)
    gauge_length_m: float = _within(0.0, 0.0, 0.2)
    lag_s: float = _within(0.0, 0.0, 1.0)
    delay_s: float = _within(0.0, 0.0, 1.0)
    bandwidth_Hz: float | None = _within(None, 1.0, 1e6)
    coupling_Hz: float = _within(0.0, 0.0, 100.0)
    baseline: float = _within(0.0, -0.1, 0.1)
    reference_wavelength_nm: float = _within(1550.0, 100.0, 1e5)
    strain_gain: float = _within(1.27, 0.1, 100.0)
    thermal_expansion_1_K: float = _within(0.0, -1.0, 1.0)
    temperature_sensitivity_nm_K: float = _within(0.010, 1e-6, 10.0)
    temperature_channel: str | None = None
    range: float | None = _within(None, 1e-9, 1e9)
    bits: int | None = _whole(None, 4, 32)
    steps: int = _whole(48, 2, 10000)
    signal: str = _one_of("sine", "sine", "square", "counter")
    amplitude: float = _within(1.0, 1e-6, 1e3)
    offset: float = _within(0.0, -1e3, 1e3)
    pitch_error_deg: float = _within(0.0, 0.0, 5.0)
    pitch_seed: int = _whole(0, 0, 2**31)
    missing_teeth: tuple[int, ...] = key(numbers(0, whole=True), ())
    extra_teeth: tuple[int, ...] = key(numbers(0, whole=True), ())


@dataclass(frozen=True)
class Ramp:
    """The table [ramp] of a scenario.

    A static inflation test: from `start_Pa` at `begin_s` to `end_Pa` at `end_s`, with stops of
    `stop_length_s` at which `leak_Pa` is lost; every grating's strain grows by `strain_per_Pa`,
    times 1 + bend x rise.
    """

    start_Pa: float = _within(1.7e5, 0.0, 1e8)
    end_Pa: float = _within(2.3e5, 0.0, 1e8)
    begin_s: float = _within(1.0, 0.0, 1e5)
    end_s: float = _within(13.0, 0.1, 1e5)
    stops_s: tuple[float, ...] = key(numbers(0.0), ())
    stop_length_s: float = _within(1.0, 0.05, 1e4)
    leak_Pa: float = _within(0.0, 0.0, 1e6)
    strain_per_Pa: float = _within(1.0e-8, -1e-5, 1e-5)
    bend_1_Pa: float = _within(0.0, -1e-4, 1e-4)


@dataclass(frozen=True)
class Scenario:
    """A whole scenario.

    `seed` decides every random number; `grid_points` the fineness of the truth; `knot_s` how often,
    in seconds of the log, the waveform is solved anew (beam and ring); `step_s` the coupled ring's
    step in time, with an element of the belt for every eight of the grid's points.
    """

    manoeuvres: tuple[Manoeuvre, ...]
    channels: Mapping[str, Sensor]
    tire: TrueTire = TrueTire()
    conditions: TrueConditions = TrueConditions()
    vehicle: Vehicle = Vehicle()
    road: Road = Road()
    nuisances: Nuisances = Nuisances()
    effects: tuple[Planted, ...] = ()
    truth: str = _one_of("beam", *TRUTHS)
    seed: int = _whole(0, 0, 2**62)
    grid_points: int = _whole(2048, 256, 65536)
    knot_s: float = _within(0.05, 0.005, 0.05)
    step_s: float = _within(2.5e-5, 1e-7, 1e-2)
    rounding_s: float = _within(0.5, 0.05, 5.0)
    ramp: Ramp | None = None
    load_steps: tuple[LoadStep, ...] = ()

    def planted(self, name: str) -> Planted | None:
        """The planted effect of that name, or None."""
        return next((effect for effect in self.effects if effect.name == name), None)

    @property
    def duration_s(self) -> float:
        return sum(m.duration_s for m in self.manoeuvres)


# ---- The scenario file: TOML becomes a validated Scenario, or an error that says what is allowed.

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
