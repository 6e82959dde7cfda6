"""Property: the stepped tire keeps its energy and rolls steadily as the steady ring."""

import numpy as np
import pytest

from tests.simulation.rolls import (
    EI,
    K_V,
    K_W,
    LINE_MASS,
    RADIUS,
    STEP,
    belt,
    energy_J,
    moved,
    orders,
    rolling,
    strain_rider,
)
from tests.simulation.worlds import instants, world
from tirelog.simulation.scenario.schema import Sensor

SPEED, LOAD = 20.0, 3000.0
DAMPED = {"radial_damping_N_s_m2": 100.0, "tangential_damping_N_s_m2": 100.0}


def test_energy_is_kept_without_damping():
    """Dropped by 2 mm while it rolls, frictionless, and 2 s of bouncing."""
    of = belt(96, friction=0.0)
    drop = np.zeros(96), RADIUS - 0.002, 0.0
    tire = rolling(of, speed=SPEED, load=LOAD, start=drop)
    energy, height = [], []
    for _ in range(100):
        tire.run(orders(800, speed=SPEED, load=LOAD, start_m=tire.state["hub_x_m"]))
        energy.append(energy_J(tire) + LOAD * tire.state["hub_z_m"])
        height.append(tire.state["hub_z_m"])
    assert np.ptp(height) > 0.02
    assert abs(np.mean(energy[-25:]) - np.mean(energy[:25])) < 1e-5 * energy[0]
    assert np.ptp(energy) < 1.2e-4 * energy[0]


def test_steady_rolling_is_the_steady_ring():
    """Against the other truth: differences on a grid, contact by an active set."""
    of = belt(192, **DAMPED)
    rolled = rolling(of, speed=SPEED, load=LOAD)
    rolled.damp_hub(3000.0)
    rolled.run(orders(round(0.6 / STEP), speed=SPEED, load=LOAD))
    rolled.damp_hub(0.0)
    drive = orders(round(0.1 / STEP), speed=SPEED, load=LOAD, start_m=rolled.state["hub_x_m"])
    motion = moved(rolled, rolled.run(drive, riders=(strain_rider(of, 0.3),)))
    tire = {
        "rolling_radius_m": RADIUS,
        "line_mass_kg_m": LINE_MASS,
        "flexural_stiffness_N_m2": EI,
        "radial_stiffness_N_m2": K_W,
        "tangential_stiffness_N_m2": K_V,
        **DAMPED,
    }
    steady = world(
        truth="ring", tire=tire, conditions={"inflation_pressure_Pa": 1.2e5}, grid_points=4096
    )
    solution = steady.solve(instants(speed=SPEED, load=LOAD))
    wave = steady.waveform(solution, Sensor("strain", surface="inner"))[0]
    place = (motion.angle_rad + 0.3 + np.pi) % (2 * np.pi) - np.pi
    exact = np.interp(place * RADIUS, steady.ring.xi_m, wave)
    assert np.std(motion.read[:, 0] - exact) < 5e-3 * np.std(exact)
    assert motion.force_z_N.mean() == pytest.approx(LOAD, rel=5e-4)
    assert motion.force_z_N.std() < 1e-3 * LOAD
    assert np.ptp(motion.hub_z_m) < 2e-5
    assert motion.entry_m.mean() == pytest.approx(solution.entry_m[0], abs=3e-4)
    assert motion.exit_m.mean() == pytest.approx(solution.exit_m[0], abs=3e-4)
