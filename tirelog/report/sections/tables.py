"""Sections made of one table each.

Footprint, dissipation, phase shift, and a campaign's summary.

Rows of the command's own columns (pandas) --> Section; nothing is estimated here. Rows with a
quality word are counted, not drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tirelog.errors import UsageError
from tirelog.report.figures import Figure, LogColours, layout, line
from tirelog.report.page import PageTable, Section
from tirelog.report.sections.models import shown_number
from tirelog.report.sections.recorded import (
    drawn_of,
    groups,
    points,
    quality,
    reach,
    short_names,
    ways,
)
from tirelog.tables.frame import table_parts
from tirelog.vocabulary.quality import good_rows

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
#: marks of single rows, and of their means
_ASIDE = {"size": 6, "opacity": 0.4}
_MEAN = {"size": 7, "opacity": 1.0, "symbol": "square"}


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
    figures = []
    for id, x, label in (
        ("length-speed", "speed_m_s", "speed [m/s]"),
        ("length-time", "time_s", "time [s]"),
    ):
        traces = ways(named, x, _METHODS, 1e3, _ASIDE)
        alt = f"Contact length by three methods against {label}; best estimate {best}."
        figures.append(
            Figure(
                id,
                f"Contact length against {label.split(' [')[0]}",
                alt,
                traces,
                layout(label, "contact length [mm]"),
            )
        )
    figures += passage
    onset = good[good["slip_onset_m"].notna()] if "slip_onset_m" in good else good.iloc[:0]
    if len(onset):
        traces = ways(groups(onset, colours), "time_s", {"slip_onset_m": "slip onset"}, 1e3)
        alt = (
            f"{len(onset)} slip onsets, {reach(onset['slip_onset_m'] * 1e3, 'mm')} from the "
            "patch centre, entry negative."
        )
        figures.append(
            Figure("slip-onset", "Slip onset", alt, traces, layout("time [s]", "slip onset [mm]"))
        )
    words = [
        f"Contact length, best estimate: {best} over {len(good)} passages without a mark.",
        *remarks,
        *drawn_of(good),
    ]
    if not len(onset):
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
    wanted = [name for name in _DISSIPATION if name in table]
    good = table.loc[good_rows(table["quality"]), wanted]
    steady = good[good["steady"].astype(bool)]
    named, averaged = groups(good, colours), groups(steady, colours)
    figures = []
    for quantity, column, mean, unit in (
        ("specific power", "specific_power_m3_s2", "specific_power_mean_m3_s2", "m³/s²"),
        ("dissipation factor", "dissipation_factor_1_m", "dissipation_factor_mean_1_m", "1/m"),
    ):
        title, label = quantity.capitalize(), f"{quantity} [{unit}]"
        traces = ways(named, "time_s", {column: "each revolution"})
        for trace in traces:
            trace["marker"] |= {"size": 4, "opacity": 0.4}
        means = ways(averaged, "time_s", {mean: "moving average"})
        of = "" if len(averaged) == 1 else ", moving average"
        traces += [{**t, "name": f"{t['name']}{of}", "marker": t["marker"] | _MEAN} for t in means]
        alt = (
            f"{title} against time: {reach(good[column], unit)}, {len(good)} passages, and "
            "moving averages at constant speed (P1 Figs. 9, 10)."
        )
        figures.append(
            Figure(
                f"{column}-time", f"{title} against time", alt, traces, layout("time [s]", label)
            )
        )
        over = points(averaged, "speed_m_s", mean)
        over += _regressions(lines, column, colours)
        alt = (
            f"Moving averages of the {quantity} against speed: {reach(steady[mean], unit)}, "
            f"{len(steady)} passages (P1 Fig. 11). Why a line is doubtful (dashed), the table says."
        )
        figures.append(
            Figure(
                f"{column}-speed", f"{title} against speed", alt, over, layout("speed [m/s]", label)
            )
        )
    for column, title, label in (
        ("strip_power_W", "Power of the strip under the grating", "power of the strip [W]"),
        (
            "strip_rolling_resistance_N",
            "Rolling resistance of the strip under the grating",
            "resistance of the strip [N]",
        ),
    ):
        if column in good and good[column].notna().any():
            size = reach(good[column], label.split("[")[1][:-1])
            alt = (
                f"{title} against speed with the setup's viscosity and section, not the whole "
                f"tire's: {size}."
            )
            figures.append(
                Figure(
                    column,
                    title,
                    alt,
                    ways(named, "speed_m_s", {column: title.lower()}),
                    layout("speed [m/s]", label),
                )
            )
    factor = reach(good["dissipation_factor_1_m"], "1/m")
    words = [
        f"Dissipation factor: {factor} over {len(good)} passages, {len(steady)} of them at "
        "constant speed.",
        *remarks,
        *drawn_of(good),
    ]
    tables = [quality(table, "dissipation")]
    if lines is not None:
        heads = {
            "quantity": "quantity", "channel": "channel", "slope": "slope", "slope_se": "its error",
            "slope_lower": "95 % from", "slope_upper": "to", "intercept": "value at speed 0",
            "intercept_se": "its error", "rows": "revolutions", "points": "means",
            "judgement": "judgement",
        }  # fmt: skip
        names = [name for name in heads if name in lines]  # a table of an older run has fewer
        header = [heads[name] for name in names]
        cells = [[shown_number(row[name]) for name in names] for _, row in lines.iterrows()]
        tables.append(PageTable("Regressions on the speed in m/s", header, cells))
    return Section("dissipation", "Dissipation", command, words, figures, tables)


def _regressions(
    lines: pd.DataFrame | None, column: str, colours: LogColours
) -> list[dict[str, Any]]:
    """The fitted straight lines of a quantity, channel by channel.

    As `dissipation --fit` gives them.
    """
    if lines is None:
        return []
    drawn = []
    names = short_names([str(log) for log in lines["log"].unique()])
    for i, (_, row) in enumerate(lines[lines["quantity"] == column].iterrows()):
        who = f"{names[str(row['log'])]}: {row['channel']}" if len(names) > 1 else row["channel"]
        colour = colours(str(row["log"])) if max(len(names), len(colours)) > 1 else i
        ends = np.array([row["slowest_m_s"], row["fastest_m_s"]], float)
        y = float(row["intercept"]) + float(row["slope"]) * ends
        judged = row.get("judgement")
        doubtful = isinstance(judged, str) and bool(judged)  # the table says why
        style = {"width": 2.5, "dash": "dash"} if doubtful else {"width": 2.5}
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
    figures = [
        Figure(
            "phase-speed",
            "Speed at the passages",
            f"Speed against time: {reach(good['speed_m_s'], 'm/s')}.",
            points(named, "time_s", "speed_m_s"),
            layout("time [s]", "speed [m/s]"),
        ),
    ]
    for quantity, label in (
        ("phase_shift", "phase shift [deg]"),
        ("patch_width", "patch width [deg]"),
    ):
        columns = [
            c
            for c in (f"{quantity}_deg", f"{quantity}_detrended_deg", f"{quantity}_corrected_deg")
            if c in good and good[c].notna().any()
        ]
        names = [
            c.removesuffix("_deg").removeprefix(quantity).strip("_") or "measured" for c in columns
        ]
        for x, axis_label in (("time_s", "time [s]"), ("speed_m_s", "speed [m/s]")):
            traces = ways(named, x, dict(zip(columns, names, strict=True)))
            title = f"{label.split(' [')[0].capitalize()} against {axis_label.split(' [')[0]}"
            alt = (
                f"{title}, {', '.join(names)}: "
                f"measured {reach(good[f'{quantity}_deg'], 'degrees')} (P4 Figs. 8 to 13)."
            )
            figures.append(Figure(f"{quantity}-{x}", title, alt, traces, layout(axis_label, label)))
    for name in ("vertical", "longitudinal"):
        column = f"{name}_force_N"
        if column in good and good[column].notna().any():
            alt = f"{name.capitalize()} force by the calibration: {reach(good[column], 'N')}."
            traces = ways(named, "time_s", {column: f"{name} force"})
            figures.append(
                Figure(
                    column,
                    f"{name.capitalize()} force",
                    alt,
                    traces,
                    layout("time [s]", f"{name} force [N]"),
                )
            )
    width, shift = (
        reach(good["patch_width_deg"], "degrees"),
        reach(good["phase_shift_deg"], "degrees"),
    )
    words = [
        f"Patch width {width}, phase shift {shift}; negative in braking.",
        *remarks,
        *drawn_of(good),
    ]
    return Section(
        "phase-shift", "Phase shift", command, words, figures, [quality(table, "phase shift")]
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
    counts = {
        word: sum(row[status] == word for row in body)
        for word in dict.fromkeys(row[status] for row in body)
    }
    words = [f"{len(body)} logs: {', '.join(f'{n} {word}' for word, n in counts.items())}."]
    return Section(
        "campaign",
        "The campaign",
        command,
        words,
        (),
        [PageTable("Logs of the campaign", header, body)],
    )
