"""Every passage against the log's own form: height, offset, position, length and oddness by one linear least squares a row.

    Reference --on a fine grid of xi--> FormTable of each speed: columns of the linear model
    PatchWindows --columns at each sample's distance--> normal equations (rows x 6 x 6) --> PassageFits

A passage is height x form(xi - shift; length, damping, tilt) + offset.  Linear in everything about the reference; what is quadratic
in length and shift is known from two more columns of the same products and taken off in turns, without touching the samples again.
At the noise of the log the errors are those of Cramer and Rao.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from tirelog.estimators.edge_shapes import ComplexArray, EdgeShape
from tirelog.estimators.footprint_reference import Reference
from tirelog.estimators.footprint_windows import PatchWindows
from tirelog.recording import FloatArray, IntArray

#: points of the form's table over a revolution: every half a millimetre, straight lines between them
TABLE_POINTS = 4096
#: columns: height, offset, -shift, length, damping, tilt | second by length, second by shift
LINEAR, HEIGHT, OFFSET, SHIFT, LENGTH, DAMPING, TILT = 6, 0, 1, 2, 3, 4, 5
#: weak knowledge of a passage's own oddness beside the log's: standard deviations of damping and tilt
ODD_SD = (0.3, 0.3)
ROUNDS = 4
#: largest quadratic term [m^2]: half of the square of 15 mm
MOST_BEND = 1.1e-4


@dataclass(frozen=True)
class FormTable:
    """The form at one speed, on an even grid: `shift_m` behind the passages' centres, `columns` (g, c), which of them `form_table` and
    `shape_table` say."""

    speed_m_s: float
    half_length_m: float
    shift_m: float
    first_m: float
    step_m: float
    columns: FloatArray

    def at(self, xi_m: FloatArray) -> FloatArray:
        """Columns at `xi_m` (any shape), linear between the grid's points; shape (..., c)."""
        place = np.clip((xi_m - self.first_m) / self.step_m, 0.0, self.columns.shape[0] - 1.001)
        low = place.astype(np.int32)
        below = np.take(self.columns, low, axis=0)
        between = np.take(self.columns, low + 1, axis=0)
        between -= below
        between *= (place - low)[..., None]
        between += below
        return between


def _table(reference: Reference, number: int, half_window_m: float, spectra: ComplexArray) -> FormTable:
    """A table of `spectra` (n, c)."""
    xi, columns = reference.family.on_grid(spectra, TABLE_POINTS, 1.02 * half_window_m)
    shape = reference.shapes[number]
    return FormTable(
        reference.speed_m_s[number], shape.half_length_m, reference.shifts_m[number], float(xi[0]), float(xi[1] - xi[0]), columns
    )


def shape_table(reference: Reference, number: int, half_window_m: float) -> FormTable:
    """Height, -shift, length, damping, tilt | bending length, tension, tread: what learning the form needs at speed `number`."""
    base, slopes = reference.family.jacobian(reference.shapes[number])
    slope = -1j * reference.family.kappa_1_m * base
    return _table(reference, number, half_window_m, np.column_stack([base, slope, slopes[:, [0, 4, 5, 1, 2, 3]]]))


def form_table(reference: Reference, number: int, half_window_m: float) -> FormTable:
    """Height, -shift, length, damping, tilt | second by length, second by shift, by the squared speed, at speed `number`; the wave holds
    what the form left of the learnt passages."""
    family, shape = reference.family, reference.shapes[number]
    base, slopes = family.jacobian(shape)
    nudge = 1e-3 * shape.half_length_m
    longer = EdgeShape.of(shape.array() + nudge * np.eye(6)[0])
    wave_number = 1j * family.kappa_1_m
    spectra = np.column_stack(
        [
            base,
            -wave_number * base,
            slopes[:, [0, 4, 5]],
            (family.jacobian(longer)[1][:, 0] - slopes[:, 0]) / nudge,
            wave_number**2 * base,
            -reference.inertia * slopes[:, 2],
        ]
    )
    table = _table(reference, number, half_window_m, spectra)
    if reference.residuals is not None and reference.residual_xi_m is not None:
        xi = table.first_m + table.step_m * np.arange(table.columns.shape[0])
        table.columns[:, 0] += np.interp(xi, reference.residual_xi_m, reference.residuals[number], 0.0, 0.0)
    return table


