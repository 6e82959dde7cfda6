"""`tirelog ladder LOG... --model M`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from tirelog.cli import options
from tirelog.cli.models.question import answered
from tirelog.cli.session import Session, write_json
from tirelog.cli.targets import in_a_folder

#: columns of --by-log
_BY_LOG = ("log", "parameter", "unit", "value", "se", "distance_km", "load_N")


def ladder(
    logs: options.Logs,
    model: options.ModelFile,
    setup: options.SetupFile = None,
    output: options.Output = None,
    format: options.Format = None,
    quiet: options.Quiet = False,
    channel: options.ChannelName = None,
    effects: options.EffectsFile = None,
    plot: options.Plot = None,
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
    with Session(setup, quiet, output, format) as session:
        ask = partial(answers.ladder, propose=propose, keep=model, progress=session.say)
        result = answered(session, logs, model, effects, channel, "climbing", ask)
        if not quiet:
            ladder_bars(result)
        session.notes(result.remarks)
        if plot is not None:
            result.plot(plot)
        if save is not None:
            save_model(result.model, save)
        if session.json:
            write_json(result.to_json(), output)
        else:
            rows = result.strengths_by_log if by_log else result.rows()
            session.write_rows("ladder", [rows], empty=_BY_LOG)
