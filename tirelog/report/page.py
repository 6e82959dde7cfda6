"""Sections to one HTML file that needs nothing else.

Scripts are inline and named by their hash in the content security policy; data is JSON in a script
element that is never executed; every text goes through `html.escape`, so a hostile file name is
only ever text.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import resources
from typing import Any

from tirelog.errors import UsageError
from tirelog.report.figures import COLOURS, DARK_COLOURS, DARK_NEUTRALS, GREY, INK, PALE, Figure
from tirelog.version import __version__


@dataclass(frozen=True)
class PageTable:
    """A small table: header cells with units, rows of text.

    colours   of each row the number of its colour in the figures, if they stand for something there
    """

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    colours: Sequence[int] = ()


@dataclass(frozen=True)
class LadderRow:
    """A model on the way to the best one.

    What was added and what that is, the error and the noise floor in the card's unit.
    """

    name: str
    said: str
    error: float
    floor: float


@dataclass(frozen=True)
class Card:
    """The answer at a glance.

    word      the verdict in a word or two; sentence: what it says
    facts     (term, text): measured on what, how sure, ...
    rungs     the error falling, in `unit`; rungs_said: what errors these are
    advice    what to do or drive next; command: the line to type next
    """

    word: str
    sentence: str
    facts: Sequence[tuple[str, str]]
    command: str
    advice: Sequence[str] = ()
    rungs: Sequence[LadderRow] = ()
    rungs_said: str = ""
    unit: str = ""


@dataclass(frozen=True)
class Section:
    """A section: what it says, the command that makes it, its figures and tables.

    The first paragraph always shows; the rest is folded away if `folded`.
    `formulas`: (name, expression). `sources`: (effect, where its physics is from).
    """

    id: str
    title: str
    command: str
    text: Sequence[str] = ()
    figures: Sequence[Figure] = ()
    tables: Sequence[PageTable] = ()
    folded: bool = True
    card: Card | None = None
    formulas: Sequence[tuple[str, str]] = ()
    sources: Sequence[tuple[str, str]] = ()


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


def _json(data: Any) -> str:
    """JSON that cannot close its script element."""
    return (
        json.dumps(data, ensure_ascii=True, separators=(",", ":"), allow_nan=False)
        .replace("<", "\\u003c")
        .replace("&", "\\u0026")
    )


@dataclass
class Report:
    """What goes on the page, in plain text.

    `missing`: (what cannot be shown, the command that would show it); `papers`: (a paper, what of
    it is shown); `made`: when, and by what.
    """

    title: str
    sections: list[Section] = field(default_factory=list)
    missing: list[tuple[str, str]] = field(default_factory=list)
    provenance: list[str] = field(default_factory=list)
    commands: list[str] = field(default_factory=list)
    papers: list[tuple[str, str]] = field(default_factory=list)
    made: str = f"tirelog {__version__}"


def render(report: Report) -> list[str]:
    """The page, in parts to be written one after the other."""
    title, sections = report.title, report.sections
    library, script, style = plotting_library(), _file("page.js"), _palette() + _file("page.css")
    policy = (
        f"default-src 'none'; script-src {_hash(library)} {_hash(script)}; "
        "style-src 'unsafe-inline'; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'"
    )
    data = {
        "figures": {
            f.id: {"traces": f.traces, "layout": f.layout, "title": f.title}
            for s in sections
            for f in s.figures
        },
        "dark": dict(
            zip((*COLOURS, INK, GREY, PALE), (*DARK_COLOURS, *DARK_NEUTRALS), strict=True)
        ),
    }
    e = html.escape
    contents = "".join(f'<li><a href="#{s.id}">{e(s.title)}</a></li>' for s in sections)
    body = "".join(_section(s) for s in sections)
    head = (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark">'
        f'<title>{e(title)}</title><link rel="icon" href="data:,">'
        f"<style>{style}</style></head><body>"
        '<a class="skip" href="#main">Skip to the results</a>'
        f"<header><h1>{e(title)}</h1><p>{e(report.made)}</p>"
        f'<nav aria-label="Sections"><ul>{contents}<li><a href="#about">About this page</a></li>'
        f'</ul></nav></header><main id="main" tabindex="-1">{body}'
        f"{_about(report)}</main>"
        '<script type="application/json" id="data">'
    )
    return [
        head,
        _json(data),
        "</script><script>",
        library,
        f"</script><script>{script}</script></body></html>\n",
    ]


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
    """What stands behind the page, at its foot."""
    e, commands, missing, papers = html.escape, report.commands, report.missing, report.papers
    absent = "".join(f"<li>{e(what)}: <code>{e(command)}</code></li>" for what, command in missing)
    cited = "".join(f"<li>{e(paper)} <em>Here: {e(what)}.</em></li>" for paper, what in papers)
    origins = "".join(f"<li>{e(part)}</li>" for part in report.provenance)
    return (
        '<section id="about"><h2>About this page</h2>'
        + (f"<h3>Not shown</h3><ul>{absent}</ul>" if absent else "")
        + (f'<h3 id="papers">Papers</h3><ul>{cited}</ul>' if cited else "")
        + "<h3>Glossary</h3>"
        + _fold(f"What {len(_WORDS)} words mean here", f"<dl>{_glossary()}</dl>")
        + "<h3>Provenance</h3>"
        + _fold("Versions, and the bytes of every file that went in", f"<ul>{origins}</ul>")
        + "<h3>Commands that repeat it</h3>"
        + _fold(
            f"{len(commands)} command lines", f"<pre><code>{e(chr(10).join(commands))}</code></pre>"
        )
        + "</section>"
    )


def _fold(summary: str, content: str) -> str:
    return f"<details><summary>{html.escape(summary)}</summary>{content}</details>"


def _section(section: Section) -> str:
    e = html.escape
    paragraphs = [f"<p>{e(p)}</p>" for p in section.text]
    formulas = "".join(
        f'<p class="formula"><strong>{e(name)}</strong> = <code>{e(text)}</code></p>'
        for name, text in section.formulas
    )
    tables = "".join(_table(t) for t in section.tables)
    made = (
        f'<p class="made">Made with <code>{e(section.command)}</code></p>'
        if section.command
        else ""
    )
    first = "".join(paragraphs[:1]) + formulas
    rest = (
        "".join(paragraphs[1:])
        + _figures(section.figures)
        + tables
        + (made if section.folded else "")
    )
    if section.folded and rest:
        rest = _fold(_folded(section), rest)
    elif not section.folded:
        rest += made
    return (
        f'<section id="{section.id}"{" class=answer" if section.card else ""}>'
        f"<h2>{e(section.title)}</h2>"
        f"{_card(section.card) if section.card else ''}{first}{rest}</section>"
    )


def _folded(section: Section) -> str:
    """What a folded section holds, in words."""
    counted = [
        f"{n} {word}{'s' if n > 1 else ''}"
        for n, word in ((len(section.figures), "figure"), (len(section.tables), "table"))
        if n
    ]
    return f"Details: {', '.join([*counted, 'how it was made'])}"


def _figures(figures: Sequence[Figure]) -> str:
    e = html.escape
    drawn = "".join(
        f'<figure{" class=half" if f.half else ""} aria-labelledby="{f.id}-title" '
        f'aria-describedby="{f.id}-alt"><figcaption id="{f.id}-title">{e(f.title)}</figcaption>'
        f'<div class="plot" id="{f.id}"></div>'
        f'<p class="alt" id="{f.id}-alt">{e(f.alt)}</p></figure>'
        for f in figures
    )
    return f'<div class="figures">{drawn}</div>' if drawn else ""


def _card(card: Card) -> str:
    e = html.escape
    facts = "".join(f"<div><dt>{e(term)}</dt><dd>{e(text)}</dd></div>" for term, text in card.facts)
    advice = "".join(f"<p>{e(text)}</p>" for text in card.advice)
    return (
        '<div class="card"><div class="said">'
        f'<p class="verdict"><strong>{e(card.word)}</strong></p>'
        f'<p class="sentence">{e(card.sentence)}</p></div><div class="steps">{_rungs(card)}'
        f"<h3>Next</h3>{advice}<pre><code>{e(card.command)}</code></pre></div>"
        f'<dl class="facts">{facts}</dl></div>'
    )


def _rungs(card: Card) -> str:
    """The error falling: a bar per model, the floor marked on each."""
    if not card.rungs:
        return ""
    e = html.escape
    largest = max(1e-300, *(value for rung in card.rungs for value in (rung.error, rung.floor)))
    steps = []
    for rung in card.rungs:
        length, mark = 100.0 * rung.error / largest, 100.0 * rung.floor / largest
        steps.append(
            f"<li><strong>{e(rung.name)}</strong> <span>{e(rung.said)}</span>"
            f'<span class="bar" aria-hidden="true"><span style="width:{length:.1f}%"></span>'
            f'<i style="left:{mark:.1f}%"></i></span>'
            f'<span class="error">{rung.error:.3g} {e(card.unit)}, noise floor {rung.floor:.3g}'
            "</span></li>"
        )
    said = f'<p class="alt">{e(card.rungs_said)}</p>' if card.rungs_said else ""
    heading = "How the error falls" if len(steps) > 1 else "The error"
    return f'<h3>{heading}</h3>{said}<ol class="rungs">{"".join(steps)}</ol>'


def _table(table: PageTable) -> str:
    e = html.escape
    head = "".join(f'<th scope="col">{e(h)}</th>' for h in table.header)
    rows = "".join(_row(table, i) for i in range(len(table.rows)))
    caption = f"<caption>{e(table.caption)}</caption>"
    return (
        f'<div class="table" role="group" aria-label="{e(table.caption)}" tabindex="0">'
        f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
    )


def _row(table: PageTable, number: int) -> str:
    """A row; its first cell names it, with the colour that it has in the figures."""
    first, *others = table.rows[number] or [""]
    swatch = (
        f'<span class="swatch" style="background:var(--c{table.colours[number] % len(COLOURS)})">'
        "</span>"
        if number < len(table.colours)
        else ""
    )
    cells = "".join(f"<td>{html.escape(c)}</td>" for c in others)
    return f'<tr><th scope="row">{swatch}{html.escape(first)}</th>{cells}</tr>'


_WORDS = (
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
        "the error that scatter alone leaves: that of revolutions within a manoeuvre, which is "
        "the same for every model, and that between "
        "like manoeuvres, which is seen through the model, so that a worse model has a higher "
        "floor",
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


def _glossary() -> str:
    return "".join(
        f"<dt>{html.escape(word)}</dt><dd>{html.escape(meaning)}</dd>" for word, meaning in _WORDS
    )
