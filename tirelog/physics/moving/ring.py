"""The coupled rigid and flexible ring (P3, last section, with the errata).

Its equations of motion and its energy.

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

The rigid ring is the belt's own n = 0 and 1; m_a and the ratios a_s, a_theta, a_c (1 if nothing
else is known) give it the mass of the tread and the sidewall's stiffness if they are known apart
from the flexible modes'.

Damping acts on what moves against the turning sidewall (Rayleigh):

    c_n = c_v + c_w n^2,  c_s = a_c pi R (c_v + c_w),  c_theta = a_c 2 pi R^3 c_v

    D = 2 pi R sum c_n |dV_n/dt + i n Omega V_n|^2 + c_s |da/dt - Omega_h x a|^2 / 2
        + c_theta (Omega - Omega_h)^2 / 2

Equations of motion (E_n = Q_v,n + i n Q_w,n the loads' modes, f_j the force of the road on tread
node j at phi_j), of the flexible ring, the rigid ring's spin and centre, the hub and its spin:

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

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from tirelog.errors import ModelError
from tirelog.physics.carcass.structures import RingCarcass, modal_impedance
from tirelog.physics.spectral import ComplexArray
from tirelog.vocabulary.arrays import FloatArray


@dataclass(frozen=True)
class CoupledRing:
    """A tire on its hub: constants of ring, belt mass, hub, tread and brush.

    The ring's constants as in `ring.RingCarcass`, rho A [kg/m], hub m_h [kg] and J_h [kg m^2].

    c_x [N/m^2] the bristles' stiffness along the road, mu its friction; modes N, the largest n; m_a
    [kg], a_s, a_theta, a_c as above; c_h [N s/m] damps the hub's vertical motion against a vehicle
    that keeps its height. ModelError for what cannot move.
    """

    EI: float
    k_w: float
    k_v: float
    c_w: float
    c_v: float
    pb: float
    R: float
    k_t: float
    rho_A: float
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
        for field in fields(self):
            value = getattr(self, field.name)
            may_vanish = field.name in ("c_w", "c_v", "pb", "c_x", "mu", "m_a", "a_c", "c_h")
            if not (np.isfinite(value) and (value > 0.0 or (may_vanish and value == 0.0))):
                raise ModelError(
                    f"coupled ring with {field.name} = {value:g}",
                    allowed=f"a finite number {'of at least' if may_vanish else 'above'} zero is "
                    "allowed",
                    do="correct it",
                )
        if self.modes < 2:
            raise ModelError(
                f"coupled ring with {self.modes} modes",
                allowed="2 or more are allowed",
                do="give the flexible ring some",
            )

    # ---- constants -------------------------------------------------------------------------------

    @property
    def carcass(self) -> RingCarcass:
        """The steady ring of the same constants."""
        return RingCarcass(
            self.EI, self.k_w, self.k_v, self.c_w, self.c_v, self.pb, self.R, self.k_t
        )

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
        return modal_impedance(self.n, self.carcass).real

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

    # ---- energy ----------------------------------------------------------------------------------

    def gyroscopic_momentum(self, V: ComplexArray, rate: ComplexArray) -> float:
        """The belt's angular momentum P [kg m^2/s] beside the rigid one."""
        return 4.0 * np.pi * self.R * float(np.vdot(V, self.gamma_n * rate).imag)

    def belt_energy(self, V: ComplexArray, rate: ComplexArray, omega: float) -> float:
        """Kinetic and elastic energy of the flexible modes [J]."""
        still = (
            2.0
            * np.pi
            * self.R
            * float(np.sum(self.m_n * np.abs(rate) ** 2 + self.Z_n * np.abs(V) ** 2))
        )
        return still + omega * self.gyroscopic_momentum(V, rate)

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
