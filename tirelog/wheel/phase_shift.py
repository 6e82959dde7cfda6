"""P4's regressors: patch width and phase shift at each passage of an accelerometer.

    Recording --wheel angle, fronts--> Passages (one accelerometer of one log) --zero--> phase shift
        --Calibration--> detrended, corrected, forces --columns--> the `phase-shift` table

The phase shift is the wheel angle at the middle of the patch signal minus its value in the zero
stretch. The angle grows in the direction of rolling: later in wheel angle is positive, braking is
negative (P4 section III; errata on the wind-up). "Zero" is a convention (P4 section IV B): the
first low, constant-speed stretch of the log, or what the user names.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import numpy as np

from tirelog.data.plausibility import implausible
from tirelog.data.recording import BLOCK_SAMPLES, Channel, Recording
from tirelog.dsp.filters import (
    UNLIKE_SPEED,
    of_the_log,
    runs,
    sliding_median,
    unlike_neighbours,
    widened,
)
from tirelog.dsp.teeth import crossings, probe
from tirelog.errors import DataLoss, SetupError, UsageError
from tirelog.runs.in_memory import joined_ranges, with_holes, without_spikes
from tirelog.vocabulary.arrays import FloatArray, IntArray, Records, TableRows
from tirelog.vocabulary.quality import (
    Quality,
    QualityFlags,
    Use,
    good,
    having,
    marked,
    quality_column,
)
from tirelog.wheel.angle import (
    SPEED_WINDOW_S,
    WheelAngle,
    encoder_of,
    means_between,
    rolling_radius,
    turns_about,
    turns_of,
)
from tirelog.wheel.fronts import find_fronts, patch_turn
from tirelog.wheel.rolling import off_clock

# ---- What an accelerometer channel has to be cleared of before its fronts are sought.
#
# channel --values held by a radio that has lost its carrier become NaN--> channel
# channel --the log's extremes, if samples pile up there--> limits of the sensor or of the converter


def without_held(channel: Channel, low: float, high: float) -> Channel:
    """The channel with runs of six or more equal samples lost.

    Runs at its limits `low` and `high` stay; as it is if the channel has too little noise to tell.
    """
    starts = np.unique(np.linspace(0, max(channel.size - 4096, 0), 32).astype(np.int64))
    pieces = [channel.read(int(s), int(s) + 4096) for s in starts]
    pieces = [p[(p > low) & (p < high)] for p in pieces]
    shares = [float(np.mean(np.diff(p) == 0)) for p in pieces if p.size > 1]
    # a channel with more equal neighbours than this has no noise to tell by; with twice as many
    # equal ones six of them would happen by chance once in 1e7 samples
    if not shares or np.median(shares) > 0.02:
        return channel
    parts = []
    for start in range(0, channel.size, BLOCK_SAMPLES):
        values = channel.read(start, start + BLOCK_SAMPLES + 1)
        equal = (np.diff(values) == 0) & (values[1:] > low) & (values[1:] < high)
        parts.append(start + np.stack(runs(equal), axis=1))
    ranges = joined_ranges(parts)
    # six equal samples in a row do not happen under noise: with 0.02 of equal neighbours once in
    # 3e8 samples.  Twice as many would take held values of up to 11 samples for measured
    first, stop = ranges[np.diff(ranges)[:, 0] >= 5].T
    return with_holes(channel, first, stop + 1)


def limits(channel: Channel) -> tuple[float, float, float]:
    """(lower limit, upper limit, share of all samples there).

    Infinite if the extreme of the log is not a pile of equal samples.
    """
    ends = np.array([np.inf, -np.inf])
    piles, known = np.zeros(2, np.int64), 0
    for _, block in channel.blocks():
        x = block[np.isfinite(block)]
        further = np.array([x.min(initial=ends[0]), x.max(initial=ends[1])])
        piles[further != ends] = 0
        ends, known = further, known + x.size
        piles += [np.sum(x == end) for end in ends]
    # samples at the extreme of a log that clips, at least; twice as many miss clips of up to eleven
    piled = piles >= 6
    low, high = np.where(piled, ends, [-np.inf, np.inf])
    return float(low), float(high), float(piles[piled].sum() / max(known, 1))


# ---- What makes an encoder or an accelerometer doubtful.
#
# Swapped channels, a wrong number of steps, a wrong sampling rate or unit, saturation.
#
# channels, WheelAngle, Fronts --> sentences on the whole channel, or a SetupError that says what to
# mend


def refuse_swapped(recording: Recording, accelerometer: Channel, encoder: Channel) -> None:
    """SetupError if accelerometer and encoder are swapped.

    The accelerometer's channel swings like an encoder, evenly, and the encoder's does not.
    """
    # times between swings more alike than this (shorter over longer, median) are an encoder's;
    # twice as far from one, 0.4, is still far above the 0.05 of passages and the rest of their
    # turns
    if _evenness(accelerometer) > 0.7 > _evenness(encoder):
        raise SetupError(
            f"{accelerometer.name} swings like an encoder and {encoder.name} does not: the "
            "channels look swapped",
            allowed="an encoder swings evenly, `steps` times a turn",
            do="exchange their sources in the setup",
            file=recording.log,
        )


def _evenness(channel: Channel) -> float:
    """How like each other the times between a channel's swings are, up to 1.

    The shorter over the longer of two neighbours, the median; 0 if it does not swing. A passage of
    the patch and the rest of its turn are 1 to 20.
    """
    found = probe(channel)
    if found.form not in ("sine", "square"):
        return 0.0
    pieces = list(islice(crossings(channel, found), 8))
    steps = np.diff(np.concatenate([piece["index"] for piece in pieces]))
    if steps.size < 20:
        return 0.0
    return float(
        np.median(
            np.minimum(steps[1:], steps[:-1]) / np.maximum(np.maximum(steps[1:], steps[:-1]), 1e-9)
        )
    )


def refuse_steps(recording: Recording, wheel: WheelAngle, turn_rad: float) -> None:
    """SetupError if the patch does not come once per turn, but every `turn_rad` of wheel angle."""
    turns = turn_rad / (2 * np.pi)
    # the patch comes this near to once per turn, as a share; twice as much takes 47 steps for 48
    if not abs(turns - 1) > 0.01:
        return
    steps = wheel.steps * turns
    raise SetupError(
        f"channel {wheel.channel}: the patch comes every {steps:.2f} steps, not every "
        f"{wheel.steps}",
        allowed="the setup's steps must be those of a whole turn",
        do=f"write steps = {round(steps)}",
        file=recording.log,
    )


def refuse_steps_by_patch(recording: Recording, wheel: WheelAngle) -> None:
    """`refuse_steps` by the first accelerometer that shows the patch, for who needs no fronts.

    It reads as much of a log as shows a few passages, most often its first hundred turns.
    """
    for channel in recording.of_kind("radial_acceleration"):
        turn = patch_turn(channel, wheel)
        if np.isfinite(turn):
            refuse_steps(recording, wheel, turn)
            return


def doubts(
    recording: Recording,
    channel: Channel,
    fronts: Records,
    radius_m: float,
    share: float,
) -> list[str]:
    """Sentences on the whole channel.  SetupError: its level is no rotation's."""
    with np.errstate(invalid="ignore", divide="ignore"):
        level_m = float(np.nanmedian(fronts["level_m_s2"] / fronts["rate_rad_s"] ** 2))
    ratio = abs(level_m) / radius_m
    what = (
        f"the level outside the patch is {ratio:.3g} times the centripetal acceleration: a "
        f"sampling rate wrong by a factor {abs(ratio) ** 0.5:.3g}, or a unit by {ratio:.3g}, would "
        "do that"
    )
    do = "check unit and scale, the sampling rate, the steps of the encoder and the radius"
    problem = implausible(recording, "level_to_rotation", ratio, what, channel=channel, do=do)
    if problem is not None and share < 0.01:
        raise problem
    outward = "outward" if level_m < 0 else "inward"
    gravity = "with" if fronts["gravity_m_s2"].any() else "without"
    of_level = f"{outward} positive by its level outside the patch, {gravity} gravity"
    clipped = f"{100 * share:.2g} % of the samples stand at its limits (clipped)"
    said = [clipped, of_level] if share > 1e-4 else [of_level]
    return [f"channel {channel.name}: {one}" for one in said]


