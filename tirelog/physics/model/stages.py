"""The stages of a prediction: load -> pressure -> structure -> sensor.

Each is a function of the values that it reads.

Everything here works on one block of revolutions as columns (`Drive`). `Task.memo` keeps each stage
by the values it read, so that a derivative recomputes only the stages that its parameter touches.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Concatenate, ParamSpec, TypeAlias, TypeVar, cast

import numpy as np

from tirelog.errors import ModelError
from tirelog.physics.carcass import contact, structures
from tirelog.physics.carcass.numbers import FASTEST_HZ
from tirelog.physics.effects import conditions_read
from tirelog.physics.effects.base import Drive, Effect, Site, Structure, Values
from tirelog.physics.pressure import line, parabola, tilted_parabola
from tirelog.physics.spectral import MODES, ComplexArray
from tirelog.vocabulary.arrays import FloatArray, IntArray
from tirelog.vocabulary.units import STANDARD_GRAVITY_M_S2

More = ParamSpec("More")
Rows = TypeVar("Rows", FloatArray, ComplexArray)
Result = TypeVar("Result")
#: an effect that is on, with its own values
Active: TypeAlias = tuple[Effect, Values]


@dataclass(frozen=True)
class Task:
    """What to compute: carcass, effects, conditions and observable.

    The carcass comes with its numbers; `active` are the effects that are on (by id), each with its
    own values. `point`: the pressure of the patch without effects is a line across the tread.
    `near`: the same with values a small step away, about which a contact may be taken as linear.
    """

    carcass: str
    flat_road: bool
    base: Mapping[str, float]
    active: Sequence[Active]
    drive: Drive
    memo: dict[Any, Any] = field(default_factory=dict)
    point: bool = False
    near: Task | None = None

    def having(self, *hooks: str) -> list[Active]:
        """The effects that enter by one of these hooks, with their values."""
        return [
            (effect, values)
            for effect, values in self.active
            if any(getattr(effect, hook) is not None for hook in hooks)
        ]

    def values_of(self, effect: str) -> Values | None:
        """The values of the effect of this id if it is on."""
        return next((values for own, values in self.active if own.id == effect), None)

    def hooks(
        self, hook: Callable[[Effect], Callable[Concatenate[Values, Drive, More], Result] | None]
    ) -> dict[str, Callable[More, Result]]:
        """One hook of the effects that have it, by their ids, given their values and conditions.

        `hook` names it by what it takes from an effect, as in `task.hooks(lambda e: e.gain)`: so
        its type is checked where it is called. What remains to be given is the site and what
        follows it.
        """
        return {
            effect.id: partial(found, values, self.drive)
            for effect, values in self.active
            if (found := hook(effect)) is not None
        }

    def key(self, names: Sequence[str] | None, *hooks: str) -> tuple[Any, ...]:
        """The values that a stage reads, as a key.

        The named base values (all of them for None) and the values of the effects with these hooks.
        """
        base = (
            tuple(self.base.items())
            if names is None
            else tuple(self.base.get(name) for name in names)
        )
        return base, tuple((effect.id, *values.values()) for effect, values in self.having(*hooks))

    def once(self, stage: str, key: tuple[Any, ...], compute: Callable[[], Result]) -> Result:
        """The stage's result, from the memo if the same values were read before."""
        if (stage, key) not in self.memo:
            self.memo[stage, key] = compute()
        return cast(Result, self.memo[stage, key])

    def under(self, name: str, key: tuple[Any, ...], drive: Drive) -> Task:
        """The task under other conditions, which are always the same for `name` and `key`."""
        memo = self.once(f"memo of {name}", key, lambda: dict[Any, Any]())
        near = None if self.near is None else replace(self.near, drive=drive, memo=memo)
        return replace(self, drive=drive, memo=memo, near=near)


