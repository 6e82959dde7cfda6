"""Pictures: of tables as they are made, and of a log, a table, a model or an answer that is there.

open log --parts_of--> TablePicture.keep --> the picture of a table as its command makes it
files --role_of--> logs that are open, tables, a model, an answer --figure_of--> a figure
    --show--> a file or a window
"""

from __future__ import annotations

import codecs
import json
import math
import os
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path as File
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from tirelog.api.logs import Logs, Path, SetupLike, as_logs, each_log
from tirelog.api.models import load_model
from tirelog.api.parts import Part, parts_of, stretch_s
from tirelog.data.recording import Recording
from tirelog.diagnosis.results import read_ladder
from tirelog.errors import TirelogError, UsageError, refuse_unknown
from tirelog.runs.ingest import is_file
from tirelog.storage.whole import LARGEST_BYTES, bounded_input, json_value, open_input, toml_role
from tirelog.vocabulary.columns import COLUMNS
from tirelog.vocabulary.tables import LOG_PICTURES, LOG_TABLES, STRETCH, LogTable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["TablePicture", "figure_of", "plot", "plot_table", "show"]


class TablePicture:
    """A picture of a table, of the parts that are kept; `ends`: of a stretch, `start` and `stop`.

    UsageError: the table has no picture, or its picture is of the whole log and not of a stretch.
    """

    def __init__(self, table: LogTable, ends: Mapping[str, Any] = {}) -> None:
        if not table.picture:
            raise UsageError(f"{table.name} has no picture", do="draw its rows with `tirelog plot`")
        if table.drawn == "whole":
            _refuse_stretch(f"the picture of {table.name}", ends)
        self.table, self.kept = table, list[Any]()

    def keep(self, recording: Recording, part: Part) -> None:
        """Keep the content of a part, while its log is open."""
        sketch = resolve_name(self.table.sketch) if self.table.sketch else None
        self.kept.append(sketch(recording, part) if sketch else (recording, part))

    def draw(self, path: Path | None) -> Figure | None:
        """The figure, None without rows to draw; a file of it if a path is given."""
        if not self.kept:
            return None
        figure: Figure | None = resolve_name(self.table.picture)(self.kept)
        if path is not None and figure is not None:
            show(figure, path)
        return figure


def _refuse_stretch(what: str, ends: Mapping[str, Any]) -> None:
    """UsageError: a stretch is asked for, of what is of the whole log."""
    if any(ends.get(end.name) is not None for end in STRETCH):
        raise UsageError(
            f"{what} is of the whole log",
            allowed="a stretch is for rows and signals",
            do="leave out the picture, or --from and --to",
        )


def plot_table(
    name: str,
    logs: Logs,
    path: Path | None = None,
    setup: SetupLike | None = None,
    **options: Any,
) -> Figure | None:
    """The picture of a table, which a notebook shows; a file of it if a path is given.

    Parameters
    ----------
    name : str
        The table's command, such as ``"footprint"``.
    logs, setup
        As for `speed`.
    path : str or os.PathLike, optional
        The picture to write: .png, .svg or .pdf.
    **options
        The table's options, as in campaigns.

    Returns
    -------
    matplotlib.figure.Figure
        The picture; None if no log has rows.

    Raises
    ------
    UsageError
        No such table, picture or option, or a log that it cannot be drawn of.
    """
    refuse_unknown(name, LOG_TABLES, f"no table is called {name!r}", do="choose among them")
    picture = TablePicture(LOG_TABLES[name], options)
    for recording in each_log(logs, setup):
        for part in parts_of(recording, name, options):
            picture.keep(recording, part)
    return picture.draw(path)


# ---- What is there: logs, tables, a model, an answer.


#: how rows in JSON begin
_ROWS = re.compile(rb"\[\s*\{")


def role_of(what: Sequence[Path | Recording]) -> str:
    """What paths lead to: "log", "table", "model" or "answer", by their first bytes.

    UsageError: to files of several kinds, to several models, or to several answers.
    """
    roles = list(dict.fromkeys(_role(one) for one in what))
    if len(roles) > 1 or (len(what) > 1 and roles[0] in ("model", "answer")):
        raise UsageError(
            f"one picture of {', '.join(map(str, what))} ({' and '.join(roles)})",
            allowed="allowed are several logs, several tables, one model or one answer",
            do="draw them one by one",
        )
    return roles[0]


