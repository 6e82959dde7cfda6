"""What the road does to the carcass.

Contact pressure and friction on the grid, with the planted effects, in two forms each.

    base pressure p(xi) -> heavier side, pulses, wedges, wear -> smeared
        -> rescaled to carry the load -> friction of the bristles

Arrays are (b, points): b instants of the drive. Pressure is a line load [N/m], positive where the
road pushes the tread inwards.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from tirelog.simulation.scenario.schema import Planted
from tirelog.simulation.steady.operators import Ring
from tirelog.vocabulary.arrays import FloatArray

#: speed [m/s] at which what grows with speed has the size that is planted
REFERENCE_SPEED_M_S = 20.0
#: distance [km] after which planted wear has its full size
WORN_OUT_KM = 40000.0
#: a tread block that is struck at the entry: it dies away in [s], and swings at [Hz] (Heckl 1986)
_STRUCK_S, _STRUCK_HZ = 0.0015, 250.0
#: friction of bristles that adhere and of those that slide [N/N], on a road that the scenario says
#: nothing of
STATIC_FRICTION, SLIDING_FRICTION = 0.8, 0.6


@dataclass(frozen=True)
class Instants:
    """What holds at b instants, each field (b,).

    Time [s], speed [m/s], acceleration [m/s^2], load [N], half length of the patch [m], slip
    (braking > 0), the planted drift's course, the tire's rise of temperature [K], and the belt's
    length over that at rest. On a stretched belt the grid's lengths, and so `half_length` and
    `load` in `on_grid`, are those over the stretch.
    """

    time_s: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    load: FloatArray
    half_length: FloatArray
    slip: FloatArray
    warmed: FloatArray
    distance_km: float
    water_depth_mm: float
    reference_load: float | FloatArray
    temperature_K: FloatArray
    stretch: FloatArray

    def __len__(self) -> int:
        return int(self.time_s.size)

    @property
    def stretches(self) -> bool:
        return bool((self.stretch != 1.0).any())

    def on_grid(self) -> Instants:
        """The same in the grid's lengths: pressures [N/m] stay, so that forces shrink with them."""
        if not self.stretches:
            return self
        return replace(
            self,
            half_length=self.half_length / self.stretch,
            load=self.load / self.stretch,
            reference_load=self.reference_load / self.stretch,
        )

    def take(self, rows: slice) -> Instants:
        """Some of the instants."""
        arrays: Any = {
            f.name: value[rows]
            for f in fields(self)
            if isinstance(value := getattr(self, f.name), np.ndarray)
        }
        return replace(self, **arrays)


def true_parabola(ring: Ring, half_length: FloatArray, load: FloatArray) -> FloatArray:
    """Cell means of 3 F/(4 L^3) (L^2 - xi^2) inside +-L, shape (b, points)."""
    near = ring.window(float(half_length.max()))
    borders = ring.borders_m[near.start : near.stop + 1]
    x = np.clip(borders / half_length[:, None], -1.0, 1.0)
    p = np.zeros((half_length.size, ring.points))
    p[:, near] = np.diff(load[:, None] * (0.75 * x - 0.25 * x * x * x), axis=1) / ring.step_m
    return p


def _pulse(u: FloatArray) -> FloatArray:
    """u exp(1 - u) for u > 0: rises at once, one at u = 1, then dies away."""
    positive = np.maximum(u, 0.0)
    return positive * np.exp(1.0 - positive)


def _gauss(u: FloatArray) -> FloatArray:
    return np.exp(-0.5 * u**2)


def _heavier_side(effect: Planted, x: FloatArray, p: FloatArray, at: Instants) -> FloatArray:
    """p (1 - a xi/L); other: the asymmetry grows with the cube towards the edges."""
    shape = 0.3 * x + 1.3 * x**3 if effect.other else x
    return p * (1.0 - effect["offset"] * np.clip(shape, -3.0, 3.0))


def _impact(effect: Planted, x: FloatArray, p: FloatArray, at: Instants) -> FloatArray:
    """A pulse at the entry edge, ~ v; other: a sudden rise that dies away into the patch.

    apart: momentum of the blocks, ~ v^2, that swing on their own stiffness, fixed in time.
    """
    if effect.apart:
        late = (x + effect["position"]) * (at.half_length / np.maximum(at.speed, 1.0))[:, None]
        swing = np.where(
            late >= 0.0,
            np.exp(-np.maximum(late, 0.0) / _STRUCK_S) * np.cos(2.0 * np.pi * _STRUCK_HZ * late),
            0.0,
        )
        size = (at.speed / REFERENCE_SPEED_M_S) ** 2 * at.load / (2 * at.half_length)
        return p + effect["amplitude"] * size[:, None] * swing
    u = (x + effect["position"]) / effect["width"]
    shape = 1.05 * _pulse((u + 1.5) / 1.1) if effect.other else _gauss(u)
    return (
        p
        + effect["amplitude"]
        * (at.load / (2 * at.half_length) * at.speed / REFERENCE_SPEED_M_S)[:, None]
        * shape
    )


