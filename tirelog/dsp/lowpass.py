"""The cut-off of the footprint's zero-phase low-pass, as the user says it.

Its gain is in `derivatives`.

    "auto" | "400Hz" | "40x" --parse--> Cutoff
        --speed of each passage--> cut-off [Hz], shape (n,)

P2 used 400 Hz (and 300), "roughly 40 times the wheel frequency", chosen from the spectrum of the
log at rest; that multiple holds near 70 km/h only (errata), so the unit is part of the setting.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from tirelog.errors import UsageError
from tirelog.vocabulary.arrays import FloatArray


@dataclass(frozen=True)
class Cutoff:
    """A cut-off setting.

    `unit` 'Hz' (value in Hz), 'x' (multiples of the wheel frequency) or 'auto'.
    """

    unit: str = "auto"
    value: float = float("nan")

    @classmethod
    def parse(cls, text: str) -> Cutoff:
        """`text` as the command line has it.

        UsageError: neither auto nor a number with Hz or x.
        """
        if text.strip().lower() == "auto":
            return cls()
        found = re.fullmatch(
            r"\s*([0-9]*\.?[0-9]+(?:[eE][0-9]+)?)\s*(k?hz|x)\s*", text, re.IGNORECASE
        )
        if not found or float(found[1]) <= 0:
            raise UsageError(
                f"cut-off {text!r}",
                allowed="allowed are auto, hertz (400Hz) and multiples of the wheel frequency, "
                "as 40x",
                do="mend it",
            )
        unit = found[2].lower()
        return (
            cls("x", float(found[1]))
            if unit == "x"
            else cls("Hz", float(found[1]) * (1000.0 if unit == "khz" else 1.0))
        )

    def frequency(
        self, speed_m_s: FloatArray, radius_m: float, wave_number_1_m: float
    ) -> FloatArray:
        """The cut-off [Hz] at each speed.

        `wave_number_1_m` is what `auto` found in the log (a cut-off along the tread).
        """
        if self.unit == "Hz":
            return np.full(np.shape(speed_m_s), self.value)
        per_metre = wave_number_1_m if self.unit == "auto" else self.value / radius_m
        return np.abs(speed_m_s) * per_metre / (2.0 * np.pi)

    def __str__(self) -> str:
        return self.unit if self.unit == "auto" else f"{self.value:g}{self.unit}"
