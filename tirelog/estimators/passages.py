"""Passages of a grating (or accelerometer) through the contact patch: the clock of every other estimator.

    Channel --passage_search--> rough middles and widths --template learnt from some, passage_fit on all--> Passages, a row a passage

One row is one passage, in the order of the log: its ordinal is the `revolution` of every table.  The *patch centre* is the zero of the
matched template, the middle between its half-level crossings (`passage_template`); all commands use it.  Only windows around the passages
are fitted, block by block at places fixed by the passages, so the rows do not depend on the size of the blocks that were read.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tirelog.dsp.noise import sample_noise
from tirelog.estimators.passage_fit import Fit, Start, Windows, fit, gather
from tirelog.estimators.passage_search import Pulses, decimate, find_pulses
from tirelog.estimators.passage_template import WIDEST_RAD, Template, learn
from tirelog.recording import BLOCK_SAMPLES, Channel, FloatArray

TURN_RAD = 2 * np.pi
#: width of a passage (half level) as a share of a turn, where the log is too short to tell
USUAL_WIDTH_TURNS = 0.06
#: two passages are one turn apart if the turn that the speeds beside them give lies in this range
ONE_TURN = (0.7, 1.4)
#: relative uncertainty of the speed from neighbouring passages, and from a pulse's width
STRETCH_NEIGHBOURS, STRETCH_WIDTH = 0.002, 0.1
#: the template: passages it is learnt from, in clusters of neighbours, and rounds
LEARNT_FROM, CLUSTERS, ROUNDS = 320, 16, 3
#: misfit [height] beyond which a pulse of unknown speed is no steady passage: the wheel stood in it or turned back
STANDING_MISFIT = 0.05


@dataclass(frozen=True)
class Passages:
    """Passages through the patch, in time order; arrays of shape (n,), n may be 0.

    index            fractional sample index of the patch centre
    time_s           its time; NaN where a passage is known to be there and its time is not
    time_se_s        standard error from the noise
    turn_before, turn_after   bool: the neighbouring passage is exactly one turn away
    period_before_s, period_after_s   to that neighbour, NaN where it is not one turn away
    omega_rad_s      wheel speed at the passage, positive; from the neighbours or, without them, from the pulse's stretch
    omega_se_rad_s   its standard error where it comes from the stretch, else NaN
    alpha_rad_s2     wheel acceleration at the passage; 0 where not known
    height, offset   of the template in this passage, patch upward (sign x recorded signal), channel's unit
    misfit           rms residual of the fit, channel's unit
    quality          words inside the passage's window (empty: ok)

    `noise`: sigma of one sample; `sign`: +1 where the patch is a maximum of the recorded signal, -1 where a minimum; `template`: None where
    the log has too few passages; `window_rad`: half window of the fit and of the quality words.
    """

    channel: str
    radius_m: float
    sign: float
    noise: float
    window_rad: float
    template: Template | None
    index: FloatArray
    time_s: FloatArray
    time_se_s: FloatArray
    turn_before: NDArray[np.bool_]
    turn_after: NDArray[np.bool_]
    omega_rad_s: FloatArray
    omega_se_rad_s: FloatArray
    alpha_rad_s2: FloatArray
    height: FloatArray
    offset: FloatArray
    misfit: FloatArray
    quality: tuple[frozenset[str], ...]

    def __len__(self) -> int:
        return int(self.time_s.size)

    @property
    def period_before_s(self) -> FloatArray:
        return np.where(self.turn_before, np.diff(self.time_s, prepend=np.nan), np.nan)

    @property
    def period_after_s(self) -> FloatArray:
        return np.where(self.turn_after, np.diff(self.time_s, append=np.nan), np.nan)

    @property
    def speed_m_s(self) -> FloatArray:
        """Speed at the passage over the rolling circumference; `estimators.speed` has the better one with its error."""
        return self.radius_m * self.omega_rad_s


def patch_sign(channel: Channel) -> float:
    """+1 where the patch is a maximum of the recorded signal, -1 where it is a minimum.

    Strain: minimum on the outer surface, maximum on the inner.  Radial acceleration is near zero in the patch and -omega^2 R (outward
    positive) outside, so the patch points away from the median, whichever way the sensor counts.
    """
    if channel.kind == "radial_acceleration":
        middle = np.nanmedian(channel.read(0, min(channel.size, BLOCK_SAMPLES))) if channel.size else -1.0
        return 1.0 if not middle > 0 else -1.0
    return 1.0 if channel.surface == "inner" else -1.0


def kinematics(time_s: FloatArray, turn_after: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
    """Wheel speed [rad/s] and acceleration [rad/s^2] at each passage, exact where the acceleration is constant; NaN at ends of a stretch.

    Through three passages one turn apart goes one parabola of the angle in time.
    """
    before = np.diff(time_s, prepend=np.nan)
    after = np.diff(time_s, append=np.nan)
    known = turn_after & np.concatenate([[False], turn_after[:-1]])
    before, after = np.where(known, before, np.nan), np.where(known, after, np.nan)
    mean_before, mean_after = TURN_RAD / before, TURN_RAD / after
    omega = (mean_before * after + mean_after * before) / (before + after)
    alpha = 2 * (mean_after - mean_before) / (before + after)
    return omega, alpha


def one_turn_apart(time_s: FloatArray, omega: FloatArray) -> NDArray[np.bool_]:
    """Whether the next passage is one turn later, shape (n,), False for the last: by the mean of the speeds at both ends."""
    turns = np.diff(time_s) * 0.5 * (omega[1:] + omega[:-1]) / TURN_RAD
    return np.append((turns > ONE_TURN[0]) & (turns < ONE_TURN[1]), False)[: time_s.size]


def _width_turns(time_s: FloatArray, width_s: FloatArray) -> float:
    """Width of a passage in turns: the median over passages of width over period."""
    if time_s.size < 2:
        return USUAL_WIDTH_TURNS
    if time_s.size == 2:
        share = width_s.mean() / (time_s[1] - time_s[0])
    else:
        share = float(np.median(2 * width_s[1:-1] / (time_s[2:] - time_s[:-2])))
    return share if 0.01 < share < 0.25 else USUAL_WIDTH_TURNS


def _start(channel: Channel, pulses: Pulses) -> tuple[Start, NDArray[np.bool_]]:
    """Rough centres, speeds and accelerations; and which passages have the next one a turn later."""
    time_s = channel.axis.at(pulses.middle)
    width_s = pulses.width / channel.axis.rate_Hz
    from_width = TURN_RAD * _width_turns(time_s, width_s) / width_s
    turn_after = one_turn_apart(time_s, from_width)
    omega, alpha = kinematics(time_s, turn_after)
    known = np.isfinite(omega) & (np.abs(omega / from_width - 1) < 0.5)
    start = Start(
        time_s,
        pulses.middle,
        np.where(known, omega, from_width),
        np.where(known, alpha, 0.0),
        np.where(known, STRETCH_NEIGHBOURS, STRETCH_WIDTH),
    )
    return start, turn_after


def _clusters(good: np.ndarray) -> list[np.ndarray]:
    """Up to LEARNT_FROM of the passages `good`, as clusters of neighbours spread over the log."""
    if good.size <= LEARNT_FROM:
        return [good[k : k + LEARNT_FROM // CLUSTERS] for k in range(0, good.size, LEARNT_FROM // CLUSTERS)]
    size = LEARNT_FROM // CLUSTERS
    firsts = np.linspace(0, good.size - size, CLUSTERS).astype(np.int64)
    return [good[k : k + size] for k in firsts]


def _learn(channel: Channel, start: Start, pulses: Pulses, sign: float, noise: float, extremes: tuple[float, float]) -> Template | None:
    """The template, from passages whose speed is known; each round fits them with the template of the round before."""
    good = np.flatnonzero(start.stretch == STRETCH_NEIGHBOURS)
    if not good.size:
        good = np.arange(len(pulses))
    clusters = _clusters(good)
    if not clusters:
        return None
    window = min(WIDEST_RAD, 3.0 * 0.5 * float(np.median(pulses.width[good] / channel.axis.rate_Hz * start.omega[good])))
    starts = [start.take(cluster) for cluster in clusters]
    windows = [gather(channel, part, window, sign, extremes) for part in starts]
    offset = [pulses.base[cluster] for cluster in clusters]
    height = [pulses.height[cluster] for cluster in clusters]
    template: Template | None = None
    for _ in range(ROUNDS):
        phi, values = _laid_over(windows, starts, offset, height)
        template = learn(phi, values, window)
        if template is None:
            return None
        fits = [fit(w, template, s, h, noise) for w, s, h in zip(windows, starts, height, strict=True)]
        offset, height = [f.offset for f in fits], [np.abs(f.height) for f in fits]
        starts = [Start(f.time_s, s.index, s.omega, s.alpha, s.stretch) for s, f in zip(starts, fits, strict=True)]
    return template


def _laid_over(
    windows: list[Windows], starts: list[Start], offset: list[FloatArray], height: list[FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Angles and scaled values of all windows' good samples."""
    phis, scaled = [], []
    for part, start, base, tall in zip(windows, starts, offset, height, strict=True):
        tau = part.time_s - start.time_s[part.row]
        phi = (start.omega[part.row] + 0.5 * start.alpha[part.row] * tau) * tau
        value = (part.values - base[part.row]) / tall[part.row]
        usable = np.isfinite(value) & ~part.clipped & (np.abs(value) < 2.0)
        phis.append(phi[usable])
        scaled.append(value[usable])
    return np.concatenate(phis), np.concatenate(scaled)


