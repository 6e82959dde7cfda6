"""Refusals before the work: what could not be written, drawn or saved in the end.

Callbacks of options that name outputs: each gives its path back, or raises.
"""

from __future__ import annotations

import errno
import os
from pathlib import Path


def in_a_folder(path: Path | None) -> Path | None:
    """The path of a file to write.  OutputError: its folder is not there, or it is one itself."""
    from tirelog.storage.remote import address
    from tirelog.storage.whole import output_error

    if path is None or address(path) is not None:
        return path
    number = 0
    if path.is_dir():
        number = errno.EISDIR
    elif not path.parent.is_dir():
        number = errno.ENOTDIR if path.parent.exists() else errno.ENOENT
    if number:
        raise output_error(path, OSError(number, os.strerror(number)))
    return path


def folder(path: Path | None) -> Path | None:
    """The path of a folder to write into, made if missing.  OutputError: a file is in its way."""
    from tirelog.storage.remote import address
    from tirelog.storage.whole import output_error

    if path is not None and address(path) is None:
        there = next(place for place in (path, *path.absolute().parents) if place.exists())
        if not there.is_dir():
            number = errno.EEXIST if there == path else errno.ENOTDIR
            raise output_error(path, OSError(number, os.strerror(number)))
    return path


def drawable(path: Path | None) -> Path | None:
    """The path of a picture to draw.

    UsageError: it has no picture's suffix, or matplotlib is missing; OutputError as `in_a_folder`.
    """
    if path is None:
        return None
    from importlib.util import find_spec

    from tirelog.vocabulary.pictures import no_matplotlib, refuse_no_picture

    refuse_no_picture(path)
    if find_spec("matplotlib") is None:
        raise no_matplotlib()
    return in_a_folder(path)
