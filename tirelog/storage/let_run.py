"""Python files that the user has let run, known by the sha256 of their bytes.

A model file may name a Python file with effects. One that a stranger sent must not run because a
model is opened: it runs if the user has named the same bytes at a command before, on this machine.
They are remembered in $XDG_STATE_HOME/tirelog/let_run (else ~/.local/state), a line per file.
"""

from __future__ import annotations

import hashlib
import os
from contextlib import suppress
from pathlib import Path

#: what is read of the list: some 6,000 files
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
    line = f"{digest}  {ascii(name)[1:-1]}\n"
    with suppress(OSError, RuntimeError):  # a list that cannot be kept: for this process only
        place = _list()
        place.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        number = os.open(place, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        try:
            os.write(number, line.encode())
        finally:
            os.close(number)


def may_run(content: bytes) -> bool:
    """True if the user has named a file of just this content before."""
    digest = hashlib.sha256(content).hexdigest()
    if digest in _now:
        return True
    with suppress(OSError, RuntimeError), open(_list(), "rb") as stream:
        known = stream.read(_MOST_BYTES).decode("ascii", "replace").splitlines()
        return any(line.split(" ")[0] == digest for line in known)
    return False


def _list() -> Path:
    """Where the list is kept.  RuntimeError: the user has no home."""
    given = Path(os.environ.get("XDG_STATE_HOME", ""))
    folder = given if given.is_absolute() else Path.home() / ".local" / "state"
    return folder / "tirelog" / "let_run"
