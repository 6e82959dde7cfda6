"""The numbers of a carcass and its load: names, units, bounds and starts, as plain data."""

from __future__ import annotations

from dataclasses import replace

from tirelog.physics.spectral import Parameter
from tirelog.vocabulary.observables import ACCELERATION, OBSERVABLES, WIDTH

CARCASSES = ("beam", "ring", "coupled_ring")
#: a parabola on a patch of given length, the ring's tread on a flat road, or all on one line
#: across the tread, P1 (2)
CONTACTS = ("prescribed", "flat_road", "point")


def _p(
    name: str,
    unit: str,
    description: str,
    value: float,
    low: float,
    high: float,
    *,
    free: bool = True,
) -> Parameter:
    return Parameter(
        name, unit, description, value, low, high, probe=value or 0.01 * high, free=free
    )


_LOAD = (
    _p(
        "lever_arm_m",
        "m",
        "distance from the neutral axis; the surface gives the sign",
        3e-4,
        0.0,
        0.02,
    ),
    _p("load_N", "N", "F, if the log does not measure it", 3600.0, 1.0, 1e6, free=False),
    _p(
        "radius_m",
        "m",
        "R, the rolling radius: speed over the wheel's angular velocity",
        0.3126,
        0.05,
        3.0,
        free=False,
    ),
)
_PATCH = (
    _p("patch_half_length_m", "m", "L at the reference load", 0.055, 0.01, 0.2),
    _p(
        "reference_load_N",
        "N",
        "load at which patch_half_length_m holds",
        3600.0,
        1.0,
        1e6,
        free=False,
    ),
    _p(
        "patch_load_exponent",
        "1",
        "L = L_ref (load / reference_load_N)^exponent",
        0.5,
        0.0,
        2.0,
        free=False,
    ),
    _p(
        "reference_pressure_Pa",
        "Pa",
        "inflation pressure at which patch_half_length_m holds",
        2.2e5,
        1e3,
        2e6,
        free=False,
    ),
    replace(
        _p(
            "patch_pressure_exponent",
            "1",
            "L falls as (pressure / reference_pressure_Pa)^-exponent; 0: not at all",
            0.0,
            -0.5,
            2.0,
            free=False,
        ),
        probe=0.3,
    ),
)
_BEAM = (
    _p("flexural_stiffness_N_m2", "N m^2", "EJ", 4.0, 0.1, 100.0),
    _p("foundation_stiffness_N_m2", "N/m^2", "k", 2.0e6, 1e5, 1e8),
    _p("line_mass_kg_m", "kg/m", "mu", 4.5, 1e-3, 100.0, free=False),
)
_RING = (
    _p("flexural_stiffness_N_m2", "N m^2", "EI", 2.0, 1e-3, 100.0),
    _p("line_mass_kg_m", "kg/m", "rho A", 3.15, 1e-3, 100.0, free=False),
    _p("radial_stiffness_N_m2", "N/m^2", "k_w", 6.3e5, 1e4, 1e8),
    _p("tangential_stiffness_N_m2", "N/m^2", "k_v", 6.3e5, 1e3, 1e9),
    _p("radial_damping_N_s_m2", "N s/m^2", "c_w", 0.0, 0.0, 1e6, free=False),
    _p("tangential_damping_N_s_m2", "N s/m^2", "c_v", 0.0, 0.0, 1e6, free=False),
    _p(
        "inflation_pressure_Pa",
        "Pa",
        "p0, if the log does not measure it",
        1.2e5,
        0.0,
        2e6,
        free=False,
    ),
    _p(
        "width_m",
        "m",
        "b, on which p0 bears: the belt's tension is p0 b R",
        0.14,
        0.01,
        2.0,
        free=False,
    ),
)
#: What an accelerometer passes on: without the first it is as quick as can be, without the second
#: it has its mean level.
FASTEST_HZ = 1e6
_ACCELEROMETER = (
    _p(
        "bandwidth_Hz",
        "Hz",
        "the accelerometer's low-pass, second order; 1e6: none",
        FASTEST_HZ,
        10.0,
        FASTEST_HZ,
        free=False,
    ),
    _p(
        "coupling_Hz",
        "Hz",
        "its high-pass (AC coupling, a piezo element), first order; 0: none",
        0.0,
        0.0,
        100.0,
        free=False,
    ),
)
#: What the coupled ring has beside the ring: it rolls with damping, on a hub that has mass, with
#: bristles that cling to the road.
_COUPLED = (
    _p(
        "hub_mass_kg",
        "kg",
        "m_h, hub and rim (and what moves with them)",
        20.0,
        1e-3,
        1e5,
        free=False,
    ),
    _p(
        "hub_inertia_kg_m2", "kg m^2", "J_h, hub and rim about the axle", 0.8, 1e-5, 1e5, free=False
    ),
    _p(
        "suspension_damping_N_s_m",
        "N s/m",
        "of the hub's vertical motion against the vehicle",
        0.0,
        0.0,
        1e6,
        free=False,
    ),
    _p(
        "added_mass_kg",
        "kg",
        "of the rigid ring beside the belt's 2 pi R rho A: tread, the sidewall's share",
        0.0,
        0.0,
        1e3,
        free=False,
    ),
    _p(
        "sidewall_stiffness_ratio",
        "1",
        "k_s of the rigid ring over the foundation's pi R (k_w + k_v)",
        1.0,
        0.01,
        100.0,
        free=False,
    ),
    _p(
        "wind_up_stiffness_ratio",
        "1",
        "k_theta over the foundation's 2 pi R^3 k_v",
        1.0,
        0.01,
        100.0,
        free=False,
    ),
    _p(
        "sidewall_damping_ratio",
        "1",
        "damping of the rigid ring's motions over that of the foundation",
        1.0,
        0.0,
        100.0,
        free=False,
    ),
    _p(
        "bristle_stiffness_N_m2", "N/m^2", "c_x, tread along the road", 1.9e6, 0.0, 1e10, free=False
    ),
    _p("friction", "1", "mu of the bristles on the road", 0.8, 0.0, 5.0, free=False),
)
#: What the steady waveform does not tell, or hardly, and a motion does.
MOTION = (
    *(p.name for p in _COUPLED),
    "line_mass_kg_m",
    "radial_damping_N_s_m2",
    "tangential_damping_N_s_m2",
)
_TREAD = (
    _p("tread_stiffness_N_m2", "N/m^2", "k_t, radial stiffness of the tread", 8.75e7, 1e6, 1e10),
)
#: For numbers with regressors: the level, and what follows the force (P4 III).
_LEVEL = tuple(
    replace(p, probe=0.01)
    for p in (
        _p("offset_rad", "rad", "level without force", 0.0, -3.2, 3.2),
        _p(
            "per_acceleration_rad_s2_m",
            "rad s^2/m",
            "part that follows the longitudinal force, per acceleration",
            0.0,
            -1.0,
            1.0,
        ),
    )
)


