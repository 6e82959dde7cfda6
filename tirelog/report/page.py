"""What a report is asked for, figures as plain data, and sections to one HTML file.

The file needs nothing else.

    Panel --`figure`--> traces and layout of the plotting library --> drawn by the page's script
    Section --`render`--> HTML

Arrays travel as base64 of float32: a trace of n points costs about 5 n bytes a coordinate. Long
series are decimated by min-max buckets first, which keeps every peak. Names go through `safe`: the
plotting library reads a few HTML elements in its texts, links among them.

Scripts are inline and named by their hash in the content security policy; data is JSON in a script
element that is never executed; every text goes through `escape`, so a hostile file name is only
ever text.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
import shlex
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib import resources
from itertools import count
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from tirelog.data.setup import setup_beside
from tirelog.diagnosis.answer import AnswerTable
from tirelog.errors import UsageError
from tirelog.plots.record import SYMBOLS, Mark, Panel
from tirelog.storage.whole import shown
from tirelog.tables.writer import shown_cell
from tirelog.version import __version__

#: distinct for all forms of colour blindness (Okabe and Ito's first three), each with three times
#: the luminance contrast to white that a graphic needs
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#C4569A", "#4B3FA0", "#8A6D00", "#6b6b6b")
#: the same ones, in order, on dark paper
DARK_COLOURS = ("#56B4E9", "#FF9E4A", "#35C99A", "#E8A0CC", "#A99CF0", "#E6C34A", "#B4BAC0")
#: what is no log's: models and effects, and what is beside them; on dark paper
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
DASHES = ("solid", "dash", "dot", "dashdot")


@dataclass(frozen=True)
class Figure:
    """A figure: `alt` is what a person reads who cannot see it.

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
    return escape(str(name), quote=False)


def packed_array(values: Any) -> dict[str, str]:
    """Numbers as the plotting library's typed array (float32)."""
    array = np.ascontiguousarray(np.asarray(values, dtype=np.float32))
    out = {"dtype": "f4", "bdata": base64.b64encode(array.tobytes()).decode()}
    if array.ndim == 2:
        out["shape"] = f"{array.shape[0]}, {array.shape[1]}"
    return out


#: of each log the number of its colour, by its file name; the same in every figure
LogColours = defaultdict[str, int]


def log_colours(logs: Iterable[str]) -> LogColours:
    """The next colour for each log that has none yet."""
    numbers = LogColours(count().__next__)
    for log in logs:
        _ = numbers[PurePath(log).name]
    return numbers


#: symbols of marks that have no name of their own here
_MARKERS: dict[str, dict[str, Any]] = {
    ".": {},
    "D": {"symbol": "diamond"},
    "_": {"symbol": "line-ew-open", "size": 14, "line": {"width": 3}},
}


def figure(id: str, title: str, alt: str, panel: Panel, half: bool = False, **shape: Any) -> Figure:
    """The figure of a panel; `shape`: what its layout has besides."""
    words = (panel.x_words, panel.y_words)
    for key, text, limits, scale, names in zip(
        ("xaxis", "yaxis"), (panel.x, panel.y), panel.limits, panel.scales, words, strict=True
    ):
        shape[key] = {"title": {"text": text}, "automargin": True, "exponentformat": "power"}
        if names:  # in their order, the first of lying ones on top
            shape[key] |= {
                "type": "category",
                "categoryorder": "array",
                "categoryarray": list(names),
                **({"autorange": "reversed"} if key == "yaxis" else {}),
            }
            continue
        if limits is not None and np.isfinite(limits).all():
            shape[key]["range"] = [float(limit) for limit in limits]
        if scale == "log":
            shape[key]["type"] = "log"
    look = {"color": EDGE, "width": 1, "dash": "dash"}
    ends = {"type": "line", "line": look}
    shape["shapes"] = [
        ends | {"yref": "paper", "y0": 0, "y1": 1, "x0": float(mark.x), "x1": float(mark.x)}
        for mark in panel.marks
        if mark.kind == "upright" and panel.limits[1] is None
    ] + [
        ends | {"xref": "paper", "x0": 0, "x1": 1, "y0": float(mark.y), "y1": float(mark.y)}
        for mark in panel.marks
        if mark.kind == "level"
    ]
    traces = [trace for mark in panel.marks for trace in _traces(mark, panel)]
    return Figure(id, title, alt, traces, shape, half)


