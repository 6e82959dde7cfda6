"""Passages of a grating (or accelerometer) through the contact patch.

The clock of every other estimator.

    Channel --`wheel.pulses`--> rough middles and widths
            --match: a template learnt from some, all fitted by it--> times
            --kinematics--> speeds --marks--> words --> Passages, one row per passage

One row is one passage, in the order of the log: its ordinal is the `revolution` of every table. The
*patch centre* is the zero of the matched template, the middle between its half-level crossings
(`template`); all commands use it. Only windows around the passages are fitted, block by block. The
passages fix the places of these, so the rows do not depend on the size of the blocks read.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.data.plausibility import doubt_of_rate, doubt_of_vehicle, implausible
from tirelog.data.recording import Channel, Recording
from tirelog.data.setup import PLAUSIBLE
from tirelog.errors import SetupError, UsageError
from tirelog.runs.in_memory import without_spikes
from tirelog.strain.passages import passage_flags
from tirelog.strain.passages.match import Signal, match, one_turn
from tirelog.strain.passages.passage_flags import TURN_RAD, kinematics, turns_between
from tirelog.strain.passages.template import Template
from tirelog.vocabulary.arrays import BoolArray, FloatArray, Records
from tirelog.vocabulary.quality import Quality, QualityFlags, marked
from tirelog.wheel.pulses import decimate, patch_sign, pulses_in
from tirelog.wheel.rolling import off_clock

# ---- Whether what was found are passages of a tire at all: the gate before any speed is known.
#
#     Pulses as found, Matched passages
#         --share of a turn, turns between, shape, speed--> '' or what is wrong with them
#
# A patch takes some hundredths of a turn and the next comes one turn later, with the same waveform,
# at a speed that changes smoothly. Pulses of a rim's or chassis' acceleration, of a bending test or
# of noise fail at least one of these. Each rule is a ratio, so none of them knows the unit of the
# signal, and each needs so many pulses that a short log of a real tire is not refused by chance.


def doubt(
    signal: Signal, raw: Records, start: Records, found: Records, learnt: bool, radius_m: float
) -> str:
    """Why the pulses are no passages of a tire; '' if nothing speaks against it.

    `raw`: the pulses as they were found, before strangers were dropped; `start`, `found` (n,): of
    `match`; `learnt`: with a template; `radius_m`: the rolling radius.
    """
    noise, share = signal.noise, _width_turns(signal.channel, raw)
    # width at half level over the period; tires of cars, trucks, bicycles and karts: 0.03 to 0.12,
    # a sine: 0.5.  Twice as much lets gravity on a rim pass, of which every second turn differs
    widest_turns = 0.2
    if share > widest_turns:
        return (
            f"each lasts {100 * share:.0f} % of the time to the next, and a patch at most "
            f"{100 * widest_turns:.0f} %"
        )
    time_s, omega = found["time_s"], start["omega_rad_s"]
    if time_s.size < 3:
        return ""
    period = np.diff(time_s)
    linked = one_turn(turns_between(time_s, omega))
    pairs, unlinked = linked.size, float(np.mean(~linked))
    # deceleration [m/s^2] from which a wheel that stops within a turn may have stood or rolled back
    # before the next passage (a car's: from 5.5 m/s): 8.  Twice as much takes random pulses at 7.8
    # m/s for stops
    stopping = np.sqrt(2.0 * 8.0 * TURN_RAD * radius_m)
    broken = ~linked & (radius_m * np.maximum(omega[1:], omega[:-1]) > stopping)
    height = np.abs(found["height"])
    # noise over height of pulses that may be the noise's own largest (the search takes 0.125), and
    # the share of pairs that may then fail, 0.15.  Twice as much asks it of all logs
    faint = noise > 0.09 * float(np.median(start["height"]))
    # share of pairs that may fail to be one turn apart, as the wheel stopped or samples were lost:
    # of pairs too fast for a stop, and of all.  Random pulses: 0.4 to 0.9; starts and stops: up to
    # 0.1, every fourth turn lost: 0.25.  Twice as much lets random pulses pass. And the pairs that
    # it takes to say so.  Half as many would doubt a car that is parked; twice as many
    # let the axles of a weighing bridge pass
    fewest_fast, fewest_pairs = 3, 8
    if (
        (pairs >= fewest_fast and broken.sum() > 0.3 * pairs)
        or (pairs >= fewest_pairs and unlinked > 0.4)
        or (pairs >= fewest_fast and faint and unlinked > 0.15)
    ):
        return (
            f"only {100 * (1 - unlinked):.0f} % of them come one turn after the one before, by "
            "the speed that their widths tell"
        )
    if learnt and time_s.size > fewest_fast:
        beyond = np.sqrt(np.maximum(found["misfit"] ** 2 - noise**2, 0.0)) / height
        # residual of the usual waveform beyond the noise, over the height; a real tire that rings
        # at its edges: 0.07, 1/f noise: 0.35 to 0.8.  Twice as much lets noise pass, half as much
        # leaves no margin
        if np.median(beyond) > 0.15:
            return f"their shapes differ by {100 * np.median(beyond):.0f} % of their height"
    uneven = np.abs(np.log(period[1:-1] / np.sqrt(period[2:] * period[:-2])))[
        linked[1:-1] & linked[2:] & linked[:-2]
    ]
    # departure of a turn's time from those beside it, relative, median; stop-and-go in town: 0.075,
    # turns that are sometimes missed: 0.2 to 0.4; twice as much would take logs in which turns are
    # missed
    if uneven.size >= 6 and np.median(uneven) > 0.15:
        return (
            f"the time from one to the next jumps by {100 * np.median(uneven):.0f} % from turn "
            "to turn"
        )
    return ""


def _width_turns(channel: Channel, pulses: Records) -> float:
    """Median width of the pulses over the time from one to the next.

    Of few pulses the least, as the wheel may have stood in others.
    """
    if len(pulses) < 3:
        return 0.0
    time_s = channel.axis.at(pulses["middle"])
    share = 2.0 * pulses["width"][1:-1] / channel.axis.rate_Hz / (time_s[2:] - time_s[:-2])
    return float(np.median(share) if share.size > 3 else share.min())


@dataclass(frozen=True)
class Passages:
    """Passages through the patch, in time order; arrays of shape (n,), n may be 0.

    index            fractional sample index of the patch centre
    time_s           its time; of a passage that was not found: by the speeds around it
    time_se_s        standard error of the time from the noise
    turn_before, turn_after   bool: the neighbouring passage is exactly one turn away, and was
                              measured as this one was
    break_after      why the next passage is not known to be one turn away, as flags: gap,
                     lost_peak, standstill, reversing; none if it is
    omega_rad_s      wheel speed at the passage, positive; from the pulse's stretch if no neighbour
                     is a turn away (NaN: not known)
    omega_se_rad_s   its standard error, with that of the differencing
    alpha_rad_s2     wheel acceleration at the passage, NaN if not known
    sides            neighbours on how many sides gave the speed: 2 centred, 1 extrapolated, 0 from
                     the stretch or between neighbours
    height, offset   of the template in this passage, patch upward (sign x recorded signal),
                     channel's unit; NaN where lost
    misfit           rms residual of the fit, channel's unit
    measured         bool: False if the passage was not found, mostly as samples are lost
    quality          flags of the words inside the passage's window; not_a_passage or implausible
                     in all rows if there is a doubt
    doubt            '' or the sentence why these are no passages of a tire (`gate`); no row then
                     has a speed or a turn

    `noise`: sigma of one sample; `sign`: +1 if the patch is a maximum of the recorded signal, -1
    if a minimum; `template`: None if the log has too few passages; `window_rad`: half window
    of the fit and of the quality words.
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
    turn_before: BoolArray
    turn_after: BoolArray
    break_after: QualityFlags
    omega_rad_s: FloatArray
    omega_se_rad_s: FloatArray
    alpha_rad_s2: FloatArray
    sides: NDArray[np.int64]
    height: FloatArray
    offset: FloatArray
    misfit: FloatArray
    measured: BoolArray
    quality: QualityFlags
    doubt: str = ""

    def __len__(self) -> int:
        return int(self.time_s.size)

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


