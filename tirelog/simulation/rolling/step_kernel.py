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

import numpy as np

from tirelog.runtime import compiled
from tirelog.simulation.rolling.circulant_kernel import (
    HALF,
    Factors,
    apply_circulant,
    factor,
    factors,
    solve,
)
from tirelog.vocabulary.arrays import FloatArray, IntArray

#: functions that live on an element
LIVING = 6
#: spin [rad/s] by which the belt's factors may be out of date
STALE = 2e-3
#: angle from the bottom beyond which nothing may touch [rad], and height above the road below which
#: points are looked at, over R
FAR, NEAR = 0.9, 0.02

# places in `constants`
RADIUS, PRESSED, BRISTLE, FRICTION, PITCH, HUB_MASS, HUB_INERTIA, SPIN_INERTIA = range(8)
CARRIED, TRANSLATION, SPRING, DAMPER, MEAN_INERTIA, HUB_DAMPING, TOP, AMPLITUDE, WAVE = range(8, 17)
# places in `state`
ANGLE, SPIN, MOMENTUM, HUB_Z, HUB_RATE, HUB_X, FACTORED_AT, HUB_IMPULSE, DRIFT = range(9)
# columns of the motion; riders' readings follow
(
    OUT_ANGLE,
    OUT_SPIN,
    OUT_HUB_Z,
    OUT_FORCE_X,
    OUT_FORCE_Z,
    OUT_ENTRY,
    OUT_EXIT,
    OUT_SPINDLE_X,
    OUT_SPINDLE_Z,
) = range(9)
COLUMNS = 9
# what a run returns
FINE, TOO_WIDE, FLOWN = range(3)


@compiled
def road_at(
    x: float, corner: FloatArray, height: FloatArray, constants: FloatArray
) -> tuple[float, float]:
    """Height [m] and slope of the road at the distance x [m]."""
    high, slope = height[0], 0.0
    if x >= corner[-1]:
        high = height[-1]
    elif x > corner[0]:
        i = np.searchsorted(corner, x, side="right") - 1
        slope = (height[i + 1] - height[i]) / (corner[i + 1] - corner[i])
        high = height[i] + slope * (x - corner[i])
    if x > corner[0] and constants[AMPLITUDE] != 0.0:
        q = constants[WAVE]
        high += constants[AMPLITUDE] * (1.0 - np.cos(q * (x - corner[0])))
        slope += constants[AMPLITUDE] * q * np.sin(q * (x - corner[0]))
    return high, slope


@compiled
def touch(
    v: FloatArray, state: FloatArray, constants: FloatArray, basis: FloatArray, circle: FloatArray,
    corner: FloatArray, height: FloatArray, tread: FloatArray, seen: IntArray, now: int,
    load: FloatArray, result: FloatArray,
) -> int:  # fmt: skip
    """The road's forces on the belt, and the edges of the contact.

    `load` (N,) on the coefficients; `result` (5,): torque, force backwards and upwards, entry and
    exit behind the axle [m] (NaN in the air). `tread` (points, 3) holds bristle, place along the
    road and height of what was seen at step `seen`.
    """
    size, points, per = v.size, circle.shape[0], basis.shape[1]
    radius, angle, pitch = constants[RADIUS], state[ANGLE], constants[PITCH]
    load[:] = 0.0
    result[:3] = 0.0
    result[3:] = np.nan
    low = (state[HUB_Z] - constants[TOP]) / radius - NEAR
    if low >= 1.0:
        return FINE
    reach = min(np.arccos(max(low, -1.0)), FAR)
    spacing = 2.0 * np.pi / points
    first = int(np.ceil((-reach - angle) / spacing - 0.5))
    last = int(np.floor((reach - angle) / spacing - 0.5))
    turn_c, turn_s = np.cos(angle), np.sin(angle)
    pressed, stuck = constants[PRESSED] * pitch, constants[BRISTLE] * pitch
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
        cos = circle[j, 0] * turn_c - circle[j, 1] * turn_s
        sin = circle[j, 1] * turn_c + circle[j, 0] * turn_s
        along = out = 0.0
        if element >= HALF:
            for k in range(LIVING):
                c = v[element + k - HALF]
                along += basis[0, q, k] * c
                out -= basis[1, q, k] * c
        else:
            for k in range(LIVING):
                c = v[(element + k - HALF) % size]
                along += basis[0, q, k] * c
                out -= basis[1, q, k] * c
        s = (radius + out) * sin + along * cos
        z = state[HUB_Z] - (radius + out) * cos + along * sin
        high, slope = road_at(state[HUB_X] - s, corner, height, constants)
        depth = high - z
        known, was_s, was_z, bristle = seen[j] == now - 1, tread[j, 1], tread[j, 2], tread[j, 0]
        seen[j] = now
        tread[j, 0], tread[j, 1], tread[j, 2] = 0.0, s - state[HUB_X], z
        if depth > 0.0:
            if number in (first, last):
                return TOO_WIDE if reach >= FAR else FLOWN
            if np.isnan(result[3]):
                result[3] = s - (s - before_s) * depth / (depth - before_depth)
            long = np.sqrt(1.0 + slope * slope)
            force_s, force_z = pressed * depth * slope, pressed * depth
            if constants[BRISTLE] > 0.0:
                if known:
                    bristle += (s - state[HUB_X] - was_s - slope * (z - was_z)) / long
                limit = constants[FRICTION] * constants[PRESSED] * depth * long / constants[BRISTLE]
                bristle = min(max(bristle, -limit), limit)
                tread[j, 0] = bristle
                force_s -= stuck * bristle / long
                force_z += stuck * bristle * slope / long
            tangential, radial = force_s * cos + force_z * sin, force_s * sin - force_z * cos
            for k in range(LIVING):
                load[(element + k - HALF) % size] += (
                    tangential * basis[0, q, k] - radial * basis[1, q, k]
                )
            result[0] += (radius + out) * tangential - along * radial
            result[1] += force_s
            result[2] += force_z
        elif before_depth > 0.0:
            result[4] = s - (s - before_s) * depth / (depth - before_depth)
        before_depth, before_s = depth, s
    return FINE


