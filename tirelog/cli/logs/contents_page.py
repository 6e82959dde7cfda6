"""The page that `info` prints of a log without a setup: every series in two or three lines."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

from tirelog.cli.common import page
from tirelog.errors import printable

if TYPE_CHECKING:
    from tirelog.drafts.contents import Contents, FoundSeries

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
    line(f"tirelog setup new {inside.log} -o {_beside(inside.log)}", 2)


def _beside(log: str) -> str:
    stem = "log" if log == "-" else log
    return (stem.rsplit(".", 1)[0] if "." in stem.rsplit("/", 1)[-1] else stem) + ".toml"


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