def find_passages(channel: Channel, radius_m: float) -> Passages:
    """The passages of `channel` (strain or radial acceleration), `radius_m` the rolling radius.

    A log without passages, or all lost, gives no rows.
    """
    channel = without_spikes(channel)
    sign = patch_sign(channel)
    pulses, data = pulses_in(channel, decimate(channel, sign), sign)
    signal = Signal(channel, sign, data.noise, data.extremes)
    # so few pulses may be jumps of an instrument beside which the tire's own are low; those are
    # taken only if they are more turns than this, and no doubt is left.  Twice as many look twice
    # in some short logs, which find the same
    few_pulses = 8
    if len(pulses) > few_pulses:
        del data  # memory
        return _measured(signal, radius_m, pulses)
    found = _measured(signal, radius_m, pulses)
    # a few jumps of the instrument, of up to three sizes, may be higher than all that the tire does
    for without in (1, 2, 3):
        other = _measured(signal, radius_m, pulses_in(channel, data, sign, without)[0])
        if not other.doubt and other.turn_after.sum() > max(found.turn_after.sum(), few_pulses):
            return other
    return found


def _measured(signal: Signal, radius_m: float, pulses: Records) -> Passages:
    """The passages that the `pulses` are; no rows if there are none."""
    channel, rate = signal.channel, signal.channel.axis.rate_Hz
    template, start, found = match(signal, pulses)
    time_s, time_se_s, omega = found["time_s"], found["time_se_s"], start["omega_rad_s"]
    backwards, standing = found["backwards"], found["standing"]
    turns = turns_between(time_s, omega)
    turned = backwards[1:] != backwards[:-1]
    index = start["index"] + (time_s - start["time_s"]) * rate
    # a clock that was set back runs on, as if no sample lacked or came twice
    untimed = passage_flags.doubted(channel, Quality.CLOCK_SET_BACK, index[:-1], index[1:])
    linked = one_turn(turns) & ~turned & ~untimed
    rolled = passage_flags.too_fast_to_stop(np.minimum(omega[1:], omega[:-1]), radius_m)
    whole = np.where(turned | untimed, 0, passage_flags.whole_turns(time_s, linked, rolled))
    linked = np.append(np.where(whole > 0, whole == 1, linked), False)[: time_s.size]
    window_rad = 0.0
    lost = np.zeros(turns.size, np.int64)
    if template:
        window_rad = template.window_rad
        lost = passage_flags.lost_between(channel, time_s, omega, turns, window_rad)
    elif start.size:
        window_rad = float(np.median(start["width_s"] * omega))
    lost = np.append(np.where(whole > 0, whole - 1, lost), 0)[: time_s.size]
    turns_after = np.where(lost > 0, lost + 1, linked)
    shortest_s = 2.0 * window_rad / np.maximum(omega[1:], omega[:-1])
    motion = kinematics(time_s, time_se_s, turns_after.astype(float))
    # a row that has no neighbours takes the speed that its own stretch tells
    alone = motion["sides"] == 0
    blind = np.where(standing | (time_s.size < 3), np.nan, 1.0)
    speed, speed_se = (
        np.where(alone, found[name] * blind, motion[name])
        for name in ("omega_rad_s", "omega_se_rad_s")
    )
    neighbours = np.append(time_s[:1], time_s[:-1]), np.append(time_s[1:], time_s[-1:])
    fast = passage_flags.too_fast_to_stop(speed, radius_m) | np.isnan(speed)
    stood = passage_flags.stood_between(motion["omega_rad_s"], found["omega_rad_s"], fast)
    # fewer samples in a window are too few for a waveform; twice as many mark fast passages of slow
    # loggers
    quality = (
        passage_flags.window_quality(channel, found, index, window_rad / omega * rate)
        | marked(standing | stood, Quality.STANDSTILL)
        | marked(backwards, Quality.REVERSING)
        | marked(off_clock(channel.axis, *neighbours), Quality.IMPLAUSIBLE)
        | marked((found["used"] < 6) & (template is not None), Quality.FEW_SAMPLES)
    )
    measured = Passages(
        channel=channel.name,
        radius_m=radius_m,
        sign=signal.sign,
        noise=signal.noise,
        window_rad=window_rad,
        template=template,
        index=index,
        time_s=time_s,
        time_se_s=time_se_s,
        turn_before=np.append(False, linked)[: time_s.size],
        turn_after=linked,
        break_after=passage_flags.breaks(
            channel, index, turns, shortest_s, turns_after > 0, turned, rolled, untimed
        ),
        omega_rad_s=speed,
        omega_se_rad_s=speed_se,
        alpha_rad_s2=motion["alpha_rad_s2"],
        sides=motion["sides"],
        height=found["height"],
        offset=found["offset"],
        misfit=found["misfit"],
        measured=np.ones(time_s.size, bool),
        quality=quality,
    )
    why = doubt(signal, pulses, start, found, template is not None, radius_m)
    if why:
        which = f"{len(measured)} of {len(pulses)} pulses found"
        said = (
            f"{channel.name}: {which} are not one turn apart, or not of a patch: {why}; not a "
            "patch signal? They give no speed; check source, kind and surface of the channel in "
            "the setup"
        )
        return without_speeds(measured, said, Quality.NOT_A_PASSAGE)
    return _with_lost(measured, lost, channel) if lost.any() else measured


