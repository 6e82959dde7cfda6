"""The stacks of several logs, numbered through: in memory while they are few, then in a temporary file, one at a time in memory again.

    stretches of a log (`stack.stretches_of`, at most some MB each) --add--> Stacks --one at a time--> Stack, equal to the bit

A usual log is one stack.  A long one is several, one after the other, cut between manoeuvres where these are short enough; a manoeuvre
that had to be cut keeps its number.  What has a value a revolution stays in memory, the waveforms (32 bytes a bin) are put aside.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import IO, Any, overload

import numpy as np

from tirelog.errors import OutputError
from tirelog.recording import Conditions, Stack

#: bytes of waveforms that are kept in memory
IN_MEMORY = 1 << 25
_WAVEFORMS = ("values", "phi_mean", "phi_variance", "count")
_NUMBERS = ("noise", "log", "manoeuvre", "revolution", "regime")


class Stacks(Sequence[Stack]):
    """Stacks on the same angles; `logs` names all logs, and each stack's `log` and `manoeuvre` count through them."""

    def __init__(self, in_memory: int = IN_MEMORY) -> None:
        self.logs: tuple[str, ...] = ()
        self._room = in_memory
        self._stacks: list[Stack] = []
        self._places: list[int | None] = []  # where in the file the waveforms are, None where they are in memory
        self._file: IO[bytes] | None = None

    def add(self, log: str, stretches: Iterable[Stack]) -> None:
        """One more log.  OutputError: the folder for temporary files is full or cannot be written."""
        first = 1 + max((int(stack.manoeuvre.max()) for stack in self._stacks), default=-1)
        for stretch in stretches:
            if len(stretch):
                number = np.full(len(stretch), len(self.logs))
                self._keep(replace(stretch, log=number, manoeuvre=stretch.manoeuvre + first))
        self.logs = (*self.logs, log)

    def of_log(self, number: int) -> Iterator[Stack]:
        """The stacks of one log, in order."""
        return (self[i] for i, stack in enumerate(self._stacks) if stack.log[0] == number)

    def number_through(self) -> None:
        """Manoeuvres 0, 1, 2, ... where some have gone with their revolutions."""
        names = np.unique(np.concatenate([np.zeros(0, np.int64), *(stack.manoeuvre for stack in self._stacks)]))
        self._stacks = [replace(stack, manoeuvre=np.searchsorted(names, stack.manoeuvre)) for stack in self._stacks]

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
        size = sum(getattr(stack, name).nbytes for name in _WAVEFORMS)
        self._room -= size
        if self._room >= 0:
            self._stacks.append(stack)
            self._places.append(None)
            return
        self._places.append(self._write(stack, size))
        empty: Any = np.empty((len(stack), 0))
        self._stacks.append(replace(stack, **dict.fromkeys(_WAVEFORMS, empty)))

    def _write(self, stack: Stack, size: int) -> int:
        """The waveforms at the end of the file; where they begin."""
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile(prefix="tirelog-")  # noqa: SIM115 - lives as long as the stacks
            place = self._file.seek(0, 2)
            for name in _WAVEFORMS:
                np.save(self._file, getattr(stack, name), allow_pickle=False)
            self._file.flush()
        except OSError as problem:
            raise OutputError(
                f"the revolutions of a long log cannot be put aside ({problem.strerror}); the folder for temporary files has to have room "
                f"for them, {size / len(stack) / 1e3:.0f} kB each; make room or set TMPDIR to another folder",
                file=tempfile.tempdir,
            ) from problem
        return place

    def _read(self, place: int) -> dict[str, Any]:
        assert self._file is not None
        self._file.seek(place)
        return {name: np.load(self._file, allow_pickle=False) for name in _WAVEFORMS}


def joined(stacks: Iterable[Stack]) -> Stack:
    """Several stacks on the same angles as one."""
    parts = list(stacks)
    if len(parts) == 1:
        return parts[0]
    rows: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in (*_WAVEFORMS, *_NUMBERS)}
    return replace(parts[0], conditions=Conditions.concatenate([part.conditions for part in parts]), **rows)
