"""What a terminal shows while a command works: a line from two seconds on, a summary at the end.

Nothing of it is written if standard error is no terminal.
"""

from __future__ import annotations

import sys
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from tirelog.errors import printable
from tirelog.runtime import PATIENCE_S

if TYPE_CHECKING:
    from tirelog.api.campaigns import Entry


class Working:
    """A line that says what is worked on and for how long; with several things how many are done.

    Entered once; the line comes after two seconds and goes when it is left.
    """

    def __init__(self, *, shown: bool) -> None:
        self._shown, self._lock = shown, threading.Lock()
        self._text, self._done, self._total = "", 0, 0
        self._line: Any = None
        self._task: Any = None
        self._timer: threading.Timer | None = None

    def __enter__(self) -> Working:
        if self._shown:
            self._timer = threading.Timer(PATIENCE_S, self._begin)
            self._timer.daemon = True
            self._timer.start()
        return self

    def say(self, text: str, done: int = 0, total: int = 0) -> None:
        """What is worked on now; `done` of a `total` before it."""
        with self._lock:
            self._text, self._done, self._total = printable(text), done, total
            self._update()

    def _begin(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

        with self._lock:
            if not self._shown:
                return
            self._line = Progress(
                SpinnerColumn(),
                TextColumn("{task.description}", markup=False),
                BarColumn(bar_width=20),
                TimeElapsedColumn(),
                console=Console(stderr=True),
                transient=True,
            )
            self._task = self._line.add_task(self._text, total=None)
            self._update()
            self._line.start()

    def _update(self) -> None:
        if self._line is not None:
            several = self._total > 1
            self._line.update(
                self._task,
                description=self._text,
                completed=self._done if several else 0,
                total=self._total if several else None,
            )

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with self._lock:
            self._shown = False
            if self._timer is not None:
                self._timer.cancel()
            if self._line is not None:
                self._line.stop()
                self._line = None


def summary(output: Path | str, rows: int, logs: int, began: float) -> None:
    """One line on a terminal: the file, its rows, of how many logs, in how long."""
    if not sys.stderr.isatty():
        return
    of = f" of {logs} logs" if logs > 1 else ""
    sys.stderr.write(
        f"{printable(str(output))}: {rows:,} row{'' if rows == 1 else 's'}{of}, "
        f"{time.monotonic() - began:.1f} s\n"
    )


class CampaignProgress:
    """A line with the time left, overwritten on a terminal; elsewhere a plain line per log."""

    def __init__(self, quiet: bool, of: int) -> None:
        self.quiet, self.begun, self.terminal = quiet, time.monotonic(), sys.stderr.isatty()
        if self.terminal and of and not quiet:  # the first log may take minutes
            sys.stderr.write(f"\r\x1b[Ktirelog: 0/{of}, working")
            sys.stderr.flush()

    def __call__(self, entry: Entry, finished: int, of: int) -> None:
        if self.quiet:
            return
        left = (time.monotonic() - self.begun) / finished * (of - finished)
        made = f"{sum(entry.rows.values())} rows" if entry.rows else "kept for models"
        outcome = (
            ("stays open" if entry.fault == "machine" else "failed")
            if entry.error
            else f"{made}, {entry.seconds:.1f} s, {entry.peak_memory_MB:.0f} MB"
        )
        line = printable(f"tirelog: {finished}/{of} {entry.log}: {outcome}; {left:.0f} s left")
        sys.stderr.write(
            f"\r\x1b[K{line}" + ("\n" if finished == of else "") if self.terminal else f"{line}\n"
        )
        sys.stderr.flush()
