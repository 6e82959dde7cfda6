"""One passage of the patch.

Strain and its derivatives along the tread, with the edges (P2 Figs. 18, 19, 21).

    rows of the footprint table (and accelerations of the speed table)
        --a clean, nearly free-rolling row--> its window of samples
        --`strain.footprint.plain_edges.along_tread`, raw and low-passed-->
        three figures over xi, entry to exit

The edges of the best estimate are the table's times; those by the second derivative are the extrema
that `strain.footprint.plain_edges.find_edges` sees in what is drawn.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tirelog.data.recording import Channel, Recording
from tirelog.dsp.lowpass import Cutoff
from tirelog.report.figures import GREY, INK, Figure, layout, line
from tirelog.strain.footprint.plain_edges import (
    AlongTread,
    Edges,
    along_tread,
    distance_along,
    find_edges,
)
from tirelog.strain.footprint.windows import gather_windows
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.kinds import STRAIN_KINDS
from tirelog.vocabulary.quality import good_rows

#: low-pass of the picture: P2's multiple of the wheel frequency
CUTOFF = "40x"
#: what is drawn, in half lengths, and what is read beside it for the low-pass, in its periods
_WINDOW, _BESIDE = 2.2, 3.0
_UPSAMPLED = 4


@dataclass(frozen=True)
class _Passage:
    """A chosen row with what its window gave.

    `strain` (m,), patch downward, its derivatives; `edges_m` of the table, `by_derivative` as found
    here.
    """

    row: pd.Series
    acceleration_m_s2: float
    cutoff_Hz: float
    strain: FloatArray
    raw: AlongTread
    smooth: AlongTread
    edges_m: tuple[float, float]
    by_derivative: Edges


def passage_figures(
    recording: Recording, footprint: pd.DataFrame, speed: pd.DataFrame | None, colour: int = 0
) -> list[Figure]:
    """The figures of one passage of the recording's first grating with rows, in its colour.

    Empty if there is no row without a mark.
    """
    for channel in recording.of_kind(*STRAIN_KINDS):
        rows = footprint[
            (footprint["log"] == recording.log) & (footprint["channel"] == channel.name)
        ]
        rows = rows[good_rows(rows["quality"]) & rows["length_m"].notna()]
        if len(rows):
            row, acceleration = _chosen(rows, speed)
            passage = _measured(recording, channel, row, acceleration)
            return [] if passage is None else _drawn(recording, channel, passage, colour)
    return []


def _chosen(rows: pd.DataFrame, speed: pd.DataFrame | None) -> tuple[pd.Series, float]:
    """A row of little acceleration and moderate speed, and its acceleration [m/s^2]."""
    acceleration = pd.Series(0.0, index=rows.index)
    if speed is not None:
        known = speed[
            (speed["log"] == rows["log"].iloc[0]) & (speed["channel"] == rows["channel"].iloc[0])
        ]
        known = known.drop_duplicates("revolution").set_index("revolution")["acceleration_m_s2"]
        acceleration = pd.Series(
            known.reindex(rows["revolution"]).to_numpy(float), index=rows.index
        ).fillna(0.0)
    free = acceleration.abs().sort_values(kind="stable").index[: max(len(rows) // 3, 1)]
    chosen = rows.loc[free].sort_values("speed_m_s", kind="stable").iloc[len(free) // 4]
    return chosen, float(acceleration[rows["revolution"] == chosen["revolution"]].iloc[0])


def _measured(
    recording: Recording, channel: Channel, row: pd.Series, acceleration: float
) -> _Passage | None:
    speed, length = float(row["speed_m_s"]), float(row["length_m"])
    rate = channel.axis.rate_Hz
    asked = Cutoff.parse(CUTOFF).frequency(
        np.array([speed]), recording.setup.tire.radius_m, float("nan")
    )
    cutoff = np.minimum(asked, 0.49 * rate)
    reach = np.array([0.7 * _WINDOW * length / speed * rate + _BESIDE * rate / cutoff[0]])
    index = np.atleast_1d(channel.axis.index(float(row["time_s"])))
    upward = 1.0 if channel.surface == "inner" else -1.0
    window = next(iter(gather_windows(channel, upward, index, reach, np.zeros(1, np.int64))), None)
    if window is None or not np.isfinite(window.values).any():
        return None
    v, a = np.array([speed]), np.array([acceleration])
    raw, smooth = (
        along_tread(window.values, window.rate_Hz, window.centre, v, a, cut, up)
        for cut, up in ((np.array([1e9]), 1), (cutoff, _UPSAMPLED))
    )
    found = find_edges(
        window.values,
        window.rate_Hz,
        window.centre,
        v,
        a,
        cutoff,
        np.array([0.5 * length]),
        0.0,
        _UPSAMPLED,
    )
    times = np.array([row["entry_time_s"], row["exit_time_s"]], float) - float(row["time_s"])
    entry, leave = distance_along(times, v, a)
    return _Passage(
        row,
        acceleration,
        float(cutoff[0]),
        window.values[0],
        raw,
        smooth,
        (float(entry), float(leave)),
        found,
    )


def _drawn(recording: Recording, channel: Channel, p: _Passage, own: int) -> list[Figure]:
    length = float(p.row["length_m"])
    reach = 1e3 * _WINDOW * 0.5 * length
    turned = -1.0 if channel.surface == "inner" else 1.0
    which = f"{Path(recording.log).name}, {channel.name}, revolution {p.row['revolution']}"
    state = (
        f"{p.row['time_s']:.2f} s, {p.row['speed_m_s']:.1f} m/s, {p.acceleration_m_s2:+.1f} m/s²"
    )
    figures = []
    raw, smooth = 1e3 * p.raw.xi_m[0], 1e3 * p.smooth.xi_m[0]
    for name, title, label, curves in (
        ("strain", "Strain", "strain [microstrain]", ((raw, 1e6 * turned * p.strain),)),
        (
            "first",
            "First derivative of the strain",
            "dε/dξ [microstrain/mm]",
            ((raw, 1e3 * turned * p.raw.first[0]), (smooth, 1e3 * turned * p.smooth.first[0])),
        ),
        (
            "second",
            "Second derivative of the strain",
            "d²ε/dξ² [microstrain/mm²]",
            ((raw, turned * p.raw.second[0]), (smooth, turned * p.smooth.second[0])),
        ),
    ):
        traces = [
            line(x, y, words, colour, line={"width": width})
            for (x, y), words, colour, width in zip(
                curves,
                ("samples", f"low-pass {p.cutoff_Hz:.0f} Hz"),
                (GREY if len(curves) > 1 else own, own),
                (1.0, 1.5),
                strict=False,
            )
        ]
        x, y = curves[-1]
        seen = y[np.abs(x) < reach]
        low, high = float(np.nanmin(seen)), float(np.nanmax(seen))
        room = 0.15 * (high - low) or 1.0
        ends = (low - room, high + room)
        traces += _edge_lines(p, ends)
        alt = (
            f"{title} along the tread, entry at the left: {which}, {state}. Contact length "
            f"{1e3 * length:.1f} mm, "
            f"edges at {1e3 * p.edges_m[0]:.1f} and {1e3 * p.edges_m[1]:.1f} mm from the patch "
            "centre."
        )
        shape = layout(
            "ξ from the patch centre [mm], entry to exit",
            label,
            xrange=(-reach, reach),
            yrange=ends,
        )
        figures.append(
            Figure(
                f"passage-{name}",
                f"One passage: {title.lower()} ({which}; {state})",
                alt,
                traces,
                shape,
            )
        )
    return figures


def _edge_lines(p: _Passage, ends: tuple[float, float]) -> list[dict[str, Any]]:
    """The edges as upright lines.

    Best estimate (table), extrema of the second and the first derivative, slip onset.
    """
    d = p.by_derivative
    middle = 0.5 * (p.edges_m[0] + p.edges_m[1])
    lines: list[tuple[str, tuple[float, ...], str]] = [
        ("edges, best estimate", p.edges_m, "solid"),
        ("extrema of d²ε/dξ²", (float(d.entry_m[0]), float(d.exit_m[0])), "dash"),
    ]
    onset = p.row.get("slip_onset_m")
    if onset is not None and np.isfinite(float(onset)):
        lines.append(("slip onset", (middle + float(onset),), "dot"))
    drawn = []
    for name, places, dash in lines:
        x = [v for place in places for v in (1e3 * place, 1e3 * place, np.nan)]
        y = [v for _ in places for v in (*ends, np.nan)]
        if np.isfinite(np.asarray(x, float)).any():
            drawn.append(line(x, y, name, INK, line={"dash": dash, "width": 1.5}, hoverinfo="skip"))
    return drawn
