"""Output files that appear whole or not at all, and never in the place of an input.

    with whole_file(path) as part:   write to `part`, beside `path`; on success it takes that name
    with all_or_none():              several of them take their names together
    with inputs_kept():              `taken_as_input(path)` -> no output may be that file

What is there already decides how an output takes its name: a regular file is replaced and keeps its
mode, a link is followed, a device or a pipe is written through.  Parts and temporary folders carry
the machine, the process and its start in their names, so that the next start sweeps those whose
process is gone, and nobody else's.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import platform
import re
import secrets
import shlex
import shutil
import stat
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from io import BufferedReader
from pathlib import Path
from typing import Any, BinaryIO, cast

from tirelog.errors import OUTSIDE_LOG, OutputError, TirelogError, UsageError
from tirelog.runtime import noticed_wait

_ADVICE = {
    errno.ENOENT: "the folder has to exist; make it or give another path",
    errno.EACCES: "the folder has to be writable; give another path",
    errno.EROFS: "the file system is read-only; give another path",
    **OUTSIDE_LOG,
    errno.EFBIG: "no file may be so large here; raise the limit or give another path",
    errno.EISDIR: "it is a folder; give the path of a file",
    errno.EEXIST: "it is a file; give the path of a folder",
    errno.EBADF: "it has been closed; leave it open, or give -o FILE",
}
#: bytes of an output's name that stand in its part's; the rest takes up to 70 of the system's 255
_NAME_BYTES = 160
#: machine and process namespace, process, its start, and what cannot be guessed
_OWNER = r"(?P<machine>[0-9a-f]{8})-(?P<pid>\d{1,10})-(?P<start>\d{1,20})-[0-9a-f]{16}"
_PART = re.compile(rf"\.(?P<name>.+)\.{_OWNER}\.part", re.DOTALL)
_FOLDER = re.compile(rf"tirelog-{_OWNER}")
#: paths that mean a stream that this process has open
_OWN_STREAM = re.compile(r"/(?:dev|proc/self)/fd/(\d+)")
_STREAMS = {"/dev/stdin": 0, "/dev/stdout": 1, "/dev/stderr": 2}

#: where the system has no such flag, O_EXCL alone refuses a link
_NO_FOLLOW = getattr(os, "O_NOFOLLOW", 0)

#: folders that this command has swept
_swept: set[tuple[Path, re.Pattern[str]]] = set()
_inputs: dict[tuple[int, int], str] | None = None
_batch: list[tuple[Path, Path]] | None = None
#: folders that `make_folder` made for this batch, those inside others first
_new_folders: list[Path] = []


def output_error(path: Path | str, problem: Exception) -> OutputError:
    """An OutputError for a failed write, with advice."""
    number = _number(problem)
    what = os.strerror(number) if number else getattr(problem, "strerror", None) or problem
    return OutputError(
        f"cannot be written ({what})", do=_ADVICE.get(number, "give another path"), file=path
    )


def _number(problem: Exception) -> int:
    """The system's error number, 0 if there is none.

    HDF5 says it in its text, among pages of others.
    """
    told = re.search(r"errno = (\d+)", str(problem))
    return getattr(problem, "errno", None) or (int(told[1]) if told else 0)


@contextmanager
def failed_writes(path: Path | str) -> Iterator[None]:
    """What the system and HDF5 raise if `path` cannot be written becomes an OutputError."""
    try:
        yield
    except (OSError, RuntimeError) as problem:  # HDF5 raises either
        if isinstance(problem, BrokenPipeError) or (
            isinstance(problem, RuntimeError) and not _number(problem)
        ):
            raise
        raise output_error(path, problem) from problem


# ---- names of what is not finished ---------------------------------------------------------------


@cache
def _machine() -> str:
    """Eight digits for this machine and its processes: elsewhere their numbers mean nothing."""
    told = [platform.node()]
    with suppress(OSError, UnicodeDecodeError):
        told.append(Path("/etc/machine-id").read_text())
    with suppress(OSError, UnicodeDecodeError):
        told.append(os.readlink("/proc/self/ns/pid"))
    return hashlib.sha256("\n".join(told).encode("utf-8", "surrogateescape")).hexdigest()[:8]


def _started(pid: int) -> int | None:
    """When the process began [ticks since the machine did], None if it has ended, 0 if unknown."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text(errors="replace")
    except OSError:
        return None if os.path.exists("/proc/self/stat") else 0
    state, *others = text.rpartition(")")[2].split()
    return None if state in "ZX" else int(others[18])