def _wedge(effect: Planted, x: FloatArray, p: FloatArray, at: Instants) -> FloatArray:
    """A hydrodynamic wedge ahead of the entry, ~ v^2 depth; other: a triangle of finite length."""
    u = (-1.0 - x) / effect["length"]
    triangle = np.clip(np.minimum(u / 0.7, (3.5 - u) / 2.8), 0.0, 1.0)
    shape = 1.3 * triangle if effect.other else _pulse(u)
    speeds = (at.speed / REFERENCE_SPEED_M_S) ** 2
    return (
        p
        + effect["amplitude"]
        * (at.load / (2 * at.half_length) * speeds * at.water_depth_mm)[:, None]
        * shape
    )


def _worn(effect: Planted, x: FloatArray, p: FloatArray, at: Instants) -> FloatArray:
    """More carried near the exit, ~ age; other: a rise towards the exit that ends at the edge."""
    u = (x - effect["position"]) / effect["width"]
    rise = np.where(
        np.abs(x) < 1.0, np.exp((np.minimum(x, 1.0) - 1.0) / (1.4 * effect["width"])), 0.0
    )
    shape = 1.25 * rise if effect.other else _gauss(u)
    age = at.distance_km / WORN_OUT_KM
    return p + effect["amplitude"] * age * (at.load / (2 * at.half_length))[:, None] * shape


def _saddle(effect: Planted, x: FloatArray, p: FloatArray, at: Instants) -> FloatArray:
    """Even: the shoulders of the patch carry more, ~ v^n F^m; apart: a rib of each shoulder does.

    Where the sidewall stands on the belt, within a tenth of the patch.
    """
    size = effect["a"] * _powers(effect, at)
    if effect.apart:
        ribs = np.where(np.abs(x) < 1.0, _gauss((np.abs(x) - 0.8) / 0.1) - 0.15, 0.0)
        return p * (1.0 + size[:, None] * ribs)
    return p * (1.0 + size[:, None] * np.where(np.abs(x) < 1.0, x**2 - 0.2, 0.0))


def _suction(effect: Planted, x: FloatArray, p: FloatArray, at: Instants) -> FloatArray:
    """Adhesion that pulls the tread behind the exit edge, ~ v^n."""
    size = effect["a"] * _powers(effect, at) * at.load / (2 * at.half_length)
    return p - size[:, None] * _pulse((x - 1.0) / effect["s"])


def _powers(effect: Planted, at: Instants) -> FloatArray:
    """(v/20)^n (F/F_ref)^m of an effect outside the catalogue, shape (b,)."""
    size = (np.maximum(at.speed, 1e-6) / REFERENCE_SPEED_M_S) ** effect["speed_exponent"]
    if "load_exponent" in effect.parameters:
        size = size * (at.load / at.reference_load) ** effect["load_exponent"]
    return size


_PRESSURE = {
    "pressure_offset": _heavier_side,
    "pressure_saddle": _saddle,
    "edge_impact": _impact,
    "water_film": _wedge,
    "wear": _worn,
    "exit_suction": _suction,
}


def pressure(
    ring: Ring, effects: tuple[Planted, ...], base: FloatArray, at: Instants
) -> FloatArray:
    """The base pressure (b, points) with each planted effect on it, rescaled to carry `at.load`."""
    changed = [effect for effect in effects if effect.name in _PRESSURE]
    smeared = next((effect for effect in effects if effect.name == "rough_contact"), None)
    p = base
    if changed:
        x = ring.xi_m / at.half_length[:, None]
        for effect in changed:
            p = _PRESSURE[effect.name](effect, x, p, at)
    if smeared is not None:
        p = _smear(ring, smeared, p, at)
    if p is not base:
        p = p * (at.load / (p.sum(axis=1) * ring.step_m))[:, None]
    return p


def _smear(ring: Ring, effect: Planted, p: FloatArray, at: Instants) -> FloatArray:
    """Convolution with exp(-|xi|/(s L)); other: a Gaussian of the same variance.

    apart: asperities that the entry presses flat and that keep flat, so that they smear the entry's
    half alone (contact grows with the load and does not shrink with it).
    """
    if effect.apart:
        smeared = _smear(ring, replace(effect, form="exact"), p, at)
        ahead = 0.5 - 0.5 * np.tanh(ring.xi_m / (0.3 * at.half_length[:, None]))
        return smeared * ahead + p * (1.0 - ahead)
    width = effect["length"] * at.half_length[:, None]
    # the kernel's transform by its values on the grid, not by a formula: exact mean over cells near
    # its cusp
    border = np.abs(ring.borders_m) / width
    if effect.other:
        kernel = np.exp(-0.25 * (ring.xi_m / width) ** 2)
    else:
        primitive = np.sign(ring.borders_m) * -np.expm1(-border)
        kernel = np.diff(primitive, axis=1)
    kernel = kernel / kernel.sum(axis=1, keepdims=True)
    return ring.inverse(ring.transform(p) * ring.transform(np.fft.ifftshift(kernel, axes=1)))


