"""Effects on the load and on what the road does to the tread: pressure, traction, water, wear.

Their order here is that of the catalogue.
"""

from __future__ import annotations

import numpy as np

from tirelog.physics.effects.base import CATALOGUE_G_M_S2, Drive, Site, effect, number
from tirelog.physics.pressure import (
    SLIDING_FRICTION,
    STATIC_FRICTION,
    Grip,
    bell,
    filled_wedge,
    rough,
    saddled_parabola,
    smear,
    traction_modes,
    water,
    wedge,
)
from tirelog.physics.spectral import ComplexArray
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import OBSERVABLES

#: metres that the neutral axis moves per metre of tread worn off: half, of a section that is of one
#: material; a stiff belt holds it (0), and the lever arm of a grating on the liner keeps its length
NEUTRAL_AXIS_SHARE = 0.5
#: Distance [km] after which the tread counts as worn: A = distance / 40000.
LIFE_KM = 40000.0


@effect(
    "tilt",
    valid_range={"offset": (-1.0, 1.0)},
    offset=number(0.0, -0.95, 0.95, "1", "a in p (1 - a xi / L)", probe=0.1),
)
def pressure_offset(drive: Drive, *, offset: float) -> FloatArray:
    """Contact pressure heavier towards the entry edge.

    Signature: odd about the patch centre, the same at every speed
    Valid: abs(a) < 1, else the pressure pulls
    Source: P1 3.2; P2 below (12)
    """
    return np.full((1, 1), offset)


@effect(
    "pressure",
    follows=(("speed_m_s", 1),),
    valid_range={"a": (-1.2, 5.0)},
    tried=False,
    a=number(0.0, -1.2, 5.0, "1", "a in p (1 + a (v/20)^n (xi^2/L^2 - 1/5))", probe=0.3),
    speed_exponent=number(0.0, 0.0, 4.0, "1", "n, power of the speed", probe=1.0, free=False),
)
def pressure_saddle(drive: Drive, site: Site, *, a: float, speed_exponent: float) -> FloatArray:
    """Shoulders of the patch carry more, p (1 + a (v/20)^n (xi^2/L^2 - 1/5)).

    Signature: even; two humps inside the edges, a flat or lifted middle
    Valid: a from -1.2 (no pressure is negative) to 5 (none in the middle)
    Source: Clark (ed.), Mechanics of Pneumatic Tires, 1981: measured contact pressures

    An under-inflated tire has such shoulders. A diagnosis does not try it: patch length and
    stiffness take two thirds of it, and what is left has a cosine of 0.6 with that of stiffening
    (docs/second_forms.md).
    """
    size = a * (drive.speed_m_s / 20.0) ** speed_exponent
    return size * saddled_parabola(site.load_N, site.half_length_m, site.radius_m)


def slip(drive: Drive, slip_per_g: float) -> FloatArray:
    """The measured slip if the log has one, else -a acceleration/9.81; positive in braking."""
    estimate = -slip_per_g * drive.acceleration_m_s2 / CATALOGUE_G_M_S2
    return np.where(np.isfinite(drive.slip), drive.slip, estimate)