#: the zero is sought in stretches below this speed [m/s] (P4: about 10): drag, which moves it, goes
#: with the square; doubled, it is four times as large
LOW_SPEED_M_S = 13.0


@dataclass(frozen=True)
class EdgeTimes:
    """One accelerometer of one log, arrays of shape (n,), NaN if a passage was not found.

    Angles in degrees: `entry_deg`, `exit_deg` within one turn, `width_deg`, `shift_deg` (NaN
    without a zero) and standard errors; `speed_m_s` low-passed at 20 Hz, `acceleration_m_s2` over
    the turn; `quality` flags; `steady` (n,) in a constant-speed stretch; `zero_speed_m_s`
    at which the zero was taken (NaN without one); `forces_N` means of the force channels around the
    passage. `without_zero` says why there is no zero, '' if there is one. `example` (3, m), for
    pictures: angles from the middle of one passage [deg], the signal there in levels outside, and
    its two fronts.
    """

    log: str
    channel: str
    radius_m: float
    driven: bool | None
    time_s: FloatArray
    speed_m_s: FloatArray
    acceleration_m_s2: FloatArray
    entry_deg: FloatArray
    exit_deg: FloatArray
    width_deg: FloatArray
    width_se_deg: FloatArray
    shift_deg: FloatArray
    shift_se_deg: FloatArray
    steady: np.ndarray
    quality: QualityFlags
    zero_speed_m_s: float
    remarks: tuple[str, ...] = ()
    without_zero: str = ""
    forces_N: dict[str, FloatArray] = field(default_factory=dict)
    example: FloatArray = field(default_factory=lambda: np.zeros((3, 0)))

    @property
    def said(self) -> tuple[str, ...]:
        """The remarks, and why there is no zero."""
        return (*self.remarks, self.without_zero) if self.without_zero else self.remarks

    @property
    def good(self) -> np.ndarray:
        """Passages whose fronts are good (they need no zero), shape (n,)."""
        return good(self.quality, Use.FRONTS) & np.isfinite(self.width_deg)


