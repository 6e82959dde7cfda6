"""P4's own way to the wheel's speed, kept as a reference: frequency trackers on short windows of
the encoder's sinusoid.

    samples (n,) --windows of one low-pass length--> tracker
        --> angular frequency (w,) [rad/s] at the windows' middles

P4 section IV A mixes the technique of Quinn and Fernandes (its [17]) with a closed-form
notch-filter estimate (its [20]), on windows that amount to a low-pass at 20 Hz. Both know the
frequency only, so an angle would have to be integrated from it; `wheel_angle` does better and is
what every estimate uses.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

from tirelog.vocabulary.arrays import FloatArray

#: a window of this length has its -3 dB at 20 Hz
WINDOW_S = 0.443 / 20.0

Tracker = Callable[[FloatArray], float]


def quinn_fernandes(values: FloatArray, steps: int = 8) -> float:
    """Frequency [rad/sample] of a sinusoid in white noise, `values` (n,) of zero mean: ARMA(2, 2)
    with poles and zeros on the unit circle.

    xi_t = x_t + alpha xi_(t-1) - xi_(t-2), beta = sum (xi_t + xi_(t-2)) xi_(t-1) / sum xi_(t-1)^2,
    alpha <- 2 beta - alpha at first and beta in the end, omega = arccos(alpha / 2); from the
    notch's estimate. NaN where the values are no oscillation.
    """
    alpha = 2 * np.cos(notch(values))
    if not np.isfinite(alpha):
        return float("nan")
    for step in range(steps):
        xi = lfilter([1.0], [1.0, -alpha, 1.0], values)
        middle = xi[1:-1]
        beta = float((xi[2:] + xi[:-2]) @ middle / (middle @ middle))
        alpha = beta if step > 2 else 2 * beta - alpha
        alpha = min(max(alpha, -2.0), 2.0)
    return float(np.arccos(alpha / 2))


def notch(values: FloatArray) -> float:
    """Frequency [rad/sample] at which a notch leaves least of `values` (n,) of zero mean, freed of
    the bias of white noise in closed form.

    With r_k the covariances at lag k, cos(omega) = (r_2 + sqrt(r_2^2 + 8 r_1^2)) / (4 r_1): lag 0,
    which holds the noise, is not used. NaN where the values are no oscillation.
    """
    n = values.size
    first, second = values[1:] @ values[:-1] / (n - 1), values[2:] @ values[:-2] / (n - 2)
    if first == 0:
        return float("nan")
    cosine = (second + np.sqrt(second**2 + 8 * first**2)) / (4 * first)
    return float(np.arccos(cosine)) if abs(cosine) <= 1 else float("nan")


def track(
    values: FloatArray, rate_Hz: float, steps: int, tracker: Tracker = quinn_fernandes
) -> tuple[FloatArray, FloatArray]:
    """(times [s] from the first sample, wheel speed [rad/s]) of an encoder of `steps` teeth,
    `values` (n,), window after window.
    """
    length = max(int(WINDOW_S * rate_Hz), 8)
    count = values.size // length
    times = np.asarray(
        (np.arange(count) + 0.5) * length / rate_Hz - 0.5 / rate_Hz, dtype=np.float64
    )
    windows = values[: count * length].reshape(count, length)
    speed = np.array([tracker(w - w.mean()) for w in windows]) * rate_Hz / steps
    return times, speed
