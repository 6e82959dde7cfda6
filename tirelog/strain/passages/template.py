"""The waveform of a passage, learnt from the log: one smooth curve over the wheel angle.

    samples of a few hundred passages (angle from the centre, value scaled to height 1)
        --cubic splines--> Template

The angle, not the time, is the abscissa, so one template serves every speed. Its zero is the middle
between the two places where it crosses half of its height: the *patch centre* of every command. An
odd part of the waveform moves that middle less than the extremum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray, Record, Records, records
from tirelog.wheel.pulses import spline, spline_at

# ---- Compiled loops over the windows of passages: the matched fit.
#
#     Source, SPAN of each row --read_window--> Scratch: samples, times, weights
#         --Gauss-Newton on the template--> FOUND of each row
#
# A window is a row's SPAN of the channel, thinned to MOST_SAMPLES.


#: a row as its fit begins: patch centre [s] and [samples], the wheel's rate [rad/s] and its change
#: [rad/s^2], how far the rate may be off (standard deviation, relative), height and offset of the
#: passage [channel's unit], its width at half level [s]
ROW = np.dtype(
    [("time_s", "f8"), ("index", "f8"), ("omega_rad_s", "f8"), ("alpha_rad_s2", "f8"),
     ("stretch", "f8"), ("height", "f8"), ("offset", "f8"), ("width_s", "f8")]
)  # fmt: skip
#: a row's window: first sample of the channel and the one behind, and what to add to their numbers
#: to find them in a `Source`
SPAN = np.dtype([("first", "i8"), ("stop", "i8"), ("shift", "i8")])
#: an even stretch of the time axis: its first sample, that one's time [s], seconds per sample
SEGMENT = np.dtype([("first", "f8"), ("start_s", "f8"), ("period_s", "f8")])
#: a template at one angle: value (height 1), slope [1/rad], scatter between turns over the height
POINT = np.dtype([("value", "f8"), ("slope", "f8"), ("scatter", "f8")])
#: a row's fit: patch centre [s], rate [rad/s] with the stretch in it, their standard errors, height
#: and offset [channel's unit], rms of the residual in that unit, samples used, what the window
#: holds, whether it leaves the log, whether the wheel stood in the passage or rolled backwards
FOUND = np.dtype(
    [("time_s", "f8"), ("time_se_s", "f8"), ("omega_rad_s", "f8"), ("omega_se_rad_s", "f8"),
     ("height", "f8"), ("offset", "f8"), ("misfit", "f8"), ("used", "i8"), ("holds_lost", "?"),
     ("holds_spike", "?"), ("holds_clipped", "?"), ("outside", "?"), ("standing", "?"),
     ("backwards", "?")],
    align=True,
)  # fmt: skip


class Source(NamedTuple):
    """The samples of a channel that windows are read from.

    samples   (N,) as recorded, NaN where lost
    times_s   (N,) [s], or empty: then `segments` (k,) of SEGMENT tell them
    sign      turns the patch upward; low, high: the channel's least and largest sample
    """

    samples: FloatArray
    times_s: FloatArray
    segments: Records
    sign: float
    low: float
    high: float


#: a sample of a window: its value, patch upward, and when it was taken [s]; 1 if it counts, 1 if it
#: is at an end of the range; angle from the patch centre [rad]; the template there, its slope
#: [1/rad], its scatter between turns; what the fit leaves of it, and how far that leaves its
#: neighbours' mean
SAMPLE = np.dtype(
    [("value", "f8"), ("time_s", "f8"), ("weight", "f8"), ("stuck", "f8"), ("phi", "f8"),
     ("shape", "f8"), ("slope", "f8"), ("scatter", "f8"), ("residual", "f8"), ("bend", "f8")]
)  # fmt: skip


# ---- Compiled: normal equations, of the passages' template here and of their form in `footprint`.
#
#     columns (n + SPARE, w + 1), the values last --all products--> gram (w + 1, w + 1)
#         --elimination--> inverse of its first rows and columns --> solution


#: rows that arrays of columns have beyond the samples
SPARE = 3


@compiled
def products(columns: FloatArray, used: int, wide: int, gram: FloatArray) -> None:
    """Fills `gram` (wide + 1, wide + 1) with products of all pairs of columns, the values last.

    Summed over the `used` samples. `columns` has room for SPARE more than are used. SPARE + 1
    samples at a time: what is summed is loaded and stored once for all of them.
    """
    for i in range(wide + 1):
        for j in range(i + 1):
            gram[i, j] = 0.0
    for k in range(used, used + SPARE):
        for i in range(wide + 1):
            columns[k, i] = 0.0
    for k in range(0, used, SPARE + 1):
        for i in range(wide + 1):
            a, b, c, d = columns[k, i], columns[k + 1, i], columns[k + 2, i], columns[k + 3, i]
            for j in range(i + 1):
                gram[i, j] += (
                    a * columns[k, j]
                    + b * columns[k + 1, j]
                    + c * columns[k + 2, j]
                    + d * columns[k + 3, j]
                )
    for i in range(wide + 1):
        for j in range(i):
            gram[j, i] = gram[i, j]


@compiled
def invert(matrix: FloatArray) -> None:
    """Turns a positive definite `matrix` (n, n) into its inverse, by elimination.

    A pivot that rounding has left without a digit counts as 1e-16.
    """
    size = matrix.shape[0]
    for k in range(size):
        pivot = 1.0 / max(matrix[k, k], 1e-16)
        matrix[k, k] = 1.0
        for j in range(size):
            matrix[k, j] *= pivot
        for i in range(size):
            factor = matrix[i, k]
            if i != k:
                matrix[i, k] = 0.0
                for j in range(size):
                    matrix[i, j] -= factor * matrix[k, j]


@compiled
def apply_inverse(inverse: FloatArray, right: FloatArray, out: FloatArray) -> None:
    """Fills `out` (n,) with the product of `inverse` (n, n) and the head of `right`."""
    for i in range(out.size):
        value = 0.0
        for j in range(out.size):
            value += inverse[i, j] * right[j]
        out[i] = value


#: columns of a passage's fit: 1, T, T' and phi T'
WIDE = 4
#: samples per row at most; a creeping wheel's windows are thinned to this; twice as many take
#: twice as long where a wheel creeps, and only there
MOST_SAMPLES = 400


@compiled
def fit_rows(
    source: Source, noise: float, table: Records, window_rad: float, rows: Records, spans: Records,
    found: Records, room: Records,
) -> None:  # fmt: skip
    """Fills each row's fit y = a + b T(phi (1 + e) - s) by the template T.

    table        (g,) of POINT: T over +-`window_rad`
    rows, spans  (n,) of ROW and SPAN
    found        (n,) of FOUND
    noise        standard deviation of one sample [channel's unit]
    """
    columns = np.empty((MOST_SAMPLES + SPARE, WIDE + 1))
    gram, inverse, solved = np.empty((WIDE + 1, WIDE + 1)), np.empty((WIDE, WIDE)), np.empty(WIDE)
    # how far a step may shift [window] and stretch; twice as far could carry the centre out of the
    # window in two steps
    most_shift = most_stretch = 0.3
    for k in range(rows.shape[0]):
        count, lost = read_window(source, spans[k], room)
        row, made = rows[k], found[k]
        made["holds_lost"], made["holds_spike"] = lost > 0, False
        time_s, omega, alpha = row["time_s"], row["omega_rad_s"], row["alpha_rad_s2"]
        height = row["height"]
        # Gauss-Newton steps of a fit; in the first one wild samples lose their weight; twice as
        # many take twice as long
        for iteration in range(2):
            hold = (max(noise, 1e-12 * height) / (height * row["stretch"])) ** 2
            _shapes(count, time_s, omega, alpha, table, window_rad, room)
            _step(count, hold, room, columns, gram, inverse, solved)
            if iteration == 0 and _wild(count, abs(height), noise, room):
                made["holds_spike"] = True
                _step(count, hold, room, columns, gram, inverse, solved)
            guess = solved[1] if abs(solved[1]) > 0.05 * height else height
            shift = min(max(-solved[2] / guess, -most_shift * window_rad), most_shift * window_rad)
            time_s += shift / omega
            omega *= 1.0 + min(max(solved[3] / guess, -most_stretch), most_stretch)
            height = abs(guess)
        square, off, stuck, used = 0.0, 0.0, 0.0, 0
        for i in range(count):
            if room[i]["weight"] > 0:
                used += 1
                square += room[i]["residual"] ** 2
            if room[i]["stuck"] > 0:
                stuck += 1.0
                off += abs(room[i]["residual"])
        made["used"] = used
        # stuck samples are clipped if they lie this many sigmas off; twice as many leave clipped
        # samples in that are up to six off
        made["holds_clipped"] = off > 3.0 * noise * max(stuck, 1.0)
        made["time_s"] = time_s
        made["time_se_s"] = noise * np.sqrt(inverse[2, 2]) / (height * omega)
        made["omega_rad_s"] = omega
        made["omega_se_rad_s"] = noise * np.sqrt(inverse[3, 3]) / height * omega
        made["height"] = solved[1]
        made["offset"] = solved[0]
        made["misfit"] = np.sqrt(square / max(used, 1))


@compiled
def read_window(source: Source, span: Record, room: Records) -> tuple[int, int]:
    """Fills `room` with the samples of a `span`, thinned; how many, and how many are lost.

    `room` (MOST_SAMPLES,) of SAMPLE, `span`: one SPAN. Lost and stuck samples have no weight. Stuck
    are three or more in a row on the channel's least or largest value.
    """
    first, stop, shift = span["first"], span["stop"], span["shift"]
    samples, times, segments, sign = source.samples, source.times_s, source.segments, source.sign
    stride = -(-(stop - first) // MOST_SAMPLES)
    count = -(-(stop - first) // stride)
    low, high = sign * source.low, sign * source.high
    lost = extreme = 0
    for i in range(count):
        value = sign * samples[first + i * stride + shift]
        there = np.isfinite(value)
        room[i]["value"] = value
        room[i]["weight"] = 1.0 if there else 0.0
        room[i]["stuck"] = 0.0
        lost += not there
        extreme += (value == low) | (value == high)
    if extreme > 2:
        _without_stuck(count, low, high, room)
    if times.size > 0:
        for i in range(count):
            room[i]["time_s"] = times[first + i * stride + shift]
        return count, lost
    i = 0
    for k in range(segments.size):
        begin, start_s = segments[k]["first"], segments[k]["start_s"]
        period_s = segments[k]["period_s"]
        end = segments[k + 1]["first"] if k + 1 < segments.size else np.inf
        while i < count and first + i * stride < end:
            room[i]["time_s"] = start_s + (first + i * stride - begin) * period_s
            i += 1
    return count, lost


@compiled
def _without_stuck(count: int, low: float, high: float, room: Records) -> None:
    """Marks stuck samples and takes their weight."""
    values = room["value"]
    run = 0
    for i in range(count):
        on = values[i] in (low, high)
        run = run + 1 if on and (run == 0 or values[i] == values[i - 1]) else (1 if on else 0)
        if run >= 3:
            room["stuck"][i - 2 : i + 1], room["weight"][i - 2 : i + 1] = 1.0, 0.0


@compiled
def _shapes(
    count: int, time_s: float, omega: float, alpha: float, table: Records, window_rad: float,
    room: Records,
) -> None:  # fmt: skip
    """Fills angle, template, its slope and scatter at each sample.

    Linear between the points of `table` (g,), constant outside.
    """
    times, phis, shapes, slopes = room["time_s"], room["phi"], room["shape"], room["slope"]
    scale, most = (table.size - 1) / (2.0 * window_rad), table.size - 1.001
    for i in range(count):
        tau = times[i] - time_s
        phi = (omega + 0.5 * alpha * tau) * tau
        place = (phi + window_rad) * scale
        place = place if place > 0.0 else 0.0
        place = place if place < most else most
        lower = int(place)
        share, here, after = place - lower, table[lower], table[lower + 1]
        phis[i] = phi
        shapes[i] = here["value"] + share * (after["value"] - here["value"])
        slopes[i] = here["slope"] + share * (after["slope"] - here["slope"])
        room[i]["scatter"] = here["scatter"]


@compiled
def _step(
    count: int, hold: float, room: Records, columns: FloatArray, gram: FloatArray,
    inverse: FloatArray, solved: FloatArray,
) -> None:  # fmt: skip
    """Fills `solved` (WIDE,) with a, b, c, d of y = a + b T + c T' + d phi T', and residuals.

    Of the first `count` samples of a window, those of lost ones are 0. To first order c = -b s and
    d = b e. The stretch is held by `hold`, the inverse of its variance per noise variance; the
    other three have a prior too weak to matter, for rows without samples. `inverse` (WIDE, WIDE) of
    the normal equations is filled too: variances per noise variance; the rest is room.
    """
    values, weights, phis = room["value"], room["weight"], room["phi"]
    shapes, slopes, residuals = room["shape"], room["slope"], room["residual"]
    used, trace = 0, 1e-30
    for i in range(count):
        if weights[i] > 0:
            row = columns[used]
            row[0] = 1.0
            row[1] = shapes[i]
            row[2] = slopes[i]
            row[3] = phis[i] * slopes[i]
            row[WIDE] = values[i]
            used += 1
    products(columns, used, WIDE, gram)
    gram[3, 3] += hold
    for i in range(WIDE):
        trace += gram[i, i]
    for i in range(WIDE):
        gram[i, i] += 1e-9 * trace
    inverse[:] = gram[:WIDE, :WIDE]
    invert(inverse)
    apply_inverse(inverse, gram[WIDE], solved)
    for i in range(count):
        fitted = solved[0] + solved[1] * shapes[i]
        fitted += (solved[2] + solved[3] * phis[i]) * slopes[i]
        residual = values[i] - fitted
        residuals[i] = residual if np.isfinite(residual) else 0.0


@compiled
def _wild(count: int, height: float, noise: float, room: Records) -> bool:
    """Whether any samples are wild; takes the weight off these.

    Their residual leaves the mean of its neighbours', by more than theirs do, or they are not the
    tire at all.
    """
    # a sample is wild if it leaves its two neighbours' mean by this many sigmas and by this share
    # of the height: noise does the first once in 1e10, and half of it once in 1000
    limit = max(8.0 * noise, 0.06 * height)
    # what is further off than this share of the height is not the tire; twice as much keeps what is
    # off by most of the height, half as much takes a waveform that the template lacks for foreign
    foreign = max(8.0 * noise, 0.35 * height)
    values, weights = room["value"], room["weight"]
    residuals, bends = room["residual"], room["bend"]
    most = 0.0
    for i in range(count):
        if room[i]["stuck"] > 0:
            residuals[i] = 0.0
        size = abs(residuals[i])
        most = size if size > most else most
    # no residual leaves its neighbours' mean by more than twice the largest
    if most <= 0.5 * limit:
        return False
    bends[0] = bends[count - 1] = 0.0
    for i in range(1, count - 1):
        bend = abs(residuals[i] - 0.5 * (residuals[i - 1] + residuals[i + 1]))
        bends[i] = bend if np.isfinite(values[i - 1] + values[i] + values[i + 1]) else 0.0
    found = False
    for i in range(count):
        largest = max(bends[max(i - 1, 0)], bends[min(i + 1, count - 1)])
        # and by this many times the scatter between turns at its angle: the ringing of an edge is
        # no spike.  Half as much would take a third of the passages of a real accelerometer for
        # spiked; twice as much hides spikes at its edges
        usual = 5.0 * height * room[i]["scatter"]
        if (bends[i] > max(limit, usual) and bends[i] >= largest) or abs(residuals[i]) > max(
            foreign, usual
        ):
            weights[i] = 0.0
            found = True
    return found


#: knots over the template's window, and points of its table; twice as many knots follow edges
#: twice as sharp, with half of the samples for each
INTERVALS, TABLE = 40, 4096
#: the fit's window in half widths (half level): edges and shoulders, where the slope is
WINDOW_HALF_WIDTHS = 1.8
#: that window reaches so far at most on either side of the middle [rad]; twice as far is a quarter
#: of a turn
WIDEST_RAD = 0.8
#: half of the contact length over half of the width at half level, roughly, for both carcasses
LENGTH_TO_WIDTH = 1.25


@dataclass(frozen=True)
class Template:
    """The waveform at even angles: height 1, patch upward.

    `points` (g,) of POINT at `phi_rad` (g,) over +-`window_rad`; their scatter between turns is
    beyond the noise, and 0 where it is not known.

    `half_width_rad`: half of the distance between the half-level crossings, which lie at
    -half_width_rad and +half_width_rad.
    """

    phi_rad: FloatArray
    points: Records
    window_rad: float
    half_width_rad: float

    def mirrored(self) -> Template:
        """The waveform of a wheel that rolls backwards."""
        points = self.points[::-1].copy()
        points["slope"] *= -1.0
        return replace(self, points=points)


def half_height(phi: FloatArray, values: FloatArray) -> tuple[float, float] | None:
    """(middle, half width) of the crossings of half of the height, or None without such.

    The height is above the ends' mean.
    """
    top = int(np.argmax(values))
    level = 0.5 * (values[top] + 0.5 * (values[0] + values[-1]))
    below = values < level
    if not below[:top].any() or not below[top:].any():
        return None
    a, b = int(np.flatnonzero(below[:top])[-1]), top + int(np.flatnonzero(below[top:])[0])
    entry = np.interp(level, values[[a, a + 1]], phi[[a, a + 1]])
    leave = np.interp(level, values[[b, b - 1]], phi[[b, b - 1]])
    return float(0.5 * (entry + leave)), float(0.5 * (leave - entry))


def learned_template(phi: FloatArray, values: FloatArray, window: float) -> Template | None:
    """The template of samples, within +-`window` [rad], or None.

    `values` (N,) at `phi` (N,) [rad] from the centres. None if the curve has no two half-level
    crossings. Its table covers a window of WINDOW_HALF_WIDTHS half widths around the middle of the
    crossings, as far as `window` allows.
    """
    used = (np.abs(phi) < window) & (np.abs(values) < 2.0)
    solved = spline(phi[used], values[used], window, INTERVALS)
    grid = np.linspace(-window, window, TABLE)
    found = half_height(grid, spline_at(solved, grid, window))
    if found is None:
        return None
    middle, half_width = found
    reach = min(WINDOW_HALF_WIDTHS * half_width, WIDEST_RAD, window - abs(middle))
    table = np.linspace(-reach, reach, TABLE)
    curve = spline_at(solved, table + middle, window)
    base = 0.5 * (curve[0] + curve[-1])
    height = curve.max() - base
    values = (curve - base) / height
    points = records(POINT, value=values, slope=np.gradient(values, table))
    return Template(table, points, reach, half_width)