def distinct(task: Task) -> tuple[Task, IntArray | None]:
    """The task with each distinct row once, and the place of every row among them (n,).

    Rows are distinct if belt or load can see the difference.

    None if none are alike, or nobody knows what an effect of the user's own reads.
    """
    on = task.having("structure", *LOAD_HOOKS, *PRESSURE_HOOKS)
    read = conditions_read(effect for effect, _ in on)
    if read is None:
        return task, None
    read |= {"load_N", "inflation_pressure_Pa"}
    if task.carcass == "beam" or any(task.base[name] for name in DAMPING_NAMES):
        read.add("speed_m_s")
    key = tuple(sorted(read))

    def found() -> tuple[Drive, IntArray | None]:
        drive, rows = task.drive.distinct(key)  # which are all if no two are alike
        return (task.drive, None) if rows.max(initial=-1) + 1 == rows.size else (drive, rows)

    drive, rows = task.once("distinct rows", key, found)
    return (task, None) if rows is None else (task.under("distinct rows", key, drive), rows)


def of_rows(found: Rows, rows: IntArray | None) -> Rows:
    """What was found of the distinct rows, of each row."""
    return found if rows is None or found.shape[0] == 1 else found[rows]


#: Parameters of the carcass and the load by the stage that reads them; the ring on a flat road
#: reads its carcass in the load stage too.
LOAD_NAMES = (
    "load_N",
    "reference_load_N",
    "patch_load_exponent",
    "reference_pressure_Pa",
    "patch_pressure_exponent",
    "patch_half_length_m",
    "radius_m",
)
STRUCTURE_NAMES = (
    "flexural_stiffness_N_m2",
    "foundation_stiffness_N_m2",
    "line_mass_kg_m",
    "radial_stiffness_N_m2",
    "tangential_stiffness_N_m2",
    "radial_damping_N_s_m2",
    "tangential_damping_N_s_m2",
    "inflation_pressure_Pa",
    "width_m",
    "radius_m",
)
FLAT_ROAD_NAMES = (*STRUCTURE_NAMES, "load_N", "tread_stiffness_N_m2")
#: the strain and its derivatives by xi, in their order
ALONG_STRAIN = ("strain", "strain_slope", "strain_curvature")
LOAD_HOOKS, PRESSURE_HOOKS = ("load", "added_load"), ("tilt", "pressure", "kernel", "traction")
DAMPING_NAMES = ("radial_damping_N_s_m2", "tangential_damping_N_s_m2")


def ring_carcass(task: Task) -> structures.RingCarcass:
    """The ring's constants at the model's own inflation pressure."""
    b = task.base
    return structures.RingCarcass(
        EI=b["flexural_stiffness_N_m2"],
        k_w=b["radial_stiffness_N_m2"],
        k_v=b["tangential_stiffness_N_m2"],
        c_w=b["radial_damping_N_s_m2"],
        c_v=b["tangential_damping_N_s_m2"],
        pb=b["inflation_pressure_Pa"] * b["width_m"],
        R=b["radius_m"],
        k_t=b.get("tread_stiffness_N_m2", np.inf),
    )


def loads(task: Task) -> FloatArray:
    """Load F [N] on the tire, (n or 1, 1), with its effects.

    The measured load, else the model's, times and plus what effects on the load do.
    """
    F = np.where(np.isfinite(task.drive.load_N), task.drive.load_N, task.base["load_N"])
    for change in task.hooks(lambda effect: effect.load).values():
        F = F * (1.0 + change())
    for added in task.hooks(lambda effect: effect.added_load).values():
        F = F + added()
    contact.check_load(float(F.min(initial=np.inf)))
    return F


def _load_key(task: Task, *hooks: str) -> tuple[Any, ...]:
    """The values that the load stage reads; on a flat road the belt's tension too."""
    if task.flat_road:
        return task.key(FLAT_ROAD_NAMES, *LOAD_HOOKS, "structure", *hooks)
    return task.key(LOAD_NAMES, *LOAD_HOOKS, *hooks)


