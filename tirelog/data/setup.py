"""The setup file: what a log's channels are, and the tire, the conditions and the log around them.

    TOML text --parse--> tables --fields of the dataclasses below--> Setup (frozen, validated)

The dataclasses are the schema, as `storage.schema` reads it. Units are only checked here; `ingest`
converts. The file is longer than others, since a schema is to be read in one place.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, make_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tirelog.data.bounds import PLAUSIBLE, bounds_of, doubt_of_key, override
from tirelog.errors import SetupError, nearest
from tirelog.storage.documents import toml_text
from tirelog.storage.schema import (
    TEXT,
    Document,
    FilePlace,
    Named,
    Table,
    ValueKind,
    is_number,
    key,
    kinds_of,
    number,
    table_of,
    words,
)
from tirelog.vocabulary.conditions import SETUP_KEYS
from tirelog.vocabulary.kinds import KINDS, WAVELENGTH_KINDS

SURFACES = ("outer", "inner")
ROADS = ("flat", "step", "cleat", "sine", "profile")


def _number(low: float, high: float, *, above: bool = True, default: Any = None) -> Any:
    """A number in (low, high] (`above`) or [low, high].

    `default` if the key is absent.
    """
    return key(number(low, high, above=above), default)


_PAIR = ValueKind(
    "a pair [low, high] in nm, such as [1549.0, 1551.5]",
    lambda value: (
        isinstance(value, list)
        and len(value) == 2
        and all(map(is_number, value))
        and value[0] < value[1]
    ),
    lambda value: (float(value[0]), float(value[1])),
)
_NAMES = ValueKind(
    'a list of names, such as ["time_s", "strain_1"]',
    lambda value: isinstance(value, list) and bool(value) and all(map(TEXT.fits, value)),
    tuple,
)


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
    file: str | None = field(default=None, compare=False, metadata={"kind": None})

    def known(self) -> dict[str, Any]:
        """What the setup gives of the tire, by its keys."""
        return {name: value for name in kinds_of(Tire) if (value := getattr(self, name))}

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

    kind: str = key(words(*KINDS), "")
    source: str = ""
    unit: str | None = None
    scale: float | None = _number(-1e30, 1e30)
    offset: float | None = _number(-1e30, 1e30)
    reference_wavelength_nm: float | None = _number(100.0, 1e5)
    strain_gain: float = _number(0.0, 100.0, default=1.27)
    thermal_expansion_1_K: float = _number(-1.0, 1.0, default=0.0)
    temperature_channel: str | None = None
    temperature_sensitivity_nm_K: float = _number(0.0, 10.0, default=0.010)
    surface: str | None = key(words(*SURFACES))
    window_nm: tuple[float, float] | None = key(_PAIR)
    gauge_length_m: float | None = _number(0.0, 1.0)
    angle_deg: float | None = _number(-360.0, 360.0, above=False)
    lateral_m: float | None = _number(-1.0, 1.0, above=False)
    steps: int | None = key(number(0, 100_000, above=True, whole=True))
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
    separator: str | None = key(words(*SEPARATORS))
    decimal: str | None = key(words(".", ","))
    header_rows: int | None = key(number(0, 10_000, whole=True))
    encoding: str | None = key(words("utf-8", "cp1252"))
    columns: tuple[str, ...] | None = key(_NAMES)
    unusual: tuple[str, ...] | None = key(_NAMES)

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

    kind: str = key(words(*ROADS), "flat")
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


_ROAD = table_of(RoadSetup)
_SETUP = Table(
    {
        "tire": table_of(Tire),
        "conditions": table_of(LogConditions),
        "channels": Named(table_of(ChannelSetup, "kind")),
        "log": table_of(LogSetup),
        "road": _ROAD,
    },
    Setup,
)


def _refuse_channels(channels: Mapping[str, ChannelSetup], place: FilePlace) -> None:
    """SetupError: a channel has a name that is none, or lacks what its kind asks for."""
    for name, channel in channels.items():
        at, kind, twin = place / name, channel.kind, channel.temperature_channel
        at.refuse(
            (
                not re.fullmatch(r"[\w.+-]+", name),
                "",
                f"channel name {name!r}",
                "allowed are letters, digits and _ . + -",
                "rename it",
            ),
            (
                not channel.source and channel.window_nm is None,
                "",
                "no source",
                "allowed is a column, topic or dataset path, or window_nm",
                'add source = "..."',
            ),
            (
                channel.scale == 0.0,
                "scale",
                "scale = 0",
                "allowed is what one recorded step is worth in the unit",
                "mend the number",
            ),
        )
        try:
            KINDS[kind].to_si(channel.source_unit)
        except SetupError as problem:
            raise (at / "unit").moved(problem) from None
        at.refuse(
            (
                kind in WAVELENGTH_KINDS and channel.reference_wavelength_nm is None,
                "",
                "no reference_wavelength_nm",
                "a grating needs its wavelength at rest in nm",
                "add it",
            ),
            (
                twin is not None and (twin not in channels or twin == name),
                "temperature_channel",
                f"temperature_channel {twin!r} is no other channel{nearest(twin or '', channels)}",
                "",
                f"name one of {', '.join(channels)}",
            ),
        )


def _refuse_strange(setup: Setup, document: Document) -> None:
    """SetupError: a number that no tire has, or a rolling radius far from the unloaded one."""
    tire, unusual, place = setup.tire, setup.log.unusual or (), FilePlace(document)
    tables: dict[FilePlace, Any] = {place / "tire": tire, place / "conditions": setup.conditions}
    tables |= {place / "channels" / name: channel for name, channel in setup.channels.items()}
    for table, values in tables.items():
        for name, value in vars(values).items():
            if name not in PLAUSIBLE or value is None or name in unusual:
                continue
            bounds = bounds_of(name, tire.width_m, tire.unloaded_radius_m)
            if not bounds.holds(value):
                raise (table / name).error(
                    f"{name} = {value:g}", *doubt_of_key(name, value, bounds)
                )
    if not tire.rolling_radius_m or not tire.unloaded_radius_m:
        return
    ratio, bounds = tire.rolling_radius_m / tire.unloaded_radius_m, PLAUSIBLE["rolling_to_unloaded"]
    if not bounds.holds(ratio) and "rolling_to_unloaded" not in unusual:
        low, high = bounds.low * tire.unloaded_radius_m, bounds.high * tire.unloaded_radius_m
        raise (place / "tire" / "rolling_radius_m").error(
            f"a rolling radius of {tire.rolling_radius_m:.4g} m is {100 * abs(ratio - 1):.0f} % "
            f"{'larger' if ratio > 1 else 'smaller'} than the unloaded "
            f"{tire.unloaded_radius_m:.4g} m",
            f"allowed is {bounds} of it, {low:.4g} to {high:.4g} m",
            f"mend one of the two; {override('rolling_to_unloaded')}",
        )


def parse_road(line: str) -> RoadSetup:
    """[road] in one line, as a command takes it: `cleat,height_m=0.01,length_m=0.04`.

    SetupError as for a setup file.
    """
    kind, *pairs = (word.strip() for word in line.split(","))
    given: dict[str, Any] = {"kind": kind}
    for pair in pairs:
        name, _, value = (part.strip() for part in pair.partition("="))
        try:
            given[name] = value if name == "file" else float(value)
        except ValueError:
            raise SetupError(
                f"{pair!r} in the road {line!r}",
                allowed="KEY=NUMBER is allowed, such as height_m=0.01",
                do="correct it",
            ) from None
    place = FilePlace(Document("", SetupError, "a road", "--road"), ("road",))
    road: RoadSetup = _ROAD.read(given, place)
    return road


def _refuse_words(log: LogSetup, place: FilePlace) -> None:
    """SetupError: words of [log] that contradict each other, or that nothing is called by."""
    named = log.columns or ()
    twice = next((name for k, name in enumerate(named) if name and name in named[:k]), None)
    foreign = next((name for name in log.unusual or () if name not in PLAUSIBLE), "")
    place.refuse(
        (
            log.decimal is not None and log.decimal == log.separator,
            "decimal",
            f"separator and decimal are both {log.decimal!r}",
            "allowed are two that differ",
            "mend one of them",
        ),
        (
            twice is not None,
            "columns",
            f"columns has the name {twice!r} twice",
            "each name once is allowed",
            "rename one",
        ),
        (
            foreign,
            "unusual",
            f"unusual: no quantity is called {foreign!r}{nearest(foreign, PLAUSIBLE)}",
            f"allowed are {', '.join(PLAUSIBLE)}",
            "mend it",
        ),
    )


def parse_setup(text: str, file: str | None = None) -> Setup:
    """The setup in `text`.  SetupError, with file and line, for anything that is not allowed."""
    document = Document(text, SetupError, "a setup", file or "setup")
    setup: Setup = document.read(_SETUP)
    setup = replace(setup, tire=replace(setup.tire, file=file), text=text, file=file)
    place = FilePlace(document)
    at_least = "a setup has at least one [channels.NAME]"
    place.refuse((not setup.channels, "", "no channels", at_least, "add what the log holds"))
    _refuse_channels(setup.channels, place / "channels")
    _refuse_words(setup.log, place / "log")
    _refuse_strange(setup, document)
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
