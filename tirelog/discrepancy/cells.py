"""Means of like revolutions: what every later step works on.

    Stack (n, m)  ->  cell (n,): one manoeuvre, a band of speed  ->  Cells (C, m)

Within a cell each revolution is   y = P(phi) + baseline + amplitude P + width phi P' - shift P' + noise   with P the cell's mean
waveform at the
revolution's real angles.  The four coefficients are taken out, the rest averaged; they come back as random effects of the cell's mean
(their covariance over revolutions, neighbours' correlation included, over the number of revolutions), the shift as a free nuisance.
With one angle only the mean is taken.  Amplitude and width are relative: a load that scatters moves both.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from tirelog.recording import Conditions, Stack

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: width [m/s] of a cell's band of speed, fewest revolutions in it, most bands in a manoeuvre
BAND_M_S = 1.6
FEWEST = 3
MOST_BANDS = 6
_ROUNDS = 2


@dataclass(frozen=True)
class Cells:
    """C cells x m angles; rows in the order of log, manoeuvre, time.

    values, phi, phi_variance (C, m)  mean waveform, at the mean angle and variance of its samples; NaN where no sample fell
    sd             (C, m)  standard error of the mean from independent noise; inf where empty
    random         (C, m, 3)  columns of the random effects, all relative: amplitude (P), width (phi P'), baseline (rms of P)
    random_cov     (C, 3, 3)  covariance of their means
    shift          (C, m)  P', the free nuisance (zero with one angle)
    revolutions    (C,)  in the cell;  conditions: means;  log, manoeuvre (C,) integers, manoeuvre 0 ... M-1;  regime (C,)
    within         (C, m) mean square of single revolutions about their cell, shift taken out, noise and random effects in it
    speed_mean, speed_square (C, m)  mean and mean square of a bin's samples' speed about the cell's mean speed [m/s], [m^2/s^2]
    moved          (C,)  by how much `phi` was moved to the model's patch centre [rad] (a fit does that)
    cell           (n,) the cell of each revolution of the stack
    """

    observable: str
    surface: str
    radius_m: float
    values: FloatArray
    phi: FloatArray
    phi_variance: FloatArray
    sd: FloatArray
    random: FloatArray
    random_cov: FloatArray
    shift: FloatArray
    revolutions: IntArray
    conditions: Conditions
    log: IntArray
    manoeuvre: IntArray
    regime: NDArray[np.str_]
    within: FloatArray
    speed_mean: FloatArray
    speed_square: FloatArray
    moved: FloatArray
    cell: IntArray
    logs: tuple[str, ...]

    @property
    def angles(self) -> dict[str, Any]:
        """Where a model is asked to predict: the arguments of `Model.predict`."""
        return {"phi_rad": self.phi, "phi_variance": self.phi_variance} if self.phi.shape[1] > 1 else {"phi_rad": None}

    @property
    def manoeuvres(self) -> int:
        return int(self.manoeuvre.max()) + 1 if self.manoeuvre.size else 0

    def __len__(self) -> int:
        return int(self.values.shape[0])


def assign(stack: Stack) -> IntArray:
    """The cell of each revolution, (n,): bands of speed inside each manoeuvre."""
    cell = np.empty(len(stack), np.int64)
    first = 0
    for manoeuvre in np.unique(stack.manoeuvre):
        rows = np.flatnonzero(stack.manoeuvre == manoeuvre)
        speed = stack.conditions.speed_m_s[rows]
        low, spread = speed.min(), np.ptp(speed)
        bands = int(np.clip(np.ceil(spread / BAND_M_S), 1, max(1, min(MOST_BANDS, rows.size // FEWEST))))
        band = np.minimum(((speed - low) / max(spread, 1e-9) * bands).astype(int), bands - 1)
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


def make_cells(stack: Stack) -> Cells:
    """The cells of a stack."""
    cell = assign(stack)
    C, m = int(cell.max()) + 1, stack.phi_rad.size
    parts = [_one_waveform(stack, np.flatnonzero(cell == c)) if m > 1 else _one_number(stack, np.flatnonzero(cell == c)) for c in range(C)]
    noise = _noise_profile(parts, m)
    covariance = _coefficient_covariance(parts)
    number = np.array([part.rows.size for part in parts])
    random = np.stack([part.random for part in parts])
    spread = np.einsum("cmi,ij,cmj->cm", random, covariance[0], random) if m > 1 else 0.0
    sample = np.stack([part.count for part in parts])
    per_revolution = np.maximum(sample / number[:, None], 1e-9)
    with np.errstate(divide="ignore"):
        sd = np.sqrt(noise[None, :] / sample) if m > 1 else np.stack([part.scatter for part in parts]) / np.sqrt(number)[:, None]
    where = np.array([part.rows[0] for part in parts])
    return Cells(
        observable=stack.observable,
        surface=stack.surface,
        radius_m=stack.radius_m,
        values=np.stack([part.mean for part in parts]),
        phi=np.stack([part.phi for part in parts]),
        phi_variance=np.stack([part.variance for part in parts]),
        sd=np.where(sample > 0, sd, np.inf),
        random=random,
        random_cov=covariance[1][None] / number[:, None, None],
        shift=np.stack([part.shift for part in parts]),
        revolutions=number,
        conditions=_mean_conditions(stack.conditions, cell, C),
        log=stack.log[where],
        manoeuvre=np.unique(stack.manoeuvre[where], return_inverse=True)[1],
        regime=stack.regime[where],
        within=(noise[None, :] / per_revolution + spread) if m > 1 else (sd**2 * number[:, None]),
        speed_mean=np.stack([part.speed_mean for part in parts]),
        speed_square=np.stack([part.speed_square for part in parts]),
        moved=np.zeros(C),
        cell=cell,
        logs=stack.logs,
    )


@dataclass
class _Part:
    """One cell's means and what single revolutions did about them."""

    rows: IntArray
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


def _curve(phi: FloatArray, values: FloatArray) -> CubicSpline:
    """Periodic spline through a cell's non-empty bins."""
    full = np.isfinite(values)
    x, y = phi[full], values[full]
    return CubicSpline(np.append(x, x[0] + 2.0 * np.pi), np.append(y, y[0]), bc_type="periodic")


def _bin_means(values: FloatArray, phi: FloatArray, variance: FloatArray, count: FloatArray) -> tuple[FloatArray, ...]:
    """Mean value, mean angle, angle variance and number of samples of each bin over revolutions (k, m) -> (m,)."""
    total = count.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(count > 0, values, 0.0).T
        mean = np.einsum("mk,km->m", mean, count) / total
        angle = np.einsum("km,km->m", np.where(count > 0, phi, 0.0), count) / total
        second = np.where(count > 0, variance + (phi - angle) ** 2, 0.0)
        return mean, angle, np.einsum("km,km->m", second, count) / total, total


def _one_waveform(stack: Stack, rows: IntArray) -> _Part:
    """The cell made of the revolutions `rows`."""
    values, phi, variance = stack.values[rows], stack.phi_mean[rows], stack.phi_variance[rows]
    count = np.where(np.isfinite(values), stack.count[rows], 0).astype(float)
    coefficients = np.zeros((rows.size, 4))
    corrected = values
    for _ in range(_ROUNDS):
        mean, angle, spread, total = _bin_means(corrected, phi, variance, count)
        curve = _curve(angle, mean)
        columns = _columns(curve, np.where(count > 0, phi, 0.0))
        expected = columns[..., 0] + 0.5 * variance * curve(np.where(count > 0, phi, 0.0), 2)
        excess = np.where(count > 0, values - expected, 0.0)
        gram = np.einsum("kmi,km,kmj->kij", columns, count, columns)
        right = np.einsum("kmi,km->ki", columns, excess * count)
        coefficients = np.linalg.solve(gram + 1e-12 * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(4), right[..., None])[..., 0]
        coefficients -= coefficients.mean(axis=0)
        taken = np.einsum("kmi,ki->km", columns, coefficients)
        corrected = np.where(count > 0, values - taken, np.nan)
    mean, angle, spread, total = _bin_means(corrected, phi, variance, count)
    residual = np.where(count > 0, excess - taken, 0.0)
    residual_ss, freedom = _scatter(residual, count, stack.conditions.speed_m_s[rows])
    own = _columns(curve, np.where(total > 0, angle, 0.0))
    speed = stack.conditions.speed_m_s[rows]
    about = (speed - speed.mean())[:, None]
    share = count / np.maximum(total, 1e-12)
    return _Part(
        rows,
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
    )


def _columns(curve: CubicSpline, phi: FloatArray) -> FloatArray:
    """P, phi P', -P' and the rms of P at angles (..., ) -> (..., 4); the width about the patch only, where P' is."""
    slope = curve(phi, 1)
    size = float(np.sqrt(np.mean(curve(curve.x) ** 2)))
    return np.stack([curve(phi), phi * slope * np.exp(-((phi / 0.6) ** 2)), -slope, np.full_like(phi, size)], axis=-1)


def _scatter(residual: FloatArray, count: FloatArray, speed: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Per bin: sum of count x residual^2 after the mean and, with enough revolutions, the trend in speed; degrees of freedom.  (m,)
    each."""
    k = residual.shape[0]
    present = (count > 0).sum(axis=0)
    total = np.maximum(count.sum(axis=0), 1e-12)
    centred = residual - (residual * count).sum(axis=0) / total
    lost = 1.0 + 4.0 * k / residual.shape[1]
    if k >= 5 and np.ptp(speed) > 1e-6:
        dv = speed[:, None] - (count * speed[:, None]).sum(axis=0) / total
        slope = (count * dv * centred).sum(axis=0) / np.maximum((count * dv**2).sum(axis=0), 1e-12)
        centred = centred - slope * dv
        lost += 1.0
    return (count * np.where(count > 0, centred, 0.0) ** 2).sum(axis=0), np.maximum(present - lost, 0.0)


def _one_number(stack: Stack, rows: IntArray) -> _Part:
    """A cell of a number per revolution, m = 1: its mean and scatter."""
    values = stack.values[rows]
    good = np.isfinite(values)
    mean = np.nanmean(values, axis=0) if good.any() else np.full(1, np.nan)
    scatter = np.nanstd(values, axis=0, ddof=1) if good.sum() > 2 else np.full(1, np.nan)
    zero = np.zeros(1)
    return _Part(
        rows, mean, zero, zero, good.sum(axis=0).astype(float), np.zeros((1, 3)), zero, np.zeros((rows.size, 3)), zero, zero, scatter,
        zero, zero,
    )  # fmt: skip


def _noise_profile(parts: list[_Part], m: int) -> FloatArray:
    """Variance of one sample by angle (m,), pooled over cells and smoothed over neighbouring bins."""
    if m == 1:
        scatters = np.concatenate([part.scatter for part in parts])
        pooled = np.nanmedian(scatters) if np.isfinite(scatters).any() else np.nan
        for part in parts:
            part.scatter = np.where(np.isfinite(part.scatter) & (part.scatter > 0.3 * pooled), part.scatter, pooled)
        return np.full(1, pooled**2)
    ss, freedom = (np.sum([getattr(part, name) for part in parts], axis=0) for name in ("residual_ss", "freedom"))
    half = max(1, m // 64)
    kernel = np.ones(2 * half + 1)
    wrapped: Callable[[FloatArray], FloatArray] = lambda x: np.convolve(np.r_[x[-half:], x, x[:half]], kernel, mode="valid")  # noqa: E731
    profile = wrapped(ss) / np.maximum(wrapped(freedom), 1e-9)
    floor = 1e-3 * np.median(profile) + 1e-30
    return np.maximum(profile, floor)


def _coefficient_covariance(parts: list[_Part]) -> tuple[FloatArray, FloatArray]:
    """Covariance (3, 3) of single revolutions' coefficients, and that of a long mean (with neighbours' correlation), both over revolutions.

    Each cell's coefficients are taken about their trend in the order of driving: what follows speed is not scatter.
    """
    zero, one, freedom, pairs = np.zeros((3, 3)), np.zeros((3, 3)), 0.0, 0
    for part in parts:
        k = part.rows.size
        x = np.linspace(-1.0, 1.0, k)[:, None] if k > 1 else np.zeros((1, 1))
        design = np.hstack([np.ones((k, 1)), x]) if k >= 4 else np.ones((k, 1))
        c = part.coefficients - design @ np.linalg.lstsq(design, part.coefficients, rcond=None)[0]
        zero += c.T @ c
        one += 0.5 * (c[1:].T @ c[:-1] + c[:-1].T @ c[1:])
        freedom += k - design.shape[1]
        pairs += k - 1
    single = zero / max(freedom, 1.0)
    together = single + 2.0 * one / max(pairs, 1)
    values, vectors = np.linalg.eigh(0.5 * (together + together.T))
    scale = np.trace(single) + 1e-300
    return single, (vectors * np.maximum(values, 1e-6 * scale)) @ vectors.T


def _mean_conditions(conditions: Conditions, cell: IntArray, C: int) -> Conditions:
    """Means over each cell."""
    number = np.bincount(cell, minlength=C)
    return Conditions(**{name: np.bincount(cell, getattr(conditions, name), C) / number for name in Conditions.__dataclass_fields__})
