"""Reference pages and tables in pages, from the registers of the package.

    python docs/generate.py             writes them (also: make reference)
    tests/test_docs.py                  the committed ones are what the registers give

`PAGES` are whole files; `SECTIONS` stand in written pages, between two comments that name them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, Field, fields
from inspect import Parameter, Signature, getdoc, isclass, isroutine, signature, unwrap
from pathlib import Path
from typing import Any

import tirelog
from tirelog.data import setup
from tirelog.diagnosis.certainty import CLASSES, calibration, least_share
from tirelog.diagnosis.propose.grammar import FRAMES, LAWS, PROFILES, STAGES
from tirelog.diagnosis.rules import RULES, THRESHOLDS
from tirelog.physics.effects import CATALOGUE, Effect, readers, serves
from tirelog.physics.model import file as model_file
from tirelog.physics.model.file import PRESETS
from tirelog.physics.model.model import NUISANCES, Model, Nuisance
from tirelog.physics.model.user_effects import FRAMES as SHAPE_FRAMES
from tirelog.report.page import GLOSSARY
from tirelog.simulation.scenario import schema
from tirelog.storage.schema import KeyKind, OneOf, kinds_of
from tirelog.vocabulary.columns import COLUMNS, OPTIONAL, TABLES
from tirelog.vocabulary.conditions import CONDITIONS
from tirelog.vocabulary.kinds import KINDS
from tirelog.vocabulary.observables import OBSERVABLES
from tirelog.vocabulary.quality import OK, Quality
from tirelog.vocabulary.tables import LOG_PICTURES, LOG_TABLES, LogTable
from tirelog.vocabulary.units import UNITS

ROOT = Path(__file__).resolve().parents[1]
NOTE = "<!-- made by `make reference` from {}; change that file -->"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def words(names: Iterable[str]) -> str:
    """Names as code, one after the other."""
    return ", ".join(f"`{name}`" for name in names)


def unit_of(unit: str) -> str:
    """A unit as a cell; a pure number has none."""
    return "" if unit == "1" else unit


def quality_page() -> str:
    """The words with the tables they stand in and what their rows are good for."""
    rows = [
        (
            f"`{flag.word}`",
            flag.sentence,
            ", ".join(f"`{name}`" for name in flag.tables),
            "; ".join(use.value for use in flag.good_for) or "no",
        )
        for flag in sorted(Quality, key=_word)
    ]
    return f"""{NOTE.format("tirelog/vocabulary/quality.py")}
# Quality words

The column `quality` of a table is `{OK}`, or words in alphabetical order joined by `;`: what is
wrong inside the patch window of that row. The row stays in the table with all numbers that are
known. Unless the last column says otherwise, it is left out of pictures, moving averages,
regressions, calibrations, and of the numbers per revolution that are compared with a model. A word
that is not in this list, in a table of another version or tool, is kept and counted, and its row
left out too.

