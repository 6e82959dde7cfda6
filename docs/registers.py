"""Reference pages and the README's tables, made from the registers of the package.

python docs/registers.py            writes them
python docs/registers.py --check    status 1 if one is not what the registers give
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from tirelog.physics.effects import CATALOGUE, Effect
from tirelog.vocabulary.conditions import CONDITIONS
from tirelog.vocabulary.kinds import KINDS
from tirelog.vocabulary.observables import OBSERVABLES
from tirelog.vocabulary.units import UNITS

ROOT = Path(__file__).parents[1]
MADE = "Made by `python docs/registers.py` from `{}`; change that file, not this page.\n"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join(
        f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |\n" for line in lines
    )


def words(names: Iterable[str]) -> str:
    """Names as code, one after the other."""
    return ", ".join(f"`{name}`" for name in names)


def unit_of(unit: str) -> str:
    """A unit as a cell; a pure number has none."""
    return "" if unit == "1" else unit


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
                " ".join(units),
                kind.unit,
                words(told),
            )
        )
    return "\n".join(
        [
            "# Kinds of channel\n",
            MADE.format("tirelog/vocabulary/kinds.py"),
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
            ),
        ]
    )


def conditions_page() -> str:
    """docs/conditions.md."""
    rows = []
    for condition in CONDITIONS.values():
        key = condition.setup
        given = "" if key is None else f"{'from' if key.from_low else 'above'} {key.low:g}"
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
                "" if key is None else f"{given} to {key.high:g}",
                words(followers),
            )
        )
    return "\n".join(
        [
            "# Conditions\n",
            MADE.format("tirelog/vocabulary/conditions.py"),
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
            ),
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
            words(effect.id for effect in CATALOGUE if o.name in effect.reaches),
        )
        for o in OBSERVABLES.values()
    ]
    return "\n".join(
        [
            "# Observables\n",
            MADE.format("tirelog/vocabulary/observables.py"),
            "What a model predicts (`observable` in a model file) and a log measures. A new one: "
            "[howto/observable.md](howto/observable.md).\n",
            table(
                ("observable", "what it is", "form", "unit", "shown in", "measured by", "effects"),
                rows,
            ),
        ]
    )


def effects_page() -> str:
    """docs/effects.md."""
    return "\n".join(
        [
            "# Effects of the catalogue\n",
            MADE.format("tirelog/physics/effects/"),
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
        ("observables", words(effect.reaches)),
        ("needs", words(effect.needs) or "nothing beyond speed"),
        *((f"option `{name}`", words(allowed)) for name, allowed in effect.options.items()),
        ("signature", effect.signature),
        ("valid", "; ".join([effect.valid, *ranges(effect)])),
        ("source", effect.source),
    ]
    return "\n".join(
        [
            f"## {effect.id}\n",
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


def readme_tables() -> dict[str, str]:
    """The README's tables by the name in their marks."""
    keys = [c for c in CONDITIONS.values() if c.setup is not None or c.kinds]
    return {
        "kinds": table(
            ("kind", "what it is", "unit if none is named"),
            [(f"`{k.name}`", k.meaning, k.source_unit) for k in KINDS.values()],
        ),
        "conditions": table(
            ("condition", "what it is", "key of `[conditions]`", "or a channel of kind"),
            [
                (
                    c.name,
                    f"{c.meaning} [{c.unit}]",
                    f"`{c.field}`" if c.setup is not None else "",
                    words(c.kinds),
                )
                for c in keys
            ],
        ),
        "observables": table(
            ("`--observable`", "what it is", "unit", "measured by channels of kind"),
            [(f"`{o.name}`", o.meaning, o.unit, words(o.kinds)) for o in OBSERVABLES.values()],
        ),
    }


def readme(text: str) -> str:
    """The README with its tables as the registers give them."""
    for name, made in readme_tables().items():
        begin, end = f"<!-- {name}: docs/registers.py -->\n", f"<!-- end of {name} -->"
        marked = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
        if len(marked.findall(text)) != 1:
            raise ValueError(f"the README has not one place for the table of {name}")
        text = marked.sub(lambda _, made=f"{begin}{made}{end}": made, text)  # type: ignore[misc]
    return text


def pages() -> dict[Path, str]:
    """Every file that is made, with what it should say."""
    return {
        ROOT / "docs" / "channel_kinds.md": kinds_page(),
        ROOT / "docs" / "conditions.md": conditions_page(),
        ROOT / "docs" / "observables.md": observables_page(),
        ROOT / "docs" / "effects.md": effects_page(),
        ROOT / "README.md": readme((ROOT / "README.md").read_text(encoding="utf-8")),
    }


def main(arguments: Sequence[str]) -> int:
    """Write what differs, or only say it."""
    other = [
        path
        for path, text in pages().items()
        if not path.exists() or path.read_text(encoding="utf-8") != text
    ]
    if "--check" not in arguments:
        made = pages()
        for path in other:
            path.write_text(made[path], encoding="utf-8")
    sys.stdout.writelines(f"{path.relative_to(ROOT)}\n" for path in other)
    return 1 if other and "--check" in arguments else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
