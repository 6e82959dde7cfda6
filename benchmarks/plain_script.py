"""What a competent user would write instead of tirelog: speed, footprint and dissipation of 16
gratings, whole file in memory.
"""

import sys

import numpy as np
import pandas as pd
from scipy.signal import butter, find_peaks, sosfiltfilt

RATE_HZ, RADIUS_M, GAIN, CUTOFF_HZ = 2500.0, 0.305, 1.27, 400.0

frame = pd.read_csv(sys.argv[1])
time = frame["time_s"].to_numpy()
filter_ = butter(4, CUTOFF_HZ, fs=RATE_HZ, output="sos")
rows = []
for name in [c for c in frame.columns if c.startswith("CH")]:
    wavelength = frame[name].interpolate().bfill().to_numpy()
    strain = GAIN * (wavelength - 1550.0) / 1550.0
    smooth = sosfiltfilt(filter_, strain)
    first = np.gradient(smooth, time)
    second = np.gradient(first, time)
    peaks, _ = find_peaks(-smooth, height=0.5 * np.max(-smooth), distance=50)
    for i in range(1, len(peaks) - 1):
        a, b = peaks[i - 1], peaks[i + 1]
        speed = 4 * np.pi * RADIUS_M / (time[b] - time[a])
        low, high = peaks[i] - (peaks[i] - a) // 4, peaks[i] + (b - peaks[i]) // 4
        entry, leave = (
            low + np.argmax(second[low : peaks[i]]),
            peaks[i] + np.argmax(second[peaks[i] : high]),
        )
        half = slice((a + peaks[i]) // 2, (peaks[i] + b) // 2)
        factor = np.trapezoid(first[half] ** 2, time[half]) / speed
        rows.append(
            (
                name,
                time[peaks[i]],
                speed,
                (time[leave] - time[entry]) * speed,
                factor,
                factor * speed**2,
            )
        )
pd.DataFrame(
    rows, columns=["channel", "time_s", "speed_m_s", "length_m", "factor", "power"]
).to_csv(sys.argv[2], index=False)
