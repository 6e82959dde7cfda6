"""A road, and the tread on it: one-sided springs along its normal, and brush friction along it.

The tread is a ring of M nodes that turn with the belt, h = 2 pi R / M apart. Node j lies at r_j = C
+ (R + w) e_r + v e_t. With x = -s it would go below the road by d = h(x) - z. The spring energy k_t
d^2 / 2 per length then pushes it back along its gradient, k_t d (h'(x), 1). A bristle clings to the
road. Its deflection u grows by the way that the node slides between two steps, so a steady patch
slides steadily at any step; it stays within mu p / C_x. The nodes carry u with them, so nothing is
smeared; a node that leaves the road forgets it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from tirelog.data.setup import RoadSetup, road_points
from tirelog.errors import ModelError
from tirelog.kernels import compiled
from tirelog.physics.carcass import contact
from tirelog.physics.carcass.structures import modal_impedance
from tirelog.physics.moving.ring import CoupledRing
from tirelog.physics.spectral import STEP, ComplexArray
from tirelog.vocabulary.arrays import FloatArray, Records

# ---- The road under a moving tire: height and slope over the distance driven.
#
#     `setup.RoadSetup` (a log's [road], or words of a command) --`road_of`--> RoadProfile
#
# Heights are over `x` [m], the distance in the direction of driving, shapes as asked. Every
# profile is continuous: a step and a cleat have a ramp, since tread that presses along the road's
# normal has no answer to a wall. What is steeper than `STEEPEST` is refused, and `check_climbable`
# refuses what is higher than the tire can climb.

#: Steepest slope [m/m] of a ramp. Twice as steep asks for nodes half as far apart to see a ramp as
#: well.
STEEPEST = 3.0
#: Largest rise within one tire diameter, as a share of the radius: the ring's displacements are
#: small ones. Twice as much would double the strain that a linear ring takes for small.
HIGHEST = 0.2
#: Ramp [m] of a step or cleat that names none, as far as its length and the steepest slope allow.
#: Twice as long makes a softer blow: give it in the road's own words if it matters.
RAMP = 0.01


@dataclass(frozen=True)
class RoadProfile:
    """Height over the distance driven; without any numbers it is flat.

    Heights [m] at growing distances [m], straight between them and level outside; a sine, amplitude
    (1 - cos(2 pi x / wavelength)) from x = 0 on, which begins level and rises to twice the
    amplitude. It begins at `at_m`, and comes again every `spacing_m` if that is above zero.
    """

    distance_m: tuple[float, ...] = ()
    height_m: tuple[float, ...] = ()
    amplitude_m: float = 0.0
    wavelength_m: float | None = None
    at_m: float = 0.0
    spacing_m: float = 0.0

    def __post_init__(self) -> None:
        waving = abs(self.amplitude_m) * 2.0 * np.pi / (self.wavelength_m or np.inf)
        slope = max(waving, np.abs(self._slopes).max())
        if slope > STEEPEST:
            raise ModelError(
                f"road with a slope of {slope:.3g}",
                allowed=f"up to {STEEPEST:g} is allowed (the tread presses along the road's "
                "normal)",
                do="give the step a longer ramp",
            )

    @cached_property
    def _slopes(self) -> FloatArray:
        """dh/dx before the first point, between the points, and after the last."""
        slopes = np.diff(self.height_m) / np.diff(self.distance_m)
        return np.concatenate([[0.0], slopes, [0.0]])

    def profile(self, x_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Height [m] and slope [m/m] at `x_m`, each of its shape."""
        x = x_m - self.at_m
        if self.wavelength_m is not None:
            q, x = 2.0 * np.pi / self.wavelength_m, np.maximum(x, 0.0)
            return self.amplitude_m * (1.0 - np.cos(q * x)), self.amplitude_m * q * np.sin(q * x)
        if not self.distance_m:
            return np.zeros_like(x), np.zeros_like(x)
        if self.spacing_m > 0.0:  # a turn ahead of the first obstacle there is none
            x = np.where(x > 0.0, np.mod(x, self.spacing_m), x)
        place = np.searchsorted(self.distance_m, x, side="right")
        return np.interp(x, self.distance_m, self.height_m), self._slopes[place]

    def check_climbable(self, radius_m: float) -> None:
        """ModelError if it rises by more than the tire can take within one of its diameters."""
        x, h = np.array(self.distance_m), np.array(self.height_m)
        wide, wave = 2.0 * radius_m, self.wavelength_m
        rises = [float(np.ptp(h[(x >= begin) & (x <= begin + wide)])) for begin in x]
        rises += [2.0 * abs(self.amplitude_m)] * (wave is not None and wave < 2.0 * wide)
        rise = next((rise for rise in rises if rise > HIGHEST * radius_m), None)
        if rise is not None:
            raise ModelError(
                f"road that rises {rise:.3g} m within one tire diameter",
                allowed=f"up to {HIGHEST * radius_m:.3g} m is allowed for a radius of "
                f"{radius_m:.3g} m (small displacements of the ring)",
                do="give a lower obstacle",
            )


