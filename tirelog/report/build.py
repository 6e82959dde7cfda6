"""From logs, tables, a model and a ladder to the page's sections, and what is missing.

Asked (paths and options) + open recordings
    --tables given with --table, of a campaign's folder, or made--> sections of tables
    campaign's folder --stored--> the sections of its models
    --diagnosis--> Diagnosis --> the model against the measurement, the diagnosis; with a ladder
                                 its steps
whatever cannot be shown --> (what and why, the command that would show it)
"""

from __future__ import annotations

import hashlib
import re
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tirelog.data.recording import Recording
from tirelog.diagnosis.history import read_ladder
from tirelog.errors import TirelogError, UsageError
from tirelog.inference.shared_samples import once_each
from tirelog.physics.model.file import load_model
from tirelog.physics.model.model import Model
from tirelog.physics.model.user_effects import catalogue_with
from tirelog.products import OF_A_DRIVE, tables_of
from tirelog.report.page import Card, Figure, LadderRow, LogColours, PageTable, Report, Section
from tirelog.report.request import ReportRequest
from tirelog.report.sections import recorded as sections
from tirelog.report.sections.diagnosed import model_story
from tirelog.report.sections.models import NO_MODEL, ladder_section, without_a_model
from tirelog.storage.whole import json_of
from tirelog.strain.dissipation_table import regressions
from tirelog.tables.frame import frame_of, table_parts
from tirelog.version import __version__
from tirelog.vocabulary.columns import OPTIONAL, TABLES

Progress = Callable[[str], None]
_COMMANDS = ("speed", "footprint", "dissipation", "phase-shift")


def build(
    recordings: Sequence[Recording], asked: ReportRequest, progress: Progress = lambda text: None
) -> Report:
    """The report on `recordings`.

    UsageError, ModelError: a file that was given with an option cannot be used.
    """
    tables = given_tables(asked.tables, asked.campaign)
    climbed = read_ladder(asked.ladder) if asked.ladder else None
    # before the tables, which may take minutes: a model that cannot be read is told at once
    model = load_model(asked.model, effects=asked.effects) if asked.model else None
    if model is not None:
        deque(once_each(recordings, model.observables, asked.channel, []), maxlen=0)
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    made_by = f"Made on {now} by tirelog {__version__}"
    report = Report(_title(recordings, asked), made=made_by)
    colours = LogColours(recording.log for recording in recordings)
    look = asked.command("info")
    if recordings:
        report.sections.append(sections.recorded(recordings, look, colours))
    else:
        report.missing.append(("what was recorded, and the signals: no log was given", look))
    if asked.campaign is not None:
        report.sections.append(
            sections.campaign(asked.campaign / "summary.csv", "tirelog campaign run MANIFEST")
        )
    seen = _tables(report, recordings, tables, asked, progress, colours)
    told: list[Section] = []
    if asked.campaign is not None and asked.model is None:
        for made, missing in model_pages(asked.campaign):
            told += made
            report.missing += missing
    if not told or climbed is not None:
        told += _models(report, recordings, climbed, asked, model, progress, colours, seen)
    answers = [section for section in told if section.card is not None]
    if not answers:
        answers = [without_a_model(seen, asked, "What is known of a model stands below.")]
    details = [section for section in told if section.card is None]
    report.sections[:0] = [*answers, *details]
    report.papers += used_papers(report.sections)
    report.commands += dict.fromkeys(
        [*(section.command for section in report.sections), asked.report_command()]
    )
    report.provenance += _provenance(recordings, asked)
    return report


def _title(recordings: Sequence[Recording], asked: ReportRequest) -> str:
    tires = list(dict.fromkeys(r.setup.tire.name for r in recordings if r.setup.tire.name))
    names = list(sections.short_names([r.log for r in recordings]).values()) or [
        str(asked.campaign)
    ]
    logs = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
    return f"{', '.join(tires) or ('Tire' if recordings else 'Campaign')}: {logs}"


def _tables(
    report: Report,
    recordings: Sequence[Recording],
    tables: SourceTables,
    asked: ReportRequest,
    progress: Progress,
    colours: LogColours,
) -> list[tuple[str, str]]:
    """A section of each table.

    What was measured, and the first sentence of each section by its title.
    """
    speed: pd.DataFrame | None = None
    first = len(report.sections)
    ready = _made_together([n for n in _COMMANDS if n not in tables.files], recordings, progress)
    for name in _COMMANDS:
        command = asked.command(name)
        lines: pd.DataFrame | None = None
        remarks: list[str] = []
        table = tables.get(name)
        try:
            if table is None:
                made = ready.pop(name, None) or made_tables([name], recordings)[name]
                table, lines, remarks = made.table, made.regressions, made.remarks
                del made  # the table goes as soon as it is drawn
            elif name == "dissipation":
                lines = tables.get("dissipation-fit")
        except TirelogError as problem:
            report.missing.append((f"{name}: {problem}", command))
            continue
        if table is None or not len(table):
            why = "no channel for it" if table is None else "no passage was found"
            seen = asked.command("info") if table is None else command
            report.missing.append((f"{name}: {why}", seen))
            continue
        if name == "speed":
            report.sections.append(
                sections.drive_section(recordings, table, command, remarks, colours)
            )
            speed = table.loc[
                _first(table, recordings), ["log", "channel", "revolution", "acceleration_m_s2"]
            ]
            del table  # an hour of 16 gratings is half a million rows
        elif name == "footprint":
            passage = [
                f
                for recording in recordings[:1]
                for f in sections.passage_figures(recording, table, speed, colours(recording.log))
            ]
            report.sections.append(
                sections.footprint_section(table, command, remarks, colours, passage)
            )
        elif name == "dissipation":
            report.sections.append(
                sections.dissipation_section(table, command, remarks, colours, lines)
            )
            if lines is None:
                report.missing.append(
                    (
                        "dissipation: the regressions on speed (give the file with --table)",
                        asked.command(name, "--fit", "-o", "fit.csv"),
                    )
                )
        else:
            _phase_shift(report, table, command, remarks, asked, colours)
    measured = [(section.title, section.text[0]) for section in report.sections[first:]]
    return [("Measured", sections.measured_on(recordings)), *measured] if recordings else measured


