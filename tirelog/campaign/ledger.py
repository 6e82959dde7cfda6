"""What a campaign has done.

One small JSON file per log, written after the log's parts, and the hashes of files that did not
change.

In output/.tirelog:

    hashes.json                      log -> [size, time of the last change, sha256]
    done/<name>.json                 Entry of a log
    means/<observable>/<name>.npz    what models need of a log, if the manifest has models
    tmp/                             temporary runs of the workers; emptied when a run begins

The files of the output folder are known by their name relative to it, '/' between the parts:

    name -> `read`, `write` (whole or not at all), `remove`, `names` (what is there), `held` (this
            run's alone)

What a campaign knows of a file is whether it is there; what it may rely on is that it is whole:
`whole_file` sees to it. What a kill has left among the temporary runs, or half written beside one
of the campaign's files, the next run removes, and nothing else. The folder is locked while a run
works.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
import shutil
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any, cast
from zipfile import BadZipFile

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.errors import UsageError
from tirelog.inference.cells.pieces import Pieces
from tirelog.storage.whole import (
    failed_writes,
    json_of,
    json_value,
    open_input,
    whole_file,
    whole_name,
)

# ---- What a campaign calls its files, and the folder of this machine in which they are made.


#: what is in a campaign's folder beside its results
HIDDEN = ".tirelog"


#: what a campaign writes besides, by its name in the folder
_RESULTS = re.compile(
    r"summary\.csv|table=[^/]+/log=[^/]+/part\.parquet|models/[^/]+/(page|compare|diagnose|ladder)\.json"
)


def is_own(name: str) -> bool:
    """Whether a file of the output folder is the campaign's.

    A result, or anything in its hidden folder.
    """
    return name.startswith(f"{HIDDEN}/") or _RESULTS.fullmatch(name) is not None


def json_table(data: bytes | None) -> dict[str, Any]:
    """A small file of ours as a table; empty if it is not there or was damaged."""
    try:
        return dict(json_of(data or b"{}", {str: object}))
    except ValueError:
        return {}


def swept(temporary: Path) -> None:
    """A folder at `temporary`, empty if it can be emptied.

    A link in its place is removed, and not followed.
    """
    with failed_writes(temporary):
        if temporary.is_symlink():
            temporary.unlink()
        # what cannot be removed now is removed by the next run
        shutil.rmtree(temporary, ignore_errors=True)
        temporary.mkdir(parents=True, exist_ok=True)


class Folder:
    """A campaign's output folder; its files are known by their names in it.

    `temporary`: the folder for the workers' temporary runs.
    """

    def __init__(self, place: str | Path) -> None:
        self.path = Path(place)
        self.root, self.temporary = str(place), self.path / HIDDEN / "tmp"

    @contextmanager
    def held(self) -> Iterator[None]:
        """The folder for this process alone, swept of what a kill may have left.

        UsageError: another run has it.
        """
        with _locked(self.path):
            self._sweep()
            try:
                yield
            finally:
                self._sweep()  # a worker that died has left what it was writing

    def _sweep(self) -> None:
        swept(self.temporary)
        self.remove(name for name in self.names() if is_own(whole_name(name) or ""))

    def read(self, name: str) -> bytes | None:
        """A file's bytes, or None if it is not there."""
        try:
            return (self.path / name).read_bytes()
        except OSError:
            return None

    def write(self, name: str, data: bytes) -> None:
        """OutputError: it cannot be written; the old file stays."""
        with whole_file(self.place(name)) as part, failed_writes(part):
            part.write_bytes(data)

    def place(self, name: str) -> Path:
        """Where a file is to be written, in a folder that is there."""
        path = self.path / name
        with failed_writes(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            if path.is_symlink():  # who may have put it there? its file is not ours
                path.unlink()
        return path

    def remove(self, names: Iterable[str]) -> None:
        """Those that are not there are no error."""
        for name in names:
            (self.path / name).unlink(missing_ok=True)

    def names(self) -> set[str]:
        """Every file in the folder."""
        files = (Path(folder, file) for folder, _, files in os.walk(self.path) for file in files)
        return {file.relative_to(self.path).as_posix() for file in files}


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """The folder at `path` while this process has its lock.

    The lock is the kernel's, so it does not outlive a crash. UsageError: another run has it.
    """
    hidden = path / HIDDEN
    with failed_writes(path):
        hidden.mkdir(parents=True, exist_ok=True)
        if hidden.is_symlink():
            raise UsageError(
                "is a link",
                allowed="allowed is a folder of the campaign's own, which it empties",
                do="remove the link",
                file=hidden,
            )
        flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)
        lock = os.open(hidden / "lock", flags, 0o666)
    with os.fdopen(lock):
        try:
            if sys.platform == "win32":
                import msvcrt

                msvcrt.locking(lock, msvcrt.LK_NBLCK, 1)
            else:
                import fcntl

                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise UsageError(
                "another campaign run works in this folder",
                allowed="one at a time is allowed",
                do="wait for it",
                file=path,
            ) from None
        yield


# ---- What a campaign has done.


_DONE = f"{HIDDEN}/done/"
_HASHES = f"{HIDDEN}/hashes.json"


