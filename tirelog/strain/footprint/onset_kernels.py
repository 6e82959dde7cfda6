"""Compiled: a traction beside a passage's form, for each of many onsets (`slip_onset`).

    columns and products of a row (`kernels`) + a traction's wave for each onset
        --> the joint solution of least misfit

`waves` (g, c): tractions on the grid of the form's table, a column an onset.
"""

from __future__ import annotations

import numpy as np

from tirelog.runtime import compiled
from tirelog.strain.footprint.kernels import (
    FITTED,
    HEIGHT,
    LENGTH,
    OWN,
    SHIFT,
    SPARE,
    apply_inverse,
    bend,
    fitted,
    look_up,
    own_inverse,
    products,
    quadratic_form,
)
from tirelog.vocabulary.arrays import FloatArray, IntArray, Record, Records

#: a row's best onset, NaN without one: its number and that of the onset in the middle of three;
#: squared residual over sigma^2, and length over height [m], at the onset before the middle one, at
#: it, and after it; at the best one with the length's standard error; samples used; the least
#: squared residual with an onset that is far from the best
ONSET = np.dtype(
    [("best", "f8"), ("middle", "f8"), ("chi2_before", "f8"), ("chi2_middle", "f8"),
     ("chi2_after", "f8"), ("length_before", "f8"), ("length_middle", "f8"),
     ("length_after", "f8"), ("chi2", "f8"), ("length", "f8"), ("length_se", "f8"), ("used", "f8"),
     ("rival", "f8")]
)  # fmt: skip
#: one onset that was tried: squared residual over sigma^2, length over height and its standard
#: error [m]
TRIED = np.dtype([("chi2", "f8"), ("length", "f8"), ("length_se", "f8")])
#: a traction of which the passage's other columns leave less than this share cannot be told from
#: them; turns of its quadratic terms
LEAST_OWN, JOINT_ROUNDS = 1e-5, 5
#: a joint solution is trusted this share of the starts' spacing about where the form was put;
#: beyond, its cost grows with this power
TRUST, FAR = 0.5, 4
#: starts that are followed to their end at most
ATTEMPTS = 8


@compiled
def _wave(waves: FloatArray, onset: int, place: FloatArray, used: int, wave: FloatArray) -> None:
    """Fills `wave` (m,) with the traction of onset number `onset` at the samples in use.

    From the table `waves` (g, c), at their places (m,) on its grid.
    """
    for k in range(used):
        low = int(place[k])
        share = place[k] - low
        wave[k] = waves[low, onset] * (1.0 - share) + waves[low + 1, onset] * share


@compiled
def _beside(
    columns: FloatArray,
    wave: FloatArray,
    used: int,
    inverse: FloatArray,
    along: FloatArray,
    moved: FloatArray,
) -> tuple[float, float, float]:
    """The square of a wave beside a form's columns, its product, and the square left.

    The product is that with the values; what is left of the square is beside a passage's own
    columns. Filled: its products with the columns `along` (FITTED,), the inverse times them `moved`
    (OWN,).
    """
    own, right = 0.0, 0.0
    for i in range(FITTED):
        along[i] = 0.0
    for k in range(used):
        own += wave[k] ** 2
        right += wave[k] * columns[k, FITTED]
        for i in range(FITTED):
            along[i] += columns[k, i] * wave[k]
    apply_inverse(inverse, along, moved)
    free = own
    for i in range(OWN):
        free -= along[i] * moved[i]
    return own, right, free


