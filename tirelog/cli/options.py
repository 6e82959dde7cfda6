"""The options and arguments that commands share, each with one flag and one help."""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import wraps
from importlib import util
from inspect import Parameter, Signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tirelog.api as api
from tirelog.errors import OutputError, UsageError
from tirelog.storage.whole import (
    output_error,
    refuse_address,
    refuse_inputs,
    refuse_one_for_two,
    taken_as_input,
)
from tirelog.vocabulary.tables import TABLE_FORMATS, no_matplotlib, refuse_no_picture
from tirelog.vocabulary.units import likely_number

if TYPE_CHECKING:
    from tirelog.data.recording import Conditions
    from tirelog.data.setup import RoadSetup, Setup


# ---- What a shell may complete: values that are known by name.
#
# Nothing here reads a log: an answer has to come while one types.


def completing(words: Iterable[str] | Callable[[], Iterable[str]]) -> Callable[[str], list[str]]:
    """What completes one of these words; a function gives them when one types."""

    def beginning(incomplete: str) -> list[str]:
        known = words() if callable(words) else words
        return [word for word in known if word.startswith(incomplete)]

    return beginning


effects = completing(lambda: api.models.catalogue_with())


# ---- Refusals before the work: paths that nothing could be written to in the end.
#
# Callbacks of options that name outputs: each gives its path back, or raises.


def in_a_folder(path: Path | None) -> Path | None:
    """The path of a file to write.  OutputError: it is a folder, or its folder does not exist."""
    if path is None:
        return path
    refuse_address(path)
    if path.is_dir():
        raise _no_place(path, errno.EISDIR)
    if not path.parent.is_dir():
        raise _no_place(path, errno.ENOTDIR if path.parent.exists() else errno.ENOENT)
    return path


def _no_place(path: Path, number: int) -> OutputError:
    return output_error(path, OSError(number, os.strerror(number)))


def folder(path: Path | None) -> Path | None:
    """The path of a folder to write into, made if missing.  OutputError: a file is in its way."""
    if path is not None:
        refuse_address(path)
        there = next(place for place in (path, *path.absolute().parents) if place.exists())
        if not there.is_dir():
            raise _no_place(path, errno.EEXIST if there == path else errno.ENOTDIR)
    return path


def drawable(path: Path | None) -> Path | None:
    """The path of a picture to draw.

    UsageError: it has no picture's suffix, or matplotlib is missing; OutputError as `in_a_folder`.
    """
    if path is None:
        return None
    refuse_no_picture(path)
    if util.find_spec("matplotlib") is None:
        raise no_matplotlib()
    return in_a_folder(path)


# ---- Conditions and drives from the options of `tirelog model predict`, as numbers.


#: revolutions that one command computes, and rows that it writes of them; twice as many rows take
#: twice the memory, some 500 MB
MOST, MOST_ROWS = 2000, 2_100_000
_FIELDS = {
    "speed": "speed_m_s",
    "load": "load_N",
    "pressure": "inflation_pressure_Pa",
    "acceleration": "acceleration_m_s2",
    "slip": "slip",
}


def values_of(text: str, option: str) -> list[float]:
    """The values that an option gives.  UsageError: words that are none."""
    likely = likely_number(text)
    try:
        numbers = [float(part) for part in text.split(":" if ":" in text else ",")]
        # 22,5 and 0,05 are one number to who writes decimals with a comma
        one = likely and (numbers[-1] <= numbers[0] or ",0" in text[:-1])
        if all(map(math.isfinite, numbers)) and len(numbers) <= MOST and not one:
            if ":" not in text:
                return numbers
            low, high, step = numbers
            count = math.floor((high - low) / step + 1e-9) + 1
            if 1 <= count <= MOST:
                return [low + i * step for i in range(count)]
    except (ValueError, ZeroDivisionError, OverflowError):
        pass
    raise UsageError(
        f"{option} {text}",
        allowed=f"allowed are a number, several with commas, or FROM:TO:STEP, {MOST} at most; two "
        "whole numbers have to rise",
        do=likely or f"write {option} 20, {option} 10,20 or {option} 5:25:5",
    )


def assigned(text: str, option: str, allowed: str, do: str = "correct it") -> tuple[str, str]:
    """Name and word of NAME=WORD.  UsageError: no name or word, or a number with a unit."""
    name, _, word = text.partition("=")
    likely = likely_number(word)
    if (
        not word.strip()
        or likely
        or word.strip().lower().lstrip("+-") in ("nan", "inf", "infinity")
    ):
        raise UsageError(f"{option}{text}", allowed=allowed, do=likely or do)
    return name.strip(), word.strip()


def refuse_many(conditions: int, points: int) -> None:
    """UsageError: `conditions` of so many `points` each are too many rows for the memory."""
    rows = conditions * points
    if rows > MOST_ROWS:
        raise UsageError(
            f"{rows} rows",
            allowed=f"{MOST_ROWS} are allowed in one command",
            do="ask for fewer --points or conditions at once",
        )


def conditions_given(
    setup: Setup | None, more: Mapping[str, float | None], **options: str | None
) -> Conditions:
    """Each value of each option with each of the others, and the setup's conditions.

    UsageError: no number, one that no tire is driven under, or more than MOST of them together.
    """
    given = {
        _FIELDS[name]: values_of(text, f"--{name}")
        for name, text in options.items()
        if text is not None
    }
    count = math.prod(len(values) for values in given.values())
    if count > MOST:
        raise UsageError(
            f"{count} conditions",
            allowed=f"{MOST} are allowed in one command",
            do="ask for fewer values at once",
        )
    other = {name: value for name, value in more.items() if value is not None}
    called = {_FIELDS[name]: f"--{name}" for name in options} | {
        "time_s": "--time",
        "temperature_K": "--temperature",
    }
    return api.models.conditions_of(given, setup, called=called, **other)


