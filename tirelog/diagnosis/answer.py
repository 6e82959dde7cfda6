"""An answer about logs and a model: one frozen record, which everybody renders.

    Comparison, Diagnosis, Ladder, Proposal, FitOfLogs, TireForm
        headline, tables, sentences  -> terminal, notebook, page
        figure                       -> file, notebook
        to_json                      -> programs

Numbers of a table stand in the unit in which a person reads them; whoever shows one rounds them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from tirelog.tables.writer import document, table

if TYPE_CHECKING:
    from matplotlib.axes import Axes


#: the module of the pictures, which loads a library of plots: only when one is drawn
PICTURES = "tirelog.plots.answers"


@dataclass(frozen=True)
class AnswerTable:
    """A small table to read: words and numbers, None for nothing."""

    caption: str
    names: Sequence[str]
    rows: Sequence[Sequence[Any]]

    def columns(self, *names: str) -> AnswerTable:
        """The table with these columns alone."""
        at = [self.names.index(name) for name in names]
        return AnswerTable(self.caption, names, [[row[i] for i in at] for row in self.rows])


class AnswerRecord:
    """What every answer has: a headline, tables and sentences below it, and a figure.

    `picture` and `panel`: functions of `plots.answers` that take the answer: its figure,
    and the main panel of that.
    """

    picture: ClassVar[str]
    panel: ClassVar[str]

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        raise NotImplementedError

    def below(self) -> tuple[Sequence[AnswerTable], Sequence[str]]:
        """What a notebook shows below the headline: tables, and sentences."""
        return (), ()

    def plot(self, path_or_axes: str | Path | Axes | None = None, **how: str) -> Any:
        """The figure.

        path_or_axes  a file to write it to as well (.png, .svg, .pdf), or axes that get its main
                      panel alone
        kind          of a comparison: "page", "polar" (around the wheel, with the contact pressure)
                      or "edges" (of the patch, close up)

        UsageError: no picture has the path's suffix.
        """
        if path_or_axes is not None and not isinstance(path_or_axes, str | Path):
            panel = resolve_name(f"{PICTURES}:{self.panel}")(self)
            resolve_name("tirelog.plots.style:draw_panel")(path_or_axes, panel)
            return path_or_axes.figure
        figure = resolve_name(f"{PICTURES}:{self.picture}")(self, **how)
        if path_or_axes is not None:
            resolve_name("tirelog.plots.style:write")(figure, Path(path_or_axes))
        return figure

    def draw(self, path: Path, **how: str) -> list[Path]:
        """The pictures as files: the first at `path`; those beside it come back."""
        self.plot(path, **how)
        return []

    def __repr__(self) -> str:
        return self.headline

    def _repr_html_(self) -> str:
        tables, sentences = self.below()
        return document(self.headline, [table(t.names, t.rows) for t in tables], sentences)


def in_unit(error: float | None, factor: float) -> str:
    """An error to read, times `factor`; a dash if there is none."""
    return "-" if error is None else f"{error * factor:.3g}"


def excess_of(rmse: float, floor: float) -> float:
    """sqrt(rmse^2 - floor^2), zero if the error lies below the floor."""
    return float(np.sqrt(max(rmse**2 - floor**2, 0.0)))


def plain_fields(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values by name as JSON takes them (`plain_values`)."""
    return {str(name): plain_values(value) for name, value in values.items()}


def plain_values(value: Any) -> Any:
    """The same without numpy types, tuples as lists, not-a-number and infinity as None."""
    if isinstance(value, Mapping):
        return plain_fields(value)
    if isinstance(value, list | tuple):
        return [plain_values(v) for v in value]
    if isinstance(value, np.ndarray):
        return plain_values(value.tolist())
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value
