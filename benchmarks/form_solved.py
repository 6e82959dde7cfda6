"""Tires solved by contact for the form benchmark: a nonlinear tense ring, and finite elements.

    suite, form, effect, tire --> solved_case(...) --> Case (`benchmarks.form_worlds`)

Here the contact pressure and the patch length come out of the contact, so that neither is of any
chosen form, nor is the patch a power of the load. Each tire is solved in steady rolling over a grid
of speeds and loads (half a minute to two minutes), which is kept as .npz under FORM_CACHE, or the
system's folder for temporary files, and interpolated by cubics.

    tense_ring  a stretched ring in large deflection: membrane, bending, inflation, sidewalls,
                inertia and one-sided tread springs against a flat road, by Newton's method
    solid_belt  plane strain by finite elements (`pip install scikit-fem`): belt and tread in one
                solid on sidewalls, under tension, unilateral contact with a road of the tire's gap

Damping acts within the solution; an impact is a pulse of pressure at the entry edge as solved.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse
from scipy.interpolate import CubicSpline
from scipy.sparse.linalg import splu

from benchmarks.form_worlds import (
    GRAVITY_M_S2,
    POINTS,
    Array,
    Case,
    Instants,
    Tire,
    sizes_of,
    tire_of,
)

#: effects that these worlds have, and what their sizes are of those beside the spectral tire
EFFECTS_SOLVED = {
    "tense_ring": {
        "viscous_damping": 1.0,
        "load_transfer": 1.0,
        "aero_load": 1.0,
        "edge_impact": 1.0,
        "sensor_lag": 1.0,
    },
    "solid_belt": {
        "viscous_damping": 1.0,
        "load_transfer": 1.0,
        "aero_load": 1.0,
        "edge_impact": 1.0,
        "sensor_lag": 1.0,
    },
}
SPEEDS_M_S = np.linspace(5.0, 26.0, 7)
#: of the tire's load
LOAD_SHARES = np.linspace(0.4, 2.2, 25)

# ---- a ring in large deflection ------------------------------------------------------------------

#: nodes round the ring: 1.8 mm apart
NODES = 1024
_STRETCHING_N = 1.0e6


@dataclass(frozen=True)
class Solved:
    """Strain with inner sign, (speeds, loads, POINTS) from xi = -pi R, and half lengths [m]."""

    strain: Array
    half_length_m: Array
    load_N: Array


class TenseRing:
    """Equilibrium of the ring's nodes and of the hub's height at a load and a speed."""

    def __init__(self, tire: Tire, damping_1_s: float, impact: float) -> None:
        self.tire, self.damping, self.impact = tire, damping_1_s, impact
        self.step = 2 * np.pi * tire.radius_m / NODES
        angle = 2 * np.pi * (np.arange(NODES) - NODES // 2) / NODES
        self.outward = np.stack([np.sin(angle), -np.cos(angle)], axis=1)
        self.along = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        self.rest = tire.radius_m * self.outward
        one = sparse.identity(NODES, format="csr")
        ahead = sparse.csr_matrix(np.roll(np.eye(NODES), 1, axis=1))
        self.first = (ahead - one) / self.step
        self.second = (ahead + ahead.T - 2 * one) / self.step**2
        self.central = (ahead - ahead.T) / (2 * self.step)
        both = sparse.identity(2)
        self.bending = 0.5 * tire.bending_N_m2 * sparse.kron(both, self.second.T @ self.second)
        kw, kv = 0.3 * tire.foundation_N_m2, 0.15 * tire.foundation_N_m2
        blocks = [
            [
                sparse.diags(
                    kw * self.outward[:, i] * self.outward[:, j]
                    + kv * self.along[:, i] * self.along[:, j]
                )
                for j in (0, 1)
            ]
            for i in (0, 1)
        ]
        self.sidewall = sparse.bmat(blocks)
        swirl = sparse.csr_matrix([[0.0, 1.0], [-1.0, 0.0]])
        self.inflation = 2.2e5 * tire.width_m * sparse.kron(swirl, self.central)
        self.tread = 18.0 * tire.foundation_N_m2

    def linear(self, speed: float) -> sparse.csr_matrix:
        """Stiffness of all but stretching and contact, per length."""
        inertia = (
            -self.tire.mass_kg_m
            * speed**2
            * sparse.kron(sparse.identity(2), self.first.T @ self.first)
        )
        out = self.bending + self.sidewall - self.inflation + inertia
        if self.damping:
            rate = 2.0 * self.tire.mass_kg_m * self.damping * speed
            radial = sparse.hstack([sparse.diags(self.outward[:, i]) for i in (0, 1)])
            out = out + rate * radial.T @ self.central @ radial
        return sparse.csr_matrix(out)

    def solve(
        self, start: Array, height: float, speed: float, load: float | None
    ) -> tuple[Array, float]:
        """Positions (2 NODES,) and the road's depth below the hub; at a given depth for no load."""
        x, rest = start.copy(), self.rest.T.ravel()
        linear = self.linear(speed)
        pushed = np.zeros(NODES)
        for turn in range(60):
            if load is not None and self.impact:
                pushed = self._pulse(x, height, speed, load)
            segments = np.stack([self.first @ x[:NODES], self.first @ x[NODES:]])
            stretch = np.hypot(*segments)
            pull = _STRETCHING_N * (1.0 - 1.0 / stretch)
            side = self.sidewall @ rest
            force = linear @ x - side
            if self.damping:
                radial = (
                    self.tire.mass_kg_m
                    * 2
                    * self.damping
                    * speed
                    * (self.central @ np.full(NODES, self.tire.radius_m))
                )
                force -= np.concatenate([radial * self.outward[:, i] for i in (0, 1)])
            force += np.concatenate([self.first.T @ (pull * segments[i]) for i in (0, 1)])
            depth = -x[NODES:] - height
            touching = depth > 0
            force[NODES:] -= self.tread * np.where(touching, depth, 0.0) + pushed
            blocks = [[None, None], [None, None]]
            for i in (0, 1):
                for j in (0, 1):
                    part = _STRETCHING_N * segments[i] * segments[j] / stretch**3
                    whole = sparse.diags(part + (pull if i == j else 0.0))
                    blocks[i][j] = self.first.T @ whole @ self.first
            jacobian = linear + sparse.bmat(blocks)
            springs = np.concatenate([np.zeros(NODES), self.tread * touching])
            jacobian = jacobian + sparse.diags(springs)
            if load is None:
                move, lift = splu(sparse.csc_matrix(jacobian)).solve(-force), 0.0
            else:
                missing = self.step * (self.tread * depth[touching].sum() + pushed.sum()) - load
                factor = splu(sparse.csc_matrix(jacobian))
                plain, by_height = factor.solve(-force), factor.solve(-springs)
                weight = self.step * springs
                # load changes by -weight (dx_z + dheight)
                lift = (missing - weight @ plain) / (weight @ by_height + weight.sum())
                move = plain + lift * by_height
            largest = max(np.abs(move).max(), abs(lift))
            share = min(1.0, 3e-3 / largest)
            x, height = x + share * move, height + share * lift
            if largest < 1e-10 or (turn > 30 and largest < 1e-8):
                return x, height
        raise RuntimeError(f"no equilibrium at {speed} m/s and {load} N")

    def edges(self, x: Array, height: float) -> tuple[float, float]:
        """Material abscissae of the first and last contact [m]."""
        depth = -x[NODES:] - height
        inside = np.flatnonzero(depth > 0)
        ends = []
        for node, outer in ((inside[0], inside[0] - 1), (inside[-1], inside[-1] + 1)):
            share = depth[node] / (depth[node] - depth[outer])
            ends.append((node + share * (outer - node) - NODES // 2) * self.step)
        return ends[0], ends[1]

    def _pulse(self, x: Array, height: float, speed: float, load: float) -> Array:
        if not (-x[NODES:] - height > 0).any():
            return np.zeros(NODES)
        entry, leave = self.edges(x, height)
        half = 0.5 * (leave - entry)
        place = (np.arange(NODES) - NODES // 2) * self.step
        shape = np.exp(-0.5 * ((place - entry) / (0.06 * half)) ** 2)
        return np.asarray(self.impact * load / (2 * half) * speed / 20.0 * shape)

    def strain(self, x: Array) -> Array:
        """Strain of the inner face less that at the top, at POINTS places."""
        one = [self.central @ x[:NODES], self.central @ x[NODES:]]
        two = [self.second @ x[:NODES], self.second @ x[NODES:]]
        length = np.hypot(*one)
        curvature = (one[0] * two[1] - one[1] * two[0]) / length**3
        told = length - 4.0 * self.tire.lever_m * curvature
        spectrum = np.fft.rfft(told - told[0])
        return np.asarray(np.fft.irfft(spectrum, POINTS) * (POINTS / NODES))

    def grid(self) -> Solved:
        loads = LOAD_SHARES * self.tire.load_N
        waves = np.empty((SPEEDS_M_S.size, loads.size, POINTS))
        halves = np.empty(waves.shape[:2])
        for row, speed in enumerate(SPEEDS_M_S):
            x, _ = self.solve(self.rest.T.ravel(), 1.0, speed, None)
            height = -x[NODES:].min() - 0.004
            x, _ = self.solve(x, height, speed, None)
            for column, load in enumerate(loads):
                x, height = self.solve(x, height, speed, load)
                entry, leave = self.edges(x, height)
                waves[row, column] = self.strain(x)
                halves[row, column] = 0.5 * (leave - entry)
        return Solved(waves, halves, loads)


# ---- a solid belt by finite elements -------------------------------------------------------------

#: belt and tread depth [m], their moduli [Pa] and the width that carries them [m]
_BELT_M, _TREAD_M, _TREAD_PA, _WIDTH_M = 0.006, 0.010, 6.0e6, 0.16


class SolidBelt:
    """Plane strain: belt (upper 6 mm) and tread, sidewalls above, a round gap to the road below."""

    def __init__(self, tire: Tire, damping_1_s: float, impact: float) -> None:
        try:
            import skfem
        except ImportError:
            sys.exit("solid_belt needs scikit-fem: pip install scikit-fem")
        self.tire, self.damping, self.impact = tire, damping_1_s, impact
        fine = np.linspace(-0.13, 0.13, 131)
        coarse = np.linspace(0.13, 0.6, 60)[1:]
        x = np.concatenate([-coarse[::-1], fine, coarse])
        depth = np.concatenate(
            [
                np.linspace(-_TREAD_M, 0.0, 5),
                np.linspace(0.0, _BELT_M, 4)[1:],
            ]
        )
        mesh = skfem.MeshQuad.init_tensor(x, depth)
        self.skfem, self.mesh = skfem, mesh
        self.basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementQuad2()), intorder=4)
        self.place = self.basis.doflocs
        top = mesh.facets_satisfying(lambda p: np.isclose(p[1], _BELT_M))
        self.top = skfem.FacetBasis(mesh, self.basis.elem, facets=top, intorder=4)
        below = np.isclose(self.place[1], -_TREAD_M)
        rows = self._vertical()
        nodes = np.flatnonzero(below & rows & (np.abs(self.place[0]) < 0.115))
        self.road = nodes[np.argsort(self.place[0][nodes])]
        self.x_road = self.place[0][self.road]
        liner = np.flatnonzero(np.isclose(self.place[1], _BELT_M) & ~rows)
        self.liner = liner[np.argsort(self.place[0][liner])]
        self.x_liner = self.place[0][self.liner]

    def _vertical(self) -> Array:
        """Which unknowns are vertical displacements."""
        probe = self.basis.project(lambda p: np.stack([0.0 * p[0], 1.0 + 0.0 * p[0]]))
        return np.asarray(probe > 0.5)

    def matrix(self, speed: float) -> sparse.csc_matrix:
        """Elasticity, sidewalls, tension less inertia, and losses."""
        from skfem import BilinearForm
        from skfem.helpers import ddot, eye, sym_grad, trace

        tire = self.tire
        # plane strain of the width; the belt's modulus gives the tire's bending stiffness
        poisson = 0.3
        belt = tire.bending_N_m2 * 12.0 * (1 - poisson**2) / (_WIDTH_M * _BELT_M**3)
        tension = 2.2e5 * 0.02 * tire.radius_m
        per_depth = (tension - tire.mass_kg_m * speed**2) / _BELT_M

        def elastic(u: Any, v: Any, w: Any) -> Any:
            inside = w.x[1] > 0.0
            young = np.where(inside, belt, _TREAD_PA)
            nu = np.where(inside, poisson, 0.45)
            lame = young * nu / ((1 + nu) * (1 - 2 * nu))
            shear = young / (2 * (1 + nu))
            strain = sym_grad(u)
            stress = 2.0 * shear * strain + lame * eye(trace(strain), 2)
            turned = inside * per_depth * u.grad[1][0] * v.grad[1][0]
            lost = inside * (2 * tire.mass_kg_m * self.damping * speed / _BELT_M)
            return _WIDTH_M * ddot(stress, sym_grad(v)) + turned + lost * u.grad[1][0] * v.value[1]

        def sidewall(u: Any, v: Any, w: Any) -> Any:
            k = tire.foundation_N_m2
            return k * u.value[1] * v.value[1] + 0.3 * k * u.value[0] * v.value[0]

        parts = [
            BilinearForm(elastic).assemble(self.basis),
            BilinearForm(sidewall).assemble(self.top),
        ]
        return sparse.csc_matrix(parts[0] + parts[1])

    def grid(self) -> Solved:
        tire = self.tire
        loads = LOAD_SHARES * tire.load_N
        around = (np.arange(POINTS) - POINTS // 2) * (2 * np.pi * tire.radius_m / POINTS)
        inside = np.abs(around) < 0.59
        waves = np.zeros((SPEEDS_M_S.size, loads.size, POINTS))
        halves = np.empty(waves.shape[:2])
        pushes = np.zeros((self.basis.N, self.road.size))
        pushes[self.road, np.arange(self.road.size)] = 1.0
        for row, speed in enumerate(SPEEDS_M_S):
            answer = splu(self.matrix(speed)).solve(pushes)
            compliance = answer[self.road]
            # the liner's longitudinal strain at the places of the wheel that the mesh covers
            strains = CubicSpline(self.x_liner, answer[self.liner]).derivative()(around[inside])
            for column, load in enumerate(loads):
                force, halves[row, column] = self._contact(compliance, load, speed)
                waves[row, column, inside] = strains @ force
            # edges lie between nodes 1 mm apart: a smooth law of the load through them
            law = np.polynomial.Polynomial.fit(np.sqrt(loads), halves[row], 4)
            halves[row] = law(np.sqrt(loads))
        return Solved(waves, halves, loads)

    def _contact(self, compliance: Array, load: float, speed: float) -> tuple[Array, float]:
        """Nodal forces >= 0 that carry the load on a gap x^2 / 2R, and half the length."""
        gap = self.x_road**2 / (2 * self.tire.radius_m)
        active = np.abs(self.x_road) < 0.04
        pulse = np.zeros(gap.size)
        for _ in range(100):
            some = np.flatnonzero(active)
            if self.impact:
                entry, leave = self.x_road[some[0]], self.x_road[some[-1]]
                shape = np.exp(-0.5 * ((self.x_road - entry) / (0.03 * (leave - entry))) ** 2)
                size = self.impact * load * speed / 20.0 * 0.06 * np.sqrt(2 * np.pi) / 4.0
                pulse = size * shape / shape.sum()
            count = some.size
            system = np.zeros((count + 1, count + 1))
            system[:count, :count] = compliance[np.ix_(some, some)]
            system[:count, count], system[count, :count] = -1.0, 1.0
            right = np.append(-gap[some] - compliance[some] @ pulse, load - pulse.sum())
            solution = np.linalg.solve(system, right)
            force = np.zeros(gap.size)
            force[some], depth = solution[:count], solution[count]
            apart = compliance @ (force + pulse) + gap - depth
            wanted = np.where(active, force > 0.0, apart < 0.0)
            if (wanted == active).all():
                break
            active = wanted
        step = self.x_road[1] - self.x_road[0]
        return force + pulse, 0.5 * (self.x_road[some[-1]] - self.x_road[some[0]] + step)


# ---- interpolated over speed and load ------------------------------------------------------------

_SOLVERS: dict[str, Callable[[Tire, float, float], TenseRing | SolidBelt]] = {
    "tense_ring": TenseRing,
    "solid_belt": SolidBelt,
}


@dataclass
class GridTruth:
    """Waveforms between the solved ones."""

    tire: Tire
    form: str
    effect: str
    sizes: Mapping[str, float]

    def __post_init__(self) -> None:
        damping = self.sizes.get("damping_rate_1_s", 0.0)
        impact = self.sizes.get("amplitude", 0.0) if self.effect == "edge_impact" else 0.0
        source = Path(__file__).read_bytes()
        key = hashlib.sha256(repr((self.tire, self.form, damping, impact)).encode() + source)
        folder = Path(os.environ.get("FORM_CACHE", tempfile.gettempdir())) / "form_worlds"
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{self.form}_{key.hexdigest()[:16]}.npz"
        if not path.exists():
            solved = _SOLVERS[self.form](self.tire, damping, impact).grid()
            part = path.with_suffix(f".{os.getpid()}.npz")
            np.savez(part, **vars(solved))
            part.replace(path)
        with np.load(path) as kept:
            self.solved = Solved(**{name: kept[name] for name in kept.files})
        self._halves = CubicSpline(
            self.solved.load_N, CubicSpline(SPEEDS_M_S, self.solved.half_length_m)(15.0)
        )

    def load_N(self, at: Instants) -> Array:
        load = at.log.load_N * (1.0 + at.scatter)
        if self.effect == "load_transfer":
            load = load * (1.0 + self.sizes["coefficient"] * at.acceleration_m_s2 / GRAVITY_M_S2)
        if self.effect == "aero_load":
            load = load * (1.0 + self.sizes["coefficient"] * (at.speed_m_s / 30.0) ** 2)
        return load

    def _weights(self, at: Instants) -> list[tuple[Array, Array]]:
        """Of speeds and of loads: four nodes and their weights at each instant."""
        out = []
        for value, nodes in ((at.speed_m_s, SPEEDS_M_S), (self.load_N(at), self.solved.load_N)):
            x = (value - nodes[0]) / (nodes[1] - nodes[0])
            if x.min() < -0.5 or x.max() > nodes.size - 0.5:
                raise ValueError("a speed or a load is outside of what was solved")
            base = np.clip(np.floor(x).astype(int), 1, nodes.size - 3)
            f = x - base
            weights = np.stack(
                [
                    -f * (f - 1) * (f - 2) / 6,
                    (f + 1) * (f - 1) * (f - 2) / 2,
                    -(f + 1) * f * (f - 2) / 2,
                    (f + 1) * f * (f - 1) / 6,
                ]
            )
            out.append((base + np.arange(-1, 3)[:, None], weights))
        return out

    def half_length_m(self, at: Instants) -> Array:
        (rows, a), (columns, b) = self._weights(at)
        table = self.solved.half_length_m
        return np.asarray(
            sum(a[i] * b[j] * table[rows[i], columns[j]] for i in range(4) for j in range(4))
        )

    def waveforms(self, at: Instants) -> Array:
        (rows, a), (columns, b) = self._weights(at)
        out = np.zeros((at.speed_m_s.size, POINTS))
        for i in range(4):
            for j in range(4):
                out += (a[i] * b[j])[:, None] * self.solved.strain[rows[i], columns[j]]
        if self.effect == "sensor_lag":
            kappa = np.arange(POINTS // 2 + 1) / self.tire.radius_m
            lag = 1.0 + 1j * at.speed_m_s[:, None] * kappa * self.sizes["lag_s"]
            out = np.fft.irfft(np.fft.rfft(out, axis=1) / lag, POINTS, axis=1)
        return out

    def described(self) -> dict[str, Any]:
        return {
            "load_N": self.solved.load_N.tolist(),
            "speed_m_s": SPEEDS_M_S.tolist(),
            "half_length_m": self.solved.half_length_m.tolist(),
        }


def solved_case(suite: str, form: str, effect: str, number: int) -> Case:
    """A case of a tire solved by contact; KeyError for an effect that it does not have."""
    tire = replace(tire_of(suite, number), width_m=0.08 if form == "tense_ring" else 0.205)
    sizes = sizes_of(suite, effect, number)
    if effect:
        sizes = {k: v * EFFECTS_SOLVED[form][effect] for k, v in sizes.items()}
    truth = GridTruth(tire, form, effect, sizes)
    return Case(suite, form, effect, number, tire, truth, sizes)