def _traces(mark: Mark, panel: Panel) -> list[dict[str, Any]]:
    """A mark as the plotting library has it; none of words and of lines across the panel.

    What only this library has of its look is in its style, as `marker` or `line`.
    """
    style, named = mark.style, not mark.name.startswith("_")
    colour = mark.colour if isinstance(mark.colour, str) else COLOURS[mark.colour % len(COLOURS)]
    at, along = mark.x, mark.y
    own: dict[str, Any] = {"type": "scatter", "name": safe(mark.name.removeprefix("_"))}
    if mark.kind in ("words", "level", "span"):
        return []
    if mark.kind == "heat":
        reach, label = (
            mark.style["high"],
            mark.name.split("\n")[0],
        )  # the second line is of the scale
        return [
            {
                "type": "heatmap",
                "x": packed_array(mark.x),
                "y": packed_array(mark.y),
                "z": packed_array(mark.other),
                "zmin": -reach,
                "zmax": reach,
                "colorscale": [list(stop) for stop in DIVERGING],
                "colorbar": {"title": {"text": label, "side": "right"}, "thickness": 12},
            }
        ]
    if mark.kind == "bars":
        across = bool(style.get("across"))
        words = [safe((panel.y_words if across else panel.x_words)[i]) for i in mark.x]
        values = packed_array(mark.y)
        x, y = (values, words) if across else (words, values)
        bar = {"type": "bar", "width": 0.6, "x": x, "y": y, "marker": {"color": colour}}
        bar["orientation"] = "h" if across else "v"
        if mark.other is not None:
            error = {"type": "data", "array": packed_array(mark.other), "visible": True}
            look = {"color": "#6b6b6b", "thickness": 1.5}
            bar["error_x" if across else "error_y"] = error | look
        return [own | bar]
    if mark.kind == "dots":
        symbol = SYMBOLS[mark.colour % 3] if isinstance(mark.colour, int) else SYMBOLS[0]
        marker = {"color": colour, "size": 5, "opacity": 0.7, "symbol": symbol}
        marker |= _MARKERS.get(style.get("symbol", "."), {"symbol": style.get("symbol")})
        own |= {"mode": "markers", "marker": marker | style.get("marker", {})}
    else:
        steps = {"steps-mid": "hvh", "steps-post": "hv"}.get(style.get("drawstyle", ""), "linear")
        drawn = {"dash": style.get("dash", "solid"), "shape": steps} | style.get("line", {})
        own |= {"mode": "lines", "line": {"color": colour, "width": 1.5} | drawn}
    if mark.kind == "upright":  # one without a name is a shape of the layout
        if panel.limits[1] is None:
            return []
        at, along = [mark.x, mark.x], panel.limits[1]
        own |= {"showlegend": bool(mark.name), "hoverinfo": "skip"}
    own["x"] = [panel.x_words[i] for i in at] if panel.x_words else packed_array(at)
    own["y"] = packed_array(along)
    if mark.kind == "band":
        own |= {"line": {"color": colour, "width": 0}, "hoverinfo": "skip", "showlegend": False}
        above = {"y": packed_array(mark.other), "fill": "tonexty", "fillcolor": f"{colour}40"}
        return [own, own | above | {"showlegend": named}]
    return [own]


@dataclass(frozen=True)
class Card:
    """The answer at a glance.

    word      the verdict in a word or two; sentence: what it says
    facts     (term, text): measured on what, how sure, ...
    rungs     models on the way to the best one: `name` and what that is, `error` and noise
              `floor` in `unit`, of which the last is shown; rungs_said: what errors these are
    advice    what to do or drive next; command: the line to type next
    """

    word: str
    sentence: str
    facts: Sequence[tuple[str, str]]
    command: str
    advice: Sequence[str] = ()
    rungs: Sequence[Mapping[str, Any]] = ()
    rungs_said: str = ""
    unit: str = ""


@dataclass(frozen=True)
class Section:
    """A section: what it says, the command that makes it, its figures and tables.

    The first paragraph always shows; the rest is folded away if `folded`.
    """

    id: str
    title: str
    command: str
    text: Sequence[str] = ()
    figures: Sequence[Figure] = ()
    tables: Sequence[AnswerTable] = ()
    folded: bool = True
    card: Card | None = None


