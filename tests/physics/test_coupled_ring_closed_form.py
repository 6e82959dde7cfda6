"""Closed form: the coupled ring in time, by the belt's free vibration, rest and steady rolling on
the road, momentum and torque.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm, solve

from tests.physics.coupled_tire import TIRE as PASSENGER
from tests.physics.coupled_tire import course
from tirelog.physics.carcass import contact
from tirelog.physics.carcass.structures import modal_impedance
from tirelog.physics.moving.ring import CoupledRing, matrices
from tirelog.physics.moving.transient import State, Stepper, stepped_motion

TIRE = replace(PASSENGER, c_w=600.0, c_v=600.0, m_h=1.0, J_h=0.1, c_x=0.0)
LOAD, SPEED = 1000.0, 20.0


def rolling(
    tire: CoupledRing,
    speed: float = SPEED,
    torque: float = 0.0,
    nodes: int = 3072,
    start: State | None = None,
) -> Stepper:
    begin, drive = start or State.rolling(tire, LOAD, speed), course(LOAD, speed, torque=torque)
    return Stepper(tire, begin, drive, step_s=1e-4, nodes=nodes)


def steady_ring(tire: CoupledRing, omega: float) -> tuple[np.ndarray, np.ndarray]:
    """(pressure, V_2...) of the damped steady ring that carries the load, by active sets on the
    errata's impedance, with all modes.
    """
    phi = np.arange(-300, 301) * contact.STEP
    n = np.arange(1025)
    inverse = 1.0 / modal_impedance(n.astype(float), tire, omega)
    n_s, cos, sin = n[:, None], np.cos(phi), np.sin(phi)
    unit = (
        np.exp(-1j * n_s * phi)
        * contact.STEP
        / (2.0 * np.pi)
        * inverse[:, None]
        * (sin - 1j * n_s * cos)
    )
    unit[0] = 0.0  # the hub turns freely: no wind-up
    shape = np.where(n_s > 0, 2.0, 1.0) * np.exp(1j * n_s * phi) * (sin + 1j * n_s * cos)
    gives = -(shape.T @ unit).real
    active = np.abs(phi) < 0.1
    for _ in range(50):
        on = np.flatnonzero(active)
        system = np.zeros((on.size + 1, on.size + 1))
        system[:-1, :-1] = -gives[np.ix_(on, on)] + np.eye(on.size) / tire.k_t
        system[:-1, -1], system[-1, :-1] = -1.0, tire.R * contact.STEP
        answer = solve(system, np.append(-tire.R * (1.0 - cos[on]), LOAD))
        pressing = answer[-1] - tire.R * (1.0 - cos) + gives[:, on] @ answer[:-1] > 0.0
        if np.array_equal(pressing, active):
            break
        active = pressing
    pressure = np.zeros(phi.size)
    pressure[on] = answer[:-1]
    return pressure, (unit @ pressure)[2 : tire.modes + 1]


def test_free_vibration_in_the_air_is_the_matrix_exponential():
    tire = replace(TIRE, c_w=40.0, c_v=20.0, m_h=20.0, modes=6)
    start = State.rolling(tire, LOAD, SPEED, height_m=0.2)
    start.hub = start.centre
    start.V = 1e-6 * np.array([1.0, 2j, 1 - 1j, 0.5, 0.1j])
    V = start.V
    air = Stepper(tire, start, course(0.0), step_s=1e-4)
    for _ in range(200):
        air.step()
    M, damping, stiffness = matrices(tire, SPEED / tire.R)
    size = M.size
    system = np.block(
        [[np.zeros((size, size)), np.eye(size)], [-stiffness / M[:, None], -damping / M[:, None]]]
    )
    q = np.zeros(2 * size)
    q[6:size:2], q[7:size:2] = V.real, V.imag
    q = expm(0.02 * system) @ q
    assert pytest.approx(q[6:size:2] + 1j * q[7:size:2], rel=1e-6, abs=1e-12) == air.state.V


def test_rest_on_the_road_is_the_contact_with_the_flat_road():
    tire = replace(TIRE, modes=60)
    rest = Stepper(tire, State.rolling(tire, LOAD, 0.0), course(LOAD), step_s=5e-5, nodes=3072)
    motion = stepped_motion(rest, 0.5)
    touching = contact.solve_contact(tire, LOAD)
    pressure = np.interp(touching.phi_rad, rest.road_forces.phi, rest.road_forces.pressure)
    assert motion.force_z_N[-1] == pytest.approx(LOAD, rel=1e-6)
    assert pressure == pytest.approx(
        touching.pressure_N_m, abs=2e-3 * touching.pressure_N_m.max()
    )  # 60 modes of 1536
    assert tire.R - rest.state.hub.imag == pytest.approx(touching.drop_m, rel=1e-4)


@pytest.mark.parametrize("start", ["low", "spun", "twisted"])
def test_steady_rolling_from_any_start_is_the_steady_ring(start):
    state = State.rolling(TIRE, LOAD, SPEED)
    if start == "low":
        state.hub, state.centre = state.hub - 0.003j, state.centre - 0.002j
    elif start == "spun":
        state.omega, state.V = state.omega + 1.0, 0.0 * state.V
    else:
        state.psi_hub, state.V_rate = 0.01, 0.01 * np.ones_like(state.V)
    stepper = rolling(TIRE, start=state)
    stepped_motion(stepper, 1.4)
    motion = stepped_motion(stepper, 0.05, every=1)
    assert motion.force_z_N.mean() == pytest.approx(LOAD, rel=1e-4)
    assert motion.spindle_z_N == pytest.approx(np.full(500, LOAD), rel=1e-4)
    _, steady = steady_ring(TIRE, stepper.state.omega)
    mean = motion.V.mean(axis=0)
    assert np.abs(mean - steady).max() < 1e-4 * np.abs(steady).max()


def test_a_brake_torque_is_the_road_force_times_the_radius_of_a_belt_that_does_not_stretch():
    free, braked = (
        rolling(replace(TIRE, c_x=1.9e6), torque=torque, nodes=1536) for torque in (0.0, -60.0)
    )
    forces = []
    for stepper in (free, braked):
        stepped_motion(stepper, 0.5)
        forces.append(stepped_motion(stepper, 0.05, every=1).force_s_N.mean())
    assert forces[1] - forces[0] == pytest.approx(60.0 / TIRE.R, rel=5e-3)
    assert braked.state.omega * TIRE.R < free.state.omega * TIRE.R < SPEED


def test_what_tows_the_tire_is_what_it_dissipates():
    stepper = rolling(replace(TIRE, c_x=1.9e6), nodes=1536)
    stepped_motion(stepper, 0.5)
    lost = stepper.tread.lost
    motion = stepped_motion(stepper, 0.1, every=1)
    omega, V = motion.omega_rad_s.mean(), motion.V.mean(axis=0)
    a = stepper.state.centre - stepper.state.hub
    belt = 4.0 * np.pi * TIRE.R * omega**2 * np.sum(TIRE.n**2 * TIRE.c_n * np.abs(V) ** 2)
    sidewall, slip = TIRE.c_s * omega**2 * abs(a) ** 2, (stepper.tread.lost - lost) / 0.1
    assert belt > 50.0
    assert motion.spindle_s_N.mean() * SPEED == pytest.approx(belt + sidewall + slip, rel=2e-3)
