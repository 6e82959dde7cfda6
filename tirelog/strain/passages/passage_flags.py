"""What was wrong around each passage.

Words for its window, passages that were lost, breaks between passages.

A row has a word only if the trouble lies inside the row's own window (half a patch and its
shoulders on either side).
"""

from __future__ import annotations

import numpy as np

from tirelog.data.recording import Channel, TimeAxis
from tirelog.dsp.filters import of_the_log
from tirelog.vocabulary.arrays import BoolArray, FloatArray, IntArray, Records, records
from tirelog.vocabulary.quality import Quality, QualityFlags, having, marked

# ---- How fast the wheel turns at each passage.
#
# From the times of the passages alone, with an error that holds the differencing.
#
#     times and their errors (n,), turns to the next passage (n,)
#         --parabolas through three passages--> omega, alpha, standard error (n,)
#
# The second-order centred difference over two turns (P1 4, P2 4.2, errata) in its form for unequal
# steps is exact for a constant acceleration. What a change of acceleration leaves, one twelfth of
# the
# period times the change over two turns, is subtracted as far as it exceeds the noise; what a
# smooth curve through the accelerations around does not foretell goes into the standard error.


#: radians of a turn
TURN_RAD = 2 * np.pi
#: a change of acceleration counts beyond this many times its noise variance: noise does that once
#: in 22; doubled, once in 210
SIGNIFICANT = 4.0
#: passages on either side whose accelerations tell how it changes, and the degree of their curve;
#: twice as far tells it better at a steady pace, and rounds off the beginning of a braking
REACH, DEGREE = 3, 3
#: standard deviation of the jerk if nothing tells it: the acceleration itself, gained or lost over
#: this many turns; twice as many halve the jerk and with it what is added to the error
BLIND_TURNS = 2.0


#: a passage's wheel speed with standard error, wheel acceleration, and neighbours on how many sides
#: these are known: 2 centred, 1 extrapolated from the next, 0 none (NaN)
KINEMATICS = np.dtype(
    [("omega_rad_s", "f8"), ("omega_se_rad_s", "f8"), ("alpha_rad_s2", "f8"), ("sides", "i8")]
)


def turns_between(time_s: FloatArray, omega: FloatArray) -> FloatArray:
    """Turns from each passage to the next by the mean of the speeds at both, shape (n - 1,)."""
    return np.diff(time_s) * 0.5 * (omega[1:] + omega[:-1]) / TURN_RAD


def may_have_stopped(time_s: FloatArray) -> BoolArray:
    """Whether the wheel may have come to rest between each passage and the next, (n - 1,).

    The next is one turn or less away. The deceleration of the two turns before and the acceleration
    of the two turns after, carried on, meet at rest in the time between.
    """
    period = np.diff(time_s)
    stop = np.zeros(period.size, bool)
    # at the passage two turns on: change of the speed over a turn, and how long it has to fall to
    # nothing at that rate
    with np.errstate(
        divide="ignore", invalid="ignore", over="ignore"
    ):  # stamps that repeat have no period
        speed = TURN_RAD / period
        rate = (speed[:-1] - speed[1:]) / (0.5 * (period[:-1] + period[1:]))
        down = (speed[1:] - 0.5 * rate * period[1:]) / rate
        up = (speed[:-1] + 0.5 * rate * period[:-1]) / -rate
        # a wheel may have stopped if it would have needed up to so many times the time between: the
        # brake came late in the turns before; twice as much doubts more gaps between turns
        soon = down[:-3] + up[3:] < 3.0 * period[2:-2]  # a steady speed never falls to 0
    stop[2:-2] = (rate[:-3] > 0) & (rate[3:] < 0) & soon
    return stop


def _residual() -> tuple[FloatArray, float]:
    """Projection of accelerations on what their curve leaves, and the residual variance.

    The variance is what white passage times make of it. Accelerations are second differences of the
    times: 1, -2, 1.
    """
    count = 2 * REACH + 1
    second = np.diff(np.eye(count + 2), 2, axis=0)
    curve = np.vander((np.arange(count) - REACH) / REACH, DEGREE + 1)
    project = np.eye(count) - curve @ np.linalg.pinv(curve)
    return project, float(np.trace(project @ second @ second.T) / (count - DEGREE - 1))


RESIDUAL, RESIDUAL_NOISE = _residual()