@dataclass(frozen=True)
class ReportRequest:
    """What the user gave, with paths as typed.

    So the commands on the page can be typed again, but for what an address keeps secret.
    """

    logs: tuple[str, ...] = ()
    setup: Path | None = None
    model: Path | None = None
    ladder: Path | None = None
    campaign: Path | None = None
    tables: tuple[Path, ...] = ()
    channel: str | None = None
    effects: Path | None = None

    def command(self, name: str, *more: str, model: bool = False) -> str:
        """A command line on the same logs."""
        logs = list(map(shown, self.logs)) or ["LOG"]
        words = ["tirelog", name, *logs, *more, *self._given("setup")]
        if model:
            words += ["--model", str(self.model or "M"), *self._given("channel", "effects")]
        return shlex.join(words)

    def make_model(self) -> str:
        """The command line that makes a first model of these logs."""
        beside = setup_beside(self.logs[0]) if self.logs else None
        setup = str(self.setup or beside or "SETUP.toml")
        return f"tirelog model new --carcass beam --setup {shlex.quote(setup)} -o M.toml"

    def with_options(self, line: str) -> str:
        """A command line on these logs with the options that were given for them and it lacks."""
        names = (n for n in ("setup", "channel", "effects") if f" --{n} " not in line)
        return f"{line} {shlex.join(self._given(*names))}".rstrip()

    def report_command(self) -> str:
        """The page's own command line."""
        words = ["tirelog", "report", *map(shown, self.logs)]
        words += self._given("setup", "model", "ladder", "campaign", "channel", "effects")
        words += [word for path in self.tables for word in ("--table", str(path))]
        return shlex.join([*words, "-o", "report.html"])

    def _given(self, *names: str) -> list[str]:
        """These options with their values, those that were given."""
        values = {name: getattr(self, name) for name in names}
        return [w for name, v in values.items() if v is not None for w in (f"--{name}", str(v))]


def plotting_library() -> str:
    """The plotting library's JavaScript.  UsageError: the extra is missing."""
    try:
        from plotly.offline import get_plotlyjs
    except ImportError:
        raise UsageError(
            "the page needs plotly", do="it comes with the extra: pip install 'tirelog[report]'"
        ) from None
    # its credits link to the web; written so, they mean the same to a browser and are no address to
    # whoever scans the page for any
    return re.sub(r'href="(https?):/(?=/)', r'href="\1:\\/', str(get_plotlyjs()))


def _file(name: str) -> str:
    return (resources.files("tirelog.report") / "templates" / name).read_text("utf-8")


def _hash(script: str) -> str:
    return "'sha256-" + base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() + "'"


@dataclass
class Report:
    """What goes on the page, in plain text.

    `missing`: (what cannot be shown, the command that would show it); `made`: when, and by what.
    """

    title: str
    sections: list[Section] = field(default_factory=list)
    missing: list[tuple[str, str]] = field(default_factory=list)
    provenance: list[str] = field(default_factory=list)
    commands: list[str] = field(default_factory=list)
    made: str = f"tirelog {__version__}"


def render(report: Report) -> list[str]:
    """The page, in parts to be written one after the other."""
    library, script, style = plotting_library(), _file("page.js"), _palette() + _file("page.css")
    policy = (
        f"default-src 'none'; script-src {_hash(library)} {_hash(script)}; "
        "style-src 'unsafe-inline'; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'"
    )
    light, dark = (*COLOURS, INK, GREY, PALE), (*DARK_COLOURS, *DARK_NEUTRALS)
    figures = (f for section in report.sections for f in section.figures)
    data = {
        "figures": {
            f.id: {"traces": f.traces, "layout": f.layout, "title": f.title} for f in figures
        },
        "dark": dict(zip(light, dark, strict=True)),
    }
    links = (f'<a href="#{one.id}">{escape(one.title)}</a>' for one in report.sections)
    head = (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark">'
        f'<title>{escape(report.title)}</title><link rel="icon" href="data:,">'
        f"<style>{style}</style></head><body>"
        '<a class="skip" href="#main">Skip to the results</a>'
        f"<header><h1>{escape(report.title)}</h1><p>{escape(report.made)}</p>"
        f'<nav aria-label="Sections"><ul>{_items(links)}'
        '<li><a href="#about">About this page</a></li>'
        '</ul></nav></header><main id="main" tabindex="-1">'
        f"{''.join(map(_section, report.sections))}{_about(report)}</main>"
        '<script type="application/json" id="data">'
    )
    return [
        head.replace("m/s^2", "m/s²"),
        # JSON that cannot close its script element
        json.dumps(data, ensure_ascii=True, separators=(",", ":"), allow_nan=False)
        .replace("m/s^2", "m/s\\u00b2")
        .replace("<", "\\u003c")
        .replace("&", "\\u0026"),
        "</script><script>",
        library,
        f"</script><script>{script}</script></body></html>\n",
    ]


