"""Fronts of the contact patch in a radial acceleration (P4 section IV B), by its own form.

    pulses (`wheel.pulses`), wheel angle --once a turn--> PASSAGE: rough middle and half width
        --samples beside the patch--> level outside, its slope, gravity
        --samples about the patch in steps from inside to outside, passages laid over--> Form
        --least squares of each passage's shift and stretch--> fronts, a row per passage

The acceleration is Omega^2 (w'' + w - R), outward positive (errata): a level -Omega^2 R all around,
and nothing in the patch, where the tread is straight. A front is where the signal, without
gravity's part, crosses half of the level outside, extrapolated from beside it: a fixed share of the
step at every speed. A fixed threshold in m/s^2 would let the width shrink with speed (errata).

A known form uses the whole flank, from the lobe beside the patch to its middle, and reaches the
Cramer-Rao bound. Fronts lie at the form's half level, moved and stretched as the passage is; where
a passage's form follows speed or acceleration, a regression corrects what it leaves at the half
level. Lobes that grow with the patch move half of the level, and not the flanks' steep part: a
stretch follows that part, and with it the edge of the contact.

The angle is that of an encoder, or of the passages themselves. Angles [rad] grow in the direction
of rolling; everything is worked out for the passages of a piece of the log at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from tirelog.data.recording import Channel
from tirelog.dsp.filters import sliding_median
from tirelog.dsp.pitch import AngleFunction
from tirelog.vocabulary.arrays import BoolArray, FloatArray, IntArray, Records, records
from tirelog.vocabulary.quality import Quality, marked
from tirelog.vocabulary.units import STANDARD_GRAVITY_M_S2
from tirelog.wheel.angle import SPEED_WINDOW_S, WheelAngle
from tirelog.wheel.pulses import decimate, patch_sign, pulses_in, spline, spline_at

#: samples read at once: their columns stay in the cache
PIECE = 1 << 15

#: a passage, NaN where it was not found. What it is looked for by: wheel angle of its middle and
#: half width, rate of the wheel, the vehicle's acceleration, noise of the angle. Then what is
#: filled: level outside, its slope by the angle and standard error for a noise of one, level
#: inside, gravity in the signal; the fronts' angles, standard errors and slopes [steps/rad]; flags
PASSAGE = np.dtype(
    [("middle_rad", "f8"), ("half_rad", "f8"), ("rate_rad_s", "f8"), ("ahead_m_s2", "f8"),
     ("angle_noise_rad", "f8"), ("level_m_s2", "f8"), ("tilt_m_s2", "f8"), ("level_share", "f8"),
     ("inside_m_s2", "f8"), ("gravity_m_s2", "f8"), ("entry_rad", "f8"),
     ("exit_rad", "f8"), ("middle_se_rad", "f8"), ("width_se_rad", "f8"), ("entry_slope", "f8"),
     ("exit_slope", "f8"), ("quality", "u4")]
)  # fmt: skip

# ---- Samples about the passages, and the levels outside and inside.

#: the level is taken from this range beside each front [rad]; half of the first lies in the lobes
#: of the front, twice the second reaches beyond the top of the wheel
BESIDE = np.radians(25.0), np.radians(130.0)


def samples(
    channel: Channel, angle: AngleFunction, rows: Records, reach_rad: FloatArray
) -> Iterator[tuple[IntArray, IntArray, FloatArray, FloatArray]]:
    """(numbers of passages, owner, angle from its middle [rad], value) of samples, by pieces.

    Of those within `reach_rad` (n,) of the middles of the `rows` (n,) of PASSAGE, (s,) each; owners
    count in the numbers. Rows whose samples are strewn over more than a few pieces are left out.
    """
    begin, end = (channel.axis.index(time) for time in _ends(angle, rows, reach_rad))
    # where the angle is not known a window begins at the one before, or ends at the one after
    begin = np.fmax.accumulate(np.append(0.0, begin))[1:]
    end = np.fmin.accumulate(np.append(end, channel.size)[::-1])[::-1][:-1]
    first, last = (np.ceil(one).astype(np.int64) for one in (begin, end))
    sizes, at = np.maximum(last - first, 0), 0
    while at < rows.size:
        start = int(first[at])
        some = np.arange(at, at + max(int(np.searchsorted(first[at:], start + PIECE)), 1))
        at += some.size
        some = some[first[some] + sizes[some] - start <= 4 * PIECE]
        if not sizes[some].any():
            continue
        owner = np.repeat(np.arange(some.size), sizes[some])
        before = np.cumsum(sizes[some]) - sizes[some]
        index = np.arange(owner.size) + (first[some] - before)[owner]
        values = channel.read(start, int(index[-1]) + 1)[index - start]
        turned = angle.at(channel.axis.at(index.astype(np.float64)))
        yield some, owner, turned - rows["middle_rad"][some[owner]], values


def _ends(angle: AngleFunction, rows: Records, reach_rad: FloatArray) -> list[FloatArray]:
    """Times [s] at which windows of `reach_rad` (n,) about the middles begin and end, (n,) each."""
    return [angle.time_at(rows["middle_rad"] + side * reach_rad) for side in (-1.0, 1.0)]


def _beyond_ends(
    channel: Channel, angle: AngleFunction, rows: Records, reach_rad: FloatArray
) -> BoolArray:
    """Which of the `rows` (n,) have a window of `reach_rad` (n,) that the log does not hold."""
    begin, end = _ends(angle, rows, reach_rad)
    first, last = channel.axis.at(np.array([0.0, channel.size - 1.0]))
    return np.asarray(~((begin >= first) & (end <= last)))


def _sums(owner: IntArray, columns: FloatArray, weight: FloatArray, n: int) -> FloatArray:
    """Weighted sums over each owner's samples of products of all `columns` (c, s), (n, c, c)."""
    made = np.empty((n, len(columns), len(columns)))
    for i, column in enumerate(columns):
        for j in range(i + 1):
            made[:, i, j] = made[:, j, i] = np.bincount(owner, weight * column * columns[j], n)
    return made


