"""The coupled rigid and flexible ring (P3, last section, with the errata).

Its equations of motion.

Frame: s along the passing of tread material through the patch, z up, both at rest in space; the
tire drives towards -s. An angle phi on the ring counts from the patch centre in the direction of
rotation: e_r = (sin phi, -cos phi), e_t = (cos phi, sin phi). The tread band is an inextensible
ring; with v tangential and w outward, seen in the frame that does not turn,

    v = 2 Re sum_(n = 2..N) V_n e^(i n phi),    w = -v',

and the rigid ring is its centre C (n = 1) and its angle psi, dpsi/dt = Omega (n = 0).

Lagrangian. A material point has the velocity

    dC/dt + (w_t + Omega (w' - v)) e_r + (v_t + Omega (R + w + v')) e_t.

The belt keeps its length to second order, w + v' = -(w' - v)^2 / (2 R); then every
term in Omega^2 but the rigid one cancels (the errata's "rotation cancels altogether"):

    T = m_h |dH/dt|^2 / 2 + m_r |dC/dt|^2 / 2 + J_h Omega_h^2 / 2 + J_r Omega^2 / 2
        + 2 pi R sum m_n |dV_n/dt|^2 + Omega P
    P = rho A R int w_t (w' - v) dphi = 4 pi R sum gamma_n Im(dV_n/dt conj V_n)
    U = k_s |a|^2 / 2 + k_theta (psi - psi_h)^2 / 2 + 2 pi R sum Z_n |V_n|^2 + contact,  a = C - H

    m_n = rho A (1 + n^2),  gamma_n = rho A n (n^2 - 1),  Z_n undamped as in `ring.modal_impedance`,
    m_r = 2 pi R rho A + m_a,        J_r = m_r R^2,
    k_s = a_s pi R (k_v + k_w),      k_theta = a_theta 2 pi R^3 k_v

The rigid ring is the belt's own n = 0 and 1. m_a gives it the mass of the tread; the ratios a_s,
a_theta, a_c give it the sidewall's stiffness and damping. They are 1 unless they are known
separately from the flexible modes'.

Damping acts on what moves against the turning sidewall (Rayleigh):

    c_n = c_v + c_w n^2,  c_s = a_c pi R (c_v + c_w),  c_theta = a_c 2 pi R^3 c_v

    D = 2 pi R sum c_n |dV_n/dt + i n Omega V_n|^2 + c_s |da/dt - Omega_h x a|^2 / 2
        + c_theta (Omega - Omega_h)^2 / 2

Equations of motion of the flexible ring, the rigid ring's spin and centre, the hub and its spin.
E_n = Q_v,n + i n Q_w,n are the loads' modes, f_j the force of the road on tread node j at phi_j.

    m_n V'' + (c_n + 2 i gamma_n Omega) V' + (Z_n + i n Omega c_n + i gamma_n Omega') V = E_n
    d/dt (J_r Omega + P) = sum f_j . r'_j - k_theta (psi - psi_h) - c_theta (Omega - Omega_h)
                           + 4 pi R sum n c_n Im(conj(V' + i n Omega V) V)
    m_r C'' = sum f_j - F_s,    F_s = k_s a + c_s (a' - Omega_h x a)
    m_h H'' = F_s - i c_h H_z' + F_applied
    J_h Omega_h' = k_theta (psi - psi_h) + c_theta (Omega - Omega_h)
                   + c_s (a' - Omega_h x a) . (e_z x a) + applied torque

Signs. The gyroscopic term 2 i gamma_n Omega is skew (it does no work) and vanishes for n = 1: a
rigid translation feels no rotation. P3's 4 rho A n Omega belongs to the turning frame, -4 i rho A n
Omega d/dt there; d/dt -> d/dt + i n Omega brings it here (tested). The damping's torque on the spin
is the rolling resistance: in steady rolling it is -4 pi R Omega sum n^2 c_n |V_n|^2, its power what
the belt dissipates. A torque that turns the ring is f . r' with |r'| = R: a belt that does not
stretch rolls with the radius R, however it is loaded.

Not in it: the belt's stretch, camber and side force, a tread with mass of its own, springs that
know second order (k_w against k_v under wind-up).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from tirelog.errors import ModelError
from tirelog.physics.carcass import contact
from tirelog.physics.carcass.numbers import steady_carcass
from tirelog.physics.carcass.structures import RingCarcass, modal_impedance
from tirelog.physics.model.model import Model
from tirelog.physics.spectral import STEP, ComplexArray
from tirelog.vocabulary.arrays import FloatArray


@dataclass(frozen=True)
class CoupledRing(RingCarcass):
    """A tire on its hub: constants of ring, belt mass, hub, tread and brush.

    The ring's constants as in `ring.RingCarcass`, rho A [kg/m], hub m_h [kg] and J_h [kg m^2].

    c_x [N/m^2] the bristles' stiffness along the road, mu its friction; modes N, the largest n; m_a
    [kg], a_s, a_theta, a_c as above; c_h [N s/m] damps the hub's vertical motion against a vehicle
    that keeps its height. ModelError for what cannot move.
    """

    rho_A: float = field(kw_only=True)
    m_h: float = 20.0
    J_h: float = 0.8
    c_x: float = 1.9e6
    mu: float = 0.8
    modes: int = 60
    m_a: float = 0.0
    a_s: float = 1.0
    a_theta: float = 1.0
    a_c: float = 1.0
    c_h: float = 0.0

    def __post_init__(self) -> None:
        for own in fields(self):
            value = getattr(self, own.name)
            may_vanish = own.name in ("c_w", "c_v", "pb", "c_x", "mu", "m_a", "a_c", "c_h")
            if not (np.isfinite(value) and (value > 0.0 or (may_vanish and value == 0.0))):
                raise ModelError(
                    f"coupled ring with {own.name} = {value:g}",
                    allowed=f"a finite number {'of at least' if may_vanish else 'above'} zero is "
                    "allowed",
                    do="correct it",
                )

    # ---- constants -------------------------------------------------------------------------------

    @cached_property
    def n(self) -> FloatArray:
        """2 ... N, shape (N - 1,)."""
        return np.arange(2.0, self.modes + 1.0)

    @cached_property
    def m_n(self) -> FloatArray:
        return self.rho_A * (1.0 + self.n**2)

    @cached_property
    def gamma_n(self) -> FloatArray:
        return self.rho_A * self.n * (self.n**2 - 1.0)

    @cached_property
    def c_n(self) -> FloatArray:
        return self.c_v + self.c_w * self.n**2

    @cached_property
    def Z_n(self) -> FloatArray:
        """Undamped stiffness [N/m^2]."""
        return modal_impedance(self.n, self).real

    @cached_property
    def m_r(self) -> float:
        return 2.0 * np.pi * self.R * self.rho_A + self.m_a

    @cached_property
    def J_r(self) -> float:
        return self.m_r * self.R**2

    @cached_property
    def k_s(self) -> float:
        return self.a_s * np.pi * self.R * (self.k_v + self.k_w)

    @cached_property
    def c_s(self) -> float:
        return self.a_c * np.pi * self.R * (self.c_v + self.c_w)

    @cached_property
    def k_theta(self) -> float:
        return self.a_theta * 2.0 * np.pi * self.R**3 * self.k_v

    @cached_property
    def c_theta(self) -> float:
        return self.a_c * 2.0 * np.pi * self.R**3 * self.c_v

    # ---- bounds ----------------------------------------------------------------------------------

    @property
    def critical_speed_m_s(self) -> float:
        """Critical speed [m/s], R sqrt(k_s / m), of the ring on its sidewall.

        There the turning sidewall's damping drives a whirl of the ring (m: the ring, on a hub held
        by the vehicle).

        Lower than the ring on a free hub; the flexible modes have none (Z_n > 0 at every speed).
        """
        return self.R * float(np.sqrt(self.k_s / self.m_r))

    def check_speed(self, speed_m_s: float) -> None:
        """ModelError at and above the critical speed."""
        if not abs(speed_m_s) < self.critical_speed_m_s:
            raise ModelError(
                f"speed {speed_m_s:g} m/s is beyond the critical one, "
                f"{self.critical_speed_m_s:.1f} m/s, where the ring whirls in its sidewall",
                allowed="a lower one is allowed",
                do="lower the speed or give a stiffer sidewall",
            )

    def largest_step_s(self, speed_m_s: float = 0.0) -> float:
        """Longest stable step [s].

        One radian of the tread's contact frequency, 2.4 of the belt's highest one at that speed.
        """
        contact = np.sqrt((self.k_t + self.c_x) / self.rho_A)
        belt = np.sqrt(self.Z_n[-1] / self.m_n[-1] + (self.modes * speed_m_s / self.R) ** 2)
        return float(min(1.0 / contact, 2.4 / belt))

    # ---- momentum --------------------------------------------------------------------------------

    def gyroscopic_momentum(self, V: ComplexArray, rate: ComplexArray) -> float:
        """The belt's angular momentum P [kg m^2/s] beside the rigid one."""
        return 4.0 * np.pi * self.R * float(np.vdot(V, self.gamma_n * rate).imag)

    def belt_drag(self, V: ComplexArray, rate: ComplexArray, omega: float) -> float:
        """Torque [N m] of the belt's damping on the spin."""
        carried = self.n * self.c_n * V
        # rate + i n Omega V is what moves in the turning frame
        return (
            4.0
            * np.pi
            * self.R
            * float(np.vdot(rate, carried).imag - omega * np.vdot(self.n * V, carried).real)
        )


