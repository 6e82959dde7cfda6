"""Numbers in the order of driving, about a straight line."""

from __future__ import annotations

import numpy as np

from tirelog.vocabulary.arrays import FloatArray


def without_line(values: FloatArray) -> FloatArray:
    """Values (n,) without the straight line through them."""
    place = np.arange(values.size) - 0.5 * (values.size - 1)
    left: FloatArray = values - values.mean()
    return left - (place @ left) / (place @ place) * place


def scatter_about_line(values: FloatArray) -> float:
    """Standard deviation of values (n,) about a line; of three about their mean, NaN of fewer.

    What moves along a piece is its manoeuvre's: a speed that rises, and what follows it.
    """
    if values.size < 3:
        return float("nan")
    short = values.size == 3
    left = values - values.mean() if short else without_line(values)
    return float(np.sqrt((left @ left) / (values.size - (1 if short else 2))))
