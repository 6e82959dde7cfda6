"""`tirelog compare LOG... --model M`."""

from __future__ import annotations

from typing import Annotated

import typer

from tirelog.cli import options
from tirelog.cli.models.question import Question, with_question, write_answer
from tirelog.errors import refuse_unknown
from tirelog.vocabulary.pictures import COMPARE, ERRORS_BY

By = Annotated[
    str | None,
    typer.Option(
        "--by",
        help="A table by revolution, angle, speed, regime or conditions; with a [road] in the "
        "setup by hit, time or frequency.",
    ),
]


@with_question
def compare(
    asked: Question,
    by: By = None,
    kind: Annotated[str, options.plot_kind(COMPARE)] = "page",
) -> None:
    """Fit a model on some manoeuvres and show its error on the others, beside the noise floor."""
    from tirelog.api import answers
    from tirelog.cli.models.answers_page import comparison_page

    options.refuse_kind_alone(kind, asked.plot)
    if by is not None:
        refuse_unknown(by, ERRORS_BY, f"--by {by}", do="choose one")
    with asked.session as session:
        result = asked.answered(session, "fitting the model", answers.compare)
        parts = None if by is None else result.by(by)
        session.notes(result.notes)
        if asked.plot is not None:
            session.notes(f"more is drawn in {beside}" for beside in result.draw(asked.plot, kind))
        write_answer(session, "compare", result, lambda: comparison_page(result), parts)
