"""Pulses to fitted passages.

What each fit starts from, the template, and which pulses are no passage after all.

Pulses --screen, rough speeds--> Start --learn--> Template
    --fit--> Fit, one row per passage
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from tirelog.data.recording import Channel
from tirelog.dsp.filters import NORMAL_MEDIAN
from tirelog.strain.passages.passage_flags import (
    TURN_RAD,
    kinematics,
    may_have_stopped,
    turns_between,
)
from tirelog.strain.passages.search import AT_ONCE, PULSE, usual
from tirelog.strain.passages.template import (
    FOUND,
    INTERVALS,
    MOST_SAMPLES,
    ROW,
    SEGMENT,
    SPAN,
    WIDEST_RAD,
    Source,
    Template,
    fit_rows,
    learned_template,
    scratch,
    spline_sums,
)
from tirelog.vocabulary.arrays import BoolArray, FloatArray, IntArray, Records, records

# ---- The centre of each passage by a matched filter.
#
# Offset, height, shift and stretch of the template, least squares, row by row.
#
#     samples around rough centres
#         --Gauss-Newton on the template (`template`)--> centre, its standard error, height
#
# With phi the angle that the wheel has turned since the rough centre, the model of a row is y = a +
# b
# T(phi (1 + e) - s). Where the speed is known from the neighbouring passages the stretch e is held
# near 0; else it tells the speed. The standard error is the Cramer-Rao bound of the template at the
# noise of the log.


@dataclass(frozen=True)
class Signal:
    """A channel as the fits see it.

    `sign` turns the patch upward, `noise` is one sample's sigma, `extremes` are the channel's least
    and largest sample.
    """

    channel: Channel
    sign: float
    noise: float
    extremes: tuple[float, float]


@dataclass(frozen=True)
class Windows:
    """The windows of some rows in pieces of a channel.

    `samples` (N,) as recorded, and their `times` [s], empty if the axis tells them; `spans` (n,):
    each row's window, of SPAN; `outside` (n,): part of the window lies outside the log.
    """

    signal: Signal
    samples: FloatArray
    times: FloatArray
    spans: Records
    outside: BoolArray

    @classmethod
    def concatenate(cls, parts: list[Windows]) -> Windows:
        begins = np.cumsum([0] + [part.samples.size for part in parts])
        spans = [part.spans.copy() for part in parts]
        for part, begin in zip(spans, begins, strict=False):
            part["shift"] += begin
        samples, times = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("samples", "times")
        )
        return cls(
            parts[0].signal,
            samples,
            times,
            np.concatenate(spans),
            np.concatenate([part.outside for part in parts]),
        )

    @property
    def source(self) -> Source:
        """The samples as the kernels take them."""
        signal, axis = self.signal, self.signal.channel.axis
        segments = records(SEGMENT, first=axis.first, start_s=axis.start_s, period_s=axis.period_s)
        return Source(self.samples, self.times, segments, signal.sign, *signal.extremes)


def _spans(signal: Signal, start: Records, window_rad: float) -> tuple[Records, BoolArray]:
    """Each row's window (n,) of SPAN, not shifted; which of them leave the log (n,)."""
    axis = signal.channel.axis
    reach = window_rad / start["omega_rad_s"] * axis.rate_Hz
    with np.errstate(over="ignore", invalid="ignore"):
        low, high = np.ceil(start["index"] - reach), np.floor(start["index"] + reach) + 1
    # a row without a finite guess gets a window of one sample, in which nothing is fitted
    first = np.clip(np.nan_to_num(low), 0, axis.size - 1).astype(np.int64)
    stop = np.clip(np.nan_to_num(high), first + 1, axis.size).astype(np.int64)
    spans = np.zeros(first.size, SPAN)
    spans["first"], spans["stop"] = first, stop
    return spans, (low < 0) | (high > axis.size)


def _read(signal: Signal, spans: Records) -> tuple[FloatArray, FloatArray]:
    """Samples and times from the first to the last window.

    The shift of `spans` (n,) becomes what leads there.
    """
    channel = signal.channel
    if not spans.size:  # no row has a first guess
        return np.zeros(0), np.zeros(0)
    begin, end = int(spans["first"].min()), int(spans["stop"].max())
    spans["shift"] = -begin
    samples = np.ascontiguousarray(channel.read(begin, end), dtype=np.float64)
    explicit = channel.axis.explicit
    return samples, np.asarray(
        explicit(begin, end), np.float64
    ) if explicit is not None else np.zeros(0)