@dataclass(frozen=True)
class Friction:
    """Traction of the bristles.

    `tangential` (b, points) [N/m] towards the exit in braking; `radial` its load on the carcass
    [N/m]; `onset_m` (b,) where sliding begins, NaN if nothing slides.
    """

    tangential: FloatArray
    radial: FloatArray
    onset_m: FloatArray


def friction(ring: Ring, effect: Planted, p: FloatArray, at: Instants) -> Friction:
    """The bristles' traction: adhesion up to f_s p, then sliding f_d p.

    Adhesion is tau = sigma C_x (xi + L) (P2 13, 17); other: no jump at the onset, and a tread that
    yields.

    C_x = 2 gamma L f_s with gamma = 3 F/(4 L^3) as P2 (17) gives it, times
    `slip_stiffness_ratio`: a tread on a road of half the grip has twice that ratio. The load on the
    carcass is lever x d tau/d xi (P2 18), the jump at the onset as a point load (errata).
    """
    # the patch, and what smearing and wedges add around it
    near = ring.window(min(3.0 * float(at.half_length.max()), 0.49 * ring.circumference_m))
    borders = ring.borders_m[near.start : near.stop + 1]
    padded = np.concatenate((p, p[:, :1]), axis=1)
    middle = 0.5 * (padded[:, near.start - 1 : near.stop] + padded[:, near.start : near.stop + 1])
    tau, jump, onset = _traction(effect, borders, middle, at)
    tangential, radial = np.zeros_like(p), np.zeros_like(p)
    tangential[:, near] = 0.5 * (tau[:, :-1] + tau[:, 1:])
    slides = borders >= np.nan_to_num(onset, nan=np.inf)[:, None]
    radial[:, near] = (
        effect["lever_m"] * np.diff(tau - slides * jump[:, None], axis=1) / ring.step_m
    )
    if jump.any():
        radial += ring.point_load(np.nan_to_num(onset), effect["lever_m"] * jump)
    return Friction(tangential, radial, onset)


def _traction(
    effect: Planted, borders_m: FloatArray, p: FloatArray, at: Instants
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(shear at the cell borders (b, k), its jump (b,), the onset [m] (b,)).

    Under the pressure there; the jump is that at the onset of sliding.
    """
    length, slip = at.half_length[:, None], at.slip[:, None]
    static, sliding = _grip(effect)
    stiffness = 1.5 * static * at.load[:, None] / length**2
    stiffness = stiffness * effect.parameters.get("slip_stiffness_ratio", 1.0)
    position = np.maximum(borders_m + length, 0.0)
    if effect.other:
        # the shear grows quickly behind the entry, then levels off, and passes smoothly into
        # sliding
        held = np.abs(slip) * stiffness * 1.2 * length * -np.expm1(-position / (0.7 * length))
        limit = 0.5 * (static + sliding) * np.maximum(p, 1e-9)
        tau = np.sign(slip) * held / np.cbrt(1.0 + (held / limit) ** 3)
        return tau, np.zeros(len(at)), np.full(len(at), np.nan)
    held = np.abs(slip) * stiffness * position
    onset, pressed = _onset(borders_m, held, p, at, static)
    slides = borders_m >= np.nan_to_num(onset, nan=np.inf)[:, None]
    tau = np.sign(slip) * np.where(slides, sliding * p, np.minimum(held, static * p))
    return tau, -(static - sliding) * pressed * np.sign(at.slip), onset


def _grip(effect: Planted) -> tuple[float, float]:
    """Friction that sticks and that slides on this scenario's road."""
    own = effect.parameters
    return (
        own.get("static_friction", STATIC_FRICTION),
        own.get("sliding_friction", SLIDING_FRICTION),
    )


def _onset(
    borders_m: FloatArray, held: FloatArray, p: FloatArray, at: Instants, static: float
) -> tuple[FloatArray, FloatArray]:
    """(place at which sliding begins (b,), the pressure there).

    There the held shear first exceeds f_s p inside the patch, linear between borders; NaN without
    slip.
    """
    excess = held - static * p
    step = borders_m[1] - borders_m[0]
    inside = (borders_m >= -at.half_length[:, None]) & (borders_m <= at.half_length[:, None] + step)
    over = inside & (excess > 0)
    first = np.maximum(np.argmax(over, axis=1), 1)
    rows = np.arange(first.size)
    before, after = excess[rows, first - 1], excess[rows, first]
    share = np.clip(
        np.divide(-before, after - before, out=np.zeros_like(after), where=after != before),
        0.0,
        1.0,
    )
    onset = np.maximum(borders_m[first - 1] + share * step, -at.half_length)
    pressed = (1.0 - share) * p[rows, first - 1] + share * p[rows, first]
    found = over.any(axis=1) & (np.abs(at.slip) > 1e-6)
    return np.where(found, onset, np.nan), np.where(found, pressed, 0.0)
