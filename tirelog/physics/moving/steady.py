"""The coupled ring that rolls steadily and freely on a flat road.

Where a motion begins, and what it is measured from.

Tire, load, speed -> pressure on the tread's nodes and modes V_n = E_n / (Z_n + i n Omega c_n), n =
2 ... N, by active sets; then the spin at which bristles, pressure and damping leave no torque. As
`contact.solve_contact`, but with the modes that the motion has, and with damping: a motion that
begins here stays here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve
from scipy.optimize import brentq

from tirelog.errors import ModelError
from tirelog.physics.carcass import contact
from tirelog.physics.carcass.ring import modal_impedance
from tirelog.physics.moving.ring import CoupledRing
from tirelog.physics.spectral import STEP, ComplexArray
from tirelog.vocabulary.arrays import FloatArray

#: The spin is sought within this share of v / R. Twice as wide finds spins of tires that slip by a
#: tenth.
_SPIN_RANGE = 0.05
_PHI = np.arange(-int(contact.REACH / STEP), int(contact.REACH / STEP) + 1) * STEP


@dataclass(frozen=True)
class SteadyRolling:
    """Steady rolling: modes, height of the ring, sidewall's displacement and spin.

    Modes V (N - 1,) [m]; height of the ring's centre above the road [m]; sidewall's displacement
    a = C - H [m]; spin [rad/s].

    phi_rad, pressure_N_m  the nodes that press, and with what
    """

    V: ComplexArray
    centre_m: float
    displacement: complex
    omega: float
    phi_rad: FloatArray
    pressure_N_m: FloatArray


def steady_rolling(tire: CoupledRing, load_N: float, speed_m_s: float) -> SteadyRolling:
    """The tire's steady rolling at a load and a speed.

    ModelError for a load that does not press or a patch that grows beyond the reach of the
    contact.
    """
    if not load_N > 0.0:
        raise ModelError(
            f"load {load_N:g} N does not press the tire on the road",
            allowed="a load above zero is allowed",
            do="correct load_N",
        )
    omega = speed_m_s / tire.R
    for _ in range(2 if speed_m_s else 1):
        unit, gives = _compliance(tire, omega)
        on, p, drop = _balance(tire, load_N, gives)
        V = unit[:, on] @ p
        # the road's force i F stands on the sidewall: k_s a + c_s (0 - i Omega a) = i F, Omega x a
        # = i Omega a in the complex plane
        a = 1j * load_N / complex(tire.k_s, -tire.c_s * omega)
        if speed_m_s:
            omega = _free_spin(tire, V, a, _PHI[on], p, speed_m_s)
    return SteadyRolling(V, tire.R - drop, a, omega, _PHI[on], p)


def _compliance(tire: CoupledRing, omega: float) -> tuple[ComplexArray, FloatArray]:
    """Compliance of belt and nodes to pressure, the rigid ring held.

    (modes per pressure on a node (N - 1, j), downward yield of a node per pressure on a node (j,
    j)).
    """
    n, cos, sin = tire.n[:, None], np.cos(_PHI), np.sin(_PHI)
    load = np.exp(-1j * n * _PHI) * (STEP / (2.0 * np.pi)) * (sin - 1j * n * cos)
    unit = load / modal_impedance(tire.n, tire.carcass, omega)[:, None]
    lift = 2.0 * np.exp(1j * n * _PHI) * (sin + 1j * n * cos)
    return unit, (lift.T @ unit).real


def _balance(
    tire: CoupledRing, load_N: float, lifts: FloatArray
) -> tuple[np.ndarray, FloatArray, float]:
    """(nodes that press, their pressure [N/m], drop [m] of the ring).

    The drop is that of the ring's centre below its height unloaded.
    """
    shape, h = tire.R * (1.0 - np.cos(_PHI)), tire.R * STEP
    active = np.abs(_PHI) <= 0.15
    for _ in range(100):
        on = np.flatnonzero(active)
        system = np.zeros((on.size + 1, on.size + 1))
        system[:-1, :-1] = lifts[np.ix_(on, on)] + np.eye(on.size) / tire.k_t
        system[:-1, -1], system[-1, :-1] = -1.0, h
        answer = solve(system, np.append(-shape[on], load_N))
        pressing = answer[-1] - shape - lifts[:, on] @ answer[:-1] > 0.0
        if np.array_equal(pressing, active):
            return on, answer[:-1], float(answer[-1])
        active = pressing
        if active[0] or active[-1]:
            break
    raise ModelError(
        f"at {load_N:g} N the patch grows beyond {contact.REACH:g} rad to either side, or finds "
        "no balance",
        allowed="a shorter one is allowed",
        do="give a stiffer foundation or a lower load",
    )


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
