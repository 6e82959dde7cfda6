"""Pulses to fitted passages.

What each fit starts from, the template, and which pulses are no passage after all.

Pulses --screen, rough speeds--> Start --learn--> Template
    --fit--> Fit, one row per passage
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from tirelog.data.recording import Channel
from tirelog.dsp.filters import NORMAL_MEDIAN
from tirelog.strain.passages.passage_flags import (
    TURN_RAD,
    kinematics,
    may_have_stopped,
    turns_between,
)
from tirelog.strain.passages.template import (
    FOUND,
    MOST_SAMPLES,
    ROW,
    SAMPLE,
    SEGMENT,
    SPAN,
    WIDEST_RAD,
    Source,
    Template,
    fit_rows,
    learned_template,
)
from tirelog.vocabulary.arrays import BoolArray, FloatArray, IntArray, Records, records
from tirelog.wheel.pulses import AT_ONCE, usual

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


def _spans(signal: Signal, start: Records, window_rad: float) -> tuple[Records, BoolArray]:
    """Each row's window (n,) of SPAN, not shifted; which of them leave the log (n,)."""
    axis = signal.channel.axis
    reach = window_rad / start["omega_rad_s"] * axis.rate_Hz
    with np.errstate(over="ignore", invalid="ignore"):
        low, high = np.ceil(start["index"] - reach), np.floor(start["index"] + reach) + 1
    # a row without a finite guess gets a window of one sample, in which nothing is fitted
    first = np.clip(np.nan_to_num(low), 0, axis.size - 1).astype(np.int64)
    stop = np.clip(np.nan_to_num(high), first + 1, axis.size).astype(np.int64)
    return records(SPAN, first=first, stop=stop), (low < 0) | (high > axis.size)


def _blocks(signal: Signal, start: Records, spans: Records) -> Iterator[tuple[slice, Source]]:
    """Rows of `start` whose centres lie in one block of the log, and the samples around them.

    The rows are in order; the shift of their `spans` (n,) of SPAN becomes what leads to the
    samples.
    """
    channel, axis = signal.channel, signal.channel.axis
    segments = records(SEGMENT, first=axis.first, start_s=axis.start_s, period_s=axis.period_s)
    block = np.floor(start["index"] / AT_ONCE)
    for rows in np.split(np.arange(block.size), np.flatnonzero(np.diff(block)) + 1):
        if not rows.size:
            continue
        part = slice(rows[0], rows[-1] + 1)
        begin, end = int(spans["first"][part].min()), int(spans["stop"][part].max())
        spans["shift"][part] = -begin
        samples = np.ascontiguousarray(channel.read(begin, end), dtype=np.float64)
        times = np.zeros(0) if axis.explicit is None else axis.explicit(begin, end)
        times = np.asarray(times, np.float64)
        yield part, Source(samples, times, segments, signal.sign, *signal.extremes)


def fit(
    signal: Signal, template: Template, start: Records, window_rad: float | None = None
) -> Records:
    """Each row's centre by the template, (n,) of FOUND, a block of the log at a time.

    `start` (n,) of ROW, in order; `window_rad` on either side, the template's if it is not given.
    """
    found, table, room = (
        np.zeros(start.size, FOUND),
        template.points,
        np.empty(MOST_SAMPLES, SAMPLE),
    )
    spans, found["outside"] = _spans(signal, start, window_rad or template.window_rad)
    for part, source in _blocks(signal, start, spans):
        fit_rows(
            source, signal.noise, table, template.window_rad, start[part], spans[part],
            found[part], room,
        )  # fmt: skip
    return found


