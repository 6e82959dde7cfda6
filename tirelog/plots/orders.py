"""The order map: how much of each order of the wheel a grating feels, over speed or over time.

    revolutions (n, m) --transform over the angle--> amplitude of each order (n, k)
        --like speeds (or times) together--> a map whose height is the frequency, order x wheel's

At constant speed all that repeats stands on orders; where an order crosses a natural frequency of
the tire it grows. With a ring model its modes are drawn as the belt feels them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.data.recording import Recording
from tirelog.inference.stacks.cut import stacks_from_logs
from tirelog.physics.model.model import Model
from tirelog.physics.moving.modes import Mode, natural_modes, of_model
from tirelog.plots.style import MICRO, SLIDE, figure_page, label, on_a_slide, write
from tirelog.vocabulary.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

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

    Empty bins are filled from their neighbours, and so few orders are given that every one has two
    samples per cycle even in the sparsest revolution.
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


def map_of(
    values: FloatArray, speed_m_s: FloatArray, time_s: FloatArray, radius_m: float
) -> OrderMap:
    """The order map of revolutions, over speed, or over time if they are of one speed."""
    several = np.ptp(speed_m_s) > _ONE_SPEED * np.median(speed_m_s)
    axis = speed_m_s if several else time_s
    # a moment of its own for each revolution; of like speeds some together
    steps = int(min(_STEPS, max(axis.size // 2, 1) if several else axis.size))
    edges = np.linspace(axis.min(), axis.max() + 1e-9, steps + 1)
    row = np.clip(np.searchsorted(edges, axis, side="right") - 1, 0, steps - 1)
    squares = amplitudes(values) ** 2
    mean = np.full((steps, squares.shape[1]), np.nan)
    for step in np.unique(row):
        mean[step] = squares[row == step].mean(axis=0)
    if several:
        speeds = edges
    else:
        order = np.argsort(time_s)
        speeds = np.interp(edges, time_s[order], speed_m_s[order])
    return OrderMap(
        "speed" if several else "time", edges, speeds / (2.0 * np.pi * radius_m), np.sqrt(mean)
    )


def order_maps(
    figure: Figure,
    maps: Sequence[tuple[Axes, str, OrderMap]],
    orders: Sequence[int] = (1, 5, 10, 20, 40),
) -> None:
    """Draw maps, each with its name on its axes of `figure`, at one scale of colours.

    `orders` are named at the edge.
    """
    from matplotlib.colors import LogNorm

    every = np.concatenate([found.amplitude.ravel() for _, _, found in maps])
    known = MICRO * every[np.isfinite(every) & (every > 0.0)]
    low, high = (
        (float(np.percentile(known, _DARKEST)), float(known.max())) if known.size else (0.1, 1.0)
    )
    mesh: Any = None
    for axes, name, found in maps:
        bounds = np.arange(found.amplitude.shape[1] + 1) + 0.5
        mesh = axes.pcolormesh(
            np.broadcast_to(found.edges[:, None], (found.edges.size, bounds.size)),
            found.wheel_Hz[:, None] * bounds,
            MICRO * found.amplitude,
            norm=LogNorm(low, max(high, 1.01 * low)),
            cmap="viridis",
            rasterized=True,
        )
        top = min(HIGHEST_HZ, float(found.wheel_Hz.max() * bounds[-1]))
        label(
            axes,
            "speed [m/s]" if found.along == "speed" else "time [s]",
            "frequency on the belt [Hz]",
            xlim=(found.edges[0], found.edges[-1]),
            ylim=(0.0, top),
        )
        axes.set_title(name)
        axes.grid(False)
        for order in orders:
            height = order * found.wheel_Hz[-1]
            if order < bounds[-1] and height < 0.97 * top:
                place = (found.edges[-1], height)
                axes.annotate(f" order {order}", place, fontsize=9, va="center")
    figure.colorbar(mesh, ax=figure.axes, label="amplitude of an order [microstrain]", format="%g")


def on_the_belt(mode: Mode, wheel_Hz: float) -> float:
    """The frequency [Hz] at which a point of the turning belt feels a mode.

    A wave of n lobes that goes with the rotation passes the belt's points n turns a turn more
    slowly, one against it so much faster; what stands beside the tire is given as it is heard.
    """
    turned = {"with": -1.0, "against": 1.0}.get(mode.direction, 0.0) * mode.lobes * wheel_Hz
    return abs(mode.frequency_Hz + turned)


def modes_over(
    axes: Axes, model: Model, found: OrderMap | None, *, highest_Hz: float, **more: Any
) -> None:
    """The modes of a ring model in the air as lines over speed on `axes`, as the belt feels them.

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
        # where the tire stands, what goes with the rotation and against it is one: just turning
        turning = max(float(speed), 1e-3)
        for mode in natural_modes(tire, speed_m_s=turning, to_Hz=2.0 * highest_Hz):
            if mode.damping_ratio < _MOST_DAMPED:
                line = lines.setdefault((mode.shape, mode.direction), np.full(len(speeds), np.nan))
                line[number] = on_the_belt(mode, wheel_Hz)
    below = -np.inf
    around = [Stroke(linewidth=3.4, foreground="white"), Stroke(linewidth=1.6, foreground="black")]
    for (shape, direction), line in sorted(lines.items(), key=lambda item: item[1][-1]):
        style = {"with": "-", "against": "--"}.get(direction, ":")
        axes.plot(places, line, style, color="black", lw=1.6, path_effects=around)
        height = float(line[-1])
        if not height <= highest_Hz or height - below < _APART * highest_Hz:
            continue  # names would lie on each other
        below = height
        axes.annotate(
            f" {shape}", (places[-1], height), xytext=(4, 0), textcoords="offset points",
            fontsize=9, va="center", annotation_clip=False,
        )  # fmt: skip
    handles = [
        axes.plot([], [], style, color="black", lw=1.6, label=f"{word} the rotation")[0]
        for style, word in (("-", "wave with"), ("--", "wave against"))
    ]
    axes.legend(handles=handles, loc="upper left", title="modes in the air", title_fontsize=10)


