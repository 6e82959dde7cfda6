"""Sections of what was recorded, of each table, and of a campaign's logs.

Each takes recordings or a table's rows (pandas, the command's own columns) and draws them; nothing
is estimated here. Rows with a quality word are counted, not drawn.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tirelog.data.recording import Recording
from tirelog.diagnosis.answer import AnswerTable
from tirelog.errors import UsageError
from tirelog.plots.tables import (
    holds,
    parts_of_frame,
    passage_panels,
    passages,
    rows_of_parts,
    table_panels,
    undrawn,
)
from tirelog.plots.turns import signals
from tirelog.report.page import (
    GREY,
    INK,
    Figure,
    LogColours,
    Section,
    figure,
)
from tirelog.runs.ingest import channel_rows
from tirelog.tables.frame import table_parts
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
    rows = [
        [
            names[recording.log],
            ", ".join(recording.channels),
            text(_duration(recording)),
            *(about.get(key, "") for key in asked),
        ]
        for recording, about in zip(recordings, known, strict=True)
    ]
    own = [colours[Path(recording.log).name] for recording in recordings]
    header = ["log", "channels", "duration [s]", *asked]
    paragraphs = list[str]()
    tables = [AnswerTable("Logs, with their colours in the figures", header, rows, own)]
    for recording in recordings:
        of_channels, who = channel_rows(recording), names[recording.log]
        header = [name for name in of_channels if name != "log"]
        cells = [
            [text(of_channels[name][i]) for name in header]
            for i in range(len(of_channels["channel"]))
        ]
        tables.append(AnswerTable(f"Channels of {who}", header, cells))
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


def quality(table: pd.DataFrame, name: str) -> AnswerTable:
    """How many rows carry which quality."""
    counts = table["quality"].value_counts()
    return AnswerTable(
        f"Rows of {name} by quality",
        ["quality", "rows"],
        [[str(word), str(n)] for word, n in counts.items() if n],
    )


def reach(values: pd.Series, unit: str) -> str:
    """From the smallest to the largest value, in words."""
    if not values.notna().any():
        return "no value"
    return f"{values.min():.4g} to {values.max():.4g} {unit}".removesuffix(" 1")


#: a table, the regressions on speed of a dissipation table, and remarks on it
MadeTable = tuple[pd.DataFrame | None, pd.DataFrame | None, list[str]]
#: a table that has rows, its regressions and remarks, the command that makes it, colours of logs
DrawnTable = tuple[pd.DataFrame, pd.DataFrame | None, list[str], str, LogColours]
#: the sections of tables: their titles
OF_TABLES = {
    "speed": "The drive",
    "footprint": "Footprint",
    "dissipation": "Dissipation",
    "phase-shift": "Phase shift",
}


def table_section(name: str, drawn: DrawnTable, recordings: Sequence[Recording]) -> Section:
    """The section of a table: each quantity over time and over speed, of rows without a mark.

    Of the speed also the recorded signals, of a footprint a passage, of a dissipation the table of
    its regressions.
    """
    table, lines, remarks, command, colours = drawn
    parts = parts_of_frame(table)
    found = rows_of_parts(parts, colours)
    fits = [] if lines is None else lines.astype(object).to_dict("records")
    figures, sizes, clean = list[Figure](), dict[str, str](), good_rows(table["quality"])
    if name == "footprint":
        figures += passage_figures(recordings, parts, colours)
    for quantity, x, panel in table_panels(found, fits):
        if quantity.columns == {"speed_m_s": ""} and name != "speed":
            continue
        best = table.loc[clean, next(c for c in quantity.columns if holds(table, c))]
        size = reach(best * quantity.factor, quantity.unit)
        sizes.setdefault(quantity.name, size)
        title = f"{quantity.name.capitalize()} against {x.split('_')[0]}"
        said = ", ".join(word for c, word in quantity.columns.items() if word and c in table)
        source = f" ({quantity.source})" if quantity.source else ""
        alt = f"{title}{f': {said}' if said else ''}; {size}{source}."
        figures.append(figure(f"{name}-{len(figures)}", title, alt, panel))
    if name == "speed":
        figures += signal_figures(recordings, parts, colours)
    quantities = ", ".join(f"{what} {size}" for what, size in sizes.items())
    said = f"{quantities[:1].upper()}{quantities[1:] or 'Nothing to draw'}"
    words = [f"{said}; {int(clean.sum())} passages without a mark.", *remarks]
    if left_out := undrawn(parts):
        words.append(f"{left_out}.")
    tables = [quality(table, name)]
    if lines is not None:
        shown = [column for column in _HEADS if column in lines]  # an older run's table has fewer
        rows = [[row[column] for column in shown] for row in fits]
        header = [_HEADS[column] for column in shown]
        tables.append(AnswerTable("Regressions on the speed in m/s", header, rows))
    return Section(name, OF_TABLES[name], command, words, figures, tables)


#: columns of the regressions, as the page calls them
_HEADS = {
    "quantity": "quantity", "channel": "channel", "slope": "slope", "slope_se": "its error",
    "slope_lower": "95 % from", "slope_upper": "to", "intercept": "value at speed 0",
    "intercept_se": "its error", "rows": "revolutions", "points": "means",
    "judgement": "judgement",
}  # fmt: skip


def signal_figures(
    recordings: Sequence[Recording], parts: Sequence[Mapping[str, Any]], colours: LogColours
) -> list[Figure]:
    """The recorded strain and acceleration of the first logs, with their passages.

    They are decimated so that no peak vanishes.
    """
    figures = list[Figure]()
    for recording in recordings[:DRAWN_LOGS]:
        channels = recording.of_kind(*STRAIN_KINDS, *ACCELERATION_KINDS)[:DRAWN_CHANNELS]
        own = [part for part in parts if part["log"][0] == recording.log]
        look = (colours[Path(recording.log).name], GREY, INK)
        panels = signals(recording, channels, own, (-np.inf, np.inf), look) if channels else []
        for channel, panel in zip(channels, panels, strict=True):
            which = f"{channel.name}, {Path(recording.log).name}"
            figures.append(
                figure(
                    f"signal-{len(figures)}",
                    f"Recorded signal, {which}",
                    f"The signal of {which} over the whole log, the extremes of each short "
                    "stretch, with its passages; drag to zoom.",
                    panel,
                )
            )
    return figures


def passage_figures(
    recordings: Sequence[Recording], parts: Sequence[Mapping[str, Any]], colours: LogColours
) -> list[Figure]:
    """One passage of the first log: strain and its derivatives along the tread, with the edges.

    None if there is no row without a mark.
    """
    for recording in recordings[:1]:
        for part in (part for part in parts if part["log"][0] == recording.log):
            channel = recording.channels.get(str(part["channel"][0]))
            if channel is None or channel.kind not in STRAIN_KINDS:
                continue
            for row, _ in passages(part)[:1]:
                which = f"{Path(recording.log).name}, {channel.name}"
                state = f"{row['time_s']:.2f} s, {row['speed_m_s']:.1f} m/s"
                colour = colours[Path(recording.log).name]
                panels = passage_panels(recording, channel, row, (GREY, colour), INK)
                return [
                    figure(
                        f"passage-{i}",
                        f"One passage: {title} ({which}; {state})",
                        f"{title.capitalize()} along the tread, entry at the left: {which}, "
                        f"{state}. Contact length {1e3 * row['length_m']:.1f} mm.",
                        replace(panel, x="ξ from the patch centre [mm], entry to exit"),
                    )
                    for i, (title, panel) in enumerate(
                        zip(("strain", "first derivative", "second derivative"), panels)
                    )
                ]
    return []


def campaign(summary: Path, command: str) -> Section:
    """A campaign's logs and how each ended, from its summary.  UsageError: it is none."""
    table = next(table_parts(summary, words=True))
    header, body = list(table), table.to_numpy().tolist()
    if "status" not in header:
        raise UsageError(
            "is no campaign's summary",
            allowed="`tirelog campaign run` writes it",
            do="run it again",
            file=summary,
        )
    status = header.index("status")
    counts = Counter(row[status] for row in body)
    return Section(
        "campaign",
        "The campaign",
        command,
        [f"{len(body)} logs: {', '.join(f'{n} {word}' for word, n in counts.items())}."],
        (),
        [AnswerTable("Logs of the campaign", header, body)],
    )
