"""Fronts by the flank's mean form, learnt from the log itself.

The same crossing, nearer to the bound.

    crossings by cubics
        --samples aligned by them, least squares of a spline--> mean form of entry and exit
    form, samples of one passage --least squares of one shift--> matched place
    cubics minus matched places
        --regression on speed, acceleration and width--> what the form's change moves the crossing

A known form uses the whole flank, from the spike beside the patch to the patch's middle, and
reaches the Cramer-Rao bound of a shift; the cubic uses what lies about the crossing, and the
crossing is what a front is. Where the form changes with speed or load the matched place and the
crossing part, and the regression gives the difference back: on the average the matched front is the
cubics'.

A patch that grows lifts the lobes beside it, and half of the level then lies farther inside: on a
ring by an eighth of what the patch has grown, while the steepest part of the flank keeps its
distance from the edge of the contact to a hundredth. So a width that moves is followed by that part
(`_grown`); of the usual width the fronts are at half of the level.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tirelog.data.recording import Channel
from tirelog.dsp.filters import sliding_median
from tirelog.vocabulary.arrays import FloatArray, IntArray
from tirelog.wheel.angle import WheelAngle
from tirelog.wheel.coarse_patch import DEGREE, Flanks, groups, normalised, ranges

#: passages without a fault that a form needs, and of which at most it is learnt; twice as many of
#: the latter tell the form to 0.7 of the noise
LEAST, MOST = 40, 400
#: reach of the form on the outer side and on the inner one, in half widths of the patch
OUTER, INNER = 1.0, 0.8
#: knots of the spline lie so far apart, in level over the flank's slope; twice as far apart, the
#: spline rounds off what is as steep as the flank
KNOTS = 0.35
#: a matched place farther from the crossing than so many standard errors is not taken: noise does
#: it once in 2e6; half of it would drop one in 80
FAR = 5.0
#: a width follows the steepest part of the flanks if it moves by more than so many of its errors:
#: what the noise moves would be followed too.  Half of it would let an eighth of noise in
MOVED = 3.0
#: degree of the polynomial through a flank: the least that has a steepest place and its own lobes;
#: a cubic sees an eighth of what a ring's fronts move by, two more see nothing else
DEGREE_OF_FLANK = 5
#: half width of its window, in level over the flank's slope, and not beyond the patch's middle, or
#: the other flank is in it; half as wide, noise moves the steepest place as much as the patch does
FLANK_REACH = 1.5
#: steps that centre the window on the steepest place; twice as many take twice as long for it
CENTRINGS = 4
#: passages over which errors are as large as what is left of the signal says, and so many at least
#: that tell it by their widths; twice as many follow a change of road half as soon
SMOOTH, FEWEST = 101, 9
#: steps of the least squares, and the longest of them [deg]; twice as long ones could leave the
#: flank
STEPS, LONGEST = 3, 1.0


@dataclass(frozen=True)
class FrontForm:
    """The mean flank in levels outside over the angle from the front [rad].

    From `low` to `high`: a cubic spline with even knots, by the `weights` (k + 3,) of the bumps
    around the k + 1 knots.
    """

    weights: FloatArray
    low: float
    high: float

    def values(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(levels, slopes [levels/rad]) at `u`, beyond the ends those of the ends."""
        first, share, step = _place(u, self.low, self.high, self.weights.size)
        around = [self.weights[first + j] for j in range(4)]
        value = sum(w * c for w, c in zip(_bumps(share), around, strict=True))
        slope = sum(w * c for w, c in zip(_bump_slopes(share), around, strict=True))
        return np.asarray(value), np.asarray(slope) / step

    def weight(self, u: FloatArray) -> FloatArray:
        """1 inside, falling to 0 over the tenth at each end.

        Which samples fall into it must not matter.
        """
        edge = 0.1 * (self.high - self.low)
        return np.clip(np.minimum(u - self.low, self.high - u) / edge, 0.0, 1.0)