def _owner() -> str:
    """This process, and what cannot be guessed, as part of a name."""
    pid = os.getpid()
    return f"{_machine()}-{pid}-{_started(pid) or 0}-{secrets.token_hex(8)}"


def _cut(name: str) -> str:
    return os.fsdecode(os.fsencode(name)[:_NAME_BYTES])


def part_name(path: Path | str) -> Path:
    """A new name beside `path` for what is not finished: tells its process, cannot be guessed."""
    path = Path(path)
    return path.with_name(f".{_cut(path.name)}.{_owner()}.part")


def whole_name(path: str) -> str | None:
    """The path that a part takes when it is finished; None if the path is not that of a part."""
    folder, _, name = path.rpartition("/")
    part = _PART.fullmatch(name)
    return part and f"{folder}/{part['name']}".lstrip("/")


def _sweep(folder: Path, form: re.Pattern[str]) -> None:
    """Remove what in `folder` has a name of our `form` and no process any more.

    At a command's first output in a folder: many outputs list it once.
    """
    if (place := (folder.absolute(), form)) in _swept:
        return
    _swept.add(place)
    try:
        with os.scandir(folder) as entries:
            ours = [(entry, found) for entry in entries if (found := form.fullmatch(entry.name))]
    except OSError:
        return
    gone = []
    for entry, found in ours:
        if found["machine"] == _machine():
            now, then = _started(int(found["pid"])), int(found["start"])
            if now is None or (now != then and now > 0 and then > 0):
                gone.append(entry)  # the process of this machine that chose the name has ended
    for entry in gone:
        with suppress(OSError):
            if hasattr(os, "geteuid") and (
                entry.stat(follow_symlinks=False).st_uid != os.geteuid()
            ):
                continue
            if entry.is_dir(follow_symlinks=False):
                shutil.rmtree(entry.path, ignore_errors=True)
            else:
                os.unlink(entry.path)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """A temporary folder, removed at the end, or by the next start if this process is killed."""
    base = Path(tempfile.gettempdir())
    _sweep(base, _FOLDER)
    folder = base / f"tirelog-{_owner()}"
    with failed_writes(folder):
        folder.mkdir(mode=0o700)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


# ---- inputs --------------------------------------------------------------------------------------


#: the beginning of an address; a `Path` keeps one of the two slashes
_ADDRESS = re.compile(r"(file:(?=/)|[a-z][a-z0-9+.-]+:(?=/{1,2}[^/]))", re.IGNORECASE)
_PIPED_IN = "pipe it, as in: aws s3 cp s3://bucket/log.csv - | tirelog speed - --setup SETUP"


def refuse_address(path: Path | str, do: str = "write it here and copy it then") -> None:
    """UsageError if `path` is an address such as s3://bucket/log.csv, and what to `do` then."""
    if address := _ADDRESS.match(str(path)):  # what follows may hold a password
        raise UsageError(
            "is an address", allowed="allowed is a path", do=do, file=address[1] + "//..."
        )


def open_input(path: Path | str) -> BinaryIO:
    """The bytes of a file, opened to be read.

    "-" is standard input. It and a pipe are waited for until something writes to them, with a
    notice after two seconds.
    OSError, ValueError: there is none. UsageError: it is an address.
    """
    refuse_address(path, _PIPED_IN)
    named = Path(path)
    if path != "-" and not named.is_fifo():
        return named.open("rb")
    pipe = "standard input: is silent" if path == "-" else f"{path}: is a pipe"
    with noticed_wait(f"{pipe}; waiting for what writes to it"):
        stream = cast(BufferedReader, sys.stdin.buffer) if path == "-" else named.open("rb")
        stream.peek(1)  # until there are bytes, or whoever opened it has left
        return stream


@contextmanager
def inputs_kept() -> Iterator[None]:
    """While open (for one command), `whole_file` refuses the inputs of `taken_as_input`.

    Folders are swept anew.
    """
    global _inputs
    before, _inputs = _inputs, {}
    _swept.clear()
    try:
        yield
    finally:
        _inputs = before


