"""The manifest of a campaign.

Which logs, with which setups and conditions, become which tables and are held against which models.

```toml
[campaign]
name = "spring 2026"
output = "results"                 # relative to the manifest, or an address (s3://bucket/folder)

[[logs]]
glob = "logs/wet/*.csv.gz"         # relative to the manifest, or an address
setup = "wet.toml"                 # optional: else the setup beside each log
conditions = "conditions.csv"      # optional: column `log` (path or name), and conditions of the
                                   # setup or tags (driver, track) per log

[tables.speed]
[tables.footprint]
cutoff = "auto"                    # the command's own options

[[models]]
file = "beam.toml"
commands = ["compare", "diagnose"]
each = "tire"                      # optional: diagnose each tire, or "log", alone and without it
```
"""

from __future__ import annotations

import csv
import dataclasses
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from io import TextIOWrapper
from pathlib import Path
from typing import Any

from tirelog.data.setup import LogConditions, Setup, load_setup, parse_setup, setup_beside
from tirelog.errors import SetupError, TirelogError, UsageError, refuse_unknown
from tirelog.products import OF_A_DRIVE, checked
from tirelog.storage.documents import toml_tables, toml_text
from tirelog.storage.remote import address, match_remote, open_input, read_remote

_SECTIONS = ("campaign", "logs", "tables", "models")
_CONDITIONS = tuple(f.name for f in dataclasses.fields(LogConditions))
MODEL_COMMANDS = ("compare", "diagnose", "ladder")
EACH = ("log", "tire")


@dataclass(frozen=True)
class CampaignLog:
    """One log: its path, setup, partition's name and tags.

    The setup has the conditions of the campaign's table put in.

    `problem` says why it cannot be read at all (its setup does not fit, ...); it is kept as failed,
    and does not stop the rest.
    """

    path: str
    name: str
    setup: Setup | None
    tags: Mapping[str, str] = field(default_factory=dict)
    problem: str = ""


@dataclass(frozen=True)
class CampaignModel:
    """A model file, what it predicts, and what to do with it over all logs.

    `each`: "log" or "tire" if each is to be diagnosed alone, and be left out, too.
    """

    file: Path
    observable: str
    commands: tuple[str, ...]
    each: str = ""


@dataclass(frozen=True)
class Campaign:
    """A whole manifest, resolved: paths are no longer relative to it.

    `remarks` tell what of it is of no use.
    """

    name: str
    output: str
    logs: tuple[CampaignLog, ...]
    tables: Mapping[str, Mapping[str, Any]]
    models: tuple[CampaignModel, ...]
    file: Path
    remarks: tuple[str, ...] = ()


def _refuse(file: Path, what: str, allowed: str, *, do: str = "mend it") -> UsageError:
    """The error of a manifest."""
    return UsageError(what, allowed=allowed, do=do, file=file)


def _keys(data: Any, allowed: tuple[str, ...], where: str, file: Path) -> dict[str, Any]:
    """`data` as a table with no other keys than `allowed`."""
    if not isinstance(data, dict):
        raise _refuse(file, f"{where} is not a table", f"allowed are {', '.join(allowed)} under it")
    for key in data:
        said = f"unknown key {key!r} in {where}"
        refuse_unknown(key, allowed, said, do="mend or remove it", file=file)
    return data


def load_manifest(path: Path) -> Campaign:
    """The manifest at `path`.

    UsageError: not TOML, an unknown key or option, no log matches, two logs with one name, a row of
    conditions that cannot be taken. SetupError: a calibration that is none. A log whose setup does
    not fit is no error here.
    """
    data = _keys(_toml(path, "a manifest", "give its path"), _SECTIONS, "the manifest", path)
    about = _keys(data.get("campaign", {}), ("name", "output"), "[campaign]", path)
    base = path.parent
    wanted = _tables(data.get("tables", {}), base, path)
    conditions: dict[str, dict[str, _Row]] = {}
    logs = tuple(
        log
        for where, entry in _entries(data, "logs", path)
        for log in _logs(entry, where, base, path, conditions)
    )
    _distinct(logs, path)
    models = tuple(
        _model(entry, where, base, path) for where, entry in _entries(data, "models", path)
    )
    if not wanted and not models:
        raise _refuse(
            path,
            "asks for nothing",
            f"allowed are [tables.NAME] ({', '.join(OF_A_DRIVE)}) and [[models]]",
            do="add one",
        )
    _distinct_models(models, path)
    output = _text(about, "output", "[campaign]", path) or "results"
    name = _text(about, "name", "[campaign]", path) or path.stem
    remarks = tuple(remark for rows in conditions.values() for remark in _of_no_log(rows))
    place = address(output) or str(base / output)
    return Campaign(name, place, logs, wanted, models, path, remarks)


