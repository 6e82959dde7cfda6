"""The wheel's angle, speed and rolling radius from its encoder (P4 section IV A).

    encoder channel --teeth--> counted passages
        --pitch table learnt from the log--> WheelAngle (angle and rate at any time)
    WheelAngle, vehicle_speed --> rolling radius with its error

Angles [rad] grow in the direction of rolling; their zero is the first tooth that was seen. Sine,
square pulses, counters and angles are taken as they come.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tirelog.data.plausibility import doubt_of_vehicle
from tirelog.data.recording import BLOCK_SAMPLES, Channel, Recording
from tirelog.dsp.pitch import (
    KNOT_STEP_S,
    LEAST_TURNS,
    SPAN_S,
    AngleFunction,
    KnotBuilder,
    PitchLearner,
    PitchTable,
    angle_function,
    steps_that_repeat,
)
from tirelog.dsp.teeth import (
    SLOW_S,
    TEETH,
    FASTEST_BACK_Hz,
    Probe,
    count_teeth,
    probe,
    teeth_of_counter,
    turns_of_counts,
)
from tirelog.errors import DataLoss, SetupError
from tirelog.vocabulary import units
from tirelog.vocabulary.arrays import BoolArray, FloatArray, IntArray, Records, records
from tirelog.vocabulary.quality import Quality, QualityFlags, marked
from tirelog.wheel.rolling import TURNS, rolling

# ---- Which way the wheel rolled after a standstill, if its one-track encoder does not show it.
#
#     stretches, a vehicle speed with a sign --mean over each stretch--> ways (1, -1)
#     wheel angle, placings --what nothing tells--> untold (stretches,)
#
# A turning point that the signal shows and the tone wheel's own pattern are used before
# (`dsp.teeth`, `dsp.pitch`); what is left is known from the vehicle's speed, if it
# has a
# sign, or by a speed at which nobody drives backwards.


def means_between(channel: Channel, begin_s: FloatArray, end_s: FloatArray) -> FloatArray:
    """Means of a channel over stretches of time (n,); NaN if one has no sample, or no end."""
    means = np.full(begin_s.size, np.nan)
    for k, ends in enumerate(np.stack([begin_s, end_s], axis=1)):
        if not np.isfinite(ends).all():
            continue
        first, last = (int(index) for index in np.ceil(channel.axis.index(ends)))
        total, known = 0.0, 0
        for at in range(first, max(last, first + 1), BLOCK_SAMPLES):
            values = channel.read(at, min(at + BLOCK_SAMPLES, max(last, first + 1)))
            total, known = total + float(np.nansum(values)), known + int(np.isfinite(values).sum())
        means[k] = total / known if known else np.nan
    return means


def ways_of(stretches: Records, vehicle: Channel | None) -> IntArray:
    """The direction of stretches (k,) of STRETCH that a vehicle speed [m/s] tells: 1, -1 or 0.

    None of them if it never falls below zero: it has no sign.
    """
    if vehicle is None or stretches.size < 2:
        return np.zeros(stretches.size, np.int64)
    speed = np.nan_to_num(means_between(vehicle, stretches["begin_s"], stretches["end_s"]))
    # a mean speed below this [m/s] tells no direction; doubled, a car that creeps at 0.3 m/s has
    # none
    ways = np.sign(speed).astype(np.int64) * (np.abs(speed) > 0.15)
    return ways * bool((ways < 0).any())


def untold_stretches(angle: AngleFunction, stretches: Records) -> BoolArray:
    """Stretches after a standstill whose direction nothing tells, shape (n,).

    Neither the tone wheel, nor the vehicle, nor the speed.
    """
    untold = np.zeros(len(stretches), bool)
    for number in range(1, len(stretches)):
        low, high = np.searchsorted(angle.stretch, [number, number + 1])
        beside = np.abs(angle.rate_rad_s[[max(low - 1, 0), min(low, angle.stretch.size - 1)]])
        # a wheel that turns this fast, in turns per second, on both sides of a hole in its signal
        # did not stand in it: 1 m/s on a car; doubled, more holes count as standstills and cost a
        # direction
        if beside.min() > 0.5 * 2 * np.pi:  # a hole in the signal, and no standstill
            untold[number] = untold[number - 1]
            continue
        fast = bool(np.any(np.abs(angle.rate_rad_s[low:high]) > FASTEST_BACK_Hz * 2 * np.pi))
        untold[number] = not (stretches["showed"][number] or fast)
    return untold


#: width of the speed's window: -3 dB at 20 Hz, the low-pass of P4; twice as wide, at 10 Hz
SPEED_WINDOW_S = 0.443 / 20.0


@dataclass(frozen=True)
class WheelAngle:
    """The wheel angle as a function of time, and what is doubtful in it.

    `angle`: the function of time; `backward` (n,) knots at which the wheel rolls back; `untold`
    (stretches,) True if nothing shows the direction after a standstill; `uneven_s` (m,) times of
    teeth beside which the count was mended, or may have lost teeth; `remarks`: sentences on the
    whole log.
    """

    channel: str
    steps: int
    angle: AngleFunction
    backward: np.ndarray
    untold: np.ndarray
    uneven_s: FloatArray
    remarks: tuple[str, ...]

    def speed_rad_s(self, time_s: FloatArray) -> FloatArray:
        """Wheel speed [rad/s], low-passed at 20 Hz, at times of shape (n,)."""
        knots, half = self.angle.time_s, SPEED_WINDOW_S / 2
        # the window is cut at the ends
        first, last = np.maximum(time_s - half, knots[0]), np.minimum(time_s + half, knots[-1])
        span = np.where(last > first, last - first, np.nan)
        return (self.angle.at(last) - self.angle.at(first)) / span

    def mended(self, begin_s: FloatArray, end_s: FloatArray) -> BoolArray:
        """Stretches of time (n,) at which the count of teeth was mended, or within a hole of it.

        None if most are: a gap in the tone wheel comes every turn, and is learnt.
        """
        knots, beside = self.angle.time_s, 0.5 * KNOT_STEP_S
        last = np.clip(np.searchsorted(knots, begin_s) - 1, 0, knots.size - 1)
        next_ = np.clip(np.searchsorted(knots, end_s), 0, knots.size - 1)
        begin = np.minimum(begin_s - 0.5 * SPAN_S, knots[last] - beside)
        end = np.maximum(end_s + 0.5 * SPAN_S, knots[next_] + beside)
        low, high = (np.searchsorted(self.uneven_s, at) for at in (begin, end))
        near = np.isfinite(begin_s + end_s) & (high > low)
        return near & (np.mean(near) < 0.5) if near.size else near

    def quality(self, start_s: FloatArray, stop_s: FloatArray) -> QualityFlags:
        """What is wrong with the angle within [start, stop], each shape (n,).

        Flags of standstill, reversing, gap, direction_unknown.
        """
        knots = self.angle.time_s
        first = np.clip(np.searchsorted(knots, start_s) - 1, 0, knots.size - 1)
        last = np.clip(np.searchsorted(knots, stop_s), 0, knots.size - 1)
        # slower than this, in turns per second, the wheel counts as standing: 0.2 m/s on a car;
        # doubled, what creeps at 0.4 m/s is at rest
        slow = np.flatnonzero(np.diff(knots) > max(1 / 0.1 / self.steps, 2 * KNOT_STEP_S))
        back = np.flatnonzero(self.backward)
        still = np.searchsorted(slow, last) > np.searchsorted(slow, first)
        reversing = np.searchsorted(back, last, side="right") > np.searchsorted(back, first)
        gap = (self.angle.stretch[last] != self.angle.stretch[first]) & ~still
        untold = self.untold[self.angle.stretch[last]]
        return (
            marked(still, Quality.STANDSTILL)
            | marked(gap, Quality.GAP)
            | marked(reversing, Quality.REVERSING)
            | marked(untold, Quality.DIRECTION_UNKNOWN)
        )


def wheel_angle(channel: Channel, unit: str = "1", vehicle: Channel | None = None) -> WheelAngle:
    """The wheel angle from an encoder channel.

    `unit` is the source's (an angle is taken as it is); `vehicle` a speed [m/s] whose sign tells
    the direction, if it ever falls below zero.

    SetupError: the channel has no `steps`.  DataLoss: it shows no teeth.
    """
    steps = int(channel.settings.get("steps") or 0)
    if units.UNITS[units.canonical(unit) or "1"][0] == "angle":
        return _by_angle(channel, steps or 360)
    if steps < 1:
        raise SetupError(
            f"channel {channel.name}: no steps",
            allowed="an encoder has a whole number of steps a turn",
            do="add steps = 48 or what it has",
        )
    found = probe(channel)
    turn, pieces = 2 * steps, count_teeth(channel, found, steps)
    if found.form == "counter":
        counted, turn = teeth_of_counter(channel, steps)
        pieces = (counted[at : at + BLOCK_SAMPLES] for at in range(0, counted.size, BLOCK_SAMPLES))
    learner, builder = PitchLearner(turn), KnotBuilder(turn)
    passages, missing, extra, sample = 0, 0, 0, np.zeros(0, TEETH)
    uneven = [np.zeros(0)]
    for teeth in pieces:
        learner.add(teeth)
        builder.add(teeth)
        passages += teeth.size
        missing += int(teeth["missing"].sum())
        extra += int(teeth["extra"].sum())
        uneven.append(_uneven_times(teeth))
        sample = max(sample, teeth, key=len)
    if passages < (16 if found.form == "counter" else 4 * steps):
        raise _too_few(channel, passages, steps)
    stretches = learner.placed(ways_of(learner.stretches, vehicle))
    pitch, knots = learner.table(stretches), builder.knots()
    # an edge lies anywhere between two samples
    edge_s = 0.0 if found.form == "sine" else 1.0 / channel.axis.rate_Hz / np.sqrt(12.0)
    # of one passage: the noise over the slope, five samples
    alone = found.noise / max(found.amplitude, np.finfo(float).tiny) / steps / np.sqrt(5.0)
    noise = builder.noise_rad(otherwise=float(alone))
    function = angle_function(knots, pitch.error_rad, stretches, noise, edge_s)
    backward = ~knots["forward"] | (stretches["sign"][knots["stretch"]] < 0)
    untold = untold_stretches(function, stretches)
    remarks = _remarks(found, (missing, extra), (backward, untold))
    remarks += _pitch_remarks(found.form, steps, pitch, sample, edge_s)
    return WheelAngle(
        channel.name, steps, function, backward, untold,
        np.concatenate(uneven), tuple(f"channel {channel.name}: {one}" for one in remarks),
    )  # fmt: skip


def _uneven_times(teeth: Records) -> FloatArray:
    """Times of the `teeth` (n,) of TEETH beside which the count was mended, or may have lost some.

    Teeth that are merely slow are no reason.
    """
    time = teeth["time_s"]
    slow = np.diff(time, append=np.inf) > SLOW_S
    begun = np.diff(teeth["stretch"], append=teeth["stretch"][-1:]) > 0
    mended = (teeth["missing"] > 0) | (teeth["extra"] > 0) | teeth["hole"]
    return np.asarray(time[mended | begun | (teeth["uneven"] & ~slow)])


def _too_few(channel: Channel, passages: int, steps: float) -> DataLoss:
    """The error of a channel with fewer than two turns."""
    return DataLoss(
        f"channel {channel.name}: no teeth, or fewer than two turns of them ({passages} changes)",
        allowed=f"an encoder's signal swings {steps:g} times a turn through its middle, and a "
        "counter climbs by as much",
        do="check the wiring, the source, and that encoder and accelerometer are not swapped, or "
        "give a longer log",
    )


def _by_angle(channel: Channel, steps: int) -> WheelAngle:
    """The wheel angle of an angle channel, as it is."""
    time, turns = turns_of_counts(channel, 2 * np.pi, is_angle=True)
    if time.size < 16:
        raise _too_few(channel, time.size, 2 * np.pi)
    noise = max(2.0 * np.pi * _scatter(turns), channel.resolution / np.sqrt(12.0))
    rate = np.gradient(2 * np.pi * turns, time).astype(np.float32)
    function = AngleFunction(time, turns, 2 * np.pi, rate, np.zeros(time.size, np.int32), noise)
    backward, untold = np.diff(turns, prepend=turns[0]) < 0, np.zeros(1, bool)
    return WheelAngle(channel.name, steps, function, backward, untold, np.zeros(0), ())


def _scatter(turns: FloatArray) -> float:
    """Standard deviation of angles (n,), noise and steps of the sensor alike.

    From their third differences, as far as they move.
    """
    third = np.abs(np.diff(turns, 3))
    # third differences [turns] below this are the arithmetic's, not the sensor's: at a million
    # turns a double is known to 1e-10
    third = third[third > 1e-9]
    return float(np.median(third)) / (0.6745 * np.sqrt(20.0)) if third.size else 0.0


def _remarks(
    found: Probe, repaired: tuple[int, int], ways: tuple[BoolArray, BoolArray]
) -> list[str]:
    """Sentences on the teeth and the direction of this log."""
    share, (missing, extra), (backward, untold) = min(found.duty, 1.0 - found.duty), repaired, ways
    told = {
        f"{missing} missing and {extra} extra teeth were repaired": missing + extra > 0,
        "the wheel rolled backwards for a while; passages there are left out": backward.any(),
        f"after {untold.sum()} standstills nothing tells which way the wheel rolled "
        "(direction_unknown); a vehicle_speed with a sign would": untold.any(),
        f"pulses of {share:.0%} of a step; edges of one kind are counted": found.pulsed,
    }
    return [sentence for sentence, is_so in told.items() if is_so]


def _pitch_remarks(
    form: str, steps: int, pitch: PitchTable, sample: Records, edge_s: float
) -> list[str]:
    """Sentences on the pitch table; `edge_s` [s] the error of an edge between samples."""
    # a table that explains more than this share of the deviations repeats; another number of steps
    # must explain so much more than the setup's; twice the lead keeps a setup's wrong number of
    # steps where both explain much
    if pitch.repeats >= 0.8 or (form == "counter" and pitch.turns == 0):
        return []
    if pitch.turns == 0:
        return [
            f"fewer than {LEAST_TURNS} even turns, so the tone wheel's pitch errors are not learnt"
        ]
    other, share, own = steps_that_repeat(sample, steps, pitch.error_rad.size, edge_s)
    if not (share > own + 0.2 and steps % other):
        return []
    return [
        f"the learnt pitch table does not repeat with {steps} steps, it does with {other}; mend "
        "steps in the setup"
    ]


def rolling_radius(recording: Recording, wheel: WheelAngle) -> tuple[float, float, tuple[str, ...]]:
    """(rolling radius, its standard error [m], sentences on the wheel and the radius).

    The setup's, else a calibrated one, else the unloaded radius; the error is NaN of a given one.

    Calibrated against `vehicle_speed` (P4: v = r omega) by the turns that roll freely. If there
    are too few, by the median of all; its error comes from their scatter.
    SetupError: the vehicle's speed contradicts the setup's radius.
    """
    tire = recording.setup.tire
    speeds = recording.of_kind("vehicle_speed")
    measured = _radius_of_turns(speeds[0], wheel, tire.radius_m) if speeds else None
    if measured and (problem := doubt_of_vehicle(recording, speeds[0], measured[0])):
        raise problem
    if tire.rolling_radius_m is not None:
        return tire.rolling_radius_m, float("nan"), wheel.remarks
    if measured:
        said = (
            f"rolling radius {measured[0]:.5f} +- {measured[1]:.5f} m, calibrated against "
            f"{speeds[0].name}"
        )
        return *measured, (*wheel.remarks, said)
    said = (
        f"no rolling radius and no vehicle speed: the unloaded radius {tire.radius_m:.4f} m is used"
    )
    return tire.radius_m, float("nan"), (*wheel.remarks, said)


def _radius_of_turns(
    speed: Channel, wheel: WheelAngle, radius_m: float
) -> tuple[float, float] | None:
    """(radius, standard error) [m] from the turns that roll freely, else the median of all.

    `radius_m` is the radius for their accelerations. None if the wheel never rolls.
    """
    found = rolling(speed, turns_of(wheel, radius_m)[1])
    if np.isfinite(found.mean_radius_m[0]):
        return found.mean_radius_m
    radii = found.rows["metres"][np.isfinite(found.rows["metres"])] / (2.0 * np.pi)
    if radii.size < LEAST_TURNS:
        return None
    spread = 1.4826 * float(np.median(np.abs(radii - np.median(radii))))
    return float(np.median(radii)), 1.2533 * spread / np.sqrt(radii.size)


def turns_of(wheel: WheelAngle, radius_m: float) -> tuple[FloatArray, Records]:
    """(times of the middles, the turns) of the wheel, from its first angle on."""
    lowest, highest = (
        float(c) * wheel.angle.unit_rad for c in (wheel.angle.count[0], np.max(wheel.angle.count))
    )
    number = max(int((highest - lowest) / (2 * np.pi)), 0)
    return turns_about(wheel, lowest + np.pi * np.arange(1.0, 2.0 * number, 2.0), radius_m)


def turns_about(
    wheel: WheelAngle, middle_rad: FloatArray, radius_m: float
) -> tuple[FloatArray, Records]:
    """(times of the middles, the turns) about wheel angles, (n,) each.

    Accelerations are those of the durations of a turn's halves.
    """
    start, time, stop = (wheel.angle.time_at(middle_rad + shift) for shift in (-np.pi, 0.0, np.pi))
    with np.errstate(
        divide="ignore", invalid="ignore", over="ignore"
    ):  # half a turn between two equal stamps
        acceleration = (
            radius_m * 2 * np.pi * (1 / (stop - time) - 1 / (time - start)) / (stop - start)
        )
    acceleration = np.where(np.isfinite(acceleration), acceleration, np.nan)
    return time, records(
        TURNS, begin_s=start, end_s=stop, turns=1.0, acceleration_m_s2=acceleration,
        quality=wheel.quality(start, stop),
    )  # fmt: skip


def encoder_of(recording: Recording) -> tuple[Channel, WheelAngle]:
    """The recording's encoder channel and its wheel angle.

    SetupError: the setup has none. DataLoss: what the setup has was lost, or shows no teeth.
    """
    encoders = recording.of_kind("wheel_encoder")
    if not encoders:
        lost = [c for c, own in recording.setup.channels.items() if own.kind == "wheel_encoder"]
        if lost:
            raise DataLoss(
                f"channel {lost[0]} could not be read",
                allowed="the wheel angle needs it",
                do="copy or record the log again",
                file=recording.log,
            )
        raise SetupError(
            "no wheel_encoder channel",
            allowed="the wheel angle needs one",
            do="add it to the setup",
            file=recording.log,
        )
    unit = (
        recording.setup.channels[encoders[0].name].source_unit
        if encoders[0].name in recording.setup.channels
        else "1"
    )
    try:
        speeds = recording.of_kind("vehicle_speed")
        return encoders[0], wheel_angle(encoders[0], unit, speeds[0] if speeds else None)
    except (DataLoss, SetupError) as problem:
        raise problem.at(recording.log) from None
