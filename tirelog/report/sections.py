"""Sections made of tables: what was recorded, the drive, footprint, dissipation, phase shift.

Each takes the table's rows (pandas, the command's own columns) and draws them; nothing is estimated here.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from tirelog.overview import channel_rows
from tirelog.recording import Recording
from tirelog.report.figures import Figure, decimated, dots, layout, line
from tirelog.report.page import Section, Table

#: gratings drawn over time; a page cannot carry many more, and a person cannot read them
DRAWN_CHANNELS = 6


def text(value: Any) -> str:
    """A number or word as a table cell."""
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else f"{value:.6g}"
    return str(value)


def recorded(recordings: list[Recording]) -> Section:
    """What was recorded: channels, repairs, tire and conditions."""
    tables, paragraphs = [], []
    for recording in recordings:
        rows = channel_rows(recording)
        header = [name for name in rows if name != "log"]
        cells = [[text(rows[name][i]) for name in header] for i in range(len(rows["channel"]))]
        tables.append(Table(f"Channels of {recording.log}", header, cells))
        about = recording.setup.tire.__dict__ | recording.setup.conditions.__dict__
        known = [[key, text(value)] for key, value in about.items() if value not in (None, "")]
        tables.append(Table(f"Tire and conditions of {recording.log}", ["quantity", "value"], known))
        repairs = [f"{what} ({n})" for done in recording.provenance.get("repairs", {}).values() for what, n in done.items() if n]
        if repairs:
            paragraphs.append(f"{recording.log}: repaired in the time axis: {', '.join(repairs)}.")
        paragraphs += [f"{recording.log}: {remark}." for remark in recording.remarks]
        paragraphs += [f"{recording.log}: lost: {loss}." for loss in recording.losses]
    return Section("recorded", "What was recorded", "tirelog info LOG", paragraphs, (), tables)


def _groups(table: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """The table's channels (of each log), named for a legend."""
    several = table["log"].nunique() > 1
    return [
        (f"{log}: {channel}" if several else str(channel), rows) for (log, channel), rows in table.groupby(["log", "channel"], sort=False)
    ]


def _quality(table: pd.DataFrame, name: str) -> Table:
    """How many rows carry which quality."""
    counts = table["quality"].value_counts()
    return Table(f"Rows of {name} by quality", ["quality", "rows"], [[str(word), str(n)] for word, n in counts.items()])


def drive(recordings: list[Recording], speed: pd.DataFrame) -> Section:
    """Speed, acceleration, and the recorded signal over time."""
    groups = _groups(speed)[:DRAWN_CHANNELS]
    v = [dots(rows["time_s"], rows["speed_m_s"], name, i) for i, (name, rows) in enumerate(groups)]
    a = [dots(rows["time_s"], rows["acceleration_m_s2"], name, i) for i, (name, rows) in enumerate(groups)]
    reach = f"{speed['speed_m_s'].min():.2f} to {speed['speed_m_s'].max():.2f} m/s over {len(speed)} passages"
    figures = [
        Figure("speed", "Speed of the wheel centre", f"Speed against time, {reach}.", v, layout("time [s]", "speed [m/s]")),
        Figure(
            "acceleration",
            "Longitudinal acceleration",
            "Acceleration against time at each passage.",
            a,
            layout("time [s]", "acceleration [m/s²]"),
        ),
    ]
    for recording in recordings[:3]:
        figures += _signals(recording)
    return Section("drive", "The drive", "tirelog speed LOG", [f"Speed {reach}."], figures, [_quality(speed, "speed")])


def _signals(recording: Recording) -> list[Figure]:
    """Recorded strain (microstrain) or acceleration over time, decimated so that no peak vanishes."""
    figures = []
    for kinds, label, factor in (
        (("fbg_strain", "strain"), "strain [µm/m]", 1e6),
        (("radial_acceleration",), "radial acceleration [m/s²]", 1.0),
    ):
        channels = recording.of_kind(*kinds)[:DRAWN_CHANNELS]
        if not channels:
            continue
        traces = []
        for i, channel in enumerate(channels):
            time, values = decimated(channel)
            traces.append(line(time, values * factor, channel.name, i))
        name = label.split(" [")[0]
        alt = f"{name} of {', '.join(c.name for c in channels)} over the whole log, the extremes of each short stretch; drag to zoom."
        figures.append(
            Figure(f"signal-{_slug(recording.log)}-{kinds[0]}", f"Recorded {name}, {recording.log}", alt, traces, layout("time [s]", label))
        )
    return figures


def _slug(name: str) -> str:
    """An element id from a hostile name."""
    return "".join(c if c.isascii() and c.isalnum() else "-" for c in name)