def kinematics(time_s: FloatArray, time_se_s: FloatArray, turns_after: FloatArray) -> Records:
    """Speeds at the passages.

    `turns_after` (n,): whole turns to the next passage, 0 if that is not known (and for the
    last).
    """
    n = time_s.size
    linked = turns_after > 0
    after = np.where(linked, np.diff(time_s, append=np.nan), np.nan)
    before = np.append(np.nan, after)[:n]
    mean_after = TURN_RAD * turns_after / after
    mean_before = np.append(np.nan, mean_after)[:n]
    omega = (mean_before * after + mean_after * before) / (before + after)
    alpha = 2 * (mean_after - mean_before) / (before + after)
    centred = np.isfinite(omega)
    period = 0.5 * (before + after)
    omega, omega_se = _corrected(omega, alpha, period, time_se_s)
    sides = np.where(centred, 2, 0)
    for step in (1, -1):
        _one_sided(step, time_s, time_se_s, linked, omega, omega_se, alpha, sides)
    return records(
        KINEMATICS, omega_rad_s=omega, omega_se_rad_s=omega_se, alpha_rad_s2=alpha, sides=sides
    )


def _near(values: FloatArray, offset: int) -> FloatArray:
    """`values` of the passage `offset` later, NaN beyond the ends."""
    padded = np.pad(values, REACH, constant_values=np.nan)
    return padded[REACH + offset : REACH + offset + values.size]