@dataclass(frozen=True)
class PassageFits:
    """One row a passage, shape (n,): `height` and `offset` (patch downward), `shift_m` of the patch's middle behind the passage's centre,
    `length_m` the full contact length, `damping`, `tilt` beside the reference's; standard errors at `noise` one; `chi2` per degree of
    freedom, `used` samples, `inside` samples between the edges."""

    height: FloatArray
    offset: FloatArray
    shift_m: FloatArray
    length_m: FloatArray
    damping: FloatArray
    tilt: FloatArray
    length_se_m: FloatArray
    shift_se_m: FloatArray
    chi2: FloatArray
    used: FloatArray
    inside: FloatArray

    @classmethod
    def empty(cls, n: int) -> PassageFits:
        return cls(**{f.name: np.full(n, np.nan) for f in fields(cls)})

    def put(self, rows: IntArray, other: PassageFits) -> None:
        """Write the rows of `other` at the ordinals `rows`."""
        for f in fields(self):
            getattr(self, f.name)[rows] = getattr(other, f.name)


def design(table: FormTable, xi_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
    """Columns of the linear model (LINEAR and the two quadratic ones) at `xi_m` (n, m), shape (n, m, 8)."""
    looked = table.at(xi_m)
    out = np.empty((*xi_m.shape, LINEAR + 2))
    faster = (speed_m_s**2 - table.speed_m_s**2)[:, None]
    out[..., HEIGHT] = looked[..., 0] + faster * looked[..., 7]
    out[..., OFFSET] = 1.0
    out[..., SHIFT:] = looked[..., 1:7]
    return out


@dataclass(frozen=True)
class Normal:
    """Normal equations of rows: `columns` (n, m, 8) with `values` (n, m) about each row's `middle` (n,), zero where a sample is not used;
    `gram` (n, 8, 8), `right` (n, 8); `used` samples and those `inside` the patch (n,); `sigma` of a column's value."""

    columns: FloatArray
    values: FloatArray
    middle: FloatArray
    gram: FloatArray
    right: FloatArray
    used: FloatArray
    inside: FloatArray
    sigma: float
    xi_m: FloatArray

    def take(self, which: IntArray) -> Normal:
        """The rows `which`."""
        columns, values, middle, gram, right, used, inside, xi_m = (
            array[which] for array in (self.columns, self.values, self.middle, self.gram, self.right, self.used, self.inside, self.xi_m)
        )
        return Normal(columns, values, middle, gram, right, used, inside, self.sigma, xi_m)


def normal_equations(
    windows: PatchWindows,
    table: FormTable,
    half_window_m: float,
    speed_m_s: FloatArray,
    acceleration_m_s2: FloatArray,
    noise: float,
    shift_m: FloatArray | float = 0.0,
) -> Normal:
    """The rows of `windows` against `table`; `noise`: standard deviation of a sample of the log; `shift_m`: how far behind the
    reference's own place the form is put."""
    xi = windows.distance_m(speed_m_s, acceleration_m_s2) - table.shift_m - np.reshape(shift_m, (-1, 1))
    good = (np.abs(xi) < half_window_m) & np.isfinite(windows.values)
    known = np.where(good, windows.values, 0.0)
    used = good.sum(axis=1)
    middle = known.sum(axis=1) / np.maximum(used, 1)
    values = np.where(good, known - middle[:, None], 0.0)
    columns = design(table, xi, speed_m_s) * good[..., None]
    turned = np.swapaxes(columns, 1, 2)
    inside = (good & (np.abs(xi) < table.half_length_m)).sum(axis=1)
    sigma = noise / np.sqrt(windows.averaged)
    return Normal(columns, values, middle, turned @ columns, (turned @ values[..., None])[..., 0], used, inside, sigma, xi)


@dataclass(frozen=True)
class Solution:
    """`whole` (n, 8): the columns' coefficients, the two quadratic ones last; `inverse` (n, 6, 6) of the linear normal matrix; `poor` (n,):
    rows with too few samples."""

    whole: FloatArray
    inverse: FloatArray
    poor: NDArray[np.bool_]

    def take(self, which: IntArray) -> Solution:
        """The rows `which`."""
        return Solution(self.whole[which], self.inverse[which], self.poor[which])


def solve(normal: Normal, odd_sd: tuple[float, float] = ODD_SD) -> Solution:
    """The least-squares solution of all rows; `odd_sd`: what is known of damping and tilt beside the reference's."""
    right, gram = normal.right, normal.gram
    matrix = gram[:, :LINEAR, :LINEAR].copy()
    # oddness is a ratio to the height, whose rough size is the right side's
    rough = np.maximum(np.abs(right[:, HEIGHT]) / np.maximum(gram[:, HEIGHT, HEIGHT], 1e-300), 1e-300)
    for column, sd in zip((DAMPING, TILT), odd_sd, strict=True):
        matrix[:, column, column] += (normal.sigma / (sd * rough)) ** 2
    poor = normal.used < LINEAR + 2
    matrix[poor] = np.eye(LINEAR)
    scale = 1.0 / np.sqrt(np.maximum(np.einsum("nii->ni", matrix), 1e-300))
    scaled = matrix * scale[:, :, None] * scale[:, None, :] + 1e-13 * np.eye(LINEAR)
    inverse = np.linalg.inv(scaled) * scale[:, :, None] * scale[:, None, :]
    straight = solution = np.einsum("nij,nj->ni", inverse, right[:, :LINEAR])
    bends = np.einsum("nij,njk->nik", inverse, gram[:, :LINEAR, LINEAR:])
    for _ in range(ROUNDS):
        curved = quadratic(solution, rough)
        solution = straight - np.einsum("nik,nk->ni", bends, curved)
    return Solution(np.concatenate([solution, quadratic(solution, rough)], axis=1), inverse, poor)


def quadratic(solution: FloatArray, rough: FloatArray) -> FloatArray:
    """Coefficients of the two quadratic columns that belong to a linear solution (n, ..., 6 or more), shape (n, ..., 2); `rough` (n, ...)
    is the size of the height."""
    limit = MOST_BEND * rough[..., None]
    with np.errstate(divide="ignore", invalid="ignore"):
        bend = 0.5 * solution[..., [LENGTH, SHIFT]] ** 2 / solution[..., [HEIGHT]]
    return np.clip(np.nan_to_num(bend), -limit, limit)


def described(normal: Normal, solution: Solution, table: FormTable) -> PassageFits:
    """A solution in physical terms, with errors at the noise of a sample."""
    whole, height = solution.whole, solution.whole[:, HEIGHT]
    left = (normal.values**2).sum(axis=1) - 2.0 * np.einsum("ni,ni->n", whole, normal.right)
    left += np.einsum("ni,nij,nj->n", whole, normal.gram, whole)
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = whole / height[:, None]
        error = normal.sigma * np.sqrt(np.einsum("nii->ni", solution.inverse)) / np.abs(height)[:, None]
    nan = np.where(solution.poor | ~(height > 0), np.nan, 1.0)
    return PassageFits(
        height * nan,
        (whole[:, OFFSET] + normal.middle) * nan,
        (table.shift_m + relative[:, SHIFT]) * nan,
        2.0 * (table.half_length_m + relative[:, LENGTH]) * nan,
        relative[:, DAMPING] * nan,
        relative[:, TILT] * nan,
        2.0 * error[:, LENGTH] * nan,
        error[:, SHIFT] * nan,
        np.maximum(left, 0.0) / np.maximum(normal.used - LINEAR, 1) / normal.sigma**2 * nan,
        normal.used.astype(float),
        normal.inside.astype(float),
    )
