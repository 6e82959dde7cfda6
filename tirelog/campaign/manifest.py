"""The manifest of a campaign.

Which logs, with which setups and conditions, become which tables and are held against which models.

```toml
[campaign]
name = "spring 2026"
output = "results"                 # relative to the manifest

[[logs]]
glob = "logs/wet/*.csv.gz"         # relative to the manifest
setup = "wet.toml"                 # optional: else the setup beside each log
conditions = "conditions.csv"      # optional: column `log` (path or name), and conditions of the
                                   # setup or tags (driver, track) per log

[tables.speed]
[tables.footprint]
cutoff = "auto"                    # the command's own options

[[models]]
file = "beam.toml"
commands = ["compare", "diagnose"]
```
"""

from __future__ import annotations

import csv
import dataclasses
import json
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from io import TextIOWrapper
from pathlib import Path
from typing import Any

from tirelog.data.setup import (
    LogConditions,
    Setup,
    load_setup,
    parse_setup,
    setup_beside,
)
from tirelog.errors import SetupError, TirelogError, UsageError
from tirelog.products import OF_A_DRIVE, checked
from tirelog.storage.schema import (
    ANYTHING,
    LINE,
    Document,
    Entries,
    FilePlace,
    OneOf,
    Table,
)
from tirelog.storage.whole import open_input, refuse_address, toml_tables, toml_text

_CONDITIONS = tuple(f.name for f in dataclasses.fields(LogConditions))


@dataclass(frozen=True)
class LogTask:
    """One log: its path, setup, partition's name and tags; then what a worker is to make of it.

    The setup has the conditions of the campaign's table put in. `problem` says why the log cannot
    be read at all (its setup does not fit, ...); it is kept as failed, and does not stop the rest.
    With the rest, which `runner.plan_tasks` puts in, it can travel to another machine.
    `observables`: whose pieces are kept. `unreached`: `problem` is not the log's own.
    """

    log: str
    name: str
    setup: Setup | None
    tags: Mapping[str, str] = field(default_factory=dict)
    problem: str = ""
    key: str = ""
    tables: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    output: str = ""
    observables: tuple[str, ...] = ()
    unreached: bool = False


@dataclass(frozen=True)
class CampaignModel:
    """A model file, what it predicts, and what to do with it over all logs."""

    file: Path
    observable: str
    commands: tuple[str, ...]


@dataclass(frozen=True)
class Campaign:
    """A whole manifest, resolved: paths are no longer relative to it.

    `remarks` tell what of it is of no use.
    """

    name: str
    output: str
    logs: tuple[LogTask, ...]
    tables: Mapping[str, Mapping[str, Any]]
    models: tuple[CampaignModel, ...]
    file: Path
    remarks: tuple[str, ...] = ()


_TABLES = {
    name: Table({option.name: ANYTHING for option in maker.table.options})
    for name, maker in OF_A_DRIVE.items()
}
_GLOB = replace(LINE, words='a pattern relative to the manifest, such as "logs/*.csv"')
_MODEL = replace(LINE, words='the path of a model file, such as "beam.toml"')
_MANIFEST = Table(
    {
        "campaign": Table({"name": LINE, "output": LINE}),
        "logs": Entries(
            Table({"glob": _GLOB, "setup": LINE, "conditions": LINE}, needed=("glob",))
        ),
        "tables": Table(_TABLES),
        "models": Entries(
            Table(
                {
                    "file": _MODEL,
                    "commands": OneOf(("compare", "diagnose", "ladder"), several=True),
                },
                needed=("file",),
            )
        ),
    }
)


