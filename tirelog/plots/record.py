"""A picture as a record, and its drawing by matplotlib, whole or not at all.

    numbers --> Mark --> Panel --> Page --`picture`, `write`--> matplotlib (files, notebooks)
                             Panel --`report.page`--> plotly's JSON (the report's page)

A page holds panels of marks, which name what they show and its unit. Style words are of no library:
width, dash, size, symbol, opacity. What else a mark's style holds is matplotlib's own, but for
`marker` and `line`, which are of the report's page.

matplotlib is an extra (`pip install 'tirelog[plot]'`): it is imported here, when a picture was
needed; a message says if it is not there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.data.recording import Channel
from tirelog.storage.whole import whole_file
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.tables import no_matplotlib, refuse_no_picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: symbols of points, in the order in which they are taken
SYMBOLS = ("circle", "square", "diamond")


@dataclass(frozen=True)
class Mark:
    """A mark of a panel with its name in the legend; names "_..." are not shown.

    kind    line, dots, band (from y to `other`), bars (words in the panel's x_words or y_words),
            heat (`other` over x and y), upright and level (lines across the panel), span (from x to
            `other`), words (`name` at x, y)
    colour  as matplotlib writes it, or the number of a colour of the report
    """

    kind: str
    x: Any = ()
    y: Any = ()
    name: str = ""
    colour: Any = "#0072B2"
    other: Any = None
    style: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Panel:
    """Marks over two axes, whose titles carry their units.

    limits   of x and of y, what is shown at first
    scales   of x and of y: "linear" or "log"
    x_words, y_words   at 0, 1, ... of the axis
    legend   how matplotlib places it; None: none is drawn
    bare     no axes, and both to one scale
    """

    x: str = ""
    y: str = ""
    marks: Sequence[Mark] = ()
    title: str = ""
    limits: tuple[Any, Any] = (None, None)
    scales: tuple[str, str] = ("linear", "linear")
    x_words: Sequence[str] = ()
    y_words: Sequence[str] = ()
    legend: Mapping[str, Any] | None = field(default_factory=lambda: {"fontsize": 7})
    bare: bool = False


@dataclass(frozen=True)
class Page:
    """Panels by rows; a row of fewer panels spreads them over the width.  None: an empty place.

    size      inches
    share     axes that the panels of a column ("x") or of a row ("y") have in common
    bar       one bar of colours for all panels: its label; else each has its own
    """

    rows: Sequence[Sequence[Panel | None]] = ()
    size: tuple[float, float] = (12.0, 4.0)
    title: str = ""
    heights: Sequence[float] | None = None
    share: str = ""
    bar: str = ""
    bar_style: Mapping[str, Any] = field(default_factory=dict)


def line(x: Any, y: Any, name: str = "", colour: Any = "#0072B2", **style: Any) -> Mark:
    """A line through the points (x, y)."""
    return Mark("line", x, y, name, colour, style=style)


def dots(x: Any, y: Any, name: str = "", colour: Any = "#0072B2", **style: Any) -> Mark:
    """Points; `error`: the half length of a bar at each."""
    return Mark("dots", x, y, name, colour, style.pop("error", None), style)


def band(
    x: Any, low: Any, high: Any, name: str = "", colour: Any = "#0072B2", **style: Any
) -> Mark:
    """A shade between two lines."""
    return Mark("band", x, low, name, colour, high, style)


def bars(places: Any, values: Any, name: str = "", colour: Any = "#0072B2", **style: Any) -> Mark:
    """Bars at places; `error`: standard errors; `across`: horizontal bars for long words."""
    return Mark("bars", places, values, name, colour, style.pop("error", None), style)


def heat(x: Any, y: Any, values: Any, unit: str, scale: str, low: float, high: float) -> Mark:
    """Values (y, x) in colour: `scale` "linear", "log", or "signed" about zero.

    Signed colours are linear up to `low` and go by orders of magnitude from there to `high`.
    """
    return Mark("heat", x, y, unit, other=values, style={"scale": scale, "low": low, "high": high})


def upright(places: Any, name: str = "", colour: Any = "0.5", **style: Any) -> list[Mark]:
    """Lines from the bottom to the top; the first has the name."""
    return [
        Mark("upright", x, (), "" if i else name, colour, style=style) for i, x in enumerate(places)
    ]


def level(y: float, name: str = "", colour: Any = "black", **style: Any) -> Mark:
    """A line from the left to the right."""
    return Mark("level", (), y, name, colour, style=style)


def span(low: float, high: float, colour: Any, **style: Any) -> Mark:
    """A shade between two abscissae."""
    return Mark("span", low, (), "", colour, high, style)


def words(text: str, x: float, y: float, **style: Any) -> Mark:
    """Text at a place; `beside`: so many points to the right of it and above."""
    return Mark("words", x, y, text, style=style)


def rows_of(panels: Sequence[Panel], across: int) -> list[list[Panel | None]]:
    """Panels in rows of so many, the last one filled up."""
    filled = [*panels, *[None] * (-len(panels) % across)]
    return [filled[i : i + across] for i in range(0, len(filled), across)]


# ---- The same drawn by matplotlib.


#: colours that the colour-blind tell apart (Okabe and Ito)
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
RAW, EDGE, MARK = "#999999", "#D55E00", "#009E73"
MICRO = 1e6
#: pixels per inch in a notebook: a page of 13 inches is as wide as its column
NOTEBOOK_DPI = 72
#: stretches of a decimated signal, and samples that are decimated at once
BUCKETS = 2000
_BLOCK = 1 << 18


@cache
def _shown() -> type[Figure]:
    """A figure that a notebook shows without pyplot, which would keep every one of them."""
    from matplotlib.figure import Figure

    class Shown(Figure):
        """A figure with a form in PNG."""

        def _repr_png_(self) -> bytes:
            made = BytesIO()
            self.savefig(made, format="png", dpi=NOTEBOOK_DPI)
            return made.getvalue()

    return Shown


def figure_page(width: float, height: float) -> Figure:
    """An empty page, inches.  UsageError: matplotlib is not there."""
    try:
        kind = _shown()
    except ImportError:
        raise no_matplotlib() from None
    return kind(figsize=(width, height), layout="constrained")


def write(figure: Figure, path: Path) -> None:
    """The page as a file of its suffix's format, whole or not at all.

    UsageError: not a picture's suffix.
    """
    refuse_no_picture(path)
    with whole_file(path) as target:
        figure.savefig(target, format=path.suffix.lower()[1:], dpi=120)


#: our words of style in matplotlib's
_STYLE = {"width": "lw", "size": "ms", "opacity": "alpha", "dash": "ls", "symbol": "marker"}
_DASHES = {"solid": "-", "dash": "--", "dot": ":", "dashdot": "-."}
_SYMBOLS = {"circle": ".", "square": "^", "diamond": "v"}
#: style that is of the page's library alone
_OF_THE_PAGE = ("marker", "line")
#: of a kind of mark matplotlib's method, what of the mark it takes, and how it looks at least
_DRAWN: dict[str, tuple[str, str, dict[str, Any]]] = {
    "line": ("plot", "x y", {}),
    "dots": ("plot", "x y", {"marker": ".", "ls": "none"}),
    "dots with errors": ("errorbar", "x y other", {"marker": ".", "ls": "none"}),
    "band": ("fill_between", "x y other", {"lw": 0}),
    "upright": ("axvline", "x", {"lw": 0.7}),
    "level": ("axhline", "y", {"lw": 1.0}),
    "span": ("axvspan", "x other", {"lw": 0}),
}

#: more letters than that below an axis would lie on each other
_LETTERS = 90


def picture(page: Page) -> Figure:
    """The page drawn."""
    figure = figure_page(*page.size)
    if page.title:
        figure.suptitle(page.title, fontsize=12)
    across = int(np.lcm.reduce([max(len(row), 1) for row in page.rows]))
    grid = figure.add_gridspec(len(page.rows), across, height_ratios=page.heights)
    meshes, firsts = list[Any](), dict[int, "Axes"]()
    for i, row in enumerate(page.rows):
        wide = across // max(len(row), 1)
        first: Axes | None = None
        for j, panel in enumerate(row):
            if panel is None:
                continue
            axes = figure.add_subplot(
                grid[i, j * wide : (j + 1) * wide],
                sharex=firsts.get(j) if "x" in page.share else None,
                sharey=first if "y" in page.share else None,
            )
            first = first or axes
            firsts.setdefault(j, axes)
            mesh = draw_panel(axes, panel)
            meshes += [] if mesh is None else [mesh]
            if mesh is not None and not page.bar:
                figure.colorbar(mesh, ax=axes, label=panel.marks[0].name, format="%g")
            if "x" in page.share and i + 1 < len(page.rows) and page.rows[i + 1][j] is not None:
                axes.tick_params(labelbottom=False)
                axes.set_xlabel("")
            if "y" in page.share and j > 0:
                axes.tick_params(labelleft=False)
    if page.bar and meshes:
        shown = [mesh.axes for mesh in meshes]
        figure.colorbar(meshes[-1], ax=shown, label=page.bar, **page.bar_style)
    return figure


def draw_panel(axes: Any, panel: Panel) -> Any:
    """The panel on matplotlib's axes; the colours of its map come back, None if it has none."""
    mesh = None
    axes.grid(alpha=0.25, linewidth=0.6)
    for mark in panel.marks:
        mesh = _draw_mark(axes, mark) or mesh
    axes.set(xlabel=panel.x, ylabel=panel.y)
    if panel.scales != ("linear", "linear"):
        axes.set(xscale=panel.scales[0], yscale=panel.scales[1])
    for limits, limit in zip(panel.limits, (axes.set_xlim, axes.set_ylim), strict=True):
        if limits is not None:
            limit(limits)
    for names, ticks in ((panel.x_words, axes.set_xticks), (panel.y_words, axes.set_yticks)):
        if names:
            long = ticks == axes.set_xticks and sum(map(len, names)) > _LETTERS
            ticks(range(len(names)), names, **({"rotation": 60, "ha": "right"} if long else {}))
    if panel.bare:
        axes.set_axis_off()
        axes.set_aspect("equal")
    if panel.title:
        axes.set_title(panel.title, loc="center" if panel.bare else "left", fontsize="medium")
    if panel.legend is not None and axes.get_legend_handles_labels()[1]:
        axes.legend(**panel.legend)
    return mesh


def _draw_mark(axes: Any, mark: Mark) -> Any:
    """The mark on matplotlib's axes; the colours of a map come back."""
    style: dict[str, Any] = {
        _STYLE.get(name, name): value
        for name, value in mark.style.items()
        if name not in _OF_THE_PAGE
    }
    style |= {"ls": _DASHES[style["ls"]]} if style.get("ls") in _DASHES else {}
    style |= {"marker": _SYMBOLS[style["marker"]]} if style.get("marker") in _SYMBOLS else {}
    of = COLOURS[mark.colour % len(COLOURS)] if isinstance(mark.colour, int) else mark.colour
    own = {"color": of, "label": mark.name or None}
    if mark.kind == "heat":
        return _draw_heat(axes, mark)
    if mark.kind == "words":
        beside = {"xytext": style.pop("beside", None), "textcoords": "offset points"}
        shift = beside if beside["xytext"] is not None else {}
        axes.annotate(mark.name, (mark.x, mark.y), **{"fontsize": 8, **shift, **style})
    elif mark.kind == "bars":
        across = style.pop("across", False)
        error = {} if mark.other is None else {"xerr" if across else "yerr": mark.other}
        (axes.barh if across else axes.bar)(mark.x, mark.y, 0.6, **own, **error, **style)
    else:
        with_errors = mark.kind == "dots" and mark.other is not None
        method, names, look = _DRAWN["dots with errors" if with_errors else mark.kind]
        values = (getattr(mark, name) for name in names.split())
        getattr(axes, method)(*values, **own, **{**look, **style})
    return None


def _draw_heat(axes: Any, mark: Mark) -> Any:
    """A map's colours; signed ones are linear up to a number, see `record.heat`."""
    from matplotlib.colors import LogNorm, Normalize, SymLogNorm

    low, high = mark.style["low"], mark.style["high"]
    signed = mark.style["scale"] == "signed"
    if signed:
        high = high if high > 0.0 else 1.0
        small = min(low, high) if low > 0.0 else high
        norm: Any = SymLogNorm(linthresh=small, vmin=-high, vmax=high, base=10)
    else:
        norm = (LogNorm if mark.style["scale"] == "log" else Normalize)(low, high)
    axes.grid(False)
    return axes.pcolormesh(
        mark.x,
        mark.y,
        mark.other,
        norm=norm,
        cmap="RdBu_r" if signed else "viridis",
        shading="auto",
        rasterized=not signed,
    )


def decimated(
    channel: Channel, buckets: int = BUCKETS, first: int = 0, end: int | None = None
) -> tuple[FloatArray, FloatArray]:
    """(times [s], values) of the samples [first, end) of a channel, so that no peak vanishes.

    The smallest and the largest sample of every bucket stay, in their order. Reads block by block;
    shapes (<= 2 buckets + 2,).
    """
    end = channel.size if end is None else end
    size = max(1, -(-(end - first) // buckets))
    at, values = list[FloatArray](), list[FloatArray]()
    step = size * max(1, _BLOCK // size)
    for start in range(first, end, step):
        block = channel.read(start, min(start + step, end))
        rows = -(-block.size // size)
        padded = np.full(rows * size, np.nan)
        padded[: block.size] = block
        table = padded.reshape(rows, size)
        known = np.isfinite(table).any(axis=1)
        low = np.argmin(np.where(np.isnan(table), np.inf, table), axis=1)
        high = np.argmax(np.where(np.isnan(table), -np.inf, table), axis=1)
        pair = (
            np.sort(np.stack([low, high], axis=1), axis=1)[known]
            + (np.flatnonzero(known) * size)[:, None]
        )
        at.append((start + pair).ravel().astype(float))
        values.append(padded[pair.ravel()])
    index = np.concatenate(at) if at else np.zeros(0)
    return channel.axis.at(index) if index.size else index, np.concatenate(
        values
    ) if values else index


def robust_range(
    *values: FloatArray, share: float = 0.01, margin: float = 0.15
) -> tuple[float, float]:
    """Limits that hold all but `share` of the finite values at either end, with a margin."""
    finite = np.concatenate([v[np.isfinite(v)] for v in values] or [np.zeros(0)])
    if not finite.size:
        return 0.0, 1.0
    low, high = (float(q) for q in np.quantile(finite, (share, 1.0 - share)))
    room = margin * (high - low) or 0.05 * abs(high) or 1.0
    return low - room, high + room


#: a slide of 16:9 [inches]
SLIDE = (13.3, 7.5)
#: sizes that the back row reads; a legend of many logs has to fit beside the lines
_LARGE: dict[Any, Any] = {
    "font.size": 14.0,
    "axes.labelsize": 14.0,
    "axes.titlesize": 14.0,
    "legend.fontsize": 11.0,
    "figure.titlesize": 16.0,
    "lines.linewidth": 1.8,
}


@contextmanager
def on_a_slide() -> Iterator[None]:
    """Large letters and lines for what is drawn, and written, inside."""
    figure_page(1.0, 1.0)  # says it if matplotlib is missing
    from matplotlib import rc_context

    with rc_context(_LARGE):
        yield


def by_value(values: Sequence[float] | FloatArray) -> list[Any]:
    """A colour for each of ordered values, dark to light, also for the colour-blind."""
    from matplotlib import colormaps

    given = np.asarray(values, float)
    span = np.ptp(given) if given.size else 0.0
    place = (given - given.min()) / span if span > 0.0 else np.zeros(given.size)
    return list(colormaps["viridis"](0.88 * place))
