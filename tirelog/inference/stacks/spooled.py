"""The stacks of several logs, numbered through.

In memory while they are few, then in a temporary file, one at a time in memory again.

    stretches of a log (`cut.stretches_of`, at most some MB each) --add--> Stacks
        --one at a time--> Stack, equal to the bit

A usual log is one stack. A long one is several, one after the other, cut between manoeuvres if
these are short enough; a manoeuvre that had to be cut keeps its number. What has a value
per revolution stays in memory, the waveforms (32 bytes per bin) are put aside.
"""

from __future__ import annotations

import io
import os
import tempfile
import weakref
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import IO, Any, overload

import numpy as np

from tirelog.data.recording import Conditions, Stack
from tirelog.errors import OutputError

#: bytes of waveforms that are kept in memory
IN_MEMORY = 3 << 23
_WAVEFORMS = ("values", "phi_mean", "phi_variance", "count")
_NUMBERS = ("noise", "log", "manoeuvre", "revolution", "regime")


class Stacks(Sequence[Stack]):
    """Stacks on the same angles.

    `logs` names all logs, and each stack's `log` and `manoeuvre` count through them.

    `notes`: sentences on what was set apart of them.
    """

    def __init__(self, in_memory: int | None = None) -> None:
        self.logs: tuple[str, ...] = ()
        self.notes: tuple[str, ...] = ()
        self._room = IN_MEMORY if in_memory is None else in_memory
        self._stacks: list[Stack] = []
        self._places: list[
            tuple[int, int] | None
        ] = []  # from where to where in the file the waveforms are, None if they are in memory
        self._file: IO[bytes] | None = None

    def add(self, log: str, stretches: Iterable[Stack]) -> None:
        """One more log.

        OutputError: the folder for temporary files is full or cannot be written.
        """
        first = 1 + max((int(stack.manoeuvre.max()) for stack in self._stacks), default=-1)
        for stretch in stretches:
            if len(stretch):
                number = np.full(len(stretch), len(self.logs))
                self._keep(replace(stretch, log=number, manoeuvre=stretch.manoeuvre + first))
        self.logs = (*self.logs, log)

    def note(self, sentence: str) -> None:
        """A sentence that whoever reads a result of these stacks must see, once."""
        self.notes = tuple(dict.fromkeys((*self.notes, sentence)))

    def of_log(self, number: int) -> Iterator[Stack]:
        """The stacks of one log, in order."""
        return (self[i] for i, stack in enumerate(self._stacks) if stack.log[0] == number)

    def outlines(self) -> list[Stack]:
        """The stacks, those that are put aside without their waveforms."""
        return list(self._stacks)

    def number_through(self) -> None:
        """Manoeuvres 0, 1, 2, ... when some have gone with their revolutions."""
        names = np.unique(
            np.concatenate([np.zeros(0, np.int64), *(stack.manoeuvre for stack in self._stacks)])
        )
        self._stacks = [
            replace(stack, manoeuvre=np.searchsorted(names, stack.manoeuvre))
            for stack in self._stacks
        ]

    def __len__(self) -> int:
        return len(self._stacks)

    @overload
    def __getitem__(self, index: int) -> Stack: ...
    @overload
    def __getitem__(self, index: slice) -> list[Stack]: ...
    def __getitem__(self, index: int | slice) -> Stack | list[Stack]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        stack, place = self._stacks[index], self._places[index]
        return replace(stack, logs=self.logs, **({} if place is None else self._read(place)))

    def _keep(self, stack: Stack) -> None:
        self._stacks.append(stack)
        self._places.append(None)
        self._room -= _bytes(stack)
        if self._room < 0:  # all of them: memory is short in what follows
            for i, place in enumerate(self._places):
                if place is None:
                    self._places[i] = self._write(self._stacks[i])
                    empty: Any = np.empty((len(self._stacks[i]), 0))
                    self._stacks[i] = replace(self._stacks[i], **dict.fromkeys(_WAVEFORMS, empty))

    def _write(self, stack: Stack) -> tuple[int, int]:
        """The waveforms at the end of the file; where they begin and end."""
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile(prefix="tirelog-")  # noqa: SIM115
                weakref.finalize(self, self._file.close)
            place = self._file.seek(0, 2)
            for name in _WAVEFORMS:
                np.save(self._file, getattr(stack, name), allow_pickle=False)
            self._file.flush()
            return place, self._file.tell()
        except OSError as problem:
            raise OutputError(
                f"the revolutions of long logs cannot be put aside ({problem.strerror or problem})",
                allowed="the folder for temporary files has to hold them, "
                f"{_bytes(stack) / len(stack) / 1000.0:.0f} kB each",
                do="make room or set TMPDIR to another folder",
                file=tempfile.tempdir or os.environ.get("TMPDIR"),
            ) from problem

    def _read(self, place: tuple[int, int]) -> dict[str, Any]:
        """The waveforms, read without the file's own place: processes may do it side by side."""
        assert self._file is not None
        first, stop = place
        if hasattr(os, "pread"):
            data = io.BytesIO(os.pread(self._file.fileno(), stop - first, first))
        else:  # Windows, where no process is forked either
            self._file.seek(first)
            data = io.BytesIO(self._file.read(stop - first))
        return {name: np.load(data, allow_pickle=False) for name in _WAVEFORMS}


def _bytes(stack: Stack) -> int:
    """Bytes of memory that the stack's waveforms take."""
    return sum(int(getattr(stack, name).nbytes) for name in _WAVEFORMS)


def outlines(stacks: Sequence[Stack]) -> Sequence[Stack]:
    """The stacks; of those that are put aside what has a value per revolution, nothing is read."""
    return stacks.outlines() if isinstance(stacks, Stacks) else stacks


def joined(stacks: Iterable[Stack]) -> Stack:
    """Several stacks on the same angles as one."""
    parts = list(stacks)
    if len(parts) == 1:
        return parts[0]
    rows: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in (*_WAVEFORMS, *_NUMBERS)
    }
    return replace(
        parts[0], conditions=Conditions.concatenate([part.conditions for part in parts]), **rows
    )