def _role(one: Path | Recording) -> str:
    """What one path leads to; whatever is nothing else is a log, or is refused as one."""
    if isinstance(one, Recording) or not is_file(os.fspath(one)):
        return "log"
    with open_input(os.fspath(one)) as stream:
        head = stream.read(LARGEST_BYTES).removeprefix(codecs.BOM_UTF8).lstrip()
    if str(one).endswith(".toml"):
        return "model" if toml_role(head.decode("utf-8", "replace"))[0] == "a model" else "log"
    if _ROWS.match(head):
        return "table"
    first, names = head.split(b"\n", 1)[0], list[str]()
    with suppress(Exception):  # damaged bytes are no table
        if head.startswith(b"PAR1"):
            import pyarrow.parquet as pq

            names = list(pq.read_schema(os.fspath(one)).names)
        else:
            line = first.decode("utf-8").strip()
            names = list(json.loads(line)) if line.startswith("{") else line.split(",")
    # a log begins with its time, or has columns that no table has
    own = len(names) > 1 and names[0] != "time_s" and set(names) <= set(COLUMNS)
    if own or names[:2] == ["log", "channel"]:
        return "table"
    return "answer" if head.startswith(b"{") else "log"


def figure_of(
    what: Sequence[Path | Recording],
    logs: Iterable[Recording],
    kind: str = "",
    channels: Collection[str] = (),
    ends: Mapping[str, Any] = {},
    note: Callable[[str], object] = lambda text: None,
) -> Figure:
    """The picture of logs, tables, a model or an answer; `logs`: those in `what`, once open.

    Of logs a `kind` of `vocabulary.tables.LOG_PICTURES`, these `channels` or all, a stretch or all;
    `note` takes remarks. UsageError: as `role_of`, no such kind or channel, a stretch of a picture
    of the whole log, or nothing to draw. ReadError, SetupError, ModelError: a file is none.
    """
    role = role_of(what)
    if role == "log":
        return _of_logs(logs, kind, channels, ends, note)
    paths = [os.fspath(str(one)) for one in what]
    if kind not in ("", "signal") or channels or any(end is not None for end in ends.values()):
        raise UsageError(
            f"--kind, --channel, --from or --to for a picture of {paths[0]} ({role})",
            allowed="they are allowed for logs",
            do="leave them out",
        )
    if role == "model":
        made: Figure = resolve_name("tirelog.plots.answers:model_picture")(load_model(paths[0]))
        return made
    if role == "answer":
        return _of_answer(File(paths[0]))
    parts = [part for path in paths for part in _parts_of_table(path)]
    if not parts:
        raise UsageError(f"{', '.join(paths)}: no rows to draw", do="make the table again")
    if len({tuple(part) for part in parts}) > 1:
        raise UsageError(
            f"{', '.join(paths)} have unlike columns",
            allowed="allowed are tables of one kind",
            do="draw them one by one",
        )
    figure: Figure | None = resolve_name("tirelog.plots.tables:table_picture")(parts)
    if figure is None:
        raise UsageError(
            "is no table of numbers that vary",
            allowed="allowed is a table with two columns of such numbers",
            do="read its rows",
            file=paths[0],
        )
    return figure