def site_and_base_pressure(task: Task) -> tuple[Site, Any, ComplexArray | None]:
    """The patch and the modes of its pressure without effects.

    If an effect tilts the pressure, also the modes of the pressure times xi / L.
    """
    F, b = loads(task), task.base
    R = b["radius_m"]
    tilted = bool(task.having("tilt"))
    if task.flat_road:
        near = None if task.near is None else _contact_state(task.near, loads(task.near))
        half, modes, tilt = contact.pressure_modes(_contact_state(task, F), near, tilted=tilted)
        return Site(F, half, R, b.get("reference_load_N", b["load_N"])), modes, tilt
    half = b["patch_half_length_m"] * (F / b["reference_load_N"]) ** b["patch_load_exponent"]
    if b["patch_pressure_exponent"]:
        p = task.drive.inflation_pressure_Pa
        ratio = np.where(np.isfinite(p), p / b["reference_pressure_Pa"], 1.0)
        half = half * ratio ** -b["patch_pressure_exponent"]
    if np.any(half >= np.pi * R):
        raise ModelError(
            f"the patch of {2 * float(np.max(half)):.3g} m is longer than the circumference "
            f"{2 * np.pi * R:.3g} m",
            allowed="a shorter one is allowed",
            do="correct patch_half_length_m, load or radius_m",
        )
    even = (line if task.point else parabola)(F, half, R)
    site = Site(F, half, R, b["reference_load_N"])
    return site, even, tilted_parabola(F, half, R) if tilted else None


def _contact_state(task: Task, load_N: FloatArray) -> contact.ContactState:
    """What the contact with a flat road is solved for."""
    s = structure(task)
    pb = _inflation_pb(task) + s.tension / task.base["radius_m"]
    lost = np.concatenate(np.broadcast_arrays(*ring_losses(task, s)), axis=1)
    stiffer = np.atleast_2d(np.asarray(1.0 + s.stiffening, np.float64))
    _positive_foundation(stiffer)
    return contact.ContactState(ring_carcass(task), load_N, pb, lost, stiffer)


def ring_losses(task: Task, s: Structure) -> list[FloatArray]:
    """Strengths [N/m^2] of what takes power from a rolling ring, columns (n or 1, 1).

    In the order of `contact.LOSSES`.
    """
    b = task.base
    spin = task.drive.speed_m_s / b["radius_m"]
    radial = b["radial_damping_N_s_m2"] + 2.0 * b["line_mass_kg_m"] * s.damping_rate
    k_w = b["radial_stiffness_N_m2"] * (1.0 + s.stiffening) + s.added_stiffness
    EI = b["flexural_stiffness_N_m2"]
    strengths = (
        spin * radial if np.any(radial) else 0.0,
        spin * b["tangential_damping_N_s_m2"] if b["tangential_damping_N_s_m2"] else 0.0,
        s.loss * k_w,
        spin * s.retardation * EI if np.any(s.retardation) else 0.0,
    )
    return [np.atleast_2d(np.asarray(x, dtype=np.float64)) for x in strengths]


def leans(task: Task) -> bool:
    """Is the ring's waveform not even about the patch centre: by its pressure, or as it lags?

    What traction alone does follows the force, as the wind-up does that a phase shift has anyway.
    """
    lost = ring_losses(task, structure(task))
    return bool(task.having("tilt", "pressure")) or any(np.any(x) for x in lost)


def loaded_site(task: Task) -> tuple[Site, ComplexArray, ComplexArray | None]:
    """`site_and_base_pressure`, once per set of values."""
    key = (*_load_key(task), bool(task.having("tilt")))
    return task.once("site", key, lambda: site_and_base_pressure(task))


@dataclass(frozen=True)
class ContactLoads:
    """What the road does to the tread, modes (n or 1, K) [N/m].

    The pressure p, which carries F exactly; the traction tau along the road, positive in braking;
    and what tau does across the tread by its lever h, the `couple` h d tau / d xi (P2 (18)). The
    last two are None without traction.
    """

    pressure: ComplexArray
    traction: ComplexArray | None = None
    couple: ComplexArray | None = None

    @property
    def normal(self) -> ComplexArray:
        """Pressure and couple: all that acts across the tread."""
        return self.pressure if self.couple is None else self.pressure + self.couple


def pressure(task: Task) -> ContactLoads:
    """What the road does to the tread with all effects, once per set of values."""
    return task.once("pressure", _load_key(task, *PRESSURE_HOOKS), lambda: _pressure(task))


