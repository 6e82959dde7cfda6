"""The setup file: what a log's channels are, and the tire, the conditions and the log around them.

    TOML text --parse--> tables --fields of the dataclasses below--> Setup (frozen, validated)

The dataclasses are the schema: a key is allowed if it is a field, a number must be finite and
inside the field's range, and an unknown key is refused with its line, what is allowed and the
nearest spelling. Units are only checked here; `ingest` converts. The file is longer than others,
since a schema is to be read in one place.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields, make_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from tirelog.data.bounds import PLAUSIBLE, bounds_of, doubt_of_key, override
from tirelog.errors import SetupError, nearest
from tirelog.storage.documents import toml_tables, toml_text
from tirelog.vocabulary.conditions import SETUP_KEYS
from tirelog.vocabulary.kinds import KINDS, WAVELENGTH_KINDS

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

SURFACES = ("outer", "inner")
ROADS = ("flat", "step", "cleat", "sine", "profile")


def _number(low: float, high: float, *, above: bool = True, default: Any = None) -> Any:
    """A number in (low, high] (`above`) or [low, high].

    `default` if the key is absent.
    """
    return field(default=default, metadata={"range": (low, high, above)})


@dataclass(frozen=True)
class Tire:
    """[tire]: the tire; lengths in m.

    name                       what reports call it
    unloaded_radius_m          R; speeds use it if the rolling radius is not given, and say so
    rolling_radius_m           R_e of the loaded, rolling tire (errata, Speed)
    section_height_m           of the tread strip under the grating
    width_m                    of the belt
    section_area_m2            of the strip; else section height x width
    viscosity_Pa_s             of the rubber: gives dissipation in W and N
    static_footprint_length_m  length of the patch at rest
    friction_ratio             sliding over sticking friction; else 0.75 +- 0.13
    """

    name: str = ""
    unloaded_radius_m: float | None = _number(0.0, 5.0)
    rolling_radius_m: float | None = _number(0.0, 5.0)
    section_height_m: float | None = _number(0.0, 1.0)
    width_m: float | None = _number(0.0, 2.0)
    section_area_m2: float | None = _number(0.0, 1.0)
    viscosity_Pa_s: float | None = _number(0.0, 1e9)
    static_footprint_length_m: float | None = _number(0.0, 2.0)
    friction_ratio: float | None = _number(0.2, 1.2)
    #: the setup's path, for messages; no key of the table
    file: str | None = field(default=None, compare=False, metadata={"key": False})

    def known(self) -> dict[str, Any]:
        """What the setup gives of the tire, by its keys."""
        own = (f.name for f in fields(self) if f.metadata.get("key", True))
        return {name: value for name in own if (value := getattr(self, name))}

    @property
    def radius_m(self) -> float:
        """The rolling radius, or the unloaded radius if the setup has none.

        SetupError if it has neither.
        """
        radius = self.rolling_radius_m or self.unloaded_radius_m
        if radius is None:
            raise SetupError(
                "the setup has no radius",
                allowed="[tire] takes rolling_radius_m or unloaded_radius_m",
                do="add one of them",
                file=self.file,
            )
        return radius

    @property
    def area_m2(self) -> float | None:
        """The section's area: as given, or section height x width, or None."""
        if self.section_area_m2 is not None:
            return self.section_area_m2
        if self.section_height_m is None or self.width_m is None:
            return None
        return self.section_height_m * self.width_m


if TYPE_CHECKING:

    class _ConditionKeys:
        def __getattr__(self, key: str) -> float | None: ...

else:
    _ConditionKeys = make_dataclass(
        "_ConditionKeys",
        [
            (name, "float | None", _number(key.low, key.high, above=not key.from_low))
            for name, key in SETUP_KEYS.items()
        ],
        frozen=True,
    )


@dataclass(frozen=True)
class LogConditions(_ConditionKeys):
    """[conditions]: constant over the log; the register's keys, None for what is not given."""

    driven: bool | None = None


