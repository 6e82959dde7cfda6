"""What a tire's setup and log can be: the one check that every command makes before it says
anything.

    key of a setup, its number --`doubt_of_key`--> '' or why it is no tire's, with the probable unit
    Recording --`check`--> SetupError where a channel cannot be what its setup says; remarks where
    it is only strange

The bounds are wide: from a child's bicycle to an earth mover and an aircraft's main wheel. What
lies outside is a wrong unit, a wrong column or a wrong grating nearly always, and every figure made
of it would be wrong with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from tirelog.data.recording import Channel, Recording
from tirelog.errors import SetupError
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.units import STANDARD_GRAVITY_M_S2


@dataclass(frozen=True)
class Bounds:
    """From `low` to `high` in SI; `units`: what else the number may have been given in, factor to
    SI by name.
    """

    low: float
    high: float
    units: Mapping[str, float]

    def holds(self, value: float) -> bool:
        return self.low <= value <= self.high

    def probable(self, value: float) -> str:
        """`; 2.2 bar would be 220000` for each other unit in which the value lies inside the
        bounds, or ''.
        """
        fits = [
            f"{value:g} {name} would be {value * factor:g}"
            for name, factor in self.units.items()
            if self.holds(value * factor)
        ]
        return f"; {' or '.join(fits)}" if fits else ""


_LENGTHS = {"mm": 1e-3, "cm": 1e-2, "in": 0.0254}
#: inflation pressure above the air's [Pa]: sand and farm tires 0.3 bar, bicycles 12 bar, aircraft
#: 17 bar.  Twice as wide on both sides would let MPa pass for bar
PRESSURE = Bounds(2e4, 2e6, {"bar": 1e5, "psi": 6894.757, "kPa": 1e3, "MPa": 1e6, "hPa": 1e2})
#: wheel load [N]: a child's bicycle 100 N, trucks 50 kN, aircraft 300 kN, the largest earth movers
#: 1 MN.  Twice as low would not find more mistakes of a unit: kN and tonnes lie a factor of 100
#: away
LOAD = Bounds(10.0, 1e6, {"kN": 1e3, "kg": STANDARD_GRAVITY_M_S2, "t": 1e3 * STANDARD_GRAVITY_M_S2})
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
#: a grating's median wavelength against its reference: 2 % are 31 nm at 1550 nm, or 25,000
#: microstrain, or 3,000 K.  Gratings of one fibre lie 5 to 40 nm apart, so twice as much would let
#: a neighbour pass for it
WAVELENGTH_SHARE = 0.02
#: median strain that is said, and that is refused: silica breaks at 5 %, strips on rubber read 10 %
#: at most; a tire's own is below 0.3 %
STRANGE_STRAIN, MOST_STRAIN = 0.01, 0.1
#: speed of a vehicle [m/s]: aircraft take off at 100
FASTEST_M_S = 150.0
#: a channel is judged by so many of its samples, in so many pieces from all over the log
LOOKED_AT, PIECES = 4096, 8


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


def check(recording: Recording) -> Recording:
    """`recording` with a remark on what is strange in it.

    SetupError: a channel cannot be what its setup says.
    """
    # twins first: what a wrong one reads is in the compensated strain of the others
    channels = sorted(
        recording.channels.values(), key=lambda channel: channel.kind != "fbg_temperature"
    )
    remarks = [said for channel in channels if (said := _doubt(recording, channel))]
    return replace(recording, remarks=(*recording.remarks, *remarks)) if remarks else recording


def _doubt(recording: Recording, channel: Channel) -> str:
    """'' or a remark on one channel.  SetupError where its values are out of the question."""
    judge = {
        "fbg_strain": _of_grating,
        "fbg_temperature": _of_grating,
        "strain": _of_strain,
        "inflation_pressure": _of_pressure,
        "vertical_load": _of_load,
        "vehicle_speed": _of_speed,
    }.get(channel.kind)
    some = _some(channel) if judge is not None else np.zeros(0)
    return judge(recording, channel, some) if judge is not None and some.size else ""


def _some(channel: Channel) -> FloatArray:
    """Samples from all over the channel that are not lost."""
    size = min(max(LOOKED_AT // PIECES, 1), channel.size)
    starts = np.unique(
        np.linspace(0, max(channel.size - size, 0), PIECES).astype(np.int64)
    ).tolist()
    some = (
        np.concatenate([channel.read(start, start + size) for start in starts])
        if channel.size
        else np.zeros(0)
    )
    known: FloatArray = some[np.isfinite(some)]
    return known


def _refused(recording: Recording, channel: Channel, what: str, do: str) -> SetupError:
    return SetupError(f"channel {channel.name}: {what}; {do}", file=recording.log)


def _of_grating(recording: Recording, channel: Channel, some: FloatArray) -> str:
    setup = recording.setup.channels[channel.name]
    reference, middle = setup.reference_wavelength_nm, float(np.median(some))
    gain = (
        setup.strain_gain
        if channel.kind == "fbg_strain"
        else reference / setup.temperature_sensitivity_nm_K
    )
    share = middle / gain
    if abs(share) > WAVELENGTH_SHARE:
        wavelength = reference * (1.0 + share)
        factors = {"pm": 1e-3, "nm": 1.0, "um": 1e3, "mm": 1e6, "m": 1e9}
        raw = wavelength / factors.get(setup.source_unit, 1.0)
        fits = [
            unit
            for unit, factor in factors.items()
            if abs(raw * factor / reference - 1.0) <= WAVELENGTH_SHARE
        ]
        hint = (
            f'is the unit {fits[0]}? write unit = "{fits[0]}"'
            if fits
            else "name the grating's own column, or mend reference_wavelength_nm"
        )
        raise _refused(
            recording,
            channel,
            f"wavelengths of {wavelength:.6g} nm (median) against reference_wavelength_nm = "
            f"{reference:g}",
            f"allowed is {100 * WAVELENGTH_SHARE:g} % off; {hint} in the setup",
        )
    return _of_strain(recording, channel, some) if channel.kind == "fbg_strain" else ""


def _of_strain(recording: Recording, channel: Channel, some: FloatArray) -> str:
    middle = float(np.median(some))
    if abs(middle) > MOST_STRAIN:
        raise _refused(
            recording,
            channel,
            f"a median strain of {middle:.4g}",
            f"allowed is {MOST_STRAIN:g} (a number, no microstrain); is the unit microstrain? "
            'write unit = "microstrain"',
        )
    if abs(middle) > STRANGE_STRAIN:
        return (
            f"{channel.name}: a median strain of {1e6 * middle:.0f} microstrain, and a tire's "
            f"stays below {1e6 * STRANGE_STRAIN:.0f}; "
            "check unit and reference"
        )
    return ""


def _of_pressure(recording: Recording, channel: Channel, some: FloatArray) -> str:
    middle, most = float(np.median(some)), float(np.abs(some).max())
    if most == 0.0:
        return f"{channel.name}: the pressure reads 0 throughout"
    if PRESSURE.holds(middle) or (
        middle < PRESSURE.low <= most <= PRESSURE.high
    ):  # an inflation test begins at nothing
        return ""
    return _outside(recording, channel, middle, PRESSURE, "Pa")


def _of_load(recording: Recording, channel: Channel, some: FloatArray) -> str:
    middle, most = float(np.median(some)), float(np.abs(some).max())
    if most == 0.0:
        return f"{channel.name}: the load reads 0 throughout"
    if middle < 0.0:
        return (
            f"{channel.name}: a median load of {middle:.4g} N; positive is the tire pressed on "
            "the road; check the sign"
        )
    if LOAD.low <= most and middle <= LOAD.high:  # a wheel in the air carries nothing
        return ""
    return _outside(recording, channel, middle, LOAD, "N")


def _of_speed(recording: Recording, channel: Channel, some: FloatArray) -> str:
    middle = float(np.median(some))
    if middle > FASTEST_M_S:
        raise _refused(
            recording,
            channel,
            f"a median speed of {middle:.4g} m/s",
            f'allowed is {FASTEST_M_S:g}; is the unit km/h? write unit = "km/h"',
        )
    return (
        f"{channel.name}: a median speed of {middle:.4g} m/s; positive is forwards; check the sign"
        if middle < 0.0
        else ""
    )


def _outside(
    recording: Recording, channel: Channel, middle: float, bounds: Bounds, unit: str
) -> str:
    raise _refused(
        recording,
        channel,
        f"a median of {middle:.4g} {unit}",
        f"allowed for a tire is {bounds.low:g} to {bounds.high:g}{bounds.probable(middle)}; "
        "mend unit or source in the setup",
    )
