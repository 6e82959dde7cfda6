"""Reports: one offline page of logs, tables, a campaign, and what a model says of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path as File
from typing import Any

from tirelog.api.logs import Logs, Path, as_logs, open_log
from tirelog.data.recording import Recording
from tirelog.errors import UsageError
from tirelog.report.build import build
from tirelog.report.page import plotting_library, render
from tirelog.report.request import ReportRequest
from tirelog.storage.whole import whole_file

__all__ = ["ReportOrder", "ReportRequest", "write_report"]

_SUFFIXES = (".html", ".htm")


@dataclass(frozen=True)
class ReportOrder:
    """What a report is to be made of and written to, known to be possible before any work.

    asked    logs and files, as typed; the commands on the page name them so
    output   the page to write, .html
    """

    asked: ReportRequest
    output: File | None = None

    def __post_init__(self) -> None:
        """UsageError: nothing could come of it."""
        if not self.asked.logs and self.asked.campaign is None:
            raise UsageError(
                "nothing to report on",
                allowed="allowed are logs, runs and --campaign DIR",
                do="give one",
            )
        if self.output is None:
            raise UsageError("nothing to write", do="add -o PAGE.html")
        if self.asked.propose and self.asked.model is None:
            raise UsageError("--propose asks what a model lacks", do="give the model with --model")
        page = self.output
        if page.suffix.lower() not in _SUFFIXES and (page.is_file() or not page.exists()):
            raise UsageError(
                f"-o {page}: the page is HTML",
                allowed=f"allowed are the suffixes {', '.join(_SUFFIXES)}",
                do="rename it",
            )
        plotting_library()

    def make(
        self, recordings: Sequence[Recording], progress: Callable[[str], None] = lambda text: None
    ) -> tuple[str, ...]:
        """The page of open logs; a sentence on what was written."""
        made = build(recordings, self.asked, progress)
        assert self.output is not None
        with whole_file(self.output) as part, part.open("w", encoding="utf-8") as stream:
            stream.writelines(render(made))
            size = stream.tell()
        return (f"{self.output}: {len(made.sections)} sections, {size / 1e6:.1f} MB",)


def write_report(
    logs: Logs = (),
    output: Path | None = None,
    *,
    setup: Path | None = None,
    tables: Sequence[Path] = (),
    campaign: Path | None = None,
    model: Path | None = None,
    ladder: Path | None = None,
    channel: str | None = None,
    effects: Path | None = None,
    propose: bool = False,
    progress: Callable[[str], None] = lambda text: None,
) -> tuple[str, ...]:
    """One offline page: what was recorded, what came of it, where a model fails.

    Parameters
    ----------
    logs : str, os.PathLike, Recording or a list of them, optional
        Logs or runs, by path or open.
    output : str or os.PathLike, optional
        The page to write, .html.
    setup : str or os.PathLike, optional
        The setup of logs given by path; without it the TOML file beside each.
    tables : sequence of str or os.PathLike
        Tables already made, which are not made again.
    campaign : str or os.PathLike, optional
        A campaign's output folder.
    model, ladder : str or os.PathLike, optional
        A model file to hold against the logs, and the ladder kept beside it.
    channel, effects
        As for `measure` and `load_model`.
    propose : bool
        If something is unknown it is written down, as by `propose`.
    progress : callable, optional
        Hears what is being done, a sentence at a time.

    Returns
    -------
    tuple of str
        A sentence on the page that was written.

    Raises
    ------
    UsageError
        Nothing to report on or to write, or a file that is none of what it was given as.
    ReadError, SetupError
        As `open_log`.
    """
    given: dict[str, Any] = {"setup": setup, "model": model, "ladder": ladder}
    given |= {"campaign": campaign, "effects": effects}
    paths = {name: None if path is None else File(path) for name, path in given.items()}
    named = as_logs(logs)
    order = ReportOrder(
        ReportRequest(
            tuple(log.log if isinstance(log, Recording) else os.fspath(log) for log in named),
            tables=tuple(map(File, tables)),
            channel=channel,
            propose=propose,
            **paths,
        ),
        None if output is None else File(output),
    )
    with ExitStack() as resources:
        opened = [
            log if isinstance(log, Recording) else resources.enter_context(open_log(log, setup))
            for log in named
        ]
        return order.make(opened, progress)
