"""The papers' own footprint.

The edges by the extrema of the strain's first and second derivative along the tread (P2 3.2, 4.3).

    windows (n, m) of strain, patch downward
        --low-pass, derivatives, upsampled--> d/d xi and d2/d xi2 through the passage's kinematics
        --extrema on either side of the centre, sub-sample--> Edges: times from the centre, lengths,
                                                              standard errors

Distance runs by the passage's own speed and acceleration, xi = v t + a t^2 / 2, so an extremum of d
eps / d xi is one along the tread.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tirelog.dsp.filters import derivatives, window_spectra
from tirelog.kernels import compiled
from tirelog.strain.footprint.kernels import motion_of
from tirelog.vocabulary.arrays import ColumnSet, FloatArray, Records

#: the fields of `Edges` of one row
EDGES = np.dtype(
    [("length_d2_m", "f8"), ("length_d2_se_m", "f8"), ("length_d1_m", "f8"),
     ("length_d1_se_m", "f8"), ("entry_m", "f8"), ("exit_m", "f8"), ("entry_height", "f8"),
     ("exit_height", "f8")]
)  # fmt: skip

#: edges are looked for out to this multiple of the expected half length
SEARCH = 2.1
#: steps towards an extremum, which lies no farther than this many columns from the column that is
#: least; twice as far reaches the next column's own extremum
STEPS, FARTHEST = 4, 0.75
#: samples per period of the low-pass' cut-off that need none between them to find an extremum;
#: twice as many put one between the samples of logs up to twice the rate
DENSE = 8.0


@dataclass(frozen=True)
class Edges(ColumnSet):
    """One row per passage, shape (n,); NaN if an extremum was not found.

    Lengths and abscissae in m, heights in 1/m^2 of strain.

    `entry_m`, `exit_m` are the abscissae of the second derivative's extrema, `entry_height`,
    `exit_height` the size of them there.
    """

    length_d2_m: FloatArray
    length_d2_se_m: FloatArray
    length_d1_m: FloatArray
    length_d1_se_m: FloatArray
    entry_m: FloatArray
    exit_m: FloatArray
    entry_height: FloatArray
    exit_height: FloatArray


def distance_along(
    time_s: FloatArray, speed_m_s: FloatArray, acceleration_m_s2: FloatArray
) -> FloatArray:
    """Distance [m] along the tread after `time_s` from the patch centre; broadcasts."""
    return time_s * (speed_m_s + 0.5 * acceleration_m_s2 * time_s)


@compiled
def _along(
    first_s: float, second_s: float, time: float, speed: float, acceleration: float
) -> tuple[float, float]:
    """First and second derivative along the tread out of those in time.

    `time`: from the patch centre.
    """
    now = max(speed + acceleration * time, 0.05 * abs(speed) + 1e-9)
    first = first_s / now
    return first, (second_s - acceleration * first) / now**2


@compiled
def _along_rows(derivatives: FloatArray, motion: Records, upsample: int) -> FloatArray:
    """`derivatives` (2, n, m) in time turned into those along the tread; `motion` (n,)."""
    out = np.empty_like(derivatives)
    for row in range(motion.size):
        centre, rate = motion[row]["centre"], motion[row]["rate_Hz"]
        speed, acceleration = motion[row]["speed_m_s"], motion[row]["acceleration_m_s2"]
        for k in range(derivatives.shape[2]):
            time = (k / upsample - centre) / rate
            out[0, row, k], out[1, row, k] = _along(
                derivatives[0, row, k], derivatives[1, row, k], time, speed, acceleration
            )
    return out


@dataclass(frozen=True)
class AlongTread:
    """Low-passed windows, (n, m x upsample): abscissae and derivatives.

    `xi_m` from the patch centre, `first` and `second` derivative by xi [1/m, 1/m^2].
    """

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
) -> AlongTread:
    """The derivatives along the tread after the low-pass; arguments as of `find_edges`."""
    count, spectra = windows.shape[1], window_spectra(windows)
    in_time = derivatives(spectra, rate_Hz, cutoff_Hz, count, upsample)[:2]
    first, second = _along_rows(
        np.stack(in_time), motion_of(centre, rate_Hz, speed_m_s, acceleration_m_s2), upsample
    )
    time = (np.arange(count * upsample) / upsample - centre[:, None]) / rate_Hz
    return AlongTread(
        distance_along(time, speed_m_s[:, None], acceleration_m_s2[:, None]), first, second
    )


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

    `centre` (n,): column of the patch centre; `half_length_m` (n,): what half of the patch is
    expected to be, to look for extrema; `noise`: standard deviation of a sample; `upsample`: points
    per sample, 2 unless samples are DENSE.
    """
    first, second, noises = derivatives(
        window_spectra(windows), rate_Hz, cutoff_Hz, windows.shape[1], upsample
    )
    # an extremum moves by the noise of the next derivative
    wiggle = noise * noises
    motion = motion_of(centre, rate_Hz, speed_m_s, acceleration_m_s2)
    found = np.empty(centre.size, EDGES)
    edge_rows(first, second, motion, SEARCH * half_length_m, wiggle, upsample, found)
    return Edges(**{name: found[name] for name in EDGES.names or ()})


