"""Rolling radius and delay of the vehicle's speed, from the turns of a wheel.

    vehicle_speed --Odometer--> distance at any time
        --turns of the wheel--> metres per turn
        --least squares--> delay of the vehicle's speed, metres per turn without it
        --turns of free rolling--> rolling radius

A vehicle's speed comes late: GPS and CAN filter, hold and pass on. A delay d adds to the distance
of a turn -d times the change of speed in it, a share of -d a / v. Slip is a share that follows the
force, so the acceleration a, at every speed. Over a range of speeds both differ, and the delay is
found beside any slip that follows the acceleration; where they do not, the delay's error says so.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tirelog.data.recording import BLOCK_SAMPLES, Channel, TimeAxis
from tirelog.dsp.filters import of_the_log
from tirelog.vocabulary.arrays import BoolArray, FloatArray, Records, records

#: acceleration up to which a turn rolls freely [m/s^2]: at a tire's usual 0.1 of slip per g that is
#: 0.002; doubled, twice as much of it goes into the radius
FREE_M_S2 = 0.2
#: turns of free rolling that tell a radius; twice as many tell the scatter to 16 instead of 23 %
LEAST_TURNS = 10
#: what is thought of a delay before the log is read, standard deviation about 0 [s]: GPS and CAN
#: stay below one second. Doubled, logs that do not tell it have twice the error
_DELAY_S = 1.0
#: the same of a belt that grows at 25 m/s, share of the radius: tires grow by less than 1 %.
#: Doubled, logs with little cruising tell the delay less well
_GROWTH, _GROWTH_M_S = 0.01, 25.0
#: scatters that a turn may lie off its neighbours before its own error is larger than others' (a
#: reference that jumps, a corner of the speed), and off the radius before it is left out (a turn
#: over a border of manoeuvres rolls freely for a part of it only); half as many do so by chance to
#: one row of seven
_OUTLYING = 3.0
#: error of a turn's distance that no row goes below, as a share: 2 um per turn; mere numerics
_LEAST_SHARE = 1e-6


@dataclass(frozen=True)
class Odometer:
    """Distance that the vehicle's speed sums up to, at knots of shape (k,).

    `time_s`, `distance_m`, `speed_m_s`; `hole`: number of holes in the samples before; `changes`:
    changes of the reading before. `step_m_s`: the smallest of them, 0 if there is none; `dense`:
    every sample is a knot, and the speed between them a straight line.
    """

    time_s: FloatArray
    distance_m: FloatArray
    speed_m_s: FloatArray
    hole: FloatArray
    changes: FloatArray
    step_m_s: float
    dense: bool

    @classmethod
    def of(cls, speed: Channel) -> Odometer:
        """That of a vehicle's speed [m/s].

        A reading that is held belongs to the middle of its hold, from which a delay of half a hold
        follows that `rolling` finds.
        """
        hold, step = _hold(speed)
        # spacing of the odometer's knots [s], if samples are closer: at 3 m/s^2 between two of them
        # the speed is straight to 4 mm/s; twice as much halves the memory
        apart = max(int(0.005 * speed.axis.rate_Hz), 1)
        longest = 5.0 / speed.axis.rate_Hz
        parts, tail = [np.zeros((5, 0))], np.zeros(3)
        for time, value in _samples(speed):
            span, change = np.diff(time), np.diff(value)
            rows = np.zeros((5, time.size))
            rows[0], rows[1] = time, value
            rows[2, 1:] = np.cumsum(0.5 * (value[1:] + value[:-1]) * span)
            rows[3, 1:] = np.cumsum(span > longest)
            rows[4, 1:] = np.cumsum(change != 0.0)
            rows[2:] += tail[:, None]
            border = np.flatnonzero((span > longest) | ((hold > 1) & (change != 0.0)))
            kept = np.zeros(time.size, bool)
            kept[:: time.size if hold > 1 else apart] = True
            kept[border] = kept[border + 1] = kept[-1] = True
            kept[0] = not tail.any()
            parts.append(rows[:, kept])
            tail = rows[2:, -1]
        table = np.concatenate(parts, axis=1)
        if table.shape[1] < 2:
            table = np.full((5, 2), np.nan)
        elif hold > 1:
            table = _held(table, 0.5 * (hold - 1) / speed.axis.rate_Hz)
        time, value, distance, hole, changes = table
        return cls(time, distance, value, hole, changes, step, hold > 1 or apart == 1)

    def at(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(distance [m], number of holes before) at times of shape (n,).

        NaN outside of the channel and in its holes. Between two times with another number of holes
        samples are missing, and their distance is not known.
        """
        low = np.clip(
            np.searchsorted(self.time_s, time_s, side="right") - 1, 0, self.time_s.size - 2
        )
        step = np.maximum(self.time_s[low + 1] - self.time_s[low], np.finfo(float).tiny)
        rise = time_s - self.time_s[low]
        mean = (self.distance_m[low + 1] - self.distance_m[low]) / step
        bend = (self.speed_m_s[low + 1] - self.speed_m_s[low]) / step if self.dense else 0.0
        distance = self.distance_m[low] + mean * rise + 0.5 * bend * rise * (rise - step)
        inside = (time_s >= self.time_s[0]) & (time_s <= self.time_s[-1])
        inside &= self.hole[low] == self.hole[low + 1]
        return np.where(inside, distance, np.nan), self.hole[low]

    def between(self, begin_s: FloatArray, end_s: FloatArray) -> FloatArray:
        """Distance [m] from one time to another, (n,); NaN if samples are missing."""
        first, last = self.at(begin_s), self.at(end_s)
        return np.where(first[1] == last[1], last[0] - first[0], np.nan)

    def bend(self, begin_s: FloatArray, end_s: FloatArray) -> FloatArray:
        """Error [m] of the distance between two times, (n,): the speed is no row of straight lines.

        A line over a time h is off by a twelfth of h^2 for each change of the acceleration.
        """
        step = np.diff(self.time_s)
        with np.errstate(invalid="ignore", divide="ignore"):
            bends = (
                np.diff(np.diff(self.speed_m_s) / step)
                * np.minimum(step[1:], step[:-1]) ** 2
                / 12.0
            )
        bends = np.concatenate([[0.0], np.nan_to_num(bends), [0.0]])
        near = np.maximum(np.abs(bends[1:]), np.abs(bends[:-1]))
        low, high = (
            np.clip(np.searchsorted(self.time_s, at, side="right") - 1, 0, step.size - 1)
            for at in (begin_s, end_s)
        )
        total = np.cumsum(bends)
        square: FloatArray = (total[high] - total[low]) ** 2 + near[low] ** 2 + near[high] ** 2
        return np.asarray(np.sqrt(square))

    def changed(self, time_s: FloatArray) -> FloatArray:
        """Changes of the reading before times of shape (n,)."""
        return np.interp(time_s, self.time_s, self.changes)


