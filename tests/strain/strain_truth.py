"""Known truth: finite differences of P1's beam and of a ring pressed onto a road."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as sla
from scipy.interpolate import CubicSpline, RectBivariateSpline
from scipy.linalg import solve_banded

from tirelog.strain.footprint.kernels import MOTION
from tirelog.strain.footprint.learn import PatchWindows
from tirelog.vocabulary.arrays import records

STEP_M = 2.5e-4
Traction = Callable[[np.ndarray], np.ndarray]


def windows_of(values, rate_Hz, **motion) -> PatchWindows:
    """Windows (n, m) of strain, patch downward: `centre` [columns], speed and acceleration."""
    moving = records(MOTION, rate_Hz=np.full(len(values), rate_Hz), **motion)
    return PatchWindows(np.arange(len(values)), values, moving)


@dataclass(frozen=True)
class Beam:
    """EJ w'''' + mu c^2 w'' + 2 mu omega_d c w' + k w = p (errata), p a parabola over
    +-half_length_m, tilted by `tilt`; or (1 - |x|^`power`) (1 + `saddle` x^2), x = xi / L.
    """

    power: float = field(default=2.0, kw_only=True)
    saddle: float = field(default=0.0, kw_only=True)
    half_length_m: float = 0.055
    stiffness: float = 4.0
    foundation: float = 2e6
    line_mass: float = 4.5
    damping_1_s: float = 0.0
    tilt: float = 0.0
    load_N: float = 3600.0
    lever_m: float = 3e-4
    slip: float = 0.0
    traction_lever_m: float = 0.018
    speeds: tuple[float, float] = (5.0, 25.0)
    _cache: dict = field(default_factory=dict, compare=False, repr=False)

    def pressure(self, xi: np.ndarray) -> np.ndarray:
        L, n, a = self.half_length_m, self.power, self.saddle
        x = np.clip(xi / L, -1, 1)
        mean = n / (n + 1) + a * (1 / 3 - 1 / (n + 3))
        shape = (1 - np.abs(x) ** n) * (1 + a * x**2) * (1 - self.tilt * x)
        return np.where(np.abs(xi) < L, 0.5 * self.load_N / (L * mean) * shape, 0.0)

    @property
    def onset_m(self) -> float:
        """P2 (15) with C_x of (17)."""
        return self.half_length_m * (1 - 2 * abs(self.slip))

    def shear(self, xi: np.ndarray) -> np.ndarray:
        """P2 (13), friction coefficients 0.8 and 0.6."""
        L = self.half_length_m
        adhering = self.slip * 1.5 * self.load_N / L**2 * 0.8 * (xi + L)
        inside = np.where(
            xi <= self.onset_m, adhering, np.sign(self.slip) * 0.6 * self.pressure(xi)
        )
        return np.where(np.abs(xi) < L, inside, 0.0)

    def wave(self, speed: float) -> tuple[np.ndarray, np.ndarray]:
        """xi and strain (minimum in the patch) at one speed."""
        h = STEP_M
        xi = np.arange(-3200, 3201) * h
        inside = (np.arange(41) - 20) / 40 * h
        weight = np.r_[0.5, np.ones(39), 0.5] / 40
        load = self.pressure(xi[:, None] + inside) @ weight
        load = (
            load
            + self.traction_lever_m * np.diff(self.shear(np.r_[xi - h / 2, xi[-1] + h / 2])) / h
        )
        bending, inertia = self.stiffness / h**4, self.line_mass * speed**2 / h**2
        drag = self.line_mass * self.damping_1_s * speed / h
        bands = np.zeros((5, xi.size))
        bands[0] = bands[4] = bending
        bands[1], bands[3] = -4 * bending + inertia + drag, -4 * bending + inertia - drag
        bands[2] = 6 * bending - 2 * inertia + self.foundation
        inward = solve_banded((2, 2), bands, load)
        curvature = np.zeros_like(inward)
        curvature[1:-1] = (inward[2:] - 2 * inward[1:-1] + inward[:-2]) / h**2
        return xi, self.lever_m * curvature

    def dissipation_factor(self, speed: float) -> float:
        """int (d eps / d xi)^2 d xi [1/m]."""
        xi, strain = self.wave(speed)
        return float(np.trapezoid(np.gradient(strain, xi) ** 2, xi))

    def __call__(self, xi: np.ndarray, speed: np.ndarray) -> np.ndarray:
        if "spline" not in self._cache:
            low, high = self.speeds
            grid = np.linspace(low, high, 15 if high > low else 1)
            waves = np.array([self.wave(v)[1] for v in grid])
            where = self.wave(low)[0]
            self._cache["spline"] = (
                CubicSpline(where, waves[0])
                if grid.size == 1
                else RectBivariateSpline(grid, where, waves, kx=3, ky=3)
            )
        spline = self._cache["spline"]
        near = np.clip(xi, -0.79, 0.79)
        return -(spline(near) if self.speeds[0] == self.speeds[1] else spline.ev(speed, near))


@dataclass(frozen=True)
class Ring:
    """An inextensible ring (P3 Table 2 by default) pressed by `sink_m` onto a flat road through
    tread springs, one-sidedly; under `slip` P2's brush rubs it by the pressure of these springs.
    """

    sink_m: float = 0.03
    tread: float = 8.75e7
    radius_m: float = 0.305
    bending: float = 2.0
    width_m: float = 0.14
    pressure_Pa: float = 1.2e5
    radial: float = 6.3e5
    tangential: float = 6.3e5
    lever_m: float = 3e-4
    nodes: int = 3000
    slip: float = 0.0
    traction_lever_m: float = 0.018
    _cache: dict = field(default_factory=dict, compare=False, repr=False)

    def shear(
        self, xi: np.ndarray, pressure: np.ndarray, half_length_m: float
    ) -> tuple[np.ndarray, float]:
        """P2 (13), friction coefficients 0.8 and 0.6, C_x of (17) by the load; where it slides."""
        load = pressure.sum() * (xi[1] - xi[0])
        held = abs(self.slip) * 1.5 * 0.8 * load / half_length_m**2 * (xi + half_length_m)
        inside = np.flatnonzero(pressure > 0)
        sliding = inside[held[inside] > 0.8 * pressure[inside]]
        first = sliding[0] if self.slip else inside[-1] + 1
        tau = np.where(np.arange(xi.size) < first, held, 0.6 * pressure)
        tau[pressure <= 0] = 0.0
        return np.sign(self.slip) * tau, float(0.5 * (xi[first - 1] + xi[first]))

    def solve(self) -> tuple[np.ndarray, np.ndarray, float, float]:
        """xi, strain (minimum in the patch), half of the contact length, where sliding begins."""
        n, R = self.nodes, self.radius_m
        h = 2 * np.pi / n
        phi = (np.arange(n) + 0.5) * h - np.pi
        forward = sp.diags([np.ones(n - 1), [1.0]], [1, -(n - 1)]).tocsr()
        eye = sp.identity(n, format="csr")
        slope, second = (forward - eye) / h, (forward - 2 * eye + forward.T) / h**2
        radial = -slope  # outward displacement from the tangential one: the ring does not stretch
        bend, steep = radial + second @ radial, slope @ radial
        energy = self.bending / R**4 * (bend.T @ bend) + self.pressure_Pa * self.width_m / R * (
            steep.T @ steep - radial.T @ radial
        )
        energy = (energy + self.radial * (radial.T @ radial) + self.tangential * eye) * (R * h)
        cosine = np.cos(phi)
        free_gap = R * cosine - (R - self.sink_m)
        touching = (free_gap > 0) & (np.abs(phi) < 1)
        for _ in range(60):
            springs = self.tread * R * h * touching
            matrix = energy + radial.T @ sp.diags(springs * cosine**2) @ radial
            tangential = sla.spsolve(matrix.tocsc(), -radial.T @ (springs * cosine * free_gap))
            gap = free_gap + cosine * (radial @ tangential)
            now = (gap > 0) & (np.abs(phi) < 1)
            if (now == touching).all():
                break
            touching = now
        last = np.flatnonzero(touching)[-1]
        edge = phi[last] + h * gap[last] / (gap[last] - gap[last + 1])
        onset = np.nan
        if self.slip:
            pressure = self.tread * np.maximum(gap, 0.0) * touching
            tau, onset = self.shear(R * phi, pressure, R * edge)
            bent = self.traction_lever_m * np.gradient(tau, R * h)
            inward = pressure * cosine + bent - tau * np.sin(phi)
            loads = (tau * cosine - radial.T @ inward) * (R * h)
            tangential = sla.spsolve(energy.tocsc(), loads)
        outward = radial @ tangential
        strain = -self.lever_m / R**2 * (outward + second @ outward)
        return R * phi, strain, float(R * edge), onset

    def _known(self) -> tuple:
        if "it" not in self._cache:
            xi, strain, edge, onset = self.solve()
            turn = 2 * np.pi * self.radius_m
            spline = CubicSpline(
                np.r_[xi, xi[0] + turn], np.r_[strain, strain[0]], bc_type="periodic"
            )
            self._cache["it"] = spline, xi[0], turn, edge, onset
        return self._cache["it"]

    @property
    def half_length_m(self) -> float:
        return self._known()[3]

    @property
    def onset_m(self) -> float:
        return self._known()[4]

    def dissipation_factor(self, speed: float) -> float:
        """int (d eps / d xi)^2 d xi [1/m]; a ring without damping is the same at each speed."""
        xi, strain, *_ = self.solve()
        return float(np.trapezoid(np.gradient(strain, xi) ** 2, xi))

    def __call__(self, xi: np.ndarray, speed: np.ndarray) -> np.ndarray:
        spline, start, turn, *_ = self._known()
        return -spline(start + np.mod(xi - start, turn))
