"""Effects on the waveform: warming, the sensor, waves beside the patch, and the tire's own form.

Their order here is that of the catalogue.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from scipy.special import eval_legendre

from tirelog.data.setup import (
    FORM_BELLS,
    FORM_DEGREES,
    FORM_PRESSURE,
    FORM_STIFFNESS,
    FORM_WAVES,
    share_of_degree,
)
from tirelog.physics.effects.base import (
    CATALOGUE_G_M_S2,
    ROOM_K,
    Drive,
    Site,
    Structure,
    effect,
    number,
)
from tirelog.physics.spectral import MODES, ComplexArray, Parameter
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import computed_from


def warmth(drive: Drive, time_constant_s: float, driver: str) -> FloatArray:
    """T - T_0 [K] if the option `driver` is temperature, else 1 - exp(-t / tau)."""
    if driver == "temperature":
        return drive.temperature_K
    return -np.expm1(-drive.time_s / time_constant_s)


def _warm_foundation(
    drive: Drive, *, stiffness: float, time_constant_s: float, driver: str
) -> Structure:
    """The foundation's relative change as the tire warms."""
    return Structure(stiffening=stiffness * warmth(drive, time_constant_s, driver))


@effect(
    "baseline",
    follows=(("time_s", 1), ("temperature_K", 1)),
    needs=("time_s",),
    instead={"time_s": "temperature_K"},
    options={"driver": ("auto", "time", "temperature")},
    structure=_warm_foundation,
    drift=number(
        0.0,
        -1e-2,
        1e-2,
        "1 or 1/K",
        "a in baseline a (1 - exp(-t/tau)), or a (T - T_0)",
        probe=2e-5,
    ),
    stiffness=number(
        0.0,
        -0.9,
        0.9,
        "1 or 1/K",
        "b in k (1 + b (1 - exp(-t/tau))), or k (1 + b (T - T_0))",
        probe=-0.03,
    ),
    time_constant_s=number(30.0, 1.0, 1e5, "s", "tau"),
)
def thermal_drift(drive: Drive, *, drift: float, time_constant_s: float, driver: str) -> FloatArray:
    """Warming, first order in time or by a temperature channel: baseline strain and stiffness.

    Signature: the baseline moves once in time or with temperature, whatever the speed
    Valid: one warming from the start of the log; driver = "time" or "temperature" (auto:
        temperature where it varies)
    Source: P1 4
    """
    return drift * warmth(drive, time_constant_s, driver)


@effect(
    "transfer",
    strength=("length_m",),
    length_m=number(0.01, 0.0, 0.2, "m", "length of the grating (fixed if it is known)"),
)
def gauge_length(drive: Drive, site: Site, *, length_m: float) -> FloatArray:
    """A grating averages over its length.

    Signature: even; rounds the waveform; hardly separable from rough_contact
    Valid: lengths below the patch length
    Source: fibre Bragg gratings of finite length

    The response is even in the length: a fit must start away from zero.
    """
    return np.sinc(site.q * (length_m / (2.0 * np.pi)))[None, :]


@effect(
    "transfer",
    follows=(("speed_m_s", 1),),
    lag_s=number(0.0, 0.0, 0.05, "s", "tau in 1/(1 + i omega tau)", probe=2e-4),
)
def sensor_lag(drive: Drive, site: Site, *, lag_s: float) -> ComplexArray:
    """First-order lag or delay of interrogator or telemetry.

    Signature: the waveform comes later and its exit side is drawn out, in proportion to speed
    Valid: lags shorter than a revolution
    Source: P2 2
    """
    x = (lag_s * drive.speed_m_s) * site.q
    weight = 1.0 / (1.0 + x * x)
    transfer = np.empty(x.shape, dtype=np.complex128)
    transfer.real = weight
    np.multiply(x, -weight, out=transfer.imag)
    return transfer


