"""What a tire's numbers can be, and the probable unit of one that cannot be a tire's.

The bounds are wide: from a child's bicycle to an earth mover and an aircraft's main wheel. What
lies outside is a wrong unit, a wrong column or a wrong grating nearly always, and every figure made
of it would be wrong with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from tirelog.vocabulary.units import STANDARD_GRAVITY_M_S2


@dataclass(frozen=True)
class Bounds:
    """The range of a number, from `low` to `high` in SI.

    `units`: what else the number may have been given in, factor to SI by name.
    """

    low: float
    high: float
    units: Mapping[str, float]

    def holds(self, value: float) -> bool:
        return self.low <= value <= self.high

    def probable(self, value: float) -> str:
        """A hint on each other unit in which the value lies inside the bounds, or ''.

        It reads `; 2.2 bar would be 220000`.
        """
        fits = [
            f"{value:g} {name} would be {value * factor:g}"
            for name, factor in self.units.items()
            if self.holds(value * factor)
        ]
        return f"; {' or '.join(fits)}" if fits else ""


#: metres per unit that a length may be meant in
_LENGTHS = {"mm": 1e-3, "cm": 1e-2, "in": 0.0254}
#: inflation pressure above the air's [Pa]: sand and farm tires 0.3 bar, bicycles 12 bar, aircraft
#: 17 bar.  Twice as wide on both sides would let MPa pass for bar
PRESSURE = Bounds(2e4, 2e6, {"bar": 1e5, "psi": 6894.757, "kPa": 1e3, "MPa": 1e6, "hPa": 1e2})
#: wheel load [N]: a child's bicycle 100 N, trucks 50 kN, aircraft 300 kN, the largest earth movers
#: 1 MN.  Twice as low would not find more mistakes of a unit: kN and tonnes lie a factor of 100
#: away
LOAD = Bounds(10.0, 1e6, {"kN": 1e3, "kg": STANDARD_GRAVITY_M_S2, "t": 1e3 * STANDARD_GRAVITY_M_S2})
#: samples per second that no instrument on a tire takes [Hz]: gratings are read at up to some
#: 100 kHz, accelerometers at 200 kHz.  Twice as much lets stamps in s that are taken for ms pass up
#: to a rate of 2 kHz in place of 1 kHz, and days that are taken for s up to 23 Hz in place of 12
FASTEST_HZ = 1e6
#: key of the setup -> what a tire can have.  Radii [m]: push-chair 0.06, earth mover 2.1; widths:
#: racing bicycle 0.02, earth mover 1.5
OF_KEY: Mapping[str, Bounds] = {
    "load_N": LOAD,
    "inflation_pressure_Pa": PRESSURE,
    "unloaded_radius_m": Bounds(0.04, 2.5, _LENGTHS),
    "rolling_radius_m": Bounds(0.04, 2.5, _LENGTHS),
    "width_m": Bounds(0.01, 2.0, _LENGTHS),
    # gratings in silica are written from the visible to 2.1 um
    "reference_wavelength_nm": Bounds(400.0, 2500.0, {"um": 1e3, "pm": 1e-3}),
}
#: rolling over unloaded radius.  A belted tire at its load: 0.94 to 0.99, a soft farm tire 0.9; a
#: quarter of the load would move it by 0.01.  Twice as wide would let half of all mixed-up columns
#: through
ROLLING_TO_UNLOADED = (0.85, 1.05)


def doubt_of_key(key: str, value: float) -> str:
    """'' or what is allowed for `key` of a setup, with the probable unit."""
    bounds = OF_KEY.get(key)
    if bounds is None or bounds.holds(value):
        return ""
    return f"allowed for a tire is {bounds.low:g} to {bounds.high:g}{bounds.probable(value)}"


def doubt_of_radius(rolling_m: float, unloaded_m: float | None) -> str:
    """'' or why a rolling radius cannot go with the unloaded one."""
    low, high = ROLLING_TO_UNLOADED
    if unloaded_m is None or low * unloaded_m <= rolling_m <= high * unloaded_m:
        return ""
    share = 100.0 * (rolling_m / unloaded_m - 1.0)
    return (
        f"a rolling radius of {rolling_m:.4g} m is {abs(share):.0f} % "
        f"{'larger' if share > 0 else 'smaller'} "
        f"than the unloaded {unloaded_m:.4g} m; allowed is {low:g} to {high:g} of it, "
        f"{low * unloaded_m:.4g} to {high * unloaded_m:.4g} m"
    )