def measure_phase_shift(
    recording: Recording, zero: str = "auto", forces: bool = False
) -> Iterator[EdgeTimes]:
    """The passages of every accelerometer of a log.

    `zero`: 'auto', 'none', a speed in m/s (the first steady stretch within 1.5 m/s of it) or
    'START:STOP' in seconds. DataLoss: the encoder shows no teeth or the accelerometers no patch.
    SetupError: no such channels, swapped channels, a wrong number of steps.
    """
    accelerometers = recording.of_kind("radial_acceleration")
    if not accelerometers:
        raise SetupError(
            "no radial_acceleration channel",
            allowed="phase-shift needs one and a wheel_encoder",
            do="add it to the setup",
            file=recording.log,
        )
    try:
        encoder, wheel = encoder_of(recording)
    except DataLoss:
        for seen in recording.of_kind("wheel_encoder")[:1]:
            refuse_swapped(recording, accelerometers[0], seen)
        raise
    radius_m, _, remarks = rolling_radius(recording, wheel)
    said = [*remarks]
    for channel in accelerometers:
        low, high, share = limits(channel)
        held = without_spikes(without_held(channel, low, high))
        found = find_fronts(held, wheel, radius_m, (low, high))
        if found is None:
            refuse_swapped(recording, channel, encoder)
            raise DataLoss(
                f"channel {channel.name} shows no patch: its signal does not fall below half of "
                "its level once a turn",
                do="check that it is a radial in-tire acceleration and that the wheel turned "
                "faster than 2 m/s",
                file=recording.log,
            )
        fronts, turn_rad = found
        refuse_steps(recording, wheel, turn_rad)
        said += doubts(recording, channel, fronts, radius_m, share)
        yield _passages(recording, channel, wheel, radius_m, fronts, zero, forces, said)
        said = []


