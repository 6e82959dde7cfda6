"""From waveforms and the drive to the numbers in the log.

World --chunks of knots--> tables (b, points)
    --six points in angle, four in time--> clean values (n,) at the moments of sampling
      --noise, digits, lost samples--> values (n,) in the unit of the file, NaN if lost
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from tirelog.simulation.scenario.schema import PLANTABLE, Nuisances, Scenario
from tirelog.simulation.steady import waveforms
from tirelog.simulation.steady.loads import REFERENCE_SPEED_M_S, SLOWEST_M_S
from tirelog.simulation.steady.waveforms import CHUNK, LOAD_STEP, World, chunks
from tirelog.storage.schema import Record
from tirelog.version import __version__
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.kinds import ACCELERATION_KINDS, STRAIN_KINDS
from tirelog.vocabulary.units import STANDARD_GRAVITY_M_S2

# ---- The wheel as a body: longitudinal force, wind-up, passages of a sensor, and the encoder's
# teeth.
#
# Sign: the phase shift is the wheel angle at the patch's middle minus its value at rest; drive
# winds the hub ahead of the belt, so it is positive in drive and negative in braking. A sensor at
# the place beta passes the patch centre when the wheel angle is beta + shift.


def phase_shift(world: World, time_s: FloatArray) -> FloatArray:
    """Phase shift [rad]: wind-up of the sidewalls, and what is planted.

    The wind-up is F_x/(2 pi R^2 k_v) (errata); planted are trend and cross-talk. Telemetry delay is
    not in it: it moves the acceleration in time.
    """
    scenario = world.scenario
    shift = np.zeros_like(time_s)
    stiffness = scenario.tire.torsional_stiffness_N_m2
    if stiffness is not None:
        shift = shift + world.longitudinal_force(time_s) / (
            2 * np.pi * world.drive.radius_m**2 * stiffness
        )
    trend, crosstalk = scenario.planted("speed_trend"), scenario.planted("load_crosstalk")
    if trend is not None:
        speed = world.drive.speed_at(time_s) / REFERENCE_SPEED_M_S
        bent = np.sqrt(0.04 + speed**2) * speed if trend.other else speed**2
        shift = shift + trend["linear_rad"] * speed + trend["quadratic_rad"] * bent
    if crosstalk is not None:
        more = world.load(time_s) / scenario.conditions.load_N - 1.0
        bent = np.expm1(3.0 * more) / 3.0 if crosstalk.other else more
        shift = shift + crosstalk["per_relative_load_rad"] * bent
    return shift


def tread_angle(world: World, sensor: Record, time_s: FloatArray) -> FloatArray:
    """Angle [rad] of the sensor's place in the road's frame, not wrapped.

    Zero, and every whole turn, at the patch centre.
    """
    return np.asarray(
        world.drive.angle_at(time_s) - np.radians(sensor.angle_deg) - phase_shift(world, time_s)
    )


def passages(world: World, sensor: Record, end_s: float) -> FloatArray:
    """Times [s] at which the sensor's place passes the patch centre, within [0, end_s)."""
    edge = tread_angle(world, sensor, np.array([0.0, end_s])) / (2 * np.pi)
    turns = np.arange(np.ceil(edge[0] - 1e-12), np.ceil(edge[1]))
    time = np.zeros(turns.size)
    shift = np.zeros(turns.size)
    for _ in range(4):
        time = world.drive.times_of_angle(2 * np.pi * turns + np.radians(sensor.angle_deg) + shift)
        shift = phase_shift(world, time)
    return time


def pitch_tables(world: World) -> dict[str, FloatArray]:
    """Deviation of each tooth of every encoder from its place [rad], shape (steps,) each.

    Run-out and single teeth, zero mean, at most the given error. The tone wheel's own seed draws
    it, so that several logs share one wheel.
    """
    tables, effect = {}, world.scenario.planted("tooth_pitch")
    for name, sensor in world.scenario.channels.items():
        if sensor.kind == "wheel_encoder":
            random = np.random.default_rng(sensor.pitch_seed)
            largest = np.radians(effect["error_deg"] if effect else sensor.pitch_error_deg)
            place = 2 * np.pi * np.arange(sensor.steps) / sensor.steps
            error = np.cos(place + random.uniform(0, 2 * np.pi)) + 0.4 * np.cos(
                2 * place + random.uniform(0, 2 * np.pi)
            )
            error = error + 0.35 * random.standard_normal(sensor.steps)
            error -= error.mean()
            tables[name] = np.asarray(error * (largest / max(np.abs(error).max(), 1e-12)))
    return tables