def footprint(table: pd.DataFrame) -> Section:
    """Contact lengths by the three methods against speed and time; slip onsets."""
    good = table[table["quality"] == "ok"]
    figures = []
    for id, x, label in (("length-speed", "speed_m_s", "speed [m/s]"), ("length-time", "time_s", "time [s]")):
        traces = [
            dots(good[x], good[column] * 1e3, name, i)
            for i, (column, name) in enumerate(
                (("length_m", "best estimate"), ("length_d2_m", "second derivative"), ("length_d1_m", "first derivative"))
            )
        ]
        alt = f"Contact length by three methods against {label}; best estimate {_spread(good['length_m'] * 1e3, 'mm')}."
        figures.append(Figure(id, f"Contact length against {label.split(' [')[0]}", alt, traces, layout(label, "contact length [mm]")))
    onset = good[good["slip_onset_m"].notna()] if "slip_onset_m" in good else good.iloc[:0]
    if len(onset):
        traces = [dots(onset["time_s"], onset["slip_onset_m"] * 1e3, "slip onset")]
        shape = layout("time [s]", "abscissa of the slip onset [mm]")
        figures.append(Figure("slip-onset", "Slip onset", f"{len(onset)} slip onsets.", traces, shape))
    words = [f"Contact length, best estimate: {_spread(good['length_m'] * 1e3, 'mm')} over {len(good)} passages without a mark."]
    return Section("footprint", "Footprint", "tirelog footprint LOG", words, figures, [_quality(table, "footprint")])


def dissipation(table: pd.DataFrame) -> Section:
    """P1 Figs. 9 to 11: factor and specific power in time and against speed."""
    good = table[table["quality"] == "ok"]
    steady = good[good["steady"].astype(bool)]
    figures = []
    for id, x, label, rows, mean in (
        ("time", "time_s", "time [s]", good, ""),
        ("speed", "speed_m_s", "speed [m/s], moving averages at constant speed", steady, "_mean"),
    ):
        for quantity, column, unit in (
            ("Dissipation factor", f"dissipation_factor{mean}_1_m", "1/m"),
            ("Specific power", f"specific_power{mean}_m3_s2", "m³/s²"),
        ):
            title = f"{quantity} against {id}"
            alt = f"{title}: {_spread(rows[column], unit)}, {len(rows)} passages."
            traces = [dots(rows[x], rows[column], quantity.lower())]
            figures.append(Figure(f"{column}-{id}", title, alt, traces, layout(label, f"{quantity.lower()} [{unit}]")))
    spread = _spread(good["dissipation_factor_1_m"], "1/m")
    words = [f"Dissipation factor: {spread} over {len(good)} passages, {len(steady)} of them at constant speed."]
    return Section("dissipation", "Dissipation", "tirelog dissipation LOG", words, figures, [_quality(table, "dissipation")])


def phase_shift(table: pd.DataFrame) -> Section:
    """P4: patch width and phase shift in time, raw, detrended and corrected, and against speed."""
    good = table[table["quality"] == "ok"]
    figures = []
    for quantity, label in (("patch_width", "patch width [deg]"), ("phase_shift", "phase shift [deg]")):
        columns = [
            c for c in (f"{quantity}_deg", f"{quantity}_detrended_deg", f"{quantity}_corrected_deg") if c in good and good[c].notna().any()
        ]
        names = [c.removesuffix("_deg").removeprefix(quantity).strip("_") or "measured" for c in columns]
        for x, axis_label in (("time_s", "time [s]"), ("speed_m_s", "speed [m/s]")):
            traces = [dots(good[x], good[c], name, i) for i, (c, name) in enumerate(zip(columns, names, strict=True))]
            title = f"{label.split(' [')[0].capitalize()} against {axis_label.split(' [')[0]}"
            alt = f"{title}: {_spread(good[f'{quantity}_deg'], 'degrees')}."
            figures.append(Figure(f"{quantity}-{x}", title, alt, traces, layout(axis_label, label)))
    width, shift = _spread(good["patch_width_deg"], "degrees"), _spread(good["phase_shift_deg"], "degrees")
    words = [f"Patch width {width}, phase shift {shift}; negative in braking."]
    return Section("phase-shift", "Phase shift", "tirelog phase-shift LOG", words, figures, [_quality(table, "phase shift")])


def _spread(values: pd.Series, unit: str) -> str:
    """Median and the middle 90 %, in words."""
    if not values.notna().any():
        return "no value"
    low, middle, high = values.quantile([0.05, 0.5, 0.95])
    return f"median {middle:.4g} {unit}, nine tenths within {low:.4g} and {high:.4g}"
