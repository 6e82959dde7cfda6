"""Like revolutions averaged.

All that later steps need of them, so that the revolutions themselves can go.

    Stack (n, m) -> cell (n,): one manoeuvre, a band of speed -> Pieces (P, m)
        -> `cells.cells_of` pools noise and scatter over all

Within a piece each revolution is

    y = P(phi) + baseline + amplitude P + width phi P' - shift P' + noise

with P the piece's mean waveform at the revolution's real angles. The four coefficients are taken
out, the rest averaged. With one angle only the mean is taken. A piece is 25 kB, whatever the number
of its revolutions; a mixed log of two minutes makes some 30 of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from tirelog.data.recording import Conditions, Stack
from tirelog.inference.cells.lines import scatter_about_line
from tirelog.inference.stacks.align import knots_of, nearest_curve
from tirelog.vocabulary.arrays import FloatArray, IntArray

ComplexArray = NDArray[np.complex128]

#: width [m/s] of a cell's band of speed: what the waveform does over it is taken to second order
#: (`floor.at_mean_speed`); twice as wide leaves eight times the third order
BAND_M_S = 1.6
#: fewest revolutions in a band (two would tell a scatter by one difference), most bands in a
#: manoeuvre: what later steps take grows with the bands; twice as many revolutions make half as
#: many bands of short manoeuvres, which average over more of the speed; twice as many bands take
#: twice the time
FEWEST = 3
MOST_BANDS = 6
#: rounds of coefficients out, mean anew: the second round's mean is free of the first's; twice as
#: many take twice as long
_ROUNDS = 2
#: neighbouring knots of a cell's curve are at least this share of a bin apart: noise over a gap is
#: a slope, and 0.3 makes it three times what a whole bin does; doubling it begins to blur edges
#: where angles are spread evenly
CLOSEST = 0.3
#: a bin with less than this share of the samples of the middle one joins a neighbour within so many
#: bins; doubling changes nothing seen
LEAST_COUNT = 0.1
_NEIGHBOUR = 1.5
_FEWEST_KNOTS = 8
#: noise of one sample, in steps, from which on rounding errors average out to 2e-8 steps^2; half of
#: it would leave 0.002
DITHERED = 0.6
#: fields of Pieces that are not a row per piece
_APART = (
    "observable",
    "channel",
    "surface",
    "radius_m",
    "coefficients",
    "conditions",
    "cell",
    "logs",
    "notes",
)
#: successive logs take their share of pieces at other speeds: the golden ratio's fraction spreads
#: them evenly
_GOLDEN = 0.6180339887498949


@dataclass(frozen=True)
class Pieces:
    """Means of like revolutions, P pieces x m angles, from one log or several.

    Rows are in the order of log, manoeuvre, time.

    mean, phi, variance, count (P, m)  mean waveform, mean angle and variance of its samples,
                                       samples; NaN if there are none
    random         (P, m, 3)  P, phi P', rms of P;  shift (P, m)  -P', whose mean coefficient is
                   zero
    residual_ss, freedom (P, m)  what is left of single revolutions;  scatter (P, 1) their standard
                                 deviation, with one angle only
    speed_mean, speed_square (P, m)  mean and mean square of a bin's samples' speed about the
                                     piece's mean speed [m/s], [m^2/s^2]
    speed_angle    (P, m)  covariance of a bin's samples' speed and angle [rad m/s]
    step           (P,)  in which the channel's values come, 0 if it is not seen
    still          (P, m)  mean of exp(2 pi i y) over the samples, y their values without noise in
                   steps: of size 1 if all of them are rounded at one place between two steps, so
                   that their errors do not average out; complex, 0 if it cannot matter
    number         (P,)  revolutions;  coefficients (n, 3) of each, in the order of the pieces; with
                   one angle only the last is the number less its piece's mean
    conditions, log, manoeuvre, regime  a value per piece;  cell (n,) the piece of each revolution
                                        of the stack, empty if it is not known
    notes          sentences on what was set apart, taken together or left out on the way here
    """

    observable: str
    channel: str
    surface: str
    radius_m: float
    mean: FloatArray
    phi: FloatArray
    variance: FloatArray
    count: FloatArray
    random: FloatArray
    shift: FloatArray
    residual_ss: FloatArray
    freedom: FloatArray
    scatter: FloatArray
    speed_mean: FloatArray
    speed_square: FloatArray
    speed_angle: FloatArray
    still: ComplexArray
    step: FloatArray
    number: IntArray
    coefficients: FloatArray
    conditions: Conditions
    log: IntArray
    manoeuvre: IntArray
    regime: NDArray[np.str_]
    cell: IntArray
    logs: tuple[str, ...]
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return int(self.number.size)

    def take(self, which: NDArray[Any]) -> Pieces:
        """Some of the pieces (mask or ascending indices)."""
        kept = np.zeros(len(self), bool)
        kept[which] = True
        rows = {f.name: getattr(self, f.name)[kept] for f in fields(self) if f.name not in _APART}
        mine = np.repeat(kept, self.number)
        return replace(
            self,
            coefficients=self.coefficients[mine],
            conditions=self.conditions.take(kept),
            cell=np.zeros(0, np.int64),
            **rows,
        )

    def thinned(self, most: int, turn: int = 0) -> Pieces:
        """At most `most` pieces, evenly over the speeds.

        Another `turn` (the number of a log, say) takes them at other speeds.
        """
        return self if len(self) <= most else self.take(self.spread(most, turn))

    def spread(self, most: int, turn: int = 0) -> IntArray:
        """The pieces, ascending, that `thinned` keeps."""
        if len(self) <= most:
            return np.arange(len(self))
        place = (np.arange(most) + (turn * _GOLDEN) % 1.0) / most * len(self)
        return np.sort(np.argsort(self.conditions.speed_m_s, kind="stable")[place.astype(int)])


def joined_pieces(parts: Sequence[Pieces]) -> Pieces:
    """The pieces of several logs as one; logs and manoeuvres are numbered through."""
    if len(parts) == 1:
        return parts[0]
    rows: dict[str, Any] = {}
    for name in ("log", "manoeuvre"):
        numbers = [getattr(part, name) for part in parts]
        first = np.cumsum([0, *(1 + int(n.max()) for n in numbers[:-1])])
        rows[name] = np.concatenate([n + more for n, more in zip(numbers, first, strict=True)])
    notes = tuple(note for part in parts for note in part.notes)
    logs = tuple(log for part in parts for log in part.logs)
    return replace(
        concatenated_pieces(parts), cell=np.zeros(0, np.int64), logs=logs, notes=notes, **rows
    )


def concatenated_pieces(parts: Sequence[Pieces]) -> Pieces:
    """All pieces under each other, cells numbered through; logs and manoeuvres have been."""
    if len(parts) == 1:
        return parts[0]
    rows: dict[str, Any] = {
        f.name: np.concatenate([getattr(part, f.name) for part in parts])
        for f in fields(Pieces)
        if f.name not in _APART or f.name == "coefficients"
    }
    first = np.cumsum([0, *(len(part) for part in parts[:-1])])
    cell = np.concatenate([part.cell + more for part, more in zip(parts, first, strict=True)])
    return replace(
        parts[0],
        conditions=Conditions.concatenate([part.conditions for part in parts]),
        cell=cell,
        **rows,
    )


def assign_pieces(stack: Stack) -> IntArray:
    """The cell of each revolution, (n,): bands of speed inside each manoeuvre."""
    cell = np.empty(len(stack), np.int64)
    first = 0
    for manoeuvre in np.unique(stack.manoeuvre):
        rows = np.flatnonzero(stack.manoeuvre == manoeuvre)
        speed = stack.conditions.speed_m_s[rows]
        low, spread = speed.min(), np.ptp(speed)
        bands = int(
            np.clip(np.ceil(spread / BAND_M_S), 1, max(1, min(MOST_BANDS, rows.size // FEWEST)))
        )
        band = np.clip(((speed - low) / max(spread, 1e-9) * bands).astype(int), 0, bands - 1)
        _, band = np.unique(_merge_small(band), return_inverse=True)
        cell[rows] = first + band
        first += int(band.max()) + 1
    return cell


def _merge_small(band: IntArray) -> IntArray:
    """Bands with fewer than FEWEST revolutions join their neighbour."""
    band = band.copy()
    while True:
        names, count = np.unique(band, return_counts=True)
        if names.size == 1 or count.min() >= FEWEST:
            return band
        i = int(np.argmin(count))
        band[band == names[i]] = names[i - 1] if i else names[1]


def pieces_of(stack: Stack) -> Pieces:
    """The pieces of a stack."""
    cell = assign_pieces(stack)
    rows_of = [np.flatnonzero(cell == c) for c in range(int(cell.max()) + 1)]
    parts = [_one_piece(stack, rows_of_one) for rows_of_one in rows_of]
    first = np.array([rows_of_one[0] for rows_of_one in rows_of])
    rows: dict[str, Any] = {  # in one order, whoever made them: sums go along it
        f.name: np.ascontiguousarray(np.stack([getattr(part, f.name) for part in parts]))
        for f in fields(_Part)
        if f.name != "coefficients"
    }
    return Pieces(
        observable=stack.observable,
        channel=stack.channel,
        surface=stack.surface,
        radius_m=stack.radius_m,
        step=np.full(len(parts), stack.step),
        number=np.array([rows_of_one.size for rows_of_one in rows_of]),
        coefficients=np.concatenate([part.coefficients for part in parts]),
        conditions=_mean_conditions(stack.conditions, cell, len(parts)),
        log=stack.log[first],
        manoeuvre=stack.manoeuvre[first],
        regime=stack.regime[first],
        cell=cell,
        logs=stack.logs,
        **rows,
    )


@dataclass
class _Part:
    """One cell's means and what single revolutions did about them."""

    mean: FloatArray
    phi: FloatArray
    variance: FloatArray
    count: FloatArray
    random: FloatArray
    shift: FloatArray
    coefficients: FloatArray
    residual_ss: FloatArray
    freedom: FloatArray
    scatter: FloatArray
    speed_mean: FloatArray
    speed_square: FloatArray
    speed_angle: FloatArray
    still: ComplexArray


