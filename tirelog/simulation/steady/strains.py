"""Strain that no load on the carcass makes (effects outside the catalogue).

And what a sensor does to a waveform.

Waveforms and their transforms are (b, points) and (b, points/2 + 1); b instants of the drive.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tirelog.simulation.scenario.schema import Planted, Scenario
from tirelog.simulation.steady.loads import REFERENCE_SPEED_M_S, Instants
from tirelog.simulation.steady.operators import ComplexArray, Ring
from tirelog.vocabulary.arrays import FloatArray

#: slower than this, time behind the patch counts as at this speed [m/s] (a ring-down at standstill
#: has no meaning)
SLOWEST_M_S = 0.2
#: absolute temperature at which a log begins [K]: the speed of sound goes with its root
ROOM_K = 293.0
#: damping of a filter that rings, as a share of the critical one (lag "apart")
_RINGING = 0.25
#: diameter of a fibre [m], and the strain with which it is drawn when it is glued at its ends
_FIBRE_M, _DRAWN = 1.25e-4, 6.0e-4


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
    return np.asarray(np.exp(-0.5 * (off / np.radians(effect["width_deg"])) ** 2)[None, :])


def _torsion(effect: Planted, ring: Ring, at: Instants, exit_m: FloatArray) -> FloatArray:
    """Odd about the patch centre, fixed to the road."""
    u = ring.xi_m / effect["width_m"]
    return (u * np.exp(0.5 - 0.5 * u**2))[None, :]


def _standing_wave(effect: Planted, ring: Ring, at: Instants, exit_m: FloatArray) -> FloatArray:
    """A wave behind the exit, fixed to the road, of a wavelength along the tread.

    apart: one that builds up first, as near the critical speed, where it travels as fast as it is
    fed, and that begins with its crest.
    """
    behind = (ring.xi_m - exit_m[:, None]) % ring.circumference_m
    if effect.apart:
        swell = 2.0 * behind / effect["decay_m"]
        wave = swell * np.exp(1.0 - swell) * np.cos(2.0 * np.pi * behind / effect["wavelength_m"])
        return wave * _faded(ring, exit_m)
    wave = np.exp(-behind / effect["decay_m"]) * np.sin(
        2.0 * np.pi * behind / effect["wavelength_m"]
    )
    return wave * _faded(ring, exit_m)


def _cavity(effect: Planted, ring: Ring, at: Instants, exit_m: FloatArray) -> FloatArray:
    """The tire's air, struck at the entry; apart: two modes, as a turning tire hears them.

    Forwards and backwards around the cavity, f +- Omega / 2 pi.
    """
    entry_m = exit_m - 2.0 * at.half_length
    speed = np.maximum(at.speed / at.stretch, SLOWEST_M_S)
    late = (ring.xi_m - entry_m[:, None]) % ring.circumference_m / speed[:, None]
    warm = np.sqrt(1.0 + at.temperature_K / ROOM_K)[:, None]
    swing = np.exp(-late / effect["decay_s"]) * np.sin(
        2.0 * np.pi * effect["frequency_Hz"] * warm * late
    )
    if effect.apart:
        swing = swing * np.cos(2.0 * np.pi * speed[:, None] / ring.circumference_m * late)
    return swing * _faded(ring, entry_m)


def _pitch(effect: Planted, ring: Ring, at: Instants, exit_m: FloatArray) -> FloatArray:
    """Bending between the blocks, as the parabola of the pressure above; apart: see `World`."""
    if effect.apart:
        return np.zeros((1, ring.points))
    x = ring.xi_m / at.half_length[:, None]
    pressure = 0.75 * at.load / at.half_length
    return pressure[:, None] * np.maximum(1.0 - x**2, 0.0)


def _even_bulge(effect: Planted, ring: Ring, at: Instants, exit_m: FloatArray) -> FloatArray:
    """Even and far: both flanks rise together."""
    u = np.abs(ring.xi_m) / effect["width_m"]
    return (u**2 * np.exp(1.0 - u**2))[None, :]


#: power of the speed of what has none among its parameters
_POWERS = {"cavity_resonance": 1.0}
#: what is fixed to the tire, so that each sensor sees it from its own place
_OF_TIRE = "splice"
_EXTRA = {
    "ring_down": _ring_down,
    "torsion": _torsion,
    "standing_wave": _standing_wave,
    "even_bulge": _even_bulge,
    "cavity_resonance": _cavity,
    "tread_pitch": _pitch,
}


def extra_strain(
    ring: Ring, scenario: Scenario, at: Instants, exit_m: FloatArray, behind_rad: float = 0.0
) -> FloatArray | None:
    """The sum of the planted strains (b, points), each its first parameter times (v/20)^n.

    None if none is planted. `behind_rad`: the sensor's place behind the first sensor's.
    """
    total: FloatArray | None = None
    for effect in scenario.effects:
        if effect.name in _EXTRA or effect.name == _OF_TIRE:
            power = effect.parameters.get("speed_exponent", _POWERS.get(effect.name, 0.0))
            size = (
                effect.parameters[next(iter(effect.parameters))]
                * (np.maximum(at.speed, 1e-6) / REFERENCE_SPEED_M_S) ** power
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

    Averaged over the gauge (apart: and slack in compression), late by the lag, within its
    bandwidth.

    In the road's frame a lag of tau is a length c tau, so that (1 + c tau d/dxi) s = strain: exact
    at constant speed. The bandwidth is a second-order magnitude without delay (a delay is
    `delay_s`).
    """
    if gauge is not None:
        spectrum = spectrum * _averaged(ring, gauge)
        if isinstance(gauge, Planted) and gauge.apart:
            spectrum = ring.transform(_slack(ring.inverse(spectrum), gauge["length_m"]))
    first = ring.derivatives[1]
    if lag is not None:
        tau = lag["lag_s"] if isinstance(lag, Planted) else lag
        length = np.maximum(speed, 0.0)[:, None] * tau
        spectrum = spectrum / delaying(lag, length * first)
    if bandwidth_Hz is not None:
        frequency = speed[:, None] * np.abs(first) / (2.0 * np.pi)
        spectrum = spectrum / np.sqrt(1.0 + (frequency / bandwidth_Hz) ** 4)
    return spectrum


def delaying(lag: Planted | float, late: Any) -> Any:
    """What a lag divides a wave by, at i omega tau = `late`: 1 + late; other: of two in a row.

    apart: of an underdamped second-order filter, which is as late at low frequencies and rings.
    """
    if isinstance(lag, Planted) and lag.other:
        return (1.0 + 0.5 * late) ** 2
    if isinstance(lag, Planted) and lag.apart:
        return 1.0 + late + (late / (2.0 * _RINGING)) ** 2
    return 1.0 + late


def _slack(strain: FloatArray, length_m: float) -> FloatArray:
    """What a fibre that is glued at its ends alone reads: it buckles under compression.

    Euler's load of a clamped rod, at a strain of (2 pi r / length)^2 with r = d / 4, beyond the
    strain with which it was drawn.
    """
    least = _DRAWN + (0.5 * np.pi * _FIBRE_M / max(length_m, 1e-4)) ** 2
    return np.maximum(strain, -least)


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
