"""The session that commands share: it opens logs, counts losses, and writes.

    with Session(setup, quiet, output, format) as session:
        with session.table("speed") as table:
            for recording, part in session.parts(logs, "speed"):
                table.write(part.columns)

A session prints each recording's remarks once, on standard error. If a log cannot be read or gives
no table, the session goes on with the next. Then, or if input was lost, it ends with status 3; with
4 if nothing could be read.
"""

from __future__ import annotations

import io
import json
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import cached_property, partial
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, TypeVar

import typer

import tirelog.api as api
from tirelog.errors import (
    DataLoss,
    ExitStatus,
    ReadError,
    SetupError,
    TirelogError,
    UsageError,
    printable,
)
from tirelog.runtime import PATIENCE_S
from tirelog.storage.whole import output_error, whole_file

if TYPE_CHECKING:
    from tirelog.data.recording import Recording
    from tirelog.data.setup import Setup
    from tirelog.tables.writer import TableWriter

#: an open recording, or the series in a log without a setup
Log = TypeVar("Log", "Recording", "api.logs.Contents")


# ---- The process's standard streams, and the signals that end it.
#
# standard output   closed, full or of another encoding: an OutputError or an escaped letter
# SIGTERM, SIGHUP   unwind like an interrupt, so that unfinished files are removed


#: signals that end a process from outside
_ENDINGS = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))


@contextmanager
def endings_unwind() -> Iterator[None]:
    """While open, SIGTERM and SIGHUP are a KeyboardInterrupt of their name, once.

    An ignored one (`nohup`) stays so.
    """

    def stop(number: int, _: FrameType | None) -> None:
        for ending in mine:
            signal.signal(ending, signal.SIG_IGN)  # the second must not disturb the sweeping
        raise KeyboardInterrupt(signal.Signals(number).name)

    here = threading.current_thread() is threading.main_thread()
    mine = [number for number in _ENDINGS if here and signal.getsignal(number) is signal.SIG_DFL]
    for number in mine:
        signal.signal(number, stop)
    try:
        yield
    finally:
        for number in mine:
            signal.signal(number, signal.SIG_DFL)


