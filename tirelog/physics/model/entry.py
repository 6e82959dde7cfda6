"""An effect as it stands in a model, with its own numbers and options."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.physics.effects import Effect
from tirelog.physics.parameters import Parameter


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
