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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from tirelog.data.recording import Conditions, Stack
from tirelog.inference.stacks.align import knots_of, nearest_curve
from tirelog.inference.stacks.cut import ANGLES, joined, outlines
from tirelog.process_pool import shared_out
from tirelog.vocabulary.arrays import FloatArray, IntArray

# ---- Numbers in the order of driving, about a straight line.


def without_line(values: FloatArray) -> FloatArray:
    """Values (n,) without the straight line through them."""
    place = np.arange(values.size) - 0.5 * (values.size - 1)
    left: FloatArray = values - values.mean()
    return left - (place @ left) / (place @ place) * place


def scatter_about_line(values: FloatArray) -> float:
    """Standard deviation of values (n,) about a line; of three about their mean, NaN of fewer.

    What moves along a piece is its manoeuvre's: a speed that rises, and what follows it.
    """
    if values.size < 3:
        return float("nan")
    short = values.size == 3
    left = values - values.mean() if short else without_line(values)
    return float(np.sqrt((left @ left) / (values.size - (1 if short else 2))))


#: fewest revolutions in a band: two would tell a scatter by one difference; twice as many make half
#: as many bands of short manoeuvres, which average over more of the speed
FEWEST = 3


#: marks a field with a value per row
ROW: Mapping[str, Any] = {"empty": None}


def binned(power: int, empty: float) -> Mapping[str, Any]:
    """Marks a field with bins: the power of the unit in it, what a bin without samples has."""
    return {"power": power, "empty": empty}


@dataclass(frozen=True, kw_only=True)
class Means:
    """Means of similar revolutions, n rows x m angles, in the order of log, manoeuvre, time.

    values, phi, phi_variance (n, m)  mean waveform, mean angle and variance of its samples; NaN if
                                      there are none
    random         (n, m, 3)  P, phi P', rms of P;  shift (n, m)  -P'; zero with one angle only
    speed_mean, speed_square (n, m)  mean and mean square of a bin's samples' speed about the row's
                                     mean speed [m/s], [m^2/s^2]
    speed_angle    (n, m)  covariance of a bin's samples' speed and angle [rad m/s]
    conditions     means;  log, manoeuvre, regime (n,)
    cell           the row of each revolution of the stack, empty if only the rows are left
    notes          sentences on what was set apart, taken together or left out of the logs
    member         the grating, if they are of one of several; place_rad its angle on the wheel
    """

    observable: str
    surface: str
    radius_m: float
    values: FloatArray = field(metadata=binned(1, np.nan))
    phi: FloatArray = field(metadata=binned(0, np.nan))
    phi_variance: FloatArray = field(metadata=binned(0, 0.0))
    random: FloatArray = field(metadata=binned(1, 0.0))
    shift: FloatArray = field(metadata=binned(1, 0.0))
    speed_mean: FloatArray = field(metadata=binned(0, 0.0))
    speed_square: FloatArray = field(metadata=binned(0, 0.0))
    speed_angle: FloatArray = field(metadata=binned(0, 0.0))
    conditions: Conditions
    log: IntArray = field(metadata=ROW)
    manoeuvre: IntArray = field(metadata=ROW)
    regime: NDArray[np.str_] = field(metadata=ROW)
    cell: IntArray
    logs: tuple[str, ...]
    notes: tuple[str, ...] = ()
    member: str = ""
    place_rad: float = np.nan

    def __len__(self) -> int:
        return int(self.values.shape[0])

    def take(self, which: NDArray[Any]) -> Self:
        """Some of the rows (mask or indices)."""
        rows = {f.name: getattr(self, f.name)[which] for f in fields(self) if f.metadata}
        conditions = self.conditions.take(which)
        return replace(self, conditions=conditions, cell=np.zeros(0, np.int64), **rows)


