"""How well means of numbers per revolution are known: their scatter, how alike neighbours are."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.special import digamma, polygamma

from tirelog.inference.cells.lines import without_line
from tirelog.inference.cells.pieces import Pieces
from tirelog.vocabulary.arrays import FloatArray

#: a piece's scatter below this share of the usual one is taken as that for what all pieces say:
#: values may be alike by rounding; half as much lets one such piece count for the more
_LEAST_SCATTER = 0.1
#: degrees of freedom that all pieces together stand for beside one, at most: then they are alike to
#: a tenth; twice as many, to 7 %
_MOST_PRIOR = 200.0
#: neighbours that numbers are alike with, told by pieces of so many revolutions; twice as many of
#: the first tell a road that wanders over more turns, and of others noise
NEIGHBOURS, LONG = 2, 20


def scatter_of_numbers(pieces: Pieces, alike: float = 1.0) -> FloatArray:
    """With one angle only: standard deviation of single revolutions (P, 1).

    A piece's own, drawn towards that of all pieces as far as its few revolutions leave it unknown:
    the mean of a scaled inverse chi-square whose spread over the pieces tells how much they differ
    (Smyth, Stat. Appl. Genet. Mol. Biol. 3 (2004) 3). By itself a scatter of four revolutions makes
    a chi-square of three out of nothing. About their own line neighbours that are `alike` scatter
    by less than about the one of all.
    """
    number = pieces.count[:, 0].astype(np.float64)
    own = pieces.scatter[:, 0] / np.sqrt([_about_a_line(int(n), alike) for n in number])
    # squares are alike over fewer neighbours than values: of a Markov chain, so many times fewer
    freedom = np.maximum(2.0 * alike / (alike**2 + 1.0) * number - 2.0, 1.0)
    known = np.isfinite(own)
    usual = float(np.median(own[known])) if known.any() else np.nan
    if not usual > 0.0:
        return np.full(pieces.scatter.shape, usual)
    size = np.maximum(own[known], _LEAST_SCATTER * usual)
    half = 0.5 * freedom[known]
    log = 2.0 * np.log(size) - digamma(half) + np.log(half)
    differ = float(np.sum((log - log.mean()) ** 2) / max(log.size - 1, 1))
    differ -= float(polygamma(1, half).mean())
    prior = _MOST_PRIOR
    if differ > 0.0:  # trigamma falls: the least number of degrees of freedom that differs so much
        tried = np.geomspace(0.1, _MOST_PRIOR, 400)
        prior = float(tried[np.argmin(np.abs(polygamma(1, 0.5 * tried) - differ))])
    # the mean of logarithms, which the few pieces in which the number moves do not decide
    weight = 1.0 / (polygamma(1, half) + max(differ, 0.0))
    of_all = np.exp(np.average(log, weights=weight) + digamma(0.5 * prior) - np.log(0.5 * prior))
    told = np.where(known, freedom, 0.0)
    square = (prior * of_all + told * np.where(known, own, 0.0) ** 2) / (prior + told)
    return np.asarray(np.sqrt(square), dtype=np.float64)[:, None]


@lru_cache(maxsize=4096)
def _about_a_line(number: int, alike: float) -> float:
    """Mean square of so many numbers about their own line over that about the line of all.

    The trace of what the line leaves of their correlation: of the next neighbour, and if that were
    more than a half of the one after it too.
    """
    if number < 4:
        return 1.0
    beyond = 0.5 * (alike - 1.0)
    near = [beyond] if beyond <= 0.5 else [0.5 * beyond] * NEIGHBOURS
    place = np.arange(number) - 0.5 * (number - 1)
    place /= np.sqrt(place @ place)
    left = number - 2.0
    for lag, correlation in enumerate(near, start=1):
        hat = (number - lag) / number + float(place[lag:] @ place[:-lag])
        left -= 2.0 * correlation * hat
    return max(left / (number - 2.0), 0.2)


def alikeness(pieces: Pieces) -> float:
    """Variance of a mean of numbers over what it would be if neighbours were not alike, at least 1.

    By pieces of LONG revolutions and more: loads of a road wander over more than a turn. It is
    asked about a straight line, as their scatter is; about that through n each product is less by
    twice that variance over n, at small lags.
    """
    lags = np.arange(1, 1 + NEIGHBOURS)
    long = [
        without_line(about)
        for about in np.split(pieces.coefficients[:, 2], np.cumsum(pieces.number)[:-1])
        if about.size >= LONG
    ]
    square = float(sum(about @ about for about in long))
    if not square > 0.0:
        return 1.0
    values = sum(about.size for about in long)
    mean_size = values / len(long)
    seen: float = sum(
        sum(float(about[lag:] @ about[:-lag]) for about in long) * mean_size / (mean_size - lag)
        for lag in lags
    )
    seen /= square
    found = max((1.0 + 2.0 * seen) / (1.0 - 4.0 * (NEIGHBOURS - seen) / mean_size), 1.0)
    # squared errors are divided by it: as far as it scatters (Bartlett), their mean is larger
    return found * (1.0 + 4.0 * NEIGHBOURS / values)
