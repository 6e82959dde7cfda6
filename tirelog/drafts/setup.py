"""A first setup for a log: what its contents tell is written, what was guessed is marked.

Contents --channels, twins, references--> TOML --read back with the log--> surfaces filled in
"""

from __future__ import annotations

import json
import re
import shlex
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tirelog.data.plausibility import check_recording
from tirelog.data.recording import Channel, Recording
from tirelog.data.setup import Setup, names_beside, parse_setup
from tirelog.drafts.contents import Contents, FoundSeries, contents
from tirelog.errors import DataLoss, ReadError, SetupError, TirelogError, UsageError
from tirelog.runs.ingest import is_file, open_recording
from tirelog.runs.store import is_run
from tirelog.strain.passages.find import passages_of
from tirelog.vocabulary import units
from tirelog.vocabulary.kinds import ACCELERATION_KINDS, STRAIN_KINDS, WAVELENGTH_KINDS
from tirelog.vocabulary.quality import Quality, having
from tirelog.wheel.phase_shift import measure_phase_shift
from tirelog.wheel.table import encoder_speed

# ---- Which surface a strain sensor sits on, by the side to which the patch takes its signal.


#: the patch takes some hundredths of a turn: quantiles that it reaches and its flanks do not
_LOW, _HIGH = 0.01, 0.99
#: how much further one side has to reach than the other before it is called the patch's; twice as
#: much leaves more surfaces open in the draft, and says so there
_PLAIN = 1.5
#: samples looked at, from the middle of the channel
_SAMPLES = 1 << 17


def likely_surface(channel: Channel) -> str:
    """'outer' (the patch is a minimum), 'inner' (a maximum), or '' if neither side is plain."""
    start = max((channel.size - _SAMPLES) // 2, 0)
    some = channel.read(start, start + _SAMPLES)
    some = some[np.isfinite(some)]
    if some.size < 100:
        return ""
    low, middle, high = np.quantile(some, [_LOW, 0.5, _HIGH])
    below, above = middle - low, high - middle
    if below > _PLAIN * above:
        return "outer"
    return "inner" if above > _PLAIN * below else ""


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


# ---- What is left to do about a setup: implausible, missing, unused, guessed.


#: unused series that are named
_MOST_UNUSED = 20


@dataclass(frozen=True)
class Finding:
    """A sentence, and what it is about: implausible, missing, unused, guessed or said."""

    about: str
    sentence: str


def findings(recording: Recording, log: str) -> list[Finding]:
    """What is wrong or open in the setup of a recording that was opened unchecked.

    What of `log` is unused is told if it is a file that tirelog did not write itself.
    """
    setup = recording.setup
    out = [Finding("missing", loss) for loss in recording.losses]
    for name, channel in recording.channels.items():
        alone = replace(recording, channels={name: channel}, remarks=())
        try:
            found = [Finding("implausible", said) for said in check_recording(alone).remarks]
            out += [one for one in found if one not in out]  # what is said of a clock is said once
        except SetupError as problem:
            out.append(Finding("implausible", problem.message))
    out += _declared_surfaces(recording)
    out += [Finding("implausible", said) for said in _motion(recording)]
    out += [Finding("said", remark) for remark in recording.remarks]
    out += [Finding("missing", said) for said in _missing(recording)]
    if is_file(log) and not is_run(log):
        with suppress(ReadError):  # nothing to list beside what was read
            out += _unused(setup, contents(log))
    across = [name for name, one in setup.channels.items() if one.lateral_m is not None]
    if across:
        said = f"lateral_m of {', '.join(across)}: models have no width, no number depends on it"
        out.append(Finding("unused", said))
    lines = marks(setup.text)
    if lines:
        some = ", ".join(map(str, lines[:10])) + (", ..." if len(lines) > 10 else "")
        word = "guess is" if len(lines) == 1 else "guesses are"
        out.append(Finding("guessed", f"{len(lines)} {word} still marked (lines {some})"))
    return out


def _declared_surfaces(recording: Recording) -> list[Finding]:
    """Strain channels whose patch lies on the other side than their surface says."""
    out = []
    for channel in recording.of_kind(*STRAIN_KINDS):
        likely = likely_surface(channel)
        if likely and likely != channel.surface:
            side = "down" if likely == "outer" else "up"
            out.append(
                Finding(
                    "implausible",
                    f"channel {channel.name}: the patch takes the strain {side}, and surface = "
                    f'"{channel.surface}"; is it "{likely}"?',
                )
            )
    return out


def _motion(recording: Recording) -> list[str]:
    """What of rates, speeds, radii and accelerations is no tire's, a sentence once."""
    said, tire = list[str](), recording.setup.tire
    encoders = recording.of_kind("wheel_encoder")
    if not (tire.rolling_radius_m or tire.unloaded_radius_m):
        return said
    for channel in (*recording.of_kind(*STRAIN_KINDS, *ACCELERATION_KINDS), *encoders):
        with suppress(DataLoss, UsageError):  # no wheel that turns, or another surface
            try:
                if channel.kind == "wheel_encoder":
                    encoder_speed(recording)
                    continue
                passages = passages_of(recording, channel)
                if having(passages.quality, Quality.IMPLAUSIBLE).any():
                    said.append(passages.doubt)
                elif encoders and channel.kind in ACCELERATION_KINDS:
                    list(measure_phase_shift(recording))
            except SetupError as problem:
                said.append(problem.message)
    return list(dict.fromkeys(said))


def _missing(recording: Recording) -> list[str]:
    """What tables will ask for and the setup does not have."""
    setup, said = recording.setup, []
    tire = setup.tire
    strain = [one.name for one in recording.of_kind(*STRAIN_KINDS)]
    accelerometer = recording.of_kind("radial_acceleration")
    if (
        (strain or accelerometer)
        and tire.rolling_radius_m is None
        and tire.unloaded_radius_m is None
    ):
        said.append("[tire] rolling_radius_m or unloaded_radius_m, without which there is no speed")
    if strain and tire.area_m2 is None:
        said.append(
            "[tire] section_height_m and width_m, without which dissipation has no power per width"
        )
    for channel in recording.of_kind("wheel_encoder"):
        if setup.channels[channel.name].steps is None and channel.name in setup.channels:
            said.append(f"channel {channel.name}: steps, the teeth or counts of a turn")
    for name in strain:
        if setup.channels[name].surface is None:
            said.append(f"channel {name}: surface; outer is taken")
    return said


def _unused(setup: Setup, inside: Contents) -> list[Finding]:
    """Series of the log that no channel names."""
    used = {one.source.strip().strip("/").lower() for one in setup.channels.values()}
    windows = [one.window_nm for one in setup.channels.values() if one.window_nm is not None]
    rest = []
    for one in inside.found:
        names = {one.series.source.strip("/").lower(), one.series.place}
        inside_window = one.series.window_nm is not None and any(
            low <= sum(one.series.window_nm) / 2.0 <= high for low, high in windows
        )
        begun = any(
            source.startswith(tuple(f"{name}[" for name in names if name)) for source in used
        )
        if not (names & used or inside_window or begun):
            rest.append(one.series.source)
    if not rest:
        return []
    some = ", ".join(rest[:_MOST_UNUSED]) + (", ..." if len(rest) > _MOST_UNUSED else "")
    return [Finding("unused", f"{len(rest)} series of the log: {some}")]
