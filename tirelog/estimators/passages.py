"""Passages of a grating (or accelerometer) through the contact patch: the clock of every other estimator.

    Channel --passage_search--> rough middles and widths
            --passage_learn: a template from some; passage_fit: all by it--> times
            --passage_kinematics--> speeds --passage_marks--> words --> Passages, a row a passage

One row is one passage, in the order of the log: its ordinal is the `revolution` of every table.  The *patch centre* is the zero of the
matched template, the middle between its half-level crossings (`passage_template`); all commands use it.  Only windows around the passages
are fitted, a block at a time at places fixed by the passages, so the rows do not depend on the size of the blocks that were read.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.dsp.noise import sample_noise
from tirelog.estimators import passage_marks as marks
from tirelog.estimators.passage_fit import Fit, Start, fit, gather
from tirelog.estimators.passage_kinematics import TURN_RAD, kinematics, turns_between
from tirelog.estimators.passage_learn import learn_template
from tirelog.estimators.passage_screen import one_turn, screen, width_turns
from tirelog.estimators.passage_search import Pulses, search
from tirelog.estimators.passage_template import Template
from tirelog.recording import BLOCK_SAMPLES, Channel, FloatArray

#: relative uncertainty of the speed from neighbouring passages, and from a pulse's width
STRETCH_NEIGHBOURS, STRETCH_WIDTH = 0.002, 0.1
#: misfit [height] beyond which a pulse of unknown speed is no steady passage (the wheel stood in it), or not the tire at all
STANDING_MISFIT, FOREIGN_MISFIT = 0.05, 0.1
#: a row is doubtful where its misfit is this many times the median's
DOUBTFUL = 3.0
#: heights, against the median, outside of which a pulse of unknown speed is no passage of this wheel
FOREIGN_HEIGHTS = (0.3, 2.5)


@dataclass(frozen=True)
class Passages:
    """Passages through the patch, in time order; arrays of shape (n,), n may be 0.

    index            fractional sample index of the patch centre
    time_s           its time; of a passage that lies in lost samples: by the speeds around it
    time_se_s        standard error of the time from the noise
    turn_before, turn_after   bool: the neighbouring passage is exactly one turn away, and was measured as this one was
    break_after      '' or why the next passage is not known to be one turn away: gap, standstill, reversing
    omega_rad_s      wheel speed at the passage, positive; where no neighbour is a turn away from the pulse's stretch (NaN: not known)
    omega_se_rad_s   its standard error, the differencing in it
    alpha_rad_s2     wheel acceleration at the passage, NaN where not known
    sides            neighbours on how many sides gave the speed: 2 centred, 1 extrapolated, 0 from the stretch or between neighbours
    height, offset   of the template in this passage, patch upward (sign x recorded signal), channel's unit; NaN where lost
    misfit           rms residual of the fit, channel's unit
    measured         bool: False where the passage lies in lost samples
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
    break_after: NDArray[np.str_]
    omega_rad_s: FloatArray
    omega_se_rad_s: FloatArray
    alpha_rad_s2: FloatArray
    sides: NDArray[np.int64]
    height: FloatArray
    offset: FloatArray
    misfit: FloatArray
    measured: NDArray[np.bool_]
    quality: tuple[frozenset[str], ...]

    def __len__(self) -> int:
        return int(self.time_s.size)

    @property
    def period_before_s(self) -> FloatArray:
        """Time since the passage before, NaN where that is not one turn away."""
        return np.where(self.turn_before, np.diff(self.time_s, prepend=np.nan), np.nan)

    @property
    def period_after_s(self) -> FloatArray:
        """Time to the passage after, NaN where that is not one turn away."""
        return np.where(self.turn_after, np.diff(self.time_s, append=np.nan), np.nan)

    @property
    def speed_m_s(self) -> FloatArray:
        """Speed over the rolling circumference (errata, Speed)."""
        return self.radius_m * self.omega_rad_s

    @property
    def speed_se_m_s(self) -> FloatArray:
        """Standard error of `speed_m_s`, the radius taken as exact."""
        return self.radius_m * self.omega_se_rad_s

    @property
    def acceleration_m_s2(self) -> FloatArray:
        """Longitudinal acceleration, positive in drive."""
        return self.radius_m * self.alpha_rad_s2


def patch_sign(channel: Channel) -> float:
    """+1 where the patch is a maximum of the recorded signal, -1 where it is a minimum.

    Strain: minimum on the outer surface, maximum on the inner.  Radial acceleration is near zero in the patch and -omega^2 R (outward
    positive) outside, so the patch points away from the median, whichever way the sensor counts.
    """
    if channel.kind == "radial_acceleration":
        some = channel.read(0, min(channel.size, BLOCK_SAMPLES))
        some = some[np.isfinite(some)]
        return -1.0 if some.size and np.median(some) > 0 else 1.0
    return 1.0 if channel.surface == "inner" else -1.0


