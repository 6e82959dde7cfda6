"""A campaign's output folder, on this machine or at an address: files by their name relative to it, '/' between the parts.

    name -> `read`, `write` (whole or not at all), `remove`, `names` (what is there), `held` (this run's alone)

What a campaign knows of a file is whether it is there; what it may rely on is that it is whole.  A folder at an address is
`campaign.remote_folder.RemoteFolder`.
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, Protocol

from tirelog.errors import UsageError
from tirelog.files import output_error, whole_file
from tirelog.remote import PART, address

#: what stands in a campaign's folder beside its results
HIDDEN = ".tirelog"


class Folder(Protocol):
    """`root`: path or address.  `temporary`: a folder of this machine for the workers' temporary runs."""

    root: str
    temporary: Path

    def held(self) -> AbstractContextManager[None]:
        """The folder for this process alone, swept of what a kill may have left.  UsageError: another run has it."""

    def check_held(self) -> None:
        """UsageError where the folder was taken over by another run."""

    def read(self, name: str) -> bytes | None:
        """A file's bytes, or None where it is not there."""

    def read_all(self, names: Sequence[str]) -> dict[str, bytes]:
        """Several files; those that are not there are left out."""

    def write(self, name: str, data: bytes) -> None:
        """OutputError: it cannot be written; what stood there stands."""

    def remove(self, names: Sequence[str]) -> None:
        """Those that are not there are no error."""

    def names(self) -> set[str]:
        """Every file in the folder."""


def json_of(data: bytes | None) -> dict[str, Any]:
    """A small file of ours as a table; empty where it is not there or was damaged."""
    try:
        content = json.loads(data or b"{}")
    except ValueError:
        return {}
    return content if isinstance(content, dict) else {}


def folder_at(place: str | Path) -> Folder:
    """The folder at a path or an address."""
    url = address(place)
    if url is None or url.startswith("file://"):
        return LocalFolder(Path(url.removeprefix("file:/") if url else place))
    from tirelog.campaign.remote_folder import RemoteFolder

    return RemoteFolder(url.rstrip("/"))


class LocalFolder:
    """A folder on this machine.  The lock is the kernel's for this process, so it does not outlive a crash."""

    def __init__(self, path: Path) -> None:
        self.path, self.root = path, str(path)
        self.temporary = path / HIDDEN / "tmp"

    @contextmanager
    def held(self) -> Iterator[None]:
        try:
            (self.path / HIDDEN).mkdir(parents=True, exist_ok=True)
            lock = (self.path / HIDDEN / "lock").open("a+")
        except OSError as problem:
            raise output_error(self.path, problem) from problem
        with lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise UsageError(
                    "another campaign run works in this folder; one at a time is allowed; wait for it", file=self.path
                ) from None
            self._sweep()
            try:
                yield
            finally:
                self._sweep()  # a worker that died has left what it was writing

    def _sweep(self) -> None:
        """Remove what a kill left half-written."""
        swept(self.temporary)
        for part in self.path.rglob(f".*{PART}"):
            part.unlink(missing_ok=True)

    def check_held(self) -> None:
        pass

    def read(self, name: str) -> bytes | None:
        try:
            return (self.path / name).read_bytes()
        except OSError:
            return None

    def read_all(self, names: Sequence[str]) -> dict[str, bytes]:
        return {name: data for name in names if (data := self.read(name)) is not None}

    def write(self, name: str, data: bytes) -> None:
        path = self.path / name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as problem:
            raise output_error(path, problem) from problem
        with whole_file(path) as part:
            part.write_bytes(data)

    def remove(self, names: Sequence[str]) -> None:
        for name in names:
            (self.path / name).unlink(missing_ok=True)

    def names(self) -> set[str]:
        found: set[str] = set()
        for folder, _, files in os.walk(self.path):
            inside = os.path.relpath(folder, self.path)
            found |= {name if inside == "." else f"{inside}/{name}" for name in files}
        return found


def swept(temporary: Path) -> None:
    """An empty folder at `temporary`."""
    shutil.rmtree(temporary, ignore_errors=True)
    try:
        temporary.mkdir(parents=True)
    except OSError as problem:
        raise output_error(temporary, problem) from problem


def temporary_for(url: str) -> Path:
    """The folder of this machine for the temporary runs of a campaign whose results are elsewhere: always the same one, so that the next
    run sweeps what a kill left."""
    import hashlib

    return Path(tempfile.gettempdir()) / f"tirelog-campaign-{os.getuid()}-{hashlib.sha256(url.encode()).hexdigest()[:16]}"