@effect(
    "traction",
    follows=(("acceleration_m_s2", 1),),
    reads=("stretch",),
    also_at_zero=("ring",),
    valid_range={"slip": (-1.0, 1.0)},
    needs=("acceleration_m_s2",),
    instead={"acceleration_m_s2": "slip"},
    strength=("lever_m",),
    lever_m=number(
        0.005,
        -0.05,
        0.05,
        "m",
        "h in h d tau/d xi, of either sign (P2: the section height)",
        probe=0.01,
    ),
    slip_per_g=number(
        0.1, 0.0, 1.0, "1", "a in slip = -a acceleration/9.81, if no slip is measured"
    ),
    static_friction=number(
        STATIC_FRICTION, 0.05, 3.0, "1", "f_s, of a tread that adheres", free=False
    ),
    sliding_friction=number(
        SLIDING_FRICTION, 0.05, 3.0, "1", "f_d, of a tread that slides", free=False
    ),
    slip_stiffness_ratio=number(
        1.0,
        0.1,
        100.0,
        "1",
        "C_x over 2 gamma L f_s, with which all slides at slip 1 only (P2 (17))",
        free=False,
    ),
)
def traction(
    drive: Drive,
    site: Site,
    *,
    lever_m: float,
    slip_per_g: float,
    static_friction: float,
    sliding_friction: float,
    slip_stiffness_ratio: float,
) -> tuple[ComplexArray, float] | None:
    """Brush friction under drive and brake torque, with its slip onset.

    Signature: odd, changes sign with the acceleration, a kink where adhesion ends
    Valid: slip up to 1; friction 0.8 sticking, 0.6 sliding unless the model says otherwise; on a
        ring the shear also pulls the belt along
    Source: P2 (13)-(18), C_x by (17); errata: the jump at x_s, either sign of the lever

    A ring's belt is pulled along by the shear itself, so that traction acts there also without a
    lever, which only adds its couple. Friction and stiffness of the grip are fixed unless a model
    file frees them.
    """
    sigma = slip(drive, slip_per_g)
    if not np.any(sigma):
        return None
    grip = Grip(static_friction, sliding_friction, slip_stiffness_ratio)
    modes = traction_modes(site.load_N, site.half_length_m, sigma, site.radius_m, grip)
    return modes, lever_m


@effect(
    "stretch",
    follows=(("acceleration_m_s2", 1),),
    needs=("acceleration_m_s2",),
    instead={"acceleration_m_s2": "slip"},
    observables=("strain", "dissipation_factor"),
    beam_only=True,
    tried=False,
    compliance_1_N=number(0.0, 0.0, 1e-4, "1/N", "1 / (E A) of the belt", probe=1e-6),
    tangential_stiffness_N_m2=number(
        3e5, 1e3, 1e9, "N/m^2", "k_v, of the sidewalls along the tread", free=False
    ),
)
def belt_stretch(
    drive: Drive, site: Site, *, compliance_1_N: float, tangential_stiffness_N_m2: float
) -> FloatArray:
    """A belt that the traction pulls along and stretches, k_v u - E A u'' = tau.

    Signature: follows the traction; tension ahead of a braked patch and compression behind it, the
        same at every place of the section
    Valid: beside traction; a beam model only (P3's ring keeps its length); the inertia mu c^2 u'',
        a thousandth of E A u'', is left out
    Source: P1 (21), (23), which have u' and u'' and no equation for them

    u' is the strain of the neutral axis, for which P1 (27) is exact. A diagnosis does not try it:
    beside traction's lever it is odd in the slip too.
    """
    c = compliance_1_N
    return c / (c * tangential_stiffness_N_m2 + site.q**2)


@effect(
    "pressure",
    follows=(("speed_m_s", 1),),
    options={"speed_law": ("linear", "squared")},
    amplitude=number(
        0.0,
        0.0,
        20.0,
        "1",
        "a in a F/(2L) (v/20)^n exp(-((xi + x0 L)/(s L))^2/2), n = 1, or 2 if squared",
        probe=0.5,
    ),
    position=number(1.0, 0.5, 1.5, "1", "x0, place of the pulse over L"),
    width=number(0.05, 0.02, 0.5, "1", "s, width of the pulse over L"),
)
def edge_impact(
    drive: Drive, site: Site, *, amplitude: float, position: float, width: float, speed_law: str
) -> ComplexArray:
    """Momentum of the tread arriving: a pressure pulse at the entry edge.

    Signature: a kink at the entry edge that grows with speed
    Valid: pulses narrower than the patch; speed_law = "linear", or "squared" as momentum that
        arrives with the speed has it
    Source: P1, P2, outlook (i)
    """
    # arriving momentum mu c w_t is mu c^2 w': by the option the pulse grows with the square
    law = 2.0 if speed_law == "squared" else 1.0
    height = amplitude * site.mean_pressure * (drive.speed_m_s / 20.0) ** law
    half = site.half_length_m
    return bell(height, -position * half, width * half, site.radius_m)


