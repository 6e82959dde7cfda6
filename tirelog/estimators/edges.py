"""The papers' own footprint: the edges by the extrema of the strain's first and second derivative along the tread (P2 3.2, 4.3).

    windows (n, m) of strain, patch downward --low-pass, derivatives, upsampled--> d/d xi and d2/d xi2 through the passage's kinematics
    --extrema on either side of the centre, sub-sample--> Edges: times from the centre, lengths, standard errors

Distance runs by the passage's own speed and acceleration, xi = v t + a t^2 / 2, so an extremum of d eps / d xi is one along the tread.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tirelog.dsp.derivatives import Extremum, derivative, fill_lost, least, window_spectrum
from tirelog.dsp.lowpass import gain
from tirelog.recording import FloatArray

#: edges are looked for out to this multiple of the expected half length
SEARCH = 2.1


@dataclass(frozen=True)
class Edges:
    """One row a passage, shape (n,); NaN where an extremum was not found.  Lengths and abscissae in m, heights in 1/m^2 of strain.

    `entry_m`, `exit_m` are the abscissae of the second derivative's extrema, `entry_height`, `exit_height` the size of them there.
    """

    length_d2_m: FloatArray
    length_d2_se_m: FloatArray
    length_d1_m: FloatArray
    length_d1_se_m: FloatArray
    entry_m: FloatArray
    exit_m: FloatArray
    entry_height: FloatArray
    exit_height: FloatArray


def travelled(time_s: FloatArray, speed_m_s: FloatArray, acceleration_m_s2: FloatArray) -> FloatArray:
    """Distance [m] along the tread after `time_s` from the patch centre; broadcasts."""
    return time_s * (speed_m_s + 0.5 * acceleration_m_s2 * time_s)


@dataclass(frozen=True)
class AlongTread:
    """Low-passed windows, (n, m x upsample): `xi_m` from the patch centre, `first` and `second` derivative by xi [1/m, 1/m^2]."""

    xi_m: FloatArray
    first: FloatArray
    second: FloatArray


def along_tread(
    windows: FloatArray,
    rate_Hz: float,
    centre: FloatArray,
    speed_m_s: FloatArray,
    acceleration_m_s2: FloatArray,
    cutoff_Hz: FloatArray,
    upsample: int = 2,
    columns: slice = slice(None),
) -> AlongTread:
    """The derivatives along the tread after the low-pass, at `columns` of those there are; other arguments as of `find_edges`."""
    count = windows.shape[1]
    spectrum = window_spectrum(fill_lost(windows))
    gains = gain(_frequencies(count, rate_Hz), cutoff_Hz)
    first_s, second_s = (derivative(spectrum, gains, rate_Hz, order, count, upsample)[:, columns] for order in (1, 2))
    time = (np.arange(count * upsample)[columns] / upsample - centre[:, None]) / rate_Hz
    speed = np.maximum(speed_m_s[:, None] + acceleration_m_s2[:, None] * time, 0.05 * np.abs(speed_m_s[:, None]) + 1e-9)
    first = first_s / speed
    second = (second_s - acceleration_m_s2[:, None] * first) / speed**2
    return AlongTread(travelled(time, speed_m_s[:, None], acceleration_m_s2[:, None]), first, second)


def lowpassed(windows: FloatArray, rate_Hz: float, cutoff_Hz: FloatArray, upsample: int = 2) -> FloatArray:
    """The windows (n, m) after the low-pass, less the line through their ends, (n, m x upsample)."""
    count = windows.shape[1]
    gains = gain(_frequencies(count, rate_Hz), cutoff_Hz)
    return derivative(window_spectrum(fill_lost(windows)), gains, rate_Hz, 0, count, upsample)


def _columns(middle: FloatArray, reach: FloatArray, count: int) -> slice:
    """The columns, of `count`, in which any row's extrema are looked for, with neighbours for their parabolas."""
    low, high = float(np.min(middle - reach)), float(np.max(middle + reach))
    if not np.isfinite(low + high):
        return slice(0, count)
    start = min(max(int(low) - 3, 0), max(count - 8, 0))
    return slice(start, max(min(int(high) + 4, count), start + 8))


def _frequencies(count: int, rate_Hz: float) -> FloatArray:
    return np.asarray(np.fft.rfftfreq(count, 1.0 / rate_Hz), np.float64)


def find_edges(
    windows: FloatArray,
    rate_Hz: float,
    centre: FloatArray,
    speed_m_s: FloatArray,
    acceleration_m_s2: FloatArray,
    cutoff_Hz: FloatArray,
    half_length_m: FloatArray,
    noise: float,
    upsample: int = 2,
) -> Edges:
    """Edges of the passages in `windows` (n, m), patch downward, NaN where lost.

    `centre` (n,): column of the patch centre; `half_length_m` (n,): what half of the patch is expected to be, to look for extrema;
    `noise`: standard deviation of a sample; `upsample`: points a sample, so that a parabola through three follows what the low-pass leaves.
    """
    count = windows.shape[1]
    reach = SEARCH * half_length_m / speed_m_s * rate_Hz * upsample
    looked_at = _columns(centre * upsample, reach, count * upsample)
    tread = along_tread(windows, rate_Hz, centre, speed_m_s, acceleration_m_s2, cutoff_Hz, upsample, looked_at)
    first, second = tread.first, tread.second
    frequency = _frequencies(count, rate_Hz)
    gains = gain(frequency, cutoff_Hz)
    middle = centre * upsample - looked_at.start
    d1 = least(first, middle - reach, middle), least(-first, middle, middle + reach)
    inner = [np.where(np.isfinite(e.place), e.place, middle) for e in d1]
    d2 = least(second, middle - reach, inner[0]), least(second, inner[1], middle + reach)

    def place(e: Extremum) -> FloatArray:
        return travelled((e.place - middle) / (rate_Hz * upsample), speed_m_s, acceleration_m_s2)

    edge = [place(e) for e in d2]
    flank = [place(e) for e in d1]
    wiggle1, wiggle2 = (_wiggle(frequency, gains, order, count, noise) for order in (2, 3))
    step = 1.0 / (rate_Hz * upsample)
    return Edges(
        edge[1] - edge[0],
        _pair_error(d2, wiggle2 / speed_m_s**2, step, speed_m_s),
        flank[1] - flank[0],
        _pair_error(d1, wiggle1 / speed_m_s, step, speed_m_s),
        edge[0],
        edge[1],
        -d2[0].height,
        -d2[1].height,
    )


def _wiggle(frequency: FloatArray, gains: FloatArray, order: int, count: int, noise: float) -> FloatArray:
    """Standard deviation of the `order`-th time derivative of low-passed white `noise`, shape (n,)."""
    power = (2.0 * np.pi * frequency) ** (2 * order) * gains**2
    return noise * np.sqrt(2.0 * power.sum(axis=1) / count)


def _pair_error(pair: tuple[Extremum, Extremum], wiggle: FloatArray, step_s: float, speed_m_s: FloatArray) -> FloatArray:
    """Standard error [m] of the distance between two extrema: each moves by the noise of the next derivative over its curvature."""
    squares = sum((wiggle * step_s**2 / extremum.curvature) ** 2 for extremum in pair)
    return np.sqrt(squares) * speed_m_s
