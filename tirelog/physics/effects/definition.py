"""An effect from the function that computes it: `@effect`, with its numbers by `number`.

    @effect(
        "gain",
        follows=(("temperature_K", 1),),
        needs=("temperature_K",),
        gain_1_K=number(0.0, -0.02, 0.02, "1/K", "a, relative change per kelvin", probe=1e-3),
    )
    def warm_gain(drive: Drive, *, gain_1_K: float) -> FloatArray:
        \"""A sensor whose gain follows the temperature, 1 + a dT.

        Signature: the whole waveform grows or shrinks with the temperature
        Valid: the straight part of a sensor's curve
        Source: data sheets of accelerometers and gauges

        What else a reader of the code should know; the catalogue does not repeat it.
        \"""
        return 1.0 + gain_1_K * drive.temperature_K

The function's name is the effect's id. The first paragraph of its docstring is the mechanism. A
text after a label goes on in lines that are indented.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from inspect import cleandoc, getfullargspec
from pkgutil import resolve_name
from typing import Any

from tirelog.errors import ModelError
from tirelog.physics.effects.base import ENTERS, Drive, Effect, Follows, Values
from tirelog.physics.spectral import Parameter

#: option -> the words that a model file may choose from
Options = Mapping[str, tuple[str, ...]]


def number(
    value: float,
    low: float,
    high: float,
    unit: str,
    description: str,
    *,
    probe: float | None = None,
    free: bool = True,
    prior: tuple[float, float] | None = None,
) -> Parameter:
    """A number of an effect, which gets its name from the keyword that it is given by.

    Its start value, bounds, unit and meaning. `probe` is the start value unless that is zero; the
    rest is as in `Parameter`.
    """
    typical = value if probe is None else probe
    return Parameter("", unit, description, value, low, high, typical, free, prior=prior)


@dataclass(frozen=True, eq=False)
class KeywordHook:
    """A hook of `Effect`, by a function that takes its values by keyword.

    `names` are the numbers and `options` that the function reads; `home` is where another process
    finds the hook: module:effect.hook.
    """

    function: Callable[..., Any]
    names: Sequence[str]
    options: Options
    home: str

    def __call__(self, v: Values, drive: Drive, *more: Any) -> Any:
        own = {
            name: self._word(v, name) if name in self.options else v[name] for name in self.names
        }
        return self.function(drive, *more, **own)

    def _word(self, v: Values, option: str) -> str:
        return next(word for word in self.options[option] if v[f"{option}:{word}"])

    def __reduce__(self) -> tuple[Callable[[str], Any], tuple[str]]:
        """How it goes to another process: there the function's name is the effect's."""
        return resolve_name, (self.home,)


def names_read(function: Callable[..., Any], known: Sequence[str]) -> Sequence[str]:
    """The numbers and options that a function takes by keyword; all that are known if it may."""
    spec = getfullargspec(function)
    return known if spec.varkw else spec.kwonlyargs


def texts_of(function: Callable[..., Any]) -> dict[str, str]:
    """What a function's docstring says of its effect: mechanism, signature, valid and source."""
    text = cleandoc(function.__doc__ or "")
    mechanism = " ".join(text.partition("\n\n")[0].split()).removesuffix(".")
    labelled = re.findall(r"^(Signature|Valid|Source): (.*(?:\n +.*)*)", text, re.MULTILINE)
    texts = {"mechanism": mechanism[:1].lower() + mechanism[1:]}
    texts |= dict.fromkeys(("signature", "valid", "source"), "")
    return texts | {label.lower(): " ".join(words.split()) for label, words in labelled}


def effect(
    hook: str, *, follows: Follows | str = (), strength: tuple[str, ...] | None = None, **given: Any
) -> Callable[[Callable[..., Any]], Effect]:
    """A decorator: the `Effect` whose `hook` the function computes.

    The function takes by place what the hook is given after the values (conditions, site, ...), and
    by keyword the numbers and options that it reads. `given` are the effect's numbers; functions of
    the same form for its other hooks, by the hook's name; and other fields of `Effect`. `strength`
    is, unless given, the free numbers that start at zero.
    """
    numbers = {
        name: replace(value, name=name)
        for name, value in given.items()
        if isinstance(value, Parameter)
    }
    fields = {name: value for name, value in given.items() if name not in numbers}
    options = fields.get("options", {})
    known = [*numbers, *options]
    if strength is None:
        strength = tuple(p.name for p in numbers.values() if p.value == 0.0 and p.free)

    def made(function: Callable[..., Any]) -> Effect:
        home = f"{function.__module__}:{function.__qualname__}"
        functions = {hook: function} | {name: fields[name] for name in ENTERS if name in fields}
        hooks = {
            name: KeywordHook(each, names_read(each, known), options, f"{home}.{name}")
            for name, each in functions.items()
        }
        read = {name for each in hooks.values() for name in each.names}
        if read != set(known):
            raise ModelError(
                f"effect {function.__name__}: its functions read {', '.join(sorted(read))}, its "
                f"numbers and options are {', '.join(known)}",
                allowed="each of these is read, and nothing else",
                do="correct the effect",
            )
        return Effect(
            id=function.__name__,
            follows=follows,
            acts_on=tuple(ENTERS[name][0].split()[0] for name in hooks),
            parameters=tuple(numbers.values()),
            strength=strength,
            **fields | hooks | texts_of(function),
        )

    return made
