"""Figures as plain data.

Traces and layout of the plotting library, drawn by the page's script.

Arrays travel as base64 of float32: a trace of n points costs about 5 n bytes a coordinate. Long
series are decimated by min-max buckets first, which keeps every peak. Names go through `safe`: the
plotting library reads a few HTML elements in its texts, links among them.
"""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

import numpy as np

from tirelog.plots.record import Mark, Panel
from tirelog.vocabulary.arrays import FloatArray

#: told apart by all forms of colour blindness (Okabe and Ito's first three), each with three times
#: the luminance contrast to white that a graphic needs
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#C4569A", "#4B3FA0", "#8A6D00", "#6b6b6b")
#: the same ones, in order, on dark paper
DARK_COLOURS = ("#56B4E9", "#FF9E4A", "#35C99A", "#E8A0CC", "#A99CF0", "#E6C34A", "#B4BAC0")
#: what is no log's: models and effects, and what stands aside of them; on dark paper
INK, GREY, PALE = "#26323d", "#5f6b76", "#7f8992"
DARK_NEUTRALS = ("#e8edf2", "#b9c2ca", "#8d97a0")
EDGE = "#8d8d8d"
#: blue below zero, red above, light between
DIVERGING = (
    (0.0, "#2166ac"),
    (0.25, "#92c5de"),
    (0.5, "#f7f7f7"),
    (0.75, "#f4a582"),
    (1.0, "#b2182b"),
)
SCATTER_POINTS = 6000
SYMBOLS = ("circle", "square", "diamond")
DASHES = ("solid", "dash", "dot", "dashdot")
#: a map's colours end at this percentile of the sizes, so that one odd cell does not bleach the
#: rest
_COLOUR_PERCENTILE = 99.5


@dataclass(frozen=True)
class Figure:
    """A figure: `alt` is what a person who cannot see it would be told.

    half   it may stand beside the next one on a wide window
    """

    id: str
    title: str
    alt: str
    traces: list[dict[str, Any]]
    layout: dict[str, Any] = field(default_factory=dict)
    half: bool = False


def safe(name: str) -> str:
    """The user's text, escaped so that the plotting library shows it as it is."""
    return html.escape(str(name), quote=False)


def packed_array(values: Any) -> dict[str, str]:
    """Numbers as the plotting library's typed array (float32)."""
    array = np.ascontiguousarray(np.asarray(values, dtype=np.float32))
    out = {"dtype": "f4", "bdata": base64.b64encode(array.tobytes()).decode()}
    if array.ndim == 2:
        out["shape"] = f"{array.shape[0]}, {array.shape[1]}"
    return out


def axis(title: str, **more: Any) -> dict[str, Any]:
    """An axis whose title carries its unit."""
    return {"title": {"text": title}, "automargin": True, "exponentformat": "power", **more}


def layout(x: str, y: str, **more: Any) -> dict[str, Any]:
    """A plain layout with axis titles.

    `xrange`, `yrange`: what is shown at first; `lines`: abscissae of dashed vertical lines.
    """
    axes = {"xaxis": axis(x), "yaxis": axis(y)}
    for name, key in (("xrange", "xaxis"), ("yrange", "yaxis")):
        if more.get(name) is not None and np.isfinite(more[name]).all():
            axes[key]["range"] = [float(v) for v in more[name]]
        more.pop(name, None)
    lines = more.pop("lines", ())
    if len(lines):
        style = {"color": EDGE, "width": 1, "dash": "dash"}
        more["shapes"] = [
            {
                "type": "line",
                "yref": "paper",
                "y0": 0,
                "y1": 1,
                "x0": float(v),
                "x1": float(v),
                "line": style,
            }
            for v in lines
        ]
    return {**axes, **more}


class LogColours:
    """Of each log the number of its colour, by its file name; the same in every figure."""

    def __init__(self, logs: Iterable[str] = ()) -> None:
        self._numbers: dict[str, int] = {}
        for log in logs:
            self(log)

    def __call__(self, log: str) -> int:
        return self._numbers.setdefault(PurePath(log).name, len(self._numbers))

    def __len__(self) -> int:
        return len(self._numbers)


def _colour(colour: int | str) -> str:
    """A colour by its number, or itself."""
    return colour if isinstance(colour, str) else COLOURS[colour % len(COLOURS)]


def line(x: Any, y: Any, name: str, colour: int | str = 0, **more: Any) -> dict[str, Any]:
    """A trace that joins the points (x, y) by a line, `colour` one of its own or its number."""
    style = {"color": _colour(colour), "width": 1.5, **more.pop("line", {})}
    return {
        "type": "scatter",
        "mode": "lines",
        "x": packed_array(x),
        "y": packed_array(y),
        "name": safe(name),
        "line": style,
        **more,
    }


def dots(x: Any, y: Any, name: str, colour: int | str = 0, **more: Any) -> dict[str, Any]:
    """Points; evenly thinned if there are more than a page can carry (`thinned` says so)."""
    step = thinning(np.size(x))
    marker = {
        "color": _colour(colour),
        "size": 5,
        "opacity": 0.7,
        "symbol": SYMBOLS[colour % 3] if isinstance(colour, int) else SYMBOLS[0],
    }
    return {
        "type": "scatter",
        "mode": "markers",
        "x": packed_array(np.asarray(x)[::step]),
        "y": packed_array(np.asarray(y)[::step]),
        "name": safe(name),
        "marker": {**marker, **more.pop("marker", {})},
        **more,
    }


