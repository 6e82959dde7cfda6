"""`tirelog propose LOG... --model M -o BETTER.toml`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tirelog.cli import options
from tirelog.cli.models.question import answered
from tirelog.cli.session import Session, page, write_json
from tirelog.cli.targets import in_a_folder

if TYPE_CHECKING:
    from tirelog.api.results import ProposalOfLogs

#: letters in a line of the page
_WIDTH = 110


def propose(
    logs: options.Logs,
    model: options.ModelFile,
    setup: options.SetupFile = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Write the model with what is proposed; none if nothing is.",
            callback=in_a_folder,
        ),
    ] = None,
    format: Annotated[
        str | None, typer.Option("--format", help="json in place of the page.")
    ] = None,
    quiet: options.Quiet = False,
    channel: options.ChannelName = None,
    effects: options.EffectsFile = None,
    plot: options.Plot = None,
    despite: Annotated[
        bool, typer.Option("--despite", help="Also if an effect of the catalogue explains it.")
    ] = False,
    shape: Annotated[
        bool, typer.Option("--shape", help="A measured shape in any case, in place of formulas.")
    ] = False,
) -> None:
    """Write down the unknown effect: formulas that remove it, or its measured shape."""
    from tirelog.api import answers
    from tirelog.api.models import refuse_another, save_model
    from tirelog.errors import UsageError

    if format not in (None, "json"):
        raise UsageError(
            f"--format {format}", allowed="json is allowed", do="give it, or leave it out"
        )
    if output is not None:
        refuse_another(output)
    with Session(setup, quiet) as session:
        ask = partial(answers.propose, despite=despite, shape=shape, progress=session.say)
        result = answered(session, logs, model, effects, channel, "proposing", ask)
        if plot is not None and result.status != "nothing":
            result.plot(plot)
        if output is not None and result.model is not None:
            save_model(result.model, output)
        better = output or Path("BETTER.toml")
        asked = answers.Asked(tuple(logs), setup, better, channel=channel, effects=effects)
        follows = "" if result.status == "nothing" else asked.command("compare", model=True)
        if result.status == "nothing":
            unwritten = [str(path) for path in (output, plot) if path is not None]
            if unwritten:
                session.note(f"{' and '.join(unwritten)} not written: there is no proposal")
        if format == "json":
            write_json(result.to_json() | {"next_command": follows}, None)
        else:
            _page(result, follows)


def _page(result: ProposalOfLogs, command: str) -> None:
    """The proposal to read."""
    out = page(_WIDTH)
    out.print(f"{result.status.upper()}.  {result.sentence}")
    for term in result.terms:
        out.print(f"\n{term.name}, acts on {term.formula.acts_on}: {term.formula.words}")
        out.print(f"  {term.formula.expression}")
        for name, number in term.numbers.items():
            error = number["se"]
            told = "not determined" if error is None else f"{error:.2g}"
            unit = "" if number["unit"] in ("", "1") else f" {number['unit']}"
            out.print(f"  {name} = {number['value']:.5g} +- {told}{unit}")
    sentences = result.sentences()
    if sentences:
        out.print("")
    for sentence in sentences:
        out.print(sentence)
    if command:
        out.print(f"next: {command}")