def _passages(
    recording: Recording,
    channel: Channel,
    wheel: WheelAngle,
    radius_m: float,
    fronts: Records,
    zero: str,
    forces: bool,
    said: list[str],
) -> EdgeTimes:
    """Fronts as a table's rows."""
    entry, leave = fronts["entry_rad"], fronts["exit_rad"]
    found = np.isfinite(entry) & np.isfinite(leave)
    middle = np.where(found, 0.5 * (entry + leave), fronts["middle_rad"])
    time, turns = turns_about(wheel, middle, radius_m)
    speed = radius_m * wheel.speed_rad_s(time)
    low, high = (
        wheel.angle.time_at(middle + side * (np.radians(15.0) + 0.3)) for side in (-1.0, 1.0)
    )
    quality = (
        fronts["quality"]
        | wheel.quality(np.nan_to_num(low, nan=-1.0), np.nan_to_num(high, nan=np.inf))
        | marked(~found, Quality.LOST_PEAK)
        | marked(off_clock(channel.axis, turns["begin_s"], turns["end_s"]), Quality.IMPLAUSIBLE)
    )
    begin, end = (wheel.angle.time_at(front) for front in (entry, leave))
    quality |= marked(wheel.mended(begin, end), Quality.GAP)
    reading = np.where(found, middle, np.nan)
    turn, moved, strange, unclear = _one_turn(reading, wheel, time, good(quality, Use.FRONTS))
    quality |= marked(strange, Quality.REVERSING) | marked(unclear, Quality.IMPLAUSIBLE)
    width = np.degrees(leave - entry)
    # degrees by which one turn alone may differ from those around, in shift or width
    for column in (turn, width):
        quality |= unlike_neighbours(column, quality, 0.1)
    # of a log most of whose turns contradict each other, those that agree by chance are no better
    doubtful = having(quality, Quality.UNLIKE_NEIGHBOURS | Quality.IMPLAUSIBLE)[found]
    unlike = np.zeros(found.size, bool)
    unlike[found] = of_the_log(doubtful, 0.5) & ~doubtful
    quality |= marked(unlike, Quality.UNLIKE_NEIGHBOURS)
    clean = found & good(quality)
    steady = steady_passages(speed, clean)
    offset, zero_speed = _zero(turn, speed, time, steady, clean, zero)
    if np.isnan(offset):
        quality |= np.uint32(Quality.NO_ZERO)
    if moved:
        said = [
            *said,
            f"channel {wheel.channel}: the tooth count was lost {moved} times; the patch itself "
            "gave the whole teeth back",
        ]
    wanted = f"stretch for --zero {zero}"
    if zero == "auto":
        wanted = f"constant-speed stretch below {LOW_SPEED_M_S:g} m/s"
    without = (
        f"no {wanted} for the zero of the phase shift, which is empty (no_zero); name another with "
        "--zero SPEED or --zero START:STOP, or give the --calibration of a log that has one"
    )
    # what both fronts have in common stays in their middle
    shared = np.sqrt(0.5) * wheel.angle.shared_noise_at(time)
    middle_se = np.degrees(np.hypot(fronts["middle_se_rad"], shared))
    width_se = np.degrees(fronts["width_se_rad"])
    # a road hardly moves the patch from turn to turn; a hum moves it, and its width as much
    wider = widened(turn, middle_se, quality)
    middle_se, width_se = wider, width_se * wider / middle_se
    means = {}
    for force in recording.of_kind("vertical_load", "longitudinal_force") if forces else ():
        # the mean of a turn in which the wheel stood is no passage's
        end = np.where(turns["end_s"] - turns["begin_s"] < 5.0, turns["end_s"], np.nan)
        means[force.kind] = means_between(force, turns["begin_s"], end)
    return EdgeTimes(
        recording.log, channel.name, radius_m, recording.setup.conditions.driven, time,
        speed, turns["acceleration_m_s2"], turn - width / 2, turn + width / 2, width,
        width_se, turn - offset, middle_se,
        steady, quality, zero_speed, tuple(said), without if np.isnan(offset) else "", means,
        _example(channel, wheel, fronts, clean),
    )  # fmt: skip