@dataclass(frozen=True)
class ChannelSetup:
    """[channels.NAME]: one signal of the log.

    kind                          what is measured
    source                        where it stands in the file
    unit                          of the source, or of what scale and offset give
    scale, offset                 value in the unit = scale x recorded + offset
    reference_wavelength_nm       of a grating without strain
    strain_gain                   strain per relative change of wavelength
    thermal_expansion_1_K         of what the grating is bonded to
    temperature_channel           the unbonded twin grating
    temperature_sensitivity_nm_K  of a grating
    surface                       outer (groove): minimum in the patch; inner (liner): maximum
    window_nm                     finds a grating by wavelength among a varying number of peaks
    gauge_length_m                length a grating averages over
    angle_deg                     of a sensor on the tire: the wheel's angle at which it passes the
                                  patch's centre, growing in the direction of rolling
    lateral_m                     of a sensor on the tire: its place across the tread, 0 in the
                                  middle; for the reader, no number depends on it
    steps                         of a wheel encoder, per turn
    sampling_rate_Hz              the channel's own rate
    """

    kind: str = ""
    source: str = ""
    unit: str | None = None
    scale: float | None = _number(-1e30, 1e30)
    offset: float | None = _number(-1e30, 1e30)
    reference_wavelength_nm: float | None = _number(100.0, 1e5)
    strain_gain: float = _number(0.0, 100.0, default=1.27)
    thermal_expansion_1_K: float = _number(-1.0, 1.0, default=0.0)
    temperature_channel: str | None = None
    temperature_sensitivity_nm_K: float = _number(0.0, 10.0, default=0.010)
    surface: str | None = None
    window_nm: tuple[float, float] | None = None
    gauge_length_m: float | None = _number(0.0, 1.0)
    angle_deg: float | None = _number(-360.0, 360.0, above=False)
    lateral_m: float | None = _number(-1.0, 1.0, above=False)
    steps: int | None = None
    sampling_rate_Hz: float | None = _number(0.0, 1e9)

    @property
    def source_unit(self) -> str:
        return self.unit or KINDS[self.kind].source_unit

    @property
    def scaled(self) -> bool:
        """True if what is recorded is not yet in the channel's unit."""
        return self.scale is not None or self.offset is not None

    @property
    def scaling(self) -> tuple[float, float]:
        """(scale, offset) with value in the unit = scale x recorded + offset."""
        return 1.0 if self.scale is None else self.scale, self.offset or 0.0

    def recorded(self, value: float) -> float:
        """What is recorded for a value in the channel's unit."""
        scale, offset = self.scaling
        return (value - offset) / scale


#: what may stand between the cells of a text log; " " stands for runs of blanks
SEPARATORS = (",", ";", "\t", " ", "|")
#: words of [log] that are of a few
_WORDS = {"separator": SEPARATORS, "decimal": (".", ","), "encoding": ("utf-8", "cp1252")}
_TEXT_KEYS = ("separator", "decimal", "header_rows", "encoding", "columns")


@dataclass(frozen=True)
class LogSetup:
    """[log]: what the file itself does not say, or what was taken for something else.

    separator    between the cells of a text log: one of SEPARATORS (" " stands for runs of blanks)
    decimal      "." or ","
    header_rows  lines above the first row of samples, blank ones counted
    encoding     utf-8 or cp1252
    columns      names of the columns from the first on, in place of the header's
    unusual      quantities whose numbers are right though no tire is known to have them
    """

    sampling_rate_Hz: float | None = _number(0.0, 1e9)
    time: str | None = None
    time_unit: str | None = None
    separator: str | None = None
    decimal: str | None = None
    header_rows: int | None = field(default=None, metadata={"range": (0, 10_000, False)})
    encoding: str | None = None
    columns: tuple[str, ...] | None = None
    unusual: tuple[str, ...] | None = None

    @property
    def of_text(self) -> list[str]:
        """The keys that are given and that only a text log has."""
        return [key for key in _TEXT_KEYS if getattr(self, key) is not None]


@dataclass(frozen=True)
class RoadSetup:
    """[road]: what the wheel rolled over in this log; lengths in m along the direction of driving.

    kind        flat; step (height_m, over a ramp of ramp_m); cleat (height_m, length_m at its foot,
                ramps of ramp_m within it); sine (amplitude_m (1 - cos(2 pi x / wavelength_m)));
                profile (file: two columns, distance and height, beside the setup)
    time_s      when the wheel's centre stands over the obstacle's beginning; searched for in the
                log if it is not given
    position_m  the same as a distance driven since the log's start
    spacing_m   after which the obstacle comes again (a drum's circumference)
    """

    kind: str = "flat"
    height_m: float | None = _number(-1.0, 1.0)
    length_m: float | None = _number(0.0, 100.0)
    ramp_m: float | None = _number(0.0, 100.0)
    amplitude_m: float | None = _number(-1.0, 1.0)
    wavelength_m: float | None = _number(0.0, 1e4)
    file: str | None = None
    time_s: float | None = _number(0.0, 1e7, above=False)
    position_m: float | None = _number(-1e6, 1e6)
    spacing_m: float | None = _number(0.0, 1e6)