{table(("word", "what it says of the row", "tables", "the row is used nevertheless"), rows)}
"""


def _word(flag: Quality) -> str:
    return flag.word


def kinds_page() -> str:
    """docs/channel_kinds.md."""
    rows = []
    for kind in KINDS.values():
        told = [o.name for o in OBSERVABLES.values() if kind.name in o.kinds]
        told += [c.field for c in CONDITIONS.values() if kind.name in c.kinds]
        units = [name for name, (quantity, _, _) in UNITS.items() if quantity in kind.quantities]
        rows.append(
            (
                f"`{kind.name}`",
                kind.meaning,
                kind.source_unit,
                " ".join(units) or "any",
                kind.unit if kind.quantities else "SI, or as it is written",
                words(told),
            )
        )
    return "\n".join(
        [
            NOTE.format("tirelog/vocabulary/kinds.py"),
            "# Kinds of channel\n",
            "`kind` and `unit` of a channel in a setup. Inside, everything is SI.\n",
            table(
                (
                    "kind",
                    "what it is",
                    "unit if the setup names none",
                    "allowed units",
                    "inside",
                    "observables and conditions that it gives",
                ),
                rows,
            )
            + "\n",
        ]
    )


def conditions_page() -> str:
    """docs/conditions.md."""
    rows = []
    for condition in CONDITIONS.values():
        key = condition.setup
        given = "" if key is None else f"{'from' if key[2] else 'above'} {key[0]:g}"
        followers = [
            effect.id
            for effect in CATALOGUE
            if condition.field in [name for name, _ in effect.followed]
        ]
        rows.append(
            (
                f"`{condition.field}`",
                condition.meaning,
                unit_of(condition.unit),
                f"`{condition.symbol}`" if condition.in_expressions else "",
                words(condition.kinds),
                "" if key is None else f"{given} to {key[1]:g}",
                words(followers),
            )
        )
    return "\n".join(
        [
            NOTE.format("tirelog/vocabulary/conditions.py"),
            "# Conditions\n",
            "What a revolution is driven under. A channel that measures a condition goes before "
            "the setup's constant; speed,\nacceleration and time come from the passages of the "
            "patch. A condition that nothing gives is not known, and an\neffect that needs it is "
            "refused. A new one: [howto/condition.md](howto/condition.md).\n",
            table(
                (
                    "condition",
                    "what it is",
                    "unit",
                    "in an expression",
                    "measured by channels of kind",
                    "allowed in a setup's `[conditions]`",
                    "effects that follow it",
                ),
                rows,
            )
            + "\n",
        ]
    )


def observables_page() -> str:
    """docs/observables.md."""
    rows = [
        (
            f"`{o.name}`",
            o.meaning,
            "waveform" if o.waveform else "number per revolution",
            unit_of(o.unit),
            unit_of(o.shown_unit),
            words(o.kinds),
            words(effect.id for effect in CATALOGUE if o.name in effect.reaches) + through(o.name),
        )
        for o in OBSERVABLES.values()
    ]
    return "\n".join(
        [
            NOTE.format("tirelog/vocabulary/observables.py"),
            "# Observables\n",
            "What a model predicts (`observable` in a model file) and a log measures. A new one: "
            "[howto/observable.md](howto/observable.md).\n",
            table(
                ("observable", "what it is", "form", "unit", "shown in", "measured by", "effects"),
                rows,
            )
            + "\n",
        ]
    )


def tables_page() -> str:
    """docs/tables.md."""
    return (
        "\n".join(
            [
                NOTE.format("tirelog/vocabulary/tables.py"),
                "# Tables of a log\n",
                "Each is a command and a function of `import tirelog`; those of a drive are made "
                "by `tirelog tables` and\nare keys of a campaign's `[tables]`, with the names of "
                "options in brackets. `--table NAME` makes the\nothers too. A column in brackets "
                "is there only if the setup or a calibration gives what it needs.\nA new one: "
                "[howto/table.md](howto/table.md).\n\n"
                "`--from` and `--to` (`start`, `stop`) leave out the rows outside of a stretch, in "
                "seconds since the first sample\nor in stamps as in the log: in all tables but "
                "`inflation`. The rows are those of the whole log's table, with\nthe same ordinals "
                "of revolutions. At the ends of the stretch too they use their neighbours.",
                *(table_section(entry) for entry in LOG_TABLES.values()),
            ]
        )
        + "\n"
    )


def table_section(entry: LogTable) -> str:
    """All that the register says of one table."""
    columns = [COLUMNS[name] for name in entry.columns]
    options = "".join(
        f"* `{o.flag}` (`{o.name}`): {o.help}\n" for o in (*entry.options, *entry.views)
    )
    return "\n".join(
        [
            f"\n## {entry.name}\n",
            f"{entry.says} `tirelog {entry.name} LOG`, `tirelog.{entry.python_name}(log)`.\n",
            f"* a table {'of a drive' if entry.driven else 'by its name alone'}, "
            f"made of channels of kind {words(entry.kinds)}\n{options}",
            table(
                ("column", "unit", "what it is"),
                [
                    (
                        f"[`{c.name}`]" if c.name in OPTIONAL else f"`{c.name}`",
                        c.unit,
                        c.meaning_in(entry.name),
                    )
                    for c in columns
                ],
            ),
        ]
    )


def through(observable: str) -> str:
    """What acts on an observable beside another effect only."""
    beside = {
        effect.id: " or ".join(f"`{other.id}`" for other in readers(effect, observable))
        for effect in CATALOGUE
    }
    return "".join(
        f"; beside {others}: {words(name for name, by in beside.items() if by == others)}"
        for others in dict.fromkeys(filter(None, beside.values()))
    )


def effects_page() -> str:
    """docs/effects.md."""
    return (
        "\n".join(
            [
                NOTE.format("tirelog/physics/effects/"),
                "# Effects of the catalogue\n",
                "A new one: [howto/effect.md](howto/effect.md). `compare`, `diagnose` and `ladder` "
                "remark when a range is left.\n",
                table(
                    ("effect", "mechanism", "follows", "acts on", "valid for"),
                    [
                        (
                            f"[`{e.id}`](#{e.id})",
                            e.mechanism,
                            e.follows_said,
                            ", ".join(e.acts_on),
                            "; ".join(ranges(e)),
                        )
                        for e in CATALOGUE
                    ],
                ),
                *(effect_section(effect) for effect in CATALOGUE),
            ]
        )
        + "\n"
    )


def ranges(effect: Effect) -> list[str]:
    """The ranges of an effect in words."""
    units = {p.name: p.unit for p in effect.parameters}
    return [
        f"{CONDITIONS[name].name if name in CONDITIONS else name} {low:g} to {high:g} "
        f"{unit_of(CONDITIONS[name].unit if name in CONDITIONS else units[name])}".rstrip()
        for name, (low, high) in effect.valid_range.items()
    ]


def effect_section(effect: Effect) -> str:
    """All that the catalogue says of one effect."""
    facts = [
        (
            "observables",
            ", ".join(said.replace(name, f"`{name}`", 1) for name, said in serves(effect).items()),
        ),
        ("needs", words(effect.needs) or "nothing beyond speed"),
        *((f"option `{name}`", words(allowed)) for name, allowed in effect.options.items()),
        ("signature", effect.signature),
        ("valid", "; ".join([effect.valid, *ranges(effect)])),
        ("source", effect.source),
        *([] if effect.tried else [("diagnose", "does not try it; add it if you know of it")]),
    ]
    return "\n".join(
        [
            f"\n## {effect.id}\n",
            f"{effect.mechanism[0].upper()}{effect.mechanism[1:]}.\n",
            "".join(f"* {name}: {said}\n" for name, said in facts),
            table(
                ("parameter", "what it is", "unit", "start", "bounds"),
                [
                    (
                        f"`{p.name}`",
                        p.description + ("" if p.free else " (fixed)"),
                        unit_of(p.unit),
                        f"{p.value:g}",
                        f"{p.min:g} to {p.max:g}",
                    )
                    for p in effect.parameters
                ],
            ),
        ]
    )


#: tables of a scenario file, in the order of a reader's questions
SCENARIO_TABLES: Mapping[str, type] = {
    "[[manoeuvres]]": schema.Manoeuvre,
    "[channels.NAME]": schema.Sensor,
    "[tire]": schema.TrueTire,
    "[conditions]": schema.TrueConditions,
    "[vehicle]": schema.Vehicle,
    "[road]": schema.Road,
    "[ramp]": schema.Ramp,
}
NUISANCE_TABLES: Mapping[str, type] = {
    f"[nuisances.{f.name}]": type(f.default) for f in fields(schema.Nuisances)
}


def scenario_page() -> str:
    """docs/scenario.md."""
    return (
        "\n".join(
            [
                NOTE.format("tirelog/simulation/scenario/schema.py"),
                "# Scenario files\n",
                "What `tirelog simulate` drives. sample_data/README.md shows a file as a whole, "
                "and what can be planted with\n`[[effects]]`; a key that is not here is refused. "
                "The same `seed` gives the same log.",
                *(scenario_section(name, kind) for name, kind in SCENARIO_TABLES.items()),
                "\n## Nuisances\n",
                f"{getdoc(schema.Nuisances)}\n",
                "They act in the truth, beam or ring, any of them together. Beside them: "
                "`load_scatter` under `[road]`,\n`patch_load_exponent` under `[tire]`, and with "
                "the channel `noise_correlation`, `hum`, `flicker`, `quantisation`,\n"
                "`lost_fraction`, `lost_run`, `lost_at_flanks`. "
                "`sample_data/scenarios/nuisances.toml` has all of them.",
                *(scenario_section(name, kind, "###") for name, kind in NUISANCE_TABLES.items()),
            ]
        )
        + "\n"
    )


def scenario_section(name: str, kind: type, level: str = "##") -> str:
    """One table of a scenario: what it is, its keys with what is allowed."""
    rows = rows_of(kind)
    head = ("key", "if absent", "allowed")
    return f"\n{level} `{name}`\n\n{getdoc(kind)}\n\n{table(head, rows)}"


def rows_of(table: type) -> list[tuple[str, str, str]]:
    """A row for each key of a table: its name, what it is if absent, what is allowed."""
    kinds = kinds_of(table)
    return [
        (f"`{f.name}`", default_of(f), allowed_in(kinds[f.name]))
        for f in fields(table)
        if f.name in kinds
    ]


def default_of(key: Field[Any]) -> str:
    """A key's value if a scenario does not give it, as a cell."""
    if key.default is MISSING or key.default in (None, "", ()):
        return ""
    value = key.default
    return str(value).lower() if isinstance(value, bool) else f"{value}"