# ---- How a tire rings: natural frequencies, damping and shapes of the coupled ring.
#
# Free in the air, or on a flat road.
#
# The equations of `ring`, linear about the tire that turns at Omega (second-order terms left out),
# in the frame that does not turn:
#
#     M q'' + (C + G) q' + (K + D) q = 0,
#     q = (H_s, H_z, C_s, C_z, psi_h, psi, Re V_2, Im V_2, ... Re V_N, Im V_N)
#
# G is the gyroscopic part 4 pi R 2 gamma_n Omega (skew), D what the turning dampers push sideways
# (circulatory). On the road the tread's springs under the patch at rest are added to K, sum k_t h
# g g' with g the gradient of a node's height; and the bristles, which cling (they are far from
# sliding in free rolling), as states of their own that pass through the patch with the belt:
#
#     u_t + Omega u_phi = a . q' + Omega b . q,  u = 0 at the entry,    force on q:  - sum c_x h a u
#
# a the gradient of a node's place along the road, b of (w' - v) sin phi. A ring model without
# bristles is on a road free of friction: its rotation does not feel the road. Frequencies are
# those that an observer beside the tire hears; on the belt itself a wave of n lobes is n Omega / 2
# pi away.

#: A coupled ring model's names for what a ring model does not have.
_OWN = {
    "m_h": "hub_mass_kg",
    "J_h": "hub_inertia_kg_m2",
    "c_h": "suspension_damping_N_s_m",
    "m_a": "added_mass_kg",
    "a_s": "sidewall_stiffness_ratio",
    "a_theta": "wind_up_stiffness_ratio",
    "a_c": "sidewall_damping_ratio",
    "c_x": "bristle_stiffness_N_m2",
    "mu": "friction",
}
#: coordinates before the belt's: two places each of hub and ring, and their angles
_RINGS = 6