def _corrected(
    omega: FloatArray, alpha: FloatArray, period: FloatArray, time_se_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Speeds freed of the differencing error if that is known, and their standard errors."""
    acceleration_noise = omega * time_se_s / period**2
    change = _near(alpha, 1) - _near(alpha, -1)
    # white times: (1, -2, 0, 2, -1)
    noise_square = np.maximum(10.0 * acceleration_noise**2, np.finfo(np.float64).tiny)
    beside = np.array([_near(change, k) for k in (-1, 0, 1)])
    squares, finite = np.nan_to_num(beside) ** 2, np.isfinite(beside)
    with np.errstate(over="ignore"):  # times without any error tell every change
        level = squares.sum(0) / np.maximum(finite.sum(0), 1) / noise_square
    share = np.where(
        np.isfinite(change), np.clip(1.0 - SIGNIFICANT / np.maximum(level, 1e-9), 0.0, 1.0), 0.0
    )
    smooth = share * np.nan_to_num(change) * period / 12.0
    inner, outer = 0.5 + share / 6.0, share / 12.0
    noise = inner**2 * (_near(time_se_s, 1) ** 2 + _near(time_se_s, -1) ** 2)
    noise = noise + outer**2 * np.nan_to_num(_near(time_se_s, 2) ** 2 + _near(time_se_s, -2) ** 2)
    scatter = _scatter(alpha, acceleration_noise)
    # of a kink beside the passage the difference is up to twice that of a smooth change
    # scatter of the accelerations beyond the noise, times period, to the error of the speed: a kink
    # at random places between passages; that part of the error is proportional to it
    error = np.sqrt(noise * (omega / period) ** 2 + (0.8 * scatter * period) ** 2 + smooth**2)
    return omega - smooth, error


def _scatter(alpha: FloatArray, noise: FloatArray) -> FloatArray:
    """Standard deviation of the accelerations about a smooth curve [rad/s^2].

    The curve goes through those around; beyond the noise. If the stretch is too short for a curve:
    half of the change to the next.
    """
    around = np.array([_near(alpha, k) for k in range(-REACH, REACH + 1)])
    square = ((RESIDUAL @ around) ** 2).sum(0) / (2 * REACH - DEGREE)
    beyond = square - SIGNIFICANT * RESIDUAL_NOISE * noise**2
    scatter = np.where(
        beyond > 0, np.sqrt(np.maximum(square - RESIDUAL_NOISE * noise**2, 0.0)), 0.0
    )
    steps = np.array([np.abs(_near(alpha, k) - alpha) for k in (-1, 1)])
    step = np.where(np.isfinite(steps), steps, 0.0).max(0)
    alone = ~np.isfinite(steps).any(0)
    step = np.where(
        alone,
        np.abs(alpha) / BLIND_TURNS,
        np.where(step > 3.0 * np.sqrt(20.0) * noise, 0.5 * step, 0.0),
    )
    return np.where(np.isfinite(square), scatter, step)


def _one_sided(
    step: int,
    time_s: FloatArray,
    time_se_s: FloatArray,
    linked: BoolArray,
    omega: FloatArray,
    omega_se: FloatArray,
    alpha: FloatArray,
    sides: IntArray,
) -> None:
    """Fill the passages at the ends of a stretch, in place.

    From the parabola of their neighbour `step` later.
    """
    n = time_s.size
    rows = np.flatnonzero(sides == 0)
    rows = rows[(rows + step >= 0) & (rows + step < n)]
    rows = rows[linked[rows if step > 0 else rows - 1] & (sides[rows + step] == 2)]
    near = rows + step
    elapsed = time_s[rows] - time_s[near]
    omega[rows] = omega[near] + alpha[near] * elapsed
    beyond = near + step
    known = (beyond >= 0) & (beyond < n)
    beyond = np.clip(beyond, 0, n - 1)
    known &= sides[beyond] == 2
    change = np.where(known, np.abs(alpha[beyond] - alpha[near]), np.abs(alpha[near]) / BLIND_TURNS)
    noise = 2.1 * omega[near] * time_se_s[near] / np.abs(elapsed)
    # share of the acceleration that may have changed beyond the last passage without a trace; that
    # part of the error is proportional to it
    blind = (change / 3.0) ** 2 + (0.05 * alpha[near]) ** 2
    omega_se[rows] = np.sqrt(noise**2 + blind * elapsed**2 + omega_se[near] ** 2)
    alpha[rows] = alpha[near]
    sides[rows] = 1


#: at most this many passages in a row are put in as lost; twice as many number turns by a speed
#: that may have changed over as many
MOST_LOST = 4
#: share of a window's samples that must be lost before a passage counts as lost there; twice as
#: much asks for most of a window, and passages lost by a third of it stay uncounted
LOST_SHARE = 0.3


def window_quality(
    channel: Channel, found: Records, index: FloatArray, reach: FloatArray
) -> QualityFlags:
    """Quality words of each row's window, which lies within `reach` [samples] of `index`; (n,)."""
    flags = (
        marked(found["holds_lost"], Quality.LOST_PEAK)
        | marked(found["holds_spike"], Quality.SPIKE)
        | marked(found["holds_clipped"], Quality.CLIPPED)
        | marked(found["outside"], Quality.EDGE_OF_LOG)
    )
    flags |= marked(in_gap(channel.axis, index, reach), Quality.GAP)
    for word in {word for _, _, word in channel.flags}:
        flags |= marked(doubted(channel, word, index - reach, index + reach), word)
    # share of the passages that hold clipped samples from which all do: passages are alike, and
    # noise that came on after the limit hides it in some
    clipped = of_the_log(having(flags, Quality.CLIPPED), 0.3)
    return np.asarray(flags | marked(clipped, Quality.CLIPPED))


def in_gap(axis: TimeAxis, index: FloatArray, reach: FloatArray, longer: float = 0.0) -> BoolArray:
    """Whether the recording has a gap within `reach` [samples] of each `index`, (n,).

    `longer` than so many samples; 0 takes every gap.
    """
    gaps = np.asarray(axis.first[1:], float) - 0.5
    if longer > 0.0:
        gaps = gaps[axis.missing[1:] > longer]
    return _touched(index - reach, index + reach, gaps, gaps)


def doubted(channel: Channel, word: Quality, begin: FloatArray, end: FloatArray) -> BoolArray:
    """Which stretches [begin, end] (n,) [samples] of `channel` hold samples with the `word`."""
    ranges = [(a, b - 1) for a, b, own in channel.flags if own == word]
    return _touched(begin, end, *np.array(ranges, float).reshape(-1, 2).T)


def _touched(begin: FloatArray, end: FloatArray, low: FloatArray, high: FloatArray) -> BoolArray:
    """Which windows [begin, end] (n,) share a place with one of the ranges [low, high] (m,)."""
    order = np.argsort(low)
    furthest = np.append(np.maximum.accumulate(high[order]), -np.inf)
    # of the ranges that begin before a window ends, the one that ends last decides
    before = np.searchsorted(low[order], end, side="right")
    return np.asarray((before > 0) & (furthest[before - 1] >= begin))


def too_fast_to_stop(omega: FloatArray, radius_m: float) -> BoolArray:
    """Whether a wheel of these speeds cannot stop within a turn, (n,)."""
    # deceleration [m/s^2] at which a wheel that rolls on may stop within a turn (a car's: from 7.8
    # m/s), half as much again as a dry road allows; faster ones did not stop between two passages.
    # Twice as much takes for a stop what was not found at 11 m/s
    return np.asarray(radius_m * omega > np.sqrt(2.0 * 16.0 * TURN_RAD * radius_m))


def stood_between(of_turns: FloatArray, own: FloatArray, rolled: BoolArray) -> BoolArray:
    """Whether the wheel may have stood between passages that seem to be one turn apart, (n,).

    The speed `of_turns` is then not the passage's `own`, by the stretch of its pulse, or neither
    can be known; NaN: not known. A wheel that is too fast for it `rolled` on (n,).
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.log(of_turns / own)
    known = np.isfinite(share)
    if known.sum() < 5:
        return ~rolled
    slow = known & ~rolled
    some = slow if slow.sum() >= 5 else known
    off = np.abs(share - np.median(share[some]))
    # usual difference of the two from which a log's slow turns are no turns at all; of drives in
    # town it is 0.01
    uneven = np.median(off[some]) > 0.06
    # both go together within this (logarithm), which no load makes of a patch; half of it marks
    # kerbs, twice as much leaves speeds half as large as they are
    return np.asarray(~rolled & (uneven | (off > 0.25)))


def whole_turns(time_s: FloatArray, linked: BoolArray, rolled: BoolArray) -> IntArray:
    """Whole turns from each passage to the next, as the turns around tell; 0 if they do not.

    The wheel `rolled` on (n - 1,). Its speed is between those of the nearest pairs before and after
    that are `linked` (n - 1,): one turn apart.
    """
    period = np.diff(time_s)
    known = np.append(np.flatnonzero(linked), -1)
    pair = np.arange(period.size)
    before = known[np.searchsorted(known[:-1], pair) - 1]
    after = known[np.searchsorted(known[:-1], pair, side="right")]
    sides = np.where([before >= 0, after >= 0], period[[before, after]], np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):  # stamps that repeat have no period
        turns = period / sides.mean(axis=0)
    whole = np.rint(turns)
    # turns that a time may be off whole ones, by the turns before and after, which may differ by
    # this ratio.  Twice as much takes any time for whole turns; of twice the ratio, turns at either
    # end of a hard braking tell nothing of those in between
    sure = rolled & (np.abs(turns - whole) < 0.25) & (whole <= MOST_LOST + 1)
    sure &= sides.max(axis=0) < 1.5 * sides.min(axis=0)
    return np.where(sure, whole, 0.0).astype(np.int64)


def lost_between(
    channel: Channel, time_s: FloatArray, omega: FloatArray, turns: FloatArray, window_rad: float
) -> IntArray:
    """Passages that lie in lost samples between each passage and the next, shape (n - 1,).

    `turns` (n - 1,) as the speeds give them. Two to MOST_LOST + 1 turns count, if the samples are
    lost or missing around every place of such a passage.
    """
    whole = np.rint(turns)
    lost = np.zeros(turns.size, np.int64)
    likely = np.flatnonzero(
        (whole >= 2) & (whole <= MOST_LOST + 1) & (np.abs(turns - whole) < 0.15 * whole)
    )
    for k in likely:
        count = int(whole[k]) - 1
        share = np.arange(1, count + 1) / (count + 1)
        ends = time_s[k], time_s[k + 1], omega[k], omega[k + 1]
        times = between(*ends, whole[k], share)
        reach = window_rad / omega[k]
        if all(_lost_share(channel, t - reach, t + reach) > LOST_SHARE for t in times):
            lost[k] = count
    return lost


def _lost_share(channel: Channel, begin_s: float, end_s: float) -> float:
    """Share of the samples between two times that are lost, or missing in a gap."""
    low, high = round(float(channel.axis.index(begin_s))), round(float(channel.axis.index(end_s)))
    expected = float(high - low)
    if channel.axis.explicit is None:
        expected = max(expected, (end_s - begin_s) * channel.axis.rate_Hz)
    return 1.0 - np.count_nonzero(np.isfinite(channel.read(low, high + 1))) / (expected + 1.0)


def between(
    t0: FloatArray, t1: FloatArray, omega0: FloatArray, omega1: FloatArray, turns: IntArray,
    share: FloatArray,
) -> FloatArray:  # fmt: skip
    """Times of passages between two, which are so many `turns` apart; broadcasts.

    By the cubic of time over angle with the speeds at both ends; `share` of the angle between.
    """
    u, angle = share, turns * TURN_RAD
    return np.asarray(
        t0 * (1 + 2 * u) * (1 - u) ** 2
        + t1 * u**2 * (3 - 2 * u)
        + angle * (u * (1 - u) ** 2 / omega0 - u**2 * (1 - u) / omega1)
    )


def breaks(
    channel: Channel,
    index: FloatArray,
    turns: FloatArray,
    shortest_s: FloatArray,
    linked: BoolArray,
    turned: BoolArray,
    rolled: BoolArray,
    untimed: BoolArray,
) -> QualityFlags:
    """Why a passage and the next are not known to be one turn apart, shape (n,).

    No word if they are, and for the last. Else one of

    gap         LOST_SHARE of `shortest_s`, so a passage may lie in it, or `untimed`: clock set back
    lost_peak   the wheel `rolled` on, and passages between were not found
    reversing   it came back before a turn was done, or passed the other way round: `turned`
    standstill  the wheel took longer than its speeds allow
    """
    apart = ~linked[:-1]
    missing_s = np.diff(channel.axis.missing_before(index)) / channel.axis.rate_Hz
    gap = untimed | (missing_s > LOST_SHARE * shortest_s)
    still = (turns > 1) & ~turned
    why = np.select(
        [~apart, gap, rolled & ~turned, still],
        [0, Quality.GAP, Quality.LOST_PEAK, Quality.STANDSTILL],
        Quality.REVERSING,
    )
    return np.append(why, 0).astype(np.uint32)[: index.size]
