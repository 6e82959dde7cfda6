"""The command line's table of contents, the options that commands share, and what help says.

Science is imported inside the commands, so that help answers at once.
"""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import wraps
from importlib import import_module, util
from inspect import Parameter, Signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

import tirelog.api as api
from tirelog.errors import OutputError, TirelogError, UsageError, refuse_unknown
from tirelog.storage.remote import address
from tirelog.storage.whole import (
    output_error,
    refuse_inputs,
    refuse_one_for_two,
    taken_as_input,
)
from tirelog.vocabulary.tables import (
    LOG_TABLES,
    TABLE_FORMATS,
    LogTable,
    no_matplotlib,
    refuse_no_picture,
)

if TYPE_CHECKING:
    from tirelog.data.recording import Conditions
    from tirelog.data.setup import RoadSetup, Setup


# ---- The commands, by name.


#: every command in the order of help: a table of `vocabulary.tables` (of a drive, before `tables`;
#: others after it), or the module in `tirelog.cli` and the function or sub-application in it
COMMANDS: Mapping[str, str | LogTable] = {
    "ingest": "files:ingest",
    "info": "files:info",
    **{name: table for name, table in LOG_TABLES.items() if table.driven},
    "tables": "files:tables",
    **{name: table for name, table in LOG_TABLES.items() if not table.driven},
    "setup": "files:app",
    "simulate": "files:simulate",
    "effects": "model:effects",
    "model": "model:app",
    "compare": "answers:compare",
    "diagnose": "answers:diagnose",
    "propose": "answers:propose",
    "form": "answers:form",
    "ladder": "answers:ladder",
    "report": "answers:report",
    "campaign": "answers:campaigns",
    "check": "files:check",
    "phase-shift": "files:phase_shift",  # which does more than write its table
}


def _function(place: str | LogTable) -> Any:
    """The command of a table, or what stands at a place in `tirelog.cli`."""
    module, _, name = (place if isinstance(place, str) else "files:table_command").partition(":")
    found = getattr(import_module(f"tirelog.cli.{module}"), name)
    return found if isinstance(place, str) else found(place)


def _version(asked: bool) -> None:
    if asked:
        from tirelog.version import __version__

        typer.echo(f"tirelog {__version__}")
        raise typer.Exit()