def window_samples(
    signal: Signal, rows: Records, window_rad: float
) -> tuple[IntArray, FloatArray, FloatArray]:
    """The samples around passages: owner, angle from its centre [rad] and value, (N,) each.

    Within +-`window_rad` of the `rows` (n,) of ROW, in order; patch upward, less the offset and
    over the height. Lost samples and those at the ends of the channel's range are left out.
    """
    parts = [np.zeros((3, 0))]
    spans, _ = _spans(signal, rows, window_rad)
    for part, source in _blocks(signal, rows, spans):
        first, stop, shift = (spans[part][name] for name in ("first", "stop", "shift"))
        stride = -((first - stop) // MOST_SAMPLES)
        sizes = -((first - stop) // stride)
        owner = np.repeat(np.arange(sizes.size), sizes)
        number = np.arange(owner.size) - (np.cumsum(sizes) - sizes)[owner]
        index = first[owner] + stride[owner] * number
        values = source.samples[index + shift[owner]]
        time_s, omega, alpha, offset, height = (
            rows[name][part][owner]
            for name in ("time_s", "omega_rad_s", "alpha_rad_s2", "offset", "height")
        )
        tau = signal.channel.axis.at(index.astype(np.float64)) - time_s
        phi = (omega + 0.5 * alpha * tau) * tau
        scaled = (signal.sign * values - offset) / height
        used = (values > source.low) & (values < source.high) & (np.abs(phi) <= window_rad)
        parts.append(np.stack([owner + part.start, phi, scaled])[:, used])
    owner, phi, scaled = np.concatenate(parts, axis=1)
    return owner.astype(np.int64), phi, scaled


# ---- The template of a log's own passages.
#
# Which of them to learn from, and the rounds of fitting and learning.
#
# rough centres --clusters of neighbours spread over the log--> windows
#     --lay over, learn, fit; again--> Template


def clusters(rows: IntArray, most: int, count: int) -> IntArray:
    """At most `most` of `rows`, as so many clusters of neighbours spread over them."""
    if rows.size <= most:
        return rows
    size = most // count
    firsts = np.linspace(0, rows.size - size, count).astype(np.int64)
    return np.unique(np.concatenate([rows[k : k + size] for k in firsts]))


def learn_template(signal: Signal, start: Records, good: IntArray) -> Template | None:
    """The template from the passages `good` (indices) of `start`, or None.

    Each round fits them with the template of the round before. None if there is no such passage, or
    no curve with two half-level crossings comes of them.
    """
    if not good.size:
        return None
    half_width = 0.5 * float(np.median((start["width_s"] * start["omega_rad_s"])[good]))
    window = min(WIDEST_RAD, 3.0 * half_width)  # the window that is learnt, in half widths
    # in clusters of neighbours; twice as many passages tell the template to 0.7 of the noise, in
    # twice the time
    at = start[clusters(good, 320, 16)]
    like, template = np.ones(at.size, bool), None
    for _ in range(3):
        template = learned_template(*window_samples(signal, at[like], window)[1:], window)
        if template is None:
            return None
        found = fit(signal, template, at, window)
        # a passage whose misfit is a larger share of its height is not learnt from; twice as much
        # learns from passages with a tenth of something else in them
        like = (found["height"] > 0.5 * np.median(at["height"])) & (
            found["misfit"] < np.maximum(0.15 * found["height"], 3 * signal.noise)
        )
        for name in ("time_s", "offset", "height"):
            at[name] = np.where(like, found[name], at[name])
    # of fewer passages a spike is a large part of the scatter
    if template is None or at.size < 5:
        return template
    template.points["scatter"] = _scatter(signal, template, at)
    return template


def _scatter(signal: Signal, template: Template, at: Records) -> FloatArray:
    """Standard deviation between turns beyond the noise over the height, (g,).

    At each angle of the template's table. By medians over short stretches of angle, so that a few
    passages with a spike do not matter; the larger of neighbouring stretches.
    """
    at = at[np.unique(np.linspace(0, at.size - 1, 60).astype(np.int64))]
    found = fit(signal, template, at)
    for name in ("time_s", "omega_rad_s", "height", "offset"):
        at[name] = found[name]
    _, phi, values = window_samples(signal, at, template.window_rad)
    rest = values - np.interp(phi, template.phi_rad, template.points["value"])
    # stretches of angle over which the scatter between turns is known; twice as many have half of
    # the samples each
    scatter_parts = 24
    place = (phi / template.window_rad + 1.0) * 0.5 * scatter_parts
    part = np.clip(place.astype(np.int64), 0, scatter_parts - 1)
    sizes = [np.abs(rest)[part == k] for k in range(scatter_parts)]
    sigma = np.array([np.median(one) / NORMAL_MEDIAN if one.size else 0.0 for one in sizes])
    noise = signal.noise / np.median(np.abs(found["height"]))
    padded = np.pad(np.sqrt(np.maximum(sigma**2 - noise**2, 0.0)), 1)
    widest = np.max([padded[:-2], padded[1:-1], padded[2:]], axis=0)
    middles = ((np.arange(scatter_parts) + 0.5) / scatter_parts * 2.0 - 1.0) * template.window_rad
    return np.asarray(np.interp(template.phi_rad, middles, widest))


# ---- Pulses that are no passages, known by when they come and how long they last.
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
    kept = pulses.copy()
    kept["middle"] = place
    kept = _joined(kept)
    for _ in range(3):  # each round leaves half of the strangers that stand side by side
        kept = kept[~_strangers(kept)]
    kept["middle"] = np.interp(kept["middle"], place, pulses["middle"])
    return kept


def _joined(pulses: Records) -> Records:
    """The pulses, their places on a gapless axis, with pairs that are too close made one.

    Their hull if that has the usual width, else the one whose width is more usual.
    """
    if len(pulses) < 3:
        return pulses
    width_around = usual(pulses["width"])
    period = width_around / width_turns(pulses["middle"], pulses["width"])
    # pulses closer than this share of a turn cannot both be passages; two passages are taken for
    # one if their widths say four times the period; with twice as much, if they say two times
    close = np.flatnonzero(np.diff(pulses["middle"]) < 0.25 * np.minimum(period[1:], period[:-1]))
    joined, kept = pulses.copy(), np.ones(len(pulses), bool)
    middle, width = joined["middle"], joined["width"]
    for first in close:
        second = first + 1
        if not kept[first]:
            continue
        entry, leave = middle[first] - 0.5 * width[first], middle[second] + 0.5 * width[second]
        # width of the joined halves against the widths around
        if 0.6 < (leave - entry) / width_around[first] < 1.5:
            middle[first], width[first] = 0.5 * (entry + leave), leave - entry
            kept[second] = False
        else:
            unusual = np.abs(np.log(width[[first, second]] / width_around[first]))
            kept[second if unusual[0] <= unusual[1] else first] = False
    return joined[kept]


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
#: heights, against the median around, outside of which a pulse of unknown speed is no passage of
#: this wheel; twice as wide keeps pulses of a sixth and of five times the height
FOREIGN_HEIGHTS = (0.3, 2.5)


def match(signal: Signal, pulses: Records) -> tuple[Template | None, Records, Records]:
    """Template, starts (n,) of ROW and fits (n,) of FOUND of the pulses that are passages.

    Of a passage in which the wheel stood the time is the middle of its pulse. The template is None
    if there are too few.
    """
    channel = signal.channel
    pulses = screen(channel, pulses)
    start = _start(channel, pulses)
    template = _learn(signal, start, np.ones(start.size, bool)) if start.size > 1 else None
    if template is None:  # the middle of the half-level crossings, to a tenth of the width
        rough: dict[str, Any] = {name: start[name] for name in ("time_s", "height", "offset")}
        rough |= dict.fromkeys(("omega_rad_s", "omega_se_rad_s", "misfit"), np.nan)
        return None, start, records(FOUND, time_se_s=0.1 * start["width_s"], **rough)
    found = fit(signal, template, start)
    kept = ~_foreign(found, start, signal.noise)
    if not kept.all():
        pulses = pulses[kept]
        start = _start(channel, pulses)
        found = fit(signal, template, start)
    back = _backwards(signal, template, start, found)
    if back.any():
        start = _start(channel, pulses, back[1:] != back[:-1])
        template = _learn(signal, start, ~back) or template
        mirrored = fit(signal, template.mirrored(), start)
        found = np.where(back, mirrored, fit(signal, template, start))
    found["backwards"] = back
    _judge(start, found, signal.noise)
    return template, start, found


def _learn(signal: Signal, start: Records, usable: BoolArray) -> Template | None:
    """The template from the passages of known speed among the `usable`.

    From all of these if none has a known speed.
    """
    known = np.flatnonzero(usable & (start["stretch"] == STRETCH_NEIGHBOURS))
    return learn_template(signal, start, known if known.size else np.flatnonzero(usable))


def _judge(start: Records, found: Records, noise: float) -> None:
    """Fills which fits are of a standing wheel, and widens errors by what the fits leave.

    The error of a row that fits far worse than most is larger: its residual is no white noise.
    """
    height, misfit = np.abs(found["height"]), found["misfit"]
    known = height > 0.0  # a row without a sample tells nothing
    share = float(np.median(misfit[known] / height[known])) if known.any() else 0.0
    # a pulse of unknown speed with more misfit [height], and than so many times the log's own
    # (edges that ring are no standstill), is no steady passage: the wheel stood in it. Twice as
    # much of either would miss short stops
    bad = misfit > np.maximum(max(0.05, 2.0 * share) * height, 3 * noise)
    standing = bad & (start["stretch"] == STRETCH_WIDTH) & ~found["holds_spike"]
    if noise > 0:
        # a row is doubtful if its misfit is this many times the median's; twice as many leave the
        # error as it is for misfits of up to six times
        doubtful = misfit > 3.0 * np.maximum(share * height, noise)
        found["time_se_s"] *= np.where(doubtful, 2.0 * misfit / noise, 1.0)
    found["standing"] = standing
    found["time_s"] = np.where(standing, start["time_s"], found["time_s"])
    found["time_se_s"] = np.where(standing, 0.25 * start["width_s"], found["time_se_s"])


def _foreign(found: Records, start: Records, noise: float) -> BoolArray:
    """Pulses that are no passage by their fit.

    Of another height than those around, or a bad fit between two that are one turn apart.
    """
    around = usual(np.abs(found["height"]))
    foreign = (found["height"] < FOREIGN_HEIGHTS[0] * around) | (
        found["height"] > FOREIGN_HEIGHTS[1] * around
    )
    foreign &= start["stretch"] == STRETCH_WIDTH
    # twice the misfit keeps pulses that are half as like a passage
    bad = found["misfit"] > np.maximum(0.1 * np.abs(found["height"]), 3 * noise)
    mean = 0.5 * (start["omega_rad_s"][2:] + start["omega_rad_s"][:-2])
    skip = (found["time_s"][2:] - found["time_s"][:-2]) * mean / TURN_RAD
    foreign[1:-1] |= bad[1:-1] & ~bad[:-2] & ~bad[2:] & one_turn(skip)
    return foreign


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
    told = near & (motion["sides"] > 0)
    return records(
        ROW,
        time_s=time_s,
        index=pulses["middle"],
        omega_rad_s=np.where(told, motion["omega_rad_s"], from_width),
        alpha_rad_s2=np.where(told, motion["alpha_rad_s2"], 0.0),
        stretch=np.where(told & (motion["sides"] == 2), STRETCH_NEIGHBOURS, STRETCH_WIDTH),
        height=pulses["height"],
        offset=pulses["base"],
        width_s=width_s,
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
    for first, stop in pairwise(np.concatenate([[0], ends, [n]])):
        rows = np.arange(first, min(stop, first + 8))
        some = start[rows]
        some["time_s"], some["omega_rad_s"] = found["time_s"][rows], found["omega_rad_s"][rows]
        some["height"] = np.abs(found["height"][rows])
        forth, other = (fit(signal, shape, some) for shape in (template, template.mirrored()))
        floor = signal.noise**2
        ratio = (forth["misfit"] ** 2 + floor) / (other["misfit"] ** 2 + floor)
        # logarithm of the likelihood ratio: odds of 3e6 to one; half of it, 1800 to one
        back[first:stop] = 0.5 * float(np.sum(forth["used"] * np.log(ratio))) > 15.0
    return back if 2 * back.sum() <= n else ~back