def fill_levels(channel: Channel, angle: AngleFunction, rows: Records, sign: float) -> None:
    """Fills the levels of the `rows` (n,) of PASSAGE, and gravity if the signal holds it.

    A straight line and cos(phi) by least squares of what lies beside the patch. What goes with
    cos(phi) is gravity as far as it does not follow the squared speed; it counts unless the data
    speak against it. `sign`: of the level outside.
    """
    sums, inside = np.zeros((rows.size, 4, 4)), np.zeros(rows.size)
    for some, owner, phi, values in samples(channel, angle, rows, rows["half_rad"] + BESIDE[1]):
        away = np.abs(phi) - rows["half_rad"][some[owner]]
        there = np.isfinite(values + phi)
        phi, values = np.where(there, phi, 0.0), np.where(there, values, 0.0)
        beside = there & (away > BESIDE[0]) & (away < BESIDE[1])
        columns = np.stack([np.ones(phi.size), phi, np.cos(phi), values])
        sums[some] = _sums(owner, columns, beside, some.size)
        # the level inside is that of a third of the patch, about its middle: beyond it a short
        # patch bends already; doubled, lengths of 70 mm come out 1 % longer
        within = there & (away < -0.65 * rows["half_rad"][some[owner]])
        count = np.bincount(owner, within, some.size)
        with np.errstate(invalid="ignore", divide="ignore"):
            inside[some] = np.bincount(owner, within * values, some.size) / count
    known = sums[:, 0, 0] > 10.0
    sums[~known] = np.eye(4)
    rising = np.linalg.solve(sums[:, :3, :3] + 1e-9 * np.eye(3), sums[:, :3, 3:])[:, 2, 0]
    square = rows["rate_rad_s"] ** 2
    used = known & np.isfinite(rising + square)
    # a speed that hardly changes cannot tell what follows it from gravity
    follows = used.any() and float(np.ptp(square[used])) > 0.2 * float(np.median(square[used]))
    told = np.polyfit(square[used], rising[used], int(follows))[-1] if used.any() else 0.0
    gravity = sign * STANDARD_GRAVITY_M_S2 * (sign * told > 0.3 * STANDARD_GRAVITY_M_S2)
    normal = sums[:, :2, :2] + 1e-9 * np.eye(2)
    lines = np.linalg.solve(normal, sums[:, :2, 3:] - gravity * sums[:, :2, 2:3])[..., 0]
    lines[~known] = np.nan
    rows["level_m_s2"], rows["tilt_m_s2"], rows["gravity_m_s2"] = *lines.T, gravity
    rows["level_share"] = np.sqrt(np.linalg.inv(normal)[:, 0, 0])
    step = inside - gravity - lines[:, 0]
    # a sensor whose level inside is further off zero than that outside does not tell levels (a
    # piezo element): there it is measured. Else it is nothing, which knows it without an error
    coupled = known.any() and np.nanmedian((inside - gravity) / step) > 0.5
    rows["inside_m_s2"] = np.where(coupled, inside - gravity, 0.0)