def _samples(speed: Channel) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Times and values that are not lost, a block at a time; each begins with the last before."""
    time = value = np.zeros(0)
    for start, values in speed.blocks(BLOCK_SAMPLES):
        good = np.isfinite(values)
        times = np.asarray(speed.axis.time(start, start + values.size))
        time, value = np.append(time[-1:], times[good]), np.append(value[-1:], values[good])
        if time.size > 1:
            yield time, value


def _hold(speed: Channel) -> tuple[int, float]:
    """(samples that a reading is held for, smallest change of the reading)."""
    # longest run that is counted [samples]; mere numerics
    longest_run = 100_000
    counts = np.zeros(longest_run + 1, np.int64)
    smallest, since, seen = np.inf, np.zeros(0, np.int64), 0
    for _, value in _samples(speed):
        change = np.abs(np.diff(value))
        at = np.flatnonzero(change > 0.0)
        smallest = min(smallest, float(change[at].min(initial=np.inf)))
        edges = np.append(since, seen + at)
        counts += np.bincount(np.minimum(np.diff(edges), longest_run), minlength=counts.size)
        since, seen = edges[-1:], seen + change.size
    total = np.cumsum(counts)
    # runs of equal samples that are shorter than the reference's hold, as a share: a few runs are
    # cut by jitter. Doubled, a hold is taken for longer where readings stand still
    hold = int(np.searchsorted(total, 0.1 * total[-1], side="right")) if total[-1] else 1
    return hold, smallest if np.isfinite(smallest) else 0.0


def _held(ends: FloatArray, half_s: float) -> FloatArray:
    """Knots of a held reading from the ends of its runs, (5, k): in the middle of its holds."""
    time, value, _, hole, changes = ends
    first = np.concatenate([[True], (changes[1:] != changes[:-1]) | (hole[1:] != hole[:-1])])
    begins = np.flatnonzero(first)
    stops = np.append(begins[1:], time.size) - 1
    early = np.minimum(time[begins] + half_s, 0.5 * (time[begins] + time[stops]))
    late = np.maximum(time[stops] - half_s, 0.5 * (time[begins] + time[stops]))
    when = np.stack([early, late], axis=1).ravel()
    once = np.concatenate([[True], np.diff(when) > 0.0])
    run = np.repeat(begins, 2)[once]
    when = when[once]
    speed = value[run]
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(when))])
    return np.stack([when, speed, way, hole[run], changes[run]])


#: stretches of whole turns of a wheel: when they begin and end, the `turns` between (0: none is
#: known), the acceleration in it, quality flags
TURNS = np.dtype(
    [("begin_s", "f8"), ("end_s", "f8"), ("turns", "f8"), ("acceleration_m_s2", "f8"),
     ("quality", "u4")]
)  # fmt: skip


def off_clock(axis: TimeAxis, begin_s: FloatArray, end_s: FloatArray) -> BoolArray:
    """Which turns from `begin_s` to `end_s` (n,) lie where the clock runs fast or slow.

    Their samples go on as before, and their times jump. If it is the samples that jump, the
    instrument has changed its rate, and the clock is right.
    """
    known = np.flatnonzero(np.isfinite(begin_s + end_s) & (end_s > begin_s))
    time, off = end_s[known] - begin_s[known], np.zeros(begin_s.size, bool)
    first, last = axis.index(begin_s[known]), axis.index(end_s[known])
    samples = last - first + axis.missing_before(last) - axis.missing_before(first)
    if known.size < LEAST_TURNS:
        return off
    period = time / np.maximum(samples, 1.0)
    # share by which the time from sample to sample over a turn may leave the log's usual one;
    # stamps that jitter by a sample make a tenth of it; half of it and twice as much find the same
    # clocks
    far = np.abs(period / np.median(period) - 1.0) > 0.03
    # beside a change of the clock a turn has some of both: the turns before and after it are held
    # against each other
    at = np.flatnonzero(far[2:] != far[:-2])
    # less the trend of the turns around, at an end of the log on its one side: a wheel that gains
    # speed changes both
    before = np.where(at < 2, np.minimum(at + 2, known.size - 3), at - 2)
    after = np.where(at + 4 < known.size, at + 2, np.maximum(at - 2, 0))
    logs = (np.log(one) for one in (time, np.maximum(samples, 1.0)))
    moves = (one[2:] - one[:-2] for one in logs)
    times, counts = (np.abs(one[at] - 0.5 * (one[before] + one[after])) for one in moves)
    if far.any() and float(np.sum(times)) > float(np.sum(counts)):
        # share of a log's turns beyond which nobody knows which of them have the right clock
        off[known] = of_the_log(far, 0.3)
    return off


#: what the vehicle's speed tells of a turn: `metres` per turn without the delay, and what their
#: errors are made of: `noise` of a row alone, `rounding` of a reading that does not change, which
#: the rows of one `group` share, `se` of both; `turns` of a row, which it shares with its
#: neighbours; how much the speed changes in it, which times the delay's error is what this leaves
#: in all rows together; the radius with its standard error, NaN if fewer than LEAST_TURNS turns
#: roll freely; whether this one does
ROWS = np.dtype(
    [("metres", "f8"), ("noise", "f8"), ("rounding", "f8"), ("se", "f8"), ("group", "i8"),
     ("turns", "f8"), ("change_m_s", "f8"), ("radius_m", "f8"), ("radius_se_m", "f8"),
     ("free", "?")]
)  # fmt: skip


@dataclass(frozen=True)
class Rolling:
    """What the vehicle's speed tells of a wheel: `rows` (n,) of ROWS, a row per stretch of turns.

    `grows`: the radius follows the speed squared; `delay_s` of the vehicle's speed, with its
    standard error.
    """

    rows: Records
    grows: bool
    delay_s: float
    delay_se_s: float

    @property
    def mean_radius_m(self) -> tuple[float, float]:
        """Rolling radius of the free turns, and its standard error, which they share; NaN: none."""
        free = self.rows[self.rows["free"]]
        if not free.size:
            return float("nan"), float("nan")
        return float(np.mean(free["radius_m"])), float(np.mean(free["radius_se_m"]))


def rolling(speed: Channel, wheel: Records) -> Rolling:
    """Rolling radius by the turns (n,) of TURNS of a wheel, and the vehicle's delay."""
    meter, delay = Odometer.of(speed), 0.0
    with np.errstate(invalid="ignore", divide="ignore"):
        lasts = (wheel["end_s"] - wheel["begin_s"]) / wheel["turns"]
    period = np.where(wheel["turns"] > 0, lasts, np.nan)
    for _ in range(20):  # rounds of Gauss and Newton
        rows = _rows(meter, wheel, period, delay)
        step, delay_se = _delay_step(wheel, rows, period, delay)
        delay += step
        if abs(step) < 1e-5:
            break
    rows = _rows(meter, wheel, period, delay)
    rows["free"] = (wheel["quality"] == 0) & np.isfinite(rows["se"]) & np.isfinite(rows["metres"])
    rows["free"] &= np.abs(wheel["acceleration_m_s2"]) < FREE_M_S2
    grows = _fill_radius(rows, period, rows["change_m_s"] * delay_se)
    return Rolling(rows, grows, delay, delay_se)


