"""Literature: published numbers, and by how much the models miss them."""

from dataclasses import replace

import numpy as np
import pytest

from tests.diagnosis.planted import MODEL, stack
from tirelog.data.recording import Channel, TimeAxis
from tirelog.diagnosis.compare import start
from tirelog.inference.floor import load_derivative
from tirelog.inference.nuisances import shared_effects
from tirelog.physics import Model
from tirelog.physics.carcass.contact import solve_contact
from tirelog.physics.moving.ring import natural_modes, of_model
from tirelog.strain.passages.find import find_passages
from tirelog.strain.speed import speed_columns

#: A passenger-car tire 205/60 R15 at 2.2 bar and 4 kN, as the default set of an open
#: implementation of the Magic Formula (FITTYP 62) states it: facts only, no licence for them is
#: stated. Frequencies are those of the belt as a rigid body on its sidewall, the hub held.
RADIUS_M, RIM_WIDTH_M, PRESSURE_PA, LOAD_N = 0.3135, 0.152, 2.2e5, 4000.0
BELT_MASS_KG, BELT_INERTIA_KG_M2 = 7.698, 0.4889
LONGITUDINAL_HZ, WIND_UP_HZ = 76.63, 67.73
STIFFNESS_N_M, QUADRATIC = 209_651.5, 15.416
CONTACT_ROOT, CONTACT_LINEAR = 0.6715, 0.7308


def published_half_length_m(load_N):
    """Half the contact length: R0 (Q_RA2 x + Q_RA1 sqrt x) with x = F / (C R0)."""
    x = load_N / (STIFFNESS_N_M * RADIUS_M)
    return RADIUS_M * (CONTACT_LINEAR * x + CONTACT_ROOT * np.sqrt(x))


def published_drop_m(load_N):
    """F / F0 = q1 y + q2 y^2 with y = drop / R0 and q1 = sqrt((C R0 / F0)^2 - 4 q2)."""
    linear = np.sqrt((STIFFNESS_N_M * RADIUS_M / LOAD_N) ** 2 - 4.0 * QUADRATIC)
    root = np.sqrt(linear**2 + 4.0 * QUADRATIC * load_N / LOAD_N)
    return RADIUS_M * (root - linear) / (2.0 * QUADRATIC)


@pytest.fixture(scope="module")
def passenger_tire():
    """The ring with that belt's mass, pressure, and the sidewall that its frequencies mean."""
    translation = BELT_MASS_KG * (2.0 * np.pi * LONGITUDINAL_HZ) ** 2
    rotation = BELT_INERTIA_KG_M2 * (2.0 * np.pi * WIND_UP_HZ) ** 2
    tangential = rotation / (2.0 * np.pi * RADIUS_M**3)
    model = Model.new(
        "ring",
        radius_m=RADIUS_M,
        width_m=RIM_WIDTH_M,
        inflation_pressure_Pa=PRESSURE_PA,
        line_mass_kg_m=BELT_MASS_KG / (2.0 * np.pi * RADIUS_M),
        tangential_stiffness_N_m2=tangential,
        radial_stiffness_N_m2=translation / (np.pi * RADIUS_M) - tangential,
        load_N=LOAD_N,
    )
    return of_model(model.values)


def test_the_belt_on_its_sidewall_rings_as_published(passenger_tire):
    """The belt's inertia as measured is 0.65 of m R^2: a ring has all its mass at R, so that its
    rotation is slower by the root of that; the translation has no such freedom."""
    held = replace(passenger_tire, m_h=1e9, J_h=1e9)
    found = {mode.shape: mode.frequency_Hz for mode in natural_modes(held, to_Hz=120.0)}
    assert found["rigid vertical"] == pytest.approx(LONGITUDINAL_HZ, rel=1e-3)
    share = BELT_INERTIA_KG_M2 / (BELT_MASS_KG * RADIUS_M**2)
    assert share == pytest.approx(0.646, abs=0.001)
    assert found["rotational"] == pytest.approx(WIND_UP_HZ * np.sqrt(share), rel=1e-3)


def test_the_patch_grows_with_the_load_as_published(passenger_tire):
    """Between 1 and 6 kN the published contact length grows as load^0.588."""
    lengths = [solve_contact(passenger_tire, F).half_length_m for F in (1000.0, 6000.0)]
    published = [published_half_length_m(F) for F in (1000.0, 6000.0)]
    exponents = [np.log(b / a) / np.log(6.0) for a, b in (lengths, published)]
    assert exponents[1] == pytest.approx(0.588, abs=0.001)
    assert exponents[0] == pytest.approx(exponents[1], rel=0.05)


