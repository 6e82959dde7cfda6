"""What is left after the last step, in physical words: where, even or odd, what it follows, at which exponent of speed or fixed frequency.

    projected whitened residual against families of columns  (what a cell is driven under) x (free shapes over the angle)
        1, (v/20)^e for a few e, acceleration, time, load, distance, water          -> the family with the largest T describes it
        rings after the exit edge at a fixed frequency in time, or a fixed wavelength along the tread -> which of the two

Significance by the same sign flips of manoeuvres, the largest over families; size by the held-out removal of the best family.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tirelog.discrepancy.assessment import nuisance_basis
from tirelog.discrepancy.base import Base
from tirelog.discrepancy.floor import held_out_losses
from tirelog.discrepancy.naming import hats
from tirelog.discrepancy.projection import per_manoeuvre, without
from tirelog.discrepancy.selection import ALARM_P, GAIN_SIGMAS, LEAST_SHARE_OF_FLOOR, Scores, flip_test, gain_and_error

FloatArray = NDArray[np.float64]

EXPONENTS = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0)
_FREQUENCIES_HZ = np.geomspace(30.0, 400.0, 36)
_WAVELENGTHS_M = np.geomspace(0.05, 0.5, 24)
_DECAYS_S = (0.008, 0.02)
_DECAYS_M = (0.1, 0.3)
#: a fixed frequency must explain so much more than a fixed wavelength, and so much of what free shapes explain
_RINGS_MORE = 1.15
_RINGS_SHARE = 0.35
#: share of the energy that makes a parity
_PARITY = 0.75


@dataclass(frozen=True)
class Leftover:
    """`size` held-out mean square that the best free shape removes [unit^2]; `shape` (m,) the residual's leading shape over `phi_rad` (m,)."""

    significant: bool
    p: float
    size: float
    where: str | None
    parity: str | None
    follows: str | None
    speed_exponent: float | None
    frequency_Hz: float | None
    shape: FloatArray
    phi_rad: FloatArray


def _factors(base: Base) -> dict[str, FloatArray]:
    """What a cell is driven under, (C,) each, by name; what does not vary is left out."""
    c = base.cells.conditions
    result = {f"speed^{e:g}": (c.speed_m_s / 20.0) ** e for e in EXPONENTS}
    for name, values in (
        ("acceleration", c.acceleration_m_s2),
        ("time", c.time_s - c.time_s.mean()),
        ("load", c.load_N),
        ("distance", c.distance_km),
        ("water", c.water_depth_mm),
    ):
        if np.isfinite(values).all() and np.ptp(values) > 1e-3 * np.abs(values).max():
            result[name] = (values - values.mean()) / np.abs(values).max() if name in ("load", "distance", "water") else values
    return result


def _score(base: Base, basis: FloatArray, residual: FloatArray, columns: FloatArray) -> Scores:
    left = without(basis, base.white(columns))
    flat = left.reshape(-1, left.shape[-1])
    return Scores(per_manoeuvre((np.swapaxes(left, 1, 2) @ residual[..., None])[..., 0], base.cells.manoeuvre), flat.T @ flat)


def describe(base: Base) -> Leftover:
    """The rest that this fit leaves."""
    cells = base.cells
    basis = nuisance_basis(base)
    residual = without(basis, base.white(np.nan_to_num(cells.values - base.fit.prediction)))
    free = hats(cells.phi) if cells.phi.shape[1] > 1 else np.ones((*cells.phi.shape, 1))
    factors = _factors(base)
    scores = [_score(base, basis, residual, factor[:, None, None] * free) for factor in factors.values()]
    statistic, p = flip_test(scores, cells.manoeuvres)
    best = int(np.argmax(statistic))
    name = list(factors)[best]
    held_white, held_plain = held_out_losses(cells, base.white, base.plain, base.fit, factors[name][:, None, None] * free)
    gain, error = gain_and_error(base.held_white, held_white)
    size = float((base.held_plain - held_plain).sum()) / base.plain.weight
    significant = p[best] <= ALARM_P and gain > GAIN_SIGMAS * error and size > LEAST_SHARE_OF_FLOOR * base.floor.square
    shape = leading_shape(base)
    phi = np.nanmean(cells.phi, axis=0)
    if not significant:
        return Leftover(False, float(p[best]), size, None, None, None, None, None, shape, phi)
    frequency = _frequency(base, basis, residual, float(statistic[best])) if cells.phi.shape[1] > 1 else None
    exponent = float(name.split("^")[1]) if name.startswith("speed") else None
    where, parity = (None, None) if cells.phi.shape[1] == 1 else place_and_parity(base, shape, phi)
    return Leftover(True, float(p[best]), size, where, parity, name.split("^")[0], exponent, frequency, shape, phi)


