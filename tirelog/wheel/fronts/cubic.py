"""Where the flanks of the patch signal cross half of the level outside, each by a cubic of its own.

    Flanks, half widths of the windows --normalised samples--> weighted cubic least squares
        --root--> place, standard error, slope

The cubic follows the flank's own shape, so nothing is assumed about it.
"""

from __future__ import annotations

import numpy as np

from tirelog.data.recording import Channel
from tirelog.vocabulary.arrays import FloatArray, IntArray
from tirelog.vocabulary.quality import Quality, QualityFlags, marked, none_of
from tirelog.wheel.angle import WheelAngle
from tirelog.wheel.fronts.dips import DEGREE
from tirelog.wheel.fronts.samples import Flanks, groups, normalised, ranges

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
