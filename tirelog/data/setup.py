"""The setup file: what a log's channels are, and the tire, the conditions and the log around them.

    TOML text --parse--> tables --keys of the records below--> Setup (frozen, validated)

The records are the schema, as `storage.schema` reads it. Units are only checked here; `ingest`
converts.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

from tirelog.errors import SetupError, nearest
from tirelog.storage.schema import (
    FLAG,
    TEXT,
    Document,
    FilePlace,
    Named,
    Record,
    ValueKind,
    is_number,
    key,
    kinds_of,
    number,
    table_of,
    words,
)
from tirelog.storage.whole import toml_text
from tirelog.vocabulary.conditions import SETUP_KEYS
from tirelog.vocabulary.kinds import KINDS, WAVELENGTH_KINDS
from tirelog.vocabulary.units import STANDARD_GRAVITY_M_S2, UNITS, canonical

# ---- What a tire's numbers can be: one table, and the unit that another number is probably given
# in.
#
# `PLAUSIBLE` is used by setups, channels, passages, wheel angles, tables and comparisons alike. The
# ranges are wide: from a bicycle to a truck. What lies outside is a wrong unit, a wrong column or a
# wrong grating nearly always, and every figure made of it would be wrong with it. Who is sure of
# such
# a number lists its name in `unusual` under [log].


#: other spellings of what people write into a setup's number, factor to the key's unit
_MORE: Mapping[str, Mapping[str, float]] = {
    "length": {"cm": 1e-2, "in": 0.0254},
    "force": {"kg": STANDARD_GRAVITY_M_S2, "t": 1e3 * STANDARD_GRAVITY_M_S2},
    "distance": {"m": 1e-3, "miles": 1.609344},
    "depth": {"m": 1e3, "cm": 10.0, "um": 1e-3, "in": 25.4},
    "wavelength": {"um": 1e3, "pm": 1e-3},
}


@dataclass(frozen=True)
class Bounds:
    """The range of a number, from `low` to `high` in `unit`; also nothing at all if `or_zero`.

    `quantity`: whose units the number may have been given in, of `vocabulary.units` or `_MORE`.
    """

    low: float
    high: float
    unit: str = ""
    quantity: str = ""
    or_zero: bool = False

    def holds(self, value: float) -> bool:
        return self.low <= value <= self.high or (self.or_zero and value == 0.0)

    def __str__(self) -> str:
        span = f"{self.low:g} to {self.high:g}{' ' * bool(self.unit)}{self.unit}"
        return f"0 or {span}" if self.or_zero else span

    def units(self, value: float, given: str = "") -> dict[str, float]:
        """Units that make a number in `given` plausible, each with its value in `unit`.

        Without `given` the number is in `unit`, and may be in more than the table's units.
        """
        table = {name: (f, o) for name, (of, f, o) in UNITS.items() if of == self.quantity}
        factor, offset = table.get(canonical(given or self.unit) or "", (1.0, 0.0))
        if given and canonical(given) not in table:
            return {}  # what the sensor tells is not what its source is recorded in
        if not given:
            table = {name: (f, 0.0) for name, f in _MORE.get(self.quantity, {}).items()} | table
        raw, found = (value - offset) / factor, dict[str, float]()
        for name, (f, o) in table.items():
            other = raw * f + o
            if self.holds(other) and (f, o) != (factor, offset) and other not in found.values():
                found[name] = other
        return found


#: name -> range.  Each has its reason, and what a range of twice the width would let pass.
PLAUSIBLE: Mapping[str, Bounds] = {
    # wheel load: motorbike and trailer 1 kN, truck 60 kN.  A tire of known width and radius has
    # `CARRIED_PA` instead.  Twice as low: a car's load in kg
    "load_N": Bounds(500.0, 6e4, "N", "force"),
    # above the air's: sand and farm tires 0.3 bar, bicycles 12 bar, aircraft 17 bar.  MPa for bar
    "inflation_pressure_Pa": Bounds(2e4, 2e6, "Pa", "pressure"),
    # tread age: truck tires 1.5e5 km.  Twice as high: m for km of a tire that is run in
    "distance_km": Bounds(0.0, 2e5, "km", "distance"),
    # wet asphalt 0.05 mm, aquaplaning basins 10 mm.  Twice as wide on each side: cm for mm
    "water_depth_mm": Bounds(0.05, 20.0, "mm", "depth", or_zero=True),
    # push-chair 0.06, earth mover 2.1; widths: racing bicycle 0.02, earth mover 1.5.  cm for m
    "unloaded_radius_m": Bounds(0.04, 2.5, "m", "length"),
    "rolling_radius_m": Bounds(0.04, 2.5, "m", "length"),
    "width_m": Bounds(0.01, 2.0, "m", "length"),
    # gratings in silica are written from the visible to 2.1 um
    "reference_wavelength_nm": Bounds(400.0, 2500.0, "nm", "wavelength"),
    # a grating's wavelength over its reference: 2 % are 31 nm at 1550 nm, 25,000 microstrain or
    # 3,000 K.  Gratings of one fibre lie 5 to 40 nm apart: a neighbour
    "wavelength": Bounds(0.98, 1.02, "of reference_wavelength_nm", "length"),
    # median: a tire's own is below 0.3 %, silica breaks at 5 %.  A neighbouring grating
    "fbg_strain": Bounds(-0.01, 0.01, "strain", "strain"),
    # soft strips on rubber read 10 % at most; microstrain for strain
    "strain": Bounds(-0.1, 0.1, "strain", "strain"),
    # median of a vehicle's speed, also backwards; tires as `speed_m_s`
    "vehicle_speed_m_s": Bounds(-10.0, 120.0, "m/s", "speed"),
    # median of the sensor in the tread: 100 m/s on a radius of 0.3 m are 33,000
    "radial_acceleration_m_s2": Bounds(-5e4, 5e4, "m/s^2", "acceleration"),
    # median of the vehicle: racing cars brake with 50 at most, for seconds
    "longitudinal_acceleration_m_s2": Bounds(-30.0, 30.0, "m/s^2", "acceleration"),
    "lateral_acceleration_m_s2": Bounds(-60.0, 60.0, "m/s^2", "acceleration"),
    "longitudinal_force_N": Bounds(-6e4, 6e4, "N", "force"),
    # of a turning wheel: drums creep at 0.3, aircraft take off at 100.  s for ms of slow wheels
    "speed_m_s": Bounds(0.2, 120.0, "m/s"),
    # samples in a patch that passes at 1 m/s: 10 at 100 Hz; accelerometers 200 kHz at most
    "sampling_rate_Hz": Bounds(100.0, 1e6, "Hz"),
    # a belted tire at its load: 0.94 to 0.99, a soft farm tire 0.9; mixed-up columns
    "rolling_to_unloaded": Bounds(0.85, 1.05),
    # radius by the vehicle's speed: over the setup's rolling one, and over the unloaded one, which
    # soft tires roll on at 0.91.  GPS is good to 1 %, speed on a bus to 3 %; a rate off by a fifth
    "vehicle_to_rolling": Bounds(0.93, 1.07, "", "speed"),
    "vehicle_to_unloaded": Bounds(0.89, 1.05, "", "speed"),
    # level of an accelerometer outside the patch over Omega^2 R, and its step into the patch, which
    # the bend at the edges makes larger; it follows the square of the rate
    "level_to_rotation": Bounds(0.7, 1.4, "of the centripetal acceleration", "acceleration"),
    "step_to_rotation": Bounds(0.5, 2.5, "of the centripetal acceleration", "acceleration"),
}
#: load over width and diameter [Pa]: bicycle and motorbike 6 to 30 kPa, car 25, truck 150, aircraft
#: 450.  Twice as low: a car's load in kg
CARRIED_PA = (4e3, 5e5)
#: kind of channel -> what of it is judged by its median
OF_KIND: Mapping[str, str] = {
    "fbg_strain": "fbg_strain",
    "strain": "strain",
    "inflation_pressure": "inflation_pressure_Pa",
    "vertical_load": "load_N",
    "vehicle_speed": "vehicle_speed_m_s",
    "radial_acceleration": "radial_acceleration_m_s2",
    "longitudinal_acceleration": "longitudinal_acceleration_m_s2",
    "lateral_acceleration": "lateral_acceleration_m_s2",
    "longitudinal_force": "longitudinal_force_N",
}


def bounds_of(name: str, width_m: float | None = None, radius_m: float | None = None) -> Bounds:
    """The range of a quantity; that of a load depends on the tire's size."""
    bounds = PLAUSIBLE[name]
    if name != "load_N" or not width_m or not radius_m:
        return bounds
    low, high = (pressure * width_m * 2.0 * radius_m for pressure in CARRIED_PA)
    return replace(bounds, low=float(f"{low:.2g}"), high=float(f"{high:.2g}"))