def load_manifest(path: Path) -> Campaign:
    """The manifest at `path`.

    UsageError: not TOML, an unknown key or option, no log matches, two logs with one name, a row of
    conditions that cannot be taken. SetupError: a calibration that is none. A log whose setup does
    not fit is no error here.
    """
    text = toml_text(path, UsageError, what="a manifest", advice="give its path")
    document = Document(text, UsageError, "a manifest", path)
    data, place, base = document.read(_MANIFEST), FilePlace(document), path.parent
    about = data.get("campaign", {})
    wanted = _tables(data.get("tables", {}), base, path)
    conditions: dict[str, dict[str, _Row]] = {}
    logs = tuple(
        log
        for number, entry in enumerate(data.get("logs", ()))
        for log in _logs(entry, place / "logs" / number, base, conditions)
    )
    models = tuple(
        _model(entry, place / "models" / number, base)
        for number, entry in enumerate(data.get("models", ()))
    )
    place.refuse(
        (
            not logs,
            "",
            "matches no log",
            "each [[logs]] has a glob relative to the manifest",
            "correct the glob",
        ),
        (
            not wanted and not models,
            "",
            "asks for nothing",
            f"allowed are [tables.NAME] ({', '.join(OF_A_DRIVE)}) and [[models]]",
            "add one",
        ),
    )
    _refuse_twins("logs", ((log.name, log.log) for log in logs), "narrow the globs", place)
    files = ((model.file.stem, model.file) for model in models)
    _refuse_twins("models", files, "rename one", place)
    output = about.get("output", "results")
    remarks = []
    for rows in conditions.values():
        if left := [name for name, row in rows.items() if not row.logs]:
            more = f" and {len(left) - 3} more" if len(left) > 3 else ""
            said = f"{rows[left[0]].file}: no log is called {', '.join(left[:3])}{more}"
            remarks.append(f"{said}: what it says of them is unused")
    refuse_address(output)
    return Campaign(
        about.get("name", path.stem), str(base / output), logs, wanted, models, path, tuple(remarks)
    )


def _tables(wanted: dict[str, dict[str, Any]], base: Path, file: Path) -> dict[str, dict[str, Any]]:
    """The wanted tables with their options, whose paths are relative to `base` no longer."""
    for name, options in wanted.items():
        for option in OF_A_DRIVE[name].table.options:
            value = options.get(option.name)
            if option.kind is Path and isinstance(value, str) and option.fits(value):
                options[option.name] = str(base / value)
    try:
        checked(wanted)
    except UsageError as problem:
        raise (problem if problem.file else problem.at(file)) from None
    return wanted


def _refuse_twins(
    what: str, named: Iterable[tuple[str, object]], do: str, place: FilePlace
) -> None:
    """UsageError: two logs or two models have one name."""
    seen: dict[str, object] = {}
    for name, path in named:
        if name in seen:
            both = f"{seen[name]} and {path}"
            problem = f"two {what} have the name {name!r}: {both}"
            raise place.error(problem, "each has a name of its own", do)
        seen[name] = path


def _logs(
    entry: Mapping[str, str], place: FilePlace, base: Path, read: dict[str, dict[str, _Row]]
) -> list[LogTask]:
    """The logs of one [[logs]] entry, in the order of their paths; `read`: conditions by file."""
    pattern = entry["glob"]
    where = f"{place.table}: glob {pattern!r}"
    try:
        matching = _matches(pattern, base)
    except (ValueError, IndexError, NotImplementedError, OSError) as problem:
        raise (place / "glob").error(
            f"{where} is no pattern ({problem})", "allowed is e.g. logs/**/*.csv"
        ) from None
    found = [log for log in matching if not log.endswith((".toml", ".truth.json"))]
    if not found:
        raise (place / "glob").error(f"{where} matches no log", f"it is relative to {base}")
    shared = load_setup(base / entry["setup"]) if "setup" in entry else None
    conditions = entry.get("conditions")
    if conditions is not None and conditions not in read:
        read[conditions] = _conditions(base / conditions)
    rows = read[conditions] if conditions is not None else {}
    return [_log(log, shared, rows, base) for log in found]


def _matches(pattern: str, base: Path) -> list[str]:
    """Paths that match, in their order."""
    root = Path(Path(pattern).anchor) if Path(pattern).is_absolute() else base
    inside = str(Path(pattern).relative_to(root)) if Path(pattern).is_absolute() else pattern
    return [str(path) for path in sorted(root.glob(inside)) if path.is_file()]


def _log(log: str, shared: Setup | None, rows: Mapping[str, _Row], base: Path) -> LogTask:
    """One log with its setup and the conditions of its row."""
    inside = str(Path(log).relative_to(base)) if Path(log).is_relative_to(base) else log
    name = re.sub(r"[^\w.+-]+", "_", inside).strip("_")
    row = rows.get(inside) or rows.get(log.rsplit("/", 1)[-1])
    tags = {} if row is None else row.tags
    if row is not None:
        row.logs.append(inside)
    try:
        setup, beside = shared, setup_beside(log)
        if setup is None and beside is not None:
            setup = load_setup(beside)
        if setup is not None and row is not None:
            setup = _with_conditions(setup, row)
    except SetupError as problem:  # a log whose setup is unusable is kept as failed
        return LogTask(log, name, None, tags, str(problem))
    return LogTask(
        log,
        name,
        setup,
        tags,
        "" if setup else "no setup file beside the log and none in the manifest",
    )