@compiled
def kick(
    v: FloatArray, u: FloatArray, state: FloatArray, constants: FloatArray, stencils: FloatArray,
    middles: FloatArray, mass: Factors, order: FloatArray, step: float, torque: float,
    work: FloatArray,
) -> tuple[float, float, float]:  # fmt: skip
    """The sidewall's force on the hub backwards and upwards, and the spin.

    Takes the impulses of the road (`work[0]` on the coefficients, `torque`), of hub and drive
    (`order`: see `run_steps`) over one step, and the spin that follows; leaves the spin of the next
    belt step's middle.
    """
    load, kicked, swirled, spun, pulling = work[0], work[1], work[2], work[3], work[4]
    turn_c, turn_s = np.cos(state[ANGLE]), np.sin(state[ANGLE])
    sum_c = sum_s = 0.0
    for j in range(v.size):
        sum_c += v[j] * middles[j, 0]
        sum_s += v[j] * middles[j, 1]
    back, up = sum_c * turn_c - sum_s * turn_s, sum_s * turn_c + sum_c * turn_s
    # hub: the spring's force at this place, the damper's impulse of the last belt step
    held = constants[SPRING] * up + state[HUB_IMPULSE] / step
    rigid_z = (held - order[2] - constants[HUB_DAMPING] * state[HUB_RATE]) / constants[HUB_MASS]
    state[HUB_RATE] += step * rigid_z
    # the hub moves backwards at minus the drive's acceleration; the belt, seen from it, the other
    # way
    rigid_s = -order[1]
    along_s, along_c = rigid_z * turn_c - rigid_s * turn_s, rigid_z * turn_s + rigid_s * turn_c
    solve(mass, load, kicked)
    for j in range(v.size):
        kicked[j] = u[j] + step * (
            kicked[j] - constants[TRANSLATION] * (along_s * middles[j, 1] + along_c * middles[j, 0])
        )
    off = constants[CARRIED] * (back * rigid_z - up * rigid_s)
    momentum = state[MOMENTUM]
    state[MOMENTUM] += step * (order[3] + torque - off)
    # spin: L = (J + v S v) W + u G v + R m u, and a change of spin kicks the belt by -(G v + R m)
    apply_circulant(stencils[1], v, swirled)
    solve(mass, swirled, spun)
    apply_circulant(stencils[2], v, pulling)
    pulled = own = carried = carried_before = mean = mean_before = 0.0
    for j in range(v.size):
        pulled += v[j] * pulling[j]
        own += spun[j] * swirled[j]
        carried += kicked[j] * swirled[j]
        carried_before += u[j] * swirled[j]
        mean += kicked[j]
        mean_before += u[j]
    arm = constants[RADIUS] * constants[MEAN_INERTIA]
    left = (
        momentum
        - (constants[SPIN_INERTIA] + pulled) * state[SPIN]
        - carried_before
        - arm * mean_before
    )
    yielding = constants[HUB_INERTIA] + pulled - own
    # what the spin has changed by over the last belt step, which was taken at the spin of its
    # middle
    state[DRIFT] = left / yielding + 0.5 * state[DRIFT]
    left += state[MOMENTUM] - momentum - carried + carried_before - arm * (mean - mean_before)
    change = left / yielding
    now = state[SPIN] + 0.5 * change
    change += 0.5 * state[DRIFT]
    state[SPIN] += change
    for j in range(v.size):
        u[j] = kicked[j] - change * (spun[j] + constants[RADIUS])
    return constants[SPRING] * back, held, now