def road_of(words: RoadSetup, at_m: float = 0.0, *, folder: Path | None = None) -> RoadProfile:
    """The road that the words describe, its obstacle beginning at `at_m`.

    ModelError if its kind lacks a number, or cannot be rolled over. A profile's file is sought in
    `folder`, unless its path is absolute.
    """
    if words.kind == "flat":
        return RoadProfile()
    if words.kind == "sine":
        amplitude, wavelength = _needed(words, "amplitude_m", "wavelength_m")
        return RoadProfile(amplitude_m=amplitude, wavelength_m=wavelength, at_m=at_m)
    if words.kind != "profile":
        road = _obstacle(words)
    elif words.file is not None:
        road = load_road((folder or Path()) / words.file)
    else:
        raise ModelError(
            "road profile without a file",
            allowed='file = "PATH" is allowed (distance and height, a point a line)',
            do="name it",
        )
    spacing, length = 0.0 if words.kind == "step" else words.spacing_m or 0.0, road.distance_m[-1]
    if 0.0 < spacing <= length:
        raise ModelError(
            f"road that comes again after {spacing:g} m although it is {length:g} m long",
            allowed="a longer spacing is allowed",
            do="correct spacing_m",
        )
    return replace(road, at_m=at_m, spacing_m=spacing)


def _obstacle(words: RoadSetup) -> RoadProfile:
    """A change of level, or a bar with a ramp on either side."""
    needed = ("height_m",) if words.kind == "step" else ("height_m", "length_m")
    height, *foot = _needed(words, *needed)
    ramp = words.ramp_m or max(RAMP, 1.01 * abs(height) / STEEPEST)
    if not foot:
        return RoadProfile((0.0, ramp), (0.0, height))
    ramp = words.ramp_m or min(ramp, 0.49 * foot[0])
    if not 0.0 < ramp < 0.5 * foot[0]:
        raise ModelError(
            f"cleat with ramps of {ramp:g} m",
            allowed="above zero and below half of its width is allowed",
            do="correct ramp_m",
        )
    return RoadProfile((0.0, ramp, foot[0] - ramp, foot[0]), (0.0, height, height, 0.0))


def _needed(words: RoadSetup, *names: str) -> tuple[float, ...]:
    """The numbers of these names.  ModelError if one is lacking."""
    values = [getattr(words, name) for name in names]
    lacking = [name for name, value in zip(names, values) if value is None]
    if lacking:
        raise ModelError(
            f"road of kind {words.kind} without {' and '.join(lacking)}",
            allowed="a number in m is allowed",
            do="give it",
        )
    return tuple(values)


def load_road(path: str | Path) -> RoadProfile:
    """A road profile from a text file.

    Two columns, distance [m] and height [m], comma or blanks between; `#` begins a remark.
    """
    distance, height = road_points(path, ModelError)
    if not (distance.size > 1 and np.all(np.diff(distance) > 0.0)):
        raise ModelError(
            "road profile without two points, or whose distance does not grow",
            allowed="two points or more at growing distances are allowed",
            do="sort the rows, one height each",
            file=path,
        )
    try:
        return RoadProfile(tuple(distance.tolist()), tuple(height.tolist()))
    except ModelError as problem:
        raise problem.at(path) from None


# ---- The tread's nodes on it.

#: a node when it was seen last: its place along the road and its height, how deep it was below the
#: road, and the number of that call; NaN: never
SEEN = np.dtype([("s_m", "f8"), ("z_m", "f8"), ("depth_m", "f8"), ("call", "f8")])


# Where the tread's nodes are, and what the road does to them.
#
# Nodes of a stretch, (j,), are in order of their angle; tables of cos(n theta), sin(n theta),
# (N - 1, 2 M), go twice around the belt, so that any stretch is one slice from `start`. Sums keep
# their order whatever the machine.


