"""Contact length, edges and slip onset of every passage of a strain grating (P2, errata).

    Channel --passages--> centres, speeds
        --some passages--> the form of free rolling (`choose_form`)
        --windows around every passage, block by block--> plain edges (P2 3.2), fits of the form
        --> Footprint, a row per passage

`length_m` comes from the fits, `length_d2_m` and `length_d1_m` are the papers' own measures after
the low-pass. Everything runs along the tread, xi = v t + a t^2 / 2, entry edge at -L, exit edge at
+L. A row depends on its passage and on the log's Reference only.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from tirelog.data.recording import Channel, Recording
from tirelog.dsp.filters import Cutoff, least_error_cutoff, unlike_neighbours
from tirelog.dsp.pitch import AngleFunction
from tirelog.errors import UsageError
from tirelog.runs.in_memory import released, without_spikes
from tirelog.strain.footprint.kernels import FITTED
from tirelog.strain.footprint.learn import (
    FREE_ROLLING_M_S2,
    LEAST_OF_CLASS,
    LEAST_SPEED_M_S,
    REMARKABLE,
    EdgeForm,
    learn_own,
    learn_reference,
)
from tirelog.strain.footprint.measure import (
    FITS,
    SLIP,
    TOO_WIDE,
    PassageForms,
    find_onsets,
    friction_of,
    look_at_some,
    measure_windows,
    nothing_measured,
)
from tirelog.strain.passages.find import Passages, passages_of
from tirelog.strain.passages.passage_flags import TURN_RAD
from tirelog.strain.speed import (
    PassageRows,
    identity_columns,
    not_turning,
    speed_quality,
    strain_channels,
)
from tirelog.vocabulary.arrays import BoolArray, FloatArray, IntArray, Records, records
from tirelog.vocabulary.kinds import ACCELERATION_KINDS
from tirelog.vocabulary.quality import Quality, QualityFlags, good, having, marked, quality_column
from tirelog.wheel.fronts import PASSAGE, fill_fronts

# ---- The form of free rolling: learnt, looked at, and learnt anew without what does not roll
# freely.
#
#     passages --> EdgeForm
#         --misses passages? without those that speed up and slow down, if that is clearer-->
#         --some of all passages are looked at: driven ones among them? without these-->
#         --of what rolls freely: the tire's own pressure and stiffness-->
#     EdgeForm, from which the next grating of the log starts
#
# What a traction does to the form is larger than what the form is asked for. Only some passages are
# looked at, evenly over the log, so that settling takes no longer on a longer log.

#: passages with a traction are too few to bend the learnt form, or too many to be left out, by this
#: share; twice as much is still neither
DRIVEN_SHARE = 0.03


def choose_form(
    channel: Channel,
    passages: Passages,
    like: EdgeForm | None = None,
) -> EdgeForm | None:
    """The form of the passages of `channel` that roll freely; None if there are none to learn from.

    `like`: that of another grating of the log, to start from.
    """
    learnt = learn_reference(channel, passages, like)
    if learnt is None:
        return None
    left_out = np.zeros(len(passages), bool)
    unsteady = ~(np.abs(passages.acceleration_m_s2) < FREE_ROLLING_M_S2)
    missed = learnt.reference.misfit - 1.0
    # passages at steady speed are not all, and enough to learn a form from. From this misfit
    # (chi-square per degree of freedom, less one) on a form is learnt of them alone; twice as much
    # leaves forms that put onsets 3 to 5 mm off
    if missed > 0.15 and unsteady.mean() >= DRIVEN_SHARE and (~unsteady).sum() >= LEAST_OF_CLASS:
        # with more misfit a form is no start for another; twice as much starts from forms that have
        # gone astray, half as much learns from the beginning what would have been near
        begin = learnt if missed < 10.0 else None
        freely = learn_reference(channel, passages, begin, unsteady)
        # twice the share that it may leave takes one as good, of fewer passages
        if freely is not None and freely.reference.misfit - 1.0 <= 0.5 * missed:
            learnt, left_out = freely, unsteady
    learnt = _undriven(channel, passages, learnt, left_out)
    own = learn_own(channel, passages, learnt)
    if own.reference.family is learnt.reference.family:
        return own
    # what free passages leave beside the tire's own form
    return _looked_at(PassageForms.of(channel, passages, own), own)[1]


def _looked_at(look: PassageForms, learnt: EdgeForm) -> tuple[IntArray, EdgeForm]:
    """Some passages, and `learnt` with what free ones of them leave."""
    # passages that are looked at for a traction; half as many leave too few of a class of speed to
    # learn from where three of four are driven, twice as many take twice as long
    rows, scatter, gain = look_at_some(look, 960)
    return rows, replace(learnt, free_scatter=scatter, least_gain=gain, forms=look.forms)


def _undriven(
    channel: Channel,
    passages: Passages,
    learnt: EdgeForm,
    left_out: BoolArray,
) -> EdgeForm:
    """The form without passages that show a traction, if the `learnt` one bends to them.

    `left_out` (n,): passages that it was not learnt from.
    """
    freed: EdgeForm | None = learnt
    for _ in range(6):  # a form is learnt anew so often at most
        if freed is None:
            break
        look = PassageForms.of(channel, passages, freed)
        rows, learnt = _looked_at(look, freed)
        driven = look.work["driven"]
        # neither few of them nor nearly all show a traction, and the form missed both
        share = driven.sum() / rows.size
        bends = abs(share - 0.5) < 0.5 - DRIVEN_SHARE and bool((driven & ~left_out).any())
        if not bends or learnt.reference.misfit <= REMARKABLE * learnt.free_scatter**2:
            break
        left_out = left_out | driven
        without = left_out.copy()
        without[np.setdiff1d(np.arange(len(passages)), rows)] = True  # who knows of the others
        freed = learn_reference(channel, passages, learnt, without)
    return learnt


#: a row of the table `footprint`, and what pictures show: lengths in m, NaN where unknown.
#: `length_m` takes a traction into account if there is a slip onset; `form_se_m`: the share of its
#: error that comes from not knowing the tire's pressure and carcass, with the same sign in all
#: rows; times of the edges [s]; `edge_asymmetry`: (exit - entry) / (exit + entry) of the sizes of
#: the second derivative's extrema, positive if the exit edge is the sharper one; what was measured;
#: `cutoff_Hz` of the low-pass; flags
FOOTPRINT = np.dtype(
    [("length_m", "f8"), ("length_se_m", "f8"), ("form_se_m", "f8"), ("length_d2_m", "f8"),
     ("length_d2_se_m", "f8"), ("length_d1_m", "f8"), ("length_d1_se_m", "f8"),
     ("entry_time_s", "f8"), ("exit_time_s", "f8"), ("edge_asymmetry", "f8"),
     ("fits", FITS), ("slip", SLIP),
     ("cutoff_Hz", "f8"), ("quality", "u4")]
)  # fmt: skip


def footprint(
    channel: Channel,
    passages: Passages,
    cutoff: Cutoff | None = None,
    settled: EdgeForm | None = None,
    friction: tuple[float, float] | None = None,
) -> Any:
    """The footprint at each of `passages` of the strain `channel`, (n,) of FOOTPRINT.

    Its columns are attributes.

    `cutoff` of the low-pass (auto); `settled`: the form of its passages, which is learnt here if it
    is not given; `friction`: of the tread, the usual one if it is not given.
    """
    cutoff, friction = cutoff or Cutoff(), friction or friction_of(None)
    n = len(passages)
    if settled is None and not passages.doubt:
        settled = choose_form(channel, passages)
    if settled is None:
        work, asked = nothing_measured(n), np.full(n, np.nan)
    else:
        look = PassageForms.of(channel, passages, settled, settled.forms)
        work, speed = look.work, passages.speed_m_s
        nyquist = 0.5 * channel.axis.rate_Hz
        # what is asked for may lie above what samples hold
        asked = cutoff.frequency(speed, passages.radius_m, settled.wave_number_1_m)
        if cutoff.unit == "auto":
            asked = np.minimum(asked, 0.9 * nyquist)
        clear = ~settled.unclear(speed)
        least_Hz = np.minimum(asked, 0.98 * nyquist)
        usual = settled.free_scatter, settled.least_gain
        measure_windows(look, least_Hz, clear, usual, look.rows)
        find_onsets(look, friction, settled.free_scatter)
    return _assembled(passages, settled, work, asked, 0.5 * channel.axis.rate_Hz)


def _unexplained(fits: Records, slip: Records, scatter: float) -> FloatArray:
    """Error of a length with traction from what the traction leaves unexplained.

    That share of what the traction has moved the length by.
    """
    free = np.maximum(fits["used"] - FITTED, 1.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = (slip["left"] - free) / np.maximum(fits["chi2"] * free / scatter**2 - free, 1.0)
        moved = np.abs(slip["length_m"] - fits["length_m"])
        # error of a length whose traction leaves a share of the misfit: this many times the share's
        # root of what the traction has moved it; the error is proportional to it
        return np.asarray(2.0 * np.sqrt(np.clip(share, 0.0, 1.0)) * moved)


def _hidden(work: Records, passages: Passages, slipping: BoolArray) -> FloatArray:
    """Error of a length by a traction that is not resolved [m], (n,).

    A traction goes with the acceleration, and so do the lengths of fits without one: how far, over
    the whole log, speeding up and slowing down apart, says what one does that no row by itself
    shows. The larger, the less it does per acceleration; so it is at most what the smallest does.
    A log none of whose passages shows a traction is one of a wheel that rolls.
    """
    length, speed = work["fits"]["length_m"], passages.speed_m_s
    acceleration = np.nan_to_num(passages.acceleration_m_s2)
    used = np.isfinite(length) & (good(passages.quality) | work["driven"])
    if not (used & work["driven"]).any():
        return np.zeros(speed.size)
    sides = np.maximum([acceleration, -acceleration], 0.0)
    follows = np.column_stack([*sides, *sides**2, speed, speed**2])[used]
    by_side = np.linalg.lstsq(
        follows - follows.mean(axis=0), length[used] - length[used].mean(), rcond=None
    )[0][:2]
    resolved = slipping & np.isin(work["slip"]["reason"].astype(str), ("", TOO_WIDE))
    return np.where(resolved, 0.0, np.abs(np.where(acceleration > 0.0, *by_side) * acceleration))


def _time_at(xi_m: FloatArray, speed_m_s: FloatArray, acceleration_m_s2: FloatArray) -> FloatArray:
    """Time from the patch centre to the distance `xi_m`; NaN if the wheel stops before."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return 2.0 * xi_m / (speed_m_s + np.sqrt(speed_m_s**2 + 2.0 * acceleration_m_s2 * xi_m))


