"""What the road does to the carcass.

Contact pressure and friction on the grid, with the planted effects, in two forms each.

    base pressure p(xi) -> heavier side, pulses, wedges, wear -> smeared
        -> rescaled to carry the load -> friction of the bristles

Arrays are (b, points): b instants of the drive. Pressure is a line load [N/m], positive where the
road pushes the tread inwards.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from tirelog.simulation.scenario.schema import Planted, Scenario
from tirelog.vocabulary.arrays import FloatArray, records

#: speed [m/s] at which what grows with speed has the size that is planted
REFERENCE_SPEED_M_S = 20.0


#: conditions at an instant: time [s], speed [m/s], acceleration [m/s^2], load [N], half length of
#: the patch [m], and slip (braking > 0). Then the planted drift's course, what the tire has driven
#: [km], water [mm], the load that a tire is for [N], the tire's rise of temperature [K], and the
#: belt's length over that at rest. On a stretched belt the grid's lengths, and so `half_length` and
#: `load` of `on_grid`, are those over the stretch
INSTANT = np.dtype(
    [("time_s", "f8"), ("speed", "f8"), ("acceleration", "f8"), ("load", "f8"),
     ("half_length", "f8"), ("slip", "f8"), ("warmed", "f8"), ("distance_km", "f8"),
     ("water_depth_mm", "f8"), ("reference_load", "f8"), ("temperature_K", "f8"),
     ("stretch", "f8")]
)  # fmt: skip
#: (b,) of INSTANT, whose columns are attributes
Instants: TypeAlias = Any


def instants_of(**columns: FloatArray | float) -> Instants:
    """Instants by their columns, (b,) or numbers; what is not given is 0."""
    return records(INSTANT, **columns).view(np.recarray)


def with_columns(at: Instants, **columns: FloatArray | float) -> Instants:
    """The same instants, some of their columns other ones."""
    changed = at.copy()
    for name, column in columns.items():
        changed[name] = column
    return changed


def on_grid(at: Instants) -> Instants:
    """The same in the grid's lengths: pressures [N/m] stay, so that forces shrink with them."""
    shrunk = ("half_length", "load", "reference_load")
    return with_columns(at, **{name: at[name] / at.stretch for name in shrunk})


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
        # a struck block dies away within 1.5 ms and swings at 250 Hz (Heckl 1986)
        dying = np.exp(-np.maximum(late, 0.0) / 0.0015)
        swing = np.where(late >= 0.0, dying * np.cos(2.0 * np.pi * 250.0 * late), 0.0)
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
    # distance [km] after which planted wear has its full size
    age = at.distance_km / 40000.0
    return p + effect["amplitude"] * (age * at.load / (2 * at.half_length))[:, None] * shape


def _saddle(effect: Planted, x: FloatArray, p: FloatArray, at: Instants) -> FloatArray:
    """Even: the shoulders of the patch carry more, ~ v^n F^m; apart: a rib of each shoulder does.

    The rib is where the sidewall meets the belt, within a tenth of the patch.
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

    apart: asperities that the entry presses flat and that keep flat. They smear the entry's half
    alone (contact grows with the load and does not shrink with it).
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


def friction(
    ring: Ring, effect: Planted, p: FloatArray, at: Instants
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The bristles' traction: adhesion up to f_s p, then sliding f_d p.

    (traction (b, points) [N/m], towards the exit in braking; its load on the carcass, the same;
    where sliding begins (b,) [m], NaN if nothing slides).

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
    return tangential, radial, onset


def _traction(
    effect: Planted, borders_m: FloatArray, p: FloatArray, at: Instants
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(shear at the cell borders (b, k), its jump (b,), the onset [m] (b,)).

    Under the pressure there; the jump is that at the onset of sliding.
    """
    length, slip = at.half_length[:, None], at.slip[:, None]
    static, sliding = effect["static_friction"], effect["sliding_friction"]
    stiffness = 1.5 * static * at.load[:, None] / length**2
    stiffness = stiffness * effect["slip_stiffness_ratio"]
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