def carcass_parameters(
    carcass: str, *observables: str, flat_road: bool, point: bool = False
) -> tuple[Parameter, ...]:
    """The parameters of a model without effects, in the order of the file.

    Of several observables each number once, free if it is for one of them. Under a `point` load the
    patch's length is only there for what effects do on a patch, and is held.
    """
    if point:
        plain = carcass_parameters(carcass, *observables, flat_road=flat_road)
        return tuple(p.fixed() if p.name == "patch_half_length_m" else p for p in plain)
    each = [
        {p.name: p for p in _of_one(carcass, observable, flat_road)} for observable in observables
    ]
    if len(each) == 1:
        return tuple(each[0].values())
    sensor, level = ([p.name for p in group] for group in (_ACCELEROMETER, _LEVEL))
    names = dict.fromkeys(name for one in each for name in one)
    last = [*sensor, *level]
    order = sorted(names, key=lambda name: last.index(name) if name in last else -1)
    known = {name: [one[name] for one in each if name in one] for name in order}
    return tuple(next((p for p in found if p.free), found[0]) for found in known.values())


def _of_one(carcass: str, observable: str, flat_road: bool) -> tuple[Parameter, ...]:
    structure = _BEAM if carcass == "beam" else _RING if carcass == "ring" else _coupled()
    patch = _TREAD if flat_road else _PATCH
    stages = OBSERVABLES[observable].reads
    level = _LEVEL if "regressors" in stages else ()
    sensor = _ACCELEROMETER if observable == ACCELERATION else ()
    if observable in (ACCELERATION, WIDTH):
        # an accelerometer shows the belt's tension at the edges of the patch, and a width by how it
        # follows the pressure; no data sheet tells the belt's width: a section is a third wider
        structure = tuple(replace(p, free=True) if p.name == "width_m" else p for p in structure)
    chosen = (*structure, *patch, *_LOAD, *sensor, *level)
    if "lever_arm" in stages:
        return chosen
    # the others do not read the lever arm; the numbers of geometry not even the structure, and the
    # phase shift not even the patch
    reads = ["offset_rad", "per_acceleration_rad_s2_m"]
    if "load" in stages:
        reads += ["patch_half_length_m", "tread_stiffness_N_m2"]
    if observable == WIDTH:
        reads += ["radial_stiffness_N_m2", "width_m"]
    held = (p if "structure" in stages or p.name in reads else p.fixed() for p in chosen)
    return tuple(p.fixed() if p.name == "lever_arm_m" else p for p in held)


def _coupled() -> tuple[Parameter, ...]:
    """The ring's parameters and the coupled ring's own."""
    # a start value: without any damping [N s/m^2] it would ring for ever
    damped = (
        replace(p, value=60.0, probe=60.0) if p.name.endswith("damping_N_s_m2") else p
        for p in _RING
    )
    return (*damped, *_COUPLED)


def steady_carcass(carcass: str) -> str:
    """The carcass that gives the model's steady waveform.

    A coupled ring that rolls steadily on a flat road is the ring.
    """
    return "ring" if carcass == "coupled_ring" else carcass
