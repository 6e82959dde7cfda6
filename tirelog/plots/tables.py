"""Pictures of tables: footprint and dissipation, speed, static tests, encoder, and phase shift.

    Recording and what a command found of each channel --while the log is open--> Sketch
        --all of them--> PNG, SVG or PDF

Longer than others: a picture per table, which share their parts.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.data.recording import Channel, Recording
from tirelog.dsp.filters import Cutoff, lowpassed, window_spectra
from tirelog.errors import UsageError
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
    decimated,
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
from tirelog.strain.dissipation import AVERAGED, DissipationOfChannel, regressions
from tirelog.strain.footprint.learn import gather_windows
from tirelog.strain.footprint.measure import along_tread
from tirelog.strain.inflation import InflationOfChannel
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.quality import OK, good_rows
from tirelog.wheel.calibration import Calibration
from tirelog.wheel.phase_shift import EdgeTimes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# ---- Columns of a table as panels: of pages of pictures, and of the report.


#: a channel's good rows: its name in the legend, columns, the number of its colour, its symbol
ChannelRows = tuple[str, Mapping[str, Any], int, str]
#: columns that something is drawn over, with their titles
AXES = {"time_s": "time [s]", "speed_m_s": "speed [m/s]"}
#: columns that tell one length, with their words
LENGTHS = {
    "length_m": "best estimate",
    "length_d2_m": "second derivative",
    "length_d1_m": "first derivative",
}
#: columns of what dissipates: the column of its moving averages, its name, its unit
DISSIPATED = {
    "specific_power_m3_s2": ("specific_power_mean_m3_s2", "specific power", "m³/s²"),
    "dissipation_factor_1_m": ("dissipation_factor_mean_1_m", "dissipation factor", "1/m"),
}
#: quantities of phase shifts, and their columns by the end of the name
SHIFTED = ("phase_shift", "patch_width")
_CLEANED = {"": "measured", "_detrended": "detrended", "_corrected": "corrected"}
#: marks of columns beside the best estimate, of each revolution, and of averages over some
_ASIDE, _PALE = {"size": 6, "opacity": 0.4}, {"size": 4, "opacity": 0.4}
_FULL = {"size": 7, "opacity": 1.0, "symbol": "square"}


#: rows of a channel that are drawn: evenly over the log if there are more
_MOST_ROWS = 20_000


def rows_of_parts(parts: Sequence[Mapping[str, Any]]) -> list[ChannelRows]:
    """The good rows of each part, by channel and, of several, log; at most MOST.

    Of more than so many rows every n-th.
    """
    found = list[ChannelRows]()
    for number, columns in enumerate(parts[:MOST]):
        kept = np.flatnonzero(good_rows(columns["quality"]))
        kept = kept[:: -(-max(kept.size, 1) // _MOST_ROWS)]
        log, name = (str(next(iter(np.atleast_1d(columns[c])), "")) for c in ("log", "channel"))
        if len(parts) > 1:
            name = f"{Path(log).name}: {name}"
        rows = {c: np.asarray(values)[kept] for c, values in columns.items() if np.ndim(values)}
        found.append((name, rows, number, SYMBOLS[0]))
    return found


def undrawn(parts: Iterable[Mapping[str, Any]]) -> str:
    """How many flagged rows and further channels a picture leaves out; empty if none."""
    rows = [int((~good_rows(columns["quality"])).sum()) for columns in parts]
    left_out = ((sum(rows[:MOST]), "flagged rows"), (len(rows) - MOST, "more channels"))
    said = "; ".join(f"{number} {what}" for number, what in left_out if number > 0)
    return f"{said} are not drawn" if said else ""


def ways(
    found: Sequence[ChannelRows],
    x: str,
    columns: Mapping[str, str],
    factor: float = 1.0,
    *,
    error: str = "",
    look: Mapping[str, Any] | None = None,
    aside: Mapping[str, Any] | None = None,
) -> list[Mark]:
    """Several `columns` (name -> words) that tell one quantity, against another.

    Of one group by colour; of several the colour is the group's and the symbol tells them apart.
    Points look on the page as `look` says, those of all columns but the first as `aside`. A single
    column has the group's name and symbol. `error`: the column of its errors.
    """
    drawn, one, several = list[Mark](), len(found) == 1, len(columns) > 1
    for group, rows, own, symbol in found:
        for i, (column, word) in enumerate(columns.items()):
            name = (word if one else f"{group}, {word}") if several else group
            marker = {"symbol": SYMBOLS[i % len(SYMBOLS)] if several else symbol}
            marker |= (aside if i else look) or {}
            style: dict[str, Any] = {"symbol": marker["symbol"], "size": 2.5, "marker": marker}
            if error:
                style |= {"error": 2.0 * np.nan_to_num(rows[error]), "elinewidth": 0.6}
            values = np.asarray(rows[column], float) * factor
            drawn.append(dots(rows[x], values, name, i if one and several else own, **style))
    return drawn


def lengths(found: Sequence[ChannelRows], x: str) -> Panel:
    """Contact lengths by three methods over a column of AXES."""
    return Panel(AXES[x], "contact length [mm]", ways(found, x, LENGTHS, 1e3, aside=_ASIDE))


def dissipation_panels(
    found: Sequence[ChannelRows],
    column: str,
    lines: Iterable[tuple[str, int, Mapping[str, Any]]],
) -> tuple[Panel, Panel]:
    """A column of DISSIPATED and its averages over time, and these over speed (P1 Figs. 9 to 11).

    lines  (name, number of the colour, row of `dissipation --fit`)
    """
    mean, name, unit = DISSIPATED[column]
    label = f"{name} [{unit}]"
    both = {column: "each revolution", mean: "moving average"}
    marks = ways(found, "time_s", both, look=_PALE, aside=_FULL)
    over = ways(found, "speed_m_s", {mean: ""})
    over += [fitted_line(*one) for one in lines if one[2]["quantity"] == column]
    return Panel(AXES["time_s"], label, marks), Panel(AXES["speed_m_s"], label, over)


def fitted_line(who: str, colour: int, row: Mapping[str, Any]) -> Mark:
    """A regression as `dissipation --fit` gives it, dashed if a judgement speaks against it."""
    ends = np.array([row["slowest_m_s"], row["fastest_m_s"]], float)
    y = float(row["intercept"]) + float(row["slope"]) * ends
    doubtful = isinstance(row.get("judgement"), str) and bool(row["judgement"])
    error = f" ± {row['slope_se']:.1g}" if np.isfinite(row["slope_se"]) else ""
    name = f"{who}, {row['slope']:.3g}{error} per m/s, {'doubtful ' * doubtful}fitted line"
    dash = "dash" if doubtful else "solid"
    return line(ends, y, name, colour, dash=dash, line={"width": 2.5})


def shifts(found: Sequence[ChannelRows], quantity: str, x: str) -> Panel:
    """A quantity of SHIFTED over a column of AXES, measured and cleaned (P4 Figs. 8 to 13)."""
    named = {f"{quantity}{part}_deg": word for part, word in _CLEANED.items()}
    columns = {
        c: word for c, word in named.items() if any(holds(rows, c) for _, rows, _, _ in found)
    }
    error = f"{quantity}_se_deg" if found and f"{quantity}_se_deg" in found[0][1] else ""
    marks = ways(found, x, columns, error=error)
    return Panel(AXES[x], f"{quantity.replace('_', ' ')} [deg]", marks)


def holds(table: Mapping[str, Any], column: str) -> bool:
    """True if the table has a value in this column of numbers."""
    return column in table and bool(np.isfinite(np.asarray(table[column], float)).any())


# ---- Any table as one page: a panel per quantity, over time or over its first column of numbers.


#: columns that share a panel, with their words, by the first of them
_TOGETHER: Mapping[str, Mapping[str, str]] = {
    "length_m": LENGTHS,
    **{
        column: {column: "each revolution", mean: "moving average"}
        for column, (mean, _, _) in DISSIPATED.items()
    },
    **{
        f"{quantity}_deg": {f"{quantity}{part}_deg": word for part, word in _CLEANED.items()}
        for quantity in SHIFTED
    },
}
#: columns that only say which row it is
_OF_A_ROW = ("revolution", "period_s", "entry_time_s", "exit_time_s", "steady", "rank", "step")
#: what the name of a column of standard errors has more than that of its quantity
_ERROR = re.compile(r"_se(?=_|$)")


def rows_picture(kept: Sequence[tuple[Recording, Part]]) -> Figure:
    """The page of a table as its command made it, with scalars for columns of one value."""
    parts = []
    for _, part in kept:
        names, values = part.columns.keys(), np.broadcast_arrays(*part.columns.values())
        parts.append(dict(zip(names, values, strict=True)))
    return table_picture(parts)


def table_picture(parts: Sequence[Mapping[str, Any]]) -> Figure:
    """The page of a table by parts with `log`, `channel` and `quality`, as a rule by channels.

    UsageError: it has no two columns of numbers that vary.
    """
    found, varying = rows_of_parts(parts), list[str]()
    for name in parts[0]:
        values = np.concatenate([np.asarray(part[name]) for part in parts])
        if values.dtype.kind in "fiu" and np.unique(values[np.isfinite(values)]).size > 1:
            varying.append(name)
    x = "time_s" if "time_s" in varying else next(iter(varying), "")
    aside = {c for own in _TOGETHER.values() for c in own if c not in _TOGETHER}
    panels = []
    for column in varying:
        if column in (x, *aside, *_OF_A_ROW) or _ERROR.search(column):
            continue
        words = {c: said for c, said in _TOGETHER.get(column, {}).items() if c in varying}
        error = next((c for c in parts[0] if c != column and _ERROR.sub("", c) == column), "")
        factor, label = (MICRO, "strain [microstrain]") if column == "strain" else (1.0, column)
        marks = ways(found, x, words or {column: ""}, factor, error=error)
        panels.append(Panel(AXES.get(x, x), label, marks))
    if not panels:
        raise UsageError(
            "is no table of numbers that vary",
            allowed="allowed is a table with two columns of such numbers",
            do="read its rows",
            file=str(next(iter(parts[0]["log"]), "")),
        )
    across = min(len(panels), 2)
    rows = rows_of(panels, across)
    return picture(Page(rows, (6.5 * across, 0.6 + 2.7 * len(rows)), undrawn(parts)))


# ---- The footprint as one page (P2 Figs. 17 to 22).
#
# Left: strain and speed over time of the first channel (Figs. 17, 20), contact lengths over time
# and speed of all. Right: one passage, free rolling if there is one, and the one with the clearest
# slip onset: strain, first and second derivative along the tread, raw and low-passed, edges by each
# method (Figs. 18, 19, 21).


#: channels with a colour of their own, or logs with a row, and the window of a passage in half
#: lengths
MOST, WINDOW = 8, 2.2
#: what is read beside a window for the low-pass, in its periods
_BESIDE = 3.0
#: numbers of the footprint table that a picture of a passage has
_OF_A_PASSAGE = (
    *("time_s", "speed_m_s", "length_m", "length_d2_m", "length_d1_m", "entry_time_s"),
    *("exit_time_s", "slip_onset_m"),
)


@dataclass(frozen=True)
class Sketch:
    """The numbers of one channel for a page, read while its log is open.

    found    what the command found of it; `signal` its samples, decimated
    closer   of a footprint the panels of the passages that are shown, of a dissipation times,
             strain and speed of a few revolutions
    """

    recording: Recording
    found: Any
    signal: tuple[FloatArray, FloatArray]
    closer: Any


def footprint_sketch(recording: Recording, part: Part) -> Sketch:
    """The numbers of a channel for the page.  UsageError: no grating."""
    found = found_of_grating(recording, part)
    shown = []
    for row, title in _passages(part.columns):
        said = f"{title}: {row['time_s']:.2f} s, {row['speed_m_s']:.1f} m/s"
        panels = passage_panels(recording, found.channel, row, (RAW, COLOURS[0]))
        shown += [[replace(panels[0], title=said), *panels[1:]]] if panels else []
    return Sketch(recording, found, decimated(found.channel), shown)


def footprint_picture(sketches: Sequence[Sketch]) -> Figure:
    """Time series and lengths at the left, passages at the right."""
    first = next((sketch for sketch in sketches if len(sketch.found.passages)), sketches[0])
    kept = [sketch.found.columns for sketch in sketches]
    p, found = first.found.passages, rows_of_parts(kept)
    speeds = Panel(
        "time [s]", "speed [m/s]", [line(p.time_s, p.speed_m_s, symbol=".", size=2, width=0.8)]
    )
    tires = (sketch.recording.setup.tire for sketch in sketches)
    statics = {tire.static_footprint_length_m for tire in tires} - {None}
    known = [
        level(1e3 * length, f"static {1e3 * length:.0f} mm", dash="dot", width=1.2)
        for length in statics
        if length is not None
    ]
    levels = [np.full(1 + p.time_s.size, 1e3 * length) for length in statics if length]
    by_time, by_speed = (
        replace(
            panel,
            marks=[*panel.marks, *known],
            # levels by themselves are in sight, whatever share of the rows they are
            limits=(None, robust_range(*(np.atleast_1d(mark.y) for mark in panel.marks), *levels)),
        )
        for panel in (lengths(found, x) for x in AXES)
    )
    over_time = [[signal_panel(first, len(sketches))], [speeds], [by_time]]
    columns = first.closer
    right = [list(row) for row in zip(*columns, strict=True)] or [[None]]
    left = [Page(over_time, heights=(1.0, 0.7, 1.0), share="x"), Page([[by_speed]])]
    return picture(
        Page(
            size=(13.5 if len(columns) < 2 else 17.0, 10.5),
            title=undrawn(kept),
            parts=[Page(parts=left, stacked=True, heights=(2.7, 1.1)), Page(right, share="x")],
            widths=(1.0, 0.8 * max(len(columns), 1)),
        )
    )


def signal_panel(sketch: Sketch, channels: int) -> Panel:
    """The whole strain of one of so many channels over time (P2 Fig. 17)."""
    channel, (time, strain) = sketch.found.channel, sketch.signal
    which = f", 1 of {channels}" if channels > 1 else ""
    return Panel(
        "time [s]",
        "strain [microstrain]",
        [line(time, MICRO * strain, width=0.5, opacity=0.9)],
        f"{Path(sketch.recording.log).name}: {channel.name} ({channel.surface} surface){which}",
    )


def _passages(columns: Mapping[str, Any]) -> list[tuple[dict[str, float], str]]:
    """Rows of a footprint table of one channel that are shown, each with its title.

    A clean one of free rolling, and the clean one with the surest slip onset.
    """
    numbers = {name: np.asarray(columns[name], float) for name in _OF_A_PASSAGE}
    length, onset = numbers["length_m"], numbers["slip_onset_m"]
    clean = np.flatnonzero((columns["quality"] == OK) & np.isfinite(length))
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
        centre = windows.motion["centre"]
        along = along_tread(windows.values, windows.rate_Hz, centre, *motion, cut, upsample)
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


# ---- Dissipation of whatever logs a command has worked on, as one page (P1 Figs. 7 to 11).
#
#     Recording and DissipationOfChannel of each channel --while the log is open--> Sketch
#         --all of them--> PNG, SVG or PDF
#
# Left: strain and speed over time (Figs. 7, 8's magnification), specific power and factor over time
# with their moving averages (Figs. 9, 10). Right: both averages over speed with their regressions
# (Fig. 11).


#: revolutions in the magnification of the strain
MAGNIFIED = 4


def dissipation_sketch(recording: Recording, part: Part) -> Sketch:
    """The numbers of a channel for the page."""
    found = part.found
    p, steady = found.passages, np.flatnonzero(found.dissipation.steady)
    row = int(steady[steady.size // 2]) if steady.size else len(p) // 2
    row = max(min(row, len(p) - MAGNIFIED - 1), 0)
    magnified = (np.zeros(0), np.zeros(0), float("nan"))
    if len(p) > MAGNIFIED:
        low, high = max(int(p.index[row]) - 10, 0), int(p.index[row + MAGNIFIED])
        channel = found.channel
        magnified = channel.axis.time(low, high), channel.read(low, high), float(p.speed_m_s[row])
    return Sketch(recording, found, decimated(found.channel), magnified)


def dissipation_picture(sketches: Sequence[Sketch]) -> Figure:
    """The page."""
    first = next((sketch for sketch in sketches if len(sketch.found.passages)), sketches[0])
    d, p = first.found.dissipation, first.found.passages
    kept = [sketch.found.columns for sketch in sketches]
    found = rows_of_parts(kept)
    lines = [
        (name, number, fit)
        for (name, _, number, _), sketch in zip(found, sketches, strict=False)
        for fit in _fits(sketch.found)
    ]
    (power, powers), (factor, factors) = (
        dissipation_panels(found, column, lines) for column in DISSIPATED
    )
    speeds = [
        dots(p.time_s, p.speed_m_s, "", RAW, size=3),
        line(
            _smoothed(p.time_s), _smoothed(p.speed_m_s), f"mean of {AVERAGED}", "#CC0000", width=0.9
        ),
        dots(p.time_s, np.where(d.steady, p.speed_m_s, np.nan), "constant speed", EDGE, size=3),
    ]
    left = [
        signal_panel(first, len(sketches)),
        power,
        factor,
        Panel("time [s]", "speed [m/s]", speeds),
    ]
    right = [_magnified(first), powers, factors]
    parts = [Page([[panel] for panel in left], share="x"), Page([[panel] for panel in right])]
    return picture(Page(size=(15.0, 10.0), title=undrawn(kept), parts=parts, widths=(1.35, 1.0)))


def _fits(found: DissipationOfChannel) -> list[Mapping[str, Any]]:
    """The regressions of a channel, as rows of `dissipation --fit`."""
    columns = regressions("", found)[0] or {"slope": ()}
    count = len(columns["slope"])
    return [
        {name: values[i] for name, values in columns.items() if np.ndim(values)}
        for i in range(count)
    ]


def _smoothed(values: FloatArray) -> FloatArray:
    """Moving averages over AVERAGED revolutions (P1 Fig. 7, red), or all of fewer."""
    if values.size < AVERAGED:
        return values
    return np.convolve(values, np.full(AVERAGED, 1.0 / AVERAGED), "valid")


def _magnified(sketch: Sketch) -> Panel:
    """The strain of a few revolutions (P1 Fig. 8)."""
    time, strain, speed = sketch.closer
    title = f"{MAGNIFIED} revolutions at {speed:.1f} m/s" if time.size else ""
    return Panel("time [s]", "strain [microstrain]", [line(time, MICRO * strain, width=0.9)], title)


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


# ---- Phase shift (P4).
#
# Top: fronts in the acceleration over wheel angle (Fig. 7), maps of shift and width over speed
# (Fig. 9). Below, a column for each of the first accelerometers: speed, shift and width over time,
# raw (Fig. 8), detrended (Fig. 10), corrected (Figs. 11 to 13). Error bars are two standard errors.


#: accelerometers that have a column of their own
MOST_ACCELEROMETERS = 4
_DRIVEN = {True: ", driven", False: ", undriven", None: ""}


def phase_shift_picture(kept: Sequence[tuple[Recording, Part]]) -> Figure:
    """The page."""
    kept, calibration = kept[:MOST_ACCELEROMETERS], kept[0][1].found.calibration
    shown = [part.found.passages[0] for _, part in kept]
    parts = [part.columns for _, part in kept]
    rows = rows_of_parts(parts)
    maps = [_with_map(rows, quantity, calibration) for quantity in SHIFTED]
    columns = [
        [
            Panel(
                "",
                "speed [m/s]",
                [line(p.time_s, p.speed_m_s, colour="k", width=1)],
                f"{Path(p.log).name}: {p.channel}{_DRIVEN[p.driven]}",
            ),
            *(shifts([one], quantity, "time_s") for quantity in SHIFTED),
        ]
        for one, p in zip(rows, shown, strict=True)
    ]
    below = Page([list(row) for row in zip(*columns, strict=True)], share="x")
    both = [Page([[_fronts(shown), *maps]]), below]
    size = (max(4.2 * len(shown), 12.0), 13.0)
    title = undrawn(parts)
    return picture(Page(size=size, title=title, parts=both, stacked=True, heights=(1.0, 2.2)))


def _fronts(logs: Sequence[EdgeTimes]) -> Panel:
    """P4 Fig. 7: one passage of each accelerometer, in levels outside the patch, and its fronts."""
    marks = [level(0.5, "", "0.8", width=0.8)]
    for number, p in enumerate(logs):
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


def _with_map(rows: Sequence[ChannelRows], quantity: str, calibration: Calibration | None) -> Panel:
    """P4 Fig. 9: all passages over speed, and the calibration's map with its range."""
    panel = replace(shifts(rows, quantity, "speed_m_s"), title="Over speed (P4 Fig. 9)")
    if calibration is None:
        return panel
    width = quantity == "patch_width"
    one = calibration.width if width else calibration.shift
    speed = np.linspace(one.low_m_s, one.high_m_s, 200)
    least = calibration.patch_width_deg if width else 0.0
    change = one(speed, calibration.reference_speed_m_s) + least
    return replace(panel, marks=[*panel.marks, line(speed, change, "map", "k", width=1.5)])
