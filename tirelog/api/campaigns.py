"""Campaigns: every log of a test, every table, and the models over all of them."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path as File
from typing import Any

from tirelog.api.logs import Path
from tirelog.campaign.ledger import Entry, Folder, Ledger
from tirelog.campaign.manifest import Campaign, LogTask, load_manifest
from tirelog.campaign.runner import plan_tasks, run_tasks, strangers, to_do, write_summary

__all__ = [
    "CampaignOutcome",
    "CampaignStatus",
    "Entry",
    "LogStatus",
    "campaign_status",
    "run_campaign",
]  # fmt: skip


@dataclass(frozen=True)
class LogStatus:
    """A log of a campaign: "done", "open" or "failed", and why; what is to be made of it."""

    log: str
    state: str
    error: str
    made: tuple[str, ...]


@dataclass(frozen=True)
class CampaignStatus:
    """How far a campaign is, log by log."""

    name: str
    logs: tuple[LogStatus, ...]

    def count(self, state: str) -> int:
        """The logs in this state."""
        return sum(log.state == state for log in self.logs)


@dataclass(frozen=True)
class CampaignOutcome:
    """The outcome of a run of a campaign.

    summary   the file with a row per log
    worked    logs that were worked on; the others were done before
    failed    sentences on logs and models that failed, and on logs that stay open after a fault of
              a store or the machine
    lost      sentences on logs whose input was lost in part
    """

    summary: str
    logs: int
    worked: int
    failed: tuple[str, ...]
    lost: tuple[str, ...]


def campaign_status(
    manifest: Path, *, only: str | None = None, retry_failed: bool = False
) -> CampaignStatus:
    """Which logs of a campaign are done, failed and open; also during a run.

    Parameters
    ----------
    manifest : str or os.PathLike
        The campaign's manifest (TOML).
    only : str, optional
        Only the logs whose path or name matches this pattern.
    retry_failed : bool
        Count failed logs among the open ones, as `run_campaign` with it does.

    Returns
    -------
    CampaignStatus
        ``logs`` with their ``state``, ``error`` and what is to be ``made`` of them.

    Raises
    ------
    UsageError, ReadError
        The manifest is none, or its output folder cannot be read.
    """
    campaign, ledger = _campaign(manifest)
    tasks = plan_tasks(campaign, ledger, only=only)
    waiting = {task.name: task for task in to_do(tasks, ledger, retry_failed=retry_failed)}
    return CampaignStatus(
        campaign.name, tuple(_log(task, waiting.get(task.name), ledger) for task in tasks)
    )


def _log(task: LogTask, waiting: LogTask | None, ledger: Ledger) -> LogStatus:
    if waiting is not None:
        kept = (f"{name} for models" for name in waiting.observables)
        return LogStatus(task.log, "open", "", (*waiting.tables, *kept))
    entry = ledger.entries.get(task.name)
    error = "" if entry is None else entry.error
    return LogStatus(task.log, "failed" if error else "done", error, ())


def _campaign(manifest: Path) -> tuple[Campaign, Ledger]:
    campaign = load_manifest(File(manifest))
    return campaign, Ledger(Folder(campaign.output))


def run_campaign(
    manifest: Path,
    *,
    workers: int = 1,
    only: str | None = None,
    retry_failed: bool = False,
    began: Callable[[int], Callable[[Entry, int, int], None]] | None = None,
    progress: Callable[[str], None] = lambda text: None,
    during: Callable[[str], AbstractContextManager[Any]] = nullcontext,
) -> CampaignOutcome:
    """All that is not made yet: every log's tables, then the models over all logs.

    Parameters
    ----------
    manifest : str or os.PathLike
        The campaign's manifest (TOML).
    workers : int
        Processes on this machine.
    only, retry_failed
        As for `campaign_status`; models are over all logs, and left out with `only`.
    began : callable, optional
        Called with the number of open logs; the callable that it returns is called with the
        entry of each finished log, its number and the number of all.
    progress : callable, optional
        Called with remarks, a sentence at a time.
    during : callable, optional
        Called with a sentence; the context that it returns is open while the models are made.

    Returns
    -------
    CampaignOutcome
        ``failed`` and ``lost`` in sentences, and the ``summary``'s path.

    Raises
    ------
    UsageError, ReadError
        As `campaign_status`; another run holds the output folder.
    OutputError
        The output cannot be written.
    """
    campaign, ledger = _campaign(manifest)
    failed: list[str] = []
    with ledger.folder.held():
        tasks = plan_tasks(campaign, ledger, only=only)
        ledger.save_hashes()
        left = to_do(tasks, ledger, retry_failed=retry_failed)
        report = began(len(left)) if began is not None else lambda entry, number, of: None
        left_open = run_tasks(
            campaign,
            ledger,
            left,
            workers=workers,
            report=report,
        )
        summary = write_summary(campaign, ledger)
        for remark in campaign.remarks:
            progress(remark)
        progress(f"{len(left)} of {len(tasks)} logs worked on, {len(tasks) - len(left)} were done; "
             f"{summary}")  # fmt: skip
        if more := strangers(campaign, ledger):
            progress(
                "the dataset holds logs that the manifest does not have: "
                f"{', '.join(more)}; remove their log=... folders"
            )
        entries = [e for task in tasks if (e := ledger.entries.get(task.name)) is not None]
        if campaign.models and only is not None:
            progress("models are over the whole campaign; they need a run without --only")
        elif campaign.models and left_open:
            progress("models are over the whole campaign; they need a run that leaves none open")
        elif campaign.models:
            from tirelog.campaign.models import run_models

            with during("models over the whole campaign"):
                failed = run_models(campaign, ledger, tasks, progress)
    return CampaignOutcome(
        summary,
        len(tasks),
        len(left),
        (
            *(entry.error for entry in entries if entry.error),
            *(f"{error}; it stays open, run it again" for error in left_open),
            *failed,
        ),
        tuple(
            f"{entry.log}: lost: {'; '.join(entry.losses)}"
            for entry in entries
            if entry.losses and not entry.error
        ),
    )