def leading_shape(base: Base) -> FloatArray:
    """The residual's leading shape over the angle, (m,), in the observable's unit at the cell where it is largest."""
    residual = base.plain(np.nan_to_num(base.cells.values - base.fit.prediction - base.offset_of_cell[:, None]))
    size, strength, shape = np.linalg.svd(residual, full_matrices=False)
    scale = strength[0] * np.abs(size[:, 0] / np.maximum(base.plain.weights.max(axis=1), 1e-300)).max()
    sign = np.sign(size[np.argmax(np.abs(size[:, 0])), 0])
    return sign * scale * shape[0]


def half_angle(base: Base) -> float:
    """L / R [rad] of the model's patch, mean over cells."""
    model, conditions = base.model, base.cells.conditions
    return float(np.mean(model.half_length_m(conditions))) / model.values["radius_m"]


def place_and_parity(base: Base, shape: FloatArray, phi: FloatArray) -> tuple[str, str]:
    """(entry, patch, exit or away; even, odd or mixed) of a shape (m,) at angles (m,)."""
    edge = half_angle(base)
    energy = shape**2
    zones = {
        "entry": (phi >= -2.2 * edge) & (phi < -0.6 * edge),
        "patch": np.abs(phi) <= 0.6 * edge,
        "exit": (phi > 0.6 * edge) & (phi <= 2.2 * edge),
        "away": np.abs(phi) > 2.2 * edge,
    }
    total = energy.sum() + 1e-300
    share = {name: float(energy[mask].sum() / total) for name, mask in zones.items()}
    mirrored = np.interp(-phi, phi, shape, period=2.0 * np.pi)
    even = float((((shape + mirrored) / 2.0) ** 2).sum() / total)
    parity = "even" if even > _PARITY else "odd" if even < 1.0 - _PARITY else "mixed"
    return _place(share, parity), parity


def _place(share: dict[str, float], parity: str) -> str:
    """The zone that holds most; both edges alike belong to the patch."""
    if share["away"] > 0.5:
        return "away"
    near = {name: share[name] for name in ("entry", "patch", "exit")}
    if parity != "mixed":
        return "patch"
    return max(near, key=lambda name: near[name])


def _frequency(base: Base, basis: FloatArray, residual: FloatArray, free_t: float) -> float | None:
    """The frequency [Hz] of a ring-down after the exit edge, where a fixed one in time explains more than a fixed wavelength."""
    cells, radius = base.cells, base.model.values["radius_m"]
    after = (np.nan_to_num(cells.phi, nan=-1.0) - half_angle(base)) * radius
    behind = np.maximum(np.where(after > 0, after, after + 2.0 * np.pi * radius), 0.0)
    since = behind / cells.conditions.speed_m_s[:, None]
    factor = (cells.conditions.speed_m_s / 20.0)[:, None, None]

    def explained(phase: FloatArray, decay: FloatArray) -> float:
        wave = np.stack([np.cos(phase), np.sin(phase)], axis=-1) * decay[..., None]
        score = _score(base, basis, residual, np.concatenate([wave, factor * wave], axis=-1))
        return float(np.linalg.norm(score.scores.sum(axis=0) @ score.root()))

    def best(numbers: Sequence[float] | FloatArray, phase: FloatArray, decays: list[FloatArray]) -> tuple[float, float]:
        found = [(explained(phase * (2.0 * np.pi * number), decay), float(number)) for number in numbers for decay in decays]
        return max(found)

    in_time, frequency = best(_FREQUENCIES_HZ, since, [np.exp(-since / d) for d in _DECAYS_S])
    in_space, _ = best(1.0 / _WAVELENGTHS_M, behind, [np.exp(-behind / d) for d in _DECAYS_M])
    if in_time**2 < _RINGS_MORE * in_space**2 or in_time**2 < _RINGS_SHARE * free_t**2:
        return None
    fine = np.linspace(0.93, 1.07, 15) * frequency
    return best(fine, since, [np.exp(-since / d) for d in _DECAYS_S])[1]
