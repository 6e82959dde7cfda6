"""What belongs to speed, load and delay rather than to forces.

Learnt from quasi-static and dynamic logs (P4 section IV C, (1)-(3)).

    Passages of several logs
        --quasi-static passages, one constant per log--> SpeedMap of phase shift and patch
                                                       width
        --drive phases of undriven wheels--> cross-talk k
        --force channels--> ForceMap    =: Calibration
    Passages, Calibration --clean--> detrended and corrected regressors (`table` makes rows of them)

A speed map is the change against the reference speed, c1 (v - v0) + c2 (v - v0)^2, v0 the speed of
the zeros. The errors are those of the least squares, widened by the scatter of the residuals and by
their correlation from passage to passage.

A telemetry delay is a phase shift in proportion to speed. So is the linear part of a car's drag, f0
+ f1 v + f2 v^2: no regression on speed parts them. A delay does not bend, drag does. So of the
linear part of the map as much is drag's as its bend says with f1 / f2 under a prior (DRAG_M_S);
what the prior leaves open is in the error of the delay. A force that differs between driving and
coasting bends the map too. If the longitudinal force is measured it enters the regression, and the
map is that at unchanged force; else the acceleration replaces it, on its own for driving and for
coasting, and drag stays in the map.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from tirelog.data.recording import Recording
from tirelog.errors import SetupError, UsageError
from tirelog.storage.schema import (
    FLAG,
    Document,
    FilePlace,
    Record,
    Table,
    ValueKind,
    kinds_of,
    number,
    numbers,
    table_of,
)
from tirelog.storage.whole import toml_text, whole_file
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.quality import Quality, marked, quality_column
from tirelog.wheel.phase_shift import EdgeTimes, measure_phase_shift

# ---- What a calibration's file may hold: a foreign one does no harm.

#: numbers of a file, none of them huge
_ROW = numbers(-1e15, 1e15)


def _is_covariance(value: Any) -> bool:
    """Whether a value is a square array of finite numbers without negative variances."""
    size = len(value) if isinstance(value, list) else 0
    if size < 2 or not all(_ROW.fits(row) and len(row) == size for row in value):
        return False
    array = np.array(value, dtype=float)
    least = -1e-9 * max(float(abs(array).max()), 1e-300)
    return bool(np.linalg.eigvalsh(0.5 * (array + array.T)).min() >= least)


_COVARIANCE = ValueKind(
    "a covariance of finite numbers: symmetric, no negative variances",
    _is_covariance,
    partial(np.array, dtype=float),
)
_SLOPE, _BOUND, _SMALL, _ANGLE = (
    number(low, high) for low, high in ((-1e3, 1e3), (-1e4, 1e4), (0.0, 1e3), (0.0, 360.0))
)

# ---- Force maps: F_z = f_z(patch width), F_x = f_x(phase shift) (P4 section III).
#
# For logs that have force channels.
#
# regressors and measured forces of several logs
#     --least squares, degree by cross-validation--> ForceMap --> force and its error


class ForceMap(Record):
    """Force as a polynomial in (regressor - centre_deg), lowest power first.

    `covariance` of the coefficients; valid from `low_deg` to `high_deg`; `rms_N` the residual on
    held-out parts of the logs, which holds what the regressor does not know.
    """

    keys: ClassVar = {
        "centre_deg": (_BOUND, None),
        "coefficients_N": (
            ValueKind(
                "two or three finite numbers",
                lambda value: _ROW.fits(value) and len(value) in (2, 3),
                partial(np.array, dtype=float),
            ),
            None,
        ),
        "covariance": (_COVARIANCE, None),
        "low_deg": (_BOUND, None),
        "high_deg": (_BOUND, None),
        "rms_N": (number(0.0, 1e7), None),
    }


def fit_force(
    logs: Sequence[EdgeTimes], regressors: Sequence[FloatArray], kind: str
) -> ForceMap | None:
    """The map of one force; None if the logs have no such channel, or too few passages."""
    parts = [np.zeros((2, 0))]
    for p, x in zip(logs, regressors, strict=True):
        if kind in p.forces_N:
            part = np.stack([x, p.forces_N[kind]])
            parts.append(part[:, p.good & np.isfinite(part).all(axis=0)])
    x, y = np.concatenate(parts, axis=1)
    # passages that a map needs, and contiguous parts that are left out in turn: each part is judged
    # by a map of the other four fifths; twice as many refuse short drives; in twice as many parts a
    # part tells less
    least, folds = 40, 5
    if x.size < least:
        return None
    centre = float(np.mean(x))
    fold = np.arange(x.size) * folds * 4 // x.size % folds
    designs = [np.vander(x - centre, degree + 1, increasing=True) for degree in (1, 2)]
    held = np.empty((2, x.size))
    for design, left in zip(designs, held, strict=True):
        for k in range(folds):
            out = fold == k
            solved = np.linalg.lstsq(design[~out], y[~out], rcond=None)[0]
            left[out] = y[out] - design[out] @ solved
    errors = np.sqrt(np.mean(held**2, axis=1))
    bent = int(errors[1] < 0.98 * errors[0])
    # the scatter is above a thousandth of a newton, and tells the errors
    se = np.full(x.size, 1e-3)
    solved, covariance, _ = least_squares(designs[bent], y, se, wild=np.inf)
    return ForceMap(centre, solved, covariance, float(x.min()), float(x.max()), float(errors[bent]))


def predict_force(
    force: ForceMap, x: FloatArray, x_se: FloatArray
) -> tuple[FloatArray, FloatArray, np.ndarray]:
    """(force, standard error, outside of the map's range), shape (n,).

    The error is that of a single passage: the map's, and what held-out passages scattered, which
    holds the regressor's usual noise; more if the passage is noisier than its range allows.
    """
    degree = force.coefficients_N.size - 1
    design = np.vander(np.nan_to_num(x) - force.centre_deg, degree + 1, increasing=True)
    value = np.where(np.isfinite(x), design @ force.coefficients_N, np.nan)
    slope = design[:, :-1] @ (force.coefficients_N[1:] * np.arange(1, degree + 1))
    own = np.einsum("ni,ij,nj->n", design, force.covariance, design)
    se = np.sqrt(own + np.maximum(force.rms_N**2, (slope * x_se) ** 2))
    with np.errstate(invalid="ignore"):
        margin = 0.05 * (force.high_deg - force.low_deg)
        outside = (x < force.low_deg - margin) | (x > force.high_deg + margin)
    return value, np.where(np.isfinite(x), se, np.nan), outside


#: below this the car's acceleration [m/s^2] counts as quasi-static: a force of
#: 6 % of the weight at most; doubled, 12 %
QUASI_STATIC_M_S2 = 0.6
#: a drive whose acceleration [m/s^2] ranges over more has a force by which its maps may bend: at
#: half of it a car's force is below 25 N a wheel; twice as much leaves 50 N in the maps
SLOW_M_S2 = 0.03
#: f1 / f2 [m/s] of a car's drag f0 + f1 v + f2 v^2, and its standard deviation: coast-down tests of
#: passenger cars give 0 to 11 m/s (f1 = 2.76 - 71.7 f2 in N and km/h, the regression by which
#: CO2MPAS completes them, for f2 of 0.025 to 0.038), and a gearbox adds to f1. Twice the deviation
#: doubles the error of a delay beside a trend that bends, and leaves that of one beside none
DRAG_M_S, DRAG_SD_M_S = 6.0, 6.0
#: the channel by which a shift's map is freed of what is force
FORCE = "longitudinal_force"


class SpeedMap(Record):
    """Change of a quantity [deg] with speed against the reference.

    `covariance` (2, 2) of the two coefficients, valid from `low_m_s` to `high_m_s`; `rms_deg` the
    residuals' standard deviation, `passages` their number.
    """

    keys: ClassVar = {
        "linear_deg_s_m": (_SLOPE, None),
        "quadratic_deg_s2_m2": (_SLOPE, None),
        "covariance": (_COVARIANCE, None),
        "low_m_s": (_BOUND, None),
        "high_m_s": (_BOUND, None),
        "rms_deg": (_ANGLE, None),
        "passages": (replace(number(0, 1e12), made=int), None),
    }

    def __call__(self, speed_m_s: FloatArray, reference_m_s: float) -> FloatArray:
        dv = speed_m_s - reference_m_s
        return np.asarray(self.linear_deg_s_m * dv + self.quadratic_deg_s2_m2 * dv**2)


@dataclass(frozen=True)
class Calibration:
    """A calibration.

    `reference_speed_m_s` is where the phase shift is zero by convention; `patch_width_deg` the mean
    width there; `crosstalk` k of P4 (3) with `crosstalk_se`; `delay_s` the constant lag of the
    accelerometer behind the encoder, with an error that holds how much of the shift's linear trend
    may be drag's; NaN or None if the logs did not show it. `beside_force` is True if the shift's
    map was learnt beside the measured longitudinal force.
    """

    reference_speed_m_s: float
    shift: SpeedMap
    width: SpeedMap
    patch_width_deg: float
    crosstalk: float
    crosstalk_se: float
    delay_s: float
    delay_se_s: float
    vertical: ForceMap | None = None
    longitudinal: ForceMap | None = None
    beside_force: bool = False

    @property
    def has_delay(self) -> bool:
        """Whether there is a constant telemetry delay beyond its error."""
        # a delay that is more than so many standard errors long is one; with twice as many, delays
        # up to twice as long are not seen
        return bool(np.isfinite(self.delay_s) and abs(self.delay_s) > 3.0 * self.delay_se_s)

    @property
    def force_column(self) -> str:
        """The column of `clean_passages` that the longitudinal force follows."""
        return "corrected_deg" if np.isfinite(self.crosstalk) else "shift_deg"

    @property
    def delay_remark(self) -> str:
        """What the rows' word `delay_removed` means, and what looks the same as a delay."""
        force = (
            "the measured longitudinal force is not in it"
            if self.beside_force
            else "a longitudinal_force channel in every log would make it smaller"
        )
        return (
            f"the accelerometer is {1e3 * self.delay_s:.3f} +- {1e3 * self.delay_se_s:.3f} ms "
            "later than the encoder (telemetry delay); the error holds a drag whose linear "
            f"coefficient is {DRAG_M_S:g} +- {DRAG_SD_M_S:g} m/s times its quadratic one; "
            f"{force}; any other trend linear in speed counts as delay; the speed map removes all "
            "of it (delay_removed)"
        )

    @property
    def remarks(self) -> tuple[str, ...]:
        """What was learnt, and what could not be."""
        said = [self.delay_remark] if self.has_delay else []
        if np.isnan(self.crosstalk):
            said.append(
                "no drive phase of an undriven wheel ([conditions] driven = false): no cross-talk, "
                "the corrected column is empty"
            )
        else:
            said.append(f"cross-talk k = {self.crosstalk:.4f} +- {self.crosstalk_se:.4f}")
        for name, force in (("vertical", self.vertical), ("longitudinal", self.longitudinal)):
            if force is not None:
                said.append(f"{name} force: {force.rms_N:.0f} N rms on held-out parts of the logs")
        return tuple(said)


def calibrate(logs: Sequence[EdgeTimes], forces: bool = False) -> Calibration:
    """The calibration from all logs.

    UsageError: too few quasi-static passages, too narrow a range of speed, or a third of it empty.
    """
    zeros = [p.zero_speed_m_s for p in logs if np.isfinite(p.zero_speed_m_s)]
    if not zeros:
        raise UsageError(
            "no log has a zero stretch",
            allowed="a calibration refers to one",
            do="add a log with a low, constant speed, or give --zero",
        )
    reference = float(np.mean(zeros))
    shift = _speed_map(logs, "shift", reference)
    width = _speed_map(logs, "width", reference)
    levels = [
        float(np.nanmean((p.width_deg - width(p.speed_m_s, reference))[quasi_static(p)]))
        for p in logs
        if quasi_static(p).any()
    ]
    level = _speed_map(logs, "shift", reference, coasting=True)
    delay, delay_se = _delay(level, reference, float(np.median([p.radius_m for p in logs])))
    whole = Calibration(
        reference, shift, width, float(np.mean(levels)), np.nan, np.nan, delay, delay_se,
        beside_force=_force_of_all(logs),
    )  # fmt: skip
    k, k_se = _crosstalk(logs, whole)
    whole = replace(whole, crosstalk=k, crosstalk_se=k_se)
    return _with_forces(logs, whole) if forces else whole


def quasi_static(p: EdgeTimes) -> np.ndarray:
    """The passages, shape (n,), with nothing wrong at which the car hardly accelerates."""
    with np.errstate(invalid="ignore"):
        return p.good & (np.abs(p.acceleration_m_s2) < QUASI_STATIC_M_S2) & np.isfinite(p.speed_m_s)


def _force_of_all(logs: Sequence[EdgeTimes]) -> bool:
    """Whether every log that a map is learnt on has its longitudinal force measured.

    At most of its passages.
    """
    used = [p for p in logs if quasi_static(p).any()]
    # share of a log's quasi-static passages at which it has to be known, to be used; the others are
    # then left out of the map; nearer to one, a log with a gap in its force is mapped without any
    return bool(used) and all(
        FORCE in p.forces_N and np.mean(np.isfinite(p.forces_N[FORCE][quasi_static(p)])) > 0.8
        for p in used
    )


def _speed_map(
    logs: Sequence[EdgeTimes], what: str, reference: float, coasting: bool = False
) -> SpeedMap:
    """The speed map of `what` by weighted least squares over the logs.

    One constant per log, (v - v0), (v - v0)^2 and what little force a quasi-static drive has, as
    nuisances.

    That force is the measured longitudinal force for the shift if all logs have it. Else it is the
    acceleration, for the shift each sign on its own, since a wheel that drives does not mirror one
    that coasts. All of it would else bend the map, also of a log that only coasts down. What of the
    map is the drag that a driven wheel carries stays in it, except in that of `coasting`.
    """
    by_force = what == "shift" and _force_of_all(logs)
    parts = []
    for log, p in enumerate(logs):
        values, se = getattr(p, f"{what}_deg"), getattr(p, f"{what}_se_deg")
        rows = quasi_static(p) & np.isfinite(values)
        force = p.forces_N[FORCE] if by_force and rows.any() else np.zeros(values.size)
        part = np.zeros((7, values.size))
        part[:5] = values, se, p.speed_m_s, p.acceleration_m_s2, force
        part[5], part[6] = log, p.driven is not False
        parts.append(part[:, rows & np.isfinite(force)])
    y, se, v, a, force, group, driven = np.concatenate(parts, axis=1)
    thirds = np.histogram(v, 3)[0]  # of the range of speed: without one no curve is known
    # passages and range of speed [m/s] that a map needs: the mean of so many is known to a fifth of
    # one's scatter, a slope to as much per m/s; half the passages make it 1.4 times that, half the
    # range twice
    least_passages, least_range_m_s = 30, 3.0
    if y.size < least_passages or np.ptp(v) < least_range_m_s or not thirds.all():
        found = (
            f"{y.size} passages over {np.ptp(v) if v.size else 0.0:.1f} m/s, {thirds[1]} of them "
            "in the middle third,"
        )
        raise UsageError(
            f"the logs have {found} below {QUASI_STATIC_M_S2} m/s^2",
            allowed=f"a speed map needs {least_passages} over {least_range_m_s} m/s and each third",
            do="add a slow drive-up or coast-down",
        )
    dv = v - reference
    columns = [(group == g).astype(float) for g in np.unique(group)] + [dv, dv**2]
    inertia = [a] if what == "width" else [np.maximum(a, 0.0), np.minimum(a, 0.0)]
    nuisances = [force - force.mean()] if by_force else []
    if what == "width" or not by_force:
        nuisances += [part for part in inertia if np.ptp(np.quantile(part, (0.1, 0.9))) > SLOW_M_S2]
    if coasting and not by_force:
        nuisances.append((v**2 - reference**2) * ((a > -SLOW_M_S2) & (driven > 0.0)))
    design = np.stack([*columns, *nuisances], axis=1)
    if coasting and not by_force:  # its size is known beforehand, as by one passage more
        known = np.eye(design.shape[1])[-1:]
        # [deg/(m/s)^2] by which the air drag of a car winds up a driven wheel, as long as it does
        # not coast, and its deviation: f2 / 2 of 0.12 to 0.22 kg/m, 1.6e-4 to 6.5e-4 deg/N by
        # sidewalls of 1.5e5 to 6e5 N/m^2. Twice the deviation doubles its share in a delay's error
        design, y = np.vstack([design, known]), np.append(y, 7e-5)
        se = np.append(se, 5e-5)
    at = len(columns) - 2
    solved, covariance, residual = least_squares(design, y, se)
    return SpeedMap(
        float(solved[at]), float(solved[at + 1]), covariance[at : at + 2, at : at + 2],
        float(v.min()), float(v.max()), float(np.std(residual)), int(v.size),
    )  # fmt: skip


def least_squares(
    design: FloatArray, y: FloatArray, se: FloatArray, wild: float = 5.0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(solution, covariance, residuals) of weighted least squares.

    Values that lie off by more than `wild` times the usual residual are left out, the covariance
    is widened by scatter and correlation.
    """
    keep = np.isfinite(y) & np.isfinite(se) & (se > 0)
    scale = np.sqrt(np.mean(design**2, axis=0))
    scale[scale == 0] = 1.0
    x = design / scale
    for _ in range(3):
        weight = np.where(keep, 1 / np.where(se > 0, se, 1.0), 0.0)
        solved = np.linalg.lstsq(x * weight[:, None], y * weight, rcond=1e-10)[0]
        residual = y - x @ solved
        z = residual * weight
        spread = float(np.median(np.abs(z[keep]))) / 0.6745
        keep &= np.abs(z) < wild * max(spread, 1e-12)
    z = z[keep]
    chi2 = float(z @ z) / max(z.size - design.shape[1], 1)
    rho = float(np.clip(np.sum(z[1:] * z[:-1]) / max(float(z @ z), 1e-300), 0.0, 0.95))
    wide = max(chi2, 1.0) * (1 + rho) / (1 - rho)
    covariance = np.linalg.pinv((x * weight[:, None]).T @ (x * weight[:, None]), rcond=1e-12) * wide
    return solved / scale, covariance / np.outer(scale, scale), residual[keep]


def _delay(shift: SpeedMap, reference: float, radius: float) -> tuple[float, float]:
    """(delay, standard error) [s]: what of the shift is linear in speed, less drag's share of it.

    Drag's share is f1 / f2 times what is quadratic in speed; its error that of the map, and that of
    f1 / f2 times the quadratic part as far as the map knows it.
    """
    to_s = np.pi / 180 * radius
    gradient = np.array([1.0, -2 * reference - DRAG_M_S])
    late = gradient @ [shift.linear_deg_s_m, shift.quadratic_deg_s2_m2]
    bend = shift.quadratic_deg_s2_m2**2 + shift.covariance[1, 1]
    variance = gradient @ shift.covariance @ gradient + DRAG_SD_M_S**2 * bend
    return float(late) * to_s, float(np.sqrt(variance)) * to_s


def clean_passages(p: EdgeTimes, calibration: Calibration) -> dict[str, np.ndarray]:
    """Columns (n,): regressors [deg] without trend (P4 (1), (2)) and cross-talk (3).

    `width_deg`, `shift_deg` detrended with the maps, `corrected_deg` the shift by (3),
    `outside`: whether the speed is outside of the maps.
    """
    c = calibration
    zero = p.zero_speed_m_s if np.isfinite(p.zero_speed_m_s) else c.reference_speed_m_s
    shift = (
        p.shift_deg
        - c.shift(p.speed_m_s, c.reference_speed_m_s)
        + float(c.shift(np.array(zero), c.reference_speed_m_s))
    )
    width = p.width_deg - c.width(p.speed_m_s, c.reference_speed_m_s)
    calm = p.good & (p.steady >= 0)
    usual = float(np.mean(width[calm])) if calm.any() else c.patch_width_deg
    low, high = max(c.shift.low_m_s, c.width.low_m_s), min(c.shift.high_m_s, c.width.high_m_s)
    with np.errstate(invalid="ignore"):
        outside = (p.speed_m_s < low - 0.5) | (p.speed_m_s > high + 0.5)
    return {
        "width_deg": width,
        "shift_deg": shift,
        "corrected_deg": shift + c.crosstalk * (width - usual),
        "outside": outside,
    }


def _crosstalk(logs: Sequence[EdgeTimes], calibration: Calibration) -> tuple[float, float]:
    """(k, standard error) of P4 (3); NaN if no log shows it.

    k leaves no phase shift on undriven wheels while the car drives off. The width's own noise would
    pull k towards zero; its known variance is subtracted.
    """
    parts = [np.zeros((3, 0))]
    for p in logs:
        if p.driven is not False:
            continue
        cleaned = clean_passages(p, calibration)
        calm = p.good & (p.steady >= 0)
        with np.errstate(invalid="ignore"):
            # driving off is an acceleration [m/s^2] above this: an undriven wheel then carries no
            # longitudinal force, and load transfer moves its width; twice as much leaves hard
            # driving alone to learn it from
            rows = p.good & (p.acceleration_m_s2 > 0.8) & np.isfinite(cleaned["shift_deg"])
        if calm.sum() >= 8 and rows.sum() >= 8:
            cleared = (cleaned[name] for name in ("shift_deg", "width_deg"))
            s, d = (x[rows] - np.mean(x[calm]) for x in cleared)
            parts.append(np.stack([s, d, p.width_se_deg[rows]]))
    s, d, se = np.concatenate(parts, axis=1)
    signal = float(d @ d - se @ se)
    if signal <= 0.1 * float(d @ d):
        return float("nan"), float("nan")
    k = -float(s @ d) / signal
    return k, float(np.std(s + k * d) * np.sqrt(float(d @ d)) / signal)


def _with_forces(logs: Sequence[EdgeTimes], c: Calibration) -> Calibration:
    """The calibration with force maps from the logs' force channels. UsageError: no log has one."""
    cleaned = [clean_passages(p, c) for p in logs]
    vertical = fit_force(logs, [one["width_deg"] for one in cleaned], "vertical_load")
    longitudinal = fit_force(logs, [one[c.force_column] for one in cleaned], FORCE)
    if vertical is None and longitudinal is None:
        raise UsageError(
            "--fit-forces, and no log has a vertical_load or longitudinal_force channel with a "
            "zero stretch",
            do="add one to the setup",
        )
    return replace(c, vertical=vertical, longitudinal=longitudinal)


# ---- A calibration applied to a log: its zero if the log has none, and the rows of `phase-shift`.


def measure_with(
    calibration: Calibration | None, recording: Recording, zero: str = "auto", forces: bool = False
) -> Iterator[EdgeTimes]:
    """`measure_phase_shift`, with the calibration's zero if the log has none and none is named."""
    for passages in measure_phase_shift(recording, zero, forces):
        yield with_zero(passages, calibration) if calibration and zero == "auto" else passages


def with_zero(p: EdgeTimes, calibration: Calibration) -> EdgeTimes:
    """The passages with the calibration's zero, if their log has none.

    As they are if it has one, or too few quasi-static passages.

    If no force is transmitted the phase shift is what the calibration's speed map says: the
    quasi-static passages, at whatever speed the map knows, give the wheel angle at which it is
    zero.
    """
    if np.isfinite(p.zero_speed_m_s):
        return p
    middle = p.entry_deg + p.width_deg / 2
    change = calibration.shift(p.speed_m_s, calibration.reference_speed_m_s)
    with np.errstate(invalid="ignore"):
        inside = (p.speed_m_s > calibration.shift.low_m_s - 0.5) & (
            p.speed_m_s < calibration.shift.high_m_s + 0.5
        )
    rows = quasi_static(p) & inside & np.isfinite(middle)
    # quasi-static passages that a zero needs, within the calibration's range of speed: their mean
    # is known to 0.35 of one's scatter, that of twice as many to 0.25
    least_zero = 8
    if rows.sum() < least_zero:
        told = f"fewer than {least_zero} quasi-static passages"
        said = f"{p.without_zero}; and {told} within the calibration's range of speed"
        return replace(p, without_zero=said)
    zero = float(np.median((middle - change)[rows]))
    speeds = f"{p.speed_m_s[rows].min():.1f} to {p.speed_m_s[rows].max():.1f} m/s"
    return replace(
        p,
        shift_deg=middle - zero,
        quality=p.quality & ~np.uint32(Quality.NO_ZERO),
        zero_speed_m_s=calibration.reference_speed_m_s,
        remarks=(
            *p.remarks,
            f"zero of the phase shift: the calibration's, by {rows.sum()} quasi-static passages "
            f"at {speeds}",
        ),
        without_zero="",
    )


def table(p: EdgeTimes, calibration: Calibration | None) -> Mapping[str, object]:
    """The columns of the `phase-shift` table for one accelerometer of one log.

    Rows from whose phase shift the calibration's telemetry delay was removed carry the word
    `delay_removed`.
    """
    quality = p.quality
    nan = np.full(p.time_s.size, np.nan)
    cleaned = dict.fromkeys(("width_deg", "shift_deg", "corrected_deg"), nan)
    if calibration is not None:
        cleaned = clean_passages(p, calibration)
    columns: dict[str, Any] = {
        "log": p.log,
        "channel": p.channel,
        "revolution": np.arange(p.time_s.size),
        "time_s": p.time_s,
        "speed_m_s": p.speed_m_s,
        "entry_angle_deg": p.entry_deg,
        "exit_angle_deg": p.exit_deg,
        "patch_width_deg": p.width_deg,
        "patch_width_se_deg": p.width_se_deg,
        "phase_shift_deg": p.shift_deg,
        "phase_shift_se_deg": p.shift_se_deg,
        "patch_width_detrended_deg": cleaned["width_deg"],
        "phase_shift_detrended_deg": cleaned["shift_deg"],
        "phase_shift_corrected_deg": cleaned["corrected_deg"],
    }
    if calibration is not None:
        pull, outside = cleaned[calibration.force_column], cleaned["outside"]
        for name, force, x, x_se in (
            ("vertical", calibration.vertical, cleaned["width_deg"], p.width_se_deg),
            ("longitudinal", calibration.longitudinal, pull, p.shift_se_deg),
        ):
            if force is not None:
                values, se, beyond = predict_force(force, x, x_se)
                columns |= {f"{name}_force_N": values, f"{name}_force_se_N": se}
                outside = outside | beyond
        removed = np.isfinite(cleaned["shift_deg"]) & calibration.has_delay
        quality = quality | marked(outside, Quality.EXTRAPOLATED)
        quality |= marked(removed, Quality.DELAY_REMOVED)
    return {**columns, "quality": quality_column(quality)}


# ---- Calibration files: versioned TOML.
#
# Checked key by key when read, so that a foreign file cannot do harm.
#
# Calibration --write_calibration--> text, whole or not at all --read_calibration--> Calibration

#: of the file's layout; another one is refused
VERSION = 1


_CALIBRATION = Table(
    {
        "version": ValueKind(f"{VERSION}", lambda version: version == VERSION),
        "reference_speed_m_s": number(0.0, 200.0),
        "phase_shift": table_of(SpeedMap, *SpeedMap.keys),
        "patch_width": Table(
            {"at_reference_deg": _ANGLE, **kinds_of(SpeedMap)},
            needed=("at_reference_deg", *SpeedMap.keys),
        ),
        "crosstalk": Table({"k": _SLOPE, "se": _SMALL}, needed=("k", "se")),
        "telemetry_delay": Table(
            {"delay_s": _SLOPE, "se_s": _SMALL, "beside_force": FLAG}, needed=("delay_s", "se_s")
        ),
        "vertical_force": table_of(ForceMap, *ForceMap.keys),
        "longitudinal_force": table_of(ForceMap, *ForceMap.keys),
    },
    needed=("version", "reference_speed_m_s", "phase_shift", "patch_width"),
)


def write_calibration(path: Path, calibration: Calibration) -> None:
    """The calibration at `path`."""
    c = calibration
    tables = {
        "phase_shift": vars(c.shift),
        "patch_width": {"at_reference_deg": c.patch_width_deg, **vars(c.width)},
        "crosstalk": {"k": c.crosstalk, "se": c.crosstalk_se},
        "telemetry_delay": {
            "delay_s": c.delay_s,
            "se_s": c.delay_se_s,
            "beside_force": c.beside_force,
        },
        "vertical_force": vars(c.vertical) if c.vertical else {},
        "longitudinal_force": vars(c.longitudinal) if c.longitudinal else {},
    }
    lines = [
        "# tirelog calibration of phase-shift: change with speed against the reference, c1 (v - "
        "v0) + c2 (v - v0)^2; beside_force: the longitudinal force was measured and its part "
        "removed",
        f"version = {VERSION}",
        f"reference_speed_m_s = {c.reference_speed_m_s!r}   # the zero of the phase shift",
    ]
    for name, values in tables.items():
        rows = [f"{key} = {json.dumps(np.asarray(one).tolist())}" for key, one in values.items()]
        if rows and "NaN" not in "".join(rows):  # what the logs did not show is left out
            lines += ["", f"[{name}]", *rows]
    with whole_file(path) as target:
        target.write_text("\n".join(lines) + "\n", encoding="utf-8")


def read_calibration(path: Path) -> Calibration:
    """The calibration at `path`.

    SetupError: no such file, not one of ours, or a value that cannot be.
    """
    text = toml_text(path, SetupError, what="a calibration", advice="name what --calibrate wrote")
    again = "write the file anew with --calibrate"
    document = Document(text, SetupError, "a calibration", path, again)
    data = document.read(_CALIBRATION)
    patch_width_deg = data["patch_width"].pop("at_reference_deg")
    data["patch_width"] = SpeedMap(**data["patch_width"])
    for name, found in data.items():
        if isinstance(found, SpeedMap | ForceMap):
            _refuse_map(found, FilePlace(document) / name)
    crosstalk = {"k": np.nan, "se": np.nan} | data.get("crosstalk", {})
    delay: dict[str, Any] = {"delay_s": np.nan, "se_s": np.nan, "beside_force": False}
    delay |= data.get("telemetry_delay", {})
    return Calibration(
        data["reference_speed_m_s"],
        data["phase_shift"],
        data["patch_width"],
        patch_width_deg,
        crosstalk["k"],
        crosstalk["se"],
        delay["delay_s"],
        delay["se_s"],
        data.get("vertical_force"),
        data.get("longitudinal_force"),
        delay["beside_force"],
    )


def _refuse_map(found: SpeedMap | ForceMap, place: FilePlace) -> None:
    """SetupError: a range without extent, or a covariance of another size than the numbers."""
    size = len(found.coefficients_N) if isinstance(found, ForceMap) else 2
    if len(found.covariance) != size:
        raise (place / "covariance").wrong(
            found.covariance.tolist(), f"allowed are finite numbers of shape {(size, size)}"
        )
    low, high = (key for key in found.keys if key.startswith(("low_", "high_")))
    least, most = getattr(found, low), getattr(found, high)
    if least >= most:
        raise (place / high).wrong(most, f"allowed is more than {low} = {least:g}")
