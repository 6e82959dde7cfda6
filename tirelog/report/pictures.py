"""The page's figures as PNG files for slides.

The same traces and layouts, drawn by matplotlib (extra `plot`).

Figure --unpacked arrays--> matplotlib axes --> FOLDER/ID.png, each whole or not at all
"""

from __future__ import annotations

import html
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.errors import UsageError
from tirelog.plots.style import figure_page
from tirelog.report.figures import DIVERGING, Figure, unpacked_array
from tirelog.storage.whole import output_error, whole_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DASHES = {"dash": "--", "dot": ":", "solid": "-", "dashdot": "-."}
_SYMBOLS = {"circle": "o", "square": "s", "diamond": "D", "line-ew-open": "_"}
#: dots per inch of a picture
_DPI = 150
#: letters of a title in one line
_TITLE = 90


def write_pictures(figures: Sequence[Figure], folder: Path) -> list[Path]:
    """Every figure as FOLDER/ID.png; the folder is made.

    OutputError: the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise output_error(folder, problem) from problem
    written = []
    for figure in figures:
        path = folder / f"{figure.id}.png"
        canvas = _drawn(figure)
        with whole_file(path) as part:
            canvas.savefig(part, format="png", dpi=_DPI)
        written.append(path)
    return written


def need_matplotlib() -> None:
    """UsageError if matplotlib is missing; asked before the work."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise UsageError(
            "--format png needs matplotlib",
            do="it comes with the extra: pip install 'tirelog[plot]'",
        ) from None


def _drawn(figure: Figure) -> Any:
    canvas = figure_page(8.0, 4.5 * max(1.0, figure.layout.get("height", 380) / 420))
    axes = canvas.subplots()
    if "categoryarray" in figure.layout.get("yaxis", {}):
        axes.yaxis.update_units(
            [html.unescape(word) for word in figure.layout["yaxis"]["categoryarray"]]
        )
    for trace in figure.traces:
        _trace(canvas, axes, {key: unpacked_array(value) for key, value in trace.items()})
    for shape in figure.layout.get("shapes", ()):
        axes.axvline(shape["x0"], color=shape["line"]["color"], lw=0.8, ls="--")
    for key, set_label, set_limits in (
        ("xaxis", axes.set_xlabel, axes.set_xlim),
        ("yaxis", axes.set_ylabel, axes.set_ylim),
    ):
        described = figure.layout.get(key, {})
        set_label(html.unescape(described.get("title", {}).get("text", "")))
        if described.get("type") == "log":
            getattr(axes, f"set_{key[0]}scale")("log")
        if "range" in described:
            set_limits(*described["range"])
    axes.set_title(
        "\n".join(textwrap.wrap(figure.title, _TITLE)), loc="left", fontsize=10, parse_math=False
    )
    axes.grid(alpha=0.25, lw=0.5)
    handles, labels = axes.get_legend_handles_labels()
    if labels:
        legend = axes.legend(handles, labels, fontsize=7)
        for text in legend.get_texts():
            text.set_parse_math(False)
    return canvas


def _trace(canvas: Any, axes: Axes, trace: dict[str, Any]) -> None:
    name = html.unescape(trace.get("name", "")) if trace.get("showlegend", True) else "_"
    if trace["type"] == "heatmap":
        _heat(canvas, axes, trace)
    elif trace["type"] == "bar":
        _bars(axes, trace, name)
    elif trace.get("fill") == "tonexty":
        before = axes.lines[-1]
        before.set_visible(False)
        low = np.asarray(before.get_ydata(), float)
        axes.fill_between(trace["x"], low, trace["y"], color=trace["fillcolor"], lw=0, label=name)
    elif trace["mode"] == "markers":
        marker = trace["marker"]
        style = _SYMBOLS.get(marker.get("symbol", "circle"), "o")
        axes.plot(
            trace["x"],
            trace["y"],
            style,
            ms=marker["size"] * 0.6,
            color=marker["color"],
            alpha=marker.get("opacity", 1.0),
            mew=0.0 if style != "_" else 2.0,
            label=name,
        )
    else:
        drawn = trace["line"]
        axes.plot(
            trace["x"],
            trace["y"],
            _DASHES[drawn.get("dash", "solid")],
            lw=drawn["width"],
            color=drawn["color"],
            label=name,
        )


def _bars(axes: Axes, trace: dict[str, Any], name: str) -> None:
    across = trace["orientation"] == "h"
    words, values = (trace["y"], trace["x"]) if across else (trace["x"], trace["y"])
    error = unpacked_array(trace["error_x"]["array"]) if "error_x" in trace else None
    draw, of = (axes.barh, "xerr") if across else (axes.bar, "yerr")
    more = {of: error, "color": trace["marker"]["color"], "label": name}
    draw([html.unescape(word) for word in words], values, trace["width"], **more)


def _heat(canvas: Any, axes: Axes, trace: dict[str, Any]) -> None:
    from matplotlib.colors import LinearSegmentedColormap

    colours = LinearSegmentedColormap.from_list("signed", list(DIVERGING))
    shading: Any = "nearest" if min(np.shape(trace["z"])) > 1 else "auto"
    rows = np.asarray(trace["y"], float)
    if len(rows) == 1:
        rows, shading = np.array([rows[0] - 0.5, rows[0] + 0.5]), "flat"
        steps = np.asarray(trace["x"], float)
        half = 0.5 * float(np.median(np.diff(steps)))
        columns = np.append(steps - half, steps[-1] + half)
    else:
        columns = np.asarray(trace["x"], float)
    mesh = axes.pcolormesh(
        columns,
        rows,
        trace["z"],
        cmap=colours,
        vmin=trace["zmin"],
        vmax=trace["zmax"],
        shading=shading,
    )
    canvas.colorbar(mesh, ax=axes, label=trace["colorbar"]["title"]["text"])