def doubt_of_key(key: str, value: float, bounds: Bounds) -> tuple[str, str]:
    """(what is allowed for a key of a setup, with probable units; what to write)."""
    units = bounds.units(value)
    fits = " or ".join(f"{value:g} {unit} would be {other:g}" for unit, other in units.items())
    numbers = " or ".join(f"{other:g}" for other in units.values())
    do = f"write {key} = {numbers}" if units else "mend the number"
    return f"allowed for a tire is {bounds}{'; ' * bool(fits)}{fits}", f"{do}; {override(key)}"


def override(name: str) -> str:
    """The line of a setup by which an implausible number is accepted."""
    return f'if it is right, write unusual = ["{name}"] under [log]'


#: ordinary sizes of a tire's own form: a shape of its contact pressure over the mean pressure, and
#: the change of its stiffness at a wavelength; twice as large, forms take more of an effect
FORM_PRESSURE, FORM_STIFFNESS = 0.3, 0.2
#: highest degree of the Legendre polynomials of a form's pressure: with 8 the kinks of a trapezoid
#: move stiffnesses of short waves by a third; twice as many take longer to fit
FORM_DEGREES = 14
#: waves in a turn between which a form's stiffness bends, and how many numbers it has: one for each
#: factor of 1.7 in wavelength
FORM_WAVES, FORM_BELLS = (2.0, 120.0), 9