def _identity(place: Path | str | int) -> tuple[int, int] | None:
    """What two names of one object share; None for what is not there, or is no regular file."""
    with suppress(OSError, ValueError):
        about = os.stat(place)
        return (about.st_dev, about.st_ino) if stat.S_ISREG(about.st_mode) else None
    return None


def taken_as_input(
    place: Path | str | int, name: str | None = None, *, edited: bool = False
) -> None:
    """Remember a regular file, by path or descriptor, as an input of this command.

    An `edited` one may be replaced by the command's output, unless it was taken as another input.
    """
    if _inputs is not None and (identity := _identity(place)) is not None:
        _inputs.setdefault(identity, "" if edited else name or str(place))


def refuse_inputs(*outputs: Path | str | int, name: str | None = None) -> None:
    """UsageError if one of the outputs, through links too, was taken as an input."""
    for output in outputs if _inputs else ():
        identity = _identity(output)
        if identity is not None and _inputs and (taken := _inputs.get(identity)):
            same = "" if taken == str(output) else f" ({taken})"
            raise UsageError(
                f"is an input of this command{same}",
                allowed="no output takes the place of an input",
                do="give another name",
                file=name or output,
            )


def refuse_one_for_two(*outputs: Path | str) -> None:
    """UsageError if two outputs of a command, through links too, are one file."""
    seen: set[str] = set()
    for output in outputs:
        if _streams(Path(output)):
            continue
        place = os.path.realpath(output)
        if place in seen:
            raise UsageError(
                "is given for two outputs",
                allowed="one would take the place of the other",
                do="give each a name of its own",
                file=output,
            )
        seen.add(place)


def shown(path: Path | str) -> str:
    """A log's path as a table may show it: bytes that are no UTF-8 are escaped, as \\xff."""
    return str(path).encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


# ---- outputs -------------------------------------------------------------------------------------


@contextmanager
def whole_file(path: Path | str) -> Iterator[Path]:
    """A path beside `path` to write to, which becomes `path` when all went well.

    It takes the name when the block ends well, and is removed when it does not.

    A link is followed; a device or pipe is opened now and written through at the end.
    UsageError: it is an input, or an address.  OutputError: folder missing or read-only, disk full.
    """
    refuse_address(path)
    refuse_inputs(path)
    if _streams(Path(path)):
        with _delivered(path) as local:
            yield local
        return
    path = Path(path)
    with failed_writes(path):
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    target = Path(os.path.realpath(path)) if path.is_symlink() else path
    _sweep(target.parent, _PART)
    part = part_name(target)
    held = False
    try:
        with failed_writes(path):
            old = target.stat() if target.exists() else None
            os.close(
                os.open(
                    part,
                    os.O_CREAT | os.O_EXCL | _NO_FOLLOW | os.O_WRONLY,
                    0o600 if old else 0o666,
                )
            )
            yield part
            refuse_inputs(path)  # a setup beside a log is known once the log is read
            with part.open("rb+") as stream:
                if old is not None:
                    os.chmod(part, stat.S_IMODE(old.st_mode))
                os.fsync(stream.fileno())
            if _batch is None:
                os.replace(part, target)
            else:
                _batch.append((part, target))
                held = True
    finally:
        if not held:
            with suppress(OSError):
                part.unlink(missing_ok=True)


@contextmanager
def all_or_none() -> Iterator[None]:
    """What `whole_file` finishes inside takes its name when the whole block has ended well.

    When it does not, all of them are removed. What goes to a pipe is out when its own block ends.
    """
    global _batch
    before, finished = _batch, list[tuple[Path, Path]]()
    _batch = finished
    try:
        yield
        for part, target in finished:
            with failed_writes(target):
                os.replace(part, target)
    finally:
        _batch = before
        for part, _ in finished:
            with suppress(OSError):
                part.unlink(missing_ok=True)
        while _new_folders:
            with suppress(OSError):  # one that holds a result stays
                _new_folders.pop(0).rmdir()


def _stream_of(path: Path) -> int | None:
    """The descriptor that the path means, None if it is an ordinary path."""
    own = _OWN_STREAM.fullmatch(str(path))
    return int(own[1]) if own else _STREAMS.get(str(path))