def allowed_in(kind: KeyKind) -> str:
    """What a file may give for a key, as a cell."""
    if isinstance(kind, OneOf):
        plain = all(word[:1].isalnum() for word in kind.choices)
        return words(kind.choices) if plain else ", ".join(map(in_quotes, kind.choices))
    return kind.allowed.removeprefix("allowed is ").removeprefix("a number ").removeprefix("from ")


def in_quotes(word: str) -> str:
    """A word of punctuation as TOML and a cell of a table take it."""
    shown = f'"{word}"'.replace("\t", "\\t")
    return '"&#124;"' if word == "|" else f"`{shown}`"


def kinds_section() -> str:
    """Kinds of channel."""
    return table(
        ("kind", "what it is", "unit if none is named"),
        [(f"`{kind.name}`", kind.meaning, kind.source_unit) for kind in KINDS.values()],
    )


def conditions_section() -> str:
    """Conditions that a setup or a channel gives."""
    rows = [
        (
            c.name,
            f"{c.meaning} [{c.unit}]",
            f"`{c.field}`" if c.setup is not None else "",
            words(c.kinds),
        )
        for c in CONDITIONS.values()
        if c.setup is not None or c.kinds
    ]
    head = ("condition", "what it is", "key of `[conditions]`", "or a channel of kind")
    return table(head, rows)