def _fit_all(
    channel: Channel, start: Start, height: FloatArray, template: Template, sign: float, noise: float, extremes: tuple[float, float]
) -> Fit:
    """All rows, a block of the log at a time."""
    block = np.floor(start.index / BLOCK_SAMPLES)
    edges = np.concatenate([[0], np.flatnonzero(np.diff(block)) + 1, [block.size]])
    parts = []
    for low, high in pairwise(edges):
        some = start.take(slice(low, high))
        windows = gather(channel, some, template.window_rad, sign, extremes)
        parts.append(fit(windows, template, some, height[low:high], noise))
    return Fit.concatenate(parts)


def _rough(channel: Channel, start: Start, pulses: Pulses, noise: float) -> Fit:
    """Rows without a template: the middle of the half-level crossings, with an error of a tenth of the width."""
    n = len(pulses)
    no = np.zeros(n, bool)
    width_s = pulses.width / channel.axis.rate_Hz
    nan = np.full(n, np.nan)
    return Fit(start.time_s, 0.1 * width_s, start.omega, nan, pulses.height, pulses.base, nan, np.zeros(n, np.int64), no, no, no, no)


def _quality(channel: Channel, found: Fit, standing: NDArray[np.bool_], index: FloatArray, reach: FloatArray) -> list[set[str]]:
    """Words for what lies inside each row's window."""
    words: list[set[str]] = [set() for _ in range(index.size)]
    marks = {"lost_peak": found.lost, "spike": found.spike, "clipped": found.clipped, "edge_of_log": found.outside, "standstill": standing}
    for word, where in marks.items():
        for k in np.flatnonzero(where):
            words[k].add(word)
    gaps = channel.axis.first[1:].astype(float)
    ranges = [(gap - 0.5, gap - 0.5, "gap") for gap in gaps] + [(float(a), float(b - 1), word) for a, b, word in channel.flags]
    for low, high, word in ranges:
        for k in np.flatnonzero((index + reach >= low) & (index - reach <= high)):
            words[k].add(word)
    return words


