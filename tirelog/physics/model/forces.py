"""Forces, losses and speeds of a rolling tire as a model has them, one number per revolution.

    Conditions (n,), slip angle and camber --`stages`--> columns (n,)

The balance of rolling, in the frame of the axle, x along the road behind the hub. The road is flat,
stiff and at rest. The pressure p acts on a tread of height z(phi) and place x(phi). Its work is
Omega int p z' dxi = 0 if the layer between belt and road returns all energy. A belt that turns as a
stiff wheel has z' = x; what remains of z' deforms it, at the power P. So

    P = Omega int p (z' - x) dxi = Omega M,        M = -int p x dxi = -F x_c

P is what the losses of the carcass take, since kinetic and elastic energy of a steady wave return
(P1 (24), (25)); by modes, with the ring's equivalent load E_n and inward displacement W_n,

    P = 2 pi R Omega sum 2 n Im(conj(W_n) E_n)

M turns the wheel back, and the load acts M / F ahead of the hub (P1 3.2). x is a place in space,
(R - w) sin phi + v cos phi of a ring: along the undeformed belt the pressure of a lossy ring leans
8 % less than that. An undamped tire rolls for nothing.

A pressure that is prescribed does not know of a flat road, and a beam has no hub: the middle of its
patch is ahead of where the hub would be, by what the carcass's power needs. What effects add to the
pressure leans against that. It exerts a moment on a carcass that takes nothing too,

    M = P_0 / Omega + dM,  dM = -int p x dxi + int p_0 x_0 dxi      _0 without what effects add

(P in place of P_0 of a beam, whose x along the belt does not know of w). The layer between belt and
road takes the power of that: the rubber of the tread or the water. The model has no losses there:
`tread_power_W`, Omega M - P. Below zero it would have to push the wheel, which no tread does.

The sliding of a brush takes the power F_x slip v + F_y tan(slip angle) v besides. The drive or the
brake provides it, not the rolling.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.data.setup import Tire
from tirelog.errors import ModelError, UsageError
from tirelog.physics import pressure as brush
from tirelog.physics.carcass import structures
from tirelog.physics.effects.contact import NEUTRAL_AXIS_SHARE
from tirelog.physics.effects.contact import slip as brush_slip
from tirelog.physics.model.laws import between_half_levels
from tirelog.physics.model.model import Model
from tirelog.physics.model.stages import (
    Task,
    hardened,
    hub_forces,
    inward,
    load_on_carcass,
    loaded_site,
    pressure,
    pulled_along,
    response,
    structure,
    tangential,
)
from tirelog.physics.spectral import MODES, STEP, grid_angles, to_grid
from tirelog.vocabulary.arrays import FloatArray

#: hooks by which effects change the pressure that the road gives a tread
_LEANING = ("tilt", "pressure", "kernel")
_N = np.arange(MODES, dtype=np.float64)


def force_columns(
    model: Model,
    conditions: Conditions,
    tire: Tire,
    *,
    slip_angle_deg: float | FloatArray = 0.0,
    camber_deg: float | FloatArray = 0.0,
) -> dict[str, FloatArray]:
    """Columns of `tirelog model forces`, each (n,); NaN if the model has none.

    The angles are one number or (n,).

    The brush takes its friction and stiffness from the model's effect `traction`, without it P2's;
    a lateral force or an aligning moment is there whenever slip angle or camber are not zero. With
    viscosity, height and width of the `tire`'s tread strip, the power that they take by P1 (25),
    bending with w''', and by (27).

    ModelError: as `Model.predict`; an angle at which a tread does not lie on the road.
    """
    widest = 45.0  # beyond it a tread does not lie on the road as the brush has it
    angles = [np.broadcast_to(angle, len(conditions)) for angle in (slip_angle_deg, camber_deg)]
    for name, given in zip(("slip angle", "camber"), angles, strict=True):
        for angle in given[~(np.abs(given) <= widest)]:
            raise ModelError(
                f"a {name} of {angle:g} degrees",
                allowed=f"{-widest:g} to {widest:g} degrees is allowed",
                do="correct it",
            )
    pieces = [
        _of_task(task, angles[0][rows, None], angles[1][rows, None], tire)
        for rows, task in model._tasks(conditions, model.values)
    ]
    found = {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}
    if not np.any(angles):
        found |= dict.fromkeys(
            ("road_lateral_N", "aligning_moment_N_m"), np.full(len(conditions), np.nan)
        )
    return found


def _of_task(
    task: Task, slip_angle_deg: FloatArray, camber_deg: FloatArray, tire: Tire
) -> dict[str, FloatArray]:
    """The columns of one block of revolutions, each (n,); angles (n, 1)."""
    site, R, speed = loaded_site(task)[0], task.base["radius_m"], task.drive.speed_m_s
    slip, grip = _brush(task)
    carcass, moment = _balance(task)
    none = np.full((1, 1), np.nan)
    bending, stretching, strip = _section_power(task, tire)
    load, half, sigma = np.broadcast_arrays(site.load_N, site.half_length_m, slip)
    slipping, camber = np.radians(slip_angle_deg), np.radians(camber_deg)
    x, y, aligning = brush.forces(load, half, sigma, slipping, camber, R, grip)
    held = brush.transition(slip, site.half_length_m, grip.stiffness_ratio)
    turning = np.where(speed > 0.0, moment, np.nan)  # a wheel at rest may lean either way
    belt, approach = _deflections(task)
    ring = task.carcass == "ring"
    hub = hub_forces(task) if ring else np.full((2, 1), np.nan)
    found = {
        "speed_m_s": speed,
        "load_N": site.load_N,
        "inflation_pressure_Pa": task.drive.inflation_pressure_Pa,
        "acceleration_m_s2": task.drive.acceleration_m_s2,
        "slip": slip,
        "slip_angle_deg": slip_angle_deg,
        "camber_deg": camber_deg,
        "patch_length_m": 2.0 * site.half_length_m,
        "dry_length_m": _dry_length(task),
        "contact_width_deg": np.degrees(2.0 * site.half_length_m / R),
        "patch_width_deg": np.degrees(between_half_levels(task)) if ring else none,
        "belt_deflection_m": belt,
        "hub_approach_m": approach,
        "speed_ratio": speed / _critical(task),
        "damping_ratio": _damping(task),
        "hub_longitudinal_N": hub[0][:, None],
        "hub_vertical_N": hub[1][:, None],
        "road_longitudinal_N": x,
        "road_lateral_N": y,
        "aligning_moment_N_m": aligning,
        "adhesion_share": (held + site.half_length_m) / (2.0 * site.half_length_m),
        "pressure_centre_m": -turning / site.load_N,
        "dissipated_power_W": moment * (speed / R),
        "carcass_power_W": carcass * (speed / R),
        "tread_power_W": (moment - carcass) * (speed / R),
        "sliding_power_W": speed * (slip * x + np.tan(np.radians(slip_angle_deg)) * y),
        "rolling_resistance_N": turning / R,
        "rolling_resistance_coefficient": turning / R / site.load_N,
        "rolling_resistance_moment_N_m": turning,
        "bending_power_W": bending,
        "stretching_power_W": stretching,
        "strip_power_W": strip,
    }
    return {
        name: np.broadcast_to(column, slip_angle_deg.shape)[:, 0] for name, column in found.items()
    }


def _critical(task: Task) -> FloatArray:
    """c_cr [m/s] of a beam with all effects, (n or 1, 1), P1 (5); NaN of a ring, which has none."""
    if task.carcass == "ring":
        return np.full((1, 1), np.nan)
    b, s = task.base, structure(task)
    k = b["foundation_stiffness_N_m2"] * (1.0 + s.stiffening) + s.added_stiffness
    EJ, mu = b["flexural_stiffness_N_m2"], b["line_mass_kg_m"]
    least = 2.0 * np.sqrt(EJ * k)
    if np.any(s.shear):  # the least of EJ q^2 / (1 + l^2 q^2) + k / q^2, or its end, G A
        inside = s.shear * np.sqrt(k) < np.sqrt(EJ)
        least = np.where(inside, least - s.shear * k, EJ / s.shear)
    return np.atleast_2d(np.sqrt((least + s.tension) / mu))


def _damping(task: Task) -> FloatArray:
    """beta of P1 (4), sqrt(mu / k) omega_d."""
    if task.carcass == "ring":
        return np.full((1, 1), np.nan)
    rate = structure(task).damping_rate
    ratio = task.base["line_mass_kg_m"] / task.base["foundation_stiffness_N_m2"]
    return np.atleast_2d(np.asarray(rate * np.sqrt(ratio), np.float64))


def _balance(task: Task) -> tuple[FloatArray, FloatArray]:
    """(power of the carcass over Omega, moment that turns the wheel back) [N m], (n or 1, 1)."""
    carcass = _carcass_moment(task)
    if not task.having(*_LEANING):
        return carcass, carcass
    plain = _without_leaning(task)
    before = _carcass_moment(plain) if task.carcass == "ring" else carcass
    return carcass, before + _hub_moment(task) - _hub_moment(plain)


def _without_leaning(task: Task) -> Task:
    """The task with the pressure of the road alone, without effects on it."""
    active = [
        (replace(effect, tilt=None, pressure=None, kernel=None), values)
        for effect, values in task.active
    ]
    return replace(task, active=active, memo={}, near=None)


def _carcass_moment(task: Task) -> FloatArray:
    """Power that the losses of the carcass take, over Omega [N m], (n or 1, 1)."""
    # the road pushes, not what a hardened foundation leaves of it
    work = (np.conj(inward(task)) * load_on_carcass(task)).imag
    return np.asarray(
        (4.0 * np.pi * task.base["radius_m"]) * (_N * work).sum(axis=1, keepdims=True)
    )


def _hub_moment(task: Task) -> FloatArray:
    """-int p x dxi about the hub [N m], (n or 1, 1), x in space; of a beam along the belt."""
    R, phi = task.base["radius_m"], grid_angles()
    x = np.where(phi < np.pi, R * phi, 0.0)  # half a turn away lies ahead and behind alike
    if task.carcass == "ring":
        x = (R - to_grid(inward(task))) * np.sin(phi) + to_grid(tangential(task)) * np.cos(phi)
    return np.asarray(
        (-R * STEP) * (to_grid(pressure(task).pressure) * x).sum(axis=1, keepdims=True)
    )


def _deflections(task: Task) -> tuple[FloatArray, FloatArray]:
    """(largest inward displacement of the belt, approach of hub and road) [m], (n or 1, 1).

    The approach is the yield of belt and tread above the hub's foot; without a road it is NaN.
    """
    belt = to_grid(inward(task))
    approach = np.full((1, 1), np.nan)
    if task.flat_road:
        plain = _without_leaning(task)
        yields = to_grid(inward(plain))[:, :1]
        tread = to_grid(pressure(plain).pressure)[:, :1] / task.base["tread_stiffness_N_m2"]
        approach = yields + tread
    return belt.max(axis=1, keepdims=True), approach


def _section_power(task: Task, tire: Tire) -> tuple[FloatArray, ...]:
    """Losses in bending, in stretching and by P1 (27) [W], each (n or 1, 1); NaN if not known.

    eta J c^2 int w'''^2 ds and eta A c^2 int u''^2 ds: their sum is P1 (25).

    Then eta A c^2 int eps'^2 ds of (27), for a grating on the inner surface: without a lever that
    is the second.
    """
    R, lever = task.base["radius_m"], task.base["lever_arm_m"]
    curved, along = hardened(task) * response(task)[1], pulled_along(task)
    stretched = np.zeros((1, MODES)) if along is None else 1j * (_N / R) * along
    known = (tire.viscosity_Pa_s, tire.section_height_m, tire.width_m)
    viscosity, height, width = (np.nan if x is None else x for x in known)
    powers = []
    for strain in (curved, stretched, lever * curved + stretched):
        slopes = (_N / R) ** 2 * (strain.real**2 + strain.imag**2)
        integral = 4.0 * np.pi * R * slopes.sum(axis=1, keepdims=True)
        powers.append(viscosity * task.drive.speed_m_s**2 * integral)
    area = height * width
    return powers[0] * area * height**2 / 12.0, powers[1] * area, powers[2] * area


def _dry_length(task: Task) -> FloatArray:
    """Length [m] of the patch that touches the road behind the effect `water_wedge`, else all."""
    site, wedge = loaded_site(task)[0], task.values_of("water_wedge")
    if wedge is None:
        return 2.0 * site.half_length_m
    depth, film = 1e-3 * task.drive.water_depth_mm, 1e-3 * wedge["film_mm"]
    wedged = brush.filled_wedge(task.drive.speed_m_s, depth, wedge["width_m"], film, site.radius_m)
    return brush.dry_length(site.load_N, site.half_length_m, *wedged)


def _brush(task: Task) -> tuple[FloatArray, brush.Grip]:
    """(Slip, grip) of the effect `traction`; without it the slip that is measured, else 0, and P2's
    grip.
    """
    v = task.values_of("traction")
    if v is None:
        return np.nan_to_num(task.drive.slip), brush.Grip()
    grip = brush.Grip(v["static_friction"], v["sliding_friction"], v["slip_stiffness_ratio"])
    return brush_slip(task.drive, v["slip_per_g"]), grip


def carcass_facts(model: Model) -> dict[str, tuple[float, str, str]]:
    """Numbers that follow from a beam's own, by name: (value, unit, what it is); P1 (2)-(5).

    Of a ring there is none: undamped, its steady wave does not know the speed (errata).
    """
    if model.carcass != "beam":
        return {}
    v = model.values
    EJ, k, mu = (
        v[name]
        for name in (
            "flexural_stiffness_N_m2", "foundation_stiffness_N_m2", "line_mass_kg_m",
        )
    )  # fmt: skip
    wave = (k / (4.0 * EJ)) ** 0.25
    speed = structures.critical_speed(EJ, k, mu)
    facts = {
        "lambda": (wave, "1/m", "(k / 4 EJ)^(1/4), of the static wave"),
        "w_0": (
            v["load_N"] * wave / (2.0 * k),
            "m",
            "under a point load, F lambda / 2k",
        ),
        "critical_speed": (speed, "m/s", "2 lambda sqrt(EJ / mu), without effects"),
        "alpha": (1.0 / speed, "s/m", "times the speed: speed over the critical one"),
    }
    rate = v.get("viscous_damping.damping_rate_1_s")
    if rate is not None:
        facts["beta"] = (rate * (mu / k) ** 0.5, "", "sqrt(mu / k) omega_d, damping ratio")
    return facts


# ---- The model of a worn tire from that of a new one, by the physics of its tread (P3 Figs. 5, 6).
#
# P3 gives no equation (errata). A block of rubber of depth d on the belt is stiff as 1 / d, across
# and along the road; and a section whose outer part is gone has its neutral axis nearer to the
# liner.


#: parameters that are in proportion to 1 / depth: the tread across the road, and along it
STIFF = ("tread_stiffness_N_m2", "bristle_stiffness_N_m2", "traction.slip_stiffness_ratio")


def worn_model(
    model: Model,
    new_depth_m: float,
    depth_m: float,
    neutral_axis_share: float = NEUTRAL_AXIS_SHARE,
) -> tuple[Model, dict[str, tuple[float, float]]]:
    """(The model with the tread worn to a depth, what changed: name -> (new, worn)).

    UsageError: depths that are none.  ModelError: a number leaves its bounds.
    """
    deepest_m = 0.05  # beyond it a number is in millimetres
    if not 0.0 < depth_m <= new_depth_m <= deepest_m:
        raise UsageError(
            f"a tread worn from {new_depth_m:g} to {depth_m:g} m",
            allowed=f"allowed are depths above 0, the new one up to {deepest_m:g} m and no less "
            "than the worn one",
            do="give both in metres",
        )
    if not 0.0 <= neutral_axis_share <= 1.0:
        raise UsageError(
            f"a neutral axis that moves by {neutral_axis_share:g} of what is worn off",
            allowed="0 to 1 is allowed",
            do="correct it",
        )
    values = model.values
    changed = {name: values[name] * new_depth_m / depth_m for name in STIFF if name in values} | {
        "lever_arm_m": max(
            values["lever_arm_m"] - neutral_axis_share * (new_depth_m - depth_m), 0.0
        )
    }
    worn = model.with_values(changed)
    return worn, {name: (values[name], value) for name, value in changed.items()}
