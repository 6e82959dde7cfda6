"""A log that another library reads, converted in a process of its own.

    log --child process: library, limits of memory, time and disk--> file that is read here, answer

Such a library makes room for what a file says of itself, and may end the process that it runs in.
The child is given limits where the system has them, and whatever becomes of it is a sentence.
"""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

from tirelog.errors import ReadError
from tirelog.readers.base import ReadReport
from tirelog.readers.other.formats import FORMATS

# ---- The process in which a library reads a log: limits first, then one conversion, then an
# answer.


#: losses, remarks, names of what is passed over, and letters of a sentence, that the answer holds
_MOST_SAID, _MOST_REMARKS, _MOST_NAMED, _MOST_LETTERS = 50, 5, 3, 300


class NoNumbers(Exception):
    """A sentence on why nothing of the log can be read."""


def one_line(sentence: object) -> str:
    """A sentence of printable letters, not too long."""
    words = " ".join(str(sentence)[: 2 * _MOST_LETTERS].split())
    return "".join(letter for letter in words if letter.isprintable())[:_MOST_LETTERS]


def limit(memory_bytes: int, disk_bytes: int, seconds: int) -> None:
    """Sets what this process may take from here on, if the system has such limits."""
    try:
        import resource
    except ImportError:
        return
    wanted = {"RLIMIT_FSIZE": disk_bytes, "RLIMIT_CPU": seconds, "RLIMIT_CORE": 0}
    with suppress(OSError, ValueError):
        status = Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
        held = next(line for line in status.splitlines() if line.startswith("VmData:"))
        wanted["RLIMIT_DATA"] = int(held.split()[1]) * 1024 + memory_bytes
    for name, most in wanted.items():
        with suppress(OSError, ValueError, AttributeError):
            kind = getattr(resource, name)
            _, hard = resource.getrlimit(kind)
            lower = most if hard == resource.RLIM_INFINITY else min(most, hard)
            resource.setrlimit(kind, (lower, hard))


def main() -> None:
    """FORMAT LOG MADE ANSWER MEMORY DISK SECONDS: converts, and writes the answer as JSON."""
    format, source, target, answer_file, *limits = sys.argv[1:]
    answer = ReadReport()
    try:
        converters = importlib.import_module("tirelog.readers.other.datasets")
        for module in FORMATS[format].imports or (FORMATS[format].library,):
            importlib.import_module(module)
        limit(*(int(most) for most in limits))
        convert = getattr(converters, f"convert_{FORMATS[format].module}")
        convert(Path(source), Path(target), answer)
        told: dict[str, object] = {
            "losses": [one_line(sentence) for sentence in answer.losses[:_MOST_SAID]],
            "remarks": [one_line(sentence) for sentence in _remarks(answer)],
            "start": answer.start,
        }
    except MemoryError:
        told = {"error": "it takes too much memory"}
    except NoNumbers as problem:
        told = {"empty": one_line("; ".join([str(problem), *answer.losses, *answer.passed_over]))}
    # libraries raise anything on a damaged file; the sentence goes to who asked
    except Exception as problem:
        told = {"error": one_line(f"{type(problem).__name__}: {problem}")}
    Path(answer_file).write_text(json.dumps(told), encoding="utf-8")


def _remarks(answer: ReadReport) -> list[str]:
    """The remarks, and one on what was passed over, if anything was."""
    some = "; ".join(answer.passed_over[:_MOST_NAMED])
    more = "; ..." if len(answer.passed_over) > _MOST_NAMED else ""
    return answer.remarks[:_MOST_REMARKS] + ([f"not read: {some}{more}"] if some else [])


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
    "ARROW_IO_THREADS": "1",
    "ARROW_DEFAULT_MEMORY_POOL": "system",  # others take room ahead, which the limit would count
}


def convert(format: str, source: Path, folder: Path, log: str) -> tuple[Path, ReadReport]:
    """(the log as a file of the format FORMATS[format].made in `folder`, the report on it).

    ReadError: its library is not installed, or it holds no numbers that can be read.
    """
    what = FORMATS[format]
    if find_spec(what.library) is None:
        raise ReadError(
            f"is {what.name}, which {what.package} reads, and that is not installed",
            allowed="read without an extra are text, MCAP, HDF5, MATLAB, Parquet, Feather and WAV",
            do=f"install it: pip install 'tirelog[{what.extra}]'",
            file=log,
        )
    target, answer = folder / "log.made", folder / "answer.json"
    ended = _run(format, source, target, answer)
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
    return target, ReadReport(**told)


def _run(format: str, source: Path, target: Path, answer: Path) -> int:
    """The exit status of the child, which is never waited for longer than it may work."""
    seconds = _START_SECONDS + source.stat().st_size // _BYTES_PER_SECOND
    code = (
        f"import sys; sys.path[:] = {sys.path!r}; "
        "from tirelog.readers.other.conversion import main; main()"
    )
    words = [format, str(source.resolve()), str(target), str(answer)]
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