def _example(channel: Channel, wheel: WheelAngle, fronts: Records, clean: np.ndarray) -> FloatArray:
    """The samples within 45 degrees of one good passage; empty if there is none."""
    rows = np.flatnonzero(clean)
    if rows.size == 0:
        return np.zeros((3, 0))
    row = rows[rows.size // 2]
    entry, leave = fronts["entry_rad"][row], fronts["exit_rad"][row]
    middle = 0.5 * (entry + leave)
    time = wheel.angle.time_at(middle + np.array([-0.8, 0.0, 0.8]))
    first, last = (int(i) for i in channel.axis.index(np.nan_to_num(time))[::2])
    at = channel.axis.time(first, last)
    level = fronts["level_m_s2"][row]
    both = np.degrees(np.resize(np.array([entry - middle, leave - middle]), at.size))
    turned = np.degrees(wheel.angle.at(at) - middle)
    return np.stack([turned, channel.read(first, last) / level, both])


def _one_turn(
    middle: FloatArray, wheel: WheelAngle, time: FloatArray, sound: np.ndarray
) -> tuple[FloatArray, int, np.ndarray, np.ndarray]:
    """(middles within one turn [deg], times that whole teeth were given back, passages, others).

    The passages are those of stretches in which the patch is elsewhere. Before the others either
    the count lost teeth or a force moved the patch.

    After a standstill, a hole or samples that were held, the count may have lost whole teeth; the
    patch's place against the passages before, of which those that are not `sound` (n,) tell
    nothing, gives them back. Where the teeth are even, what a force can move is the patch's.
    If the place of a stretch lies between two teeth the wheel must have rolled the other way.
    """
    tooth = 360.0 / wheel.steps
    known = np.isfinite(middle)
    strange, unclear = np.zeros((2, middle.size), bool)
    if not known.any():
        return middle, 0, strange, unclear
    usual = float(np.angle(np.exp(1j * middle[known]).sum()))
    turn = np.degrees(np.angle(np.exp(1j * (middle - usual))))
    stretch = wheel.angle.stretch_at(time)
    order = np.flatnonzero(known)
    doubtful = np.diff(np.searchsorted(wheel.uneven_s, time[order])) > 0
    # rows that were dropped may take whole teeth with them, and leave the others even
    # hard braking moves the patch by less than this within so many turns [deg]: a move beyond it is
    # of the count.  Twice as much leaves lost teeth of 48 steps in
    most_moved_deg = 3.0
    doubtful |= np.abs(np.diff(turn[order])) > most_moved_deg
    parts = np.split(order, 1 + np.flatnonzero(doubtful))
    lost, shown, moved, doubt, before = 0.0, 0.0, 0, False, np.zeros(0)
    # passages on either side of a place where the count may have lost teeth, whose medians say
    # where the patch is; forces move it less in so many
    beside = 3
    for rows in parts:
        own = rows[sound[rows]]
        if before.size:
            some = own if own.size else rows
            move = float(np.median(turn[some[:beside]]) - np.median(before))
            teeth = round(move / tooth) * tooth
            # what is between two teeth is neither, and a small move may be either
            between = abs(move - teeth) > most_moved_deg
            doubt = between or (teeth != 0.0 and abs(move) <= most_moved_deg)
            lost = lost if doubt else teeth
            if own.size:
                moved += lost != shown
                shown = lost
        turn[rows] -= lost
        unclear[rows] = doubt
        before = before if doubt else np.append(before, turn[own])[-beside:]
    first = float(np.median(turn[order[: 2 * beside]]))
    for number in np.unique(stretch[known]):
        rows = known & (stretch == number)
        # forces do not move the patch's usual place by more than this after a standstill; twice as
        # much leaves moves of up to four degrees unsaid
        strange |= rows & (abs(float(np.median(turn[rows])) - first) > 2.0)
    middle_deg = float(np.median(turn[known]))
    within = np.mod(np.degrees(usual) + middle_deg, 360.0)
    return turn + (within - middle_deg), moved, strange, unclear


def steady_passages(speed: FloatArray, clean: np.ndarray) -> IntArray:
    """Number of the constant-speed stretch of each passage, -1 outside of one.

    From 0 in order of time.
    """
    # steps of a constant speed from passage to passage (P1 section 4); twice the step, or twice the
    # range below, takes gentle braking for a constant speed
    joined = clean[1:] & clean[:-1] & (np.abs(np.diff(speed)) < 0.08)
    stretch, number, first = np.full(speed.size, -1, np.int64), 0, 0
    for stop in range(1, speed.size + 1):
        goes_on = stop < speed.size and joined[stop - 1]
        if goes_on and abs(speed[stop] - speed[first]) < 0.3:
            continue
        if stop - first >= 8:
            stretch[first:stop], number = number, number + 1
        first = stop
    return stretch


def _zero(
    turn: FloatArray,
    speed: FloatArray,
    time: FloatArray,
    steady: IntArray,
    clean: np.ndarray,
    zero: str,
) -> tuple[float, float]:
    """(middle [deg] that counts as zero, speed there), NaN without such a stretch.

    UsageError: `zero` is none of the forms.
    """
    by, low, high = zero_range(zero)
    rows = clean & (time >= low) & (time <= high) & (by == "time")
    for number in range(int(steady.max(initial=-1)) + 1 if by == "speed" else 0):
        one = steady == number
        if low <= float(np.mean(speed[one])) <= high:
            rows = one & clean
            break
    if not rows.any():
        return float("nan"), float("nan")
    return float(np.mean(turn[rows])), float(np.mean(speed[rows]))


def zero_range(zero: str) -> tuple[str, float, float]:
    """('speed', 'time' or 'none', from, to) in which the zero lies, by what was asked for.

    UsageError: `zero` is none of the forms that `measure_phase_shift` takes.
    """
    if zero in ("auto", "none"):
        return ("speed" if zero == "auto" else "none"), 0.0, LOW_SPEED_M_S
    try:
        numbers = [float(text) for text in zero.split(":", 1)]
        if not all(map(math.isfinite, numbers)):
            raise ValueError
    except ValueError:
        raise UsageError(
            f"--zero {zero}",
            allowed="allowed are auto, none, a speed in m/s, or START:STOP in seconds",
            do="e.g. --zero 10 or --zero 2:8",
        ) from None
    if len(numbers) == 2:
        return "time", numbers[0], numbers[1]
    return "speed", numbers[0] - 1.5, numbers[0] + 1.5


# ---- The table `wheel-angle`: the encoder's signal, the wheel's speed and its angle (P4 Figs. 4
# to 6).
#
# encoder samples of a stretch --wheel angle--> angle within the turn, v_c = r omega at 20 Hz


def wheel_angle_of(
    recording: Recording,
    start: float | None = None,
    stop: float | None = None,
    every: int | None = None,
) -> Iterator[TableRows]:
    """The wheel's angle at each sample of the encoder, or each `every`-th, of a stretch [s].

    By default 0.1 s from the middle of the log on.  SetupError: no encoder, or
    an accelerometer's patch shows that it has other steps.  DataLoss: no teeth.
    UsageError: no sample lies there, or too many do.
    """
    channel, wheel = encoder_of(recording)
    refuse_steps_by_patch(recording, wheel)
    radius_m, _, remarks = rolling_radius(recording, wheel)
    ends = channel.axis.at(0.0), channel.axis.at(float(channel.size - 1))
    middle = 0.5 * (float(ends[0]) + float(ends[1]))
    # seconds that are written if none are asked for: P4 Fig. 4 shows 100 ms; the table is as long
    # as that
    stretch_s = 0.1
    start = start if start is not None else (middle if stop is None else stop - stretch_s)
    stop = stop if stop is not None else start + stretch_s
    first, last = (
        int(np.clip(np.ceil(float(channel.axis.index(time))), 0, channel.size))
        for time in (start, stop)
    )
    step = 1 if every is None else every
    rows = len(range(first, last, step)) if step > 0 else 0
    # rows of one table: a minute of 10 kHz; twice as many take twice the memory, some 100 MB
    most_rows = 600_000
    if not 0 < rows <= most_rows:
        raise UsageError(
            f"{start:g} to {stop:g} s hold {rows} samples",
            allowed=f"1 to {most_rows} are allowed; the log goes from {float(ends[0]):g} to "
            f"{float(ends[1]):g} s",
            do="give another --from and --to, or --every 10",
            file=recording.log,
        )
    time = channel.axis.time(first, last)[::step]
    angle = wheel.angle.at(time)
    columns = {
        "log": recording.log,
        "channel": channel.name,
        "revolution": np.floor(np.nan_to_num(angle) / (2.0 * np.pi)).astype(np.int64),
        "time_s": time,
        "speed_m_s": wheel.speed_rad_s(time) * radius_m,
        "encoder_signal": channel.read(first, last)[::step],
        "turned_deg": np.degrees(angle) % 360.0,
        "quality": quality_column(
            # before the first tooth and behind the last there is no angle
            wheel.quality(time, time) | marked(np.isnan(angle), Quality.EDGE_OF_LOG)
        ),
    }
    yield TableRows(columns, remarks)


# ---- The `speed` table of a log whose encoder tells the speed: one row per turn of the wheel.
#
# Recording --wheel angle, an accelerometer's patch doubts its steps--> columns of the table


def encoder_speed(recording: Recording) -> tuple[Mapping[str, Any], Records, tuple[str, ...]]:
    """(columns of the `speed` table, the turns, remarks): one row per turn of the wheel.

    For a log without a sensor that passes the patch.

    `time_s` is the middle of the turn, `speed_m_s` the wheel's speed low-passed at 20 Hz.
    `period_s` is the turn's duration; its two halves give `acceleration_m_s2`. The
    standard error holds angle noise and the radius' error. SetupError: an accelerometer's patch
    shows that the setup's steps are not those of a turn.
    """
    channel, wheel = encoder_of(recording)
    refuse_steps_by_patch(recording, wheel)
    radius_m, radius_se_m, remarks = rolling_radius(recording, wheel)
    time, turns = turns_of(wheel, radius_m)
    off = off_clock(channel.axis, turns["begin_s"], turns["end_s"])
    turns["quality"] |= marked(off, Quality.IMPLAUSIBLE)
    mended = wheel.mended(time - 0.5 * SPEED_WINDOW_S, time + 0.5 * SPEED_WINDOW_S)
    rate = wheel.speed_rad_s(time)
    noise = np.sqrt(2.0) * wheel.angle.noise_at(time) / SPEED_WINDOW_S
    share = np.hypot(np.nan_to_num(radius_se_m) / radius_m, channel.axis.rate_error)
    speed, period = rate * radius_m, turns["end_s"] - turns["begin_s"]
    unlike = unlike_neighbours(speed, turns["quality"], UNLIKE_SPEED * np.abs(speed))
    # a tooth that is lost or added in a turn moves the turn's mean from the speed at its middle; so
    # does an acceleration that changes there, by up to an eighth of the change times the period
    allowed = 0.01 + 0.25 * sliding_median(
        np.abs(turns["acceleration_m_s2"]), min(5, time.size)
    ) * period / np.maximum(np.abs(speed), 1e-3)
    contradicted = np.abs(np.abs(rate) * period / (2.0 * np.pi) - 1.0) > allowed
    columns = {
        "log": recording.log,
        "channel": channel.name,
        "revolution": np.arange(time.size),
        "time_s": time,
        "speed_m_s": speed,
        "period_s": period,
        "speed_se_m_s": np.hypot(noise * radius_m, share * speed),
        "acceleration_m_s2": turns["acceleration_m_s2"],
        "quality": quality_column(
            turns["quality"]
            | unlike
            | marked(mended, Quality.GAP)
            | marked(contradicted, Quality.IMPLAUSIBLE)
        ),
    }
    return columns, turns, remarks
