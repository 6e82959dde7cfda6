"""Compiled: a form and a traction together against each passage's own samples (slip onset), row by row.

    a row of a window --its fit--> what a small traction with each of many onsets would remove of its misfit
                      --form put at several places, onset tried after onset--> the joint solution of least misfit

Tables, grids and rows as in `footprint_kernel`; `waves` (g, c): tractions on the form's grid, a column an onset.
"""

from __future__ import annotations

import numpy as np

from tirelog.compiled import compiled
from tirelog.estimators.footprint_kernel import (
    FITTED,
    HEIGHT,
    LENGTH,
    MOST_SHIFT,
    OWN,
    SHIFT,
    apply,
    bend,
    fitted,
    look_up,
    own_inverse,
    products,
    quadratic_form,
)
from tirelog.recording import FloatArray, IntArray

#: a traction of which the passage's other columns leave less than this share cannot be told from them; turns of its quadratic terms
LEAST_OWN, JOINT_ROUNDS = 1e-5, 5


@compiled
def _wave(waves: FloatArray, onset: int, place: FloatArray, used: int, wave: FloatArray) -> None:
    """The traction with the onset `onset` of the table `waves` (g, c) at the samples in use."""
    for k in range(used):
        low = int(place[k])
        share = place[k] - low
        wave[k] = waves[low, onset] * (1.0 - share) + waves[low + 1, onset] * share


@compiled
def _beside(
    columns: FloatArray, wave: FloatArray, used: int, inverse: FloatArray, along: FloatArray, moved: FloatArray
) -> tuple[float, float, float]:
    """What a wave is beside a form's columns: its square, its product with the values, and what a passage's own columns leave of its
    square; its products with the columns into `along` (FITTED,), the inverse times them into `moved` (OWN,)."""
    own, right = 0.0, 0.0
    for i in range(FITTED):
        along[i] = 0.0
    for k in range(used):
        own += wave[k] ** 2
        right += wave[k] * columns[k, FITTED]
        for i in range(FITTED):
            along[i] += columns[k, i] * wave[k]
    apply(inverse, along, moved)
    free = own
    for i in range(OWN):
        free -= along[i] * moved[i]
    return own, right, free


@compiled
def traction_gains(
    values: FloatArray, window: FloatArray, table: FloatArray, grid: FloatArray, waves: FloatArray, every: int, sigma: float, odd_sd: float,
    scatter: float,
) -> FloatArray:  # fmt: skip
    """Squared sigmas (`sigma` x `scatter`) of misfit that a small traction removes from the fit of each row, the best of the onsets.

    `waves` (g, c): tractions on the table's grid, of which `every`-th is tried; shape (n,).
    """
    out, wide = np.zeros(values.shape[0]), table.shape[1]
    columns, place, wave = np.empty((values.shape[1], FITTED + 1)), np.empty(values.shape[1]), np.empty(values.shape[1])
    gram, lower, inverse = np.empty((FITTED + 1, FITTED + 1)), np.zeros((OWN, OWN)), np.empty((OWN, OWN))
    bends, whole, along, moved = np.empty((3, OWN)), np.empty(FITTED), np.empty(FITTED), np.empty(OWN)
    for row in range(values.shape[0]):
        used, _ = look_up(values[row], window[row], table, grid, 1.0, wide - 1, wide, columns, place)
        if used < FITTED:
            continue
        products(columns, used, wide, gram)
        rough = own_inverse(gram, wide, sigma, odd_sd, lower, inverse)
        fitted(gram, inverse, rough, bends, whole)
        for k in range(used):
            for i in range(FITTED):
                columns[k, FITTED] -= columns[k, i] * whole[i]
        for onset in range(0, waves.shape[1], every):
            _wave(waves, onset, place, used, wave)
            own, right, free = _beside(columns, wave, used, inverse, along, moved)
            if free > LEAST_OWN * own:
                out[row] = max(out[row], right**2 / free / (sigma * scatter) ** 2)
    return out


