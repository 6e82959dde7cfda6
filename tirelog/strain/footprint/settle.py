"""The form of free rolling: learnt, looked at, and learnt anew without what does not roll freely.

    passages --> Learnt
        --misses passages? without those that speed up and slow down, if that is clearer-->
        --some of all passages are looked at: driven ones among them? without these-->
    Settled, from which the next grating of the log starts

What a traction does to the form is larger than what the form is asked for. Only some passages are
looked at, evenly over the log, so that settling takes no longer on a longer log.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import BLOCK_SAMPLES, Channel
from tirelog.strain.footprint.learn import (
    FREE_ROLLING_M_S2,
    LEAST_OF_CLASS,
    Learnt,
    learn_reference,
)
from tirelog.strain.footprint.measure import Forms, Look, Measured, look_at_some
from tirelog.strain.footprint.refine import REMARKABLE
from tirelog.strain.footprint.slip_onset import Usual
from tirelog.strain.passages.find import Passages
from tirelog.vocabulary.arrays import IntArray

#: passages that are looked at for a traction; half as many leave too few of a class of speed to
#: learn from where three of four are driven, twice as many take twice as long
LOOKED = 960
#: passages with a traction are too few to bend the learnt form, or too many to be left out, by this
#: share; twice as much is still neither
DRIVEN_SHARE = 0.03
#: misfit (chi-square per degree of freedom, less one) from which on a form is learnt of steady
#: passages alone, and the share of it that this one may leave to be taken; twice the first leaves
#: forms that put onsets 3 to 5 mm off; twice the second takes one as good, of fewer passages
MISSES, CLEARER = 0.15, 0.5
#: with a misfit above this a form is no start for another; twice as much starts from forms that
#: have gone astray, half as much learns from the beginning what would have been near
NO_START = 10.0
#: times that a form is learnt anew without passages that turn out driven: the second time sees
#: what the first one's form has hidden; the loop ends by itself if no more turn out driven; twice
#: as many take longer if they do
MOST_LEARNT = 3


@dataclass(frozen=True)
class Settled:
    """A channel's form, and what is known with it.

    `usual`: what passages that roll freely leave, None if there are none; `clearer`: whether the
    form of steady passages alone is clearer, None if that was not asked; `forms`: at the knots of
    the channel's speeds, None if they are to be made.
    """

    learnt: Learnt
    usual: Usual | None = None
    clearer: bool | None = None
    forms: Forms | None = None

    @property
    def light(self) -> Settled:
        """Without what can be made again."""
        return replace(self, forms=None)


def settle(
    channel: Channel,
    passages: Passages,
    block_samples: int = BLOCK_SAMPLES,
    like: Settled | None = None,
) -> Settled | None:
    """The form of the passages of `channel` that roll freely; None if there are none to learn from.

    `like`: that of another grating of the log, to start from: it has the same drive, so what was
    settled there about passages that speed up and slow down holds here.
    """
    if not len(passages):
        return None
    steady = np.abs(passages.acceleration_m_s2) < FREE_ROLLING_M_S2
    start = None if like is None else like.learnt
    learnt, clearer = None, None
    if like is not None and like.clearer and _enough(steady):
        learnt = learn_reference(channel, passages, block_samples, start, ~steady)
        clearer = True
    if learnt is None:
        learnt = learn_reference(channel, passages, block_samples, start)
        if learnt is None:
            return None
        missed = learnt.reference.misfit - 1.0
        clearer = None if like is None else like.clearer
        if missed > MISSES and clearer is None and _enough(steady):
            begin = learnt if missed < NO_START else None
            freely = learn_reference(channel, passages, block_samples, begin, ~steady)
            clearer = freely is not None and freely.reference.misfit - 1.0 <= CLEARER * missed
            if clearer and freely is not None:
                learnt = freely
    left_out = ~steady if clearer else np.zeros(len(passages), bool)
    return _undriven(channel, passages, block_samples, learnt, left_out, clearer)


def _enough(steady: NDArray[np.bool_]) -> bool:
    """Whether passages at steady speed (n,) are not all, and enough to learn a form from."""
    return bool((~steady).mean() >= DRIVEN_SHARE and steady.sum() >= LEAST_OF_CLASS)


def _undriven(
    channel: Channel,
    passages: Passages,
    block_samples: int,
    learnt: Learnt,
    left_out: NDArray[np.bool_],
    clearer: bool | None,
) -> Settled:
    """The form without passages that show a traction, if the `learnt` one bends to them.

    `left_out` (n,): passages that it was not learnt from.
    """
    for again in range(MOST_LEARNT + 1):
        look = Look.of(channel, passages, learnt, block_samples)
        if look is None:
            break
        rows, work = look_at_some(look, LOOKED)
        settled = Settled(learnt, work.usual, clearer, look.forms)
        new = work.driven & ~left_out
        if again == MOST_LEARNT or not new.any() or not _mixed(learnt, rows, work):
            return settled
        left_out = left_out | work.driven
        without = left_out.copy()
        without[np.setdiff1d(np.arange(len(passages)), rows)] = True  # who knows of the others
        freed = learn_reference(channel, passages, block_samples, learnt, without)
        if freed is None:
            return settled
        learnt = freed
    return Settled(learnt, None, clearer)


def _mixed(learnt: Learnt, rows: IntArray, work: Measured) -> bool:
    """Whether the form has to be learnt again, without passages under traction.

    So it is if it was learnt from passages with and without traction alike, and missed both.
    """
    share = work.driven.sum() / rows.size
    return (
        DRIVEN_SHARE < share < 1.0 - DRIVEN_SHARE
        and work.usual is not None
        and learnt.reference.misfit > REMARKABLE * work.usual.scatter**2
    )