def _error(rows: Records, share: FloatArray, left: FloatArray) -> float:
    """Standard error of the sum of the `rows` (n,), each with its `share`.

    By their errors, or by what they `left` of a fit if that is more: its own neighbours tell
    whether it comes in waves.
    """
    by_group = np.bincount(rows["group"], share * rows["rounding"])
    told = float(np.sum((share * rows["noise"]) ** 2 * rows["turns"]) + np.sum(by_group**2))
    part, seen = share * left, 0.0
    # rows over which errors may go together; half as many take slow waves of the reference for
    # noise
    waves = 20
    for lag in range(min(waves, part.size)):
        both = float(part[lag:] @ part[: part.size - lag])
        seen += (1.0 if lag == 0 else 2.0 * (1.0 - lag / waves)) * both
    return float(np.sqrt(max(told, seen)))


def _rows(meter: Odometer, wheel: Records, period: FloatArray, delay: float) -> Records:
    """The metres per turn (n,) of ROWS if the vehicle's speed is late by `delay`."""
    begin, end, turns = wheel["begin_s"] + delay, wheel["end_s"] + delay, wheel["turns"]
    with np.errstate(invalid="ignore", divide="ignore"):
        metres = np.where(turns > 0, meter.between(begin, end) / turns, np.nan)
        bend = meter.bend(begin, end) / turns
    metres = np.where(metres > 0.0, metres, np.nan)
    changes = np.nan_to_num(meter.changed(end) - meter.changed(begin))
    noise = np.hypot(_noise(metres, period), bend)
    rounding = meter.step_m_s / np.sqrt(12.0) * period / np.sqrt(1.0 + changes)
    middle = np.floor(np.nan_to_num(meter.changed(0.5 * (begin + end))))
    return records(
        ROWS, metres=metres, noise=noise, rounding=rounding, se=np.hypot(noise, rounding),
        group=np.unique(middle, return_inverse=True)[1], turns=np.maximum(turns, 1.0),
        change_m_s=wheel["acceleration_m_s2"] * period, radius_m=np.nan, radius_se_m=np.nan,
    )  # fmt: skip


