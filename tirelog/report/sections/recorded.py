"""Sections of what was recorded and driven, and what the sections share.

Each takes recordings or a table's rows (pandas, the command's own columns) and draws them; nothing
is estimated here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tirelog.data.recording import Channel, Recording
from tirelog.dsp.filters import Cutoff
from tirelog.plots.footprint import WINDOW, passage_panels
from tirelog.plots.record import upright
from tirelog.plots.style import decimated
from tirelog.report.figures import (
    GREY,
    INK,
    SCATTER_POINTS,
    SYMBOLS,
    Figure,
    LogColours,
    dots,
    figure,
    layout,
    line,
    thinning,
)
from tirelog.report.page import PageTable, Section
from tirelog.runs.ingest import channel_rows
from tirelog.strain.footprint.kernels import distance_along
from tirelog.strain.footprint.measure import find_edges
from tirelog.strain.footprint.refine import gather_windows
from tirelog.vocabulary.kinds import ACCELERATION_KINDS, STRAIN_KINDS
from tirelog.vocabulary.quality import good_rows

#: gratings drawn over time; a page cannot carry many more, and a person cannot read them
DRAWN_CHANNELS = 6
#: logs whose signals are drawn
DRAWN_LOGS = 3


def text(value: Any) -> str:
    """A number or word as a table cell."""
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else f"{value:.6g}"
    return str(value)


def short_names(logs: Sequence[str]) -> dict[str, str]:
    """Logs by their file names, if these are distinct; else as they are."""
    names = {log: Path(log).name or log for log in logs}
    return names if len(set(names.values())) == len(names) else {log: log for log in logs}


def recorded(recordings: Sequence[Recording], command: str, colours: LogColours) -> Section:
    """What was recorded: logs with their colours, channels, repairs, tire and conditions."""
    names = short_names([r.log for r in recordings])
    known = [_about(recording) for recording in recordings]
    asked = list(dict.fromkeys(key for about in known for key in about))
    same = [key for key in asked if len({about.get(key, "") for about in known}) == 1]
    apart = [key for key in asked if key not in same]
    logs = PageTable(
        "Logs, with their colours in the figures",
        ["log", "channels", "duration [s]", *apart],
        [
            [
                names[recording.log],
                ", ".join(recording.channels),
                text(_duration(recording)),
                *(about.get(key, "") for key in apart),
            ]
            for recording, about in zip(recordings, known, strict=True)
        ],
        [colours(recording.log) for recording in recordings],
    )
    tables, paragraphs = [logs], []
    if same:
        rows = [[key, known[0].get(key, "")] for key in same]
        tables.append(PageTable("Tire and conditions of every log", ["quantity", "value"], rows))
    for recording in recordings:
        of_channels, who = channel_rows(recording), names[recording.log]
        header = [name for name in of_channels if name != "log"]
        cells = [
            [text(of_channels[name][i]) for name in header]
            for i in range(len(of_channels["channel"]))
        ]
        tables.append(PageTable(f"Channels of {who}", header, cells))
        repairs = [
            f"{what} ({n})"
            for done in recording.provenance.get("repairs", {}).values()
            for what, n in done.items()
            if n
        ]
        if repairs:
            paragraphs.append(f"{who}: repaired in the time axis: {', '.join(repairs)}.")
        paragraphs += [f"{who}: {remark}." for remark in recording.remarks]
        paragraphs += [f"{who}: lost: {loss}." for loss in recording.losses]
    words = [f"{measured_on(recordings)}.", *paragraphs]
    return Section("recorded", "What was recorded", command, words, (), tables)


def measured_on(recordings: Sequence[Recording]) -> str:
    """How many logs, how long, which channels, in words."""
    channels = list(dict.fromkeys(name for r in recordings for name in r.channels))
    lasted = sum(_duration(recording) for recording in recordings)
    some = ", ".join(channels[:DRAWN_CHANNELS])
    more = f" and {len(channels) - DRAWN_CHANNELS} more" if len(channels) > DRAWN_CHANNELS else ""
    logs = "1 log" if len(recordings) == 1 else f"{len(recordings)} logs"
    word = "channel" if len(channels) == 1 else "channels"
    return f"{logs}, {lasted:.4g} s, {word} {some}{more}"


def _duration(recording: Recording) -> float:
    """Seconds from the first to the last sample of its longest channel."""
    return max((float(s) for s in channel_rows(recording)["duration_s"]), default=0.0)


def _about(recording: Recording) -> dict[str, str]:
    """What the setup says of tire and conditions, as text."""
    about = recording.setup.tire.known() | recording.setup.conditions.__dict__
    return {key: text(value) for key, value in about.items() if value not in (None, "")}


@dataclass(frozen=True)
class ChannelRows:
    """A channel of a log in a figure: its name in the legend, rows, colour and symbol."""

    name: str
    rows: pd.DataFrame
    colour: int
    symbol: str


def groups(table: pd.DataFrame, colours: LogColours) -> list[ChannelRows]:
    """The table's channels (of each log); at most DRAWN_CHANNELS.

    Of several logs each has its colour, and symbols tell its channels apart.
    """
    logs = [str(log) for log in table["log"].unique()]
    names = short_names(logs)
    several = max(len(logs), len(colours)) > 1
    alone = table["channel"].nunique() == 1  # then the log says it all
    found: list[ChannelRows] = []
    drawn: dict[str, int] = {}
    for (log, channel), rows in table.groupby(["log", "channel"], sort=False, observed=True):
        number = drawn.setdefault(str(log), 0)
        drawn[str(log)] += 1
        name = str(channel)
        if len(logs) > 1:
            name = names[str(log)] if alone else f"{names[str(log)]}: {channel}"
        colour = colours(str(log)) if several else number
        found.append(ChannelRows(name, rows, colour, SYMBOLS[number % len(SYMBOLS)]))
        if len(found) == DRAWN_CHANNELS:
            break
    return found


def points(found: Sequence[ChannelRows], x: str, y: str, **marker: Any) -> list[dict[str, Any]]:
    """A column against another, a trace per group."""
    return [
        dots(g.rows[x], g.rows[y], g.name, g.colour, marker={"symbol": g.symbol, **marker})
        for g in found
    ]


def ways(
    found: Sequence[ChannelRows],
    x: str,
    columns: Mapping[str, str],
    factor: float = 1.0,
    aside: Mapping[str, Any] | None = None,
) -> list[dict[str, Any]]:
    """Several `columns` (name -> words) that tell one quantity, against another.

    Of one group by colour; of several the colour is the group's and the symbol tells them apart.
    All but the first look as `aside` says.
    """
    drawn = []
    one = len(found) == 1
    for g in found:
        rows = g.rows.iloc[:: thinning(len(found) * len(g.rows))]  # one figure's worth for all
        for i, (column, words) in enumerate(columns.items()):
            marker = {"symbol": SYMBOLS[i % len(SYMBOLS)], **((aside or {}) if i else {})}
            name = words if one else g.name if len(columns) == 1 else f"{g.name}, {words}"
            colour = i if one else g.colour
            drawn.append(dots(rows[x], rows[column] * factor, name, colour, marker=marker))
    return drawn


def drawn_of(table: pd.DataFrame) -> list[str]:
    """A sentence if the figures cannot carry every channel or row."""
    channels = int(table[["log", "channel"]].drop_duplicates().shape[0])
    words = []
    if channels > DRAWN_CHANNELS:
        words.append(f"The first {DRAWN_CHANNELS} of {channels} channels are drawn.")
    if len(table) > SCATTER_POINTS:
        words.append(
            f"Of {len(table)} rows each figure draws evenly chosen ones, at most "
            f"{SCATTER_POINTS} a trace; the table has all of them."
        )
    return words


def quality(table: pd.DataFrame, name: str) -> PageTable:
    """How many rows carry which quality."""
    counts = table["quality"].value_counts()
    return PageTable(
        f"Rows of {name} by quality",
        ["quality", "rows"],
        [[str(word), str(n)] for word, n in counts.items() if n],
    )


def reach(values: pd.Series, unit: str) -> str:
    """From the smallest to the largest value, in words."""
    if not values.notna().any():
        return "no value"
    return f"{values.min():.4g} to {values.max():.4g} {unit}"


def drive_section(
    recordings: Sequence[Recording],
    speed: pd.DataFrame,
    command: str,
    remarks: Sequence[str],
    colours: LogColours,
) -> Section:
    """Speed, acceleration, and the recorded signal over time."""
    named = groups(speed, colours)
    v, a = (points(named, "time_s", name) for name in ("speed_m_s", "acceleration_m_s2"))
    driven, pushed = reach(speed["speed_m_s"], "m/s"), reach(speed["acceleration_m_s2"], "m/s²")
    figures = [
        Figure(
            "speed",
            "Speed of the wheel centre",
            f"Speed against time, {driven}.",
            v,
            layout("time [s]", "speed [m/s]"),
        ),
        Figure(
            "acceleration",
            "Acceleration",
            f"Acceleration against time, {pushed}.",
            a,
            layout("time [s]", "acceleration [m/s²]"),
        ),
    ]
    names = short_names([r.log for r in recordings])
    for number, recording in enumerate(recordings[:DRAWN_LOGS]):
        own = colours(recording.log)
        figures += _signals(recording, number, names[recording.log], own)
    words = [
        f"Speed {driven}, acceleration {pushed}, {len(speed)} passages of the patch.",
        *remarks,
        *drawn_of(speed),
    ]
    if len(recordings) > DRAWN_LOGS:
        words.append(f"Signals of the first {DRAWN_LOGS} logs are drawn.")
    return Section("drive", "The drive", command, words, figures, [quality(speed, "speed")])


def _signals(recording: Recording, number: int, log: str, colour: int) -> list[Figure]:
    """Recorded strain [microstrain] or acceleration over time, decimated so that no peak vanishes.

    In the log's colour, if it is one channel.
    """
    figures = []
    for kinds, label, factor in (
        (STRAIN_KINDS, "strain [microstrain]", 1e6),
        (ACCELERATION_KINDS, "radial acceleration [m/s²]", 1.0),
    ):
        channels = recording.of_kind(*kinds)[:DRAWN_CHANNELS]
        if not channels:
            continue
        traces = []
        for i, channel in enumerate(channels):
            time, values = decimated(channel)
            own = colour if len(channels) == 1 else i
            traces.append(line(time, values * factor, channel.name, own, line={"width": 1}))
        name = label.split(" [")[0]
        alt = (
            f"{name} of {', '.join(c.name for c in channels)} over the whole log, the extremes "
            "of each short stretch; drag to zoom."
        )
        figures.append(
            Figure(
                f"signal-{number}-{kinds[0]}",
                f"Recorded {name}, {log}",
                alt,
                traces,
                layout("time [s]", label),
            )
        )
    return figures


# ---- One passage of the patch.
#
# Strain and its derivatives along the tread, with the edges (P2 Figs. 18, 19, 21).
#
#     rows of the footprint table (and accelerations of the speed table)
#         --a clean, nearly free-rolling row--> its window of samples
#         --`strain.footprint.measure.along_tread`, raw and low-passed-->
#         three figures over xi, entry to exit
#
# The edges of the best estimate are the table's times; those by the second derivative are the
# extrema
# that `strain.footprint.measure.find_edges` sees in what is drawn.


#: low-pass of the picture: P2's multiple of the wheel frequency
CUTOFF = "40x"
#: what is read beside the window for the low-pass, in its periods
_BESIDE = 3.0
_UPSAMPLED = 4


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
            return _passage(recording, channel, *_chosen(rows, speed), colour)
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


def _passage(
    recording: Recording, channel: Channel, row: pd.Series, acceleration: float, own: int
) -> list[Figure]:
    """The figures of a chosen row; none if its window has no sample."""
    speed, length = float(row["speed_m_s"]), float(row["length_m"])
    rate = channel.axis.rate_Hz
    v, a = np.array([speed]), np.array([acceleration])
    asked = Cutoff.parse(CUTOFF).frequency(v, recording.setup.tire.radius_m, float("nan"))
    cutoff = np.minimum(asked, 0.49 * rate)
    reach = np.array([0.7 * WINDOW * length / speed * rate + _BESIDE * rate / cutoff[0]])
    index = np.atleast_1d(channel.axis.index(float(row["time_s"])))
    inner = channel.surface == "inner"
    upward = 1.0 if inner else -1.0
    window = next(iter(gather_windows(channel, upward, index, reach, np.zeros(1, np.int64))), None)
    if window is None or not np.isfinite(window.values).any():
        return []
    found = find_edges(
        window.values, window.rate_Hz, window.centre, v, a, cutoff, np.array([0.5 * length]), 0.0,
        _UPSAMPLED,
    )  # fmt: skip
    times = np.array([row["entry_time_s"], row["exit_time_s"]], float) - float(row["time_s"])
    edges_mm = 1e3 * distance_along(times, v, a)
    extrema = 1e3 * np.array([found["entry_m"][0], found["exit_m"][0]])
    onset = edges_mm.mean() + 1e3 * np.array([row.get("slip_onset_m", np.nan)], float)
    lines = [
        mark
        for places, name, dash in (
            (edges_mm, "edges, best estimate", "solid"),
            (extrema, "extrema of d²ε/dξ²", "dash"),
            (onset, "slip onset", "dot"),
        )
        for mark in upright(places[np.isfinite(places)], name, INK, dash=dash)
    ]
    which = f"{Path(recording.log).name}, {channel.name}, revolution {row['revolution']}"
    state = f"{row['time_s']:.2f} s, {speed:.1f} m/s, {acceleration:+.1f} m/s²"
    at = (speed, acceleration, length, float(cutoff[0]))
    panels = passage_panels(window, at, inner, lines, (GREY, own))
    titles = ("Strain", "First derivative of the strain", "Second derivative of the strain")
    return [
        figure(
            f"passage-{name}",
            f"One passage: {title.lower()} ({which}; {state})",
            f"{title} along the tread, entry at the left: {which}, {state}. Contact length "
            f"{1e3 * length:.1f} mm, edges at {edges_mm[0]:.1f} and {edges_mm[1]:.1f} mm from the "
            "patch centre.",
            replace(panel, x="ξ from the patch centre [mm], entry to exit"),
        )
        for name, title, panel in zip(("strain", "first", "second"), titles, panels, strict=True)
    ]