@effect(
    "transfer",
    follows=(("acceleration_m_s2", 1),),
    valid_range={"tilt_rad": (-0.2, 0.2)},
    observables=("radial_acceleration",),
    tried=False,
    tilt_rad=number(
        0.0, -0.5, 0.5, "rad", "tilt of its axis towards the direction of rolling on", probe=0.05
    ),
)
def sensor_tilt(drive: Drive, site: Site, *, tilt_rad: float) -> ComplexArray:
    """An accelerometer askew in the wheel's plane: a_r + tilt a_t.

    Signature: odd about the patch centre, and gravity turned by the tilt
    Valid: tilts of some degrees; without the mean, which AC coupling takes
    Source: kinematics of a turning belt of constant length (P3 w = -dv/dtheta)

    It reads a share of the tangential acceleration. The belt turns steadily and keeps its length.
    The modes of the tangential acceleration are then -i / n of the radial ones. With R + u_r
    outwards and u_r = -u_t', a_r = omega^2 (1 - n^2) U and a_t = i omega^2 (n^2 - 1) / n U. Gravity
    and the vehicle's acceleration, which alone have n = 1, have +i.

    A diagnosis does not try it: sensor_lag and pressure_offset are odd about the patch too, and
    the cost of one more name was not measured.
    """
    n = np.arange(MODES)
    along = np.zeros((1, MODES), dtype=np.complex128)
    along[0, 1:] = -1j / n[1:]
    along[0, 1] = 1j
    return 1.0 + tilt_rad * along


@effect(
    "gain",
    follows=(("temperature_K", 1),),
    valid_range={"gain_1_K": (-0.003, 0.003)},
    needs=("temperature_K",),
    tried=False,
    gain_1_K=number(0.0, -0.02, 0.02, "1/K", "a, relative change per kelvin", probe=1e-3),
)
def warm_gain(drive: Drive, *, gain_1_K: float) -> FloatArray:
    """A sensor whose gain follows the temperature, 1 + a dT.

    Signature: the whole waveform grows or shrinks with the temperature
    Valid: the straight part of a sensor's curve
    Source: data sheets of accelerometers and gauges: 0.0001 to 0.001 per kelvin

    A diagnosis does not try it, because the lever arm takes most of it. On a drive that warms while
    it gets faster, the rest has a cosine of 0.8 with belt_tension (docs/second_forms.md).
    """
    return 1.0 + gain_1_K * drive.temperature_K


def _behind(site: Site, phi_rad: FloatArray, edge_m: FloatArray) -> FloatArray:
    """Distance behind an edge of the patch along the tread [m], from 0 to a whole turn."""
    return np.mod(phi_rad * site.radius_m - edge_m, 2.0 * np.pi * site.radius_m)


def _faded(site: Site, behind_m: FloatArray) -> FloatArray:
    """One behind an edge, falling smoothly to zero over the last third of the turn."""
    share = behind_m / (2.0 * np.pi * site.radius_m)
    return 0.5 + 0.5 * np.cos(np.pi * np.clip((share - 0.6) / 0.3, 0.0, 1.0))


@effect(
    "strain",
    follows=(("speed_m_s", 3),),
    valid_range={"wavelength_m": (0.03, 0.6)},
    tried=False,
    amplitude=number(
        0.0,
        -1e-2,
        1e-2,
        "1",
        "A in A (v/20)^n exp(-s/d) sin(2 pi s/lambda), s = xi - L",
        probe=6e-5,
    ),
    wavelength_m=number(0.16, 0.03, 0.6, "m", "lambda along the tread"),
    decay_m=number(0.2, 0.02, 2.0, "m", "d, length in which it dies away"),
    speed_exponent=number(3.0, 0.0, 8.0, "1", "n, power of the speed", free=False),
)
def standing_wave(
    drive: Drive,
    site: Site,
    phi_rad: FloatArray,
    *,
    amplitude: float,
    wavelength_m: float,
    decay_m: float,
    speed_exponent: float,
) -> FloatArray:
    """A wave behind the exit edge, fixed to the road, that grows towards critical speed.

    Signature: waves behind the exit alone, of one length along the tread at every speed
    Valid: below the critical speed; it dies away within a turn
    Source: Gardner and Worswick 1951; Soedel, J. Sound Vib. 41, 1975

    A diagnosis does not try it: its cosine with viscous_damping is 0.6 (docs/second_forms.md), and
    a wave of any length would name what `propose` describes.
    """
    late = _behind(site, phi_rad, site.half_length_m)
    size = amplitude * (drive.speed_m_s / 20.0) ** speed_exponent
    wave = np.exp(-late / decay_m) * np.sin(2.0 * np.pi * late / wavelength_m)
    return np.asarray(size * wave * _faded(site, late))


