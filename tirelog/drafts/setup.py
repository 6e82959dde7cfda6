"""What a log holds, without a setup, and a first setup for it: what is guessed is marked.

log --listed--> series --the readers' own blocks--> samples from its begin
    --clock--> rates --guess--> kinds: Contents
Contents --channels, twins, references, surfaces--> TOML
"""

from __future__ import annotations

import json
import re
import shlex
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import numpy as np

from tirelog.data.plausibility import check_recording
from tirelog.data.recording import Recording
from tirelog.data.setup import ChannelSetup, Setup, names_beside
from tirelog.errors import DataLoss, ReadError, SetupError, UsageError
from tirelog.readers.base import LogReader, Series, SeriesList
from tirelog.runs.ingest import (
    LogStream,
    clock_of,
    is_file,
    local_file,
    open_log_bytes,
    opened_log,
    read_head,
    reader_of,
)
from tirelog.runs.store import is_run
from tirelog.storage.whole import temporary_folder
from tirelog.strain.passages.find import passages_of
from tirelog.vocabulary import units
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.kinds import ACCELERATION_KINDS, KINDS, STRAIN_KINDS, WAVELENGTH_KINDS
from tirelog.vocabulary.quality import Quality, having
from tirelog.wheel.phase_shift import encoder_speed, measure_phase_shift

# ---- What a series most likely is: by its unit, its name and its size. A guess, and called
# one.


#: wavelengths of gratings [nm], and the share by which one moves at most
_GRATINGS_NM, _GRATING_MOVES = (780.0, 1700.0), 0.02
#: wavelengths that telecom interrogators sweep [nm]
_INTERROGATORS_NM = (1460.0, 1620.0)
#: words of names -> kind, the likeliest first
_WORDS = (
    ({"encoder", "enc", "teeth", "tooth", "pulse", "pulses", "ticks", "hall"}, "wheel_encoder"),
    ({"speed", "velocity", "geschwindigkeit"}, "vehicle_speed"),
    ({"temp", "temperature", "temperatur"}, "temperature"),
    ({"pressure", "druck", "tpms", "ttpms"}, "inflation_pressure"),
    ({"strain", "dehnung", "dms", "gauge", "epsilon"}, "strain"),
    ({"acc", "accel", "acceleration", "beschleunigung"}, "radial_acceleration"),
    ({"load", "fz"}, "vertical_load"),
    ({"fx"}, "longitudinal_force"),
)
#: quantity of a unit -> kind
_QUANTITIES = {
    "strain": "strain",
    "pressure": "inflation_pressure",
    "temperature": "temperature",
    "speed": "vehicle_speed",
    "acceleration": "radial_acceleration",
    "force": "vertical_load",
    "angle": "wheel_encoder",
}
#: kind -> (largest typical size, unit) from the smallest up: the unit if none is written
_SIZES = {
    "strain": ((0.05, "strain"), (1e6, "microstrain")),
    "inflation_pressure": ((12.0, "bar"), (1200.0, "kPa"), (1e8, "Pa")),
    "temperature": ((200.0, "degC"), (1e4, "K")),
    "vehicle_speed": ((1e9, "m/s"),),
    "radial_acceleration": ((1e9, "m/s^2"),),
    "longitudinal_acceleration": ((1e9, "m/s^2"),),
    "vertical_load": ((40.0, "kN"), (1e9, "N")),
    "longitudinal_force": ((40.0, "kN"), (1e9, "N")),
    "wheel_encoder": ((1e18, "1"),),
}
#: no vehicle accelerates like this, a tread at its edges does; twice as much would miss one at
#: 60 km/h
_NO_VEHICLE_M_S2 = 400.0
#: words that say that a force or an acceleration is along the vehicle, or across it
_ALONG = {"x", "fx", "ax", "long", "longitudinal"}
_ACROSS = {"y", "fy", "ay", "lat", "lateral", "quer"}


@dataclass(frozen=True)
class Guess:
    """A likely kind and unit, and what makes them likely; `signal` if nothing does."""

    kind: str
    unit: str
    reason: str


