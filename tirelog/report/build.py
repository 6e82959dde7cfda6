"""From logs and tables to the page: which sections there are, and what is missing.

open recordings + given tables --makers for what suits and was not given--> frames --sections--> page
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tirelog import __version__
from tirelog.columns import TABLES
from tirelog.errors import TirelogError, UsageError
from tirelog.estimators.makers import MAKERS
from tirelog.recording import Recording
from tirelog.report import sections
from tirelog.report.page import Section
from tirelog.tables import read_table

_SECTION: dict[str, Callable[[pd.DataFrame], Section]] = {
    "footprint": sections.footprint,
    "dissipation": sections.dissipation,
    "phase-shift": sections.phase_shift,
}


@dataclass
class Report:
    """What goes on the page.  `missing`: (what cannot be shown, the command that would show it)."""

    title: str
    sections: list[Section] = field(default_factory=list)
    missing: list[tuple[str, str]] = field(default_factory=list)
    provenance: list[str] = field(default_factory=list)
    commands: list[str] = field(default_factory=list)


def table_kind(columns: Sequence[str], path: Path) -> str:
    """Which command made a table, by its columns.  UsageError: none did."""
    from tirelog.columns import OPTIONAL

    for name in ("speed", "footprint", "dissipation", "phase-shift"):
        own = set(TABLES[name]) - OPTIONAL
        if own <= set(columns):
            return name
    raise UsageError(
        "is no table of speed, footprint, dissipation or phase-shift; these can be given with --table; make it anew", file=path
    )


def given_tables(paths: Sequence[Path]) -> dict[str, pd.DataFrame]:
    """The tables given with --table, by the command that made them; several of one kind are joined."""
    found: dict[str, list[pd.DataFrame]] = {}
    for path in paths:
        frame = read_table(path)
        found.setdefault(table_kind(list(frame.columns), path), []).append(frame)
    return {name: pd.concat(frames, ignore_index=True) for name, frames in found.items()}


def made_table(name: str, recordings: Sequence[Recording]) -> pd.DataFrame | None:
    """A table made by its command's own function from the logs that suit it, or None where none does."""
    parts = []
    for recording in recordings:
        if MAKERS[name].suits(recording):
            parts += [_frame(columns) for columns, _ in MAKERS[name].rows(recording, {})]
    return pd.concat(parts, ignore_index=True) if parts else None


def _frame(columns: Mapping[str, Any]) -> pd.DataFrame:
    rows = max(np.shape(v)[0] for v in columns.values() if np.ndim(v))
    return pd.DataFrame({name: np.broadcast_to(np.asarray(v), (rows,)) if np.ndim(v) == 0 else v for name, v in columns.items()})


def build(recordings: Sequence[Recording], given: Mapping[str, pd.DataFrame], setup: Path | None) -> Report:
    """The report on `recordings`, with the tables that were `given` and those that suit the logs."""
    tires = list(dict.fromkeys(r.setup.tire.name for r in recordings if r.setup.tire.name))
    logs = ", ".join(r.log for r in recordings[:3]) + (f" and {len(recordings) - 3} more" if len(recordings) > 3 else "")
    report = Report(f"{', '.join(tires) or 'Tire'}: {logs}")
    option = f" --setup {setup}" if setup else ""
    paths = " ".join(r.log for r in recordings)
    report.sections.append(sections.recorded(list(recordings)))
    for name in ("speed", *_SECTION):
        command = f"tirelog {name} {paths}{option}"
        try:
            table = given[name] if name in given else made_table(name, recordings)
        except TirelogError as problem:
            report.missing.append((f"{name}: {problem}", command))
            continue
        if table is None or not len(table):
            why = "no channel for it" if table is None else "no passage was found"
            report.missing.append((f"{name}: {why}", command))
            continue
        report.sections.append(sections.drive(list(recordings), table) if name == "speed" else _SECTION[name](table))
        report.commands.append(command)
    report.provenance.append(f"tirelog {__version__}")
    for recording in recordings:
        about = recording.provenance
        report.provenance.append(f"{recording.log}: {about.get('format')}, {about.get('bytes')} bytes, sha256 {about.get('sha256')}")
    return report
