"""What a competent user would write instead of tirelog: speed, footprint and dissipation of a log's
gratings, whole file in memory.

    python -m benchmarks.plain_script LOG OUT [outer|inner] [pandas|polars]
"""

import sys
from typing import Any

import numpy as np
from scipy.signal import butter, find_peaks, sosfiltfilt

RADIUS_M, GAIN, CUTOFF_HZ = 0.305, 1.27, 400.0

log, out, surface, library = (*sys.argv[1:], *("outer", "pandas")[len(sys.argv) - 3 :])
sign = -1.0 if surface == "outer" else 1.0
frame: Any
if library == "polars":
    import polars

    frame = polars.read_csv(log).interpolate().fill_null(strategy="backward")
else:
    import pandas

    frame = pandas.read_csv(log)
time = frame["time_s"].to_numpy()
rate_Hz = (time.size - 1) / (time[-1] - time[0])
filter_ = butter(4, CUTOFF_HZ, fs=rate_Hz, output="sos")
rows = []
for name in [c for c in frame.columns if c.startswith("CH")]:
    column = frame[name] if library == "polars" else frame[name].interpolate().bfill()
    strain = GAIN * (column.to_numpy() - 1550.0) / 1550.0
    smooth = sosfiltfilt(filter_, strain)
    first = np.gradient(smooth, time)
    second = sign * -np.gradient(first, time)
    up = sign * smooth
    peaks, _ = find_peaks(up, height=0.5 * np.max(up), distance=max(int(0.02 * rate_Hz), 1))
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
names = ["channel", "time_s", "speed_m_s", "length_m", "factor", "power"]
if library == "polars":
    polars.DataFrame(rows, schema=names, orient="row").write_csv(out)
else:
    pandas.DataFrame(rows, columns=names).to_csv(out, index=False)
