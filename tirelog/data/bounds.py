"""What a tire's numbers can be: one table, and the unit that another number is probably given in.

`PLAUSIBLE` is used by setups, channels, passages, wheel angles, tables and comparisons alike. The
ranges are wide: from a bicycle to a truck. What lies outside is a wrong unit, a wrong column or a
wrong grating nearly always, and every figure made of it would be wrong with it. Who is sure of such
a number lists its name in `unusual` under [log].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from tirelog.vocabulary.units import STANDARD_GRAVITY_M_S2, UNITS, canonical

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
        """Units in which a number that was taken for one in `given` is plausible: its value then.

        Without `given` the number stands in `unit`, and may be in more than the table's units.
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
    "level_to_rotation": Bounds(0.7, 1.4, "Omega^2 R", "acceleration"),
    "step_to_rotation": Bounds(0.5, 2.5, "Omega^2 R", "acceleration"),
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
    "longitudinal_force": "longitudinal_force_N",
}


def bounds_of(name: str, width_m: float | None = None, radius_m: float | None = None) -> Bounds:
    """The range of a quantity, that of a load by the size of the tire if it is known."""
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
    """How a setup says that a number is right though it is not plausible."""
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
#: degree from which on a shape of the pressure is ordinarily smaller, as one over its degree; from
#: twice that on none would be
_FINE = 7.0


def share_of_degree(n: int) -> float:
    """The ordinary size of a form's shape of degree n, over that of coarse ones."""
    return min(1.0, _FINE / n)