def share_of_degree(n: int) -> float:
    """The ordinary size of a form's shape of degree n, over that of coarse ones."""
    # degree from which on a shape of the pressure is ordinarily smaller, as one over its degree;
    # from twice that on none would be
    return min(1.0, 7.0 / n)


SURFACES = ("outer", "inner")
ROADS = ("flat", "step", "cleat", "sine", "profile")


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


class Tire(Record):
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

    keys: ClassVar = {
        "name": (TEXT, ""),
        "unloaded_radius_m": (number(0.0, 5.0, above=True), None),
        "rolling_radius_m": (number(0.0, 5.0, above=True), None),
        "section_height_m": (number(0.0, 1.0, above=True), None),
        "width_m": (number(0.0, 2.0, above=True), None),
        "section_area_m2": (number(0.0, 1.0, above=True), None),
        "viscosity_Pa_s": (number(0.0, 1e9, above=True), None),
        "static_footprint_length_m": (number(0.0, 2.0, above=True), None),
        "friction_ratio": (number(0.2, 1.2, above=True), None),
        # the setup's path, for messages; no key of the table
        "file": (None, None),
    }

    def known(self) -> dict[str, Any]:
        """The keys of the tire that the setup gives."""
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
        return float(radius)

    @property
    def area_m2(self) -> float | None:
        """The section's area: as given, or section height x width, or None."""
        if self.section_area_m2 is not None:
            return float(self.section_area_m2)
        if self.section_height_m is None or self.width_m is None:
            return None
        return float(self.section_height_m * self.width_m)


class LogConditions(Record):
    """[conditions]: constant over the log; the register's keys, None for what is not given."""

    keys: ClassVar = {
        **{
            name: (number(low, high, above=not from_low), None)
            for name, (low, high, from_low) in SETUP_KEYS.items()
        },
        "driven": (FLAG, None),
    }


class ChannelSetup(Record):
    """[channels.NAME]: one signal of the log.

    kind                          what is measured
    source                        its place in the file
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

    keys: ClassVar = {
        "kind": (words(*KINDS), ""),
        "source": (TEXT, ""),
        "unit": (TEXT, None),
        "scale": (number(-1e30, 1e30, above=True), None),
        "offset": (number(-1e30, 1e30, above=True), None),
        "reference_wavelength_nm": (number(100.0, 1e5, above=True), None),
        "strain_gain": (number(0.0, 100.0, above=True), 1.27),
        "thermal_expansion_1_K": (number(-1.0, 1.0, above=True), 0.0),
        "temperature_channel": (TEXT, None),
        "temperature_sensitivity_nm_K": (number(0.0, 10.0, above=True), 0.010),
        "surface": (words(*SURFACES), None),
        "window_nm": (_PAIR, None),
        "gauge_length_m": (number(0.0, 1.0, above=True), None),
        "angle_deg": (number(-360.0, 360.0), None),
        "lateral_m": (number(-1.0, 1.0), None),
        "steps": (number(0, 100_000, above=True, whole=True), None),
        "sampling_rate_Hz": (number(0.0, 1e9, above=True), None),
    }

    @property
    def source_unit(self) -> str:
        return self.unit or KINDS[self.kind].source_unit

    @property
    def scaled(self) -> bool:
        """True if recorded numbers have another unit than the channel."""
        return self.scale is not None or self.offset is not None

    @property
    def scaling(self) -> tuple[float, float]:
        """(scale, offset) with value in the unit = scale x recorded + offset."""
        return 1.0 if self.scale is None else self.scale, self.offset or 0.0

    def recorded(self, value: float) -> float:
        """The recorded number of a value in the channel's unit."""
        scale, offset = self.scaling
        return (value - offset) / scale


