"""The centre of each passage by a matched filter: offset, height, shift and stretch of the template, least squares, all rows at once.

    samples around rough centres (ragged, laid end to end) --Gauss-Newton on the template--> centre, its standard error, height

With phi the angle that the wheel has turned since the rough centre, the model of a row is y = a + b T(phi (1 + e) - s).  Where
the speed is known from the neighbouring passages the stretch e is held near 0; else it tells the speed.  The standard error is the
Cramer-Rao bound of the template at the noise of the log.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from tirelog.estimators.passage_template import Template
from tirelog.recording import Channel, FloatArray, IntArray

#: samples a row at most; a creeping wheel's windows are thinned to this
MOST_SAMPLES = 400
ITERATIONS = 2
#: a sample is wild where it leaves its two neighbours' mean by this many sigmas and by this share of the height
WILD_SIGMAS, WILD_SHARE = 8.0, 0.06
#: what is further off than this share of the height is not the tire
FOREIGN_SHARE = 0.35
#: stuck samples are clipped where they lie this many sigmas off
CLIPPED_SIGMAS = 3.0


@dataclass(frozen=True)
class Signal:
    """A channel as the fits see it: `sign` turns the patch upward, `noise` is one sample's sigma, `extremes` are the channel's least and
    largest sample."""

    channel: Channel
    sign: float
    noise: float
    extremes: tuple[float, float]


@dataclass(frozen=True)
class Start:
    """Where a row's fit starts, shape (n,): `time_s`, `index` [samples], `omega` [rad/s], `alpha` [rad/s^2], `stretch`: how far the
    speed may be off (standard deviation, relative)."""

    time_s: FloatArray
    index: FloatArray
    omega: FloatArray
    alpha: FloatArray
    stretch: FloatArray

    def take(self, which: slice | IntArray | NDArray[np.bool_]) -> Start:
        return Start(**{f.name: getattr(self, f.name)[which] for f in fields(self)})


@dataclass(frozen=True)
class Fit:
    """A row's result, shape (n,): `time_s`, `time_se_s`, `omega` [rad/s] with the stretch in it, `omega_se`, `height`, `offset`,
    `misfit` (rms residual), `used` samples, `lost`, `spike`, `clipped`, `outside`: whether the window holds such samples."""

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
    def choose(cls, which: NDArray[np.bool_], there: Fit, elsewhere: Fit) -> Fit:
        """Rows of `there` where `which`, of `elsewhere` otherwise."""
        return cls(**{f.name: np.where(which, getattr(there, f.name), getattr(elsewhere, f.name)) for f in fields(cls)})

    @classmethod
    def concatenate(cls, parts: list[Fit]) -> Fit:
        return cls(**{f.name: np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(cls)})


@dataclass(frozen=True)
class Windows:
    """Samples around rows, end to end: `values` and `time_s` (N,), `row` (N,) the row of each, `first` (n,) where each row starts;
    `clipped` (N,) bool: on the instrument's stop; `outside` (n,): part of the window lies outside the log."""

    values: FloatArray
    time_s: FloatArray
    row: IntArray
    first: IntArray
    clipped: NDArray[np.bool_]
    outside: NDArray[np.bool_]

    @classmethod
    def concatenate(cls, parts: list[Windows]) -> Windows:
        rows = np.cumsum([0] + [part.first.size for part in parts])
        samples = np.cumsum([0] + [part.row.size for part in parts])
        return cls(
            np.concatenate([part.values for part in parts]),
            np.concatenate([part.time_s for part in parts]),
            np.concatenate([part.row + start for part, start in zip(parts, rows, strict=False)]),
            np.concatenate([part.first + start for part, start in zip(parts, samples, strict=False)]),
            np.concatenate([part.clipped for part in parts]),
            np.concatenate([part.outside for part in parts]),
        )


def _stuck(values: FloatArray, row: IntArray, extremes: tuple[float, float]) -> NDArray[np.bool_]:
    """Samples that stand on the channel's least or largest value, three or more in a row of one window."""
    on = (values == extremes[0]) | (values == extremes[1])
    if not on.any():
        return on
    run = np.zeros(values.size, bool)
    three = on[:-2] & on[1:-1] & on[2:] & (values[:-2] == values[2:]) & (row[:-2] == row[2:])
    for shift in range(3):
        run[shift : values.size - 2 + shift] |= three
    return run