def encoder_signal(
    world: World, sensor: Record, time_s: FloatArray, table: FloatArray
) -> FloatArray:
    """The encoder's voltage (n,).

    A sinusoid per tooth, amplitude growing with speed and varying by 15 % over the turn; or square
    pulses; or a count of steps.
    """
    angle = world.drive.angle_at(time_s)
    turn = angle % (2 * np.pi)
    place = 2 * np.pi * np.arange(sensor.steps) / sensor.steps
    edges = np.concatenate((place + table, [2 * np.pi + table[0]]))
    # tooth number as a smooth periodic function of the wheel angle
    extended = np.concatenate((edges[-4:-1] - 2 * np.pi, edges, edges[1:4] + 2 * np.pi))
    numbers = np.arange(-3, sensor.steps + 4)
    tooth = CubicSpline(extended, numbers)(turn)
    wave = np.sin(2 * np.pi * tooth)
    if sensor.signal == "counter":
        return np.asarray(
            np.floor(tooth + sensor.steps * np.round((angle - turn) / (2 * np.pi))), float
        )
    if sensor.signal == "square":
        return np.asarray(sensor.offset + sensor.amplitude * (wave > 0), float)
    speed = world.drive.speed_at(time_s)
    amplitude = sensor.amplitude * speed / (speed + 3.0) * (1.0 + 0.15 * np.cos(turn + 0.7))
    return np.asarray(sensor.offset + amplitude * wave, float)


#: times by channel [s], (n,) each
Times: TypeAlias = Mapping[str, FloatArray]
#: kinds that ride on the tread and read a waveform
RIDING = (*STRAIN_KINDS, *ACCELERATION_KINDS)
#: values of the unit in the file per SI unit, if they are not one
PER_SI = {"strain": 1e6, "radial_acceleration": 1.0 / STANDARD_GRAVITY_M_S2}
#: points around the sample in the angle's interpolation
ANGLE_POINTS, TIME_POINTS = 6, 4


