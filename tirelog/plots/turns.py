"""Pictures of logs: their signals, and a grating's revolutions as waterfall, wheel and edges.

Recording, and its tables of speeds or footprints --while the log is open--> sketches
    --all of them, and the kind--> a page, or a slide with a panel per log
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.data.recording import Channel, Recording, Stack
from tirelog.errors import UsageError
from tirelog.inference.stacks.cut import joined, stacks_from_logs
from tirelog.plots.record import (
    BUCKETS,
    COLOURS,
    EDGE,
    MARK,
    MICRO,
    RAW,
    SLIDE,
    Mark,
    Page,
    Panel,
    band,
    by_value,
    decimated,
    dots,
    heat,
    line,
    on_a_slide,
    picture,
    robust_range,
    rows_of,
    span,
    upright,
    words,
)
from tirelog.products import Part
from tirelog.strain.speed import PassageRows
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.kinds import STRAIN_KINDS
from tirelog.vocabulary.quality import good, good_rows

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# ---- The signals of a log over time, with the passages of the patch.


#: channels that are drawn; more panels cannot be read on a slide. Logs whose signals are drawn
MOST = 4
#: signals of a log that are drawn
_MOST_SIGNALS = 8


def signals(
    recording: Recording,
    channels: Sequence[Channel],
    speeds: Sequence[Mapping[str, Any]],
    ends: tuple[float, float],
    colours: tuple[Any, Any, Any] = (COLOURS[0], MARK, EDGE),
) -> list[Panel]:
    """A panel per channel of a log that is open, between two times [s]; points are passages.

    speeds   rows of the table `speed`, a part for each channel that has passages
    colours  of the signal, and of passages without and with a mark
    """
    left = len(channels) - _MOST_SIGNALS
    title = f"{left} more channels are not drawn" if left > 0 else ""
    passages = {str(rows["channel"][0]): rows for rows in speeds if np.size(rows["time_s"])}
    panels = list[Panel]()
    for channel in channels[:_MOST_SIGNALS]:
        low, high = channel.axis.index(np.array(ends)).clip(0, channel.size - 1)
        time, values = decimated(channel, BUCKETS, int(np.ceil(low)), int(high) + 1)
        strain = channel.kind in STRAIN_KINDS
        factor, unit = (MICRO, "microstrain") if strain else (1.0, channel.unit or "1")
        marks = [line(time, factor * values, "", colours[0], width=0.6)]
        if channel.name in passages and values.size:
            rows = passages[channel.name]
            clean = good_rows(rows["quality"])
            below = factor * (np.min(values) - 0.06 * np.ptp(values))
            of = ((clean, "", colours[1]), (~clean, ", flagged", colours[2]))
            for some, said, colour in of:
                at = np.asarray(rows["time_s"])[some]
                marks.append(dots(at, np.full(at.size, below), f"passage{said}", colour, size=4))
        panels.append(Panel("time [s]", f"{channel.name}\n[{unit}]", marks))
    panels[0] = replace(panels[0], title="; ".join(filter(None, (Path(recording.log).name, title))))
    return panels


def signal_page(logs: Sequence[Sequence[Panel]]) -> Page:
    """Logs beside each other, the signals of each below each other."""
    shown = logs[:MOST]
    rows = list(zip_longest(*shown))
    left = len(logs) - len(shown)
    title = f"{left} more logs are not drawn" if left > 0 else ""
    width = 12.0 if len(shown) == 1 else 7.0 * len(shown)
    return Page(rows, (width, 1.4 + 1.9 * len(rows)), title, share="x")


# ---- The revolutions of a grating.


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


def found_of_grating(recording: Recording, part: Part) -> PassageRows:
    """What rows of the table `footprint` were made of.  UsageError: of an accelerometer."""
    if isinstance(part.found, PassageRows) and part.found.found is not None:
        return part.found
    raise UsageError(
        "this picture is of a grating; this log has accelerometers",
        allowed="a log of strain is allowed",
        do="`tirelog phase-shift --plot` draws fronts",
        file=recording.log,
    )


@dataclass(frozen=True)
class TurnsSketch:
    """The revolutions of one channel, read while its log was open: each `every`-th as `turns`.

    `found` holds the contact length of each passage.
    """

    recording: Recording
    found: PassageRows
    turns: Stack
    every: int

    @classmethod
    def of(cls, recording: Recording, found: PassageRows) -> TurnsSketch:
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
        lengths = self.found.found.length_m[good(self.found.found.quality)]
        lengths = lengths[np.isfinite(lengths)]
        if not lengths.size:
            return float("nan"), float("nan"), float("nan")
        middle = float(np.median(lengths))
        scatter = 1.4826 * float(np.median(np.abs(lengths - middle)))
        form = self.found.found.form_se_m
        shared = float(np.nanmedian(form)) if np.isfinite(form).any() else 0.0
        return middle, float(np.hypot(1.2533 * scatter / lengths.size**0.5, shared)), scatter

    @property
    def half_angle_rad(self) -> float:
        """Half of the patch on the wheel; of a log without lengths a usual one."""
        length = self.length[0]
        return 0.5 * (length if np.isfinite(length) else 0.1) / self.turns.radius_m


#: speed [m/s], how many revolutions, their mean (m,) and scatter (m,)
SpeedClass = tuple[float, int, FloatArray, FloatArray]


def speed_classes(turns: Stack) -> list[SpeedClass]:
    """Each class of speed, slowest first.

    Classes are of equal width. One of fewer than three revolutions has no scatter and is left out.
    """
    speed = turns.conditions.speed_m_s
    # a spread of a tenth of the speed is one class
    span = float(np.ptp(speed)) / max(float(np.median(speed)), 1e-9)
    # of twelve revolutions one of four classes has three
    count = 1 if span < 0.1 or speed.size < 3 * _CLASSES else _CLASSES
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


def log_picture(sketches: Sequence[Any], kind: str) -> Figure:
    """The picture of this kind: a panel per channel of at most MOST, or all signals of a log."""
    if kind == "signal":
        return picture(signal_page(sketches))
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
        length, se, _ = sketch.length
        told = f"\npatch {1e3 * length:.1f} ± {1e3 * se:.1f} mm" if np.isfinite(length) else ""
        marks = around_the_wheel(speed_classes(sketch.turns), sketch.turns, sketch.half_angle_rad)
        legend = {"loc": "center", "title": "mean of (revolutions)", "title_fontsize": 10}
        panels.append(Panel(marks=marks, title=f"{sketch.name}{told}", legend=legend, bare=True))
    return _page(panels, sketches)


def around_the_wheel(
    classes: Sequence[SpeedClass], turns: Stack, half_angle_rad: float
) -> list[Mark]:
    """The mean strain of each class of speed as a ring about that of zero; the road is below.

    The tire turns so that the entry is at the right. The radius of zero is the whole range of the
    values, so that the lowest of them stays off the centre.
    """
    means = MICRO * np.stack([mean for _, _, mean, _ in classes])
    low, high = float(np.nanmin(means)), float(np.nanmax(means))
    zero = 1.6 * max(high - low, 1e-12) - low
    outer = zero + high + 0.12 * (high - low)
    phi = np.append(turns.phi_rad, turns.phi_rad[0])

    def ring(angle: FloatArray, radius: Any, name: str, colour: Any, **style: Any) -> Mark:
        return line(-radius * np.sin(angle), -radius * np.cos(angle), name, colour, **style)

    marks = []
    for value in (0.0, low, high):
        circle = np.full(phi.size, zero + value)
        marks.append(ring(phi, circle, "", RAW, width=0.9, dash="dash" if value else "solid"))
        said = {"ha": "center", "beside": (0, 2), "color": RAW}
        marks.append(words(f"{value:.0f} microstrain", 0.0, zero + value, **said))
    arc = np.linspace(-half_angle_rad, half_angle_rad, 61)
    marks.append(ring(arc, outer, "", EDGE, width=6.0))
    marks.append(words("patch", 0.0, -outer, ha="center", va="bottom", color=EDGE, beside=(0, 8)))
    marks.append(words("rolls →", outer, -outer, ha="right", color=RAW))
    colours = by_value([speed for speed, *_ in classes])
    for (speed, count, _, _), mean, colour in zip(classes, means, colours, strict=True):
        closed = np.append(mean, mean[0])
        marks.append(ring(phi, zero + closed, f"{speed:.1f} m/s ({count})", colour))
    return marks


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


KINDS: Mapping[str, Callable[[Sequence[TurnsSketch]], Page]] = {
    "waterfall": waterfall,
    "polar": polar,
    "edges": edges,
}