@compiled
def traction_gains(
    values: FloatArray, motion: Records, table: FloatArray, grid: Record, waves: FloatArray,
    every: int, sigma: float, odd_sd: float,
) -> FloatArray:  # fmt: skip
    """Squared `sigma` of misfit that a small traction removes from the fit of each row.

    That of the best onset, (n,); 0 if too few samples are there. `waves` (g, c): tractions on the
    table's grid, of which `every`-th is tried. `values` (n, m) move as `motion` (n,) says; `table`
    (g, FITTED) on `grid`, one GRID; `odd_sd`: of damping and tilt, in heights.
    """
    out, wide = np.zeros(values.shape[0]), table.shape[1]
    columns, place, wave = (
        np.empty((values.shape[1] + SPARE, FITTED + 1)),
        np.empty(values.shape[1]),
        np.empty(values.shape[1]),
    )
    gram, lower, inverse = (
        np.empty((FITTED + 1, FITTED + 1)),
        np.zeros((OWN, OWN)),
        np.empty((OWN, OWN)),
    )
    bends, whole, along, moved = (
        np.empty((3, OWN)),
        np.empty(FITTED),
        np.empty(FITTED),
        np.empty(OWN),
    )
    for row in range(values.shape[0]):
        used, _ = look_up(
            values[row], motion[row], table, grid, grid["shift_m"], 1.0, wide - 1, wide, columns,
            place,
        )  # fmt: skip
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
                out[row] = max(out[row], right**2 / free / sigma**2)
    return out


@compiled
def _joint(
    columns: FloatArray, place: FloatArray, used: int, waves: FloatArray, tried: IntArray,
    sigma: float, odd_sd: float, trust_m: float, told: Records, best: FloatArray,
) -> int:  # fmt: skip
    """Form and traction together by least squares for each onset in `tried`; the best one.

    Returned is the place of the best in `tried` (t,). Filled: `told` (t,) of TRIED; `best`
    (FITTED + 1,), the form's coefficients and the traction's. A solution that moves the form by
    more than `trust_m` [m] costs more: it is linear about where the form stands.

    columns  (m + SPARE, FITTED + 1) and place (m,) as `kernels.look_up` fills them, `used` of them
    waves    (g, c): the traction with each onset, on the table's grid
    """
    gram, lower, inverse = (
        np.empty((FITTED + 1, FITTED + 1)),
        np.zeros((OWN, OWN)),
        np.empty((OWN, OWN)),
    )
    bends, whole, along, moved = (
        np.empty((3, OWN)),
        np.empty(FITTED),
        np.empty(FITTED),
        np.empty(OWN),
    )
    wave, wide = np.empty(used), gram.shape[0] - 1
    products(columns, used, wide, gram)
    own_inverse(gram, wide, sigma, odd_sd, lower, inverse)
    for k, column in enumerate((FITTED, OWN, OWN + 1)):
        apply_inverse(inverse, gram[column], bends[k])
    rough, top, lowest = abs(bends[0, HEIGHT]), 0, np.inf
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
            whole[OWN], whole[OWN + 1] = (
                bend(whole[LENGTH], whole[HEIGHT], rough),
                bend(whole[SHIFT], whole[HEIGHT], rough),
            )
        left = quadratic_form(gram, wide, whole) - 2.0 * size * right + size**2 * own
        for i in range(FITTED):
            left += 2.0 * size * along[i] * whole[i]
        one = told[t]
        one["chi2"] = left / sigma**2
        one["length"] = whole[LENGTH] / whole[HEIGHT]
        one["length_se"] = (
            sigma
            / abs(whole[HEIGHT])
            * np.sqrt(inverse[LENGTH, LENGTH] + moved[LENGTH] ** 2 / free)
        )
        cost = one["chi2"] * max(abs(whole[SHIFT] / whole[HEIGHT]) / trust_m, 1.0) ** FAR
        if t == 0 or cost < lowest:
            top, lowest = t, cost
            for i in range(FITTED):
                best[i] = whole[i]
            best[FITTED] = size
    return top


@compiled
def _own_shift(whole: FloatArray, most: float) -> float:
    """How far a joint solution `whole` (FITTED + 1,) moves the form on [m], `most` at most."""
    shift = whole[SHIFT] / whole[HEIGHT]
    return 0.0 if np.isnan(shift) else min(max(shift, -most), most)


