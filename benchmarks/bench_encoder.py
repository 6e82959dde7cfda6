"""Wheel angle: least-squares tooth passages with a learnt pitch table against the band-pass +
Hilbert script; and an hour of phase-shift.

    python -m benchmarks.bench_encoder [--hour]

CPU seconds of this process, the two in turn; errors against the true angle at every sample, the
constant removed. The script's Fourier transform likes some lengths better than others: it is
measured at its best, 2^7 5^6 samples, and at a length as it comes.
"""

import sys
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np
from scipy.signal import butter, hilbert, sosfiltfilt

from benchmarks.measure import cost
from tirelog.data.recording import Channel, TimeAxis
from tirelog.wheel.angle import wheel_angle

RATE_HZ, STEPS, RADIUS_M = 10_000.0, 48, 0.305
SETUP = f"""[tire]
rolling_radius_m = {RADIUS_M}
[channels.encoder]
kind = "wheel_encoder"
source = "/encoder"
unit = "V"
steps = {STEPS}
[channels.acceleration]
kind = "radial_acceleration"
source = "/acceleration"
unit = "g"
"""


#: seconds, and speeds [m/s] at them, of a minute's drive
TOWN, MOTORWAY = (
    ([0, 15, 20, 40, 45, 60], [10, 10, 22, 22, 10, 10]),
    ([0, 2, 5, 55, 58, 60], [10, 10, 25, 25, 10, 10]),
)


def drive(
    seconds: float,
    random: np.random.Generator,
    noise: float,
    start: float = 0.0,
    minute: tuple[list[int], list[int]] = TOWN,
) -> tuple[np.ndarray, np.ndarray]:
    """(wheel angle, encoder volts) of a drive, minute by minute, from the angle `start`, pitch
    errors up to 0.4 degree.
    """
    t = np.arange(0, seconds, 1 / RATE_HZ)
    speed = np.interp(t % 60, *minute)
    angle = start + np.cumsum(speed) / RATE_HZ / RADIUS_M
    error = np.random.default_rng(1003).uniform(-1, 1, STEPS) * np.deg2rad(0.4)
    bent = np.interp(
        np.mod(angle, 2 * np.pi),
        np.arange(STEPS + 1) * 2 * np.pi / STEPS,
        np.append(error, error[0]),
    )
    return angle, np.sin(STEPS * (angle - bent)) * (
        1 + 0.1 * np.cos(angle)
    ) + noise * random.standard_normal(t.size)


def script(volts: np.ndarray) -> np.ndarray:
    """What a competent user would write."""
    clean = sosfiltfilt(butter(4, [100, 1200], "band", fs=RATE_HZ, output="sos"), volts)
    return np.unwrap(np.angle(hilbert(clean))) / STEPS


def error_deg(found: np.ndarray, true: np.ndarray) -> str:
    difference = np.rad2deg(found - true)[5000:-5000]
    difference -= np.nanmean(difference)
    return f"{np.nanstd(difference):.4f} rms, {np.nanmax(np.abs(difference)):.3f} at most"


def compare(noise: float, size: int) -> None:
    true, volts = (x[:size] for x in drive(200.0, np.random.default_rng(1000), noise))
    axis = TimeAxis.uniform(volts.size, RATE_HZ)
    channel = Channel.of_array("encoder", "wheel_encoder", volts, axis, settings={"steps": STEPS})
    times = axis.time()
    seconds: list[list[float]] = [[], [], []]
    for _ in range(3):
        marks = [time.process_time()]
        hilbert_angle = script(volts)
        marks.append(time.process_time())
        wheel = wheel_angle(channel, "V")
        marks.append(time.process_time())
        ours = wheel.angle.at(times)
        marks.append(time.process_time())
        for row, used in zip(seconds, np.diff(marks), strict=True):
            row.append(float(used))
    per = [volts.size / np.median(row) / 1e6 for row in seconds]
    both = volts.size / np.median(np.array(seconds[1]) + np.array(seconds[2])) / 1e6
    print(
        f"noise {100 * noise:.0f} %, {size} samples: script {per[0]:5.1f} Msamples/s, error "
        f"{error_deg(hilbert_angle, true)} degree"
    )
    print(
        f"          ours   {per[1]:5.1f} Msamples/s ({per[1] / per[0]:.1f} x), error "
        f"{error_deg(ours, true)} degree"
    )
    print(
        f"          and with the angle at every sample {both:.1f} Msamples/s "
        f"({both / per[0]:.1f} x)"
    )


def hour(minutes: int = 60) -> None:
    """An hour of encoder and accelerometer, most of it at 90 km/h, through the command."""
    random = np.random.default_rng(1001)
    with tempfile.TemporaryDirectory() as folder:
        log, size = Path(folder) / "hour.h5", int(60 * RATE_HZ)
        with h5py.File(log, "w") as file:
            sets = [
                file.create_dataset(name, (minutes * size,), "f4", chunks=(1 << 17,))
                for name in ("encoder", "acceleration")
            ]
            for data, unit in zip(sets, ("V", "g"), strict=True):
                data.attrs["unit"], data.attrs["sampling_rate_Hz"] = unit, RATE_HZ
            last = 0.0
            for minute in range(minutes):
                angle, volts = drive(60.0, random, 0.02, last, MOTORWAY)
                last = float(angle[-1])
                phi = np.rad2deg(np.mod(angle + np.pi, 2 * np.pi) - np.pi)
                level = (np.gradient(angle) * RATE_HZ) ** 2 * RADIUS_M / 9.81
                patch = 1 / (1 + np.exp(np.clip((np.abs(phi) - 12) / 0.8, -50, 50)))
                part = slice(minute * size, (minute + 1) * size)
                sets[0][part] = volts
                sets[1][part] = -level * (1 - patch) + 1.2 * random.standard_normal(size)
        log.with_suffix(".toml").write_text(SETUP)
        command = [
            sys.executable,
            "-m",
            "tirelog",
            "phase-shift",
            str(log),
            "-o",
            str(Path(folder) / "t.csv"),
            "--quiet",
        ]
        print(f"{minutes} min at 10 kHz through phase-shift: {cost(command)}")


if __name__ == "__main__":
    hour(
        60 if "--hour" in sys.argv else 10
    )  # first: a child's peak memory begins with its parent's
    for share, length in ((0.02, 2_000_000), (0.02, 1_987_654), (0.1, 2_000_000)):
        compare(share, length)