def without_speeds(found: Passages, said: str, word: Quality) -> Passages:
    """The rows of `found`, not a tire's, without a speed or a turn to the next, and why."""
    nan, no = np.full(len(found), np.nan), np.zeros(len(found), bool)
    return replace(
        found,
        turn_before=no,
        turn_after=no,
        omega_rad_s=nan,
        omega_se_rad_s=nan,
        alpha_rad_s2=nan,
        sides=np.zeros(len(found), np.int64),
        quality=found.quality | np.uint32(word),
        doubt=said,
    )


def _with_lost(measured: Passages, lost: NDArray[np.int64], channel: Channel) -> Passages:
    """`measured` with a row for each passage that was not found, mostly as samples are lost.

    Its time and speed are from the passages around.
    """
    place = np.repeat(np.arange(1, lost.size + 1), lost)
    turns = lost[place - 1] + 1
    share = (np.arange(place.size) - np.searchsorted(place, place) + 1) / turns
    (t0, t1), (omega0, omega1) = (
        (own[place - 1], own[place]) for own in (measured.time_s, measured.omega_rad_s)
    )
    time_s = passage_flags.between(t0, t1, omega0, omega1, turns, share)
    even, omega = t0 + (t1 - t0) * share, omega0 + (omega1 - omega0) * (time_s - t0) / (t1 - t0)
    # the speed at a lost passage is only as good as the change over the turns around it
    omega_se = np.abs(omega1 - omega0) / 3 + 2e-3 * omega
    index = channel.axis.index(time_s)
    gap = passage_flags.in_gap(
        channel.axis, index, measured.window_rad / omega * channel.axis.rate_Hz
    )
    extra: dict[str, Any] = {
        "index": index, "time_s": time_s, "turn_before": False, "turn_after": False,
        "time_se_s": 0.2 * np.abs(time_s - even) + 1e-3 * (t1 - t0) / turns, "break_after": 0,
        "omega_rad_s": omega, "omega_se_rad_s": omega_se, "sides": 0, "measured": False,
        "quality": np.uint32(Quality.LOST_PEAK) | marked(gap, Quality.GAP),
    }  # fmt: skip
    columns: dict[str, Any] = {
        f.name: np.insert(value, place, extra.get(f.name, np.nan))
        for f in fields(Passages)
        if isinstance(value := getattr(measured, f.name), np.ndarray)
    }
    return replace(measured, **columns)


