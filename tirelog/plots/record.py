"""A picture as a record: pages of panels of marks, which name what they show and its unit.

    numbers --> Mark --> Panel --> Page --`plots.style`--> matplotlib (files, notebooks)
                             Panel --`report.page`--> plotly's JSON (the report's page)

Style words are of no library: width, dash, size, symbol, opacity. What else a mark's style holds
is matplotlib's own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any


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
    own      draws on matplotlib's axes what is no mark; `polar` says of which kind they are
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
    own: Callable[[Any], object] | None = None
    polar: bool = False
    bare: bool = False


@dataclass(frozen=True)
class Page:
    """Panels by rows; a row of fewer panels spreads them over the width.  None: an empty place.

    size      inches; of a part of a page none
    parts     pages side by side, or below each other if `stacked`, instead of panels
    share     axes that the panels of a column ("x") or of a row ("y") have in common
    bar       one bar of colours for all panels: its label; else each has its own
    """

    rows: Sequence[Sequence[Panel | None]] = ()
    size: tuple[float, float] = (12.0, 4.0)
    title: str = ""
    widths: Sequence[float] | None = None
    heights: Sequence[float] | None = None
    share: str = ""
    parts: Sequence[Page] = ()
    stacked: bool = False
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
