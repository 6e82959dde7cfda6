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
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tirelog.data.recording import Recording
from tirelog.diagnosis.answer import AnswerTable, plain_fields
from tirelog.diagnosis.compare import Measured, compare, comparison_of, measured_pieces, start_from
from tirelog.diagnosis.diagnose import Diagnosis, diagnose
from tirelog.diagnosis.history import read_ladder
from tirelog.diagnosis.obstacles import compare_transients
from tirelog.diagnosis.results import Comparison, effect_curves
from tirelog.errors import ModelError, TirelogError, UsageError, nearest, or_refusal
from tirelog.inference.measured import TransientLog, measured_for
from tirelog.inference.shared_samples import once_each
from tirelog.physics.effects import Effect
from tirelog.physics.model.file import load_model
from tirelog.physics.model.model import Model
from tirelog.physics.model.user_effects import catalogue_with, own_effects
from tirelog.plots.tables import holds
from tirelog.products import OF_A_DRIVE, tables_of
from tirelog.report.page import (
    Card,
    Figure,
    LogColours,
    Report,
    ReportRequest,
    Section,
    log_colours,
)
from tirelog.report.sections import models
from tirelog.report.sections import recorded as sections
from tirelog.report.sections.recorded import MadeTable
from tirelog.storage.whole import json_of
from tirelog.strain.dissipation import regressions
from tirelog.tables.frame import frame_of, table_parts
from tirelog.version import __version__
from tirelog.vocabulary.columns import OPTIONAL, TABLES

Progress = Callable[[str], None]


def build(
    recordings: Sequence[Recording],
    asked: ReportRequest,
    progress: Progress = lambda text: None,
    model: Model | None = None,
) -> Report:
    """The report on `recordings`, with a `model` in place of that of the file in `asked`.

    UsageError, ModelError: a file that was given with an option cannot be used.
    """
    tables = given_tables(asked.tables, asked.campaign)
    climbed = read_ladder(asked.ladder) if asked.ladder else None
    # before the tables, which may take minutes: a model that cannot be read is refused at once
    if model is None and asked.model:
        model = load_model(asked.model, effects=asked.effects)
    if model is not None:
        deque(once_each(recordings, model.observables, asked.channel, []), maxlen=0)
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    report = Report(_title(recordings, asked), made=f"Made on {now} by tirelog {__version__}")
    colours = log_colours(recording.log for recording in recordings)
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
        answers = [models.without_a_model(seen, asked, "What is known of a model is below.")]
    shown = first_pictures(report.sections)
    answers = [one if one.figures else replace(one, figures=shown) for one in answers]
    report.sections[:0] = [*answers, *(section for section in told if section.card is None)]
    report.papers += used_papers(report.sections)
    report.commands += dict.fromkeys(
        [*(section.command for section in report.sections), asked.report_command()]
    )
    report.provenance += _provenance(recordings, asked)
    return report


def first_pictures(sections: Sequence[Section]) -> list[Figure]:
    """The speed, and a passage with its edges: what an answer shows that has no picture."""
    drawn = [s.figures[0] for s in sections if s.figures and s.id in ("drive", "footprint")]
    return [replace(one, id=f"answer-{one.id}", half=True) for one in drawn]


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
    files: GivenTables,
    asked: ReportRequest,
    progress: Progress,
    colours: LogColours,
) -> list[tuple[str, str]]:
    """A section of each table.

    What was measured, and the first sentence of each section by its title.
    """
    first = len(report.sections)
    wanted = [name for name in sections.OF_TABLES if name not in files]
    progress(f"making the tables {', '.join(wanted)}")
    try:
        ready = made_tables(wanted, recordings)
    except TirelogError:  # which of them it is, each alone will say
        ready = {}
    for name, section in sections.OF_TABLES.items():
        command = asked.command(name)
        try:
            table, lines, remarks = _one_table(name, files, ready, recordings)
        except TirelogError as problem:
            report.missing.append((f"{name}: {problem}", command))
            continue
        if table is None or not len(table):
            found = "no channel for it" if table is None else "no passage was found"
            look = asked.command("info") if table is None else command
            report.missing.append((f"{name}: {found}", look))
            continue
        drawn = (table, lines, remarks, command, colours)
        report.sections.append(section(drawn, recordings))
        if name == "dissipation" and lines is None:
            absent = "dissipation: the regressions on speed (give the file with --table)"
            report.missing.append((absent, asked.command(name, "--fit", "-o", "fit.csv")))
        uncalibrated = [what for c, what in _CALIBRATED.items() if not holds(table, c)]
        if name == "phase-shift" and uncalibrated:
            learnt = ("--calibration", "CALIBRATION.toml", "-o", "phase.csv")
            said = f"phase shift: {' and '.join(uncalibrated)} (give the table with --table)"
            report.missing.append((said, asked.command(name, *learnt)))
        del table, drawn  # an hour of 16 gratings is half a million rows
    measured = [(section.title, section.text[0]) for section in report.sections[first:]]
    return [("Measured", sections.measured_on(recordings)), *measured] if recordings else measured


