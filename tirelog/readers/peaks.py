"""Gratings in rows that hold a varying number of peaks: found by wavelength, followed as they move (placeholder for the tracker)."""

from __future__ import annotations

from collections.abc import Mapping

from tirelog.readers.text_parse import Parsed
from tirelog.recording import FloatArray
from tirelog.setup import ChannelSetup


class GratingTracker:
    def __init__(self, channels: Mapping[str, ChannelSetup]) -> None:
        self.channels = channels

    def follow(self, parsed: Parsed) -> tuple[dict[str, FloatArray], list[tuple[str, int, int, str]]]:
        raise NotImplementedError

    def why_silent(self, channel: str) -> str:
        return ""
