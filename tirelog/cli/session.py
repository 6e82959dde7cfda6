"""What the commands share: a session that opens logs and adds up what was lost, and writes.

    with Session(setup, quiet, output, format) as session:
        with session.table("speed") as table:
            for recording, part in session.parts(logs, "speed"):
                table.write(part.columns)

A session says each recording's remarks once on standard error, goes on with the next log if one
cannot be read or made a table of, and ends with status 3 then or if input was lost (4 if nothing
at all could be read).
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from tirelog.cli.working import Working, summary
from tirelog.errors import (
    DataLoss,
    ExitStatus,
    ReadError,
    SetupError,
    TirelogError,
    UsageError,
    printable,
)

if TYPE_CHECKING:
    from rich.console import Console

    from tirelog.api.parts import Part
    from tirelog.api.setups import Contents
    from tirelog.data.recording import Recording
    from tirelog.data.setup import Setup
    from tirelog.tables.writer import TableWriter


def say(text: str) -> None:
    """A line on standard error, as any terminal may show it."""
    with suppress(OSError, ValueError):  # nobody reads it: no reason to stop
        sys.stderr.write(f"tirelog: {printable(text)}\n")


def page(width: int) -> Console:
    """The console of a page to read: standard output, `width` columns wide if no terminal."""
    from rich.console import Console

    class Page(Console):
        def on_broken_pipe(self) -> None:
            raise BrokenPipeError  # rich's own leaves with status 1

    shown = None if sys.stdout.isatty() else width
    return Page(highlight=False, markup=False, soft_wrap=True, width=shown)


def columns_of_rows(rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Rows as columns; what a row lacks is NaN or empty text."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    texts = {name for name in names if any(isinstance(row.get(name), str) for row in rows)}
    empty = {name: "" if name in texts else float("nan") for name in names}
    return {
        name: [empty[name] if row.get(name) is None else row[name] for row in rows]
        for name in names
    }


def write_json(value: Mapping[str, Any], output: Path | None) -> None:
    """A JSON document on standard output, or as a whole file."""
    text = json.dumps(value, indent=1) + "\n"
    if output is None:
        typer.echo(text, nl=False)
        return
    from tirelog.storage.whole import whole_file

    with whole_file(output) as part:
        part.write_text(text, encoding="utf-8")


class Session:
    """One command's work on its logs, and what it writes.

    output, format   as they were given; a parquet table tells the sha256 of its logs
    hashed           tell them in any case
    tires            the logs that were read, by the tire that their setups name
    """

    def __init__(
        self,
        setup: Path | None = None,
        quiet: bool = False,
        output: Path | None = None,
        format: str | None = None,
        *,
        hashed: bool = False,
    ) -> None:
        self.quiet, self.output, self.format = quiet, output, format
        self._hashed = hashed or self._parquet()
        self._setup_file = setup
        self._shared: Setup | None = None
        self._resources = ExitStack()
        self._noted: set[str] = set()
        self._copies: dict[str, str] = {}
        self._lost: list[str] = []
        self._unread: list[str] = []
        self._refused: list[TirelogError] = []
        self._kept: list[Recording] = []
        self._read = 0
        self._streams = False
        self._began = time.monotonic()
        self._tables: list[TableWriter] = []
        self.hashes: dict[str, str] = {}
        self.tires: dict[str, list[str]] = {}

    def __enter__(self) -> Session:
        return self

    def _parquet(self) -> bool:
        """True if a parquet table is asked for.  UsageError: an unknown format or suffix."""
        if self.output is None and self.format is None:
            return False
        from tirelog.tables.writer import table_format

        return table_format(self.output, self.format) == "parquet"

    @property
    def paged(self) -> bool:
        """True if neither a file nor a format is asked for: a page to read is shown."""
        return self.output is None and self.format is None

    @property
    def json(self) -> bool:
        """True if a JSON document is asked for."""
        named = self.output is not None and self.output.suffix == ".json"
        return self.format == "json" or named

    def say(self, text: str) -> None:
        """What is being done, on standard error, unless --quiet."""
        if not self.quiet:
            say(text)

    def note(self, text: str) -> None:
        """A remark on standard error, once, unless --quiet."""
        if not self.quiet and text not in self._noted:
            self._noted.add(text)
            say(f"note: {text}")

    def notes(self, texts: Iterable[str]) -> None:
        """Remarks on standard error, unless --quiet."""
        for text in texts:
            self.note(text)

    def working(self) -> Working:
        """A line on the terminal while something takes longer; none if rows go there."""
        return Working(shown=not self.quiet and not self._streams and sys.stderr.isatty())

    @contextmanager
    def working_on(self, what: str) -> Iterator[None]:
        """The line of `working`, which says what takes long."""
        with self.working() as line:
            line.say(what)
            yield

    def setup(self) -> Setup | None:
        """The setup given with --setup, read once."""
        if self._shared is None and self._setup_file is not None:
            from tirelog.api.logs import as_setup

            self._shared = as_setup(self._setup_file)
        return self._shared

    def recordings(self, logs: list[str], *, blocks: int | None = None) -> Iterator[Recording]:
        """The logs, one after the other, each closed before the next.

        Of raw logs only the first `blocks`, if given.

        A SetupError stops the command, a log that cannot be read does not; if none can, the command
        ends here, with status 4, before an empty table takes an older one's place.
        """
        with self.working() as line:
            for number, log in enumerate(logs):
                line.say(f"reading {log}", number, len(logs))
                with self._opened(log, blocks) as recording:
                    if recording is not None:
                        name = recording.setup.tire.name or "the tire without a name"
                        self.tires.setdefault(name, []).append(recording.log)
                        yield recording
        self._stop_if_unread()

    def contents(self, logs: list[str]) -> Iterator[Contents]:
        """What is in logs that have no setup, one after the other; errors as for `recordings`."""
        from tirelog.api.setups import contents

        for log in logs:
            try:
                inside = contents(log)
            except ReadError as problem:
                self._unread.append(log)
                say(f"error: {problem}")
                continue
            self._read += 1
            self.notes(f"{log}: {remark}" for remark in inside.remarks)
            for loss in inside.losses:
                self.lost(f"{log}: {loss}")
            yield inside
        self._stop_if_unread()

    def _stop_if_unread(self) -> None:
        """Ends the command with status 4 if there were logs and none could be read."""
        if self._unread and not self._read:
            raise typer.Exit(int(ExitStatus.NOTHING_READ))

    @contextmanager
    def _opened(self, log: str, blocks: int | None = None) -> Iterator[Recording | None]:
        """One log while it is open, or None if it cannot be read; its losses are said."""
        with ExitStack() as resources:
            recording = self._open(log, resources, blocks)
            yield recording
            if recording is not None:
                self._say_losses(recording)

    def parts(
        self, logs: list[str], table: str, channels: list[str] | None = None, **options: Any
    ) -> Iterator[tuple[Recording, Part]]:
        """The rows of one table of every log, or of these `channels`, part by part (`parts_of`).

        If rows go to standard output, all that could refuse a log is looked at before the first. A
        file takes its place whole or not at all, so that its channels need not be read twice.
        """
        from tirelog.api.parts import checked_options, parts_of

        checked_options(table, options)
        first = self._streams or len(logs) > 1
        return self.parts_of(
            logs, lambda log: parts_of(log, table, options, channels or (), refused_first=first)
        )

    def parts_of(
        self, logs: list[str], made: Callable[[Recording], Iterator[Part]]
    ) -> Iterator[tuple[Recording, Part]]:
        """What is `made` of every log, part by part, what is to be said of it said.

        Of several logs each stands for itself: one that is refused, for its setup or for what it
        shows, is said to be, the others go on, and the command ends with status 3. If no log has
        given anything it ends here, with the status of the first refusal, and writes nothing.
        """
        self.setup()  # a setup for all logs that cannot be used stops the command
        gave = False
        with self.working() as line:
            for number, log in enumerate(logs):
                line.say(log, number, len(logs))
                try:
                    with self._opened(log) as recording:
                        if recording is None:
                            continue
                        if len(logs) > 1:
                            self._note_copy(recording)
                        for part in made(recording):
                            self.notes(f"{log}: {remark}" for remark in part.remarks)
                            gave = True
                            yield recording, part
                except (UsageError, SetupError, ReadError, DataLoss) as problem:
                    if len(logs) == 1:
                        raise
                    self._refuse(log, problem)
        self._stop_if_unread()
        if self._refused and not gave:
            raise typer.Exit(int(self._refused[0].exit_status))

    def _refuse(self, log: str, problem: TirelogError) -> None:
        """One log of several is refused: said now, and status 3 in the end."""
        self._refused.append(problem)
        say(f"error: {problem if problem.file is not None else problem.at(log)}")

    def all_recordings(self, logs: list[str]) -> list[Recording]:
        """The logs, open together until the session ends."""
        opened = [self._open(log, self._resources, None) for log in logs]
        self._kept = [recording for recording in opened if recording is not None]
        if not self._kept:
            raise typer.Exit(int(ExitStatus.NOTHING_READ))
        for recording in self._kept if len(logs) > 1 else ():
            self._note_copy(recording)
        return self._kept

    def _note_copy(self, recording: Recording) -> None:
        """A note if the log holds the samples of an earlier one, whose rows then come twice."""
        from tirelog.api.logs import samples_hash

        digest = samples_hash(recording)
        if digest in self._copies:
            self.note(
                f"{recording.log}: holds the same samples as {self._copies[digest]}; what is made "
                "of them comes twice"
            )
        self._copies.setdefault(digest, recording.log)

    def _open(self, log: str, resources: ExitStack, blocks: int | None) -> Recording | None:
        """One log, or None if it cannot be read (which has been said)."""
        from tirelog.api.logs import opened

        try:
            recording = resources.enter_context(
                opened(log, self.setup(), blocks=blocks, hashed=self._hashed)
            )
        except ReadError as problem:
            self._unread.append(log)
            say(f"error: {problem}")
            return None
        self._read += 1
        self.hashes[recording.log] = str(recording.provenance.get("sha256", ""))
        self.notes(f"{log}: {remark}" for remark in recording.remarks)
        self._say_losses(recording)
        return recording

    def _say_losses(self, recording: Recording) -> None:
        """Say each loss once.

        When the log is opened, and again at its end, since a damaged chunk is met while reading.
        """
        for loss in recording.losses:
            text = f"{recording.log}: {loss}"
            if text not in self._lost:
                self.lost(text)

    def refuse_edit(self, model: Path, new_model: Path) -> None:
        """DataLoss: a log was lost, and the new model would take the place of the one it is of."""
        if (self._unread or self._lost) and new_model.exists() and new_model.samefile(model):
            raise DataLoss(
                "is left as it was, since a log was not read whole",
                do="give another -o to keep the fit to the rest",
                file=new_model,
            )

    def lost(self, text: str) -> None:
        """Input was lost: said now, and status 3 in the end."""
        self._lost.append(text)
        say(f"error: {text}")

    def table(self, name: str, output: Path | None = None, **metadata: Any) -> TableWriter:
        """A writer for the command's table, or for one of several at an `output` of its own."""
        from tirelog.tables.writer import TableWriter

        output = self.output if output is None else output
        self._streams |= output is None
        about = {"inputs": self.hashes, **metadata}
        writer = TableWriter(name, output, self.format, metadata=about)
        self._tables.append(writer)
        return writer

    def write_rows(
        self, name: str, parts: Iterable[Sequence[Mapping[str, Any]]], empty: Sequence[str] = ()
    ) -> None:
        """A table of rows that come in parts; if there are none the columns `empty`."""
        with self.table(name) as table:
            for rows in parts:
                table.write(columns_of_rows(rows) or {name: [] for name in empty})

    def __exit__(self, kind: Any, value: Any, trace: Any) -> None:
        self._resources.close()
        if isinstance(value, UsageError) and self._unread and not self._read:  # why has been said
            raise typer.Exit(int(ExitStatus.NOTHING_READ))
        if (
            isinstance(value, UsageError) and self._lost
        ):  # what was asked for is not there because it was lost
            say(f"error: {value}")
            raise typer.Exit(int(DataLoss.exit_status))
        if kind is not None:
            return
        for recording in self._kept:
            self._say_losses(recording)
        self._stop_if_unread()
        if not self.quiet:
            for table in self._tables:
                if table.output is not None:
                    summary(table.output, table.rows, self._read, self._began)
        if self._unread or self._lost or self._refused:
            raise typer.Exit(int(DataLoss.exit_status))