def _noise(metres: FloatArray, period: FloatArray) -> FloatArray:
    """Standard error of the metres of each row, from its neighbours two rows to either side.

    That of all rows, as the root of the time that a turn takes, or its own if that is far larger.
    """
    off = np.full(metres.size, np.nan)
    off[2:-2] = (metres[2:-2] - 0.5 * (metres[:-4] + metres[4:])) if metres.size > 4 else np.nan
    off /= np.sqrt(1.5 * period)
    known = np.isfinite(off)
    if not known.any():
        return off
    usual = float(np.median(np.abs(off[known]))) / 0.6745
    square, count = (
        np.convolve(one, np.ones(3), "same")
        for one in (np.where(known, off**2, 0.0), known.astype(float))
    )
    own = np.sqrt(square / np.maximum(count, 1.0))
    return np.where(own > _OUTLYING * usual, own, usual) * np.sqrt(period)


def _delay_step(
    wheel: Records, rows: Records, period: FloatArray, delay: float
) -> tuple[float, float]:
    """(what the delay is more than `delay`, its standard error) [s].

    Least squares of the metres per turn on what a longer belt, slip and a delay make of them.
    """
    used = (wheel["quality"] == 0) & np.isfinite(rows["metres"] + rows["se"] + rows["change_m_s"])
    if used.sum() < LEAST_TURNS:
        return -delay, _DELAY_S
    rows, a = rows[used], wheel["acceleration_m_s2"][used]
    metres, speed = rows["metres"], rows["metres"] / period[used]
    turn = float(np.median(metres))
    drives, brakes = (a > FREE_M_S2).astype(float), (a < -FREE_M_S2).astype(float)
    design = turn * np.stack(
        [np.ones(a.size), (speed / _GROWTH_M_S) ** 2, drives, brakes, drives * a, brakes * a,
         -rows["change_m_s"] / turn], axis=1,
    )  # fmt: skip
    # what is thought of slip: 0 give or take so much, and per acceleration [s^2/m]; a tire's usual
    # is a tenth of either. Doubled, hardly anything moves: it only bounds what a log does not tell
    prior = np.array([0.0, 1 / _GROWTH, *[1 / 0.1] * 2, *[1 / 0.1] * 2, 1 / _DELAY_S])
    weight = 1.0 / np.maximum(rows["se"], _LEAST_SHARE * turn)
    whole = np.concatenate([design * weight[:, None], np.diag(prior)])
    wanted = np.concatenate([metres * weight, np.zeros(6), [-delay / _DELAY_S]])
    inverse = np.linalg.pinv(whole)
    found = inverse @ wanted
    share = inverse[-1, : a.size] * weight
    slips = design[:, 2:6] @ found[2:6]
    # share by which the slip per force may change from a log's lowest speed to its highest: what
    # that looks like is a delay. Doubled, the delay's error beside slip is twice as large
    bent = 0.1 * slips * (speed - speed.mean()) / max(float(np.ptp(speed)), 1e-9)
    error = _error(rows, share, metres - design @ found)
    squares = error**2 + np.sum(inverse[-1, a.size :] ** 2) + (share @ bent) ** 2
    return float(found[-1]), float(np.sqrt(squares))