@dataclass(frozen=True)
class Mode:
    """One natural vibration: frequency [Hz], damping ratio and shape.

    The shape comes in words, with lobes n (0 rotational, 1 rigid) and the share of n in its energy.

    direction: `with` or `against` the rotation for a travelling wave, `standing` else.
    """

    frequency_Hz: float
    damping_ratio: float
    shape: str
    lobes: int
    direction: str
    share: float


def natural_modes(
    tire: CoupledRing, *, speed_m_s: float = 0.0, load_N: float | None = None, to_Hz: float = 300.0
) -> list[Mode]:
    """The natural modes up to `to_Hz`, lowest first.

    Free in the air without `load_N`, else on the road under it.

    ModelError for a speed at or beyond the critical one, a load that does not press, or a range
    that is none.
    """
    if not to_Hz > 0.0:
        raise ModelError(
            f"modes up to {to_Hz:g} Hz",
            allowed="above zero is allowed",
            do="give the highest frequency",
        )
    tire.check_speed(speed_m_s)
    tire = enough_modes(tire, to_Hz, speed_m_s)
    system, M = first_order(tire, speed_m_s / tire.R, load_N)
    size = M.size
    values, vectors = np.linalg.eig(system)
    # Slower than this [Hz] is no vibration but a tire that rolls away. Twice as much is still
    # slower than any mode of a tire.
    heard = (values.imag > 2.0 * np.pi * 0.05) & (values.imag <= 2.0 * np.pi * to_Hz)
    found = [
        _mode(value, vector[:size], M, turning=speed_m_s != 0.0)
        for value, vector in zip(values[heard], vectors[:, heard].T)
    ]
    return sorted(found, key=lambda mode: (mode.frequency_Hz, mode.lobes))