@effect(
    "strain",
    follows=(("speed_m_s", 1), ("temperature_K", 0.5)),
    valid_range={"frequency_Hz": (180.0, 260.0)},
    tried=False,
    amplitude=number(
        0.0,
        -1e-2,
        1e-2,
        "1",
        "A in A (v/20) exp(-t/T) sin(2 pi f t), t from the entry edge",
        probe=5e-5,
    ),
    frequency_Hz=number(210.0, 120.0, 350.0, "Hz", "f at 20 degC"),
    decay_s=number(0.03, 0.002, 0.5, "s", "T"),
)
def cavity_resonance(
    drive: Drive,
    site: Site,
    phi_rad: FloatArray,
    *,
    amplitude: float,
    frequency_Hz: float,
    decay_s: float,
) -> FloatArray:
    """The tire's air rings after the entry edge, f = c / (2 pi R_mean).

    Signature: ringing behind the entry of one frequency at every speed, higher when warm
    Valid: passenger tires, 180 to 260 Hz; contact splits the mode in two, of which this is one
    Source: Sakata, Morimura and Ide 1990, Thompson 1995 (Tire Science and Technology 18, 23)

    A diagnosis does not try it: it would explain any ringing of a fixed frequency, which
    `diagnose` describes and `propose` writes down.
    """
    along = _behind(site, phi_rad, -site.half_length_m)
    # slower than this the time since the entry counts as at this speed [m/s]
    late = along / np.maximum(drive.speed_m_s, 0.2)
    # the speed of sound goes with the root of the absolute temperature
    frequency = frequency_Hz * np.sqrt(1.0 + np.nan_to_num(drive.temperature_K) / ROOM_K)
    swing = np.exp(-late / decay_s) * np.sin(2.0 * np.pi * frequency * late)
    size = amplitude * (drive.speed_m_s / 20.0)
    return np.asarray(size * swing * _faded(site, along))


# ---- Effects on the phase shift and the patch width, numbers per revolution (P4 IV): terms in rad.
#
# They are linear regressors rather than mechanisms of the waveform. Their order here is that of the
# catalogue.

_BOTH = computed_from("regressors")
_PHASE = ("phase_shift",)
#: Inflation pressure [Pa] that the regressor `inflation` counts from (P4: 2.0 bar nominal).
NOMINAL_PRESSURE_PA = 2.0e5


def _angle(description: str, bound: float = 0.5) -> Parameter:
    """A number [rad] that starts at zero, of either sign."""
    return number(0.0, -bound, bound, "rad", description, probe=0.01)


@effect(
    "regressor",
    follows=(("speed_m_s", 1),),
    valid_range={"speed_m_s": (10.0, 25.0)},
    observables=_BOTH,
    # what rolling and air do to the phase shift, they do by the force
    stands_for={"phase_shift": ("longitudinal_force_N",)},
    linear_rad=_angle("a in a (v/20) + b (v/20)^2"),
    quadratic_rad=_angle("b in a (v/20) + b (v/20)^2"),
)
def speed_trend(
    drive: Drive, site: Site, observable: str, *, linear_rad: float, quadratic_rad: float
) -> FloatArray:
    """Second-order polynomial of speed: rolling resistance and aerodynamic force.

    Signature: phase shift and width follow speed in quasi-static driving
    Valid: the speeds of the ramp it was learnt on (10 to 25 m/s)
    Source: P4 IV, Fig. 9
    """
    x = drive.speed_m_s / 20.0
    return linear_rad * x + quadratic_rad * x**2


@effect(
    "regressor",
    follows=(("load_N", 1),),
    reads=("load",),
    observables=_PHASE,
    per_relative_load_rad=_angle("a in a (F / F_nominal - 1)"),
    nominal_load_N=number(3500.0, 1.0, 1e6, "N", "F_nominal", free=False),
)
def load_crosstalk(
    drive: Drive,
    site: Site,
    observable: str,
    *,
    per_relative_load_rad: float,
    nominal_load_N: float,
) -> FloatArray:
    """Phase shift that follows the vertical load.

    Signature: a phase shift on a wheel that carries no longitudinal force
    Valid: small changes of load; needs a load that varies (measured, or by load_transfer)
    Source: P4 IV (1)-(3)
    """
    return per_relative_load_rad * (site.load_N / nominal_load_N - 1.0)


@effect(
    "regressor",
    follows=(("speed_m_s", 1),),
    observables=_PHASE,
    delay_s=number(0.0, -0.1, 0.1, "s", "delay of the sensor behind the encoder", probe=1e-3),
)
def telemetry_delay(drive: Drive, site: Site, observable: str, *, delay_s: float) -> FloatArray:
    """Constant delay between encoder and radio-linked sensor, Omega x delay.

    Signature: phase shift in proportion to speed
    Valid: constant delay; not separable from the linear part of speed_trend
    Source: P4, errata
    """
    return delay_s * drive.speed_m_s / site.radius_m


