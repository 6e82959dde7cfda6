"""What instruments call their sampling rate, wherever a file keeps it.

An attribute, a field, a variable beside the data.
"""

from __future__ import annotations

#: name -> True if the value is a period in seconds, False if it is a rate in Hz
RATES = {
    "sampling_rate_Hz": False,
    "sample_rate_Hz": False,
    "sampling_rate": False,
    "sampling_frequency": False,
    "sample_rate": False,
    "SampleRate": False,
    "samplingrate": False,
    "sampling_freq": False,
    "fs": False,
    "rate": False,
    "dt": True,
    "wf_increment": True,
    "wf_dt": True,
    "sampling_interval": True,
    "sample_interval": True,
    "sampling_period": True,
    "sampling_period_s": True,
    "dt_s": True,
}


def rate_Hz(value: float | None, is_period: bool) -> float | None:
    """The rate [Hz] that a number states, or None if it states none that is possible."""
    if value is None or not 1e-9 < value < 1e12:
        return None
    return 1.0 / value if is_period else value
