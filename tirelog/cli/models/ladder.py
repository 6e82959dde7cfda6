"""`tirelog ladder LOG... --model M`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from tirelog.cli.models.question import Question, with_question
from tirelog.cli.session import write_json
from tirelog.cli.targets import in_a_folder

#: columns of --by-log
_BY_LOG = ("log", "parameter", "unit", "value", "se", "distance_km", "load_N")


@with_question
def ladder(
    asked: Question,
    save: Annotated[
        Path | None,
        typer.Option(
            "--save", help="Write the model at the top of the ladder.", callback=in_a_folder
        ),
    ] = None,
    propose: Annotated[
        bool,
        typer.Option(
            "--propose",
            help="Where the effects end above the floor: write down what is unknown, as `propose`.",
        ),
    ] = False,
    by_log: Annotated[
        bool, typer.Option("--by-log", help="The fitted strengths log by log instead of the steps.")
    ] = False,
) -> None:
    """Add effects one by one until nothing more is worth adding; one row per step."""
    from tirelog.api import answers
    from tirelog.api.models import refuse_another, save_model
    from tirelog.cli.models.answers_page import ladder_bars

    if save is not None:
        refuse_another(save)
    with asked.session as session:
        ask = partial(answers.ladder, propose=propose, keep=asked.model, progress=session.say)
        result = asked.answered(session, "climbing", ask)
        if not asked.quiet:
            ladder_bars(result)
        session.notes(result.remarks)
        if asked.plot is not None:
            result.plot(asked.plot)
        if save is not None:
            save_model(result.model, save)
        if session.json:
            write_json(result.to_json(), asked.output)
        else:
            rows = result.strengths_by_log if by_log else result.rows()
            session.write_rows("ladder", [rows], empty=_BY_LOG)
