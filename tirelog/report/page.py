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
from tirelog.report.figures import Figure
from tirelog.version import __version__


@dataclass(frozen=True)
class PageTable:
    """A small table: header cells with units, rows of text."""

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Section:
    """A section: what it says, the command that makes it, its figures and tables.

    `switches`: data of the effect switches, if any.
    """

    id: str
    title: str
    command: str
    text: Sequence[str] = ()
    figures: Sequence[Figure] = ()
    tables: Sequence[PageTable] = ()
    switches: dict[str, Any] = field(default_factory=dict)


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


def render(
    title: str,
    sections: Sequence[Section],
    missing: Sequence[tuple[str, str]],
    provenance: Sequence[str],
    commands: Sequence[str],
) -> list[str]:
    """The page, in parts to be written one after the other.

    `missing`: (what cannot be shown, the command that would); plain text all.
    """
    library, script, style = plotting_library(), _file("page.js"), _file("page.css")
    policy = (
        f"default-src 'none'; script-src {_hash(library)} {_hash(script)}; "
        "style-src 'unsafe-inline'; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'"
    )
    data = {
        "figures": {
            f.id: {"traces": f.traces, "layout": f.layout} for s in sections for f in s.figures
        },
        "switches": {s.id: s.switches for s in sections if s.switches},
    }
    e = html.escape
    contents = "".join(f'<li><a href="#{s.id}">{e(s.title)}</a></li>' for s in sections)
    body = "".join(_section(s) for s in sections)
    origins = "".join(f"<li>{e(part)}</li>" for part in provenance)
    absent = "".join(f"<li>{e(what)}: <code>{e(command)}</code></li>" for what, command in missing)
    head = (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark">'
        f'<title>{e(title)}</title><link rel="icon" href="data:,">'
        f"<style>{style}</style></head><body>"
        '<a class="skip" href="#main">Skip to the results</a>'
        f"<header><h1>{e(title)}</h1><p>tirelog {e(__version__)}</p>"
        f'<nav aria-label="Sections"><ul>{contents}<li><a href="#about">About this page</a></li>'
        f'</ul></nav></header><main id="main">{body}'
        '<section id="about"><h2>About this page</h2>'
        + (f"<h3>Not shown</h3><ul>{absent}</ul>" if absent else "")
        + f"<h3>Glossary</h3><dl>{_glossary()}</dl><h3>Provenance</h3><ul>{origins}</ul>"
        f"<h3>Commands that repeat it</h3><pre>{e(chr(10).join(commands))}</pre></section></main>"
        '<script type="application/json" id="data">'
    )
    return [
        head,
        _json(data),
        "</script><script>",
        library,
        f"</script><script>{script}</script></body></html>\n",
    ]


def _section(section: Section) -> str:
    e = html.escape
    text = "".join(f"<p>{e(p)}</p>" for p in section.text)
    tables = "".join(_table(t) for t in section.tables)
    switches = (
        f'<div class="switches" data-section="{section.id}"></div>' if section.switches else ""
    )
    figures = "".join(
        f'<figure><figcaption id="{f.id}-title">{e(f.title)}</figcaption>'
        f'<div class="plot" id="{f.id}" role="img" aria-labelledby="{f.id}-title" '
        f'aria-describedby="{f.id}-alt"></div>'
        f'<p class="alt" id="{f.id}-alt">{e(f.alt)}</p></figure>'
        for f in section.figures
    )
    made = (
        f'<p class="made">Made with <code>{e(section.command)}</code></p>'
        if section.command
        else ""
    )
    return (
        "<section "
        f'id="{section.id}"><h2>{e(section.title)}</h2>{made}{text}{tables}{switches}{figures}</section>'
    )


def _table(table: PageTable) -> str:
    e = html.escape
    head = "".join(f'<th scope="col">{e(h)}</th>' for h in table.header)
    rows = "".join(
        "<tr>" + "".join(f"<td>{e(c)}</td>" for c in row) + "</tr>" for row in table.rows
    )
    caption = f"<caption>{e(table.caption)}</caption>"
    return (
        '<div class="table" '
        f'tabindex="0"><table>{caption}<thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>'
    )


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
