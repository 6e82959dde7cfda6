"""Pulses to fitted passages.

What each fit starts from, the template, and which pulses are no passage after all.

Pulses --screen, rough speeds--> Start --learn--> Template
    --fit--> Fit, one row per passage
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Channel
from tirelog.strain.passages.decimate import AT_ONCE
from tirelog.strain.passages.fit import PassageFit, Signal, Start, fit_blocks, fit_passages, gather
from tirelog.strain.passages.kinematics import TURN_RAD, kinematics, may_have_stopped, turns_between
from tirelog.strain.passages.learn import learn_template
from tirelog.strain.passages.screen import one_turn, screen, width_turns
from tirelog.strain.passages.search import Pulses, usual
from tirelog.strain.passages.template import Template
from tirelog.vocabulary.arrays import FloatArray

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
#: a row is doubtful if its misfit is this many times the median's; twice as many leave the error
#: as it is for misfits of up to six times
DOUBTFUL = 3.0
#: heights, against the median around, outside of which a pulse of unknown speed is no passage of
#: this wheel; twice as wide keeps pulses of a sixth and of five times the height
FOREIGN_HEIGHTS = (0.3, 2.5)
#: passages of a stretch that are tried the other way round, and the log likelihood ratio from which
#: they ran backwards: odds of 3e6 to one; half of it, 1800 to one
TRIED_BACKWARDS, BACKWARDS_EVIDENCE = 8, 15.0


@dataclass(frozen=True)
class Matched:
    """The fitted passages, and which of them were no plain ones.

    The `pulses` that are left, the `start` of their fits, the `fit`, standard errors of its times
    (n,); `standing`: the wheel stood in the passage (n,), `backwards`: it rolled backwards (n,).
    """

    template: Template | None
    pulses: Pulses
    start: Start
    fit: PassageFit
    time_se_s: FloatArray
    standing: NDArray[np.bool_]
    backwards: NDArray[np.bool_]

    @property
    def time_s(self) -> FloatArray:
        """Times of the patch centres.

        Of a passage in which the wheel stood: the middle of its pulse.
        """
        return np.where(self.standing, self.start.time_s, self.fit.time_s)


def match(signal: Signal, pulses: Pulses) -> Matched:
    """Template and fit of the pulses, without those that are no passage."""
    pulses = screen(signal.channel, pulses)
    start = _start(signal.channel, pulses)
    everything = np.ones(len(pulses), bool)
    template = _learn(signal, start, pulses, everything) if len(pulses) > 1 else None
    if template is None:
        return _matched(signal, None, pulses, start, _rough(signal, start, pulses), ~everything)
    found = _fit_all(signal, start, pulses.height, template)
    kept = ~_foreign(found, start, signal.noise)
    if not kept.all():
        pulses = pulses.take(kept)
        start = _start(signal.channel, pulses)
        found = _fit_all(signal, start, pulses.height, template)
    back = _backwards(signal, template, start, found)
    if back.any():
        start = _start(signal.channel, pulses, back[1:] != back[:-1])
        template = _learn(signal, start, pulses, ~back) or template
        found = _fit_all(signal, start, pulses.height, template)
        found = PassageFit.choose(
            back, _fit_all(signal, start, pulses.height, template.mirrored()), found
        )
    return _matched(signal, template, pulses, start, found, back)


def _learn(
    signal: Signal, start: Start, pulses: Pulses, usable: NDArray[np.bool_]
) -> Template | None:
    """The template from the passages of known speed among the `usable`.

    From all of these if none has a known speed.
    """
    known = np.flatnonzero(usable & (start.stretch == STRETCH_NEIGHBOURS))
    return learn_template(signal, start, known if known.size else np.flatnonzero(usable), pulses)


def _matched(
    signal: Signal,
    template: Template | None,
    pulses: Pulses,
    start: Start,
    found: PassageFit,
    back: NDArray[np.bool_],
) -> Matched:
    """The fits with what they say about themselves."""
    height = np.abs(found.height)
    usual = USUAL_MISFITS * float(np.median(found.misfit / height)) if len(pulses) else 0.0
    bad = found.misfit > np.maximum(max(STANDING_MISFIT, usual) * height, 3 * signal.noise)
    standing = bad & (start.stretch == STRETCH_WIDTH) & ~found.spike
    quarter_s = 0.25 * pulses.width / signal.channel.axis.rate_Hz
    return Matched(
        template,
        pulses,
        start,
        found,
        np.where(standing, quarter_s, found.time_se_s * _doubt(found, signal.noise)),
        standing,
        back,
    )


def _foreign(found: PassageFit, start: Start, noise: float) -> NDArray[np.bool_]:
    """Pulses that are no passage by their fit.

    Of another height than those around, or a bad fit between two that are one turn apart.
    """
    around = usual(np.abs(found.height))
    foreign = (found.height < FOREIGN_HEIGHTS[0] * around) | (
        found.height > FOREIGN_HEIGHTS[1] * around
    )
    foreign &= start.stretch == STRETCH_WIDTH
    bad = found.misfit > np.maximum(FOREIGN_MISFIT * np.abs(found.height), 3 * noise)
    if bad.size > 2:
        skip = (
            (found.time_s[2:] - found.time_s[:-2])
            * 0.5
            * (start.omega[2:] + start.omega[:-2])
            / TURN_RAD
        )
        foreign[1:-1] |= bad[1:-1] & ~bad[:-2] & ~bad[2:] & one_turn(skip)
    return foreign


def _doubt(found: PassageFit, noise: float) -> FloatArray:
    """Factor on the standard error of rows that fit far worse than most, (n,).

    Their residual is no white noise.
    """
    if not found.misfit.size or not np.isfinite(found.misfit).any() or not noise > 0:
        return np.ones(found.misfit.size)
    share = found.misfit / np.abs(found.height)
    expected = np.maximum(float(np.nanmedian(share)) * np.abs(found.height), noise)
    return np.where(found.misfit > DOUBTFUL * expected, 2.0 * found.misfit / noise, 1.0)


def _start(channel: Channel, pulses: Pulses, turned: NDArray[np.bool_] | None = None) -> Start:
    """Rough centres, speeds and accelerations.

    From the neighbours if these are one turn away, else from the pulse's width. `turned` (n - 1,):
    whether the wheel is known to have rolled back before the next passage.
    """
    time_s = channel.axis.at(pulses.middle)
    width_s = pulses.width / channel.axis.rate_Hz
    from_width = TURN_RAD * width_turns(time_s, width_s) / width_s
    turns = turns_between(time_s, from_width)
    linked = np.append(one_turn(turns) & (True if turned is None else ~turned), False)
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


def _fit_all(signal: Signal, start: Start, height: FloatArray, template: Template) -> PassageFit:
    """All rows, a block of the log at a time."""
    return fit_blocks(signal, template, start, height, AT_ONCE)


def _rough(signal: Signal, start: Start, pulses: Pulses) -> PassageFit:
    """Rows without a template: the middle of the half-level crossings.

    With an error of a tenth of the width.
    """
    n = len(pulses)
    no, nan = np.zeros(n, bool), np.full(n, np.nan)
    width_s = pulses.width / signal.channel.axis.rate_Hz
    return PassageFit(
        start.time_s,
        0.1 * width_s,
        nan,
        nan,
        pulses.height,
        pulses.base,
        nan,
        np.zeros(n, np.int64),
        no,
        no,
        no,
        no,
    )


def _backwards(
    signal: Signal, template: Template, start: Start, found: PassageFit
) -> NDArray[np.bool_]:
    """Passages of a wheel that rolled backwards, shape (n,).

    They are stretches whose waveform fits better the other way round. Stretches end if the next
    passage is not one turn away, or the wheel may have stopped between two. Most of a log's
    passages are taken as forwards, and a waveform that is the same both ways tells nothing.
    """
    n = found.time_s.size
    back = np.zeros(n, bool)
    ends = (
        np.flatnonzero(
            ~one_turn(turns_between(found.time_s, start.omega)) | may_have_stopped(found.time_s)
        )
        + 1
    )
    if not ends.size:
        return back
    for first, stop in pairwise(np.concatenate([[0], ends, [n]])):
        rows = np.arange(first, min(stop, first + TRIED_BACKWARDS))
        some = replace(start, time_s=found.time_s, omega=found.omega).take(rows)
        windows = gather(signal, some, template.window_rad)
        height = np.abs(found.height[rows])
        forth, other = (
            fit_passages(windows, shape, some, height) for shape in (template, template.mirrored())
        )
        floor = signal.noise**2
        ratio = (forth.misfit**2 + floor) / (other.misfit**2 + floor)
        back[first:stop] = 0.5 * float(np.sum(forth.used * np.log(ratio))) > BACKWARDS_EVIDENCE
    return back if 2 * back.sum() <= n else ~back
