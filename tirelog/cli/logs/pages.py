"""The pages that `ingest` and `info` print: of a log with a setup, and of one without."""

from __future__ import annotations

import re
import shlex
import textwrap
from typing import TYPE_CHECKING

from tirelog.cli.session import page
from tirelog.cli.text import console_table
from tirelog.errors import printable

if TYPE_CHECKING:
    from rich.console import Console

    from tirelog.api.setups import Contents, FoundSeries
    from tirelog.data.recording import Recording

#: columns of a page: as wide as a terminal, and no wider than one reads with ease
_WIDEST = 100
#: topics or columns without numbers that are named
_MOST_OTHERS = 8


def print_contents(inside: Contents) -> None:
    """The page, on standard output; nothing is cut off, however narrow the terminal."""
    console = page(_WIDEST)
    width = max(min(console.width, _WIDEST), 40)

    def line(text: str, indent: int = 0) -> None:
        for part in textwrap.wrap(
            printable(text),
            width,
            initial_indent=" " * indent,
            subsequent_indent=" " * (indent + 2),
            break_on_hyphens=False,
        ):
            console.print(part)

    many = len(inside.found)
    line(f"{inside.log}: {inside.format}, {many} series" + ("" if many != 1 else " of numbers"))
    if inside.start:
        line(f"started {inside.start}")
    stated = any(one.rate_Hz for one in inside.found)
    line(f"time: {inside.time or ('the rate that the file states' if stated else 'none is found')}")
    if not inside.whole:
        line("only the beginning was looked at")
    for one in inside.found:
        console.print()
        line(one.series.source + (f" [{one.unit}]" if one.unit else ""))
        line(_facts(one), 2)
        line(_likely(one), 2)
    if inside.others:
        console.print()
        rest = ", ..." if len(inside.others) > _MOST_OTHERS else ""
        line(f"without numbers, or too short: {', '.join(inside.others[:_MOST_OTHERS])}{rest}")
    console.print()
    line("No setup was given. A first one, to be mended:")
    line(shlex.join(["tirelog", "setup", "new", inside.log, "-o", _beside(inside.log)]), 2)


def _beside(log: str) -> str:
    """The setup's name that is found beside the log: its own, packed or not, with .toml."""
    stem = "log" if log == "-" else re.sub(r"\.(gz|zst|xz)$", "", log)
    return re.sub(r"(?<=[^/])\.[^./]*$", "", stem) + ".toml"


def _facts(one: FoundSeries) -> str:
    """Range, rate, size and first values."""
    known = one.known
    if not known.size:
        return f"{one.samples.size:,} samples, all of them lost"
    rate = f"{one.rate_Hz:,.6g} Hz" if one.rate_Hz else "no rate is known"
    lost = one.samples.size - known.size
    first = ", ".join(f"{x:.8g}" for x in known[:3].tolist())
    facts = [
        f"{known.min():.8g} to {known.max():.8g}",
        rate,
        f"{one.samples.size:,} samples looked at" + (f" ({lost:,} lost)" if lost else ""),
        f"first {first}",
    ]
    return "; ".join(facts + ([one.series.note] if one.series.note else []))


def _likely(one: FoundSeries) -> str:
    if one.guess.kind == "signal":
        return f"kind unknown: {one.guess.reason}"
    return f"likely {one.guess.kind} in {one.guess.unit}: {one.guess.reason}"


#: columns of a page that no terminal shows
_SUMMARY_WIDTH = 160


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
    from tirelog.api.logs import channels

    console = page(_SUMMARY_WIDTH)
    about = recording.provenance
    size = (
        f", {about['bytes']:,} bytes, sha256 {about['sha256'][:12]}" if about.get("sha256") else ""
    )
    console.print(printable(f"{recording.log}: {about.get('format', 'log')}{size}"))
    if about.get("start"):
        console.print(printable(f"started {about['start']}"))
    rows = {name: v for name, v in channels(recording).items() if name != "log"}
    cells = {
        name: [f"{x:,.6g}" if isinstance(x, float) else printable(str(x)) for x in values]
        for name, values in rows.items()
    }
    across = sum(max(map(len, (name, *texts))) + 2 for name, texts in cells.items())
    if across > console.width:
        _stacked(console, cells)
    else:
        left = [i for i, name in enumerate(cells) if name in ("channel", "kind", "unit")]
        console.print(console_table(list(cells), zip(*cells.values(), strict=True), left))
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
        **tire.known(),
        **{k: v for k, v in conditions.__dict__.items() if v is not None},
    }
    if known:
        console.print(printable("setup: " + ", ".join(f"{k} {v}" for k, v in known.items())))