def observables_section() -> str:
    """What a model predicts."""
    rows = [(f"`{o.name}`", o.meaning, o.unit, words(o.kinds)) for o in OBSERVABLES.values()]
    return table(("`--observable`", "what it is", "unit", "measured by channels of kind"), rows)


def setup_keys_section() -> str:
    """Every key of a setup with its range."""
    parts = []
    for name, kind in SETUP_TABLES.items():
        rows = rows_of(kind)
        about = f"```text\n{getdoc(kind)}\n```\n\n" if kind.__doc__ else ""
        parts.append(f"### `{name}`\n\n{about}{table(('key', 'if absent', 'allowed'), rows)}")
    return "\n\n".join(parts)


SETUP_TABLES: Mapping[str, type] = {
    "[tire]": setup.Tire,
    "[conditions]": setup.LogConditions,
    "[channels.NAME]": setup.ChannelSetup,
    "[log]": setup.LogSetup,
    "[road]": setup.RoadSetup,
}


def parameters_section() -> str:
    """The parameters of each carcass with start and bounds."""
    head = ("parameter", "unit", "what it is", "start", "bounds", "in a new model")
    parts = []
    for title, carcass, contact in (
        ('`carcass = "beam"`', "beam", "prescribed"),
        ('`carcass = "ring"`, on a flat road', "ring", "flat_road"),
        ('`carcass = "coupled_ring"`', "coupled_ring", "flat_road"),
    ):
        made = Model.new(carcass, contact=contact)
        rows = [
            (
                f"`{p.name}`",
                unit_of(p.unit),
                p.description,
                f"{p.value:g}",
                f"{p.min:g} to {p.max:g}",
                "free" if p.free else "fixed",
            )
            for p in made.base
        ]
        parts.append(f"### {title}\n\n{table(head, rows)}")
    return "\n\n".join(parts)


def presets_section() -> str:
    """The presets with all that their files say."""
    folder = Path(model_file.__file__).parent / "presets"
    return "\n\n".join(
        f"`--preset {name}`\n\n```toml\n{(folder / f'{name}.toml').read_text().rstrip()}\n```"
        for name in PRESETS
    )


def campaign_keys_section() -> str:
    """The tables of a campaign with their options."""
    rows = [
        (f"`[tables.{name}]`", f"`{o.name}`", o.help)
        for name, entry in LOG_TABLES.items()
        if entry.driven
        for o in entry.options
    ]
    plain = [
        f"`[tables.{name}]`"
        for name, entry in LOG_TABLES.items()
        if entry.driven and not entry.options
    ]
    without = f"\n\nWithout options: {', '.join(plain)}." if plain else ""
    return table(("table", "key", "what it does"), rows) + without


