"""Compiled: least squares of a form against each passage's own samples, row by row.

    a row of a window
        --distance of each sample--> the form's columns at the samples used, their values last
        --all products--> gram (FITTED + 1, FITTED + 1)
            --scaled Cholesky--> inverse of the passage's own block --> solution

Columns of a passage's own: height, offset, -shift, length, damping, tilt (OWN); then the quadratic
ones by length and shift. They are an axis of linear algebra, over which sums run, so their places
have names and no fields. A table (g, FITTED) has the same columns without the offset, on an even
GRID [m]; its last one times (the row's squared speed - the table's) is added to the height's.
"""

from __future__ import annotations

import numpy as np

from tirelog.kernels import compiled
from tirelog.strain.passages.template import SPARE, apply_inverse, invert, products
from tirelog.vocabulary.arrays import FloatArray, IntArray, Record, Records

#: how a row moves: column of the patch centre, columns per second, speed and acceleration of the
#: tread there
MOTION = np.dtype(
    [("centre", "f8"), ("rate_Hz", "f8"), ("speed_m_s", "f8"), ("acceleration_m_s2", "f8")]
)
#: where a table is: abscissa of its first row and from row to row, square of the speed that it
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


def distance_along(
    time_s: FloatArray, speed_m_s: FloatArray, acceleration_m_s2: FloatArray
) -> FloatArray:
    """Distance [m] along the tread after `time_s` from the patch centre; broadcasts."""
    return time_s * (speed_m_s + 0.5 * acceleration_m_s2 * time_s)


#: numbers of a passage's own, and their columns
OWN, HEIGHT, OFFSET, SHIFT, LENGTH, DAMPING, TILT = 6, 0, 1, 2, 3, 4, 5
#: columns of a fit: a passage's own and the quadratic ones
FITTED = OWN + 2
#: largest quadratic term [m^2]: half of the square of 15 mm
MOST_BEND = 1.1e-4


@compiled
def look_up(
    values: FloatArray, motion: Record, table: FloatArray, grid: Record, shift: float,
    columns: FloatArray, place: FloatArray,
) -> tuple[int, float]:  # fmt: skip
    """Fill `columns` and `place` of the samples of a row that are used; count and mean.

    Samples (m,) that are there and lie within the half window of the patch centre, shifted by
    `shift` [m]; their mean is subtracted. `motion`: one MOTION; `grid`: one GRID.

    table    (g, FITTED): the form's columns without the offset; the last one, which goes with the
             squared speed, is not kept, since the samples take its place
    columns  (m + SPARE, FITTED + 1), filled: the form's columns with the offset, the samples last
    place    (m,), filled: place on the grid [rows of the table]
    """
    centre, rate, speed = motion["centre"], motion["rate_Hz"], motion["speed_m_s"]
    acceleration, half_window = motion["acceleration_m_s2"], grid["half_window_m"]
    first, step, square = grid["first_m"], grid["step_m"], grid["speed2_m2_s2"]
    faster, top = speed**2 - square, table.shape[0] - 1.001
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
        row[HEIGHT] = row[1] + faster * row[FITTED]
        row[OFFSET], row[FITTED] = 1.0, value - middle
    return used, middle


@compiled
def own_inverse(gram: FloatArray, sigma: float, odd_sd: float, inverse: FloatArray) -> float:
    """Inverse of a passage's own block, with what is known added; its rough height.

    What is known: damping and tilt (standard deviation `odd_sd`, in heights), beside values with
    the noise `sigma`. Scaled to a diagonal of one, which is lifted a little so that columns
    that are alike share what there is. `gram` of `products`; `inverse` (OWN, OWN) is filled.
    """
    # oddness is a ratio to the height, whose rough size is the right side's
    rough: float = max(abs(gram[HEIGHT, FITTED]) / max(gram[HEIGHT, HEIGHT], 1e-300), 1e-300)
    scale = np.empty(OWN)
    for i in range(OWN):
        prior = (sigma / (odd_sd * rough)) ** 2 if i >= DAMPING else 0.0
        scale[i] = 1.0 / np.sqrt(max(gram[i, i] + prior, 1e-300))
        for j in range(i + 1):
            inverse[i, j] = inverse[j, i] = gram[i, j] * scale[i] * scale[j]
        inverse[i, i] += prior * scale[i] ** 2 + 1e-13
    invert(inverse)
    for i in range(OWN):
        for j in range(OWN):
            inverse[i, j] *= scale[i] * scale[j]
    return rough