@dataclass(frozen=True)
class Setup:
    """A whole setup file.

    `text` is the file as it stood, for the run's provenance; `file` its path, for messages.
    """

    tire: Tire = Tire()
    conditions: LogConditions = LogConditions()
    channels: Mapping[str, ChannelSetup] = field(default_factory=dict)
    log: LogSetup = LogSetup()
    road: RoadSetup = RoadSetup()
    text: str = ""
    file: str | None = None


T = TypeVar("T", bound="DataclassInstance")


class _Source:
    """The file's text, to say in which line a key stands."""

    def __init__(self, text: str, file: str | None) -> None:
        self.lines, self.file = text.splitlines(), file

    def error(
        self, what: str, table: str = "", key: str = "", *, allowed: str = "", do: str = ""
    ) -> SetupError:
        return SetupError(
            what,
            allowed=allowed,
            do=do,
            file=self.file or "setup",
            line=self.line(table, key),
        )

    def refuse(self, table: str, *checks: tuple[object, str, str, str, str]) -> None:
        """SetupError of the first check (wrong, what, key, allowed, do) that is `wrong`."""
        for wrong, what, key, allowed, do in checks:
            if wrong:
                raise self.error(what, table, key, allowed=allowed, do=do)

    def line(self, table: str, key: str) -> int | None:
        header = rf"^\s*\[\s*{re.escape(table)}\s*\]" if table else None
        inside = header is None
        for number, text in enumerate(self.lines, 1):
            if header and re.match(r"^\s*\[", text):
                inside = bool(re.match(header, text))
                if inside and not key:
                    return number
            elif inside and key and re.match(rf"^\s*[\"']?{re.escape(key)}[\"']?\s*=", text):
                return number
        return None


def _value(spec: Field[Any], value: Any, source: _Source, table: str) -> Any:
    """`value` as the field `spec` wants it, or a SetupError that says what is allowed."""
    key, wanted = spec.name, str(spec.type)
    if "tuple[str" in wanted:
        if not (isinstance(value, list) and value and all(isinstance(v, str) for v in value)):
            raise source.error(
                f"{key} = {value!r}",
                table,
                key,
                allowed="allowed is a list of names",
                do='write e.g. ["time_s", "strain_1"]',
            )
        return tuple(value)
    if "tuple" in wanted:
        if not (
            isinstance(value, list)
            and len(value) == 2
            and all(_is_number(v) for v in value)
            and value[0] < value[1]
        ):
            raise source.error(
                f"{key} = {value!r}",
                table,
                key,
                allowed="allowed is a pair [low, high] in nm",
                do="write e.g. [1549.0, 1551.5]",
            )
        return (float(value[0]), float(value[1]))
    if "float" in wanted or "int" in wanted:
        low, high, above = spec.metadata.get("range", (0, 100_000, True))
        inside = _is_number(value) and (value > low if above else value >= low) and value <= high
        if not inside or ("int" in wanted and value != int(value)):
            allowed = f"a number {'above' if above else 'from'} {low:g} to {high:g}" + (
                ", whole" if "int" in wanted else ""
            )
            raise source.error(
                f"{key} = {value!r}",
                table,
                key,
                allowed=f"allowed is {allowed}",
                do="mend the number",
            )
        return int(value) if "int" in wanted else float(value)
    kind = bool if "bool" in wanted else str
    if not isinstance(value, kind):
        raise source.error(
            f"{key} = {value!r}",
            table,
            key,
            allowed=f"allowed is {'true or false' if kind is bool else 'text in quotes'}",
            do="mend the value",
        )
    return value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _table(cls: type[T], data: Any, source: _Source, name: str) -> T:
    """A TOML table as the dataclass `cls`."""
    if not isinstance(data, dict):
        raise source.error(
            f"{name} is not a table",
            "",
            name,
            allowed=f"allowed is [{name}] with keys under it",
            do="mend it",
        )
    specs: dict[str, Field[Any]] = {f.name: f for f in fields(cls) if f.metadata.get("key", True)}
    for key in data:
        if key not in specs:
            raise source.error(
                f"unknown key {key!r} in [{name}]{nearest(key, specs)}",
                name,
                key,
                allowed=f"allowed are {', '.join(specs)}",
                do="mend or remove it",
            )
    return cls(**{key: _value(specs[key], value, source, name) for key, value in data.items()})


