"""Every passage against the log's own form.

Height, offset, position, length and oddness by one linear least squares per row.

    Reference --on a fine grid of xi--> FormTables: columns of the linear model at some speeds
    PatchWindows --`kernels.fit_rows`, columns at each sample's distance--> PassageFits

A passage is height x form(xi - shift; length, damping, tilt) + offset. Linear in everything about
the reference; what is quadratic in length and shift is known from two more columns of the same
products and taken off in turns, without touching the samples again. At the noise of the log the
errors are those of Cramer and Rao.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tirelog.strain.footprint.family import ComplexArray
from tirelog.strain.footprint.kernels import FIT, GRID, OWN, fit_rows
from tirelog.strain.footprint.reference import Reference
from tirelog.strain.footprint.windows import PatchWindows
from tirelog.vocabulary.arrays import ColumnSet, FloatArray, IntArray, Record, Records

#: points of the form's table over a revolution: every half a millimetre, straight lines between
#: them
TABLE_POINTS = 4096
#: the same while a form is learnt, in half of the time: what the straight lines miss, up to 5e-5 of
#: a passage's height, is a tenth of the noise of the quietest log; half as many miss four times as
#: much
LEARNT_POINTS = 2048
#: weak knowledge of a passage's own oddness beside the log's: standard deviation of damping and
#: tilt; twice as much lets the noise of a passage move them twice as far
ODD_SD = 0.3


def grid_of(
    reference: Reference,
    number: int,
    half_window_m: float,
    spectra: ComplexArray,
    points: int = TABLE_POINTS,
) -> tuple[FloatArray, Record]:
    """Waves (g, c) of `spectra` (n, c) at speed `number` of `reference`, and their grid.

    The grid as the kernels take it, one GRID, of so many `points` per revolution.
    """
    xi, columns = reference.family.on_grid(spectra, points, 1.02 * half_window_m)
    grid = np.empty(1, GRID)
    grid["first_m"], grid["step_m"] = xi[0], xi[1] - xi[0]
    grid["speed2_m2_s2"] = reference.speed_m_s[number] ** 2
    grid["shift_m"], grid["half_window_m"] = reference.shifts_m[number], half_window_m
    return columns, grid[0]


def shape_table(
    reference: Reference, number: int, half_window_m: float
) -> tuple[FloatArray, Record]:
    """The columns that learning needs at speed `number`, and their grid.

    Height, -shift, length, damping, tilt | tension.
    """
    spectra = reference.family.jacobian(reference.shapes[number])
    slope = -1j * reference.family.kappa_1_m * spectra[:, 0]
    return grid_of(
        reference,
        number,
        half_window_m,
        np.column_stack([spectra[:, 0], slope, spectra[:, [1, 5, 6, 3]]]),
        LEARNT_POINTS,
    )


def _form_table(
    reference: Reference, number: int, half_window_m: float
) -> tuple[FloatArray, Record]:
    """The columns that a fit needs at speed `number`, and their grid.

    Height, -shift, length, damping, tilt | second by length, second by shift, by the squared speed.
    The height's wave holds what the form left of the learnt passages.
    """
    family, shape = reference.family, reference.shapes[number]
    spectra = family.jacobian(shape)
    base, wave_number = spectra[:, 0], 1j * family.kappa_1_m
    second = family.second_by_length(shape), wave_number**2 * base
    columns, grid = grid_of(
        reference,
        number,
        half_window_m,
        np.column_stack(
            [
                base,
                -wave_number * base,
                spectra[:, [1, 5, 6]],
                *second,
                -reference.inertia * spectra[:, 3],
            ]
        ),
    )
    if reference.residuals is not None and reference.residual_xi_m is not None:
        xi = grid["first_m"] + grid["step_m"] * np.arange(columns.shape[0])
        columns[:, 0] += np.interp(
            xi, reference.residual_xi_m, reference.residuals[number], 0.0, 0.0
        )
    return columns, grid


@dataclass(frozen=True)
class FormTables:
    """The form at k speeds: columns, grids, half lengths and shifts.

    `columns` (k, g, 8) on `grids` (k,) of GRID, `half_length_m` and `shift_m` behind the passages'
    centres (k,).
    """

    columns: FloatArray
    grids: Records
    half_length_m: FloatArray
    shift_m: FloatArray

    @classmethod
    def of(cls, reference: Reference, half_window_m: float) -> FormTables:
        """The tables at the speeds of `reference`."""
        made = [_form_table(reference, k, half_window_m) for k in range(len(reference.shapes))]
        columns, grids = (np.stack(part) for part in zip(*made, strict=True))
        return cls(
            columns,
            grids,
            np.array([shape.half_length_m for shape in reference.shapes]),
            reference.shifts_m,
        )


@dataclass(frozen=True)
class PassageFits(ColumnSet):
    """One row per passage, shape (n,): the parameters of its fit.

    `height` and `offset` (patch downward), `shift_m` of the patch's middle behind the passage's
    centre, `length_m` the full contact length, `damping`, `tilt` beside the reference's; standard
    errors at `noise` one; `chi2` per degree of freedom, `used` samples.
    """

    height: FloatArray
    offset: FloatArray
    shift_m: FloatArray
    length_m: FloatArray
    damping: FloatArray
    tilt: FloatArray
    length_se_m: FloatArray
    chi2: FloatArray
    used: FloatArray


def fit_edges(
    windows: PatchWindows, motion: Records, tables: FormTables, number: IntArray, noise: float
) -> PassageFits:
    """The fits of the rows of `windows`, each against its form.

    The rows move as `motion` says (`PatchWindows.motion`); `number` (n,): each row's form in
    `tables`; `noise`: standard deviation of a sample of the log.
    """
    sigma = noise / np.sqrt(windows.averaged)
    found = np.full(len(number), np.nan, FIT)
    fit_rows(windows.values, motion, number, tables.columns, tables.grids, sigma, ODD_SD, found)
    height, used = found["height"], found["used"]
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = {name: found[name] / height for name in FIT.names or ()}
        nan = np.where(height > 0, 1.0, np.nan)
    return PassageFits(
        height=height * nan,
        offset=found["offset"] * nan,
        shift_m=(tables.shift_m[number] + relative["shift"]) * nan,
        length_m=2.0 * (tables.half_length_m[number] + relative["length"]) * nan,
        damping=relative["damping"] * nan,
        tilt=relative["tilt"] * nan,
        length_se_m=2.0 * sigma * relative["length_se"] * nan,
        chi2=found["chi2"] / np.maximum(used - OWN, 1) * nan,
        used=used.copy(),
    )
