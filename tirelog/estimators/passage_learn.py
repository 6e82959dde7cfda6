"""The template of a log's own passages: which of them to learn from, and the rounds of fitting and learning.

rough centres --clusters of neighbours spread over the log--> windows --lay over, learn, fit; again--> Template
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tirelog.estimators.passage_fit import Start, Windows, fit, gather
from tirelog.estimators.passage_search import Pulses
from tirelog.estimators.passage_template import WIDEST_RAD, Template, learn
from tirelog.recording import Channel, FloatArray, IntArray

#: passages that the template is learnt from, in clusters of neighbours, and rounds
LEARNT_FROM, CLUSTERS, ROUNDS = 320, 16, 3
#: the window that is learnt, in half widths
LEARNT_HALF_WIDTHS = 3.0


def _clusters(good: IntArray) -> list[IntArray]:
    """Up to LEARNT_FROM of the passages `good`, as clusters of neighbours spread over the log."""
    if good.size <= LEARNT_FROM:
        return [good[k : k + LEARNT_FROM // CLUSTERS] for k in range(0, good.size, LEARNT_FROM // CLUSTERS)]
    size = LEARNT_FROM // CLUSTERS
    firsts = np.linspace(0, good.size - size, CLUSTERS).astype(np.int64)
    return [good[k : k + size] for k in firsts]


def learn_template(
    channel: Channel, start: Start, good: IntArray, pulses: Pulses, sign: float, noise: float, extremes: tuple[float, float]
) -> Template | None:
    """The template, from the passages `good` (indices); each round fits them with the template of the round before.

    None where there is no such passage, or no curve with two half-level crossings comes of them.
    """
    clusters = _clusters(good)
    if not clusters:
        return None
    window = min(WIDEST_RAD, LEARNT_HALF_WIDTHS * 0.5 * float(np.median(pulses.width[good] / channel.axis.rate_Hz * start.omega[good])))
    starts = [start.take(cluster) for cluster in clusters]
    windows = [gather(channel, part, window, sign, extremes) for part in starts]
    offset = [pulses.base[cluster] for cluster in clusters]
    height = [pulses.height[cluster] for cluster in clusters]
    template: Template | None = None
    for _ in range(ROUNDS):
        phi, values = _laid_over(windows, starts, offset, height)
        template = learn(phi, values, window)
        if template is None:
            return None
        fits = [fit(w, template, s, h, noise) for w, s, h in zip(windows, starts, height, strict=True)]
        offset, height = [f.offset for f in fits], [np.abs(f.height) for f in fits]
        starts = [replace(s, time_s=f.time_s) for s, f in zip(starts, fits, strict=True)]
    return template


def _laid_over(
    windows: list[Windows], starts: list[Start], offset: list[FloatArray], height: list[FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Angles and scaled values of all windows' good samples."""
    phis, scaled = [], []
    for part, start, base, tall in zip(windows, starts, offset, height, strict=True):
        tau = part.time_s - start.time_s[part.row]
        phi = (start.omega[part.row] + 0.5 * start.alpha[part.row] * tau) * tau
        value = (part.values - base[part.row]) / tall[part.row]
        usable = np.isfinite(value) & ~part.clipped & (np.abs(value) < 2.0)
        phis.append(phi[usable])
        scaled.append(value[usable])
    return np.concatenate(phis), np.concatenate(scaled)