@compiled
def bend(moved: float, height: float, rough: float) -> float:
    """Coefficient of the quadratic column that belongs to the linear one's `moved` [m].

    Of a passage of `height`, half of moved^2 / height; at most MOST_BEND of its `rough` height.
    """
    size = 0.5 * moved**2 / height
    return 0.0 if np.isnan(size) else min(max(size, -MOST_BEND * rough), MOST_BEND * rough)


@compiled
def quadratic_form(gram: FloatArray, whole: FloatArray) -> float:
    """Squared residual that the form's coefficients `whole` leave; `gram` of `products`."""
    left: float = gram[FITTED, FITTED]
    for i in range(FITTED):
        left -= 2.0 * whole[i] * gram[i, FITTED]
        for j in range(FITTED):
            left += whole[i] * gram[i, j] * whole[j]
    return left


@compiled
def own_solutions(gram: FloatArray, inverse: FloatArray) -> FloatArray:
    """The inverse times the right side, and times the two quadratic columns, (3, OWN)."""
    solutions = np.empty((3, OWN))
    for k, column in enumerate((FITTED, OWN, OWN + 1)):
        apply_inverse(inverse, gram[column], solutions[k])
    return solutions


@compiled
def solve(
    solutions: FloatArray, rough: float, beside: FloatArray, moved: FloatArray, free: float,
    whole: FloatArray,
) -> None:  # fmt: skip
    """Fills `whole` (FITTED + 1,): coefficients of the form's columns, then of a wave beside them.

    Linear about the form; what is quadratic in length and shift is subtracted in turns. `solutions`
    (3, OWN) as of `own_solutions`; `rough` height. Of the wave (zeros and 1 without one): `beside`
    (FITTED + 2,), its products with the columns, with the values and with itself; `moved` (OWN,),
    the inverse times the first of these; `free`: what own columns leave of its square.
    """
    whole[:] = 0.0
    for _ in range(5):
        size = beside[FITTED] - beside[OWN] * whole[OWN] - beside[OWN + 1] * whole[OWN + 1]
        for i in range(OWN):
            whole[i] = solutions[0, i] - solutions[1, i] * whole[OWN]
            whole[i] -= solutions[2, i] * whole[OWN + 1]
            size -= beside[i] * whole[i]
        size /= free
        for i in range(OWN):
            whole[i] -= moved[i] * size
        whole[OWN] = bend(whole[LENGTH], whole[HEIGHT], rough)
        whole[OWN + 1] = bend(whole[SHIFT], whole[HEIGHT], rough)
        whole[FITTED] = size


@compiled
def _fit(
    values: FloatArray, motion: Record, table: FloatArray, grid: Record, sigma: float,
    odd_sd: float, columns: FloatArray, place: FloatArray, gram: FloatArray, inverse: FloatArray,
    whole: FloatArray,
) -> tuple[int, float]:  # fmt: skip
    """Fills `whole` (FITTED + 1,) with the fit of one row, if it has OWN samples.

    Samples used, and their mean, which is off. The rest is filled on the way.
    """
    used, middle = look_up(values, motion, table, grid, grid["shift_m"], columns, place)
    if used >= OWN:
        products(columns, used, FITTED, gram)
        rough = own_inverse(gram, sigma, odd_sd, inverse)
        none = np.zeros(FITTED + 2)
        solve(own_solutions(gram, inverse), rough, none, none, 1.0, whole)
    return used, middle


