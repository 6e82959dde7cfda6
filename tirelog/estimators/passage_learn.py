"""The template of a log's own passages: which of them to learn from, and the rounds of fitting and learning.

rough centres --clusters of neighbours spread over the log--> windows --lay over, learn, fit; again--> Template
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tirelog.estimators.passage_fit import Signal, Start, Windows, curve_sums, fit, gather
from tirelog.estimators.passage_search import Pulses
from tirelog.estimators.passage_template import WIDEST_RAD, Template, learn
from tirelog.recording import IntArray

#: passages that the template is learnt from, in clusters of neighbours, and rounds
LEARNT_FROM, CLUSTERS, ROUNDS = 320, 16, 3
#: the window that is learnt, in half widths
LEARNT_HALF_WIDTHS = 3.0
#: a passage whose misfit is a larger share of its height is not learnt from
ALIKE = 0.15


def _clusters(good: IntArray) -> list[IntArray]:
    """Up to LEARNT_FROM of the passages `good`, as clusters of neighbours spread over the log."""
    if good.size <= LEARNT_FROM:
        return [good[k : k + LEARNT_FROM // CLUSTERS] for k in range(0, good.size, LEARNT_FROM // CLUSTERS)]
    size = LEARNT_FROM // CLUSTERS
    firsts = np.linspace(0, good.size - size, CLUSTERS).astype(np.int64)
    return [good[k : k + size] for k in firsts]


def learn_template(signal: Signal, start: Start, good: IntArray, pulses: Pulses) -> Template | None:
    """The template, from the passages `good` (indices); each round fits them with the template of the round before.

    None where there is no such passage, or no curve with two half-level crossings comes of them.
    """
    rate_Hz = signal.channel.axis.rate_Hz
    clusters = _clusters(good)
    if not clusters:
        return None
    window = min(WIDEST_RAD, LEARNT_HALF_WIDTHS * 0.5 * float(np.median(pulses.width[good] / rate_Hz * start.omega[good])))
    chosen = np.concatenate(clusters)
    windows = Windows.concatenate([gather(signal, start.take(cluster), window) for cluster in clusters])
    at, offset, height = start.take(chosen), pulses.base[chosen], pulses.height[chosen]
    like = np.ones(chosen.size, bool)
    template: Template | None = None
    for _ in range(ROUNDS):
        template = learn(curve_sums(windows.take(like), at.take(like), offset[like], height[like], window), window)
        if template is None:
            return None
        found = fit(windows, template, at, height)
        like = (found.height > 0.5 * np.median(height)) & (found.misfit < np.maximum(ALIKE * found.height, 3 * signal.noise))
        at = replace(at, time_s=np.where(like, found.time_s, at.time_s))
        offset, height = np.where(like, found.offset, offset), np.where(like, found.height, height)
    return template
