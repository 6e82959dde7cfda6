"""Source units to SI for a channel of the setup.

P1 (1) for gratings, the table of `units` for the rest.

Every conversion is linear in the channel's own sample, so a run keeps the source's exact counts
beside a factor and an offset; the temperature term of P1 (1) is the one that needs a second
channel, and is subtracted where samples are read.
"""

from __future__ import annotations

from tirelog.data.setup import ChannelSetup
from tirelog.vocabulary import units
from tirelog.vocabulary.kinds import KINDS, WAVELENGTH_KINDS


def scaled_to_si(channel: ChannelSetup) -> tuple[float, float]:
    """(factor, offset): SI value = factor x source value + offset.

    fbg_strain: strain_gain (lambda - lambda_0) / lambda_0 (P1 (1), without its thermal term).
    fbg_temperature: T - T_0 = (lambda - lambda_0) / temperature_sensitivity, in K (P2 section 2).
    """
    factor, offset = units.to_si(channel.source_unit, *KINDS[channel.kind].quantities)
    if channel.kind not in WAVELENGTH_KINDS:
        return factor, offset
    to_nm = factor * 1e9
    reference = channel.reference_wavelength_nm
    assert reference is not None  # the setup has refused a grating without it
    if channel.kind == "fbg_strain":
        return channel.strain_gain * to_nm / reference, -channel.strain_gain
    return (
        to_nm / channel.temperature_sensitivity_nm_K,
        -reference / channel.temperature_sensitivity_nm_K,
    )
