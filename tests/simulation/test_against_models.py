"""Property: the truth (differences on a grid) and the models (modes) share no line of code, and
agree to 1e-4 of the peak or better.

Only the exact forms can agree; the other forms are there to differ.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from tests.simulation.worlds import world
from tirelog.data.recording import Conditions
from tirelog.inference.cells.cells import model_of
from tirelog.physics.effects import BY_ID
from tirelog.physics.model.model import Model
from tirelog.simulation.scenario.schema import BENDING_N_M2, PLANTABLE, Sensor
from tirelog.simulation.steady.loads import Instants, with_columns
from tirelog.simulation.steady.waveforms import World

R, SPEED, ACCELERATION, TIME = 0.305, 17.0, 1.7, 3.0
#: so that these are the speed and the acceleration then
DRIVE = [{"duration_s": 1.0, "speed_m_s": 13.6}, {"duration_s": 4.0, "speed_m_s": 20.4}]
DRIVEN = {"distance_km": 22000.0, "water_depth_mm": 0.8}
STRAIN_EFFECTS = [
    name
    for name in PLANTABLE
    if name in BY_ID
    and "strain" in BY_ID[name].observables
    and name not in ("telemetry_delay", "tooth_pitch")
]
#: what is compared on a ring as well, on a flat road, which what lags presses in another way
ON_A_RING = [
    "viscous_damping", "hysteresis", "pressure_offset", "edge_impact", "rough_contact",
    "water_film", "wear", "load_transfer", "aero_load",
]  # fmt: skip
#: numbers that are nothing by themselves
MORE = {"wear": {"lever_loss": 0.2}}
CASES = [
    *(("beam", "strain", name) for name in (None, *STRAIN_EFFECTS)),
    ("beam", "radial_acceleration", None),
    *(
        ("ring", observable, name)
        for name in (None, *ON_A_RING)
        for observable in ("strain", "radial_acceleration")
    ),
]


def truth_of(carcass: str, name: str | None = None) -> World:
    """A world on a fine grid, in which an effect may be planted."""
    return world(
        truth=carcass,
        effects=[] if name is None else [{"name": name, **MORE.get(name, {})}],
        grid_points=4096,
        manoeuvres=DRIVE,
        conditions=DRIVEN,
    )


def moment(w: World, **other: float) -> Instants:
    """The world's instant at TIME, with other numbers in place of its own."""
    at = w.instants(np.array([TIME]))
    return with_columns(at, **other)


def modelled(w: World, observable: str | list[str]) -> Model:
    """The model with a world's numbers and effects."""
    tire, truth = w.scenario.tire, w.scenario.truth
    numbers = vars(tire) | {
        "radius_m": tire.rolling_radius_m,
        "width_m": tire.width_belt_m,
        "flexural_stiffness_N_m2": BENDING_N_M2[truth],
        "inflation_pressure_Pa": 2.2e5,
    }
    model = Model.new(truth, observable)
    model = model.with_values({n: v for n, v in numbers.items() if n in model.values})
    for effect in w.scenario.effects:
        known = {p.name for p in BY_ID[effect.name].parameters}
        planted = {n: v for n, v in effect.parameters.items() if n in known}
        model = model.with_effect(effect.name, **planted)
    return model


def conditions() -> Conditions:
    drive = {"speed_m_s": SPEED, "acceleration_m_s2": ACCELERATION, "time_s": TIME, **DRIVEN}
    return Conditions.of(1, load_N=3434.0, inflation_pressure_Pa=2.2e5, temperature_K=0.0, **drive)


@pytest.mark.parametrize(("carcass", "observable", "name"), CASES)
def test_waveforms(carcass: str, observable: str, name: str | None) -> None:
    """To 1e-4 of the peak, at both surfaces."""
    w = truth_of(carcass, name)
    phi, solution, model = w.ring.xi_m / R, w.solve(moment(w)), modelled(w, observable)
    for surface in ("outer", "inner"):
        if observable == "strain":
            sensor = Sensor("fbg_strain", surface=surface)
            beside = w.baseline(np.array([TIME]), sensor)
        else:  # what the simulator adds to its accelerometers
            sensor = Sensor(observable, surface=surface)
            beside = -9.80665 * np.cos(phi) - ACCELERATION * np.sin(phi)
        truth = w.waveform(solution, sensor)[0] + beside
        predicted = model.predict(conditions(), phi, surface=surface)[0]
        assert np.abs(truth - predicted).max() < 1e-4 * np.abs(truth).max()
    if (carcass, name) == ("ring", None):
        half = 0.5 * (solution.exit_m - solution.entry_m)
        assert half == pytest.approx(model.half_length_m(conditions()), rel=1e-3)


@pytest.mark.parametrize(
    "name", ["viscous_damping", "hysteresis", "pressure_offset", "edge_impact", "rough_contact"]
)
def test_middle_of_the_fronts_of_a_ring_that_leans(name: str) -> None:
    """Where the truth's accelerometer reads half of its level, by its own table of angles, against
    the same in a zero stretch."""
    made = truth_of("ring", name)

    def middle(speed: float) -> float:
        wave = made.waveform(made.solve(moment(made, speed=speed)), Sensor("radial_acceleration"))[
            0
        ]
        share = CubicSpline(made.ring.xi_m / R, -wave * R / speed**2 - 0.5)
        inner = share.roots(extrapolate=False)
        return float(np.degrees(0.5 * (inner[inner < 0.0].max() + inner[inner > 0.0].min())))

    model = model_of(modelled(made, ["radial_acceleration", "phase_shift"]), "phase_shift")
    found = np.degrees(model.predict(conditions())[0, 0])
    assert found == pytest.approx(middle(SPEED) - middle(10.0), abs=1e-3)
    assert (abs(found) > 0.02) == (name in ("viscous_damping", "edge_impact"))


@pytest.mark.parametrize("pressure_Pa", [2.2e5, 1.6e5])
def test_width_between_fronts_at_every_load_and_pressure(pressure_Pa: float) -> None:
    """At the model's load between the places where the truth's accelerometer reads half of its
    level, by its own table of angles; at other loads these move as the steepest ones do, from which
    the contact's edges keep their distance."""
    made = world(truth="ring", conditions={"inflation_pressure_Pa": pressure_Pa})
    sensor = Sensor("radial_acceleration")
    model = modelled(made, "patch_width").with_values({"load_N": 3434.0})
    loads = np.array([2700.0, 3434.0, 4100.0])
    seen, half, contact = np.zeros((3, 3))
    for i, load in enumerate(loads):
        solution = made.solve(moment(made, load=load))
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
    driven = Conditions.of(3, speed_m_s=SPEED, load_N=loads, inflation_pressure_Pa=pressure_Pa)
    predicted = model.predict(driven)[:, 0]
    assert np.degrees(np.abs(predicted - seen - half[1] + seen[1]).max()) < 0.03
    assert np.degrees(np.ptp(contact)) > 4.0
    assert np.degrees(np.ptp(predicted - contact)) < 0.1