#: what only a calibration adds to phase shifts, by a column that holds it
_CALIBRATED = {
    "phase_shift_corrected_deg": "the corrected shift (P4 Figs. 11 to 13)",
    "vertical_force_N": "forces by the calibration's maps",
}


def _one_table(
    name: str, files: GivenTables, ready: dict[str, MadeTable], recordings: Sequence[Recording]
) -> MadeTable:
    """A table that was given, that is `ready`, or that is made alone."""
    if name not in files:
        return ready.pop(name, None) or made_tables([name], recordings)[name]
    lines = given_table(files, "dissipation-fit") if name == "dissipation" else None
    return given_table(files, name), lines, []


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
    climb = asked.command("ladder", model=True)
    ladder = [] if climbed is None else [models.ladder_section(climbed, climb)]
    if climbed is None:
        absent = "the ladder, the error falling to the floor (then --ladder M.ladder.json)"
        report.missing.append((absent, climb))
    if model is None:
        absent = "the model against the measurement, the diagnosis (then --model M)"
        report.missing.append((absent, asked.make_model()))
        return [models.without_a_model(seen, asked, models.NO_MODEL), *ladder]
    catalogue = catalogue_with(model.effects_file)
    try:
        if not recordings:
            raise UsageError("no log was given")
        told, missing = model_story(recordings, model, climbed, asked, catalogue, progress, colours)
    except TirelogError as problem:
        said = f"the model against the measurement: {problem}"
        report.missing.append((said, asked.command("compare", model=True)))
        return [models.without_a_model(seen, asked, f"Not shown is {said}."), *ladder]
    report.missing += missing
    return told


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


# ---- What a model says of the logs: one search for missing effects, shown in sections.
#
# recordings, Model --stacks, `diagnose`--> comparison, diagnosis
#                                           (a campaign: pieces of its logs, and what it was asked)
# + a ladder, or what the diagnosis selected --> the best model's comparison
# all of it --`answer`--> the page's first section
# logs that met an obstacle --> how well the model answers it


#: sections, and (what cannot be shown and why, the command that would show it)
Told = tuple[list[Section], list[tuple[str, str]]]


def model_story(
    recordings: Sequence[Recording],
    model: Model,
    climbed: Mapping[str, Any] | None,
    asked: ReportRequest,
    catalogue: Mapping[str, Effect],
    progress: Callable[[str], None],
    colours: LogColours | None = None,
) -> Told:
    """The sections of a model, the answer first.

    TirelogError if model and logs do not fit together.
    """
    logs = measured_for(recordings, model.observables, asked.channel, level=not model.ac_coupled)
    own = own_effects(model.effects_file)
    colours = log_colours(r.log for r in recordings) if colours is None else colours
    compared = compare(logs.revolutions, model)
    asked_of = or_refusal(diagnose)(logs.revolutions, model, effects=own, progress=progress)
    found = None if isinstance(asked_of, ModelError) else asked_of
    command = partial(asked.command, model=True)
    told, missing = story_of(
        logs.revolutions,
        compared,
        found,
        climbed,
        command,
        catalogue,
        colours,
        "" if found is None else asked.with_options(found.next_command),
    )
    if isinstance(asked_of, ModelError):
        missing.append((f"the diagnosis: {asked_of}", command("diagnose")))

    if logs.obstacles:
        try:
            told.insert(1, _obstacles(logs.obstacles, compared, command("compare"), progress))
        except TirelogError as problem:
            missing.append((f"obstacles: {problem}", command("compare")))
    if found is not None and found.next_command.startswith("tirelog propose"):
        unknown = "what is unknown, written down as a formula"
        missing.append((unknown, asked.with_options(found.next_command)))
    return told, missing


def _obstacles(
    logs: Sequence[TransientLog], compared: Comparison, command: str, progress: Progress
) -> Section:
    """The answer to the obstacles of the model that came, as `compare` gives it."""
    if compared.model.carcass != "coupled_ring":
        return models.not_answered(logs, compared.model.carcass, command)
    progress("driving the model over the obstacles")
    answers = compare_transients(logs, compared.model, unit=compared.unit)
    return models.obstacles(answers, command)