def modes_of_model(
    model: Model,
    *,
    speed_m_s: float = 0.0,
    load_N: float | None = None,
    hub_mass_kg: float | None = None,
    hub_inertia_kg_m2: float | None = None,
    to_Hz: float = 300.0,
) -> list[tuple[str, Mode]]:
    """(support, mode) of a ring model in the air, and on the road with a tread.

    load_N      on the road; None: the model's
    ModelError  a beam, which has no modes here, or a load for a tire without a tread
    """
    if steady_carcass(model.carcass) != "ring":
        raise ModelError(
            f"a {model.carcass} has no natural modes here",
            allowed='carcass = "ring" or "coupled_ring" is allowed',
            do="make one with --carcass ring",
            file=model.path,
        )
    tire = of_model(model.values, hub_mass_kg=hub_mass_kg, hub_inertia_kg_m2=hub_inertia_kg_m2)
    supports: dict[str, float | None] = {"air": None}
    if model.contact == "flat_road":
        supports["road"] = model.values["load_N"] if load_N is None else load_N
    elif load_N is not None:
        raise ModelError(
            "--load needs a tread on the road",
            allowed='contact = "flat_road" is allowed',
            do="leave it out, or make such a model",
            file=model.path,
        )
    return [
        (support, mode)
        for support, stands in supports.items()
        for mode in natural_modes(tire, speed_m_s=speed_m_s, load_N=stands, to_Hz=to_Hz)
    ]


def of_model(
    values: Mapping[str, float],
    *,
    hub_mass_kg: float | None = None,
    hub_inertia_kg_m2: float | None = None,
) -> CoupledRing:
    """The coupled ring with a ring or coupled ring model's numbers by name.

    The names are those of the contract ("Model file"). ModelError if it could not move with them.

    A ring has no hub of its own: 20 kg and 0.8 kg m^2 without the two; and no bristles. A model
    without a tread has one that does not matter in the air.
    """
    own: dict[str, Any] = {"c_x": 0.0} | {
        name: values[key] for name, key in _OWN.items() if key in values
    }
    own |= {
        name: given
        for name, given in (("m_h", hub_mass_kg), ("J_h", hub_inertia_kg_m2))
        if given is not None
    }
    return CoupledRing(
        EI=values["flexural_stiffness_N_m2"],
        k_w=values["radial_stiffness_N_m2"],
        k_v=values["tangential_stiffness_N_m2"],
        c_w=values["radial_damping_N_s_m2"],
        c_v=values["tangential_damping_N_s_m2"],
        pb=values["inflation_pressure_Pa"] * values["width_m"],
        R=values["radius_m"],
        k_t=values.get("tread_stiffness_N_m2", 1e8),
        rho_A=values["line_mass_kg_m"],
        **own,
    )