# ---- The passages of a channel of a recording, of the right surface.
#
# They are refused if they show that its setup names the wrong surface.


def passages_of(recording: Recording, channel: Channel) -> Passages:
    """The passages of one channel, without speeds if these are no tire's.

    UsageError if its setup names the wrong surface.
    """
    radius = recording.setup.tire.radius_m
    passages = find_passages(channel, radius)
    if passages.doubt:
        refuse_swapped_surface(recording, channel, radius)
        return passages
    problem = implausible_motion(recording, channel, passages)
    if problem is None:
        return passages
    return without_speeds(passages, problem.message, Quality.IMPLAUSIBLE)


def trusted_passages(recording: Recording, channel: Channel) -> Passages:
    """The passages of one channel for a comparison.  UsageError if they are no tire's."""
    passages = passages_of(recording, channel)
    if passages.doubt:
        raise UsageError(passages.doubt, file=recording.log)
    return passages


def implausible_motion(
    recording: Recording, channel: Channel, passages: Passages
) -> SetupError | None:
    """The error of passages whose rate, speed, radius or acceleration is no tire's; None if not.

    The radius is what `vehicle_speed` travels per radian. An accelerometer's step from the level
    outside into the patch is about Omega^2 R; the level itself may be lost (piezo elements).
    """
    known = np.flatnonzero(np.isfinite(passages.omega_rad_s))
    if not known.size:
        return None
    # passages at which the motion is judged; twice as many find the same
    some = known[np.unique(np.linspace(0, known.size - 1, 64).astype(np.int64))]
    speed, omega = passages.speed_m_s[some], passages.omega_rad_s[some]
    # stop-and-go has many slow turns: the fast ones are too slow if the time is wrong
    slowest, middle = PLAUSIBLE["speed_m_s"].low, float(np.median(speed))
    fast = float(np.quantile(speed, 0.9))
    problem = doubt_of_rate(recording, channel, fast if fast < slowest else middle)
    for reference in recording.of_kind("vehicle_speed")[:1]:
        index = np.rint(reference.axis.index(passages.time_s[some])).astype(np.int64)
        reading = np.array([reference.read(one, one + 1)[0] for one in index.tolist()])
        rolls = np.abs(reading) > slowest  # a vehicle on a drum reads nothing
        # readings of a rolling vehicle that tell a radius; with one, a single wild one would
        if rolls.sum() >= 3:
            radius = float(np.median(reading[rolls] / omega[rolls]))
            problem = problem or doubt_of_vehicle(recording, reference, radius)
    if problem is not None or channel.kind != "radial_acceleration":
        return problem
    turning = omega**2 * passages.radius_m
    # acceleration [m/s^2] beyond which gravity, twice 9.8 per turn, changes it by a fifth at most
    strong = np.maximum(turning, passages.height[some]) > 100.0
    if not strong.any():
        return None
    ratio = float(np.nanmedian((passages.height[some] / turning)[strong]))
    what = f"the step into the patch is {ratio:.3g} times the centripetal acceleration"
    do = "check unit and scale, the sampling rate, the steps of the encoder and the radius"
    return implausible(recording, "step_to_rotation", ratio, what, channel=channel, do=do)


def refuse_swapped_surface(recording: Recording, channel: Channel, radius: float) -> None:
    """UsageError if the patch is found once the channel is taken for one of the other surface."""
    if channel.kind == "radial_acceleration":
        return
    other = {"outer": "inner", "inner": "outer"}[channel.surface]
    turned = find_passages(replace(channel, surface=other), radius)
    # whole turns that must be found on the other surface before the setup's is called wrong; with
    # one, a kink of a static test would do; twice as many would let a swapped surface pass in logs
    # of a few turns
    if turned.doubt or turned.turn_after.sum() < 3:
        return
    extremum = (
        "a minimum, as the outer surface (groove)"
        if other == "outer"
        else "a maximum, as the inner surface (liner)"
    )
    raise UsageError(
        f"channel {channel.name} shows {extremum} does in the patch, and its setup says "
        f"{channel.surface}",
        allowed="the two must agree",
        do=f'write surface = "{other}"',
        file=recording.log,
    )
