"""Fronts of the contact patch in a radial acceleration, found, sampled and matched."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.polynomial import polynomial

from tirelog.data.recording import Channel
from tirelog.dsp.filters import sliding_median
from tirelog.vocabulary.arrays import BoolArray, FloatArray, IntArray, Records, records
from tirelog.vocabulary.quality import Quality, QualityFlags, marked, none_of
from tirelog.vocabulary.units import STANDARD_GRAVITY_M_S2
from tirelog.wheel.angle import WheelAngle
from tirelog.wheel.coarse_patch import (
    DEGREE,
    binned,
    find_dips,
    flanks_of,
    moved,
    ranges,
    samples,
)

# ---- Fronts by the flank's mean form, learnt from the log itself.
#
# The same crossing, nearer to the bound.
#
#     crossings by cubics
#         --samples aligned by them, least squares of a spline--> mean form of entry and exit
#     form, samples of one passage --least squares of one shift--> matched place
#     cubics minus matched places
#         --regression on speed, acceleration and width--> what the form's change moves the crossing
#
# A known form uses the whole flank, from the spike beside the patch to the patch's middle, and
# reaches the Cramer-Rao bound of a shift; the cubic uses what lies about the crossing, and the
# crossing is what a front is. Where the form changes with speed or load the matched place and the
# crossing part, and the regression gives the difference back: on the average the matched front is
# the
# cubics'.
#
# A patch that grows lifts the lobes beside it, and half of the level then lies farther inside: on a
# ring by an eighth of what the patch has grown, while the steepest part of the flank keeps its
# distance from the edge of the contact to a hundredth. So a width that moves is followed by that
# part
# (`_grown`); of the usual width the fronts are at half of the level.

#: passages without a fault that a form needs, and of which at most it is learnt; twice as many of
#: the latter tell the form to 0.7 of the noise
LEAST, MOST = 40, 400
#: reach of the form on the outer side and on the inner one, in half widths of the patch
OUTER, INNER = 1.0, 0.8
#: knots of the spline lie so far apart, in level over the flank's slope; twice as far apart, the
#: spline rounds off what is as steep as the flank
KNOTS = 0.35
#: degree of the polynomial through a flank: the least that has a steepest place and its own lobes;
#: a cubic sees an eighth of what a ring's fronts move by, two more see nothing else
DEGREE_OF_FLANK = 5
#: half width of its window, in level over the flank's slope, and not beyond the patch's middle, or
#: the other flank is in it; half as wide, noise moves the steepest place as much as the patch does
FLANK_REACH = 1.5
#: passages over which errors are as large as what is left of the signal says, and so many at least
#: that tell it by their widths; twice as many follow a change of road half as soon
SMOOTH, FEWEST = 101, 9
#: steps of the least squares, and the longest of them [deg]; twice as long ones could leave the
#: flank
STEPS, LONGEST = 3, 1.0


def matched(
    channel: Channel,
    wheel: WheelAngle,
    flanks: Records,
    cubic: tuple[FloatArray, FloatArray, FloatArray],
    spoilt: IntArray,
) -> tuple[FloatArray, FloatArray, float]:
    """(places [rad], standard errors) of all fronts, (2 n,) as `flanks`; how widths magnify them.

    A width that is followed farther than the flanks move by themselves magnifies its noise; the
    middle has none of that.

    Those of `cubic` (places, errors, slopes in levels/rad) if the log is too short for a form or a
    passage does not fit it. `spoilt`: fronts with something wrong. Errors are by the noise, and
    larger by as much as the samples lie farther from what was fitted than that.
    """
    place, se, slope = cubic
    n = flanks.size // 2
    good = np.isfinite(place)
    good[spoilt] = False
    good = np.tile(good[:n] & good[n:], 2)
    if good.sum() < 2 * LEAST:
        return place, se * _scatter(place, se), 1.0
    half = 0.5 * float(np.median((place[n:] - place[:n])[good[:n]]))
    flanks = moved(flanks, place)
    result, error = place.copy(), se.copy()
    for entries in (True, False):
        side = np.arange(n) + (0 if entries else n)
        steepness = float(np.median(np.abs(slope[side][good[side]])))
        low, high = (-OUTER * half, INNER * half) if entries else (-INNER * half, OUTER * half)
        form = _mean_flank(
            channel, wheel, flanks[_some(side[good[side]])], (low, high), KNOTS / steepness
        )
        result[side], error[side], left = _shifts(channel, wheel, flanks[side], form)
        error[side] *= _about(left)
    by_form = result[n:] - result[:n]
    result += _difference(place - result, by_form, flanks, good)
    # a matched place farther from the crossing than so many standard errors is not taken: noise
    # does it once in 2e6; half of it would drop one in 80
    known = np.isfinite(result) & (np.abs(result - place) < 5.0 * se)
    result, error = np.where(known, result, place), np.where(known, error, se * _scatter(place, se))
    lead = _grown(channel, wheel, moved(flanks, result), result, error, slope, good)
    result += lead
    seen = good[:n] & np.isfinite(by_form) & np.isfinite(result[n:] - result[:n])
    magnified = _slope(by_form[seen], (result[n:] - result[:n])[seen])
    return result, error, max(magnified, 1.0)


def _slope(x: FloatArray, y: FloatArray) -> float:
    """By how much y (n,) grows with x (n,); 1 if x does not move."""
    x = x - x.mean()
    square = float(x @ x)
    return float(x @ y) / square if square > 0.0 else 1.0


def _some(rows: IntArray) -> IntArray:
    return rows[np.linspace(0, rows.size - 1, min(rows.size, MOST)).astype(np.int64)]


def _samples(
    channel: Channel, wheel: WheelAngle, flanks: Records, reach: float
) -> Iterator[tuple[IntArray, IntArray, FloatArray, FloatArray]]:
    """(rows, owner, angle from the owner's front [rad], level) of the samples, piece by piece.

    They lie within `reach` [rad] of the fronts, and a little more; owners count in the `rows`.
    """
    windows = np.full(flanks.size, reach + LONGEST * DEGREE)
    for piece in samples(channel, wheel, flanks, *ranges(channel, wheel, flanks, windows)):
        yield piece[:4]


def _mean_flank(
    channel: Channel, wheel: WheelAngle, flanks: Records, reach: tuple[float, float], step: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The mean flank: angles from the front [rad], levels outside and slopes [1/rad] there, (g,).

    The least-squares cubic spline through the samples of all `flanks`, aligned by place, with even
    knots about `step` apart within `reach`.
    """
    low, high = reach
    intervals = max(round((high - low) / step), 4)
    left, right = 1e-9 * np.eye(intervals + 3), np.zeros(intervals + 3)

    def bumps(u: FloatArray) -> FloatArray:
        """The cubic B-splines about the knots at `u` (n,), shape (n, intervals + 3)."""
        place = (u - low) * (intervals / (high - low))
        away = np.abs(place[:, None] - np.arange(-1.0, intervals + 2))
        wide, narrow = np.maximum(2.0 - away, 0.0), np.maximum(1.0 - away, 0.0)
        return np.asarray((wide**3 - 4.0 * narrow**3) / 6.0)

    for _, _, u, y in _samples(channel, wheel, flanks, max(-low, high)):
        inside = np.isfinite(y) & (u >= low) & (u <= high)
        columns = bumps(u[inside])
        left += columns.T @ columns
        right += columns.T @ y[inside]
    angle = np.linspace(low, high, 8193)  # straight lines between miss a ten-millionth of a level
    level = bumps(angle) @ np.linalg.solve(left, right)
    return angle, level, np.gradient(level, angle)


def _shifts(
    channel: Channel,
    wheel: WheelAngle,
    flanks: Records,
    form: tuple[FloatArray, FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(places [rad] at which the form fits best, standard errors, misfits), shape (n,).

    The errors are by noise; a misfit is the root of what the form leaves over what noise does. NaN
    if samples are missing.
    """
    place, se, left = np.full((3, flanks.size), np.nan)
    angle, levels, slopes = form
    low, high = angle[0], angle[-1]
    for group, owner, u, y in _samples(channel, wheel, flanks, max(-low, high)):
        part = flanks[group]
        lost = np.bincount(owner[~np.isfinite(y)], minlength=group.size) > 0
        u, y = np.nan_to_num(u, nan=10.0), np.nan_to_num(y)
        shift = np.zeros(group.size)
        for _ in range(STEPS):
            at = u - shift[owner]
            weight = _weight(at, low, high)
            level, slope = np.interp(at, angle, levels), np.interp(at, angle, slopes)
            known = np.bincount(owner, weight * slope**2, group.size)
            known[known == 0] = np.inf  # nothing tells the place: it stays
            step = -np.bincount(owner, weight * slope * (y - level), group.size) / known
            shift += np.clip(step, -LONGEST * DEGREE, LONGEST * DEGREE)
        # a level that is wrong by a share moves the fit by what its form times its slope says
        lever = np.bincount(owner, weight * slope * level, group.size) / known
        own = np.sqrt(np.bincount(owner, (weight * slope) ** 2, group.size)) / known
        of_noise = part["noise"] / (np.abs(part["level"]) * part["rate"] ** 2)
        lost |= np.isinf(known)
        place[group] = np.where(lost, np.nan, part["angle"] + shift)
        noise = np.hypot(own, lever * part["level_share"]) * of_noise
        se[group] = np.hypot(noise, part["angle_noise"])
        at = u - shift[owner]
        weight, rest = _weight(at, low, high), y - np.interp(at, angle, levels)
        square = np.bincount(owner, weight * rest**2, group.size)
        free = np.bincount(owner, weight, group.size) - 1.0  # the place is fitted
        misfit = np.sqrt(square / np.maximum(free, 1.0)) / of_noise
        left[group] = np.where(lost, np.nan, misfit)
    return place, se, left


def _weight(u: FloatArray, low: float, high: float) -> FloatArray:
    """1 within `low` to `high`, falling to 0 over the tenth at each end.

    Which samples fall into it must not matter.
    """
    return np.clip(np.minimum(u - low, high - u) / (0.1 * (high - low)), 0.0, 1.0)


def _about(left: FloatArray) -> FloatArray:
    """What errors grow by where `left` (n,) is above one, by its median over SMOOTH passages."""
    left = np.nan_to_num(left, nan=1.0)
    usual = sliding_median(left, min(SMOOTH, left.size))
    return np.asarray(np.maximum(usual, 1.0), dtype=np.float64)


def _scatter(place: FloatArray, se: FloatArray) -> FloatArray:
    """How much more widths scatter from passage to passage than their noise says, (2 n,).

    At least 1: a cubic is not the flank's exact form, and samples fall on it differently from
    passage to passage. Of a rough road it holds what the patch itself does.
    """
    n = place.size // 2
    width, own = place[n:] - place[:n], np.hypot(se[:n], se[n:])
    scatter = np.abs(width[1:-1] - 0.5 * (width[:-2] + width[2:])) / (
        0.6745 * np.sqrt(1.5) * own[1:-1]
    )
    if scatter.size < FEWEST:
        return np.ones(2 * n)
    usual = _about(scatter)
    return np.tile(np.concatenate([usual[:1], usual, usual[-1:]]), 2)


def _difference(
    difference: FloatArray, width: FloatArray, flanks: Records, good: np.ndarray
) -> FloatArray:
    """How far crossings lie beyond matched places, shape (2 n,).

    Least squares on speed, its square, acceleration and width, for each side.
    """
    n = flanks.size // 2
    speed, ahead = flanks["rate"][:n], flanks["ahead"][:n]
    columns = np.stack([speed, speed**2, ahead, width], axis=1)
    result = np.full((2, n), np.nan)
    for side, y, rows in zip(result, difference.reshape(2, n), good.reshape(2, n), strict=True):
        rows = rows & np.isfinite(y) & np.isfinite(width)
        if rows.sum() < LEAST:
            continue
        middle, size = columns[rows].mean(axis=0), np.maximum(columns[rows].std(axis=0), 1e-12)
        design = np.column_stack([np.ones(n), (columns - middle) / size])
        for _ in range(3):
            solved = np.linalg.lstsq(design[rows], y[rows], rcond=1e-6)[0]
            left = np.abs(y - np.nan_to_num(design) @ solved)
            with np.errstate(invalid="ignore"):
                rows = rows & (left < 4 * 1.4826 * float(np.median(left[rows])))
        side[:] = design @ solved
    return result.ravel()


def _grown(
    channel: Channel,
    wheel: WheelAngle,
    flanks: Records,
    place: FloatArray,
    se: FloatArray,
    slope: FloatArray,
    good: np.ndarray,
) -> FloatArray:
    """How much farther the flanks' steepest parts move than their half levels, shape (2 n,) [rad].

    With the patch's width, from its usual one, as much outwards on both sides, so that the middle
    stays; zero if the width hardly moves.
    """
    n = flanks.size // 2
    width, own = place[n:] - place[:n], np.hypot(se[:n], se[n:])
    known = good[:n] & np.isfinite(width) & np.isfinite(own)
    if known.sum() < LEAST:
        return np.zeros(2 * n)
    usual, spread = float(np.mean(width[known])), float(np.std(width[known]))
    # a width follows the steepest part of the flanks if it moves by more than so many of its
    # errors: what the noise moves would be followed too.  Half of it would let an eighth of noise
    # in
    if spread < 3.0 * float(np.median(own[known])):
        return np.zeros(2 * n)
    grown = np.nan_to_num((width - usual) / spread)
    leads = []
    for side in (np.arange(n), n + np.arange(n)):
        rows = _some(side[known])
        reach = min(FLANK_REACH / float(np.median(np.abs(slope[rows]))), 0.5 * usual)
        parts = []
        for group, owner, u, y in _samples(channel, wheel, flanks[rows], 2.0 * reach):
            inside = np.isfinite(y) & (np.abs(u) < 2.0 * reach)
            parts.append(np.stack([u, y, grown[rows[group] % n][owner]])[:, inside])
        u, y, z = np.concatenate(parts, axis=1)
        leads.append(_lead(u, y, z, reach))
    outwards = 0.5 * (leads[1] - leads[0])
    return np.concatenate([-outwards * grown, outwards * grown])


def _lead(u: FloatArray, y: FloatArray, z: FloatArray, reach: float) -> float:
    """How far the steepest place leads the half level if z is one more [rad].

    By a polynomial whose coefficients are linear in z, in a window around the steepest place; zero
    if there is none.
    """
    powers = np.arange(DEGREE_OF_FLANK + 1)
    centre = 0.0
    # steps that centre the window on the steepest place; twice as many take twice as long for it
    for _ in range(4):
        x = (u - centre) / reach
        inside = np.abs(x) < 1.0
        weight = np.sqrt(1.0 - x[inside] ** 2)
        columns = weight[:, None] * x[inside, None] ** powers
        design = np.concatenate([columns, z[inside, None] * columns], axis=1)
        solved = np.linalg.lstsq(design, weight * y[inside], rcond=1e-9)[0]
        usual, change = solved[: powers.size], solved[powers.size :]
        centre += np.nan_to_num(_steepest(usual)[0]) * reach
    leads = [steepest - half for steepest, half in map(_steepest, (usual - change, usual + change))]
    return float(np.nan_to_num(0.5 * (leads[1] - leads[0]) * reach))


def _steepest(form: FloatArray) -> tuple[float, float]:
    """(where a polynomial within +-1 is steepest, where it is half of the level next to that).

    NaN if it is steepest near an end, or nowhere half of the level.
    """
    place = np.linspace(-1.0, 1.0, 4097)
    bend, change = (polynomial.polyder(form, k) for k in (2, 3))
    level, slope = (polynomial.polyval(place, polynomial.polyder(form, k)) for k in (0, 1))
    steepest = int(np.argmax(np.abs(slope) * (np.abs(place) < 0.9)))
    crossed = np.flatnonzero((level[1:] > 0.5) != (level[:-1] > 0.5))
    if abs(place[steepest]) > 0.89 or not crossed.size:
        return np.nan, np.nan
    at = place[steepest]
    near = crossed[np.argmin(np.abs(crossed - steepest))]
    # a step of Newton from the nearest place of the grid
    return (
        at - polynomial.polyval(at, bend) / polynomial.polyval(at, change),
        place[near] + (0.5 - level[near]) / slope[near],
    )


# ---- Where the flanks of the patch signal cross half of the level outside, each by a cubic of
# its own.
#
#     flanks, half widths of the windows --normalised samples--> weighted cubic least squares
#         --root--> place, standard error, slope
#
# The cubic follows the flank's own shape, so nothing is assumed about it.


def crossings(
    channel: Channel,
    wheel: WheelAngle,
    flanks: Records,
    window: FloatArray,
    limits: tuple[float, float],
) -> tuple[FloatArray, FloatArray, FloatArray, QualityFlags]:
    """(angle of the crossing, its standard error, the slope there, quality) of all fronts.

    The crossing of the half level [rad]; the slope in levels/rad. `window` (2,): half widths [rad]
    of entries' and of exits' windows, wider if one would hold too few samples.
    """
    # samples that a flank has at least: a cubic takes four, and three are left to tell the noise;
    # twice as many widen windows with few samples, and take more of the front's bend into them
    least = 0.5 * (7 + 0.5) * flanks["rate"] / channel.axis.rate_Hz
    windows = np.maximum(np.repeat(window, flanks.size // 2), least)
    # samples are read so much wider, for a place that was a little off [deg]; twice as wide reads
    # that much more
    first, last = ranges(channel, wheel, flanks, windows + 1.0 * DEGREE)
    result = np.full((3, first.size), np.nan)
    quality = none_of(first.size)
    for rows, owner, u, y, values in samples(channel, wheel, flanks, first, last):
        part, shift = flanks[rows], np.zeros(rows.size)
        for _ in range(2):  # the second time around the place that the first has found
            found, lost = _solve(
                owner, u - shift[owner], y, part, windows[rows], rows < flanks.size // 2
            )
            place = shift + found[0]
            near = np.abs(place - shift) < 3 * DEGREE
            result[:, rows] = part["angle"] + place, found[1], found[2]
            shift = np.where(near, place, shift)
        beyond = (values <= limits[0]) | (values >= limits[1])
        clipped = np.bincount(owner[beyond], minlength=rows.size) > 0
        quality[rows] |= marked(lost, Quality.GAP) | marked(clipped, Quality.CLIPPED)
    short = last - first < 5
    at_end = (first < 1) | (last >= channel.size - 1)
    quality |= marked(short & at_end, Quality.EDGE_OF_LOG) | marked(short & ~at_end, Quality.GAP)
    return result[0], result[1], result[2], quality


def _solve(
    owner: IntArray,
    u: FloatArray,
    y: FloatArray,
    flanks: Records,
    windows: FloatArray,
    entries: BoolArray,
) -> tuple[FloatArray, BoolArray]:
    """((3, n) place [rad], standard error and slope, n samples lost) by cubic least squares.

    Of n fronts whose samples lie at `u` (s,) [rad] and have the levels `y`; `entries` (n,):
    whether the signal leaves its level there.
    """
    n = windows.size
    u = u / windows[owner]
    inside, known = np.abs(u) < 1.0, np.isfinite(y)
    lost = np.bincount(owner[inside & ~known], minlength=n) > 0
    owner, u, y = owner[inside & known], u[inside & known], y[inside & known] - 0.5
    weight = 1.0 - u * u  # a window without edges: which samples fall into it must not matter
    powers = np.stack([np.bincount(owner, weight * u**k, n) for k in range(7)])
    squares = np.stack([np.bincount(owner, weight**2 * u**k, n) for k in range(7)])
    right = np.stack([np.bincount(owner, weight * y * u**k, n) for k in range(4)], axis=-1)
    left, between = (
        np.stack([p[k : k + 4] for k in range(4)]).transpose(2, 0, 1) for p in (powers, squares)
    )
    enough = (np.bincount(owner, minlength=n) >= 5) & (powers[0] > 1.0)
    left[~enough] = np.eye(4)
    inverse = np.linalg.inv(left + 1e-9 * powers[0][:, None, None] * np.eye(4))
    c = np.einsum("nij,nj->ni", inverse, right)
    covariance = inverse @ between @ inverse
    root = np.zeros(n)
    for _ in range(8):
        value = c[:, 0] + root * (c[:, 1] + root * (c[:, 2] + root * c[:, 3]))
        slope = c[:, 1] + root * (2 * c[:, 2] + root * 3 * c[:, 3])
        root = np.clip(root - value / np.where(slope == 0, np.inf, slope), -1.0, 1.0)
    at = np.stack([np.ones_like(root), root, root**2, root**3], axis=-1)
    share = np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", at, covariance, at), 0.0))
    slope = c[:, 1] + root * (2 * c[:, 2] + root * 3 * c[:, 3])
    level = np.abs(flanks["level"]) * flanks["rate"] ** 2
    noise = np.hypot(share, 0.5 * flanks["level_share"]) * flanks["noise"] / level
    sure = enough & np.where(entries, slope < 0, slope > 0) & (np.abs(root) < 1)
    se = np.hypot(noise / np.abs(np.where(sure, slope, 1.0)) * windows, flanks["angle_noise"])
    return np.where(sure, np.stack([root * windows, se, slope / windows]), np.nan), lost


# ---- The two fronts of every passage of an in-tire accelerometer (P4 section IV B).
#
# To a few hundredths of a degree.
#
#     Dips (coarse)
#         --samples within a few degrees of each front--> cubic through the flank
#         --half of the level--> crossing
#         --the flank's own mean form, matched--> Fronts
#
# A front is where the signal, divided by Omega^2 and with gravity's part subtracted, crosses half
# of
# the level outside, extrapolated from beside it. Inside the patch the tread moves straight and the
# true acceleration is nothing, so half of the level is a fixed share of the step at every speed; a
# fixed threshold in m/s^2 would let the width shrink with speed (errata). The cubic (`cubic`)
# assumes
# nothing about the flank; the matched form (`match`) has less noise, and the cubics' mean.
#
# Angles [rad] are those of `WheelAngle`. Everything is worked out for all fronts of a piece of the
# log at once.


#: half width of the flank's window: this share of the level over the flank's median slope, within
#: bounds [deg], from a first guess
FLANK_SHARE, NARROW, WIDE, FIRST_GUESS = 1.5, 0.7, 6.0, 2.5
#: passages before and after the middle of the log that the slope is learnt from; twice as many
#: tell it to 0.7 of the error
LEARN_FROM = 150
#: passages that tell how far they are apart without their fronts: their median is known to a tenth
#: of a degree, where one step of a hundred is 3.6; twice as many leave logs of ten turns untold
PASSAGES = 8


#: a passage, NaN if it was not found: where its middle was looked for; wheel angles of its fronts,
#: their standard errors from noise (accelerometer and wheel angle) and misfit; its flags.  The same
#: in all rows: level outside over Omega^2 [m], with the sign as recorded; whether the signal holds
#: gravity; the wheel angle from passage to passage, 2 pi if the encoder's steps are right; how much
#: more of the noise a width has than its fronts
FRONTS = np.dtype(
    [("expected_rad", "f8"), ("entry_rad", "f8"), ("exit_rad", "f8"), ("entry_se_rad", "f8"),
     ("exit_se_rad", "f8"), ("quality", "u4"), ("level_m", "f8"), ("gravity", "?"),
     ("turn_rad", "f8"), ("magnified", "f8")]
)  # fmt: skip


def gravity_in(dips: Records, sign: int) -> bool:
    """Whether the level holds gravity's one per turn.

    Least squares of level, its own once-per-turn part and gravity over all degrees beside the
    patch; if the speed hardly changes the second and third cannot be told apart and the second
    is left out. Gravity is left in the model unless the data speak against it.
    """
    normal = dips["normal"].sum(axis=0)
    left, right = normal[:, :3], normal[:, 3]
    scale = np.sqrt(np.maximum(np.diag(left), 1e-300))
    unit = left / np.outer(scale, scale)
    columns = [0, 1, 2] if np.linalg.cond(unit) < 3e3 else [0, 2]
    solved = (
        np.linalg.lstsq(unit[np.ix_(columns, columns)], (right / scale)[columns], rcond=1e-12)[0]
        / scale[columns]
    )
    return bool(sign * solved[-1] > 0.3 * STANDARD_GRAVITY_M_S2)


def find_fronts(
    channel: Channel,
    wheel: WheelAngle,
    radius_m: float,
    limits: tuple[float, float] = (-np.inf, np.inf),
) -> Records | None:
    """All passages of an accelerometer channel, (n,) of FRONTS; None if it has none.

    `radius_m` the rolling radius, `limits` at which it clips.
    """
    passages = _passages(find_dips(binned(channel, wheel.angle)))
    if passages is None:
        return None
    dips, turn = passages
    sign = int(np.sign(np.median(dips["level"])))
    dips, expected, row = _expected(dips[np.sign(dips["level"]) == sign], wheel, turn)
    gravity = gravity_in(dips, sign)
    flanks = flanks_of(dips, wheel, radius_m, sign * STANDARD_GRAVITY_M_S2 if gravity else 0.0)
    n = row.size
    window = np.full(2, FIRST_GUESS * DEGREE)
    some = slice(max(n // 2 - LEARN_FROM, 0), n // 2 + LEARN_FROM)
    for _ in range(2):
        part = np.concatenate([flanks[:n][some], flanks[n:][some]])
        slope = crossings(channel, wheel, part, window, limits)[2]
        window = np.clip(
            [
                FLANK_SHARE / np.nanmedian(np.abs(s))
                if np.isfinite(s).any()
                else FLANK_SHARE * DEGREE
                for s in np.split(slope, 2)
            ],
            NARROW * DEGREE,
            WIDE * DEGREE,
        )
    place, se, slope, quality = crossings(channel, wheel, flanks, window, limits)
    place, se, magnified = matched(
        channel, wheel, flanks, (place, se, slope), np.flatnonzero(quality)
    )
    fronts = records(
        FRONTS, expected_rad=expected, entry_rad=np.nan, exit_rad=np.nan, entry_se_rad=np.nan,
        exit_se_rad=np.nan, quality=np.uint32(Quality.LOST_PEAK), gravity=gravity, turn_rad=turn,
        magnified=magnified, level_m=sign * abs(float(np.median(dips["level"]))),
    )  # fmt: skip
    for name, both in (("rad", place), ("se_rad", se)):
        fronts[f"entry_{name}"][row], fronts[f"exit_{name}"][row] = both[:n], both[n:]
    saturated = np.abs(flanks["level"][:n]) * flanks["rate"][:n] ** 2 > 0.95 * min(
        -limits[0], limits[1]
    )
    fronts["quality"][row] = quality[:n] | quality[n:] | marked(saturated, Quality.CLIPPED)
    return fronts


def patch_turn(channel: Channel, wheel: WheelAngle) -> float:
    """Wheel angle from passage to passage [rad], by the first piece of the log that shows it.

    NaN if none has PASSAGES of them.
    """
    for piece in binned(channel, wheel.angle):
        found = _passages(find_dips([piece]))
        if found and found[0].size >= PASSAGES:
            return found[1]
    return float("nan")


def _passages(dips: Records) -> tuple[Records, float] | None:
    """(dips of the usual width, wheel angle between them [rad]); None if they do not recur.

    The angle is 2 pi if the encoder has as many steps as the setup says. Most dips come after a
    whole number of like turns; noise does not.
    """
    if dips.size < 3:
        return None
    turn = float(np.median(np.diff(_middle(dips))))
    width = dips["exit_rad"] - dips["entry_rad"]
    share = width / np.median(width)
    dips = dips[(share < 1.7) & (share > 0.55)]
    steps = np.diff(_middle(dips)) / turn
    recurring = np.abs(steps - np.rint(steps)) < 0.03
    if dips.size < 3 or turn <= 0.3 * np.pi or float(np.mean(recurring)) <= 0.6:
        return None
    return dips, turn


def _middle(dips: Records) -> FloatArray:
    """Wheel angles [rad] of the middles of the patch."""
    return np.asarray(0.5 * (dips["entry_rad"] + dips["exit_rad"]), np.float64)


def _expected(
    dips: Records, wheel: WheelAngle, turn: float
) -> tuple[Records, FloatArray, IntArray]:
    """(dips that recur once per turn, expected middles of all passages, the dips' rows).

    The middles in rad; the rows are those of the dips among the passages.
    """
    middle = _middle(dips)
    stretch = wheel.angle.stretch_at(wheel.angle.time_at(middle))
    kept = np.ones(middle.size, bool)
    if abs(turn / (2 * np.pi) - 1) < 0.01:
        for number in np.unique(stretch):
            rows = np.flatnonzero(stretch == number)
            phase = np.sort(middle[rows] % (2 * np.pi))
            # of a wheel that turned round the patch has two places; the mean lies in neither
            spread = np.concatenate([phase, phase + 2 * np.pi])
            ahead = np.searchsorted(spread, phase + 15 * DEGREE) - np.arange(phase.size)
            usual = float(np.median(spread[ahead.argmax() + np.arange(ahead.max())]))
            kept[rows] = np.abs(np.angle(np.exp(1j * (middle[rows] - usual)))) < 15 * DEGREE
    ends = middle[[0, -1]]
    dips, middle = dips[kept], middle[kept]
    turns = np.maximum(np.rint(np.diff(middle) / turn).astype(np.int64), 1)
    row = np.concatenate([[0], np.cumsum(turns)])
    before, after = np.rint(np.abs(middle[[0, -1]] - ends) / turn).astype(np.int64)
    inside = np.interp(np.arange(row[-1] + 1), row, middle)
    expected = np.concatenate(
        [
            inside[0] - turn * np.arange(before, 0, -1),
            inside,
            inside[-1] + turn * np.arange(1, after + 1),
        ]
    )
    return dips, expected, row + before