def _scaled(rows: Records, owner: IntArray, phi: FloatArray, values: FloatArray) -> FloatArray:
    """The signal (s,) at `phi` [rad] from the middles, 0 inside the patch and 1 outside."""
    own = rows[owner]
    gravity, inside = own["gravity_m_s2"], own["inside_m_s2"]
    # the car's acceleration swings with the wheel as gravity does
    ahead = np.sign(gravity) * own["ahead_m_s2"]
    still = values - gravity * np.cos(phi) - ahead * np.sin(phi) - inside
    scaled: FloatArray = still / (own["level_m_s2"] + own["tilt_m_s2"] * phi - inside)
    return scaled


# ---- The form of a passage, and each passage's shift and growth against it.

#: reach of the form in half widths of the patch; twice as far is level and tells nothing
REACH = 2.0
#: passages that the form is learnt from, rounds of that, and steps of each least squares; twice as
#: many of the first tell the form to 0.7 of the noise, of the others take twice as long
LEARNT_FROM, ROUNDS, STEPS = 400, 3, 3
#: passages that tell how the form follows speed and growth; half as many take ringing for it
FEWEST = 40
#: longest step of a shift and of a growth [rad], and how far they lead; twice as long ones could
#: leave the flank
LONGEST, FARTHEST = np.radians(1.0), np.radians(3.0)
#: what is fitted of a passage: shift of the form and growth of each half [rad], their normal matrix
#: (with that of the level), rms of what is left; then of entry and exit: what its samples tell of
#: the front, the share that is lost, mean and slope of what is left there, over the form's own
FITTED = np.dtype(
    [("shift", "f8"), ("growth", "f8"), ("normal", "f8", (3, 3)), ("misfit", "f8"),
     ("told", "f8", 2), ("lost", "f8", 2), ("left", "f8", 2), ("steeper", "f8", 2)]
)  # fmt: skip


