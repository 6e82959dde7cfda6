"""What a wheel, its road and the day do beside the tire's physics: words and sizes.

A model file's [nuisances] says of each whether it stands beside the model ("on"), never does
("off"), or does if it earns its place ("auto", the default), and how large it ordinarily is. A size
is the standard deviation of an amplitude before anything is measured, not a bound. The tire's form
has a table of its own, [form], with its numbers once they are fitted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.data.setup import FORM_PRESSURE, FORM_STIFFNESS
from tirelog.physics.effects import Effect
from tirelog.physics.spectral import Parameter

# ---- An effect as it stands in a model, with its own numbers and options.


@dataclass(frozen=True)
class ModelEffect:
    """An effect as it stands in a model, with its numbers and options.

    `source` keeps a user's own words (expression, acts_on).
    """

    effect: Effect
    parameters: tuple[Parameter, ...]
    options: Mapping[str, str] = field(default_factory=dict)
    source: Mapping[str, Any] = field(default_factory=dict)

    @property
    def id(self) -> str:
        return self.effect.id

    @classmethod
    def of(cls, effect: Effect) -> ModelEffect:
        """The effect with its start values."""
        return cls(
            effect, effect.parameters, {name: words[0] for name, words in effect.options.items()}
        )

    def values(self, flat: Mapping[str, float]) -> dict[str, float]:
        """Its own values out of the model's, with its options as `option:word` switches."""
        own = {p.name: flat[f"{self.id}.{p.name}"] for p in self.parameters}
        for name, words in self.effect.options.items():
            own |= {f"{name}:{word}": float(self.options[name] == word) for word in words}
        return own

    def resolved(self, conditions: Conditions) -> ModelEffect:
        """The entry with `driver = "auto"` settled.

        The driver is temperature if every revolution knows it and it varies, else time.
        """
        if self.options.get("driver") != "auto":
            return self
        varies = (
            conditions.known("temperature_K")
            and len(conditions) > 0
            and np.ptp(conditions.temperature_K) > 0.0
        )
        return replace(
            self, options={**self.options, "driver": "temperature" if varies else "time"}
        )


#: what a model file may say of a nuisance
USES = ("auto", "on", "off")
#: the nuisance that puts an effect of its name into the model
FORM = "form"


@dataclass(frozen=True)
class Nuisance:
    """One nuisance as it stands in a model: its use, one of USES, and its sizes."""

    name: str
    description: str
    sizes: tuple[Parameter, ...]
    use: str = "auto"

    def size(self, name: str) -> float:
        """The value of one of its sizes."""
        return next(size.value for size in self.sizes if size.name == name)

    def used(self, use: str) -> Nuisance:
        """The same nuisance with another use."""
        return replace(self, use=use)


def _size(name: str, unit: str, description: str, value: float, high: float) -> Parameter:
    return Parameter(name, unit, description, value, 1e-9, high, probe=value, free=False)


#: every nuisance with its ordinary sizes.  The force variation is 50 to 100 N peak to peak of a
#: passenger tire; 20 K warm a closed tire's gas by 7 %; a rolling radius is known to 1 or 2 %.
#: A size twice as large gives a nuisance more of what it shares with an effect, and costs power
NUISANCES = (
    Nuisance(
        "wheel",
        "run-out and force variation at harmonics 1 to 3 of the wheel",
        (
            _size("run_out", "strain", "strain at one harmonic", 3e-5, 1e-2),
            _size("force", "1", "force variation at one harmonic over the load", 0.01, 0.5),
        ),
    ),
    Nuisance(
        "drift",
        "patch length, stiffnesses and baseline move along a log",
        (
            _size("relative", "1", "change of a length or stiffness along a log", 0.03, 1.0),
            _size("baseline", "1", "change of the baseline over the waveform's rms", 0.1, 10.0),
        ),
    ),
    Nuisance(
        "rolling",
        "the rolling radius is not the setup's, and follows speed and load",
        (_size("radius", "1", "relative error; its change up to 25 m/s", 0.02, 0.5),),
    ),
    Nuisance(
        "patch_law",
        "the patch grows with another power of the load",
        (_size("exponent", "1", "error of the exponent", 0.2, 2.0),),
    ),
    Nuisance(
        "pressure_law",
        "the patch shrinks with another power of the inflation pressure",
        (_size("exponent", "1", "error of the exponent", 0.3, 2.0),),
    ),
    Nuisance(
        FORM,
        "contact pressure and stiffness of the tire that no formula describes",
        (
            _size(
                "pressure",
                "1",
                "a shape of the pressure over the mean pressure",
                FORM_PRESSURE,
                3.0,
            ),
            _size("stiffness", "1", "change of the stiffness at a wavelength", FORM_STIFFNESS, 2.0),
        ),
    ),
)
BY_NAME = {nuisance.name: nuisance for nuisance in NUISANCES}
