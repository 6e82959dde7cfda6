"""`tirelog campaign run | status MANIFEST`."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tirelog.cli.common import Quiet, Session, say
from tirelog.errors import ExitStatus, printable

if TYPE_CHECKING:
    from tirelog.campaign.ledger import Entry, Ledger
    from tirelog.campaign.manifest import Campaign

app = typer.Typer(
    help="Every log of a test campaign, every table, resumable.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

Manifest = Annotated[
    Path, typer.Argument(help="The campaign's manifest (TOML).", show_default=False)
]
Only = Annotated[
    str | None,
    typer.Option(
        "--only", help="Only logs whose path or name matches this pattern.", show_default=False
    ),
]


def _load(manifest: Path) -> tuple[Campaign, Ledger]:
    from tirelog.campaign.folder import folder_at
    from tirelog.campaign.ledger import Ledger
    from tirelog.campaign.manifest import load_manifest
    from tirelog.products import OF_A_DRIVE

    campaign = load_manifest(manifest, {name: maker.options for name, maker in OF_A_DRIVE.items()})
    return campaign, Ledger(folder_at(campaign.output))


@app.command("run")
def run(
    manifest: Manifest,
    workers: Annotated[
        int, typer.Option("--workers", min=1, max=256, help="Processes on this machine.")
    ] = 1,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", help="Dask scheduler, tcp://HOST:PORT.", show_default=False),
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would be done.")] = False,
    only: Only = None,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="Try the failed logs again.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Make what is not made yet: every log's tables, then the models over all logs."""
    from tirelog.campaign.runner import plan_tasks, strangers, to_do, write_summary
    from tirelog.campaign.runner import run_tasks as carry_out

    campaign, ledger = _load(manifest)
    if dry_run:
        for task in to_do(
            plan_tasks(campaign, ledger, only=only), ledger, retry_failed=retry_failed
        ):
            made = ", ".join([*task.tables, *(f"{name} for models" for name in task.observables)])
            typer.echo(printable(f"{task.log}: {made}"))
        return
    with ledger.folder.held():
        tasks = plan_tasks(campaign, ledger, only=only)
        ledger.save_hashes()
        open_tasks = to_do(tasks, ledger, retry_failed=retry_failed)
        carry_out(
            campaign,
            ledger,
            open_tasks,
            workers=workers,
            scheduler=scheduler,
            said=_Progress(quiet, len(open_tasks)),
        )
        summary = write_summary(campaign, ledger)
        failed = [
            entry
            for task in tasks
            if (entry := ledger.entry(task.name)) is not None and (entry.error or entry.losses)
        ]
        if not quiet:
            say(
                f"note: {len(open_tasks)} of {len(tasks)} logs worked on, "
                f"{len(tasks) - len(open_tasks)} were done; {summary}"
            )
            if more := strangers(campaign, ledger):
                say(
                    "note: the dataset holds logs that the manifest does not have: "
                    f"{', '.join(more)}; remove their log=... folders"
                )
        unmade = []
        if campaign.models and only is not None and not quiet:
            say("note: models are over the whole campaign; they are left to a run without --only")
        if campaign.models and only is None:
            from tirelog.campaign.models import run_models

            with Session(None, quiet).working() as line:
                line.say("models over the whole campaign")
                unmade = run_models(
                    campaign, ledger, tasks, say if not quiet else lambda text: None
                )
    for entry in failed:
        say(
            f"error: {entry.error}"
            if entry.error
            else f"note: {entry.log}: lost: {'; '.join(entry.losses)}"
        )
    for error in unmade:
        say(f"error: {error}")
    if failed or unmade:
        raise typer.Exit(int(ExitStatus.INPUT_LOST))


@app.command("status")
def status(manifest: Manifest) -> None:
    """Say what is done, failed and open; also while a run works."""
    from tirelog.campaign.runner import plan_tasks, to_do

    campaign, ledger = _load(manifest)
    tasks = plan_tasks(campaign, ledger)
    waiting = {task.name for task in to_do(tasks, ledger)}
    failed = {
        task.name: entry
        for task in tasks
        if (entry := ledger.entry(task.name)) is not None
        and entry.error
        and task.name not in waiting
    }
    typer.echo(
        f"{campaign.name}: {len(tasks)} logs, {len(tasks) - len(waiting) - len(failed)} done, "
        f"{len(failed)} failed, {len(waiting)} open"
    )
    for task in tasks:
        if task.name in waiting:
            typer.echo(printable(f"open    {task.log}"))
        elif task.name in failed:
            typer.echo(printable(f"failed  {failed[task.name].error}"))


class _Progress:
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
            "failed"
            if entry.error
            else f"{made}, {entry.seconds:.1f} s, {entry.peak_memory_MB:.0f} MB"
        )
        line = printable(f"tirelog: {finished}/{of} {entry.log}: {outcome}; {left:.0f} s left")
        sys.stderr.write(
            f"\r\x1b[K{line}" + ("\n" if finished == of else "") if self.terminal else f"{line}\n"
        )
        sys.stderr.flush()
