"""The pictures of `compare`.

page   waveforms with the floor's band, and the residual over angle x speed and angle x time,
       whitened too
polar  measured and predicted around the wheel, and the model's contact pressure in the patch
edges  entry and exit edge close up with the floor's band, and what is left there
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.diagnosis.answer import in_unit
from tirelog.errors import UsageError, refuse_unknown
from tirelog.plots.style import EDGE, SLIDE, by_value, figure_page, label, on_a_slide
from tirelog.plots.wheel import around_the_wheel
from tirelog.vocabulary.observables import WAVEFORMS, drawn
from tirelog.vocabulary.pictures import COMPARE

if TYPE_CHECKING:
    from tirelog.diagnosis.results import Comparison, Map

#: the map's colours end at this quantile of the residual, and are linear up to so many standard
#: errors, or to the noise floor
_QUANTILE = 99.9
_SIGMAS = 3.0
#: half of a close-up of an edge, in half angles of the patch; and the edge, if none is known
_CLOSE, _NO_EDGE_DEG = 0.6, 10.0


def figure(result: Comparison, kind: str = "page") -> Any:
    """A matplotlib figure of a comparison, of a kind of `pictures.COMPARE`.

    UsageError: not of a number per revolution, which has no waveform.
    """
    refuse_unknown(kind, COMPARE, f"no picture is called {kind!r}", do="choose one")
    if kind != "page":
        return _of_waveforms(result, kind)

    factor, unit = drawn(result.observable, result.unit)
    canvas = figure_page(12.0, 9.5)
    grid = canvas.add_gridspec(3, 2, height_ratios=(1.1, 1.0, 1.0))
    waveforms(canvas.add_subplot(grid[0, :]), result)
    for row, (left, text) in enumerate(
        (("residual", f"residual [{unit}]"), ("whitened", "residual [standard errors]")), start=1
    ):
        for column, (map_, name) in enumerate(
            ((result.by_speed, "speed [m/s]"), (result.by_time, "time [s]"))
        ):
            axes = canvas.add_subplot(grid[row, column])
            _map(
                canvas,
                axes,
                map_,
                left,
                factor if left == "residual" else 1.0,
                result.noise_floor * factor if left == "residual" else _SIGMAS,
                text,
                name,
                result.half_angle_rad,
            )
    canvas.suptitle(
        f"held-out error {in_unit(result.rmse_heldout, factor)} {unit}, noise floor "
        f"{result.noise_floor * factor:.3g}, "
        f"excess {in_unit(result.excess_heldout, factor)}; reduced chi-square "
        f"{result.reduced_chi2:.3g}"
    )
    return canvas


def draw(result: Comparison, path: Path, kind: str = "page") -> list[Path]:
    """Write the figure of a kind; the suffix decides the format.

    Of several observables the first has this path, each other one a path of its own beside it;
    these come back.
    """
    from tirelog.storage.whole import whole_file

    lead, *others = result.parts or (result,)
    beside = [path.with_stem(f"{path.stem}_{other.observable}") for other in others]
    for one, target in zip((lead, *others), (path, *beside), strict=True):
        with whole_file(target) as part:
            own = kind if one is lead or one.observable in WAVEFORMS else "page"
            figure(one, own).savefig(part, format=path.suffix.lstrip(".") or "png", dpi=110)
    return beside


def _of_waveforms(result: Comparison, kind: str) -> Any:
    """A slide of the waveforms.  UsageError: the model gives a number per revolution."""
    if result.observable not in WAVEFORMS:
        raise UsageError(
            f"--plot-kind {kind} of {result.observable}, a number per revolution",
            allowed="it is allowed for waveforms: strain and radial_acceleration",
            do="leave it out",
        )
    with on_a_slide():
        made = {"polar": _polar, "edges": _edge_zoom}[kind](result)
        made.draw_without_rendering()  # while letters are large
    return made


def _polar(result: Comparison) -> Any:
    """Measured and predicted around the wheel; the contact pressure that the model has there."""
    factor, unit = drawn(result.observable, result.unit)
    waves = result.waveforms
    colours = by_value(waves.conditions.speed_m_s)
    canvas = figure_page(*SLIDE)
    grid = canvas.add_gridspec(1, 2, width_ratios=(1.25, 1.0))
    wheel = canvas.add_subplot(grid[0], projection="polar")
    zero = around_the_wheel(
        wheel,
        [
            (phi, factor * predicted, 2.0 * factor * floor, name)
            for phi, predicted, floor, name in zip(
                waves.phi_rad, waves.predicted, waves.floor, waves.labels, strict=True
            )
        ],
        colours,
        result.half_angle_rad,
        unit,
    )
    for phi, measured, colour in zip(waves.phi_rad, waves.measured, colours, strict=True):
        wheel.plot(phi, zero + factor * measured, ".", ms=4, color=colour)
    wheel.set_title(f"{result.observable}: dots measured, lines predicted")
    wheel.legend(loc="center", fontsize=9)
    patch = canvas.add_subplot(grid[1])
    radius_mm = 1e3 * result.model.values["radius_m"]
    reach = 1.5 * max(result.half_angle_rad, 0.05)
    phi = np.linspace(-reach, reach, 301)
    pressure = result.model.predict(
        waves.conditions, phi, surface="outer", observable="contact_pressure"
    )
    for line, colour in zip(1e-3 * pressure, colours, strict=True):
        patch.plot(radius_mm * phi, line, color=colour)
    edges(patch, result.half_angle_rad, radius_mm * np.pi / 180.0)
    label(patch, "ξ from the patch centre [mm]", "contact pressure, as the model has it [N/mm]")
    return canvas


def _edge_zoom(result: Comparison) -> Any:
    """Each edge of the patch close up: waveforms with two noise floors, and what is left."""
    factor, unit = drawn(result.observable, result.unit)
    waves = result.waveforms
    colours = by_value(waves.conditions.speed_m_s)
    canvas = figure_page(*SLIDE)
    panels = canvas.subplots(2, 2, sharex="col", sharey="row", height_ratios=(1.3, 1.0))
    half = np.degrees(result.half_angle_rad) or _NO_EDGE_DEG
    for (above, below), side, name in zip(panels.T, (-1.0, 1.0), ("entry", "exit"), strict=True):
        heights = []
        for i, colour in enumerate(colours):
            phi = np.degrees(waves.phi_rad[i])
            near = np.abs(phi - side * half) <= _CLOSE * half
            predicted, measured = factor * waves.predicted[i], factor * waves.measured[i]
            band = 2.0 * factor * waves.floor[i]
            above.plot(phi[near], predicted[near], color=colour, label=waves.labels[i])
            above.fill_between(
                phi[near],
                (predicted - band)[near],
                (predicted + band)[near],
                color=colour,
                alpha=0.3,
                lw=0,
            )
            above.plot(phi[near], measured[near], ".", ms=6, color=colour)
            below.fill_between(phi[near], -band[near], band[near], color=colour, alpha=0.15, lw=0)
            below.plot(phi[near], (measured - predicted)[near], ".-", ms=5, lw=1.0, color=colour)
            heights.append(phi[near])
        for axes in (above, below):
            axes.axvline(side * half, color=EDGE, lw=1.5, ls="--")
        label(above, "", f"{result.observable} [{unit}]" if side < 0 else "")
        label(below, "angle [deg]", f"measured - predicted [{unit}]" if side < 0 else "")
        above.set_title(f"{name} edge", loc="left")
    panels[0, 0].legend(loc="best", fontsize=9)
    canvas.suptitle("dots measured, lines predicted, bands two noise floors of a mean", fontsize=12)
    return canvas


def waveforms(axes: Any, result: Comparison) -> None:
    """Means of like revolutions on `axes`: measured, predicted, and the floor's band."""
    factor, unit = drawn(result.observable, result.unit)
    waves = result.waveforms
    colours = by_value(waves.conditions.speed_m_s)
    for i, name in enumerate(waves.labels):
        phi = np.rad2deg(waves.phi_rad[i])
        band = waves.floor[i] * factor
        axes.plot(
            phi, waves.predicted[i] * factor, lw=1.2, color=colours[i], label=f"model, {name}"
        )
        axes.fill_between(
            phi,
            waves.predicted[i] * factor - 2 * band,
            waves.predicted[i] * factor + 2 * band,
            color=colours[i],
            alpha=0.2,
            lw=0,
        )
        axes.plot(phi, waves.measured[i] * factor, ".", ms=2.5, color=colours[i])
    edges(axes, result.half_angle_rad)
    axes.set(
        xlabel="angle from the patch centre [deg], entry to exit",
        ylabel=f"{result.observable} [{unit}]",
    )
    if result.half_angle_rad > 0:
        reach = np.rad2deg(6.0 * result.half_angle_rad)
        axes.set_xlim(-reach, reach)
    axes.set_title(
        "dots measured (means of like revolutions), lines predicted, band two noise floors",
        fontsize=9,
    )
    axes.legend(fontsize=7)


