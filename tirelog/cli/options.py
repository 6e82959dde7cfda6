"""The options and arguments that commands share, each with one flag and one help."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from tirelog.cli import completion
from tirelog.cli.targets import drawable, in_a_folder
from tirelog.errors import UsageError, refuse_unknown


def plot_kind(kinds: Mapping[str, str]) -> Any:
    """The option --plot-kind of a command that draws these; one it cannot is refused at once."""

    def known(kind: str) -> str:
        refuse_unknown(kind, kinds, f"--plot-kind {kind}", do="choose one")
        return kind

    return typer.Option(
        "--plot-kind",
        help=f"What --plot draws: {', '.join(kinds)}.",
        callback=known,
        autocompletion=lambda incomplete: [kind for kind in kinds if kind.startswith(incomplete)],
    )


def refuse_kind_alone(kind: str, plot: Path | None) -> None:
    """UsageError: --plot-kind names a picture, and no --plot says where to draw it."""
    if plot is None and kind != "page":
        raise UsageError(
            f"--plot-kind {kind} without --plot",
            allowed="it says what --plot draws",
            do="add --plot FILE",
        )


Logs = Annotated[list[str], typer.Argument(help="Logs or runs; '-' is standard input.")]
SetupFile = Annotated[
    Path | None, typer.Option("--setup", help="Setup file; without it FILE.toml beside the log.")
]
Output = Annotated[
    Path | None,
    typer.Option(
        "-o", "--output", help="File to write; its suffix decides the format.", callback=in_a_folder
    ),
]
Format = Annotated[
    str | None,
    typer.Option(
        "--format", help="csv, ndjson, parquet or json.", autocompletion=completion.formats
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", help="No remarks on standard error.")]
Plot = Annotated[
    Path | None,
    typer.Option("--plot", help="Picture to write, .png, .svg or .pdf.", callback=drawable),
]
EffectsFile = Annotated[
    Path | None,
    typer.Option(
        "--effects",
        help="Python file with effects of your own; it is run. A model with one of them "
        "remembers it.",
    ),
]
ChannelName = Annotated[
    str | None,
    typer.Option(
        "--channel",
        help="Channel to compare; the first that fits by default. Of strain several gratings in "
        "one fit: their names with commas between, or all.",
        autocompletion=completion.channels,
    ),
]
Channels = Annotated[
    list[str] | None,
    typer.Option(
        "--channel",
        help="Only this channel; several times for several (default: all that fit).",
        autocompletion=completion.channels,
    ),
]
ModelFile = Annotated[Path, typer.Option("--model", help="Model file.")]
#: a model that a command reads or changes, as its argument
Model = Annotated[Path, typer.Argument(metavar="MODEL", help="Model file.")]
NewModel = Annotated[
    Path, typer.Option("-o", "--output", help="Model file to write.", callback=in_a_folder)
]
#: of a command that edits a model, as `new_model`: it may take the place of the one that is read
EditedModel = Annotated[
    Path,
    typer.Option(
        "-o",
        "--output",
        help="Model file to write; the one that is read may be named.",
        callback=in_a_folder,
    ),
]
Sets = Annotated[
    list[str],
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="A parameter's value, or the word of an effect's choice; several times.",
    ),
]
