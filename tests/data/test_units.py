"""Closed form: the unit table against definitions written out here."""

import ast
import math

import pytest

from tests.sources import nodes
from tirelog.physics.effects.base import CATALOGUE_G_M_S2
from tirelog.vocabulary.units import STANDARD_GRAVITY_M_S2, UNITS, canonical, likely_number, to_si

pytestmark = pytest.mark.xdist_group("sources")  # one worker parses the package, once

# one value in the unit, and the same in SI, by definition of the unit
DEFINITIONS = {
    "m": (2.0, 2.0), "mm": (2.0, 0.002), "um": (2.0, 2e-6), "nm": (1550.0, 1.55e-6),
    "pm": (1.0, 1e-12), "strain": (1.0, 1.0), "microstrain": (850.0, 8.5e-4),
    "ustrain": (1.0, 1e-6), "m/m": (1.0, 1.0), "um/m": (1.0, 1e-6), "m/s^2": (3.0, 3.0),
    "m/s2": (3.0, 3.0), "g": (2.0, 19.6133), "m/s": (4.0, 4.0), "km/h": (36.0, 10.0),
    "mph": (1.0, 1609.344 / 3600), "kn": (1.0, 1852 / 3600), "Pa": (5.0, 5.0), "hPa": (1.0, 100.0),
    "kPa": (1.0, 1000.0), "MPa": (1.0, 1e6), "bar": (2.2, 220000.0), "mbar": (1.0, 100.0),
    "psi": (1.0, 0.45359237 * 9.80665 / 0.0254**2), "K": (300.0, 300.0), "degC": (0.0, 273.15),
    "degF": (32.0, 273.15), "N": (7.0, 7.0), "kN": (3.434, 3434.0), "daN": (1.0, 10.0),
    "kgf": (400.0, 3922.66), "lbf": (1.0, 0.45359237 * 9.80665), "s": (1.0, 1.0), "ms": (1.0, 1e-3),
    "us": (1.0, 1e-6), "ns": (1.0, 1e-9), "100ns": (1.0, 1e-7), "min": (1.0, 60.0),
    "h": (1.0, 3600.0), "d": (1.0, 86_400.0), "V": (1.0, 1.0), "mV": (1.0, 1e-3),
    "1": (1.0, 1.0), "count": (1.0, 1.0), "step": (1.0, 1.0), "rad": (1.0, 1.0),
    "deg": (180.0, math.pi),
}  # fmt: skip


def test_every_unit_has_a_definition_here():
    assert set(DEFINITIONS) == set(UNITS)


@pytest.mark.parametrize("unit", DEFINITIONS)
def test_unit_becomes_si(unit):
    value, si = DEFINITIONS[unit]
    factor, offset = to_si(unit, UNITS[unit][0])
    assert factor * value + offset == pytest.approx(si, rel=1e-12)


SPELLINGS = {
    "µe": "microstrain", "°C": "degC", "KM/H": "km/h", " nm ": "nm", "m/s²": "m/s^2",
    "MPa": "MPa", "mpa": "MPa", "furlong": None,
}  # fmt: skip


def test_spellings():
    """No unit of the table is a millipascal."""
    assert {written: canonical(written) for written in SPELLINGS} == SPELLINGS


def test_one_gravity():
    """Models and estimators share one g."""
    found = {
        (file, node.value)
        for file, node in nodes()
        if isinstance(node, ast.Constant)
        and isinstance(node.value, float)
        and 9.75 < node.value < 9.85
        and not file.startswith("simulation/")
    }
    assert found == {
        ("vocabulary/units.py", STANDARD_GRAVITY_M_S2),
        ("physics/effects/base.py", CATALOGUE_G_M_S2),
    }


@pytest.mark.parametrize(
    ("text", "means"),
    [
        ("20kmh", "20 km/h is 5.556 m/s"),
        ("2.2 bar", "2.2 bar is 2.2e+05 Pa"), ("10,20kmh", ""),
        ("20 degC", "20 degC is 293.1 K"),
        ("350kgf", "350 kgf is 3432 N"),
        ("-5mm", "-5 mm is -0.005 m"),
        ("0,305", "the decimal sign is a point: 0.305"),
        ("4.5", ""), ("on", ""), ("1:2", ""), ("5 furlongs", ""), ("1.2.3 m", ""), ("", ""),
    ],
)  # fmt: skip
def test_a_number_as_people_write_it_is_understood(text, means):
    assert likely_number(text) == means