@compiled
def fit_rows(
    values: FloatArray, motion: Records, number: IntArray, tables: FloatArray, grids: Records,
    sigma: float, odd_sd: float, found: Records, left: FloatArray,
) -> None:  # fmt: skip
    """Fills `found` (n,) of FIT with the fit of each row of `values` (n, m) against its form.

    Form `number` (n,) of the `tables` (k, g, FITTED) on `grids` (k,); `motion` (n,). A row with too
    few samples keeps what `found` comes with. The offset is the values' own. `sigma`: standard
    deviation of a value; `odd_sd`: of damping and tilt, in heights. Added to `left` (2, cells):
    what the fits leave over their heights by place in the window, and how many samples.
    """
    columns, place = np.empty((values.shape[1] + SPARE, FITTED + 1)), np.empty(values.shape[1])
    gram, inverse = np.empty((FITTED + 1, FITTED + 1)), np.empty((OWN, OWN))
    whole, cells = np.empty(FITTED + 1), left.shape[1]
    # a form is learnt of passages with as many samples as they have numbers, if there are no others
    least = OWN if cells else FITTED
    for row in range(values.shape[0]):
        k, made = number[row], found[row]
        used, middle = _fit(
            values[row], motion[row], tables[k], grids[k], sigma, odd_sd, columns, place, gram,
            inverse, whole,
        )  # fmt: skip
        made["used"] = used
        if used < least:
            continue
        made["height"], made["offset"] = whole[HEIGHT], whole[OFFSET] + middle
        made["shift"], made["length"] = whole[SHIFT], whole[LENGTH]
        made["damping"], made["tilt"] = whole[DAMPING], whole[TILT]
        made["length_se"] = np.sqrt(inverse[LENGTH, LENGTH])
        made["chi2"] = max(quadratic_form(gram, whole), 0.0) / sigma**2
        if cells:
            _add_residuals(columns, place, used, grids[k], whole, left)


@compiled
def _add_residuals(
    columns: FloatArray, place: FloatArray, used: int, grid: Record, whole: FloatArray,
    left: FloatArray,
) -> None:  # fmt: skip
    """Adds what a fit leaves of its `used` samples to `left` (2, cells), as of `fit_rows`."""
    half_window, cells = grid["half_window_m"], left.shape[1]
    for k in range(used):
        residual = columns[k, FITTED]
        for i in range(FITTED):
            residual -= columns[k, i] * whole[i]
        xi = grid["first_m"] + place[k] * grid["step_m"]
        cell = min(int((xi + half_window) * (0.5 * cells / half_window)), cells - 1)
        left[0, cell] += residual / whole[HEIGHT]
        left[1, cell] += 1.0


# ---- Compiled: a traction beside a passage's form, for each of many onsets (`measure`).
#
#     columns and products of a row (`kernels`) + a traction's wave for each onset
#         --> the joint solution of least misfit
#
# `waves` (g, c): tractions on the grid of the form's table, a column an onset.

#: a row's best onset, NaN without one: its number and that of the onset in the middle of three;
#: squared residual over sigma^2, and length over height [m], at the onset before the middle one, at
#: it, and after it; at the best one with the length's standard error; samples used; the least
#: squared residual with an onset that is far from the best; where the form was put, and how much
#: farther the solution would move it [m]. Beside them the ordinal of the passage, half length of
#: its form, and where its fit without traction puts the form
ONSET = np.dtype(
    [("best", "f8"), ("middle", "f8"), ("chi2_before", "f8"), ("chi2_middle", "f8"),
     ("chi2_after", "f8"), ("length_before", "f8"), ("length_middle", "f8"),
     ("length_after", "f8"), ("chi2", "f8"), ("length", "f8"), ("length_se", "f8"), ("used", "f8"),
     ("rival", "f8"), ("shift", "f8"), ("to_go", "f8"), ("row", "f8"), ("half_length_m", "f8"),
     ("without_m", "f8")]
)  # fmt: skip
#: one onset that was tried: squared residual over sigma^2, length over height and its standard
#: error [m]
TRIED = np.dtype([("chi2", "f8"), ("length", "f8"), ("length_se", "f8")])
#: a traction of which the passage's other columns leave less than this share cannot be parted from
#: them; twice as much tells fewer tractions
LEAST_OWN = 1e-5
#: a joint solution is trusted about where the form was put; beyond, its cost grows with this power
FAR = 4