def guessed(source: str, unit: str, samples: FloatArray) -> Guess:
    """The likely kind of a series of `samples` (n,) under the name `source`, in `unit` or ''."""
    known = samples[np.isfinite(samples)]
    name = units.canonical(unit) if unit else None
    words = set(_words(source))
    of_another = any(words & of_kind for of_kind, _ in _WORDS)
    if known.size and (found := _grating(name, known, of_another)) is not None:
        return found
    if not known.size or known.min() == known.max():
        return Guess("signal", name or unit or "1", "it does not move")
    if name is not None and units.UNITS[name][0] in _QUANTITIES:
        kind = _QUANTITIES[units.UNITS[name][0]]
        return _directed(kind, words, known, name, f"the log gives its unit, {unit}")
    for of_kind, kind in _WORDS:
        fits = name is None or units.UNITS[name][0] in KINDS[kind].quantities
        if words & of_kind and fits:
            unit_of = name or _unit_of(source, kind, known)
            return _directed(kind, words, known, unit_of, "its name")
    volts = words & {"voltage", "volt", "volts"}
    why = "a voltage, and nothing says of what" if volts else "nothing says what it is"
    return Guess("signal", name or ("V" if volts else unit or "1"), why)


def _words(source: str) -> list[str]:
    """The words of a source's last part: /front_left/encoder.raw is encoder, raw."""
    last = re.split(r"[/:]", source.strip("/"))[-1]
    return [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+", last)]


def _grating(unit: str | None, known: FloatArray, named: bool) -> Guess | None:
    """A grating by its wavelength, in a unit of length or in nm by its size.

    What has a name of something else is one only where interrogators for tires work.
    """
    if unit is not None and units.UNITS[unit][0] != "length":
        return None
    factor = 1.0 if unit is None else units.UNITS[unit][1] * 1e9
    low, high = np.quantile(known, [0.02, 0.98]) * factor
    first, last = _INTERROGATORS_NM if named and unit is None else _GRATINGS_NM
    if not first <= low <= high <= last or high - low > _GRATING_MOVES * low:
        return None
    why = "wavelengths of a grating" + ("" if unit else ", in nm by their size")
    return Guess("fbg_strain", unit or "nm", why)


def _directed(kind: str, words: set[str], known: FloatArray, unit: str, reason: str) -> Guess:
    """The guess with the direction that the name tells, if the kind is one of several.

    An axis across the tread is radial only if turning alone can give its acceleration.
    """
    along = {
        "radial_acceleration": "longitudinal_acceleration",
        "vertical_load": "longitudinal_force",
    }
    if kind in along and words & _ACROSS:
        if kind == "radial_acceleration" and _no_vehicle(known, unit, 0.5):
            return Guess(kind, unit, "only a turning wheel gives such an acceleration")
        return Guess("signal", unit, "across the tread by its name")
    kind = along.get(kind, kind) if words & _ALONG else kind
    if kind == "longitudinal_acceleration" and _no_vehicle(known, unit, 0.999):
        return Guess("signal", unit, "along the tread by its name, too large for a vehicle")
    return Guess(kind, unit, reason)


def _no_vehicle(known: FloatArray, unit: str, share: float) -> bool:
    """True if an acceleration that this share of the samples stays below is no vehicle's."""
    return float(np.quantile(np.abs(known), share)) * units.UNITS[unit][1] > _NO_VEHICLE_M_S2


def _unit_of(source: str, kind: str, known: FloatArray) -> str:
    """The unit at the end of a name, as in acc_x_g, if it is one of the kind's.

    Else the one that a channel of this kind is usually this large in.
    """
    name = units.canonical(re.split(r"[_ ]", source)[-1])
    if name and units.UNITS[name][0] in KINDS[kind].quantities:
        return name
    size = float(np.quantile(np.abs(known), 0.98))
    return next((unit for most, unit in _SIZES[kind] if size <= most), _SIZES[kind][-1][1])


# ---- The series of a log of any format.


#: format -> what lists its series, below the readers
_LISTS = {
    "HDF5": "hdf5.reader:datasets",
    "MCAP": "mcap.reader:fields",
}


def listed(format: str, path: Path, log: str) -> SeriesList:
    """The series of the file at `path`, the log or what was made of it; `log` its name.

    ReadError: nothing in it can be read.
    """
    if format in _LISTS:
        inside: SeriesList = resolve_name(f"tirelog.readers.{_LISTS[format]}")(path, log)
        return inside
    from tirelog.readers.text.reader import columns
    from tirelog.readers.text.source import ByteSource

    return columns(ByteSource(path, log), log)


#: blocks that are looked at: each of some MB
_BLOCKS = 48
#: sentences on topics that cannot be read, which are mostly alike
_MOST_UNREAD = 3
#: samples of a series that are kept
_MOST_SAMPLES = 1 << 17


@dataclass(frozen=True)
class FoundSeries:
    """A series with what its first samples tell.

    `unit` as the log spells it ('' if it does not); `rate_Hz` None if no stamps and no rate are
    there; `samples` looked at, shape (n,), NaN where lost, in the log's unit; `guess` its kind.
    """

    series: Series
    unit: str
    rate_Hz: float | None
    duration_s: float | None
    samples: FloatArray
    guess: Guess

    @property
    def known(self) -> FloatArray:
        """The samples that are not lost."""
        return self.samples[np.isfinite(self.samples)]


@dataclass(frozen=True)
class Contents:
    """What is in a log; `whole` is false if only its beginning was looked at.

    `others` are topics, columns or datasets that hold no numbers; `clock` says what is wrong with
    stamps that tell no rate.
    """

    log: str
    format: str
    start: str | None
    time: str
    found: tuple[FoundSeries, ...]
    remarks: tuple[str, ...]
    losses: tuple[str, ...]
    whole: bool
    others: tuple[str, ...] = ()
    clock: str = ""


def contents(log: str) -> Contents:
    """What the log at a path ('-' for standard input) holds.

    ReadError: nothing in it can be read.
    """
    with temporary_folder() as folder, open_log_bytes(log) as given:
        path = local_file(given, log, folder)  # which can be opened again
        with open_log_bytes(str(path)) as raw:
            head = read_head(raw, log)
            stream = LogStream(head, raw, False)
            with opened_log(str(path), head, stream, log) as opened:
                inside = listed(opened.made, opened.path or path, log)
                _refuse_without_series(inside, log)
                names = {one.source: one for one in inside.series}
                reader = reader_of(stream, opened, _setup(names), log)
                found = _read(log, reader, names, inside.time)
                said = (*inside.unread[:_MOST_UNREAD], *found.remarks)
                return replace(found, others=inside.others, remarks=said)


def _refuse_without_series(inside: SeriesList, log: str) -> None:
    """ReadError: nothing in the log is a series of numbers that can be read."""
    if inside.series:
        return
    some = ", ".join(inside.others[:8])
    only, why = some and f", only {some}", "; ".join(inside.unread[:_MOST_UNREAD])
    if why:
        raise ReadError(f"holds no series of numbers that can be read{only}: {why}", file=log)
    raise ReadError(
        f"holds no series of numbers{only}",
        allowed="a log has columns, topics or datasets of numbers",
        do="check the recording",
        file=log,
    )


def _setup(names: dict[str, Series]) -> Setup:
    """A setup that reads every series as it is recorded."""
    channels = {}
    for name, one in names.items():
        kind = "signal" if one.window_nm is None else "fbg_strain"
        middle = None if one.window_nm is None else sum(one.window_nm) / 2.0
        channels[name] = ChannelSetup(
            kind=kind, source=one.source, window_nm=one.window_nm, reference_wavelength_nm=middle
        )
    return Setup(channels=channels)


def _read(log: str, reader: LogReader, names: dict[str, Series], time: str) -> Contents:
    parts: dict[str, list[FloatArray]] = {name: [] for name in names}
    kept = dict.fromkeys(names, 0)
    clocks = {group.name: clock_of(group, reader.setup) for group in reader.groups}
    blocks, whole = reader.blocks(), True
    for number, block in enumerate(islice(blocks, _BLOCKS + 1)):
        if number == _BLOCKS:
            whole = False
            break
        size = 0
        for name, values in block.values.items():
            size = values.size
            if kept[name] < _MOST_SAMPLES:
                parts[name].append(values[:_MOST_SAMPLES])
                kept[name] += size
        clocks[block.group].add(block.stamps_s, block.number, size)
    blocks.close()  # type: ignore[attr-defined]  # every reader's blocks are a generator
    found, remarks, why = {}, [], ""
    for group in reader.groups:
        clock, rate, duration = clocks[group.name], None, None
        try:
            axis = clock.axis
            rate, duration = axis.rate_Hz, axis.duration_s
            remarks += [said for said in clock.remarks if said not in remarks]
        except (ReadError, SetupError) as problem:
            why = problem.message if clock.stamped else why
        for name in group.channels:
            one, unit = names[name], reader.setup.channels[name].unit or ""
            samples = np.concatenate([np.zeros(0), *parts[name]])
            if samples.size:
                # of a matrix that holds the time too, the name is not that of each row
                matrix, index, _ = time.partition("[")
                of_all = index and one.source.startswith(matrix + index)
                guess = guessed("" if of_all else one.source, unit, samples)
                found[name] = FoundSeries(one, unit, rate, duration, samples, guess)
    report = reader.report
    losses = [loss.removeprefix("channel ") for loss in report.losses]
    said = [*(remark.removeprefix("channel ") for remark in report.remarks), *remarks]
    said += [why] if why else []
    in_order = [found[name] for name in names if name in found]
    return Contents(
        log, report.format, report.start, time, tuple(_twins(in_order)), tuple(said), tuple(losses),
        whole, clock=why,
    )  # fmt: skip


def _twins(found: list[FoundSeries]) -> list[FoundSeries]:
    """The series, gratings that hardly move taken for twins of those that do."""
    gratings = [one for one in found if one.guess.kind == "fbg_strain"]
    moves = {id(one): float(np.ptp(np.quantile(one.known, [0.02, 0.98]))) for one in gratings}
    most = max(moves.values(), default=0.0)
    out = []
    for one in found:
        still = id(one) in moves and len(gratings) > 1 and moves[id(one)] < 0.25 * most
        guess = Guess("fbg_temperature", one.guess.unit, "a grating that hardly moves: a twin")
        out.append(replace(one, guess=guess) if still else one)
    return out


def rows(inside: Contents) -> dict[str, Any]:
    """What is in a log as columns of a table, one row per series."""
    found = inside.found
    known = [one.known if one.known.size else np.full(1, np.nan) for one in found]
    return {
        "log": np.array([inside.log] * len(found), dtype=object),
        "source": np.array([one.series.source for one in found], dtype=object),
        "unit": np.array([one.unit for one in found], dtype=object),
        "rate_Hz": np.array([one.rate_Hz for one in found], float),
        "samples": np.array([one.samples.size for one in found]),
        "lost_samples": np.array([one.samples.size - one.known.size for one in found]),
        "lowest": np.array([some.min() for some in known], float),
        "highest": np.array([some.max() for some in known], float),
        "likely_kind": np.array([one.guess.kind for one in found], dtype=object),
        "likely_unit": np.array([one.guess.unit for one in found], dtype=object),
        "reason": np.array([one.guess.reason for one in found], dtype=object),
    }


# ---- Which surface a strain sensor sits on, by the side to which the patch takes its signal.


#: the patch takes some hundredths of a turn: quantiles that it reaches and its flanks do not
_LOW, _HIGH = 0.01, 0.99
#: how much further one side has to reach than the other before it is called the patch's; twice as
#: much leaves more surfaces open in the draft, and says so there
_PLAIN = 1.5


def likely_surface(known: FloatArray) -> str:
    """'outer' (the patch is a minimum), 'inner' (a maximum), or '' if neither side is plain.

    By samples (n,) of strain, or of the wavelength that it moves.
    """
    if known.size < 100:
        return ""
    low, middle, high = np.quantile(known, [_LOW, 0.5, _HIGH])
    below, above = middle - low, high - middle
    if below > _PLAIN * above:
        return "outer"
    return "inner" if above > _PLAIN * below else ""


#: the word that marks a guess, which `tirelog setup check` looks for
MARK = "guessed"
#: series that are named, of those without a likely kind and of those that are unused
_MOST_NAMED = 20

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
    text = _text(inside, chosen, check)
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


def _text(inside: Contents, chosen: dict[str, FoundSeries], check: str) -> str:
    parts = [_HEAD.format(log=_shown(inside.log), mark=MARK, check=check)]
    twins = {n: one for n, one in chosen.items() if one.guess.kind == "fbg_temperature"}
    for name, one in chosen.items():
        parts.append(_channel(name, one, twins))
    parts.append(_log(inside))
    unknown = [one for one in inside.found if one not in chosen.values()]
    if unknown:
        parts.append('# Of these nothing says what they are; kind = "signal" takes any:\n')
        parts += [
            f"#   {_shown(one.series.source)}{_range(one)}\n" for one in unknown[:_MOST_NAMED]
        ]
    return "".join(parts)


def _channel(name: str, one: FoundSeries, twins: dict[str, FoundSeries]) -> str:
    kind, unit = one.guess.kind, one.guess.unit
    why, mark = (f"{MARK}: {one.guess.reason}", MARK) if kind != "signal" else ("", "")
    of_log = bool(one.unit) and units.canonical(one.unit) == unit
    lines = [
        f"\n[channels.{_key(name)}]",
        _line("kind", json.dumps(kind), why),
        _line("source", json.dumps(one.series.source), _shown(_range(one).strip())),
        _line("unit", json.dumps(unit), "as the log says" if of_log else mark),
    ]
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
            lines.append(_line("temperature_channel", json.dumps(near[0]), told))
    if kind in STRAIN_KINDS:
        surface = likely_surface(one.known)
        side = {"outer": "down", "inner": "up"}.get(surface)
        told = f"{MARK}: the patch takes the strain {side}"
        unknown = '# surface = "outer"   # outer: a minimum in the patch; inner: a maximum'
        lines.append(_line("surface", json.dumps(surface), told) if side else unknown)
    if kind == "wheel_encoder":
        lines.append("# steps = 48          # per turn of the wheel: needed")
    return "\n".join(lines) + "\n"


def _log(inside: Contents) -> str:
    lines = ["\n[log]"]
    if inside.time and inside.format.startswith(("text", "zip", "parquet")):
        lines.append(_line("time", json.dumps(inside.time), "found by the reader, too"))
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
    return f"{text:44s} # {_shown(comment)}" if comment else text  # comments stand in a column


def _shown(text: str) -> str:
    """Text as a comment may hold it: one line of printable letters."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name)


# ---- What is left to do about a setup: implausible, missing, unused, guessed.


@dataclass(frozen=True)
class Finding:
    """A sentence, and what it is about: implausible, missing, unused, guessed or noted."""

    about: str
    sentence: str


def findings(recording: Recording, log: str) -> list[Finding]:
    """What is wrong or open in the setup of a recording that was opened unchecked.

    Unused series of `log` are in it if `log` is a file that tirelog did not write itself.
    """
    setup = recording.setup
    out = [Finding("missing", loss) for loss in recording.losses]
    for name, channel in recording.channels.items():
        alone = replace(recording, channels={name: channel}, remarks=())
        try:
            found = [Finding("implausible", said) for said in check_recording(alone).remarks]
            out += [one for one in found if one not in out]  # a remark on a clock comes once
        except SetupError as problem:
            out.append(Finding("implausible", problem.message))
    for channel in recording.of_kind(*STRAIN_KINDS):
        start = max((channel.size - _MOST_SAMPLES) // 2, 0)
        samples = channel.read(start, start + _MOST_SAMPLES)
        likely = likely_surface(samples[np.isfinite(samples)])
        if likely and likely != channel.surface:  # the patch lies on the other side
            side = "down" if likely == "outer" else "up"
            said = f'the patch takes the strain {side}, and surface = "{channel.surface}"'
            out.append(Finding("implausible", f'channel {channel.name}: {said}; is it "{likely}"?'))
    out += _motion(recording)
    out += [Finding("noted", remark) for remark in recording.remarks]
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


def _motion(recording: Recording) -> list[Finding]:
    """What of rates, speeds, radii and accelerations is no tire's, and what the teeth are like."""
    said, noted, tire = list[str](), list[str](), recording.setup.tire
    encoders = recording.of_kind("wheel_encoder")
    if not (tire.rolling_radius_m or tire.unloaded_radius_m):
        return []
    for channel in (*recording.of_kind(*STRAIN_KINDS, *ACCELERATION_KINDS), *encoders):
        with suppress(DataLoss, UsageError):  # no wheel that turns, or another surface
            try:
                if channel.kind == "wheel_encoder":
                    noted += encoder_speed(recording)[2]
                    continue
                passages = passages_of(recording, channel)
                if having(passages.quality, Quality.IMPLAUSIBLE).any():
                    said.append(passages.doubt)
                elif encoders and channel.kind in ACCELERATION_KINDS:
                    list(measure_phase_shift(recording))
            except SetupError as problem:
                said.append(problem.message)
    once = [Finding("implausible", sentence) for sentence in dict.fromkeys(said)]
    return once + [Finding("noted", sentence) for sentence in noted]


def _missing(recording: Recording) -> list[str]:
    """What tables will ask for and the setup does not have."""
    setup, said = recording.setup, []
    tire = setup.tire
    strain = [one.name for one in recording.of_kind(*STRAIN_KINDS)]
    accelerometer = recording.of_kind("radial_acceleration")
    radii = (tire.rolling_radius_m, tire.unloaded_radius_m)
    if (strain or accelerometer) and radii == (None, None):
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
    some = ", ".join(rest[:_MOST_NAMED]) + (", ..." if len(rest) > _MOST_NAMED else "")
    return [Finding("unused", f"{len(rest)} series of the log: {some}")]