class _Out(io.FileIO):
    """Standard output's bytes; a failed write is an OutputError, unless the reader has left."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data)
        except BrokenPipeError:
            raise
        except OSError as problem:
            raise output_error("standard output", problem) from problem


def open_streams() -> None:
    """Open the standard streams that the process was started without, before any other file.

    A closed one is replaced by the null device in the direction that fails. Else the next file
    would take its number.
    """
    for number, way in ((0, os.O_WRONLY), (1, os.O_RDONLY), (2, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, way)
    if sys.stdin is None:
        sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115
    if sys.stderr is None:
        sys.stderr = open(2, "w", encoding="utf-8", errors="backslashreplace", closefd=False)  # noqa: SIM115
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    stream = io.BufferedWriter(_Out(1, "w", closefd=False))
    sys.stdout = io.TextIOWrapper(stream, encoding, "backslashreplace", line_buffering=os.isatty(1))


def drop_output() -> None:
    """Point standard output at nothing, so that no flush at exit complains."""
    with suppress(OSError, ValueError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)


# ---- What a terminal shows while a command works: a line from two seconds on, a summary at the
# end.
#
# Nothing of it is written if standard error is no terminal.


@contextmanager
def working(*, shown: bool) -> Iterator[Callable[..., None]]:
    """A line with the present work, its duration, and of several things how many are done.

    It is shown from the third second until the context ends. The callable takes the text, and how
    many of a total are done.
    """
    if not shown:
        yield lambda *_: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    words = TextColumn("{task.description}", markup=False)
    columns = SpinnerColumn(), words, BarColumn(bar_width=20), TimeElapsedColumn()
    line = Progress(*columns, console=Console(stderr=True), transient=True)
    task, late = line.add_task("", total=None), threading.Timer(PATIENCE_S, line.start)
    late.daemon = True

    def say_so(text: str, done: int = 0, total: int = 0) -> None:
        line.update(task, description=printable(text), completed=done, total=total or None)

    late.start()
    try:
        yield say_so
    finally:
        late.cancel()
        late.join()  # it may be starting the line just now
        line.stop()


def summary(output: Path | str, rows: int, logs: int, began: float) -> None:
    """One line on a terminal: the file, its rows, of how many logs, in how long."""
    if sys.stderr.isatty():
        of = f" of {logs} logs" if logs > 1 else ""
        sys.stderr.write(
            f"{printable(str(output))}: {rows:,} row{'' if rows == 1 else 's'}{of}, "
            f"{time.monotonic() - began:.1f} s\n"
        )


def campaign_progress(quiet: bool, logs: int) -> Callable[[api.campaigns.Entry, int, int], None]:
    """A callable for each finished one of so many `logs`: it prints a line with the time left."""
    begun = time.monotonic()

    def finished(entry: api.campaigns.Entry, done: int, _: int) -> None:
        left = (time.monotonic() - begun) / done * (logs - done)
        made = f"{sum(entry.rows.values())} rows" if entry.rows else "kept for models"
        outcome = f"{made}, {entry.seconds:.1f} s, {entry.peak_memory_MB:.0f} MB"
        if entry.error:
            outcome = "stays open" if entry.fault == "machine" else "failed"
        if not quiet:
            say(f"{done}/{logs} {entry.log}: {outcome}; {left:.0f} s left")

    return finished


def say(text: str) -> None:
    """A line on standard error, as any terminal may show it."""
    with suppress(OSError, ValueError):  # nobody reads it: no reason to stop
        sys.stderr.write(f"tirelog: {printable(text)}\n")


def columns_of_rows(rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Rows as columns; a missing value is NaN or empty text."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    texts = {name for name in names if any(isinstance(row.get(name), str) for row in rows)}
    empty = {name: "" if name in texts else float("nan") for name in names}
    return {
        name: [empty[name] if row.get(name) is None else row[name] for row in rows]
        for name in names
    }


def write_json(value: Mapping[str, Any], output: Path | None) -> None:
    """A JSON document on standard output, or as a whole file."""
    write_text(json.dumps(value, indent=1) + "\n", output)


def write_text(text: str, output: Path | None) -> None:
    """A text on standard output, or as a whole file."""
    if output is None:
        typer.echo(text, nl=False)
        return
    with whole_file(output) as part:
        part.write_text(text, encoding="utf-8")


class Session:
    """One command's work on its logs, and its output.

    output, format   as given; a parquet table holds the sha256 of its logs
    hashed           compute them in any case
    drafts           a log that nobody has described is read by a draft of its setup
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
        drafts: bool = False,
    ) -> None:
        self.quiet, self.output, self.format = quiet, output, format
        self._setup_file, self._drafts = setup, drafts
        self._hashed = hashed or self._parquet()
        self._resources, self._kept = ExitStack(), list["Recording"]()
        self._noted, self._copies = set[str](), dict[str, str]()
        self._lost, self._refused = list[str](), list[TirelogError]()
        self._read = self._unread = 0
        self._streams, self._began = False, time.monotonic()
        self._tables: list[TableWriter] = []
        self.hashes, self.tires = dict[str, str](), dict[str, list[str]]()

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
        return self.format == "json" or (self.output is not None and self.output.suffix == ".json")

    def say(self, text: str) -> None:
        """Print a sentence on standard error, unless --quiet."""
        if not self.quiet:
            say(text)

    def note(self, *texts: str) -> None:
        """Remarks on standard error, each once, unless --quiet."""
        for text in texts:
            if not self.quiet and text not in self._noted:
                self._noted.add(text)
                say(f"note: {text}")

    @contextmanager
    def working_on(self, what: str = "") -> Iterator[Callable[..., None]]:
        """A line on the terminal while something takes longer; none if rows go there."""
        shown = not self.quiet and not self._streams and sys.stderr.isatty()
        with working(shown=shown) as say_so:
            say_so(what)
            yield say_so

    @cached_property
    def setup(self) -> Setup | None:
        """The setup given with --setup, read once."""
        return api.logs.as_setup(self._setup_file)

    def recordings(self, logs: list[str], *, blocks: int | None = None) -> Iterator[Recording]:
        """The logs, one after the other, each closed before the next.

        Of raw logs only the first `blocks`, if given.

        A SetupError stops the command; a log that cannot be read does not. If no log can be read,
        the command ends here with status 4, so that no empty table replaces an older one.
        """
        with self.working_on() as say_so:
            for number, log in enumerate(logs):
                say_so(f"reading {log}", number, len(logs))
                with self._opened(log, blocks) as recording:
                    if recording is not None:
                        name = recording.setup.tire.name or "the tire without a name"
                        self.tires.setdefault(name, []).append(recording.log)
                        yield recording
        self._stop_if_unread()

    def contents(self, logs: list[str]) -> Iterator[api.logs.Contents]:
        """What is in logs that have no setup, one after the other; errors as for `recordings`."""
        found = (self._known(partial(api.logs.contents, log)) for log in logs)
        yield from (inside for inside in found if inside is not None)
        self._stop_if_unread()

    def _known(self, look: Callable[[], Log]) -> Log | None:
        """The result of `look`, its remarks and losses printed; None if it cannot be read."""
        try:
            found = look()
        except ReadError as problem:
            self._unread += 1
            say(f"error: {problem}")
            return None
        self._read += 1
        self.hear(found.log, found.remarks, found.losses)
        return found

    def _stop_if_unread(self) -> None:
        """Ends the command with status 4 if there were logs and none could be read."""
        if self._unread and not self._read:
            raise typer.Exit(int(ExitStatus.NOTHING_READ))

    @contextmanager
    def _opened(self, log: str, blocks: int | None = None) -> Iterator[Recording | None]:
        """One log while it is open, or None if it cannot be read; its losses are printed."""
        with ExitStack() as resources:
            recording = self._open(log, resources, blocks)
            yield recording
            if recording is not None:
                self.hear(recording.log, losses=recording.losses)

    def parts(
        self, logs: list[str], table: str, channels: list[str] | None = None, **options: Any
    ) -> Iterator[tuple[Recording, api.parts.Part]]:
        """The rows of one table of every log, or of these `channels`, part by part (`parts_of`).

        If rows go to standard output, a log is checked whole before its first row. A file appears
        whole or not at all, so its channels need not be read twice.
        """
        api.parts.checked_options(table, options)
        first = self._streams or len(logs) > 1
        return self.parts_of(
            logs,
            lambda log: api.parts.parts_of(
                log, table, options, channels or (), refused_first=first
            ),
        )

    def parts_of(
        self, logs: list[str], made: Callable[[Recording], Iterator[api.parts.Part]]
    ) -> Iterator[tuple[Recording, api.parts.Part]]:
        """The parts `made` of every log, with their remarks printed.

        If one of several logs is refused, for its setup or its content, the error is printed. The
        others go on, and the command ends with status 3. If no log gives a part, the command ends
        here with the status of the first refusal, and writes nothing.
        """
        _ = self.setup  # one for all logs that cannot be used stops the command
        gave = False
        with self.working_on() as say_so:
            for number, log in enumerate(logs):
                say_so(log, number, len(logs))
                try:
                    with self._opened(log) as recording:
                        if recording is None:
                            continue
                        if len(logs) > 1:
                            self._note_copy(recording)
                        for part in made(recording):
                            self.hear(recording.log, part.remarks)
                            gave = True
                            yield recording, part
                except (UsageError, SetupError, ReadError, DataLoss) as problem:
                    if len(logs) == 1:
                        raise
                    self._refused.append(problem)  # printed now, and status 3 in the end
                    say(f"error: {problem if problem.file is not None else problem.at(log)}")
        self._stop_if_unread()
        if self._refused and not gave:
            raise typer.Exit(int(self._refused[0].exit_status))

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
        digest = api.logs.samples_hash(recording)
        if digest in self._copies:
            self.note(
                f"{recording.log}: holds the same samples as {self._copies[digest]}; their rows "
                "come twice"
            )
        self._copies.setdefault(digest, recording.log)

    def _open(self, log: str, resources: ExitStack, blocks: int | None) -> Recording | None:
        """One log, or None if it cannot be read; then the error is printed."""

        def opened() -> Recording:
            setup = self.setup
            if setup is None and self._drafts and not api.logs.described(log):
                setup = api.logs.drafted(log)
            return resources.enter_context(
                api.logs.open_recording(log, setup, blocks=blocks, hashed=self._hashed)
            )

        recording = self._known(opened)
        if recording is not None:
            self.hashes[recording.log] = str(recording.provenance.get("sha256", ""))
        return recording

    def hear(self, log: str, remarks: Iterable[str] = (), losses: Iterable[str] = ()) -> None:
        """Print the remarks on a log, and each loss once.

        Called when it is opened and again at its end: a damaged chunk is met while reading.
        """
        self.note(*(f"{log}: {remark}" for remark in remarks))
        for text in (f"{log}: {loss}" for loss in losses):
            if text not in self._lost:
                self.lost(text)

    def refuse_edit(self, model: Path, new_model: Path) -> None:
        """DataLoss: a log was lost, and the new model would take the place of the one it is of."""
        if (self._unread or self._lost) and new_model.exists() and new_model.samefile(model):
            raise DataLoss(
                "is not changed, since a log was not read whole",
                do="give another -o to keep the fit to the rest",
                file=new_model,
            )

    def lost(self, text: str) -> None:
        """Input was lost: print it now, and end with status 3."""
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

    def write(self, name: str, parts: Iterable[Mapping[str, Any]]) -> None:
        """A table of columns that come in parts."""
        with self.table(name) as table:
            for columns in parts:
                table.write(columns)

    def show(self, name: str, shown: str, columns: Mapping[str, Any]) -> None:
        """The page to read, unless a table is asked for."""
        if self.paged:
            typer.echo(shown)
        else:
            self.write(name, [columns])

    def write_rows(self, name: str, parts: Iterable[Sequence[Mapping[str, Any]]]) -> None:
        """A table of rows that come in parts."""
        self.write(name, map(columns_of_rows, parts))

    def __exit__(self, kind: Any, value: Any, trace: Any) -> None:
        self._resources.close()
        if isinstance(value, UsageError):
            self._stop_if_unread()  # the reason is printed already
            if self._lost:  # the answer is missing because of the loss
                say(f"error: {value}")
                raise typer.Exit(int(DataLoss.exit_status))
        if kind is not None:
            return
        for recording in self._kept:
            self.hear(recording.log, losses=recording.losses)
        self._stop_if_unread()
        for table in self._tables:
            if table.output is not None and not self.quiet:
                summary(table.output, table.rows, self._read, self._began)
        if self._unread or self._lost or self._refused:
            raise typer.Exit(int(DataLoss.exit_status))