@compiled
def belt_step(
    v: FloatArray, u: FloatArray, state: FloatArray, constants: FloatArray, stencils: FloatArray,
    middles: FloatArray, system: Factors, step: float, work: FloatArray,
) -> None:  # fmt: skip
    """The belt moves on by a step at a steady spin, and wheel and hub with it.

    `work[5]` holds the stencil K - W^2 S.
    """
    right, pushed, moved, place = work[0], work[1], work[2], work[5, : 2 * HALF + 1]
    spin = state[SPIN]
    if not abs(spin - state[FACTORED_AT]) < STALE:
        state[FACTORED_AT] = spin
        for d in range(2 * HALF + 1):
            place[d] = stencils[3, d] - spin * spin * stencils[2, d]
            system[0][d] = (
                2.0 * stencils[0, d] / step
                + 2.0 * spin * stencils[1, d]
                + stencils[4, d]
                + 0.5 * step * place[d]
            )
        factor(system)
    apply_circulant(stencils[0], u, right)
    apply_circulant(place, v, pushed)
    for j in range(v.size):
        right[j] = 2.0 * right[j] - step * pushed[j]
    solve(system, right, moved)
    half_c, half_s = (
        np.cos(state[ANGLE] + 0.5 * step * spin),
        np.sin(state[ANGLE] + 0.5 * step * spin),
    )
    sum_c = sum_s = 0.0
    for j in range(v.size):
        v[j] += moved[j]
        u[j] = 2.0 * moved[j] / step - u[j]
        sum_c += moved[j] * middles[j, 0]
        sum_s += moved[j] * middles[j, 1]
    state[HUB_IMPULSE] = constants[DAMPER] * (sum_s * half_c + sum_c * half_s)
    state[ANGLE] += step * spin
    state[HUB_Z] += step * state[HUB_RATE]


@compiled
def run_steps(
    v: FloatArray, u: FloatArray, state: FloatArray, constants: FloatArray, stencils: FloatArray,
    basis: FloatArray, circle: FloatArray, middles: FloatArray, corner: FloatArray,
    height: FloatArray, tread: FloatArray, seen: IntArray, drive: FloatArray, riders: FloatArray,
    ridden: IntArray, step: float, now: int, every: int, motion: FloatArray,
) -> int:  # fmt: skip
    """Moves the tire on by drive.shape[0] steps.

    drive (n, 4): distance at the step's end [m], forward acceleration [m/s^2], load [N], torque [N
    m]. Every `every`-th moment goes to `motion` (n/every, 9 + riders): riders (k, w) read w
    coefficients from ridden (k,) on.

    `stencils` (5, 11): inertia M, swirl G, centrifugal S, stiffness K, damping C.
    """
    size = v.size
    mass, system, work, result = factors(size), factors(size), np.zeros((6, size)), np.zeros(5)
    mass[0][:] = stencils[0]
    factor(mass)
    state[FACTORED_AT] = np.inf
    for index in range(drive.shape[0]):
        told = touch(
            v,
            state,
            constants,
            basis,
            circle,
            corner,
            height,
            tread,
            seen,
            now + index,
            work[0],
            result,
        )
        if told != FINE:
            return told
        row = index // every
        kept = index % every == 0
        if kept:
            motion[row, OUT_ANGLE], motion[row, OUT_HUB_Z] = state[ANGLE], state[HUB_Z]
            motion[row, OUT_FORCE_X], motion[row, OUT_FORCE_Z] = -result[1], result[2]
            motion[row, OUT_ENTRY], motion[row, OUT_EXIT] = result[3], result[4]
            for k in range(riders.shape[0]):
                value = 0.0
                for i in range(riders.shape[1]):
                    value += riders[k, i] * v[(ridden[k] + i) % size]
                motion[row, COLUMNS + k] = value
        back, up, spin = kick(
            v, u, state, constants, stencils, middles, mass, drive[index], step, result[0], work
        )
        if kept:
            motion[row, OUT_SPIN], motion[row, OUT_SPINDLE_X], motion[row, OUT_SPINDLE_Z] = (
                spin,
                -back,
                up,
            )
            # a belt that is half a radius off its hub has no small displacements
            if not abs(back) + abs(up) < 0.25 * constants[SPRING] * size * constants[RADIUS]:
                return FLOWN
        belt_step(v, u, state, constants, stencils, middles, system, step, work)
        state[HUB_X] = drive[index, 0]
    return FINE