def errors_section() -> str:
    """Every column that is a standard error, with its tables, a row for each meaning."""
    meanings: dict[tuple[str, str, str], list[str]] = {}
    for c in COLUMNS.values():
        for name in [n for n, columns in TABLES.items() if c.name in columns]:
            if re.search(r"_se(_|$)", c.name):
                meanings.setdefault((c.name, c.unit, c.meaning_in(name)), []).append(
                    name.replace("-fit", " --fit")
                )
    rows = [(f"`{n}`", unit, words(tables), said) for (n, unit, said), tables in meanings.items()]
    return table(("column", "unit", "table", "what it is"), rows)


def _sizes(nuisance: Nuisance) -> str:
    """The ordinary sizes of a nuisance as a cell."""
    return "; ".join(f"`{p.name}` {p.value:g} {unit_of(p.unit)}".strip() for p in nuisance.sizes)


def verdicts_page() -> str:
    """The verdicts in the order in which they are tried, and every number that decides."""
    rules = [(f"`{verdict}`", words) for verdict, _, words in RULES]
    numbers = [
        (f"`{name}`", f"{value:.3g}", unit, reason)
        for name, (value, unit, reason) in THRESHOLDS.items()
    ]
    nuisances = [(f"`{n.name}`", n.description, _sizes(n)) for n in NUISANCES]
    return f"""{NOTE.format("tirelog/diagnosis/rules.py")}
# How a verdict comes about
The first rule that holds is the verdict of `tirelog diagnose`:

{table(("verdict", "given if"), rules)}

## What decides
{table(("name", "value", "unit", "why"), numbers)}

## Nuisances
What every wheel, road and day does is fitted beside the model if it earns its place by the rules of
an effect, or if the model file's `[nuisances]` says `"on"`; never if it says `"off"`. `form` has a
table of its own there, `[form]`, with the same words. A size is the standard deviation of an
amplitude before anything is measured, and can be given:
`wheel = {{ use = "auto", force = 0.02 }}`.

{table(("nuisance", "what it is", "ordinary sizes"), nuisances)}

Hum of the supply (50 or 60 Hz and multiples) keeps its own frequency, so it does not average out
where the wheel turns at a whole fraction of it, and then looks like a shape that one manoeuvre has.
It is measured in the differences of neighbouring revolutions, in which whatever repeats with the
wheel cancels. It is removed from the waveforms before anything is compared, and a remark has its
size. Other lines, as of an inverter or a pump, stay and can end in the verdict `scatter`.
"""


def propose_page() -> str:
    """The grammar of `propose` and the frames of a measured shape."""
    frames = [(f.name, f.words, f"`{f.text}`", unit_of(f.unit)) for f in FRAMES if f.side != "none"]
    profiles = [(p.name, f"`{p.text}`", ", ".join(p.sides), ", ".join(p.stages)) for p in PROFILES]
    stages = [
        (s.words, f"`{s.acts_on or 'the observable'}`", s.unit or "the observable's")
        for s in STAGES.values()
    ]
    grown = [(f"`{law.text}`", words(law.varies)) for law in LAWS]
    shapes = [
        (f"`{f.name}`", f.words, f"`{f.coordinate}`", unit_of(f.unit), words(f.acts_on))
        for f in SHAPE_FRAMES.values()
    ]
    return f"""{NOTE.format("tirelog/diagnosis/propose/grammar.py")}
# What `propose` tries
`tirelog propose LOG... --model M -o BETTER.toml` writes an unknown effect down if `diagnose` says
*unknown*, or if a large rest repeats beside what it names. A third of the manoeuvres is locked
away before the search and serves once, for the error that is printed. Free shapes come
first: each frame below times each law; the best is the ceiling, and can stand in a model file as it
is. Then every profile in every frame at every stage under every law, with p over all of them; at
most three terms. A new form: [howto/form.md](howto/form.md).

## Profiles
Along a coordinate u of a frame, with d = u - at; `@` is a wave of free phase.

{table(("profile", "formula", "frames to one or both sides", "stages"), profiles)}

## Frames
{table(("frame", "where it is fixed", "u", "unit"), frames)}

## Stages
{table(("where it acts", "`acts_on`", "unit of the strength"), stages)}

## Laws
{{name}} is a typical value of the condition; a law is left out if its condition does not vary.

{table(("law", "only if it varies"), grown)}

## Measured shapes
`shape = "empirical"` in a model file: `nodes` and `values` along a `frame`, times a `law` over
conditions (`speed / 20`; `1` for none), straight lines between the nodes and nothing outside. On
`contact_pressure` values are shares of the mean pressure.

{table(("frame", "where it is fixed", "coordinate", "unit", "`acts_on`"), shapes)}
"""


