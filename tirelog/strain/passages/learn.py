"""The template of a log's own passages.

Which of them to learn from, and the rounds of fitting and learning.

rough centres --clusters of neighbours spread over the log--> windows
    --lay over, learn, fit; again--> Template
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tirelog.dsp.noise import NORMAL_MEDIAN
from tirelog.strain.passages.fit import (
    PassageFit,
    Signal,
    Start,
    Windows,
    curve_sums,
    fit_passages,
    gather,
    residuals,
)
from tirelog.strain.passages.search import Pulses
from tirelog.strain.passages.template import WIDEST_RAD, Template, learned_template
from tirelog.vocabulary.arrays import FloatArray, IntArray

#: passages that the template is learnt from, in clusters of neighbours, and rounds; twice as many
#: tell the template to 0.7 of the noise, in twice the time
LEARNT_FROM, CLUSTERS, ROUNDS = 320, 16, 3
#: the window that is learnt, in half widths
LEARNT_HALF_WIDTHS = 3.0
#: a passage whose misfit is a larger share of its height is not learnt from; twice as much learns
#: from passages with a tenth of something else in them
ALIKE = 0.15
#: stretches of angle over which the scatter between turns is told, from so many passages at most,
#: and the passages that it takes: of fewer a spike is a large part; twice as many stretches have
#: half of the samples each
SCATTER_PARTS, SCATTER_FROM, FEWEST = 24, 60, 5


def _clusters(good: IntArray) -> list[IntArray]:
    """Up to LEARNT_FROM of the passages `good`, as clusters of neighbours spread over the log."""
    if good.size <= LEARNT_FROM:
        return [
            good[k : k + LEARNT_FROM // CLUSTERS]
            for k in range(0, good.size, LEARNT_FROM // CLUSTERS)
        ]
    size = LEARNT_FROM // CLUSTERS
    firsts = np.linspace(0, good.size - size, CLUSTERS).astype(np.int64)
    return [good[k : k + size] for k in firsts]


def learn_template(signal: Signal, start: Start, good: IntArray, pulses: Pulses) -> Template | None:
    """The template from the passages `good` (indices), or None.

    Each round fits them with the template of the round before. None if there is no such passage, or
    no curve with two half-level crossings comes of them.
    """
    rate_Hz = signal.channel.axis.rate_Hz
    clusters = _clusters(good)
    if not clusters:
        return None
    window = min(
        WIDEST_RAD,
        LEARNT_HALF_WIDTHS
        * 0.5
        * float(np.median(pulses.width[good] / rate_Hz * start.omega[good])),
    )
    chosen = np.concatenate(clusters)
    windows = Windows.concatenate(
        [gather(signal, start.take(cluster), window) for cluster in clusters]
    )
    at, offset, height = start.take(chosen), pulses.base[chosen], pulses.height[chosen]
    like = np.ones(chosen.size, bool)
    template: Template | None = None
    for _ in range(ROUNDS):
        template = learned_template(
            curve_sums(windows.take(like), at.take(like), offset[like], height[like], window),
            window,
        )
        if template is None:
            return None
        found = fit_passages(windows, template, at, height)
        like = (found.height > 0.5 * np.median(height)) & (
            found.misfit < np.maximum(ALIKE * found.height, 3 * signal.noise)
        )
        at = replace(at, time_s=np.where(like, found.time_s, at.time_s))
        offset, height = np.where(like, found.offset, offset), np.where(like, found.height, height)
    if template is None or chosen.size < FEWEST:
        return template
    return replace(template, scatter=_scatter(windows, template, found, at.alpha))


def _scatter(
    windows: Windows, template: Template, found: PassageFit, alpha: FloatArray
) -> FloatArray:
    """Standard deviation between turns beyond the noise over the height, (g,).

    At each angle of the template's table. By medians over short stretches of angle, so that a few
    passages with a spike do not matter; the larger of neighbouring stretches.
    """
    rows = np.unique(np.linspace(0, alpha.size - 1, SCATTER_FROM).astype(np.int64))
    phi, rest = residuals(windows, template, found, alpha, rows)
    place = (phi / template.window_rad + 1.0) * 0.5 * SCATTER_PARTS
    part = np.clip(place.astype(np.int64), 0, SCATTER_PARTS - 1)
    size = np.abs(rest)
    sigma = np.array(
        [
            np.median(size[part == k]) / NORMAL_MEDIAN if (part == k).any() else 0.0
            for k in range(SCATTER_PARTS)
        ]
    )
    noise = windows.signal.noise / np.median(np.abs(found.height))
    padded = np.pad(np.sqrt(np.maximum(sigma**2 - noise**2, 0.0)), 1)
    widest = np.max([padded[:-2], padded[1:-1], padded[2:]], axis=0)
    middles = ((np.arange(SCATTER_PARTS) + 0.5) / SCATTER_PARTS * 2.0 - 1.0) * template.window_rad
    scatter: FloatArray = np.interp(template.phi_rad, middles, widest)
    return scatter