def _channel(name: str, data: Any, source: _Source, names: list[str]) -> ChannelSetup:
    """One channel, with what its kind asks for."""
    table = f"channels.{name}"
    allowed = "allowed are letters, digits and _ . + -"
    named = re.fullmatch(r"[\w.+-]+", name)
    source.refuse(table, (not named, f"channel name {name!r}", "", allowed, "rename it"))
    channel = _table(ChannelSetup, data, source, table)
    kind, surface, twin = channel.kind, channel.surface, channel.temperature_channel
    source.refuse(
        table,
        (
            kind not in KINDS,
            f"kind {kind!r}{nearest(kind, KINDS)}",
            "kind",
            f"allowed are {', '.join(KINDS)}",
            "mend it",
        ),
        (
            not channel.source and channel.window_nm is None,
            "no source",
            "",
            "allowed is a column, topic or dataset path, or window_nm",
            'add source = "..."',
        ),
        (
            channel.scale == 0.0,
            "scale = 0",
            "scale",
            "allowed is what one recorded step is worth in the unit",
            "mend the number",
        ),
    )
    try:
        KINDS[kind].to_si(channel.source_unit)
    except SetupError as problem:
        raise problem.at(source.file or "setup", source.line(table, "unit")) from None
    source.refuse(
        table,
        (
            kind in WAVELENGTH_KINDS and channel.reference_wavelength_nm is None,
            "no reference_wavelength_nm",
            "",
            "a grating needs its wavelength at rest in nm",
            "add it",
        ),
        (
            surface is not None and surface not in SURFACES,
            f"surface {surface!r}",
            "surface",
            f"allowed are {', '.join(SURFACES)}",
            "mend it",
        ),
        (
            twin is not None and (twin not in names or twin == name),
            f"temperature_channel {twin!r} is no other channel{nearest(twin or '', names)}",
            "temperature_channel",
            "",
            f"name one of {', '.join(names)}",
        ),
    )
    return channel


def _refuse_strange(setup: Setup, source: _Source) -> None:
    """SetupError: a number that no tire has, or a rolling radius far from the unloaded one."""
    tire, unusual = setup.tire, setup.log.unusual or ()
    tables: dict[str, Any] = {"tire": tire, "conditions": setup.conditions}
    tables |= {f"channels.{name}": channel for name, channel in setup.channels.items()}
    for table, values in tables.items():
        for key, value in vars(values).items():
            if key not in PLAUSIBLE or value is None or key in unusual:
                continue
            bounds = bounds_of(key, tire.width_m, tire.unloaded_radius_m)
            if not bounds.holds(value):
                allowed, do = doubt_of_key(key, value, bounds)
                raise source.error(f"{key} = {value:g}", table, key, allowed=allowed, do=do)
    if not tire.rolling_radius_m or not tire.unloaded_radius_m:
        return
    ratio, bounds = tire.rolling_radius_m / tire.unloaded_radius_m, PLAUSIBLE["rolling_to_unloaded"]
    if not bounds.holds(ratio) and "rolling_to_unloaded" not in unusual:
        low, high = bounds.low * tire.unloaded_radius_m, bounds.high * tire.unloaded_radius_m
        raise source.error(
            f"a rolling radius of {tire.rolling_radius_m:.4g} m is {100 * abs(ratio - 1):.0f} % "
            f"{'larger' if ratio > 1 else 'smaller'} than the unloaded "
            f"{tire.unloaded_radius_m:.4g} m",
            "tire",
            "rolling_radius_m",
            allowed=f"allowed is {bounds} of it, {low:.4g} to {high:.4g} m",
            do=f"mend one of the two; {override('rolling_to_unloaded')}",
        )


def _road(data: Any, source: _Source) -> RoadSetup:
    """The road, of a known kind; what the kind asks for is checked when the road is built."""
    road = _table(RoadSetup, data, source, "road")
    if road.kind not in ROADS:
        raise source.error(
            f"kind {road.kind!r}{nearest(road.kind, ROADS)}",
            "road",
            "kind",
            allowed=f"allowed are {', '.join(ROADS)}",
            do="mend it",
        )
    return road


