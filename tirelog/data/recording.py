"""What flows through the package, as frozen values with arrays in SI.

    log --readers, clock--> Recording (channels on exact time axes; `runs.store` keeps it as a
                            run file)
        --wheel, strain---> passages and tables, one row per revolution
        --inference-------> Stack (revolutions x angle) with Conditions (one value per revolution)
        --diagnosis-------> model against measurement

Orientation: the tread coordinate xi [m] and the angle phi = xi / R [rad] grow with time, in the
direction in which tread material passes the patch. The entry edge is at -L, the patch centre at 0,
the exit edge at +L (errata, "one orientation"). Lost samples are NaN. Each field has its shape: n
revolutions, m angles.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.data.setup import Setup
from tirelog.vocabulary.arrays import ColumnSet, FloatArray, IntArray
from tirelog.vocabulary.conditions import ConditionValues
from tirelog.vocabulary.quality import Doubt

#: the count that says that a sample is lost
LOST_COUNT = -(1 << 31)
#: Samples per block, for whoever reads a channel piece by piece (1 MB of float64).
BLOCK_SAMPLES = 1 << 17


def counted_floats(counts: NDArray[np.int32], decimals: int) -> FloatArray:
    """Counts as floats: rounded as a parser of decimal numbers does."""
    values: FloatArray = counts / 10.0**decimals
    values[counts == LOST_COUNT] = np.nan
    return values


@dataclass(frozen=True)
class TimeAxis:
    """The time of every sample, in seconds from the start of the log.

    Either uniform segments (a gap in the recording starts a new one) or explicit times for samples
    that have no clock of their own. `first` shape (k,): index of each segment's first sample;
    `start_s` shape (k,): its time; `period_s` shape (k,): its step. `explicit` reads times [start,
    stop) if the axis is not made of segments; `rate_Hz` is then the median rate. `rate_error` is
    the standard error of the rate as a share of it, where it is no small one.
    """

    size: int
    rate_Hz: float
    first: IntArray
    start_s: FloatArray
    period_s: FloatArray
    explicit: Callable[[int, int], FloatArray] | None = None
    rate_error: float = 0.0

    @classmethod
    def uniform(cls, size: int, rate_Hz: float, start_s: float = 0.0) -> TimeAxis:
        """One gapless segment of `size` samples at `rate_Hz`."""
        return cls(
            size, rate_Hz, np.zeros(1, np.int64), np.array([start_s]), np.array([1.0 / rate_Hz])
        )

    @classmethod
    def of_times(cls, times_s: FloatArray) -> TimeAxis:
        """Explicit, ascending `times_s`, shape (size,)."""
        steps = np.diff(times_s)
        rate = float(1.0 / np.median(steps)) if steps.size and np.median(steps) > 0 else 1.0
        return cls.read_by(lambda start, stop: times_s[start:stop], times_s.size, rate)

    @classmethod
    def read_by(
        cls, explicit: Callable[[int, int], FloatArray], size: int, rate_Hz: float
    ) -> TimeAxis:
        """Explicit times, read in slices; `rate_Hz`: their median rate."""
        none = np.zeros(0)
        return cls(size, rate_Hz, none.astype(np.int64), none, none, explicit)

    def time(self, start: int = 0, stop: int | None = None) -> FloatArray:
        """Times [s] of the samples [start, stop), shape (stop - start,)."""
        stop = self.size if stop is None else min(stop, self.size)
        if self.explicit is not None:
            return self.explicit(start, stop)
        return self.at(np.arange(start, stop, dtype=np.float64))

    def at(self, index: FloatArray | float) -> FloatArray:
        """Time [s] at a fractional sample index; between samples linear."""
        index = np.asarray(index, dtype=np.float64)
        if self.explicit is not None:
            low = int(np.clip(np.floor(index.min(initial=0)), 0, self.size - 1))
            high = int(np.clip(np.ceil(index.max(initial=0)) + 1, low + 1, self.size))
            return np.interp(index, np.arange(low, high), self.explicit(low, high))
        segment = np.clip(np.searchsorted(self.first, index, side="right") - 1, 0, None)
        with np.errstate(
            over="ignore", invalid="ignore"
        ):  # a clock of 1e300 s leaves the range of floats
            return self.start_s[segment] + (index - self.first[segment]) * self.period_s[segment]

    def index(self, time_s: FloatArray | float) -> FloatArray:
        """Fractional sample index at a time [s]; a time in a gap gives the sample before it."""
        time_s = np.asarray(time_s, dtype=np.float64)
        if self.explicit is not None:
            return np.interp(time_s, self.explicit(0, self.size), np.arange(self.size))
        segment = np.clip(np.searchsorted(self.start_s, time_s, side="right") - 1, 0, None)
        last = np.append(self.first[1:], self.size)[segment] - 1
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            steps = (time_s - self.start_s[segment]) / self.period_s[segment]
            return np.asarray(np.minimum(self.first[segment] + steps, last), np.float64)

    @property
    def duration_s(self) -> float:
        return float(self.at(float(self.size - 1)) - self.at(0.0)) if self.size else 0.0

    def gaps(self) -> list[tuple[int, float]]:
        """(index of the first sample after it, its length [s]) for each gap.

        The gaps are those between segments.
        """
        return list(zip(self.first[1:].tolist(), self._jumps_s.tolist(), strict=True))

    @property
    def missing(self) -> FloatArray:
        """Number of samples missing before each segment, by its time; (k,), the first 0."""
        samples: FloatArray = np.maximum(self._jumps_s * self.rate_Hz - 1.0, 0.0)
        return np.concatenate([np.zeros(min(self.first.size, 1)), samples])

    def missing_before(self, index: FloatArray | float) -> FloatArray:
        """Number of samples missing before a fractional sample index."""
        behind = np.searchsorted(self.first[1:], index, side="right")
        return np.asarray(np.append(0.0, np.cumsum(self.missing[1:]))[behind], np.float64)

    @property
    def _jumps_s(self) -> FloatArray:
        """Time [s] from the last sample of each segment to the next one's first, (k - 1,)."""
        ends = self.start_s[:-1] + (self.first[1:] - 1 - self.first[:-1]) * self.period_s[:-1]
        return np.asarray(self.start_s[1:] - ends, np.float64)