def _streams(path: Path) -> bool:
    """True if the path is neither a regular file nor a folder, or means an open stream."""
    if _stream_of(path) is not None:
        return True
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):
        return False
    return not stat.S_ISREG(mode) and not stat.S_ISDIR(mode)


@contextmanager
def _delivered(path: Path | str) -> Iterator[Path]:
    """A temporary path whose bytes go to the device or pipe `path` at the end.

    It is opened now, so that its reader sees an end also if nothing comes.
    """
    own = _stream_of(Path(path))
    with ExitStack() as leaving:
        with failed_writes(path):
            refuse_inputs(path if own is None else own, name=str(path))
            flags = os.O_WRONLY | getattr(os, "O_NOCTTY", 0)
            opened = os.open(path, flags) if own is None else os.dup(own)
            stream = leaving.enter_context(os.fdopen(opened, "wb", buffering=0))
        local = leaving.enter_context(temporary_folder()) / (_cut(Path(path).name) or "result")
        local.touch()
        yield local
        with failed_writes(path), local.open("rb") as made:
            if own is not None and sys.stdout is not None:
                sys.stdout.flush()
            while data := made.read(1 << 20):
                while data:  # a pipe takes what it has room for
                    data = data[os.write(stream.fileno(), data) :]


def make_folder(path: Path | str) -> None:
    """The folder for several output files, made if it is missing.

    OutputError: it cannot be made.
    """
    refuse_address(path)
    folder = Path(path)
    _new_folders.extend(one for one in (folder, *folder.parents) if not one.exists())
    with failed_writes(path):
        folder.mkdir(parents=True, exist_ok=True)


# ---- TOML and JSON text to plain tables.
#
# The one way in for every file that a user, or another program, wrote.
#
#     text --tomllib or json--> tables of bounded depth and numbers of 64 bits, or an error of
#                               the file's kind
#
# What is too deep to walk, or too large to be a float, is refused here once, so that nobody behind
# has to think of it.


#: a setup, a model or a scenario is a page of text; what is larger is something else
LARGEST_BYTES = 1 << 20
#: tables and lists within each other: no file of ours has more than 6
DEEPEST = 32
#: what TOML promises for a whole number, and far less than the largest float
_LARGEST_INTEGER = 1 << 63
#: a dotted key of more parts than that, which tomllib would work on for minutes before it can be
#: refused
_TOO_DOTTED = re.compile(
    rf"""(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){{{DEEPEST}}}"""
)
#: what a file of ours is by one of its tables or keys, the first that it has, and where it goes
_ROLES = {
    "campaign": ("a manifest", "`tirelog campaign run {file}` runs it"),
    "model": ("a model", "a model goes with --model; see `tirelog model show {file}`"),
    "manoeuvres": ("a scenario", "`tirelog simulate {file} -o LOG.csv` makes its log"),
    "ramp": ("a scenario", "`tirelog simulate {file} -o LOG.csv` makes its log"),
    "channels": (
        "a setup",
        "a setup goes with --setup; `tirelog model new --setup {file} -o MODEL.toml` makes a model",
    ),
}


def toml_role(text: str) -> tuple[str, str]:
    """What kind of file ("a setup") the TOML `text` is, and where it goes; '' of another."""
    heads = set(re.findall(r"^(?:\s*\[\[?\s*(?=\w)|(?=manoeuvres\s*=))(\w+)", text, re.MULTILINE))
    return next((role for name, role in _ROLES.items() if name in heads), ("", ""))


def refuse_other_role(text: str, what: str, error: type[TirelogError], file: object) -> None:
    """The `error` if the TOML `text` is that of another kind of file than `what` ("a setup")."""
    role, use = toml_role(text)
    if role not in ("", what):
        do = use.format(file=shlex.quote(str(file)))
        raise error(f"is {role}", allowed=f"{what} is needed here", do=do, file=file)


def bounded_input(path: Path | str, most: int = LARGEST_BYTES) -> bytes:
    """The content of a file, which is an input from then on.

    OSError: it cannot be read. ValueError: it has more than `most` bytes, or a NUL in its name.
    """
    taken_as_input(path)
    with open_input(path) as stream:
        content = stream.read(most + 1)
    if len(content) > most:
        raise ValueError(f"it is larger than {most >> 20} MB")
    return content


