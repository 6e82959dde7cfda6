"""A number of a model: value, bounds, unit, and whether a fit may move it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from tirelog.errors import ModelError


@dataclass(frozen=True)
class Parameter:
    """One number of a model.

    `value` in `unit`, allowed within [min, max]; `free` says whether a fit moves it; `probe` is a
    typical size (not zero), used for steps, for plots and as a second start; `se` the standard
    error of the last fit, and `se_with_form` what it may be off by if the tire has a form of its
    own; `prior` mean and standard deviation before any data, if it has them.
    """

    name: str
    unit: str
    description: str
    value: float
    min: float
    max: float
    probe: float
    free: bool = True
    se: float | None = None
    se_with_form: float | None = None
    prior: tuple[float, float] | None = None

    def at(self, value: float | str, *, se: float | None = None) -> Parameter:
        """The same parameter with another value.

        ModelError if it is not a number within the bounds.
        """
        if isinstance(value, str):
            raise ModelError(f"{self.name} = {value}", allowed="a number is allowed", do="give one")
        return replace(self, value=float(value), se=se, se_with_form=None).checked()

    def within(self, minimum: float, maximum: float) -> Parameter:
        """The same parameter with other bounds."""
        return replace(self, min=float(minimum), max=float(maximum)).checked()

    def fixed(self) -> Parameter:
        """The same parameter, not moved by a fit."""
        return replace(self, free=False)

    def checked(self, label: str | None = None) -> Parameter:
        """Itself; ModelError if value and bounds contradict each other."""
        label = label or self.name
        if not (self.min < self.max and all(map(math.isfinite, (self.value, self.min, self.max)))):
            raise ModelError(
                f"{label}: value {self.value:g}, bounds [{self.min:g}, {self.max:g}] are no "
                "number in an interval",
                allowed="finite numbers with min < max are allowed",
                do="correct the parameter",
            )
        if not self.min <= self.value <= self.max:
            raise ModelError(
                f"{label} = {self.value:g} {self.unit} lies outside its bounds",
                allowed=f"allowed is [{self.min:g}, {self.max:g}]",
                do="change the value or give wider min and max",
            )
        return self
