"""What is in a recording, from its metadata alone: one row per channel."""

from __future__ import annotations

from typing import Any

import numpy as np

from tirelog.data.recording import Recording


def channel_rows(recording: Recording) -> dict[str, Any]:
    """What is in a recording, one row per channel, from its metadata alone."""
    channels = list(recording.channels.values())
    counts = recording.provenance.get("counts", {})
    return {
        "log": np.array([recording.log] * len(channels), dtype=object),
        "channel": np.array([c.name for c in channels], dtype=object),
        "kind": np.array([c.kind for c in channels], dtype=object),
        "unit": np.array([c.unit or "1" for c in channels], dtype=object),
        "rate_Hz": np.array([c.axis.rate_Hz for c in channels]),
        "samples": np.array([c.size for c in channels]),
        "duration_s": np.array([c.axis.duration_s for c in channels]),
        "gaps": np.array([len(c.axis.gaps()) if c.axis.explicit is None else 0 for c in channels]),
        "lost_samples": np.array([counts.get(f"lost_samples {c.name}", 0) for c in channels]),
        "flagged_ranges": np.array([len(c.flags) for c in channels]),
    }