@effect(
    "kernel",
    strength=("length",),
    length=number(0.1, 0.0, 1.0, "1", "s in the kernel exp(-abs(xi)/(s L))"),
)
def rough_contact(drive: Drive, site: Site, *, length: float) -> FloatArray:
    """Asperities that smear the edges of the pressure.

    Signature: even; rounds the waveform at both edges; hardly separable from gauge_length
    Valid: smearing shorter than the patch
    Source: P1, P2, outlook (ii)

    The response is even in s: at zero a fit has no slope to follow, so it starts away from it.
    """
    return smear(length * site.half_length_m, site.radius_m)


@effect(
    "pressure",
    follows=(("load_N", 1),),
    tried=False,
    strength=("height_m",),
    height_m=number(1e-4, 0.0, 5e-3, "m", "h, rms height of the asperities", probe=2e-4),
    tread_stiffness_N_m2=number(
        8.75e7, 1e6, 1e10, "N/m^2", "k_t, radial stiffness of the tread", free=False
    ),
)
def asperities(
    drive: Drive, site: Site, *, height_m: float, tread_stiffness_N_m2: float
) -> ComplexArray:
    """Independent springs of the tread on asperities of Gaussian height.

    Signature: even; rounds the pressure at both edges, over k_t h L^2 / (1.5 F): less at high load
    Valid: heights well below the tread's compression in the middle of the patch; the parabola
    Source: Greenwood and Williamson, Proc. R. Soc. A 295, 1966; P1, P2, outlook (ii)

    A log knows the product k_t h alone. A diagnosis does not try it: it is like rough_contact,
    which smears by a share of the patch whatever the load.
    """
    place = site.load_N, site.half_length_m, site.radius_m
    return rough(*place, abs(height_m), tread_stiffness_N_m2)  # a step of a fit may be below zero


@effect(
    "pressure",
    follows=(("speed_m_s", 2), ("water_depth_mm", 1)),
    needs=("water_depth_mm",),
    amplitude=number(
        0.0, 0.0, 20.0, "1/mm", "a in a F/(2L) (v/20)^2 depth u exp(1 - u)", probe=0.1
    ),
    length=number(0.4, 0.05, 2.0, "1", "s in u = (-L - xi)/(s L)"),
)
def water_film(drive: Drive, site: Site, *, amplitude: float, length: float) -> ComplexArray:
    """Hydrodynamic wedge ahead of the entry edge.

    Signature: lift ahead of the entry edge that grows with speed squared and water depth
    Valid: below the onset of full aquaplaning
    Source: P1, P2, outlook (iv)
    """
    height = amplitude * site.mean_pressure * (drive.speed_m_s / 20.0) ** 2 * drive.water_depth_mm
    return wedge(height, -site.half_length_m, length * site.half_length_m, site.radius_m)


@effect(
    "pressure",
    follows=(("speed_m_s", 1), ("water_depth_mm", 1)),
    needs=("water_depth_mm",),
    tried=False,
    width_m=number(0.0, 0.0, 2.0, "m", "b, width of the tread that runs onto water", probe=0.1),
    film_mm=number(
        0.1, 0.01, 5.0, "mm", "h_0, film that the road's texture lets through", free=False
    ),
)
def water_wedge(drive: Drive, site: Site, *, width_m: float, film_mm: float) -> ComplexArray:
    """A wedge of water ahead of the entry edge, which holds the patch's first part off the road.

    Signature: lift ahead of the entry edge in proportion to speed, that fills up with water depth;
        the patch that touches is shorter (`dry_length_m` of `model forces`)
    Valid: thin films, 0.1 to 1 mm, below full aquaplaning; the parabola; a gap of radius R
    Source: Reynolds 1886 with Grubin's inlet, 1949; P1, P2, outlook (iv)

    The momentum of deep water, with the square of the speed, is water_film's. A diagnosis does not
    try it: it is like water_film.
    """
    film = 1e-3 * film_mm
    depth = 1e-3 * drive.water_depth_mm
    # a step of a fit may go below zero
    wedged = filled_wedge(drive.speed_m_s, depth, abs(width_m), film, site.radius_m)
    lift = water(site.load_N, site.half_length_m, site.radius_m, *wedged, film)
    return np.asarray(np.sign(width_m) * lift, np.complex128)