@compiled
def onset_rows(
    values: FloatArray, motion: Records, table: FloatArray, grid: Record, waves: FloatArray,
    fine: int, shift_m: FloatArray, starts_m: FloatArray, turns: int, sigma: float, odd_sd: float,
    enough: float, apart: int, found: Records,
) -> None:  # fmt: skip
    """Fills `found` (n,) of ONSET: form and traction of each row with the best onset.

    `found` comes as NaN, which a row keeps that has too few samples or whose form is not upright.

    The form is put first where `shift_m` (n,) says, with the evenly spaced `starts_m` about it and
    every `fine`-th of the onsets of `waves` (g, c) tried. From the best of these the form is put
    `turns` times where the joint solution moves it, with onsets about the best; the next best ones
    follow while more than `enough` squared sigmas per sample are left.

    The rival is more than `apart` onsets from the best one; costs of what is not to be trusted are
    in its squared residual.
    """
    columns, place = np.empty((values.shape[1] + SPARE, FITTED + 1)), np.empty(values.shape[1])
    wide, coarse, near = (
        table.shape[1],
        np.arange(0, waves.shape[1], fine),
        np.arange(-fine, fine + 1),
    )
    tried = near.copy()
    told, best = np.empty(max(coarse.size, near.size), TRIED), np.empty(FITTED + 1)
    cost, onset, moved = (
        np.empty(starts_m.size),
        np.zeros(starts_m.size, np.int64),
        np.empty(starts_m.size),
    )
    trust_m = TRUST * (starts_m[1] - starts_m[0])
    costs = np.empty((starts_m.size, coarse.size))
    for row in range(values.shape[0]):
        made = found[row]
        for attempt in range(starts_m.size + ATTEMPTS):
            rough, k = attempt < starts_m.size, attempt
            if not rough:
                k = int(np.argmin(cost))
                cost[k] = np.inf
            shift = shift_m[row] + starts_m[k] if rough else moved[k]
            chosen, used, top = int(onset[k]), 0, 0
            for turn in range(1 if rough else turns):
                used, _ = look_up(
                    values[row], motion[row], table, grid, grid["shift_m"] + shift, 1.0, wide - 1,
                    wide, columns, place,
                )  # fmt: skip
                for t in range(near.size):
                    tried[t] = min(max(chosen + near[t], 0), waves.shape[1] - 1)
                now = coarse if rough else tried
                top = _joint(columns, place, used, waves, now, sigma, odd_sd, trust_m, told, best)
                chosen = int(now[top])
                if rough or turn < turns - 1:
                    shift += _own_shift(best, trust_m)
            if rough:
                far = max(abs(best[SHIFT] / best[HEIGHT]) / trust_m, 1.0)
                cost[k], onset[k], moved[k] = told[top]["chi2"] * far**FAR, chosen, shift
                some = used > FITTED and not np.isnan(cost[k])
                for t in range(coarse.size):
                    costs[k, t] = told[t]["chi2"] * far**FAR if some else np.inf
                if not some:
                    cost[k] = np.inf
            elif used > FITTED and best[HEIGHT] > 0.0 and not made["chi2"] <= told[top]["chi2"]:
                middle = min(max(top, 1), near.size - 2)
                made["best"], made["middle"], made["used"] = chosen, tried[middle], used
                before, after = told[middle - 1], told[middle + 1]
                made["chi2_before"], made["length_before"] = before["chi2"], before["length"]
                made["chi2_middle"] = told[middle]["chi2"]
                made["length_middle"] = told[middle]["length"]
                made["chi2_after"], made["length_after"] = after["chi2"], after["length"]
                made["chi2"], made["length"] = told[top]["chi2"], told[top]["length"]
                made["length_se"] = told[top]["length_se"]
            if not rough and made["chi2"] < enough * used:
                break
        if np.isnan(made["best"]):
            continue
        rival = np.inf
        for t in range(coarse.size):
            if abs(coarse[t] - made["best"]) > apart:
                for k in range(starts_m.size):
                    rival = min(rival, costs[k, t])
        made["rival"] = rival
