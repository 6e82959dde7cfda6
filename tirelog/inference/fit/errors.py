"""The one error formula of every fit: how well whitened slopes determine the parameters.

slopes (N, p), variance of a residual -> columns of length one -> eigenvectors of the normal
    matrix: seen ones give the covariance, unseen ones (blind) the combinations of parameters
    that the data do not determine
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tirelog.vocabulary.arrays import FloatArray

#: eigenvalues of the normal matrix (columns of length one) below this share of the largest are
#: directions that change nothing; twice as much drops directions that are seen 1.4 times as well
NULL = 1e-10
#: a parameter with more than this share (a cosine) in a blind direction is not determined; twice
#: as much tells errors of parameters of which a fifth cannot be seen
_SHARE = 0.1


@dataclass(frozen=True)
class Errors:
    """What is known of p parameters: standard errors, covariance, blind directions.

    Standard errors (p,), inf if the data are blind; covariance (p, p) along the directions that
    they see; the blind directions (b, p), each of length one in parameters in units of what moves
    the data alike.
    """

    se: FloatArray
    covariance: FloatArray
    blind: FloatArray

    def undetermined(self, names: Sequence[str]) -> list[tuple[str, ...]]:
        """The parameters of each blind direction."""
        return [
            tuple(n for n, share in zip(names, row, strict=True) if abs(share) > _SHARE)
            for row in self.blind
        ]


def errors_of(slopes: FloatArray, variance: float) -> Errors:
    """Standard errors of what has the whitened `slopes` (N, p), for residuals of this variance."""
    p = slopes.shape[1]
    norm = np.linalg.norm(slopes, axis=0)
    usable = norm > 0
    se, covariance, blind = np.full(p, np.inf), np.zeros((p, p)), np.eye(p)[~usable]
    if not usable.any():
        return Errors(se, covariance, blind)
    unit = slopes[:, usable] / norm[usable]
    values, vectors = np.linalg.eigh(unit.T @ unit)
    good = values > NULL * values[-1]
    hidden = np.abs(vectors[:, ~good]).max(axis=1, initial=0.0) > _SHARE
    known = np.where(hidden, np.inf, (vectors[:, good] ** 2 / values[good]).sum(axis=1))
    se[usable] = np.sqrt(variance * known) / norm[usable]
    inverse = (vectors[:, good] / values[good]) @ vectors[:, good].T
    covariance[np.ix_(usable, usable)] = variance * inverse / np.outer(norm[usable], norm[usable])
    unseen = np.zeros((int((~good).sum()), p))
    unseen[:, usable] = vectors[:, ~good].T
    return Errors(se, covariance, np.concatenate([blind, unseen]))