def pictures_section() -> str:
    """What --kind takes."""
    rows = [(f"`{kind}`", says) for kind, says in LOG_PICTURES.items()]
    return table(("`--kind`", "what is drawn"), rows)


def certainty_section() -> str:
    """The cases that the table of `diagnose` rests on."""
    known = calibration()
    rows = [
        (
            ", ".join(f"`{verdict}`" for verdict in verdicts),
            *(f"{known[kind][key]:g}" for key in ("cases", "tires", "right")),
            f"{100.0 * least_share(known[kind]['right'], known[kind]['cases']):.0f} %",
            ", ".join(known[kind]["carcasses"]),
        )
        for kind, verdicts in CLASSES.items()
        if kind in known
    ]
    head = ("verdict", "cases", "tires", "right", "at least", "carcass")
    return f"Made on {known['date']}.\n\n{table(head, rows)}"


#: headings of docs/api.md by the module that defines a name
HEADINGS = {
    "tirelog.api.logs": "Logs and setups",
    "tirelog.api.tables": "Tables",
    "tirelog.api.parts": "Calibrations",
    "tirelog.api.pictures": "Pictures",
    "tirelog.api.models": "Models",
    "tirelog.api.answers": "Answers",
    "tirelog.api.campaigns": "Campaigns",
}


def api_page() -> str:
    """Every public name of the package, with its docstring."""
    names = [*tirelog.__all__, *(t.python_name for t in LOG_TABLES.values())]
    headed: dict[str, list[str]] = {title: [] for title in [*HEADINGS.values(), "Objects"]}
    for name in sorted(dict.fromkeys(names)):
        value = getattr(tirelog, name)
        title = HEADINGS.get(unwrap(value).__module__, "Objects")
        headed[title].append(class_entry(value) if isclass(value) else function_entry(value))
    return (
        "\n\n".join(
            [
                NOTE.format("docstrings in tirelog/api"),
                "# Functions of the package",
                "All names are those of `import tirelog`; a name is loaded when it is first used.\n"
                "Units are SI. [From Python](python.md) shows how they work together.",
                *(f"## {title}\n\n" + "\n\n".join(parts) for title, parts in headed.items()),
            ]
        )
        + "\n"
    )


def function_entry(function: Callable[..., object]) -> str:
    """A function with its signature and the sections of its docstring."""
    first, *sections = re.split(r"\n\n?(\w+)\n-{3,}\n", getdoc(function) or "")
    parts = [f":::{{py:function}} tirelog.{function.__name__}{signature_of(function)}", first]
    for title, text in zip(sections[::2], sections[1::2], strict=True):
        body = f"```pycon\n{text.strip()}\n```" if title == "Examples" else entries(text)
        parts.append(f"**{title}**\n\n{body}")
    return f"### {function.__name__}\n\n" + "\n\n".join(parts) + "\n:::"


def class_entry(kind: type) -> str:
    """A class with its docstring and the first lines of what it offers."""
    rows = [
        (f"`{name}`", (getdoc(value) or "").partition("\n")[0])
        for name, value in vars(kind).items()
        if not name.startswith("_") and (isroutine(value) or isinstance(value, property))
    ]
    offered = "\n\n" + table(("name", "what it gives"), rows) if rows else ""
    return (
        f"### {kind.__name__}\n\n:::{{py:class}} tirelog.{kind.__name__}\n"
        f"```text\n{getdoc(kind)}\n```{offered}\n:::"
    )


def signature_of(function: Callable[..., object]) -> str:
    """The parameters with their defaults, without types, which are in the docstring."""
    given = signature(function)
    plain = [p.replace(annotation=Parameter.empty) for p in given.parameters.values()]
    shown = str(given.replace(parameters=plain, return_annotation=Signature.empty))
    return re.sub(r"<function .*? at \w+>", "...", shown)


