"""Closed form: the catalogue's belt in shear against Timoshenko's two equations, solved by finite
differences.
"""

import numpy as np
import pytest
from scipy.sparse import bmat, diags
from scipy.sparse.linalg import spsolve

from tirelog.api.models import forces
from tirelog.data.recording import Conditions
from tirelog.errors import ModelError
from tirelog.physics import Model

EJ, K, MU, HALF, LEVER, LOAD, R = 4.0, 7.8e6, 0.676, 0.058, 3e-4, 3434.0, 0.305


def timoshenko(shear_length, speed, points=8192):
    """(angles, strain of the inner surface) of GA (w' - t)' - mu c^2 w'' - k w + p = 0 and
    EJ t'' + GA (w' - t) = 0; w, t on a staggered closed grid."""
    step = 2 * np.pi * R / points
    place = (np.arange(points) - points // 2) * step
    force = EJ / shear_length**2  # G A
    edges = np.clip((place[:, None] + [[-step / 2, step / 2]]) / HALF, -1.0, 1.0)
    p = np.diff(LOAD * (0.75 * edges - 0.25 * edges**3), axis=1)[:, 0] / step
    one = np.ones(points)
    ahead = diags([-one, one[1:], one[:1]], [0, 1, 1 - points]) / step  # from w to t's places
    back = -ahead.T
    both = bmat(
        [
            [(force - MU * speed**2) * (back @ ahead) - K * diags(one), -force * back],
            [force * ahead, EJ * (ahead @ back) - force * diags(one)],
        ],
        format="csc",
    )
    turned = spsolve(both, np.concatenate([-p, 0 * p]))[points:]
    return place / R, -LEVER * (back @ turned)


def model():
    return Model.new(
        "beam",
        flexural_stiffness_N_m2=EJ,
        foundation_stiffness_N_m2=K,
        line_mass_kg_m=MU,
        patch_half_length_m=HALF,
        reference_load_N=LOAD,
        lever_arm_m=LEVER,
        radius_m=R,
    )


@pytest.mark.parametrize(("length", "speed"), [(0.01, 1.0), (0.02, 20.0)])
def test_strain_of_a_belt_that_yields_in_shear(length, speed):
    drive = Conditions.of(1, speed_m_s=speed, load_N=LOAD)
    angles, truth = timoshenko(length, speed)
    told = (
        model().with_effect("belt_shear", length_m=length).predict(drive, angles, surface="inner")
    )
    plain = model().predict(drive, angles, surface="inner")
    assert np.abs(told[0] - truth).max() < 2e-3 * np.abs(truth).max()
    assert np.abs(plain[0] - truth).max() > 2e-2 * np.abs(truth).max()


def test_a_belt_that_yields_too_much_is_refused():
    soft = model().with_effect("belt_shear", length_m=0.1)
    with pytest.raises(ModelError, match="too soft in shear"):
        soft.predict(Conditions.of(1, speed_m_s=40.0, load_N=LOAD), np.zeros(1))


@pytest.mark.parametrize("length", [0.01, 0.02, 0.1])
def test_its_critical_speed_is_that_of_its_slowest_wave(length):
    """The least speed of a wave, by trying waves."""
    q = np.geomspace(1.0, 1e5, 200_000)
    slowest = np.sqrt((EJ * q**2 / (1 + (length * q) ** 2) + K / q**2).min() / MU)
    told = forces(model().with_effect("belt_shear", length_m=length), {"speed_m_s": 2.0})
    assert 2.0 / told["speed_ratio"][0] == pytest.approx(slowest, rel=1e-4)
