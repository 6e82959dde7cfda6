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

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import BLOCK_SAMPLES, Channel, Recording
from tirelog.dsp.filters import Cutoff
from tirelog.errors import UsageError
from tirelog.runs.in_memory import released, without_spikes
from tirelog.strain.footprint.form_choice import FormChoice, choose_form
from tirelog.strain.footprint.kernels import FITTED
from tirelog.strain.footprint.learn import LEAST_SPEED_M_S, EdgeForm
from tirelog.strain.footprint.measure import Measured, WindowPlan, find_onsets, measure_windows
from tirelog.strain.footprint.refine import PassageFits
from tirelog.strain.footprint.slip_onset import TOO_WIDE, FrictionRatio, SlipOnset
from tirelog.strain.passages.find import Passages, passages_of
from tirelog.strain.speed import begin, not_turning, speed_quality, strain_channels
from tirelog.vocabulary.arrays import FloatArray, IntArray
from tirelog.vocabulary.quality import Quality, QualityFlags, good, having, marked, quality_column

#: error of a length whose traction leaves a share of the misfit: this many times the share's root
#: of what the traction has moved it; the error is proportional to it
UNEXPLAINED = 2.0
#: a traction moves a length by less than this share of it (13 % at a slip of 0.3); what moves one
#: farther beside a form is none, as where the load has changed; twice as much takes lengths of such
#: passages that are off by a third
MOST_MOVED = 0.2
#: fewer samples between the edges than this cannot tell a length; twice as many leave fast
#: passages of slow loggers without a length
LEAST_SAMPLES = 4
#: below this acceleration no row is called driven: beside a manoeuvre that of a steady row is up to
#: 0.15 off; at twice as much a tenth of the driven rows has its error without the word
STEADY_M_S2 = 0.2


@dataclass(frozen=True)
class Footprint:
    """One row per passage, shape (n,): the table `footprint`, and what pictures show.

    Lengths in m, NaN where unknown.

    `length_m` takes a traction into account if there is a slip onset. `form_se_m`: the share of
    its error that comes from not knowing the tire's pressure and carcass, with the same sign in all
    rows.
    `edge_asymmetry`: (exit - entry) / (exit + entry) of the sizes of the second derivative's
    extrema: positive if the exit edge is the sharper one; `d2_entry_m`, `d2_exit_m`: their
    abscissae from the patch centre. `learnt`: the log's form; `friction`: what onsets were found
    with; `cutoff_Hz`: what the low-pass used.
    """

    length_m: FloatArray
    length_se_m: FloatArray
    form_se_m: FloatArray
    length_d2_m: FloatArray
    length_d2_se_m: FloatArray
    length_d1_m: FloatArray
    length_d1_se_m: FloatArray
    entry_time_s: FloatArray
    exit_time_s: FloatArray
    edge_asymmetry: FloatArray
    d2_entry_m: FloatArray
    d2_exit_m: FloatArray
    fits: PassageFits
    slip: SlipOnset
    cutoff_Hz: FloatArray
    learnt: EdgeForm | None
    friction: FrictionRatio
    quality: QualityFlags


@dataclass(frozen=True)
class Measuring:
    """How the windows of a channel are looked at.

    `look`: None if no speed is known; `asked_Hz` (n,): cut-off of the low-pass of each passage;
    `work`: what is measured.
    """

    look: WindowPlan | None
    learnt: EdgeForm
    asked_Hz: FloatArray
    work: Measured

    @classmethod
    def of(
        cls,
        channel: Channel,
        passages: Passages,
        settled: FormChoice,
        cutoff: Cutoff,
        block_samples: int = BLOCK_SAMPLES,
    ) -> Measuring:
        """Those of the `passages` of `channel`, whose form is `settled`."""
        learnt = settled.learnt
        asked = cutoff.frequency(passages.speed_m_s, passages.radius_m, learnt.wave_number_1_m)
        if cutoff.unit == "auto":
            asked = np.minimum(asked, 0.9 * 0.5 * channel.axis.rate_Hz)
        look = WindowPlan.of(channel, passages, learnt, block_samples, settled.forms)
        work = Measured.empty(len(passages))
        work.usual = settled.usual
        return cls(look, learnt, asked, work)

    def measure(self, stretch: int = 0, of: int = 1) -> IntArray:
        """Measure all but slip onsets in one `stretch` of the log, of so many; its passages.

        A row does not depend on the stretch that it is measured with.
        """
        if self.look is None:
            return np.arange(0)
        rows = np.array_split(self.look.rows, of)[stretch]
        cutoff_Hz = np.minimum(self.asked_Hz, 0.98 * 0.5 * self.look.channel.axis.rate_Hz)
        clear = ~self.learnt.unclear(self.look.passages.speed_m_s)
        measure_windows(self.look, cutoff_Hz, clear, self.work, rows)
        return rows


