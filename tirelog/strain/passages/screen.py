"""Pulses that are no passages, told by when they come and how long they last.

The instrument jumped, or a jump split a passage in two.

    Pulses --join halves, drop strangers--> Pulses

A passage lasts a fixed share of a turn, and the next comes a turn later. Two pulses much closer
than that are the halves of one passage, or one of them is a jump; a pulse between two others that
are just one turn apart is a jump. Speeds come from the median width of the pulses around, so a few
strangers do not matter. Rows are only dropped, never added.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Channel
from tirelog.strain.passages.search import Pulses, usual
from tirelog.vocabulary.arrays import FloatArray

#: width of a passage (half level) as a share of a turn, if the log is too short to tell
USUAL_WIDTH_TURNS = 0.06
#: two passages are one turn apart if the turn that the speeds beside them give lies in this range:
#: nearer to one turn than to a half or to two, as ratios.  Wider, a missed passage goes unseen
ONE_TURN = (0.7, 1.4)
#: pulses closer than this share of a turn cannot both be passages; two passages are taken for one
#: if their widths say four times the period; with twice as much, if they say two times
TOO_CLOSE_TURNS = 0.25
#: width of the joined halves against the widths around
JOINED_WIDTH = (0.6, 1.5)
#: rounds of dropping; each round leaves half of the strangers that stand side by side
ROUNDS = 3


def width_turns(middle: FloatArray, width: FloatArray) -> float:
    """Width of a passage in turns: the median of width over period, both in one unit."""
    if middle.size < 2:
        return USUAL_WIDTH_TURNS
    if middle.size == 2:
        share = float(width.mean() / (middle[1] - middle[0]))
    else:
        share = float(np.median(2 * width[1:-1] / (middle[2:] - middle[:-2])))
    return share if 0.01 < share < 0.25 else USUAL_WIDTH_TURNS


def one_turn(turns: FloatArray) -> NDArray[np.bool_]:
    """Whether that many turns, from speeds that are good to some 20 %, are one."""
    return (turns > ONE_TURN[0]) & (turns < ONE_TURN[1])


def screen(channel: Channel, pulses: Pulses) -> Pulses:
    """The pulses of `channel` that may be passages."""
    if not len(pulses):
        return pulses
    # places as if no sample were missing, so that a gap counts
    place = channel.axis.at(pulses.middle) * channel.axis.rate_Hz
    kept = _screened(replace(pulses, middle=place))
    return replace(kept, middle=np.interp(kept.middle, place, pulses.middle))


def _screened(pulses: Pulses) -> Pulses:
    """`pulses`, their places on a gapless axis, without halves and strangers."""
    pulses = _joined(pulses)
    for _ in range(ROUNDS):
        strange = _strangers(pulses)
        if not strange.any():
            break
        pulses = pulses.take(~strange)
    return pulses


def _joined(pulses: Pulses) -> Pulses:
    """The pulses with pairs that are too close made one.

    Their hull if that has the usual width, else the one whose width is more usual.
    """
    if len(pulses) < 3:
        return pulses
    width_around = usual(pulses.width)
    period = width_around / width_turns(pulses.middle, pulses.width)
    close = np.flatnonzero(
        np.diff(pulses.middle) < TOO_CLOSE_TURNS * np.minimum(period[1:], period[:-1])
    )
    middle, width, kept = pulses.middle.copy(), pulses.width.copy(), np.ones(len(pulses), bool)
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
    return Pulses(middle, width, pulses.height, pulses.base).take(kept)


def _strangers(pulses: Pulses) -> NDArray[np.bool_]:
    """Pulses less than a turn from both neighbours, which are just one turn apart, shape (n,)."""
    strange = np.zeros(len(pulses), bool)
    if len(pulses) < 4:
        return strange
    rate = width_turns(pulses.middle, pulses.width) / usual(pulses.width)
    step = np.diff(pulses.middle) * 0.5 * (rate[1:] + rate[:-1])
    over = (pulses.middle[2:] - pulses.middle[:-2]) * 0.5 * (rate[2:] + rate[:-2])
    strange[1:-1] = one_turn(over) & (np.maximum(step[1:], step[:-1]) < 0.9 * over)
    # of neighbours only the one goes without which the others are nearest to one turn apart; the
    # rest is judged again
    off = np.full(len(pulses), np.inf)
    off[1:-1] = np.where(strange[1:-1], np.abs(np.log(over)), np.inf)
    padded = np.pad(off, 1, constant_values=np.inf)
    return strange & (off <= padded[:-2]) & (off < padded[2:])
