"""The two fronts of every passage of an in-tire accelerometer, to a few hundredths of a degree (P4 section IV B).

    Dips (coarse) --samples within a few degrees of each front--> cubic through the flank --half of the level--> Fronts

A front is where the signal, divided by Omega^2 and with gravity's part subtracted, crosses half of the level outside, extrapolated
from beside it.  Inside the patch the tread moves straight and the true acceleration is nothing, so half of the level is a fixed
share of the step at every speed; a fixed threshold in m/s^2 would let the width shrink with speed (errata).  The cubic follows the
flank's own shape, so nothing is assumed about it; its error at the crossing is a tenth above the bound for a known flank.

Angles [rad] are those of `WheelAngle`.  Everything is worked out for all fronts of a piece of the log at once.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.ndimage import median_filter

from tirelog.estimators.passage_bins import DEGREE, Dips, binned, find_dips
from tirelog.estimators.wheel_angle import WheelAngle
from tirelog.recording import Channel, FloatArray, IntArray

GRAVITY_M_S2 = 9.80665
#: samples read at once
PIECE = 1 << 17
#: half width of the flank's window: this share of the level over the flank's median slope, within bounds [deg], from a first guess
FLANK_SHARE, NARROW, WIDE, FIRST_GUESS = 1.5, 0.7, 6.0, 2.5
#: passages before and after the middle of the log that the slope is learnt from
LEARN_FROM = 150
#: samples are read so much wider, for a place that was a little off [deg]
MARGIN = 1.0
#: samples that a flank has at least
LEAST_SAMPLES = 7


@dataclass(frozen=True)
class Fronts:
    """A row a passage, shape (n,), passages that were expected and not found included (NaN).

    `entry_rad`, `exit_rad` wheel angles of the fronts, `entry_se_rad`, `exit_se_rad` their standard errors from noise (accelerometer and
    wheel angle), `expected_rad` where the passage's middle was looked for, `words` what is wrong with it.
    `sign` of the level outside as recorded, `level_m` its median over Omega^2, `gravity` True where the signal holds gravity,
    `turn_rad` is the wheel angle from passage to passage, 2 pi if the encoder's steps are right.
    """

    expected_rad: FloatArray
    entry_rad: FloatArray
    exit_rad: FloatArray
    entry_se_rad: FloatArray
    exit_se_rad: FloatArray
    words: list[set[str]]
    sign: int
    level_m: float
    gravity: bool
    turn_rad: float

    def __len__(self) -> int:
        return int(self.entry_rad.size)


def gravity_in(dips: Dips, sign: int) -> bool:
    """Whether the level holds gravity's one per turn.

    Least squares of level, its own once-per-turn part and gravity over all degrees beside the patch; where the speed hardly changes the
    second and third cannot be told apart and the second is left out.  Gravity is left in the model unless the data speak against it.
    """
    normal = dips.normal.sum(axis=0)
    left, right = normal[:, :3], normal[:, 3]
    scale = np.sqrt(np.maximum(np.diag(left), 1e-300))
    unit = left / np.outer(scale, scale)
    columns = [0, 1, 2] if np.linalg.cond(unit) < 3e3 else [0, 2]
    solved = np.linalg.lstsq(unit[np.ix_(columns, columns)], (right / scale)[columns], rcond=1e-12)[0] / scale[columns]
    return bool(sign * solved[-1] > 0.3 * GRAVITY_M_S2)


def find_fronts(channel: Channel, wheel: WheelAngle, radius_m: float, limits: tuple[float, float] = (-np.inf, np.inf)) -> Fronts | None:
    """All passages of an accelerometer channel; None where it has none.  `radius_m` the rolling radius, `limits` where it clips."""
    dips, _ = find_dips(binned(channel, wheel.angle))
    if dips is None or dips.entry_rad.size < 3:
        return None
    sign = int(np.sign(np.median(dips.level)))
    width, turn = np.median(dips.exit_rad - dips.entry_rad), _turn(dips)
    dips = dips.take((dips.exit_rad - dips.entry_rad < 1.7 * width) & (dips.exit_rad - dips.entry_rad > 0.55 * width))
    if not _recurs(dips, turn):
        return None
    dips, expected, row = _expected(dips.take(np.sign(dips.level) == sign), wheel, turn)
    gravity = gravity_in(dips, sign)
    flanks = _flanks(dips, wheel, channel, radius_m, sign * GRAVITY_M_S2 if gravity else 0.0)
    n = row.size
    window = np.full(2, FIRST_GUESS * DEGREE)
    some = slice(max(n // 2 - LEARN_FROM, 0), n // 2 + LEARN_FROM)
    for _ in range(2):
        part = flanks.take(np.concatenate([np.arange(n)[some], n + np.arange(n)[some]]))
        slope = _crossings(channel, wheel, part, _windows(channel, part, window), limits)[2]
        window = np.clip([FLANK_SHARE / _median(np.abs(s)) for s in np.split(slope, 2)], NARROW * DEGREE, WIDE * DEGREE)
    place, se, _, words = _crossings(channel, wheel, flanks, _windows(channel, flanks, window), limits)
    form = _form(place[n:] - place[:n], np.hypot(se[:n], se[n:]))
    full = np.full((4, expected.size), np.nan)
    full[:, row] = place[:n], place[n:], se[:n] * form, se[n:] * form
    marks: list[set[str]] = [{"lost_peak"} for _ in expected]
    saturated = np.abs(flanks.level[:n]) * flanks.rate[:n] ** 2 > 0.95 * min(-limits[0], limits[1])
    for k, at in enumerate(row):
        marks[at] = words.get(k, set()) | words.get(n + k, set()) | ({"clipped"} if saturated[k] else set())
    level = abs(float(np.median(dips.level)))
    return Fronts(expected, full[0], full[1], full[2], full[3], marks, sign, level, gravity, turn)


def _turn(dips: Dips) -> float:
    """Wheel angle from passage to passage [rad]: 2 pi, if the encoder has as many steps as the setup says."""
    middle = 0.5 * (dips.entry_rad + dips.exit_rad)
    return float(np.median(np.diff(middle)))


def _recurs(dips: Dips, turn: float) -> bool:
    """Whether most dips come after a whole number of like turns; noise does not."""
    steps = np.diff(0.5 * (dips.entry_rad + dips.exit_rad)) / turn
    return dips.entry_rad.size >= 3 and turn > 0.3 * np.pi and float(np.mean(np.abs(steps - np.rint(steps)) < 0.03)) > 0.6


def _expected(dips: Dips, wheel: WheelAngle, turn: float) -> tuple[Dips, FloatArray, IntArray]:
    """(dips that recur once a turn, expected middles of all passages [rad], the dips' rows among them)."""
    middle = 0.5 * (dips.entry_rad + dips.exit_rad)
    stretch = wheel.angle.stretch_at(wheel.angle.time_at(middle))
    kept = np.ones(middle.size, bool)
    if abs(turn / (2 * np.pi) - 1) < 0.01:
        for number in np.unique(stretch):
            rows = np.flatnonzero(stretch == number)
            usual = np.angle(np.exp(1j * middle[rows]).sum())
            usual += float(np.median(np.angle(np.exp(1j * (middle[rows] - usual)))))
            kept[rows] = np.abs(np.angle(np.exp(1j * (middle[rows] - usual)))) < 15 * DEGREE
    dips, middle = dips.take(kept), middle[kept]
    turns = np.maximum(np.rint(np.diff(middle) / turn).astype(np.int64), 1)
    row = np.concatenate([[0], np.cumsum(turns)])
    expected = np.interp(np.arange(row[-1] + 1), row, middle)
    return dips, expected, row


@dataclass(frozen=True)
class _Flanks:
    """Both fronts of n passages, shape (2 n,), entries first.  `angle` where the front is thought to be, `middle` the patch's middle,
    `level`, `tilt` of a / Omega^2 outside with gravity's part taken off, `gravity` [m/s^2] in the signal, `ahead` the vehicle's
    acceleration, `noise` [m/s^2] of a sample, `level_share` standard error of the level for a noise of one."""

    angle: FloatArray
    middle: FloatArray
    level: FloatArray
    tilt: FloatArray
    noise: FloatArray
    level_share: FloatArray
    gravity: float
    ahead: FloatArray
    rate: FloatArray

    def take(self, which: IntArray) -> _Flanks:
        fewer: dict[str, Any] = {k: v[which] for k, v in self.__dict__.items() if isinstance(v, np.ndarray)}
        return replace(self, **fewer)

    def moved(self, angle: FloatArray) -> _Flanks:
        good = np.isfinite(angle) & (np.abs(angle - self.angle) < 3 * DEGREE)
        return replace(self, angle=np.where(good, angle, self.angle))


def _flanks(dips: Dips, wheel: WheelAngle, channel: Channel, radius_m: float, gravity: float) -> _Flanks:
    middle = 0.5 * (dips.entry_rad + dips.exit_rad)
    level = dips.level - gravity * dips.gravity_level
    tilt = dips.tilt - gravity * dips.gravity_tilt
    time = wheel.angle.time_at(middle)
    span = 0.1
    ahead = radius_m * (wheel.speed_rad_s(time + span / 2) - wheel.speed_rad_s(time - span / 2)) / span
    noise = np.full(middle.size, float(np.median(dips.noise_m_s2)))
    twice = [np.tile(x, 2) for x in (middle, level, tilt, noise, dips.level_share, np.nan_to_num(ahead), wheel.speed_rad_s(time))]
    middle2, level2, tilt2, noise2, share2, ahead2, rate2 = twice
    return _Flanks(np.concatenate([dips.entry_rad, dips.exit_rad]), middle2, level2, tilt2, noise2, share2, gravity, ahead2, rate2)


def _median(x: FloatArray) -> float:
    return float(np.nanmedian(x)) if np.isfinite(x).any() else 1.0 / DEGREE


def _windows(channel: Channel, flanks: _Flanks, window: FloatArray) -> FloatArray:
    """Half width [rad] of each front's window: `window` (2,) for entries and exits, or wider where it would hold too few samples."""
    least = 0.5 * (LEAST_SAMPLES + 0.5) * flanks.rate / channel.axis.rate_Hz
    return np.maximum(np.repeat(window, flanks.angle.size // 2), least)


def _ranges(channel: Channel, wheel: WheelAngle, flanks: _Flanks, windows: FloatArray) -> tuple[IntArray, IntArray]:
    """First and last-but-one sample index of each front's window."""
    order = np.argsort(flanks.angle)
    first, last = np.zeros(order.size, np.int64), np.zeros(order.size, np.int64)
    for bound, shift in ((first, -1.0), (last, 1.0)):
        time = wheel.angle.time_at(flanks.angle[order] + shift * windows[order])
        bound[order] = np.ceil(channel.axis.index(np.nan_to_num(time, nan=-1.0)))
    first = np.clip(first, 0, channel.size)
    return first, np.clip(last, first, channel.size)


def _crossings(
    channel: Channel, wheel: WheelAngle, flanks: _Flanks, windows: FloatArray, limits: tuple[float, float]
) -> tuple[FloatArray, FloatArray, FloatArray, dict[int, set[str]]]:
    """(angle of the half-level crossing, its standard error, the slope there [levels/rad], words) of all fronts; words only where there
    are some."""
    first, last = _ranges(channel, wheel, flanks, windows + MARGIN * DEGREE)
    result = np.full((3, first.size), np.nan)
    words: dict[int, set[str]] = defaultdict(set)
    order = np.argsort(first, kind="stable")
    at = 0
    while at < order.size:
        start = int(first[order[at]])
        until = at + max(int(np.searchsorted(first[order[at:]], start + PIECE)), 1)
        group = order[at:until]
        stop = int(last[group].max(initial=start))
        at = until
        if stop - start > 4 * PIECE:
            group = group[last[group] - start <= 4 * PIECE]
            stop = int(last[group].max(initial=start))
        if stop <= start:
            continue
        values, part = channel.read(start, stop), flanks.take(group)
        entries = group < flanks.angle.size // 2
        for _ in range(2):  # the second time around the place that the first has found
            low, high = (np.clip(edge, first[group], last[group]) for edge in _ranges(channel, wheel, part, windows[group]))
            result[:, group], lost = _solve(values[: stop - start], start, channel, wheel, part, windows[group], low, high, entries)
            part = part.moved(result[0, group])
        for k in group[lost].tolist():
            words[k].add("gap")
        beyond = np.concatenate([[0], np.cumsum((values <= limits[0]) | (values >= limits[1]))])
        for k in group[beyond[last[group] - start] > beyond[first[group] - start]].tolist():
            words[k].add("clipped")
    short = last - first < 5
    for k in np.flatnonzero(short).tolist():
        words[k].add("edge_of_log" if first[k] < 1 or last[k] >= channel.size - 1 else "gap")
    return result[0], result[1], result[2], words


def _form(width: FloatArray, se: FloatArray) -> FloatArray:
    """How much more the width scatters from passage to passage than its noise says, shape (n,), at least 1, over 101 passages.

    The cubic is not the flank's exact form, and samples fall on it differently from passage to passage.
    """
    scatter = np.abs(width[1:-1] - 0.5 * (width[:-2] + width[2:])) / (0.6745 * np.sqrt(1.5) * se[1:-1])
    if scatter.size < 9:
        return np.ones(width.size)
    scatter = np.nan_to_num(scatter, nan=1.0)
    usual = median_filter(scatter, min(101, scatter.size), mode="reflect")
    return np.maximum(np.concatenate([usual[:1], usual, usual[-1:]]), 1.0)


def _solve(
    values: FloatArray, start: int, channel: Channel, wheel: WheelAngle, flanks: _Flanks, windows: FloatArray, first: IntArray,
    last: IntArray, entries: np.ndarray,
) -> tuple[FloatArray, np.ndarray]:  # fmt: skip
    """((3, n) place, standard error and slope, n samples lost) by cubic least squares over n fronts, whose samples [first, last) lie in
    `values` from index `start`; `entries` (n,) where the signal leaves its level."""
    n, sizes = first.size, last - first
    owner = np.repeat(np.arange(n), sizes)
    index = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes) + np.repeat(first, sizes)
    theta = wheel.angle.at(channel.axis.at(index.astype(np.float64)))
    a = values[index - start]
    u = (theta - flanks.angle[owner]) / windows[owner]
    phi = theta - flanks.middle[owner]
    a = a - flanks.gravity * np.cos(phi) - np.where(flanks.gravity != 0, np.sign(flanks.gravity) * flanks.ahead[owner] * np.sin(phi), 0.0)
    scale = flanks.rate[owner] ** 2 * (flanks.level[owner] + flanks.tilt[owner] * phi)
    y = a / scale - 0.5
    good = np.isfinite(y) & np.isfinite(u)
    lost = np.bincount(owner[~good], minlength=n) > 0
    owner, u, y = owner[good], u[good], y[good]
    weight = np.maximum(1.0 - u * u, 0.0)  # a window without edges: which samples fall into it must not matter
    powers = np.stack([np.bincount(owner, weight * u**k, n) for k in range(7)])
    squares = np.stack([np.bincount(owner, weight**2 * u**k, n) for k in range(7)])
    right = np.stack([np.bincount(owner, weight * y * u**k, n) for k in range(4)], axis=-1)
    left, between = (np.stack([p[k : k + 4] for k in range(4)]).transpose(2, 0, 1) for p in (powers, squares))
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
    se = np.hypot(noise / np.abs(np.where(sure, slope, 1.0)) * windows, wheel.angle.noise_rad)
    place = flanks.angle + root * windows
    return np.where(sure, np.stack([place, se, slope / windows]), np.nan), lost
