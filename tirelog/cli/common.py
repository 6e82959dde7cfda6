"""What the commands share.

Common options, and a session that opens logs and adds up what was lost.

    with Session(setup, quiet, hashed=keeps_hashes(output, format)) as session:
        with session.table("speed", output, format) as table:
            for recording, part in session.parts(logs, "speed"):
                table.write(part.columns)

A session says each recording's remarks once on standard error, goes on with the next log if one
cannot be read or made a table of, and ends with status 3 then or if input was lost (4 if nothing
at all could be read).
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tirelog.cli import completion
from tirelog.cli.targets import drawable, in_a_folder
from tirelog.cli.working import Working, summary
from tirelog.errors import (
    DataLoss,
    ExitStatus,
    ReadError,
    SetupError,
    TirelogError,
    UsageError,
    printable,
    refuse_unknown,
)

if TYPE_CHECKING:
    from rich.console import Console

    from tirelog.data.recording import Recording
    from tirelog.data.setup import Setup
    from tirelog.drafts.contents import Contents
    from tirelog.products import Part
    from tirelog.tables.writer import TableWriter


def plot_kind(kinds: Mapping[str, str]) -> Any:
    """The option --plot-kind of a command that draws these; one it cannot is refused at once."""

    def known(kind: str) -> str:
        refuse_unknown(kind, kinds, f"--plot-kind {kind}", do="choose one")
        return kind

    return typer.Option(
        "--plot-kind",
        help=f"What --plot draws: {', '.join(kinds)}.",
        callback=known,
        autocompletion=lambda incomplete: [kind for kind in kinds if kind.startswith(incomplete)],
    )


def refuse_kind_alone(kind: str, plot: Path | None) -> None:
    """UsageError: --plot-kind names a picture, and no --plot says where to draw it."""
    if plot is None and kind != "page":
        raise UsageError(
            f"--plot-kind {kind} without --plot",
            allowed="it says what --plot draws",
            do="add --plot FILE",
        )


Logs = Annotated[
    list[str], typer.Argument(help="Logs or runs; '-' is standard input.", show_default=False)
]
SetupFile = Annotated[
    Path | None,
    typer.Option(
        "--setup", help="Setup file; without it FILE.toml beside the log.", show_default=False
    ),
]
Output = Annotated[
    Path | None,
    typer.Option(
        "-o",
        "--output",
        help="File to write; its suffix decides the format.",
        show_default=False,
        callback=in_a_folder,
    ),
]
Format = Annotated[
    str | None,
    typer.Option(
        "--format",
        help="csv, ndjson, parquet or json.",
        show_default=False,
        autocompletion=completion.formats,
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", help="No remarks on standard error.")]
Plot = Annotated[
    Path | None,
    typer.Option(
        "--plot",
        help="Picture to write, .png, .svg or .pdf.",
        show_default=False,
        callback=drawable,
    ),
]
EffectsFile = Annotated[
    Path | None,
    typer.Option(
        "--effects",
        help="Python file with effects of your own; it is run. A model with one of them "
        "remembers it.",
        show_default=False,
    ),
]
ChannelName = Annotated[
    str | None,
    typer.Option(
        "--channel",
        help="Channel to compare; the first that fits by default. Of strain several gratings in "
        "one fit: their names with commas between, or all.",
        show_default=False,
        autocompletion=completion.channels,
    ),
]
Channels = Annotated[
    list[str] | None,
    typer.Option(
        "--channel",
        help="Only this channel; several times for several (default: all that fit).",
        show_default=False,
        autocompletion=completion.channels,
    ),
]
ModelFile = Annotated[Path, typer.Option("--model", help="Model file.", show_default=False)]


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


def keeps_hashes(output: Path | None, format: str | None) -> bool:
    """True if the table asked for carries the sha256 of its inputs: parquet has room for them."""
    from tirelog.tables.writer import table_format

    return table_format(output, format) == "parquet"


class Session:
    """One command's work on its logs; `hashed` if it tells their sha256.

    `tires`: the logs that were read, by the tire that their setups name.
    """

    def __init__(self, setup: Path | None, quiet: bool = False, *, hashed: bool = False) -> None:
        self.quiet, self._hashed = quiet, hashed
        self._setup_file = setup
        self._shared: Setup | None = None
        self._resources = ExitStack()
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

    def note(self, text: str) -> None:
        """A remark on standard error, unless --quiet."""
        if not self.quiet:
            say(f"note: {text}")

    def working(self) -> Working:
        """A line on the terminal while something takes longer; none if rows go there."""
        return Working(shown=not self.quiet and not self._streams and sys.stderr.isatty())

    def setup(self) -> Setup | None:
        """The setup given with --setup, read once."""
        if self._shared is None and self._setup_file is not None:
            from tirelog.data.setup import load_setup

            self._shared = load_setup(self._setup_file)
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
        from tirelog.drafts.contents import contents

        for log in logs:
            try:
                inside = contents(log)
            except ReadError as problem:
                self._unread.append(log)
                say(f"error: {problem}")
                continue
            self._read += 1
            for remark in inside.remarks:
                self.note(f"{log}: {remark}")
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
        from tirelog.products import checked, tables_of, with_channels

        given = {name: value for name, value in options.items() if value is not None}
        wanted = checked({table: given})
        return self.parts_of(
            logs,
            lambda recording: tables_of(
                with_channels(recording, channels, wanted) if channels else recording,
                wanted,
                refused_first=self._streams or len(logs) > 1,
            ),
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
                told = set()
                try:
                    with self._opened(log) as recording:
                        if recording is None:
                            continue
                        for part in made(recording):
                            for remark in part.remarks:
                                if remark not in told:
                                    told.add(remark)
                                    self.note(f"{log}: {remark}")
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
        return self._kept

    def _open(self, log: str, resources: ExitStack, blocks: int | None) -> Recording | None:
        """One log, or None if it cannot be read (which has been said)."""
        from tirelog.runs.ingest import open_recording

        try:
            recording = resources.enter_context(
                open_recording(log, self.setup(), blocks=blocks, hashed=self._hashed)
            )
        except ReadError as problem:
            self._unread.append(log)
            say(f"error: {problem}")
            return None
        self._read += 1
        self.hashes[recording.log] = str(recording.provenance.get("sha256", ""))
        for remark in recording.remarks:
            self.note(f"{log}: {remark}")
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

    def lost(self, text: str) -> None:
        """Input was lost: said now, and status 3 in the end."""
        self._lost.append(text)
        say(f"error: {text}")

    def table(
        self, name: str, output: Path | None, format: str | None, **metadata: Any
    ) -> TableWriter:
        """A writer for the command's table."""
        from tirelog.tables.writer import TableWriter

        self._streams |= output is None
        writer = TableWriter(name, output, format, metadata={"inputs": self.hashes, **metadata})
        self._tables.append(writer)
        return writer

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
