"""Pictures of the revolutions of a grating: waterfall, polar footprint, edges, lengths, orders.

Recording and FootprintOfChannel of each channel --while the log is open--> TurnsSketch
    --all of them, and the kind--> a slide as PNG, SVG or PDF, a panel per log
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.data.recording import Recording, Stack
from tirelog.inference.stacks.cut import joined, stacks_from_logs
from tirelog.physics.model.model import Model
from tirelog.physics.moving.ring import Mode, natural_modes, of_model
from tirelog.plots.record import (
    Mark,
    Page,
    Panel,
    band,
    dots,
    heat,
    level,
    line,
    rows_of,
    span,
    upright,
    words,
)
from tirelog.plots.style import (
    COLOURS,
    EDGE,
    MICRO,
    RAW,
    SLIDE,
    by_value,
    on_a_slide,
    picture,
    robust_range,
    write,
)
from tirelog.strain.footprint.footprint import FootprintOfChannel
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.quality import good

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# ---- The order map: how much of each order of the wheel a grating feels, over speed or over time.
#
#     revolutions (n, m) --transform over the angle--> amplitude of each order (n, k)
#         --like speeds (or times) together--> a map whose height is the frequency, order x wheel's
#
# At constant speed all that repeats is on orders; where an order crosses a natural frequency of
# the tire it grows. With a ring model its modes are drawn as the belt feels them.


_AMPLITUDE = "amplitude of an order [microstrain]"
#: highest frequency that is drawn [Hz]: what an instrumented tire's belt still moves at
HIGHEST_HZ = 300.0
#: steps of speed, or of time, of a map
_STEPS = 40
#: a drive whose speeds span less of their median than this is drawn over time
_ONE_SPEED = 0.1
#: names of lines are so far apart, of the height
_APART = 0.035
#: the least amplitudes, so many of a hundred, are all as dark: they are noise
_DARKEST = 5.0
#: logs that have a panel
_MOST = 2
#: the end of the axis of speed without a log [m/s]
FASTEST_M_S = 40.0
#: speeds at which modes are computed
MODE_SPEEDS = 12
#: a mode that is damped more than that does not ring: no line of a map shows it
_MOST_DAMPED = 0.3


@dataclass(frozen=True)
class OrderMap:
    """Amplitudes by order along a drive.

    along      "speed" [m/s] or "time" [s], edges its steps (s + 1,)
    wheel_Hz   the wheel's frequency at each edge (s + 1,)
    amplitude  rms over the step's revolutions of each order's amplitude [strain], (s, k), order 1
               first; NaN where no revolution is
    """

    along: str
    edges: FloatArray
    wheel_Hz: FloatArray
    amplitude: FloatArray


def amplitudes(values: FloatArray) -> FloatArray:
    """Amplitude of the orders 1 ... k of each revolution, (n, k); values (n, m), NaN if unknown.

    Empty bins are filled from their neighbours. Every order has two samples per cycle even in the
    sparsest revolution.
    """
    n, m = values.shape
    known = np.isfinite(values)
    whole = np.array(values)
    at = np.arange(m)
    for row in np.flatnonzero(~known.all(axis=1)):
        have = known[row]
        whole[row] = np.interp(at, at[have], values[row, have], period=m) if have.any() else np.nan
    most = max(int(0.4 * known.sum(axis=1).min()), 1) if n else 1
    found: FloatArray = 2.0 * np.abs(np.fft.rfft(whole, axis=1))[:, 1 : most + 1] / m
    return found


def map_of(turns: Stack) -> OrderMap:
    """The order map of revolutions, over speed, or over time if they are of one speed."""
    speed_m_s, time_s = turns.conditions.speed_m_s, turns.conditions.time_s
    several = np.ptp(speed_m_s) > _ONE_SPEED * np.median(speed_m_s)
    axis = speed_m_s if several else time_s
    # a moment of its own for each revolution; of similar speeds some together
    steps = int(min(_STEPS, max(axis.size // 2, 1) if several else axis.size))
    edges = np.linspace(axis.min(), axis.max() + 1e-9, steps + 1)
    row = np.clip(np.searchsorted(edges, axis, side="right") - 1, 0, steps - 1)
    squares = amplitudes(turns.values) ** 2
    mean = np.full((steps, squares.shape[1]), np.nan)
    for step in np.unique(row):
        mean[step] = squares[row == step].mean(axis=0)
    order = np.argsort(time_s)
    speeds = edges if several else np.interp(edges, time_s[order], speed_m_s[order])
    wheel_Hz = speeds / (2.0 * np.pi * turns.radius_m)
    return OrderMap("speed" if several else "time", edges, wheel_Hz, np.sqrt(mean))


def order_maps(
    maps: Sequence[tuple[str, OrderMap]], orders: Sequence[int] = (1, 5, 10, 20, 40)
) -> list[Panel]:
    """Panels of maps by name, at one scale of colours; `orders` are named at the edge."""
    every = np.concatenate([found.amplitude.ravel() for _, found in maps])
    known = MICRO * every[np.isfinite(every) & (every > 0.0)]
    low, high = (
        (float(np.percentile(known, _DARKEST)), float(known.max())) if known.size else (0.1, 1.0)
    )
    panels = []
    for name, found in maps:
        bounds = np.arange(found.amplitude.shape[1] + 1) + 0.5
        along = np.broadcast_to(found.edges[:, None], (found.edges.size, bounds.size))
        felt, values = found.wheel_Hz[:, None] * bounds, MICRO * found.amplitude
        top = min(HIGHEST_HZ, float(found.wheel_Hz.max() * bounds[-1]))
        heights = {order: order * found.wheel_Hz[-1] for order in orders if order < bounds[-1]}
        panels.append(
            Panel(
                "speed [m/s]" if found.along == "speed" else "time [s]",
                "frequency on the belt [Hz]",
                [
                    heat(along, felt, values, _AMPLITUDE, "log", low, max(high, 1.01 * low)),
                    *(
                        words(f" order {order}", found.edges[-1], y, fontsize=9, va="center")
                        for order, y in heights.items()
                        if y < 0.97 * top
                    ),
                ],
                name,
                ((found.edges[0], found.edges[-1]), (0.0, top)),
            )
        )
    return panels


def on_the_belt(mode: Mode, wheel_Hz: float) -> float:
    """The frequency [Hz] at which a point of the turning belt feels a mode.

    A wave of n lobes that goes with the rotation passes a point of the belt n times less per turn.
    One against it passes n times more. A wave that does not travel keeps its frequency.
    """
    turned = {"with": -1.0, "against": 1.0}.get(mode.direction, 0.0) * mode.lobes * wheel_Hz
    return abs(mode.frequency_Hz + turned)


def mode_lines(
    model: Model, found: OrderMap | None, *, highest_Hz: float, **more: Any
) -> list[Mark]:
    """Modes of a ring model in the air, as lines over speed on the belt.

    On the road waves of several numbers of lobes mix, and a mode has no one frequency on the belt.
    `found` is the map below the lines; without it they go from rest to FASTEST_M_S. `more`: the
    hub's mass and inertia, as for `of_model`.
    """
    from matplotlib.patheffects import Stroke

    radius_m = model.values["radius_m"]
    if found is None:
        places = speeds = np.linspace(0.0, FASTEST_M_S, MODE_SPEEDS)
    else:
        places = np.linspace(found.edges[0], found.edges[-1], MODE_SPEEDS)
        speeds = 2.0 * np.pi * radius_m * np.interp(places, found.edges, found.wheel_Hz)
    tire = of_model(model.values, **more)
    lines: dict[tuple[str, str], FloatArray] = {}
    for number, speed in enumerate(speeds):
        wheel_Hz = float(speed) / (2.0 * np.pi * radius_m)
        # if the tire is at rest, what goes with the rotation and against it is one: just turning
        for mode in natural_modes(tire, speed_m_s=max(float(speed), 1e-3), to_Hz=2.0 * highest_Hz):
            if mode.damping_ratio < _MOST_DAMPED:
                felt = lines.setdefault((mode.shape, mode.direction), np.full(len(speeds), np.nan))
                felt[number] = on_the_belt(mode, wheel_Hz)
    below, dashes = -np.inf, {"with": "solid", "against": "dash"}
    around = [Stroke(linewidth=3.4, foreground="white"), Stroke(linewidth=1.6, foreground="black")]
    marks = []
    for (shape, direction), felt in sorted(lines.items(), key=lambda item: item[1][-1]):
        look = {"dash": dashes.get(direction, "dot"), "width": 1.6, "path_effects": around}
        marks.append(line(places, felt, "", "black", **look))
        height = float(felt[-1])
        if height <= highest_Hz and height - below >= _APART * highest_Hz:
            below = height  # else names would lie on each other
            look = {"fontsize": 9, "va": "center", "beside": (4, 0), "annotation_clip": False}
            marks.append(words(f" {shape}", places[-1], height, **look))
    for direction, dash in dashes.items():
        name = f"wave {direction} the rotation"
        marks.append(line([], [], name, "black", dash=dash, width=1.6))
    return marks


def modes_over_orders(
    model: Model,
    maps: Sequence[tuple[str, OrderMap]],
    path: Path,
    *,
    highest_Hz: float = HIGHEST_HZ,
    **more: Any,
) -> None:
    """Write the modes over the order maps of logs, by name, to `path`; over speed without one."""
    named = [(Path(log).name, found) for log, found in maps[:_MOST]]
    below: list[OrderMap | None] = [found for _, found in named] or [None]
    empty = Panel("speed [m/s]", "frequency on the belt [Hz]", limits=((0.0, FASTEST_M_S), None))
    panels = [
        replace(
            panel,
            marks=[*panel.marks, *mode_lines(model, found, highest_Hz=highest_Hz, **more)],
            limits=(panel.limits[0], (0.0, highest_Hz)),
            legend={"loc": "upper left", "title": "modes in the air", "title_fontsize": 10},
        )
        for panel, found in zip(order_maps(named, orders=()) or [empty], below, strict=True)
    ]
    size = (SLIDE[0] if len(panels) > 1 else 0.8 * SLIDE[0], SLIDE[1])
    with on_a_slide():
        write(picture(Page([panels], size, bar=_AMPLITUDE, bar_style={"format": "%g"})), path)


def map_of_log(recording: Recording, channel: str | None = None) -> OrderMap:
    """The order map of a log's strain, of its first or its named grating.

    UsageError: no such channel, or too few revolutions.
    """
    return map_of(joined(stacks_from_logs([recording], "strain", channel)))


# ---- Waveforms drawn around the wheel, as they are where they act: the road is below.


def around_the_wheel(
    axes: Any,
    waves: Sequence[tuple[FloatArray, FloatArray, FloatArray, str]],
    colours: Sequence[Any],
    half_angle_rad: float,
    unit: str = "microstrain",
) -> float:
    """Waveforms (angle, value, band, name) on polar `axes`: zero is a circle, the road is below.

    The tire turns so that the entry is at the right. The radius of the zero circle comes back: the
    whole range of the values, so that the lowest of them stays off the centre.
    """
    values = np.concatenate([w for _, w, _, _ in waves])
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    zero = 1.6 * max(high - low, 1e-12) - low
    axes.set_theta_zero_location("S")
    axes.set_theta_direction(-1)
    for (phi, wave, width, name), colour in zip(waves, colours, strict=True):
        axes.fill_between(
            phi, zero + wave - width, zero + wave + width, color=colour, alpha=0.3, lw=0
        )
        axes.plot(phi, zero + wave, color=colour, label=name)
    round_it = np.linspace(-np.pi, np.pi, 361)
    axes.plot(round_it, np.full(361, zero), color=RAW, lw=0.9, ls="--")
    outer = zero + high + 0.12 * (high - low)
    arc = np.linspace(-half_angle_rad, half_angle_rad, 61)
    axes.plot(arc, np.full(61, outer), color=EDGE, lw=6.0, solid_capstyle="butt")
    axes.annotate("patch", (0.0, outer), xytext=(0, -14), textcoords="offset points",
                  ha="center", va="top", color=EDGE, annotation_clip=False)  # fmt: skip
    axes.annotate("rolls →", (0.94, 0.04), xycoords="axes fraction", ha="right", color=RAW)
    step = _round_step(high - low)
    ticks = np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step
    names = [f"{t:g} {unit}" if t == ticks[-1] else f"{t:g}" for t in ticks]
    _, labels = axes.set_rgrids(zero + ticks, names, angle=205.0, fontsize=10)
    for text in labels:
        text.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 1.0})
        text.set_ha("center")
    axes.set_rlim(0.0, outer)
    turns = np.arange(-135, 181, 45)
    axes.set_thetagrids(turns % 360, ["" if t == 0 else f"{t}°" for t in turns], fontsize=11)
    axes.grid(alpha=0.35)
    return zero


def _round_step(span: float) -> float:
    """A round number that divides the span into two to four."""
    size = 10.0 ** np.floor(np.log10(span / 2.0))
    return float(size * max(n for n in (1.0, 2.0, 5.0) if n * size <= span / 2.0))


#: channels that are drawn; more panels cannot be read on a slide
MOST = 4
#: revolutions of a channel that are kept, evenly over the log if there are more: 4 MB
_MOST_TURNS = 2000
#: classes of speed that have a colour each
_CLASSES = 4
#: half of the part of the wheel that a waterfall shows, in half lengths of the patch
_AROUND = 7.0
#: half of a close-up of an edge, in half lengths of the patch
_CLOSE = 0.55
#: standard errors of a band
_SIGMAS = 2.0


@dataclass(frozen=True)
class TurnsSketch:
    """The revolutions of one channel, read while its log was open: each `every`-th as `turns`.

    `found` holds the contact length of each passage.
    """

    recording: Recording
    found: FootprintOfChannel
    turns: Stack
    every: int

    @classmethod
    def of(cls, recording: Recording, found: FootprintOfChannel) -> TurnsSketch:
        """The sketch of a channel whose log is open.

        UsageError: fewer whole revolutions than a picture of them needs.
        """
        stacks = stacks_from_logs([recording], "strain", found.channel.name)
        every = -(-sum(len(stack) for stack in stacks.outlines()) // _MOST_TURNS)
        kept, first = [], 0  # less the revolutions before this stack
        for stack in stacks:
            kept.append(stack.take(slice(first % every, None, every)))
            first -= len(stack)
        return cls(recording, found, joined(kept), every)

    @property
    def name(self) -> str:
        """Log and channel."""
        return f"{Path(self.recording.log).name}: {self.found.channel.name}"

    @property
    def length(self) -> tuple[float, float, float]:
        """Median contact length [m], its standard error and the scatter of a passage's [m].

        The error is that of the median and, beside it, that of the form that all passages share.
        """
        lengths = self.found.footprint.length_m[good(self.found.footprint.quality)]
        lengths = lengths[np.isfinite(lengths)]
        if not lengths.size:
            return float("nan"), float("nan"), float("nan")
        middle = float(np.median(lengths))
        scatter = 1.4826 * float(np.median(np.abs(lengths - middle)))
        form = self.found.footprint.form_se_m
        shared = float(np.nanmedian(form)) if np.isfinite(form).any() else 0.0
        return middle, float(np.hypot(1.2533 * scatter / lengths.size**0.5, shared)), scatter

    @property
    def half_angle_rad(self) -> float:
        """Half of the patch on the wheel; of a log without lengths a usual one."""
        length = self.length[0]
        return 0.5 * (length if np.isfinite(length) else 0.1) / self.turns.radius_m


def speed_classes(turns: Stack) -> list[tuple[float, int, FloatArray, FloatArray]]:
    """(speed, revolutions, mean (m,), scatter (m,)) of each class of speed, slowest first.

    Classes are of equal width. One of fewer than three revolutions has no scatter and is left out.
    """
    speed = turns.conditions.speed_m_s
    # a spread of a tenth of the speed is one class
    span = float(np.ptp(speed)) / max(float(np.median(speed)), 1e-9)
    count = 1 if span < 0.1 else _CLASSES
    edges = np.linspace(speed.min(), speed.max(), count + 1)
    which = np.clip(np.searchsorted(edges, speed, side="right") - 1, 0, count - 1)
    found = []
    for number in range(count):
        rows = which == number
        if rows.sum() < 3:
            continue
        values = turns.values[rows]
        times = np.isfinite(values).sum(axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = np.nansum(values, axis=0) / times
            square = np.nansum((values - mean) ** 2, axis=0) / (times - 1)
        scatter = np.where(times > 2, np.sqrt(square), np.nan)
        mean = np.where(times, mean, np.nan)
        found.append((float(speed[rows].mean()), int(rows.sum()), mean, scatter))
    return found


def turns_picture(sketches: Sequence[TurnsSketch], kind: str) -> Figure:
    """The picture of this kind: a panel per channel, of at most MOST."""
    with on_a_slide():
        return picture(KINDS[kind](sketches))


def _page(panels: Sequence[Panel], sketches: Sequence[TurnsSketch], bar: str = "") -> Page:
    """A page with a panel for each drawn channel; its title counts the others."""
    across = 1 if len(panels) == 1 else 2
    rows = rows_of(panels, across)
    width = 0.75 * SLIDE[0] if across == 1 else SLIDE[0]
    left = len(sketches) - MOST
    title = f"{left} more are not drawn" if left > 0 else ""
    return Page(rows, (width, SLIDE[1] if len(rows) == 1 else 1.45 * SLIDE[1]), title, bar=bar)


def waterfall(sketches: Sequence[TurnsSketch]) -> Page:
    """Strain in colour over the angle about the patch and the revolutions, one scale for all."""
    low, high = robust_range(*(s.turns.values for s in sketches[:MOST]), share=0.0, margin=0.0)
    panels = []
    for sketch in sketches[:MOST]:
        turns, speed = sketch.turns, sketch.turns.conditions.speed_m_s
        near = np.abs(turns.phi_rad) <= min(_AROUND * sketch.half_angle_rad, np.pi)
        phi, number = np.degrees(turns.phi_rad), 1 + sketch.every * np.arange(len(turns))
        strain = MICRO * filled(turns.values)[:, near]
        scale = ("linear", MICRO * low, MICRO * high)
        half = float(np.degrees(sketch.half_angle_rad))
        panels.append(
            Panel(
                "angle from the patch centre [deg]",
                f"revolution{f', each {sketch.every}th' if sketch.every > 1 else ''}",
                [
                    heat(phi[near], number, strain, "strain [microstrain]", *scale),
                    *upright((-half, half), "", "white", width=1.0, dash="dash"),
                ],
                f"{sketch.name}\n{speed.min():.0f} to {speed.max():.0f} m/s",
            )
        )
    return _page(panels, sketches, "strain [microstrain]")


def filled(values: FloatArray) -> FloatArray:
    """The revolutions with bins between two known ones filled; longer gaps stay empty, (n, m).

    At speed a bin is narrower than the way between two samples: it is empty, and nothing lost.
    """
    left, right = np.roll(values, 1, axis=1), np.roll(values, -1, axis=1)
    made: FloatArray = np.where(np.isfinite(values), values, 0.5 * (left + right))
    return made


def polar(sketches: Sequence[TurnsSketch]) -> Page:
    """The mean strain around the wheel, road below, by speed; the patch as an arc on the road."""
    panels = []
    for sketch in sketches[:MOST]:
        classes, phi = speed_classes(sketch.turns), sketch.turns.phi_rad
        waves = [
            (phi, MICRO * mean, MICRO * scatter, f"{speed:.1f} m/s ({count})")
            for speed, count, mean, scatter in classes
        ]
        length, se, _ = sketch.length
        told = f"\npatch {1e3 * length:.1f} ± {1e3 * se:.1f} mm" if np.isfinite(length) else ""
        panels.append(
            Panel(
                title=f"{sketch.name}{told}",
                legend={
                    "loc": "center",
                    "title": "mean of (revolutions)",
                    "title_fontsize": 10,
                },
                own=partial(
                    around_the_wheel,
                    waves=waves,
                    colours=by_value([speed for speed, *_ in classes]),
                    half_angle_rad=sketch.half_angle_rad,
                ),
                polar=True,
            )
        )
    return _page(panels, sketches)


def edges(sketches: Sequence[TurnsSketch]) -> Page:
    """Entry and exit edge close up: means by speed with two standard errors and the scatter."""
    shown = sketches[:MOST]
    return Page(
        [[_edge(sketch, -1.0, "entry"), _edge(sketch, 1.0, "exit")] for sketch in shown],
        (SLIDE[0], SLIDE[1] * (1.0 if len(shown) < 3 else 1.45)),
        "dark band: two standard errors of the mean; light band: scatter of a revolution; "
        "orange: the edge and its scatter",
        share="y",
    )


def _edge(sketch: TurnsSketch, side: float, name: str) -> Panel:
    """One edge of a channel."""
    classes, phi, half = speed_classes(sketch.turns), sketch.turns.phi_rad, sketch.half_angle_rad
    radius_mm, moves = 1e3 * sketch.turns.radius_m, 500 * sketch.length[2]
    reach, middle = _CLOSE * half, side * half * radius_mm
    near = np.abs(phi - side * half) <= reach + 2 * np.diff(phi).max()
    x = radius_mm * phi[near]
    marks = []
    colours = by_value([speed for speed, *_ in classes])
    for (speed, count, mean, scatter), colour in zip(classes, colours, strict=True):
        y, wide = MICRO * mean[near], MICRO * scatter[near]
        narrow = _SIGMAS * wide / count**0.5
        marks += [
            band(x, y - wide, y + wide, "", colour, opacity=0.15),
            band(x, y - narrow, y + narrow, "", colour, opacity=0.45),
            line(x, y, f"{speed:.1f} m/s", colour, symbol=".", size=5),
        ]
    marks.append(span(middle - moves, middle + moves, EDGE, opacity=0.2))
    return Panel(
        "ξ from the patch centre [mm]",
        "strain [microstrain]" if side < 0 else "",
        [*marks, *upright([middle], "", EDGE, width=1.5, dash="dash")],
        f"{sketch.name}, {name}",
        ((middle - radius_mm * reach, middle + radius_mm * reach), None),
        legend={"loc": "lower left"} if side < 0 else None,
    )


def lengths(sketches: Sequence[TurnsSketch]) -> Page:
    """Contact length with two standard errors over speed and over time, a colour per channel."""
    marks: dict[str, list[Mark]] = {"speed_m_s": [], "time_s": []}
    heights = []
    for colour, sketch in zip(COLOURS[:-1], sketches, strict=False):
        f, p = sketch.found.footprint, sketch.found.passages
        rows = np.flatnonzero(good(f.quality) & np.isfinite(f.length_m))
        rows = rows[:: max(-(-rows.size // 300), 1)]
        length, error = 1e3 * f.length_m[rows], _SIGMAS * 1e3 * f.length_se_m[rows]
        heights.append(length)
        look = {"error": error, "size": 5, "elinewidth": 0.8, "opacity": 0.75}
        for x, drawn in marks.items():
            drawn.append(dots(getattr(p, x)[rows], length, sketch.name, colour, **look))
            if (static := sketch.recording.setup.tire.static_footprint_length_m) is not None:
                drawn.append(level(1e3 * static, "", colour, width=1.2, dash="dot"))
                heights.append(np.array([1e3 * static]))
    left = len(sketches) - (len(COLOURS) - 1)
    statics = any(s.recording.setup.tire.static_footprint_length_m for s in sketches)
    said = (
        "bars: two standard errors"
        + (f"; {left} more channels are not drawn" if left > 0 else "")
        + ("; dotted: static footprint" if statics else "")
    )
    limits = (None, robust_range(*heights, share=0.0))
    by_speed = Panel(
        "speed [m/s]", "contact length [mm]", marks["speed_m_s"], "", limits, legend={"loc": "best"}
    )
    by_time = Panel("time [s]", "", marks["time_s"], "", limits, legend=None)
    return Page([[by_speed, by_time]], SLIDE, said, share="y")


def orders(sketches: Sequence[TurnsSketch]) -> Page:
    """The order map of each channel, at one scale of colours."""
    maps = [(sketch.name, map_of(sketch.turns)) for sketch in sketches[:MOST]]
    return _page(order_maps(maps), sketches, _AMPLITUDE)


KINDS: Mapping[str, Callable[[Sequence[TurnsSketch]], Page]] = {
    "waterfall": waterfall,
    "polar": polar,
    "edges": edges,
    "lengths": lengths,
    "orders": orders,
}