def lagrange(place: FloatArray, points: int) -> FloatArray:
    """Weights (points, n) of the interpolating polynomial.

    At `place` in [0, 1) between the two middle ones of `points` equal steps.
    """
    nodes = np.arange(points) - (points // 2 - 1)
    weights = np.ones((points, place.size))
    for i, node in enumerate(nodes):
        for other in nodes:
            if other != node:
                weights[i] *= (place - other) / (node - other)
    return weights


def read_tables(
    tables: list[FloatArray], time_place: FloatArray, turns: FloatArray, fluctuation: FloatArray
) -> FloatArray:
    """Values (n,) of a parabola in the load's `fluctuation` (n,), by its coefficients' tables.

    tables      (b, points) each, over knots in time and angles round the wheel
    time_place  (n,) in knots from the tables' first
    turns       (n,) the tread angle in turns, zero at the patch centre
    """
    knots, points = tables[0].shape
    row = np.clip(np.floor(time_place).astype(np.intp), 1, knots - 3)
    column = ((turns + 0.5) % 1.0) * points
    left = np.clip(np.floor(column).astype(np.intp), 0, points - 1)
    width = points + ANGLE_POINTS
    index = (row - 1) * width + left + 1
    in_time = lagrange(time_place - row, TIME_POINTS)
    in_angle = lagrange(column - left, ANGLE_POINTS)
    value = np.zeros(index.size)
    for table in reversed(tables):
        flat = np.pad(table, ((0, 0), (ANGLE_POINTS // 2, ANGLE_POINTS // 2)), mode="wrap").ravel()
        total = np.zeros(index.size)
        for i, weight in enumerate(in_time):
            along = np.zeros(index.size)
            for j, share in enumerate(in_angle):
                along += share * flat[index + (i * width + j)]
            total += weight * along
        value = total + fluctuation * value
    return value


def moments_of(scenario: Scenario) -> tuple[Times, Times]:
    """(stamps, moments at which the values were true) of every channel [s], (n,) each.

    A delay parts them.
    """
    stamps, moments = {}, {}
    for name, sensor in scenario.channels.items():
        count = round(scenario.duration_s * sensor.sampling_rate_Hz)
        stamps[name] = np.arange(count) / sensor.sampling_rate_Hz
        moments[name] = stamps[name] - scenario.late_s(sensor)
    return stamps, moments


def riding_values(world: World, moments: Times) -> dict[str, FloatArray]:
    """Clean values in SI of every channel that rides on the tread.

    Gravity and the vehicle's acceleration are in the accelerometers'.
    """
    channels = world.scenario.channels
    riding = {name: time for name, time in moments.items() if channels[name].kind in RIDING}
    values: dict[str, FloatArray] = {}
    for place in dict.fromkeys(channels[name].lateral_m for name in riding):
        alike = {name: t for name, t in riding.items() if channels[name].lateral_m == place}
        values |= _values_at(world, alike, place)
    return values


def _values_at(world: World, riding: Times, lateral_m: float) -> dict[str, FloatArray]:
    """The same of the channels `riding` at one place across the tread."""
    channels = world.scenario.channels
    values = {name: np.zeros(time.size) for name, time in riding.items()}
    turns = {
        name: tread_angle(world, channels[name], time) / (2 * np.pi)
        for name, time in riding.items()
    }
    first = min(float(time.min()) for time in riding.values())
    last = max(float(time.max()) for time in riding.values())
    for (begin, end, steps), solutions in chunks(world, first, last, lateral_m):
        tables: dict[object, list[FloatArray]] = {}
        for name, time in riding.items():
            here = np.flatnonzero((time >= begin) & (time < end))
            if not here.size:
                continue
            sensor = channels[name]
            # sensors that are alike in this share their waveforms
            alike = ("kind", "surface", "gauge_length_m", "lag_s", "bandwidth_Hz")
            key = (*(getattr(sensor, of) for of in alike), world.behind_first(sensor))
            if key not in tables:
                tables[key] = waves = [world.waveform(one, sensor) for one in solutions]
                if len(waves) == 3:  # a parabola through them, in the load's fluctuation
                    middle, more, less = waves
                    slope = (more - less) / (2 * LOAD_STEP)
                    bend = (more + less - 2 * middle) / (2 * LOAD_STEP**2)
                    tables[key] = [middle, slope, bend]
            after = (time[here] - begin) / ((end - begin) / steps) + 1.0
            varies = world.fluctuation(time[here])
            values[name][here] = read_tables(tables[key], after, turns[name][here], varies)
    for name, time in riding.items():
        values[name] += _slow(world, channels[name], time, turns[name])
    return values


def _slow(world: World, sensor: Record, time_s: FloatArray, turns: FloatArray) -> FloatArray:
    """Slow additions to the waveform.

    The strain's baseline, or gravity and the vehicle's acceleration along the outward radius.
    """
    if sensor.kind != "radial_acceleration":
        return world.baseline(time_s, sensor)
    angle = 2 * np.pi * turns
    # an accelerometer feels acceleration minus gravity; outwards is down at the patch, and
    # backwards towards the exit
    forwards = world.drive.acceleration_at(time_s)
    outwards = -STANDARD_GRAVITY_M_S2 * np.cos(angle) - forwards * np.sin(angle)
    tilt = world.tilt(world.drive.speed_at(time_s))
    if tilt is None:
        return outwards
    return outwards + tilt * (STANDARD_GRAVITY_M_S2 * np.sin(angle) - forwards * np.cos(angle))


def vehicle_values(
    world: World, sensor: Record, time: FloatArray, table: FloatArray | None
) -> FloatArray:
    """Clean values in SI of a channel that does not ride on the tread; `table`: an encoder's."""
    kind = sensor.kind
    if table is not None:
        return encoder_signal(world, sensor, time, table)
    if kind == "vehicle_speed":
        return world.drive.speed_at(time) / (1.0 - world.slip(time))
    if kind == "longitudinal_acceleration":
        return world.drive.acceleration_at(time)
    if kind == "lateral_acceleration":
        return np.interp(time, world.drive.time_s, world.drive.lateral_m_s2)
    if kind == "vertical_load":
        return world.load(time) * (1.0 + world.fluctuation(time))
    if kind == "longitudinal_force":
        return world.longitudinal_force(time)
    if kind == "inflation_pressure":
        course = world.scenario.ramp
        return world.pressure(time) if course is None else waveforms.ramp_pressure(course, time)
    return world.temperature(time)


def in_source_units(
    world: World, sensor: Record, time_s: FloatArray, clean: FloatArray
) -> FloatArray:
    """SI values as the file's unit, without noise.

    FBG: the wavelength [nm] that P1 (1) turns back into the strain.
    """
    if sensor.kind == "fbg_strain":
        warm = sensor.thermal_expansion_1_K * world.temperature(time_s)
        return sensor.reference_wavelength_nm * (1.0 + (clean + warm) / sensor.strain_gain)
    if sensor.kind == "fbg_temperature":
        return sensor.reference_wavelength_nm + sensor.temperature_sensitivity_nm_K * clean
    if sensor.kind == "temperature":
        return clean + 20.0
    return clean * PER_SI.get(sensor.kind, 1.0)


def flanks(world: World, sensor: Record, time_s: FloatArray, told: FloatArray) -> NDArray[np.bool_]:
    """Where the strain changes along the tread by more than half of the most, (n,).

    There the grating's peak is broad, whatever the speed.
    """
    if not sensor.lost_at_flanks or sensor.kind not in STRAIN_KINDS or told.size < 2:
        return np.zeros(told.size, bool)
    way = world.drive.speed_at(time_s) / sensor.sampling_rate_Hz
    slope = np.abs(np.gradient(told)) / np.maximum(way, 1e-6)
    moving = way * sensor.sampling_rate_Hz > SLOWEST_M_S
    most = np.quantile(slope[moving], 0.999) if moving.any() else np.inf
    return np.asarray(moving & (slope > 0.5 * most), bool)


def noise_of(sensor: Record, size: int, random: np.random.Generator) -> FloatArray:
    """An instrument's noise (n,), in the file's unit: white or coloured, with hum and flicker."""
    total = np.zeros(size)
    if sensor.noise:
        white = random.standard_normal(size)
        kept = sensor.noise_correlation
        if kept and size:
            white[0] /= np.sqrt(1.0 - kept**2)
            white = lfilter([np.sqrt(1.0 - kept**2)], [1.0, -kept], white)
        total = sensor.noise * white
    if sensor.hum:
        phase = random.uniform(0.0, 2.0 * np.pi, 2)
        turn = 2.0 * np.pi * sensor.hum_Hz * np.arange(size) / sensor.sampling_rate_Hz
        total = total + sensor.hum * (np.sin(turn + phase[0]) + 0.5 * np.sin(2.0 * turn + phase[1]))
    if sensor.flicker and size > 1:
        # power as 1/f from one period of the log on
        spectrum = fft.rfft(random.standard_normal(size))
        spectrum[0] = 0.0
        spectrum[1:] /= np.sqrt(np.arange(1.0, spectrum.size))
        wave = fft.irfft(spectrum, n=size)
        total = total + sensor.flicker * wave / wave.std()
    return total


def spoiled(
    sensor: Record, values: FloatArray, flank: NDArray[np.bool_], random: np.random.Generator
) -> FloatArray:
    """Noise, clipping, digits and lost samples (NaN); `flank` (n,) are those of `flanks`."""
    if sensor.noise or sensor.hum or sensor.flicker:
        values = values + noise_of(sensor, values.size, random)
    if sensor.range is not None:
        values = np.clip(values, -sensor.range, sensor.range)
        if sensor.bits is not None:
            digit = 2.0 * sensor.range / 2**sensor.bits
            values = np.round(values / digit) * digit
    if sensor.quantisation:
        values = np.round(values / sensor.quantisation) * sensor.quantisation
    if sensor.lost_fraction:
        begins = random.random(values.size) < sensor.lost_fraction / sensor.lost_run
        lost = np.zeros(values.size, bool)
        for start in np.flatnonzero(begins):
            lost[start : start + int(random.geometric(1.0 / sensor.lost_run))] = True
        values = np.where(lost, np.nan, values)
    if flank.any():
        values = np.where(
            flank & (random.random(values.size) < sensor.lost_at_flanks), np.nan, values
        )
    return values


# ---- The truth of a simulated log, ready for JSON.
#
# Times are the log's own stamps. Arrays have one value per passage of the patch; angles grow in the
# direction of rolling.

#: a channel's name and its delay [s] -> what is true at each of its passages, columns (n,)
#: beginning with `time_s` in its own stamps
Passages = Callable[[str, float], dict[str, FloatArray]]


def steady_truth(
    world: World, pitch_rad: Mapping[str, FloatArray], passed: Passages | None = None
) -> dict[str, Any]:
    """The whole truth of a log.

    `passed` gives a channel's passages if they are not the steady world's.
    """
    scenario = world.scenario
    passed = passed or partial(_steady_passages, world)
    # step of the wheel's motion in the truth [s]; twice as long shows quick manoeuvres half as
    # finely in the truth file alone
    time = np.arange(0.0, scenario.duration_s, 0.05)
    return {
        "tirelog_version": __version__,
        "seed": scenario.seed,
        "truth": scenario.truth,
        "contact": "parabola" if scenario.truth == "beam" else scenario.tire.contact,
        "tire": asdict(scenario.tire),
        "conditions": asdict(scenario.conditions),
        "road": asdict(scenario.road),
        **({} if scenario.nuisances == Nuisances() else {"nuisances": asdict(scenario.nuisances)}),
        "ramp": None if scenario.ramp is None else asdict(scenario.ramp),
        "effects": planted_truth(scenario),
        "manoeuvres": world.drive.parts,
        "motion": {
            "time_s": _list(time),
            "wheel_angle_rad": _list(world.drive.angle_at(time)),
            "speed_m_s": _list(world.drive.speed_at(time)),
            "acceleration_m_s2": _list(world.drive.acceleration_at(time)),
        },
        "channels": {
            name: _channel(scenario, name, passed)
            for name, s in scenario.channels.items()
            if s.kind in RIDING
        },
        "pitch_error_deg": {name: _list(np.degrees(table)) for name, table in pitch_rad.items()},
    }


def planted_truth(scenario: Scenario) -> list[dict[str, Any]]:
    """Every planted effect: name, form, strength, parameters.

    For one outside the catalogue also where it shows, parity, speed exponent, frequency.
    """
    out = []
    for effect in scenario.effects:
        known = PLANTABLE[effect.name]
        entry: dict[str, Any] = {
            "name": effect.name,
            "form": effect.form,
            "in_catalogue": known.in_catalogue,
            "strength": effect[next(iter(known.parameters))],
            "parameters": dict(effect.parameters),
        }
        if not known.in_catalogue:
            entry |= {
                "where": known.where,
                "parity": known.parity,
                "speed_exponent": effect["speed_exponent"],
                "frequency_Hz": effect.parameters.get("frequency_Hz"),
            }
        out.append(entry)
    if scenario.truth == "ring" and scenario.tire.contact == "parabola":
        out.append(
            {
                "name": "ring_curvature",
                "form": "exact",
                "in_catalogue": True,
                "strength": 1.0,
                "parameters": {},
            }
        )
    return out


def _channel(scenario: Scenario, name: str, passed: Passages) -> dict[str, Any]:
    """The passages of one sensor, in its own stamps (a delay makes them later)."""
    sensor = scenario.channels[name]
    late = scenario.late_s(sensor)
    return {
        "kind": sensor.kind,
        "angle_deg": sensor.angle_deg,
        "surface": sensor.surface,
        "delay_s": late,
        "passages": {key: _list(value) for key, value in passed(name, late).items()},
    }


def _steady_passages(world: World, name: str, late_s: float) -> dict[str, FloatArray]:
    """The passages of one sensor of a steady world."""
    sensor = world.scenario.channels[name]
    time = passages(world, sensor, world.scenario.duration_s - late_s)
    columns: dict[str, list[FloatArray]] = {}
    for first in range(0, time.size, CHUNK):
        for key, value in _passages(world, sensor, time[first : first + CHUNK]).items():
            columns.setdefault(key, []).append(value)
    return {
        "time_s": time + late_s,
        **{key: np.concatenate(values) for key, values in columns.items()},
    }


def _passages(world: World, sensor: Record, time: FloatArray) -> dict[str, FloatArray]:
    """True values at the passages `time` (n,), each (n,)."""
    across = world.across(time, sensor.lateral_m)
    at = world.instants(time, (1.0 + world.fluctuation(time)) * across)
    solution = world.solve(at)
    slope = world.ring.inverse(world.ring.derivatives[1] * world.strain(solution, sensor))
    radius = world.drive.radius_at(at.speed)
    return {
        "speed_m_s": at.speed,
        "acceleration_m_s2": at.acceleration,
        "load_N": at.load,
        "longitudinal_force_N": world.longitudinal_force(time),
        "slip": at.slip,
        "contact_length_m": solution.exit_m - solution.entry_m,
        "entry_m": solution.entry_m,
        "exit_m": solution.exit_m,
        "slip_onset_m": solution.onset_m,
        "dissipation_factor_1_m": (slope**2).sum(axis=1) * world.ring.step_m / at.stretch,
        "wheel_angle_rad": world.drive.angle_at(time),
        "phase_shift_deg": np.degrees(phase_shift(world, time)),
        "patch_width_deg": np.degrees((solution.exit_m - solution.entry_m) / radius),
    }


def _list(values: FloatArray) -> list[float | None]:
    """Numbers for JSON to ten digits, None if there is none."""
    return [float(f"{v:.10g}") if np.isfinite(v) else None for v in values]