def footprint(
    channel: Channel,
    passages: Passages,
    cutoff: Cutoff | None = None,
    block_samples: int = BLOCK_SAMPLES,
    settled: FormChoice | None = None,
    measured: Iterable[tuple[IntArray, Measured]] | None = None,
    friction: FrictionRatio | None = None,
) -> Footprint:
    """The footprint at each of `passages` of the strain `channel`.

    `cutoff` of the low-pass (auto); `settled`: the form of its passages, which is learnt here if it
    is not given; `measured`: passages and what was measured of them (`Measuring`), if it was;
    `friction`: of the tread, the usual one if it is not given.
    """
    cutoff, friction = cutoff or Cutoff(), friction or FrictionRatio()
    n = len(passages)
    if settled is None and not passages.doubt:
        settled = choose_form(channel, passages, block_samples)
    if settled is None:
        work, learnt, asked = Measured.empty(n), None, np.full(n, np.nan)
    else:
        how = Measuring.of(channel, passages, settled, cutoff, block_samples)
        work, learnt, asked = how.work, how.learnt, how.asked_Hz
        if measured is None:
            how.measure()
        for rows, some in measured or ():
            work.put(rows, some)
        if how.look is not None:
            find_onsets(how.look, work, friction)
    return _assembled(
        passages,
        learnt,
        work,
        asked,
        0.5 * channel.axis.rate_Hz,
        passages.speed_m_s,
        np.nan_to_num(passages.acceleration_m_s2),
        friction,
    )