def _pressure(task: Task) -> ContactLoads:
    site, p, tilted = loaded_site(task)
    if not task.having(*PRESSURE_HOOKS):
        return ContactLoads(p)
    if tilted is not None:
        for tilt in task.hooks(lambda effect: effect.tilt).values():
            p = p - tilt() * tilted
    for added in task.hooks(lambda effect: effect.pressure).values():
        p = p + added(site)
    pulled = [pull(site) for pull in task.hooks(lambda effect: effect.traction).values()]
    shears = [shear for shear in pulled if shear is not None]
    tau, couple = None, None
    if shears:
        tau = np.asarray(sum(own for own, _ in shears), np.complex128)
        couple = np.asarray(sum((1j * x * site.q) * own for own, x in shears), np.complex128)
    for kernel in task.hooks(lambda effect: effect.kernel).values():
        smeared = kernel(site)
        p, couple = p * smeared, None if couple is None else couple * smeared
    carried = 2.0 * np.pi * site.radius_m * p[:, :1].real
    if not np.all(carried > 0.0):
        raise ModelError(
            "the effects on the contact pressure lift the tire off the road",
            allowed="a pressure that carries the load is allowed",
            do="lower their strength",
        )
    scale = site.load_N / carried
    return ContactLoads(
        p * scale, None if tau is None else tau * scale, None if couple is None else couple * scale
    )


def load_on_carcass(task: Task) -> ComplexArray:
    """Modes of the inward load per length on the carcass.

    It is the pressure, on a ring with its tangential parts (`ring.equivalent_load`).
    """
    pressed = pressure(task)
    if task.carcass == "beam":
        return pressed.normal
    return task.once(
        "ring load",
        _load_key(task, *PRESSURE_HOOKS),
        lambda: structures.equivalent_load(pressed.normal, pressed.traction),
    )


def structure(task: Task) -> Structure:
    """The sum of what effects do to the carcass."""
    return sum((own() for own in task.hooks(lambda e: e.structure).values()), Structure())


def _inflation_pb(task: Task) -> FloatArray:
    """p0 b [N/m], (n or 1, 1): at the measured inflation pressure, else the model's."""
    known = task.drive.inflation_pressure_Pa
    return (
        np.where(np.isfinite(known), known, task.base["inflation_pressure_Pa"])
        * task.base["width_m"]
    )


def impedance(task: Task, s: Structure) -> FloatArray | ComplexArray:
    """Z (n or 1, K) [N/m^2] of the carcass itself, load per length over inward displacement."""
    b, c = task.base, task.drive.speed_m_s
    R, EI = b["radius_m"], b["flexural_stiffness_N_m2"]
    n = np.arange(MODES, dtype=np.float64)
    q = n / R
    yielding = 1.0 + s.shear * q**2  # EJ q^4 / (1 + l^2 q^2) in place of EJ q^4
    if task.carcass == "beam":
        mu = b["line_mass_kg_m"]
        k = b["foundation_stiffness_N_m2"] * (1.0 + s.stiffening) + s.added_stiffness
        hoop = s.tension - mu * c**2
        _positive_foundation(k)
        if s.ring < 1.0:
            structures.refuse_supercritical(c, hoop, EI, k, mu)
        Z = EI * q**4 / yielding + hoop * q**2 + k
        if np.any(s.by_waves):
            Z = Z + np.expm1(s.by_waves) * (EI * q**4 / yielding + s.tension * q**2 + k)
        Z = _holding(s, Z)
        # P1 (2), and (1 + tau c d/dxi) of (22); the mean deflection (n = 0) is not cycled
        lost = 2.0 * mu * c * s.damping_rate * q + s.retardation * c * q * (EI * q**4)
        lost = lost + s.loss * k * (n > 0)
        return Z + 1j * lost if np.any(lost) else Z
    n[0] = 1.0  # the mode that an inextensible belt does not have; its load is zero
    k_w = b["radial_stiffness_N_m2"] * (1.0 + s.stiffening) + s.added_stiffness
    k_v = b["tangential_stiffness_N_m2"] * (1.0 + s.stiffening)
    _positive_foundation(k_w)
    bending = (EI / R**4) * (1.0 - n**2) ** 2 / yielding
    tension = (_inflation_pb(task) * R + s.tension) / R**2
    static = bending + (n**2 - 1.0) * tension + k_w + k_v / n**2
    Z = _holding(s, static * np.exp(s.by_waves))
    losses = ring_losses(task, s)
    if not any(np.any(x) for x in losses):
        return Z
    radial_rate, tangential_rate, radial, bending_rate = losses
    turning = n * (radial_rate + bending_rate * (bending / EI)) + tangential_rate / n
    return Z + 1j * (turning + radial * (np.arange(MODES) > 0))