@compiled
def _beside(
    columns: FloatArray, place: FloatArray, used: int, waves: FloatArray, first: int,
    lined: FloatArray, sums: FloatArray,
) -> None:  # fmt: skip
    """Fills `sums` (FITTED + 2, t) for the t onsets from number `first` on.

    Products of each one's traction with the columns, with the values, and with itself, over the
    `used` samples. `columns` (m + SPARE, FITTED + 1) and `place` (m,) as `look_up` fills them;
    `waves` (g, c); `lined` (t,) is room. Onsets are innermost: what lies side by side is worked on
    at once.
    """
    count = lined.size
    for i in range(FITTED + 2):
        for t in range(count):
            sums[i, t] = 0.0
    for k in range(used):
        low = int(place[k])
        share = place[k] - low
        for t in range(count):
            lined[t] = waves[low, first + t] * (1.0 - share) + waves[low + 1, first + t] * share
            sums[FITTED + 1, t] += lined[t] ** 2
        for i in range(FITTED + 1):
            factor = columns[k, i]
            for t in range(count):
                sums[i, t] += factor * lined[t]


@compiled
def _free_of(beside: FloatArray, inverse: FloatArray, moved: FloatArray) -> float:
    """What a passage's own columns leave of a traction's square; fills `moved` as of `solve`."""
    apply_inverse(inverse, beside, moved)
    free: float = beside[FITTED + 1]
    for i in range(OWN):
        free -= beside[i] * moved[i]
    return free


@compiled
def traction_gains(
    values: FloatArray, motion: Records, table: FloatArray, grid: Record, waves: FloatArray,
    sigma: float, odd_sd: float,
) -> FloatArray:  # fmt: skip
    """Squared `sigma` of misfit that a small traction removes from the fit of each row.

    That of the best onset, (n,); 0 if too few samples are there. `waves` (g, c): tractions on the
    table's grid. `values` (n, m) move as `motion` (n,) says; `table` (g, FITTED) on `grid`, one
    GRID; `odd_sd`: of damping and tilt, in heights.
    """
    out, whole = np.zeros(values.shape[0]), np.empty(FITTED + 1)
    columns, place = np.empty((values.shape[1] + SPARE, FITTED + 1)), np.empty(values.shape[1])
    lined, sums = np.empty(waves.shape[1]), np.empty((FITTED + 2, waves.shape[1]))
    gram, inverse = np.empty((FITTED + 1, FITTED + 1)), np.empty((OWN, OWN))
    moved = np.empty(OWN)
    for row in range(values.shape[0]):
        used, _ = _fit(
            values[row], motion[row], table, grid, sigma, odd_sd, columns, place, gram, inverse,
            whole,
        )  # fmt: skip
        if used < FITTED:
            continue
        _beside(columns, place, used, waves, 0, lined, sums)
        for t in range(lined.size):
            beside = sums[:, t]
            free, left = _free_of(beside, inverse, moved), beside[FITTED]
            for i in range(FITTED):
                left -= whole[i] * beside[i]
            if free > LEAST_OWN * beside[FITTED + 1]:
                out[row] = max(out[row], left**2 / free / sigma**2)
    return out


