"""What a series most likely is: by its unit, its name and its size. A guess, and said to be one."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from tirelog.vocabulary import units
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.kinds import KINDS

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