@effect(
    "regressor",
    follows=(("acceleration_m_s2", 1),),
    needs=("acceleration_m_s2",),
    observables=_PHASE,
    amplitude_rad=_angle("cosine part over one tooth", 0.1),
    slope_rad=_angle("sine part over one tooth", 0.1),
    phase_per_g_rad=number(
        0.05,
        -1.0,
        1.0,
        "rad",
        "phase shift at 1 g of acceleration, that moves the patch over the teeth",
    ),
    steps=number(48.0, 1.0, 1e4, "1", "teeth of the wheel", free=False),
)
def tooth_pitch(
    drive: Drive,
    site: Site,
    observable: str,
    *,
    amplitude_rad: float,
    slope_rad: float,
    phase_per_g_rad: float,
    steps: float,
) -> FloatArray:
    """Pitch error of the tone wheel, periodic from tooth to tooth.

    Signature: a ripple on the phase shift as the force moves it over the teeth
    Valid: once the encoder's own pitch table has been taken out
    Source: P4, errata
    """
    angle = steps * (phase_per_g_rad * drive.acceleration_m_s2 / CATALOGUE_G_M_S2)
    return amplitude_rad * (np.cos(angle) - 1.0) + slope_rad * np.sin(angle)


@effect(
    "regressor",
    follows=(("inflation_pressure_Pa", 1),),
    valid_range={
        "inflation_pressure_Pa": (NOMINAL_PRESSURE_PA - 0.5e5, NOMINAL_PRESSURE_PA + 0.5e5)
    },
    needs=("inflation_pressure_Pa",),
    observables=_BOTH,
    per_relative_pressure_rad=_angle("a in a (p / 2.0 bar - 1)"),
)
def inflation(
    drive: Drive, site: Site, observable: str, *, per_relative_pressure_rad: float
) -> FloatArray:
    """A softer tire has a longer patch and winds up more.

    Signature: a step from log to log with inflation pressure
    Valid: 0.5 bar around nominal
    Source: P4 V (1.6 and 2.0 bar)
    """
    return per_relative_pressure_rad * (drive.inflation_pressure_Pa / NOMINAL_PRESSURE_PA - 1.0)


@effect(
    "regressor",
    follows=(("longitudinal_force_N", 1),),
    needs=("longitudinal_force_N",),
    observables=_PHASE,
    per_force_rad_N=number(
        0.0,
        -1e-3,
        1e-3,
        "rad/N",
        "1 / (2 pi R^2 k_v), k_v of the sidewalls against winding up",
        probe=1e-5,
    ),
)
def wind_up(drive: Drive, site: Site, observable: str, *, per_force_rad_N: float) -> FloatArray:
    """Sidewalls that the longitudinal force winds up, F_x / (2 pi R^2 k_v).

    Signature: phase shift in proportion to the measured force, also at constant speed
    Valid: a force that is measured; without one per_acceleration_rad_s2_m takes its place, and the
        drag of constant speed is in speed_trend
    Source: P4 III, errata
    """
    return per_force_rad_N * drive.longitudinal_force_N


# ---- The tire's own form: what its contact pressure and stiffness are beside the model's formulas.
#
# It follows the load and nothing else. The pressure gets F / (2 L) times a sum of shapes on the
# patch, none of which carries load. Differences of Legendre polynomials P_(n-1) - P_(n+1) vanish
# at the edges; P_0 - P_2 is the parabola. P_1 and P_2 end there in a step. Each shape has a size at
# the reference load and one that grows with the relative load beyond it. The static stiffness of
# the carcass gets a factor by the number of waves in a turn, its logarithm a sum of bells. Each
# number has a prior of mean zero: a form is learnt only as far as a log shows it.


#: degrees n of the shapes P_(n-1) - P_(n+1) beside the parabola
SMOOTH = tuple(range(2, FORM_DEGREES))
#: degrees of the shapes that end in a step at the edges
STEPS = (1, 2)
PRESSURE = (*(f"pressure_{n}" for n in SMOOTH), *(f"edge_{n}" for n in STEPS))
BY_LOAD = tuple(f"{name}_by_load" for name in PRESSURE)
STIFFNESS = tuple(f"stiffness_{i}" for i in range(1, FORM_BELLS + 1))