def doubts(conditions: Conditions, *texts: str) -> list[str]:
    """Remarks on a speed that is more likely in km/h, and on texts that may be one number.

    No speed below 200 km/h.
    """
    likely = [(text, likely_number(text)) for text in texts]
    said = [f"{text} is two values; {meant}" for text, meant in likely if meant]
    highest = float(max(conditions.speed_m_s, default=0.0))
    if 3.6 * highest < 200.0:
        return said
    return [
        *said,
        f"--speed {highest:g} is {3.6 * highest:g} km/h; {highest:g} km/h is {highest / 3.6:.4g}",
    ]


def road_words(words: str, setup: Setup | None) -> RoadSetup:
    """The road of --road: in words, or `setup` for the setup's [road]."""
    from tirelog.data.setup import parse_road

    if words != "setup":
        return parse_road(words)
    if setup is None or setup.road.kind == "flat":
        raise UsageError(
            "--road setup: the setup has no [road]",
            allowed="a road in words is allowed, such as cleat,height_m=0.01,length_m=0.04",
        )
    return setup.road


#: a step of the load takes so long [s]
_STEP_S = 1e-6


def load_steps(words: list[str]) -> list[tuple[float, float]]:
    """Times [s], which grow from 0 on, and loads [N].  UsageError: words that are none."""
    made = [(-_STEP_S, 0.0)]
    for text in words:
        time_s, _, load_N = text.partition(":")
        try:
            step = float(time_s), float(load_N)
        except ValueError:
            step = math.nan, math.nan
        if not (math.isfinite(sum(step)) and step[0] >= made[-1][0] + _STEP_S):
            raise UsageError(
                f"--load-step {text}",
                allowed="TIME:LOAD in s and N is allowed, times that grow from 0 on",
                do="correct it",
            )
        made.append(step)
    return made[1:]


def with_options(command: Callable[..., None], parameters: Iterable[Parameter]) -> None:
    """Give the command the parameters that typer reads, in the place of its own."""
    typed = [one.replace(kind=Parameter.KEYWORD_ONLY) for one in parameters]
    vars(command)["__signature__"] = Signature(typed)
    command.__annotations__ = {one.name: one.annotation for one in typed}


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
        "--format", help="csv, ndjson, parquet or json.", autocompletion=completing(TABLE_FORMATS)
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", help="No remarks on standard error.")]
Plot = Annotated[
    Path | None,
    typer.Option("--plot", help="Picture to write: .png, .svg or .pdf.", callback=drawable),
]
EffectsFile = Annotated[
    Path | None,
    typer.Option(
        "--effects",
        help="Python file with effects of your own. It is run.",
    ),
]
ChannelName = Annotated[
    str | None,
    typer.Option(
        "--channel",
        help="Channel to compare; default the first that fits. Strain: several gratings in one "
        "fit, as NAME,NAME or all.",
    ),
]
Channels = Annotated[
    list[str] | None,
    typer.Option(
        "--channel",
        help="Only this channel; repeat for several. Default: all that fit.",
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
        help="Model file to write; it may be MODEL itself.",
        callback=in_a_folder,
    ),
]
Sets = Annotated[
    list[str],
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Value of a parameter, or word of an effect's choice; repeat for several.",
    ),
]


# ---- Commands that write on none of their inputs.


#: options that name what a command writes; every other path, and every log, is an input
OUTPUTS = ("output", "new_model", "plot", "save", "calibrate")


def _keep_inputs(given: dict[str, Any]) -> None:
    """Register the files that a command reads, before it reads them.

    A command that writes a `new_model` edits its `model`, which the new one may replace.

    UsageError: it would write on another of its inputs, or two outputs on one file.
    """
    edited = given.get("model") if "new_model" in given else None
    for place in _inputs(given, OUTPUTS if edited is None else (*OUTPUTS, "model")):
        if str(place) == "-":
            taken_as_input(0, "standard input")
        else:
            taken_as_input(place)
    if edited is not None:
        taken_as_input(edited, edited=True)
    written = [given[name] for name in OUTPUTS if given.get(name) is not None]
    refuse_inputs(*written)
    refuse_one_for_two(*written)
    refuse_inputs(1, name="standard output")


def _inputs(given: dict[str, Any], outputs: tuple[str, ...]) -> Iterator[Path | str]:
    """The paths among a command's arguments that it reads, and the setups beside its logs."""
    for name, value in given.items():
        several = value if isinstance(value, list | tuple) else [value]
        logs = name in ("log", "logs")
        for path in several:
            if name not in outputs and (isinstance(path, Path) or (logs and isinstance(path, str))):
                yield path
        if logs and given.get("setup") is None:
            from tirelog.data.setup import setup_beside

            yield from filter(None, map(setup_beside, filter(None, several)))


def keeping_inputs(command: Callable[..., None]) -> Callable[..., None]:
    """The command; its inputs are registered before it starts, so that it overwrites none."""

    @wraps(command)
    def kept(**given: Any) -> None:
        _keep_inputs(given)
        command(**given)

    return kept
