"""The picture of a fit: which parameters its data tell apart."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tirelog.plots.style import figure_page

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tirelog.diagnosis.fitted import FitOfLogs


def figure(fitted: FitOfLogs) -> Figure:
    """A matplotlib figure of the correlations."""
    size = 0.6 * len(fitted.found.names)
    canvas = figure_page(size + 5.5, size + 2.0)
    correlations(canvas.add_subplot(), fitted)
    return canvas


def correlations(axes: Axes, fitted: FitOfLogs) -> None:
    """The correlation of each pair of fitted parameters as colour and number, values beside."""
    found = fitted.found
    sd = np.sqrt(np.diag(found.covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        r = found.covariance / np.outer(sd, sd)
    axes.imshow(r, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
    for (i, j), value in np.ndenumerate(r):
        if np.isfinite(value):
            colour = "white" if abs(value) > 0.6 else "black"
            axes.text(j, i, f"{value:.2f}", ha="center", va="center", fontsize=7, color=colour)
    labels = []
    for name, value, se in zip(found.names, found.values, found.se, strict=True):
        error = f"± {se:.2g}" if np.isfinite(se) else "(not determined)"
        labels.append(f"{name} = {value:.4g} {error} {fitted.model.parameters[name].unit}")
    places = range(len(found.names))
    axes.set_yticks(places, labels, fontsize=8)
    axes.set_xticks(places, list(found.names), fontsize=8, rotation=60, ha="right")
    axes.set_title("correlation of the fitted parameters", loc="left", fontsize=10)