@dataclass
class Entry:
    """The outcome of one log's task under its key.

    `error` is empty if the tables were made; `pieces`: observable -> '' if what models need
    of the log was kept, or why it could not be. `fault`: whose the error is, "log" (recorded), or
    "output" (a full disk) or "machine", after which the log stays open.
    """

    log: str
    name: str
    key: str
    error: str = ""
    rows: dict[str, int] = field(default_factory=dict)
    quality: dict[str, dict[str, int]] = field(default_factory=dict)
    losses: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    pieces: dict[str, str] = field(default_factory=dict)
    seconds: float = 0.0
    peak_memory_MB: float = 0.0
    fault: str = "log"


@dataclass
class Ledger:
    """The entries in a campaign's output folder."""

    folder: Folder

    @cached_property
    def _hashes(self) -> dict[str, list[Any]]:
        """Of each log what changes with its bytes, and their hash."""
        return json_table(self.folder.read(_HASHES))

    @cached_property
    def entries(self) -> dict[str, Entry]:
        """What is known of each log, by its name; nothing where the file was damaged."""
        files = [file for file in self.folder.names() if file.startswith(_DONE)]
        found = (_entry(self.folder.read(file) or b"") for file in files)
        return {entry.name: entry for entry in found if entry is not None}

    def sha256(self, log: str) -> str:
        """The hash of a log's bytes.

        A log that has not changed since it was last asked for is not read again. OSError: it cannot
        be read.
        """
        about = os.stat(log)
        state = [about.st_size, about.st_mtime_ns]
        known = self._hashes.get(log)
        if isinstance(known, list) and known[:-1] == state:
            return str(known[-1])
        with open_input(log) as stream:
            digest = hashlib.file_digest(cast(Any, stream), "sha256").hexdigest()
        self._hashes[log] = [*state, digest]
        return digest

    def save_hashes(self) -> None:
        data = json_bytes(self._hashes)
        if self.folder.read(_HASHES) != data:
            self.folder.write(_HASHES, data)

    def forget(self, names: set[str]) -> None:
        """The logs are open again: their outcome and their parts are removed."""
        gone = {f"{_DONE}{name}.json" for name in names}
        self.folder.remove(
            sorted(file for file in self.folder.names() if file in gone or log_of(file) in names)
        )
        for name in names:
            self.entries.pop(name, None)

    def record(self, entry: Entry) -> None:
        self.entries[entry.name] = entry
        self.folder.write(f"{_DONE}{entry.name}.json", json_bytes(asdict(entry)))


def log_of(name: str) -> str:
    """The log whose part a file of the dataset is, or ''."""
    parts = name.split("/")
    return (
        parts[1].removeprefix("log=") if len(parts) == 3 and parts[0].startswith("table=") else ""
    )


#: an entry as it is written
_ENTRY = {
    **dict.fromkeys(("log", "name", "key", "error", "fault"), str),
    "losses": [str],
    "remarks": [str],
    "rows": {str: int},
    "quality": {str: {str: int}},
    "pieces": {str: str},
    "seconds": float,
    "peak_memory_MB": float,
}


def _entry(data: bytes) -> Entry | None:
    """The entry in a file; None if it is not what was written, and its log is then read again."""
    try:
        return Entry(**json_of(data, _ENTRY))
    except (ValueError, TypeError):
        return None


def json_bytes(data: Any) -> bytes:
    """A table as a small file of ours."""
    return (json.dumps(data, indent=1) + "\n").encode()


def key_of(sha256: str, setup_text: str, tables: Any, version: str) -> str:
    """A task's key.

    It changes with the log's bytes, its setup, the tables' options and tirelog's version, and with
    nothing else.
    """
    text = json.dumps([sha256, setup_text, tables, version], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


# ---- Pieces of a log as bytes.
#
# Arrays by name, numbers and text only, nothing that is executed when it is read.
#
# Pieces -> .npz (uncompressed) -> Pieces, equal to the bit


_WORDS = ("observable", "channel", "surface", "radius_m", "logs", "notes")
#: fields that are no arrays, and those that the pieces of one channel do not need
_APART = (*_WORDS, "conditions", "member", "place_rad")


def pieces_bytes(pieces: Pieces) -> bytes:
    """The content of a file that holds the pieces."""
    arrays: dict[str, Any] = {
        f.name: getattr(pieces, f.name) for f in fields(Pieces) if f.name not in _APART
    }
    arrays |= {
        f"conditions.{f.name}": getattr(pieces.conditions, f.name) for f in fields(Conditions)
    }
    arrays["words"] = np.array(json.dumps({name: getattr(pieces, name) for name in _WORDS}))
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def read_pieces(data: bytes) -> Pieces:
    """The pieces in a file.  ValueError: it is none."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            words = json_value(str(arrays["words"]))
            words |= {name: tuple(words[name]) for name in ("logs", "notes")}
            given = {f.name: arrays[f"conditions.{f.name}"] for f in fields(Conditions)}
            rest = (f.name for f in fields(Pieces) if f.name not in _APART)
            rows = {name: arrays[name] for name in rest}
        return Pieces(**words, conditions=Conditions(**given), **rows)
    except (KeyError, TypeError, AttributeError, OSError, EOFError, BadZipFile) as problem:
        raise ValueError(str(problem)) from None
