"""Sections as a file.

What a campaign's models have to show is drawn where their results are, and put on the page later.

Sections --JSON--> models/<model>/page.json --> the same Sections
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from tirelog.errors import UsageError
from tirelog.report.figures import Figure
from tirelog.report.page import Card, PageTable, Rung, Section
from tirelog.storage.documents import json_of

#: ids stand in the page as they are
_ID = re.compile(r"[a-z][a-z0-9_-]*")
_CARD = {
    **dict.fromkeys(("word", "sentence", "command", "rungs_said", "unit"), str),
    "facts": [[str]],
    "advice": [str],
    "rungs": [{"name": str, "said": str, "error": float, "floor": float}],
}
_SECTION = {
    **dict.fromkeys(("id", "title", "command"), str),
    "text": [str],
    "figures": [
        {"id": str, "title": str, "alt": str, "traces": [{str: object}], "layout": {str: object}}
    ],
    "tables": [{"caption": str, "header": [str], "rows": [[str]], "colours?": [int]}],
    "card?": _CARD,
    "formulas?": [[str]],
    "sources?": [[str]],
}


def stored(sections: Sequence[Section], missing: Sequence[tuple[str, str]]) -> dict[str, Any]:
    """The sections and what is missing as the JSON document of the file."""
    return {
        "sections": [asdict(section) for section in sections],
        "missing": [list(pair) for pair in missing],
    }


def read_stored(path: Path) -> tuple[list[Section], list[tuple[str, str]]]:
    """(sections, what is missing) of a file.  UsageError: it is none."""
    try:
        content = json_of(
            path.read_text(encoding="utf-8"), {"sections": [_SECTION], "missing": [[str]]}
        )
        sections = [_section(one) for one in content["sections"]]
        return sections, [(str(what), str(command)) for what, command in content["missing"]]
    except (OSError, ValueError, KeyError, TypeError):
        raise UsageError(
            "is no page of a campaign's model",
            allowed="`tirelog campaign run` writes it",
            do="remove it and run again",
            file=path,
        ) from None


def _section(data: dict[str, Any]) -> Section:
    figures = [Figure(**one) for one in data.pop("figures")]
    tables = [PageTable(**one) for one in data.pop("tables")]
    card = data.pop("card", None)
    if card is not None:
        rungs = [Rung(**one) for one in card["rungs"]]
        card = Card(**card | {"facts": [tuple(one) for one in card["facts"]], "rungs": rungs})
    for pairs in ("formulas", "sources"):
        data[pairs] = tuple((str(name), str(text)) for name, text in data.get(pairs, ()))
    if not all(_ID.fullmatch(name) for name in (data["id"], *(figure.id for figure in figures))):
        raise ValueError
    return Section(**data, figures=figures, tables=tables, card=card)


def model_pages(campaign: Path) -> Iterator[tuple[list[Section], list[tuple[str, str]]]]:
    """(sections, what is missing) of each model of a campaign.

    Titles and ids are told apart if there are several.
    """
    files = sorted(campaign.glob("models/*/page.json"))
    for number, file in enumerate(files, 1):
        sections, missing = read_stored(file)
        if len(files) > 1:
            sections = [
                _told_apart(section, file.parent.name, f"-{number}") for section in sections
            ]
        yield sections, missing


def _told_apart(section: Section, model: str, mark: str) -> Section:
    figures = [replace(figure, id=figure.id + mark) for figure in section.figures]
    return replace(
        section,
        id=section.id + mark,
        title=f"{section.title}: {model}",
        figures=figures,
    )