def _callback(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """From the recorded logs of a sensorised tire to tidy tables, and from tables to the physics
    that a model lacks.
    """


#: options that name what a command writes; every other path, and every log, is an input
OUTPUTS = ("output", "new_model", "plot", "save", "calibrate")


def _keep_inputs(given: dict[str, Any]) -> None:
    """Tell which files a command reads, before it does.

    A command that writes a `new_model` edits its `model`, which the new one may replace.

    UsageError: it would write on another of them, or two outputs on one file.
    """
    outputs = (*OUTPUTS, "against") if given.get("bless") else OUTPUTS
    edited = given.get("model") if "new_model" in given else None
    for place in _inputs(given, outputs if edited is None else (*outputs, "model")):
        if str(place) == "-":
            taken_as_input(0, "standard input")
        else:
            taken_as_input(place)
    if edited is not None:
        taken_as_input(edited, edited=True)
    written = [given[name] for name in outputs if given.get(name) is not None]
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


class Commands(typer.Typer):
    """Commands that know which files they read before they start, so that none writes on them."""

    def command(self, *given: Any, **options: Any) -> Callable[[Any], Any]:
        """Typer's, whose callback gets what typer has made of the command line: paths are paths."""
        register = super().command(*given, **options)

        def keeping(callback: Callable[..., Any]) -> Any:
            @wraps(callback)
            def kept(**values: Any) -> Any:
                _keep_inputs(values)
                return callback(**values)

            return register(kept)

        return keeping


def command(asked: str = "") -> Any:
    """The command line as typer's command object: the command `asked` for alone, else the whole.

    The whole also if there is no such command. One alone is made in 10 ms, the whole in 55 (CPU, 23
    November 2026, Python 3.11).
    """
    app = Commands(
        name="tirelog",
        cls=WholeHelp,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        no_args_is_help=True,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_callback)
    for name in [asked] if asked in COMMANDS else COMMANDS:
        target = _function(COMMANDS[name])
        if isinstance(target, typer.Typer):
            app.add_typer(target, name=name, cls=WholeHelp)
        else:
            app.command(name)(target)
    parsed = typer.main.get_command(app)
    dress(parsed)
    return parsed


# ---- What a shell may complete: values that are known by name.
#
# Nothing here reads a log: an answer has to come while one types.


def completing(words: Iterable[str] | Callable[[], Iterable[str]]) -> Callable[[str], list[str]]:
    """What completes one of these words, which are asked for when one types."""

    def beginning(incomplete: str) -> list[str]:
        known = words() if callable(words) else words
        return [word for word in known if word.startswith(incomplete)]

    return beginning


effects = completing(lambda: api.models.catalogue_with())


def channels(ctx: Any, incomplete: str) -> list[str]:
    """Channels of the setup that is given, or stands beside the first log."""
    from tirelog.data.setup import load_setup, setup_beside

    found: tuple[str, ...] = ()
    with suppress(TirelogError, OSError):
        logs = ctx.params.get("logs") or []
        place = ctx.params.get("setup") or (setup_beside(logs[0]) if logs else None)
        if place is not None:
            found = tuple(load_setup(place).channels)
    return [name for name in found if name.startswith(incomplete)]


# ---- Refusals before the work: what could not be written, drawn or saved in the end.
#
# Callbacks of options that name outputs: each gives its path back, or raises.


def in_a_folder(path: Path | None) -> Path | None:
    """The path of a file to write.  OutputError: its folder is not there, or it is one itself."""
    if path is None or address(path) is not None:
        return path
    if path.is_dir():
        raise _no_place(path, errno.EISDIR)
    if not path.parent.is_dir():
        raise _no_place(path, errno.ENOTDIR if path.parent.exists() else errno.ENOENT)
    return path


def _no_place(path: Path, number: int) -> OutputError:
    return output_error(path, OSError(number, os.strerror(number)))


def folder(path: Path | None) -> Path | None:
    """The path of a folder to write into, made if missing.  OutputError: a file is in its way."""
    if path is not None and address(path) is None:
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


# ---- Conditions and drives as options of `tirelog model predict` give them, as numbers.


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
    try:
        numbers = [float(part) for part in text.split(":" if ":" in text else ",")]
        if all(map(math.isfinite, numbers)) and len(numbers) <= MOST:
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
        allowed=f"allowed are a number, several with commas, or FROM:TO:STEP, {MOST} at most",
        do=f"write {option} 20, {option} 10,20 or {option} 5:25:5",
    )


def refuse_many(conditions: int, points: int) -> None:
    """UsageError for more rows than memory is meant for: so many `points` of each condition."""
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
    """Each value of each option with each of the others, and what the setup knows besides.

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


def road_words(words: str, setup: Setup | None) -> RoadSetup:
    """The road of --road: in words, or `setup` for the setup's [road]."""
    from tirelog.data.setup import parse_road

    if words != "setup":
        return parse_road(words)
    if setup is None or setup.road.kind == "flat":
        raise UsageError(
            "--road setup, and the setup has no [road]",
            allowed="a road in words is allowed, such as cleat,height_m=0.01,length_m=0.04",
        )
    return setup.road


def events(words: list[str], option: str, form: str) -> list[Any]:
    """The numbers of each event that an option gives: times [s] one after the other, and a value.

    UsageError: words that are not of the `form`, such as TIME:LOAD, or go back in time.
    """
    made: list[Any] = []
    before = 0.0
    for text in words:
        try:
            numbers = [float(part) for part in text.split(":")]
        except ValueError:
            numbers = []
        if len(numbers) != form.count(":") + 1 or not all(map(math.isfinite, numbers)):
            raise UsageError(
                f"{option} {text}", allowed=f"{form} in s and SI units is allowed", do="correct it"
            )
        times = [before, *numbers[:-1]]
        if times != sorted(times):
            raise UsageError(
                f"{option} {text} goes back in time",
                allowed="times that grow, from 0 s on, are allowed",
                do="correct it",
            )
        before = times[-1] + (1e-6 if len(numbers) == 2 else 0.0)  # a step takes a moment
        made.append(tuple(numbers))
    return made