def gather(signal: Signal, start: Records, window_rad: float) -> Windows:
    """The windows of all rows of `start`, which must lie within one block's reach."""
    spans, outside = _spans(signal, start, window_rad)
    samples, times = _read(signal, spans)
    return Windows(signal, samples, times, spans, outside)


def residuals(
    windows: Windows, template: Template, found: Records, alpha: FloatArray, which: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Angles [rad] of the samples of the rows `which`, and what the template leaves of them (N,).

    What is left is a share of the height. Lost samples and those outside of the template do not
    count; offset, height and shift are of those inside.
    """
    signal, angles, left = windows.signal, [], []
    for span, made, change in zip(windows.spans[which], found[which], alpha[which], strict=True):
        stride = -(-(span["stop"] - span["first"]) // MOST_SAMPLES)
        index = np.arange(span["first"], span["stop"], stride)
        value = signal.sign * windows.samples[index + span["shift"]]
        tau = signal.channel.axis.at(index.astype(np.float64)) - made["time_s"]
        phi = (made["omega_rad_s"] + 0.5 * change * tau) * tau
        inside = np.isfinite(value) & (np.abs(phi) <= template.window_rad)
        phi, value = phi[inside], value[inside]
        waves = (np.interp(phi, template.phi_rad, w) for w in (template.values, template.slope))
        design = np.column_stack([np.ones(phi.size), *waves])
        solved = np.linalg.lstsq(design, value, rcond=None)[0]
        angles.append(phi)
        left.append((value - design @ solved) / made["height"])
    return np.concatenate(angles), np.concatenate(left)


def fit_passages(
    windows: Windows, template: Template, start: Records, height: FloatArray
) -> Records:
    """Each row's centre by the template, (n,) of FOUND; `height` (n,) a first guess."""
    found = np.zeros(height.size, FOUND)
    found["outside"] = windows.outside
    _fit(windows, template, start, height, found)
    return found


def fit_blocks(
    signal: Signal,
    template: Template,
    start: Records,
    height: FloatArray,
    block_samples: int = AT_ONCE,
) -> Records:
    """`fit_passages` of rows from all over the log, in order, a block of it at a time."""
    found = np.zeros(height.size, FOUND)
    spans, found["outside"] = _spans(signal, start, template.window_rad)
    block = np.floor(start["index"] / block_samples)
    ends = np.concatenate([[0], np.flatnonzero(np.diff(block)) + 1, [block.size]])
    for low, high in pairwise(ends.tolist()):
        part = slice(low, high)
        samples, times = _read(signal, spans[part])
        windows = Windows(signal, samples, times, spans[part], found["outside"][part])
        _fit(windows, template, start[part], height[part], found[part])
    return found


def _fit(
    windows: Windows, template: Template, start: Records, height: FloatArray, found: Records
) -> None:
    """Fills all of `found` (n,) of FOUND but which rows leave the log."""
    rows = start.copy()
    rows["height"] = height
    fit_rows(
        windows.source, windows.signal.noise, template.table, template.window_rad, rows,
        windows.spans, found, scratch(),
    )  # fmt: skip


def curve_sums(
    windows: Windows, start: Records, offset: FloatArray, height: FloatArray, window_rad: float
) -> tuple[FloatArray, FloatArray, int]:
    """The rows' samples, scaled to height 1, as what a template's curve is learnt from.

    Normal equations of a spline over +-`window_rad`, the upper triangle (s, s) and the right side
    (s,), and how many samples are in them.
    """
    normal, right = np.zeros((INTERVALS + 3, INTERVALS + 3)), np.zeros(INTERVALS + 3)
    rows = start.copy()
    rows["height"] = height
    count = spline_sums(
        windows.source, rows, offset, windows.spans, window_rad, normal, right, scratch()
    )
    return normal, right, count


# ---- The template of a log's own passages.
#
# Which of them to learn from, and the rounds of fitting and learning.
#
# rough centres --clusters of neighbours spread over the log--> windows
#     --lay over, learn, fit; again--> Template


#: passages that the template is learnt from, in clusters of neighbours, and rounds; twice as many
#: tell the template to 0.7 of the noise, in twice the time
LEARNT_FROM, CLUSTERS, LEARNING_ROUNDS = 320, 16, 3
#: stretches of angle over which the scatter between turns is told, from so many passages at most,
#: and the passages that it takes: of fewer a spike is a large part; twice as many stretches have
#: half of the samples each
SCATTER_PARTS, SCATTER_FROM, FEWEST = 24, 60, 5


def _clusters(good: IntArray) -> list[IntArray]:
    """Up to LEARNT_FROM of the passages `good`, as clusters of neighbours spread over the log."""
    if good.size <= LEARNT_FROM:
        return [
            good[k : k + LEARNT_FROM // CLUSTERS]
            for k in range(0, good.size, LEARNT_FROM // CLUSTERS)
        ]
    size = LEARNT_FROM // CLUSTERS
    firsts = np.linspace(0, good.size - size, CLUSTERS).astype(np.int64)
    return [good[k : k + size] for k in firsts]


def learn_template(
    signal: Signal, start: Records, good: IntArray, pulses: Records
) -> Template | None:
    """The template from the passages `good` (indices), or None.

    Each round fits them with the template of the round before. None if there is no such passage, or
    no curve with two half-level crossings comes of them.
    """
    rate_Hz = signal.channel.axis.rate_Hz
    clusters = _clusters(good)
    if not clusters:
        return None
    # the window that is learnt, in half widths
    window = min(
        WIDEST_RAD,
        3.0 * 0.5 * float(np.median(pulses["width"][good] / rate_Hz * start["omega_rad_s"][good])),
    )
    chosen = np.concatenate(clusters)
    windows = Windows.concatenate([gather(signal, start[cluster], window) for cluster in clusters])
    at, offset, height = start[chosen].copy(), pulses["base"][chosen], pulses["height"][chosen]
    like = np.ones(chosen.size, bool)
    template: Template | None = None
    for _ in range(LEARNING_ROUNDS):
        template = learned_template(
            curve_sums(
                replace(windows, spans=windows.spans[like], outside=windows.outside[like]),
                at[like],
                offset[like],
                height[like],
                window,
            ),
            window,
        )
        if template is None:
            return None
        found = fit_passages(windows, template, at, height)
        # a passage whose misfit is a larger share of its height is not learnt from; twice as much
        # learns from passages with a tenth of something else in them
        like = (found["height"] > 0.5 * np.median(height)) & (
            found["misfit"] < np.maximum(0.15 * found["height"], 3 * signal.noise)
        )
        at["time_s"] = np.where(like, found["time_s"], at["time_s"])
        offset, height = (
            np.where(like, found["offset"], offset),
            np.where(like, found["height"], height),
        )
    if template is None or chosen.size < FEWEST:
        return template
    return replace(template, scatter=_scatter(windows, template, found, at["alpha_rad_s2"]))


def _scatter(windows: Windows, template: Template, found: Records, alpha: FloatArray) -> FloatArray:
    """Standard deviation between turns beyond the noise over the height, (g,).

    At each angle of the template's table. By medians over short stretches of angle, so that a few
    passages with a spike do not matter; the larger of neighbouring stretches.
    """
    rows = np.unique(np.linspace(0, alpha.size - 1, SCATTER_FROM).astype(np.int64))
    phi, rest = residuals(windows, template, found, alpha, rows)
    place = (phi / template.window_rad + 1.0) * 0.5 * SCATTER_PARTS
    part = np.clip(place.astype(np.int64), 0, SCATTER_PARTS - 1)
    size = np.abs(rest)
    sigma = np.array(
        [
            np.median(size[part == k]) / NORMAL_MEDIAN if (part == k).any() else 0.0
            for k in range(SCATTER_PARTS)
        ]
    )
    noise = windows.signal.noise / np.median(np.abs(found["height"]))
    padded = np.pad(np.sqrt(np.maximum(sigma**2 - noise**2, 0.0)), 1)
    widest = np.max([padded[:-2], padded[1:-1], padded[2:]], axis=0)
    middles = ((np.arange(SCATTER_PARTS) + 0.5) / SCATTER_PARTS * 2.0 - 1.0) * template.window_rad
    scatter: FloatArray = np.interp(template.phi_rad, middles, widest)
    return scatter


# ---- Pulses that are no passages, told by when they come and how long they last.
#
# The instrument jumped, or a jump split a passage in two.
#
#     Pulses --join halves, drop strangers--> Pulses
#
# A passage lasts a fixed share of a turn, and the next comes a turn later. Two pulses much closer
# than that are the halves of one passage, or one of them is a jump; a pulse between two others that
# are just one turn apart is a jump. Speeds come from the median width of the pulses around, so a
# few
# strangers do not matter. Rows are only dropped, never added.


#: width of a passage (half level) as a share of a turn, if the log is too short to tell
USUAL_WIDTH_TURNS = 0.06
#: two passages are one turn apart if the turn that the speeds beside them give lies in this range:
#: nearer to one turn than to a half or to two, as ratios.  Wider, a missed passage goes unseen
ONE_TURN = (0.7, 1.4)
#: width of the joined halves against the widths around
JOINED_WIDTH = (0.6, 1.5)


def width_turns(middle: FloatArray, width: FloatArray) -> float:
    """Width of a passage in turns: the median of width over period, both in one unit."""
    if middle.size < 2:
        return USUAL_WIDTH_TURNS
    if middle.size == 2:
        share = float(width.mean() / (middle[1] - middle[0]))
    else:
        share = float(np.median(2 * width[1:-1] / (middle[2:] - middle[:-2])))
    return share if 0.01 < share < 0.25 else USUAL_WIDTH_TURNS


def one_turn(turns: FloatArray) -> BoolArray:
    """Whether that many turns, from speeds that are good to some 20 %, are one."""
    return (turns > ONE_TURN[0]) & (turns < ONE_TURN[1])


def screen(channel: Channel, pulses: Records) -> Records:
    """The pulses of `channel` that may be passages."""
    if not len(pulses):
        return pulses
    # places as if no sample were missing, so that a gap counts
    place = channel.axis.at(pulses["middle"]) * channel.axis.rate_Hz
    gapless = pulses.copy()
    gapless["middle"] = place
    kept = _screened(gapless)
    kept["middle"] = np.interp(kept["middle"], place, pulses["middle"])
    return kept


def _screened(pulses: Records) -> Records:
    """`pulses`, their places on a gapless axis, without halves and strangers."""
    pulses = _joined(pulses)
    # rounds of dropping; each round leaves half of the strangers that stand side by side
    for _ in range(3):
        strange = _strangers(pulses)
        if not strange.any():
            break
        pulses = pulses[~strange]
    return pulses


def _joined(pulses: Records) -> Records:
    """The pulses with pairs that are too close made one.

    Their hull if that has the usual width, else the one whose width is more usual.
    """
    if len(pulses) < 3:
        return pulses
    width_around = usual(pulses["width"])
    period = width_around / width_turns(pulses["middle"], pulses["width"])
    # pulses closer than this share of a turn cannot both be passages; two passages are taken for
    # one if their widths say four times the period; with twice as much, if they say two times
    close = np.flatnonzero(np.diff(pulses["middle"]) < 0.25 * np.minimum(period[1:], period[:-1]))
    middle, width, kept = (
        pulses["middle"].copy(),
        pulses["width"].copy(),
        np.ones(len(pulses), bool),
    )
    for first in close:
        second = first + 1
        if not kept[first]:
            continue
        entry, leave = middle[first] - 0.5 * width[first], middle[second] + 0.5 * width[second]
        if JOINED_WIDTH[0] < (leave - entry) / width_around[first] < JOINED_WIDTH[1]:
            middle[first], width[first] = 0.5 * (entry + leave), leave - entry
            kept[second] = False
        else:
            unusual = np.abs(np.log(width[[first, second]] / width_around[first]))
            kept[second if unusual[0] <= unusual[1] else first] = False
    return records(PULSE, middle=middle, width=width, height=pulses["height"], base=pulses["base"])[
        kept
    ]


def _strangers(pulses: Records) -> BoolArray:
    """Pulses less than a turn from both neighbours, which are just one turn apart, shape (n,)."""
    strange = np.zeros(len(pulses), bool)
    if len(pulses) < 4:
        return strange
    rate = width_turns(pulses["middle"], pulses["width"]) / usual(pulses["width"])
    step = np.diff(pulses["middle"]) * 0.5 * (rate[1:] + rate[:-1])
    over = (pulses["middle"][2:] - pulses["middle"][:-2]) * 0.5 * (rate[2:] + rate[:-2])
    strange[1:-1] = one_turn(over) & (np.maximum(step[1:], step[:-1]) < 0.9 * over)
    # of neighbours only the one goes without which the others are nearest to one turn apart; the
    # rest is judged again
    off = np.full(len(pulses), np.inf)
    off[1:-1] = np.where(strange[1:-1], np.abs(np.log(over)), np.inf)
    padded = np.pad(off, 1, constant_values=np.inf)
    return strange & (off <= padded[:-2]) & (off < padded[2:])


#: relative uncertainty of the speed from neighbouring passages, and from a pulse's width; twice as
#: much lets the noise of a passage move its speed twice as far
STRETCH_NEIGHBOURS, STRETCH_WIDTH = 0.002, 0.1
#: misfit [height] beyond which a pulse of unknown speed is no steady passage (the wheel stood in
#: it), or not the tire at all; twice as much of either keeps pulses that are half as like a
#: passage
STANDING_MISFIT, FOREIGN_MISFIT = 0.05, 0.1
#: and beyond so many times the log's own: edges that ring are no standstill.  Twice as much would
#: miss short stops
USUAL_MISFITS = 2.0
#: heights, against the median around, outside of which a pulse of unknown speed is no passage of
#: this wheel; twice as wide keeps pulses of a sixth and of five times the height
FOREIGN_HEIGHTS = (0.3, 2.5)
#: passages of a stretch that are tried the other way round, and the log likelihood ratio from which
#: they ran backwards: odds of 3e6 to one; half of it, 1800 to one
TRIED_BACKWARDS, BACKWARDS_EVIDENCE = 8, 15.0


@dataclass(frozen=True)
class MatchedPassages:
    """The fitted passages, and which of them were no plain ones.

    The `pulses` that are left, the `start` of their fits, the `fit`, standard errors of its times
    (n,); `standing`: the wheel stood in the passage (n,), `backwards`: it rolled backwards (n,).
    """

    template: Template | None
    pulses: Records
    start: Records
    fit: Records
    time_se_s: FloatArray
    standing: BoolArray
    backwards: BoolArray

    @property
    def time_s(self) -> FloatArray:
        """Times of the patch centres.

        Of a passage in which the wheel stood: the middle of its pulse.
        """
        return np.where(self.standing, self.start["time_s"], self.fit["time_s"])


def match(signal: Signal, pulses: Records) -> MatchedPassages:
    """Template and fit of the pulses, without those that are no passage."""
    pulses = screen(signal.channel, pulses)
    start = _start(signal.channel, pulses)
    everything = np.ones(len(pulses), bool)
    template = _learn(signal, start, pulses, everything) if len(pulses) > 1 else None
    if template is None:
        return _matched(signal, None, pulses, start, _rough(signal, start, pulses), ~everything)
    found = fit_blocks(signal, template, start, pulses["height"])
    kept = ~_foreign(found, start, signal.noise)
    if not kept.all():
        pulses = pulses[kept]
        start = _start(signal.channel, pulses)
        found = fit_blocks(signal, template, start, pulses["height"])
    back = _backwards(signal, template, start, found)
    if back.any():
        start = _start(signal.channel, pulses, back[1:] != back[:-1])
        template = _learn(signal, start, pulses, ~back) or template
        found = fit_blocks(signal, template, start, pulses["height"])
        found = np.where(
            back, fit_blocks(signal, template.mirrored(), start, pulses["height"]), found
        )
    return _matched(signal, template, pulses, start, found, back)


def _learn(signal: Signal, start: Records, pulses: Records, usable: BoolArray) -> Template | None:
    """The template from the passages of known speed among the `usable`.

    From all of these if none has a known speed.
    """
    known = np.flatnonzero(usable & (start["stretch"] == STRETCH_NEIGHBOURS))
    return learn_template(signal, start, known if known.size else np.flatnonzero(usable), pulses)


def _matched(
    signal: Signal,
    template: Template | None,
    pulses: Records,
    start: Records,
    found: Records,
    back: BoolArray,
) -> MatchedPassages:
    """The fits with what they say about themselves."""
    height = np.abs(found["height"])
    usual = USUAL_MISFITS * float(np.median(found["misfit"] / height)) if len(pulses) else 0.0
    bad = found["misfit"] > np.maximum(max(STANDING_MISFIT, usual) * height, 3 * signal.noise)
    standing = bad & (start["stretch"] == STRETCH_WIDTH) & ~found["holds_spike"]
    quarter_s = 0.25 * pulses["width"] / signal.channel.axis.rate_Hz
    return MatchedPassages(
        template,
        pulses,
        start,
        found,
        np.where(standing, quarter_s, found["time_se_s"] * _doubt(found, signal.noise)),
        standing,
        back,
    )


def _foreign(found: Records, start: Records, noise: float) -> BoolArray:
    """Pulses that are no passage by their fit.

    Of another height than those around, or a bad fit between two that are one turn apart.
    """
    around = usual(np.abs(found["height"]))
    foreign = (found["height"] < FOREIGN_HEIGHTS[0] * around) | (
        found["height"] > FOREIGN_HEIGHTS[1] * around
    )
    foreign &= start["stretch"] == STRETCH_WIDTH
    bad = found["misfit"] > np.maximum(FOREIGN_MISFIT * np.abs(found["height"]), 3 * noise)
    if bad.size > 2:
        skip = (
            (found["time_s"][2:] - found["time_s"][:-2])
            * 0.5
            * (start["omega_rad_s"][2:] + start["omega_rad_s"][:-2])
            / TURN_RAD
        )
        foreign[1:-1] |= bad[1:-1] & ~bad[:-2] & ~bad[2:] & one_turn(skip)
    return foreign


def _doubt(found: Records, noise: float) -> FloatArray:
    """Factor on the standard error of rows that fit far worse than most, (n,).

    Their residual is no white noise.
    """
    if not found["misfit"].size or not np.isfinite(found["misfit"]).any() or not noise > 0:
        return np.ones(found["misfit"].size)
    share = found["misfit"] / np.abs(found["height"])
    expected = np.maximum(float(np.nanmedian(share)) * np.abs(found["height"]), noise)
    # a row is doubtful if its misfit is this many times the median's; twice as many leave the error
    # as it is for misfits of up to six times
    return np.where(found["misfit"] > 3.0 * expected, 2.0 * found["misfit"] / noise, 1.0)


def _start(channel: Channel, pulses: Records, turned: BoolArray | None = None) -> Records:
    """Rough centres, speeds and accelerations.

    From the neighbours if these are one turn away, else from the pulse's width. `turned` (n - 1,):
    whether the wheel is known to have rolled back before the next passage.
    """
    time_s = channel.axis.at(pulses["middle"])
    width_s = pulses["width"] / channel.axis.rate_Hz
    from_width = TURN_RAD * width_turns(time_s, width_s) / width_s
    turns = turns_between(time_s, from_width)
    linked = np.append(one_turn(turns) & (True if turned is None else ~turned), False)
    motion = kinematics(time_s, 0.02 * width_s, linked.astype(float))
    with np.errstate(invalid="ignore"):
        near = np.abs(motion["omega_rad_s"] / from_width - 1) < 0.5
    known = near & (motion["sides"] == 2)
    extrapolated = near & (motion["sides"] == 1)
    return records(
        ROW,
        time_s=time_s,
        index=pulses["middle"],
        omega_rad_s=np.where(known | extrapolated, motion["omega_rad_s"], from_width),
        alpha_rad_s2=np.where(known | extrapolated, motion["alpha_rad_s2"], 0.0),
        stretch=np.where(known, STRETCH_NEIGHBOURS, STRETCH_WIDTH),
    )


def _rough(signal: Signal, start: Records, pulses: Records) -> Records:
    """Rows without a template: the middle of the half-level crossings.

    With an error of a tenth of the width.
    """
    nan = np.nan
    return records(
        FOUND,
        time_s=start["time_s"],
        time_se_s=0.1 * pulses["width"] / signal.channel.axis.rate_Hz,
        omega_rad_s=nan,
        omega_se_rad_s=nan,
        height=pulses["height"],
        offset=pulses["base"],
        misfit=nan,
    )


def _backwards(signal: Signal, template: Template, start: Records, found: Records) -> BoolArray:
    """Passages of a wheel that rolled backwards, shape (n,).

    They are stretches whose waveform fits better the other way round. Stretches end if the next
    passage is not one turn away, or the wheel may have stopped between two. Most of a log's
    passages are taken as forwards, and a waveform that is the same both ways tells nothing.
    """
    n = found["time_s"].size
    back = np.zeros(n, bool)
    ends = (
        np.flatnonzero(
            ~one_turn(turns_between(found["time_s"], start["omega_rad_s"]))
            | may_have_stopped(found["time_s"])
        )
        + 1
    )
    if not ends.size:
        return back
    for first, stop in pairwise(np.concatenate([[0], ends, [n]])):
        rows = np.arange(first, min(stop, first + TRIED_BACKWARDS))
        some = start[rows]
        some["time_s"], some["omega_rad_s"] = found["time_s"][rows], found["omega_rad_s"][rows]
        windows = gather(signal, some, template.window_rad)
        height = np.abs(found["height"][rows])
        forth, other = (
            fit_passages(windows, shape, some, height) for shape in (template, template.mirrored())
        )
        floor = signal.noise**2
        ratio = (forth["misfit"] ** 2 + floor) / (other["misfit"] ** 2 + floor)
        back[first:stop] = 0.5 * float(np.sum(forth["used"] * np.log(ratio))) > BACKWARDS_EVIDENCE
    return back if 2 * back.sum() <= n else ~back
