"""Property: fronts of a simulated carcass, whose soft flanks nobody drew for the estimator, meet
the goals at 10 m/s, where the noise tells most.
"""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.wheel_cases import Instruments, wheel_scenario
from benchmarks.wheel_manoeuvres import scenario
from tirelog.simulation import simulate, to_recording
from tirelog.simulation.scenario.schema import Manoeuvre, Planted, Road
from tirelog.wheel.phase_shift import measure_phase_shift


def measured(plan):
    """The passages of a log, and what is true of them."""
    simulated = simulate(plan)
    found = next(measure_phase_shift(to_recording(simulated, "log")))
    return found, simulated.truth["channels"]["acceleration"]["passages"]


@pytest.mark.parametrize(
    ("noise_g", "shift_deg", "width_deg"), [(1.2, 0.02, 0.05), (3.0, 0.05, 0.11)]
)
def test_goals_at_10_m_s(noise_g, shift_deg, width_deg):
    plan = wheel_scenario(seed=8001, with_=Instruments(acceleration_noise_g=noise_g), roughness=0.0)
    found, true = measured(replace(plan, manoeuvres=(Manoeuvre(60.0, 10.0, None),)))
    nearest = np.abs(np.array(true["time_s"])[:, None] - found.time_s).argmin(axis=1)
    assert found.good.mean() > 0.97
    assert abs(len(found.quality) - len(true["time_s"])) <= 1
    middle = (found.entry_deg + found.width_deg / 2)[nearest] - np.rad2deg(true["wheel_angle_rad"])
    middle = np.mod(middle - middle[0] + 180, 360)
    uncertain = 1 + 2 / np.sqrt(2 * middle.size)
    assert middle.std() < shift_deg * uncertain
    assert found.width_deg.std() < width_deg * uncertain
    for error, se in (
        (middle - middle.mean(), found.shift_se_deg[nearest]),
        (found.width_deg - found.width_deg.mean(), found.width_se_deg),
    ):
        assert 0.92 < np.mean(np.abs(error) < 1.96 * se) <= 1.0


@pytest.mark.parametrize("pressure_Pa", [2.0e5, 1.6e5])
def test_width_in_manoeuvres_follows_the_contact_of_a_ring(pressure_Pa):
    """Load that moves by a tenth: what the width misses of the contact's edges is no part of it."""
    transfer = Planted("load_transfer", "exact", {"coefficient": 0.3})
    plan = wheel_scenario(seed=8003, pressure_Pa=pressure_Pa, effects=(transfer,), roughness=0.0)
    moves = ((6, 12.0), (5, 23.0), (6, 23.0), (3, 12.0), (5, 12.0))
    ring = replace(
        plan,
        truth="ring",
        effects=(transfer,),
        manoeuvres=tuple(Manoeuvre(float(s), v, None) for s, v in moves),
    )
    found, true = measured(ring)
    nearest = np.abs(np.array(true["time_s"])[:, None] - found.time_s).argmin(axis=0)
    contact = np.array(true["patch_width_deg"])[nearest]
    good = found.good
    error = (found.width_deg - contact)[good]
    assert np.std(contact[good]) > 0.35
    # half levels alone miss an eighth of what moves, and 0.075 degrees
    assert abs(np.polyfit(contact[good], error, 1)[0]) < 0.06
    assert error.std() < 0.05


def test_a_rough_road_moves_the_patch_and_is_no_error():
    """Loads that vary from turn to turn widen the patch; errors stay those of the noise."""
    ring = scenario("dynamic_2.0bar_1.2g", 804)
    found, true = measured(replace(ring, road=Road(0.02)))
    nearest = np.abs(np.array(true["time_s"])[:, None] - found.time_s).argmin(axis=0)
    contact = np.array(true["patch_width_deg"])[nearest]
    middle = found.entry_deg + found.width_deg / 2 - np.rad2deg(true["wheel_angle_rad"])[nearest]
    middle = np.mod(middle - middle[0] + 180, 360)
    assert np.std(np.diff(contact)) > 2 * np.median(found.width_se_deg)
    for error, se in (
        (middle - middle.mean(), found.shift_se_deg),
        (found.width_deg - contact - np.mean(found.width_deg - contact), found.width_se_deg),
    ):
        assert 0.85 < np.mean(np.abs(error) < 1.96 * se) < 0.99
        assert np.sqrt(np.mean(se**2)) < 1.3 * error.std()