def find_passages(channel: Channel, radius_m: float, block_samples: int = BLOCK_SAMPLES) -> Passages:
    """The passages of `channel` (strain or radial acceleration), `radius_m` the rolling radius.

    The rows do not depend on `block_samples`.  A log without passages, or all lost, gives no rows.
    """
    sign, noise = patch_sign(channel), sample_noise(channel)
    pulses, extremes = search(channel, sign, noise, block_samples) if np.isfinite(noise) else (None, (0.0, 0.0))
    if not pulses:
        return _none(channel, radius_m, sign, noise)
    template, found, start, pulses = _fitted(channel, pulses, sign, noise, extremes)
    turns = turns_between(found.time_s, start.omega)
    linked = np.append(one_turn(turns), False)
    known = start.stretch == STRETCH_NEIGHBOURS
    standing = ~known & (found.misfit > np.maximum(STANDING_MISFIT * np.abs(found.height), 3 * noise))
    half_width_s = 0.5 * pulses.width / channel.axis.rate_Hz
    time_s = np.where(standing, start.time_s, found.time_s)
    time_se_s = np.where(standing, 0.5 * half_width_s, found.time_se_s * _doubt(found, noise))
    window_rad = template.window_rad if template else float(np.median(2 * half_width_s * start.omega))
    lost = marks.lost_between(channel, time_s, start.omega, turns, window_rad) if template else np.zeros(turns.size, np.int64)
    turns_after = np.append(lost, 0) + np.where(linked | (np.append(lost, 0) > 0), 1, 0)
    motion = kinematics(time_s, time_se_s, turns_after.astype(float))
    alone = motion.sides == 0
    index = pulses.middle + (time_s - start.time_s) * channel.axis.rate_Hz
    omega = np.where(alone, np.where(standing, np.nan, found.omega), motion.omega)
    words = marks.window_words(channel, found, standing, index, window_rad / start.omega * channel.axis.rate_Hz)
    measured = Passages(
        channel=channel.name,
        radius_m=radius_m,
        sign=sign,
        noise=noise,
        window_rad=window_rad,
        template=template,
        index=index,
        time_s=time_s,
        time_se_s=time_se_s,
        turn_before=np.concatenate([[False], linked[:-1]]),
        turn_after=linked,
        break_after=marks.breaks(channel, index, turns, turns_after > 0),
        omega_rad_s=omega,
        omega_se_rad_s=np.where(alone, found.omega_se, motion.omega_se),
        alpha_rad_s2=motion.alpha,
        sides=motion.sides,
        height=found.height,
        offset=found.offset,
        misfit=found.misfit,
        measured=np.ones(time_s.size, bool),
        quality=tuple(frozenset(w) for w in words),
    )
    return _with_lost(measured, lost, channel) if lost.any() else measured


def _fitted(
    channel: Channel, pulses: Pulses, sign: float, noise: float, extremes: tuple[float, float]
) -> tuple[Template | None, Fit, Start, Pulses]:
    """Template and fit of the pulses, without those that are no passage."""
    pulses = screen(pulses)
    start = _start(channel, pulses)
    good = np.flatnonzero(start.stretch == STRETCH_NEIGHBOURS)
    good = good if good.size else np.arange(len(pulses))
    template = learn_template(channel, start, good, pulses, sign, noise, extremes) if len(pulses) > 1 else None
    if template is None:
        return None, _rough(channel, start, pulses), start, pulses
    found = _fit_all(channel, start, pulses.height, template, sign, noise, extremes)
    kept = ~_foreign(found, start, noise)
    if not kept.all():
        pulses = pulses.take(kept)
        start = _start(channel, pulses)
        found = _fit_all(channel, start, pulses.height, template, sign, noise, extremes)
    return template, found, start, pulses


def _foreign(found: Fit, start: Start, noise: float) -> NDArray[np.bool_]:
    """Pulses that are no passage by their fit: of another height than most, or a bad fit between two that are one turn apart."""
    usual = float(np.median(np.abs(found.height)))
    foreign = (found.height < FOREIGN_HEIGHTS[0] * usual) | (found.height > FOREIGN_HEIGHTS[1] * usual)
    foreign &= start.stretch == STRETCH_WIDTH
    bad = found.misfit > np.maximum(FOREIGN_MISFIT * np.abs(found.height), 3 * noise)
    if bad.size > 2:
        skip = (found.time_s[2:] - found.time_s[:-2]) * 0.5 * (start.omega[2:] + start.omega[:-2]) / TURN_RAD
        foreign[1:-1] |= bad[1:-1] & ~bad[:-2] & ~bad[2:] & one_turn(skip)
    return foreign


