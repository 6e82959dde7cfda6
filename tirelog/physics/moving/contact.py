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
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import brentq

from tirelog.data.road import RoadProfile
from tirelog.errors import ModelError
from tirelog.kernels import compiled
from tirelog.physics.carcass import contact
from tirelog.physics.carcass.structures import modal_impedance
from tirelog.physics.moving.ring import CoupledRing
from tirelog.physics.spectral import STEP, ComplexArray
from tirelog.vocabulary.arrays import FloatArray, Records

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
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Forces (j,) [N/m] of the road on nodes, along it and upwards.

    was (M,) of SEEN, of the call before or earlier; bristles (M,) [m]; k_t, c_x [N/m^2]. A
    node that came down since the last call has slid for a part of the way; one that was not looked
    at then has not.
    """
    size = s.size
    f_s, f_z = np.zeros(size), np.zeros(size)
    for i in range(size):
        j = (start + i) % nodes
        gap, steep = height[i] - z[i], slope[i]
        before, seen = bristles[j], was[j]["call"] == now - 1.0
        bristles[j] = 0.0
        if gap > 0.0:
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
            bristles[j] = held
            f_s[i] -= c_x * held / long
            f_z[i] += c_x * held * steep / long
        node = was[j]
        node["s_m"], node["z_m"], node["depth_m"], node["call"] = s[i], z[i], gap, now
    return f_s, f_z


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
#: angle from the patch centre [rad] beyond which nothing may touch
FAR = contact.REACH


@dataclass
class Tread:
    """The tread of a coupled ring on a road; holds the bristles' deflections (M,) between steps."""

    tire: CoupledRing
    road: RoadProfile
    nodes: int = 1536
    bristles: FloatArray = field(init=False)

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

    def forces(
        self, centre: complex, psi: float, V: ComplexArray
    ) -> tuple[complex, float, ComplexArray]:
        """(Force, torque, load) of the road at this place.

        The force [N] is s + i z, the torque [N m] turns the ring, sum f . r', and the load has the
        modes E_n (N - 1,) [N/m]. Bristles move on by what their nodes slid since the last call.
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
        f_s, f_z = press(
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
        if np.any(f_z[np.abs(phi) >= FAR]):
            raise ModelError(
                f"the road reaches the tire beyond {FAR:g} rad to either side",
                allowed="a shorter patch is allowed",
                do="lower the load or the obstacle",
            )
        f_r, f_t = f_s * sin - f_z * cos, f_s * cos + f_z * sin
        real, imag = modes_of(*self._by_node, start, f_t, f_r, n, self.nodes)
        total = complex(f_s.sum(), f_z.sum()) * self._pitch
        torque = self._pitch * float(tire.R * f_t.sum() + np.sum(f_r * bend))
        return total, torque, turn.conj() * (real + 1j * imag)

    def _near(self, centre: complex, psi: float) -> tuple[int, FloatArray]:
        """First of the stretch of nodes that may touch, and their angles from the patch centre."""
        R, pitch = self.tire.R, 2.0 * np.pi / self.nodes
        every_m = 0.05  # the road's highest place around the tire is looked up anew after this way
        if not abs(centre.real - self._top_at) < every_m:
            reach = (FAR + 0.1) * R + every_m
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

    low, high = (speed_m_s / tire.R * share for share in (0.95, 1.05))
    if not tire.c_x > 0.0 or torque(low) * torque(high) > 0.0:
        return (
            speed_m_s / tire.R
        )  # without friction, or with damping that it cannot overcome, nothing makes the ring roll
    return float(brentq(torque, low, high, xtol=1e-9 * high))