def _holding(s: Structure, Z: FloatArray) -> FloatArray:
    """Z itself; ModelError if a wave runs as fast as the tire rolls, in a belt that yields."""
    if (np.any(s.shear) or np.any(s.by_waves)) and not np.all(Z > 0.0):
        raise ModelError(
            "the belt is too soft in shear, or in its form, to carry waves at this speed",
            allowed="a speed below the belt's critical one is allowed",
            do="lower belt_shear.length_m or the speed, or take stiffer numbers of form",
        )
    return Z


def _positive_foundation(k: FloatArray | float) -> None:
    if not np.all(np.asarray(k) > 0.0):
        raise ModelError(
            "the foundation's stiffness falls to zero or below under the effects",
            allowed="a positive stiffness is allowed",
            do="lower their strength",
        )


#: inward displacement and curvature (strain per lever arm) per load, of each mode (n or 1, K)
Response: TypeAlias = tuple[FloatArray | ComplexArray, FloatArray | ComplexArray]


def response(task: Task) -> Response:
    """What the carcass makes of a unit load [N/m], once per set of values.

    The curvature is that of a belt that does not yield in shear.
    """
    return task.once("response", task.key(STRUCTURE_NAMES, "structure"), lambda: _response(task))


def _response(task: Task) -> Response:
    s, R = structure(task), task.base["radius_m"]
    q2, Z = (np.arange(MODES) / R) ** 2, impedance(task, s)
    if task.carcass == "ring":
        w = 1.0 / Z
        return w, w * (q2 - 1.0 / R**2)
    if s.ring == 0.0:
        return 1.0 / Z, q2 / Z
    closed = closed_ring(task, Z, s)
    share = float(s.ring)
    w = (1.0 - share) / Z + share * closed
    bent = (1.0 - share) * (q2 / Z) + share * (q2 - 1.0 / R**2) * closed
    return w, bent


def closed_ring(
    task: Task, Z: FloatArray | ComplexArray, s: Structure
) -> FloatArray | ComplexArray:
    """1 / (Z_n / n^2) of the ring that the beam closes to (`ring`).

    It has the same EJ, k, tension, damping and loss, and no inertia left.

    Differs from the beam's Z by EJ (1 - 2 n^2) / R^4 - T / R^2 + mu c^2 q^2 + k_v / n^2.
    """
    b, R = task.base, task.base["radius_m"]
    n = np.arange(MODES, dtype=np.float64)
    n[0] = 1.0
    tangential = s.ring_tangential / s.ring
    more = b["flexural_stiffness_N_m2"] * (1.0 - 2.0 * n**2) / R**4 - s.tension / R**2
    Z_ring = (
        Z + more + b["line_mass_kg_m"] * task.drive.speed_m_s**2 * (n / R) ** 2 + tangential / n**2
    )
    closed = 1.0 / Z_ring
    closed[:, 0] = 0.0
    return closed


