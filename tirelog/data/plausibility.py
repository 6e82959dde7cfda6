"""What a log can be: the one check that every command makes before it says anything.

    Recording
        --`check_recording`--> SetupError if a channel cannot be what its setup says;
                               remarks if it is only strange

What a setup can say is judged by `bounds`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tirelog.data.bounds import FASTEST_HZ, LOAD, PRESSURE, Bounds
from tirelog.data.recording import Channel, Recording
from tirelog.errors import SetupError
from tirelog.vocabulary.arrays import FloatArray

#: a grating's median wavelength against its reference: 2 % are 31 nm at 1550 nm, or 25,000
#: microstrain, or 3,000 K.  Gratings of one fibre lie 5 to 40 nm apart, so twice as much would let
#: a neighbour pass for it
WAVELENGTH_SHARE = 0.02
#: median strain that is said, and that is refused: silica breaks at 5 %, strips on rubber read
#: 10 % at most; a tire's own is below 0.3 %; twice the first leaves a wrong unit of up to seven
#: times unsaid
STRANGE_STRAIN, MOST_STRAIN = 0.01, 0.1
#: speed of a vehicle [m/s]: aircraft take off at 100; twice as much lets speeds of 160 to 300 km/h
#: pass that are written without their unit
FASTEST_M_S = 150.0
#: a channel is judged by so many of its samples, in so many pieces from all over the log; twice as
#: many look twice as long at the head of every command
LOOKED_AT, PIECES = 4096, 8


def check_recording(recording: Recording) -> Recording:
    """`recording` with a remark on what is strange in it.

    SetupError: a channel cannot be what its setup says.
    """
    # twins first: what a wrong one reads is in the compensated strain of the others
    channels = sorted(
        recording.channels.values(), key=lambda channel: channel.kind != "fbg_temperature"
    )
    remarks = [said for channel in channels if (said := _doubt(recording, channel))]
    fastest = max((channel.axis.rate_Hz for channel in channels), default=0.0)
    if fastest > FASTEST_HZ:
        remarks.append(
            f"a sampling rate of {fastest:.4g} Hz, and no instrument on a tire is as fast as "
            f"{FASTEST_HZ:g}; check time_unit and sampling_rate_Hz under [log]"
        )
    return replace(recording, remarks=(*recording.remarks, *remarks)) if remarks else recording


def _doubt(recording: Recording, channel: Channel) -> str:
    """'' or a remark on one channel.  SetupError if its values are out of the question."""
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
    return SetupError(f"channel {channel.name}: {what}", do=f"{do}", file=recording.log)


def _of_grating(recording: Recording, channel: Channel, some: FloatArray) -> str:
    setup = recording.setup.channels[channel.name]
    reference, middle = setup.reference_wavelength_nm, float(np.median(some))
    if reference is None:  # a setup that was read has one for each grating
        return ""
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
            f"stays below {1e6 * STRANGE_STRAIN:.0f}; check unit and reference"
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
