"""Samples that several logs of one answer share: what is recorded once must not count twice.

a channel's samples, block by block --> a hash of all of them: equal ones are one log twice
                                    --> hashes of short windows that begin at samples which the
                                        values themselves choose: a stretch that is cut out of
                                        another log has the same ones, wherever it begins
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from tirelog.data.recording import Channel, Recording
from tirelog.data.setup import Tire
from tirelog.errors import UsageError
from tirelog.vocabulary.observables import OBSERVABLES

#: an odd number whose product spreads over all bits (2^64 by the golden ratio)
_SPREAD = np.uint64(0x9E3779B97F4A7C15)
#: samples of a window: as many values with noise are never the same by chance
_WINDOW = 64


def once_each(
    recordings: Iterable[Recording],
    observables: Iterable[str],
    channel: str | None,
    notes: list[str],
) -> Iterator[Recording]:
    """The recordings as they come.

    Added to `notes`: what they share with earlier ones, and that they are of another tire.

    Judged by the samples of the `channel`, or of the first that measures one of the observables.

    UsageError: a log holds the same samples as an earlier one.
    """
    kinds = [kind for name in observables for kind in OBSERVABLES[name].kinds]
    whole: dict[str, str] = {}
    first: tuple[str, Tire] | None = None  # a recording would keep its samples in memory
    parts: dict[str, np.ndarray] = {}
    for recording in recordings:
        first = first or (recording.log, recording.setup.tire)
        tires = recording.setup.tire, first[1]
        radii = [(tire.rolling_radius_m, tire.unloaded_radius_m) for tire in tires]
        for own, other in zip(*radii, strict=True):
            # loads and pressures move the rolling radius of one tire by less
            if own and other and abs(own - other) > 0.02 * other:
                notes.append(
                    f"{recording.log}: a radius of {own:.4g} m, and of {other:.4g} m in "
                    f"{first[0]}: a model is of one tire; give logs of one, or mend a setup"
                )
        named = recording.channels.get(channel or "")
        for source in ([named] if named is not None else recording.of_kind(*kinds))[:1]:
            digest, windows = fingerprint(source)
            same = whole.setdefault(digest, recording.log)
            if recording.log in parts or same != recording.log:
                raise UsageError(
                    f"holds the same samples of {source.name} as {same}",
                    allowed="each log counts once: twice would make chance look like proof",
                    do="leave one of them out",
                    file=recording.log,
                )
            for log, others in parts.items():
                common = np.intersect1d(windows, others).size
                # windows in common from which logs share a stretch: some thousand samples
                if common >= 4:
                    notes.append(
                        f"{recording.log}: {100 * common / windows.size:.0f} % of its samples are "
                        f"in {log} too and count twice: probabilities come out too small; give "
                        "each stretch once"
                    )
            parts[recording.log] = windows
        yield recording


def fingerprint(channel: Channel) -> tuple[str, np.ndarray]:
    """The hash of a channel's samples, and those of its windows: sorted, different."""
    digest, found = hashlib.blake2b(digest_size=16), [np.zeros(0, np.uint64)]
    factors = _SPREAD * np.arange(1, 2 * _WINDOW, 2, dtype=np.uint64)  # odd, all of them others
    for _, values in channel.blocks():
        digest.update(np.ascontiguousarray(values).data)
        bits = np.ascontiguousarray(values).view(np.uint64) * _SPREAD
        # of the bits of a sample's hash so many are zero where a window begins: one sample in 256
        starts = np.flatnonzero(bits[: max(bits.size - _WINDOW + 1, 0)] >> (64 - np.uint64(8)) == 0)
        if starts.size:
            ranges = sliding_window_view(values, _WINDOW)[starts]
            varied = ranges.max(axis=1) > ranges.min(axis=1)  # not at rest, and nothing lost
            windows = sliding_window_view(bits, _WINDOW)[starts[varied]]
            found.append((windows * factors).sum(axis=1, dtype=np.uint64))
    return digest.hexdigest(), np.unique(np.concatenate(found))