@compiled
def places(
    cosines: FloatArray, sines: FloatArray, start: int, n: FloatArray, real: FloatArray,
    imag: FloatArray, radius: float, centre_s: float, centre_z: float, sin: FloatArray,
    cos: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:  # fmt: skip
    """s, z and w' - v of nodes at angles with these `sin`, `cos` (j,).

    From the modes 2 V e^(i n psi) as `real`, `imag` (N - 1,).
    """
    size = sin.size
    v, w, bend = np.zeros(size), np.zeros(size), np.zeros(size)
    for k in range(n.size):
        a, b, m = real[k], imag[k], n[k]
        turned = m * m - 1.0
        # slices, so that no index is checked for its sign: six times as quick
        c, d = cosines[k, start : start + size], sines[k, start : start + size]
        for i in range(size):
            along = a * c[i] - b * d[i]
            v[i] += along
            w[i] += m * (a * d[i] + b * c[i])
            bend[i] += turned * along
    return centre_s + (radius + w) * sin + v * cos, centre_z - (radius + w) * cos + v * sin, bend


@compiled
def press(
    s: FloatArray, z: FloatArray, height: FloatArray, slope: FloatArray, was: Records,
    bristles: FloatArray, start: int, nodes: int, k_t: float, c_x: float, mu: float, now: float,
) -> tuple[FloatArray, FloatArray, float, float, float]:  # fmt: skip
    """Forces (j,) [N/m] of the road on nodes, along it and upwards, and energies per length [J/m].

    The energies are those of springs and bristles, and what sliding took.

    was (M,) of SEEN, of the call before or earlier; bristles (M,) [m]; k_t, c_x [N/m^2]. A
    node that came down since the last call has slid for a part of the way; one that was not looked
    at then has not.
    """
    size = s.size
    f_s, f_z = np.zeros(size), np.zeros(size)
    sprung = clung = lost = 0.0
    for i in range(size):
        j = (start + i) % nodes
        gap, steep = height[i] - z[i], slope[i]
        before, seen = bristles[j], was[j]["call"] == now - 1.0
        bristles[j] = 0.0
        if gap > 0.0:
            sprung += 0.5 * k_t * gap * gap
            f_s[i], f_z[i] = k_t * gap * steep, k_t * gap
        if mu > 0.0 and c_x > 0.0:
            long = np.sqrt(1.0 + steep * steep)
            limit = mu * k_t * max(gap, 0.0) * long / c_x
            slid = 0.0
            if seen:
                share = (
                    1.0
                    if was[j]["depth_m"] >= 0.0
                    else min(max(gap / max(gap - was[j]["depth_m"], 1e-12), 0.0), 1.0)
                )
                rise = steep * (z[i] - was[j]["z_m"])
                slid = share * ((s[i] - was[j]["s_m"]) - rise) / long
            else:
                before = 0.0
            free = before + slid
            held = min(max(free, -limit), limit)
            lost += 0.5 * c_x * (before + held) * (free - held)
            clung += 0.5 * c_x * held * held
            bristles[j] = held
            f_s[i] -= c_x * held / long
            f_z[i] += c_x * held * steep / long
        node = was[j]
        node["s_m"], node["z_m"], node["depth_m"], node["call"] = s[i], z[i], gap, now
    return f_s, f_z, sprung, clung, lost


@compiled
def modes_of(
    cosines: FloatArray,
    sines: FloatArray,
    start: int,
    f_t: FloatArray,
    f_r: FloatArray,
    n: FloatArray,
    nodes: int,
) -> tuple[FloatArray, FloatArray]:
    """Real and imaginary part of Q_v + i n Q_w (N - 1,).

    They belong to forces [N/m] on nodes (j,), in the belt's own angle. The tables are transposed,
    (2 M, N - 1), for sums over nodes of all modes at once.
    """
    t_c, t_s, r_c, r_s = np.zeros(n.size), np.zeros(n.size), np.zeros(n.size), np.zeros(n.size)
    for i in range(f_t.size):
        t, r = f_t[i], f_r[i]
        if t != 0.0 or r != 0.0:
            c, d = cosines[start + i], sines[start + i]
            for k in range(n.size):
                t_c[k] += t * c[k]
                t_s[k] -= t * d[k]
                r_c[k] += r * c[k]
                r_s[k] -= r * d[k]
    return (t_c - n * r_s) / nodes, (t_s + n * r_c) / nodes


#: Nodes whose undeformed place is less than this above the road are looked at [share of R]. Twice
#: as much looks at more nodes and finds the same contact.
NEAR = 0.04
#: Angle from the patch centre [rad] beyond which nothing may touch. Twice as much reaches the
#: upper half of the tire.
FAR = 0.8
#: The road's highest place around the tire is looked up anew after this distance [m]. Twice as far
#: looks it up half as often, over as much more of the road.
_TOP_EVERY_M = 0.05


@dataclass
class RoadForces:
    """What the road does to the tire, totals and modes.

    force [N] as s + i z; torque [N m] that turns the ring, sum f . r'; modes E_n (N - 1,) [N/m];
    energy [J] of the tread's springs (bristles included).
    """

    force: complex
    torque: float
    modes: ComplexArray
    energy: float


@dataclass
class Tread:
    """The tread of a coupled ring on a road; holds the bristles' deflections (M,) between steps.

    `lost` [J] sums what sliding takes.
    """

    tire: CoupledRing
    road: RoadProfile
    nodes: int = 1536
    bristles: FloatArray = field(init=False)
    lost: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        theta = 2.0 * np.pi * np.arange(self.nodes) / self.nodes
        turns = np.outer(self.tire.n, np.concatenate([theta, theta]))
        self._cos, self._sin = np.cos(turns), np.sin(turns)
        self._by_node = np.ascontiguousarray(self._cos.T), np.ascontiguousarray(self._sin.T)
        self._pitch = 2.0 * np.pi * self.tire.R / self.nodes
        self.bristles = np.zeros(self.nodes)
        self._was = np.full(self.nodes, np.nan, SEEN)
        self._now = 0
        self._top, self._top_at = 0.0, np.inf

    def forces(self, centre: complex, psi: float, V: ComplexArray) -> RoadForces:
        """The road's forces at this place.

        Bristles move on by what their nodes slid since the last call.
        """
        tire, n = self.tire, self.tire.n
        start, phi = self._near(centre, psi)
        sin, cos = np.sin(phi), np.cos(phi)
        turn = np.exp(1j * psi * n)
        A = 2.0 * turn * V
        s, z, bend = places(
            self._cos,
            self._sin,
            start,
            n,
            A.real,
            A.imag,
            tire.R,
            centre.real,
            centre.imag,
            sin,
            cos,
        )
        height, slope = self.road.profile(-s)
        self._now += 1
        f_s, f_z, sprung, clung, lost = press(
            s,
            z,
            height,
            slope,
            self._was,
            self.bristles,
            start,
            self.nodes,
            tire.k_t,
            tire.c_x,
            tire.mu,
            self._now,
        )
        self.lost += self._pitch * lost
        if phi.size and ((phi[0] <= -FAR and f_z[0] != 0.0) or (phi[-1] >= FAR and f_z[-1] != 0.0)):
            raise ModelError(
                f"the road reaches the tire beyond {FAR:g} rad to either side",
                allowed="a shorter patch is allowed",
                do="lower the load or the obstacle",
            )
        f_r, f_t = f_s * sin - f_z * cos, f_s * cos + f_z * sin
        real, imag = modes_of(*self._by_node, start, f_t, f_r, n, self.nodes)
        total = complex(f_s.sum(), f_z.sum()) * self._pitch
        torque = self._pitch * float(tire.R * f_t.sum() + np.sum(f_r * bend))
        energy = self._pitch * (sprung + clung)
        return RoadForces(total, torque, turn.conj() * (real + 1j * imag), energy)

    def _near(self, centre: complex, psi: float) -> tuple[int, FloatArray]:
        """First of the stretch of nodes that may touch, and their angles from the patch centre."""
        R, pitch = self.tire.R, 2.0 * np.pi / self.nodes
        if not abs(centre.real - self._top_at) < _TOP_EVERY_M:
            reach = (FAR + 0.1) * R + _TOP_EVERY_M
            self._top = float(
                np.max(self.road.profile(np.linspace(-reach, reach, 1001) - centre.real)[0])
            )
            self._top_at = centre.real
        low = (centre.imag - self._top) / R - NEAR
        if low >= 1.0:
            return 0, np.zeros(0)
        reach = min(math.acos(max(low, -1.0)), FAR + 2.0 * pitch)
        first, last = math.ceil((-reach - psi) / pitch), math.floor((reach - psi) / pitch)
        return first % self.nodes, np.asarray(
            np.arange(first, last + 1) * pitch + psi, dtype=np.float64
        )


# ---- The coupled ring that rolls steadily and freely on a flat road.
#
# Where a motion begins, and what it is measured from.
#
# Tire, load, speed -> pressure on the tread's nodes and modes V_n = E_n / (Z_n + i n Omega c_n),
# n =
# 2 ... N, by active sets; then the spin at which bristles, pressure and damping leave no torque. As
# `contact.solve_contact`, but with the modes that the motion has, and with damping: a motion that
# begins here stays here.


#: The spin is sought within this share of v / R. Twice as wide finds spins of tires that slip by a
#: tenth.
_SPIN_RANGE = 0.05
_PHI = np.arange(-contact.NODES, contact.NODES + 1, dtype=np.float64) * STEP


def steady_rolling(
    tire: CoupledRing, load_N: float, speed_m_s: float
) -> tuple[ComplexArray, float, complex, float]:
    """Steady rolling at a load and a speed: modes, height of the ring, sidewall and spin.

    Modes V (N - 1,) [m]; height of the ring's centre above the road [m]; sidewall's displacement
    a = C - H [m]; spin [rad/s].

    ModelError for a load that does not press or a patch that grows beyond the reach of the
    contact.
    """
    contact.check_load(load_N)
    omega = speed_m_s / tire.R
    for _ in range(2 if speed_m_s else 1):
        unit, gives = _compliance(tire, omega)
        shape, begin = tire.R * (1.0 - np.cos(_PHI)), np.abs(_PHI) <= 0.15
        carries = np.full(_PHI.size, tire.R * STEP)
        found = contact.balance(gives, shape, carries, tire.k_t, load_N, begin)
        if found is None:
            raise ModelError(
                f"at {load_N:g} N the patch grows beyond {contact.REACH:g} rad to either side, or "
                "finds no balance",
                allowed="a shorter one is allowed",
                do="give a stiffer foundation or a lower load",
            )
        on, p, drop, *_ = found
        V = unit[:, on] @ p
        # the road's force i F loads the sidewall: k_s a + c_s (0 - i Omega a) = i F, Omega x a
        # = i Omega a in the complex plane
        a = 1j * load_N / complex(tire.k_s, -tire.c_s * omega)
        if speed_m_s:
            omega = _free_spin(tire, V, a, _PHI[on], p, speed_m_s)
    return V, tire.R - drop, a, omega


def _compliance(tire: CoupledRing, omega: float) -> tuple[ComplexArray, FloatArray]:
    """Compliance of belt and nodes to pressure, the rigid ring held.

    (modes per pressure on a node (N - 1, j), downward yield of a node per pressure on a node (j,
    j)).
    """
    n, cos, sin = tire.n[:, None], np.cos(_PHI), np.sin(_PHI)
    load = np.exp(-1j * n * _PHI) * (STEP / (2.0 * np.pi)) * (sin - 1j * n * cos)
    unit = load / modal_impedance(tire.n, tire, omega)[:, None]
    lift = 2.0 * np.exp(1j * n * _PHI) * (sin + 1j * n * cos)
    return unit, (lift.T @ unit).real


def _free_spin(
    tire: CoupledRing, V: ComplexArray, a: complex, phi: FloatArray, p: FloatArray, speed_m_s: float
) -> float:
    """The spin [rad/s] at which the road's torque on the ring is what damping takes."""
    turn = np.exp(1j * np.outer(phi, tire.n))
    bend = 2.0 * (turn @ ((tire.n**2 - 1.0) * V)).real
    lead = tire.R * np.cos(phi) + bend * np.sin(phi)
    limit = tire.mu * p / tire.c_x if tire.c_x > 0.0 else 0.0 * p
    pitch = tire.R * STEP
    drag = tire.belt_drag(V, np.zeros_like(V), 1.0) - tire.c_s * abs(a) ** 2

    def torque(omega: float) -> float:
        u, held = 0.0, np.empty_like(p)
        for i, (slide, most) in enumerate(zip((omega * lead - speed_m_s) * (STEP / omega), limit)):
            u = min(max(u + slide, -most), most)
            held[i] = u
        tau = tire.c_x * held
        f_r, f_t = -tau * np.sin(phi) - p * np.cos(phi), -tau * np.cos(phi) + p * np.sin(phi)
        return pitch * float(tire.R * f_t.sum() + f_r @ bend) + omega * drag

    low, high = (speed_m_s / tire.R * (1.0 + share) for share in (-_SPIN_RANGE, _SPIN_RANGE))
    if not tire.c_x > 0.0 or torque(low) * torque(high) > 0.0:
        return (
            speed_m_s / tire.R
        )  # without friction, or with damping that it cannot overcome, nothing makes the ring roll
    return float(brentq(torque, low, high, xtol=1e-9 * high))