@dataclass(frozen=True)
class Scaled:
    """Samples as they are stored, brought to SI when they are read.

    raw x scale + offset, NaN if raw is `lost` (None: never).

    `raw(start, stop)` gives the stored numbers; counts of int32 take half of the memory of what
    they become.
    """

    raw: Callable[[int, int], NDArray[Any]]
    scale: float
    offset: float
    lost: int | None = None

    def __call__(self, start: int, stop: int) -> FloatArray:
        raw = self.raw(start, stop)
        with np.errstate(
            over="ignore", invalid="ignore"
        ):  # a cell of 1e308 leaves the range of floats, as its channel's unit may
            values: FloatArray = np.multiply(raw, self.scale, dtype=np.float64)
            values += self.offset
        if self.lost is not None:
            values[raw == self.lost] = np.nan
        return values


@dataclass(frozen=True)
class Channel:
    """One recorded channel in SI.

    samples     `samples(start, stop)` reads values, shape (stop - start,), NaN where lost
    unit        the SI unit ('' for strain and encoder)
    surface     'outer' or 'inner' (strain only)
    resolution  the step of the source in SI (0 if unknown)
    flags       (start, stop, word): sample ranges that reader or clock doubted
    settings    the channel's own keys of the setup (steps of an encoder, ...)
    mended      bursts of bad samples are lost already (`runs.in_memory`)
    at_hand     reading the samples again costs little, and no library holds their file's place
    stored      reads the samples from their file, if they are held in memory
    recorded    the channel before another channel was subtracted from it
    """

    name: str
    kind: str
    unit: str
    axis: TimeAxis
    samples: Callable[[int, int], FloatArray]
    surface: str = "outer"
    resolution: float = 0.0
    flags: tuple[Doubt, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)
    mended: bool = False
    at_hand: bool = False
    stored: Callable[[int, int], FloatArray] | None = None
    recorded: Channel | None = None

    @property
    def size(self) -> int:
        return self.axis.size

    def read(self, start: int = 0, stop: int | None = None) -> FloatArray:
        """Values [start, stop) in SI, shape (stop - start,); NaN where lost.

        Indices outside the channel are cut off.
        """
        stop = self.size if stop is None else min(stop, self.size)
        return self.samples(max(start, 0), stop)

    def blocks(self, size: int = BLOCK_SAMPLES) -> Iterator[tuple[int, FloatArray]]:
        """(index of the first sample, values) block by block."""
        for start in range(0, self.size, size):
            yield start, self.read(start, start + size)

    @classmethod
    def of_array(
        cls, name: str, kind: str, values: FloatArray, axis: TimeAxis, **more: Any
    ) -> Channel:
        """A channel in memory."""
        return cls(
            name, kind, more.pop("unit", ""), axis, lambda start, stop: values[start:stop], **more
        )


