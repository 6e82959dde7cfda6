"""Bytes to raw blocks: one reader per file format, none of which holds a whole file.

    open_log(path, setup) -> LogReader
        .groups    the channels that share one sample clock, known before the first block
        .blocks()  RawBlock after RawBlock, in the order of the file, for any of the groups
        .report    what was lost, repaired or doubted; complete once the blocks are read to the end

Values are in the *source's* unit, NaN where the instrument marks a sample as lost (blank, NaN, 0,
-1, ...), or counts of its last decimal; `tirelog.runs.ingest` scales them to SI, builds the time
axis from the stamps (`tirelog.runs.clock`) and writes the run.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tirelog.data.setup import Setup
from tirelog.errors import ReadError, TirelogError
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.quality import Quality

#: float64 values, or int32 counts
Samples = FloatArray | NDArray[np.int32]
#: the count that says that a sample is lost
LOST_COUNT = -(1 << 31)


def counted_floats(samples: Samples, decimals: int | None) -> FloatArray:
    """Samples as floats: counts are divided by 10^decimals.

    That rounds correctly, as a parser of decimal numbers does.
    """
    if samples.dtype != np.int32:
        return np.asarray(samples, np.float64)
    values = samples / 10.0 ** (decimals or 0)
    values[samples == LOST_COUNT] = np.nan
    return values


def lost_samples(samples: Samples) -> int:
    """How many of them are lost."""
    return int(
        np.count_nonzero(samples == LOST_COUNT if samples.dtype == np.int32 else np.isnan(samples))
    )


@dataclass(frozen=True)
class Group:
    """Channels sampled together.

    `channels` are names of the setup; `rate_Hz` is what the file itself says (None: the setup or
    the stamps must tell); `stamp_resolution_s` the step of the file's stamps (0 if it is as fine
    as the samples); `counted` is true if the sample number in the file, not the stamp, is the
    clock; `edges` if a sample is an edge at its stamp, and no clock is behind them; `decimals` the
    decimals of each channel's source (None: binary floats); `scale`, `offset` turn stored numbers
    into the source's unit if the file has such attributes (already applied in blocks).
    """

    name: str
    channels: tuple[str, ...]
    rate_Hz: float | None = None
    stamp_resolution_s: float = 0.0
    counted: bool = False
    decimals: Mapping[str, int | None] = field(default_factory=dict)
    edges: bool = False


@dataclass(frozen=True)
class RawBlock:
    """Some consecutive samples of a group.

    `values[channel]` shape (n,), source unit: float64, NaN where lost, or int32 counts of
    10^-decimals (those of the group), LOST_COUNT where lost; `stamps_s` shape (n,) seconds from the
    first stamp of the log, or None if the file has no stamps; `number` shape (n,) the file's own
    sample numbers (gaps in them are lost samples), or None; `flags` (channel, start, stop, word):
    doubted samples of this block.
    """

    group: str
    values: Mapping[str, Samples]
    stamps_s: FloatArray | None = None
    number: FloatArray | None = None
    flags: tuple[tuple[str, int, int, Quality], ...] = ()


@dataclass
class ReadReport:
    """What the reader met.

    `losses` make status 3; `remarks` are said once; `counts` (bad rows, ...) go into the
    provenance. `damage` is the loss by which any row may hold what was never written.
    """

    format: str = ""
    start: str | None = None  # absolute start of the log, ISO 8601, if the file tells it
    losses: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    damage: str = ""


def of_damaged(damage: str, problem: TirelogError, log: str) -> ReadError:
    """What is said instead of a `problem` that a damaged log has: the setup may be right."""
    return ReadError(
        f"{damage}; what could be read does not go with its setup: {problem.what}",
        do="copy the log again",
        file=log,
    )


class LogReader(Protocol):
    """An open log."""

    report: ReadReport
    setup: Setup  # as given, with the units that the file itself states

    @property
    def groups(self) -> tuple[Group, ...]:
        """The channels that share one sample clock."""
        ...

    def blocks(self) -> Iterator[RawBlock]:
        """All blocks, once."""
        ...
