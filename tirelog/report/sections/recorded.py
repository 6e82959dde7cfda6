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

from tirelog.data.recording import Channel, Recording
from tirelog.diagnosis.answer import AnswerTable
from tirelog.dsp.filters import Cutoff
from tirelog.errors import UsageError
from tirelog.plots.record import Mark, Panel, dots, line, upright
from tirelog.plots.style import decimated
from tirelog.plots.tables import free_rolling, passage_panels, passage_window
from tirelog.report.page import (
    GREY,
    INK,
    SCATTER_POINTS,
    SYMBOLS,
    Figure,
    LogColours,
    Section,
    figure,
    thinning,
)
from tirelog.runs.ingest import channel_rows
from tirelog.strain.footprint.kernels import distance_along
from tirelog.strain.footprint.measure import find_edges
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


#: a channel of a log in a figure: its name in the legend, rows, colour and symbol
ChannelRows = tuple[str, pd.DataFrame, int, str]


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


def ways(
    found: Sequence[ChannelRows],
    x: str,
    columns: Mapping[str, str],
    factor: float = 1.0,
    *,
    look: Mapping[str, Any] | None = None,
    aside: Mapping[str, Any] | None = None,
    all_named: bool = False,
) -> list[Mark]:
    """Several `columns` (name -> words) that tell one quantity, against another.

    Of one group by colour; of several the colour is the group's and the symbol tells them apart.
    Points look as `look` says, those of all columns but the first as `aside`. Of several groups the
    words are shown if there are several columns, or with `all_named`.
    """
    drawn = []
    one, worded = len(found) == 1, all_named or len(columns) > 1
    for group, every, own, _ in found:
        rows = every.iloc[:: thinning(len(found) * len(every))]  # one figure's worth for all
        for i, (column, words) in enumerate(columns.items()):
            marker = {"symbol": SYMBOLS[i % len(SYMBOLS)], **((aside if i else look) or {})}
            name = words if one else f"{group}, {words}" if worded else group
            colour = i if one else own
            drawn.append(dots(rows[x], rows[column] * factor, name, colour, marker=marker))
    return drawn


def points(found: Sequence[ChannelRows], x: str, y: str) -> list[Mark]:
    """A column against another, by group."""
    return [
        dots(rows[x], rows[y], name, colour, marker={"symbol": symbol})
        for name, rows, colour, symbol in found
    ]


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


def holds(table: pd.DataFrame, column: str) -> bool:
    """True if the table has a value in this column."""
    return column in table and bool(table[column].notna().any())


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


def drive_section(
    recordings: Sequence[Recording],
    speed: pd.DataFrame,
    command: str,
    remarks: Sequence[str],
    colours: LogColours,
) -> Section:
    """Speed, acceleration, and the recorded signal over time."""
    named = groups(speed, colours)
    driven, pushed = reach(speed["speed_m_s"], "m/s"), reach(speed["acceleration_m_s2"], "m/s²")
    figures = [
        figure(id, title, f"{name} against time, {size}.", Panel("time [s]", label, marks))
        for id, title, name, label, size, marks in (
            ("speed", "Speed of the wheel centre", "Speed", "speed [m/s]", driven,
             points(named, "time_s", "speed_m_s")),
            ("acceleration", "Acceleration", "Acceleration", "acceleration [m/s²]", pushed,
             points(named, "time_s", "acceleration_m_s2")),
        )
    ]  # fmt: skip
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


#: as finely as the low-passed curves are drawn
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
    at = free_rolling(acceleration, rows["speed_m_s"])
    return rows.iloc[at], float(acceleration.iloc[at])