def _toml(path: Path, what: str, advice: str) -> dict[str, Any]:
    """The tables in a TOML file.  UsageError: it cannot be read, is no TOML, or goes too far."""
    return toml_tables(toml_text(path, UsageError, what=what, advice=advice), UsageError, file=path)


def _entries(data: Mapping[str, Any], name: str, file: Path) -> list[tuple[str, Any]]:
    """The [[`name`]] entries, each with how an error calls it."""
    entries = data.get(name, [])
    if not isinstance(entries, list):
        raise _refuse(
            file,
            f"{name} is not a list of tables",
            f"allowed are entries that begin with [[{name}]]",
        )
    return [(f"[[{name}]] number {number}", entry) for number, entry in enumerate(entries, 1)]


def _text(table: Mapping[str, Any], key: str, where: str, file: Path) -> str | None:
    """The text under `key`, None if it is not there.

    UsageError: it is no text, empty, or holds control characters.
    """
    value = table.get(key)
    if value is not None and (
        not isinstance(value, str) or not value.strip() or not value.isprintable()
    ):
        raise _refuse(file, f"{where}: {key} is not text of one line", "allowed is text in quotes")
    return value


def _tables(data: Any, base: Path, file: Path) -> dict[str, dict[str, Any]]:
    """The wanted tables with their options, whose paths are relative to `base` no longer."""
    wanted = _keys(data, tuple(OF_A_DRIVE), "[tables]", file)
    for name, options in wanted.items():
        maker = OF_A_DRIVE[name]
        _keys(options, maker.options, f"[tables.{name}]", file)
        for option in maker.table.options:
            value = options.get(option.name)
            if option.kind is Path and isinstance(value, str) and option.fits(value):
                options[option.name] = str(base / value)
    try:
        checked(wanted)
    except UsageError as problem:
        raise (problem if problem.file else problem.at(file)) from None
    return wanted


def _distinct(logs: tuple[CampaignLog, ...], path: Path) -> None:
    if not logs:
        raise _refuse(
            path,
            "matches no log",
            "each [[logs]] has a glob relative to the manifest",
            do="mend the glob",
        )
    seen: dict[str, str] = {}
    for log in logs:
        if log.name in seen:
            raise _refuse(
                path,
                f"two logs have the name {log.name!r}: {seen[log.name]} and {log.path}",
                "a name stands for one log",
                do="narrow the globs",
            )
        seen[log.name] = log.path


def _distinct_models(models: tuple[CampaignModel, ...], path: Path) -> None:
    seen: dict[str, Path] = {}
    for model in models:
        if model.file.stem in seen:
            raise _refuse(
                path,
                f"two models have the name {model.file.stem!r}: {seen[model.file.stem]} and "
                f"{model.file}",
                "one is allowed",
                do="rename one",
            )
        seen[model.file.stem] = model.file


