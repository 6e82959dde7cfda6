"""The page that `ingest` and `info` print."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

from tirelog.cli.common import page
from tirelog.data.recording import Recording
from tirelog.errors import printable
from tirelog.runs.overview import channel_rows

if TYPE_CHECKING:
    from rich.console import Console

#: columns of a page that no terminal shows
_WIDTH = 160


def _stacked(console: Console, cells: dict[str, list[str]]) -> None:
    """Channel by channel, for a terminal that is narrower than the table: nothing is cut off."""
    for row in zip(*cells.values(), strict=True):
        of = dict(zip(cells, row, strict=True))
        console.print(f"{of.pop('channel')}: {of.pop('kind')}, unit {of.pop('unit')}")
        told = [f"{name} {text}" for name, text in of.items()]
        for line in textwrap.wrap(", ".join(told), max(console.width - 2, 20)):
            console.print(f"  {line}")


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
    rows = {name: v for name, v in channel_rows(recording).items() if name != "log"}
    cells = {
        name: [f"{x:,.6g}" if isinstance(x, float) else printable(str(x)) for x in values]
        for name, values in rows.items()
    }
    across = sum(max(map(len, (name, *texts))) + 2 for name, texts in cells.items())
    if across > console.width:
        _stacked(console, cells)
    else:
        table = Table(box=None, pad_edge=False)
        for name in cells:
            left = name in ("channel", "kind", "unit")
            table.add_column(name, justify="left" if left else "right", no_wrap=True)
        for row in zip(*cells.values(), strict=True):
            table.add_row(*row)
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