def entries(text: str) -> str:
    """A section of a docstring as a list: names at the margin, texts indented below."""
    items: list[str] = []
    for line in text.strip().splitlines():
        if line and not line.startswith(" "):
            name, _, kind = line.partition(" : ")
            items.append(f"* `{name}`" + (f" ({kind})" if kind else "") + ":")
        elif line.strip():
            items.append(f"  {line.strip()}")
    return "\n".join(items).replace("``", "`").removesuffix(":")


def glossary_page() -> str:
    """The words of the report, and those of the sensors and models."""
    words_of_all = sorted((*GLOSSARY, *FURTHER_WORDS), key=_lower)
    return (
        f"{NOTE.format('tirelog/report/page.py and docs/generate.py')}\n# Glossary\n\n"
        + "\n\n".join(f"**{word}**: {meaning}." for word, meaning in words_of_all)
        + "\n"
    )


def _lower(entry: tuple[str, str]) -> str:
    return entry[0].lower()


#: words of the pages and the terminal that the report does not use
FURTHER_WORDS = (
    ("fiber Bragg grating (FBG)", "a sensor in a glass fiber; its wavelength follows the strain"),
    ("reference grating", "a second grating that feels the temperature and no strain; `twin` in "
     "the setup"),
    ("patch", "the part of the tread that touches the road; also contact patch or footprint"),
    ("entry edge, exit edge", "where the tread meets and leaves the road; at xi = -L and xi = +L"),
    ("xi, phi", "place about the middle of the patch, along the tread [m] and as an angle [rad]"),
    ("passage", "one way of the sensor through the patch; a revolution lies between two"),
    ("setup", "a TOML file that says what the channels of a log are"),
    ("run", "a log that `tirelog ingest` has repaired and stored as HDF5"),
    ("carcass", "the structure of a model: a beam on a foundation, a ring, or a coupled ring"),
    ("observable", "the quantity that a model predicts, such as strain or phase shift"),
    ("nuisance", "a disturbance of wheel, road or day, such as run-out, fitted beside the model"),
    ("ladder", "forward selection: effects are added one by one while each improves the model"),
    ("verdict", "the first word of a diagnosis, such as missing, ambiguous or unknown"),
    ("repeatability", "how far similar revolutions agree; the noise floor measures it"),
    ("form", "the tire's own shape of strain, learned from the log without a model of the carcass"),
    ("quality word", "an entry of the column `quality`"),
)  # fmt: skip


PAGES: Mapping[str, Callable[[], str]] = {
    "docs/api.md": api_page,
    "docs/glossary.md": glossary_page,
    "docs/quality_words.md": quality_page,
    "docs/channel_kinds.md": kinds_page,
    "docs/conditions.md": conditions_page,
    "docs/observables.md": observables_page,
    "docs/effects.md": effects_page,
    "docs/verdicts.md": verdicts_page,
    "docs/propose.md": propose_page,
    "docs/tables.md": tables_page,
    "docs/scenario.md": scenario_page,
}
SECTIONS: Mapping[str, Mapping[str, Callable[[], str]]] = {
    "docs/setup.md": {
        "channel kinds": kinds_section,
        "conditions": conditions_section,
        "keys": setup_keys_section,
    },
    "docs/model.md": {
        "observables": observables_section,
        "parameters": parameters_section,
        "presets": presets_section,
    },
    "docs/campaigns.md": {"keys": campaign_keys_section},
    "docs/standard_errors.md": {"columns": errors_section},
    "docs/slides.md": {"kinds": pictures_section},
    "docs/methods/certainty.md": {"cases": certainty_section},
}


def filled(page: str, text: str) -> str:
    """A written page with each of its sections as the registers give it."""
    for name, made in SECTIONS[page].items():
        begin = f"<!-- {name}: made by `make reference` -->\n"
        end = f"\n<!-- end of {name} -->"
        if len(re.findall(f"{re.escape(begin)}.*?{re.escape(end)}", text, re.S)) != 1:
            raise SystemExit(f"{page}: not one section {name!r} between its two comments")
        before, rest = text.split(begin)
        text = before + begin + made() + end + rest.split(end)[1]
    return text


def made() -> dict[Path, str]:
    """Every file that is made, with its text."""
    whole = {ROOT / name: text() for name, text in PAGES.items()}
    return whole | {ROOT / name: filled(name, (ROOT / name).read_text()) for name in SECTIONS}


if __name__ == "__main__":
    for path, text in made().items():
        path.write_text(text)
