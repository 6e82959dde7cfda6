"""Python files that the user has let run, known by the sha256 of their bytes.

A model file may name a Python file with effects. One that a stranger sent must not run because a
model is opened: it runs if the user has named the same bytes at a command before, on this machine.
They are remembered in $XDG_STATE_HOME/tirelog/let_run (else ~/.local/state), a line per file, the
newest last; of a list that has grown too large the older half is forgotten.
"""

from __future__ import annotations

import hashlib
import os
from contextlib import suppress
from pathlib import Path

from tirelog.storage.whole import part_name

#: bytes of the list that are read and kept: some 6,000 files
_MOST_BYTES = 1 << 20
#: of this process, if no list can be kept
_now: set[str] = set()


def let_run(content: bytes, name: str) -> None:
    """Remember that the user has named a file of this content; `name` is for the reader."""
    digest = hashlib.sha256(content).hexdigest()
    if may_run(content):
        _now.add(digest)
        return
    _now.add(digest)
    line = f"{digest}  {ascii(name)[1:-1]}\n".encode()
    with suppress(OSError, RuntimeError):  # a list that cannot be kept: for this process only
        place = _list()
        place.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        number = os.open(place, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        try:
            full = os.fstat(number).st_size + len(line) > _MOST_BYTES
            if not full:
                os.write(number, line)
        finally:
            os.close(number)
        if full:
            known = _known(place)
            _rewrite(place, b"\n".join([*known[len(known) // 2 :], line]))


def _rewrite(place: Path, content: bytes) -> None:
    """Put a whole new list in the old one's place."""
    part = part_name(place)
    try:
        with open(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as stream:
            stream.write(content)
        part.replace(place)
    finally:
        part.unlink(missing_ok=True)


def may_run(content: bytes) -> bool:
    """True if the user has named a file of just this content before."""
    digest = hashlib.sha256(content).hexdigest()
    if digest in _now:
        return True
    with suppress(OSError, RuntimeError):
        return any(line.split(b" ")[0] == digest.encode() for line in _known(_list()))
    return False


def _known(place: Path) -> list[bytes]:
    """The lines at the list's end that are whole and within its bounds."""
    with open(place, "rb") as stream:
        before = max(stream.seek(0, os.SEEK_END) - _MOST_BYTES, 0)
        stream.seek(before)
        lines = stream.read(_MOST_BYTES).splitlines()
    return lines[1:] if before else lines  # the first one may have lost its begin


def _list() -> Path:
    """Where the list is kept.  RuntimeError: the user has no home."""
    given = Path(os.environ.get("XDG_STATE_HOME", ""))
    folder = given if given.is_absolute() else Path.home() / ".local" / "state"
    return folder / "tirelog" / "let_run"
