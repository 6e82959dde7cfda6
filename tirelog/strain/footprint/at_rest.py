"""The cut-off of the footprint's low-pass from the log at rest (P2 4.3).

    strain at a standstill, strain while rolling --spectra--> frequency above which rolling holds no
                                                              more than the standstill does

P2 chose its 400 Hz so. A log that never stands has no such cut-off.
"""

from __future__ import annotations

import numpy as np

from tirelog.data.recording import Channel
from tirelog.errors import UsageError
from tirelog.strain.passages.find import Passages
from tirelog.vocabulary.arrays import FloatArray

#: samples of a spectrum: some 5 Hz apart at 2.5 kHz; twice as many need twice the standstill
WINDOW = 512
#: rolling holds signal where its spectrum is above this many times that at rest; doubled, the
#: cut-off comes some 5 % lower, as strain falls as a high power of the frequency
ABOVE = 2.0
#: the share of a stretch without passages that is taken as rest, the middle or the outer one: what
#: is next to a passage may still roll; with all of it, the first and last turn of the wheel are in
#: the noise at rest
REST_SHARE = 0.5
#: windows of either kind, evenly over the log, that a spectrum is the mean of at most; 400 tell a
#: spectrum to 5 %, twice as many to 3.5 %, in twice the time
_MOST_WINDOWS = 400


def cutoff_at_rest(channel: Channel, passages: Passages) -> float:
    """The cut-off [Hz].  UsageError: the log does not stand still for WINDOW samples."""
    time = np.asarray(passages.time_s, float)
    ends = float(channel.axis.at(0.0)), float(channel.axis.at(float(channel.size - 1)))
    edges = np.concatenate([[ends[0]], time, [ends[1]]])
    i = int(np.argmax(np.diff(edges)))
    low, high = edges[i], edges[i + 1]
    keep = REST_SHARE * (high - low)
    start = low if i == 0 else high - keep if i == time.size else low + 0.5 * (high - low - keep)
    rest = _windows(channel, start, start + keep)
    rolling = _windows(channel, time[0], time[-1]) if time.size > 1 else np.zeros((0, WINDOW))
    if not len(rest) or not len(rolling):
        raise UsageError(
            f"--cutoff rest: channel {channel.name} does not stand still for "
            f"{WINDOW / channel.axis.rate_Hz / REST_SHARE:.2g} s before, between or after passages",
            allowed="allowed are auto, hertz (400Hz) and multiples of the wheel frequency (40x)",
            do="give one of them, or a log with a standstill",
        )
    return cutoff_between(rest, rolling, channel.axis.rate_Hz)


def _windows(channel: Channel, start_s: float, stop_s: float) -> FloatArray:
    """Gapless windows of a stretch, (n, WINDOW), evenly over it if there are many."""
    first, last = (int(channel.axis.index(t)) for t in (start_s, stop_s))
    begins = np.arange(first, last - WINDOW + 1, WINDOW)
    if begins.size > _MOST_WINDOWS:
        begins = begins[np.linspace(0, begins.size - 1, _MOST_WINDOWS).astype(int)]
    rows = [np.asarray(channel.read(int(b), int(b) + WINDOW), float) for b in begins]
    whole = [row for row in rows if row.size == WINDOW and np.isfinite(row).all()]
    return np.array(whole).reshape(-1, WINDOW)


def cutoff_between(rest: FloatArray, rolling: FloatArray, rate_Hz: float) -> float:
    """The frequency [Hz] above which `rolling`, windows (m, WINDOW), is no more than `rest`."""
    quiet, loud = _spectrum(rest), _spectrum(rolling)
    above = np.flatnonzero(loud > ABOVE * quiet)
    last = int(above[-1]) + 1 if above.size else 1
    return float(min(last, WINDOW // 2 - 1) * rate_Hz / WINDOW)


def _spectrum(windows: FloatArray) -> FloatArray:
    """Mean power of the windows, Hann, and the median of nine neighbouring frequencies."""
    taper = np.hanning(WINDOW)
    lifted = (windows - windows.mean(axis=1, keepdims=True)) * taper
    power = (np.abs(np.fft.rfft(lifted, axis=1)) ** 2).mean(axis=0)
    padded = np.pad(power, 4, mode="edge")
    return np.asarray(
        np.median(np.lib.stride_tricks.sliding_window_view(padded, 9), axis=1), np.float64
    )