def _passage(
    recording: Recording, channel: Channel, row: pd.Series, acceleration: float, own: int
) -> list[Figure]:
    """The figures of a chosen row; none if its window has no sample."""
    speed, length = float(row["speed_m_s"]), float(row["length_m"])
    rate = channel.axis.rate_Hz
    v, a = np.array([speed]), np.array([acceleration])
    asked = Cutoff.parse("40x").frequency(v, recording.setup.tire.radius_m, float("nan"))  # as P2
    cutoff = np.minimum(asked, 0.49 * rate)
    index = float(channel.axis.index(float(row["time_s"])))
    inner = channel.surface == "inner"
    near = (speed, length, float(cutoff[0]))
    window = passage_window(channel, 1.0 if inner else -1.0, index, *near)
    if window is None or not np.isfinite(window.values).any():
        return []
    found = find_edges(
        window.values, window.rate_Hz, window.motion["centre"], v, a, cutoff,
        np.array([0.5 * length]), 0.0, _UPSAMPLED,
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


# ---- Sections made of one table each.


_METHODS = {
    "length_m": "best estimate",
    "length_d2_m": "second derivative",
    "length_d1_m": "first derivative",
}
_DRAWN = ("log", "channel", "time_s", "speed_m_s", "slip_onset_m", *_METHODS)
_DISSIPATION = (
    *("log", "channel", "time_s", "speed_m_s", "steady"),
    *("specific_power_m3_s2", "specific_power_mean_m3_s2"),
    *("dissipation_factor_1_m", "dissipation_factor_mean_1_m"),
    *("strip_power_W", "strip_rolling_resistance_N"),
)
#: marks of what stands beside the best estimate, of each revolution, and of averages over some
_ASIDE, _PALE = {"size": 6, "opacity": 0.4}, {"size": 4, "opacity": 0.4}
_FULL = {"size": 7, "opacity": 1.0, "symbol": "square"}
#: columns of the regressions, as the page calls them
_HEADS = {
    "quantity": "quantity", "channel": "channel", "slope": "slope", "slope_se": "its error",
    "slope_lower": "95 % from", "slope_upper": "to", "intercept": "value at speed 0",
    "intercept_se": "its error", "rows": "revolutions", "points": "means",
    "judgement": "judgement",
}  # fmt: skip
#: a shift's or width's columns, by the end of their names
_CLEANED = {"": "measured", "_detrended": "detrended", "_corrected": "corrected"}


def footprint_section(
    table: pd.DataFrame,
    command: str,
    remarks: Sequence[str],
    colours: LogColours,
    passage: Sequence[Figure] = (),
) -> Section:
    """Contact lengths by the three methods against speed and time; one passage; slip onsets."""
    good = table.loc[good_rows(table["quality"]), [name for name in _DRAWN if name in table]]
    best = reach(good["length_m"] * 1e3, "mm")
    named = groups(good, colours)
    figures = [*passage] + [
        figure(
            f"length-{name}",
            f"Contact length against {name}",
            f"Contact length by three methods against {label}; best estimate {best}.",
            Panel(label, "contact length [mm]", ways(named, x, _METHODS, 1e3, aside=_ASIDE)),
        )
        for name, x, label in (
            ("speed", "speed_m_s", "speed [m/s]"),
            ("time", "time_s", "time [s]"),
        )
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


def dissipation_section(
    table: pd.DataFrame,
    command: str,
    remarks: Sequence[str],
    colours: LogColours,
    lines: pd.DataFrame | None = None,
) -> Section:
    """The section of a dissipation table, as in P1 Figs. 9 to 11.

    Specific power and factor in time, with their moving averages; averages against speed, with the
    regressions.
    """
    good = table.loc[good_rows(table["quality"]), [name for name in _DISSIPATION if name in table]]
    steady = good[good["steady"].astype(bool)]
    named, averaged = groups(good, colours), groups(steady, colours)
    figures = []
    for quantity, column, mean, unit in (
        ("specific power", "specific_power_m3_s2", "specific_power_mean_m3_s2", "m³/s²"),
        ("dissipation factor", "dissipation_factor_1_m", "dissipation_factor_mean_1_m", "1/m"),
    ):
        title, label = quantity.capitalize(), f"{quantity} [{unit}]"
        marks = ways(named, "time_s", {column: "each revolution"}, look=_PALE)
        marks += ways(averaged, "time_s", {mean: "moving average"}, look=_FULL, all_named=True)
        over = points(averaged, "speed_m_s", mean)
        over += [] if lines is None else _regressions(lines, column, colours)
        figures += [
            figure(
                f"{column}-time",
                f"{title} against time",
                f"{title} against time: {reach(good[column], unit)}, {len(good)} passages, and "
                "moving averages at constant speed (P1 Figs. 9, 10).",
                Panel("time [s]", label, marks),
            ),
            figure(
                f"{column}-speed",
                f"{title} against speed",
                f"Moving averages of the {quantity} against speed: {reach(steady[mean], unit)}, "
                f"{len(steady)} passages (P1 Fig. 11). Why a line is doubtful (dashed), the table "
                "says.",
                Panel("speed [m/s]", label, over),
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


def _regressions(lines: pd.DataFrame, column: str, colours: LogColours) -> list[Mark]:
    """The fitted straight lines of a quantity, channel by channel.

    As `dissipation --fit` gives them.
    """
    drawn = []
    names = short_names([str(log) for log in lines["log"].unique()])
    for i, (_, row) in enumerate(lines[lines["quantity"] == column].iterrows()):
        who = f"{names[str(row['log'])]}: {row['channel']}" if len(names) > 1 else row["channel"]
        colour = colours[Path(str(row["log"])).name] if max(len(names), len(colours)) > 1 else i
        ends = np.array([row["slowest_m_s"], row["fastest_m_s"]], float)
        y = float(row["intercept"]) + float(row["slope"]) * ends
        judged = row.get("judgement")
        doubtful = isinstance(judged, str) and bool(judged)  # the table says why
        style = {"width": 2.5, "dash": "dash" if doubtful else "solid"}
        name = f"{who}, {'doubtful ' if doubtful else ''}fitted line"
        drawn.append(line(ends, y, name, colour, line=style))
    return drawn


def phase_shift_section(
    table: pd.DataFrame, command: str, remarks: Sequence[str], colours: LogColours
) -> Section:
    """The section of a phase-shift table, as in P4 Figs. 8 to 13.

    Phase shift and patch width in time and against speed, raw and cleaned; forces if there is a
    map.
    """
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
            Panel("time [s]", "speed [m/s]", points(named, "time_s", "speed_m_s")),
        )
    ]
    for quantity, size in (("phase_shift", shift), ("patch_width", width)):
        name = quantity.replace("_", " ")
        words = {f"{quantity}{part}_deg": word for part, word in _CLEANED.items()}
        columns = {c: word for c, word in words.items() if holds(good, c)}
        figures += [
            figure(
                f"{quantity}-{x}",
                f"{name.capitalize()} against {along}",
                f"{name.capitalize()} against {along}, {', '.join(columns.values())}: measured "
                f"{size} (P4 Figs. 8 to 13).",
                Panel(f"{along} [{unit}]", f"{name} [deg]", ways(named, x, columns)),
            )
            for x, along, unit in (("time_s", "time", "s"), ("speed_m_s", "speed", "m/s"))
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
