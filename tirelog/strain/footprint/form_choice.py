"""The form of free rolling: learnt, looked at, and learnt anew without what does not roll freely.

    passages --> EdgeForm
        --misses passages? without those that speed up and slow down, if that is clearer-->
        --some of all passages are looked at: driven ones among them? without these-->
        --still misses them, each in its own way? of those that are alike, and that it fits-->
        --of what rolls freely: the tire's own pressure and stiffness-->
    FormChoice, from which the next grating of the log starts

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
    EdgeForm,
    learn_own,
    learn_reference,
)
from tirelog.strain.footprint.measure import Forms, Measured, WindowPlan, look_at_some
from tirelog.strain.footprint.refine import REMARKABLE
from tirelog.strain.footprint.slip_onset import FreeRollingReference
from tirelog.strain.passages.find import Passages
from tirelog.vocabulary.arrays import FloatArray, IntArray

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
#: passages differ among themselves if what the form misses of each alone is this share of what it
#: misses of all; half of it asks of forms that miss all alike
DIFFER = 0.3
#: then it is learnt of this share of them, which it fits best, and of all with no more than this
#: chi-square per degree of freedom; twice the share mixes those that pull with those that do not,
#: half the chi-square leaves out speeds that the first ones do not have
BEST, LIKELY = 0.2, 4.0
#: where the form of the first does not hold yet, at other speeds, passages are told by a gap: the
#: misfit above it is so many times that below; twice as much leaves out speeds
GAP = 2.0
#: times that they are chosen, at most, and how many times as many there have to be if the form is
#: not much clearer; half as many times may leave out speeds that the first ones do not have
MOST_CHOSEN, MORE = 6, 1.05
#: times that a form is learnt anew without passages that turn out driven: the second time sees
#: what the first one's form has hidden; the loop ends by itself if no more turn out driven; twice
#: as many take longer if they do
MOST_LEARNT = 3


@dataclass(frozen=True)
class FormChoice:
    """A channel's form, and what is known with it.

    `usual`: what passages that roll freely leave, None if there are none; `clearer`: whether the
    form of steady passages alone is clearer, None if that was not asked; `chosen`: whether it is
    that of passages which are alike; `forms`: at the knots of the channel's speeds, None if
    they are to be made.
    """

    learnt: EdgeForm
    usual: FreeRollingReference | None = None
    clearer: bool | None = None
    chosen: bool = False
    forms: Forms | None = None

    @property
    def light(self) -> FormChoice:
        """Without what can be made again."""
        return replace(self, forms=None)


def choose_form(
    channel: Channel,
    passages: Passages,
    block_samples: int = BLOCK_SAMPLES,
    like: FormChoice | None = None,
) -> FormChoice | None:
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
    settled = _undriven(channel, passages, block_samples, learnt, left_out, clearer)
    if like is None or like.chosen:
        settled = _of_alike(channel, passages, block_samples, settled, like) or settled
    return _with_own(channel, passages, block_samples, settled)


def _with_own(
    channel: Channel, passages: Passages, block_samples: int, settled: FormChoice
) -> FormChoice:
    """`settled` with the tire's own form, and what free passages leave beside that."""
    learnt = learn_own(channel, passages, settled.learnt, block_samples)
    if learnt.reference.family is settled.learnt.reference.family:
        return replace(settled, learnt=learnt)
    look = WindowPlan.of(channel, passages, learnt, block_samples)
    if look is None:
        return replace(settled, learnt=learnt, forms=None)
    rolls = ~learnt.without if settled.chosen and learnt.without is not None else None
    _, work = look_at_some(look, LOOKED, rolls)
    return replace(settled, learnt=learnt, usual=work.usual, forms=look.forms)


def _enough(steady: NDArray[np.bool_]) -> bool:
    """Whether passages at steady speed (n,) are not all, and enough to learn a form from."""
    return bool((~steady).mean() >= DRIVEN_SHARE and steady.sum() >= LEAST_OF_CLASS)


