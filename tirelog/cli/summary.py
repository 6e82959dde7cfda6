"""The page that `ingest` and `info` print."""

from __future__ import annotations

from tirelog.cli.common import page
from tirelog.data.recording import Recording
from tirelog.errors import printable
from tirelog.runs.overview import channel_rows

#: columns of a page that no terminal shows
_WIDTH = 160


def print_summary(recording: Recording) -> None:
    """The page, on standard output."""
    from rich.table import Table

    console = page(_WIDTH)
    about = recording.provenance
    size = (
        f", {about['bytes']:,} bytes, sha256 {about['sha256'][:12]}" if about.get("sha256") else ""
    )
    console.print(printable(f"{recording.log}: {about.get('format', 'log')}{size}"))
    if about.get("start"):
        console.print(printable(f"started {about['start']}"))
    rows = channel_rows(recording)
    table = Table(box=None, pad_edge=False)
    for name in list(rows)[1:]:
        table.add_column(
            name, justify="left" if name in ("channel", "kind", "unit") else "right", no_wrap=True
        )
    for i in range(len(rows["channel"])):
        table.add_row(
            *(
                f"{v[i]:,.6g}" if isinstance(v[i], float) else str(v[i])
                for name, v in rows.items()
                if name != "log"
            )
        )
    console.print(table)
    repairs = {
        f"{group}: {what}": n
        for group, done in about.get("repairs", {}).items()
        for what, n in done.items()
        if n
    }
    for what, n in repairs.items():
        console.print(printable(f"repaired in the time axis of {what}: {n}"))
    for what, n in about.get("counts", {}).items():
        if n and not what.startswith("lost_samples"):
            console.print(printable(f"{what}: {n}"))
    tire, conditions = recording.setup.tire, recording.setup.conditions
    known = {
        **{k: v for k, v in tire.__dict__.items() if v},
        **{k: v for k, v in conditions.__dict__.items() if v is not None},
    }
    if known:
        console.print(printable("setup: " + ", ".join(f"{k} {v}" for k, v in known.items())))
