"""Output files that appear whole or not at all.

with whole_file(path) as part:  write to `part` (a path beside `path`)   -> on success fsync and rename, else nothing is left
"""

from __future__ import annotations

import errno
import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tirelog.errors import OutputError
from tirelog.remote import address, upload

_ADVICE = {
    errno.ENOENT: "the folder has to exist; make it or give another path",
    errno.EACCES: "the folder has to be writable; give another path",
    errno.EROFS: "the file system is read-only; give another path",
    errno.ENOSPC: "the disk is full; make room or give another path",
    errno.EDQUOT: "the quota is used up; make room or give another path",
    errno.EFBIG: "no file may be so large here; raise the limit or give another path",
    errno.EISDIR: "it is a folder; give the path of a file",
    errno.EEXIST: "it is a file; give the path of a folder",
}


def output_error(path: Path | str, problem: Exception) -> OutputError:
    """An OutputError for a failed write, with advice."""
    number = _number(problem)
    what = os.strerror(number) if number else getattr(problem, "strerror", None) or problem
    return OutputError(f"cannot be written ({what}); {_ADVICE.get(number, 'give another path')}", file=path)


def _number(problem: Exception) -> int:
    """The system's error number, 0 where there is none.  HDF5 says it in its text, among pages of others."""
    told = re.search(r"errno = (\d+)", str(problem))
    return getattr(problem, "errno", None) or (int(told[1]) if told else 0)


@contextmanager
def failed_writes(path: Path | str) -> Iterator[None]:
    """What the system and HDF5 raise where `path` cannot be written becomes an OutputError."""
    try:
        yield
    except (OSError, RuntimeError) as problem:  # HDF5 raises either
        if isinstance(problem, BrokenPipeError) or (isinstance(problem, RuntimeError) and not _number(problem)):
            raise
        raise output_error(path, problem) from problem


@contextmanager
def whole_file(path: Path | str) -> Iterator[Path]:
    """A path beside `path` to write to; it takes the name `path` when the block ends well, and is removed when it does not.

    A remote address is written to a temporary file that is uploaded whole.  OutputError: folder missing or read-only, disk full.
    """
    url = address(path)
    if url is not None:
        with tempfile.TemporaryDirectory(prefix="tirelog-") as folder:
            local = Path(folder) / Path(path).name
            local.touch()
            yield local
            upload(local, url)
        return
    path = Path(path)
    if path.is_dir():
        raise output_error(path, IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR)))
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with failed_writes(path):
            part.touch()
            yield part
            with part.open("rb+") as stream:
                os.fsync(stream.fileno())
            os.replace(part, path)
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def make_folder(path: Path | str) -> None:
    """The folder for several output files, made where it is missing; a remote address needs none.  OutputError: it cannot be made."""
    if address(path) is None:
        try:
            Path(path).mkdir(parents=True, exist_ok=True)
        except OSError as problem:
            raise output_error(path, problem) from None
