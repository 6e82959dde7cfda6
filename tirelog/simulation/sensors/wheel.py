"""The wheel as a body: longitudinal force, wind-up, passages of a sensor, and the encoder's teeth.

Sign: the phase shift is the wheel angle at the patch's middle minus its value at rest; drive winds
the hub ahead of the belt, so it is positive in drive and negative in braking. A sensor at the place
beta passes the patch centre when the wheel angle is beta + shift.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from tirelog.simulation.scenario.drive import force_of_road
from tirelog.simulation.scenario.schema import Sensor
from tirelog.simulation.steady.loads import REFERENCE_SPEED_M_S
from tirelog.simulation.steady.waveforms import World
from tirelog.vocabulary.arrays import FloatArray


def longitudinal_force(world: World, time_s: FloatArray) -> FloatArray:
    """Longitudinal force of the road on the wheel [N], drive positive."""
    return force_of_road(world.scenario, world.drive, time_s)


def phase_shift(world: World, time_s: FloatArray) -> FloatArray:
    """Phase shift [rad]: wind-up of the sidewalls, and what is planted.

    The wind-up is F_x/(2 pi R^2 k_v) (errata); planted are trend and cross-talk. Telemetry delay is
    not in it: it moves the acceleration in time.
    """
    scenario = world.scenario
    shift = np.zeros_like(time_s)
    stiffness = scenario.tire.torsional_stiffness_N_m2
    if stiffness is not None:
        shift = shift + longitudinal_force(world, time_s) / (
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


def tread_angle(world: World, sensor: Sensor, time_s: FloatArray) -> FloatArray:
    """Angle [rad] of the sensor's place in the road's frame, not wrapped.

    Zero, and every whole turn, at the patch centre.
    """
    angle: FloatArray = (
        world.drive.angle_at(time_s) - np.radians(sensor.angle_deg) - phase_shift(world, time_s)
    )
    return angle


def passages(world: World, sensor: Sensor, end_s: float) -> FloatArray:
    """Times [s] at which the sensor's place passes the patch centre, within [0, end_s)."""
    edge = tread_angle(world, sensor, np.array([0.0, end_s])) / (2 * np.pi)
    turns = np.arange(np.ceil(edge[0] - 1e-12), np.ceil(edge[1]))
    time = np.zeros(turns.size)
    shift = np.zeros(turns.size)
    for _ in range(4):
        time = world.drive.times_of_angle(2 * np.pi * turns + np.radians(sensor.angle_deg) + shift)
        shift = phase_shift(world, time)
    return time


def pitch_table(world: World, sensor: Sensor) -> FloatArray:
    """How far each tooth stands from its place [rad], shape (steps,).

    Run-out and single teeth, zero mean, at most the given error. The tone wheel's own seed draws
    it, so that several logs share one wheel.
    """
    random = np.random.default_rng(sensor.pitch_seed)
    effect = world.scenario.planted("tooth_pitch")
    largest = np.radians(effect["error_deg"] if effect is not None else sensor.pitch_error_deg)
    place = 2 * np.pi * np.arange(sensor.steps) / sensor.steps
    error = np.cos(place + random.uniform(0, 2 * np.pi)) + 0.4 * np.cos(
        2 * place + random.uniform(0, 2 * np.pi)
    )
    error = error + 0.35 * random.standard_normal(sensor.steps)
    error -= error.mean()
    scaled: FloatArray = error * (largest / max(np.abs(error).max(), 1e-12))
    return scaled


def encoder_signal(
    world: World, sensor: Sensor, time_s: FloatArray, table: FloatArray
) -> FloatArray:
    """The encoder's voltage (n,).

    A sinusoid per tooth, amplitude growing with speed and varying by 15 % over the turn; or square
    pulses; or a count of steps. A missing tooth leaves the offset; an extra one doubles the
    frequency over its pitch.
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
    index = np.floor(tooth).astype(int) % sensor.steps
    wave = np.where(np.isin(index, sensor.extra_teeth), np.sin(4 * np.pi * tooth), wave)
    wave = np.where(np.isin(index, sensor.missing_teeth), 0.0, wave)
    if sensor.signal == "counter":
        return np.asarray(
            np.floor(tooth + sensor.steps * np.round((angle - turn) / (2 * np.pi))), float
        )
    if sensor.signal == "square":
        return np.asarray(sensor.offset + sensor.amplitude * (wave > 0), float)
    speed = world.drive.speed_at(time_s)
    amplitude = sensor.amplitude * speed / (speed + 3.0) * (1.0 + 0.15 * np.cos(turn + 0.7))
    return np.asarray(sensor.offset + amplitude * wave, float)
