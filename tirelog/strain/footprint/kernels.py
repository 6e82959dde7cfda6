"""Compiled: least squares of a form against each passage's own samples, row by row.

    a row of a window
        --distance of each sample--> the form's columns at the samples used, their values last
        --all products--> gram (w + 1, w + 1), w columns
            --scaled Cholesky--> inverse of the passage's own block --> solution

Columns of a passage's own: height, offset, -shift, length, damping, tilt (OWN); of a fit then the
quadratic ones by length and shift, of learning then the shared ones. They are an axis of linear
algebra, over which sums run, so their places have names and no fields. A table (g, c) has the same
columns without the offset, on an even GRID [m]; one of them, `follows`,
times `by_speed2` x (the row's squared speed - the table's) is added to the height's.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray, IntArray, Record, Records

#: how a row moves: column of the patch centre, columns per second, speed and acceleration of the
#: tread there
MOTION = np.dtype(
    [("centre", "f8"), ("rate_Hz", "f8"), ("speed_m_s", "f8"), ("acceleration_m_s2", "f8")]
)
#: where a table stands: abscissa of its first row and from row to row, square of the speed that it
#: holds at, shift of its form behind the patch centre, half of the window that samples are used in
GRID = np.dtype(
    [("first_m", "f8"), ("step_m", "f8"), ("speed2_m2_s2", "f8"), ("shift_m", "f8"),
     ("half_window_m", "f8")]
)  # fmt: skip
#: a row's fit, NaN without one: the solution by the passage's own columns (height and offset in the
#: values' unit, the others times the height; shift and length in m), errors of length and shift
#: of a linear height [m sigma^-1], squared residual over sigma^2, samples used
FIT = np.dtype(
    [("height", "f8"), ("offset", "f8"), ("shift", "f8"), ("length", "f8"), ("damping", "f8"),
     ("tilt", "f8"), ("length_se", "f8"), ("chi2", "f8"), ("used", "f8")]
)  # fmt: skip


class ClassSums(NamedTuple):
    """What the rows of one class of speed leave about a form, each put where it is.

    own            (n, OWN): each row's own solution, 0 if it has too few samples
    chi2, used     (n,): its squared residual over sigma^2, samples used
    left, counts   (cells,): sums of residuals over heights by place in the window, and how many
    """

    own: FloatArray
    chi2: FloatArray
    used: FloatArray
    left: FloatArray
    counts: FloatArray

    @property
    def free(self) -> FloatArray:
        """Degrees of freedom of each row, (n,)."""
        return np.maximum(self.used - OWN, 1.0)


def motion_of(
    centre: FloatArray, rate_Hz: float, speed_m_s: FloatArray, acceleration_m_s2: FloatArray
) -> Records:
    """How rows move, (n,) of MOTION."""
    motion = np.empty(centre.size, MOTION)
    motion["centre"], motion["rate_Hz"] = centre, rate_Hz
    motion["speed_m_s"], motion["acceleration_m_s2"] = speed_m_s, acceleration_m_s2
    return motion


#: numbers of a passage's own, and their columns
OWN, HEIGHT, OFFSET, SHIFT, LENGTH, DAMPING, TILT = 6, 0, 1, 2, 3, 4, 5
#: columns of a fit: a passage's own and the quadratic ones
FITTED = OWN + 2
#: turns of a fit's quadratic terms
ROUNDS = 4
#: largest quadratic term [m^2]: half of the square of 15 mm
MOST_BEND = 1.1e-4
#: rows that arrays of columns have beyond the samples
SPARE = 3


@compiled
def look_up(
    values: FloatArray, motion: Record, table: FloatArray, grid: Record, shift: float,
    by_speed2: float, follows: int, wide: int, columns: FloatArray, place: FloatArray,
) -> tuple[int, float]:  # fmt: skip
    """Fill `columns` and `place` of the samples of a row that are used; count and mean.

    Samples (m,) that are there and lie within the half window of the patch centre, shifted by
    `shift` [m]; their mean is taken off. `motion`: one MOTION; `grid`: one GRID.

    table    (g, c): the form's columns without the offset; number `follows` goes with the squared
             speed. The last of c = `wide` columns is not kept, since the samples take its place
    columns  (m + SPARE, wide + 1), filled: the form's columns with the offset, the samples last
    place    (m,), filled: place on the grid [rows of the table]
    """
    centre, rate, speed = motion["centre"], motion["rate_Hz"], motion["speed_m_s"]
    acceleration, half_window = motion["acceleration_m_s2"], grid["half_window_m"]
    first, step, square = grid["first_m"], grid["step_m"], grid["speed2_m2_s2"]
    faster, top = by_speed2 * (speed**2 - square), table.shape[0] - 1.001
    per_column, per_step, half = 1.0 / rate, 1.0 / step, 0.5 * acceleration
    used, total = 0, 0.0
    for k in range(values.size):
        time, value = (k - centre) * per_column, values[k]
        xi = time * (speed + half * time) - shift
        if abs(xi) < half_window and not np.isnan(value):
            place[used] = min(max((xi - first) * per_step, 0.0), top)
            columns[used, OFFSET] = value
            total += value
            used += 1
    middle = total / max(used, 1)
    for k in range(used):
        low, value = int(place[k]), columns[k, OFFSET]
        share = place[k] - low
        row, below, above = columns[k], table[low], table[low + 1]
        for c in range(table.shape[1]):
            row[c + 1] = below[c] + share * (above[c] - below[c])
        row[HEIGHT] = row[1] + faster * row[follows + 1]
        row[OFFSET], row[wide] = 1.0, value - middle
    return used, middle


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
def own_inverse(
    gram: FloatArray, wide: int, sigma: float, odd_sd: float, lower: FloatArray, inverse: FloatArray
) -> float:
    """Inverse of a passage's own block, with what is known added; its rough height.

    What is known: damping and tilt (standard deviation `odd_sd`, in heights), beside values with
    the noise `sigma`. Scaled to a diagonal of one, which is lifted a little so that columns that
    cannot be told apart share what there is. `gram` of `products`; `lower` (OWN, OWN) is room,
    `inverse` (OWN, OWN) is filled.
    """
    # oddness is a ratio to the height, whose rough size is the right side's
    rough: float = max(abs(gram[HEIGHT, wide]) / max(gram[HEIGHT, HEIGHT], 1e-300), 1e-300)
    prior = (sigma / (odd_sd * rough)) ** 2
    scale = np.empty(OWN)
    for i in range(OWN):
        scale[i] = 1.0 / np.sqrt(max(gram[i, i] + (prior if i >= DAMPING else 0.0), 1e-300))
    for i in range(OWN):
        for j in range(i + 1):
            value = gram[i, j] * scale[i] * scale[j]
            if i == j:
                value += (prior * scale[i] ** 2 if i >= DAMPING else 0.0) + 1e-13
            for k in range(j):
                value -= lower[i, k] * lower[j, k]
            lower[i, j] = np.sqrt(max(value, 1e-16)) if i == j else value / lower[j, j]
    for c in range(OWN):  # a column of the inverse: forward, then backward
        for i in range(c, OWN):
            value = 1.0 if i == c else 0.0
            for k in range(c, i):
                value -= lower[i, k] * inverse[k, c]
            inverse[i, c] = value / lower[i, i]
        for i in range(OWN - 1, c - 1, -1):
            value = inverse[i, c]
            for k in range(i + 1, OWN):
                value -= lower[k, i] * inverse[k, c]
            inverse[i, c] = value / lower[i, i]
    for i in range(OWN):
        for j in range(i + 1):
            inverse[i, j] *= scale[i] * scale[j]
            inverse[j, i] = inverse[i, j]
    return rough


@compiled
def apply_inverse(inverse: FloatArray, right: FloatArray, out: FloatArray) -> None:
    """Fills `out` (OWN,) with the product of `inverse` (OWN, OWN) and the head of `right`."""
    for i in range(OWN):
        value = 0.0
        for j in range(OWN):
            value += inverse[i, j] * right[j]
        out[i] = value


@compiled
def bend(moved: float, height: float, rough: float) -> float:
    """Coefficient of the quadratic column that belongs to the linear one's `moved` [m].

    Of a passage of `height`, half of moved^2 / height; at most MOST_BEND of its `rough` height.
    """
    size = 0.5 * moved**2 / height
    return 0.0 if np.isnan(size) else min(max(size, -MOST_BEND * rough), MOST_BEND * rough)


@compiled
def quadratic_form(gram: FloatArray, wide: int, whole: FloatArray) -> float:
    """Squared residual that the coefficients `whole` (wide,) leave; `gram` of `products`."""
    left: float = gram[wide, wide]
    for i in range(wide):
        left -= 2.0 * whole[i] * gram[i, wide]
        for j in range(wide):
            left += whole[i] * gram[i, j] * whole[j]
    return left


@compiled
def fitted(
    gram: FloatArray, inverse: FloatArray, rough: float, bends: FloatArray, whole: FloatArray
) -> None:
    """Fills `whole` with the solution (FITTED,) of a fit.

    Linear about the form; what is quadratic in length and shift is taken off in turns. `bends` (3,
    OWN): the inverse times the right side, and times the two quadratic columns.
    """
    for k, column in enumerate((FITTED, OWN, OWN + 1)):
        apply_inverse(inverse, gram[column], bends[k])
    for turn in range(ROUNDS + 1):
        for i in range(OWN):
            whole[i] = bends[0, i] - (
                bends[1, i] * whole[OWN] + bends[2, i] * whole[OWN + 1] if turn else 0.0
            )
        whole[OWN], whole[OWN + 1] = (
            bend(whole[LENGTH], whole[HEIGHT], rough),
            bend(whole[SHIFT], whole[HEIGHT], rough),
        )


@compiled
def fit_rows(
    values: FloatArray, motion: Records, number: IntArray, tables: FloatArray, grids: Records,
    sigma: float, odd_sd: float, found: Records,
) -> None:  # fmt: skip
    """Fills `found` (n,) of FIT with the fit of each row of `values` (n, m) against its form.

    Form `number` (n,) of the `tables` (k, g, FITTED) on `grids` (k,); `motion` (n,). `found` comes
    as NaN, which a row with too few samples keeps. The offset is the values' own. `sigma`: standard
    deviation of a value; `odd_sd`: of damping and tilt, in heights.
    """
    wide = tables.shape[2]
    columns, place = np.empty((values.shape[1] + SPARE, FITTED + 1)), np.empty(values.shape[1])
    gram, lower, inverse = (
        np.empty((FITTED + 1, FITTED + 1)),
        np.zeros((OWN, OWN)),
        np.empty((OWN, OWN)),
    )
    bends, whole = np.empty((3, OWN)), np.empty(FITTED)
    for row in range(values.shape[0]):
        k = number[row]
        used, middle = look_up(
            values[row], motion[row], tables[k], grids[k], grids[k]["shift_m"], 1.0, wide - 1,
            wide, columns, place,
        )  # fmt: skip
        made = found[row]
        made["used"] = used
        if used < FITTED:
            continue
        products(columns, used, wide, gram)
        rough = own_inverse(gram, wide, sigma, odd_sd, lower, inverse)
        fitted(gram, inverse, rough, bends, whole)
        made["height"], made["offset"] = whole[HEIGHT], whole[OFFSET] + middle
        made["shift"], made["length"] = whole[SHIFT], whole[LENGTH]
        made["damping"], made["tilt"] = whole[DAMPING], whole[TILT]
        made["length_se"] = np.sqrt(inverse[LENGTH, LENGTH])
        made["chi2"] = max(quadratic_form(gram, wide, whole), 0.0) / sigma**2


@compiled
def class_sums(
    values: FloatArray, motion: Records, table: FloatArray, grid: Record, by_speed2: float,
    sigma: float, odd_sd: float, cells: int,
) -> ClassSums:  # fmt: skip
    """What the rows of one class of speed leave about a form.

    `values` (n, m) move as `motion` (n,) says; `table` (g, OWN) on `grid`, one GRID: a passage's
    own columns but the offset, and one that follows the squared speed.
    """
    wide = table.shape[1] + 1
    count = values.shape[0]
    rows, chi2, samples = np.zeros((count, OWN)), np.zeros(count), np.zeros(count)
    left, counts = np.zeros(cells), np.zeros(cells)
    columns, place = np.empty((values.shape[1] + SPARE, wide + 1)), np.empty(values.shape[1])
    gram, lower, inverse = (
        np.empty((wide + 1, wide + 1)),
        np.zeros((OWN, OWN)),
        np.empty((OWN, OWN)),
    )
    per_cell = cells / (2.0 * grid["half_window_m"])
    for row in range(values.shape[0]):
        used, _ = look_up(
            values[row], motion[row], table, grid, grid["shift_m"], by_speed2, wide - 2, wide,
            columns, place,
        )  # fmt: skip
        samples[row] = used
        if used < OWN:
            continue
        products(columns, used, wide, gram)
        own_inverse(gram, wide, sigma, odd_sd, lower, inverse)
        own = rows[row]
        apply_inverse(inverse, gram[wide], own)
        for k in range(used):
            residual = columns[k, wide]
            for i in range(OWN):
                residual -= columns[k, i] * own[i]
            chi2[row] += (residual / sigma) ** 2
            xi = grid["first_m"] + place[k] * grid["step_m"]
            cell = min(int((xi + grid["half_window_m"]) * per_cell), cells - 1)
            left[cell] += residual / own[HEIGHT]
            counts[cell] += 1.0
    return ClassSums(rows, chi2, samples, left, counts)
