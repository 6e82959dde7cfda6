"""Output files that appear whole or not at all.

with whole_file(path) as part:  write to `part` (a path beside `path`)   -> on success fsync and rename, else nothing is left
"""

from __future__ import annotations

import errno
import os
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
    errno.EISDIR: "it is a folder; give the path of a file",
    errno.EEXIST: "it is a file; give the path of a folder",
}


def output_error(path: Path | str, problem: OSError) -> OutputError:
    """An OutputError for a failed write, with advice."""
    advice = _ADVICE.get(problem.errno or 0, "give another path")
    return OutputError(f"cannot be written ({problem.strerror or problem}); {advice}", file=path)


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
        part.touch()
        yield part
        with part.open("rb+") as stream:
            os.fsync(stream.fileno())
        os.replace(part, path)
    except OSError as problem:
        if isinstance(problem, BrokenPipeError):
            raise
        raise output_error(path, problem) from problem
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
