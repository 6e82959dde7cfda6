"""The footprints of all strain channels of a log, for tables that go on from them."""

from __future__ import annotations

from collections.abc import Iterator

from tirelog.data.recording import Recording
from tirelog.dsp.lowpass import Cutoff
from tirelog.runs.bursts import mended
from tirelog.strain.channels import not_turning, strain_channels
from tirelog.strain.footprint.settle import settle
from tirelog.strain.footprint.table import FootprintOfChannel, footprint_of_channel
from tirelog.strain.passages.surface import passages_of


def footprints_of(recording: Recording) -> Iterator[FootprintOfChannel]:
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
        yield footprint_of_channel(recording, channel, passages, Cutoff.parse("auto"), own)
    if not turned:
        raise not_turning(recording)