def enough_modes(tire: CoupledRing, to_Hz: float, speed_m_s: float) -> CoupledRing:
    """The tire with the belt modes that a spectrum up to `to_Hz` needs, 12 to 60.

    As many as ring up to there (seen beside a tire at that speed), and as many again for the patch.
    """
    n = np.arange(2.0, 61.0)
    wide = replace(tire, modes=60)
    slow = np.sqrt(wide.Z_n / wide.m_n) - n * abs(speed_m_s) / tire.R
    below = n[slow < 2.0 * np.pi * to_Hz]
    return replace(
        tire, modes=int(np.clip(2.0 * (below[-1] if below.size else 0.0) + 4.0, 12.0, 60.0))
    )


def first_order(
    tire: CoupledRing, omega_rad_s: float, load_N: float | None = None
) -> tuple[FloatArray, FloatArray]:
    """(A of y' = A y, diagonal of M), y = (q, q', and on the road the bristles' deflections u)."""
    M, damping, stiffness = matrices(tire, omega_rad_s, load_N)
    size = M.size
    system = np.zeros((2 * size, 2 * size))
    system[:size, size:] = np.eye(size)
    system[size:] = np.hstack([-stiffness, -damping]) / M[:, None]
    if load_N is not None and tire.c_x > 0.0 and tire.mu > 0.0:
        system = _with_bristles(tire, system, M, omega_rad_s, load_N)
    return system, M