def gather(signal: Signal, start: Start, window_rad: float) -> Windows:
    """The windows of all rows of `start`, which must lie within one block's reach of one another."""
    channel = signal.channel
    reach = window_rad / start.omega * channel.axis.rate_Hz
    low, high = np.ceil(start.index - reach), np.floor(start.index + reach) + 1
    outside = (low < 0) | (high > channel.size)
    first_sample = np.clip(low, 0, channel.size - 1).astype(np.int64)
    stop_sample = np.clip(high, first_sample + 1, channel.size).astype(np.int64)
    stride = -(-(stop_sample - first_sample) // MOST_SAMPLES)
    count = -(-(stop_sample - first_sample) // stride)
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    row = np.repeat(np.arange(count.size), count)
    place = first_sample[row] + (np.arange(row.size) - first[row]) * stride[row]
    begin, end = int(first_sample.min()), int(stop_sample.max())
    raw = np.asarray(channel.read(begin, end), dtype=np.float64)
    values = raw[place - begin]
    time_s = channel.axis.at(place.astype(np.float64))
    return Windows(signal.sign * values, time_s, row, first, _stuck(values, row, signal.extremes), outside)


def _wild(residual: FloatArray, row: IntArray, limit: FloatArray) -> NDArray[np.bool_]:
    """Samples whose residual leaves the mean of its neighbours' by more than `limit`, and by more than theirs do."""
    bend = np.zeros(residual.size)
    bend[1:-1] = np.abs(residual[1:-1] - 0.5 * (residual[:-2] + residual[2:]))
    bend[~np.isfinite(bend)] = 0.0
    edge = np.concatenate([[True], row[1:] != row[:-1]])
    bend[edge] = 0.0
    bend[np.concatenate([edge[1:], [True]])] = 0.0
    largest = bend.copy()
    largest[1:] = np.maximum(largest[1:], bend[:-1])
    largest[:-1] = np.maximum(largest[:-1], bend[1:])
    return (bend > limit) & (bend >= largest)


def _sums(windows: Windows, columns: list[FloatArray], weight: FloatArray) -> FloatArray:
    """Weighted products of the columns summed over each row's samples, shape (n, k, k), symmetric."""
    k = len(columns)
    sums = np.empty((windows.first.size, k, k))
    for i in range(k):
        weighted = columns[i] * weight
        for j in range(i, k):
            sums[:, i, j] = sums[:, j, i] = np.add.reduceat(weighted * columns[j], windows.first)
    return sums


def _step(windows: Windows, template: Template, start: Start, height: FloatArray, weight: FloatArray, noise: float) -> tuple:
    """One Gauss-Newton step: (solution (n, 4) of a, b, -b s, b e; covariance (n, 4, 4) per noise variance; model (N,))."""
    tau = windows.time_s - start.time_s[windows.row]
    phi = (start.omega[windows.row] + 0.5 * start.alpha[windows.row] * tau) * tau
    shape, slope = template(phi)
    values = np.where(weight > 0, windows.values, 0.0)
    columns = [np.ones(phi.size), shape, slope, phi * slope]
    sums = _sums(windows, [*columns, values], weight)
    normal, right = sums[:, :4, :4].copy(), sums[:, :4, 4]
    # the stretch is held by what the neighbours say; the other three have a prior too weak to matter, for rows without samples
    normal[:, 3, 3] += (max(noise, 1e-12 * height.max()) / (height * start.stretch)) ** 2
    weak = 1e-9 * (np.trace(normal, axis1=1, axis2=2) + 1e-30)
    normal[:, range(4), range(4)] += weak[:, None]
    covariance = np.linalg.inv(normal)
    solution = (covariance @ right[..., None])[..., 0]
    model = sum(solution[windows.row, k] * columns[k] for k in range(4))
    return solution, covariance, model


def _cut_off(windows: Windows, model: FloatArray, noise: float) -> NDArray[np.bool_]:
    """Rows whose stuck samples lie off the template that the others fit: clipped, and not just a coarse scale's last step, shape (n,)."""
    if not windows.clipped.any():
        return np.zeros(windows.first.size, bool)
    count = np.add.reduceat(windows.clipped.astype(np.int64), windows.first)
    off = np.add.reduceat(np.where(windows.clipped, np.abs(model - windows.values), 0.0), windows.first)
    return off > CLIPPED_SIGMAS * noise * np.maximum(count, 1)


def fit(windows: Windows, template: Template, start: Start, height: FloatArray, noise: float) -> Fit:
    """Each row's centre by the template; `height` (n,) a first guess, `noise` sigma of one sample."""
    lost = ~np.isfinite(windows.values)
    weight = np.where(lost | windows.clipped, 0.0, 1.0)
    wild = np.zeros(lost.size, bool)
    at = start
    for iteration in range(ITERATIONS):
        solution, covariance, model = _step(windows, template, at, height, weight, noise)
        residual = np.where(weight > 0, windows.values - model, 0.0)
        if iteration == 0:
            row_height = np.abs(height)[windows.row]
            limit = np.maximum(WILD_SIGMAS * noise, WILD_SHARE * row_height)
            found = _wild(np.where(lost, np.nan, residual), windows.row, limit)
            found |= np.abs(residual) > np.maximum(FOREIGN_SHARE * row_height, WILD_SIGMAS * noise)
            if found.any():
                wild |= found
                weight = np.where(wild, 0.0, weight)
                solution, covariance, model = _step(windows, template, at, height, weight, noise)
        guess = np.where(np.abs(solution[:, 1]) > 0.05 * height, solution[:, 1], height)
        shift = np.clip(-solution[:, 2] / guess, -0.3 * template.window_rad, 0.3 * template.window_rad)
        stretch = np.clip(solution[:, 3] / guess, -0.3, 0.3)
        at = replace(at, time_s=at.time_s + shift / at.omega, omega=at.omega * (1 + stretch))
        height = np.abs(guess)
    residual = np.where(weight > 0, windows.values - model, 0.0)
    used = np.add.reduceat((weight > 0).astype(np.int64), windows.first)
    misfit = np.sqrt(np.add.reduceat(residual**2, windows.first) / np.maximum(used, 1))
    any_of = np.logical_or.reduceat
    return Fit(
        at.time_s,
        noise * np.sqrt(np.maximum(covariance[:, 2, 2], 0.0)) / (height * at.omega),
        at.omega,
        noise * np.sqrt(np.maximum(covariance[:, 3, 3], 0.0)) / height * at.omega,
        solution[:, 1],
        solution[:, 0],
        misfit,
        used,
        any_of(lost, windows.first),
        any_of(wild, windows.first),
        _cut_off(windows, model, noise),
        windows.outside,
    )