def _items(content: Iterable[str]) -> str:
    """Items of a list, each already HTML."""
    return "".join(f"<li>{one}</li>" for one in content)


def _palette() -> str:
    """The colours of the figures as the style sheet's variables, in light and in dark."""
    light, dark = (
        " ".join(f"--c{i}: {colour};" for i, colour in enumerate(colours))
        for colours in (COLOURS, DARK_COLOURS)
    )
    return (
        f":root {{ {light} }}\n@media (prefers-color-scheme: dark) {{ :root {{ {dark} }} }}\n"
        f"@media print {{ :root {{ {light} }} }}\n"
    )


def _about(report: Report) -> str:
    """What the page rests on, at its foot."""
    absent = _items(f"{escape(what)}: <code>{escape(done)}</code>" for what, done in report.missing)
    cited = _items(f"{name}: {escape(paper)}" for name, paper in PAPERS.items())
    meanings = "".join(f"<dt>{escape(w)}</dt><dd>{escape(meaning)}</dd>" for w, meaning in GLOSSARY)
    commands = escape("\n".join(report.commands))
    return (
        '<section id="about"><h2>About this page</h2>'
        + (f"<h3>Not shown</h3><ul>{absent}</ul>" if absent else "")
        + "<h3>Papers</h3>"
        + _fold("Where methods and effects are from", f"<ul>{cited}</ul>")
        + "<h3>Glossary</h3>"
        + _fold(f"What {len(GLOSSARY)} words mean here", f"<dl>{meanings}</dl>")
        + "<h3>Provenance</h3>"
        + _fold(
            "Versions, and the bytes of every file that went in",
            f"<ul>{_items(map(escape, report.provenance))}</ul>",
        )
        + "<h3>Commands that repeat it</h3>"
        + _fold(f"{len(report.commands)} command lines", f"<pre><code>{commands}</code></pre>")
        + "</section>"
    )


def _fold(summary: str, content: str) -> str:
    return f"<details><summary>{escape(summary)}</summary>{content}</details>"


def _section(section: Section) -> str:
    first, *more = [f"<p>{escape(p)}</p>" for p in section.text] or [""]
    rest = "".join([*more, _figures(section.figures), *map(_table, section.tables)])
    made = f'<p class="made">Made with <code>{escape(section.command)}</code></p>'
    rest += made if section.command else ""
    if section.folded and rest:
        sizes = ((len(section.figures), "figure"), (len(section.tables), "table"))
        held = [f"{n} {word}{'s' if n > 1 else ''}" for n, word in sizes if n]
        rest = _fold(f"Details: {', '.join([*held, 'how it was made'])}", rest)
    return (
        f'<section id="{section.id}"{" class=answer" if section.card else ""}>'
        f"<h2>{escape(section.title)}</h2>"
        f"{_card(section.card) if section.card else ''}{first}{rest}</section>"
    )


def _figures(figures: Sequence[Figure]) -> str:
    drawn = "".join(
        f'<figure{" class=half" if f.half else ""} aria-labelledby="{f.id}-title" '
        f'aria-describedby="{f.id}-alt"><figcaption id="{f.id}-title">{escape(f.title)}'
        f'</figcaption><div class="plot" id="{f.id}"></div>'
        f'<p class="alt" id="{f.id}-alt">{escape(f.alt)}</p></figure>'
        for f in figures
    )
    return f'<div class="figures">{drawn}</div>' if drawn else ""


def _card(card: Card) -> str:
    facts = "".join(
        f"<div><dt>{escape(term)}</dt><dd>{escape(text)}</dd></div>" for term, text in card.facts
    )
    advice = "".join(f"<p>{escape(text)}</p>" for text in card.advice)
    return (
        '<div class="card"><div class="verdicts">'
        f'<p class="verdict"><strong>{escape(card.word)}</strong></p>'
        f'<p class="sentence">{escape(card.sentence)}</p></div><div class="steps">{_rungs(card)}'
        f"<h3>Next</h3>{advice}<pre><code>{escape(card.command)}</code></pre></div>"
        f'<dl class="facts">{facts}</dl></div>'
    )


