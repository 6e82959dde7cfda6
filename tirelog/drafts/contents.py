"""What a log holds, without a setup: every series with its rate, range, examples and likely kind.

log --listed--> series --the readers' own blocks--> samples from its begin
    --clock--> rates --guess--> kinds
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from tirelog.data.setup import ChannelSetup, Setup
from tirelog.errors import ReadError, SetupError
from tirelog.readers.base import LogReader, Series, SeriesList, counted_floats
from tirelog.runs.ingest import (
    LogStream,
    clock_of,
    is_file,
    log_part,
    open_log_bytes,
    opened_log,
    read_head,
    reader_of,
)
from tirelog.storage.whole import failed_writes, temporary_folder
from tirelog.vocabulary import units
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.kinds import KINDS

# ---- What a series most likely is: by its unit, its name and its size. A guess, and said to be
# one.


#: wavelengths of gratings [nm], and the share by which one moves at most
_GRATINGS_NM, _GRATING_MOVES = (780.0, 1700.0), 0.02
#: wavelengths that telecom interrogators sweep [nm]
_INTERROGATORS_NM = (1460.0, 1620.0)
#: words of names -> kind, the likeliest first
_WORDS = (
    ({"encoder", "teeth", "tooth", "pulse", "pulses", "ticks", "hall"}, "wheel_encoder"),
    ({"speed", "velocity", "geschwindigkeit"}, "vehicle_speed"),
    ({"temp", "temperature", "temperatur"}, "temperature"),
    ({"pressure", "druck", "tpms", "ttpms"}, "inflation_pressure"),
    ({"strain", "dms", "gauge", "epsilon"}, "strain"),
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


def guessed(source: str, unit: str, samples: FloatArray, rate_Hz: float | None) -> Guess:
    """The likely kind of a series of `samples` (n,) under the name `source`, in `unit` or ''."""
    known = samples[np.isfinite(samples)]
    name = units.canonical(unit) if unit else None
    words = set(_words(source))
    if known.size and (found := _grating(name, known, _named(words))) is not None:
        return found
    if not known.size or known.min() == known.max():
        return Guess("signal", name or unit or "1", "it does not move")
    if name is not None and units.UNITS[name][0] in _QUANTITIES:
        kind = _QUANTITIES[units.UNITS[name][0]]
        return _directed(kind, words, known, name, f"the log gives its unit, {unit}")
    for of_kind, kind in _WORDS:
        fits = name is None or units.UNITS[name][0] in KINDS[kind].quantities
        if words & of_kind and fits:
            unit_of = name or _suffix(source, kind) or _by_size(kind, known)
            return _directed(kind, words, known, unit_of, "its name")
    if words & {"voltage", "volt", "volts"}:
        return Guess("signal", name or "V", "a voltage, and nothing says of what")
    return Guess("signal", name or unit or "1", "nothing says what it is")


def _words(source: str) -> list[str]:
    """The words of a source's last part: /front_left/encoder.raw is encoder, raw."""
    last = re.split(r"[/:]", source.strip("/"))[-1]
    return [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+", last)]


def _named(words: set[str]) -> bool:
    """True for names that say what a series is."""
    return any(words & of_kind for of_kind, _ in _WORDS)


def _grating(unit: str | None, known: FloatArray, named: bool) -> Guess | None:
    """A grating by its wavelength, in a unit of length or in nm by its size.

    What has a name of something else is one only where interrogators for tires work.
    """
    if unit is not None and units.UNITS[unit][0] != "length":
        return None
    factor = 1.0 if unit is None else units.UNITS[unit][1] * 1e9
    low, high = np.quantile(known, [0.02, 0.98]) * factor
    first, last = _INTERROGATORS_NM if named and unit is None else _GRATINGS_NM
    if not first <= low <= high <= last:
        return None
    if high - low > _GRATING_MOVES * low:
        return None
    why = "wavelengths of a grating" + ("" if unit else ", in nm by their size")
    return Guess("fbg_strain", unit or "nm", why)


def _directed(kind: str, words: set[str], known: FloatArray, unit: str, reason: str) -> Guess:
    """The guess with the direction that the name tells, if the kind is one of several.

    An axis across the tread is radial only if it stands at what turning alone can give.
    """
    along = {
        "radial_acceleration": "longitudinal_acceleration",
        "vertical_load": "longitudinal_force",
    }
    if kind in along and words & _ACROSS:
        if kind == "radial_acceleration" and _no_vehicle(known, unit, 0.5):
            return Guess(kind, unit, "it stands at an acceleration that only turning gives")
        return Guess("signal", unit, "across the tread by its name")
    kind = along.get(kind, kind) if words & _ALONG else kind
    if kind == "longitudinal_acceleration" and _no_vehicle(known, unit, 0.999):
        return Guess("signal", unit, "along the tread by its name, too large for a vehicle")
    return Guess(kind, unit, reason)


def _no_vehicle(known: FloatArray, unit: str, share: float) -> bool:
    """True if an acceleration that this share of the samples stays below is no vehicle's."""
    return float(np.quantile(np.abs(known), share)) * units.UNITS[unit][1] > _NO_VEHICLE_M_S2


def _suffix(source: str, kind: str) -> str:
    """The unit at the end of a name, as in acc_x_g, if it is one of the kind's; else ''."""
    name = units.canonical(re.split(r"[_ ]", source)[-1])
    return name if name and units.UNITS[name][0] in KINDS[kind].quantities else ""


def _by_size(kind: str, known: FloatArray) -> str:
    """The unit that a channel of this kind is usually this large in."""
    size = float(np.quantile(np.abs(known), 0.98))
    return next((unit for most, unit in _SIZES[kind] if size <= most), _SIZES[kind][-1][1])


# ---- The series of a log of any format.


def listed(format: str, path: Path, log: str) -> SeriesList:
    """The series of the file at `path`, the log or what was made of it; `log` its name.

    ReadError: nothing in it can be read.
    """
    if format == "HDF5":
        from tirelog.readers.hdf5.reader import datasets

        return datasets(path, log)
    if format == "MCAP":
        from tirelog.readers.mcap.reader import fields

        return fields(path, log)
    if format == "WAV":
        from tirelog.readers.other.wav import channels

        return channels(path, log)
    if format == "Parquet":
        from tirelog.readers.other.formats import text_of
        from tirelog.readers.text.reader import columns

        return columns(text_of(path, log)[0], log)
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
    with _local(log) as path, open_log_bytes(str(path)) as raw:
        head = read_head(raw, log)
        stream = LogStream(head, raw, False)
        with opened_log(str(path), head, stream, log) as opened:
            inside = listed(opened.made, opened.path or path, log)
            some = ", ".join(inside.others[:8])
            if not inside.series and inside.unread:
                what = f"holds no series of numbers that can be read{some and f', only {some}'}"
                why = "; ".join(inside.unread[:_MOST_UNREAD])
                raise ReadError(f"{what}: {why}", file=log)
            if not inside.series:
                raise ReadError(
                    f"holds no series of numbers{some and f', only {some}'}",
                    allowed="a log has columns, topics or datasets of numbers",
                    do="check the recording",
                    file=log,
                )
            names = {f"c{k}": one for k, one in enumerate(inside.series)}
            reader = reader_of(stream, opened, _setup(names), log)
            found = _read(log, reader, names, inside.time)
            said = (*inside.unread[:_MOST_UNREAD], *found.remarks)
            return replace(found, others=inside.others, remarks=said)


@contextmanager
def _local(log: str) -> Iterator[Path]:
    """The log as a file, which can be opened again."""
    if is_file(log):
        yield Path(log)
        return
    with temporary_folder() as folder, open_log_bytes(log) as raw:
        path = folder / "log"
        with failed_writes(path), path.open("wb") as copy:
            while part := log_part(raw, log):
                copy.write(part)
        yield path


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
    places = {n: group.decimals.get(n) for group in reader.groups for n in group.channels}
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
                parts[name].append(counted_floats(values[:_MOST_SAMPLES], places[name]))
                kept[name] += size
        clocks[block.group].add(block.stamps_s, block.number, size)
    blocks.close()  # type: ignore[attr-defined]  # every reader's blocks are a generator
    found, remarks, why = [], [], ""
    for group in reader.groups:
        clock, rate, duration = clocks[group.name], None, None
        try:
            axis = clock.axis()
            rate, duration = axis.rate_Hz, axis.duration_s
            remarks += [said for said in clock.remarks if said not in remarks]
        except (ReadError, SetupError) as problem:
            why = problem.message if clock.stamped else why
        for name in group.channels:
            one, setup = names[name], reader.setup.channels[name]
            samples = np.concatenate([np.zeros(0), *parts[name]])
            unit = setup.unit or ""
            if samples.size:
                guess = guessed(one.source, unit, samples, rate)
                found.append(FoundSeries(one, unit, rate, duration, samples, guess))
    order = {one: k for k, one in enumerate(names.values())}
    found.sort(key=lambda one: order[one.series])
    report = reader.report
    losses = [_with_source(loss, names) for loss in report.losses]
    said = [*(_with_source(remark, names) for remark in report.remarks), *remarks]
    said += [why] if why else []
    return Contents(
        log, report.format, report.start, time, tuple(_twins(found)), tuple(said), tuple(losses),
        whole, clock=why,
    )  # fmt: skip


def _with_source(sentence: str, names: dict[str, Series]) -> str:
    """A reader's sentence with a series' own name for the channel's."""
    for name, one in names.items():
        if sentence.startswith(f"channel {name}: "):
            return f"{one.source}: {sentence.removeprefix(f'channel {name}: ')}"
    return sentence


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

    def number(values: list[float | None]) -> FloatArray:
        return np.array([np.nan if value is None else value for value in values])

    return {
        "log": np.array([inside.log] * len(found), dtype=object),
        "source": np.array([one.series.source for one in found], dtype=object),
        "unit": np.array([one.unit for one in found], dtype=object),
        "rate_Hz": number([one.rate_Hz for one in found]),
        "samples": np.array([one.samples.size for one in found]),
        "lost_samples": np.array([one.samples.size - one.known.size for one in found]),
        "lowest": number([float(one.known.min()) if one.known.size else None for one in found]),
        "highest": number([float(one.known.max()) if one.known.size else None for one in found]),
        "likely_kind": np.array([one.guess.kind for one in found], dtype=object),
        "likely_unit": np.array([one.guess.unit for one in found], dtype=object),
        "reason": np.array([one.guess.reason for one in found], dtype=object),
    }