def _knots(count: FloatArray) -> int | None:
    """How many knots the curve of revolutions with `count` (k, m) samples may have; None: any.

    Fewer than the samples of one of them, if these leave bins without a sample: then revolutions
    whose samples lock to fixed angles fill bins of their own between those of others, and a curve
    that bends from bin to bin follows whatever the ones have more of than the others.
    """
    samples = float(np.median(count.sum(axis=1)))
    return None if samples >= count.shape[1] else knots_of(samples)


def _curve(
    phi: FloatArray, values: FloatArray, count: FloatArray, knots: int | None
) -> CubicSpline:
    """Periodic spline of a cell's bins: the nearest with so many `knots`, or through all of them.

    Through all, those that lie too close are taken together: samples that lock to fixed angles
    give neighbouring bins mean angles far closer than a bin, and a spline that goes through both
    turns their noise into a slope.
    """
    full = np.isfinite(values) & (count > 0)
    x, y, n = phi[full], values[full], count[full]
    if knots is not None:
        return nearest_curve(x, y, n, knots)
    few = LEAST_COUNT * np.median(n)
    width = 2.0 * np.pi / phi.size
    while x.size > _FEWEST_KNOTS:
        gap = np.diff(np.append(x, x[0] + 2.0 * np.pi))  # to the next one
        lone = np.minimum(n, np.roll(n, -1)) < few
        close = gap / width < np.where(lone, _NEIGHBOUR, CLOSEST)
        if not close.any():
            break
        first = int(np.argmin(np.where(close, gap, np.inf)))
        x, y, n = _joined(x, y, n, first)
    return CubicSpline(np.append(x, x[0] + 2.0 * np.pi), np.append(y, y[0]), bc_type="periodic")


