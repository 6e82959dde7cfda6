"""The command line's table of contents, and what help says.

Science is imported inside the commands, so that help answers at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from tirelog.cli.options import keeping_inputs
from tirelog.vocabulary.tables import LOG_TABLES, LogTable

# ---- The commands, by name.


#: every command in the order of help, one of a group behind the group's name: a table of
#: `vocabulary.tables` (of a drive, before `tables`; others after it), or the module in
#: `tirelog.cli` and the function in it
COMMANDS: Mapping[str, str | LogTable] = {
    "ingest": "files:ingest",
    "info": "files:info",
    **{name: table for name, table in LOG_TABLES.items() if table.driven},
    "plot": "files:plot",
    "tables": "files:tables",
    **{name: table for name, table in LOG_TABLES.items() if not table.driven},
    "setup new": "files:new",
    "setup check": "files:check_setup",
    "simulate": "files:simulate",
    "effects": "model:effects",
    "model new": "model:new",
    "model show": "model:show",
    "model add": "model:add",
    "model remove": "model:remove",
    "model set": "model:change",
    "model worn": "model:worn",
    "model pressure": "model:pressure",
    "model fit": "model:fit",
    "model predict": "model:predict",
    "model forces": "model:forces",
    "model modes": "model:modes",
    "model plan": "model:plan",
    "model warm": "model:warm",
    "compare": "answers:compare",
    "diagnose": "answers:diagnose",
    "propose": "answers:propose",
    "form": "answers:form",
    "ladder": "answers:ladder",
    "report": "answers:report",
    "campaign run": "answers:run",
    "campaign status": "answers:status",
    "check": "files:check",
    "phase-shift": "files:phase_shift",  # which does more than write its table
}
#: groups of commands, with what help says of each
HELP: Mapping[str, str] = {
    "setup": "Draft the setup of a log, and check one.",
    "model": "Make, change, fit and evaluate model files.",
    "campaign": "Tables and models of all logs of a test campaign, resumable.",
}
#: commands that are asked for rarely: the lists of commands leave them out
RARE = ("slip", "grip", "strain-shift", "wheel-angle", "model worn")


def _function(place: str | LogTable) -> Any:
    """The command of a table, or the function at a place in `tirelog.cli`."""
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
    """Tables from the logs of a sensorised tire, and the effect that a tire model lacks."""


def command(asked: str = "") -> Any:
    """The command line as typer's command object: the command or group `asked`, else the whole.

    The whole also if there is no such command. One alone is made in 10 ms, the whole in 55 (CPU, 23
    November 2026, Python 3.11).
    """
    app = typer.Typer(
        name="tirelog",
        cls=WholeHelp,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        no_args_is_help=True,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_callback)
    groups = {"": app}
    for path in [one for one in COMMANDS if one.split()[0] == asked] or COMMANDS:
        group, _, name = path.rpartition(" ")
        if group not in groups:
            groups[group] = typer.Typer(
                help=HELP[group], cls=WholeHelp, rich_markup_mode=None, no_args_is_help=True
            )
            app.add_typer(groups[group], name=group)
        own = keeping_inputs(_function(COMMANDS[path]))
        groups[group].command(name, cls=PlainUsage, hidden=path in RARE)(own)
    parsed = typer.main.get_command(app)
    dress(parsed)
    return parsed


# ---- What help says beside each command's own words: groups, examples, words for a value.
#
# A new command has its line in GROUPS and in EXAMPLES, an option of a kind not seen before its word
# in METAVARS.


#: the commands in the order of help, by what one wants
GROUPS: Mapping[str, tuple[str, ...]] = {
    "Logs": ("info", "setup", "plot", "ingest", "simulate"),
    "Tables": (
        "speed",
        "footprint",
        "dissipation",
        "phase-shift",
        "inflation",
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
    "plot": (
        ("tirelog plot drive.csv.gz -o drive.png", "its signals, passages marked"),
        ("tirelog plot drive.csv.gz --from 10 --to 12 -o two_seconds.png", "a stretch of them"),
        (
            "tirelog plot drive.csv.gz --kind polar -o wheel.svg",
            "strain around the wheel; also waterfall, edges",
        ),
        ("tirelog plot model.toml -o model.png", "what a model predicts; also tables"),
    ),
    "simulate": (
        ("tirelog simulate scenarios/drive.toml -o made.csv", "beside it its truth and its setup"),
        ("tirelog simulate scenarios/drive.toml -o made.csv --seed 7", "another draw of the noise"),
    ),
    "speed": (
        ("tirelog speed drive.csv.gz -o speed.csv", "a row per passage"),
        ("tirelog speed drive.csv.gz hidden_1.csv.gz | head -3", "two logs, one table"),
        ("tirelog speed drive.csv.gz --from 10 --to 20", "a stretch of the log, in seconds"),
        ("tirelog speed drive.csv.gz -o speed.csv --plot speed.png", "and a picture"),
    ),
    "footprint": (
        ("tirelog footprint drive.csv.gz -o footprint.csv", "contact length, edges, slip onset"),
        ("tirelog footprint drive.csv.gz -o f.csv --plot footprint.png", "and a picture"),
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
        ("tirelog grip drive.csv.gz --static-friction 1.0", "on a road with more friction"),
    ),
    "strain-shift": (
        ("tirelog strain-shift cleat.csv.gz -o shift.csv", "the patch's place in wheel angle"),
    ),
    "wheel-angle": (
        (
            "tirelog wheel-angle encoder.h5 -o angle.csv --plot angle.png",
            "0.1 s of the encoder's signal",
        ),
        ("tirelog wheel-angle encoder.h5 --from 5 --to 9 --every 20", "4 s, each 20th sample"),
    ),
    "tables": (
        ("tirelog tables drive.csv.gz -o results", "every table that the log has channels for"),
        (
            "tirelog tables hidden_*.csv.gz -o results --table speed --table footprint",
            "two tables of many logs",
        ),
        ("tirelog tables drive.csv.gz -o results --table grip", "one of the rarely used tables"),
    ),
    "check": (
        ("tirelog check speed.csv --against golden.csv", "status 1 if rows moved"),
        (
            "tirelog check speed.csv --against golden.csv --tolerance speed_m_s=0.001",
            "with a tolerance of your own",
        ),
    ),
    "effects": (
        ("tirelog effects", "the catalogue"),
        ("tirelog effects water_film --plot water_film.png", "what an effect does to the strain"),
    ),
    "model new": (
        ("tirelog model new --setup drive.toml -o model.toml", "a beam to begin with"),
        ("tirelog model new --preset P3 -o ring.toml", "the ring of a paper's table"),
    ),
    "model show": (("tirelog model show model.toml", "parameters and effects"),),
    "model add": (("tirelog model add model.toml water_film -o better.toml", "one more effect"),),
    "model remove": (
        ("tirelog model remove better.toml water_film -o model.toml", "without this effect"),
    ),
    "model set": (
        (
            "tirelog model set model.toml line_mass_kg_m=4.5 lever_arm_m=fixed",
            "a value, and a parameter that no fit moves",
        ),
        (
            "tirelog model set model.toml lever_arm_m=0:0.01 wheel=on -o bounds.toml",
            "bounds, and the fit includes wheel run-out",
        ),
    ),
    "model worn": (
        (
            "tirelog model worn ring.toml --new-depth 0.008 --depth 0.003 -o worn.toml",
            "5 mm of tread less",
        ),
    ),
    "model pressure": (
        (
            "tirelog model pressure model.toml mat.csv --pitch 0.005 --load 3434 -o measured.toml",
            "of a mat with a cell each 5 mm",
        ),
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
            "forces at the hub, and rolling resistance",
        ),
    ),
    "model modes": (
        ("tirelog model modes ring.toml --speed 20", "of a ring, on the road"),
        ("tirelog model modes ring.toml --plot modes.png", "their shapes"),
    ),
    "model warm": (
        (
            "tirelog model warm lossy.toml --speed 20 --heat-capacity 15000 --cooling 12",
            "an hour at one speed",
        ),
        (
            "tirelog model warm lossy.toml --log drive.csv.gz --heat-capacity 15000 --cooling 12",
            "at a log's speeds; without the two numbers they are fitted to its temperature",
        ),
    ),
    "model plan": (
        ("tirelog model plan ring.toml --speed 5,10,20", "which test determines which number"),
    ),
    "compare": (
        ("tirelog compare drive.csv.gz --model model.toml", "validation error and noise floor"),
        (
            "tirelog compare drive.csv.gz --model model.toml --by angle -o by_angle.csv",
            "error over the wheel's angle",
        ),
        (
            "tirelog compare drive.csv.gz --model model.toml --plot compared.png",
            "and what the model misses as a picture",
        ),
    ),
    "diagnose": (
        ("tirelog diagnose hidden_*.csv.gz --model model.toml", "which effect is missing"),
        ("tirelog diagnose hidden_*.csv.gz --model model.toml --format json", "for a script"),
        (
            "tirelog diagnose hidden_*.csv.gz --model model.toml --leave-one-out log",
            "does the verdict hang on one log?",
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
            "tirelog ladder hidden_*.csv.gz --model model.toml -o ladder.json --plot steps.png",
            "forward selection of effects",
        ),
    ),
    "report": (
        ("tirelog report drive.csv.gz --model model.toml -o report.html", "one offline page"),
        (
            "tirelog report hidden_*.csv.gz --model model.toml --ladder ladder.json -o r.html",
            "with the ladder",
        ),
    ),
    "campaign run": (
        ("tirelog campaign run campaign.toml --workers 2", "all that is not made yet"),
    ),
    "campaign status": (("tirelog campaign status campaign.toml", "done, failed and open"),),
}
#: the word for the value of an argument or option in help
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
    "points": "NUMBER",
    "carcass": "CARCASS",
    "preset": "PRESET",
    "contact": "CONTACT",
    "surface": "SURFACE",
    "observable": "OBSERVABLE",
    "cutoff": "CUTOFF",
    "changes": "NAME=VALUE",
    "only": "PATTERN",
    "manifest": "CAMPAIGN",
    "road": "ROAD",
    "zero": "ZERO",
    "acceleration": "M_PER_S2",
    "speed": "M_PER_S",
    "steady_step": "M_PER_S",
    "start": "TIME",
    "stop": "TIME",
    "slip": "SHARE",
    "temperature": "K",
    "time": "S",
    "duration": "S",
    "step": "S",
    "load": "N",
    "pressure": "PA",
    "hub_mass": "KG",
    "hub_inertia": "KG_M2",
    "heat_capacity": "J_PER_K",
    "cooling": "W_PER_K",
    "ambient": "K",
    "sensor": "DEGREES",
    "to_frequency": "HZ",
    "modes": "NUMBER",
    "pitch": "M",
    "new_depth": "M",
    "depth": "M",
    "neutral_axis": "SHARE",
    "friction_ratio": "NUMBER",
    "static_friction": "NUMBER",
    "sliding_friction": "NUMBER",
    "stiffness_ratio": "NUMBER",
    "load_exponent": "NUMBER",
    "every": "NUMBER",
    "slip_angle": "DEGREES",
    "camber": "DEGREES",
}
#: letters of a first sentence that the list of commands shows: all of it, on several lines
_WHOLE = 400


class PlainUsage(TyperCommand):
    """A command whose usage has no braces: COMMAND [OPTIONS] LOG..."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        several = {p.metavar for p in self.params if p.nargs == -1}
        pieces = (piece.strip("{}") for piece in super().collect_usage_pieces(ctx))
        return [f"{piece}..." if piece.strip("[]") in several else piece for piece in pieces]


class WholeHelp(TyperGroup):
    """Help of the program, its commands under headings, or of a group; no sentence is cut off."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        headings = GROUPS if self.name == "tirelog" else {"Commands": self.list_commands(ctx)}
        for title, names in headings.items():
            own = [(name, self.get_command(ctx, name)) for name in names]
            shown = [(n, c) for n, c in own if c is not None and not c.hidden]
            rows = [(n, c.get_short_help_str(_WHOLE)) for n, c in shown]
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
        if not getattr(parameter, "is_flag", False) and parameter.metavar is None:
            parameter.metavar = METAVARS.get(parameter.name)