def matched(
    channel: Channel,
    wheel: WheelAngle,
    flanks: Flanks,
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
    n = flanks.passages
    good = np.isfinite(place)
    good[spoilt] = False
    good = np.tile(good[:n] & good[n:], 2)
    if good.sum() < 2 * LEAST:
        return place, se * _scatter(place, se), 1.0
    half = 0.5 * float(np.median((place[n:] - place[:n])[good[:n]]))
    flanks = flanks.moved(place)
    result, error = place.copy(), se.copy()
    for entries in (True, False):
        side = np.arange(n) + (0 if entries else n)
        steepness = float(np.median(np.abs(slope[side][good[side]])))
        low, high = (-OUTER * half, INNER * half) if entries else (-INNER * half, OUTER * half)
        form = _learn(
            channel, wheel, flanks.take(_some(side[good[side]])), (low, high), KNOTS / steepness
        )
        result[side], error[side], left = _shifts(channel, wheel, flanks.take(side), form)
        error[side] *= _about(left)
    by_form = result[n:] - result[:n]
    result += _difference(place - result, by_form, flanks, good)
    known = np.isfinite(result) & (np.abs(result - place) < FAR * se)
    result, error = np.where(known, result, place), np.where(known, error, se * _scatter(place, se))
    lead = _grown(channel, wheel, flanks.moved(result), result, error, slope, good)
    result += lead
    seen = good[:n] & np.isfinite(by_form) & np.isfinite(result[n:] - result[:n])
    magnified = _slope(by_form[seen], (result[n:] - result[:n])[seen])
    return result, error, max(magnified, 1.0)


def _slope(x: FloatArray, y: FloatArray) -> float:
    """By how much y (n,) grows with x (n,); 1 if x does not move."""
    x = x - x.mean()
    square = float(x @ x)
    return float(x @ y) / square if square > 0.0 else 1.0


def _place(u: FloatArray, low: float, high: float, size: int) -> tuple[IntArray, FloatArray, float]:
    """(the first of the four bumps that are not zero at `u`, the place, the width).

    The place is that within its interval, in [0, 1]; the width that of an interval.
    """
    step = (high - low) / (size - 3)
    x = np.clip((u - low) / step, 0.0, size - 3)
    first = np.clip(x.astype(np.int64), 0, size - 4)
    return first, x - first, step


def _bumps(s: FloatArray) -> tuple[FloatArray, ...]:
    """Values of the four cubic bumps (uniform B-splines) at the place s of an interval."""
    return (
        (1 - s) ** 3 / 6,
        (4 - 6 * s**2 + 3 * s**3) / 6,
        (1 + 3 * s + 3 * s**2 - 3 * s**3) / 6,
        s**3 / 6,
    )


def _bump_slopes(s: FloatArray) -> tuple[FloatArray, ...]:
    return -((1 - s) ** 2) / 2, (3 * s**2 - 4 * s) / 2, (1 + 2 * s - 3 * s**2) / 2, s**2 / 2


def _some(rows: IntArray) -> IntArray:
    return rows[np.linspace(0, rows.size - 1, min(rows.size, MOST)).astype(np.int64)]


def _learn(
    channel: Channel, wheel: WheelAngle, flanks: Flanks, reach: tuple[float, float], step: float
) -> FrontForm:
    """The least-squares cubic spline through the samples of all `flanks`, aligned by place."""
    low, high = reach
    size = max(round((high - low) / step), 4) + 3
    left, right = 1e-9 * np.eye(size), np.zeros(size)
    first, last = _samples(channel, wheel, flanks, reach)
    for group, start, values in groups(channel, first, last):
        _, u, y = normalised(
            values, start, channel, wheel, flanks.take(group), first[group], last[group]
        )
        inside = np.isfinite(y) & (u >= low) & (u <= high)
        at, share, _ = _place(u[inside], low, high, size)
        bumps = _bumps(share)
        for j, one in enumerate(bumps):
            right += np.bincount(at + j, one * y[inside], size)
            for k, other in enumerate(bumps):
                left += np.bincount((at + j) * size + at + k, one * other, size * size).reshape(
                    size, size
                )
    return FrontForm(np.asarray(np.linalg.solve(left, right), dtype=np.float64), low, high)


def _samples(
    channel: Channel, wheel: WheelAngle, flanks: Flanks, reach: tuple[float, float]
) -> tuple[IntArray, IntArray]:
    """First and last-but-one sample of each flank.

    From `reach` before to after its place, and a little more.
    """
    first, last = ranges(
        channel,
        wheel,
        flanks,
        np.full(flanks.angle.size, max(abs(r) for r in reach) + LONGEST * DEGREE),
    )
    return first, last


def _shifts(
    channel: Channel, wheel: WheelAngle, flanks: Flanks, form: FrontForm
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(places [rad] at which the form fits best, standard errors, misfits), shape (n,).

    The errors are by noise; a misfit is the root of what the form leaves over what noise does. NaN
    if samples are missing.
    """
    place, se, left = np.full((3, flanks.angle.size), np.nan)
    first, last = _samples(channel, wheel, flanks, (form.low, form.high))
    for group, start, values in groups(channel, first, last):
        part = flanks.take(group)
        owner, u, y = normalised(values, start, channel, wheel, part, first[group], last[group])
        lost = np.bincount(owner[~np.isfinite(y)], minlength=group.size) > 0
        u, y = np.nan_to_num(u, nan=10.0), np.nan_to_num(y)
        moved = np.zeros(group.size)
        for _ in range(STEPS):
            at = u - moved[owner]
            weight, (level, slope) = form.weight(at), form.values(at)
            known = np.bincount(owner, weight * slope**2, group.size)
            known[known == 0] = np.inf  # nothing tells the place: it stays
            step = -np.bincount(owner, weight * slope * (y - level), group.size) / known
            moved += np.clip(step, -LONGEST * DEGREE, LONGEST * DEGREE)
        # a level that is wrong by a share moves the fit by what its form times its slope says
        lever = np.bincount(owner, weight * slope * level, group.size) / known
        own = np.sqrt(np.bincount(owner, (weight * slope) ** 2, group.size)) / known
        noise = (
            np.hypot(own, lever * part.level_share)
            * part.noise
            / (np.abs(part.level) * part.rate**2)
        )
        lost |= np.isinf(known)
        place[group] = np.where(lost, np.nan, part.angle + moved)
        se[group] = np.hypot(noise, part.angle_noise)
        at = u - moved[owner]
        weight, (level, _) = form.weight(at), form.values(at)
        square = np.bincount(owner, weight * (y - level) ** 2, group.size)
        of_noise = (part.noise / (np.abs(part.level) * part.rate**2)) ** 2
        free = np.bincount(owner, weight, group.size) - 1.0  # the place is fitted
        left[group] = np.where(lost, np.nan, np.sqrt(square / np.maximum(free, 1.0) / of_noise))
    return place, se, left


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
    difference: FloatArray, width: FloatArray, flanks: Flanks, good: np.ndarray
) -> FloatArray:
    """How far crossings lie beyond matched places, shape (2 n,).

    Least squares on speed, its square, acceleration and width, for each side.
    """
    n = flanks.passages
    speed, ahead = flanks.rate[:n], flanks.ahead[:n]
    columns = [np.ones(n), speed, speed**2, ahead, width]
    result = np.full(2 * n, np.nan)
    for side in (slice(0, n), slice(n, 2 * n)):
        y, rows = difference[side], good[side] & np.isfinite(difference[side]) & np.isfinite(width)
        if rows.sum() < LEAST:
            continue
        middles = [float(np.mean(c[rows])) for c in columns]
        sizes = [max(float(np.std(c[rows])), 1e-12) for c in columns]
        design = np.stack(
            [
                np.ones(n),
                *((c - m) / s for c, m, s in zip(columns[1:], middles[1:], sizes[1:], strict=True)),
            ],
            axis=1,
        )
        for _ in range(3):
            solved = np.linalg.lstsq(design[rows], y[rows], rcond=1e-6)[0]
            left = y - np.nan_to_num(design) @ solved
            with np.errstate(invalid="ignore"):
                rows = rows & (np.abs(left) < 4 * 1.4826 * float(np.median(np.abs(left[rows]))))
        result[side] = design @ solved
    return result


def _grown(
    channel: Channel,
    wheel: WheelAngle,
    flanks: Flanks,
    place: FloatArray,
    se: FloatArray,
    slope: FloatArray,
    good: np.ndarray,
) -> FloatArray:
    """How much farther the flanks' steepest parts move than their half levels, shape (2 n,) [rad].

    With the patch's width, from its usual one, as much outwards on both sides, so that the middle
    stays; zero if the width hardly moves.
    """
    n = flanks.passages
    width, own = place[n:] - place[:n], np.hypot(se[:n], se[n:])
    known = good[:n] & np.isfinite(width) & np.isfinite(own)
    if known.sum() < LEAST:
        return np.zeros(2 * n)
    usual, spread = float(np.mean(width[known])), float(np.std(width[known]))
    if spread < MOVED * float(np.median(own[known])):
        return np.zeros(2 * n)
    grown = np.nan_to_num((width - usual) / spread)
    leads = []
    for side in (np.arange(n), n + np.arange(n)):
        rows = _some(side[known])
        steep = float(np.median(np.abs(slope[rows])))
        reach = min(FLANK_REACH / steep, 0.5 * usual)
        u, y, z = _around(channel, wheel, flanks.take(rows), grown[rows % n], reach)
        leads.append(_lead(u, y, z, reach))
    outwards = 0.5 * (leads[1] - leads[0])
    return np.concatenate([-outwards * grown, outwards * grown])


def _around(
    channel: Channel, wheel: WheelAngle, flanks: Flanks, grown: FloatArray, reach: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(angle from the front [rad], level, how much the patch has grown) of the samples (s,)."""
    parts: list[tuple[FloatArray, ...]] = []
    first, last = _samples(channel, wheel, flanks, (-2.0 * reach, 2.0 * reach))
    for group, start, values in groups(channel, first, last):
        owner, u, y = normalised(
            values, start, channel, wheel, flanks.take(group), first[group], last[group]
        )
        inside = np.isfinite(y) & (np.abs(u) < 2.0 * reach)
        parts.append((u[inside], y[inside], grown[group][owner[inside]]))
    u, y, z = (np.concatenate(part) for part in zip(*parts, strict=True))
    return u, y, z


def _lead(u: FloatArray, y: FloatArray, z: FloatArray, reach: float) -> float:
    """How far the steepest place leads the half level if z is one more [rad].

    By a polynomial whose coefficients are linear in z, in a window around the steepest place; zero
    if there is none.
    """
    powers = np.arange(DEGREE_OF_FLANK + 1)
    centre = 0.0
    for _ in range(CENTRINGS):
        x = (u - centre) / reach
        inside = np.abs(x) < 1.0
        weight = np.sqrt(1.0 - x[inside] ** 2)
        columns = weight[:, None] * x[inside, None] ** powers
        design = np.concatenate([columns, z[inside, None] * columns], axis=1)
        solved = np.linalg.lstsq(design, weight * y[inside], rcond=1e-9)[0]
        usual, change = solved[: powers.size], solved[powers.size :]
        steepest = _steepest(usual)
        if steepest is None:
            return 0.0
        centre += steepest * reach
    leads = []
    for form in (usual - change, usual + change):
        steepest = _steepest(form)
        half = None if steepest is None else _half_level(form, steepest)
        if steepest is None or half is None:
            return 0.0
        leads.append(steepest - half)
    return 0.5 * (leads[1] - leads[0]) * reach


def _steepest(form: FloatArray) -> float | None:
    """Where a polynomial in the window is steepest; None if that is near an end."""
    slope = np.polynomial.polynomial.polyder(form)
    turns = np.polynomial.polynomial.polyroots(np.polynomial.polynomial.polyder(slope))
    places = np.real(turns[(np.abs(np.imag(turns)) < 1e-9) & (np.abs(np.real(turns)) < 0.9)])
    if not places.size:
        return None
    return float(places[np.argmax(np.abs(np.polynomial.polynomial.polyval(places, slope)))])


def _half_level(form: FloatArray, near: float) -> float | None:
    """Where a polynomial is half of the level, next to a place; None if it is not."""
    x = np.linspace(-1.0, 1.0, 2001)
    above = np.polynomial.polynomial.polyval(x, form) > 0.5
    crossing = np.flatnonzero(above[1:] != above[:-1])
    if not crossing.size:
        return None
    left = int(crossing[np.argmin(np.abs(x[crossing] - near))])
    low, high = np.polynomial.polynomial.polyval(x[left : left + 2], form) - 0.5
    return float(x[left] + (x[left + 1] - x[left]) * low / (low - high))
