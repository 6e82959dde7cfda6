"""Pictures of tables, and their panels for the report's page.

rows of a table, by channels --> its quantities --> panels over time and over speed
    of a footprint also single passages, of phase shifts fronts and the calibration's maps;
    a static test's strain over time and pressure --> PNG, SVG or PDF
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.data.recording import Channel, Recording
from tirelog.dsp.filters import Cutoff, lowpassed, window_spectra
from tirelog.plots.record import (
    COLOURS,
    EDGE,
    MARK,
    MICRO,
    RAW,
    SYMBOLS,
    Mark,
    Page,
    Panel,
    dots,
    level,
    line,
    picture,
    robust_range,
    rows_of,
    span,
    upright,
    words,
)
from tirelog.plots.turns import found_of_grating
from tirelog.products import Part
from tirelog.strain.dissipation import AVERAGED, regressions
from tirelog.strain.footprint.learn import gather_windows
from tirelog.strain.footprint.measure import along_tread
from tirelog.strain.inflation import InflationOfChannel
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.quality import good_rows
from tirelog.wheel.calibration import Calibration
from tirelog.wheel.phase_shift import EdgeTimes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# ---- Quantities of tables as panels: of pages of pictures, and of the report.


#: a channel's good rows: its name in the legend, columns, the number of its colour, its symbol
ChannelRows = tuple[str, Mapping[str, Any], int, str]
#: columns that something is drawn over, with their titles
AXES = {"time_s": "time [s]", "speed_m_s": "speed [m/s]"}
#: channels that are drawn, and rows of each: evenly over the log if there are more
MOST, MOST_ROWS = 8, 6000


@dataclass(frozen=True)
class Quantity:
    """A quantity of a table: its columns with their words, the best first.

    factor      from the columns to its unit
    over_speed  those of the columns that are drawn over the speed, too
    source      figures of a paper that show it
    """

    name: str
    unit: str
    columns: Mapping[str, str]
    factor: float = 1.0
    over_speed: Sequence[str] = ()
    source: str = ""


_LENGTHS = {
    "length_m": "best estimate",
    "length_d2_m": "second derivative",
    "length_d1_m": "first derivative",
}
_SHIFTS, _WIDTHS = (
    {
        f"{name}{part}_deg": word
        for part, word in (
            ("", "measured"),
            ("_detrended", "detrended"),
            ("_corrected", "corrected"),
        )
    }
    for name in ("phase_shift", "patch_width")
)
_FACTORS = {
    "dissipation_factor_mean_1_m": "moving average",
    "dissipation_factor_1_m": "each revolution",
}
_POWERS = {
    "specific_power_mean_m3_s2": "moving average",
    "specific_power_m3_s2": "each revolution",
}
#: any other column of numbers is a quantity of its own
QUANTITIES = (
    Quantity("speed", "m/s", {"speed_m_s": ""}),
    Quantity("acceleration", "m/s²", {"acceleration_m_s2": ""}),
    Quantity("contact length", "mm", _LENGTHS, 1e3, tuple(_LENGTHS), "P2 Figs. 20 to 22"),
    Quantity("slip onset", "mm", {"slip_onset_m": ""}, 1e3),
    Quantity("dissipation factor", "1/m", _FACTORS, 1.0, tuple(_FACTORS)[:1], "P1 Figs. 9 to 11"),
    Quantity("specific power", "m³/s²", _POWERS, 1.0, tuple(_POWERS)[:1], "P1 Figs. 9 to 11"),
    Quantity("power of the strip", "W", {"strip_power_W": ""}, 1.0, ("strip_power_W",)),
    Quantity(
        "resistance of the strip",
        "N",
        {"strip_rolling_resistance_N": ""},
        1.0,
        ("strip_rolling_resistance_N",),
    ),
    Quantity(
        "resistance coefficient of the strip",
        "1",
        {"strip_rolling_resistance_coefficient": ""},
    ),
    Quantity("phase shift", "deg", _SHIFTS, 1.0, tuple(_SHIFTS), "P4 Figs. 8 to 13"),
    Quantity("patch width", "deg", _WIDTHS, 1.0, tuple(_WIDTHS), "P4 Figs. 8 to 13"),
    Quantity("vertical force", "N", {"vertical_force_N": ""}),
    Quantity("longitudinal force", "N", {"longitudinal_force_N": ""}),
    Quantity("strain", "microstrain", {"strain": ""}, MICRO),
)
_KNOWN = {column: quantity for quantity in QUANTITIES for column in quantity.columns}
#: columns that only say which row it is
_OF_A_ROW = (
    *("revolution", "period_s", "entry_time_s", "exit_time_s", "steady", "rank", "step"),
    *("entry_angle_deg", "exit_angle_deg"),
)
#: what the name of a column of standard errors has more than that of its quantity
_ERROR = re.compile(r"_se(?=_|$)")
#: what the page shows of columns beside the best of a quantity
_ASIDE = {"size": 4, "opacity": 0.4}


def parts_of_frame(table: Any) -> list[dict[str, Any]]:
    """The columns of a DataFrame by channels of logs."""
    groups = table.groupby(["log", "channel"], sort=False, observed=True, dropna=False)
    return [{str(name): rows[name].to_numpy() for name in rows} for _, rows in groups]


def rows_of_parts(
    parts: Sequence[Mapping[str, Any]], colours: Mapping[str, int] | None = None
) -> list[ChannelRows]:
    """The good rows of each part, by channel and, of several, log; at most MOST, each MOST_ROWS.

    Of several logs each has its colour, if there are `colours` by file names, and symbols tell its
    channels apart.
    """
    found, seen = list[ChannelRows](), list[str]()
    for number, columns in enumerate(parts[:MOST]):
        kept = np.flatnonzero(good_rows(columns["quality"]))
        kept = kept[:: -(-max(kept.size, 1) // MOST_ROWS)]
        log, name = (str(next(iter(np.atleast_1d(columns[c])), "")) for c in ("log", "channel"))
        arrays = {c: np.asarray(values)[kept] for c, values in columns.items() if np.ndim(values)}
        rows = {**arrays, "log": log, "channel": name}
        if len(parts) > 1:
            name = f"{Path(log).name}: {name}"
        of_log = colours is not None and len(colours) > 1
        colour = colours[Path(log).name] if colours is not None and of_log else number
        symbol = SYMBOLS[seen.count(log) % len(SYMBOLS) if of_log else 0]
        found.append((name, rows, colour, symbol))
        seen.append(log)
    return found


def undrawn(parts: Iterable[Mapping[str, Any]]) -> str:
    """How many flagged rows and further channels a picture leaves out; empty if none."""
    flagged = [int((~good_rows(columns["quality"])).sum()) for columns in parts]
    rows = [len(columns["quality"]) - n for columns, n in zip(parts, flagged, strict=True)]
    left_out = (
        ("flagged rows", sum(flagged[:MOST])),
        (f"channels with more than {MOST_ROWS} rows", sum(n > MOST_ROWS for n in rows[:MOST])),
        ("further channels", len(rows) - MOST),
    )
    said = "; ".join(f"{what} {number}" for what, number in left_out if number > 0)
    return f"not drawn: {said}" if said else ""


def ways(
    found: Sequence[ChannelRows], x: str, columns: Mapping[str, str], factor: float = 1.0
) -> list[Mark]:
    """Several `columns` (name -> words) that tell one quantity, against another.

    Of one group by colour; of several the colour is the group's and the symbol tells them apart.
    A single column has the group's name and symbol. Bars are two standard errors, of a column
    without any those of the first.
    """
    drawn, one, several = list[Mark](), len(found) == 1, len(columns) > 1
    for group, rows, own, symbol in found:
        errors = {_ERROR.sub("", c): c for c in rows if _ERROR.search(c)}
        for i, (column, word) in enumerate(columns.items()):
            name = (word if one else f"{group}, {word}") if several else group
            shape = SYMBOLS[i % len(SYMBOLS)] if several else symbol
            marker = {"symbol": shape, **(_ASIDE if i else {})}
            style: dict[str, Any] = {"symbol": shape, "size": 2.5, "marker": marker}
            style["zorder"] = 3.0 - 0.1 * i  # the best on top
            error = errors.get(column) or errors.get(next(iter(columns)))
            if error is not None:
                style |= {"error": 2.0 * factor * np.nan_to_num(rows[error]), "elinewidth": 0.6}
            values = np.asarray(rows[column], float) * factor
            drawn.append(dots(rows[x], values, name, i if one and several else own, **style))
    return drawn


def table_panels(
    found: Sequence[ChannelRows], lines: Sequence[Mapping[str, Any]] = ()
) -> Iterator[tuple[Quantity, str, Panel]]:
    """(quantity, the column that it is over, panel) of all numbers that vary.

    lines   rows of `dissipation --fit`: they are drawn with what they are of
    """
    varying = list[str]()
    for name in found[0][1] if found else ():
        values = np.concatenate([np.atleast_1d(rows[name]) for _, rows, _, _ in found])
        if values.dtype.kind in "fiu" and np.unique(values[np.isfinite(values)]).size > 1:
            varying.append(name)
    first = "time_s" if "time_s" in varying else next(iter(varying), "")
    done = {first, *_OF_A_ROW}
    for column in varying:
        if column in done or _ERROR.search(column):
            continue
        quantity = _KNOWN.get(column) or Quantity(column, "", {column: ""})
        done |= set(quantity.columns)
        columns = {c: said for c, said in quantity.columns.items() if c in varying}
        fast = {c: said for c, said in columns.items() if c in quantity.over_speed}
        own = [one for one in lines if one["quantity"] in columns]
        for x, shown in ((first, columns), ("speed_m_s", fast if "speed_m_s" in varying else {})):
            if not shown or (shown is fast and x == first):
                continue
            marks = ways(found, x, shown, quantity.factor)
            if shown is fast:
                marks += [
                    fitted_line(name, colour, one)
                    for name, rows, colour, _ in found
                    for one in own
                    if (one["log"], one["channel"]) == (rows["log"], rows["channel"])
                ]
            unit = f" [{quantity.unit}]" if quantity.unit else ""
            yield quantity, x, Panel(AXES.get(x, x), f"{quantity.name}{unit}", marks)


def fitted_line(who: str, colour: int, row: Mapping[str, Any]) -> Mark:
    """A regression as `dissipation --fit` gives it, dashed if a judgement speaks against it."""
    ends = np.array([row["slowest_m_s"], row["fastest_m_s"]], float)
    y = float(row["intercept"]) + float(row["slope"]) * ends
    doubtful = isinstance(row.get("judgement"), str) and bool(row["judgement"])
    error = f" ± {row['slope_se']:.1g}" if np.isfinite(row["slope_se"]) else ""
    name = f"{who}, {row['slope']:.3g}{error} per m/s, {'doubtful ' * doubtful}fitted line"
    dash = "dash" if doubtful else "solid"
    return line(ends, y, name, colour, dash=dash, line={"width": 2.5})


def holds(table: Mapping[str, Any], column: str) -> bool:
    """True if the table has a value in this column of numbers."""
    return column in table and bool(np.isfinite(np.asarray(table[column], float)).any())


# ---- Tables as one page each: a panel per quantity, over time or over its first column of numbers.
#
# recordings and parts, kept while their logs were open --> PNG, SVG or PDF


def table_picture(
    parts: Sequence[Mapping[str, Any]],
    lines: Sequence[Mapping[str, Any]] = (),
    more: Sequence[Sequence[Panel]] = (),
) -> Figure | None:
    """The page of a table by parts with `log`, `channel` and `quality`; None if nothing varies."""
    panels = [panel for *_, panel in table_panels(rows_of_parts(parts), lines)]
    return _page(panels, undrawn(parts), more) if panels else None


def _page(panels: Sequence[Panel], title: str, more: Sequence[Sequence[Panel]] = ()) -> Figure:
    """Panels in rows of two, or as wide as the rows that follow them."""
    across = max(min(len(panels), 2), *map(len, more), 1)
    rows = [*rows_of(panels, across), *more]
    return picture(Page(rows, ((6.5, 13.0, 16.0)[across - 1], 0.6 + 2.7 * len(rows)), title))


def rows_picture(kept: Sequence[tuple[Recording, Part]]) -> Figure | None:
    """The page of a table as its command made it, with scalars for columns of one value."""
    parts = []
    for _, part in kept:
        names, values = part.columns.keys(), np.broadcast_arrays(*part.columns.values())
        parts.append(dict(zip(names, values, strict=True)))
    return table_picture(parts)


#: a recording, its part, and further rows of panels, drawn while the log is open
Sketch = tuple[Recording, Part, list[list[Panel]]]
#: revolutions in the magnification of the strain
MAGNIFIED = 4


def dissipation_sketch(recording: Recording, part: Part) -> Sketch:
    """The speed with its moving average, and the strain of a few revolutions (P1 Figs. 7, 8)."""
    found, p = part.found, part.found.passages
    if len(p) <= max(MAGNIFIED, AVERAGED):
        return recording, part, []
    steady = np.flatnonzero(found.found.steady)
    row = int(steady[steady.size // 2]) if steady.size else len(p) // 2
    row = min(row, len(p) - MAGNIFIED - 1)
    low, high = max(int(p.index[row]) - 10, 0), int(p.index[row + MAGNIFIED])
    time, strain = found.channel.axis.time(low, high), found.channel.read(low, high)
    mean = np.full(AVERAGED, 1.0 / AVERAGED)
    time_s, speed_m_s = (np.convolve(values, mean, "valid") for values in (p.time_s, p.speed_m_s))
    speeds = [
        dots(p.time_s, p.speed_m_s, "", RAW, size=3),
        dots(p.time_s[steady], p.speed_m_s[steady], "constant speed", EDGE, size=3),
        line(time_s, speed_m_s, f"mean of {AVERAGED}", "#CC0000", width=0.9),
    ]
    title = f"{MAGNIFIED} revolutions at {p.speed_m_s[row]:.1f} m/s"
    magnified = [line(time, MICRO * strain, width=0.9)]
    return (
        recording,
        part,
        [
            [
                Panel("time [s]", "speed [m/s]", speeds, found.channel.name),
                Panel("time [s]", "strain [microstrain]", magnified, title),
            ]
        ],
    )


def dissipation_picture(sketches: Sequence[Sketch]) -> Figure | None:
    """Specific power and factor over time and, with their regressions, over speed (P1)."""
    fits = [regressions(recording.log, part.found)[0] for recording, part, _ in sketches]
    lines = [
        {name: np.broadcast_to(values, len(fit["slope"]))[i] for name, values in fit.items()}
        for fit in fits
        if fit is not None
        for i in range(len(fit["slope"]))
    ]
    shown = next((rows for *_, rows in sketches if rows), [])
    return table_picture([part.columns for _, part, _ in sketches], lines, shown)


# ---- The footprint (P2 Figs. 17 to 22): also a passage of free rolling, and one with slip onset:
# strain, first and second derivative along the tread, raw and low-passed, with the edges.

#: the window of a passage in half lengths, and what is read beside it for the low-pass, in periods
WINDOW, _BESIDE = 2.2, 3.0
#: numbers of the footprint table that a picture of a passage has
_OF_A_PASSAGE = (
    *("time_s", "speed_m_s", "length_m", "length_d2_m", "length_d1_m", "entry_time_s"),
    *("exit_time_s", "slip_onset_m"),
)


def footprint_sketch(recording: Recording, part: Part) -> Sketch:
    """The passages of a channel for the page.  UsageError: no grating."""
    channel, shown = found_of_grating(recording, part).channel, []
    for row, title in passages(part.columns):
        said = f"{title}: {row['time_s']:.2f} s, {row['speed_m_s']:.1f} m/s"
        panels = passage_panels(recording, channel, row, (RAW, COLOURS[0]))
        shown += [[replace(panels[0], title=said), *panels[1:]]] if panels else []
    return recording, part, shown


def footprint_picture(sketches: Sequence[Sketch]) -> Figure | None:
    """Lengths over time and speed beside the static one, and passages below."""
    parts = [part.columns for _, part, _ in sketches]
    statics = {recording.setup.tire.static_footprint_length_m for recording, *_ in sketches}
    known = [
        level(1e3 * length, f"static {1e3 * length:.0f} mm", dash="dot", width=1.2)
        for length in statics
        if length is not None
    ]
    panels = [
        replace(panel, marks=[*panel.marks, *known]) if quantity.name == "contact length" else panel
        for quantity, _, panel in table_panels(rows_of_parts(parts))
    ]
    shown = next((rows for *_, rows in sketches if rows), [])
    return _page(panels, undrawn(parts), shown) if panels else None


def passages(columns: Mapping[str, Any]) -> list[tuple[dict[str, float], str]]:
    """Rows of a footprint table of one channel that are shown, each with its title.

    A clean one of free rolling, and the clean one with the surest slip onset.
    """
    numbers = {name: np.asarray(columns[name], float) for name in _OF_A_PASSAGE}
    length, onset = numbers["length_m"], numbers["slip_onset_m"]
    clean = np.flatnonzero(good_rows(columns["quality"]) & np.isfinite(length))
    if not clean.size:
        return []
    chosen = {int(clean[free_rolling(numbers["time_s"][clean], numbers["speed_m_s"][clean])]): ""}
    slipping = clean[np.isfinite(onset[clean])]
    if slipping.size:
        surest = slipping[np.argmin(onset[slipping] / length[slipping])]
        chosen.setdefault(int(surest), " with slip")
    return [
        ({name: float(values[row]) for name, values in numbers.items()}, f"passage{more}")
        for row, more in chosen.items()
    ]


def free_rolling(time_s: Any, speed_m_s: Any) -> int:
    """Which of some passages has little acceleration and moderate speed."""
    speed = np.asarray(speed_m_s, float)
    pushed = np.abs(np.gradient(speed, np.asarray(time_s, float))) if speed.size > 1 else speed
    free = np.argsort(np.nan_to_num(pushed), kind="stable")[: max(speed.size // 3, 1)]
    return int(free[np.argsort(speed[free], kind="stable")[free.size // 4]])


def passage_panels(
    recording: Recording, channel: Channel, row: Any, colours: tuple[Any, Any], edges: Any = EDGE
) -> list[Panel]:
    """Strain, its first and second derivative along the tread, raw and low-passed (P2 Fig. 18).

    row      of the footprint table, with a length; without a sample at it there are no panels
    colours  of the samples and of the low-passed ones; `edges`: of the lines at the edges
    """
    speed, length, time_s = (float(row[name]) for name in ("speed_m_s", "length_m", "time_s"))
    rate, inner = channel.axis.rate_Hz, channel.surface == "inner"
    motion = np.array([speed]), np.zeros(1)
    wheel = Cutoff.parse("40x").frequency(motion[0], recording.setup.tire.radius_m, float("nan"))
    cutoff = np.minimum(wheel, 0.49 * rate)  # as P2
    reach = 0.7 * WINDOW * length / speed * rate + _BESIDE * rate / cutoff
    index = np.atleast_1d(channel.axis.index(time_s))
    sign = 1.0 if inner else -1.0
    found = gather_windows(channel, sign, index, motion, reach, np.zeros(1, np.int64))
    windows = next(iter(found), None)
    if windows is None or not np.isfinite(windows.values).any():
        return []
    known = windows.values[0][np.isfinite(windows.values[0])]
    edge = max(windows.values.shape[1] // 32, 1)
    ends = [float(part.mean()) if part.size else 0.0 for part in (known[:edge], known[-edge:])]
    marks: list[list[Mark]] = [[], [], []]
    shown: list[FloatArray] = []
    for cut, upsample, name, colour, look in (
        (np.array([1e9]), 1, "samples", colours[0], {"width": 0.8, "symbol": ".", "size": 3}),
        (cutoff, 4, f"low-pass {cutoff[0]:.0f} Hz", colours[1], {"width": 1.4}),
    ):
        along = along_tread(windows, cut, upsample)
        spectra, m = window_spectra(windows.values), windows.values.shape[1]
        strain = lowpassed(spectra, windows.rate_Hz, cut, m, upsample)[0]
        xi, first, second = 1e3 * along[0][0], along[1][0], along[2][0]
        strain = strain + np.linspace(ends[0], ends[1], strain.size)
        shown = [-sign * MICRO * strain, -sign * 1e3 * first, -sign * second]
        for drawn, curve in zip(marks, shown, strict=True):
            drawn.append(line(xi, curve, f"_{name}", colour, **look))
    lines, far = _edge_lines(row, edges), 1e3 * WINDOW * 0.5 * length
    labels = ("strain [microstrain]", "dε/dξ [microstrain/mm]", "d²ε/dξ² [microstrain/mm²]")
    return [
        Panel(
            "ξ from the patch centre [mm], entry to exit" if text is labels[-1] else "",
            text,
            [*drawn, *lines],
            limits=((-far, far), robust_range(curve[np.abs(xi) < far], share=0.0)),
            legend={"fontsize": 7, "loc": "lower right"} if text is labels[0] else None,
        )
        for text, drawn, curve in zip(labels, marks, shown, strict=True)
    ]


def _edge_lines(row: Any, colour: Any) -> list[Mark]:
    """The edges in a row of the footprint table, lengths by the derivatives, and the slip onset."""
    times_s = np.array([row["entry_time_s"], row["exit_time_s"]], float) - float(row["time_s"])
    edges_mm = 1e3 * float(row["speed_m_s"]) * times_s
    middle, half = edges_mm.mean(), np.array([-0.5, 0.5])
    places = (
        (edges_mm, "edges, best estimate", {"width": 1.3}),
        (
            middle + 1e3 * half * row["length_d2_m"],
            "length by the 2nd derivative",
            {"dash": "dash"},
        ),
        (middle + 1e3 * half * row["length_d1_m"], "length by the 1st derivative", {"dash": "dot"}),
        (np.array([middle + 1e3 * row["slip_onset_m"]]), "slip onset", {"colour": MARK}),
    )
    return [
        mark
        for at, name, look in places
        for mark in upright(at[np.isfinite(at)], name, **{"colour": colour, **look})
    ]


# ---- Static tests as one page (P2 Figs. 15, 16).
#
# Strain over time with its ramps and stops, and over the inflation pressure.
#
# Recording and InflationOfChannel of each channel --> PNG, SVG or PDF


def inflation_picture(kept: Sequence[tuple[Recording, Part]]) -> Figure:
    """The page, a row per channel."""
    rows = [
        [_stops(recording, part.found), _ramps(recording, part.found)] for recording, part in kept
    ]
    return picture(Page(rows, (12.0, 3.6 * len(rows) + 0.4)))


_SINCE = "strain since the start [microstrain]"


def _stops(recording: Recording, found: InflationOfChannel) -> Panel:
    """Strain over time; its stops are shaded, with what is lost in each."""
    s, test = found.series, found.columns
    marks = [line(s["time_s"], MICRO * (s["strain"] - s["strain"][0]), width=1.4)]
    for stretch, start, duration, leak in zip(
        test["stretch"], test["time_s"], test["duration_s"], test["leak"], strict=True
    ):
        if stretch != "stop":
            continue
        lost = np.nan_to_num(leak) != 0
        marks.append(span(start, start + duration, EDGE if lost else RAW, opacity=0.2))
        if lost:
            text = f"−{MICRO * abs(leak):.1f}"
            marks.append(words(text, start, 0.04, xycoords=("data", "axes fraction")))
    title = f"{Path(recording.log).name}: {found.channel.name}; shaded: stops and lost samples"
    return Panel("time [s]", _SINCE, marks, title)


def _ramps(recording: Recording, found: InflationOfChannel) -> Panel:
    """Strain over the inflation pressure, with its straight line."""
    s, test = found.series, found.columns
    marks = []
    if np.isfinite(s["pressure_Pa"]).any():
        ends = np.array([np.nanmin(s["pressure_Pa"]), np.nanmax(s["pressure_Pa"])])
        rise = test["strain_slope_1_Pa"][0] * (ends - np.nanmean(s["pressure_Pa"]))
        se = 1e11 * test["strain_slope_se_1_Pa"][0]
        text = (
            f"{1e11 * test['strain_slope_1_Pa'][0]:.1f}{f' ± {se:.1g}' if np.isfinite(se) else ''} "
            f"microstrain/bar, straight to {100 * test['nonlinearity'][0]:.1f} %"
        )
        strain = MICRO * (s["strain"].mean() - s["strain"][0] + rise)
        marks = [
            dots(1e-5 * s["pressure_Pa"], MICRO * (s["strain"] - s["strain"][0]), size=3),
            line(1e-5 * ends, strain, text, MARK, width=1.5),
        ]
    static = recording.setup.tire.static_footprint_length_m
    title = "" if static is None else f"static footprint {1e3 * static:.0f} mm"
    return Panel("inflation pressure [bar]", _SINCE, marks, title, legend={"fontsize": 8})


# ---- Phase shift (P4): also fronts in the acceleration over wheel angle (Fig. 7), and the
# calibration's maps over speed (Fig. 9).


def phase_shift_picture(kept: Sequence[tuple[Recording, Part]]) -> Figure:
    """Shift and width over time and over speed, raw and cleaned, and fronts."""
    calibration, parts = kept[0][1].found[1], [part.columns for _, part in kept]
    panels = [_fronts([part.found[0] for _, part in kept])]
    for quantity, x, panel in table_panels(rows_of_parts(parts)):
        mapped = calibration is not None and x == "speed_m_s"
        maps = [_map(calibration, width=quantity.name == "patch width")] if mapped else []
        panels.append(replace(panel, marks=[*panel.marks, *maps]))
    return _page(panels, undrawn(parts))


def _fronts(logs: Sequence[EdgeTimes]) -> Panel:
    """P4 Fig. 7: one passage of each accelerometer, in levels outside the patch, and its fronts."""
    marks = [level(0.5, "", "0.8", width=0.8)]
    for number, p in enumerate(logs[: len(COLOURS)]):
        if p.example.size:
            name, colour = f"{p.channel}, {Path(p.log).name}", COLOURS[number]
            marks.append(
                line(p.example[0], p.example[1], name, colour, symbol=".", width=0.7, size=2)
            )
            marks += upright(p.example[2, :2], "", colour, dash="dash", width=1)
    return Panel(
        "wheel angle from the patch's middle [deg]",
        "acceleration / level outside [-]",
        marks,
        "Fronts (P4 Fig. 7)",
        (None, (-0.6, 1.6)),
        legend={"fontsize": 7, "loc": "lower left"},  # where no front passes
    )


def _map(calibration: Calibration, *, width: bool) -> Mark:
    """P4 Fig. 9: the calibration's map over speed, with its range."""
    one = calibration.width if width else calibration.shift
    speed = np.linspace(one.low_m_s, one.high_m_s, 200)
    least = calibration.patch_width_deg if width else 0.0
    change = one(speed, calibration.reference_speed_m_s) + least
    return line(speed, change, "map", "k", width=1.5)
