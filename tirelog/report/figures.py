"""Figures as plain data: traces and layout of the plotting library, drawn by the page's script or as PNG.

Arrays travel as base64 of float32: a trace of n points costs about 5 n bytes a coordinate.  Long series are decimated by min-max
buckets first, which keeps every peak.
"""

from __future__ import annotations

import base64
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tirelog.recording import Channel, FloatArray

#: Okabe-Ito: told apart by all forms of colour blindness
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#999999")
BUCKETS = 2000
SCATTER_POINTS = 6000


@dataclass(frozen=True)
class Figure:
    """A figure: `alt` is what a person who cannot see it would be told."""

    id: str
    title: str
    alt: str
    traces: list[dict[str, Any]]
    layout: dict[str, Any] = field(default_factory=dict)


def packed(values: Any) -> dict[str, str]:
    """Numbers as the plotting library's typed array (float32)."""
    array = np.ascontiguousarray(np.asarray(values, dtype=np.float32))
    out = {"dtype": "f4", "bdata": base64.b64encode(array.tobytes()).decode()}
    if array.ndim == 2:
        out["shape"] = f"{array.shape[0]}, {array.shape[1]}"
    return out


def axis(title: str, **more: Any) -> dict[str, Any]:
    """An axis whose title carries its unit."""
    return {"title": {"text": title}, "automargin": True, **more}


def layout(x: str, y: str, **more: Any) -> dict[str, Any]:
    """A plain layout with axis titles."""
    return {"xaxis": axis(x), "yaxis": axis(y), **more}


def line(x: Any, y: Any, name: str, colour: int = 0, **more: Any) -> dict[str, Any]:
    """A line."""
    style = {"color": COLOURS[colour % len(COLOURS)], "width": 1.5, **more.pop("line", {})}
    return {"type": "scatter", "mode": "lines", "x": packed(x), "y": packed(y), "name": name, "line": style, **more}


def dots(x: Any, y: Any, name: str, colour: int = 0, **more: Any) -> dict[str, Any]:
    """Points; evenly thinned where there are more than a page can carry."""
    step = max(1, -(-np.size(x) // SCATTER_POINTS))
    marker = {"color": COLOURS[colour % len(COLOURS)], "size": 5, "opacity": 0.7, "symbol": ["circle", "square", "diamond"][colour % 3]}
    return {
        "type": "scatter",
        "mode": "markers",
        "x": packed(np.asarray(x)[::step]),
        "y": packed(np.asarray(y)[::step]),
        "name": name,
        "marker": marker,
        **more,
    }


def band(x: Any, low: Any, high: Any, name: str, colour: int = 0) -> list[dict[str, Any]]:
    """A shaded band between two lines."""
    edge = {"width": 0}
    shade = COLOURS[colour % len(COLOURS)] + "40"
    return [
        line(x, low, name, colour, line=edge, showlegend=False, hoverinfo="skip"),
        line(x, high, name, colour, line=edge, fill="tonexty", fillcolor=shade, hoverinfo="skip"),
    ]


def heat(x: Any, y: Any, z: Any, unit: str) -> dict[str, Any]:
    """A signed map: blue below zero, red above, the same reach on both sides."""
    reach = float(np.nanmax(np.abs(z))) if np.isfinite(z).any() else 1.0
    bar = {"title": {"text": unit}}
    return {
        "type": "heatmap",
        "x": packed(x),
        "y": packed(y),
        "z": packed(z),
        "zmin": -reach,
        "zmax": reach,
        "colorscale": "RdBu",
        "reversescale": True,
        "colorbar": bar,
    }


def decimated(channel: Channel, buckets: int = BUCKETS) -> tuple[FloatArray, FloatArray]:
    """(times [s], values) of a channel, its smallest and largest sample of every bucket in their order: no peak vanishes.

    Reads block by block; shapes (<= 2 buckets + 2,).
    """
    size = max(1, -(-channel.size // buckets))
    at: list[FloatArray] = []
    values: list[FloatArray] = []
    for start, block in channel.blocks(size * max(1, (1 << 20) // size)):
        rows = -(-block.size // size)
        padded = np.full(rows * size, np.nan)
        padded[: block.size] = block
        table = padded.reshape(rows, size)
        known = np.isfinite(table).any(axis=1)
        low = np.argmin(np.where(np.isnan(table), np.inf, table), axis=1)
        high = np.argmax(np.where(np.isnan(table), -np.inf, table), axis=1)
        pair = np.sort(np.stack([low, high], axis=1), axis=1)[known] + (np.flatnonzero(known) * size)[:, None]
        at.append((start + pair).ravel().astype(float))
        values.append(padded[pair.ravel()])
    index = np.concatenate(at) if at else np.zeros(0)
    return channel.axis.at(index) if index.size else index, np.concatenate(values) if values else index
