"""The compiled step of a tire in motion.

Contact with the road, kicks, and an implicit step of the turning belt.

One step h; v are the belt's coefficients, u their rates, L the spin's momentum (all as in `belt`):

    contact     tread points below the road are pressed, bristles dragged
                -> forces on the coefficients, torque Q
    kick        u, hub and L take their impulses; the spin W follows from L and the belt's own
                angular momentum
    belt step   implicit midpoint in the frame that turns with W, K' = K - W^2 S:
                (2 M/h + 2 W G + C + h/2 K') (v1 - v0) = 2 M u0 - h K' v0
                u1 = 2 (v1 - v0)/h - u0

Both parts are symplectic: without damping and friction energy does not drift. Stable as long as the
kicks are: h < 2/sqrt((k_t + C_x)/rho A).
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

from tirelog.kernels import compiled
from tirelog.simulation.rolling.belt import HALF, apply_circulant, invert, solve
from tirelog.vocabulary.arrays import FloatArray, Record, Records

#: functions that live on an element
LIVING = 6
#: spin [rad/s] by which the belt's inverse may be out of date
STALE = 2e-3
#: angle from the bottom beyond which nothing may touch [rad], and height above the road below which
#: points are looked at, over R
FAR, NEAR = 0.9, 0.02

#: a tire on its road: belt's radius; stiffness of tread springs and bristles, friction; distance of
#: tread points; the hub's mass and inertia, the whole spin's inertia; how the belt's centre is
#: carried by a coefficient and pulled by the hub; the sidewall's spring and damper between hub and
#: a coefficient; the belt's inertia per coefficient; the hub's damper; top, amplitude and wave
#: number of the road
CONSTANTS = np.dtype(
    [("radius_m", "f8"), ("pressed_N_m2", "f8"), ("bristle_N_m2", "f8"), ("friction", "f8"),
     ("pitch_m", "f8"), ("hub_mass_kg", "f8"), ("hub_inertia_kg_m2", "f8"),
     ("spin_inertia_kg_m2", "f8"), ("carried_kg", "f8"), ("translation", "f8"),
     ("spring_N_m", "f8"), ("damper_N_s_m", "f8"), ("mean_inertia_kg", "f8"),
     ("hub_damping_N_s_m", "f8"), ("top_m", "f8"), ("amplitude_m", "f8"), ("wave_1_m", "f8")]
)  # fmt: skip
#: what moves beside the belt: wheel angle, spin, the spin's momentum; the hub's height, its rate,
#: its way forward; the spin that the belt's inverse holds at; the damper's impulse on the hub, and
#: the spin's change over the last belt step
STATE = np.dtype(
    [("angle_rad", "f8"), ("spin_rad_s", "f8"), ("momentum_N_m_s", "f8"), ("hub_z_m", "f8"),
     ("hub_rate_m_s", "f8"), ("hub_x_m", "f8"), ("inverted_at_rad_s", "f8"),
     ("hub_impulse_N_s", "f8"), ("drift_rad_s", "f8")]
)  # fmt: skip
#: a tread point: deflection of its bristle, its place along the road and its height when it was
#: seen last, at the step `seen`
POINT = np.dtype([("bristle_m", "f8"), ("along_m", "f8"), ("height_m", "f8"), ("seen", "i8")])
#: what the road does: torque on the wheel, force backwards and upwards, edges of the contact behind
#: the axle (NaN in the air)
CONTACT = np.dtype(
    [("torque_N_m", "f8"), ("force_s_N", "f8"), ("force_z_N", "f8"), ("entry_m", "f8"),
     ("exit_m", "f8")]
)  # fmt: skip
#: what one step is driven with: distance at its end, forward acceleration, load, torque
DRIVE = np.dtype(
    [("distance_m", "f8"), ("acceleration_m_s2", "f8"), ("load_N", "f8"), ("torque_N_m", "f8")]
)
#: the motion at one moment
MOMENT = np.dtype(
    [("angle_rad", "f8"), ("spin_rad_s", "f8"), ("hub_z_m", "f8"), ("force_x_N", "f8"),
     ("force_z_N", "f8"), ("entry_m", "f8"), ("exit_m", "f8"), ("spindle_x_N", "f8"),
     ("spindle_z_N", "f8")]
)  # fmt: skip
#: a direction, as cosine and sine of its angle
DIRECTION = np.dtype([("cos", "f8"), ("sin", "f8")])


#: the functions that live on an element at its tread points, and their slopes; (points, LIVING)
Basis: TypeAlias = tuple[FloatArray, FloatArray]


class Stencils(NamedTuple):
    """The belt's circulants, (11,) each: inertia M, swirl G, centrifugal S, K, damping C.

    `cosines` and `sines`: as of `belt.waves_of`.
    """

    inertia: FloatArray
    swirl: FloatArray
    centrifugal: FloatArray
    stiffness: FloatArray
    damping: FloatArray
    cosines: FloatArray
    sines: FloatArray


# what a run returns
FINE, TOO_WIDE, FLOWN = range(3)


@compiled
def road_at(
    x: float, corner: FloatArray, height: FloatArray, constants: Record
) -> tuple[float, float]:
    """Height [m] and slope of the road at the distance x [m].

    Straight between its corners (c,), `height` (c,) there [m]; beyond them level. From the first
    corner on the waves of `constants`, one CONSTANTS, are added.
    """
    high, slope = height[0], 0.0
    if x >= corner[-1]:
        high = height[-1]
    elif x > corner[0]:
        i = np.searchsorted(corner, x, side="right") - 1
        slope = (height[i + 1] - height[i]) / (corner[i + 1] - corner[i])
        high = height[i] + slope * (x - corner[i])
    if x > corner[0] and constants["amplitude_m"] != 0.0:
        q, amplitude = constants["wave_1_m"], constants["amplitude_m"]
        high += amplitude * (1.0 - np.cos(q * (x - corner[0])))
        slope += amplitude * q * np.sin(q * (x - corner[0]))
    return high, slope


@compiled
def touch(
    v: FloatArray, state: Record, constants: Record, basis: Basis, circle: Records,
    corner: FloatArray, height: FloatArray, tread: Records, now: int, load: FloatArray,
    result: Record,
) -> int:  # fmt: skip
    """The road's forces on the belt, and the edges of the contact; FINE, TOO_WIDE or FLOWN.

    v             (N,) coefficients [m]; `state` one STATE, `constants` one CONSTANTS
    circle        (points,) of DIRECTION: the tread points on a wheel at angle 0
    corner, height  (c,) [m]: the road between its corners
    tread         (points,) of POINT, of which those near the road are looked at at step `now`
    load          (N,) [N] on the coefficients, filled; `result`: one CONTACT, filled
    """
    basis_value, basis_slope = basis
    size, points, per = v.size, circle.size, basis_value.shape[0]
    radius, angle, pitch = constants["radius_m"], state["angle_rad"], constants["pitch_m"]
    hub_x, hub_z = state["hub_x_m"], state["hub_z_m"]
    load[:] = 0.0
    result["torque_N_m"], result["force_s_N"], result["force_z_N"] = 0.0, 0.0, 0.0
    result["entry_m"], result["exit_m"] = np.nan, np.nan
    low = (hub_z - constants["top_m"]) / radius - NEAR
    if low >= 1.0:
        return FINE
    reach = min(np.arccos(max(low, -1.0)), FAR)
    spacing = 2.0 * np.pi / points
    first = int(np.ceil((-reach - angle) / spacing - 0.5))
    last = int(np.floor((reach - angle) / spacing - 0.5))
    turn_c, turn_s = np.cos(angle), np.sin(angle)
    stiffness, cling = constants["pressed_N_m2"], constants["bristle_N_m2"]
    pressed, stuck = stiffness * pitch, cling * pitch
    around = np.concatenate((v[-HALF:], v))
    before_depth = before_s = 0.0
    j = (first - 1) % points
    element, q = j // per, j % per
    for number in range(first, last + 1):
        # on to the next point, without divisions
        j, q = j + 1, q + 1
        if q == per:
            element, q = element + 1, 0
        if j == points:
            j, element = 0, 0
        at, point = circle[j], tread[j]
        cos = at["cos"] * turn_c - at["sin"] * turn_s
        sin = at["sin"] * turn_c + at["cos"] * turn_s
        along = out = 0.0
        for k in range(LIVING):
            along += basis_value[q, k] * around[element + k]
            out -= basis_slope[q, k] * around[element + k]
        s = (radius + out) * sin + along * cos
        z = hub_z - (radius + out) * cos + along * sin
        high, slope = road_at(hub_x - s, corner, height, constants)
        depth = high - z
        known, bristle = point["seen"] == now - 1, point["bristle_m"]
        was_s, was_z = point["along_m"], point["height_m"]
        point["seen"], point["bristle_m"] = now, 0.0
        point["along_m"], point["height_m"] = s - hub_x, z
        if depth > 0.0:
            if number in (first, last):
                return TOO_WIDE if reach >= FAR else FLOWN
            if np.isnan(result["entry_m"]):
                result["entry_m"] = s - (s - before_s) * depth / (depth - before_depth)
            long = np.sqrt(1.0 + slope * slope)
            force_s, force_z = pressed * depth * slope, pressed * depth
            if cling > 0.0:
                if known:
                    bristle += (s - hub_x - was_s - slope * (z - was_z)) / long
                limit = constants["friction"] * stiffness * depth * long / cling
                bristle = min(max(bristle, -limit), limit)
                point["bristle_m"] = bristle
                force_s -= stuck * bristle / long
                force_z += stuck * bristle * slope / long
            tangential, radial = force_s * cos + force_z * sin, force_s * sin - force_z * cos
            for k in range(LIVING):
                load[(element + k - HALF) % size] += (
                    tangential * basis_value[q, k] - radial * basis_slope[q, k]
                )
            result["torque_N_m"] += (radius + out) * tangential - along * radial
            result["force_s_N"] += force_s
            result["force_z_N"] += force_z
        elif before_depth > 0.0:
            result["exit_m"] = s - (s - before_s) * depth / (depth - before_depth)
        before_depth, before_s = depth, s
    return FINE


@compiled
def kick(
    v: FloatArray, u: FloatArray, state: Record, constants: Record, stencils: Stencils,
    middles: Records, mass: FloatArray, order: Record, step: float, torque: float, load: FloatArray,
) -> tuple[float, float, float]:  # fmt: skip
    """The sidewall's force on the hub backwards and upwards, and the spin.

    Takes the impulses of the road (`load` [N] on the coefficients, `torque` [N m]), of hub and
    drive (`order`, one DRIVE) over one step [s]. Then takes the spin that follows, and leaves that
    of the next belt step's middle. `v` (N,) [m], `u` (N,) [m/s]; `middles` (N,) of DIRECTION.
    """
    kicked, swirled = np.empty(v.size), np.empty(v.size)
    spun, pulling, spring = np.empty(v.size), np.empty(v.size), constants["spring_N_m"]
    turn_c, turn_s = np.cos(state["angle_rad"]), np.sin(state["angle_rad"])
    sum_c = sum_s = 0.0
    for j in range(v.size):
        sum_c += v[j] * middles[j]["cos"]
        sum_s += v[j] * middles[j]["sin"]
    back, up = sum_c * turn_c - sum_s * turn_s, sum_s * turn_c + sum_c * turn_s
    # hub: the spring's force at this place, the damper's impulse of the last belt step
    held = spring * up + state["hub_impulse_N_s"] / step
    damped = constants["hub_damping_N_s_m"] * state["hub_rate_m_s"]
    rigid_z = (held - order["load_N"] - damped) / constants["hub_mass_kg"]
    state["hub_rate_m_s"] += step * rigid_z
    # the hub moves backwards at minus the drive's acceleration; the belt, seen from it, the other
    # way
    rigid_s = -order["acceleration_m_s2"]
    along_s, along_c = rigid_z * turn_c - rigid_s * turn_s, rigid_z * turn_s + rigid_s * turn_c
    solve(mass, load, kicked)
    pull = constants["translation"]
    for j in range(v.size):
        at = middles[j]
        kicked[j] = u[j] + step * (kicked[j] - pull * (along_s * at["sin"] + along_c * at["cos"]))
    off = constants["carried_kg"] * (back * rigid_z - up * rigid_s)
    momentum = state["momentum_N_m_s"]
    state["momentum_N_m_s"] += step * (order["torque_N_m"] + torque - off)
    # spin: L = (J + v S v) W + u G v + R m u, and a change of spin kicks the belt by -(G v + R m)
    apply_circulant(stencils.swirl, v, swirled)
    solve(mass, swirled, spun)
    apply_circulant(stencils.centrifugal, v, pulling)
    pulled = own = carried = carried_before = mean = mean_before = 0.0
    for j in range(v.size):
        pulled += v[j] * pulling[j]
        own += spun[j] * swirled[j]
        carried += kicked[j] * swirled[j]
        carried_before += u[j] * swirled[j]
        mean += kicked[j]
        mean_before += u[j]
    radius = constants["radius_m"]
    arm = radius * constants["mean_inertia_kg"]
    left = (
        momentum
        - (constants["spin_inertia_kg_m2"] + pulled) * state["spin_rad_s"]
        - carried_before
        - arm * mean_before
    )
    yielding = constants["hub_inertia_kg_m2"] + pulled - own
    # what the spin has changed by over the last belt step, which was taken at the spin of its
    # middle
    state["drift_rad_s"] = left / yielding + 0.5 * state["drift_rad_s"]
    new = state["momentum_N_m_s"]
    left += new - momentum - carried + carried_before - arm * (mean - mean_before)
    change = left / yielding
    now = state["spin_rad_s"] + 0.5 * change
    change += 0.5 * state["drift_rad_s"]
    state["spin_rad_s"] += change
    u[:] = kicked - change * (spun + radius)
    return spring * back, held, now


@compiled
def belt_step(
    v: FloatArray, u: FloatArray, state: Record, constants: Record, stencils: Stencils,
    middles: Records, system: FloatArray, step: float, place: FloatArray,
) -> None:  # fmt: skip
    """Move belt, wheel and hub on by a step [s] at a steady spin.

    `v` (N,) [m] and `u` (N,) [m/s] become those at the step's end; `place` (11,) keeps the stencil
    K - W^2 S. Arguments as of `kick`.
    """
    right, pushed, moved = np.empty(v.size), np.empty(v.size), np.empty(v.size)
    spin = state["spin_rad_s"]
    if not abs(spin - state["inverted_at_rad_s"]) < STALE:
        state["inverted_at_rad_s"] = spin
        place[:] = stencils.stiffness - spin * spin * stencils.centrifugal
        whole = (
            2.0 * stencils.inertia / step
            + 2.0 * spin * stencils.swirl
            + stencils.damping
            + 0.5 * step * place
        )
        invert(whole, stencils.cosines, stencils.sines, system)
    apply_circulant(stencils.inertia, u, right)
    apply_circulant(place, v, pushed)
    solve(system, 2.0 * right - step * pushed, moved)
    middle = state["angle_rad"] + 0.5 * step * spin
    half_c, half_s = np.cos(middle), np.sin(middle)
    sum_c = sum_s = 0.0
    for j in range(v.size):
        v[j] += moved[j]
        u[j] = 2.0 * moved[j] / step - u[j]
        sum_c += moved[j] * middles[j]["cos"]
        sum_s += moved[j] * middles[j]["sin"]
    state["hub_impulse_N_s"] = constants["damper_N_s_m"] * (sum_s * half_c + sum_c * half_s)
    state["angle_rad"] += step * spin
    state["hub_z_m"] += step * state["hub_rate_m_s"]


@compiled
def run_steps(
    v: FloatArray, u: FloatArray, state: Record, constants: Record, stencils: Stencils,
    basis: Basis, circle: Records, middles: Records, corner: FloatArray, height: FloatArray,
    tread: Records, drive: Records, riders: FloatArray, step: float, now: int, every: int,
    result: Record, motion: Records, read: FloatArray,
) -> int:  # fmt: skip
    """Moves the tire on by drive.size steps of `step` [s]; FINE, TOO_WIDE or FLOWN.

    drive    (n,) of DRIVE
    motion   (n/every,) of MOMENT, of every `every`-th moment; read (n/every, k) what the riders
             (k, N) read of the coefficients
    middles  (N,) of DIRECTION: the middles of the functions; `result`: room for one CONTACT
    The others as of `touch` and `kick`; the arrays of what moves hold the end when it returns.
    """
    size = v.size
    mass, system = np.empty(2 * size), np.empty(2 * size)
    load, place = np.zeros(size), np.zeros(2 * HALF + 1)
    invert(stencils.inertia, stencils.cosines, stencils.sines, mass)
    state["inverted_at_rad_s"] = np.inf
    for index in range(drive.size):
        told = touch(
            v, state, constants, basis, circle, corner, height, tread, now + index, load,
            result,
        )  # fmt: skip
        if told != FINE:
            return told
        row = index // every
        kept = index % every == 0
        if kept:
            moment = motion[row]
            moment["angle_rad"], moment["hub_z_m"] = state["angle_rad"], state["hub_z_m"]
            moment["force_x_N"], moment["force_z_N"] = -result["force_s_N"], result["force_z_N"]
            moment["entry_m"], moment["exit_m"] = result["entry_m"], result["exit_m"]
            for k in range(riders.shape[0]):
                read[row, k] = np.dot(riders[k], v)
        back, up, spin = kick(
            v, u, state, constants, stencils, middles, mass, drive[index], step,
            result["torque_N_m"], load,
        )  # fmt: skip
        if kept:
            moment = motion[row]
            moment["spin_rad_s"], moment["spindle_x_N"], moment["spindle_z_N"] = spin, -back, up
            # a belt that is half a radius off its hub has no small displacements
            most = 0.25 * constants["spring_N_m"] * size * constants["radius_m"]
            if not abs(back) + abs(up) < most:
                return FLOWN
        belt_step(v, u, state, constants, stencils, middles, system, step, place)
        state["hub_x_m"] = drive[index]["distance_m"]
    return FINE
