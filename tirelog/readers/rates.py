"""What instruments call their sampling rate, wherever a file keeps it.

An attribute, a field, a variable beside the data.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

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


#: a rate or a period in words, and the number and unit behind it: "data_rate = 2000.0 Hz",
#: "Samples per Second<tab>1", "sampled at 1024", "Delta_X<tab>0.001"
_BEHIND = (
    r"\s*(?:[\[(][^\])]*[\])])?\s*(?:[A-Za-z ]{0,40}[:=]|\bis\b|\bof\b)?[\s,;]*"
    r"\"?(\d[\d.]*(?:,\d+)?(?:e[+-]?\d+)?)"
)
_IN_WORDS = (
    re.compile(
        r"(?:samples? per second|sampl\w*[ _]?(?:rate|freq(?:uency)?)|sampl(?:ed|ing) at"
        r"|(?:data|acquisition|output|scan|scanning|logging|update)[ _]?(?:rate|frequency|freq)"
        r"|(?<!baud )(?<!bit )(?<!heart )(?<![^\W_])rate\b|\bfs\b)"
        + _BEHIND
        + r"\s*(MHz|k?Hz|k?S/s)?",
        re.I,
    ),
    re.compile(
        r"(?:delta_x|\bdt\b|sampl\w*[ _](?:interval|period|time))"
        + _BEHIND
        + r"\s*(ns|us|µs|ms|s)?\b",
        re.I,
    ),
)
_FACTORS = {"mhz": 1e6, "khz": 1e3, "ks/s": 1e3, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}


def rate_in_words(lines: Iterable[str]) -> float | None:
    """The sampling rate [Hz] that the lines of a preamble tell, or None."""
    for line in lines:
        for pattern, is_period in zip(_IN_WORDS, (False, True), strict=True):
            if match := pattern.search(line):
                try:
                    number = float(match[1].replace(",", "."))
                except ValueError:
                    continue
                number *= _FACTORS.get((match[2] or "").lower(), 1.0)
                if (rate := rate_Hz(number, is_period)) is not None:
                    return rate
    return None


def unit_by_size(first: float | None) -> str:
    """The unit of a stamp without one, told by its size.

    A date in ms, us or ns since 1970 is known by its size, all else is seconds.
    """
    sizes = (("ns", 1e17), ("us", 1e14), ("ms", 1e11))
    return next((unit for unit, size in sizes if first is not None and first > size), "s")


def rate_Hz(value: float | None, is_period: bool) -> float | None:
    """The rate [Hz] that a number states, or None if it states none that is possible."""
    if value is None or not 1e-9 < value < 1e12:
        return None
    return 1.0 / value if is_period else value
