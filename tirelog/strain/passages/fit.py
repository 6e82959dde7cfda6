"""The centre of each passage by a matched filter.

Offset, height, shift and stretch of the template, least squares, row by row.

    samples around rough centres
        --Gauss-Newton on the template (`template`)--> centre, its standard error, height

With phi the angle that the wheel has turned since the rough centre, the model of a row is y = a + b
T(phi (1 + e) - s). Where the speed is known from the neighbouring passages the stretch e is held
near 0; else it tells the speed. The standard error is the Cramer-Rao bound of the template at the
noise of the log.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Channel
from tirelog.strain.passages import template as kernels
from tirelog.strain.passages.template import (
    FOUND,
    ROW,
    SEGMENT,
    SPAN,
    CurveSums,
    Source,
    Template,
    scratch,
    spline_sums,
)
from tirelog.vocabulary.arrays import ColumnSet, FloatArray, IntArray, Records


@dataclass(frozen=True)
class Signal:
    """A channel as the fits see it.

    `sign` turns the patch upward, `noise` is one sample's sigma, `extremes` are the channel's least
    and largest sample.
    """

    channel: Channel
    sign: float
    noise: float
    extremes: tuple[float, float]


@dataclass(frozen=True)
class Start(ColumnSet):
    """Where a row's fit starts, shape (n,).

    `time_s`, `index` [samples], `omega` [rad/s], `alpha` [rad/s^2], `stretch`: how far the speed
    may be off (standard deviation, relative).
    """

    time_s: FloatArray
    index: FloatArray
    omega: FloatArray
    alpha: FloatArray
    stretch: FloatArray


@dataclass(frozen=True)
class PassageFit:
    """A row's result, shape (n,): time, speed, height and what was wrong.

    `time_s`, `time_se_s`, `omega` [rad/s] with the stretch in it, `omega_se`, `height`, `offset`,
    `misfit` (rms residual), `used` samples, `lost`, `spike`, `clipped`, `outside`: whether the
    window holds such samples.
    """

    time_s: FloatArray
    time_se_s: FloatArray
    omega: FloatArray
    omega_se: FloatArray
    height: FloatArray
    offset: FloatArray
    misfit: FloatArray
    used: IntArray
    lost: NDArray[np.bool_]
    spike: NDArray[np.bool_]
    clipped: NDArray[np.bool_]
    outside: NDArray[np.bool_]

    @classmethod
    def choose(
        cls, which: NDArray[np.bool_], there: PassageFit, elsewhere: PassageFit
    ) -> PassageFit:
        """Rows of `there` if `which`, of `elsewhere` otherwise."""
        return cls(
            **{
                f.name: np.where(which, getattr(there, f.name), getattr(elsewhere, f.name))
                for f in fields(cls)
            }
        )


@dataclass(frozen=True)
class Windows:
    """The windows of some rows in pieces of a channel.

    `samples` (N,) as recorded, and their `times` [s], empty if the axis tells them; `spans` (n,):
    each row's window, of SPAN; `outside` (n,): part of the window lies outside the log.
    """

    signal: Signal
    samples: FloatArray
    times: FloatArray
    spans: Records
    outside: NDArray[np.bool_]

    @classmethod
    def concatenate(cls, parts: list[Windows]) -> Windows:
        begins = np.cumsum([0] + [part.samples.size for part in parts])
        spans = [part.spans.copy() for part in parts]
        for part, begin in zip(spans, begins, strict=False):
            part["shift"] += begin
        samples, times = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("samples", "times")
        )
        return cls(
            parts[0].signal,
            samples,
            times,
            np.concatenate(spans),
            np.concatenate([part.outside for part in parts]),
        )

    def take(self, which: NDArray[np.bool_]) -> Windows:
        return replace(self, spans=self.spans[which], outside=self.outside[which])

    @property
    def source(self) -> Source:
        """The samples as the kernels take them."""
        return _source(self.signal, self.samples, self.times)


def _source(signal: Signal, samples: FloatArray, times: FloatArray) -> Source:
    axis = signal.channel.axis
    segments = np.empty(axis.first.size, SEGMENT)
    segments["first"], segments["start_s"] = axis.first, axis.start_s
    segments["period_s"] = axis.period_s
    return Source(samples, times, segments, signal.sign, *signal.extremes)


def _spans(signal: Signal, start: Start, window_rad: float) -> tuple[Records, NDArray[np.bool_]]:
    """Each row's window (n,) of SPAN, not shifted; which of them leave the log (n,)."""
    axis = signal.channel.axis
    reach = window_rad / start.omega * axis.rate_Hz
    with np.errstate(over="ignore", invalid="ignore"):
        low, high = np.ceil(start.index - reach), np.floor(start.index + reach) + 1
    # a row without a finite guess gets a window of one sample, in which nothing is fitted
    first = np.clip(np.nan_to_num(low), 0, axis.size - 1).astype(np.int64)
    stop = np.clip(np.nan_to_num(high), first + 1, axis.size).astype(np.int64)
    spans = np.zeros(first.size, SPAN)
    spans["first"], spans["stop"] = first, stop
    return spans, (low < 0) | (high > axis.size)


