"""The brush's shear place by place, P2 (13); the package has its Fourier modes."""

import numpy as np

from tirelog.physics.pressure import Grip, slip_stiffness, transition
from tirelog.vocabulary.arrays import FloatArray

P2_GRIP = Grip()


def traction(
    xi_m: FloatArray,
    load_N: FloatArray,
    half_length_m: FloatArray,
    slip: FloatArray,
    grip: Grip = P2_GRIP,
) -> FloatArray:
    """tau(xi) [N/m], positive in braking."""
    gamma = 0.75 * load_N / half_length_m**3
    stiffness = grip.stiffness_ratio * slip_stiffness(load_N, half_length_m, grip.static_friction)
    stick = slip * stiffness * (xi_m + half_length_m)
    slide = np.sign(slip) * grip.sliding_friction * gamma * (half_length_m**2 - xi_m**2)
    tau = np.where(xi_m < transition(slip, half_length_m, grip.stiffness_ratio), stick, slide)
    return np.where(np.abs(xi_m) < half_length_m, tau, 0.0)
