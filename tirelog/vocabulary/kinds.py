"""Every kind of channel, once: what it measures, in which units it may be recorded, its SI unit.

A setup names a channel's kind; readers, tables, models and pages look up here what that means. A
new kind is one entry; docs/channel_kinds.md and docs/setup.md are made from this register.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from tirelog.vocabulary import units


@dataclass(frozen=True)
class Kind:
    """A kind of channel.

    quantities   whose units (`vocabulary.units`) its source may have; () for a unit of any kind,
                 SI inside if the table has it, else as written
    unit         SI unit of its samples inside the package; "" for a pure number, or a free unit
    source_unit  unit of the source if the setup names none
    measures     what the samples tell: "strain" for whatever the patch's strain is found in; else
                 the kind's own quantity
    wavelength   True if the source is a grating's wavelength, which needs one at rest
    meaning      a sentence for the reader of a setup
    """

    name: str
    quantities: tuple[str, ...]
    unit: str
    source_unit: str
    measures: str
    meaning: str
    wavelength: bool = False

    def to_si(self, unit: str) -> tuple[float, float, str]:
        """(factor, offset, SI unit) of a source in `unit`.  SetupError: it is none of the kind."""
        if not self.quantities:
            return units.free_to_si(unit)
        return *units.to_si(unit, *self.quantities), self.unit


_ALL = (
    Kind(
        "fbg_strain",
        ("length",),
        "",
        "nm",
        "strain",
        "wavelength of a fiber Bragg grating that is bonded to the tire",
        wavelength=True,
    ),
    Kind(
        "fbg_temperature",
        ("length",),
        "K",
        "nm",
        "temperature",
        "wavelength of an unbonded twin grating, the temperature reference",
        wavelength=True,
    ),
    Kind("strain", ("strain",), "", "strain", "strain", "strain as the instrument gives it"),
    Kind(
        "radial_acceleration",
        ("acceleration",),
        "m/s^2",
        "m/s^2",
        "acceleration",
        "an accelerometer in the tread, along the radius",
    ),
    Kind(
        "wheel_encoder",
        ("voltage", "number", "angle"),
        "",
        "1",
        "wheel angle",
        "the wheel's encoder: pulses, a count of steps, or an angle",
    ),
    Kind("vehicle_speed", ("speed",), "m/s", "m/s", "speed", "a reference for the rolling radius"),
    Kind(
        "longitudinal_acceleration",
        ("acceleration",),
        "m/s^2",
        "m/s^2",
        "vehicle acceleration",
        "the vehicle's acceleration, forwards",
    ),
    Kind(
        "lateral_acceleration",
        ("acceleration",),
        "m/s^2",
        "m/s^2",
        "vehicle acceleration",
        "the vehicle's acceleration, to the left",
    ),
    Kind("temperature", ("temperature",), "K", "K", "temperature", "temperature of the tire"),
    Kind(
        "inflation_pressure",
        ("pressure",),
        "Pa",
        "Pa",
        "pressure",
        "inflation pressure above the air's",
    ),
    Kind("vertical_load", ("force",), "N", "N", "force", "load of the wheel on the road"),
    Kind(
        "longitudinal_force", ("force",), "N", "N", "force", "force of the road along the vehicle"
    ),
    Kind(
        "signal",
        (),
        "",
        "1",
        "signal",
        "any other signal, in a unit of its own: a piezo or capacitive sensor, a torque",
    ),
)
KINDS: Mapping[str, Kind] = {kind.name: kind for kind in _ALL}
#: kinds of channel in which the patch's strain is found
STRAIN_KINDS = tuple(kind.name for kind in _ALL if kind.measures == "strain")
#: kinds of channel whose values change little from one sample to the next, beside those in which a
#: patch or teeth are found
SLOW_KINDS = tuple(
    kind.name
    for kind in _ALL
    if kind.measures not in ("strain", "acceleration", "wheel angle", "signal")
)
#: kinds whose source is a wavelength: one of 0 or below is a lost peak
WAVELENGTH_KINDS = tuple(kind.name for kind in _ALL if kind.wavelength)
#: kinds of channel in which the patch's acceleration is found
ACCELERATION_KINDS = tuple(kind.name for kind in _ALL if kind.measures == "acceleration")