@dataclass(frozen=True)
class Form:
    """The mean passage over the angle from its middle, (g,), and where it crosses half its step.

    `angle_rad` even over +-`reach_rad`; `level` is 0 inside and about 1 outside, `slope` [1/rad];
    `fronts_rad` (2,): entry and exit, with the slopes there `steepness` (2,). `change` (g,): how
    the level follows the growth [1/rad]; `lead`: how much farther the steepest places move with it.
    """

    angle_rad: FloatArray
    level: FloatArray
    slope: FloatArray
    reach_rad: float
    fronts_rad: FloatArray
    steepness: FloatArray
    change: FloatArray | float = 0.0
    lead: float = 0.0

    def moved(self, shift: FloatArray, growth: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Angles (s,) on the form of those at `shift` from the middle; what growth moves there.

        Of passages that have grown by `growth` (s,) [rad] on either side.
        """
        # share of the reach about the middle in which the form gives way as the patch grows: flanks
        # and lobes keep their shape; twice as far, it stretches the flanks
        soft = 0.25 * self.reach_rad
        inside = shift / (1.0 + growth / soft)
        u = np.where(np.abs(inside) < soft, inside, shift - np.sign(shift) * growth)
        return u, np.clip(u / soft, -1.0, 1.0)

    def near(self, u: FloatArray, side: int) -> tuple[FloatArray, FloatArray]:
        """(distance from the front of a `side`, in steps, weight of being near it) at `u`."""
        steps = (u - self.fronts_rad[side]) * abs(self.steepness[side])
        return steps, np.clip(1.0 - (2.0 * steps) ** 2, 0.0, 1.0)


def _form(u: FloatArray, y: FloatArray, reach: float, intervals: int) -> Form | None:
    """The form of samples `y` (s,) at `u` (s,) [rad] from the middle; None if it has no fronts."""
    used = np.isfinite(y) & (np.abs(u) < reach)
    # points of the form's table: straight lines between miss a ten-millionth of a level
    points = 8193
    angle = np.linspace(-reach, reach, points)
    level = spline_at(spline(u[used], y[used], reach, intervals), angle, reach)
    slope, half = np.gradient(level, angle), level - 0.5
    crossed, centre = np.flatnonzero((half[1:] > 0.0) != (half[:-1] > 0.0)), points // 2
    falls = crossed[(half[crossed] > 0.0) & (crossed < centre)]
    rises = crossed[(half[crossed] <= 0.0) & (crossed > centre)]
    if not (falls.size and rises.size):
        return None
    at = np.array([falls[-1], rises[0]])
    fronts = angle[at] - half[at] / (half[at + 1] - half[at]) * (angle[1] - angle[0])
    return Form(angle, level, slope, reach, fronts, slope[at])


def _fit(
    form: Form, owner: IntArray, phi: FloatArray, y: FloatArray, n: int
) -> tuple[Records, FloatArray, FloatArray]:
    """The form fitted to each of `n` passages, (n,) of FITTED; angles on it and what is left, (s,).

    Their samples lie at `phi` (s,) [rad] from the rough middles and have the levels `y`, NaN where
    lost.
    """
    there, found = np.isfinite(y), np.zeros(n, FITTED)
    phi, y = np.nan_to_num(phi, nan=np.pi), np.where(there, y, 0.0)
    for step in range(STEPS + 1):
        u, grows = form.moved(phi - found["shift"][owner], found["growth"][owner])
        level = np.interp(u, form.angle_rad, form.level)
        slope = np.interp(u, form.angle_rad, form.slope)
        # which samples fall into the window must not matter
        weight = np.clip(10.0 * (1.0 - np.abs(u) / form.reach_rad), 0.0, 1.0)
        left = np.where(there, y - level, 0.0)
        sums = _sums(owner, np.stack([-slope, -slope * grows, level, left]), weight * there, n)
        found["normal"] = sums[:, :3, :3] + 1e-9 * np.eye(3)
        if step < STEPS:
            moves = np.linalg.solve(found["normal"][:, :2, :2], sums[:, :2, 3:])[..., 0]
            for name, move in zip(("shift", "growth"), moves.T, strict=True):
                found[name] += np.clip(move, -LONGEST, LONGEST)
    free = np.bincount(owner, weight * there, n) - 2.0  # shift and growth are fitted
    found["misfit"] = np.sqrt(sums[:, 3, 3] / np.maximum(free, 1.0))
    for side, front in enumerate(form.fronts_rad):
        tells = weight * slope**2 * (u * front > 0.0)
        told, whole = (np.bincount(owner, tells * one, n) for one in (there, 1.0))
        steps, near = form.near(u, side)
        count, square = (
            np.maximum(np.bincount(owner, near * there * steps**k, n), 1e-9) for k in (0, 2)
        )
        found["told"][:, side], found["lost"][:, side] = told, 1.0 - told / (whole + 1e-300)
        found["left"][:, side] = np.bincount(owner, near * left, n) / count
        found["steeper"][:, side] = np.bincount(owner, near * steps * left, n) / square
    return found, u, np.where(there, left, np.nan)


def _learned(channel: Channel, angle: AngleFunction, rows: Records) -> Form | None:
    """The form of the `rows` (n,) of PASSAGE; None if it has no two fronts of a patch.

    Each round lays the passages over as the form of the round before fits them.
    """
    known = rows[np.isfinite(rows["level_m_s2"])]
    some = known[np.linspace(0, known.size - 1, min(known.size, LEARNT_FROM)).astype(np.int64)]
    if not some.size:
        return None
    parts = [np.zeros((3, 0))]
    for part, owner, phi, values in samples(channel, angle, some, _window(some)):
        parts.append(np.stack([part[owner], phi, _scaled(some[part], owner, phi, values)]))
    number, phi, y = np.concatenate(parts, axis=1)
    owner, half = number.astype(np.int64), float(np.median(some["half_rad"]))
    u, intervals, like = phi, 40, np.ones(some.size, bool)
    for _ in range(ROUNDS):
        learnt = _form(np.where(like[owner], u, np.inf), y, REACH * half, intervals)
        if learnt is None:
            return None
        form = learnt
        found, u, left = _fit(form, owner, phi, y, some.size)
        # passages with more than this times the usual residual are not learnt from
        like = found["misfit"] < 3.0 * np.median(found["misfit"])
        half, steepest = 0.5 * float(np.ptp(form.fronts_rad)), float(np.abs(form.steepness).max())
        # knots lie so far apart, in level over the flank's slope; twice as far apart, the form
        # rounds off what is as steep as the flank
        intervals = int(np.clip(2.0 * form.reach_rad * steepest / 0.35, 16.0, 400.0))
    # where the level wanders, a crossing within the patch may pass for a front
    if half < 0.5 * np.median(some["half_rad"]):
        return None
    growth = found["growth"] - np.mean(found["growth"][like])
    spread = float(np.std(growth[like]))
    own = found["misfit"] * np.sqrt(np.linalg.inv(found["normal"][:, :2, :2])[:, 1, 1])
    # the form follows the growth if this moves by more than so many of its errors: what the noise
    # moves would be followed too.  Half of it would let an eighth of noise in
    if like.sum() < FEWEST or spread < 3.0 * float(np.median(own)):
        return form
    used = np.isfinite(left) & (np.abs(u) < form.reach_rad) & like[owner]
    sizes, reach = growth[owner[used]], form.reach_rad
    change = spline_at(spline(u[used], left[used], reach, intervals, sizes), form.angle_rad, reach)
    bent = np.gradient(change, form.angle_rad) * spread
    wider, narrower = (_steep_width(form.angle_rad, form.slope + one) for one in (bent, -bent))
    return replace(form, change=change, lead=(wider - narrower) / (4.0 * spread))


def _steep_width(angle: FloatArray, slope: FloatArray) -> float:
    """Angle between the steep parts on either side of the middle."""
    # the power is high enough to see little but the steepest place, and low enough for its noise:
    # a third less or more moves widths by a hundredth of what they grow
    steep = slope**6
    right, left = (np.average(angle, weights=steep * (angle * side > 0.0)) for side in (1.0, -1.0))
    return float(right - left)


def _window(rows: Records) -> FloatArray:
    """Reach of the samples that a fit of each of the `rows` needs, (n,) [rad]."""
    half = rows["half_rad"]
    return np.asarray(REACH * np.maximum(half, np.median(half)) + FARTHEST, np.float64)


def _followed(left: FloatArray, rows: Records, good: BoolArray) -> FloatArray:
    """What of `left` (n,) goes with speed, its square and acceleration, or is always there, (n,).

    By least squares over the `good` (n,); nothing if these are too few.
    """
    speed, ahead = rows["rate_rad_s"], rows["ahead_m_s2"]
    columns = np.nan_to_num([np.ones(rows.size), speed, speed**2, ahead]).T
    scale = np.maximum(np.abs(columns[good]).max(axis=0, initial=0.0), 1e-12)
    if good.sum() < FEWEST:
        return np.zeros(rows.size)
    solved = np.linalg.lstsq(columns[good] / scale, left[good], rcond=1e-6)[0] / scale
    return np.asarray(columns @ solved, np.float64)


def fill_fronts(
    channel: Channel, angle: AngleFunction, rows: Records, sign: float, noise: float,
    limits: tuple[float, float] = (-np.inf, np.inf),
) -> None:  # fmt: skip
    """Fills levels and fronts of the `rows` (n,) of PASSAGE, which are in the order of the angle.

    `sign` of the level outside, `noise` of a sample, `limits` at which the sensor clips. Errors are
    by the noise, and larger by as much as samples lie farther from the form than that.
    """
    for name in ("entry_rad", "exit_rad", "middle_se_rad", "width_se_rad"):
        rows[name] = np.nan
    fill_levels(channel, angle, rows, sign)
    form = _learned(channel, angle, rows)
    if form is None:
        return
    found, clipped = np.zeros(rows.size, FITTED), np.zeros(rows.size, bool)
    for some, owner, phi, values in samples(channel, angle, rows, _window(rows)):
        part = rows[some]
        found[some] = _fit(form, owner, phi, _scaled(part, owner, phi, values), some.size)[0]
        beyond = (values <= limits[0]) | (values >= limits[1])
        beyond &= np.abs(phi) < REACH * part["half_rad"][owner]
        clipped[some] = np.bincount(owner, beyond, some.size) > 0
    told = found["told"] * rows["rate_rad_s"][:, None]
    # half of what tells a front must be there, and little may be lost without a word
    short = ~(told > 0.5 * np.median(told, axis=0)).all(axis=1)
    # a level that is known so much worse than usual, at this rate of the wheel, lacks a seventh of
    # the turn on one side: what is left there is bent by the lobe. Twice as much moves widths by
    # four of their errors
    sure = rows["level_share"] / np.sqrt(rows["rate_rad_s"])
    thin = sure > 1.1 * np.nanmedian(sure)
    at_end, beside_end = (
        _beyond_ends(channel, angle, rows, reach)
        for reach in (_window(rows), rows["half_rad"] + BESIDE[1])
    )
    lost = (found["lost"] > 0.02).any(axis=1)
    rows["quality"] |= marked((short & at_end) | (thin & beside_end), Quality.EDGE_OF_LOG)
    rows["quality"] |= marked((short & ~at_end) | (thin & ~beside_end) | lost, Quality.GAP)
    rows["quality"] |= marked(clipped, Quality.CLIPPED)
    # a passage that moves farther is another
    near = (np.abs(found["shift"]) < FARTHEST) & (np.abs(found["growth"]) < FARTHEST)
    known = near & ~short & np.isfinite(rows["level_m_s2"])
    nan, good = np.where(known, 1.0, np.nan), known & (rows["quality"] == 0)
    growth = found["growth"] - (np.mean(found["growth"][good]) if good.any() else 0.0)
    for side, name in enumerate(("entry", "exit")):
        front, steep = form.fronts_rad[side], form.steepness[side]
        usual = np.average(
            form.change + 0.0 * form.level, weights=form.near(form.angle_rad, side)[1]
        )
        more = _followed(found["left"][:, side] - usual * growth, rows, good)
        grown = np.sign(front) * (found["growth"] + form.lead * growth)
        place = rows["middle_rad"] + found["shift"] + front - more / steep + grown
        rows[f"{name}_rad"] = place * nan
        rows[f"{name}_slope"] = steep + found["steeper"][:, side] * abs(steep)
    # of coarse steps the noise may be none: then errors are by what the form leaves alone
    of_noise = np.maximum(noise / np.abs(rows["level_m_s2"] - rows["inside_m_s2"]), 1e-9)
    misfit = np.where(good, found["misfit"] / of_noise, 1.0)
    # errors are as large as what is left of the signal says over so many passages; twice as many
    # follow a change of road half as soon
    around, smooth = (sliding_median(misfit, min(size, misfit.size)) for size in (9, 101))
    # what the form leaves over beside the usual near it; of clean logs it is twice at most
    rows["quality"] |= marked(misfit > 4.0 * around, Quality.UNLIKE_NEIGHBOURS)
    wider = np.maximum(smooth, 1.0) * of_noise * nan
    inverse = np.linalg.inv(found["normal"][:, :2, :2])
    by_level = (inverse @ found["normal"][:, :2, 2:])[..., 0] * rows["level_share"][:, None]
    own = np.hypot(np.sqrt(np.diagonal(inverse, axis1=1, axis2=2)), by_level) * wider[:, None]
    of_angle = np.sqrt(0.5) * rows["angle_noise_rad"]
    rows["middle_se_rad"] = np.hypot(own[:, 0], of_angle)
    rows["width_se_rad"] = 2.0 * np.hypot((1.0 + form.lead) * own[:, 1], of_angle)


# ---- The passages of an accelerometer beside an encoder.


def find_fronts(
    channel: Channel,
    wheel: WheelAngle,
    radius_m: float,
    limits: tuple[float, float] = (-np.inf, np.inf),
) -> tuple[Records, float] | None:
    """(passages (n,) of PASSAGE, wheel angle between them [rad]) of an accelerometer channel.

    None if it has none; the angle is 2 pi if the encoder's steps are right. `radius_m` the rolling
    radius, `limits` at which it clips.
    """
    found = _passages(channel, wheel.angle)
    if found is None:
        return None
    middle, half, turn, sign, noise = found
    seen, expected, row = _expected(middle, wheel, turn)
    time = wheel.angle.time_at(middle[seen])
    rows = records(
        PASSAGE,
        middle_rad=middle[seen],
        half_rad=half[seen],
        rate_rad_s=wheel.speed_rad_s(time),
        ahead_m_s2=np.nan_to_num(radius_m * _rate_of_change(wheel, time)),
        angle_noise_rad=wheel.angle.noise_at(time),
    )
    fill_fronts(channel, wheel.angle, rows, sign, noise, limits)
    saturated = np.abs(rows["level_m_s2"]) > 0.95 * min(-limits[0], limits[1])
    rows["quality"] |= marked(saturated, Quality.CLIPPED)
    nan, lost = np.nan, np.uint32(Quality.LOST_PEAK)
    fronts = records(
        PASSAGE, middle_rad=expected, entry_rad=nan, exit_rad=nan, middle_se_rad=nan,
        width_se_rad=nan, rate_rad_s=nan, quality=lost,
    )  # fmt: skip
    fronts[row] = rows
    return fronts, turn


def _rate_of_change(wheel: WheelAngle, time_s: FloatArray) -> FloatArray:
    """Acceleration [rad/s^2] of the wheel over a tenth of a second about times (n,).

    By what lies between two losses of the count; NaN of too little.
    """
    cuts, half = wheel.angle.cuts_s, 0.5 * SPEED_WINDOW_S
    ends, number = np.concatenate([[-np.inf], cuts, [np.inf]]), np.searchsorted(cuts, time_s)
    begin = np.maximum(time_s - 0.05, ends[number] + half)
    end = np.minimum(time_s + 0.05, ends[number + 1] - half)
    span = np.where(end - begin > half, end - begin, np.nan)
    return np.asarray((wheel.speed_rad_s(end) - wheel.speed_rad_s(begin)) / span)


def patch_turn(channel: Channel, wheel: WheelAngle) -> float:
    """Wheel angle from passage to passage [rad], by the beginning of the log that shows it.

    NaN if there are too few of them.
    """
    size = 2 * PIECE
    while True:
        part = replace(channel, axis=replace(channel.axis, size=min(size, channel.size)))
        found = _passages(part, wheel.angle)
        # passages that tell how far they are apart without their fronts: their median is known to a
        # tenth of a degree, where one step of a hundred is 3.6; twice as many leave logs of ten
        # turns untold
        if found and found[0].size >= 8:
            return found[2]
        if size >= channel.size:
            return float("nan")
        size *= 4


def _passages(
    channel: Channel, angle: AngleFunction
) -> tuple[FloatArray, FloatArray, float, float, float] | None:
    """(middles, half widths [rad], angle between them [rad], sign of the level, noise of a sample).

    Of pulses of the usual width while the wheel rolls forwards. None if they do not recur: most
    come after a whole number of equal turns; noise does not.
    """
    sign = patch_sign(channel)
    pulses, data = pulses_in(channel, decimate(channel, sign), sign)
    entry, leave = (
        angle.at(channel.axis.at(pulses["middle"] + side * pulses["width"])) for side in (-0.5, 0.5)
    )
    middle, half = 0.5 * (entry + leave), 0.5 * (leave - entry)
    climbing = np.fmax.accumulate(np.append(-np.inf, middle))
    known = (middle > climbing[:-1]) & (half > np.radians(2.0)) & (half < np.radians(35.0))
    middle, half = middle[known], half[known]
    if middle.size < 3:
        return None
    turn, share = float(np.median(np.diff(middle))), half / np.median(half)
    usual = (share < 1.7) & (share > 0.55)
    middle, half = middle[usual], half[usual]
    steps = np.diff(middle) / turn
    recurring = np.abs(steps - np.rint(steps)) < 0.03
    if middle.size < 3 or turn <= 0.3 * np.pi or float(np.mean(recurring)) <= 0.6:
        return None
    return middle, half, turn, -sign, data.noise


def _expected(
    middle: FloatArray, wheel: WheelAngle, turn: float
) -> tuple[BoolArray, FloatArray, IntArray]:
    """(which of the passages recur once per turn, expected middles of all passages, their rows).

    The middles in rad; the rows are those of the former among the latter.
    """
    stretch = wheel.angle.stretch_at(wheel.angle.time_at(middle))
    kept, near = np.ones(middle.size, bool), np.radians(15.0)
    if abs(turn / (2 * np.pi) - 1) < 0.01:
        for number in np.unique(stretch):
            rows = np.flatnonzero(stretch == number)
            phase = np.sort(middle[rows] % (2 * np.pi))
            # of a wheel that turned round the patch has two places; the mean lies in neither
            spread = np.concatenate([phase, phase + 2 * np.pi])
            ahead = np.searchsorted(spread, phase + near) - np.arange(phase.size)
            usual = float(np.median(spread[ahead.argmax() + np.arange(ahead.max())]))
            kept[rows] = np.abs(np.angle(np.exp(1j * (middle[rows] - usual)))) < near
    ends = middle[[0, -1]]
    middle = middle[kept]
    turns = np.maximum(np.rint(np.diff(middle) / turn).astype(np.int64), 1)
    row = np.concatenate([[0], np.cumsum(turns)])
    before, after = np.rint(np.abs(middle[[0, -1]] - ends) / turn).astype(np.int64)
    every = np.arange(-before, row[-1] + after + 1)
    beyond = np.minimum(every, 0) + np.maximum(every - row[-1], 0)
    return kept, np.interp(every, row, middle) + turn * beyond, row + before
