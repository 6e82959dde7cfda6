"""What a log holds that a channel of a setup could name: one entry per column, field or dataset."""

from __future__ import annotations

from dataclasses import dataclass

#: entries of one log; more are not listed
MOST_SERIES = 500


@dataclass(frozen=True)
class Series:
    """A source as a setup names it; `window_nm` for a grating among peaks; `note` for a reader.

    `place` is another name of it, such as #3.
    """

    source: str
    window_nm: tuple[float, float] | None = None
    note: str = ""
    place: str = ""


@dataclass(frozen=True)
class Listed:
    """All series of a log; `time` names what tells their times, '' if nothing does by name.

    `others` are topics, columns or datasets that hold no numbers, or too few for a signal;
    `unread` are sentences on those whose numbers cannot be read.
    """

    series: tuple[Series, ...]
    time: str = ""
    others: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()
