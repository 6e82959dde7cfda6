"""A campaign's output folder, on this machine or at an address.

Files by their name relative to it, '/' between the parts.

    name -> `read`, `write` (whole or not at all), `remove`, `names` (what is there), `held` (this
            run's alone)

What a campaign knows of a file is whether it is there; what it may rely on is that it is whole.

At an address objects are seen whole or not at all; a store that is not one of objects gets a file
under another name, which is moved (`remote`). No store has locks that end with a process: one run
at a time is the user's to see to there.

On this machine everything is written below `.tirelog/tmp`, which is the campaign's own, and moved
to its place when it is whole. So what a kill has left is there and nowhere else: the next run
empties that one folder, and never looks at files of other programs that stand among its results.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import Any, Protocol

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
from tirelog.storage.whole import failed_writes, json_value, output_error

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


def json_of(data: bytes | None) -> dict[str, Any]:
    """A small file of ours as a table; empty if it is not there or was damaged."""
    try:
        content = json_value(data or b"{}")
    except ValueError:
        return {}
    return content if isinstance(content, dict) else {}


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
    import hashlib

    user = os.getuid() if hasattr(os, "getuid") else 0
    return (
        Path(tempfile.gettempdir())
        / f"tirelog-campaign-{user}-{hashlib.sha256(url.encode()).hexdigest()[:16]}"
    )


def _lock(descriptor: int) -> None:
    """Lock an open file for this process alone.  OSError: another one has it."""
    if sys.platform == "win32":
        import msvcrt

        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


class Folder(Protocol):
    """A campaign's output folder, wherever it is.

    `root`: path or address; `temporary`: a folder of this machine for the workers' temporary runs.
    """

    root: str
    temporary: Path

    def held(self) -> AbstractContextManager[None]:
        """The folder for this process alone, swept of what a kill may have left.

        UsageError: another run has it; at an address nobody looks for one.
        """

    def read(self, name: str) -> bytes | None:
        """A file's bytes, or None if it is not there."""

    def read_all(self, names: Sequence[str]) -> dict[str, bytes]:
        """Several files; those that are not there are left out."""

    def write(self, name: str, data: bytes) -> None:
        """OutputError: it cannot be written; what stood there stands."""

    def remove(self, names: Sequence[str]) -> None:
        """Those that are not there are no error."""

    def names(self) -> set[str]:
        """Every file in the folder."""


def folder_at(place: str | Path) -> Folder:
    """The folder at a path or an address."""
    url = address(place)
    if url is None or url.startswith("file://"):
        return LocalFolder(Path(url.removeprefix("file:/") if url else place))
    return RemoteFolder(url.rstrip("/"))


class LocalFolder:
    """A folder on this machine.

    The lock is the kernel's for this process, so it does not outlive a crash.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.root = path, str(path)
        self.temporary = _temporary_in(path)

    @contextmanager
    def held(self) -> Iterator[None]:
        hidden = self.path / HIDDEN
        try:
            hidden.mkdir(parents=True, exist_ok=True)
            _refuse_link(hidden)  # its folder tmp is emptied: never one that a link leads to
            lock = os.open(
                hidden / "lock", os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666
            )
        except OSError as problem:
            raise output_error(self.path, problem) from problem
        with os.fdopen(lock):
            try:
                _lock(lock)
            except OSError:
                raise UsageError(
                    "another campaign run works in this folder",
                    allowed="one at a time is allowed",
                    do="wait for it",
                    file=self.path,
                ) from None
            swept(self.temporary)
            try:
                yield
            finally:
                swept(self.temporary)  # a worker that died has left what it was writing

    def read(self, name: str) -> bytes | None:
        try:
            return (self.path / name).read_bytes()
        except OSError:
            return None

    def read_all(self, names: Sequence[str]) -> dict[str, bytes]:
        return {name: data for name in names if (data := self.read(name)) is not None}

    def write(self, name: str, data: bytes) -> None:
        with moved_into(self.path, name) as unmoved, failed_writes(self.path / name):
            unmoved.write_bytes(data)

    def remove(self, names: Sequence[str]) -> None:
        for name in names:
            (self.path / name).unlink(missing_ok=True)

    def names(self) -> set[str]:
        found: set[str] = set()
        for folder, _, files in os.walk(self.path):
            inside = os.path.relpath(folder, self.path)
            found |= {name if inside == "." else f"{inside}/{name}" for name in files}
        return found


class RemoteFolder:
    """A folder at the address `root`."""

    def __init__(self, root: str) -> None:
        self.root, self.temporary = root, temporary_for(root)

    @contextmanager
    def held(self) -> Iterator[None]:
        self.remove([name for name in self.names() if _half_written(name)])
        swept(self.temporary)
        try:
            yield
        finally:
            swept(self.temporary)
            self.temporary.rmdir()

    def read(self, name: str) -> bytes | None:
        return read_remote(self._at(name))

    def read_all(self, names: Sequence[str]) -> dict[str, bytes]:
        found = read_several([self._at(name) for name in names])
        return {url.removeprefix(f"{self.root}/"): data for url, data in found.items()}

    def write(self, name: str, data: bytes) -> None:
        write_remote(self._at(name), data)

    def remove(self, names: Sequence[str]) -> None:
        remove_remote([self._at(name) for name in names])

    def names(self) -> set[str]:
        return set(list_remote(self.root))

    def _at(self, name: str) -> str:
        return f"{self.root}/{name}"


def _half_written(name: str) -> bool:
    """A file of the campaign's own under the name that `write_remote` and `upload` move from."""
    folder, _, last = name.rpartition("/")
    return (
        last.startswith(".")
        and last.endswith(PART)
        and is_own(f"{folder}/{last[1 : -len(PART)]}".lstrip("/"))
    )


def _temporary_in(output: Path) -> Path:
    """Where a campaign in the folder `output` keeps what is not whole yet."""
    return output / HIDDEN / "tmp"


def _refuse_link(path: Path) -> None:
    """UsageError: `path` is a symbolic link."""
    if path.is_symlink():
        raise UsageError(
            "is a link",
            allowed="allowed is a folder of the campaign's own, which it empties",
            do="remove the link",
            file=path,
        )


@contextmanager
def moved_into(output: Path, name: str) -> Iterator[Path]:
    """A path to write to; when the block ends well, the file there becomes `name` in `output`.

    The path is in a new folder of an unpredictable name that nobody else may enter.  OutputError:
    it cannot be put there; what stood under `name` stands.
    """
    path, temporary = output / name, _temporary_in(output)
    with ExitStack() as left:
        with failed_writes(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            temporary.mkdir(parents=True, exist_ok=True)
            folder = tempfile.TemporaryDirectory(dir=temporary, ignore_cleanup_errors=True)
            unmoved = Path(left.enter_context(folder)) / path.name
        yield unmoved
        with failed_writes(path):
            with unmoved.open("rb+") as stream:
                os.fsync(stream.fileno())
            os.replace(unmoved, path)