def find_passages(channel: Channel, radius_m: float, block_samples: int = BLOCK_SAMPLES) -> Passages:
    """The passages of `channel` (strain or radial acceleration), `radius_m` the rolling radius.

    The rows do not depend on `block_samples`.  A log without passages, or all lost, gives no rows.
    """
    sign, noise = patch_sign(channel), sample_noise(channel)
    data = decimate(channel, sign, block_samples)
    pulses = find_pulses(data, noise if np.isfinite(noise) else 0.0)
    n = len(pulses)
    if not n:
        return _none(channel, radius_m, sign, noise)
    start, turn_after = _start(channel, pulses)
    template = _learn(channel, start, pulses, sign, noise, data.extremes)
    if template is None:
        found, window = _rough(channel, start, pulses, noise), float(np.median(pulses.width / channel.axis.rate_Hz * start.omega))
    else:
        found, window = _fit_all(channel, start, pulses.height, template, sign, noise, data.extremes), template.window_rad
    unknown = start.stretch == STRETCH_WIDTH
    standing = unknown & (found.misfit > np.maximum(STANDING_MISFIT * np.abs(found.height), 3 * noise)) & (template is not None)
    width_s = pulses.width / channel.axis.rate_Hz
    time_s = np.where(standing, start.time_s, found.time_s)
    time_se = np.where(standing, 0.25 * width_s, found.time_se_s)
    omega, alpha = kinematics(time_s, turn_after)
    omega = np.where(np.isfinite(omega), omega, found.omega)
    index = pulses.middle + (time_s - start.time_s) * channel.axis.rate_Hz
    reach = window / omega * channel.axis.rate_Hz
    words = _quality(channel, found, standing, index, reach)
    return Passages(
        channel.name,
        radius_m,
        sign,
        noise,
        window,
        template,
        index,
        time_s,
        time_se,
        np.concatenate([[False], turn_after[:-1]]),
        turn_after,
        omega,
        np.where(unknown, found.omega_se, np.nan),
        np.nan_to_num(alpha),
        found.height,
        found.offset,
        found.misfit,
        tuple(frozenset(w) for w in words),
    )


def _none(channel: Channel, radius_m: float, sign: float, noise: float) -> Passages:
    """No passage at all."""
    empty, no = np.zeros(0), np.zeros(0, bool)
    return Passages(
        channel.name, radius_m, sign, noise, 0.0, None, empty, empty, empty, no, no, empty, empty, empty, empty, empty, empty, ()
    )