def _worn_lever(drive: Drive, *, lever_loss: float) -> FloatArray:
    """The factor on the lever arm."""
    return 1.0 - lever_loss * (drive.distance_km / LIFE_KM)


@effect(
    "pressure",
    follows=(("distance_km", 1),),
    valid_range={"distance_km": (0.0, LIFE_KM)},
    needs=("distance_km",),
    lever=_worn_lever,
    amplitude=number(
        0.0,
        0.0,
        5.0,
        "1",
        "a in a A F/(2L) exp(-((xi - x0 L)/(s L))^2/2), A = distance/40000 km",
        probe=0.3,
    ),
    lever_loss=number(0.0, -1.0, 1.0, "1", "b in the lever arm y (1 - b A)", probe=0.2),
    position=number(0.85, 0.3, 1.3, "1", "x0, place of the added pressure over L"),
    width=number(0.18, 0.03, 1.0, "1", "s, its width over L"),
)
def wear(
    drive: Drive, site: Site, *, amplitude: float, position: float, width: float
) -> ComplexArray:
    """Shallower tread: exit side carries more, shorter lever arm.

    Signature: exit side heavier than the entry side, the same at every speed, growing with distance
    Valid: up to the tread's life, about 40,000 km
    Source: P3 Figs. 5, 6 (no equation is given there; errata)
    """
    height = amplitude * (drive.distance_km / LIFE_KM) * site.mean_pressure
    half = site.half_length_m
    return bell(height, position * half, width * half, site.radius_m)


@effect(
    "shortening",
    follows=(("distance_km", 1),),
    needs=("distance_km",),
    tried=False,
    strength=("worn_mm",),
    worn_mm=number(0.0, -10.0, 50.0, "mm", "rubber worn off in 40000 km, evenly", probe=1.0),
    neutral_axis_share=number(
        NEUTRAL_AXIS_SHARE,
        0.01,
        1.0,
        "1",
        "metres that the neutral axis moves per metre worn off",
        free=False,
    ),
)
def tread_depth(drive: Drive, *, worn_mm: float, neutral_axis_share: float) -> FloatArray:
    """Tread worn off with the distance, from which the neutral axis withdraws.

    Signature: the whole waveform of a grating on the liner shrinks from log to log, in proportion
        to the distance
    Valid: logs of one tire at several distances; wear that is even; the depth left is the new one
        less worn_mm distance / 40000 km
    Source: P3 (wear, no equation is given there); section of one material (errata)

    It is what `tirelog model worn` does to the lever arm, by the logs' own distances. A
    diagnosis does not try it: `wear` has it as lever_loss, beside the pressure's form.
    """
    return 1e-3 * worn_mm * neutral_axis_share * (drive.distance_km / LIFE_KM)


@effect(
    "strain",
    follows=(("load_N", 1),),
    tried=False,
    strain_m_N=number(
        0.0,
        -1e-7,
        1e-7,
        "m/N",
        "y a cos(phase) P^2 / (4 pi^2 EJ), strain per line load, for blocks of pitch P",
        probe=1e-9,
    ),
)
def tread_pitch(drive: Drive, site: Site, phi_rad: FloatArray, *, strain_m_N: float) -> FloatArray:
    """Bending between the tread's blocks, strain in proportion to the pressure above.

    Signature: even, inside the patch alone, the same at every speed, of either sign
    Valid: pitches well below 2 pi / lambda; pressure of the parabola
    Source: P1 (2) at waves shorter than 1 / lambda, with a pressure a p cos(2 pi s / P)

    Blocks of the tread bend the belt between them while they are pressed on the road. Waves of the
    pressure much shorter than 1 / lambda of P1 bend the belt by themselves: EJ q^4 w = a p cos, so
    that the strain under the sensor is y a p / (EJ q^2). The pattern turns with the tire, so one
    sensor always reads the same phase.

    A diagnosis does not try it: patch length, stiffness and lever arm take half of it, and what a
    name more costs is not counted (docs/second_forms.md).
    """
    x = phi_rad * site.radius_m / site.half_length_m
    return strain_m_N * (1.5 * site.mean_pressure) * np.maximum(1.0 - x * x, 0.0)