def _logs(
    entry: Any, where: str, base: Path, file: Path, read: dict[str, dict[str, _Row]]
) -> list[CampaignLog]:
    """The logs of one [[logs]] entry, in the order of their paths; `read`: conditions by file."""
    _keys(entry, ("glob", "setup", "conditions"), where, file)
    pattern = _text(entry, "glob", where, file)
    if pattern is None:
        raise _refuse(
            file,
            f"{where} has no glob",
            "allowed is a pattern relative to the manifest",
            do='add glob = "logs/*.csv"',
        )
    setup, conditions = _text(entry, "setup", where, file), _text(entry, "conditions", where, file)
    try:
        matching = _matches(pattern, base)
    except (ValueError, IndexError, NotImplementedError, OSError) as problem:
        raise _refuse(
            file,
            f"{where}: glob {pattern!r} is no pattern ({problem})",
            "allowed is e.g. logs/**/*.csv",
        ) from None
    found = [log for log in matching if not log.endswith((".toml", ".truth.json"))]
    if not found:
        raise _refuse(
            file,
            f"{where}: glob {pattern!r} matches no log",
            f"it is relative to {base}, or an address",
        )
    shared = _setup(setup, base) if setup is not None else None
    if conditions is not None and conditions not in read:
        read[conditions] = _conditions(base / conditions)
    rows = read[conditions] if conditions is not None else {}
    return [_log(log, shared, rows, base) for log in found]


def _matches(pattern: str, base: Path) -> list[str]:
    """Paths (or addresses) that match, in their order."""
    url = address(pattern)
    if url is not None:
        return match_remote(url)
    root = Path(Path(pattern).anchor) if Path(pattern).is_absolute() else base
    inside = str(Path(pattern).relative_to(root)) if Path(pattern).is_absolute() else pattern
    return [str(path) for path in sorted(root.glob(inside)) if path.is_file()]


def _setup(place: str, base: Path) -> Setup:
    """The setup at a path relative to the manifest, or at an address."""
    url = address(place)
    if url is None:
        return load_setup(base / place)
    data = read_remote(url)
    if data is None:
        raise SetupError(
            "is not there", allowed="a setup is a TOML file", do="give another address", file=url
        )
    return parse_setup(data.decode("utf-8-sig", errors="replace"), url)


def _setup_beside(log: str) -> Setup | None:
    """The setup of a log's own name beside it, or None."""
    url = address(log)
    if url is None:
        beside = setup_beside(log)
        return load_setup(beside) if beside is not None else None
    folder, _, name = url.rpartition("/")
    stems = [name[:at] for at in range(len(name) - 1, 0, -1) if name[at] == "."]
    for stem in stems:
        if (data := read_remote(f"{folder}/{stem}.toml")) is not None:
            return parse_setup(data.decode("utf-8-sig", errors="replace"), f"{folder}/{stem}.toml")
    return None


def _log(log: str, shared: Setup | None, rows: Mapping[str, _Row], base: Path) -> CampaignLog:
    """One log with its setup and the conditions of its row."""
    inside = (
        str(Path(log).relative_to(base))
        if address(log) is None and Path(log).is_relative_to(base)
        else log
    )
    name = re.sub(r"[^\w.+-]+", "_", inside).strip("_")
    row = rows.get(inside) or rows.get(log.rsplit("/", 1)[-1])
    tags = {} if row is None else {k: v for k, v in row.cells.items() if k not in _CONDITIONS}
    if row is not None:
        row.logs.append(inside)
    try:
        setup = shared if shared is not None else _setup_beside(log)
        if setup is not None and row is not None:
            setup = _with_conditions(setup, row)
    except SetupError as problem:  # a log whose setup is unusable is kept as failed
        return CampaignLog(log, name, None, tags, str(problem))
    return CampaignLog(
        log,
        name,
        setup,
        tags,
        "" if setup else "no setup file beside the log and none in the manifest",
    )


@dataclass(frozen=True)
class _Row:
    """A row of a table of conditions: the cells beside `log`, and the logs that they are of."""

    file: Path
    line: int
    cells: Mapping[str, str]
    logs: list[str] = field(default_factory=list)

    def refuse(self, what: str, allowed: str, do: str = "mend it") -> UsageError:
        return UsageError(what, allowed=allowed, do=do, file=self.file, line=self.line)


#: how a table of conditions may say yes and no
_YES = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}