@compiled
def least(row: FloatArray, low: float, high: float) -> tuple[float, float, float]:
    """Place, height and curvature of the least value of `row` between two columns.

    Between `low` and `high`, of the quartic through five columns: place in columns (NaN if it lies
    at the border of its range), height, curvature per column^2 (NaN if it is no minimum).

    At six columns per period of the low-pass' cut-off, a place in a passage is true to 0.02 columns
    (rms); a parabola through three: 0.1.
    """
    count = row.size
    first, last = max(int(np.ceil(low)), 0), min(int(np.floor(high)), count - 1)
    index = first
    for k in range(first, last + 1):
        if row[k] < row[index]:
            index = k
    safe = min(max(index, 2), count - 3)
    a, b, c, d, e = row[safe - 2], row[safe - 1], row[safe], row[safe + 1], row[safe + 2]
    # derivatives in the middle by central differences
    slope, bend = (a - e + 8.0 * (d - b)) / 12.0, (16.0 * (b + d) - 30.0 * c - a - e) / 12.0
    third, fourth = (e - a + 2.0 * (b - d)) / 2.0, a + e - 4.0 * (b + d) + 6.0 * c
    shift = float(index - safe)
    for _ in range(STEPS):
        curvature = bend + shift * (third + 0.5 * shift * fourth)
        if not curvature > 0.0:
            return np.nan, row[index], np.nan
        shift -= (slope + shift * (bend + shift * (0.5 * third + shift * fourth / 6.0))) / curvature
        shift = min(max(shift, index - safe - FARTHEST), index - safe + FARTHEST)
    curvature = bend + shift * (third + 0.5 * shift * fourth)
    height = c + shift * (
        slope + shift * (0.5 * bend + shift * (third / 6.0 + shift * fourth / 24.0))
    )
    inner = np.ceil(low) < index < np.floor(high) and 0 < index < count - 1
    return safe + shift if inner else np.nan, height, curvature if curvature > 0.0 else np.nan


@compiled
def edge_rows(
    first_s: FloatArray,
    second_s: FloatArray,
    motion: Records,
    reach_m: FloatArray,
    wiggle: FloatArray,
    upsample: int,
    found: Records,
) -> None:
    """Fills `found` (n,) of EDGES out of derivatives in time.

    The derivatives (n, m x upsample) are looked at within `reach_m` (n,) of the centre; rows move
    as `motion` (n,) says; `wiggle` (n, 2): standard deviations of the second and third derivative's
    noise.
    """
    n, count = first_s.shape
    fall, rise, bend = np.empty(count), np.empty(count), np.empty(count)
    place, squares, heights = np.empty(4), np.empty(4), np.empty(4)
    for row in range(n):
        rate, speed = motion[row]["rate_Hz"] * upsample, motion[row]["speed_m_s"]
        acceleration, middle = motion[row]["acceleration_m_s2"], motion[row]["centre"] * upsample
        reach = reach_m[row] / speed * rate
        for k in range(max(int(middle - reach) - 2, 0), min(int(middle + reach) + 3, count)):
            fall[k], bend[k] = _along(
                first_s[row, k], second_s[row, k], (k - middle) / rate, speed, acceleration
            )
            rise[k] = -fall[k]
        low, high = middle - reach, middle + reach
        for e in range(4):  # steepest fall and rise, then the sharpest bends outside of them
            if e < 2:
                least_of = least(rise if e else fall, middle if e else low, high if e else middle)
            else:
                steepest = middle if np.isnan(place[e - 2]) else place[e - 2]
                least_of = least(bend, steepest if e == 3 else low, high if e == 3 else steepest)
            place[e], heights[e] = least_of[0], least_of[1]
            squares[e] = (wiggle[row, e // 2] / speed ** (e // 2 + 1) / rate**2 / least_of[2]) ** 2
        for e in range(4):
            time = (place[e] - middle) / rate
            place[e] = time * (speed + 0.5 * acceleration * time)
        edges = found[row]
        edges["length_d2_m"] = place[3] - place[2]
        edges["length_d2_se_m"] = np.sqrt(squares[2] + squares[3]) * speed
        edges["length_d1_m"] = place[1] - place[0]
        edges["length_d1_se_m"] = np.sqrt(squares[0] + squares[1]) * speed
        edges["entry_m"], edges["exit_m"] = place[2], place[3]
        edges["entry_height"], edges["exit_height"] = -heights[2], -heights[3]
