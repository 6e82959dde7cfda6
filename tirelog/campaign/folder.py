"""A campaign's output folder, on this machine or at an address.

Files by their name relative to it, '/' between the parts.

    name -> `read`, `write` (whole or not at all), `remove`, `names` (what is there), `held` (this
            run's alone)

What a campaign knows of a file is whether it is there; what it may rely on is that it is whole:
`whole_file` sees to it here, and a store, which shows whole objects or is given another name first
(`remote`). Workers' temporary runs are in a folder of this machine. What a kill has left there, or
half written beside one of the campaign's files, the next run removes, and nothing else.

On this machine the folder is locked while a run works. No store has locks that end with a process:
one run at a time is the user's to see to there.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tirelog.errors import UsageError
from tirelog.storage.remote import (
    PART,
    address,
    list_remote,
    read_remote,
    read_several,
    remove_remote,
    write_remote,
)
from tirelog.storage.whole import failed_writes, json_of, output_error, whole_file, whole_name

# ---- What a campaign calls its files, and the folder of this machine in which they are made.


#: what stands in a campaign's folder beside its results
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
    """An empty folder at `temporary`.  A link in its place is removed, and not followed."""
    try:
        if temporary.is_symlink():
            temporary.unlink()
        shutil.rmtree(temporary, ignore_errors=True)
        temporary.mkdir(parents=True)
    except OSError as problem:
        raise output_error(temporary, problem) from problem


def temporary_for(url: str) -> Path:
    """The folder of this machine for a campaign's temporary runs.

    For a campaign whose results are elsewhere. It is always the same one, so that the next run
    sweeps what a kill left.
    """
    user = os.getuid() if hasattr(os, "getuid") else 0
    return (
        Path(tempfile.gettempdir())
        / f"tirelog-campaign-{user}-{hashlib.sha256(url.encode()).hexdigest()[:16]}"
    )


def folder_at(place: str | Path) -> Folder:
    """The folder at a path or an address."""
    url = address(place)
    if url is None or url.startswith("file://"):
        return LocalFolder(Path(url.removeprefix("file:/") if url else place))
    return RemoteFolder(url.rstrip("/"))


class LocalFolder:
    """A folder on this machine.

    `root`: its path; `temporary`: for the workers' temporary runs.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.root = path, str(path)
        self.temporary = path / HIDDEN / "tmp"

    @contextmanager
    def held(self) -> Iterator[None]:
        """The folder for this process alone, swept of what a kill may have left.

        The lock is the kernel's, so it does not outlive a crash. UsageError: another run has it.
        """
        hidden = self.path / HIDDEN
        try:
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
        except OSError as problem:
            raise output_error(self.path, problem) from problem
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
                    file=self.path,
                ) from None
            self._sweep()
            try:
                yield
            finally:
                self._sweep()  # a worker that died has left what it was writing

    def _sweep(self) -> None:
        swept(self.temporary)
        self.remove([name for name in self.names() if is_own(whole_name(name) or "")])

    def read(self, name: str) -> bytes | None:
        """A file's bytes, or None if it is not there."""
        try:
            return (self.path / name).read_bytes()
        except OSError:
            return None

    def read_all(self, names: Sequence[str]) -> dict[str, bytes]:
        """Several files; those that are not there are left out."""
        return {name: data for name in names if (data := self.read(name)) is not None}

    def write(self, name: str, data: bytes) -> None:
        """OutputError: it cannot be written; what stood there stands."""
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

    def remove(self, names: Sequence[str]) -> None:
        """Those that are not there are no error."""
        for name in names:
            (self.path / name).unlink(missing_ok=True)

    def names(self) -> set[str]:
        """Every file in the folder."""
        files = (Path(folder, file) for folder, _, files in os.walk(self.path) for file in files)
        return {file.relative_to(self.path).as_posix() for file in files}


class RemoteFolder:
    """A folder at the address `root`, with the same doors as `LocalFolder`."""

    def __init__(self, root: str) -> None:
        self.root, self.temporary = root, temporary_for(root)

    @contextmanager
    def held(self) -> Iterator[None]:
        """The folder, swept of what a kill may have left; nobody looks for another run."""
        self.remove([name for name in self.names() if _half_written(name)])
        swept(self.temporary)
        try:
            yield
        finally:
            swept(self.temporary)
            self.temporary.rmdir()

    def read(self, name: str) -> bytes | None:
        return read_remote(self.place(name))

    def read_all(self, names: Sequence[str]) -> dict[str, bytes]:
        found = read_several([self.place(name) for name in names])
        return {url.removeprefix(f"{self.root}/"): data for url, data in found.items()}

    def write(self, name: str, data: bytes) -> None:
        write_remote(self.place(name), data)

    def place(self, name: str) -> str:
        return f"{self.root}/{name}"

    def remove(self, names: Sequence[str]) -> None:
        remove_remote([self.place(name) for name in names])

    def names(self) -> set[str]:
        return set(list_remote(self.root))


Folder = LocalFolder | RemoteFolder


def _half_written(name: str) -> bool:
    """A file of the campaign's own under the name that `write_remote` and `upload` move from."""
    folder, _, last = name.rpartition("/")
    own = f"{folder}/{last[1 : -len(PART)]}".lstrip("/")
    return last.startswith(".") and last.endswith(PART) and is_own(own)