def _unexplained(fits: PassageFits, slip: SlipOnset, scatter: float) -> FloatArray:
    """Error of a length with traction from what the traction leaves unexplained.

    That share of what the traction has moved the length by.
    """
    free = np.maximum(fits.used - FITTED, 1.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = (slip.left - free) / np.maximum(fits.chi2 * free / scatter**2 - free, 1.0)
        return (
            UNEXPLAINED * np.sqrt(np.clip(share, 0.0, 1.0)) * np.abs(slip.length_m - fits.length_m)
        )


def _hidden(work: Measured, passages: Passages, slipping: NDArray[np.bool_]) -> FloatArray:
    """Error of a length by a traction that is not resolved [m], (n,).

    A traction goes with the acceleration, and so do the lengths of fits without one: how far, over
    the whole log, speeding up and slowing down apart, says what one does that no row by itself
    shows. The larger, the less it does per acceleration; so it is at most what the smallest does.
    A log none of whose passages shows a traction is one of a wheel that rolls.
    """
    length, speed = work.fits.length_m, passages.speed_m_s
    acceleration = np.nan_to_num(passages.acceleration_m_s2)
    used = np.isfinite(length) & (good(passages.quality) | work.driven)
    if not (used & work.driven).any():
        return np.zeros(speed.size)
    sides = np.maximum([acceleration, -acceleration], 0.0)
    follows = np.column_stack([*sides, *sides**2, speed, speed**2])[used]
    by_side = np.linalg.lstsq(
        follows - follows.mean(axis=0), length[used] - length[used].mean(), rcond=None
    )[0][:2]
    resolved = slipping & np.isin(work.slip.reason.astype(str), ("", TOO_WIDE))
    return np.where(resolved, 0.0, np.abs(np.where(acceleration > 0.0, *by_side) * acceleration))


def _time_at(xi_m: FloatArray, speed_m_s: FloatArray, acceleration_m_s2: FloatArray) -> FloatArray:
    """Time from the patch centre to the distance `xi_m`; NaN if the wheel stops before."""
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(speed_m_s**2 + 2.0 * acceleration_m_s2 * xi_m)
        return 2.0 * xi_m / (speed_m_s + root)


def _assembled(
    passages: Passages,
    learnt: EdgeForm | None,
    work: Measured,
    asked_Hz: FloatArray,
    nyquist: float,
    speed: FloatArray,
    acceleration: FloatArray,
    friction: FrictionRatio,
) -> Footprint:
    """Rows of the table out of what was measured."""
    fits, edges = work.fits, work.edges
    n = len(passages)
    scatter, reference_se, form_se = 1.0, np.zeros(n), np.zeros(n)
    if learnt is not None and n:
        scatter = learnt.scatter(fits.chi2)
        reference_se, form_se = learnt.length_errors(speed)
    slip = work.slip
    with np.errstate(invalid="ignore"):
        slipping = np.abs(slip.length_m - fits.length_m) < MOST_MOVED * fits.length_m
    length = np.where(slipping, slip.length_m, fits.length_m)
    own_se = np.where(
        slipping,
        np.hypot(slip.length_se_m, _unexplained(fits, slip, scatter)),
        fits.length_se_m * scatter,
    )
    noise_se = np.sqrt(
        own_se**2
        + reference_se**2
        + (fits.length_m * np.nan_to_num(passages.speed_se_m_s / speed)) ** 2
    )
    hidden = _hidden(work, passages, slipping)
    driven = np.abs(acceleration) > STEADY_M_S2
    unresolved = driven & (hidden > np.hypot(noise_se, form_se))
    length, noise_se = _told(length, np.hypot(noise_se, hidden))
    d2, d2_se = _told(edges.length_d2_m, edges.length_d2_se_m)
    d1, d1_se = _told(edges.length_d1_m, edges.length_d1_se_m)
    half = 0.5 * length
    with np.errstate(invalid="ignore"):
        entry = passages.time_s + _time_at(fits.shift_m - half, speed, acceleration)
        leave = passages.time_s + _time_at(fits.shift_m + half, speed, acceleration)
        asymmetry = (edges.exit_height - edges.entry_height) / (
            edges.exit_height + edges.entry_height
        )
    known = np.where(np.isfinite(length), 1.0, np.nan)
    return Footprint(
        length,
        noise_se,
        form_se * known,
        d2,
        d2_se,
        d1,
        d1_se,
        entry,
        leave,
        asymmetry,
        edges.entry_m + fits.shift_m,
        edges.exit_m + fits.shift_m,
        fits,
        work.slip,
        asked_Hz,
        learnt,
        friction,
        _quality(passages, work, learnt, length, d2, asked_Hz, nyquist)
        | marked(unresolved & np.isfinite(length), Quality.TRACTION_UNRESOLVED),
    )


def _told(lengths_m: FloatArray, errors_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lengths and their errors (n,), NaN unless a length is above its own error.

    Nothing is known of a length that is not.
    """
    with np.errstate(invalid="ignore"):
        told = errors_m < lengths_m
    return np.where(told, lengths_m, np.nan), np.where(told, errors_m, np.nan)


def _quality(
    passages: Passages,
    work: Measured,
    learnt: EdgeForm | None,
    length_m: FloatArray,
    length_d2_m: FloatArray,
    asked_Hz: FloatArray,
    nyquist: float,
) -> QualityFlags:
    """Quality words of the rows: the passages' own, and what the footprint adds."""
    with np.errstate(invalid="ignore"):
        cut = asked_Hz > nyquist
        short = work.inside < LEAST_SAMPLES
    unknown = ~np.isfinite(length_m)
    unclear = ~np.isfinite(length_d2_m) & ~cut & ~unknown
    formless = (
        np.zeros(len(passages), bool)
        if learnt is None
        else learnt.unclear(passages.speed_m_s) & ~unknown
    )
    return (
        passages.quality
        | marked(cut, Quality.CUTOFF)
        | marked(short, Quality.PATCH_SHORT)
        | marked(unknown, Quality.NO_LENGTH)
        | marked(unclear, Quality.EDGE_UNCLEAR)
        | marked(formless, Quality.FORM_UNCLEAR)
    )


# ---- The table `footprint` of a recording.
#
# Passages and footprint of each strain channel, as columns, with remarks on the whole log.


@dataclass(frozen=True)
class FootprintOfChannel:
    """One channel: what was found, the table's columns, sentences on the whole channel."""

    channel: Channel
    passages: Passages
    footprint: Footprint
    columns: dict[str, Any]
    remarks: tuple[str, ...]


def footprints_of(
    recording: Recording, friction_ratio: float | None = None
) -> Iterator[FootprintOfChannel]:
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
    settled: FormChoice | None,
    block_samples: int = BLOCK_SAMPLES,
    measured: Iterable[tuple[IntArray, Measured]] | None = None,
    friction_ratio: float | None = None,
) -> FootprintOfChannel:
    """The footprint of one strain channel of `recording`.

    `settled`: the form of its passages, None if there is none; `measured`: as of `footprint`;
    `friction_ratio`: instead of the setup's.
    """
    refuse_cutoff(recording, channel, cutoff)
    if friction_ratio is None:
        friction_ratio = recording.setup.tire.friction_ratio
    friction = FrictionRatio.given(friction_ratio)
    found = footprint(channel, passages, cutoff, block_samples, settled, measured, friction)
    columns = begin(recording.log, passages) | {
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
        "slip_onset_m": found.slip.onset_m,
        "slip_onset_se_m": found.slip.onset_se_m,
        "slip_onset_reason": found.slip.reason,
        "quality": quality_column(found.quality | speed_quality(passages)),
    }
    channel = released(channel)
    remarks = (
        (passages.doubt,)
        if passages.doubt
        else _remarks(recording, channel, passages, found, cutoff)
    )
    return FootprintOfChannel(channel, passages, found, columns, remarks)


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
    recording: Recording, channel: Channel, passages: Passages, found: Footprint, cutoff: Cutoff
) -> tuple[str, ...]:
    """What the summary says of a channel.

    Lengths, form, cut-off, the static footprint beside the dynamic one.
    """
    slow = int((passages.speed_m_s <= LEAST_SPEED_M_S).sum())
    too_slow = (
        f"{channel.name}: {slow} of {len(passages)} passages are slower than "
        f"{LEAST_SPEED_M_S:g} m/s, and have no length"
    )
    if found.learnt is None or not np.isfinite(found.length_m).any():
        few = f"{channel.name}: too few passages to learn the form of; no lengths"
        return (too_slow,) if 2 * slow > len(passages) else (few,)
    length, form = float(np.nanmedian(found.length_m)), float(np.nanmedian(found.form_se_m))
    known = np.isfinite(found.cutoff_Hz)
    low, high = float(found.cutoff_Hz[known].min()), float(found.cutoff_Hz[known].max())
    range_ = f"{low:.0f} Hz" if high - low < 1.0 else f"{low:.0f} to {high:.0f} Hz"
    text = (
        f"{channel.name}: contact length {1e3 * length:.2f} mm (median; "
        f"form known to {1e3 * form:.2f} mm), low-pass {cutoff} = {range_}"
    )
    static = recording.setup.tire.static_footprint_length_m
    if static is not None:
        text += f"; static footprint {1e3 * static:.1f} mm, dynamic / static {length / static:.3f}"
    remarks = [text, too_slow] if slow else [text]
    if np.isfinite(found.slip.onset_m).any():
        remarks.append(
            f"{channel.name}: slip onsets take a ratio of sliding to sticking friction of "
            f"{found.friction.value:.3g} +- {found.friction.se:g}"
        )
    doubted = int(having(found.quality, Quality.FORM_UNCLEAR).sum())
    if doubted:
        remarks.append(
            f"{channel.name}: {Quality.FORM_UNCLEAR.word}: {doubted} passages are unlike "
            "any that a tire's carcass makes on a flat road; their lengths may be wrong by half"
        )
    if not found.learnt.free_rolling:
        remarks.append(
            f"{channel.name}: no stretch of steady speed; the form was learnt from driven or "
            "braked passages"
        )
    return tuple(remarks)