def _assembled(
    passages: Passages,
    learnt: EdgeForm | None,
    work: Records,
    asked_Hz: FloatArray,
    nyquist: float,
) -> Any:
    """Rows of FOOTPRINT out of what was measured."""
    fits, edges, slip, n = work["fits"], work["edges"], work["slip"], len(passages)
    speed, acceleration = passages.speed_m_s, np.nan_to_num(passages.acceleration_m_s2)
    scatter, reference_se, form_se = 1.0, np.zeros(n), np.zeros(n)
    if learnt is not None and n:
        scatter = learnt.scatter(fits["chi2"])
        reference_se, form_se = learnt.length_errors(speed)
    with np.errstate(invalid="ignore"):
        # a traction moves a length by less than this share of it (13 % at a slip of 0.3); what
        # moves one farther beside a form is none, as where the load has changed; twice as much
        # takes lengths of such passages that are off by a third
        slipping = np.abs(slip["length_m"] - fits["length_m"]) < 0.2 * fits["length_m"]
    length = np.where(slipping, slip["length_m"], fits["length_m"])
    own_se = np.where(
        slipping,
        np.hypot(slip["length_se_m"], _unexplained(fits, slip, scatter)),
        fits["length_se_m"] * scatter,
    )
    noise_se = np.sqrt(
        own_se**2
        + reference_se**2
        + (fits["length_m"] * np.nan_to_num(passages.speed_se_m_s / speed)) ** 2
    )
    hidden = _hidden(work, passages, slipping)
    # below this acceleration no row is called driven: beside a manoeuvre that of a steady row is up
    # to 0.15 off; at twice as much a tenth of the driven rows has its error without the word
    driven = np.abs(acceleration) > 0.2
    unresolved = driven & (hidden > np.hypot(noise_se, form_se))
    length, noise_se = _told(length, np.hypot(noise_se, hidden))
    d2, d2_se = _told(edges["length_d2_m"], edges["length_d2_se_m"])
    d1, d1_se = _told(edges["length_d1_m"], edges["length_d1_se_m"])
    half = 0.5 * length
    with np.errstate(invalid="ignore"):
        entry = passages.time_s + _time_at(fits["shift_m"] - half, speed, acceleration)
        leave = passages.time_s + _time_at(fits["shift_m"] + half, speed, acceleration)
        asymmetry = (edges["exit_height"] - edges["entry_height"]) / (
            edges["exit_height"] + edges["entry_height"]
        )
    quality = _quality(passages, work, learnt, length, d2, asked_Hz, nyquist)
    quality |= marked(unresolved & np.isfinite(length), Quality.TRACTION_UNRESOLVED)
    return records(
        FOOTPRINT,
        length_m=length,
        length_se_m=noise_se,
        form_se_m=form_se * np.where(np.isfinite(length), 1.0, np.nan),
        length_d2_m=d2,
        length_d2_se_m=d2_se,
        length_d1_m=d1,
        length_d1_se_m=d1_se,
        entry_time_s=entry,
        exit_time_s=leave,
        edge_asymmetry=asymmetry,
        fits=fits,
        slip=slip,
        cutoff_Hz=asked_Hz,
        quality=quality,
    ).view(np.recarray)


