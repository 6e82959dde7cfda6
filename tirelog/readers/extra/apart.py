"""A log that another library reads, converted in a process of its own.

    log --child process: library, limits of memory, time and disk--> file that is read here, answer

Such a library makes room for what a file says of itself, and may end the process that it runs in.
The child is given limits where the system has them, and whatever becomes of it is a sentence.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

from tirelog.errors import ReadError
from tirelog.readers.extra.formats import FORMATS, ExtraFormat
from tirelog.readers.other.converted import Converted

#: bytes of memory that a library may take beyond what it takes when it is loaded: one channel of
#: 60 million doubles, and what its scale makes of it
MEMORY_BYTES = 1 << 30
#: bytes that a log may be made, as for MATLAB's
DISK_BYTES = 1 << 33
#: seconds of the processor: a library reads some 10 MB per second; those of the start come on top
_START_SECONDS, _BYTES_PER_SECOND = 60, 1 << 20
#: bytes of the child's answer that are read; it shortens its lists itself
_ANSWER_BYTES = 1 << 16
_ENVIRONMENT = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "NUMEXPR_MAX_THREADS": "1",
    "ARROW_DEFAULT_MEMORY_POOL": "system",  # others take room ahead, which the limit would count
}


def convert(format: str, source: Path, folder: Path, log: str) -> tuple[Path, Converted]:
    """(the log as a file of the format FORMATS[format].made in `folder`, what is said of it).

    ReadError: its library is not installed, or it holds no numbers that can be read.
    """
    what = FORMATS[format]
    _check_library(what, log)
    target, answer = folder / "log.made", folder / "answer.json"
    ended = _run(what, source, target, answer)
    try:
        with answer.open("rb") as file:
            told = json.loads(file.read(_ANSWER_BYTES))
    except (OSError, ValueError):
        told = {"error": _how_it_ended(ended)}
    if "empty" in told:
        raise ReadError(
            f"is {what.name} without a log in it: {told['empty']}",
            allowed="allowed are files that hold numbers over time",
            do="export the signals themselves; if they were in it, copy it again",
            file=log,
        )
    if "error" in told:
        raise ReadError(
            f"is {what.name} that cannot be read ({told['error']})",
            allowed=f"allowed is what {what.library} reads within {MEMORY_BYTES >> 20} MB",
            do="copy it again, save it without a password, or export the signals in parts",
            file=log,
        )
    return target, Converted(
        tuple(told["losses"]), tuple(told["passed_over"]), tuple(told["remarks"]), told["start"]
    )


def _check_library(what: ExtraFormat, log: str) -> None:
    if find_spec(what.library) is None:
        raise ReadError(
            f"is {what.name}, which {what.package} reads, and that is not installed",
            allowed="read without an extra are text, MCAP, HDF5, MATLAB, Parquet, Feather and WAV",
            do=f"install it: pip install 'tirelog[{what.extra}]'",
            file=log,
        )


def _run(what: ExtraFormat, source: Path, target: Path, answer: Path) -> int:
    """The exit status of the child, which is never waited for longer than it may work."""
    seconds = _START_SECONDS + source.stat().st_size // _BYTES_PER_SECOND
    code = (
        f"import sys; sys.path[:] = {sys.path!r}; from tirelog.readers.extra.child import main; "
        "main()"
    )
    words = [what.module, str(source.resolve()), str(target), str(answer)]
    limits = [str(n) for n in (MEMORY_BYTES, DISK_BYTES, seconds)]
    try:
        return subprocess.run(
            [sys.executable, "-c", code, *words, *limits],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **_ENVIRONMENT, "TMPDIR": str(target.parent)},
            timeout=4 * seconds,
            check=False,
        ).returncode
    except subprocess.TimeoutExpired:
        return -24


def _how_it_ended(status: int) -> str:
    """What is known of a child that gave no answer."""
    if status in (-24, -9):  # SIGXCPU, SIGKILL
        return "it took too long, or too much memory"
    return f"its library ended with status {status}, as for want of memory or by a damaged file"
