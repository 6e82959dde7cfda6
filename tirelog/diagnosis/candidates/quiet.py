"""Whether what a model leaves is the noise floor."""

from __future__ import annotations

import numpy as np

from tirelog.diagnosis.rules import ERROR_SIGMAS, QUIET_CHI2, QUIET_FLOORS
from tirelog.inference.base import Base, TogetherBase, apart


def quiet(base: Base, floor_square: float) -> bool:
    """Is what the model leaves the noise floor?  By the held-out error and by chi-square.

    Of a held-out error goes what chance adds to it, since few manoeuvres decide the parameters, and
    of a chi-square: that of the 64 values of a number per revolution is above 1.2 in one of eight
    logs in which nothing is missing. Of several observables each has to be at its own: the mean of
    three hides what one is above it.
    """
    if isinstance(base, TogetherBase) and not all(
        quiet(part, part.floor.square) for part in apart(base, held_by_all=True)
    ):
        return False
    if base.reduced_chi2 > QUIET_CHI2 + ERROR_SIGMAS * np.sqrt(2.0 / base.fit.freedom):
        return False
    above = base.square_held - QUIET_FLOORS**2 * floor_square
    if above <= 0.0:
        return True
    mean, spread = base.of_errors
    return above <= mean + ERROR_SIGMAS * spread


def quiet_waveforms(base: Base) -> bool:
    """Is what the model leaves of the waveforms the noise floor?

    Of a number per revolution it may be more: no nuisance of wheel, road or day acts on one.
    """
    parts = apart(base, held_by_all=True)
    waveforms = [part for part in parts if part.cells.phi.shape[1] > 1]
    if len(waveforms) == len(parts):
        return quiet(base, base.floor.square)
    return all(quiet(part, part.floor.square) for part in waveforms)
