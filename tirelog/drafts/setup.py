"""A first setup for a log: what its contents tell is written, what was guessed is marked.

Contents --channels, twins, references--> TOML --read back with the log--> surfaces filled in
"""

from __future__ import annotations

import json
import re
import shlex
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tirelog.data.setup import names_beside, parse_setup
from tirelog.drafts.contents import Contents, FoundSeries, contents
from tirelog.drafts.surface import likely_surface
from tirelog.errors import TirelogError
from tirelog.runs.ingest import is_file, open_recording
from tirelog.vocabulary import units
from tirelog.vocabulary.kinds import STRAIN_KINDS, WAVELENGTH_KINDS

#: the word that marks a guess, which `tirelog setup check` looks for
MARK = "guessed"
#: column at which comments begin
_COMMENT = 44
#: blocks of the log that tell a surface
_BLOCKS = 48
#: series without a likely kind that are listed as comments
_MOST_UNKNOWN = 60

_HEAD = """\
# Setup of {log}, drafted by `tirelog setup new`.
# Lines marked "{mark}" are likely, not certain: mend them, then take the mark away.
# `{check}` says what is left to do.

[tire]
name = ""
# Speeds need one of these two; the rolling radius is that of the loaded, rolling tire.
# rolling_radius_m = 0.305
# unloaded_radius_m = 0.3126
# Dissipation needs these two.
# section_height_m = 0.018
# width_m = 0.215

[conditions]
# load_N = 3434.0
# inflation_pressure_Pa = 2.2e5
"""


@dataclass(frozen=True)
class SetupDraft:
    """A setup's text, and the sentences to say about it."""

    text: str
    channels: int
    guesses: int


def draft(log: str, output: str | None = None) -> SetupDraft:
    """A first setup for the log at a path ('-' for standard input), to be written to `output`.

    ReadError: nothing in it can be read.
    """
    inside = contents(log)
    chosen = _channels(inside)
    place = ["--setup", output] if output and Path(output) not in names_beside(log) else []
    check = _shown(shlex.join(["tirelog", "setup", "check", inside.log, *place]))
    text = _text(inside, chosen, {}, check)
    if is_file(log):
        text = _text(inside, chosen, _surfaces(log, text), check)
    return SetupDraft(text, len(chosen), len(marks(text)))


def marks(text: str) -> list[int]:
    """The lines of a setup, from 1, that are still marked as guessed."""
    return [
        number
        for number, line in enumerate(text.splitlines(), 1)
        if re.search(rf"#[^\"]*\b{MARK}\b", line) and not line.startswith("#")
    ]


def _channels(inside: Contents) -> dict[str, FoundSeries]:
    """The series worth a channel, by the channel's name: those of a likely kind, else all."""
    likely = [one for one in inside.found if one.guess.kind != "signal"]
    named: dict[str, FoundSeries] = {}
    for one in likely or inside.found:
        plain = re.sub(r"[^\w.+-]+", "_", one.series.source.strip("/#")).strip("_.") or "channel"
        plain = f"column_{plain}" if plain.isdigit() else plain
        name, again = plain[:60], 2
        while name in named:
            name, again = f"{plain[:56]}_{again}", again + 1
        named[name] = one
    return named


def _surfaces(log: str, text: str) -> dict[str, str]:
    """The likely surface of each strain channel, as far as the log shows it."""
    try:
        setup = parse_setup(text, "the draft")
        with open_recording(log, setup, blocks=_BLOCKS, check=False) as recording:
            return {
                channel.name: likely_surface(channel)
                for channel in recording.of_kind(*STRAIN_KINDS)
            }
    except TirelogError:
        return {}