def waveform(
    task: Task, observable: str, lever_m: float
) -> tuple[ComplexArray, FloatArray | float]:
    """Modes of the waveform (n or 1, K) and the baseline (n or 1, 1) that is added to it.

    `observable` is one of

        strain                   at the signed `lever_m`; its slope [1/m], curvature [1/m^2]
        radial_acceleration      [m/s^2], outward positive (errata)
        frame_acceleration       the part of it that is no motion of the tread
        displacement             [m], inward
        tangential_displacement  [m], in the direction of passing
        contact_pressure, shear_traction  [N/m]
    """
    if observable == "contact_pressure":
        return pressure(task).pressure, 0.0
    if observable == "shear_traction":
        tau = pressure(task).traction
        return np.zeros((1, MODES), np.complex128) if tau is None else tau, 0.0
    if observable == "frame_acceleration":
        return accelerometer(task, sensed(task, frame_acceleration(task))) * gain(task), 0.0
    if observable == "displacement":
        return inward(task), 0.0
    if observable == "tangential_displacement":
        return tangential(task), 0.0
    if observable in ALONG_STRAIN[1:]:
        modes, _ = waveform(task, "strain", lever_m)
        along = (1j * np.arange(MODES) / task.base["radius_m"]) ** ALONG_STRAIN.index(observable)
        return modes * along, 0.0
    if observable == "strain":
        few, rows = distinct(task)
        modes = hardened(few) * (lever_m * response(few)[1])
        sheared, q = structure(few).shear, np.arange(MODES) / task.base["radius_m"]
        if np.any(sheared):  # the cross-section turns by less than the slope
            modes = modes / (1.0 + sheared * q**2)
        modes = of_rows(modes, rows)
        modes = modes * lever_factor(task)
        for shorter in task.hooks(lambda effect: effect.shortening).values():
            modes = modes * (1.0 - shorter() / (abs(lever_m) or np.inf))
        pulled = pulled_along(few)
        if pulled is not None:
            modes = modes + 1j * q * of_rows(pulled, rows)
        return sensed(task, modes) * gain(task), baseline(task)
    spin, curved = task.drive.speed_m_s**2, bending(task)
    factor, seen = gain(task), sensed(task, curved * spin + frame_acceleration(task))
    return accelerometer(task, seen) * factor, turning_level(task) * factor


def pulled_along(task: Task) -> ComplexArray | None:
    """Modes (n or 1, K) of u [m], by which the traction pulls a beam along; None if not at all."""
    yields = [own(loaded_site(task)[0]) for own in task.hooks(lambda e: e.stretch).values()]
    if not yields:
        return None
    traction = pressure(task).traction
    return np.zeros((1, MODES), np.complex128) if traction is None else traction * yields[0]


def tangential(task: Task) -> ComplexArray:
    """Modes (n or 1, K) of v [m] of a ring, which its inextensible belt has: w = -dv/d theta (P3).

    Inward W_n = i n V_n; the mean is the wind-up of the traction on k_v, Z_0 (errata). Of a beam
    what the traction pulls it along by, if it stretches; else it is not known, NaN.
    """
    if task.carcass != "ring":
        along = pulled_along(task)
        return np.full((1, MODES), np.nan, np.complex128) if along is None else along
    w = inward(task)
    v = np.zeros(w.shape, np.complex128)
    v[:, 1:] = w[:, 1:] / (1j * np.arange(1, MODES))
    pressed = pressure(task)
    around = -pressed.normal[:, 1:2].imag  # p sin(phi) + tau cos(phi), on average
    if pressed.traction is not None:
        around = around + pressed.traction[:, 1:2].real
    v[:, :1] = around / task.base["tangential_stiffness_N_m2"]
    return v


def frame_acceleration(task: Task) -> ComplexArray:
    """Modes (n or 1, K) that a turning accelerometer reads if the tread keeps still in the wheel.

    It reads specific force, acceleration less gravity, here along the outward radius. The radius
    points down at the patch centre (phi = 0), as gravity does. It points backwards at phi = 90
    degrees, where the material has left the patch:

        -g cos(phi) - a_x sin(phi) = Re[(-g + i a_x) exp(i phi)]

    An acceleration of the vehicle that is not known counts as none.
    """
    a_x = np.nan_to_num(task.drive.acceleration_m_s2)
    modes = np.zeros((a_x.shape[0], MODES), np.complex128)
    modes[:, 1:2] = 0.5 * (-STANDARD_GRAVITY_M_S2 + 1j * a_x)
    return modes


def hardened(task: Task) -> ComplexArray:
    """Modes of the load on the carcass, less what a hardened foundation takes."""
    load, cubic = load_on_carcass(task), structure(task).cubic
    if not np.any(cubic):
        return load
    base = task.base
    k = base["foundation_stiffness_N_m2" if task.carcass == "beam" else "radial_stiffness_N_m2"]

    def balanced() -> ComplexArray:
        # what was found last for these rows differs by a step of a fit: a quarter fewer turns
        left, task.memo["balance"] = structures.hardened_load(
            load, response(task)[0], k * cubic, task.memo.get("balance")
        )
        return left

    key = _load_key(task, *PRESSURE_HOOKS), task.key(STRUCTURE_NAMES, "structure")
    return task.once("hardened", key, balanced)


