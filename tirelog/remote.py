"""Logs and results elsewhere: s3://, gs://, https://, any address that fsspec knows (extra `remote`).

Credentials come by the environment's own means (AWS_*, GOOGLE_APPLICATION_CREDENTIALS, ...), never through tirelog.
"""

from __future__ import annotations

import errno
import re
from pathlib import Path
from typing import Any, BinaryIO, cast

from tirelog.errors import OutputError, ReadError, TirelogError, UsageError

_ADDRESS = re.compile(r"^([a-z][a-z0-9+.-]+):/{1,2}(?=[^/])")


def address(path: Path | str) -> str | None:
    """`path` as a remote address, or None where it is a local path.  (A `Path` keeps only one of the two slashes.)"""
    text = str(path)
    match = _ADDRESS.match(text)
    return f"{match[1]}://{text[match.end() :]}" if match else None


def _filesystem(url: str) -> Any:
    try:
        import fsspec
    except ImportError:
        raise UsageError(f"{url}: addresses need fsspec; it comes with the extra: pip install 'tirelog[remote]'") from None
    try:
        return fsspec.core.url_to_fs(url)[0]
    except (ImportError, ValueError) as problem:
        raise UsageError(f"{url}: {problem}; allowed is an address that fsspec has a package for; install it") from None


def _refusal(kind: type[TirelogError], url: str, problem: BaseException) -> TirelogError:
    """What a store says, with advice where credentials are the trouble."""
    text = f"{type(problem).__name__}: {problem}".splitlines()[0][:200]
    credentials = isinstance(problem, PermissionError) or "credential" in text.lower() or getattr(problem, "errno", None) == errno.EACCES
    advice = "give credentials by the environment's own means (e.g. AWS_ACCESS_KEY_ID)" if credentials else "give another address"
    return kind(f"cannot be reached ({text}); {advice}", file=url)


def open_remote(url: str) -> BinaryIO:
    """A stream that reads from `url` in ranges.  ReadError: not there, or no credentials."""
    try:
        return cast(BinaryIO, _filesystem(url).open(url, "rb"))
    except TirelogError:
        raise
    except Exception as problem:  # each store has exceptions of its own
        raise _refusal(ReadError, url, problem) from None


def fetch(url: str, path: Path) -> None:
    """Copy `url` to a local file."""
    with open_remote(url) as source, path.open("wb") as target:
        try:
            while part := source.read(1 << 22):
                target.write(part)
        except OSError as problem:
            raise _refusal(ReadError, url, problem) from None


def upload(path: Path, url: str) -> None:
    """Copy a whole local file to `url`; object stores show it whole or not at all.  OutputError: it could not be stored."""
    try:
        _filesystem(url).put_file(str(path), url)
    except TirelogError:
        raise
    except Exception as problem:
        raise _refusal(OutputError, url, problem) from None
