"""A log that another library reads, converted in a process of its own.

    log --child process: library, limits of memory, time and disk--> file that is read here, answer

Such a library makes room for what a file says of itself, and may end the process that it runs in.
The child is given limits where the system has them, and whatever becomes of it is a sentence.
"""

from __future__ import annotations

import importlib
import json
import os
import re
import subprocess
import sys
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from tirelog.errors import ReadError
from tirelog.readers.base import Converted

# ---- The process in which a library reads a log: limits first, then one conversion, then an
# answer.


#: sentences of a kind, and letters of one, that the answer holds
_MOST_SAID, _MOST_LETTERS = 50, 300


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
    answer = Converted()
    try:
        converters = importlib.import_module("tirelog.readers.other.datasets")
        for module in FORMATS[format].imports or (FORMATS[format].library,):
            importlib.import_module(module)
        if format == "Feather":
            converters.start_arrow()
        limit(*(int(most) for most in limits))
        convert = getattr(converters, f"convert_{FORMATS[format].module}")
        convert(Path(source), Path(target), answer)
        told: dict[str, object] = {
            name: [one_line(sentence) for sentence in sentences[:_MOST_SAID]]
            for name, sentences in vars(answer).items()
            if name != "start"
        } | {"start": answer.start}
    except MemoryError:
        told = {"error": "it takes too much memory"}
    except NoNumbers as problem:
        told = {"empty": one_line("; ".join([str(problem), *answer.losses, *answer.passed_over]))}
    # libraries raise anything on a damaged file; the sentence goes to who asked
    except Exception as problem:
        told = {"error": one_line(f"{type(problem).__name__}: {problem}")}
    Path(answer_file).write_text(json.dumps(told), encoding="utf-8")


# ---- Which formats a library reads, which extra brings it, and what the log is made.


#: how a set of a universal file begins: -1 alone, then the number of its kind
_UFF = re.compile(rb"\s{0,80}?(?:^|\n)(?: {4}-1 *\r?\n){1,2} {0,5}\d{1,4}[bB]? *[\r\n\d]")
#: first file of a zip archive that is an office document
_OFFICE = (b"[Content_Types].xml", b"_rels/", b"docProps/", b"xl/", b"mimetype")


@dataclass(frozen=True)
class ExtraFormat:
    """A format that `convert_MODULE` in `datasets` makes the format `made`.

    `name` in sentences, `library` as it is imported, `package` and `extra` as they are installed;
    `imports` are loaded before the limits are set, if not the library alone.
    """

    name: str
    module: str
    made: str
    library: str
    package: str = ""
    extra: str = ""
    imports: tuple[str, ...] = ()


FORMATS = {
    "TDMS": ExtraFormat("a LabVIEW TDMS file", "tdms", "HDF5", "nptdms", "npTDMS", "tdms"),
    "Excel": ExtraFormat(
        "an Excel or other office document",
        "excel",
        "",
        "python_calamine",
        "python-calamine",
        "excel",
    ),
    "ROS bag": ExtraFormat(
        "a ROS bag",
        "bag",
        "MCAP",
        "rosbags",
        "rosbags",
        "ros",
        ("mcap.writer", "rosbags.rosbag1", "rosbags.rosbag2", "rosbags.typesys", "zstandard"),
    ),
    "MDF": ExtraFormat("an MDF measurement", "mdf", "HDF5", "asammdf", "asammdf", "mdf"),
    "UFF": ExtraFormat("a universal file (UFF)", "uff", "HDF5", "pyuff", "pyuff", "uff"),
    "Feather": ExtraFormat(
        "an Arrow or Feather file",
        "feather",
        "Parquet",
        "pyarrow",
        imports=("pyarrow.ipc", "pyarrow.parquet"),
    ),
    "MATLAB": ExtraFormat("a MATLAB file", "matlab", "HDF5", "scipy", imports=("scipy.io",)),
    "WAV": ExtraFormat("a WAV recording", "wav", "HDF5", "scipy", imports=("scipy.io.wavfile",)),
}


def extra_format(head: bytes) -> str:
    """The name of the format in FORMATS, by the first bytes of a log; '' if it is none."""
    for start, name in (
        (b"TDSm", "TDMS"),
        (b"MDF     ", "MDF"),
        (b"UnFinMF ", "MDF"),
        (b"#ROSBAG V", "ROS bag"),
        (b"SQLite format 3\0", "ROS bag"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "Excel"),
        (b"ARROW1\0\0", "Feather"),
    ):
        if head.startswith(start):
            return name
    if head.startswith(b"PK\3\4") and head[30:].startswith(_OFFICE):
        return "Excel"
    return "UFF" if _UFF.match(head[:400]) else ""


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
    return target, Converted(**told)


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