def _map(
    canvas: Any,
    axes: Any,
    map_: Map,
    kind: str,
    factor: float,
    small: float,
    label: str,
    name: str,
    edge: float,
) -> None:
    values = getattr(map_, kind) * factor
    known = np.abs(values[np.isfinite(values)])
    largest = float(np.percentile(known, _QUANTILE)) if known.size else 1.0
    mesh = coloured(axes, map_, values, small, max(largest, small))
    if mesh is None:
        axes.plot(
            np.rad2deg(map_.phi_rad) if map_.phi_rad.size > 1 else map_.axis, np.ravel(values), "."
        )
        axes.set(xlabel=name if map_.phi_rad.size == 1 else "angle [deg]", ylabel=label)
        return
    canvas.colorbar(mesh, ax=axes, label=label, format="%g")
    edges(axes, edge)
    for begin in map_.begins:
        axes.axhline(begin, color="black", lw=1.0)
    axes.set(
        xlabel="angle [deg]",
        ylabel=f"{name}, logs one after the other" if map_.begins else name,
    )


def coloured(axes: Any, map_: Map, values: Any, small: float, largest: float) -> Any:
    """A map's `values` (k, m) in colour on `axes`; None, and nothing drawn, if it has one row.

    Linear up to `small`, by orders of magnitude beyond, so that 1 and 40 are told on one scale.
    """
    from matplotlib.colors import SymLogNorm

    if map_.axis.size < 2 or map_.phi_rad.size < 2:
        return None
    largest = largest if largest > 0.0 else 1.0
    small = min(small, largest) if small > 0.0 else largest
    return axes.pcolormesh(
        np.rad2deg(map_.phi_rad),
        map_.axis,
        values,
        cmap="RdBu_r",
        norm=SymLogNorm(linthresh=small, vmin=-largest, vmax=largest, base=10),
        shading="nearest",
    )


def edges(axes: Any, edge: float, per_degree: float = 1.0) -> None:
    """The patch's edges [rad] as lines on `axes`, of degrees or of `per_degree` of something."""
    for side in (-edge, edge):
        axes.axvline(per_degree * np.rad2deg(side), color="0.5", lw=0.7, ls="--")