def _made_together(
    names: Sequence[str], recordings: Sequence[Recording], progress: Progress
) -> dict[str, MadeTable]:
    """The tables that no file gives; none if one of them cannot be made, to be asked each alone."""
    progress(f"making the tables {', '.join(names)}")
    try:
        return made_tables(names, recordings)
    except TirelogError:
        return {}


def _first(table: pd.DataFrame, recordings: Sequence[Recording]) -> pd.Series:
    """True for the rows of the first log, of which a passage is shown."""
    return table["log"] == (recordings[0].log if recordings else "")


def _phase_shift(
    report: Report,
    table: pd.DataFrame,
    command: str,
    remarks: Sequence[str],
    asked: ReportRequest,
    colours: LogColours,
) -> None:
    """The section, and what a calibration would add to it."""
    report.sections.append(sections.phase_shift_section(table, command, remarks, colours))
    wanted = {
        "phase_shift_corrected_deg": "the corrected shift (P4 Figs. 11 to 13)",
        "vertical_force_N": "forces by the calibration's maps",
    }
    absent = [
        what
        for column, what in wanted.items()
        if column not in table or not table[column].notna().any()
    ]
    if absent:
        again = asked.command("phase-shift", "--calibration", "CALIBRATION.toml", "-o", "phase.csv")
        report.missing.append(
            (f"phase shift: {' and '.join(absent)} (give the table with --table)", again)
        )


def _models(
    report: Report,
    recordings: Sequence[Recording],
    climbed: Any,
    asked: ReportRequest,
    model: Model | None,
    progress: Progress,
    colours: LogColours,
    seen: Sequence[tuple[str, str]],
) -> list[Section]:
    """The answer, comparison, diagnosis and ladder; or why there are none."""
    ladder: list[Section] = []
    if climbed is not None:
        ladder = [ladder_section(climbed, asked.command("ladder", model=True))]
    else:
        report.missing.append(
            (
                "the ladder, the error falling to the floor (then --ladder M.ladder.json)",
                asked.command("ladder", model=True),
            )
        )
    if model is None:
        what = "the model against the measurement, the diagnosis"
        report.missing.append((f"{what} (then --model M)", asked.make_model()))
        return [without_a_model(seen, asked, NO_MODEL), *ladder]
    catalogue = catalogue_with(model.effects_file, asked=False)
    try:
        if not recordings:
            raise UsageError("no log was given")
        story = model_story(recordings, model, climbed, asked, catalogue, progress, colours)
    except TirelogError as problem:
        said = f"the model against the measurement: {problem}"
        report.missing.append((said, asked.command("compare", model=True)))
        return [without_a_model(seen, asked, f"Not shown is {said}."), *ladder]
    report.missing += story.missing
    return [story.answer, *story.before_ladder, *ladder, *story.after_ladder]


def _provenance(recordings: Sequence[Recording], asked: ReportRequest) -> list[str]:
    """Versions, and the bytes of every file that went in."""
    said = [f"tirelog {__version__}"]
    for recording in recordings:
        about = recording.provenance
        said.append(
            f"{recording.log}: {about.get('format')}, {about.get('bytes')} bytes, sha256 "
            f"{about.get('sha256')}"
        )
    for path in (asked.setup, asked.model, asked.ladder, asked.effects, *asked.tables):
        if path is not None and path.is_file():
            with path.open("rb") as stream:
                said.append(f"{path}: sha256 {hashlib.file_digest(stream, 'sha256').hexdigest()}")
    return said


# ---- Where the tables come from: nothing is read before it is asked for, and then only the columns
# that are drawn.


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
    parts: dict[str, list[pd.DataFrame]] = {name: [] for name in names}
    said: dict[str, list[str]] = {name: [] for name in names}
    lines = []
    for recording in recordings:
        wanted: dict[str, dict[str, Any]] = {
            name: {} for name in names if OF_A_DRIVE[name].suits(recording)
        }
        for part in tables_of(recording, wanted) if wanted else ():
            frame = frame_of(part.columns).drop(columns=list(_UNUSED), errors="ignore")
            parts[part.table].append(_lighter(frame, None))
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
                replace(
                    section,
                    id=f"{section.id}-{number}",
                    title=f"{section.title}: {file.parent.name}",
                    figures=[replace(f, id=f"{f.id}-{number}") for f in section.figures],
                )
                for section in sections
            ]
        yield sections, missing
