"""Whether what was found are passages of a tire at all: the gate before any speed is told.

    Pulses as found, Matched passages
        --share of a turn, turns between, shape, speed--> '' or what is wrong with them

A patch takes some hundredths of a turn and the next comes one turn later, with the same waveform,
at a speed that changes smoothly. Pulses of a rim's or chassis' acceleration, of a bending test or
of noise fail at least one of these. Each rule is a ratio, so none of them knows the unit of the
signal, and each needs so many pulses that a short log of a real tire is not refused by chance.
"""

from __future__ import annotations

import numpy as np

from tirelog.data.recording import Channel
from tirelog.strain.passages.kinematics import TURN_RAD, turns_between
from tirelog.strain.passages.match import Matched
from tirelog.strain.passages.screen import one_turn
from tirelog.strain.passages.search import Pulses

#: width at half level over the period; tires of cars, trucks, bicycles and karts: 0.03 to 0.12, a
#: sine: 0.5.  Twice as much lets gravity on a rim pass, of which every second turn stands out
WIDEST_TURNS = 0.2
#: deceleration [m/s^2] from which a wheel that stops within a turn may have stood or rolled back
#: before the next passage (a car's: from 5.5 m/s).  Twice as much takes random pulses at 7.8 m/s
#: for stops
STOPPING_M_S2 = 8.0
#: share of pairs that may fail to be one turn apart, as the wheel stopped or samples were lost: of
#: pairs too fast for a stop, and of all.  Random pulses: 0.4 to 0.9; starts and stops: up to 0.1,
#: every fourth turn lost: 0.25.  Twice as much lets random pulses pass
MOST_BROKEN, MOST_UNLINKED = 0.3, 0.4
#: pairs that it takes to say so.  Half as many would doubt a car that is parked; twice as many let
#: the axles of a weighing bridge pass
FEWEST_FAST, FEWEST_PAIRS = 3, 8
#: residual of the usual waveform beyond the noise, over the height; a real tire that rings at its
#: edges: 0.07, 1/f noise: 0.35 to 0.8.  Twice as much lets noise pass, half as much leaves no
#: margin
MOST_MISFIT = 0.15
#: noise over height of pulses that may be the noise's own largest (the search takes 0.125), and the
#: share of pairs that may then fail.  Twice as much asks it of all logs
FAINT, FAINT_UNLINKED = 0.09, 0.15
#: departure of a turn's time from those beside it, relative, median; stop-and-go in town: 0.075,
#: turns that are sometimes missed: 0.2 to 0.4; twice as much would take logs in which turns are
#: missed
MOST_UNEVEN, FEWEST_TRIPLES = 0.15, 6


def doubt(channel: Channel, raw: Pulses, matched: Matched, noise: float, radius_m: float) -> str:
    """Why the pulses are no passages of a tire; '' if nothing speaks against it.

    `raw`: the pulses as they were found, before strangers were dropped; `noise`: sigma of one
    sample; `radius_m`: the rolling radius.
    """
    share = _width_turns(channel, raw)
    if share > WIDEST_TURNS:
        return (
            f"each lasts {100 * share:.0f} % of the time to the next, and a patch at most "
            f"{100 * WIDEST_TURNS:.0f} %"
        )
    time_s, omega = matched.time_s, matched.start.omega
    if time_s.size < 3:
        return ""
    period = np.diff(time_s)
    linked = one_turn(turns_between(time_s, omega))
    pairs, unlinked = linked.size, float(np.mean(~linked))
    broken = ~linked & (radius_m * np.maximum(omega[1:], omega[:-1]) > _stopping_speed(radius_m))
    height = np.abs(matched.fit.height)
    faint = noise > FAINT * float(np.median(matched.pulses.height))
    if (
        (pairs >= FEWEST_FAST and broken.sum() > MOST_BROKEN * pairs)
        or (pairs >= FEWEST_PAIRS and unlinked > MOST_UNLINKED)
        or (pairs >= FEWEST_FAST and faint and unlinked > FAINT_UNLINKED)
    ):
        return (
            f"only {100 * (1 - unlinked):.0f} % of them come one turn after the one before, by "
            "the speed that their widths tell"
        )
    if matched.template is not None and time_s.size > FEWEST_FAST:
        beyond = np.sqrt(np.maximum(matched.fit.misfit**2 - noise**2, 0.0)) / height
        if np.median(beyond) > MOST_MISFIT:
            return f"their shapes differ by {100 * np.median(beyond):.0f} % of their height"
    uneven = np.abs(np.log(period[1:-1] / np.sqrt(period[2:] * period[:-2])))[
        linked[1:-1] & linked[2:] & linked[:-2]
    ]
    if uneven.size >= FEWEST_TRIPLES and np.median(uneven) > MOST_UNEVEN:
        return (
            f"the time from one to the next jumps by {100 * np.median(uneven):.0f} % from turn "
            "to turn"
        )
    return ""


def sentence(channel: str, rows: int, found: int, why: str) -> str:
    """What a command says of a channel whose pulses are no passages.

    `rows` of the `found` pulses stand in its table.
    """
    which = f"the {found} pulses found" if rows == found else f"{rows} of {found} pulses found"
    return (
        f"{channel}: {which} are not one turn apart, or not of a patch: {why}; "
        "not a patch signal? "
        "No speed is told from them; check source, kind and surface of the channel in the setup"
    )


def _stopping_speed(radius_m: float) -> float:
    """Speed [m/s] from which a wheel can stop within a turn."""
    return float(np.sqrt(2.0 * STOPPING_M_S2 * TURN_RAD * radius_m))


def _width_turns(channel: Channel, pulses: Pulses) -> float:
    """Median width of the pulses over the time from one to the next.

    Of few pulses the least, as the wheel may have stood in others.
    """
    if len(pulses) < 3:
        return 0.0
    time_s = channel.axis.at(pulses.middle)
    share = 2.0 * pulses.width[1:-1] / channel.axis.rate_Hz / (time_s[2:] - time_s[:-2])
    return float(np.median(share) if share.size > 3 else share.min())
