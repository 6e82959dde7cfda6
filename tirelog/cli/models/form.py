"""`tirelog form LOG... --model M`."""

from __future__ import annotations

from tirelog.cli import options
from tirelog.cli.models.question import answered
from tirelog.cli.session import Session, write_json


def form(
    logs: options.Logs,
    model: options.ModelFile,
    setup: options.SetupFile = None,
    output: options.Output = None,
    format: options.Format = None,
    quiet: options.Quiet = False,
    channel: options.ChannelName = None,
    effects: options.EffectsFile = None,
    plot: options.Plot = None,
) -> None:
    """Read the tire's contact pressure and stiffness out of its logs, with standard errors."""
    from tirelog.api import answers

    with Session(setup, quiet, output, format) as session:
        result = answered(
            session, logs, model, effects, channel, "fitting the form", answers.tire_form
        )
        session.notes(result.notes)
        if plot is not None:
            result.plot(plot)
        if session.json:
            write_json(result.to_json(), output)
        else:
            session.write_rows("form", [result.rows()])
