"""`tirelog campaign run | status MANIFEST`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from tirelog.cli import options
from tirelog.cli.session import CampaignProgress, Session, say
from tirelog.errors import ExitStatus, printable

app = typer.Typer(
    help="Every log of a test campaign, every table, resumable.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

Manifest = Annotated[Path, typer.Argument(help="The campaign's manifest (TOML).")]
Only = Annotated[
    str | None, typer.Option("--only", help="Only logs whose path or name matches this pattern.")
]


@app.command("run")
def run(
    manifest: Manifest,
    workers: Annotated[
        int, typer.Option("--workers", min=1, max=256, help="Processes on this machine.")
    ] = 1,
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", help="Dask scheduler, tcp://HOST:PORT.")
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would be done.")] = False,
    only: Only = None,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="Try the failed logs again.")
    ] = False,
    quiet: options.Quiet = False,
) -> None:
    """Make what is not made yet: every log's tables, then the models over all logs."""
    from tirelog.api.campaigns import campaign_status, run_campaign

    session = Session(quiet=quiet)
    if dry_run:
        for log in campaign_status(manifest, only=only, retry_failed=retry_failed).logs:
            if log.made:
                typer.echo(printable(f"{log.log}: {', '.join(log.made)}"))
        return
    done = run_campaign(
        manifest,
        workers=workers,
        scheduler=scheduler,
        only=only,
        retry_failed=retry_failed,
        began=partial(CampaignProgress, quiet),
        said=session.note,
        during=session.working_on,
    )
    for loss in done.lost:
        say(f"note: {loss}")
    for error in done.failed:
        say(f"error: {error}")
    if done.failed or done.lost:
        raise typer.Exit(int(ExitStatus.INPUT_LOST))


@app.command("status")
def status(manifest: Manifest, quiet: options.Quiet = False) -> None:
    """Say what is done, failed and open; also while a run works."""
    from tirelog.api.campaigns import campaign_status

    found = campaign_status(manifest)
    typer.echo(
        f"{found.name}: {len(found.logs)} logs, {found.count('done')} done, "
        f"{found.count('failed')} failed, {found.count('open')} open"
    )
    for log in found.logs:
        if log.state == "open":
            typer.echo(printable(f"open    {log.log}"))
        elif log.state == "failed":
            typer.echo(printable(f"failed  {log.error}"))
