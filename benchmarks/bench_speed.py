"""Speed against known truth, and what it costs: 16 gratings, 2.5 kHz, beside findpeaks on a
low-pass as P1 did it.

The truth is a speed profile integrated in time (nothing of the estimator in it). Figures: rms error
of the speed at constant speed (goal 0.002 m/s) and in manoeuvres (0.01 m/s), passages missed and
invented, share of rows within one standard error (0.68 +- 0.05).
"""

import time

import numpy as np
from scipy.signal import butter, find_peaks, sosfiltfilt

from tirelog.data.recording import Channel, TimeAxis
from tirelog.strain.passages.find import find_passages

RATE_HZ, RADIUS_M, PICOMETRE = 2500.0, 0.305, 1.27e-3 / 1550.0
CONSTANT = [[v, v] for v in (6.0, 10.0, 15.0, 20.0, 25.0)]
SEEDS = range(2000, 2006)
COPIES = 16


def drive(knots_s, speeds_m_s, seed, noise_pm):
    """(channel, times, speeds of the true passages, which of them lie whole within the log)."""
    rng = np.random.default_rng(seed)
    fine = np.arange(0.0, knots_s[-1], 1e-4)
    speed = np.interp(fine, knots_s, speeds_m_s)
    turns = 0.4 + np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * 1e-4)]) / (
        2 * np.pi * RADIUS_M
    )
    at = np.arange(int(knots_s[-1] * RATE_HZ)) / RATE_HZ
    xi = (np.mod(np.interp(at, fine, turns) + 0.5, 1.0) - 0.5) * 2 * np.pi * RADIUS_M
    flat = 0.5 * (np.tanh((xi + 0.055) / 0.023) - np.tanh((xi - 0.055) / 0.023))
    shape = (
        flat
        - 0.3 * np.exp(-(((xi + 0.105) / 0.035) ** 2))
        - 0.22 * np.exp(-(((xi - 0.11) / 0.04) ** 2))
    )
    values = (
        -8e-4 * shape + 5e-5 * (1 - np.exp(-at / 60)) + rng.normal(0, noise_pm * PICOMETRE, at.size)
    )
    passed = np.interp(np.arange(1, np.ceil(turns[-1])), turns, fine)
    speed_there = np.interp(passed, fine, speed)
    whole = (passed > 0.15 / speed_there) & (passed < at[-1] - 0.15 / speed_there)
    channel = Channel.of_array("grating", "strain", values, TimeAxis.uniform(at.size, RATE_HZ))
    return channel, passed, speed_there, whole


def manoeuvres(seed):
    """Knots of a drive: drive, cruise, brake, coast, at random within 6 to 25 m/s and 4 m/s^2."""
    rng = np.random.default_rng(seed)
    knots, speeds = [0.0], [float(rng.uniform(6, 25))]
    while knots[-1] < 120:
        step = rng.uniform(3, 9)
        target = speeds[-1] if rng.random() < 0.5 else float(rng.uniform(6, 25))
        speeds.append(float(np.clip(target, speeds[-1] - 4 * step, speeds[-1] + 4 * step)))
        knots.append(knots[-1] + step)
    return knots, speeds


def plain(channel):
    """(times, speeds) the plain way: peaks of a 400 Hz low-pass, whole samples."""
    smooth = sosfiltfilt(butter(4, 400.0, fs=RATE_HZ, output="sos"), channel.read())
    peaks, _ = find_peaks(-smooth, height=0.5 * np.max(-smooth), distance=50)
    at = peaks / RATE_HZ
    return at[1:-1], 4 * np.pi * RADIUS_M / (at[2:] - at[:-2])


def report(title, drives):
    """One line: errors, missed and invented passages, coverage; and the plain way's error."""
    off, ratio, plainly, missed, invented = [], [], [], 0, 0
    for channel, time_s, speed, whole in drives:
        found = find_passages(channel, RADIUS_M)
        nearest = np.abs(found.time_s[:, None] - time_s[None, :]).argmin(1)
        missed += np.setdiff1d(np.flatnonzero(whole), nearest).size
        invented += len(found) - np.unique(nearest).size
        off.append(found.speed_m_s - speed[nearest])
        ratio.append(off[-1] / found.speed_se_m_s)
        at, there = plain(channel)
        plainly.append(there - np.interp(at, time_s, speed))
    rms = np.sqrt(np.mean(np.concatenate(off) ** 2))
    covered = np.mean(np.abs(np.concatenate(ratio)) < 1)
    plain_rms = np.sqrt(np.mean(np.concatenate(plainly) ** 2))
    print(
        f"{title:32} rms {rms:.5f} m/s  missed {missed}  invented {invented}  within one s.e. "
        f"{covered:.3f}   plain {plain_rms:.4f} m/s"
    )


def main() -> None:
    for noise_pm in (0.8, 8.0):
        constant = (
            drive([0, 60], v, seed, noise_pm) for seed, v in zip(SEEDS, CONSTANT, strict=False)
        )
        report(f"constant speed, {noise_pm} pm", constant)
        report(
            f"manoeuvres, {noise_pm} pm",
            (drive(*manoeuvres(seed), seed, noise_pm) for seed in SEEDS),
        )
    channel, *_ = drive([0, 600], [8, 22], 2100, 0.8)
    begun = time.process_time()
    for _ in range(COPIES):
        find_passages(channel, RADIUS_M)
    ours = time.process_time() - begun
    begun = time.process_time()
    for _ in range(COPIES):
        plain(channel)
    plainly = time.process_time() - begun
    samples = COPIES * channel.size / 1e6
    print(f"{samples:.0f} M samples: {ours:.2f} s of CPU ({samples / ours:.0f} M/s)")
    print(f"the plain way: {plainly:.2f} s ({samples / plainly:.0f} M/s)")


if __name__ == "__main__":
    main()
