"""Compiled passes over stamps: each goes through them once, where numpy takes five arrays.

Ten minutes at 10 kHz of one grating, `tirelog tables`: 0.15 s of 1.2 s of CPU time less (23
November 2026, two shared cores, Python 3.11).
"""

from __future__ import annotations

import numpy as np

from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray, IntArray


@compiled
def residual_range(first: int, stamps: FloatArray, period_s: float) -> tuple[float, float]:
    """(least, largest) residual [s] of `stamps` (n,) against a clock, at indices from `first` on.

    Unknown ones (NaN) do not count; (inf, -inf) if none is known.
    """
    low, high = np.inf, -np.inf
    for i in range(stamps.size):
        residual = stamps[i] - period_s * (first + i)
        low = residual if residual < low else low
        high = residual if residual > high else high
    return low, high


@compiled
def small_steps(k: IntArray, stamps: FloatArray, least_s: float) -> int:
    """How many steps between `stamps` (n,) [s] at clock indices `k` (n,) are below `least_s`."""
    small = 0
    for i in range(1, k.size):
        small += abs((stamps[i] - stamps[i - 1]) / (k[i] - k[i - 1])) < least_s
    return small


@compiled
def residual_steps(k: IntArray, stamps: FloatArray, period_s: float, steps: FloatArray) -> None:
    """Fills `steps` (n - 1,) [s] with the sizes of steps of the residual against a clock."""
    before = stamps[0] - period_s * k[0]
    for i in range(1, k.size):
        here = stamps[i] - period_s * k[i]
        steps[i - 1] = abs(here - before)
        before = here


@compiled
def residuals(k: IntArray, stamps: FloatArray, period_s: float, out: FloatArray) -> float:
    """Fills `out` (n,) [s] with the residuals against a clock; the largest step between two [s].

    NaN if one of them is.
    """
    most = 0.0
    for i in range(k.size):
        out[i] = stamps[i] - period_s * k[i]
        if i > 0:
            step = abs(out[i] - out[i - 1])
            most = step if step > most or step != step else most
    return most


@compiled
def moments(k: IntArray, residual: FloatArray) -> tuple[float, float, float, float, float]:
    """Means of `k` and `residual` (n,), and the sums of squares and products about them.

    (mean k, mean r, S_kk, S_kr, S_rr).
    """
    mean_k, mean_r = 0.0, 0.0
    for i in range(k.size):
        mean_k += k[i]
        mean_r += residual[i]
    mean_k, mean_r = mean_k / k.size, mean_r / k.size
    kk, kr, rr = 0.0, 0.0, 0.0
    for i in range(k.size):
        by_k, by_r = k[i] - mean_k, residual[i] - mean_r
        kk += by_k * by_k
        kr += by_k * by_r
        rr += by_r * by_r
    return mean_k, mean_r, kk, kr, rr