def _joined(
    x: FloatArray, y: FloatArray, n: FloatArray, first: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The knots with `first` and the one after it (round the turn) as one.

    The joined knot lies at the mean of their samples.
    """
    last = (first + 1) % x.size
    total = n[first] + n[last]
    share = n[last] / total
    x, y, n = x.copy(), y.copy(), n.copy()
    x[first] += share * ((x[last] - x[first]) % (2.0 * np.pi))
    y[first] += share * (y[last] - y[first])
    n[first] = total
    left = np.arange(x.size) != last
    x, y, n = x[left], y[left], n[left]
    order = np.argsort(x)
    return x[order], y[order], n[order]


def _bin_means(
    values: FloatArray, phi: FloatArray, variance: FloatArray, count: FloatArray
) -> tuple[FloatArray, ...]:
    """Mean value, mean angle, angle variance and number of samples of each bin.

    Over revolutions: (k, m) -> (m,).
    """
    total = count.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(count > 0, values, 0.0).T
        mean = np.einsum("mk,km->m", mean, count) / total
        angle = np.einsum("km,km->m", np.where(count > 0, phi, 0.0), count) / total
        second = np.where(count > 0, variance + (phi - angle) ** 2, 0.0)
        return mean, angle, np.einsum("km,km->m", second, count) / total, total


def _one_piece(stack: Stack, rows: IntArray) -> _Part:
    """The piece of the revolutions `rows`."""
    if stack.phi_rad.size == 1:
        return _one_number(stack.values[rows])
    speed = stack.conditions.speed_m_s[rows]
    revolutions = (
        stack.values[rows],
        stack.phi_mean[rows],
        stack.phi_variance[rows],
        stack.count[rows],
    )
    return one_waveform(*revolutions, speed, step=stack.step, step_from=stack.step_from)


def one_waveform(
    values: FloatArray,
    phi: FloatArray,
    variance: FloatArray,
    count: NDArray[Any],
    speed: FloatArray,
    step: float = 0.0,
    step_from: float = 0.0,
) -> _Part:
    """The piece of k revolutions.

    From bin means, mean angles, variances and counts (k, m) and speeds (k,).

    The coefficients of all revolutions together are zero in the mean. Their values are whole steps
    from `step_from`, if the `step` is not 0.
    """
    count = np.where(np.isfinite(values), count, 0).astype(float)
    knots = _knots(count)
    corrected = values
    for _ in range(_ROUNDS):
        mean, angle, spread, total = _bin_means(corrected, phi, variance, count)
        curve = _curve(angle, mean, total, knots)
        columns = _columns(curve, np.where(count > 0, phi, 0.0))
        expected = columns[..., 0] + 0.5 * variance * curve(np.where(count > 0, phi, 0.0), 2)
        excess = np.where(count > 0, values - expected, 0.0)
        gram = np.einsum("kmi,km,kmj->kij", columns, count, columns)
        right = np.einsum("kmi,km->ki", columns, excess * count)
        gram += 1e-12 * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(4)
        coefficients = np.linalg.solve(gram, right[..., None])[..., 0]
        coefficients -= coefficients.mean(axis=0)
        taken = np.einsum("kmi,ki->km", columns, coefficients)
        corrected = np.where(count > 0, values - taken, np.nan)
    mean, angle, spread, total = _bin_means(corrected, phi, variance, count)
    residual = np.where(count > 0, excess - taken, 0.0)
    fitted = count * np.einsum("kmi,kij,kmj->km", columns, np.linalg.inv(gram), columns)
    residual_ss, freedom = _scatter(residual, count, speed, fitted)
    still = np.zeros(mean.size, np.complex128)
    if step > 0.0 and np.any(residual_ss < (DITHERED**2 + 1.0 / 12.0) * step**2 * freedom):
        still = _still(
            np.where(count > 0, values - residual - step_from, 0.0),
            columns[..., 2] ** 2 * variance,
            count,
            step,
        )
    own = _columns(curve, np.where(total > 0, angle, 0.0))
    about = (speed - speed.mean())[:, None]
    share = count / np.maximum(total, 1e-12)
    return _Part(
        mean,
        angle,
        spread,
        total,
        own[:, [0, 1, 3]],
        own[:, 2],
        coefficients[:, [0, 1, 3]],
        residual_ss,
        freedom,
        np.zeros(0),
        (share * about).sum(axis=0),
        (share * about**2).sum(axis=0),
        (share * about * np.where(count > 0, phi - angle, 0.0)).sum(axis=0),
        still,
    )


def _still(smooth: FloatArray, spread: FloatArray, count: FloatArray, step: float) -> ComplexArray:
    """Mean of exp(2 pi i y / step) over the samples of each bin, (m,).

    Values without noise `smooth` (k, m), and their variance within each revolution's bin `spread`
    (k, m).
    """
    turning = (
        2.0j * np.pi * smooth / step - 2.0 * np.pi**2 * np.where(count > 0, spread, 0.0) / step**2
    )
    total = np.maximum(count.sum(axis=0), 1e-12)
    return np.asarray((count * np.exp(turning)).sum(axis=0) / total, dtype=np.complex128)


def _columns(curve: CubicSpline, phi: FloatArray) -> FloatArray:
    """P, phi P', -P' and the rms of P at angles (..., ) -> (..., 4).

    The width counts about the patch only, where P' is.
    """
    slope = curve(phi, 1)
    size = float(np.sqrt(np.mean(curve(curve.x) ** 2)))
    return np.stack(
        [curve(phi), phi * slope * np.exp(-((phi / 0.6) ** 2)), -slope, np.full_like(phi, size)],
        axis=-1,
    )


def _scatter(
    residual: FloatArray, count: FloatArray, speed: FloatArray, fitted: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(sum of count x residual^2, degrees of freedom) per bin, (m,) each.

    The residual is left after the mean and, with enough revolutions, the trend in speed. `fitted`
    (k, m) is the share of each value's noise that its revolution's coefficients take up (its
    leverage): nearly all of it lies at the edges of the patch.
    """
    k = residual.shape[0]
    present = (count > 0).sum(axis=0)
    total = np.maximum(count.sum(axis=0), 1e-12)
    centred = residual - (residual * count).sum(axis=0) / total
    lost = 1.0 + (1.0 - 1.0 / k) * fitted.sum(axis=0)  # the mean's coefficients are not taken out
    if k >= 5 and np.ptp(speed) > 1e-6:
        dv = speed[:, None] - (count * speed[:, None]).sum(axis=0) / total
        slope = (count * dv * centred).sum(axis=0) / np.maximum((count * dv**2).sum(axis=0), 1e-12)
        centred = centred - slope * dv
        lost += 1.0
    return (count * np.where(count > 0, centred, 0.0) ** 2).sum(axis=0), np.maximum(
        present - lost, 0.0
    )


def _one_number(values: FloatArray) -> _Part:
    """The piece of a number per revolution (k, 1): its mean, and its scatter about a line."""
    good = np.isfinite(values)
    mean = np.nanmean(values, axis=0) if good.any() else np.full(1, np.nan)
    scatter = np.array([scatter_about_line(values[good])])
    zero = np.zeros(1)
    about = np.zeros((len(values), 3))
    about[:, 2] = np.nan_to_num(values[:, 0] - mean)
    return _Part(
        mean, zero, zero, good.sum(axis=0).astype(float), np.zeros((1, 3)), zero,
        about, zero, zero, scatter, zero, zero, zero, np.zeros(1, np.complex128),
    )  # fmt: skip


def _mean_conditions(conditions: Conditions, cell: IntArray, C: int) -> Conditions:
    """Means over each cell."""
    number = np.bincount(cell, minlength=C)
    return Conditions(
        **{
            name: np.bincount(cell, getattr(conditions, name), C) / number
            for name in Conditions.__dataclass_fields__
        }
    )
