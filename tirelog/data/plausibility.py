"""What a log can be: the one check that every command makes before it says anything.

    Recording
        --`check_recording`--> SetupError if a channel cannot be what its setup says
    a number that an estimator made of a channel
        --`implausible`------> the error to raise, or to say beside the rows; None

The ranges are those of `bounds`, whose override a setup may name.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tirelog.data.recording import Channel, Recording
from tirelog.data.setup import OF_KIND, PLAUSIBLE, ChannelSetup, bounds_of, override
from tirelog.errors import SetupError
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.kinds import WAVELENGTH_KINDS
from tirelog.vocabulary.units import UNITS

#: kinds that begin at nothing, and that are dead if they stay there
_NEVER_ZERO = ("inflation_pressure", "vertical_load")


def check_recording(recording: Recording) -> Recording:
    """The recording with a remark on each implausible quantity.

    SetupError: a channel cannot be what its setup says.
    """
    # twins first: what a wrong one reads is in the compensated strain of the others
    channels = sorted(
        recording.channels.values(), key=lambda channel: channel.kind != "fbg_temperature"
    )
    remarks = []
    for channel in channels:
        some = _some(channel) if channel.kind in (*OF_KIND, *WAVELENGTH_KINDS) else np.zeros(0)
        fast = channel.axis.rate_Hz > PLAUSIBLE["sampling_rate_Hz"].high
        problem = doubt_of_rate(recording, channel) if fast else None
        if problem := problem or _doubt(recording, channel, some):
            raise problem
        if some.size and channel.kind in _NEVER_ZERO and not some.any():
            remarks.append(f"{channel.name}: {channel.kind} reads 0 throughout")
        if channel.kind == "wheel_encoder" and channel.size:
            remarks += _end_of_teeth(recording, channel)
    return replace(recording, remarks=(*recording.remarks, *remarks)) if remarks else recording


def implausible(
    recording: Recording,
    name: str,
    value: float,
    what: str,
    *,
    channel: Channel | None = None,
    do: str = "",
) -> SetupError | None:
    """The error of a number outside its plausible range; None if it is inside.

    name, value   the quantity of `PLAUSIBLE` and its number
    what          the number in a sentence
    channel       whose unit in the setup may be wrong
    do            what else may be wrong
    """
    tire, setup = recording.setup.tire, recording.setup
    bounds = bounds_of(name, tire.width_m, tire.unloaded_radius_m)
    if bounds.holds(value) or name in (setup.log.unusual or ()):
        return None
    advice = do or "mend unit or source in the setup"
    if channel is not None:
        what = f"channel {channel.name}: {what}"
        units = bounds.units(value, _setup_of(recording, channel).source_unit)
        if units:
            words = " or ".join(f'unit = "{unit}"' for unit in units)
            advice = f"is the unit {' or '.join(units)}? write {words} in the setup"
        elif bounds.holds(-value):
            scale = -_setup_of(recording, channel).scaling[0]
            advice = f"is the sign inverted? write scale = {scale:g} in the setup"
    return SetupError(
        what, allowed=f"allowed is {bounds}", do=f"{advice}; {override(name)}", file=recording.log
    )


def doubt_of_rate(
    recording: Recording, channel: Channel, speed_m_s: float | None = None
) -> SetupError | None:
    """The error of a sampling rate or speed by a wrong unit of time."""
    log, rate = recording.setup.log, channel.axis.rate_Hz
    now = UNITS.get(log.time_unit or "s", ("time", 1.0, 0.0))[1]
    rates, speeds = PLAUSIBLE["sampling_rate_Hz"], PLAUSIBLE["speed_m_s"]
    fits = [
        unit
        for unit, (quantity, factor, _) in UNITS.items()
        if quantity == "time"
        and rates.holds(rate * now / factor)
        and (speed_m_s is None or speeds.holds(speed_m_s * now / factor))
    ]
    declared = _setup_of(recording, channel).sampling_rate_Hz or log.sampling_rate_Hz
    do = "check time_unit and sampling_rate_Hz under [log]"
    if declared is not None:
        do = f"the setup says sampling_rate_Hz = {declared:g}: mend it"
    elif fits:
        words = " or ".join(f'time_unit = "{unit}"' for unit in fits)
        do = f"are the stamps in {' or '.join(fits)}? write {words} under [log]"
    name, value = "sampling_rate_Hz", rate
    what = f"channel {channel.name}: a sampling rate of {rate:.4g} Hz"
    if speed_m_s is not None:
        what += f", and the wheel at {speed_m_s:.3g} m/s"
        if rates.holds(rate):
            name, value = "speed_m_s", speed_m_s
    return implausible(recording, name, value, what, do=do)


def doubt_of_vehicle(
    recording: Recording, reference: Channel, radius_m: float
) -> SetupError | None:
    """The error of a vehicle's speed that contradicts the setup's radius.

    `radius_m`: the vehicle's speed over the wheel's, of turns that roll freely.
    """
    tire = recording.setup.tire
    which = "unloaded" if tire.rolling_radius_m is None else "rolling"
    ratio = radius_m / tire.radius_m
    # a vehicle's speed over the wheel's below which the vehicle is at rest, on a drum; units make
    # 0.1
    if which == "rolling" and abs(ratio) < 0.03:
        return None
    what = (
        f"its speed over the wheel's gives a rolling radius of {radius_m:.4g} m, {ratio:.3g} times "
        f"the {which} radius of the setup, {tire.radius_m:.4g} m"
    )
    do = f"check the radius, the sampling rate or steps, unit and source of {reference.name}"
    return implausible(recording, f"vehicle_to_{which}", ratio, what, channel=reference, do=do)


def _setup_of(recording: Recording, channel: Channel) -> ChannelSetup:
    """The setup of a channel, or the defaults of its kind."""
    return recording.setup.channels.get(channel.name, ChannelSetup(channel.kind))


def _some(channel: Channel) -> FloatArray:
    """Samples from all over the channel that are not lost."""
    # eight pieces from all over the log; twice as many look twice as long at the head of every
    # command
    size = min(512, channel.size)
    starts = np.unique(np.linspace(0, max(channel.size - size, 0), 8).astype(np.int64)).tolist()
    some = (
        np.concatenate([channel.read(start, start + size) for start in starts])
        if channel.size
        else np.zeros(0)
    )
    return np.asarray(some[np.isfinite(some)], np.float64)


def _end_of_teeth(recording: Recording, encoder: Channel) -> list[str]:
    """What to say of an encoder whose signal ends, or stops to move, before its log.

    In each second it is held against the one with the largest swing of nine. A wheel at rest
    has no teeth either.
    """
    size = max(int(encoder.axis.rate_Hz), 1)
    starts = np.linspace(0, max(encoder.size - size, 0), 9).astype(np.int64).tolist()
    # a tenth: the noise of a cable that is broken is less, a slow wheel's teeth are more
    least = 0.1 * max(_swing(encoder, start, size) for start in starts)
    seconds = range(encoder.size, size, -size)
    last = next((at for at in seconds if _swing(encoder, at - size, size) > least), size)
    own_s = float(encoder.axis.at(float(last)))
    channels = recording.channels.values()
    end_s = max(float(one.axis.at(float(one.size))) for one in channels if one.size)
    # a tenth of the log, and more than the second that is looked at
    if last <= size or end_s - own_s < max(2.0, 0.1 * end_s):
        return []
    return [
        f"{encoder.name}: no teeth from about {own_s:.3g} s on, and the log lasts {end_s:.4g} s; "
        "rows end there: the wheel is at rest, or the encoder was lost"
    ]


def _swing(channel: Channel, start: int, size: int) -> float:
    """How far a channel moves within so many samples, without the outermost hundredths.

    The less of both halves: a counter that begins anew is far off in one of them.
    """
    halves = np.array_split(channel.read(start, start + size), 2)
    known = [half[np.isfinite(half)] for half in halves]
    return min(float(np.ptp(np.quantile(x, [0.01, 0.99]))) if x.size else 0.0 for x in known)


def _doubt(recording: Recording, channel: Channel, some: FloatArray) -> SetupError | None:
    """The error of the median of some samples of a channel, None if it is plausible."""
    if not some.size:
        return None
    setup, tire = _setup_of(recording, channel), recording.setup.tire
    middle, most = float(np.median(some)), float(np.abs(some).max())
    name, do, problem = OF_KIND.get(channel.kind, ""), "", None
    if setup.reference_wavelength_nm is not None and channel.kind in WAVELENGTH_KINDS:
        reference = setup.reference_wavelength_nm
        of_strain = channel.kind == "fbg_strain"
        gain = setup.strain_gain if of_strain else reference / setup.temperature_sensitivity_nm_K
        do = "name the grating's own column, or mend reference_wavelength_nm"
        what = (
            f"wavelengths of {reference * (1.0 + middle / gain):.6g} nm (median) against "
            f"reference_wavelength_nm = {reference:g}"
        )
        share = 1.0 + middle / gain
        problem = implausible(recording, "wavelength", share, what, channel=channel, do=do)
        if not of_strain:
            return problem
    elif channel.kind in _NEVER_ZERO and middle >= 0.0:
        # an inflation test begins at nothing, and a wheel in the air carries nothing
        low = bounds_of(name, tire.width_m, tire.unloaded_radius_m).low
        middle = most if middle < low else middle
        if most == 0.0:
            return None
    what = f"a median of {middle:.4g} {channel.unit or 'strain'}"
    return problem or implausible(recording, name, middle, what, channel=channel, do=do)