def _of_logs(
    logs: Iterable[Recording],
    kind: str,
    channels: Collection[str],
    ends: Mapping[str, Any],
    note: Callable[[str], object],
) -> Figure:
    """The picture of open logs (`figure_of`)."""
    from tirelog.plots import turns

    kind = kind or next(iter(LOG_PICTURES))
    refuse_unknown(kind, LOG_PICTURES, f"--kind {kind}", do="choose one")
    if kind != "signal":
        _refuse_stretch(f"the picture {kind}", ends)
    table, kept = "speed" if kind == "signal" else "footprint", list[Any]()
    for recording in logs:
        parts = list[Part]()
        try:
            parts += parts_of(recording, table, ends, () if kind == "signal" else channels)
        except TirelogError as problem:
            if kind != "signal":
                raise
            note(f"{recording.log}: passages are not marked: {problem.message}")
        for remark in (remark for part in parts for remark in part.remarks):
            note(f"{recording.log}: {remark}")
        parts = [part for part in parts if part.columns]
        if kind == "signal":
            for name in channels:
                what = f"no channel is called {name!r}"
                refuse_unknown(name, recording.channels, what, do="choose one", file=recording.log)
            shown = [recording.channels[name] for name in channels or recording.channels]
            within = stretch_s(recording, ends)
            between = within.get("start", -math.inf), within.get("stop", math.inf)
            kept.append(turns.signals(recording, shown, [p.columns for p in parts], between))
        else:
            found = [turns.found_of_grating(recording, part) for part in parts]
            kept += [turns.TurnsSketch.of(recording, one) for one in found]
    if not kept:
        raise UsageError("nothing to draw", do="see `tirelog info`")
    return turns.log_picture(kept, kind)


def _parts_of_table(path: str) -> list[dict[str, Any]]:
    """The columns of a table by channels of logs; a table without them has the file's name."""
    from tirelog.tables.frame import read_table

    table = read_table(path)
    for name, word in (("log", path), ("channel", ""), ("quality", "ok")):
        if name not in table:
            table[name] = word
    parts: list[dict[str, Any]] = resolve_name("tirelog.plots.tables:parts_of_frame")(table)
    return parts


def _of_answer(path: File) -> Figure:
    """The picture of an answer's JSON.  UsageError: it is none that has a picture."""
    try:
        fields = json_value(bounded_input(path, 16 * LARGEST_BYTES))
        if "steps" in fields:
            fields = read_ladder(path)
        figure: Figure = resolve_name("tirelog.plots.answers:answer_picture")(fields)
    except (ValueError, KeyError, TypeError, AttributeError) as problem:
        raise UsageError(
            f"cannot be drawn ({type(problem).__name__}: {problem})",
            allowed="allowed is the JSON of compare, diagnose, ladder or form",
            do="write one with --format json",
            file=path,
        ) from None
    return figure


def plot(
    what: Logs,
    path: Path | None = None,
    setup: SetupLike | None = None,
    *,
    kind: str = "",
    channel: Sequence[str] = (),
    start: float | str | None = None,
    stop: float | str | None = None,
) -> Figure:
    """The picture of logs, tables, a model file or an answer's JSON, by the content of the files.

    Parameters
    ----------
    what : str, os.PathLike, Recording or a list of them
        What to draw: logs by path or open, or paths of tables, of one model or of one answer.
    path : str or os.PathLike, optional
        The picture to write: .png, .svg or .pdf. A notebook shows the figure that comes back.
    setup : str, os.PathLike, Setup or dict, optional
        The setup of logs given by path; without it the TOML file beside each.
    kind : str, optional
        Of logs: ``"signal"`` (the default), ``"waterfall"``, ``"polar"`` or ``"edges"``.
    channel : sequence of str, optional
        Of logs: only these channels.
    start, stop : float or str, optional
        Of signals: only this stretch of each log, as for `speed`.

    Returns
    -------
    matplotlib.figure.Figure
        The picture.

    Raises
    ------
    UsageError
        Files of several kinds, or nothing to draw.
    ReadError, SetupError, ModelError
        A file cannot be read.
    """
    given = list(as_logs(what))
    ends = {"start": start, "stop": stop}
    figure = figure_of(given, each_log(given, setup), kind, channel, ends)
    if path is not None:
        show(figure, path)
    return figure


def show(figure: Figure, path: Path | None) -> None:
    """The figure as a file, or in a window until that is closed.  UsageError: no screen."""
    if path is not None:
        resolve_name("tirelog.plots.record:write")(figure, File(path))
        return
    from matplotlib import pyplot

    if pyplot.get_backend().lower() == "agg":
        raise UsageError(
            "no screen to draw on",
            allowed="a picture goes to a screen or to a file",
            do="give -o PICTURE.png",
        )
    window = pyplot.figure(figsize=figure.get_size_inches()).canvas
    window.figure = figure
    figure.set_canvas(window)
    pyplot.show()
