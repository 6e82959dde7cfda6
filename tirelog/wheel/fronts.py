"""Fronts of the contact patch in a radial acceleration, found, sampled and matched."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tirelog.data.recording import Channel
from tirelog.vocabulary.arrays import FloatArray, IntArray
from tirelog.vocabulary.quality import Quality, QualityFlags, marked, none_of
from tirelog.vocabulary.units import STANDARD_GRAVITY_M_S2
from tirelog.wheel.angle import WheelAngle
from tirelog.wheel.coarse_patch import (
    DEGREE,
    Dips,
    Flanks,
    binned,
    find_dips,
    flanks_of,
    groups,
    normalised,
    ranges,
)
from tirelog.wheel.matching import matched

# ---- Where the flanks of the patch signal cross half of the level outside, each by a cubic of
# its own.
#
#     Flanks, half widths of the windows --normalised samples--> weighted cubic least squares
#         --root--> place, standard error, slope
#
# The cubic follows the flank's own shape, so nothing is assumed about it.


#: samples are read so much wider, for a place that was a little off [deg]; twice as wide reads
#: that much more
MARGIN = 1.0
#: samples that a flank has at least: a cubic takes four, and three are left to tell the noise;
#: twice as many widen windows with few samples, and take more of the front's bend into them
LEAST_SAMPLES = 7


def at_least(channel: Channel, flanks: Flanks, window: FloatArray) -> FloatArray:
    """Half width [rad] of each front's window.

    `window` (2,) of entries and of exits, wider if it would hold too few samples.
    """
    least = 0.5 * (LEAST_SAMPLES + 0.5) * flanks.rate / channel.axis.rate_Hz
    return np.maximum(np.repeat(window, flanks.angle.size // 2), least)


def crossings(
    channel: Channel,
    wheel: WheelAngle,
    flanks: Flanks,
    windows: FloatArray,
    limits: tuple[float, float],
) -> tuple[FloatArray, FloatArray, FloatArray, QualityFlags]:
    """(angle of the crossing, its standard error, the slope there, quality) of all fronts.

    The crossing of the half level [rad]; the slope in levels/rad.
    """
    first, last = ranges(channel, wheel, flanks, windows + MARGIN * DEGREE)
    result = np.full((3, first.size), np.nan)
    quality = none_of(first.size)
    for group, start, values in groups(channel, first, last):
        part = flanks.take(group)
        entries = group < flanks.passages
        for _ in range(2):  # the second time around the place that the first has found
            low, high = (
                np.clip(edge, first[group], last[group])
                for edge in ranges(channel, wheel, part, windows[group])
            )
            result[:, group], lost = _solve(
                values, start, channel, wheel, part, windows[group], low, high, entries
            )
            part = part.moved(result[0, group])
        beyond = np.concatenate([[0], np.cumsum((values <= limits[0]) | (values >= limits[1]))])
        clipped = beyond[last[group] - start] > beyond[first[group] - start]
        quality[group] |= marked(lost, Quality.GAP) | marked(clipped, Quality.CLIPPED)
    short = last - first < 5
    at_end = (first < 1) | (last >= channel.size - 1)
    quality |= marked(short & at_end, Quality.EDGE_OF_LOG) | marked(short & ~at_end, Quality.GAP)
    return result[0], result[1], result[2], quality


def _solve(
    values: FloatArray, start: int, channel: Channel, wheel: WheelAngle, flanks: Flanks,
    windows: FloatArray, first: IntArray, last: IntArray, entries: np.ndarray,
) -> tuple[FloatArray, np.ndarray]:  # fmt: skip
    """((3, n) place, standard error and slope, n samples lost) by cubic least squares.

    Of n fronts, whose samples [first, last) lie in `values` from index `start`; `entries` (n,):
    whether the signal leaves its level there.
    """
    n = first.size
    owner, u, y = normalised(values, start, channel, wheel, flanks, first, last)
    u, y = u / windows[owner], y - 0.5
    good = np.isfinite(y) & np.isfinite(u)
    lost = np.bincount(owner[~good], minlength=n) > 0
    owner, u, y = owner[good], u[good], y[good]
    weight = np.maximum(
        1.0 - u * u, 0.0
    )  # a window without edges: which samples fall into it must not matter
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
    level = np.abs(flanks.level) * flanks.rate**2
    noise = np.hypot(share, 0.5 * flanks.level_share) * flanks.noise / level
    falls = np.where(entries, slope < 0, slope > 0)
    sure = enough & falls & (np.abs(root) < 1)
    se = np.hypot(noise / np.abs(np.where(sure, slope, 1.0)) * windows, flanks.angle_noise)
    place = flanks.angle + root * windows
    return np.where(sure, np.stack([place, se, slope / windows]), np.nan), lost


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


@dataclass(frozen=True)
class Fronts:
    """One row per passage, shape (n,), those that were not found included (NaN).

    `entry_rad`, `exit_rad` wheel angles of the fronts, `entry_se_rad`, `exit_se_rad` their standard
    errors from noise (accelerometer and wheel angle) and misfit, `expected_rad` where the passage's
    middle was looked for, `quality` its flags. `sign` of the level outside as recorded, `level_m`
    its median over Omega^2, `gravity` True if the signal holds gravity, `turn_rad` is the wheel
    angle from passage to passage, 2 pi if the encoder's steps are right; `magnified` how much more
    of the noise a width has than its fronts.
    """

    expected_rad: FloatArray
    entry_rad: FloatArray
    exit_rad: FloatArray
    entry_se_rad: FloatArray
    exit_se_rad: FloatArray
    quality: QualityFlags
    sign: int
    level_m: float
    gravity: bool
    turn_rad: float
    magnified: float = 1.0

    def __len__(self) -> int:
        return int(self.entry_rad.size)


def gravity_in(dips: Dips, sign: int) -> bool:
    """Whether the level holds gravity's one per turn.

    Least squares of level, its own once-per-turn part and gravity over all degrees beside the
    patch; if the speed hardly changes the second and third cannot be told apart and the second
    is left out. Gravity is left in the model unless the data speak against it.
    """
    normal = dips.normal.sum(axis=0)
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
) -> Fronts | None:
    """All passages of an accelerometer channel; None if it has none.

    `radius_m` the rolling radius, `limits` at which it clips.
    """
    found, _ = find_dips(binned(channel, wheel.angle))
    passages = _passages(found)
    if found is None or passages is None:
        return None
    sign = int(np.sign(np.median(found.level)))
    dips, turn = passages
    dips, expected, row = _expected(dips.take(np.sign(dips.level) == sign), wheel, turn)
    gravity = gravity_in(dips, sign)
    flanks = flanks_of(
        dips, wheel, channel, radius_m, sign * STANDARD_GRAVITY_M_S2 if gravity else 0.0
    )
    n = row.size
    window = np.full(2, FIRST_GUESS * DEGREE)
    some = slice(max(n // 2 - LEARN_FROM, 0), n // 2 + LEARN_FROM)
    for _ in range(2):
        part = flanks.take(np.concatenate([np.arange(n)[some], n + np.arange(n)[some]]))
        slope = crossings(channel, wheel, part, at_least(channel, part, window), limits)[2]
        window = np.clip(
            [FLANK_SHARE / _median(np.abs(s)) for s in np.split(slope, 2)],
            NARROW * DEGREE,
            WIDE * DEGREE,
        )
    place, se, slope, quality = crossings(
        channel, wheel, flanks, at_least(channel, flanks, window), limits
    )
    place, se, magnified = matched(
        channel, wheel, flanks, (place, se, slope), np.flatnonzero(quality)
    )
    full = np.full((4, expected.size), np.nan)
    full[:, row] = place[:n], place[n:], se[:n], se[n:]
    saturated = np.abs(flanks.level[:n]) * flanks.rate[:n] ** 2 > 0.95 * min(-limits[0], limits[1])
    flags = marked(np.ones(expected.size, bool), Quality.LOST_PEAK)
    flags[row] = quality[:n] | quality[n:] | marked(saturated, Quality.CLIPPED)
    level = abs(float(np.median(dips.level)))
    return Fronts(
        expected, full[0], full[1], full[2], full[3], flags, sign, level, gravity, turn, magnified
    )


def patch_turn(channel: Channel, wheel: WheelAngle) -> float:
    """Wheel angle from passage to passage [rad], by the first piece of the log that shows it.

    NaN if none has PASSAGES of them.
    """
    for piece in binned(channel, wheel.angle):
        found = _passages(find_dips(iter([piece]))[0])
        if found and found[0].entry_rad.size >= PASSAGES:
            return found[1]
    return float("nan")


def _passages(dips: Dips | None) -> tuple[Dips, float] | None:
    """(dips of the usual width, wheel angle between them [rad]); None if they do not recur."""
    if dips is None or dips.entry_rad.size < 3:
        return None
    width, turn = np.median(dips.exit_rad - dips.entry_rad), _turn(dips)
    dips = dips.take(
        (dips.exit_rad - dips.entry_rad < 1.7 * width)
        & (dips.exit_rad - dips.entry_rad > 0.55 * width)
    )
    return (dips, turn) if _recurs(dips, turn) else None


def _turn(dips: Dips) -> float:
    """Wheel angle from passage to passage [rad].

    2 pi, if the encoder has as many steps as the setup says.
    """
    middle = 0.5 * (dips.entry_rad + dips.exit_rad)
    return float(np.median(np.diff(middle)))


def _recurs(dips: Dips, turn: float) -> bool:
    """Whether most dips come after a whole number of like turns; noise does not."""
    steps = np.diff(0.5 * (dips.entry_rad + dips.exit_rad)) / turn
    return (
        dips.entry_rad.size >= 3
        and turn > 0.3 * np.pi
        and float(np.mean(np.abs(steps - np.rint(steps)) < 0.03)) > 0.6
    )


def _expected(dips: Dips, wheel: WheelAngle, turn: float) -> tuple[Dips, FloatArray, IntArray]:
    """(dips that recur once per turn, expected middles of all passages, the dips' rows).

    The middles in rad; the rows are those of the dips among the passages.
    """
    middle = 0.5 * (dips.entry_rad + dips.exit_rad)
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
    dips, middle = dips.take(kept), middle[kept]
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


def _median(x: FloatArray) -> float:
    return float(np.nanmedian(x)) if np.isfinite(x).any() else 1.0 / DEGREE
