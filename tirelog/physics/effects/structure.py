"""Effects on the belt and its foundation: loss, damping, tension, curvature, stretch.

Their order here is that of the catalogue.
"""

from __future__ import annotations

import numpy as np

from tirelog.physics.effects.base import ROOM_K, Drive, Structure, effect, number
from tirelog.vocabulary.arrays import FloatArray


@effect(
    "structure",
    follows=(("speed_m_s", 1),),
    damping_rate_1_s=number(0.0, 0.0, 1e4, "1/s", "omega_d in 2 mu omega_d dw/dt", probe=60.0),
)
def viscous_damping(drive: Drive, *, damping_rate_1_s: float) -> Structure:
    """Damping of the foundation, 2 mu omega_d dw/dt.

    Signature: odd about the patch centre, the exit side lags; grows in proportion to speed
    Valid: any damping below the critical speed; on a ring the radial foundation is damped
    Source: P1 (2); errata: sign of the damping term, four exact roots instead of (7)-(12)
    """
    return Structure(damping_rate=damping_rate_1_s)


@effect(
    "structure",
    valid_range={"loss_factor": (0.0, 0.5)},
    loss_factor=number(0.0, 0.0, 1.0, "1", "eta, loss factor of the foundation", probe=0.1),
)
def hysteresis(drive: Drive, *, loss_factor: float) -> Structure:
    """Rate-independent loss, k (1 + i eta sign(kappa)).

    Signature: odd about the patch centre like viscous damping, but the same at every speed
    Valid: loss factors of rubber, up to about 0.5; on a ring the radial foundation loses
    Source: P1 1, 3.2
    """
    return Structure(loss=loss_factor)


@effect(
    "structure",
    follows=(("temperature_K", 1),),
    valid_range={"loss_factor": (0.0, 0.5), "temperature_K": (-40.0, 80.0)},
    needs=("temperature_K",),
    tried=False,
    loss_factor=number(0.0, 0.0, 1.0, "1", "eta, loss factor at the reference", probe=0.1),
    fall_1_K=number(
        0.01, -0.1, 0.1, "1/K", "b, relative fall of the loss per kelvin (rubber: some 0.01)"
    ),
)
def warm_hysteresis(drive: Drive, *, loss_factor: float, fall_1_K: float) -> Structure:
    """Rate-independent loss that falls with temperature, k (1 + i eta exp(-b dT)).

    Signature: odd about the patch centre like hysteresis, weaker the warmer the tire is
    Valid: changes of temperature of some tens of kelvin, away from the glass transition
    Source: P1 1, 3.2

    A diagnosis does not try it: in a log that hardly warms it is `hysteresis`.
    """
    return Structure(loss=loss_factor * np.exp(-fall_1_K * drive.temperature_K))


@effect(
    "structure",
    follows=(("speed_m_s", 1),),
    tried=False,
    retardation_s=number(
        0.0, 0.0, 0.1, "s", "tau = eta / E of the belt's material in bending", probe=1e-4
    ),
)
def belt_viscosity(drive: Drive, *, retardation_s: float) -> Structure:
    """Viscosity of the belt in bending, EJ (1 + tau d/dt) w'''' (Kelvin-Voigt).

    Signature: odd about the patch centre and in proportion to speed, like viscous damping, with
        more of its short waves
    Valid: bending waves slower than 1 / tau
    Source: P1 (22); steady, d/dt = c d/dxi (errata)

    A diagnosis does not try it. Its change of a beam's strain, at 8 to 24 m/s, has a cosine of 0.7
    with viscous_damping and of -0.8 to -0.9 with pressure_offset. A third name for an odd part
    would make more logs ambiguous. Add it if you know the rubber.
    """
    return Structure(retardation=retardation_s)


@effect(
    "structure",
    valid_range={"length_m": (0.0, 0.03)},
    tried=False,
    strength=("length_m",),
    length_m=number(0.005, 0.0, 0.1, "m", "l = sqrt(EJ / (G A))", probe=0.01),
)
def belt_shear(drive: Drive, *, length_m: float) -> Structure:
    """A belt that yields in shear, EJ q^4 / (1 + l^2 q^2) (Timoshenko).

    Signature: even; rounds the strain and deepens the dent, more of the short waves
    Valid: l well below the patch length; rotary inertia is left out
    Source: P1 (21) with its shear term; Timoshenko's beam on Winkler's foundation

    With l^2 = EJ / (G A) the bending force EJ q^4 w becomes EJ q^4 w / (1 + l^2 q^2). The rotation
    of the cross-section bends, so the strain is y w'' / (1 + l^2 q^2). P1 drops it. A diagnosis
    does not try it: it is even as gauge_length is, and the cost of one more name was not measured.
    """
    return Structure(shear=length_m**2)