@compiled
def _joint(
    columns: FloatArray, place: FloatArray, used: int, waves: FloatArray, tried: IntArray, sigma: float, odd_sd: float, least: FloatArray,
    best: FloatArray,
) -> int:  # fmt: skip
    """Form and traction together by least squares for each onset in `tried`: squared residual over sigma^2 into `least`, coefficients of
    the best (the form's FITTED, the traction's) into `best`; the place of the best in `tried`."""
    gram, lower, inverse = np.empty((FITTED + 1, FITTED + 1)), np.zeros((OWN, OWN)), np.empty((OWN, OWN))
    bends, whole, along, moved = np.empty((3, OWN)), np.empty(FITTED), np.empty(FITTED), np.empty(OWN)
    wave, wide = np.empty(used), gram.shape[0] - 1
    products(columns, used, wide, gram)
    own_inverse(gram, wide, sigma, odd_sd, lower, inverse)
    for k, column in enumerate((FITTED, OWN, OWN + 1)):
        apply(inverse, gram[column], bends[k])
    rough, top = abs(bends[0, HEIGHT]), 0
    for t in range(tried.size):
        _wave(waves, tried[t], place, used, wave)
        own, right, free = _beside(columns, wave, used, inverse, along, moved)
        free = max(free, LEAST_OWN * own + 1e-300)
        size, whole[OWN], whole[OWN + 1] = 0.0, 0.0, 0.0
        for _ in range(JOINT_ROUNDS):
            size = right - along[OWN] * whole[OWN] - along[OWN + 1] * whole[OWN + 1]
            for i in range(OWN):
                whole[i] = bends[0, i] - bends[1, i] * whole[OWN] - bends[2, i] * whole[OWN + 1]
                size -= along[i] * whole[i]
            size /= free
            for i in range(OWN):
                whole[i] -= moved[i] * size
            whole[OWN], whole[OWN + 1] = bend(whole[LENGTH], whole[HEIGHT], rough), bend(whole[SHIFT], whole[HEIGHT], rough)
        left = quadratic_form(gram, wide, whole) - 2.0 * size * right + size**2 * own
        for i in range(FITTED):
            left += 2.0 * size * along[i] * whole[i]
        least[t] = left / sigma**2
        if t == 0 or least[t] < least[top]:
            top = t
            for i in range(FITTED):
                best[i] = whole[i]
            best[FITTED] = size
    return top


@compiled
def _own_shift(whole: FloatArray) -> float:
    """How far a joint solution moves the form on."""
    shift = whole[SHIFT] / whole[HEIGHT]
    return 0.0 if np.isnan(shift) else min(max(shift, -MOST_SHIFT), MOST_SHIFT)


@compiled
def onset_rows(
    values: FloatArray, window: FloatArray, table: FloatArray, grid: FloatArray, waves: FloatArray, fine: int, shift_m: FloatArray,
    starts_m: FloatArray, turns: int, sigma: float, odd_sd: float, scatter: float,
) -> FloatArray:  # fmt: skip
    """Form and traction of each row, the form put first where `shift_m` (n,) says, with `starts_m` about it tried, then where the best
    joint solution moves it, `turns` times; onsets are every `fine`-th of `waves` (g, c) first, then those about the best.

    (n, 6): number of the best onset, of the onset in the middle of three, squared residual over (sigma scatter)^2 at those, and the
    length's coefficient over the height's; NaN where there are too few samples or the form is not upright.
    """
    out = np.full((values.shape[0], 6), np.nan)
    columns, place = np.empty((values.shape[1], FITTED + 1)), np.empty(values.shape[1])
    wide, coarse, near = table.shape[1], np.arange(0, waves.shape[1], fine), np.arange(-fine, fine + 1)
    least, best, at = np.empty(max(coarse.size, near.size)), np.empty(FITTED + 1), grid.copy()
    for row in range(values.shape[0]):
        shift, lowest, used, top = shift_m[row], np.inf, 0, 0
        tried = coarse
        for turn in range(starts_m.size + turns):
            trial = turn < starts_m.size
            put = shift_m[row] + starts_m[turn] if trial else shift
            at[3] = grid[3] + put
            used, _ = look_up(values[row], window[row], table, at, 1.0, wide - 1, wide, columns, place)
            top = _joint(columns, place, used, waves, tried, sigma, odd_sd, least, best)
            if trial and least[top] < lowest:
                lowest, shift = least[top], put + _own_shift(best)
            elif not trial and turn < starts_m.size + turns - 1:
                shift += _own_shift(best)
                chosen = tried[top]
                tried = near.copy()
                for t in range(near.size):
                    tried[t] = min(max(chosen + near[t], 0), waves.shape[1] - 1)
        if used < FITTED or not best[HEIGHT] > 0.0:
            continue
        middle = min(max(top, 1), near.size - 2)
        out[row, 0], out[row, 1] = tried[top], tried[middle]
        for k in range(3):
            out[row, 2 + k] = least[middle - 1 + k] / scatter**2
        out[row, 5] = best[LENGTH] / best[HEIGHT]
    return out
