"""What compare, diagnose, ladder and propose share: logs and a model in, an answer out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from tirelog.cli.session import Session, write_json

if TYPE_CHECKING:
    from tirelog.api.answers import MeasuredLogs
    from tirelog.api.models import Model

Answer = TypeVar("Answer")


def answered(
    session: Session,
    logs: list[str],
    model: Path,
    effects: Path | None,
    channel: str | None,
    doing: str,
    ask: Callable[[MeasuredLogs, Model], Answer],
) -> Answer:
    """What is answered of logs and a model; a log that cannot be read is said and left out."""
    from tirelog.api.answers import measure
    from tirelog.api.models import load_model

    read = load_model(model, effects=effects)
    found = measure(session.recordings(logs), read, channel)
    session.notes(found.notes)
    with session.working() as line:
        line.say(doing)
        return ask(found, read)


def write_answer(
    session: Session,
    name: str,
    answer: Any,
    page: Callable[[], None],
    parts: Iterable[Sequence[Mapping[str, Any]]] | None = None,
) -> None:
    """The answer as JSON, as a table `name` of its rows (or of `parts` of others), or as a page."""
    if parts is not None:
        session.write_rows(name, parts)
    elif session.json:
        write_json(answer.to_json(), session.output)
    elif session.paged:
        page()
    else:
        session.write_rows(name, [answer.rows()])
