"""A campaign's output folder at an address, and the lock that keeps it for one run.

    .tirelog/lock.<n>    JSON {owner, host, pid, beat_s}; the highest n holds; it is written anew
                         every BEAT_S while its owner lives

A store has no locks that end with a process, so a lock ends with its heartbeat: EXPIRES_S after the
last one anybody may take over, by creating lock.<n+1>; on the machine that wrote it at once, if
its process is gone. On stores that can refuse to overwrite (S3, GCS, Azure) two that start at the
same moment cannot both create it, whatever their clocks say: one run at a time is guaranteed there,
as long as no process sleeps for EXPIRES_S and clocks differ by less than that. A run that finds
itself taken over stops before its next entry. On other stores the lock is looked for before it is
written: two runs that start at the same moment may both believe that they hold it.

Objects are seen whole or not at all; a store that is not one of objects gets a file under another
name, which is moved (`remote`).
"""

from __future__ import annotations

import json
import os
import socket
import threading
import time
import uuid
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress

from tirelog.campaign.names import HIDDEN, is_own, json_of, swept, temporary_for
from tirelog.errors import TirelogError, UsageError
from tirelog.storage.remote import (
    PART,
    create_remote,
    list_remote,
    read_remote,
    read_several,
    remove_remote,
    write_remote,
)

#: a lock is written anew this often [s], and is over so long [s] after it was last: three beats may
#: be missed
BEAT_S = 15.0
EXPIRES_S = 60.0
_LOCK = f"{HIDDEN}/lock."


class RemoteFolder:
    """A folder at the address `root`."""

    def __init__(self, root: str) -> None:
        self.root = root
        self.temporary = temporary_for(root)
        self._owner = uuid.uuid4().hex
        self._number = 0
        self._lost = threading.Event()

    def _at(self, name: str) -> str:
        return f"{self.root}/{name}"

    def read(self, name: str) -> bytes | None:
        return read_remote(self._at(name))

    def read_all(self, names: Sequence[str]) -> dict[str, bytes]:
        return {
            url.removeprefix(self.root + "/"): data
            for url, data in read_several([self._at(name) for name in names]).items()
        }

    def write(self, name: str, data: bytes) -> None:
        write_remote(self._at(name), data)

    def remove(self, names: Sequence[str]) -> None:
        remove_remote([self._at(name) for name in names])

    def names(self) -> set[str]:
        return set(list_remote(self.root))

    # ---- the lock --------------------------------------------------------------------------------

    def check_held(self) -> None:
        if self._lost.is_set():
            raise UsageError(
                "another run has taken this folder over",
                allowed="one at a time is allowed",
                do="run it again",
                file=self.root,
            )

    @contextmanager
    def held(self) -> Iterator[None]:
        self._take()
        done = threading.Event()
        heart = threading.Thread(target=self._beat, args=(done,), daemon=True)
        heart.start()
        swept(self.temporary)
        try:
            yield
        finally:
            done.set()
            heart.join()
            swept(self.temporary)
            self.temporary.rmdir()
            if not self._lost.is_set():
                with suppress(TirelogError):  # it ends with its heartbeat
                    self.remove([f"{_LOCK}{self._number}"])

    def _take(self) -> None:
        """Create the next lock.  UsageError: another run's heart beats."""
        listed = self.names()
        numbers = sorted(
            int(tail)
            for name in listed
            if name.startswith(_LOCK) and (tail := name.removeprefix(_LOCK)).isdigit()
        )
        if numbers:
            _refuse_if_alive(self.root, self.read(f"{_LOCK}{numbers[-1]}"))
        self._number = numbers[-1] + 1 if numbers else 1
        if not create_remote(self._at(f"{_LOCK}{self._number}"), self._content()):
            raise _taken(self.root, "a moment ago")
        self.remove(
            [f"{_LOCK}{n}" for n in numbers] + [name for name in listed if _half_written(name)]
        )

    def _content(self) -> bytes:
        return json.dumps(
            {"owner": self._owner, "host": _here(), "pid": os.getpid(), "beat_s": time.time()}
        ).encode()

    def _beat(self, done: threading.Event) -> None:
        """Write the lock anew, as long as it is ours."""
        while not done.wait(BEAT_S):
            with suppress(
                TirelogError
            ):  # a store that does not answer once may answer the next time
                name = f"{_LOCK}{self._number}"
                if (
                    _owner(self.read(name)) != self._owner
                    or f"{_LOCK}{self._number + 1}" in self.names()
                ):
                    self._lost.set()
                    return
                self.write(name, self._content())


def _half_written(name: str) -> bool:
    """A file of the campaign's own under the name that `write_remote` and `upload` move from."""
    folder, _, last = name.rpartition("/")
    return (
        last.startswith(".")
        and last.endswith(PART)
        and is_own(f"{folder}/{last[1 : -len(PART)]}".lstrip("/"))
    )


def _owner(data: bytes | None) -> str | None:
    return json_of(data).get("owner")


def _refuse_if_alive(root: str, data: bytes | None) -> None:
    """UsageError while the lock's heart may beat."""
    lock = json_of(data)
    age = time.time() - _number(lock.get("beat_s"))
    if age > EXPIRES_S or (
        lock.get("host") == _here() and not _runs(int(_number(lock.get("pid"))))
    ):
        return
    raise _taken(root, f"{age:.0f} s ago from {lock.get('host')}, process {lock.get('pid')}")


def _number(value: object) -> float:
    """A number of a lock, 0 if it is none: a lock that nobody can have written has ended."""
    return float(value) if isinstance(value, int | float) and abs(value) < 1e18 else 0.0


def _taken(root: str, when: str) -> UsageError:
    return UsageError(
        f"another campaign run works in this folder (last heard {when})",
        allowed="one at a time is allowed",
        do=f"wait for it, or {EXPIRES_S:.0f} s if it was killed",
        file=root,
    )


def _here() -> str:
    """Where process ids mean what they do here: this machine, or this container of it."""
    with suppress(OSError):
        return f"{socket.gethostname()} {os.readlink('/proc/self/ns/pid')}"
    return socket.gethostname()


def _runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        pass
    return pid > 0