@compiled
def _joint(
    columns: FloatArray, place: FloatArray, used: int, waves: FloatArray, first: int, sigma: float,
    odd_sd: float, trust_m: float, told: Records, best: FloatArray,
) -> int:  # fmt: skip
    """Form and traction together by least squares for the onsets from `first` on; the best one.

    Returned is the place of the best among them. Filled: the argument (t,) of TRIED, as many as
    are tried; `best` (FITTED + 1,), the form's coefficients and the traction's. A solution that
    moves the form by more than `trust_m` [m] costs more: it is linear about the form's place.

    columns  (m + SPARE, FITTED + 1) and place (m,) as `kernels.look_up` fills them, `used` of them
    waves    (g, c): the traction with each onset, on the table's grid
    """
    gram, inverse = np.empty((FITTED + 1, FITTED + 1)), np.empty((OWN, OWN))
    lined, sums = np.empty(told.size), np.empty((FITTED + 2, told.size))
    whole, moved = np.empty(FITTED + 1), np.empty(OWN)
    products(columns, used, FITTED, gram)
    own_inverse(gram, sigma, odd_sd, inverse)
    solutions = own_solutions(gram, inverse)
    _beside(columns, place, used, waves, first, lined, sums)
    top, lowest = 0, np.inf
    for t in range(told.size):
        beside, one = sums[:, t], told[t]
        free = _free_of(beside, inverse, moved)
        free = max(free, LEAST_OWN * beside[FITTED + 1] + 1e-300)
        solve(solutions, abs(solutions[0, HEIGHT]), beside, moved, free, whole)
        size, height = whole[FITTED], whole[HEIGHT]
        left = quadratic_form(gram, whole)
        left += size * (size * beside[FITTED + 1] - 2.0 * beside[FITTED])
        for i in range(FITTED):
            left += 2.0 * size * whole[i] * beside[i]
        variance = inverse[LENGTH, LENGTH] + moved[LENGTH] ** 2 / free
        one["chi2"], one["length"] = left / sigma**2, whole[LENGTH] / height
        one["length_se"] = sigma / abs(height) * np.sqrt(variance)
        cost = one["chi2"] * max(abs(whole[SHIFT] / height) / trust_m, 1.0) ** FAR
        if t == 0 or cost < lowest:
            top, lowest = t, cost
            best[:] = whole
    return top


@compiled
def _own_shift(whole: FloatArray, most: float) -> float:
    """How far a joint solution `whole` (FITTED + 1,) moves the form on [m], `most` at most."""
    shift = whole[SHIFT] / whole[HEIGHT]
    return 0.0 if np.isnan(shift) else min(max(shift, -most), most)