@effect(
    "baseline",
    follows=(("inflation_pressure_Pa", 1), ("temperature_K", 1)),
    needs=("inflation_pressure_Pa",),
    instead={"inflation_pressure_Pa": "temperature_K"},
    options={"driver": ("pressure", "temperature")},
    tried=False,
    strain_1_Pa=number(0.0, -1e-7, 1e-7, "1/Pa", "b R / (E A), strain per pressure", probe=1e-9),
    reference_pressure_Pa=number(
        2.2e5,
        0.0,
        2e6,
        "Pa",
        "inflation pressure at which the strain counts as none",
        probe=2.0e5,
        free=False,
    ),
)
def belt_extension(
    drive: Drive, *, strain_1_Pa: float, reference_pressure_Pa: float, driver: str
) -> FloatArray:
    """The belt's stretch under inflation, p b R / (E A).

    Signature: the whole waveform rises with the inflation pressure, the same at every speed
    Valid: a thin ring of constant width; driver = "pressure", or "temperature" where only that is
        known (gas of constant volume, from room temperature)
    Source: P2 4.1, Fig. 15 (strain grows linearly with the pressure); P1 4

    A gas of constant volume has a pressure in proportion to its temperature; 10 K off room
    temperature are 3 % of the change. A diagnosis does not try it: with one pressure per log it is
    the log's own offset.
    """
    if driver == "temperature":
        # pressure of the air [Pa], which a gauge reads as zero
        change = (reference_pressure_Pa + 1.013e5) * drive.temperature_K / ROOM_K
    else:
        change = drive.inflation_pressure_Pa - reference_pressure_Pa
    return strain_1_Pa * change


def _stretch(drive: Drive, *, stretch_s2_m2: float) -> FloatArray:
    """The belt's uniform strain by its rotation."""
    return stretch_s2_m2 * drive.speed_m_s**2


@effect(
    "structure",
    follows=(("inflation_pressure_Pa", 1), ("speed_m_s", 2)),
    baseline=_stretch,
    tension_N=number(
        0.0,
        0.0,
        2e4,
        "N",
        "T0, tension at standstill and 2.2 bar (p0 b R in P3), in proportion to the pressure",
        probe=200.0,
    ),
    tension_mass_kg_m=number(
        0.0, 0.0, 50.0, "kg/m", "m in T = T0 + m v^2 (rho A in P3)", probe=1.0
    ),
    stretch_s2_m2=number(0.0, -1e-6, 1e-6, "s^2/m^2", "a in baseline strain a v^2", probe=2e-8),
)
def belt_tension(drive: Drive, *, tension_N: float, tension_mass_kg_m: float) -> Structure:
    """Pre-tension T kappa^2 from inflation and rotation, with the belt's uniform stretch.

    Signature: even; widens and flattens the waveform, more at speed; baseline rises with speed
        squared
    Valid: tension small against the belt's own stiffness E A
    Source: P3, sigma A = p0 b R + rho A R^2 Omega^2 (errata)

    T0 grows with the inflation pressure, as p0 b R does; the rotation's share does not.
    """
    pressure = drive.inflation_pressure_Pa
    # inflation pressure [Pa] at which T0 of the belt's tension holds; if a log does not know its
    # own, it is taken to be this
    inflated = np.where(np.isfinite(pressure), pressure / 2.2e5, 1.0)
    return Structure(tension=tension_N * inflated + tension_mass_kg_m * drive.speed_m_s**2)


@effect(
    "structure",
    follows=(("inflation_pressure_Pa", 1),),
    needs=("inflation_pressure_Pa",),
    observables=("strain", "radial_acceleration"),
    exponent=number(
        0.0,
        -1.0,
        3.0,
        "1",
        "m in k (p / 2.0 bar)^m; 0: sidewalls of rubber alone, 1: of pressure alone",
        probe=0.3,
    ),
)
def inflated_sidewalls(drive: Drive, *, exponent: float) -> Structure:
    """Sidewalls that the inflation pressure stiffens, k (p / 2.0 bar)^m.

    Signature: from log to log: at low pressure a longer patch and wider flanks than by the belt's
        tension
    Valid: logs of several pressures; the belt's tension follows the pressure anyway
    Source: P3, K_w and K_v of sidewalls under pressure; P4 V (1.6 and 2.0 bar)
    """
    # inflation pressure [Pa] at which the model's own stiffnesses hold (P4: 2.0 bar nominal)
    ratio = drive.inflation_pressure_Pa / 2.0e5
    return Structure(stiffening=ratio**exponent - 1.0)


@effect(
    "structure",
    follows=(("load_N", 1),),
    options={"law": ("hardens", "softens")},
    cubic_1_m2=number(0.0, 0.0, 1e5, "1/m^2", "k3 in k (1 +- k3 w^2)", probe=3e3),
)
def stiffening(drive: Drive, *, cubic_1_m2: float, law: str) -> Structure:
    """Foundation that hardens with deflection, k (1 + k3 w^2).

    Signature: even; the patch centre is held back, more at high load
    Valid: k3 w^2 up to about 10; law = "hardens", or "softens" as long as the foundation does not
        give way (k3 w^2 below about 1/3)
    Source: P1, P2, outlook (iii)

    A foundation that softens, k (1 - k3 w^2), is a sidewall that buckles outwards; a diagnosis
    tries the hardening one.
    """
    return Structure(cubic=-cubic_1_m2 if law == "softens" else cubic_1_m2)


@effect(
    "structure",
    beam_only=True,
    strength=("fraction",),
    fraction=number(1.0, 0.0, 1.0, "1", "share of the ring's response: 0 the beam, 1 the ring"),
    tangential_stiffness_N_m2=number(
        3e5, 1e3, 1e9, "N/m^2", "k_v, tangential foundation of the ring", free=False
    ),
)
def ring_curvature(drive: Drive, *, fraction: float, tangential_stiffness_N_m2: float) -> Structure:
    """A closed ring in place of the straight beam.

    Signature: even; adds a slow wave around the whole revolution, no trend with speed
    Valid: an inextensible belt; a beam model only (a ring carcass is one already)
    Source: P3, Z_n of the errata

    It is P3's ring without inflation. Undamped, its rotation cancels (errata).
    """
    return Structure(ring=fraction, ring_tangential=fraction * tangential_stiffness_N_m2)
