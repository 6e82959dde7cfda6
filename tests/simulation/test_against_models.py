"""Property: the truth (differences on a grid) and the models (modes) share no line of code, and
agree to 1e-4 of the peak or better.

Only the exact forms can agree; the other forms are there to differ.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from tirelog.data.recording import Conditions
from tirelog.inference.cells.joint import model_of
from tirelog.physics.effects import BY_ID
from tirelog.physics.model.model import Model
from tirelog.simulation.scenario.schema import PLANTABLE, Sensor
from tirelog.simulation.steady.loads import Instants
from tirelog.simulation.steady.waveforms import World

from .worlds import world

R, SPEED, ACCELERATION, TIME = 0.305, 17.0, 1.7, 2.0
DISTANCE_KM, WATER_MM = 22000.0, 0.8
BEAM = {
    "flexural_stiffness_N_m2": 4.0,
    "foundation_stiffness_N_m2": 2.0e6,
    "line_mass_kg_m": 4.5,
    "patch_half_length_m": 0.058,
    "reference_load_N": 3434.0,
    "patch_load_exponent": 0.5,
    "lever_arm_m": 3.0e-4,
    "radius_m": R,
}
RING = {
    "flexural_stiffness_N_m2": 2.0,
    "radial_stiffness_N_m2": 6.3e5,
    "tangential_stiffness_N_m2": 6.3e5,
    "width_m": 0.14,
    "tread_stiffness_N_m2": 8.75e7,
    "inflation_pressure_Pa": 2.2e5,
    "lever_arm_m": 3.0e-4,
    "radius_m": R,
}
STRAIN_EFFECTS = [
    name
    for name in PLANTABLE
    if name in BY_ID
    and "strain" in BY_ID[name].observables
    and name not in ("telemetry_delay", "tooth_pitch")
]


def moment(w: World) -> Instants:
    """The world's instant at TIME, with SPEED and ACCELERATION in place of its drive's."""
    at = replace(
        w.instants(np.array([TIME])), speed=np.array([SPEED]), acceleration=np.array([ACCELERATION])
    )
    for effect in w.scenario.effects:
        if effect.name == "load_transfer":
            load = at.load * (1.0 + effect["coefficient"] * ACCELERATION / 9.81)
            at = replace(at, load=load, half_length=w.half_length(load))
        if effect.name == "aero_load":
            load = (
                w.scenario.conditions.load_N
                * (1.0 + effect["coefficient"] * (SPEED / 30.0) ** 2)
                * np.ones(1)
            )
            at = replace(at, load=load, half_length=w.half_length(load))
        if effect.name == "imbalance":
            load = w.scenario.conditions.load_N + effect["force_N"] * (SPEED / 20.0) ** 2 * np.ones(
                1
            )
            at = replace(at, load=load, half_length=w.half_length(load))
        if effect.name == "traction":
            at = replace(at, slip=np.array([-effect["slip_per_g"] * ACCELERATION / 9.81]))
    return at


def conditions() -> Conditions:
    return Conditions.of(
        1,
        speed_m_s=SPEED,
        acceleration_m_s2=ACCELERATION,
        time_s=TIME,
        load_N=3434.0,
        inflation_pressure_Pa=2.2e5,
        distance_km=DISTANCE_KM,
        water_depth_mm=WATER_MM,
        temperature_K=0.0,
    )


def predicted(model: Model, w: World, surface: str = "outer") -> np.ndarray:
    return model.predict(conditions(), w.ring.xi_m / R, surface=surface)[0]


def own(values: dict[str, float], model: Model) -> dict[str, float]:
    return {name: value for name, value in values.items() if name in model.values}


@pytest.mark.parametrize("name", [None, *STRAIN_EFFECTS])
@pytest.mark.parametrize("surface", ["outer", "inner"])
def test_strain_of_the_beam(name: str | None, surface: str) -> None:
    planted = [] if name is None else [{"name": name}]
    cruise = [{"duration_s": 4.0, "speed_m_s": SPEED}]
    w = world(
        effects=planted,
        grid_points=4096,
        manoeuvres=cruise,
        conditions={"distance_km": DISTANCE_KM, "water_depth_mm": WATER_MM},
    )
    sensor = Sensor("fbg_strain", surface=surface)
    truth = w.waveform(w.solve(moment(w)), sensor)[0] + w.baseline(np.array([TIME]), sensor)
    model = Model.new("beam", **own(BEAM, Model.new("beam")))
    if name is not None:
        known = {p.name for p in BY_ID[name].parameters}
        planted_there = w.scenario.effects[0].parameters
        model = model.with_effect(name, **{n: v for n, v in planted_there.items() if n in known})
    assert np.abs(truth - predicted(model, w, surface)).max() < 1e-4 * np.abs(truth).max()


def test_radial_acceleration_of_the_beam() -> None:
    w = world(grid_points=4096)
    phi = w.ring.xi_m / R
    still = -9.80665 * np.cos(phi) - ACCELERATION * np.sin(
        phi
    )  # what the simulator adds to its accelerometers
    truth = w.waveform(w.solve(moment(w)), Sensor("radial_acceleration"))[0] + still
    blank = Model.new("beam", observable="radial_acceleration")
    model = Model.new("beam", observable="radial_acceleration", **own(BEAM, blank))
    assert np.abs(truth - predicted(model, w)).max() < 1e-4 * np.abs(truth).max()


def test_strain_and_patch_of_the_ring_on_a_flat_road() -> None:
    w = world(truth="ring", grid_points=4096)
    solution = w.solve(moment(w))
    truth = w.waveform(solution, Sensor("fbg_strain"))[0]
    blank = Model.new("ring", contact="flat_road")
    model = Model.new("ring", contact="flat_road", **own(RING, blank))
    assert np.abs(truth - predicted(model, w)).max() < 2e-3 * np.abs(truth).max()
    assert 0.5 * (solution.exit_m - solution.entry_m) == pytest.approx(
        model.half_length_m(conditions()), rel=1e-3
    )


@pytest.mark.parametrize(
    "name",
    [
        "viscous_damping", "hysteresis", "pressure_offset", "edge_impact", "rough_contact",
        "water_film", "wear", "load_transfer", "aero_load",
    ],
)  # fmt: skip
@pytest.mark.parametrize("observable", ["strain", "radial_acceleration"])
def test_waveforms_of_the_ring_with_an_effect(name: str, observable: str) -> None:
    """On a flat road, which what lags presses in another way: 1e-4 of the peak."""
    w = world(
        truth="ring",
        effects=[{"name": name}],
        grid_points=4096,
        manoeuvres=[{"duration_s": 4.0, "speed_m_s": SPEED}],
        conditions={"distance_km": DISTANCE_KM, "water_depth_mm": WATER_MM},
    )
    kind = {"strain": "fbg_strain"}.get(observable, observable)
    truth = w.waveform(w.solve(moment(w)), Sensor(kind))[0]
    if observable != "strain":
        phi = w.ring.xi_m / R
        truth = truth - 9.80665 * np.cos(phi) - ACCELERATION * np.sin(phi)
    model = Model.new("ring", observable)
    model = model.with_values(own({**RING, "line_mass_kg_m": 4.5}, model))
    known = {p.name for p in BY_ID[name].parameters}
    planted = w.scenario.effects[0].parameters
    model = model.with_effect(name, **{n: v for n, v in planted.items() if n in known})
    assert np.abs(truth - predicted(model, w)).max() < 1e-4 * np.abs(truth).max()


@pytest.mark.parametrize(
    "name", ["viscous_damping", "hysteresis", "pressure_offset", "edge_impact", "rough_contact"]
)
def test_middle_of_the_fronts_of_a_ring_that_leans(name: str) -> None:
    """Where the truth's accelerometer reads half of its level, by its own table of angles, against
    the same in a zero stretch."""
    made = world(truth="ring", effects=[{"name": name}], grid_points=4096)

    def middle(speed: float) -> float:
        at = replace(moment(made), speed=np.array([speed]))
        wave = made.waveform(made.solve(at), Sensor("radial_acceleration"))[0]
        share = CubicSpline(made.ring.xi_m / R, -wave * R / speed**2 - 0.5)
        inner = share.roots(extrapolate=False)
        return float(np.degrees(0.5 * (inner[inner < 0.0].max() + inner[inner > 0.0].min())))

    model = Model.new("ring", ["radial_acceleration", "phase_shift"])
    model = model.with_values(own({**RING, "line_mass_kg_m": 4.5}, model))
    known = {p.name for p in BY_ID[name].parameters}
    planted = made.scenario.effects[0].parameters
    model = model.with_effect(name, **{n: v for n, v in planted.items() if n in known})
    found = np.degrees(model_of(model, "phase_shift").predict(conditions())[0, 0])
    assert found == pytest.approx(middle(SPEED) - middle(10.0), abs=1e-3)
    assert (abs(found) > 0.02) == (name in ("viscous_damping", "edge_impact"))


@pytest.mark.parametrize("pressure_Pa", [2.2e5, 1.6e5])
def test_width_between_fronts_at_every_load_and_pressure(pressure_Pa: float) -> None:
    """At the model's load between the places where the truth's accelerometer reads half of its
    level, by its own table of angles; at other loads these move as the steepest ones do, from which
    the contact's edges keep their distance."""
    made = world(truth="ring", conditions={"inflation_pressure_Pa": pressure_Pa})
    sensor = Sensor("radial_acceleration")
    model = Model.new(
        "ring",
        "patch_width",
        load_N=3434.0,
        **{k: v for k, v in RING.items() if k != "lever_arm_m"},
    )
    loads = np.array([2700.0, 3434.0, 4100.0])
    seen, half, contact = np.zeros((3, 3))
    for i, load in enumerate(loads):
        at = replace(made.instants(np.array([TIME])), load=np.array([load]))
        solution = made.solve(at)
        wave = made.waveform(solution, sensor)[0]
        slope = CubicSpline(made.ring.xi_m / R, wave).derivative()
        phi = np.linspace(-0.3, 0.3, 24001)
        steep = slope(phi)
        seen[i] = phi[np.argmin(steep)] - phi[np.argmax(steep)]
        beside = np.abs(made.ring.xi_m / R) - 0.5 * seen[i]
        beside = (beside > np.radians(25.0)) & (beside < np.radians(130.0))
        inside = CubicSpline(made.ring.xi_m / R, wave)(phi) > 0.5 * wave[beside].mean()
        half[i] = phi[inside.nonzero()[0]].max() - phi[inside.nonzero()[0]].min()
        contact[i] = (solution.exit_m - solution.entry_m)[0] / R
    conditions = Conditions.of(3, speed_m_s=SPEED, load_N=loads, inflation_pressure_Pa=pressure_Pa)
    predicted = model.predict(conditions)[:, 0]
    assert np.degrees(np.abs(predicted - seen - half[1] + seen[1]).max()) < 0.03
    assert np.degrees(np.ptp(contact)) > 4.0
    assert np.degrees(np.ptp(predicted - contact)) < 0.1
