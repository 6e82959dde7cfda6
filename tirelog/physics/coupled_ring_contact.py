"""Road against tread: one-sided springs along the road's normal, and brush friction along the road.

The tread is a ring of M nodes that turn with the belt, h = 2 pi R / M apart. Node j lies at r_j = C + (R + w) e_r + v e_t; where it
would go below the road, by d = h(x) - z with x = -s, the spring energy k_t d^2 / 2 per length pushes it back along its gradient, k_t d
(h'(x), 1). A bristle clings to the road: its deflection u grows by what the node slides (the way between two steps, so that
a steady patch slides steadily whatever the step), and stays within mu p / C_x. The nodes carry u
with them, so nothing is smeared; a node that leaves the road forgets it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tirelog.errors import ModelError
from tirelog.physics.coupled_ring import CoupledRing
from tirelog.physics.road import Road
from tirelog.physics.spectral import ComplexArray, FloatArray

#: Nodes whose undeformed place is less than this above the road are looked at [share of R].
NEAR = 0.04
#: Angle from the patch centre [rad] beyond which nothing may touch.
FAR = 0.8


@dataclass
class RoadForces:
    """What the road does to the tire, totals and modes.

    force [N] as s + i z; torque [N m] that turns the ring, sum f . r'; modes E_n (N - 1,) [N/m]; energy [J] of the tread's springs
    (bristles included); angle phi [rad] of the nodes that were looked at, and the vertical force per length p [N/m] on them.
    """

    force: complex
    torque: float
    modes: ComplexArray
    energy: float
    phi: FloatArray
    pressure: FloatArray


@dataclass
class Tread:
    """The tread of a coupled ring on a road; holds the bristles' deflections (M,) between steps.

    `lost` [J] sums what sliding takes.
    """

    tire: CoupledRing
    road: Road
    nodes: int = 1536
    bristles: FloatArray = field(init=False)
    lost: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        theta = 2.0 * np.pi * np.arange(self.nodes) / self.nodes
        turns = np.outer(np.concatenate([theta, theta]), self.tire.n)
        # Re (basis c) = real basis (Re c, Im c); twice around, so that any stretch is one slice
        self._basis = np.concatenate([np.cos(turns), -np.sin(turns)], axis=1)
        self._reach = round(FAR / (2.0 * np.pi) * self.nodes)
        self._pitch = 2.0 * np.pi * self.tire.R / self.nodes
        self.bristles = np.zeros(self.nodes)
        self._was = np.full((3, self.nodes), np.nan)

    def forces(self, centre: complex, psi: float, V: ComplexArray) -> RoadForces:
        """The road's forces at this place; bristles move on by what their nodes slid since the last call."""
        tire, n = self.tire, self.tire.n
        near, phi, sin, cos = self._near(centre, psi)
        turn = np.exp(1j * psi * n)
        A = 2.0 * turn * V
        shape = np.array([A, -1j * n * A, (n**2 - 1.0) * A])
        basis = self._basis[near]
        v, w, bend = np.concatenate([shape.real, shape.imag], axis=1) @ basis.T
        s, z = centre.real + (tire.R + w) * sin + v * cos, centre.imag - (tire.R + w) * cos + v * sin
        height, slope = self.road.profile(-s)
        gap = height - z
        depth = np.maximum(gap, 0.0)
        f_s, f_z = tire.k_t * depth * slope, tire.k_t * depth
        energy = 0.5 * tire.k_t * self._pitch * float(depth @ depth)
        if tire.mu > 0.0 and tire.c_x > 0.0:
            long = np.sqrt(1.0 + slope**2)
            slid = self._slid(near, s, z, slope, gap) / long
            tau, stored = self._friction(near, slid, tire.k_t * depth * long)
            f_s, f_z, energy = f_s - tau / long, f_z + tau * slope / long, energy + stored
        f_r, f_t = f_s * sin - f_z * cos, f_s * cos + f_z * sin
        parts = (np.stack([f_t, f_r]) @ basis) / self.nodes
        q = parts[:, : n.size] + 1j * parts[:, n.size :]
        total = complex(f_s.sum(), f_z.sum()) * self._pitch
        torque = self._pitch * float(tire.R * f_t.sum() + f_r @ bend)
        return RoadForces(total, torque, turn.conj() * (q[0] + 1j * n * q[1]), energy, phi, f_z)

    def _slid(self, near: slice, s: FloatArray, z: FloatArray, slope: FloatArray, gap: FloatArray) -> FloatArray:
        """What nodes moved along the road since the last call while they touched it, times the road's length per s, (j,)."""
        index = np.arange(near.start, near.stop) % self.nodes
        s_was, z_was, gap_was = self._was[:, index]
        # a node that came down meanwhile has slid for a part of the way only; one that was not looked at has not
        share = np.where(gap_was < 0.0, gap / np.maximum(gap - gap_was, 1e-12), 1.0)
        self._was = np.full((3, self.nodes), np.nan)
        self._was[:, index] = s, z, gap
        return np.nan_to_num(np.clip(share, 0.0, 1.0) * ((s - s_was) - slope * (z - z_was)))

    def _near(self, centre: complex, psi: float) -> tuple[slice, FloatArray, FloatArray, FloatArray]:
        """The stretch of nodes that may touch, their angles in (-pi, pi] with sine and cosine; nodes count on past M."""
        R, pitch = self.tire.R, 2.0 * np.pi / self.nodes
        middle = round(-psi / pitch)
        offset = np.arange(middle - self._reach, middle + self._reach + 1)
        phi: FloatArray = np.asarray(offset * pitch + psi, dtype=np.float64)
        sin, cos = np.sin(phi), np.cos(phi)
        close = np.flatnonzero(centre.imag - R * cos - self.road.profile(-(centre.real + R * sin))[0] < NEAR * R)
        if close.size == 0:
            return slice(0, 0), *np.zeros((3, 0))
        first, end = int(close[0]), int(close[-1]) + 1
        if first == 0 or end == offset.size:
            raise ModelError(
                f"the road reaches the tire beyond {FAR:g} rad to either side; a shorter patch is allowed; lower the load or the obstacle"
            )
        start = int(offset[first]) % self.nodes
        return slice(start, start + end - first), phi[first:end], sin[first:end], cos[first:end]

    def _friction(self, near: slice, slid: FloatArray, normal: FloatArray) -> tuple[FloatArray, float]:
        """(tau [N/m] of the bristles on the road along +s, their energy [J]) after sliding by `slid` [m]; sums `lost`."""
        tire, M = self.tire, self.nodes
        before = np.concatenate([self.bristles, self.bristles])[near]
        u = before + slid
        limit = tire.mu * normal / tire.c_x
        held = np.clip(u, -limit, limit)
        self.lost += 0.5 * tire.c_x * self._pitch * float((before + held) @ (u - held))
        self.bristles = np.zeros(M)
        self.bristles[near] = held[: max(M - near.start, 0)]
        self.bristles[: max(near.stop - M, 0)] = held[M - near.start :] if near.stop > M else 0.0
        return tire.c_x * held, 0.5 * tire.c_x * self._pitch * float(held @ held)