def story_of(
    measured: Measured,
    compared: Comparison,
    found: Diagnosis | None,
    climbed: Mapping[str, Any] | None,
    command: Callable[[str], str],
    catalogue: Mapping[str, Effect],
    colours: LogColours | None = None,
    next_command: str = "",
) -> Told:
    """The sections of what was found on `measured`: answer, diagnosis, ladder and comparison.

    `command(name)`: the line that repeats it; `next_command`: what to type next.
    """
    colours = log_colours(models.logs_of(compared)) if colours is None else colours
    best: Comparison | None = None
    added: Sequence[str] = () if found is None else (*found.found.came_in, *found.selected)
    missing: list[tuple[str, str]] = []
    if climbed is not None:
        top = top_of_ladder(compared.model, climbed, catalogue)
        came = [effect.id for effect in compared.model.effects]
        added = [effect.id for effect in top.effects if effect.id not in came]
        try:
            best = comparison_of(start_from(measured_pieces(measured), top)) if added else None
        except ModelError as problem:
            missing.append((f"the ladder's last model: {problem.message}", command("ladder")))
    elif found is not None and added:
        best = found.after
    curves = []
    if found is not None:
        drawn = found.selected or [effect.id for effect in found.model.effects]
        curves = effect_curves(found.found.after if found.selected else found.found.before, drawn)
    given = models.AnswerSection(compared, found, best, added, climbed, curves, catalogue)
    asked = "compare" if found is None else "diagnose"
    follows = next_command or (command("diagnose") if found is None else found.next_command)
    told = [models.answer(given, follows, command(asked), colours)]
    if found is not None:
        told.append(models.diagnosis(found, command("diagnose")))
    if climbed is not None:
        told.append(models.ladder_section(climbed, command("ladder")))
    return [*told, *models.comparisons(compared, command("compare"), colours)], missing


def top_of_ladder(
    model: Model, climbed: Mapping[str, Any], catalogue: Mapping[str, Effect]
) -> Model:
    """The model with the effects that a ladder added and the values it found.

    UsageError: an effect that nobody knows.
    """
    added = [step for step in climbed["steps"] if step["outcome"] == "added"]
    for step in added:
        name = step["effect"]
        if name in [e.id for e in model.effects]:
            continue
        if name not in catalogue:
            raise UsageError(
                f"the ladder has the effect {name!r}{nearest(name, catalogue)}, which is not "
                "known here",
                do="give it with --effects",
            )
        model = model.with_effect(catalogue[name])
    values = {
        name: p["value"]
        for step in added[-1:]
        for name, p in step["parameters"].items()
        if name in model.parameters
    }
    return model.with_values(values)


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


#: files by the command that made them, each with the log's name if the file does not hold it
GivenTables = dict[str, list[tuple[Path, str | None]]]


def given_table(files: GivenTables, kind: str) -> pd.DataFrame | None:
    """All rows of a kind, or None if none was given."""
    parts = [
        _lighter(part, log)
        for path, log in files.get(kind, ())
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


def given_tables(paths: Sequence[Path], campaign: Path | None = None) -> GivenTables:
    """The tables given with --table and those of a campaign's folder.

    UsageError: no such table, no campaign.
    """
    files: GivenTables = {}
    for path in paths:
        files.setdefault(table_kind(list(next(table_parts(path))), path), []).append((path, None))
    if campaign is None:
        return files
    if not (campaign / "summary.csv").is_file():
        raise UsageError(
            "is no campaign's output (no summary.csv in it)",
            do="give the folder that `tirelog campaign run` writes",
            file=campaign,
        )
    for kind in KINDS:
        for part in sorted(campaign.glob(f"table={kind}/log=*/part.parquet")):
            files.setdefault(kind, []).append((part, part.parent.name.removeprefix("log=")))
    return files


def made_tables(names: Sequence[str], recordings: Sequence[Recording]) -> dict[str, MadeTable]:
    """Tables of the logs that suit them, made as their commands make them, in what is drawn of it.

    Each, None if no log suits it, with the regressions on speed (of the dissipation table) and the
    remarks on it. Together, so that each channel is read and its passages are found once.
    TirelogError: one of them cannot be made.
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
    fits = {"dissipation": pd.concat(lines, ignore_index=True)} if lines else {}
    return {
        name: (_joined(own) if own else None, fits.get(name), said[name])
        for name, own in parts.items()
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
_PAPER = re.compile(r"\bP[1-4]\b")
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
        methods = [_METHODS[section.id]] if section.id in _METHODS else []
        named = ((p, name) for name, what in section.sources for p in _PAPER.findall(what))
        for paper, what in (*methods, *named):
            used[paper].append(what)
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


#: ids are in the page as they are
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
    "tables": [{"caption": str, "names": [str], "rows": [[object]], "colours?": [int]}],
    "card?": _CARD,
    "sources?": [[str]],
}


def stored(sections: Sequence[Section], missing: Sequence[tuple[str, str]]) -> dict[str, Any]:
    """The sections and what is missing as the JSON document of the file."""
    return plain_fields({"sections": [asdict(section) for section in sections], "missing": missing})


def read_stored(path: Path) -> Told:
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
    tables = [AnswerTable(**one) for one in data.pop("tables")]
    card = data.pop("card", None)
    data["sources"] = tuple((str(name), str(text)) for name, text in data.get("sources", ()))
    if not all(_ID.fullmatch(name) for name in (data["id"], *(figure.id for figure in figures))):
        raise ValueError
    answer = None if card is None else Card(**card)
    return Section(**data, figures=figures, tables=tables, card=answer)


def model_pages(campaign: Path) -> Iterator[Told]:
    """(sections, what is missing) of each model of a campaign.

    Titles and ids differ if there are several.
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
