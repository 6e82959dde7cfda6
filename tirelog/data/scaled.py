"""Samples as they are stored, brought to SI when they are read."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.kernels import built, compiled
from tirelog.vocabulary.arrays import FloatArray


@dataclass(frozen=True)
class Scaled:
    """Samples as they are stored, brought to SI when they are read.

    raw x scale + offset, NaN if raw is `lost` (None: never).

    `raw(start, stop)` gives the stored numbers; counts of int32 take half of the memory of what
    they become. `at_hand` if they are stored as they are, so that reading them again costs little.
    """

    raw: Callable[[int, int], NDArray[Any]]
    scale: float
    offset: float
    lost: int | None = None
    at_hand: bool = False

    def __call__(self, start: int, stop: int) -> FloatArray:
        raw = self.raw(start, stop)
        if raw.dtype == np.int32 and self.lost is not None and _loop_at_hand():
            counted = np.empty(raw.size)
            scaled_counts(raw, self.scale, self.offset, self.lost, counted)
            return counted
        values = raw.astype(np.float64)
        with np.errstate(
            over="ignore", invalid="ignore"
        ):  # a cell of 1e308 leaves the range of floats, as its channel's unit may
            values *= self.scale
            values += self.offset
        if self.lost is not None:
            values[raw == self.lost] = np.nan
        return values


def _loop_at_hand() -> bool:
    """True if the loop costs less than numpy: it need not be compiled first."""
    return built.at_hand() or "numba" in sys.modules


@compiled
def scaled_counts(
    raw: NDArray[np.int32], scale: float, offset: float, lost: int, out: FloatArray
) -> None:
    """Fills `out` (n,) with raw x scale + offset, NaN where `raw` (n,) is `lost`."""
    for i in range(raw.size):
        out[i] = np.nan if raw[i] == lost else raw[i] * scale + offset