@dataclass(frozen=True)
class Recording:
    """One log in SI: its channels, its setup, where it came from and what was repaired.

    `log` is the path as the user gave it; `remarks` are sentences on the whole log that a command
    says once on standard error; `losses` are sentences on input that was lost (status 3); the list
    grows when a damaged chunk is met while reading.
    """

    log: str
    channels: Mapping[str, Channel]
    setup: Setup
    provenance: Mapping[str, Any] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    losses: list[str] = field(default_factory=list)

    def of_kind(self, *kinds: str) -> list[Channel]:
        """The channels of these kinds, in the setup's order."""
        return [channel for channel in self.channels.values() if channel.kind in kinds]


@dataclass(frozen=True)
class Conditions(ConditionValues, ColumnSet):
    """Conditions of n revolutions: an array (n,) for each of the register."""

    @classmethod
    def of(cls, n: int, **values: Any) -> Conditions:
        """`n` revolutions; a scalar is repeated, a field that is not given is NaN."""
        return cls(
            **{
                f.name: np.broadcast_to(np.asarray(values.get(f.name, np.nan), float), (n,))
                for f in fields(cls)
            }
        )

    def __len__(self) -> int:
        return int(self.speed_m_s.size)

    def known(self, name: str) -> bool:
        """True if every revolution has a finite value of the field `name`."""
        return bool(np.isfinite(getattr(self, name)).all())


@dataclass(frozen=True)
class Stack:
    """One channel cut into revolutions, on one grid of angle bins.

    From half a turn before each patch centre to half a turn behind it.

    values        (n, m)  mean of the samples in the bin, SI, NaN if the bin holds none
    phi_rad       (m,)    bin centres, ascending in (-pi, pi)
    phi_mean      (n, m)  mean angle of the bin's samples [rad] (samples lock to fixed angles at
                  constant speed, so it is not the centre)
    phi_variance  (n, m)  variance of the angles in the bin [rad^2]
    count         (n, m)  samples in the bin
    noise         (n,)    standard deviation of one sample's noise
    conditions            one value per revolution
    log, manoeuvre, revolution  (n,) integers: which log (index in `logs`), which manoeuvre (unique
                                over all logs), ordinal of the passage
    regime        (n,)    'cruise', 'drive', 'coast' or 'brake'
    step                  the channel's values come in whole steps of it, SI; 0 if they are not seen
                          to
    place_rad             of one of several gratings its angle on the wheel, else NaN
    """

    observable: str
    channel: str
    surface: str
    radius_m: float
    values: FloatArray
    phi_rad: FloatArray
    phi_mean: FloatArray
    phi_variance: FloatArray
    count: IntArray
    noise: FloatArray
    conditions: Conditions
    log: IntArray
    manoeuvre: IntArray
    revolution: IntArray
    regime: NDArray[np.str_]
    logs: tuple[str, ...]
    step: float = 0.0
    place_rad: float = float("nan")

    @property
    def member(self) -> str:
        """The grating, if it is one of several."""
        return self.channel if np.isfinite(self.place_rad) else ""

    def __len__(self) -> int:
        return int(self.values.shape[0])

    def take(self, which: Any) -> Stack:
        """The revolutions `which` (mask, slice or indices)."""
        rows = (
            "values",
            "phi_mean",
            "phi_variance",
            "count",
            "noise",
            "log",
            "manoeuvre",
            "revolution",
            "regime",
        )
        return replace(
            self,
            conditions=self.conditions.take(which),
            **{name: getattr(self, name)[which] for name in rows},
        )
