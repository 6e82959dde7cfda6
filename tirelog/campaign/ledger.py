"""What a campaign has done: one small JSON file a log, written after the log's parts; and the hashes of files that did not change.

output/.tirelog/lock               held while a run works on the folder
output/.tirelog/hashes.json        path -> (size, mtime, sha256), so that an unchanged file is not read again
output/.tirelog/done/<name>.json   Entry of a log
output/.tirelog/tmp/               temporary runs of the workers; emptied when a run begins
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from tirelog.errors import UsageError
from tirelog.files import output_error, whole_file


@dataclass
class Entry:
    """The outcome of one log's task under its key.  `error` is empty where the tables were made."""

    log: str
    name: str
    key: str
    error: str = ""
    exit_status: int = 0
    rows: dict[str, int] = field(default_factory=dict)
    quality: dict[str, dict[str, int]] = field(default_factory=dict)
    losses: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    seconds: float = 0.0
    peak_memory_MB: float = 0.0


class Ledger:
    """The folder `.tirelog` of a campaign's output."""

    def __init__(self, output: Path) -> None:
        self.output = output
        self.folder = output / ".tirelog"
        self.temporary = self.folder / "tmp"
        self._hashes: dict[str, list[Any]] | None = None

    @contextmanager
    def locked(self) -> Iterator[None]:
        """The folder for this process alone, swept of what a kill may have left.  UsageError: another run has it."""
        try:
            (self.folder / "done").mkdir(parents=True, exist_ok=True)
            lock = (self.folder / "lock").open("a+")
        except OSError as problem:
            raise output_error(self.output, problem) from problem
        with lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise UsageError(
                    "another campaign run works in this folder; one at a time is allowed; wait for it", file=self.output
                ) from None
            self._sweep()
            try:
                yield
            finally:
                self._sweep()  # a worker that died has left what it was writing

    def _sweep(self) -> None:
        """Remove what a kill left half-written."""
        shutil.rmtree(self.temporary, ignore_errors=True)
        self.temporary.mkdir()
        for part in self.output.rglob(".*.part"):
            part.unlink(missing_ok=True)

    def sha256(self, path: str) -> str:
        """The hash of a file's bytes; of a file that has not changed since it was last asked for, without reading it."""
        if self._hashes is None:
            self._hashes = dict(_load(self.folder / "hashes.json") or {})
        state = os.stat(path)
        known = self._hashes.get(path)
        if known and known[:2] == [state.st_size, state.st_mtime_ns]:
            return str(known[2])
        with open(path, "rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
        self._hashes[path] = [state.st_size, state.st_mtime_ns, digest]
        return digest

    def save_hashes(self) -> None:
        _save(self.folder / "hashes.json", self._hashes or {})

    def entry(self, name: str) -> Entry | None:
        """What is known of a log, or None (also where the file was damaged)."""
        data = _load(self.folder / "done" / f"{name}.json")
        try:
            return Entry(**data) if data else None
        except TypeError:
            return None

    def record(self, entry: Entry) -> None:
        _save(self.folder / "done" / f"{entry.name}.json", asdict(entry))

    def entries(self) -> list[Entry]:
        """All entries, in the order of their names."""
        names = sorted(path.name.removesuffix(".json") for path in (self.folder / "done").glob("*.json"))
        return [entry for name in names if (entry := self.entry(name)) is not None]


def _load(path: Path) -> Any:
    try:
        data = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError):
        return None
    return data if isinstance(data, dict) else None


def _save(path: Path, data: Any) -> None:
    with whole_file(path) as part:
        part.write_text(json.dumps(data, sort_keys=True, indent=1), "utf-8")


def key_of(sha256: str, setup_text: str, tables: Any, version: str) -> str:
    """A task's key: it changes with the log's bytes, its setup, the tables' options and tirelog's version, and with nothing else."""
    text = json.dumps([sha256, setup_text, tables, version], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()