def _text(
    inside: Contents, chosen: dict[str, FoundSeries], surfaces: dict[str, str], check: str
) -> str:
    parts = [_HEAD.format(log=_shown(inside.log), mark=MARK, check=check)]
    twins = {n: one for n, one in chosen.items() if one.guess.kind == "fbg_temperature"}
    for name, one in chosen.items():
        parts.append(_channel(name, one, twins, surfaces.get(name, "")))
    parts.append(_log(inside))
    unknown = [one for one in inside.found if one not in chosen.values()]
    if unknown:
        parts.append('# Of these nothing says what they are; kind = "signal" takes any:\n')
        parts += [
            f"#   {_shown(one.series.source)}{_range(one)}\n" for one in unknown[:_MOST_UNKNOWN]
        ]
    return "".join(parts)


def _channel(name: str, one: FoundSeries, twins: dict[str, FoundSeries], surface: str) -> str:
    kind, unit = one.guess.kind, one.guess.unit
    lines = [
        f"\n[channels.{_key(name)}]",
        _line("kind", _quoted(kind), f"{MARK}: {one.guess.reason}" if kind != "signal" else ""),
        _line("source", _quoted(one.series.source), _shown(_range(one).strip())),
    ]
    if one.unit and units.canonical(one.unit) == unit:
        lines.append(_line("unit", _quoted(unit), "as the log says"))
    else:
        lines.append(_line("unit", _quoted(unit), MARK if kind != "signal" else ""))
    if kind in WAVELENGTH_KINDS:
        middle = float(np.median(one.known)) * units.UNITS[unit][1] * 1e9
        told = f"{MARK}: the median of the log; put the wavelength at rest"
        lines.append(_line("reference_wavelength_nm", f"{middle:.4f}", told))
    if one.series.window_nm is not None:
        low, high = one.series.window_nm
        lines.append(_line("window_nm", f"[{low}, {high}]", f"{MARK}: where its peaks are"))
    if kind == "fbg_strain":
        lines.append("# strain_gain = 1.27")
        near = sorted(twins, key=lambda n: abs(_middle(twins[n]) - _middle(one)))
        if near:
            told = f"{MARK}: the nearest grating that hardly moves"
            lines.append(_line("temperature_channel", _quoted(near[0]), told))
    if kind in STRAIN_KINDS:
        side = {"outer": "down", "inner": "up"}.get(surface, "")
        if side:
            told = f"{MARK}: the patch takes the strain {side}"
            lines.append(_line("surface", _quoted(surface), told))
        else:
            lines.append('# surface = "outer"   # outer: a minimum in the patch; inner: a maximum')
    if kind == "wheel_encoder":
        lines.append("# steps = 48          # per turn of the wheel: needed")
    return "\n".join(lines) + "\n"


def _log(inside: Contents) -> str:
    lines = ["\n[log]"]
    if inside.time and inside.format.startswith(("text", "parquet")):
        lines.append(_line("time", _quoted(inside.time), "found by the reader, too"))
    if inside.clock:
        lines.append(f"# no rate is found: {_shown(inside.clock)}")
    elif any(one.rate_Hz is None for one in inside.found):
        lines.append("# no stamps and no rate were found: one of these is needed")
        lines.append('# time = "#1"')
        lines.append("# sampling_rate_Hz = 1000.0")
    return "\n".join(lines) + "\n\n"


def _middle(one: FoundSeries) -> float:
    return float(np.median(one.known)) if one.known.size else 0.0


def _range(one: FoundSeries) -> str:
    if not one.known.size:
        return " (all lost)"
    rate = f", {one.rate_Hz:.6g} Hz" if one.rate_Hz else ""
    unit = f" {one.unit}" if one.unit else ""
    return f" {one.known.min():.6g} to {one.known.max():.6g}{unit}{rate}"


def _line(key: str, value: str, comment: str) -> str:
    text = f"{key} = {value}"
    return f"{text:{_COMMENT}s} # {_shown(comment)}" if comment else text


def _shown(text: str) -> str:
    """Text as a comment may hold it: one line of printable letters."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def _quoted(text: str) -> str:
    return json.dumps(text)


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name)