#: separators of the cells of a text log; " " is any run of blanks
SEPARATORS = (",", ";", "\t", " ", "|")
_TEXT_KEYS = ("separator", "decimal", "header_rows", "encoding", "columns")


class LogSetup(Record):
    """[log]: facts that the file lacks or that were read wrongly.

    separator    between the cells of a text log: one of SEPARATORS (" " for runs of blanks)
    decimal      "." or ","
    header_rows  lines above the first row of samples, blank ones counted
    encoding     utf-8 or cp1252
    columns      names of the columns from the first on, in place of the header's
    unusual      quantities whose numbers are right though no tire is known to have them
    """

    keys: ClassVar = {
        "sampling_rate_Hz": (number(0.0, 1e9, above=True), None),
        "time": (TEXT, None),
        "time_unit": (TEXT, None),
        "separator": (words(*SEPARATORS), None),
        "decimal": (words(".", ","), None),
        "header_rows": (number(0, 10_000, whole=True), None),
        "encoding": (words("utf-8", "cp1252"), None),
        "columns": (_NAMES, None),
        "unusual": (_NAMES, None),
    }

    @property
    def of_text(self) -> list[str]:
        """The keys that are given and that only a text log has."""
        return [key for key in _TEXT_KEYS if getattr(self, key) is not None]


class RoadSetup(Record):
    """[road]: what the wheel rolled over in this log; lengths in m along the direction of driving.

    kind        flat; step (height_m, over a ramp of ramp_m); cleat (height_m, length_m at its foot,
                ramps of ramp_m within it); sine (amplitude_m (1 - cos(2 pi x / wavelength_m)));
                profile (file: two columns, distance and height, beside the setup)
    time_s      when the wheel's centre is over the obstacle's beginning; searched for in the
                log if it is not given
    position_m  the same as a distance driven since the log's start
    spacing_m   after which the obstacle comes again (a drum's circumference)
    """

    keys: ClassVar = {
        "kind": (words(*ROADS), "flat"),
        "height_m": (number(-1.0, 1.0, above=True), None),
        "length_m": (number(0.0, 100.0, above=True), None),
        "ramp_m": (number(0.0, 100.0, above=True), None),
        "amplitude_m": (number(-1.0, 1.0, above=True), None),
        "wavelength_m": (number(0.0, 1e4, above=True), None),
        "file": (TEXT, None),
        "time_s": (number(0.0, 1e7), None),
        "position_m": (number(-1e6, 1e6, above=True), None),
        "spacing_m": (number(0.0, 1e6, above=True), None),
    }


@dataclass(frozen=True)
class Setup:
    """A whole setup file.

    `text` is the content of the file, for the run's provenance; `file` its path, for messages.
    """

    tire: Tire = key(table_of(Tire), Tire())
    conditions: LogConditions = key(table_of(LogConditions), LogConditions())
    channels: Mapping[str, ChannelSetup] = field(
        default_factory=dict, metadata={"kind": Named(table_of(ChannelSetup, "kind"))}
    )
    log: LogSetup = key(table_of(LogSetup), LogSetup())
    road: RoadSetup = key(table_of(RoadSetup), RoadSetup())
    text: str = key(None, "")
    file: str | None = key(None)


def _refuse_channels(channels: Mapping[str, ChannelSetup], place: FilePlace) -> None:
    """SetupError if a channel has no valid name, or lacks a key of its kind."""
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
                f"temperature_channel {twin!r} is not another channel"
                f"{nearest(twin or '', channels)}",
                "",
                f"name one of {', '.join(channels)}",
            ),
        )


def _refuse_strange(setup: Setup, document: Document) -> None:
    """SetupError for an implausible number, or a rolling radius far from the unloaded."""
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
    road: RoadSetup = table_of(RoadSetup).read(given, place)
    return road


def _refuse_words(log: LogSetup, place: FilePlace) -> None:
    """SetupError for words of [log] that contradict each other or are unknown."""
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
    setup: Setup = document.read(table_of(Setup))
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