def _undriven(
    channel: Channel,
    passages: Passages,
    block_samples: int,
    learnt: EdgeForm,
    left_out: NDArray[np.bool_],
    clearer: bool | None,
) -> FormChoice:
    """The form without passages that show a traction, if the `learnt` one bends to them.

    `left_out` (n,): passages that it was not learnt from.
    """
    for again in range(MOST_LEARNT + 1):
        look = WindowPlan.of(channel, passages, learnt, block_samples)
        if look is None:
            break
        rows, work = look_at_some(look, LOOKED)
        settled = FormChoice(learnt, work.usual, clearer, forms=look.forms)
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
    return FormChoice(learnt, None, clearer)


def _of_alike(
    channel: Channel,
    passages: Passages,
    block_samples: int,
    settled: FormChoice,
    like: FormChoice | None,
) -> FormChoice | None:
    """The form of passages that are alike and that it fits, if it is much clearer.

    So it is where many passages pull at a steady speed: no form fits those that do, and that of all
    fits none. Begun with those that the form of `settled`, or of `like`, fits best, which may be
    those that pull: then it still misses them, and is learnt of the others.
    """
    learnt, missed = (like or settled).learnt, settled.learnt.reference.misfit - 1.0
    if missed < MISSES:
        return None
    kept, count = np.zeros(len(passages), bool), 0
    for again in range(MOST_CHOSEN):
        look = WindowPlan.of(channel, passages, learnt, block_samples)
        if look is None:
            return None
        rows, work = look_at_some(look, LOOKED)
        misfit = np.nan_to_num(work.fits.chi2[rows], nan=np.inf)
        if not again and like is None and np.median(misfit) - 1.0 < DIFFER * missed:
            return None
        best = misfit <= max(np.quantile(misfit, BEST), LIKELY)
        if again:
            best |= _below_gap(misfit, look.number[rows])
        groups = [best, ~best] if again and learnt.reference.misfit > REMARKABLE else [best]
        start = learnt if learnt.reference.misfit < NO_START else None
        made = []
        for group in groups:
            others = np.ones(len(passages), bool)
            others[rows[group]] = False
            if (found := learn_reference(channel, passages, block_samples, start, others)) is None:
                return None
            made.append((found.reference.misfit, found, ~others))
        least, found, those = min(made, key=lambda one: one[0])
        if again and least > CLEARER * learnt.reference.misfit and those.sum() < MORE * count:
            break
        learnt, kept, count = found, those, int(those.sum())
    if learnt.reference.misfit - 1.0 > min(CLEARER * missed, NO_START):
        return None
    look = WindowPlan.of(channel, passages, learnt, block_samples)
    if look is None:
        return None
    _, work = look_at_some(look, LOOKED, kept)
    return FormChoice(learnt, work.usual, settled.clearer, True, look.forms)


def _below_gap(misfit: FloatArray, group: IntArray) -> NDArray[np.bool_]:
    """Which of the rows (n,) are below a gap among the misfits of their `group`.

    The widest one, if it is as wide as GAP and has a tenth of the group on either side.
    """
    below = np.zeros(misfit.size, bool)
    for number in np.unique(group):
        own = np.flatnonzero((group == number) & np.isfinite(misfit))
        own = own[np.argsort(misfit[own])]
        few = own.size // 10 + 1
        steps = misfit[own[few:-few]] / misfit[own[few - 1 : -few - 1]]
        if steps.size and steps.max() > GAP:
            below[own[: few + int(np.argmax(steps))]] = True
    return below


def _mixed(learnt: EdgeForm, rows: IntArray, work: Measured) -> bool:
    """Whether the form has to be learnt again, without passages under traction.

    So it is if it was learnt from passages with and without traction alike, and missed both.
    """
    share = work.driven.sum() / rows.size
    return (
        DRIVEN_SHARE < share < 1.0 - DRIVEN_SHARE
        and work.usual is not None
        and learnt.reference.misfit > REMARKABLE * work.usual.scatter**2
    )
