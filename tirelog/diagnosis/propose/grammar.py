"""The forms that are tried, as data: frame x profile x stage x law.

A frame gives a coordinate u in the language of a model file. A profile is a formula of u. A stage
is the place where it acts. A law is how it grows. One line more is one form more. The grammar
carries units: a test refuses what is dimensionally wrong.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from tirelog.physics.model.user_effects import FROM_EXIT_M, TO_ENTRY_M
from tirelog.vocabulary.arrays import FloatArray


@dataclass(frozen=True)
class FormFrame:
    """A coordinate u in which a form keeps its place.

    `text` and `unit` of u; `offset` the text of u - at; `side`: "round" (the wheel's angle), "both"
    (to both sides of the patch), "one" (from an edge on), "gated" (likewise, u > 0 being asked).
    Scanned values: `widths` [unit], `places` [unit], `rates` [1/unit].
    """

    name: str
    words: str
    text: str
    unit: str
    side: str
    widths: FloatArray
    places: FloatArray
    rates: FloatArray = field(default_factory=lambda: np.zeros(0))
    offset: str = "({u} - at)"


FRAMES: tuple[FormFrame, ...] = (
    FormFrame("wheel_angle", "at a place of the wheel", "phi", "rad", "round",
              np.deg2rad([3.0, 6.0, 12.0, 24.0, 45.0]), np.deg2rad(np.arange(-180.0, 180.0, 6.0)),
              offset="((phi - at + pi) % (2 * pi) - pi)"),
    FormFrame("patch", "along the patch (xi / L)", "(xi / L)", "1", "both",
              np.geomspace(0.1, 5.0, 9), np.linspace(-3.0, 3.0, 25)),
    FormFrame("tread", "along the tread about the patch centre", "xi", "m", "both",
              np.geomspace(0.02, 0.5, 8), np.linspace(0.02, 0.86, 22)),
    FormFrame("time_since_exit", "in the time since the exit edge", f"({FROM_EXIT_M} / speed)", "s",
              "one", np.geomspace(0.0015, 0.08, 8), np.linspace(0.002, 0.04, 20),
              np.geomspace(25.0, 420.0, 36)),
    FormFrame("distance_since_exit", "in the distance since the exit edge", FROM_EXIT_M, "m", "one",
              np.geomspace(0.015, 0.6, 8), np.linspace(0.03, 0.51, 17),
              np.geomspace(1.4, 20.0, 28)),
    FormFrame("time_before_entry", "in the time before the entry edge", f"({TO_ENTRY_M} / speed)",
              "s", "one", np.geomspace(0.0015, 0.08, 5), np.linspace(0.004, 0.04, 10),
              np.geomspace(25.0, 420.0, 18)),
    FormFrame("distance_before_entry", "in the distance before the entry edge", TO_ENTRY_M, "m",
              "one", np.geomspace(0.015, 0.6, 5), np.linspace(0.06, 0.5, 8),
              np.geomspace(1.4, 20.0, 14)),
    FormFrame("after_exit", "behind the exit edge, in half lengths of the patch", "((xi - L) / L)",
              "1", "gated", np.geomspace(0.1, 0.8, 4), np.linspace(0.0, 1.0, 2)),
    FormFrame("before_entry", "ahead of the entry edge, in half lengths of the patch",
              "((-L - xi) / L)", "1", "gated", np.geomspace(0.1, 0.8, 4), np.linspace(0.0, 1.0, 2)),
    FormFrame("none", "all around", "1", "1", "none", np.ones(1), np.ones(2)),
)  # fmt: skip


@dataclass(frozen=True)
class Profile:
    """A form along a coordinate.

    `text` of u, of d = u - at, and of its numbers: name -> role (width, place, rate). `@(x)` is
    a wave of free phase. `sides`, `stages` that it is for; every `each`-th width is scanned;
    `complexity` counts what a reader has to take in.
    """

    name: str
    text: str
    numbers: Mapping[str, str]
    sides: tuple[str, ...]
    complexity: int
    each: int = 1
    stages: tuple[str, ...] = ("waveform",)
    frames: tuple[str, ...] = ()


_BUMP = {"at": "place", "width": "width"}
_BOTH_STAGES = ("waveform", "contact_pressure")
PROFILES: tuple[Profile, ...] = (
    Profile("bump", "exp(-(d / width) ** 2 / 2)", _BUMP, ("round", "one"), 3),
    Profile("bump", "exp(-(d / width) ** 2 / 2)", _BUMP, ("both",), 3, 2, frames=("patch",)),
    Profile("bump", "exp(-(d / width) ** 2 / 2)", _BUMP, ("both",), 3, 3, ("contact_pressure",),
            ("patch",)),
    Profile("two flanks", "exp(-((abs(u) - at) / width) ** 2 / 2)", _BUMP, ("both",), 3, 2,
            frames=("tread",)),
    Profile("flanks from zero", "(u / width) ** 2 * exp(1 - (u / width) ** 2)",
            {"width": "width"}, ("both",), 2),
    Profile("odd wave", "u / width * exp(0.5 - (u / width) ** 2 / 2)", {"width": "width"},
            ("both",), 2),
    Profile("decay", "exp(-u / decay)", {"decay": "width"}, ("one",), 2),
    Profile("pulse", "u / decay * exp(1 - u / decay)", {"decay": "width"}, ("one",), 2),
    Profile("ringing", "exp(-u / decay) * @(2 * pi * f * u)", {"decay": "width", "f": "rate"},
            ("one",), 4, 2),
    *(Profile(f"wheel harmonic {n}", f"@({n} * u)", {}, ("round",), 2) for n in range(1, 7)),
    *(Profile(f"power {n} within the patch", f"u ** {n} * (abs(u) < 1)", {}, ("both",), 1, 1,
              _BOTH_STAGES, ("patch",)) for n in (1, 2, 3, 4)),
    *(Profile(f"parabola times power {n}", f"(1 - u ** 2) * u ** {n} * (abs(u) < 1)", {}, ("both",),
              1, 1, ("contact_pressure",), ("patch",)) for n in (1, 2, 3, 4)),
    Profile("decay", "exp(-abs(u) / decay) * (u > 0)", {"decay": "width"}, ("gated",), 2, 1,
            ("contact_pressure",)),
    Profile("pulse", "abs(u) / decay * exp(1 - abs(u) / decay) * (u > 0)", {"decay": "width"},
            ("gated",), 2, 1, ("contact_pressure",)),
    Profile("the same everywhere", "1", {}, ("none",), 0, 1,
            ("baseline", "load", "foundation_stiffness", "sensor")),
)  # fmt: skip


@dataclass(frozen=True)
class Stage:
    """A place where a form acts.

    `acts_on` in a model file ("" for the observable itself); `unit` of the amplitude ("" for the
    observable's); `prefix` of the formula; `probe` an amplitude that is small there.
    """

    name: str
    words: str
    acts_on: str
    unit: str
    prefix: str = ""
    probe: float = 0.01


STAGES: Mapping[str, Stage] = {
    stage.name: stage
    for stage in (
        Stage("waveform", "the waveform itself", "", ""),
        Stage("contact_pressure", "the contact pressure", "contact_pressure", "1",
              "load / (2 * L) * ", 0.02),
        Stage("baseline", "the baseline", "baseline", "", probe=1e-6),
        Stage("load", "the load", "load", "N", probe=20.0),
        Stage("foundation_stiffness", "the foundation's stiffness", "foundation_stiffness",
              "N/m^2", probe=1e4),
        Stage("sensor", "the sensor's gain", "sensor", "1"),
    )
}  # fmt: skip


@dataclass(frozen=True)
class Law:
    """How a form grows with what a revolution is driven under.

    `text`, with {name} for a typical value of a condition; `scanned` values of its numbers;
    `varies`: conditions that must vary in the data, or it says nothing; its `numbers`, if given.
    """

    text: str
    scanned: Mapping[str, tuple[float, ...]]
    varies: tuple[str, ...] = ()
    complexity: int = 1
    numbers: Mapping[str, float] = field(default_factory=dict)

    def written(self, free: Sequence[str] = ()) -> str:
        """The law as a formula has it: what is not `free` as a plain number, 1 left out."""
        factors = []
        for factor in self.text.split(" * "):
            base, _, power = factor.partition(" ** ")
            value = 1.0 if not power else self.numbers[power]
            if power in free:
                factors.append(factor)
            elif value != 0.0:
                factors.append(base if value == 1.0 else f"{base} ** {value:g}")
        text = " * ".join(factors)
        for name, value in self.numbers.items():
            if name not in (*EXPONENTS, *free):
                text = re.sub(rf"\b{name}\b", f"{value:.6g}", text)
        return text


#: exponents at which laws are scanned, of the speed alone and beside another quantity; the polish
#: moves them between, and grids twice as fine take twice as long
_SPEEDS = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0)
_FEW = (0.0, 1.0, 2.0)
LAWS: tuple[Law, ...] = (
    Law("(speed / 20) ** n", {"n": _SPEEDS}),
    Law("(acceleration / 9.81) * (speed / 20) ** n", {"n": _FEW}, ("acceleration",)),
    Law("abs(acceleration / 9.81) * (speed / 20) ** n", {"n": _FEW}, ("acceleration",), 2),
    Law("(load / {load}) ** m * (speed / 20) ** n", {"m": (-1.0, 1.0, 2.0), "n": _FEW}, ("load",)),
    Law("(1 - exp(-time / tau)) * (speed / 20) ** n", {"tau": (8.0, 25.0, 80.0), "n": (0.0, 1.0)},
        (), 2),
    Law("(temperature / {temperature}) * (speed / 20) ** n", {"n": (0.0, 1.0)}, ("temperature",)),
    Law("(distance / {distance}) * (speed / 20) ** n", {"n": (0.0, 1.0)}, ("distance",)),
    Law("(water / {water}) * (speed / 20) ** n", {"n": _FEW}, ("water",)),
    Law("(pressure / {pressure}) ** m * (speed / 20) ** n", {"m": (-1.0, 1.0), "n": (0.0, 1.0)},
        ("pressure",)),
)  # fmt: skip
#: where the numbers of a law may go, and their units; twice as far lets a descent run on where no
#: log says more
LAW_BOUNDS: Mapping[str, tuple[float, float]] = {
    "n": (-1.0, 5.0),
    "m": (-3.0, 4.0),
    "tau": (2.0, 300.0),
}
LAW_UNITS: Mapping[str, str] = {"n": "1", "m": "1", "tau": "s"}
#: numbers that are rounded to halves if that costs nothing
EXPONENTS = ("n", "m")


@dataclass(frozen=True)
class Form:
    """A profile in a frame at a stage: a formula without its law."""

    frame: FormFrame
    profile: Profile
    stage: Stage

    @property
    def text(self) -> str:
        """The formula over places and its own numbers."""
        text = re.sub(r"\bd\b", self.frame.offset.format(u=self.frame.text), self.profile.text)
        return re.sub(r"\bu\b", self.frame.text, text)

    @property
    def words(self) -> str:
        return f"{self.profile.name} {self.frame.words}".replace("everywhere all", "all")

    @property
    def wave(self) -> bool:
        """Is it a wave of free phase: two columns?"""
        return "@(" in self.profile.text

    def grids(self, most: int) -> Iterator[dict[str, FloatArray]]:
        """Scanned values of each number, (S,), for each combination; at `most` so many at once."""
        frame, widths = self.frame, self.frame.widths[:: self.profile.each]
        values = {"width": widths, "place": frame.places, "rate": frame.rates}
        combined = list(product(*(values[role] for role in self.profile.numbers.values())))
        for start in range(0, len(combined), most):
            columns = np.array(combined[start : start + most], dtype=np.float64).T
            yield dict(zip(self.profile.numbers, columns, strict=True))

    def bounds(self, name: str) -> tuple[float, float]:
        """Where a polished or fitted number may go, by its role."""
        role, frame = self.profile.numbers[name], self.frame
        if role == "width":
            return 0.2 * float(frame.widths[0]), 4.0 * float(frame.widths[-1])
        if role == "rate":
            return 0.3 * float(frame.rates[0]), 3.0 * float(frame.rates[-1])
        first, last = float(frame.places[0]), float(frame.places[-1])
        reach = 0.5 * float(np.ptp(frame.places))
        return 0.0 if frame.side in ("one", "gated") else first - reach, last + reach

    def unit(self, name: str) -> str:
        """The unit of one of its numbers."""
        if self.profile.numbers[name] != "rate":
            return self.frame.unit
        return {"s": "Hz", "m": "1/m"}.get(self.frame.unit, f"1/{self.frame.unit}")


def forms() -> Iterator[Form]:
    """Every form of the grammar, the most general stage first."""
    for stage, frame, profile in product(STAGES.values(), FRAMES, PROFILES):
        if (
            frame.side in profile.sides
            and stage.name in profile.stages
            and frame.name in (profile.frames or (frame.name,))
            and (stage.name, frame.name) != ("contact_pressure", "tread")
        ):
            yield Form(frame, profile, stage)


def laws(typical: Mapping[str, float]) -> list[Law]:
    """The laws over conditions that vary, with numbers: `typical` has a value of each by symbol."""
    values = {name: f"{value:.4g}" for name, value in typical.items()}
    return [
        replace(
            law,
            text=law.text.format(**values),
            numbers=dict(zip(law.scanned, numbers, strict=True)),
        )
        for law in LAWS
        if set(law.varies) <= values.keys()
        for numbers in product(*law.scanned.values())
    ]
