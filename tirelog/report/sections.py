"""Sections of what was recorded and driven, and what the sections share.

Each takes recordings or a table's rows (pandas, the command's own columns) and draws them; nothing
is estimated here.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tirelog.data.recording import Recording
from tirelog.report.figures import SCATTER_POINTS, Figure, decimated, dots, layout, line
from tirelog.report.page import PageTable, Section
from tirelog.runs.overview import channel_rows
from tirelog.vocabulary.kinds import ACCELERATION_KINDS, STRAIN_KINDS

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


def recorded(recordings: Sequence[Recording], command: str) -> Section:
    """What was recorded: channels, repairs, tire and conditions."""
    tables, paragraphs = [], []
    names = short_names([r.log for r in recordings])
    for recording in recordings:
        rows, who = channel_rows(recording), names[recording.log]
        header = [name for name in rows if name != "log"]
        cells = [[text(rows[name][i]) for name in header] for i in range(len(rows["channel"]))]
        tables.append(PageTable(f"Channels of {who}", header, cells))
        about = recording.setup.tire.__dict__ | recording.setup.conditions.__dict__
        known = [[key, text(value)] for key, value in about.items() if value not in (None, "")]
        tables.append(PageTable(f"Tire and conditions of {who}", ["quantity", "value"], known))
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
    return Section("recorded", "What was recorded", command, paragraphs, (), tables)


def groups(table: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """The table's channels (of each log), named for a legend; at most DRAWN_CHANNELS."""
    logs = [str(log) for log in table["log"].unique()]
    names = short_names(logs)
    found = table.groupby(["log", "channel"], sort=False, observed=True)
    named = (
        (f"{names[str(log)]}: {channel}" if len(logs) > 1 else str(channel), rows)
        for (log, channel), rows in found
    )
    return [group for _, group in zip(range(DRAWN_CHANNELS), named, strict=False)]


def drawn_of(table: pd.DataFrame) -> list[str]:
    """A sentence if the figures cannot carry every channel or row."""
    channels = int(table[["log", "channel"]].drop_duplicates().shape[0])
    words = []
    if channels > DRAWN_CHANNELS:
        words.append(f"Over time the first {DRAWN_CHANNELS} of {channels} channels are drawn.")
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
    recordings: Sequence[Recording], speed: pd.DataFrame, command: str, remarks: Sequence[str]
) -> Section:
    """Speed, acceleration, and the recorded signal over time."""
    named = groups(speed)
    v = [dots(rows["time_s"], rows["speed_m_s"], name, i) for i, (name, rows) in enumerate(named)]
    a = [
        dots(rows["time_s"], rows["acceleration_m_s2"], name, i)
        for i, (name, rows) in enumerate(named)
    ]
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
        figures += _signals(recording, number, names[recording.log])
    words = [
        f"Speed {driven}, acceleration {pushed}, {len(speed)} passages of the patch.",
        *remarks,
        *drawn_of(speed),
    ]
    if len(recordings) > DRAWN_LOGS:
        words.append(f"Signals of the first {DRAWN_LOGS} logs are drawn.")
    return Section("drive", "The drive", command, words, figures, [quality(speed, "speed")])


def _signals(recording: Recording, number: int, log: str) -> list[Figure]:
    """Recorded strain [µm/m] or acceleration over time, decimated so that no peak vanishes."""
    figures = []
    for kinds, label, factor in (
        (STRAIN_KINDS, "strain [µm/m]", 1e6),
        (ACCELERATION_KINDS, "radial acceleration [m/s²]", 1.0),
    ):
        channels = recording.of_kind(*kinds)[:DRAWN_CHANNELS]
        if not channels:
            continue
        traces = []
        for i, channel in enumerate(channels):
            time, values = decimated(channel)
            traces.append(line(time, values * factor, channel.name, i, line={"width": 1}))
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