def test_a_linear_ring_of_these_frequencies_is_stiffer_than_the_tire(passenger_tire):
    """Not in the model: 132 mm of contact and 20.3 mm of deflection at 4 kN."""
    touching = solve_contact(passenger_tire, LOAD_N)
    assert published_half_length_m(LOAD_N) == pytest.approx(0.0659, abs=1e-4)
    assert published_drop_m(LOAD_N) == pytest.approx(0.0203, abs=1e-4)
    assert touching.drop_m / published_drop_m(LOAD_N) == pytest.approx(0.58, abs=0.05)
    assert touching.half_length_m / published_half_length_m(LOAD_N) == pytest.approx(0.7, abs=0.05)


#: In-tire piezo element through a slip ring, 10 kHz (O. Jousimaa, Aalto 2016, measurements under
#: the CERN OHL 1.2, to be cited): bursts of 170 to 230 Hz once per turn.
#: (speed [km/h], load [kN], None if not stated): (period of a turn [s], turns recorded)
PIEZO = {
    (20.0, 1.0): (0.3471, 27),
    (20.0, 2.0): (0.3418, 27),
    (20.0, None): (0.3408, 30),
    (30.0, 1.0): (0.2287, 38),
    (30.0, None): (0.2266, 42),
}
PIEZO_RATE_HZ, PIEZO_RADIUS_M = 10_000.0, 0.303


def piezo(period_s, turns, seed):
    """A burst per turn, of another frequency within the published ones and another phase each."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(period_s * (turns + 0.5) * PIEZO_RATE_HZ)) / PIEZO_RATE_HZ
    values = 0.02 * rng.normal(size=t.size)
    for turn in range(turns):
        at = (turn + 0.5 + 0.003 * rng.normal()) * period_s
        near = np.abs(t - at) < 0.1
        wave = np.sin(2 * np.pi * rng.uniform(170, 230) * (t[near] - at) + rng.uniform(0, 6))
        values[near] += np.exp(-(((t[near] - at) / 0.015) ** 2)) * wave
    return values


@pytest.mark.parametrize("kind", ["strain", "radial_acceleration"])
@pytest.mark.parametrize("recording", PIEZO)
def test_bursts_once_per_turn_give_the_wheel_s_speed_or_none(recording, kind):
    """A burst is no patch: no row may tell a speed that the wheel did not have."""
    period_s, turns = PIEZO[recording]
    rolled_m_s = 2 * np.pi * PIEZO_RADIUS_M / period_s
    assert rolled_m_s == pytest.approx(recording[0] / 3.6, rel=0.02)
    values = piezo(period_s, turns, 2000) * (1e-4 if kind == "strain" else 100.0)
    axis = TimeAxis.uniform(values.size, PIEZO_RATE_HZ)
    found = find_passages(Channel.of_array("c", kind, values, axis), PIEZO_RADIUS_M)
    assert len(found) > turns
    told = speed_columns("a.csv", found)["speed_m_s"]
    told = told[np.isfinite(told)]
    assert np.all(np.abs(told / rolled_m_s - 1.0) < 0.05)


#: Force variation of a passenger tire over the speed (Vehicles 2020, 2(3), 31, CC BY 4.0):
#: speed [km/h] -> radial, its first harmonic, and tangential, peak to peak [N]
FORCE_VARIATION = {
    120: (213.0, 152.9, 208.0),
    140: (258.0, 194.4, 285.0),
    160: (322.0, 247.1, 417.0),
    180: (390.0, 310.9, 577.0),
    200: (446.0, 388.5, 729.0),
    220: (538.0, 470.7, 846.0),
    240: (803.0, 553.4, 935.0),
}


def test_the_wheel_s_force_variation_keeps_the_size_that_grows_in_a_tire():
    """Not in the model: the first harmonic grows as v^1.9, and the nuisance `wheel` has one size at
    all speeds, so that logs at 120 and at 240 km/h need one each."""
    speeds = np.array(list(FORCE_VARIATION)) / 3.6
    first = np.array([row[1] for row in FORCE_VARIATION.values()])
    exponent = np.polyfit(np.log(speeds), np.log(first), 1)[0]
    assert exponent == pytest.approx(1.87, abs=0.05)
    base = start([stack(manoeuvres=9, revolutions=4, m=64)], MODEL)
    shared = shared_effects(base.cells, base.fit, "wheel")
    force = [i for i, name in enumerate(shared.names) if name.startswith("force variation")]
    load = load_derivative(base.cells, base.fit)
    size = np.abs(shared.columns[..., force]).max(axis=(1, 2)) / np.abs(load).max(axis=1)
    assert np.ptp(base.cells.conditions.speed_m_s) > 10.0
    assert size == pytest.approx(np.full(len(size), size[0]), rel=0.02)
