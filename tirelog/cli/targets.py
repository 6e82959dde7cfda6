"""Refusals before the work: files that could not be written, pictures that could not be drawn."""

from __future__ import annotations

from pathlib import Path


def refuse_unwritable(*paths: Path | None) -> None:
    """OutputError if a file to write cannot be written there.

    The folder of one of the files is not there, or the path is a folder itself.
    """
    import errno

    from tirelog.storage.remote import address
    from tirelog.storage.whole import output_error

    for path in paths:
        if path is None or address(str(path)) is not None:
            continue
        number = errno.EISDIR if path.is_dir() else 0 if path.parent.is_dir() else errno.ENOENT
        if number:
            raise output_error(path, OSError(number, ""))


def refuse_picture(path: Path | None) -> None:
    """UsageError: it has no picture's suffix, or matplotlib is missing.

    OutputError: its folder is not there.
    """
    if path is None:
        return
    from importlib.util import find_spec

    from tirelog.errors import UsageError
    from tirelog.plots.style import SUFFIXES

    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(
            f"--plot {path}: suffix {path.suffix!r}",
            allowed=f"allowed are {', '.join(SUFFIXES)}",
            do="rename it",
        )
    if find_spec("matplotlib") is None:
        raise UsageError(
            "--plot needs matplotlib",
            allowed="allowed without it are tables",
            do="install it: pip install 'tirelog[plot]'",
        )
    refuse_unwritable(path)