# ---- Difference operators on a closed grid: the truth's derivatives.
#
# A grid has N points xi_j = (j - N/2) h around one loaded rolling circumference, the patch centre
# at index N/2. A linear operator that is the same at every point is a circulant matrix; it is kept
# as the discrete Fourier transform of its stencil, shape (N/2 + 1,), so that sums of stencils are
# sums of arrays and the solution of a circulant system is a division. The stencils are finite
# differences of order eight, not the derivatives' own symbols.

ComplexArray = NDArray[np.complex128]


def central_weights(derivative: int, half_width: int = 5) -> FloatArray:
    """Weights of the central difference of unit step, shape (2 half_width + 1,).

    With 5 points on either side it is of order eight up to the fourth derivative.

    From the moment conditions sum_j w_j j^m = m! [m = derivative].
    """
    offsets = np.arange(-half_width, half_width + 1)
    moments = np.vander(offsets.astype(float), increasing=True).T
    wanted = np.zeros(offsets.size)
    wanted[derivative] = math.factorial(derivative)
    weights = np.linalg.solve(moments, wanted)
    # even or odd to the last bit: what rounding leaves is multiplied by step^-derivative
    return np.asarray(0.5 * (weights + (-1) ** derivative * weights[::-1]), float)


@dataclass(frozen=True)
class Ring:
    """The closed grid of `points` points (even) around `circumference_m`.

    With its operators as transforms of stencils.
    """

    points: int
    circumference_m: float

    @property
    def step_m(self) -> float:
        return self.circumference_m / self.points

    @cached_property
    def xi_m(self) -> FloatArray:
        """Positions [m], shape (points,): -circumference/2 .. +circumference/2.

        The patch centre is at index points/2.
        """
        return np.asarray((np.arange(self.points) - self.points // 2) * self.step_m, float)

    @cached_property
    def derivatives(self) -> tuple[ComplexArray, ...]:
        """Transforms of the stencils of the 0th to 4th derivative by xi.

        Each of shape (points/2 + 1,).
        """
        return tuple(self.stencil(central_weights(m) / self.step_m**m) for m in range(5))

    def stencil(self, weights: FloatArray) -> ComplexArray:
        """Transform of the operator (A f)_j = sum_i weights_i f_(j + i), i from -half to half."""
        column = np.zeros(self.points)
        half = weights.size // 2
        for offset, weight in zip(range(-half, half + 1), weights, strict=True):
            column[-offset % self.points] += weight
        spectrum: ComplexArray = fft.rfft(column)
        if abs(weights.sum()) < 1e-9 * np.abs(weights).sum():
            spectrum[0] = 0.0
        return spectrum

    def kernel(self, values: FloatArray) -> ComplexArray:
        """Transform of a smoothing: even `values` at xi_m, scaled to sum to one."""
        return np.asarray(fft.rfft(np.fft.ifftshift(values / values.sum())))

    def transform(self, values: FloatArray) -> ComplexArray:
        """Discrete Fourier transform along the last axis."""
        return np.asarray(fft.rfft(values, axis=-1))

    def inverse(self, spectrum: ComplexArray) -> FloatArray:
        """Values on the grid from a transform, along the last axis."""
        return np.asarray(fft.irfft(spectrum, n=self.points, axis=-1))

    @cached_property
    def borders_m(self) -> FloatArray:
        """Borders of the cells around the points [m], shape (points + 1,)."""
        return np.asarray(
            (np.arange(self.points + 1) - 0.5 - self.points // 2) * self.step_m, float
        )

    def window(self, reach_m: float) -> slice:
        """The points within `reach_m` of the patch centre, and one more on either side."""
        half = min(int(reach_m / self.step_m) + 2, self.points // 2)
        return slice(self.points // 2 - half, min(self.points // 2 + half + 1, self.points))

    def point_load(self, position_m: FloatArray, amount: FloatArray) -> FloatArray:
        """Concentrated loads, shape (..., points).

        `amount` [N] at `position_m`, shared by two points so that force and moment are kept.
        """
        place = np.asarray(position_m, float) / self.step_m + self.points // 2
        left = np.floor(place).astype(int)
        share = place - left
        load = np.zeros((*np.shape(place), self.points))
        for index, weight in ((left, 1.0 - share), (left + 1, share)):
            np.put_along_axis(
                load,
                (index % self.points)[..., None],
                (weight * amount / self.step_m)[..., None],
                axis=-1,
            )
        return load


# ---- Strain that no load on the carcass makes (effects outside the catalogue).
#
# And what a sensor does to a waveform.
#
# Waveforms and their transforms are (b, points) and (b, points/2 + 1); b instants of the drive.

#: slower than this, time behind the patch counts as at this speed [m/s] (a ring-down at standstill
#: has no meaning)
SLOWEST_M_S = 0.2


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

    A sensor `behind_rad` behind the first sees it so much earlier.
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
    # the speed of sound goes with the root of the temperature, which begins at 293 K
    warm = np.sqrt(1.0 + at.temperature_K / 293.0)[:, None]
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
            # of what has none among its parameters, the cavity's grows with the speed
            usual = 1.0 if effect.name == "cavity_resonance" else 0.0
            power = effect.parameters.get("speed_exponent", usual)
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
    gauge: Planted | None,
    lag: Planted | None,
    bandwidth_Hz: float | None,
) -> ComplexArray:
    """`spectrum` (b, m) behind the sensor.

    Averaged over the gauge (apart: and slack in compression), late by the lag, within its
    bandwidth.

    In the road's frame a lag of tau is a length c tau, so that (1 + c tau d/dxi) s = strain: exact
    at constant speed. The bandwidth is a second-order magnitude without delay (a delay is
    `delay_s`).
    """
    if gauge is not None:
        spectrum = spectrum * _averaged(ring, gauge)
        if gauge.apart:
            spectrum = ring.transform(_slack(ring.inverse(spectrum), gauge["length_m"]))
    first = ring.derivatives[1]
    if lag is not None:
        length = np.maximum(speed, 0.0)[:, None] * lag["lag_s"]
        spectrum = spectrum / delaying(lag, length * first)
    if bandwidth_Hz is not None:
        frequency = speed[:, None] * np.abs(first) / (2.0 * np.pi)
        spectrum = spectrum / np.sqrt(1.0 + (frequency / bandwidth_Hz) ** 4)
    return spectrum


def delaying(lag: Planted | None, late: Any) -> Any:
    """Divisor of a wave by a lag, 1 + late with late = i omega tau; other: two lags.

    apart: of an underdamped second-order filter, which is as late at low frequencies and rings.
    """
    if lag is not None and lag.other:
        return (1.0 + 0.5 * late) ** 2
    if lag is not None and lag.apart:
        # damping of a filter that rings, as a share of the critical one (lag "apart")
        return 1.0 + late + (late / (2.0 * 0.25)) ** 2
    return 1.0 + late


def _slack(strain: FloatArray, length_m: float) -> FloatArray:
    """Strain of a fibre that is glued at its ends alone and buckles.

    Euler's load of a clamped rod: a strain of (2 pi r / length)^2 with r = d / 4. It adds to the
    strain with which the fibre was drawn.
    """
    fibre_m, drawn = 1.25e-4, 6.0e-4  # diameter of the glass, strain when it is glued
    least = drawn + (0.5 * np.pi * fibre_m / max(length_m, 1e-4)) ** 2
    return np.maximum(strain, -least)


def _averaged(ring: Ring, gauge: Planted) -> ComplexArray:
    """Transform of the mean over the gauge length.

    other: a sensitivity that falls towards the ends, of equal variance.
    """
    length = gauge["length_m"]
    if gauge.other:
        width = max(length / np.sqrt(12.0), 0.3 * ring.step_m)
        return ring.kernel(np.exp(-0.5 * (ring.xi_m / width) ** 2))
    # the box's ends fall between the points: exact shares of the cells
    primitive = np.clip(ring.borders_m, -0.5 * length, 0.5 * length)
    return ring.kernel(np.diff(primitive))
