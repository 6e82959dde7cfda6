"""Logs and results elsewhere.

At s3://, gs://, https://, any address that fsspec knows (extra `remote`).

Credentials come by the environment's own means (AWS_*, GOOGLE_APPLICATION_CREDENTIALS, ...), never
through tirelog. A store that does not answer is an error after ANSWER_S seconds; what it sends once
it answers may take as long as it takes.
"""

from __future__ import annotations

import errno
import os
import posixpath
import re
import sys
import threading
from collections.abc import Callable, Sequence
from io import BufferedReader
from pathlib import Path
from typing import Any, BinaryIO, TypeVar, cast
from urllib.parse import unquote

from tirelog.errors import OutputError, ReadError, TirelogError, UsageError, without_credentials
from tirelog.runtime import noticed_wait

T = TypeVar("T")

_ADDRESS = re.compile(r"^([a-z][a-z0-9+.-]+):/{1,2}(?=[^/])", re.IGNORECASE)
#: a path of this machine as an address
_FILE = re.compile(r"^file:/+(?=[^/])", re.IGNORECASE)
#: a store has to answer a question within this time
ANSWER_S = 8.0
#: object stores: a put is seen whole or not at all; elsewhere a file is put under another name and
#: moved
_WHOLE_PUTS = {"s3", "s3a", "gs", "gcs", "az", "abfs", "abfss", "adl", "oci", "memory"}
#: the name under which a file is put if it would be seen half written, and what it is swept by
PART = ".part"


def address(path: Path | str) -> str | None:
    """`path` as a remote address, or None if it is a local path.

    (A `Path` keeps only one of the two slashes.)
    """
    text = str(path)
    if match := _FILE.match(text):
        return f"file:///{text[match.end() :]}"
    match = _ADDRESS.match(text)
    return f"{match[1].lower()}://{text[match.end() :]}" if match else None


def object_of(url: str) -> tuple[str, str]:
    """What an address means, however it is spelled: (kind of store, path in it).

    Spellings that some stores tell apart, `a//b` and `a/b` or `%20` and a blank, count as one: to
    refuse an output too many costs less than an input. UsageError: no store of this kind is known.
    """
    system = _filesystem(url)
    path = unquote(str(system._strip_protocol(url)))
    return type(system).__name__, posixpath.normpath(f"/{path.lstrip('/')}")


def shown(path: Path | str) -> str:
    """A log's path as a table may show it.

    An address appears without user, password or values of its query.

    A local path stays as it is given; bytes of a name that are no UTF-8 are escaped, as \\xff.
    """
    text = str(path)
    text = text if address(text) is None else without_credentials(text)
    return text.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


def _filesystem(url: str) -> Any:
    try:
        import fsspec
    except ImportError:
        raise UsageError(
            f"{url}: addresses need fsspec",
            do="it comes with the extra: pip install 'tirelog[remote]'",
        ) from None
    try:
        return fsspec.core.url_to_fs(url)[0]
    except (ImportError, ValueError) as problem:
        raise UsageError(
            f"{url}: {problem}",
            allowed="allowed is an address that fsspec has a package for",
            do="install it",
        ) from None


def _refusal(kind: type[TirelogError], url: str, problem: BaseException) -> TirelogError:
    """What a store says, with advice if credentials are the trouble."""
    text = f"{type(problem).__name__}: {problem}".splitlines()[0][:200]
    credentials = (
        isinstance(problem, PermissionError)
        or "credential" in text.lower()
        or getattr(problem, "errno", None) == errno.EACCES
    )
    advice = (
        "give credentials by the environment's own means (e.g. AWS_ACCESS_KEY_ID)"
        if credentials
        else "give another address"
    )
    return kind(f"cannot be reached ({text}); {advice}", file=url)


def _answer(
    url: str, kind: type[TirelogError], question: Callable[[Any], T], *, may_miss: bool = False
) -> T:
    """What the store of `url` answers; `kind` of error if it refuses.

    Also if it does not answer in time (its own retries take minutes).

    FileNotFoundError is an answer, and is raised as it is if what is asked for `may_miss`; of the
    others the cause is a ConnectionError or TimeoutError, whatever the store's own exceptions are.
    """
    system, answers, failures = _filesystem(url), list[T](), list[BaseException]()

    def ask() -> None:
        try:
            answers.append(question(system))
        except BaseException as problem:  # each store has exceptions of its own
            failures.append(problem)

    asking = threading.Thread(target=ask, daemon=True)
    asking.start()
    asking.join(ANSWER_S)
    if answers:
        return answers[0]
    if not failures:
        raise kind(
            f"cannot be reached (no answer within {ANSWER_S:g} s); allowed is a store that "
            "answers; see to it and try again",
            file=url,
        ) from TimeoutError()
    missing = isinstance(failures[0], FileNotFoundError)
    if isinstance(failures[0], TirelogError) or (missing and may_miss):
        raise failures[0]
    raise _refusal(kind, url, failures[0]) from None if missing else ConnectionError()


def _found(url: str, kind: type[TirelogError], question: Callable[[Any], T]) -> T | None:
    """`_answer` of a store that may not have what is asked for: None then."""
    try:
        return _answer(url, kind, question, may_miss=True)
    except FileNotFoundError:
        return None


