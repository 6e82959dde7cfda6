"""The table `footprint` of a recording.

Passages and footprint of each strain channel, as columns, with remarks on the whole log.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from tirelog.data.recording import BLOCK_SAMPLES, Channel, Recording
from tirelog.dsp.lowpass import Cutoff
from tirelog.errors import UsageError
from tirelog.runs.bursts import mended
from tirelog.runs.in_memory import released
from tirelog.strain.channels import not_turning, strain_channels
from tirelog.strain.footprint.footprint import Footprint, footprint
from tirelog.strain.footprint.learn import LEAST_SPEED_M_S
from tirelog.strain.footprint.measure import Measured
from tirelog.strain.footprint.settle import Settled, settle
from tirelog.strain.footprint.slip_onset import FrictionRatio
from tirelog.strain.passages.find import Passages
from tirelog.strain.passages.surface import passages_of
from tirelog.strain.speed import begin, speed_quality
from tirelog.vocabulary.arrays import IntArray
from tirelog.vocabulary.quality import Quality, having, quality_column


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
        channel = mended(stored)
        passages = passages_of(recording, channel)
        turned |= len(passages) > 0
        own = None if passages.doubt else settle(channel, passages, like=first)
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
    settled: Settled | None,
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