def inward(task: Task) -> ComplexArray:
    """Modes of the belt's displacement towards the axle [m]."""
    return hardened(task) * response(task)[0]


def bending(task: Task) -> ComplexArray:
    """Modes of what the tread is less curved by than a circle, w'' + w / R^2 outwards [1/m]."""
    few, rows = distinct(task)
    load, (displacement, curvature) = hardened(few), response(few)
    if task.carcass == "ring":
        return of_rows(load * curvature, rows)
    return of_rows(load * (curvature - displacement / task.base["radius_m"] ** 2), rows)


def turning_level(task: Task) -> FloatArray:
    """What a turning accelerometer reads on average, -c^2 / R, (n or 1, 1).

    Of an AC-coupled one what its high-pass leaves of that while the speed changes slowly.
    """
    speed, R, coupling = task.drive.speed_m_s, task.base["radius_m"], task.base.get("coupling_Hz")
    if not coupling:
        return -(speed**2) / R
    rate = -2.0 * speed * np.nan_to_num(task.drive.acceleration_m_s2) / R
    return np.asarray(rate / (2.0 * np.pi * coupling), dtype=np.float64)


def accelerometer(task: Task, modes: ComplexArray) -> ComplexArray:
    """The waveform (n or 1, K) within the accelerometer's own band.

    A second-order low-pass (Butterworth), less the delay that it has at low frequencies: a delay
    moves the patch, and where that is counts from itself. A first-order high-pass.
    """
    low, high = task.base.get("bandwidth_Hz", FASTEST_HZ), task.base.get("coupling_Hz", 0.0)
    if low >= FASTEST_HZ and not high:
        return modes

    def passed() -> ComplexArray:
        turns = task.drive.speed_m_s / (2.0 * np.pi * task.base["radius_m"])
        frequency = turns * np.arange(MODES)
        x = frequency / low
        through = np.exp(1j * np.sqrt(2.0) * x) / (1.0 + 1j * np.sqrt(2.0) * x - x**2)
        if high:
            through = through * (frequency / (frequency - 1j * high))
        return np.asarray(through, dtype=np.complex128)

    key = task.key(("radius_m", "bandwidth_Hz", "coupling_Hz"))
    return modes * task.once("accelerometer", key, passed)


def gain(task: Task) -> FloatArray | float:
    """What effects on the sensor multiply its whole reading by, (n or 1, 1)."""
    return math.prod(own() for own in task.hooks(lambda effect: effect.gain).values())


def lever_factor(task: Task) -> FloatArray | float:
    """What effects multiply the lever arm by, (n or 1, 1)."""
    return math.prod(own() for own in task.hooks(lambda effect: effect.lever).values())


def sensed(task: Task, modes: ComplexArray) -> ComplexArray:
    """The waveform as grating and interrogator hand it on."""
    sensors = task.hooks(lambda effect: effect.transfer)
    if not sensors:
        return modes
    site = loaded_site(task)[0]
    for name, transfer in sensors.items():
        key = task.key(("radius_m",), "transfer")
        modes = modes * task.once(f"sensor {name}", key, partial(transfer, site))
    return modes


def baseline(task: Task) -> FloatArray | float:
    """Strain (n or 1, 1) that is the same all around the revolution."""
    return sum((own() for own in task.hooks(lambda effect: effect.baseline).values()), 0.0)


def hub_forces(task: Task) -> FloatArray:
    """(F_x, F_z) [N] of a ring, (2, n or 1).

    `structures.ring_hub_forces` at the pressure and traction of the task.
    """
    pressed = pressure(task)
    carcass = ring_carcass(task)
    return np.stack(
        structures.ring_hub_forces(
            pressed.normal, pressed.traction, carcass, task.drive.speed_m_s[:, 0] / carcass.R
        )
    )
