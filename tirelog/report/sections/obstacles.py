"""The section of logs that met an obstacle: how well the model answers it, hit by hit.

MeasuredLogs --`compare_transients` behind `compare`, of a model that moves--> Section
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tirelog.plots.models.transient import SHOWN_S
from tirelog.report.figures import GREY, INK, Figure, LogColours, dots, layout, line
from tirelog.report.page import PageTable, Section
from tirelog.report.sections.models import page_table, shown_value

if TYPE_CHECKING:
    from tirelog.diagnosis.obstacles.compare import HitResult, TransientComparison
    from tirelog.inference.obstacle_log import TransientLog

#: hits that are drawn
_MOST = 3


def not_answered(logs: Sequence[TransientLog], carcass: str, command: str) -> Section:
    """The hits that were found, if the model does not move."""
    hits = sum(log.hits_s.size for log in logs)
    text = (
        f"{hits} hits on an obstacle; answer, comparison and diagnosis leave their revolutions "
        f"out. A {carcass} says nothing of an obstacle; a model with carcass = "
        '"coupled_ring" does.'
    )
    rows = [[Path(log.log).name, log.road.kind, str(log.hits_s.size), _times(log)] for log in logs]
    table = PageTable("Obstacles", ["log", "kind", "hits", "at [s]"], rows)
    return Section("obstacles", "Obstacles", command, [text], (), [table])


def _times(log: TransientLog) -> str:
    return ", ".join(f"{time:.3f}" for time in log.hits_s)


def obstacles(result: TransientComparison, command: str, colours: LogColours) -> Section:
    """Each hit as measured and predicted, what of the added the model misses, and by frequency."""
    factor, unit = shown_value(result.observable, result.unit)
    total = result.to_json()
    words = [
        f"{len(result.hits)} hits on an obstacle, kept apart from the steady revolutions; the "
        f"model covers {100.0 * total['covered']:.0f} % of what they added: "
        f"{total['added'] * factor:.3g} {unit} added, {total['missed'] * factor:.3g} missed, at a "
        f"floor of {total['noise_floor'] * factor:.3g}.",
        f"The prediction has {total['nuisance_parameters']} nuisance numbers (when, phase, level "
        "and alignment of each hit), which the errors are charged for.",
        *(f"{remark}." for remark in result.remarks),
    ]
    if len(result.hits) > _MOST:
        words.append(f"The first {_MOST} hits are drawn; the table has all of them.")
    figures = [
        figure
        for number, hit in enumerate(result.hits[:_MOST])
        for figure in _hit(hit, number, result.observable, factor, unit, colours)
    ]
    table = page_table(result.hits_table(lambda log: Path(log).name))
    return Section("obstacles", "Obstacles", command, words, figures, [table])


def _hit(
    found: HitResult,
    number: int,
    observable: str,
    factor: float,
    unit: str,
    colours: LogColours,
) -> list[Figure]:
    hit, log = found.hit, Path(found.log.log).name
    at = hit.since_s <= SHOWN_S
    time, colour = 1e3 * hit.since_s[at], colours(log)
    which = f"{log}, {hit.time_s:.3f} s, {hit.speed_m_s:.1f} m/s"
    covered = f"{100.0 * found.row()['covered']:.0f} % of the added is covered"
    whole = [
        dots(time, factor * hit.measured[at], "measured", colour, marker={"size": 3}),
        line(time, factor * hit.predicted[at], "model", INK),
    ]
    apart = [
        line(time, factor * hit.added[at], "added by the obstacle", colour),
        line(time, factor * hit.missed[at], "of that missed by the model", INK),
    ]
    since = "time since the hit [ms]"
    figures = [
        Figure(
            f"hit-{number}",
            f"Hit {number + 1}: {which}",
            f"Measured (points) and predicted (line) {observable} after the hit; {covered}.",
            whole,
            layout(since, f"{observable} [{unit}]"),
            half=True,
        ),
        Figure(
            f"hit-added-{number}",
            f"Hit {number + 1}: what the obstacle added, and what the model misses",
            f"Change by the obstacle, and the part that the model does not cover; {covered}.",
            apart,
            layout(since, f"change of {observable} [{unit}]"),
            half=True,
        ),
    ]
    s = found.spectrum
    middle = np.sqrt(np.maximum(s.edges_Hz[:-1], 0.5 * s.edges_Hz[1]) * s.edges_Hz[1:])
    bands = [
        line(middle, factor * np.sqrt(np.maximum(squares, 0.0)), name, of, line={"dash": dash})
        for name, squares, of, dash in (
            ("added", s.added, colour, "solid"),
            ("missed", s.missed, INK, "solid"),
            ("floor", s.floor, GREY, "dash"),
        )
    ]
    shape = layout("frequency [Hz]", f"rms in the band [{unit}]")
    shape["xaxis"] |= {"type": "log"}
    alt = "Root mean squares per band: what the obstacle added, what of it is missed, the floor."
    title = f"Hit {number + 1} by frequency"
    return [*figures, Figure(f"hit-bands-{number}", title, alt, bands, shape)]