@dataclass(frozen=True, kw_only=True)
class Pieces(Means):
    """Means of similar revolutions from one log or several, P of them.

    count          (P, m)  samples
    residual_ss, freedom (P, m)  what is left of single revolutions;  scatter (P, 1) their standard
                                 deviation, with one angle only
    step           (P,)  in which the channel's values come, 0 if it is not seen
    still          (P, m)  size of the mean of exp(2 pi i y) over the samples, y their values
                   without noise in steps: 1 if all of them are rounded at one place between two
                   steps, so that their errors do not average out; 0 if it cannot matter
    number         (P,)  revolutions;  coefficients (n, 3) of each, in the order of the pieces; with
                   one angle only the last is the number less its piece's mean
    """

    channel: str
    count: FloatArray = field(metadata=ROW)
    residual_ss: FloatArray = field(metadata=ROW)
    freedom: FloatArray = field(metadata=ROW)
    scatter: FloatArray = field(metadata=ROW)
    still: FloatArray = field(metadata=ROW)
    step: FloatArray = field(metadata=ROW)
    number: IntArray = field(metadata=ROW)
    coefficients: FloatArray

    def take(self, which: NDArray[Any]) -> Self:
        """Some of the pieces (mask or ascending indices)."""
        kept = np.zeros(len(self), bool)
        kept[which] = True
        mine = np.repeat(kept, self.number)
        return replace(super().take(kept), coefficients=self.coefficients[mine])

    def thinned(self, most: int, turn: int = 0) -> Pieces:
        """At most `most` pieces, evenly over the speeds.

        Another `turn` (the number of a log, say) takes them at other speeds.
        """
        if len(self) <= most:
            return self
        return self.take(evenly_over(self.conditions.speed_m_s, most, turn))


def evenly_over(speed_m_s: FloatArray, most: int, turn: int) -> IntArray:
    """At most `most` of these speeds (n,), evenly over them: their numbers, ascending.

    Another `turn` takes others: the golden ratio's fraction spreads successive ones evenly.
    """
    if speed_m_s.size <= most:
        return np.arange(speed_m_s.size)
    place = (np.arange(most) + (turn * 0.5 * (np.sqrt(5.0) - 1.0)) % 1.0) / most * speed_m_s.size
    return np.sort(np.argsort(speed_m_s, kind="stable")[place.astype(int)])


def joined_pieces(parts: Sequence[Pieces]) -> Pieces:
    """The pieces of several logs as one; logs and manoeuvres are numbered through."""
    rows: dict[str, Any] = {}
    for name in ("log", "manoeuvre"):
        numbers = [getattr(part, name) for part in parts]
        first = np.cumsum([0, *(1 + int(n.max()) for n in numbers[:-1])])
        rows[name] = np.concatenate([n + more for n, more in zip(numbers, first, strict=True)])
    notes = tuple(note for part in parts for note in part.notes)
    logs = tuple(log for part in parts for log in part.logs)
    return replace(concatenated_pieces(parts), logs=logs, notes=notes, **rows)


def concatenated_pieces(parts: Sequence[Pieces]) -> Pieces:
    """All pieces under each other, without their revolutions' cells; logs have been numbered."""
    rows: dict[str, Any] = {
        f.name: np.concatenate([getattr(part, f.name) for part in parts])
        for f in fields(Pieces)
        if f.metadata or f.name == "coefficients"
    }
    conditions = Conditions.concatenate([part.conditions for part in parts])
    return replace(parts[0], conditions=conditions, cell=np.zeros(0, np.int64), **rows)


