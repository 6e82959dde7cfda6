"""`tirelog diagnose LOG... --model M`."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Annotated

import typer

from tirelog.cli.models.question import Question, with_question, write_answer
from tirelog.errors import UsageError


@with_question
def diagnose(
    asked: Question,
    bootstrap: Annotated[
        int,
        typer.Option(
            metavar="DRAWS",
            help="Draw the manoeuvres anew so many times, and say how often each effect is named.",
            min=0,
            max=10000,
        ),
    ] = 0,
    leave_one_out: Annotated[
        str | None,
        typer.Option(
            metavar="log|tire",
            help="Diagnose without each log, or tire, in turn; say where the verdict changes.",
        ),
    ] = None,
) -> None:
    """Tell which effect the model lacks, which cannot be told apart, and what to drive next."""
    from tirelog.api import answers
    from tirelog.cli.models.answers_page import diagnosis_page

    if leave_one_out not in (None, "log", "tire"):
        raise UsageError(
            f"--leave-one-out {leave_one_out}", allowed="allowed are log, tire", do="choose one"
        )
    with asked.session as session:
        ask = partial(
            answers.diagnose,
            bootstrap=bootstrap,
            leave_one_out=session.tires if leave_one_out == "tire" else bool(leave_one_out),
            progress=session.say,
        )
        result = asked.answered(session, "diagnosing", ask)
        to_repeat = answers.Asked(
            tuple(asked.logs),
            asked.setup,
            asked.model,
            channel=asked.channel,
            effects=asked.effects,
        )
        result = replace(result, next_command=to_repeat.with_options(result.next_command))
        session.notes(result.before.remarks)
        if asked.plot is not None:
            session.notes(f"more is drawn in {beside}" for beside in result.draw(asked.plot))
        write_answer(session, "diagnose", result, lambda: diagnosis_page(result))