@effect(
    "load",
    follows=(("acceleration_m_s2", 1),),
    needs=("acceleration_m_s2",),
    observables=tuple(OBSERVABLES),
    coefficient=number(0.0, -2.0, 2.0, "1", "a in F (1 + a acceleration/9.81)", probe=0.25),
)
def load_transfer(drive: Drive, *, coefficient: float) -> FloatArray:
    """Load follows the longitudinal acceleration, and the patch length follows the load.

    Signature: even; the waveform grows and widens with acceleration
    Valid: the wheel stays on the road; positive on a rear wheel, negative on a front wheel
    Source: P4 V
    """
    return coefficient * drive.acceleration_m_s2 / CATALOGUE_G_M_S2


@effect(
    "load",
    follows=(("lateral_acceleration_m_s2", 1),),
    needs=("lateral_acceleration_m_s2",),
    observables=tuple(OBSERVABLES),
    coefficient=number(0.0, -2.0, 2.0, "1", "a in F (1 + a lateral acceleration/9.81)", probe=0.25),
)
def cornering(drive: Drive, *, coefficient: float) -> FloatArray:
    """In a curve the load moves to one wheel, and to one side of the tread.

    Signature: even; the waveform grows and widens with the lateral acceleration, on the two sides
        of the tread in opposite senses
    Valid: the strip of tread under the sensor stays on the road
    Source: P4 VI (curves are left to later work); a tilted belt, Pacejka, Tire and Vehicle Dynamics

    The coefficient is the sensor's own: t y / d of a belt that tilts by t per g. Its place across
    the tread is y; the depth of the contact, d, is about L^2 / (2 R). Load from the other wheel
    adds the same at every y.
    """
    return coefficient * drive.lateral_acceleration_m_s2 / CATALOGUE_G_M_S2


@effect(
    "load",
    follows=(("speed_m_s", 2),),
    observables=tuple(OBSERVABLES),
    coefficient=number(0.0, -0.9, 2.0, "1", "a in F (1 + a (v/30)^2)", probe=0.05),
)
def aero_load(drive: Drive, *, coefficient: float) -> FloatArray:
    """Load follows speed squared, and the patch length follows the load.

    Signature: even; the waveform grows and widens with speed squared
    Valid: the wheel stays on the road
    Source: P4 IV
    """
    return coefficient * (drive.speed_m_s / 30.0) ** 2


@effect(
    "added_load",
    follows=(("speed_m_s", 2),),
    valid_range={"speed_m_s": (0.0, 20.0)},
    tried=False,
    force_N=number(
        0.0,
        -500.0,
        500.0,
        "N",
        "m r (20 / R)^2 cos(place), force at 20 m/s when the sensor is at the patch",
        probe=100.0,
    ),
)
def imbalance(drive: Drive, *, force_N: float) -> FloatArray:
    """A wheel out of balance presses with m r omega^2 when the sensor is down.

    Signature: as a load that grows with speed squared, with either sign
    Valid: well below the hop of the wheel (12 to 15 Hz), about 20 m/s
    Source: a rotating mass; 0.1 kg at 0.2 m and R = 0.3 m are 89 N at 20 m/s

    A diagnosis does not try it: for one sensor it is aero_load with either sign. Sensors at several
    places of one tire have it by the cosine of the angle between them.
    """
    return force_N * (drive.speed_m_s / 20.0) ** 2