def _doubt(found: Fit, noise: float) -> FloatArray:
    """Factor on the standard error where a row fits far worse than most: its residual then is no white noise, (n,)."""
    if not found.misfit.size or not np.isfinite(found.misfit).any() or not noise > 0:
        return np.ones(found.misfit.size)
    usual = max(float(np.nanmedian(found.misfit)), noise)
    return np.where(found.misfit > DOUBTFUL * usual, 2.0 * found.misfit / noise, 1.0)


def _start(channel: Channel, pulses: Pulses) -> Start:
    """Rough centres, speeds and accelerations: from the neighbours where these are one turn away, else from the pulse's width."""
    time_s = channel.axis.at(pulses.middle)
    width_s = pulses.width / channel.axis.rate_Hz
    from_width = TURN_RAD * width_turns(time_s, width_s) / width_s
    turns = turns_between(time_s, from_width)
    linked = np.append(one_turn(turns), False)
    motion = kinematics(time_s, 0.02 * width_s, linked.astype(float))
    with np.errstate(invalid="ignore"):
        near = np.abs(motion.omega / from_width - 1) < 0.5
    known = near & (motion.sides == 2)
    extrapolated = near & (motion.sides == 1)
    return Start(
        time_s,
        pulses.middle,
        np.where(known | extrapolated, motion.omega, from_width),
        np.where(known | extrapolated, motion.alpha, 0.0),
        np.where(known, STRETCH_NEIGHBOURS, STRETCH_WIDTH),
    )


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


def _rough(channel: Channel, start: Start, pulses: Pulses) -> Fit:
    """Rows without a template: the middle of the half-level crossings, with an error of a tenth of the width."""
    n = len(pulses)
    no, nan = np.zeros(n, bool), np.full(n, np.nan)
    width_s = pulses.width / channel.axis.rate_Hz
    return Fit(start.time_s, 0.1 * width_s, nan, nan, pulses.height, pulses.base, nan, np.zeros(n, np.int64), no, no, no, no)


def _with_lost(measured: Passages, lost: NDArray[np.int64], channel: Channel) -> Passages:
    """`measured` with a row for each passage that lies in lost samples, its time and speed from the passages around."""
    times, speeds, ses, words = [], [], [], []
    for k in np.flatnonzero(lost):
        count, around = int(lost[k]), slice(k, k + 2)
        t, omega = measured.time_s[around], measured.omega_rad_s[around]
        times.append(marks.between(t[0], t[1], omega[0], omega[1], count))
        even = t[0] + (t[1] - t[0]) * np.arange(1, count + 1) / (count + 1)
        ses.append(0.2 * np.abs(times[-1] - even) + 1e-3 * (t[1] - t[0]) / (count + 1))
        speeds.append(np.interp(times[-1], t, omega))
        words += [frozenset({"lost_peak"})] * count
    place = np.repeat(np.arange(1, lost.size + 1), lost)
    time_s, omega = np.concatenate(times), np.concatenate(speeds)
    # the speed at a lost passage is only as good as the change over the turns around it
    omega_se = np.abs(measured.omega_rad_s[place] - measured.omega_rad_s[place - 1]) / 3 + 2e-3 * omega
    extra: dict[str, Any] = {
        "index": channel.axis.index(time_s), "time_s": time_s, "time_se_s": np.concatenate(ses), "turn_before": False, "turn_after": False,
        "break_after": "", "omega_rad_s": omega, "omega_se_rad_s": omega_se, "sides": 0, "measured": False,
    }  # fmt: skip
    columns: dict[str, Any] = {
        f.name: np.insert(value, place, extra.get(f.name, np.nan))
        for f in fields(Passages)
        if isinstance(value := getattr(measured, f.name), np.ndarray)
    }
    quality = list(measured.quality)
    for where, word in zip(place[::-1], words[::-1], strict=True):
        quality.insert(int(where), word)
    return replace(measured, quality=tuple(quality), **columns)


def _none(channel: Channel, radius_m: float, sign: float, noise: float) -> Passages:
    """No passage at all."""
    empty, no = np.zeros(0), np.zeros(0, bool)
    columns: dict[str, Any] = {f.name: empty for f in fields(Passages)[6:]}
    columns |= {"turn_before": no, "turn_after": no, "measured": no, "break_after": np.zeros(0, "U10"), "sides": np.zeros(0, np.int64)}
    columns |= {"quality": ()}
    return Passages(channel.name, radius_m, sign, noise, 0.0, None, **columns)