def modes_over_orders(
    model: Model,
    maps: Sequence[tuple[str, OrderMap]],
    path: Path,
    *,
    highest_Hz: float = HIGHEST_HZ,
    **more: Any,
) -> None:
    """Write the modes over the order maps of logs, by name, to `path`; over speed without one."""
    with on_a_slide():
        shown = list(maps[:_MOST])
        figure = figure_page(SLIDE[0] if len(shown) > 1 else 0.8 * SLIDE[0], SLIDE[1])
        panels = figure.subplots(1, max(len(shown), 1), squeeze=False)[0]
        if shown:
            named = [(axes, Path(log).name, found) for axes, (log, found) in zip(panels, shown)]
            order_maps(figure, named, orders=())
        below = [found for _, found in shown]
        for axes, found in zip(panels, below or (None,), strict=True):
            modes_over(axes, model, found, highest_Hz=highest_Hz, **more)
            if found is None:
                label(axes, "speed [m/s]", "frequency on the belt [Hz]", ylim=(0.0, highest_Hz))
            axes.set_ylim(0.0, highest_Hz)
            axes.margins(x=0.0)
        write(figure, path)


def map_of_log(recording: Recording, channel: str | None = None) -> OrderMap:
    """The order map of a log's strain, of its first grating or the one that is named.

    UsageError: no such channel, or too few revolutions.
    """
    parts = list(stacks_from_logs([recording], "strain", channel))
    return map_of(
        np.concatenate([part.values for part in parts]),
        np.concatenate([part.conditions.speed_m_s for part in parts]),
        np.concatenate([part.conditions.time_s for part in parts]),
        parts[0].radius_m,
    )
