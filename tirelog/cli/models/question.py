"""What compare, diagnose, form, ladder and propose share: logs and a model in, an answer out."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from tirelog.cli import options
from tirelog.cli.session import Session, write_json

if TYPE_CHECKING:
    from tirelog.api.answers import MeasuredLogs
    from tirelog.api.models import Model

Answer = TypeVar("Answer")


@dataclass(frozen=True)
class Question:
    """Logs, a model and the options that compare, diagnose, form and ladder have alike."""

    logs: options.Logs
    model: options.ModelFile
    setup: options.SetupFile = None
    output: options.Output = None
    format: options.Format = None
    quiet: options.Quiet = False
    channel: options.ChannelName = None
    effects: options.EffectsFile = None
    plot: options.Plot = None

    @property
    def session(self) -> Session:
        """The session that reads the logs and writes the answer."""
        return Session(self.setup, self.quiet, self.output, self.format)

    def answered(
        self, session: Session, doing: str, ask: Callable[[MeasuredLogs, Model], Answer]
    ) -> Answer:
        """What is answered; a log that cannot be read is said and left out."""
        return answered(session, self.logs, self.model, self.effects, self.channel, doing, ask)


def with_question(command: Callable[..., None]) -> Callable[..., None]:
    """The command with the options of a Question, its first argument, before its own."""
    asked = inspect.signature(Question, eval_str=True).parameters
    _, *own = inspect.signature(command, eval_str=True).parameters.values()

    @wraps(command)
    def run(**given: Any) -> None:
        question = Question(**{name: given.pop(name) for name in asked})
        command(question, **given)

    parameters = [p.replace(kind=p.KEYWORD_ONLY) for p in (*asked.values(), *own)]
    vars(run)["__signature__"] = inspect.Signature(parameters)  # which typer reads
    run.__annotations__ = {p.name: p.annotation for p in parameters}
    del run.__wrapped__  # whose signature has the question
    return run


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