def _read(signal: Signal, spans: Records) -> tuple[FloatArray, FloatArray]:
    """Samples and times from the first to the last window.

    The shift of `spans` (n,) becomes what leads there.
    """
    channel = signal.channel
    if not spans.size:  # no row has a first guess
        return np.zeros(0), np.zeros(0)
    begin, end = int(spans["first"].min()), int(spans["stop"].max())
    spans["shift"] = -begin
    samples = np.ascontiguousarray(channel.read(begin, end), dtype=np.float64)
    explicit = channel.axis.explicit
    return samples, np.asarray(
        explicit(begin, end), np.float64
    ) if explicit is not None else np.zeros(0)


def gather(signal: Signal, start: Start, window_rad: float) -> Windows:
    """The windows of all rows of `start`, which must lie within one block's reach."""
    spans, outside = _spans(signal, start, window_rad)
    samples, times = _read(signal, spans)
    return Windows(signal, samples, times, spans, outside)


def residuals(
    windows: Windows, template: Template, found: PassageFit, alpha: FloatArray, which: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Angles [rad] of the samples of the rows `which`, and what the template leaves of them (N,).

    What is left is a share of the height. Lost samples and those outside of the template do not
    count; offset, height and shift are of those inside.
    """
    rows, made = np.zeros(which.size, ROW), np.zeros(which.size, FOUND)
    rows["alpha_rad_s2"] = alpha[which]
    made["time_s"], made["omega_rad_s"] = found.time_s[which], found.omega[which]
    made["height"] = found.height[which]
    phi, left = np.empty((2, which.size * kernels.MOST_SAMPLES))
    used = kernels.leave_rows(
        windows.source,
        template.table,
        template.window_rad,
        rows,
        windows.spans[which],
        made,
        scratch(),
        phi,
        left,
    )
    return phi[:used], left[:used]


def _rows(start: Start, height: FloatArray) -> Records:
    """What is known of the rows, as the kernels take it: (n,) of ROW."""
    rows = np.empty(height.size, ROW)
    rows["time_s"], rows["omega_rad_s"], rows["alpha_rad_s2"] = (
        start.time_s,
        start.omega,
        start.alpha,
    )
    rows["stretch"], rows["height"] = start.stretch, height
    return rows


def fit_passages(
    windows: Windows, template: Template, start: Start, height: FloatArray
) -> PassageFit:
    """Each row's centre by the template; `height` (n,) a first guess."""
    fits = _Fits(windows.signal.noise, template, start, height)
    fits.fit(slice(None), windows.source, windows.spans)
    return fits.found(windows.outside)


def fit_blocks(
    signal: Signal, template: Template, start: Start, height: FloatArray, block_samples: int
) -> PassageFit:
    """`fit_passages` of rows from all over the log, in order, a block of it at a time."""
    fits = _Fits(signal.noise, template, start, height)
    spans, outside = _spans(signal, start, template.window_rad)
    empty = np.zeros(0)
    source = _source(signal, empty, empty)
    block = np.floor(start.index / block_samples)
    for low, high in pairwise(
        np.concatenate([[0], np.flatnonzero(np.diff(block)) + 1, [block.size]]).tolist()
    ):
        part = slice(low, high)
        samples, times = _read(signal, spans[part])
        fits.fit(part, source._replace(samples=samples, times_s=times), spans[part])
    return fits.found(outside)


class _Fits:
    """The fits of some rows by one template, made part by part."""

    def __init__(self, noise: float, template: Template, start: Start, height: FloatArray) -> None:
        self._found = np.zeros(height.size, FOUND)
        self._known = noise, template.table, template.window_rad
        self._rows, self._scratch = _rows(start, height), scratch()

    def fit(self, part: slice, source: Source, spans: Records) -> None:
        """A part of the rows, whose windows are `spans` of the `source`."""
        rows, found = self._rows[part], self._found[part]
        kernels.fit_rows(source, *self._known, rows, spans, found, self._scratch)

    def found(self, outside: NDArray[np.bool_]) -> PassageFit:
        made = {name.removeprefix("holds_"): self._found[name].copy() for name in FOUND.names or ()}
        return PassageFit(
            omega=made.pop("omega_rad_s"),
            omega_se=made.pop("omega_se_rad_s"),
            outside=outside,
            **made,
        )


def curve_sums(
    windows: Windows, start: Start, offset: FloatArray, height: FloatArray, window_rad: float
) -> CurveSums:
    """The rows' samples, scaled to height 1, as what a template's curve is learnt from.

    The curve is over +-`window_rad`.
    """
    sums = CurveSums()
    rows = _rows(start, height)
    sums.count = spline_sums(
        windows.source,
        rows,
        offset,
        windows.spans,
        window_rad,
        sums.normal,
        sums.right,
        scratch(),
    )
    return sums
