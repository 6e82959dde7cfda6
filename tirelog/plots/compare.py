"""The picture of `compare`.

Waveforms with the floor's band, and the residual over angle x speed and angle x time, whitened too.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.vocabulary.observables import drawn

if TYPE_CHECKING:
    from tirelog.diagnosis.results import Comparison, Map

#: the map's colours end at this quantile of the residual, and are linear up to so many standard
#: errors, or to the noise floor
_QUANTILE = 99.9
_SIGMAS = 3.0


def figure(result: Comparison) -> Any:
    """A matplotlib figure of a comparison."""
    from matplotlib.figure import Figure

    from tirelog.diagnosis.results import in_unit

    factor, unit = drawn(result.observable, result.unit)
    canvas = Figure(figsize=(12.0, 9.5), layout="constrained")
    grid = canvas.add_gridspec(3, 2, height_ratios=(1.1, 1.0, 1.0))
    waveforms(canvas.add_subplot(grid[0, :]), result)
    for row, (kind, label) in enumerate(
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
                kind,
                factor if kind == "residual" else 1.0,
                result.noise_floor * factor if kind == "residual" else _SIGMAS,
                label,
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


def draw(result: Comparison, path: Path) -> list[Path]:
    """Write the figure; the suffix decides the format.

    Of several observables the first has this path, each other one a path of its own beside it;
    these come back.
    """
    from tirelog.storage.whole import whole_file

    lead, *others = result.parts or (result,)
    beside = [path.with_stem(f"{path.stem}_{other.observable}") for other in others]
    for one, target in zip((lead, *others), (path, *beside), strict=True):
        with whole_file(target) as part:
            figure(one).savefig(part, format=path.suffix.lstrip(".") or "png", dpi=110)
    return beside


def waveforms(axes: Any, result: Comparison) -> None:
    """Some like revolutions, measured and predicted, with the floor's band, on `axes`."""
    factor, unit = drawn(result.observable, result.unit)
    waves = result.waveforms
    for i, label in enumerate(waves.labels):
        phi = np.rad2deg(waves.phi_rad[i])
        band = waves.floor[i] * factor
        (line,) = axes.plot(phi, waves.predicted[i] * factor, lw=1.2, label=f"model, {label}")
        axes.fill_between(
            phi,
            waves.predicted[i] * factor - 2 * band,
            waves.predicted[i] * factor + 2 * band,
            color=line.get_color(),
            alpha=0.2,
            lw=0,
        )
        axes.plot(phi, waves.measured[i] * factor, ".", ms=2.5, color=line.get_color())
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
    axes.set(xlabel="angle [deg]", ylabel=name)


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


def edges(axes: Any, edge: float) -> None:
    """The patch's edges as lines on `axes`."""
    for side in (-edge, edge):
        axes.axvline(np.rad2deg(side), color="0.5", lw=0.7, ls="--")