def matrices(
    tire: CoupledRing, omega_rad_s: float, load_N: float | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(diagonal of M, C + G, K + D), (k,), (k, k), (k, k) in SI, q as above."""
    scale = 4.0 * np.pi * tire.R
    M = np.concatenate(
        [
            [tire.m_h, tire.m_h, tire.m_r, tire.m_r, tire.J_h, tire.J_r],
            np.repeat(scale * tire.m_n, 2),
        ],
    )
    damping, stiffness = np.zeros((M.size, M.size)), np.zeros((M.size, M.size))
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    pair = np.array([[1.0, -1.0], [-1.0, 1.0]])
    damping[:4, :4] = tire.c_s * np.kron(pair, np.eye(2))
    stiffness[:4, :4] = tire.k_s * np.kron(pair, np.eye(2)) - tire.c_s * omega_rad_s * np.kron(
        pair, turn
    )
    damping[1, 1] += tire.c_h
    damping[4:6, 4:6], stiffness[4:6, 4:6] = tire.c_theta * pair, tire.k_theta * pair
    for i, (n, c, gamma, Z) in enumerate(zip(tire.n, tire.c_n, tire.gamma_n, tire.Z_n)):
        at = slice(_RINGS + 2 * i, _RINGS + 2 * i + 2)
        damping[at, at] = scale * (c * np.eye(2) + 2.0 * gamma * omega_rad_s * turn)
        stiffness[at, at] = scale * (Z * np.eye(2) + n * omega_rad_s * c * turn)
    if load_N is not None:
        stiffness += _road(tire, load_N)
    return M, damping, stiffness


def _road(tire: CoupledRing, load_N: float) -> FloatArray:
    """Stiffness of the tread's springs that press at this load, (k, k)."""
    phi, n = contact.solve_contact(tire, load_N).phi_rad, tire.n[:, None]
    # a node's height is C_z - w cos phi + v sin phi;  v = 2 Re V e, w = 2 Re (-i n V e)
    gradient = _by_places(phi, n, np.sin(phi) + 1j * n * np.cos(phi))
    gradient[3] = 1.0
    return (tire.k_t * tire.R * STEP) * gradient @ gradient.T


def _by_places(phi: FloatArray, n: FloatArray, wave: ComplexArray) -> FloatArray:
    """Derivatives (k, j) of Re sum 2 V_n exp(i n phi) `wave` (N - 1, j) by the coordinates q."""
    by_V = 2.0 * np.exp(1j * n * phi) * wave
    rings = np.zeros((_RINGS, phi.size))
    return np.vstack([rings, np.stack([by_V.real, -by_V.imag], 1).reshape(-1, phi.size)])


def _with_bristles(
    tire: CoupledRing, system: FloatArray, M: FloatArray, omega: float, load_N: float
) -> FloatArray:
    """The system with the bristles' deflections u (48,) as further states.

    They are in upwind cells from entry to exit; twice as many resolve shorter waves.
    """
    pressed, cells = contact.solve_contact(tire, load_N), 48
    half = pressed.half_length_m / tire.R
    width = 2.0 * half / cells
    phi = np.linspace(-half + 0.5 * width, half - 0.5 * width, cells)
    n, size = tire.n[:, None], M.size
    # s = C_s + w sin phi + v cos phi + R psi;  w' - v = (n^2 - 1) v
    along = _by_places(phi, n, np.cos(phi) - 1j * n * np.sin(phi))
    along[2], along[5] = 1.0, tire.R
    turned = _by_places(phi, n, np.asarray((n**2 - 1.0) * np.sin(phi), dtype=np.complex128))
    whole = np.zeros((system.shape[0] + cells,) * 2)
    whole[: 2 * size, : 2 * size] = system
    whole[size : 2 * size, 2 * size :] = -tire.c_x * tire.R * width * along / M[:, None]
    whole[2 * size :, :size], whole[2 * size :, size : 2 * size] = omega * turned.T, along.T
    whole[2 * size :, 2 * size :] = (
        -abs(omega) / width * (np.eye(cells) - np.eye(cells, k=-1 if omega >= 0.0 else 1))
    )
    return whole


def _mode(value: complex, q: ComplexArray, M: FloatArray, *, turning: bool) -> Mode:
    energy = M * np.abs(q) ** 2
    energy /= energy.sum()
    lobes = energy[_RINGS:].reshape(-1, 2).sum(axis=1)
    # the hub moves along with the ring: its part counts to the ring's
    rigid, rotational = energy[:4].sum(), energy[4:6].sum()
    groups = np.concatenate([[rotational, rigid], lobes])
    main = int(np.argmax(groups))
    # rounded: what is not damped is 0, not the eigenvalue solver's noise
    frequency, damping = (
        float(value.imag) / (2.0 * np.pi),
        round(-float(value.real) / abs(value), 12) + 0.0,
    )
    share = float(groups[main])
    word, (x, y) = f"{main}-lobe", q[_RINGS + 2 * (main - 2) :][:2]
    if main == 0:
        word, turning = "rotational", False
    elif main == 1:
        upright = (energy[1] + energy[3]) / rigid
        vertical = "vertical" if upright > 0.75 else "whirl"
        word = f"rigid {'longitudinal' if upright < 0.25 else vertical}"
        # s + i z turning with the rotation goes as exp(+ i omega t), and V exp(i n phi), of the
        # lobes, as exp(- i omega t)
        y, x = (q[2], q[3]) if energy[2:4].sum() > energy[:2].sum() else (q[0], q[1])
    along, against = abs(x - 1j * y), abs(x + 1j * y)
    # at rest a pair of equal frequencies may come out as any mixture
    standing = not turning or min(along, against) > 0.5 * max(along, against)
    direction = "standing" if standing else "with" if along > against else "against"
    return Mode(frequency, damping, word, main, direction, share)
