"""Where the page's tables come from.

Files given with --table, a campaign's folder, or the commands' own functions.

paths --columns--> kind of table
    --> `SourceTables`: nothing is read before it is asked for, and then only the columns that are
    drawn
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tirelog.data.recording import Recording
from tirelog.errors import UsageError
from tirelog.products import OF_A_DRIVE, tables_of
from tirelog.report.figures import Figure
from tirelog.report.page import Card, LadderRow, PageTable, Section
from tirelog.storage.whole import json_of
from tirelog.tables.frame import frame_of, table_parts
from tirelog.vocabulary.columns import OPTIONAL, TABLES

KINDS = ("speed", "footprint", "dissipation", "phase-shift", "dissipation-fit")
_WORDS = ("log", "channel", "quality", "slip_onset_reason")
#: columns that no figure draws
_UNUSED = {
    "period_s", "speed_se_m_s", "length_se_m", "length_form_se_m", "length_d2_se_m",
    "length_d1_se_m", "edge_asymmetry", "slip_onset_se_m", "slip_onset_reason",
    "dissipation_factor_se_1_m", "entry_angle_deg", "exit_angle_deg",
}  # fmt: skip


@dataclass
class SourceTables:
    """Tables by the command that made them.

    (file, name of the log if the file does not hold it).
    """

    files: dict[str, list[tuple[Path, str | None]]] = field(default_factory=dict)

    def add(self, path: Path, log: str | None = None, kind: str | None = None) -> None:
        """One more file.  UsageError: no table that can be drawn."""
        if kind is None:
            kind = table_kind(list(next(table_parts(path))), path)
        self.files.setdefault(kind, []).append((path, log))

    def get(self, kind: str) -> pd.DataFrame | None:
        """All rows of a kind, or None if none was given."""
        parts = [
            _lighter(part, log)
            for path, log in self.files.get(kind, ())
            for part in table_parts(path, _UNUSED)
        ]
        return _joined(parts) if parts else None


def table_kind(columns: Sequence[str], path: Path) -> str:
    """Which command made a table, by its columns.  UsageError: none did."""
    for name in KINDS:
        if set(TABLES[name]) - OPTIONAL <= set(columns):
            return name
    raise UsageError(
        "is no table of speed, footprint, dissipation or phase-shift",
        allowed="these can be given with --table",
        do="make it anew",
        file=path,
    )


def _drawn_of(frame: pd.DataFrame, log: str | None) -> pd.DataFrame:
    """What of a table is drawn, in less memory."""
    return _lighter(frame.drop(columns=[name for name in frame.columns if name in _UNUSED]), log)


def _lighter(frame: pd.DataFrame, log: str | None) -> pd.DataFrame:
    """The table in less memory, with its column `log`.

    Words as categories, numbers as exact as a picture, times as they are; `log` is put in its
    column if it is not there.
    """
    kinds: dict[str, Any] = {name: "category" for name in _WORDS if name in frame}
    kinds |= {
        str(name): np.float32
        for name in frame
        if frame[name].dtype == np.float64 and not str(name).endswith("time_s")
    }
    frame = frame.astype(kinds)
    if log is not None:
        frame["log"] = pd.Categorical([log]).repeat(len(frame))
    return frame


def _joined(parts: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Parts as one table; words stay categories."""
    if len(parts) == 1:
        return parts[0]
    words = {
        name: pd.api.types.union_categoricals([p[name] for p in parts])
        for name in _WORDS
        if all(name in p for p in parts)
    }
    numbers = pd.concat([p.drop(columns=list(words)) for p in parts], ignore_index=True)
    return numbers.assign(**words)


def given_tables(paths: Sequence[Path], campaign: Path | None = None) -> SourceTables:
    """The tables given with --table and those of a campaign's folder.

    UsageError: no such table, no campaign.
    """
    tables = SourceTables()
    for path in paths:
        tables.add(path)
    if campaign is None:
        return tables
    if not (campaign / "summary.csv").is_file():
        raise UsageError(
            "is no campaign's output (no summary.csv in it)",
            do="give the folder that `tirelog campaign run` writes",
            file=campaign,
        )
    for kind in KINDS:
        for part in sorted(campaign.glob(f"table={kind}/log=*/part.parquet")):
            tables.add(part, part.parent.name.removeprefix("log="), kind)
    return tables


@dataclass(frozen=True)
class MadeTable:
    """A table made from the open logs, None if no log suits it.

    With what was said of it, and with the dissipation table its regressions on speed.
    """

    table: pd.DataFrame | None
    regressions: pd.DataFrame | None
    remarks: list[str]


def made_tables(names: Sequence[str], recordings: Sequence[Recording]) -> dict[str, MadeTable]:
    """Tables of the logs that suit them, made as their commands make them, in what is drawn of it.

    Together, so that each channel is read and its passages are found once. TirelogError: one of
    them cannot be made.
    """
    from tirelog.strain.dissipation_table import regressions

    parts: dict[str, list[pd.DataFrame]] = {name: [] for name in names}
    said: dict[str, list[str]] = {name: [] for name in names}
    lines = []
    for recording in recordings:
        wanted: dict[str, dict[str, Any]] = {
            name: {} for name in names if OF_A_DRIVE[name].suits(recording)
        }
        for part in tables_of(recording, wanted) if wanted else ():
            frame = frame_of(part.columns)
            parts[part.table].append(_drawn_of(frame, None))
            said[part.table] += [f"{Path(recording.log).name}: {r}." for r in part.remarks]
            if part.table == "dissipation":
                fitted, _ = regressions(recording.log, part.found)
                lines += [] if fitted is None else [frame_of(fitted)]
    fits = pd.concat(lines, ignore_index=True) if lines else None
    return {
        name: MadeTable(
            _joined(parts[name]) if parts[name] else None,
            fits if name == "dissipation" else None,
            said[name],
        )
        for name in names
    }


# ---- The papers that figures and effects on the page stand on (their errata: docs/errata.md).


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
#: sections by the papers whose method they use
_METHODS = {
    "drive": ("P2", "speed"),
    "footprint": ("P2", "contact length and slip onset"),
    "dissipation": ("P1", "dissipation"),
    "phase-shift": ("P4", "patch width and phase shift"),
}


def used_papers(sections: Sequence[Section]) -> list[tuple[str, str]]:
    """(paper, what of it is on the page), of each paper that the sections name."""
    used: dict[str, list[str]] = {name: [] for name in PAPERS}
    for section in sections:
        if section.id in _METHODS:
            paper, what = _METHODS[section.id]
            used[paper].append(what)
        for name, what in section.sources:
            for paper in re.findall(r"\bP[1-4]\b", what):
                used[paper].append(name)
    return [
        (f"{paper}: {PAPERS[paper]}", ", ".join(dict.fromkeys(what)))
        for paper, what in used.items()
        if what
    ]


# ---- Sections as a file.
#
# What a campaign's models have to show is drawn where their results are, and put on the page later.
#
# Sections --JSON--> models/<model>/page.json --> the same Sections


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
        rungs = [LadderRow(**one) for one in card["rungs"]]
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