def _shares() -> FloatArray:
    """The coefficient (shapes, degrees) of each Legendre polynomial from P_1 on in each shape."""
    shares = np.zeros((len(PRESSURE), FORM_DEGREES))
    for row, n in enumerate(SMOOTH):
        shares[row, n - 2], shares[row, n] = 1.0, -1.0
    for row, n in enumerate(STEPS, len(SMOOTH)):
        shares[row, n - 1] = 1.0
    return shares


def _by_waves(waves: FloatArray) -> FloatArray:
    """The bells of the logarithm of the stiffness at numbers of waves in a turn, (n, 9)."""
    centres = np.linspace(np.log(FORM_WAVES[0]), np.log(FORM_WAVES[1]), FORM_BELLS)
    x = np.clip(np.log(np.maximum(waves, 1.0)), centres[0], centres[-1])
    return np.asarray(np.exp(-0.5 * ((x[:, None] - centres) / np.diff(centres)[0]) ** 2))


#: what turns a spherical Bessel function into the modes of P_1, P_2, ...: odd ones are imaginary
_TURNS = (-1j) ** np.arange(1, FORM_DEGREES + 1)
_SHARES, _BELLS = _shares(), _by_waves(np.arange(MODES, dtype=np.float64))


def pressure_shapes(u: FloatArray) -> FloatArray:
    """The shapes at xi / L (n,), in mean pressures F / (2 L), (n, shapes); zero off the patch."""
    degrees = np.arange(1, _SHARES.shape[1] + 1)
    inside = np.abs(u) <= 1.0
    shapes = eval_legendre(degrees, np.clip(u, -1.0, 1.0)[:, None]) @ _SHARES.T
    return np.where(inside[:, None], shapes, 0.0)


def _structure(drive: Drive, **numbers: float) -> Structure:
    """The factor on the stiffness by wavelength."""
    return Structure(by_waves=_BELLS @ np.array([numbers[name] for name in STIFFNESS]))


@cache
def _no_pull() -> tuple[FloatArray, FloatArray]:
    """Pressure at places of the patch per number (q, p), and that of the parabola.

    In standard deviations of a pressure below zero: the road does not pull.
    """
    # in mean pressures; with five times as much flat pressures end up 0.4 % longer
    pull, places = 0.02, 24
    u = np.cos(np.pi * (np.arange(places) + 0.5) / places)
    rows = np.zeros((places, len(PRESSURE) + len(BY_LOAD) + len(STIFFNESS)))
    rows[:, : len(PRESSURE)] = pressure_shapes(u)
    return rows / pull, 1.5 * (1.0 - u**2) / pull


def _learnt(words: str, limit: float, size: float) -> Parameter:
    """A number of a form, with a prior of mean zero and this standard deviation."""
    return number(0.0, -limit, limit, "1", words, probe=0.1, prior=(0.0, size))


def _numbers() -> dict[str, Any]:
    """A number with a prior for each shape of pressure and each bell of stiffness."""
    share = [share_of_degree(n) for n in (*SMOOTH, *STEPS)]
    pressure = {
        name: _learnt(f"pressure of the shape {name} over the mean", 3.0, FORM_PRESSURE * size)
        for name, size in zip(PRESSURE, share, strict=True)
    }
    by_load = {
        name: _learnt(f"change of {shape} per relative change of the load", 10.0, size)
        for name, shape, size in zip(BY_LOAD, PRESSURE, share, strict=True)
    }
    words = "logarithm of the stiffness over the model's"
    stiffness = {name: _learnt(words, 2.0, FORM_STIFFNESS) for name in STIFFNESS}
    return pressure | by_load | stiffness


@effect("pressure", structure=_structure, constraints=_no_pull, tried=False, **_numbers())
def form(drive: Drive, site: Site, **numbers: float) -> ComplexArray:
    """The tire's own contact pressure over the patch, and stiffness over wavelength.

    Signature: anything within the patch and beside it that follows the load alone
    Valid: what is the same at all speeds and accelerations
    Source: Legendre series of a pressure on a strip; a factor by wavelength
    """
    sizes, by_load = (np.array([numbers[n] for n in names]) for names in (PRESSURE, BY_LOAD))
    more = site.load_N / site.reference_load_N - 1.0
    shares = (sizes + more * by_load) @ _SHARES * _TURNS
    odd, even = (
        np.einsum("ck,kcm->cm", part, site.legendre[first::2])
        for first, part in enumerate((shares[:, ::2].imag, shares[:, 1::2].real))
    )
    waves: ComplexArray = even + 1j * odd
    return site.load_N / (2.0 * np.pi * site.radius_m) * waves