def _with_conditions(setup: Setup, row: _Row) -> Setup:
    """The setup with this log's conditions.

    Its text carries them too, so that a run made from it says the same. SetupError, with the row's
    place: a condition is beyond what a setup may say.
    """
    told = {key: text for key in _CONDITIONS if (text := row.cells.get(key, "")) != ""}
    given = {
        key: _YES[text.strip().lower()] if key == "driven" else float(text)
        for key, text in told.items()
    }
    known = {k: v for k, v in dataclasses.asdict(setup.conditions).items() if v is not None} | given
    lines = [
        f"{k} = {str(v).lower() if isinstance(v, bool) else repr(v)}" for k, v in known.items()
    ]
    outside = re.sub(r"(?ms)^\s*\[conditions\].*?(?=^\s*\[|\Z)", "", setup.text)
    text = outside.rstrip() + "\n\n[conditions]\n" + "\n".join(lines) + "\n"
    try:
        return parse_setup(text, setup.file)
    except SetupError as problem:  # the setup was in order without them
        raise problem.at(row.file, row.line) from None


def _of_no_log(rows: Mapping[str, _Row]) -> list[str]:
    """A sentence if rows of a table of conditions are those of no log."""
    left = [name for name, row in rows.items() if not row.logs]
    if not left:
        return []
    more = f" and {len(left) - 3} more" if len(left) > 3 else ""
    file = rows[left[0]].file
    return [f"{file}: no log is called {', '.join(left[:3])}{more}: what it says of them is unused"]


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
            do="mend the path",
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
        row = _Row(path, line, {k: v or "" for k, v in cells.items() if isinstance(k, str)})
        if None in cells:
            raise row.refuse("has more cells than the header", "allowed is one per column")
        if log in rows:
            raise row.refuse(
                f"log {log!r} has a row in line {rows[log].line} already",
                "allowed is one row per log",
                do="remove one of them",
            )
        _refuse_cells(row)
        rows[log] = row
    return rows


def _refuse_cells(row: _Row) -> None:
    """UsageError: a condition is no number, or `driven` neither yes nor no."""
    for key in _CONDITIONS:
        text = row.cells.get(key, "")
        if key == "driven":
            fits, allowed = text.strip().lower() in ("", *_YES), f"allowed are {', '.join(_YES)}"
        else:
            fits, allowed = not text or _finite(text), "allowed is a number"
        if not fits:
            raise row.refuse(f"{key} = {text[:40]!r}", allowed)


def _finite(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _model(entry: Any, where: str, base: Path, file: Path) -> CampaignModel:
    _keys(entry, ("file", "commands", "each"), where, file)
    each = _text(entry, "each", where, file) or ""
    if each not in ("", *EACH):
        raise _refuse(
            file,
            f"{where}: each = {each[:40]!r}",
            f"allowed are {', '.join(EACH)}",
        )
    commands = entry.get("commands", ["compare", "diagnose"])
    if not isinstance(commands, list) or not commands:
        raise _refuse(
            file,
            f"{where}: commands is not a list",
            f"allowed are {', '.join(MODEL_COMMANDS)} in one",
        )
    for command in commands:
        said = f"{where}: command {str(command)[:40]!r}"
        refuse_unknown(command, MODEL_COMMANDS, said, file=file)
    name = _text(entry, "file", where, file)
    if name is None:
        raise _refuse(
            file,
            f"{where} has no file",
            "allowed is the path of a model file",
            do='add file = "beam.toml"',
        )
    path = base / name
    observable = _observable(path)
    if isinstance(observable, list):
        raise _refuse(
            file,
            f"{where}: {name} is of {len(observable)} observables, which a campaign does not fit "
            "together",
            "allowed is a model of one observable",
            do="make a model of each, or take `tirelog diagnose LOG... --model`",
        )
    if each and "diagnose" not in commands:
        raise _refuse(
            file,
            f"{where}: each without diagnose among its commands",
            "each log or tire is diagnosed",
            do='add "diagnose", or remove each',
        )
    return CampaignModel(path, str(observable), tuple(commands), each)


def _observable(path: Path) -> Any:
    """What the model file says it predicts; what else is wrong with it is said when it is used."""
    try:
        return _toml(path, "a model", "mend the path").get("model", {}).get("observable", "strain")
    except (TirelogError, AttributeError):
        return "strain"
