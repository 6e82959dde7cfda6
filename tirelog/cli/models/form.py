"""`tirelog form LOG... --model M`."""

from __future__ import annotations

from tirelog.cli.models.question import Question, with_question
from tirelog.cli.session import write_json


@with_question
def form(asked: Question) -> None:
    """Read the tire's contact pressure and stiffness out of its logs, with standard errors."""
    from tirelog.api import answers

    with asked.session as session:
        result = asked.answered(session, "fitting the form", answers.tire_form)
        session.notes(result.notes)
        if asked.plot is not None:
            result.plot(asked.plot)
        if session.json:
            write_json(result.to_json(), asked.output)
        else:
            session.write_rows("form", [result.rows()])