def assign_pieces(stack: Stack) -> IntArray:
    """The cell of each revolution, (n,): bands of speed inside each manoeuvre."""
    cell = np.empty(len(stack), np.int64)
    first = 0
    for manoeuvre in np.unique(stack.manoeuvre):
        rows = np.flatnonzero(stack.manoeuvre == manoeuvre)
        speed = stack.conditions.speed_m_s[rows]
        low, spread = speed.min(), np.ptp(speed)
        # width [m/s] of a cell's band of speed: what the waveform does over it is taken to second
        # order (`floor.at_mean_speed`); twice as wide leaves eight times the third order. What
        # later steps take grows with the bands: twice as many as six take twice the time
        bands = int(np.clip(np.ceil(spread / 1.6), 1, max(1, min(6, rows.size // FEWEST))))
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
    rows_of = [np.flatnonzero(cell == number) for number in range(int(cell.max()) + 1)]
    parts = [
        one_waveform(
            stack.values[one],
            stack.phi_mean[one],
            stack.phi_variance[one],
            stack.count[one],
            stack.conditions.speed_m_s[one],
            step=stack.step,
        )
        if stack.phi_rad.size > 1
        else _one_number(stack.values[one])
        for one in rows_of
    ]
    first = np.array([one[0] for one in rows_of])
    number = np.array([one.size for one in rows_of])
    means = {
        f.name: np.bincount(cell, getattr(stack.conditions, f.name)) / number
        for f in fields(Conditions)
    }
    rows: dict[str, Any] = {  # in one order, whoever made them: sums go along it
        name: np.ascontiguousarray(np.stack([part[name] for part in parts]))
        for name in parts[0]
        if name != "coefficients"
    }
    return Pieces(
        observable=stack.observable,
        channel=stack.channel,
        surface=stack.surface,
        radius_m=stack.radius_m,
        step=np.full(len(parts), stack.step),
        number=number,
        coefficients=np.concatenate([part["coefficients"] for part in parts]),
        conditions=Conditions(**means),
        log=stack.log[first],
        manoeuvre=stack.manoeuvre[first],
        regime=stack.regime[first],
        cell=cell,
        logs=stack.logs,
        member=stack.member,
        place_rad=stack.place_rad,
        **rows,
    )


#: one piece's fields of `Pieces` without the axis of the pieces, its coefficients (k, 3)
PieceRow = dict[str, Any]


def _knots(count: FloatArray) -> int | None:
    """How many knots the curve of revolutions with `count` (k, m) samples may have; None: any.

    Fewer than the samples of one of them, if these leave bins without a sample. Then revolutions
    whose samples lock to fixed angles fill bins of their own between those of others. A curve that
    bends from bin to bin would follow the difference between these revolutions.
    """
    samples = float(np.median(count.sum(axis=1)))
    return None if samples >= count.shape[1] else knots_of(samples)


def _curve(
    phi: FloatArray, values: FloatArray, count: FloatArray, knots: int | None
) -> CubicSpline:
    """Periodic spline of a cell's bins: nearest with so many `knots`, or through all of them."""
    full = np.isfinite(values) & (count > 0)
    x, y, n = phi[full], values[full], count[full]
    if knots is not None:
        return nearest_curve(x, y, n, knots)
    # samples that lock to the bins' edges give neighbours nearly one angle: their noise over the
    # gap is a slope, and over 0.3 bins three times what a whole bin makes
    apart = np.diff(x, prepend=x[-1] - 2.0 * np.pi) >= 0.3 * 2.0 * np.pi / phi.size
    group = np.cumsum(apart) - 1
    x = np.where(group < 0, x + 2.0 * np.pi, x)  # the first bins are one with the last
    group = np.where(group < 0, group[-1], group)
    x, y = (np.bincount(group, n * one) / np.bincount(group, n) for one in (x, y))
    return CubicSpline(np.append(x, x[0] + 2.0 * np.pi), np.append(y, y[0]), bc_type="periodic")


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


def one_waveform(
    values: FloatArray,
    phi: FloatArray,
    variance: FloatArray,
    count: NDArray[Any],
    speed: FloatArray,
    step: float = 0.0,
) -> PieceRow:
    """The piece of k revolutions.

    From bin means, mean angles, variances and counts (k, m) and speeds (k,).

    The coefficients of all revolutions together are zero in the mean. Their values come in whole
    steps, if the `step` is not 0.
    """
    count = np.where(np.isfinite(values), count, 0).astype(float)
    knots = _knots(count)
    corrected = values
    # rounds of coefficients out, mean anew: the second round's mean is free of the first's; twice
    # as many take twice as long
    for _ in range(2):
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
    still = np.zeros(mean.size)
    # noise of one sample, in steps, from which on rounding errors average out to 2e-8 steps^2; half
    # of it would leave 0.002
    if step > 0.0 and np.any(residual_ss < (0.6**2 + 1.0 / 12.0) * step**2 * freedom):
        still = _still(
            np.where(count > 0, values - residual, 0.0),
            columns[..., 2] ** 2 * variance,
            count,
            step,
        )
    own = _columns(curve, np.where(total > 0, angle, 0.0))
    about = (speed - speed.mean())[:, None]
    share = count / np.maximum(total, 1e-12)
    return {
        "values": mean,
        "phi": angle,
        "phi_variance": spread,
        "count": total,
        "random": own[:, [0, 1, 3]],
        "shift": own[:, 2],
        "coefficients": coefficients[:, [0, 1, 3]],
        "residual_ss": residual_ss,
        "freedom": freedom,
        "scatter": np.zeros(0),
        "speed_mean": (share * about).sum(axis=0),
        "speed_square": (share * about**2).sum(axis=0),
        "speed_angle": (share * about * np.where(count > 0, phi - angle, 0.0)).sum(axis=0),
        "still": still,
    }


def _still(smooth: FloatArray, spread: FloatArray, count: FloatArray, step: float) -> FloatArray:
    """Size of the mean of exp(2 pi i y / step) over the samples of each bin, (m,).

    Values without noise `smooth` (k, m), and their variance within each revolution's bin `spread`
    (k, m).
    """
    turning = (
        2.0j * np.pi * smooth / step - 2.0 * np.pi**2 * np.where(count > 0, spread, 0.0) / step**2
    )
    total = np.maximum(count.sum(axis=0), 1e-12)
    return np.asarray(np.abs((count * np.exp(turning)).sum(axis=0)) / total, dtype=np.float64)


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


def _one_number(values: FloatArray) -> PieceRow:
    """The piece of a number per revolution (k, 1): its mean, and its scatter about a line."""
    good = np.isfinite(values)
    mean = np.nanmean(values, axis=0) if good.any() else np.full(1, np.nan)
    scatter = np.array([scatter_about_line(values[good])])
    about = np.zeros((len(values), 3))
    about[:, 2] = np.nan_to_num(values[:, 0] - mean)
    names = "phi phi_variance shift residual_ss freedom speed_mean speed_square speed_angle still"
    return dict.fromkeys(names.split(), np.zeros(1)) | {
        "values": mean,
        "count": good.sum(axis=0).astype(float),
        "random": np.zeros((1, 3)),
        "coefficients": about,
        "scatter": scatter,
    }


# ---- The pieces of all logs under two limits: `LOG_PIECES` of each log, `MOST_PIECES` of all.
#
# What works on them takes the same time and memory however long and many the logs are.
#
#     Stacks of one log, each in its turn in memory
#     more than `LOG_PIECES` of them: manoeuvres, evenly over the speeds of each regime, and of
#         conditions that few of them have
#         --pieces_of--> their pieces under each other
#     the pieces of several logs, more than `MOST_PIECES` together
#         --share_out--> each log's share of them, evenly over its speeds
#
# Manoeuvres are left out whole: they are what repeats, and what stays of them scatters as it did.
# To
# average several as one instead would take the scatter between them for the model's error: with
# loads
# that scatter by 1 %, three as one raised reduced chi-square from 1.0 to 2.0. `notes` of the pieces
# say what was left out; `cell` knows of each revolution its piece, or the one nearest in speed.
#
# `diagnose` of logs does both steps at once; a campaign's workers do the first and its models the
# second, with the same numbers.


#: pieces of one log (ten minutes of mixed driving): its sixty manoeuvres tell by sign flips what a
#: verdict asks for, and what it calls too small to matter does not shrink with more of them.
#: Twice as many take up to twice the time, and tell strengths to 0.7 of their errors
LOG_PIECES = 160
#: pieces that all logs together may have, in `diagnose` as in campaigns: a diagnosis takes 0.35 MB
#: for each beside 240 MB, so it stays below 1 GB, and twice as many would take 1.5 GB
MOST_PIECES = 1800
#: pieces that a log gives at least; if there are so many logs that they have no room, only some of
#: the logs, evenly; with twice as many, half as many logs have a part
LEAST_SHARE = 2


def pieces_of_logs(stacks: Sequence[Stack], most: int = MOST_PIECES) -> Pieces:
    """The pieces of all logs of the stacks, at most `most`, for which several share the room."""
    outline = outlines(stacks)
    logs = np.unique(np.concatenate([stack.log for stack in outline]))
    share, most = min(most, LOG_PIECES), room(outline[0].phi_rad.size, most)
    chosen = logs[chosen_logs(logs.size, most)]
    pieces = pieces_of_all(stacks, share, chosen)
    of_log = [np.flatnonzero(pieces.log == log) for log in chosen]
    each = zip(of_log, share_out([rows.size for rows in of_log], most), strict=True)
    speed = pieces.conditions.speed_m_s
    kept = np.concatenate(
        [rows[evenly_over(speed[rows], n, turn)] for turn, (rows, n) in enumerate(each)]
    )
    said = left_out(kept.size, len(pieces), chosen.size, logs.size)
    number = np.full(len(pieces) + 1, -1)  # the last is that of no piece
    number[kept] = np.arange(kept.size)
    some = replace(pieces.take(kept), notes=(*pieces.notes, *said))
    return replace(some, cell=_nearest_cells(some, number[pieces.cell], joined(outline)))


def room(angles: int, most: int = MOST_PIECES) -> int:
    """The number of pieces that there is room for.

    `most` waveforms; numbers per revolution take next to none.
    """
    return most if angles > 1 else most * ANGLES


def chosen_logs(logs: int, most: int = MOST_PIECES) -> list[int]:
    """The logs that give pieces: all, or evenly some of them if they have no room."""
    return sorted(
        {int(i) for i in np.linspace(0, logs - 1, min(logs, max(most // LEAST_SHARE, 1))).round()}
    )


def share_out(sizes: Sequence[int], most: int = MOST_PIECES) -> list[int]:
    """How many pieces each log gives, of `sizes` that they have.

    Short logs give all of theirs, longer ones equally many, `most` together.
    """
    highest = max(sizes, default=0)
    while highest > LEAST_SHARE and sum(min(size, highest) for size in sizes) > most:
        highest -= 1
    return [min(size, highest) for size in sizes]


def left_out(used: int, of: int, logs_used: int, logs: int) -> tuple[str, ...]:
    """The sentence on what many logs have no room for, if anything."""
    if used == of and logs_used == logs:
        return ()
    return (
        f"{used} of {of} means of similar revolutions are used, spread over the speeds of "
        f"{logs_used} of {logs} logs; more have no room",
    )


def pieces_of_all(
    stacks: Sequence[Stack], most: int = LOG_PIECES, logs: IntArray | None = None
) -> Pieces:
    """The pieces of stacks that are numbered through, about `most` of each log at most.

    Of some `logs` alone, if they are given. Stacks of which no manoeuvre is used are not read.
    """
    outline = outlines(stacks)
    whole = joined(outline)
    pieces = np.zeros(int(whole.manoeuvre.max()) + 1, np.int64)  # of each manoeuvre
    for stack in outline:
        own = np.unique(np.stack([stack.manoeuvre, assign_pieces(stack)]), axis=1)[0]
        pieces += np.bincount(own, minlength=pieces.size)
    kept, some = _kept_manoeuvres(whole, pieces, room(whole.phi_rad.size, most), logs)
    used = [np.flatnonzero(np.isin(stack.manoeuvre, kept)) for stack in outline]
    read = [i for i, rows in enumerate(used) if rows.size]

    def part_of(number: int) -> Pieces:
        stack, rows = stacks[read[number]], used[read[number]]
        return pieces_of(stack if rows.size == len(stack) else stack.take(rows))

    parts: list[Pieces] = []
    cells = [np.full(len(stack), -1) for stack in outline]
    for i, part in zip(read, shared_out(len(read), part_of), strict=True):
        cells[i][used[i]] = part.cell + sum(len(one) for one in parts)
        parts.append(part)
    made = concatenated_pieces(parts)
    notes = (
        f"{made.logs[number]}: {used} of {of} manoeuvres are used, spread over the speeds of "
        "each regime; errors are those of what is used"
        for number, (used, of) in some.items()
    )
    return replace(
        made,
        cell=_nearest_cells(made, np.concatenate(cells), whole),
        notes=(*getattr(stacks, "notes", ()), *notes),
    )


def _nearest_cells(pieces: Pieces, cell: IntArray, whole: Stack) -> IntArray:
    """The piece of each revolution, (n,): its own or, of none (-1), the nearest in speed.

    Of its log; -1 if the log gives no piece.
    """
    speed = whole.conditions.speed_m_s
    for number in np.unique(whole.log[cell < 0]):
        rows, there = (cell < 0) & (whole.log == number), np.flatnonzero(pieces.log == number)
        if there.size:
            there = there[np.argsort(pieces.conditions.speed_m_s[there], kind="stable")]
            among = pieces.conditions.speed_m_s[there]
            cell[rows] = there[np.searchsorted(0.5 * (among[1:] + among[:-1]), speed[rows])]
    return cell


def _kept_manoeuvres(
    whole: Stack, pieces: IntArray, most: int, logs: IntArray | None
) -> tuple[IntArray, dict[int, tuple[int, int]]]:
    """The manoeuvres that are used, ascending; of logs with others: how many, and of how many.

    About `most` pieces of a log, shared out over its regimes, and in these over manoeuvres under
    conditions that few others have; of each kind its manoeuvres evenly by their mean speed.
    `pieces` of each manoeuvre by its number.
    """
    names, first, which = np.unique(whole.manoeuvre, return_index=True, return_inverse=True)
    log, pieces = whole.log[first], pieces[names]
    mean = {
        name: np.bincount(which, getattr(whole.conditions, name)) / np.bincount(which)
        for name in Conditions.__dataclass_fields__
        if name != "acceleration_m_s2"  # with the speed it makes the regimes
    }
    speed = mean.pop("speed_m_s")
    logs = np.unique(log) if logs is None else logs
    kept, used = np.isin(log, logs), dict[int, tuple[int, int]]()
    for number in logs:
        of_log = np.flatnonzero(log == number)
        if pieces[of_log].sum() <= most:
            continue
        rare = np.array([_rare(x[of_log]) for x in mean.values()])
        regimes = np.unique(whole.regime[first[of_log]], return_inverse=True)[1]
        label = np.unique(np.vstack([regimes, rare]), axis=1, return_inverse=True)[1].ravel()
        kinds = [of_log[label == kind] for kind in np.unique(label)]
        shares = share_out([int(pieces[kind].sum()) for kind in kinds], most)
        for kind, share in zip(kinds, shares, strict=True):
            kept[kind] = False
            kept[_spread(kind[np.argsort(speed[kind], kind="stable")], pieces, share)] = True
        used[int(number)] = int(kept[of_log].sum()), of_log.size
    return names[kept], used


def _rare(mean: FloatArray) -> NDArray[np.bool_]:
    """Manoeuvres (n,) on the side of a condition's range that few are on; none if it is not known.

    A wet lap in a dry hour tells what the dry ones cannot.
    """
    known: NDArray[np.bool_] = np.isfinite(mean)
    if not known.any():
        return known
    high: NDArray[np.bool_] = known & (mean > 0.5 * (mean[known].min() + mean[known].max()))
    for side in (high, known & ~high):
        # a side of a condition's range with less than this share of the manoeuvres has a share of
        # its own; twice as much shares out halves, which are used alike without
        if np.count_nonzero(side) < 0.25 * np.count_nonzero(known):
            return side
    return np.zeros(mean.size, np.bool_)


def _spread(of_kind: IntArray, pieces: IntArray, most: int) -> IntArray:
    """Evenly some of the manoeuvres `of_kind`, with `most` pieces together, or one of them."""
    for count in range(of_kind.size, 1, -1):
        place = ((np.arange(count) + 0.5) / count * of_kind.size).astype(np.int64)
        if pieces[of_kind[place]].sum() <= most:
            return of_kind[place]
    return of_kind[of_kind.size // 2 : of_kind.size // 2 + 1]