def parse_road(words: str) -> RoadSetup:
    """[road] in one line, as a command takes it: `cleat,height_m=0.01,length_m=0.04`.

    SetupError as for a setup file.
    """
    kind, *pairs = (word.strip() for word in words.split(","))
    given: dict[str, Any] = {"kind": kind}
    for pair in pairs:
        key, _, value = (part.strip() for part in pair.partition("="))
        try:
            given[key] = value if key == "file" else float(value)
        except ValueError:
            raise SetupError(
                f"{pair!r} in the road {words!r}",
                allowed="KEY=NUMBER is allowed, such as height_m=0.01",
                do="correct it",
            ) from None
    return _road(given, _Source("", "--road"))


def _log(data: Any, source: _Source) -> LogSetup:
    """[log], its words among those that are known."""
    log = _table(LogSetup, data, source, "log")
    named = log.columns or ()
    twice = next((name for k, name in enumerate(named) if name and name in named[:k]), None)
    foreign = next((name for name in log.unusual or () if name not in PLAUSIBLE), "")
    source.refuse(
        "log",
        *(
            (
                (value := getattr(log, key)) is not None and value not in allowed,
                f"{key} = {value!r}",
                key,
                f"allowed are {', '.join(repr(word) for word in allowed)}",
                "mend it",
            )
            for key, allowed in _WORDS.items()
        ),
        (
            log.decimal is not None and log.decimal == log.separator,
            f"separator and decimal are both {log.decimal!r}",
            "decimal",
            "allowed are two that differ",
            "mend one of them",
        ),
        (
            twice is not None,
            f"columns has the name {twice!r} twice",
            "columns",
            "each name once is allowed",
            "rename one",
        ),
        (
            foreign,
            f"unusual: no quantity is called {foreign!r}{nearest(foreign, PLAUSIBLE)}",
            "unusual",
            f"allowed are {', '.join(PLAUSIBLE)}",
            "mend it",
        ),
    )
    return log


def parse_setup(text: str, file: str | None = None) -> Setup:
    """The setup in `text`.  SetupError, with file and line, for anything that is not allowed."""
    source = _Source(text, file)
    data = toml_tables(text, SetupError, file=file or "setup")
    sections = ("tire", "conditions", "channels", "log", "road")
    for key in data:
        if key not in sections:
            raise source.error(
                f"unknown table [{key}]{nearest(key, sections)}",
                key,
                allowed=f"allowed are {', '.join(sections)}",
                do="mend or remove it",
            )
    tables = data.get("channels", {})
    if not isinstance(tables, dict) or not tables:
        raise source.error(
            "no channels",
            allowed="a setup has at least one [channels.NAME]",
            do="add what the log holds",
        )
    names = list(tables)
    channels = {name: _channel(name, table, source, names) for name, table in tables.items()}
    setup = Setup(
        replace(_table(Tire, data.get("tire", {}), source, "tire"), file=source.file),
        _table(LogConditions, data.get("conditions", {}), source, "conditions"),
        channels,
        _log(data.get("log", {}), source),
        _road(data.get("road", {}), source),
        text,
        file,
    )
    _refuse_strange(setup, source)
    return setup


def load_setup(path: Path | str) -> Setup:
    """The setup file at `path`."""
    text = toml_text(path, SetupError, what="a setup", advice="give another with --setup")
    return parse_setup(text, str(path))


def setup_beside(log: Path | str) -> Path | None:
    """The setup of the log's own name (`drive.csv.gz`: `drive.csv.toml`, `drive.toml`), or None."""
    # also for a name too long for any file
    return next((path for path in names_beside(log) if os.path.isfile(path)), None)


def names_beside(log: Path | str) -> list[Path]:
    """The names under which a setup is found beside the log."""
    path = Path(log)
    if not path.name:  # a folder, such as . or /
        return []
    candidates = [path.with_suffix(".toml")]
    while path.suffix:
        path = path.with_suffix("")
        candidates.append(
            path.with_suffix(path.suffix + ".toml")
            if path.suffix
            else path.with_name(path.name + ".toml")
        )
    return [place for place in candidates if place != Path(log)]
