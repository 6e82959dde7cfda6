"""What a terminal shows while a command works: a line from two seconds on, a summary at the end.

Nothing of it is written if standard error is no terminal.
"""

from __future__ import annotations

import sys
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import Any

from tirelog.errors import printable

#: what ends sooner needs no line [s]
_PATIENCE_S = 2.0
#: what is said besides while kernels are compiled
_COMPILING = " (compiling, once on this machine)"


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
        self._compiling = False
        self._listener: Any = None

    def __enter__(self) -> Working:
        if self._shown:
            self._timer = threading.Timer(_PATIENCE_S, self._begin)
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
        self._hear_of_compiling()

    def _hear_of_compiling(self) -> None:
        """Say so while kernels are compiled: the first command of an installation takes longer."""
        if "numba" not in sys.modules:
            return
        from numba.core import event

        line = self

        class Compiling(event.Listener):
            """Told by numba when it begins, and when it has done."""

            def on_start(self, event: Any) -> None:
                line.compiling(True)

            def on_end(self, event: Any) -> None:
                line.compiling(False)

        self._listener = Compiling()
        event.register("numba:compile", self._listener)

    def compiling(self, now: bool) -> None:
        """Kernels are being compiled, or are no more."""
        with self._lock:
            self._compiling = now
            self._update()

    def _update(self) -> None:
        if self._line is not None:
            several = self._total > 1
            self._line.update(
                self._task,
                description=f"{self._text}{_COMPILING if self._compiling else ''}",
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
        if self._listener is not None:
            from numba.core import event

            event.unregister("numba:compile", self._listener)
            self._listener = None


def summary(output: Path | str, rows: int, logs: int, began: float) -> None:
    """One line on a terminal: the file, its rows, of how many logs, in how long."""
    if not sys.stderr.isatty():
        return
    of = f" of {logs} logs" if logs > 1 else ""
    sys.stderr.write(
        f"{printable(str(output))}: {rows:,} row{'' if rows == 1 else 's'}{of}, "
        f"{time.monotonic() - began:.1f} s\n"
    )