def thinning(points: int) -> int:
    """Every how many-th of so many points `dots` draws."""
    return max(1, -(-points // SCATTER_POINTS))


def band(x: Any, low: Any, high: Any, name: str, colour: int | str = 0) -> list[dict[str, Any]]:
    """A shaded band between two lines."""
    edge = {"width": 0}
    shade = _colour(colour) + "40"
    return [
        line(x, low, name, colour, line=edge, showlegend=False, hoverinfo="skip"),
        line(
            x,
            high,
            name,
            colour,
            line=edge,
            fill="tonexty",
            fillcolor=shade,
            hoverinfo="skip",
            showlegend=False,
        ),
    ]


def bars(
    labels: Sequence[str],
    values: Any,
    name: str,
    colour: int | str = 0,
    *,
    across: bool = False,
    **more: Any,
) -> dict[str, Any]:
    """Bars over words; `across`: lying, so that long words stay readable.

    `error`: standard errors, NaN if there is none.
    """
    words = [safe(label) for label in labels]
    x, y = (packed_array(values), words) if across else (words, packed_array(values))
    marker = {"color": _colour(colour)}
    if "error" in more:
        key = "error_x" if across else "error_y"
        more[key] = {
            "type": "data",
            "array": packed_array(more.pop("error")),
            "visible": True,
            "color": "#6b6b6b",
            "thickness": 1.5,
        }
    return {
        "type": "bar",
        "width": 0.6,
        "x": x,
        "y": y,
        "name": safe(name),
        "marker": marker,
        "orientation": "h" if across else "v",
        **more,
    }


#: symbols of marks that have no name of their own here
_MARKERS: dict[str, dict[str, Any]] = {
    ".": {},
    "D": {"symbol": "diamond"},
    "_": {"symbol": "line-ew-open", "size": 14, "line": {"width": 3}},
}


def figure(id: str, title: str, alt: str, panel: Panel, half: bool = False, **shape: Any) -> Figure:
    """The figure of a panel; `shape`: what its layout has besides."""
    x, y = panel.limits
    lines = [mark.x for mark in panel.marks if mark.kind == "upright" and y is None]
    of = layout(panel.x, panel.y, xrange=x, yrange=y, lines=lines, **shape)
    for key, scale, names in zip(
        ("xaxis", "yaxis"), panel.scales, (panel.x_words, panel.y_words), strict=True
    ):
        if names:  # in their order, the first of lying ones on top
            down = {"autorange": "reversed"} if key == "yaxis" else {}
            of[key] = axis(of[key]["title"]["text"], type="category", categoryorder="array",
                           categoryarray=list(names), **down)  # fmt: skip
        elif scale == "log":
            of[key] |= {"type": "log"}
    return Figure(id, title, alt, [t for m in panel.marks for t in _traces(m, panel)], of, half)


def _traces(mark: Mark, panel: Panel) -> list[dict[str, Any]]:
    """A mark as the plotting library has it; none of words and of lines across the panel."""
    name, style = mark.name.removeprefix("_"), mark.style
    if mark.kind in ("words", "level", "span"):
        return []
    if mark.kind == "upright":  # one without a name is a shape of the layout
        of = {"dash": style.get("dash", "solid"), "width": 1.5}
        at, ends = [mark.x, mark.x], panel.limits[1]
        quiet = {"showlegend": bool(name), "hoverinfo": "skip"}
        made = line(at, ends or at, name, mark.colour, line=of, **quiet)
        return [] if ends is None else [made]
    x = [panel.x_words[i] for i in mark.x] if panel.x_words else mark.x
    marker = _MARKERS.get(style.get("symbol", "."), {"symbol": style.get("symbol")})
    if mark.kind == "band":
        shade = band(x, mark.y, mark.other, name, mark.colour)
        shade[1]["showlegend"] = not mark.name.startswith("_")
        return shade
    if mark.kind == "bars":
        across = bool(style.get("across"))
        labels = [panel.y_words[i] for i in mark.x] if across else x
        known = {} if mark.other is None else {"error": mark.other}
        return [bars(labels, mark.y, name, mark.colour, across=across, **known)]
    if mark.kind == "line":
        steps = {"steps-mid": "hvh", "steps-post": "hv"}.get(style.get("drawstyle", ""), "linear")
        drawn = {"dash": style.get("dash", "solid"), "shape": steps}
        made = line(mark.x, mark.y, name, mark.colour, line=drawn)
    else:
        made = dots(mark.x, mark.y, name, mark.colour, marker=marker)
    return [{**made, "x": x} if panel.x_words else made]


def colour_reach(z: FloatArray) -> float:
    """Where the colours of a map end."""
    known = np.abs(z[np.isfinite(z)])
    return float(np.percentile(known, _COLOUR_PERCENTILE)) if known.size else 1.0


def heat(x: Any, y: Any, z: Any, unit: str, reach: float | None = None) -> dict[str, Any]:
    """A signed map: blue below zero, red above, the same reach on both sides."""
    reach = colour_reach(z) if reach is None else reach
    return {
        "type": "heatmap",
        "x": packed_array(x),
        "y": packed_array(y),
        "z": packed_array(z),
        "zmin": -reach,
        "zmax": reach,
        "colorscale": [list(stop) for stop in DIVERGING],
        "colorbar": {"title": {"text": unit, "side": "right"}, "thickness": 12},
    }