def toml_text(path: Path | str, error: type[TirelogError], *, what: str, advice: str) -> str:
    """The text of the TOML file at `path`, without a byte-order mark.

    `error` if it cannot be read, is too large or no UTF-8.

    `what` names the kind of file ("a setup") and `advice` says what to do ("give another with
    --setup").
    """
    try:
        raw = bounded_input(path)
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or problem
        raise error(
            f"cannot be read ({reason}); {what} is a TOML file; {advice}", file=path
        ) from None
    try:
        text = raw.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError:
        raise error(f"is not UTF-8 text; {what} is a TOML file; {advice}", file=path) from None
    refuse_other_role(text, what, error, path)
    return text


def toml_tables(text: str, error: type[TirelogError], *, file: object) -> dict[str, Any]:
    """The tables in TOML `text`; `error` if it is no TOML or goes too far.

    The error names the line if it is known.
    """
    try:
        if _TOO_DOTTED.search(text):
            raise RecursionError
        return dict(_bounded(tomllib.loads(text)))
    except RecursionError:
        message, line = (
            f"is nested deeper than {DEEPEST}; allowed is a page of tables and keys; mend it",
            None,
        )
    except (
        ValueError
    ) as problem:  # tomllib's own error is one; so is an integer of thousands of digits
        where = re.search(r"line (\d+)", str(problem))
        # Python itself refuses thousands of digits, with advice to programmers
        what = (
            "a whole number of thousands of digits, where 19 are allowed"
            if "set_int_max_str_digits" in str(problem)
            else problem
        )
        message, line = (
            f"not TOML: {what}; allowed is TOML in UTF-8; mend the line",
            int(where[1]) if where else None,
        )
    raise error(message, file=file, line=line)


def json_value(text: str | bytes) -> Any:
    """What JSON `text` holds; ValueError if it is no JSON or goes too far."""
    try:
        return _bounded(json.loads(text))
    except RecursionError:
        raise ValueError(f"nested deeper than {DEEPEST}") from None


def json_of(text: str | bytes, shape: Any) -> Any:
    """What JSON `text` holds; ValueError if it is no JSON, goes too far or has another `shape`.

    A shape is a type, a union with None, [shape of each], {str: shape of each}, or {"name": shape,
    "name_that_may_be_missing_or_null?": shape}. A whole number is a float too.
    """
    value = json_value(text)
    _refuse_other(value, shape, "it")
    return value


def _refuse_other(value: Any, shape: Any, place: str) -> None:
    """ValueError if the value at a `place` of the document has another shape."""
    if isinstance(shape, list) and isinstance(value, list):
        for number, one in enumerate(value):
            _refuse_other(one, shape[0], f"{place}[{number}]")
    elif isinstance(shape, dict) and isinstance(value, dict):
        named: dict[str, Any] = dict.fromkeys(value, shape[str]) if str in shape else shape
        for name, one in named.items():
            key = name.removesuffix("?")
            if value.get(key) is not None or (key == name and key in value):
                _refuse_other(value[key], one, f"{place}.{key}")
            elif key == name:
                raise ValueError(f"{place} has no {key}")
    elif isinstance(shape, list | dict) or not (
        (isinstance(value, shape) and (shape in (bool, object) or not isinstance(value, bool)))
        or (type(value) is int and isinstance(0.0, shape))
    ):
        raise ValueError(f"{place} is {type(value).__name__}")


def _bounded(tables: Any) -> Any:
    """`tables` as they are.

    ValueError for what is nested too deep, and for whole numbers of more than 64 bits.
    """
    level = [tables]
    for _ in range(DEEPEST):
        below: list[Any] = []
        for item in level:
            if isinstance(item, dict):
                below += item.values()
            elif isinstance(item, list):
                below += item
            elif isinstance(item, int) and not -_LARGEST_INTEGER <= item < _LARGEST_INTEGER:
                digits = len(str(abs(item))) if item.bit_length() < 10_000 else "thousands of"
                raise ValueError(f"a whole number of {digits} digits, where 19 are allowed")
        if not below:
            return tables
        level = below
    raise RecursionError