def _rungs(card: Card) -> str:
    """The error falling: a bar per model, and the noise floor of the last one on each."""
    if not card.rungs:
        return ""
    floor = card.rungs[-1]["floor"]
    largest = max(1e-300, floor, *(rung["error"] for rung in card.rungs))
    mark, steps = 100.0 * floor / largest, []
    for rung in card.rungs:
        length = 100.0 * rung["error"] / largest
        steps.append(
            f"<li><strong>{escape(rung['name'])}</strong> <span>{escape(rung['said'])}</span>"
            f'<span class="bar" aria-hidden="true"><span style="width:{length:.1f}%"></span>'
            f'<i style="left:{mark:.1f}%"></i></span>'
            f'<span class="error">{rung["error"]:.3g} {escape(card.unit)}</span></li>'
        )
    heading = "How the error falls" if len(steps) > 1 else "The error"
    said = f"{card.rungs_said} The upright mark is the noise floor, {floor:.3g} {card.unit}."
    return (
        f'<h3>{heading}</h3><p class="alt">{escape(said)}</p>'
        f'<ol class="rungs">{"".join(steps)}</ol>'
    )


def _table(table: AnswerTable) -> str:
    """The table; the first cell of a row names it, with the colour that it has in the figures."""
    caption, *names = map(escape, (table.caption, *table.names))
    head = "".join(f'<th scope="col">{name}</th>' for name in names)
    rows = ""
    for number, row in enumerate(table.rows):
        first, *others = map(escape, map(shown_cell, row or [""]))
        if number < len(table.colours):
            colour = f"var(--c{table.colours[number] % len(COLOURS)})"
            first = f'<span class="swatch" style="background:{colour}"></span>{first}'
        cells = "".join(f"<td>{cell}</td>" for cell in others)
        rows += f'<tr><th scope="row">{first}</th>{cells}</tr>'
    return (
        f'<div class="table" role="group" aria-label="{caption}" tabindex="0">'
        f"<table><caption>{caption}</caption><thead><tr>{head}</tr></thead><tbody>{rows}</tbody>"
        "</table></div>"
    )


#: the papers that methods, figures and effects stand on (their errata: docs/errata.md)
PAPERS = {
    "P1": "N. Roveri, G. Pepe, A. Carcaterra, On line estimation of rolling resistance for "
    "intelligent tires.",
    "P2": "N. Roveri, G. Pepe, A. Carcaterra, OPTYRE - A new technology for tire monitoring: "
    "Evidence of contact patch phenomena, Mechanical Systems and Signal Processing 66-67 (2016) "
    "793-810.",
    "P3": "H. Hijry, S. Mohsen, O. Albalawi, S. Ali, A. Alhawiti, G. A. Elnashar, Development and "
    "simulation of a novel mathematical model for an intelligent tire system toward predictive "
    "maintenance.",
    "P4": "New Regressors for the Direct Identification of Tire Deformation in Road Vehicles Via "
    '"In-Tire" Accelerometers.',
}
#: words of the page and their meanings, also those of docs/glossary.md
GLOSSARY = (
    ("revolution", "one turn of the wheel, patch centre to patch centre"),
    ("contact length", "length of tread that touches the road, entry edge to exit edge"),
    ("dissipation factor", "integral of the squared strain gradient over a revolution (P1)"),
    (
        "slip onset",
        "place in the patch where adhesion turns to slip, entry negative, exit positive",
    ),
    (
        "quality",
        "'ok', or words that say what is wrong inside a row's patch window; "
        "such rows are counted and not drawn",
    ),
    (
        "phase shift",
        "wheel angle at the middle of the patch signal minus its value in the zero stretch; "
        "negative in braking",
    ),
    ("effect", "one physical mechanism that can be in a model or missing from it"),
    (
        "noise floor",
        "the error that scatter alone leaves, within and between manoeuvres. The first part is the "
        "same for every model; of the second a worse model has more",
    ),
    ("excess error", "sqrt(rmse^2 - floor^2): what a better model could still remove"),
    (
        "held out",
        "manoeuvres that the fit has not seen: each is left out in its turn and predicted from "
        "all the others",
    ),
    (
        "reduced chi-square",
        "squared residual per degree of freedom, in units of noise and scatter: 1 if the model "
        "leaves nothing else",
    ),
    (
        "manoeuvre",
        "a stretch of one regime (cruise, drive, coast, brake); what repeats from one to the "
        "next is no chance",
    ),
    ("residual", "measured less predicted"),
)