@dataclass(frozen=True)
class _Row:
    """A row of a table of conditions: its place, what it says, and the logs that it is of."""

    file: Path
    line: int
    conditions: Mapping[str, float]
    tags: Mapping[str, str]
    logs: list[str] = field(default_factory=list)


#: how a table of conditions may say yes and no
_YES = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}


def _with_conditions(setup: Setup, row: _Row) -> Setup:
    """The setup with this log's conditions.

    Its text carries them too, so that a run made from it says the same. SetupError, with the row's
    place: a condition is beyond what a setup may say.
    """
    known = {k: v for k, v in dataclasses.asdict(setup.conditions).items() if v is not None}
    known |= row.conditions
    lines = [f"{k} = {json.dumps(v)}" for k, v in known.items()]
    outside = re.sub(r"(?ms)^\s*\[conditions\].*?(?=^\s*\[|\Z)", "", setup.text)
    text = outside.rstrip() + "\n\n[conditions]\n" + "\n".join(lines) + "\n"
    try:
        return parse_setup(text, setup.file)
    except SetupError as problem:  # the setup was in order without them
        raise problem.at(row.file, row.line) from None


def _conditions(path: Path) -> dict[str, _Row]:
    """The campaign's table of conditions: log -> its row.

    UsageError: it cannot be read, a cell is none of what its column may be, or a log has two rows.
    """
    try:
        with TextIOWrapper(open_input(path), "utf-8-sig", newline="") as stream:
            reader = csv.DictReader(stream)
            lines = [(reader.line_num, cells) for cells in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as problem:
        problem = getattr(problem, "strerror", None) or problem
        raise UsageError(
            f"cannot be read ({problem})",
            allowed="the conditions are a CSV with a column log",
            do="correct the path",
            file=path,
        ) from None
    if not lines or "log" not in lines[0][1]:
        raise UsageError(
            "has no column log",
            allowed="it names each row's log by path or file name",
            do="add it",
            file=path,
        )
    rows: dict[str, _Row] = {}
    for line, cells in lines:
        log = str(cells.pop("log"))
        tags = {name: cell or "" for name, cell in cells.items() if isinstance(name, str)}
        texts = {key: tags.pop(key).strip() for key in _CONDITIONS if key in tags}
        given = {key: _condition(key, text) for key, text in texts.items() if text}
        wrong = next((key for key, value in given.items() if value is None), "")
        for refused, what, allowed, do in (
            (None in cells, "has more cells than the header", "allowed is one per column", ""),
            (
                log in rows,
                f"log {log!r} has a row in line {log in rows and rows[log].line} already",
                "allowed is one row per log",
                "remove one of them",
            ),
            (
                wrong,
                f"{wrong} = {texts.get(wrong, '')[:40]!r}",
                f"allowed are {', '.join(_YES)}" if wrong == "driven" else "allowed is a number",
                "",
            ),
        ):
            if refused:
                raise UsageError(what, allowed=allowed, do=do or "correct it", file=path, line=line)
        rows[log] = _Row(path, line, {k: v for k, v in given.items() if v is not None}, tags)
    return rows


def _condition(key: str, text: str) -> float | None:
    """The value of a condition, for `driven` true or false; None if the text is none."""
    if key == "driven":
        return _YES.get(text.lower())
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _model(entry: Mapping[str, Any], place: FilePlace, base: Path) -> CampaignModel:
    """One [[models]] entry."""
    name = entry["file"]
    commands = entry.get("commands", ("compare", "diagnose"))
    observable = _observable(base / name)
    place.refuse(
        (
            isinstance(observable, list),
            "file",
            f"{place.table}: {name} is of {len(observable)} observables, which a campaign does not "
            "fit together",
            "allowed is a model of one observable",
            "make a model of each, or take `tirelog diagnose LOG... --model`",
        ),
    )
    return CampaignModel(base / name, str(observable), commands)


def _observable(path: Path) -> Any:
    """The observable in a model file; another fault of the file is found when it is used."""
    try:
        text = toml_text(path, UsageError, what="a model", advice="correct the path")
        tables = toml_tables(text, UsageError, file=path)
        return tables.get("model", {}).get("observable", "strain")
    except (TirelogError, AttributeError):
        return "strain"
