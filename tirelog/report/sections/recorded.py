"""Sections of what was recorded, of each table, and of a campaign's logs.

Each takes recordings or a table's rows (pandas, the command's own columns) and draws them; nothing
is estimated here. Rows with a quality word are counted, not drawn.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tirelog.data.recording import Recording
from tirelog.diagnosis.answer import AnswerTable
from tirelog.errors import UsageError
from tirelog.plots.record import SYMBOLS, Mark, Panel, decimated, line
from tirelog.plots.tables import (
    DISSIPATED,
    LENGTHS,
    SHIFTED,
    ChannelRows,
    dissipation_panels,
    free_rolling,
    holds,
    lengths,
    passage_panels,
    shifts,
    ways,
)
from tirelog.report.page import (
    GREY,
    INK,
    SCATTER_POINTS,
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
    same = [key for key in asked if len({about.get(key, "") for about in known}) == 1]
    apart = [key for key in asked if key not in same]
    logs = AnswerTable(
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
        [colours[Path(recording.log).name] for recording in recordings],
    )
    tables, paragraphs = [logs], []
    if same:
        rows = [[key, known[0].get(key, "")] for key in same]
        tables.append(AnswerTable("Tire and conditions of every log", ["quantity", "value"], rows))
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


def groups(table: pd.DataFrame, colours: LogColours) -> list[ChannelRows]:
    """The table's channels (of each log); at most DRAWN_CHANNELS.

    Of several logs each has its colour, and symbols tell its channels apart.
    """
    logs = [str(log) for log in table["log"].unique()]
    names = short_names(logs)
    several = max(len(logs), len(colours)) > 1
    alone = table["channel"].nunique() == 1  # then the log says it all
    found, drawn = list[ChannelRows](), dict[str, int]()
    for (log, channel), rows in table.groupby(["log", "channel"], sort=False, observed=True):
        number = drawn[str(log)] = drawn.get(str(log), -1) + 1
        name = str(channel)
        if len(logs) > 1:
            name = names[str(log)] if alone else f"{names[str(log)]}: {channel}"
        colour = colours[Path(str(log)).name] if several else number
        found.append((name, rows, colour, SYMBOLS[number % len(SYMBOLS)]))
        if len(found) == DRAWN_CHANNELS:
            break
    return found


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
    return f"{values.min():.4g} to {values.max():.4g} {unit}"


#: a table, the regressions on speed of a dissipation table, and remarks on it
MadeTable = tuple[pd.DataFrame | None, pd.DataFrame | None, list[str]]
#: a table that has rows, its regressions and remarks, the command that makes it, colours of logs
DrawnTable = tuple[pd.DataFrame, pd.DataFrame | None, list[str], str, LogColours]


def drive_section(drawn: DrawnTable, recordings: Sequence[Recording]) -> Section:
    """Speed, acceleration, and the recorded signal over time."""
    speed, _, remarks, command, colours = drawn
    named = groups(speed, colours)
    driven, pushed = reach(speed["speed_m_s"], "m/s"), reach(speed["acceleration_m_s2"], "m/s²")
    figures = [
        figure(
            id,
            title,
            f"{name} against time, {size}.",
            Panel("time [s]", f"{name.lower()} [{unit}]", ways(named, "time_s", {column: name})),
        )
        for id, title, name, unit, size, column in (
            ("speed", "Speed of the wheel centre", "Speed", "m/s", driven, "speed_m_s"),
            (
                *("acceleration", "Acceleration", "Acceleration", "m/s²", pushed),
                "acceleration_m_s2",
            ),
        )
    ]
    names = short_names([r.log for r in recordings])
    for number, recording in enumerate(recordings[:DRAWN_LOGS]):
        figures += _signals(
            recording, number, names[recording.log], colours[Path(recording.log).name]
        )
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
        name, marks = label.split(" [")[0], list[Mark]()
        channels = recording.of_kind(*kinds)[:DRAWN_CHANNELS]
        for i, channel in enumerate(channels):
            time, values = decimated(channel)
            own = colour if len(channels) == 1 else i
            marks.append(line(time, values * factor, channel.name, own, line={"width": 1}))
        if channels:
            figures.append(
                figure(
                    f"signal-{number}-{kinds[0]}",
                    f"Recorded {name}, {log}",
                    f"{name} of {', '.join(c.name for c in channels)} over the whole log, the "
                    "extremes of each short stretch; drag to zoom.",
                    Panel("time [s]", label, marks),
                )
            )
    return figures


# ---- One passage of the patch: strain and its derivatives along the tread, with the edges.


def passage_figures(recording: Recording, footprint: pd.DataFrame, colour: int = 0) -> list[Figure]:
    """The figures of one passage of the recording's first grating with rows, in its colour.

    Empty if there is no row without a mark.
    """
    for channel in recording.of_kind(*STRAIN_KINDS):
        own = (footprint["log"] == recording.log) & (footprint["channel"] == channel.name)
        rows = footprint[own & good_rows(footprint["quality"]) & footprint["length_m"].notna()]
        if not len(rows):
            continue
        row = rows.iloc[free_rolling(rows["time_s"], rows["speed_m_s"])]
        which = f"{Path(recording.log).name}, {channel.name}, revolution {row['revolution']}"
        state = f"{row['time_s']:.2f} s, {row['speed_m_s']:.1f} m/s"
        titles = ("Strain", "First derivative of the strain", "Second derivative of the strain")
        names = ("strain", "first", "second")
        panels = passage_panels(recording, channel, row, (GREY, colour), INK)
        return [
            figure(
                f"passage-{name}",
                f"One passage: {title.lower()} ({which}; {state})",
                f"{title} along the tread, entry at the left: {which}, {state}. Contact length "
                f"{1e3 * row['length_m']:.1f} mm.",
                replace(panel, x="ξ from the patch centre [mm], entry to exit"),
            )
            for name, title, panel in zip(names, titles, panels, strict=False)
        ]
    return []


# ---- Sections made of one table each.


_DRAWN = ("log", "channel", "time_s", "speed_m_s", "slip_onset_m", *LENGTHS)
_DISSIPATION = (
    *("log", "channel", "time_s", "speed_m_s", "steady", *DISSIPATED),
    *(mean for mean, _, _ in DISSIPATED.values()),
    *("strip_power_W", "strip_rolling_resistance_N"),
)
#: columns of the regressions, as the page calls them
_HEADS = {
    "quantity": "quantity", "channel": "channel", "slope": "slope", "slope_se": "its error",
    "slope_lower": "95 % from", "slope_upper": "to", "intercept": "value at speed 0",
    "intercept_se": "its error", "rows": "revolutions", "points": "means",
    "judgement": "judgement",
}  # fmt: skip


def footprint_section(drawn: DrawnTable, recordings: Sequence[Recording]) -> Section:
    """Contact lengths by the three methods against speed and time; one passage; slip onsets."""
    table, _, remarks, command, colours = drawn
    passage = [
        one
        for recording in recordings[:1]
        for one in passage_figures(recording, table, colours[Path(recording.log).name])
    ]
    good = table.loc[good_rows(table["quality"]), [name for name in _DRAWN if name in table]]
    best = reach(good["length_m"] * 1e3, "mm")
    named = groups(good, colours)
    figures = [*passage] + [
        figure(
            f"length-{name}",
            f"Contact length against {name}",
            f"Contact length by three methods against {name}; best estimate {best}.",
            lengths(named, x),
        )
        for name, x in (("speed", "speed_m_s"), ("time", "time_s"))
    ]
    onset = good[good["slip_onset_m"].notna()] if "slip_onset_m" in good else good.iloc[:0]
    words = [
        f"Contact length, best estimate: {best} over {len(good)} passages without a mark.",
        *remarks,
        *drawn_of(good),
    ]
    if len(onset):
        marks = ways(groups(onset, colours), "time_s", {"slip_onset_m": "slip onset"}, 1e3)
        figures.append(
            figure(
                "slip-onset",
                "Slip onset",
                f"{len(onset)} slip onsets, {reach(onset['slip_onset_m'] * 1e3, 'mm')} from the "
                "patch centre, entry negative.",
                Panel("time [s]", "slip onset [mm]", marks),
            )
        )
    else:
        words.append("No slip onset was seen.")
    return Section("footprint", "Footprint", command, words, figures, [quality(table, "footprint")])


def dissipation_section(drawn: DrawnTable, recordings: Sequence[Recording]) -> Section:
    """The section of a dissipation table, as in P1 Figs. 9 to 11.

    Specific power and factor in time, with their moving averages; averages against speed, with the
    regressions.
    """
    table, lines, remarks, command, colours = drawn
    good = table.loc[good_rows(table["quality"]), [name for name in _DISSIPATION if name in table]]
    steady = good[good["steady"].astype(bool)]
    named = groups(good, colours)
    figures, fits = [], _regressions(lines, colours)
    for column, (mean, quantity, unit) in DISSIPATED.items():
        title, (over_time, over) = quantity.capitalize(), dissipation_panels(named, column, fits)
        figures += [
            figure(
                f"{column}-time",
                f"{title} against time",
                f"{title} against time: {reach(good[column], unit)}, {len(good)} passages, and "
                "moving averages at constant speed (P1 Figs. 9, 10).",
                over_time,
            ),
            figure(
                f"{column}-speed",
                f"{title} against speed",
                f"Moving averages of the {quantity} against speed: {reach(steady[mean], unit)}, "
                f"{len(steady)} passages (P1 Fig. 11). Why a line is doubtful (dashed), the table "
                "says.",
                over,
            ),
        ]
    for column, what, label, unit in (
        ("strip_power_W", "Power", "power", "W"),
        ("strip_rolling_resistance_N", "Rolling resistance", "resistance", "N"),
    ):
        if holds(good, column):
            title = f"{what} of the strip under the grating"
            marks = ways(named, "speed_m_s", {column: title.lower()})
            figures.append(
                figure(
                    column,
                    title,
                    f"{title} against speed with the setup's viscosity and section, not the whole "
                    f"tire's: {reach(good[column], unit)}.",
                    Panel("speed [m/s]", f"{label} of the strip [{unit}]", marks),
                )
            )
    words = [
        f"Dissipation factor: {reach(good['dissipation_factor_1_m'], '1/m')} over {len(good)} "
        f"passages, {len(steady)} of them at constant speed.",
        *remarks,
        *drawn_of(good),
    ]
    tables = [quality(table, "dissipation")]
    if lines is not None:
        names = [name for name in _HEADS if name in lines]  # a table of an older run has fewer
        cells = [[row[name] for name in names] for _, row in lines.iterrows()]
        header = [_HEADS[name] for name in names]
        tables.append(AnswerTable("Regressions on the speed in m/s", header, cells))
    return Section("dissipation", "Dissipation", command, words, figures, tables)


def _regressions(
    lines: pd.DataFrame | None, colours: LogColours
) -> list[tuple[str, int, Mapping[str, Any]]]:
    """The rows of `dissipation --fit`, each with its name and the number of its colour."""
    if lines is None:
        return []
    names = short_names([str(log) for log in lines["log"].unique()])
    several, fits = max(len(names), len(colours)) > 1, []
    for _, same in lines.groupby("quantity", sort=False, observed=True):
        for i, (_, row) in enumerate(same.iterrows()):
            who = f"{names[str(row['log'])]}: " * (len(names) > 1) + str(row["channel"])
            fits.append((who, colours[Path(str(row["log"])).name] if several else i, row))
    return fits


def phase_shift_section(drawn: DrawnTable, recordings: Sequence[Recording]) -> Section:
    """The section of a phase-shift table, as in P4 Figs. 8 to 13.

    Phase shift and patch width in time and against speed, raw and cleaned; forces if there is a
    map.
    """
    table, _, remarks, command, colours = drawn
    good = table[good_rows(table["quality"])]
    named = groups(good, colours)
    shift, width = (
        reach(good[f"{quantity}_deg"], "degrees") for quantity in ("phase_shift", "patch_width")
    )
    figures = [
        figure(
            "phase-speed",
            "Speed at the passages",
            f"Speed against time: {reach(good['speed_m_s'], 'm/s')}.",
            Panel("time [s]", "speed [m/s]", ways(named, "time_s", {"speed_m_s": ""})),
        )
    ]
    figures += [
        figure(
            f"{quantity}-{x}",
            f"{name.capitalize()} against {along}",
            f"{name.capitalize()} against {along}: measured {size} (P4 Figs. 8 to 13).",
            shifts(named, quantity, x),
        )
        for quantity, name, size in zip(
            SHIFTED, ("phase shift", "patch width"), (shift, width), strict=True
        )
        for x, along in (("time_s", "time"), ("speed_m_s", "speed"))
    ]
    figures += [
        figure(
            f"{name}_force_N",
            f"{name.capitalize()} force",
            f"{name.capitalize()} force by the calibration: {reach(good[f'{name}_force_N'], 'N')}.",
            Panel(
                "time [s]",
                f"{name} force [N]",
                ways(named, "time_s", {f"{name}_force_N": f"{name} force"}),
            ),
        )
        for name in ("vertical", "longitudinal")
        if holds(good, f"{name}_force_N")
    ]
    said = f"Patch width {width}, phase shift {shift}; negative in braking."
    return Section(
        "phase-shift",
        "Phase shift",
        command,
        [said, *remarks, *drawn_of(good)],
        figures,
        [quality(table, "phase shift")],
    )


#: the section of each table
OF_TABLES: Mapping[str, Callable[[DrawnTable, Sequence[Recording]], Section]] = {
    "speed": drive_section,
    "footprint": footprint_section,
    "dissipation": dissipation_section,
    "phase-shift": phase_shift_section,
}


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