def _fill_radius(rows: Records, period: FloatArray, delayed: FloatArray) -> bool:
    """Fills the radius of the `rows` (n,) by the free ones, and its error; whether it grows.

    R = a + b V^2 if b is sure, else a.  `delayed`: what the delay's error makes of each row [m].
    """
    turn = 2.0 * np.pi
    square = (rows["metres"] / period / _GROWTH_M_S) ** 2
    for grows in (True, False):
        used = rows["free"].copy()
        for _ in range(2):
            if used.sum() < LEAST_TURNS:
                return False
            least = _LEAST_SHARE * float(np.median(rows["metres"][used]))
            weight = 1.0 / np.maximum(rows["se"][used], least)
            # about the mean, so that the errors of a and b do not go together
            middle = float(np.average(square[used], weights=weight**2))
            at = np.stack([np.ones(rows.size), square - middle], axis=1)[:, : 1 + grows]
            inverse = np.linalg.pinv(at[used] * weight[:, None]) * weight
            found = inverse @ rows["metres"][used]
            left = rows["metres"] - at @ found
            own = [_error(rows[used], share, left[used]) for share in inverse]
            errors = np.hypot(own, inverse @ delayed[used])
            spread = float(np.sqrt(np.average(left[used] ** 2, weights=weight**2)))
            used &= np.abs(left) <= _OUTLYING * np.maximum(spread, rows["se"])
        # standard errors by which a radius must grow with the speed squared; half as many would let
        # one log of twenty bend by chance
        if not grows or found[1] > 4.0 * errors[1] > 0.0:
            break
    rows["radius_m"] = at @ found / turn
    rows["radius_se_m"] = np.sqrt((at * errors) ** 2 @ np.ones(1 + grows)) / turn
    return grows
