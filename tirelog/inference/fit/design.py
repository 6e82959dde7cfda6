"""A model on a stack: what it predicts there, its derivatives, and the waveform's own parts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from tirelog.data.recording import Stack
from tirelog.errors import ModelError
from tirelog.physics.model.model import Model
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import SCALARS, WAVEFORMS


@dataclass(frozen=True)
class Design:
    """A model on a stack: prediction (n, m), its derivatives by `names` (p, n, m), and of the
    prediction the waveform without what is added to it and the waveform's slope by phi (n, m each).
    """

    names: tuple[str, ...]
    prediction: FloatArray
    jacobian: FloatArray
    waveform: FloatArray
    slope: FloatArray


def observable_of(model: Model, stack: Stack) -> str:
    """What the model must predict for the stack; ModelError if it is a model for something else."""
    both_waves = model.observable in WAVEFORMS and stack.observable in WAVEFORMS
    if model.observable != stack.observable and not both_waves:
        raise ModelError(
            f"the model predicts {model.observable}, the channel {stack.channel!r} measures "
            f"{stack.observable}; "
            "the same observable (or two waveforms of one tire) is allowed; take another model "
            "or channel"
        )
    return stack.observable


def angles_of(stack: Stack) -> tuple[FloatArray | None, FloatArray | None]:
    """The angles at which the stack was measured, and their variance in each bin; none for a number
    per revolution.
    """
    return (None, None) if stack.observable in SCALARS else (stack.phi_mean, stack.phi_variance)


def parts_on(
    model: Model, stack: Stack, values: Mapping[str, float] | None = None, *, slope: bool = False
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`Model.parts` on the stack's own angles and conditions."""
    phi, variance = angles_of(stack)
    observable = observable_of(model, stack)
    return model.parts(
        stack.conditions,
        phi,
        surface=stack.surface,
        phi_variance=variance,
        values=values,
        observable=observable,
        slope=slope,
    )


def slopes_on(
    model: Model, stack: Stack, names: Sequence[str], values: Mapping[str, float] | None = None
) -> FloatArray:
    """`Model.jacobian` on the stack's own angles and conditions."""
    phi, variance = angles_of(stack)
    observable = observable_of(model, stack)
    return model.jacobian(
        stack.conditions,
        phi,
        names,
        surface=stack.surface,
        phi_variance=variance,
        values=values,
        observable=observable,
    )


def load_slope_on(
    model: Model, stack: Stack, values: Mapping[str, float] | None = None
) -> FloatArray:
    """`Model.load_slope` on the stack's own angles and conditions."""
    phi, variance = angles_of(stack)
    observable = observable_of(model, stack)
    return model.load_slope(
        stack.conditions,
        phi,
        surface=stack.surface,
        phi_variance=variance,
        values=values,
        observable=observable,
    )


def load_bend_on(
    model: Model, stack: Stack, share: FloatArray, by_load: FloatArray, values: Mapping[str, float]
) -> FloatArray:
    """What a load that is higher by `share` (n,) of itself adds to the prediction beyond share x
    `by_load`, (n, m).
    """
    higher = replace(stack, conditions=model.loaded(stack.conditions, 1.0 + share, values))
    (wave, level, _), (usual, at_rest, _) = (
        parts_on(model, higher, values),
        parts_on(model, stack, values),
    )
    return (wave + level) - (usual + at_rest) - share[:, None] * by_load


def design(
    model: Model,
    stack: Stack,
    names: Sequence[str] | None = None,
    values: Mapping[str, float] | None = None,
) -> Design:
    """The model on the stack; `names` by default the free parameters."""
    names = tuple(model.free if names is None else names)
    wave, level, slope = parts_on(model, stack, values, slope=True)
    return Design(names, wave + level, slopes_on(model, stack, names, values), wave, slope)
