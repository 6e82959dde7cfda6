"""What a campaign has done.

One small JSON file per log, written after the log's parts, and the hashes of files that did not
change.

In output/.tirelog:

    hashes.json                      log -> [what changes with its bytes (size, time, a store's
                                     tag), sha256]
    done/<name>.json                 Entry of a log
    means/<observable>/<name>.npz    what models need of a log, if the manifest has models
    tmp/                             temporary runs of the workers (elsewhere if the output is at
                                     an address); emptied when a run begins
"""

from __future__ import annotations

import hashlib
import io
import json
import os
from dataclasses import asdict, dataclass, field, fields
from typing import Any
from zipfile import BadZipFile

import numpy as np

from tirelog.campaign.folder import HIDDEN, Folder, json_table
from tirelog.data.recording import Conditions
from tirelog.inference.cells.pieces import Pieces
from tirelog.storage.remote import address, open_input, state_of
from tirelog.storage.whole import json_of, json_value

_DONE = f"{HIDDEN}/done/"
_HASHES = f"{HIDDEN}/hashes.json"


@dataclass
class Entry:
    """The outcome of one log's task under its key.

    `error` is empty if the tables were made; `pieces`: observable -> '' if what models need
    of the log was kept, or why it could not be. `fault`: whose the error is, "log" (recorded), or
    "output" (a full disk) or "machine" (also a store or cluster), after which the log stays open.
    """

    log: str
    name: str
    key: str
    error: str = ""
    exit_status: int = 0
    rows: dict[str, int] = field(default_factory=dict)
    quality: dict[str, dict[str, int]] = field(default_factory=dict)
    losses: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    pieces: dict[str, str] = field(default_factory=dict)
    seconds: float = 0.0
    peak_memory_MB: float = 0.0
    fault: str = "log"


class Ledger:
    """The entries in a campaign's output folder."""

    def __init__(self, folder: Folder) -> None:
        self.folder = folder
        self._hashes: dict[str, list[Any]] | None = None
        self._entries: dict[str, Entry] | None = None

    def sha256(self, log: str) -> str:
        """The hash of a log's bytes.

        A log that has not changed since it was last asked for is not read again. OSError,
        ReadError: it cannot be read.
        """
        if self._hashes is None:
            self._hashes = json_table(self.folder.read(_HASHES))
        url = address(log)
        if url is None:
            stat = os.stat(log)
            state: list[Any] = [stat.st_size, stat.st_mtime_ns]
        else:
            state = state_of(url)
        known = self._hashes.get(log)
        if isinstance(known, list) and known[:-1] == state:
            return str(known[-1])
        with open_input(log) as stream:
            digest = hashlib.sha256()
            while part := stream.read(1 << 22):
                digest.update(part)
        self._hashes[log] = [*state, digest.hexdigest()]
        return digest.hexdigest()

    def save_hashes(self) -> None:
        data = _bytes(self._hashes or {})
        if self.folder.read(_HASHES) != data:
            self.folder.write(_HASHES, data)

    def entry(self, name: str) -> Entry | None:
        """What is known of a log, or None (also if the file was damaged)."""
        if self._entries is None:
            files = [file for file in self.folder.names() if file.startswith(_DONE)]
            found = map(_entry, self.folder.read_all(files).values())
            self._entries = {entry.name: entry for entry in found if entry is not None}
        return self._entries.get(name)

    def forget(self, names: set[str]) -> None:
        """The logs are open again: their outcome and their parts are removed."""
        gone = {f"{_DONE}{name}.json" for name in names}
        self.folder.remove(
            sorted(file for file in self.folder.names() if file in gone or log_of(file) in names)
        )
        known = self._entries or {}
        for name in names & set(known):
            del known[name]

    def record(self, entry: Entry) -> None:
        self.folder.write(f"{_DONE}{entry.name}.json", _bytes(asdict(entry)))
        if self._entries is not None:
            self._entries[entry.name] = entry


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
    "exit_status": int,
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


def _bytes(data: Any) -> bytes:
    return json.dumps(data, sort_keys=True, indent=1).encode()


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


def pieces_bytes(pieces: Pieces) -> bytes:
    """The content of a file that holds the pieces."""
    arrays: dict[str, Any] = {
        f.name: getattr(pieces, f.name)
        for f in fields(Pieces)
        if f.name not in (*_WORDS, "conditions")
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
            rest = (f.name for f in fields(Pieces) if f.name not in (*_WORDS, "conditions"))
            rows = {name: arrays[name] for name in rest}
        return Pieces(**words, conditions=Conditions(**given), **rows)
    except (KeyError, TypeError, AttributeError, OSError, EOFError, BadZipFile) as problem:
        raise ValueError(str(problem)) from None