@compiled
def _moved_on(
    values: FloatArray, motion: Record, table: FloatArray, grid: Record, onset: int, shift: float,
    turns: int, waves: FloatArray, sigma: float, odd_sd: float, trust_m: float, told: Records,
    best: FloatArray, columns: FloatArray, place: FloatArray,
) -> tuple[int, int, int, float]:  # fmt: skip
    """(samples used, first onset, the best one from there on, shift) of a row after `turns`.

    The form lies at `shift` [m] at first, and then where the joint solution `best` moves it. The
    onsets (t,) that are tried lie about the best one, which is `onset` at first.
    """
    used, first, top = 0, 0, 0
    for turn in range(turns):
        used, _ = look_up(values, motion, table, grid, grid["shift_m"] + shift, columns, place)
        if used <= FITTED:
            break
        first = min(max(onset - told.size // 2, 0), waves.shape[1] - told.size)
        top = _joint(
            columns, place, used, waves, first, sigma, odd_sd, trust_m, told, best
        )  # fmt: skip
        onset = first + top
        if turn < turns - 1:
            shift += _own_shift(best, trust_m)
    return used, first, top, shift


@compiled
def follow_rows(
    values: FloatArray, motion: Records, table: FloatArray, grid: Record, waves: FloatArray,
    fine: int, trust_m: float, turns: int, sigma: float, odd_sd: float, found: Records,
) -> None:  # fmt: skip
    """Fills `found` (n,) of ONSET: form and traction of each row with the onset near a start.

    The start is the best onset that `found` has, and where it puts the form; this is put `turns`
    times where the joint solution moves it, with onsets about the best one. NaN is no start; it
    becomes the best onset of a row with too few samples or whose form is not upright. The rival of
    a start is less what that one leaves.
    """
    columns, place = np.empty((values.shape[1] + SPARE, FITTED + 1)), np.empty(values.shape[1])
    told, best = np.empty(2 * fine + 1, TRIED), np.empty(FITTED + 1)
    for row in range(values.shape[0]):
        made = found[row]
        if np.isnan(made["best"]):
            continue
        used, first, top, shift = _moved_on(
            values[row], motion[row], table, grid, int(made["best"]), made["shift"], turns, waves,
            sigma, odd_sd, trust_m, told, best, columns, place,
        )  # fmt: skip
        if used <= FITTED or not best[HEIGHT] > 0.0 or np.isnan(told[top]["chi2"]):
            made["best"] = np.nan
            continue
        middle = min(max(top, 1), told.size - 2)
        before, here, after = told[middle - 1], told[middle], told[middle + 1]
        made["best"], made["middle"], made["used"] = first + top, first + middle, used
        made["chi2_before"], made["length_before"] = before["chi2"], before["length"]
        made["chi2_middle"], made["length_middle"] = here["chi2"], here["length"]
        made["chi2_after"], made["length_after"] = after["chi2"], after["length"]
        made["chi2"], made["length"] = told[top]["chi2"], told[top]["length"]
        made["length_se"] = told[top]["length_se"]
        made["shift"], made["to_go"] = shift, best[SHIFT] / best[HEIGHT]
        made["rival"] += made["chi2"]


@compiled
def seek_rows(
    values: FloatArray, motion: Records, table: FloatArray, grid: Record, waves: FloatArray,
    fine: int, starts_m: FloatArray, trust_m: float, turns: int, sigma: float, odd_sd: float,
    enough: float, apart: int, found: Records,
) -> None:  # fmt: skip
    """Fills starts of `found` (n,) of ONSET: best onset, the form's place with it, its rival.

    The form of each row begins where the fit without traction has it. The evenly spaced `starts_m`
    about that are tried with every `fine`-th of the onsets of `waves` (g, c). From the best
    of these the form is put `turns` times where the joint solution moves it, with onsets about the
    best; the next best ones follow while more than `enough` squared sigmas per sample are left.

    The rival is the least squared residual with an onset more than `apart` from the best one, less
    that one's; costs of what is not to be trusted are in it. A row without a start stays NaN.
    """
    columns, place = np.empty((values.shape[1] + SPARE, FITTED + 1)), np.empty(values.shape[1])
    few = np.ascontiguousarray(waves[:, ::fine])
    told, near, best = (
        np.empty(few.shape[1], TRIED),
        np.empty(2 * fine + 1, TRIED),
        np.empty(FITTED + 1),
    )
    cost, onset, moved = np.empty((3, starts_m.size))
    costs = np.empty((starts_m.size, few.shape[1]))
    for row in range(values.shape[0]):
        made = found[row]
        for k in range(starts_m.size):
            shift = made["without_m"] + starts_m[k]
            used, _, top, _ = _moved_on(
                values[row], motion[row], table, grid, 0, shift, 1, few, sigma, odd_sd, trust_m,
                told, best, columns, place,
            )  # fmt: skip
            far = max(abs(best[SHIFT] / best[HEIGHT]) / trust_m, 1.0) ** FAR
            some = used > FITTED and not np.isnan(told[top]["chi2"] * far)
            for t in range(few.shape[1]):
                costs[k, t] = told[t]["chi2"] * far if some else np.inf
            cost[k] = costs[k, top]
            onset[k], moved[k] = top * fine, shift + _own_shift(best, trust_m)
        left = np.inf
        # starts that are followed to their end at most; twice as many take up to twice as long
        # where the first ones fail
        for _ in range(4):
            k = int(np.argmin(cost))
            if cost[k] == np.inf:
                break
            cost[k] = np.inf
            used, first, top, shift = _moved_on(
                values[row], motion[row], table, grid, int(onset[k]), moved[k], turns, waves,
                sigma, odd_sd, trust_m, near, best, columns, place,
            )  # fmt: skip
            if used > FITTED and best[HEIGHT] > 0.0 and near[top]["chi2"] < left:
                made["best"], made["shift"], left = first + top, shift, near[top]["chi2"]
            if left < enough * used:
                break
        rival = np.inf
        for t in range(few.shape[1]):
            if abs(t * fine - made["best"]) > apart:
                for k in range(starts_m.size):
                    rival = min(rival, costs[k, t])
        made["rival"] = rival - left
