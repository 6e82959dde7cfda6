"""The error tree.

Every error that a user can cause is a `TirelogError`; its class knows the exit status of the
command line.

A message has three parts, joined by semicolons: what is wrong; what is allowed; what to do. `file`
and `line` say where. Each part is a field, and code reads fields; the sentence is for people.

    raise UsageError(f"unknown table {name!r}", allowed=TABLES, do="choose one")
    unknown table 'x'; allowed are speed, footprint; choose one
"""

from __future__ import annotations

import difflib
import errno
import os
from collections.abc import Callable, Collection, Iterable
from enum import IntEnum
from functools import wraps
from typing import ParamSpec, Self, TypeVar

_P = ParamSpec("_P")
_T = TypeVar("_T")

#: errors of the system that say nothing of the log they were met at, and what to do
OUTSIDE_LOG = {
    errno.EMFILE: "raise the limit of open files (ulimit -n) and run it again",
    errno.ENFILE: "close other programs and run it again",
    errno.ENOMEM: "free memory and run it again",
    errno.EAGAIN: "raise the limit of processes (ulimit -u) and run it again",
    errno.ENOSPC: "the disk is full; make room or give another path",
    errno.EDQUOT: "the quota is used up; make room or give another path",
    errno.EIO: "the disk or its connection fails; repair it and run it again",
    errno.ESTALE: "mount the network folder again and run it again",
    **dict.fromkeys(
        (errno.ETIMEDOUT, errno.ECONNREFUSED, errno.ECONNRESET, errno.ENETUNREACH,
         errno.EHOSTUNREACH),
        "check the connection and run it again",
    ),
}  # fmt: skip
#: exceptions of the same kind
_OUTSIDE_KINDS = (MemoryError, ConnectionError, TimeoutError)


def is_outside_log(problem: BaseException | None) -> bool:
    """True if an error or its origin is of the machine or the network.

    Also an origin that `raise ... from None` keeps from the traceback counts.
    """
    while problem is not None:
        if isinstance(problem, _OUTSIDE_KINDS) or getattr(problem, "errno", None) in OUTSIDE_LOG:
            return True
        problem = problem.__cause__ or problem.__context__
    return False


def system_message(problem: OSError) -> str:
    """A message: what the system refused, where, and what to do."""
    where = f"{problem.filename}: " if problem.filename else ""
    advice = OUTSIDE_LOG[problem.errno or 0]
    return f"{where}the system refuses ({os.strerror(problem.errno or 0)}); {advice}"


class ExitStatus(IntEnum):
    """Exit statuses of every command."""

    DONE = 0
    ANSWER_IS_NO = 1
    UNUSABLE_REQUEST = 2
    INPUT_LOST = 3
    NOTHING_READ = 4
    DEFECT = 70


def printable(text: str) -> str:
    """`text` as one line without control characters.

    Names in a log may hold line ends, escape sequences and marks that turn the direction of
    writing: they are shown as `\\x1b`, `\\n`.
    """
    return (
        text if text.isprintable() else "".join(c if c.isprintable() else _escaped(c) for c in text)
    )


def _escaped(letter: str) -> str:
    """The escape of a letter that no terminal should get, or of a byte."""
    if "\udc80" <= letter <= "\udcff":
        return f"\\x{ord(letter) - 0xDC00:02x}"
    return letter.encode("unicode_escape", "surrogatepass").decode("ascii")


class TirelogError(Exception):
    """Base of all errors that the user can mend."""

    exit_status: ExitStatus = ExitStatus.UNUSABLE_REQUEST

    def __init__(
        self,
        what: str,
        *,
        allowed: str | Iterable[str] = "",
        do: str = "",
        file: object = None,
        line: int | None = None,
    ) -> None:
        """`allowed`: a clause as it is printed, or the words one of which may be chosen.

        A whole sentence as `what` alone is taken too; its first clause then says what is wrong.
        """
        clause = (
            allowed if isinstance(allowed, str) else f"allowed are {', '.join(allowed) or 'none'}"
        )
        self.allowed, self.do = clause, do
        self.what = what if clause or do else what.split(";")[0]
        self.message = "; ".join(part for part in (what, self.allowed, self.do) if part)
        self.file, self.line = file, line
        super().__init__(self.__str__())

    def at(self, file: object, line: int | None = None) -> Self:
        """The same error with its place in a file."""
        there = type(self)(self.message, file=file, line=line)
        there.what, there.allowed, there.do = self.what, self.allowed, self.do
        return there

    def __str__(self) -> str:
        where = (
            ""
            if self.file is None
            else f"{self.file}{'' if self.line is None else f':{self.line}'}: "
        )
        return printable(f"{where}{self.message}")


class UsageError(TirelogError):
    """An option or argument that cannot be carried out."""


class SetupError(TirelogError):
    """A setup file that cannot be used."""


class ModelError(TirelogError):
    """An unusable model file, effect or parameter, or a fit without convergence."""


def or_refusal(compute: Callable[_P, _T]) -> Callable[_P, _T | ModelError]:
    """`compute` that returns its ModelError in place of raising it.

    For whatever a search only tries, such as a model without an effect or a planned manoeuvre. Such
    a model may be none that the physics computes; then the reason is the answer, and the type
    checker asks each caller what becomes of it.
    """

    @wraps(compute)
    def tried(*given: _P.args, **named: _P.kwargs) -> _T | ModelError:
        try:
            return compute(*given, **named)
        except ModelError as refusal:
            return refusal

    return tried


class OutputError(TirelogError):
    """A result that could not be written; there is then no file of its name."""


class ReadError(TirelogError):
    """A log of which nothing could be read."""

    exit_status = ExitStatus.NOTHING_READ


class DataLoss(TirelogError):
    """Input that was lost or could not be read; the rest was used.

    Reported at the end, status 3.
    """

    exit_status = ExitStatus.INPUT_LOST


def nearest(name: str, allowed: Iterable[str]) -> str:
    """` (nearest: a, b)` for a misspelt `name`, or the empty string if nothing is near."""
    close = difflib.get_close_matches(name, list(allowed), cutoff=0.5)
    return f" (nearest: {', '.join(close)})" if close else ""


def choices(name: object, allowed: Collection[str]) -> tuple[str, str]:
    """(the words near a misspelt `name` as `nearest` gives them, a clause with those allowed).

    The clause is empty if words are near and the list is long: it would fill the screen.
    """
    near = nearest(str(name)[:80], allowed)
    if near and len(allowed) > 8:
        return near, ""
    return near, f"allowed are {', '.join(allowed) or 'none'}"


def refuse_unknown(
    word: object,
    allowed: Collection[str],
    what: str,
    *,
    do: str = "correct it",
    error: type[TirelogError] = UsageError,
    file: object = None,
) -> None:
    """The `error` for a word that is none of those allowed: `what`, with the nearest ones."""
    if word not in allowed:
        near, clause = choices(word, allowed)
        listed = do.startswith("list: ")  # by a command
        raise error(f"{what}{near}", allowed="" if listed else clause, do=do, file=file)
