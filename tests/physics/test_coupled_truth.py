"""Property: the models' coupled ring moves as the simulator's finite elements."""

from functools import cache

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from tests.physics.coupled_tire import course, obstacle, strain
from tests.simulation.rolls import (
    EI,
    K_V,
    K_W,
    LEVEL,
    LINE_MASS,
    PB,
    RADIUS,
    belt,
    moved,
    orders,
    rolling,
    strain_rider,
)
from tirelog.data.road import RoadProfile
from tirelog.physics.moving.ring import CoupledRing
from tirelog.physics.moving.transient import State, Stepper, stepped_motion

pytestmark = pytest.mark.xdist_group("coupled truth")  # one worker makes what these tests share

SPEED, LOAD, LEVER, THETA, DAMPING = 20.0, 3000.0, 3e-4, -1.2, 100.0
BEGIN, HEIGHT, LENGTH = 0.5, 0.005, 0.04
CLEAT = RoadProfile((0.5, 0.51, 0.53, 0.54), (0.0, HEIGHT, HEIGHT, 0.0))
STEP, SETTLING = 2.5e-5, 24000


def tire(modes=60, damping=DAMPING):
    sidewall = {"k_w": K_W, "k_v": K_V, "c_w": damping, "c_v": damping}
    return CoupledRing(EI=EI, **sidewall, pb=PB, R=RADIUS, k_t=8.75e7, rho_A=LINE_MASS, modes=modes)


def loads(time):
    """A step of load within 10 ms."""
    return LOAD * (1.0 + 0.3 * float(np.clip((time - 0.02) / 0.01, 0.0, 1.0)))


@cache
def truth(what, seconds):
    """Motion from where the hub stands at 0 m, settled before."""
    of = belt(192, radial_damping_N_s_m2=DAMPING, tangential_damping_N_s_m2=DAMPING)
    rolled = rolling(
        of, speed=SPEED, load=LOAD, profile=CLEAT if what == "cleat" else LEVEL, step=STEP
    )
    start = -SPEED * STEP * SETTLING
    rolled.state["hub_x_m"] = start
    rolled.damp_hub(3000.0)
    rolled.run(orders(SETTLING, speed=SPEED, load=LOAD, start_m=start))
    rolled.damp_hub(0.0)
    drive = orders(round(seconds / STEP), speed=SPEED, load=LOAD)
    if what == "load step":
        drive["load_N"] = [loads(STEP * i) for i in range(drive.size)]
    rider = strain_rider(of, THETA - float(rolled.state["angle_rad"]), LEVER)
    return moved(rolled, rolled.run(drive, riders=(rider,)))


@cache
def model(what, seconds):
    of = tire()
    bar = obstacle("cleat", BEGIN, height_m=HEIGHT, length_m=LENGTH)
    road = bar if what == "cleat" else RoadProfile()
    load = loads if what == "load step" else LOAD
    stepper = Stepper(
        of, State.rolling(of, LOAD, SPEED), course(load, SPEED, road), step_s=STEP, nodes=2304
    )
    return stepped_motion(stepper, seconds, every=1)


def below(frequency_Hz, values, step_s):
    return sosfiltfilt(butter(4, frequency_Hz, fs=1.0 / step_s, output="sos"), values)


def apart(what, seconds, frequency_Hz=None):
    """Rms difference over the model's standard deviation, 10 ms off the ends."""
    true, modal = truth(what, seconds), model(what, seconds)
    pairs = {
        "spindle": (true.spindle_z_N, modal.spindle_z_N),
        "hub": (true.hub_z_m, modal.hub_z_m),
        "force": (true.force_z_N, modal.force_z_N),
        "strain": (true.read[:, 0], strain(tire(), modal, THETA, LEVER)),
    }
    inside = (true.time_s > 0.01) & (true.time_s < seconds - 0.01)
    out = {}
    for name, (a, b) in pairs.items():
        if frequency_Hz is not None:
            a, b = (
                below(frequency_Hz, a, STEP),
                below(frequency_Hz, b, modal.time_s[1] - modal.time_s[0]),
            )
        b = np.interp(true.time_s, modal.time_s, b)
        out[name] = float(np.std((a - b)[inside]) / np.std(b[inside]))
    return out


def test_flat_road():
    """Strain through a turn, the forces' means, and the drag that the damping makes."""
    true, modal = truth("flat", 0.1), model("flat", 0.1)
    assert np.ptp(strain(tire(), modal, THETA, LEVER)) > 1e-3
    assert apart("flat", 0.1)["strain"] < 0.008
    assert true.force_z_N.mean() == pytest.approx(modal.force_z_N.mean(), rel=5e-4)
    assert true.hub_z_m.mean() == pytest.approx(modal.hub_z_m.mean(), abs=2e-5)
    # the model begins without bristles in the patch
    late = modal.time_s > 0.05
    assert true.force_x_N.mean() == pytest.approx(-modal.force_s_N[late].mean(), rel=0.03)
    assert true.spin_rad_s.mean() == pytest.approx(modal.omega_rad_s[late].mean(), rel=1e-4)


def test_cleat():
    far = apart("cleat", 0.15)
    assert np.ptp(truth("cleat", 0.15).spindle_z_N) > 0.3 * LOAD
    assert far["spindle"] < 0.012
    assert far["hub"] < 0.003
    low, high = apart("cleat", 0.15, 300.0), apart("cleat", 0.15, 600.0)
    assert low["strain"] < 0.012
    assert low["force"] < 0.01
    assert high["strain"] < 0.02
    assert high["force"] < 0.05


def test_load_step():
    far = apart("load step", 0.15)
    assert np.ptp(truth("load step", 0.15).spindle_z_N) > 0.3 * LOAD
    assert far["spindle"] < 0.012
    assert far["hub"] < 0.003
    assert apart("load step", 0.15, 300.0)["strain"] < 0.012