def open_remote(url: str) -> BinaryIO:
    """A stream that reads from `url` in ranges.

    ReadError: not there, or no credentials; while it is read, the store refuses or has gone, which
    no reader can take for damage of the log.
    """
    stream = _answer(url, ReadError, lambda system: system.open(url, "rb"))

    def guarded(call: Callable[..., T]) -> Callable[..., T]:
        def answer(*given: Any) -> T:
            try:
                return call(*given)
            except Exception as problem:  # each store has exceptions of its own
                known = isinstance(problem, TirelogError)  # one of the two calls the other
                raise problem if known else _refusal(ReadError, url, problem) from ConnectionError()

        return answer

    stream.read, stream.readinto = guarded(stream.read), guarded(stream.readinto)
    return cast(BinaryIO, stream)


def open_input(path: Path | str) -> BinaryIO:
    """The bytes of a file here or at an address, opened to be read.

    "-" is standard input. It and a pipe are waited for until something writes to them, with a
    notice after two seconds.
    OSError, ValueError: there is none. ReadError: nothing is there, or no credentials.
    """
    url = address(path)
    if url is not None:
        return open_remote(url)
    named = Path(path)
    if path != "-" and not named.is_fifo():
        return named.open("rb")
    pipe = "standard input: is silent" if path == "-" else f"{path}: is a pipe"
    with noticed_wait(f"{pipe}; waiting for what writes to it"):
        stream = cast(BufferedReader, sys.stdin.buffer) if path == "-" else named.open("rb")
        stream.peek(1)  # until there are bytes, or whoever opened it has left
        return stream


def read_remote(url: str) -> bytes | None:
    """A small object's bytes, or None if it is not there.  ReadError: it cannot be known."""
    found = _found(url, ReadError, lambda system: system.cat_file(url))
    return None if found is None else bytes(found)


def read_several(urls: Sequence[str]) -> dict[str, bytes]:
    """Small objects' bytes by address; those that are not there are left out.

    Read side by side if the store can.
    """
    if not urls:
        return {}

    def read(system: Any) -> dict[str, bytes]:
        plain = {system._strip_protocol(url): url for url in urls}
        found = system.cat(list(plain), on_error="omit")
        return {plain[name]: bytes(data) for name, data in found.items()}

    return _answer(urls[0], ReadError, read)


def list_remote(url: str) -> list[str]:
    """Names of all that lies below the folder `url`, at any depth, relative to it.

    Nothing if it is not there.
    """

    def names(system: Any) -> list[str]:
        system.invalidate_cache()
        root = str(system._strip_protocol(url)).rstrip("/") + "/"
        return [str(name).removeprefix(root) for name in system.find(url)]

    return sorted(_found(url, OutputError, names) or [])


def match_remote(pattern: str) -> list[str]:
    """Addresses that match a pattern.  ReadError: the store cannot be asked."""

    def names(system: Any) -> list[str]:
        system.invalidate_cache()
        scheme = pattern.split("://")[0]
        return [
            str(address(name if "://" in name else f"{scheme}://{name.lstrip('/')}"))
            for name in map(str, system.glob(pattern))
        ]

    return sorted(_found(pattern, ReadError, names) or [])


#: what stores call the marks of an object's bytes
_MARKS = ("ETag", "etag", "md5Hash", "LastModified", "last_modified", "mtime", "updated", "created")


def state_of(path: str) -> list[Any]:
    """What changes when the bytes at a path or address do, as far as it is known without reading.

    OSError, ReadError: not there.
    """
    url = address(path)
    if url is None:
        about = os.stat(path)
        return [about.st_size, about.st_mtime_ns]
    info = _answer(url, ReadError, lambda system: system.info(url))
    marks = [info.get(name) for name in _MARKS]
    return [info.get("size"), *(str(mark) for mark in marks if mark is not None)]


def write_remote(url: str, data: bytes) -> None:
    """A small object, whole or not at all.  OutputError: it could not be stored."""
    _answer(url, OutputError, lambda store: _put(store, url, lambda to: store.pipe_file(to, data)))


def remove_remote(urls: Sequence[str]) -> None:
    """Remove objects; those that are gone already are no error."""
    if urls:
        try:
            _answer(urls[0], OutputError, lambda system: system.rm(list(urls)), may_miss=True)
        except FileNotFoundError:
            for url in urls if len(urls) > 1 else ():
                remove_remote([url])


def upload(path: Path, url: str) -> None:
    """Copy a whole local file to `url`, so that it is seen whole or not at all.

    OutputError: it could not be stored.
    """
    system = _filesystem(url)
    try:
        _put(system, url, lambda to: system.put_file(str(path), to))
    except Exception as problem:  # each store has exceptions of its own
        raise _refusal(OutputError, url, problem) from None


def _put(system: Any, url: str, store: Callable[[str], object]) -> None:
    """Have `store` put an object at `url` so that it is seen whole or not at all."""
    kinds = {system.protocol} if isinstance(system.protocol, str) else set(system.protocol)
    folder, _, name = url.rpartition("/")
    place = url if kinds & _WHOLE_PUTS else f"{folder}/.{name}{PART}"
    store(place)
    if place != url:
        system.mv(place, url)
