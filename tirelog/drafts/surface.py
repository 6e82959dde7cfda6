"""Which surface a strain sensor sits on, by the side to which the patch takes its signal."""

from __future__ import annotations

import numpy as np

from tirelog.data.recording import Channel

#: the patch takes some hundredths of a turn: quantiles that it reaches and its flanks do not
_LOW, _HIGH = 0.01, 0.99
#: how much further one side has to reach than the other before it is called the patch's; twice as
#: much leaves more surfaces open in the draft, and says so there
_PLAIN = 1.5
#: samples looked at, from the middle of the channel
_SAMPLES = 1 << 17


def likely_surface(channel: Channel) -> str:
    """'outer' (the patch is a minimum), 'inner' (a maximum), or '' if neither side is plain."""
    start = max((channel.size - _SAMPLES) // 2, 0)
    some = channel.read(start, start + _SAMPLES)
    some = some[np.isfinite(some)]
    if some.size < 100:
        return ""
    low, middle, high = np.quantile(some, [_LOW, 0.5, _HIGH])
    below, above = middle - low, high - middle
    if below > _PLAIN * above:
        return "outer"
    return "inner" if above > _PLAIN * below else ""
