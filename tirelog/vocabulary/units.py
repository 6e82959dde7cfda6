"""Units at the edge of the package: what a source may be recorded in, and how it becomes SI.

Only what an instrument, a setup file or a column writes as a unit passes through here; inside,
everything is SI. The table is ours because pint costs more at start than all of our own imports; a
test holds it against the definitions.
"""

from __future__ import annotations

import re
from contextlib import suppress

from tirelog.errors import SetupError, nearest

#: Standard gravity, the g of units, models and estimators.
STANDARD_GRAVITY_M_S2 = 9.80665

#: unit -> (quantity, factor, offset):  SI value = factor * value + offset
UNITS: dict[str, tuple[str, float, float]] = {
    "m": ("length", 1.0, 0.0),
    "mm": ("length", 1e-3, 0.0),
    "um": ("length", 1e-6, 0.0),
    "nm": ("length", 1e-9, 0.0),
    "pm": ("length", 1e-12, 0.0),
    "strain": ("strain", 1.0, 0.0),
    "microstrain": ("strain", 1e-6, 0.0),
    "ustrain": ("strain", 1e-6, 0.0),
    "m/m": ("strain", 1.0, 0.0),
    "um/m": ("strain", 1e-6, 0.0),
    "m/s^2": ("acceleration", 1.0, 0.0),
    "m/s2": ("acceleration", 1.0, 0.0),
    "g": ("acceleration", STANDARD_GRAVITY_M_S2, 0.0),
    "m/s": ("speed", 1.0, 0.0),
    "km/h": ("speed", 1.0 / 3.6, 0.0),
    "mph": ("speed", 0.44704, 0.0),
    "kn": ("speed", 1852.0 / 3600.0, 0.0),
    "Pa": ("pressure", 1.0, 0.0),
    "hPa": ("pressure", 1e2, 0.0),
    "kPa": ("pressure", 1e3, 0.0),
    "MPa": ("pressure", 1e6, 0.0),
    "bar": ("pressure", 1e5, 0.0),
    "mbar": ("pressure", 1e2, 0.0),
    "psi": ("pressure", 6894.757293168361, 0.0),
    "K": ("temperature", 1.0, 0.0),
    "degC": ("temperature", 1.0, 273.15),
    "degF": ("temperature", 5.0 / 9.0, 459.67 * 5.0 / 9.0),
    "N": ("force", 1.0, 0.0),
    "kN": ("force", 1e3, 0.0),
    "daN": ("force", 10.0, 0.0),
    "kgf": ("force", STANDARD_GRAVITY_M_S2, 0.0),
    "lbf": ("force", 4.4482216152605, 0.0),
    "s": ("time", 1.0, 0.0),
    "ms": ("time", 1e-3, 0.0),
    "us": ("time", 1e-6, 0.0),
    "ns": ("time", 1e-9, 0.0),
    "100ns": ("time", 1e-7, 0.0),  # FILETIME, .NET
    "min": ("time", 60.0, 0.0),
    "h": ("time", 3600.0, 0.0),
    "d": ("time", 86_400.0, 0.0),
    "V": ("voltage", 1.0, 0.0),
    "mV": ("voltage", 1e-3, 0.0),
    "1": ("number", 1.0, 0.0),
    "count": ("number", 1.0, 0.0),
    "step": ("number", 1.0, 0.0),
    "rad": ("angle", 1.0, 0.0),
    "deg": ("angle", 0.017453292519943295, 0.0),
}

#: other spellings that instruments use, lower-cased
SPELLINGS = {
    "µe": "microstrain", "με": "microstrain", "µε": "microstrain", "ue": "microstrain",
    "µm/m": "um/m", "um\\m": "um/m", "µm\\m": "um/m", "kmh": "km/h",
    "°c": "degC", "c": "degC", "celsius": "degC", "°f": "degF",
    "kph": "km/h", "m/s²": "m/s^2", "ms^-2": "m/s^2", "m s-2": "m/s^2", "m/s**2": "m/s^2",
    "sec": "s", "second": "s", "seconds": "s", "volt": "V", "volts": "V", "-": "1", "": "1",
    "counts": "count", "steps": "step", "µm": "um", "nanometer": "nm", "kelvin": "K",
    "µs": "us", "μs": "us", "day": "d", "days": "d", "100 ns": "100ns",
}  # fmt: skip


def canonical(unit: str) -> str | None:
    """The table's name of `unit` as an instrument may spell it; None if it is not known."""
    text = unit.strip()
    if text in UNITS:
        return text
    if text.lower() in SPELLINGS:
        return SPELLINGS[text.lower()]
    same = [name for name in UNITS if name.lower() == text.lower()]
    return same[0] if len(same) == 1 else None


#: letters of a unit that the table does not have
MOST_LETTERS = 24


def free_to_si(unit: str) -> tuple[float, float, str]:
    """(factor, offset, SI unit) of any unit; one that the table does not have stays as written.

    SetupError: it is no word.
    """
    name = canonical(unit)
    if name is not None:
        quantity, factor, offset = UNITS[name]
        si = next(one for one, (of, f, o) in UNITS.items() if (of, f, o) == (quantity, 1.0, 0.0))
        return factor, offset, si
    text = unit.strip()
    if not text or len(text) > MOST_LETTERS or not text.isprintable():
        raise SetupError(
            f"unit {text[:MOST_LETTERS]!r}",
            allowed=f"allowed is a word of up to {MOST_LETTERS} letters",
            do="write the unit of the source",
        )
    return 1.0, 0.0, text


def likely_number(text: str) -> str:
    """What a number with a unit or a decimal comma means in SI; empty for any other text.

    >>> likely_number("20kmh")
    '20 km/h is 5.556 m/s'
    >>> likely_number("0,305")
    'the decimal sign is a point: 0.305'
    """
    found = re.fullmatch(r"([-+]?[\d.,]+) *([^\d\s].*)?", text.strip())
    if found is None:
        return ""
    unit = canonical(found[2] or "1")
    with suppress(ValueError):
        value = float(found[1].replace(",", "."))
        if found[2] is None and "," in found[1]:
            return f"the decimal sign is a point: {value:g}"
        if found[2] is not None and unit is not None and "," not in found[1]:
            factor, offset, si = free_to_si(unit)
            if (factor, offset) == (1.0, 0.0):
                return f"leave the unit out: {value:g}"
            return f"{value:g} {unit} is {factor * value + offset:.4g} {si}"
    return ""


def to_si(unit: str, *quantities: str) -> tuple[float, float]:
    """(factor, offset) with SI = factor * value + offset, for a unit of one of `quantities`.

    SetupError: the unit is not known, or is of another quantity.
    """
    allowed = [name for name, (quantity, _, _) in UNITS.items() if quantity in quantities]
    name = canonical(unit)
    if name is None or name not in allowed:
        raise SetupError(
            f"unit {unit!r} is not one of {', '.join(allowed)}{nearest(unit, allowed)}",
            do="write the unit of the source",
        )
    _, factor, offset = UNITS[name]
    return factor, offset
