"""Pictures of the revolutions of a grating: waterfall, polar footprint, edges, lengths, orders.

Recording and FootprintOfChannel of each channel --while the log is open--> TurnsSketch
    --all of them, and the kind--> a slide as PNG, SVG or PDF, a panel per log
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.data.recording import Recording
from tirelog.inference.stacks.cut import stacks_from_logs
from tirelog.plots.orders import map_of, order_maps
from tirelog.plots.style import (
    COLOURS,
    EDGE,
    MICRO,
    SLIDE,
    by_value,
    figure_page,
    label,
    on_a_slide,
    robust_range,
    write,
)
from tirelog.plots.wheel import around_the_wheel
from tirelog.strain.footprint.table import FootprintOfChannel
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.quality import good

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
    """The revolutions of one channel, read while its log was open.

    phi_rad (m,), entry negative; strain (n, m), NaN where there is no sample; time_s, speed_m_s,
    manoeuvre (n,); every is the share of revolutions kept: each `every`-th.
    found holds the contact length of each passage.
    """

    log: str
    channel: str
    radius_m: float
    phi_rad: FloatArray
    strain: FloatArray
    time_s: FloatArray
    speed_m_s: FloatArray
    every: int
    found: FootprintOfChannel
    static_length_m: float | None = None

    @classmethod
    def of(cls, recording: Recording, found: FootprintOfChannel) -> TurnsSketch:
        """The sketch of a channel whose log is open.

        UsageError: fewer whole revolutions than a picture of them needs.
        """
        stacks = stacks_from_logs([recording], "strain", found.channel.name)
        total = sum(len(stack) for stack in stacks.outlines())
        every = -(-total // _MOST_TURNS)
        kept, first = [], 0  # less the revolutions before this stack
        for stack in stacks:
            kept.append(stack.take(slice(first % every, None, every)))
            first -= len(stack)
        return cls(
            recording.log,
            found.channel.name,
            kept[0].radius_m,
            kept[0].phi_rad,
            np.concatenate([part.values for part in kept]),
            np.concatenate([part.conditions.time_s for part in kept]),
            np.concatenate([part.conditions.speed_m_s for part in kept]),
            every,
            found,
            recording.setup.tire.static_footprint_length_m,
        )

    @property
    def name(self) -> str:
        """Log and channel."""
        return f"{Path(self.log).name}: {self.channel}"

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
        return 0.5 * (length if np.isfinite(length) else 0.1) / self.radius_m


@dataclass(frozen=True)
class SpeedClass:
    """Revolutions of like speed: their mean waveform and its band, (m,), as strain."""

    speed_m_s: float
    turns: int
    mean: FloatArray
    scatter: FloatArray

    @property
    def se(self) -> FloatArray:
        """Standard error of the mean, (m,)."""
        return np.asarray(self.scatter / max(self.turns, 1) ** 0.5)


def speed_classes(sketch: TurnsSketch) -> list[SpeedClass]:
    """The revolutions by speed, slowest first, in classes of equal width.

    A class whose revolutions are fewer than three has no scatter and is left out.
    """
    speed = sketch.speed_m_s
    # a spread of a tenth of the speed is one class
    span = float(np.ptp(speed)) / max(float(np.median(speed)), 1e-9)
    count = 1 if span < 0.1 else _CLASSES
    edges = np.linspace(speed.min(), speed.max(), count + 1)
    which = np.clip(np.searchsorted(edges, speed, side="right") - 1, 0, count - 1)
    found = []
    for number in range(count):
        rows = which == number
        known = np.isfinite(sketch.strain[rows])
        if rows.sum() < 3:
            continue
        times = known.sum(axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = np.nansum(sketch.strain[rows], axis=0) / times
            square = np.nansum((sketch.strain[rows] - mean) ** 2, axis=0) / (times - 1)
        scatter = np.where(times > 2, np.sqrt(square), np.nan)
        found.append(
            SpeedClass(
                float(speed[rows].mean()), int(rows.sum()), np.where(times, mean, np.nan), scatter
            )
        )
    return found


def turns_picture(sketches: Sequence[TurnsSketch], path: Path, kind: str) -> None:
    """Write the picture of this kind to `path`: a panel per channel, of at most MOST."""
    with on_a_slide():
        write(KINDS[kind](sketches), path)


def _panels(sketches: Sequence[TurnsSketch], **more: Any) -> tuple[Figure, Iterator[Any]]:
    """A page with a panel for each channel that is drawn; its title says which are not."""
    shown = min(len(sketches), MOST)
    columns = 1 if shown == 1 else 2
    rows = -(-shown // columns)
    width = 0.75 * SLIDE[0] if shown == 1 else SLIDE[0]
    figure = figure_page(width, SLIDE[1] if rows == 1 else 1.45 * SLIDE[1])
    panels = figure.subplots(rows, columns, squeeze=False, **more)
    for spare in panels.ravel()[shown:]:
        spare.remove()
    if len(sketches) > MOST:
        figure.suptitle(f"{len(sketches) - MOST} more are not drawn")
    return figure, zip(panels.ravel(), sketches[:MOST])


def waterfall(sketches: Sequence[TurnsSketch]) -> Figure:
    """Strain in colour over the angle about the patch and the revolutions, one scale for all."""
    figure, panels = _panels(sketches)
    low, high = robust_range(*(s.strain for s in sketches[:MOST]), share=0.0, margin=0.0)
    mesh: Any = None
    for axes, sketch in panels:
        reach = min(_AROUND * sketch.half_angle_rad, np.pi)
        near = np.abs(sketch.phi_rad) <= reach
        mesh = axes.pcolormesh(
            np.degrees(sketch.phi_rad[near]),
            1 + sketch.every * np.arange(len(sketch.strain)),
            MICRO * filled(sketch.strain)[:, near],
            cmap="viridis",
            vmin=MICRO * low,
            vmax=MICRO * high,
            shading="nearest",
            rasterized=True,
        )
        for side in (-1.0, 1.0):
            axes.axvline(np.degrees(side * sketch.half_angle_rad), color="white", lw=1.0, ls="--")
        speeds = f"{sketch.speed_m_s.min():.0f} to {sketch.speed_m_s.max():.0f} m/s"
        each = f", each {sketch.every}th" if sketch.every > 1 else ""
        axes.set(
            xlabel="angle from the patch centre [deg]",
            ylabel=f"revolution{each}",
            title=f"{sketch.name}\n{speeds}",
        )
    figure.colorbar(mesh, ax=figure.axes, label="strain [microstrain]")
    return figure


def filled(values: FloatArray) -> FloatArray:
    """The revolutions with bins between two known ones filled; longer gaps stay empty, (n, m).

    A bin is narrower than a sample is apart from the next at speed: it is empty, and nothing lost.
    """
    left, right = np.roll(values, 1, axis=1), np.roll(values, -1, axis=1)
    made: FloatArray = np.where(np.isfinite(values), values, 0.5 * (left + right))
    return made


def polar(sketches: Sequence[TurnsSketch]) -> Figure:
    """The mean strain around the wheel, road below, by speed; the patch as an arc on the road."""
    figure, panels = _panels(sketches, subplot_kw={"projection": "polar"})
    for axes, sketch in panels:
        classes = speed_classes(sketch)
        around_the_wheel(
            axes,
            [
                (
                    sketch.phi_rad,
                    MICRO * c.mean,
                    MICRO * c.scatter,
                    f"{c.speed_m_s:.1f} m/s ({c.turns})",
                )
                for c in classes
            ],
            by_value([c.speed_m_s for c in classes]),
            sketch.half_angle_rad,
        )
        length, se, _ = sketch.length
        told = f"\npatch {1e3 * length:.1f} ± {1e3 * se:.1f} mm" if np.isfinite(length) else ""
        axes.set_title(f"{sketch.name}{told}")
        axes.legend(loc="center", title="mean of (revolutions)", title_fontsize=10)
    return figure


def edges(sketches: Sequence[TurnsSketch]) -> Figure:
    """Entry and exit edge close up: means by speed with two standard errors and the scatter."""
    shown = sketches[:MOST]
    figure = figure_page(SLIDE[0], SLIDE[1] * (1.0 if len(shown) < 3 else 1.45))
    panels = figure.subplots(len(shown), 2, squeeze=False, sharey="row")
    for row, sketch in zip(panels, shown):
        classes = speed_classes(sketch)
        colours = by_value([c.speed_m_s for c in classes])
        half = sketch.half_angle_rad
        _, _, scatter = sketch.length
        for axes, side, name in zip(row, (-1.0, 1.0), ("entry", "exit")):
            reach = _CLOSE * half
            near = np.abs(sketch.phi_rad - side * half) <= reach + 2 * np.diff(sketch.phi_rad).max()
            x = 1e3 * sketch.radius_m * sketch.phi_rad[near]
            heights = []
            for c, colour in zip(classes, colours, strict=True):
                mean = MICRO * c.mean[near]
                heights.append(mean)
                for band, alpha in ((c.scatter, 0.15), (_SIGMAS * c.se, 0.45)):
                    width = MICRO * band[near]
                    axes.fill_between(
                        x, mean - width, mean + width, color=colour, alpha=alpha, lw=0
                    )
                axes.plot(x, mean, ".-", color=colour, ms=5, label=f"{c.speed_m_s:.1f} m/s")
            middle = 1e3 * side * half * sketch.radius_m
            axes.axvspan(
                middle - 500 * scatter, middle + 500 * scatter, color=EDGE, alpha=0.2, lw=0
            )
            axes.axvline(middle, color=EDGE, lw=1.5, ls="--")
            label(
                axes,
                "ξ from the patch centre [mm]",
                "strain [microstrain]" if side < 0 else "",
                xlim=(
                    middle - 1e3 * reach * sketch.radius_m,
                    middle + 1e3 * reach * sketch.radius_m,
                ),
            )
            axes.set_title(f"{sketch.name}, {name}", loc="left")
        row[0].legend(loc="lower left")
    figure.suptitle(
        "dark band two standard errors of the mean, light band scatter of a revolution; "
        "orange the edge, and how far it scatters",
        fontsize=12,
    )
    return figure


def lengths(sketches: Sequence[TurnsSketch]) -> Figure:
    """Contact length with two standard errors over speed and over time, a colour per channel."""
    figure = figure_page(*SLIDE)
    by_speed, by_time = figure.subplots(1, 2, sharey=True)
    heights = []
    for number, sketch in enumerate(sketches[: len(COLOURS) - 1]):
        f, p = sketch.found.footprint, sketch.found.passages
        clean = good(f.quality) & np.isfinite(f.length_m)
        rows = np.flatnonzero(clean)
        rows = rows[:: max(-(-rows.size // 300), 1)]
        colour, length = COLOURS[number], 1e3 * f.length_m[rows]
        for axes, x, name in (
            (by_speed, p.speed_m_s, sketch.name),
            (by_time, p.time_s, None),
        ):
            axes.errorbar(
                x[rows],
                length,
                yerr=_SIGMAS * 1e3 * f.length_se_m[rows],
                fmt=".",
                color=colour,
                ms=5,
                elinewidth=0.8,
                alpha=0.75,
                label=name,
            )
        heights.append(length)
        if sketch.static_length_m is not None:
            for axes in (by_speed, by_time):
                axes.axhline(1e3 * sketch.static_length_m, color=colour, lw=1.2, ls=":")
            heights.append(np.array([1e3 * sketch.static_length_m]))
    limits = robust_range(*heights, share=0.0)
    label(by_speed, "speed [m/s]", "contact length [mm]", ylim=limits)
    label(by_time, "time [s]", "")
    by_speed.legend(loc="best")
    left = len(sketches) - (len(COLOURS) - 1)
    figure.suptitle(
        "bars two standard errors"
        + (f"; {left} channels more are not drawn" if left > 0 else "")
        + ("; dotted: static footprint" if any(s.static_length_m for s in sketches) else ""),
        fontsize=12,
    )
    return figure


def orders(sketches: Sequence[TurnsSketch]) -> Figure:
    """The order map of each channel, at one scale of colours."""
    figure, panels = _panels(sketches)
    order_maps(
        figure,
        [(axes, s.name, map_of(s.strain, s.speed_m_s, s.time_s, s.radius_m)) for axes, s in panels],
    )
    return figure


KINDS: Mapping[str, Callable[[Sequence[TurnsSketch]], Any]] = {
    "waterfall": waterfall,
    "polar": polar,
    "edges": edges,
    "lengths": lengths,
    "orders": orders,
}
