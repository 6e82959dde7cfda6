"""Strain that no load on the carcass makes (effects outside the catalogue).

And what a sensor does to a waveform.

Waveforms and their transforms are (b, points) and (b, points/2 + 1); b instants of the drive.
"""

from __future__ import annotations

import numpy as np

from tirelog.simulation.scenario.planted import Planted
from tirelog.simulation.scenario.schema import Scenario
from tirelog.simulation.steady.loads import REFERENCE_SPEED_M_S, Instants
from tirelog.simulation.steady.operators import ComplexArray, Ring
from tirelog.vocabulary.arrays import FloatArray

#: slower than this, time behind the patch counts as at this speed [m/s] (a ring-down at standstill
#: has no meaning)
SLOWEST_M_S = 0.2


def _ring_down(effect: Planted, ring: Ring, at: Instants, exit_m: FloatArray) -> FloatArray:
    """A resonance set off by the exit edge: fixed frequency in time, decaying behind the patch."""
    late = (
        (ring.xi_m - exit_m[:, None])
        % ring.circumference_m
        / np.maximum(at.speed / at.stretch, SLOWEST_M_S)[:, None]
    )
    swing = np.exp(-late / effect["decay_s"]) * np.sin(2.0 * np.pi * effect["frequency_Hz"] * late)
    return swing * _faded(ring, exit_m)


def _faded(ring: Ring, exit_m: FloatArray) -> FloatArray:
    """One behind the exit, smoothly zero over the last third of the turn.

    At its end the angle starts anew.
    """
    share = (ring.xi_m - exit_m[:, None]) % ring.circumference_m / ring.circumference_m
    return 0.5 + 0.5 * np.cos(np.pi * np.clip((share - 0.6) / 0.3, 0.0, 1.0))


def _splice(effect: Planted, ring: Ring, behind_rad: float) -> FloatArray:
    """The carcass's splice, once a turn at a fixed angle from the first sensor.

    A sensor that stands `behind_rad` behind the first sees it so much earlier.
    """
    place = np.radians(effect["angle_deg"]) - behind_rad
    off = np.angle(np.exp(1j * (2.0 * np.pi * ring.xi_m / ring.circumference_m - place)))
    bump: FloatArray = np.exp(-0.5 * (off / np.radians(effect["width_deg"])) ** 2)[None, :]
    return bump


def _torsion(effect: Planted, ring: Ring, at: Instants, exit_m: FloatArray) -> FloatArray:
    """Odd about the patch centre, fixed to the road."""
    u = ring.xi_m / effect["width_m"]
    return (u * np.exp(0.5 - 0.5 * u**2))[None, :]


def _standing_wave(effect: Planted, ring: Ring, at: Instants, exit_m: FloatArray) -> FloatArray:
    """A wave behind the exit, fixed to the road, of a wavelength along the tread."""
    behind = (ring.xi_m - exit_m[:, None]) % ring.circumference_m
    wave = np.exp(-behind / effect["decay_m"]) * np.sin(
        2.0 * np.pi * behind / effect["wavelength_m"]
    )
    return wave * _faded(ring, exit_m)


def _even_bulge(effect: Planted, ring: Ring, at: Instants, exit_m: FloatArray) -> FloatArray:
    """Even and far: both flanks rise together."""
    u = np.abs(ring.xi_m) / effect["width_m"]
    return (u**2 * np.exp(1.0 - u**2))[None, :]


#: what is fixed to the tire, so that each sensor sees it from its own place
_OF_TIRE = "splice"
_EXTRA = {
    "ring_down": _ring_down,
    "torsion": _torsion,
    "standing_wave": _standing_wave,
    "even_bulge": _even_bulge,
}


def extra_strain(
    ring: Ring, scenario: Scenario, at: Instants, exit_m: FloatArray, behind_rad: float = 0.0
) -> FloatArray | None:
    """The sum of the planted strains (b, points), each amplitude (v/20)^n.

    None if none is planted. `behind_rad`: the sensor's place behind the first sensor's.
    """
    total: FloatArray | None = None
    for effect in scenario.effects:
        if effect.name in _EXTRA or effect.name == _OF_TIRE:
            size = (
                effect["amplitude"]
                * (np.maximum(at.speed, 1e-6) / REFERENCE_SPEED_M_S) ** effect["speed_exponent"]
            )
            form = (
                _splice(effect, ring, behind_rad)
                if effect.name == _OF_TIRE
                else _EXTRA[effect.name](effect, ring, at, exit_m)
            )
            shape = size[:, None] * form
            total = shape if total is None else total + shape
    return total


def seen_by(
    ring: Ring,
    spectrum: ComplexArray,
    speed: FloatArray,
    gauge: Planted | float | None,
    lag: Planted | float | None,
    bandwidth_Hz: float | None,
) -> ComplexArray:
    """`spectrum` (b, m) as the sensor passes it on.

    Averaged over the gauge, late by the lag, within its bandwidth.

    In the road's frame a lag of tau is a length c tau, so that (1 + c tau d/dxi) s = strain: exact
    at constant speed. The bandwidth is a second-order magnitude without delay (a delay is
    `delay_s`).
    """
    if gauge is not None:
        spectrum = spectrum * _averaged(ring, gauge)
    first = ring.derivatives[1]
    if lag is not None:
        tau = lag["lag_s"] if isinstance(lag, Planted) else lag
        length = np.maximum(speed, 0.0)[:, None] * tau
        if isinstance(lag, Planted) and lag.other:
            spectrum = spectrum / (1.0 + 0.5 * length * first) ** 2
        else:
            spectrum = spectrum / (1.0 + length * first)
    if bandwidth_Hz is not None:
        frequency = speed[:, None] * np.abs(first) / (2.0 * np.pi)
        spectrum = spectrum / np.sqrt(1.0 + (frequency / bandwidth_Hz) ** 4)
    return spectrum


def _averaged(ring: Ring, gauge: Planted | float) -> ComplexArray:
    """Transform of the mean over the gauge length.

    other: a sensitivity that falls towards the ends, of equal variance.
    """
    length = gauge["length_m"] if isinstance(gauge, Planted) else gauge
    if isinstance(gauge, Planted) and gauge.other:
        width = max(length / np.sqrt(12.0), 0.3 * ring.step_m)
        return ring.kernel(np.exp(-0.5 * (ring.xi_m / width) ** 2))
    # the box's ends fall between the points: exact shares of the cells
    primitive = np.clip(ring.borders_m, -0.5 * length, 0.5 * length)
    return ring.kernel(np.diff(primitive))
