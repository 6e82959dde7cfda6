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
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from inspect import cleandoc, getfullargspec
from typing import Any

from tirelog.errors import ModelError
from tirelog.physics.effects.base import ENTERS, Drive, Effect, Follows, Values
from tirelog.physics.parameters import Parameter

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
    if strength is None:
        strength = tuple(p.name for p in numbers.values() if p.value == 0.0 and p.free)

    def made(function: Callable[..., Any]) -> Effect:
        functions = {hook: function} | {name: fields[name] for name in ENTERS if name in fields}
        read = {name for each in functions.values() for name in names_read(each, numbers, options)}
        if read != {*numbers, *options}:
            raise ModelError(
                f"effect {function.__name__}: its functions read {', '.join(sorted(read))}, its "
                f"numbers and options are {', '.join([*numbers, *options])}",
                allowed="each of these is read, and nothing else",
                do="correct the effect",
            )
        text = cleandoc(function.__doc__ or "")
        mechanism = " ".join(text.partition("\n\n")[0].split()).removesuffix(".")
        labels = dict(re.findall(r"^(Signature|Valid|Source): (.*(?:\n +.*)*)", text, re.MULTILINE))
        said = {label: " ".join(words.split()) for label, words in labels.items()}
        hooks = {name: hook_of(each, numbers, options) for name, each in functions.items()}
        return Effect(
            id=function.__name__,
            mechanism=mechanism[:1].lower() + mechanism[1:],
            follows=follows,
            acts_on=tuple(ENTERS[name][0].split()[0] for name in functions),
            parameters=tuple(numbers.values()),
            strength=strength,
            source=said.get("Source", ""),
            valid=said.get("Valid", ""),
            signature=said.get("Signature", ""),
            **fields | hooks,
        )

    return made


def names_read(
    function: Callable[..., Any], numbers: Iterable[str], options: Options
) -> Sequence[str]:
    """The numbers and options that a function takes by keyword; all of them if it takes any."""
    spec = getfullargspec(function)
    return [*numbers, *options] if spec.varkw else spec.kwonlyargs


def hook_of(
    function: Callable[..., Any], numbers: Iterable[str], options: Options
) -> Callable[..., Any]:
    """A function of values by keyword as a hook of `Effect`, which takes them as one mapping."""
    read = names_read(function, numbers, options)
    names = [name for name in read if name not in options]
    choices = {name: options[name] for name in read if name in options}

    def computed(v: Values, drive: Drive, *more: Any) -> Any:
        own: dict[str, Any] = {name: v[name] for name in names}
        for option, words in choices.items():
            own[option] = next(word for word in words if v[f"{option}:{word}"])
        return function(drive, *more, **own)

    return computed
