"""From logs, tables, a model and a ladder to the page's sections, and what is missing.

Asked (paths and options) + open recordings
    --sources--> one table after the other, given or made --> sections of tables
    campaign's folder --stored--> the sections of its models
    --diagnosis--> Diagnosis --> the model against the measurement, the diagnosis; with a ladder
                                 its steps
whatever cannot be shown --> (what and why, the command that would show it)
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from typing import Any

import pandas as pd

from tirelog.data.recording import Recording
from tirelog.diagnosis.history import read_ladder
from tirelog.errors import TirelogError, UsageError
from tirelog.inference.shared_samples import once_each
from tirelog.physics.model.file import load_model
from tirelog.physics.model.model import Model
from tirelog.report.figures import LogColours
from tirelog.report.page import Report, Section
from tirelog.report.request import ReportRequest
from tirelog.report.sections import models as model_sections
from tirelog.report.sections import recorded as sections
from tirelog.report.sections import tables as table_sections
from tirelog.report.sections.answer import NO_MODEL, without_a_model
from tirelog.report.sections.recorded import passage_figures
from tirelog.report.sources import (
    MadeTable,
    SourceTables,
    given_tables,
    made_tables,
    model_pages,
    used_papers,
)
from tirelog.version import __version__

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
    report = Report(_title(recordings, asked), made=_made())
    colours = LogColours(recording.log for recording in recordings)
    if recordings:
        report.sections.append(sections.recorded(recordings, asked.command("info"), colours))
    else:
        report.missing.append(
            ("what was recorded, and the signals: no log was given", asked.command("info"))
        )
    if asked.campaign is not None:
        report.sections.append(
            table_sections.campaign(asked.campaign / "summary.csv", "tirelog campaign run MANIFEST")
        )
    seen = _tables(report, recordings, tables, asked, progress, colours)
    pages = (
        list(model_pages(asked.campaign))
        if asked.campaign is not None and asked.model is None
        else []
    )
    told: list[Section] = []
    for made, missing in pages:
        told += made
        report.missing += missing
    if not pages or climbed is not None:
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


def _made() -> str:
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    return f"Made on {now} by tirelog {__version__}"


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
                for f in passage_figures(recording, table, speed, colours(recording.log))
            ]
            report.sections.append(
                table_sections.footprint_section(table, command, remarks, colours, passage)
            )
        elif name == "dissipation":
            report.sections.append(
                table_sections.dissipation_section(table, command, remarks, colours, lines)
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
    report.sections.append(table_sections.phase_shift_section(table, command, remarks, colours))
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
        ladder = [model_sections.ladder_section(climbed, asked.command("ladder", model=True))]
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
    from tirelog.physics.model.user_effects import catalogue_with
    from tirelog.report.sections.diagnosed import model_story

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
    import hashlib

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