def with_options(command: Callable[..., None], parameters: Iterable[Parameter]) -> None:
    """Give the command the parameters that typer reads, in the place of its own."""
    typed = [one.replace(kind=Parameter.KEYWORD_ONLY) for one in parameters]
    vars(command)["__signature__"] = Signature(typed)
    command.__annotations__ = {one.name: one.annotation for one in typed}


def plot_kind(kinds: Mapping[str, str]) -> Any:
    """The option --plot-kind of a command that draws these; one it cannot is refused at once."""

    def known(kind: str) -> str:
        refuse_unknown(kind, kinds, f"--plot-kind {kind}", do="choose one")
        return kind

    return typer.Option(
        "--plot-kind",
        help=f"What --plot draws: {', '.join(kinds)}.",
        callback=known,
        autocompletion=completing(kinds),
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
        "--format", help="csv, ndjson, parquet or json.", autocompletion=completing(TABLE_FORMATS)
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
        autocompletion=channels,
    ),
]
Channels = Annotated[
    list[str] | None,
    typer.Option(
        "--channel",
        help="Only this channel; several times for several (default: all that fit).",
        autocompletion=channels,
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


# ---- What help says beside each command's own words: groups, examples, what stands for a value.
#
# A new command has its line in GROUPS and in EXAMPLES, an option of a kind not seen before its word
# in METAVARS.


#: the commands in the order of help, by what one wants
GROUPS: Mapping[str, tuple[str, ...]] = {
    "Logs": ("info", "setup", "ingest", "simulate"),
    "Tables": (
        "speed",
        "footprint",
        "dissipation",
        "phase-shift",
        "inflation",
        "slip",
        "grip",
        "strain-shift",
        "wheel-angle",
        "tables",
        "check",
    ),
    "Physics": ("effects", "model", "compare", "diagnose", "form", "propose", "ladder", "report"),
    "Campaigns": ("campaign",),
}
#: per command: lines as they are typed in a folder like sample_data, with what they do
EXAMPLES: Mapping[str, tuple[tuple[str, str], ...]] = {
    "info": (
        ("tirelog info drive.csv.gz", "channels, rates, gaps, the setup"),
        ("tirelog info log.csv", "without a setup: columns, ranges, likely kinds"),
    ),
    "setup new": (("tirelog setup new log.csv -o log.toml", "a draft, guesses marked"),),
    "setup check": (("tirelog setup check drive.csv.gz", "what is implausible or missing"),),
    "ingest": (
        ("tirelog ingest drive.csv.gz -o drive.h5", "read once; every command takes the run"),
        ("zstd -dc log.csv.zst | tirelog ingest - --setup drive.toml -o run.h5", "from a pipe"),
    ),
    "simulate": (
        ("tirelog simulate scenarios/drive.toml -o made.csv", "beside it its truth and its setup"),
        ("tirelog simulate scenarios/drive.toml -o made.csv --seed 7", "another draw of the noise"),
    ),
    "speed": (
        ("tirelog speed drive.csv.gz -o speed.csv", "a row per passage"),
        ("tirelog speed drive.csv.gz hidden_1.csv.gz | head -3", "two logs, one table"),
        ("tirelog speed drive.csv.gz -o speed.csv --plot speed.png", "and a picture"),
    ),
    "footprint": (
        ("tirelog footprint drive.csv.gz -o footprint.csv", "contact length, edges, slip onset"),
        ("tirelog footprint drive.csv.gz -o f.csv --plot footprint.png", "and a picture"),
        (
            "tirelog footprint drive.csv.gz -o f.csv --plot wheel.svg --plot-kind polar",
            "strain around the wheel; also waterfall, edges, lengths, orders",
        ),
    ),
    "dissipation": (
        ("tirelog dissipation drive.csv.gz -o dissipation.csv", "factor and power per revolution"),
        ("tirelog dissipation drive.csv.gz --format ndjson", "lines for jq"),
    ),
    "phase-shift": (
        ("tirelog phase-shift encoder.h5 -o phase.csv", "patch width and phase shift"),
        (
            "tirelog phase-shift encoder_ramp.h5 --calibrate wheel.toml -o phase.csv",
            "learn the calibration from this log",
        ),
    ),
    "inflation": (
        ("tirelog inflation inflation.csv.gz -o inflation.csv", "strain against pressure"),
    ),
    "slip": (
        ("tirelog slip encoder.h5 -o slip.csv", "of each turn, from the vehicle's speed (P2)"),
    ),
    "grip": (
        ("tirelog grip drive.csv.gz -o grip.csv", "adhesion share, friction used and left"),
        ("tirelog grip drive.csv.gz --static-friction 1.0", "on a road with more of it"),
    ),
    "strain-shift": (
        ("tirelog strain-shift cleat.csv.gz -o shift.csv", "the patch's place in wheel angle"),
    ),
    "wheel-angle": (
        (
            "tirelog wheel-angle encoder.h5 -o angle.csv --plot angle.png",
            "0.1 s of P4 Figs. 4 to 6",
        ),
        ("tirelog wheel-angle encoder.h5 --from 5 --to 9 --every 20", "4 s, each 20th sample"),
    ),
    "tables": (
        ("tirelog tables drive.csv.gz -o results", "all that the log has channels for"),
        (
            "tirelog tables hidden_*.csv.gz -o results --table speed --table footprint",
            "two tables of many logs",
        ),
    ),
    "check": (
        ("tirelog check speed.csv --against golden.csv", "status 1 if rows moved"),
        (
            "tirelog check speed.csv --against golden.csv --tolerance speed_m_s=0.001",
            "or far enough",
        ),
    ),
    "effects": (
        ("tirelog effects", "the catalogue"),
        ("tirelog effects water_film --plot water_film.png", "what one does to the strain"),
    ),
    "model new": (
        ("tirelog model new --setup drive.toml -o model.toml", "a beam to begin with"),
        ("tirelog model new --preset P3 -o ring.toml", "the ring of a paper's table"),
    ),
    "model show": (("tirelog model show model.toml", "parameters, effects, ladders climbed"),),
    "model add": (("tirelog model add model.toml water_film -o better.toml", "an effect more"),),
    "model remove": (
        ("tirelog model remove better.toml water_film -o model.toml", "an effect less"),
    ),
    "model worn": (
        (
            "tirelog model worn ring.toml --new-depth 0.008 --depth 0.003 -o worn.toml",
            "5 mm of tread less",
        ),
    ),
    "model nuisance": (
        ("tirelog model nuisance model.toml wheel on -o model.toml", "run-out beside the model"),
    ),
    "model fit": (
        ("tirelog model fit drive.csv.gz --model model.toml -o fitted.toml", "with its errors"),
    ),
    "model predict": (
        ("tirelog model predict fitted.toml --speed 20 -o revolution.csv", "one revolution"),
        (
            "tirelog model predict fitted.toml --speed 5:25:5 --load 3000,4000 -o all.parquet",
            "ten of them",
        ),
    ),
    "model forces": (
        (
            "tirelog model forces ring.toml --speed 20 --load 1000:4000:1000",
            "at the hub, and what rolling costs",
        ),
    ),
    "model modes": (
        ("tirelog model modes ring.toml --speed 20", "of a ring, on the road"),
        (
            "tirelog model modes ring.toml --log drive.csv.gz --plot orders.png",
            "its modes over the log's order map; without a log, their shapes",
        ),
    ),
    "compare": (
        ("tirelog compare drive.csv.gz --model model.toml", "held out, beside the noise floor"),
        (
            "tirelog compare drive.csv.gz --model model.toml --by angle -o by_angle.csv",
            "where on the wheel it fails",
        ),
        (
            "tirelog compare drive.csv.gz --model model.toml --plot edges.pdf --plot-kind edges",
            "the patch's edges close up",
        ),
    ),
    "diagnose": (
        ("tirelog diagnose hidden_*.csv.gz --model model.toml", "which effect is missing"),
        ("tirelog diagnose hidden_*.csv.gz --model model.toml --format json", "for a script"),
        (
            "tirelog diagnose hidden_*.csv.gz --model model.toml --leave-one-out log "
            "--bootstrap 500",
            "does the verdict hang on one log, or on some manoeuvres?",
        ),
    ),
    "propose": (
        (
            "tirelog propose unknown_*.csv.gz --model model.toml -o better.toml",
            "the unknown effect as a formula",
        ),
    ),
    "form": (
        (
            "tirelog form hidden_*.csv.gz --model model.toml -o form.csv --plot form.png",
            "contact pressure over the patch, and stiffness over wavelength",
        ),
    ),
    "ladder": (
        (
            "tirelog ladder hidden_*.csv.gz --model model.toml --save better.toml --plot steps.png",
            "effects until nothing more is worth adding",
        ),
    ),
    "report": (
        ("tirelog report drive.csv.gz --model model.toml -o report.html", "one offline page"),
        (
            "tirelog report hidden_*.csv.gz --model model.toml --ladder model.ladder.json -o r.htm",
            "with the ladder; --propose also writes down what is unknown",
        ),
    ),
    "campaign run": (("tirelog campaign run campaign.toml --workers 2", "what is not made yet"),),
    "campaign status": (("tirelog campaign status campaign.toml", "done, failed and open"),),
}
#: what stands for the value of an argument or option in help
METAVARS: Mapping[str, str] = {
    "logs": "LOG",
    "log": "LOG",
    "scenario": "SCENARIO",
    "table": "TABLE",
    "name": "EFFECT",
    "effect": "EFFECT",
    "model": "MODEL",
    "campaign": "CAMPAIGN",
    "output": "FILE",
    "new_model": "FILE",
    "setup": "SETUP",
    "format": "FORMAT",
    "channel": "CHANNEL",
    "effects": "PYTHON_FILE",
    "own": "PYTHON_FILE",
    "plot": "PICTURE",
    "kind": "KIND",
    "save": "FILE",
    "against": "TABLE",
    "ladder": "LADDER",
    "calibration": "FILE",
    "calibrate": "FILE",
    "tolerance": "COLUMN=VALUE",
    "by": "WHAT",
    "workers": "NUMBER",
    "seed": "NUMBER",
    "average": "NUMBER",
    "points": "NUMBER",
    "carcass": "CARCASS",
    "preset": "PRESET",
    "contact": "CONTACT",
    "surface": "SURFACE",
    "observable": "OBSERVABLE",
    "cutoff": "CUTOFF",
    "nuisances": "WORDS",
    "use": "USE",
    "only": "PATTERN",
    "manifest": "CAMPAIGN",
    "scheduler": "ADDRESS",
    "road": "ROAD",
    "zero": "ZERO",
    "acceleration": "M_PER_S2",
    "speed": "M_PER_S",
    "steady_step": "M_PER_S",
    "slip": "SHARE",
    "temperature": "K",
    "time": "S",
    "duration": "S",
    "step": "S",
    "load": "N",
    "pressure": "PA",
    "from_Pa": "PA",
    "to_Pa": "PA",
    "hub_mass": "KG",
    "hub_inertia": "KG_M2",
    "sensor": "DEGREES",
    "to_frequency": "HZ",
    "modes": "NUMBER",
    "new_depth": "M",
    "depth": "M",
    "neutral_axis": "SHARE",
    "friction_ratio": "NUMBER",
    "static_friction": "NUMBER",
    "sliding_friction": "NUMBER",
    "stiffness_ratio": "NUMBER",
    "load_exponent": "NUMBER",
    "every": "NUMBER",
    "from_s": "S",
    "to_s": "S",
    "slip_angle": "DEGREES",
    "camber": "DEGREES",
}
#: letters of a first sentence that the list of commands shows: all of it, on several lines
_WHOLE = 400


class WholeHelp(TyperGroup):
    """Help of the program, its commands under headings, or of a group; no sentence is cut off."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        headings = GROUPS if self.name == "tirelog" else {"Commands": self.list_commands(ctx)}
        for title, names in headings.items():
            own = [(name, self.get_command(ctx, name)) for name in names]
            rows = [(n, c.get_short_help_str(_WHOLE)) for n, c in own if c is not None]
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)


def dress(command: Any, path: str = "") -> None:
    """Give a command, and all below it, their examples and words for values."""
    for name, below in getattr(command, "commands", {}).items():
        dress(below, f"{path} {name}".strip())
    lines = EXAMPLES.get(path, ())
    if lines:
        # \b: the lines stay as they are
        shown = "\n".join(f"  {line}\n      {does}" for line, does in lines)
        command.epilog = f"\b\nExamples:\n{shown}"
    for parameter in command.params:
        if not getattr(parameter, "is_flag", False):
            if parameter.metavar is None:
                parameter.metavar = METAVARS.get(parameter.name)
            if parameter.metavar is not None and parameter.param_type_name == "argument":
                parameter.display_type_rich = lambda *_, **__: ""  # the word says it