def _told(lengths_m: FloatArray, errors_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lengths and their errors (n,), NaN unless a length is above its own error.

    Nothing is known of a length that is not.
    """
    with np.errstate(invalid="ignore"):
        told = errors_m < lengths_m
    return np.where(told, lengths_m, np.nan), np.where(told, errors_m, np.nan)


def _quality(
    passages: Passages,
    work: Records,
    learnt: EdgeForm | None,
    length_m: FloatArray,
    length_d2_m: FloatArray,
    asked_Hz: FloatArray,
    nyquist: float,
) -> QualityFlags:
    """Quality words of the rows: the passages' own, and what the footprint adds."""
    with np.errstate(invalid="ignore"):
        cut = asked_Hz > nyquist
        # fewer samples between the edges than this cannot tell a length; twice as many leave fast
        # passages of slow loggers without a length
        short = work["inside"] < 4
    unknown = ~np.isfinite(length_m)
    # of good passages, a length may be off the turns around by this share
    unlike = unlike_neighbours(length_m, passages.quality, 0.02 * np.nan_to_num(length_m))
    unclear = ~np.isfinite(length_d2_m) & ~cut & ~unknown
    formless = (
        np.zeros(len(passages), bool)
        if learnt is None
        else learnt.unclear(passages.speed_m_s) & ~unknown
    )
    return (
        passages.quality
        | unlike
        | marked(cut, Quality.CUTOFF)
        | marked(short, Quality.PATCH_SHORT)
        | marked(unknown, Quality.NO_LENGTH)
        | marked(unclear, Quality.EDGE_UNCLEAR)
        | marked(formless, Quality.FORM_UNCLEAR)
    )


# ---- The table `footprint` of a recording.
#
# Passages and footprint of each strain channel, as columns, with remarks on the whole log.


def footprints_of(
    recording: Recording, friction_ratio: float | None = None
) -> Iterator[PassageRows]:
    """The footprint of each strain channel, with the usual low-pass.

    UsageError: no channel shows a patch that comes round.
    """
    first, turned = None, False
    for stored in strain_channels(recording):
        channel = without_spikes(stored)
        passages = passages_of(recording, channel)
        turned |= len(passages) > 0
        own = None if passages.doubt else choose_form(channel, passages, like=first)
        first = first or own
        yield footprint_of_channel(
            recording, channel, passages, Cutoff(), own, friction_ratio=friction_ratio
        )
    if not turned:
        raise not_turning(recording)


def footprint_of_channel(
    recording: Recording,
    channel: Channel,
    passages: Passages,
    cutoff: Cutoff,
    settled: EdgeForm | None,
    friction_ratio: float | None = None,
) -> PassageRows:
    """The footprint of one strain channel of `recording`.

    `settled`: the form of its passages, None if there is none; `friction_ratio`: instead of the
    setup's.
    """
    cutoff, said = at_rest(channel, passages, cutoff)
    refuse_cutoff(recording, channel, cutoff)
    if friction_ratio is None:
        friction_ratio = recording.setup.tire.friction_ratio
    friction = friction_of(friction_ratio)
    found = footprint(channel, passages, cutoff, settled, friction)
    columns = identity_columns(recording.log, passages) | {
        "length_m": found.length_m,
        "length_se_m": found.length_se_m,
        "length_form_se_m": found.form_se_m,
        "length_d2_m": found.length_d2_m,
        "length_d2_se_m": found.length_d2_se_m,
        "length_d1_m": found.length_d1_m,
        "length_d1_se_m": found.length_d1_se_m,
        "entry_time_s": found.entry_time_s,
        "exit_time_s": found.exit_time_s,
        "edge_asymmetry": found.edge_asymmetry,
        "slip_onset_m": found.slip["onset_m"],
        "slip_onset_se_m": found.slip["onset_se_m"],
        "slip_onset_reason": found.slip["reason"],
        "quality": quality_column(found.quality | speed_quality(passages)),
    }
    rows = PassageRows(columns, (passages.doubt,), released(channel), passages, found)
    if passages.doubt:
        return rows
    remarks = _remarks(recording, rows, settled, cutoff, friction)
    return replace(rows, remarks=(*remarks, *said))


def at_rest(channel: Channel, passages: Passages, cutoff: Cutoff) -> tuple[Cutoff, tuple[str, ...]]:
    """The cut-off in hertz where `rest` asks for it, with a remark on what it was found from (P2).

    The wheel rests in the longest time without a passage, less two turns beside one: so long takes
    a start from rest. In a log that has none the far side of the tire serves, where only the road
    shakes the grating.
    """
    if cutoff.unit != "rest" or not len(passages):
        return cutoff, ()
    rate_Hz = channel.axis.rate_Hz
    turn = 2.0 * np.pi / passages.omega_rad_s * rate_Hz  # samples
    beside = np.nan_to_num(2.0 * turn)
    start = np.append(0.0, passages.index + beside)
    stop = np.append(passages.index - beside, channel.size)
    longest = int(np.nanargmax(stop - start))
    half = int(np.nan_to_num(np.nanmedian(turn)) / 8.0) + 1
    quiet = np.arange(start[longest] + half, stop[longest] - half, half)
    source = f"{(stop[longest] - start[longest]) / rate_Hz:.1f} s at rest"
    if quiet.size < 8:  # fewer windows leave the noise unknown by a third
        quiet = (passages.index + 0.5 * turn)[passages.turn_after]
        source = "the far side of the tire, as the log has no rest"
    passing, resting = (
        _windows_at(channel, places, half) for places in (passages.index[passages.measured], quiet)
    )
    if not (len(passing) and len(resting)):
        return Cutoff(), (f"{channel.name}: no rest, so the low-pass is that of auto",)
    found = min(least_error_cutoff(passing, resting, rate_Hz), 0.45 * rate_Hz)
    asked = Cutoff("Hz", round(found, 1))
    return asked, (f"{channel.name}: low-pass {asked} by the spectrum of {source}",)


def _windows_at(channel: Channel, places: FloatArray, half: int) -> FloatArray:
    """Windows (k, 2 half) about samples `places`, some evenly, without those that lost much."""
    whole = places[(places > half) & (places < channel.size - half)]
    # a quarter as many windows move the cut-off by a tenth
    some = whole[:: max(whole.size // 256, 1)].astype(np.int64)
    cut = [channel.read(place - half, place + half) for place in some.tolist()]
    return np.array([one for one in cut if np.isfinite(one).mean() > 0.9])


def refuse_cutoff(recording: Recording, channel: Channel, cutoff: Cutoff) -> None:
    """UsageError for a low-pass above what the channel's samples hold."""
    if cutoff.unit == "Hz" and cutoff.value >= 0.5 * channel.axis.rate_Hz:
        raise UsageError(
            f"--cutoff {cutoff}: channel {channel.name} is sampled at {channel.axis.rate_Hz:g} Hz "
            f"and holds nothing above {0.5 * channel.axis.rate_Hz:g} Hz",
            allowed="allowed is less than that",
            do="give a lower one, or auto",
            file=recording.log,
        )


def _remarks(
    recording: Recording,
    rows: PassageRows,
    learnt: EdgeForm | None,
    cutoff: Cutoff,
    friction: tuple[float, float],
) -> tuple[str, ...]:
    """What the summary says of a channel.

    Lengths, form, cut-off, the static footprint beside the dynamic one.
    """
    channel, passages, found = rows.channel, rows.passages, rows.found
    slow = int((passages.speed_m_s <= LEAST_SPEED_M_S).sum())
    too_slow = (
        f"{channel.name}: {slow} of {len(passages)} passages are slower than "
        f"{LEAST_SPEED_M_S:g} m/s, and have no length"
    )
    if learnt is None or not np.isfinite(found.length_m).any():
        few = f"{channel.name}: too few passages to learn the shape of the edges; no lengths"
        return (too_slow,) if 2 * slow > len(passages) else (few,)
    length, form = float(np.nanmedian(found.length_m)), float(np.nanmedian(found.form_se_m))
    low, high = float(np.nanmin(found.cutoff_Hz)), float(np.nanmax(found.cutoff_Hz))
    range_ = f"{low:.0f} Hz" if high - low < 1.0 else f"{low:.0f} to {high:.0f} Hz"
    static = recording.setup.tire.static_footprint_length_m
    doubted = int(having(found.quality, Quality.FORM_UNCLEAR).sum())
    onsets = np.isfinite(found.slip["onset_m"]).any()
    text = (
        f"{channel.name}: median contact length {1e3 * length:.2f} mm, with an error of "
        f"{1e3 * form:.2f} mm that all rows share (shape of the edges); "
        f"low-pass {cutoff} = {range_}"
    )
    if static is not None:
        text += f"; static footprint {1e3 * static:.1f} mm, dynamic / static {length / static:.3f}"
    told = {
        text: True,
        too_slow: slow > 0,
        f"{channel.name}: slip onsets take a ratio of sliding to sticking friction of "
        f"{friction[0]:.3g} +- {friction[1]:g}": onsets,
        f"{channel.name}: {Quality.FORM_UNCLEAR.word}: {doubted} passages are unlike any that a "
        "tire's carcass makes on a flat road; their lengths may be wrong by half": doubted > 0,
        f"{channel.name}: no stretch of steady speed; the form was learnt from driven or braked "
        "passages": not learnt.free_rolling,
    }
    return tuple(sentence for sentence, is_so in told.items() if is_so)


# ---- The table `footprint` of an accelerometer: contact length between the fronts of each passage.
#
#     Passages --their kinematics--> wheel angle --`wheel.fronts`--> fronts
#         --speed--> length, entry and exit time
#
# Inside the patch the tread moves straight and its acceleration is nothing; outside it is Omega^2 R
# or, if the sensor is AC-coupled, something else by as much. A front is where the signal crosses
# the middle between the two levels: a fixed share of the step at every speed (errata on P4). No
# encoder is needed: the passages themselves are the clock.

#: a passage's own kinematics tell the angle so far to either side [rad]; half a turn on it is the
#: next one's
_OWN_RAD = 2.6


def accelerometer_footprints(recording: Recording) -> list[PassageRows]:
    """The footprint of every accelerometer of a recording."""
    return [
        footprint_of_accelerometer(recording, channel)
        for channel in recording.of_kind(*ACCELERATION_KINDS)
    ]


def footprint_of_accelerometer(recording: Recording, channel: Channel) -> PassageRows:
    """The footprint of one accelerometer."""
    channel = without_spikes(channel)
    passages = passages_of(recording, channel)
    fronts, entry_s, exit_s = _fronts(channel, passages)
    nothing, width = np.full(len(passages), np.nan), fronts["exit_rad"] - fronts["entry_rad"]
    # samples between the fronts below which none can be known; twice as many leave fast passages of
    # slow loggers without
    short = 2.0 * fronts["half_rad"] * channel.axis.rate_Hz < 4.0 * fronts["rate_rad_s"]
    untold, flags = np.isnan(width), speed_quality(passages)
    flags |= marked(short, Quality.PATCH_SHORT)
    flags |= np.where(untold, fronts["quality"], np.uint32(0))
    with np.errstate(invalid="ignore", divide="ignore"):
        of_speed = width * np.nan_to_num(passages.omega_se_rad_s / passages.omega_rad_s)
        steep = fronts["exit_slope"] - fronts["entry_slope"]
        asymmetry = (fronts["exit_slope"] + fronts["entry_slope"]) / steep
    length = passages.radius_m * width
    columns = identity_columns(recording.log, passages) | {
        "length_m": length,
        "length_se_m": passages.radius_m * np.hypot(fronts["width_se_rad"], of_speed),
        # only a strain's derivatives have these
        **dict.fromkeys(("length_form_se_m", "length_d2_m", "length_d2_se_m"), nothing),
        **dict.fromkeys(("length_d1_m", "length_d1_se_m"), nothing),
        "entry_time_s": entry_s,
        "exit_time_s": exit_s,
        "edge_asymmetry": np.where(untold, np.nan, asymmetry),
        "slip_onset_m": nothing,
        "slip_onset_se_m": nothing,
        "slip_onset_reason": np.full(len(passages), "not strain", object),
        "quality": quality_column(flags | marked(untold & good(flags), Quality.NO_LENGTH)),
    }
    if passages.doubt:
        said = passages.doubt
    elif untold.all():
        said = f"{channel.name}: no front was found; no lengths"
    else:
        said = (
            f"{channel.name}: contact length {1e3 * float(np.nanmedian(length)):.2f} mm (median), "
            "between the fronts at half of the step of the acceleration; the tread's bend at the "
            "edges is in it"
        )
    return PassageRows(columns, (said,), channel, passages)


def _fronts(channel: Channel, passages: Passages) -> tuple[Records, FloatArray, FloatArray]:
    """The fronts (n,) of PASSAGE of all passages; times of entry and exit (n,) [s]."""
    n, nan = len(passages), np.nan
    fronts = records(PASSAGE, entry_rad=np.full(n, nan), exit_rad=nan, width_se_rad=nan)
    fronts["rate_rad_s"] = passages.omega_rad_s
    times = np.full((2, n), nan)
    known = np.flatnonzero(np.isfinite(passages.omega_rad_s))
    if passages.doubt or passages.template is None or not known.size:
        return fronts, *times
    rows = fronts[known]
    rows["middle_rad"] = TURN_RAD * np.arange(known.size)
    rows["half_rad"] = passages.template.half_width_rad
    rows["ahead_m_s2"] = np.nan_to_num(passages.acceleration_m_s2[known])
    angle = _angle(passages, known)
    fill_fronts(channel, angle, rows, -passages.sign, passages.noise)
    times[:, known] = [angle.time_at(rows[name]) for name in ("entry_rad", "exit_rad")]
    fronts[known] = rows
    return fronts, *times


def _angle(passages: Passages, known: np.ndarray) -> AngleFunction:
    """The wheel angle by the kinematics of the `known` passages, a turn apart each."""
    omega = passages.omega_rad_s[known][:, None]
    alpha = np.nan_to_num(passages.alpha_rad_s2[known])[:, None]
    turned = np.array([-_OWN_RAD, 0.0, _OWN_RAD])
    with np.errstate(invalid="ignore"):  # a wheel at rest before has no time there
        rate = np.sqrt(omega**2 + 2.0 * alpha * turned)
    time = (passages.time_s[known][:, None] + 2.0 * turned / (omega + rate)).ravel()
    angle = (TURN_RAD * np.arange(known.size)[:, None] + turned).ravel()
    kept = time > np.fmax.accumulate(np.append(-np.inf, time))[:-1]
    stretch = np.zeros(int(kept.sum()), np.int32)
    return AngleFunction(
        time[kept], angle[kept], 1.0, rate.ravel()[kept].astype(np.float32), stretch, 0.0
    )
