"""Stacks as a least-squares problem: weights, what a model predicts for them, and nuisances projected out.

Stack (n, m) --weights--> w = sqrt(count) / noise (0 where nothing was measured)
design(model, stack) -> prediction (n, m), jacobian (p, n, m), waveform and its slope by phi (n, m)
Nuisances: columns that are no physics of the model (an offset per log; per revolution: offset, amplitude, small shift)
`project` takes them out of weighted arrays, so that what is left is what the model must explain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tirelog.errors import ModelError
from tirelog.physics.carcass import SCALARS, WAVEFORMS
from tirelog.physics.model import Model
from tirelog.physics.spectral import FloatArray
from tirelog.recording import Stack

#: Nuisances per revolution.
NUISANCES = ("offset", "amplitude", "shift")


@dataclass(frozen=True)
class Design:
    """A model on a stack: prediction (n, m), its derivatives by `names` (p, n, m), and of the prediction the waveform without what is
    added to it and the waveform's slope by phi (n, m each)."""

    names: tuple[str, ...]
    prediction: FloatArray
    jacobian: FloatArray
    waveform: FloatArray
    slope: FloatArray


def observable_of(model: Model, stack: Stack) -> str:
    """What the model must predict for the stack; ModelError where it is a model for something else."""
    both_waves = model.observable in WAVEFORMS and stack.observable in WAVEFORMS
    if model.observable != stack.observable and not both_waves:
        raise ModelError(
            f"the model predicts {model.observable}, the channel {stack.channel!r} measures {stack.observable}; "
            f"the same observable (or two waveforms of one tire) is allowed; take another model or channel"
        )
    return stack.observable


def angles_of(stack: Stack) -> tuple[FloatArray | None, FloatArray | None]:
    """The angles at which the stack was measured, and their variance in each bin; none for a number per revolution."""
    return (None, None) if stack.observable in SCALARS else (stack.phi_mean, stack.phi_variance)


def weights(stack: Stack) -> FloatArray:
    """sqrt(count) / noise, (n, m), 0 where nothing was measured; a stack without a noise figure weighs all bins alike."""
    noise = np.where(np.isfinite(stack.noise) & (stack.noise > 0), stack.noise, np.nan)
    if np.isnan(noise).all():
        noise = np.full(len(stack), max(float(np.nanstd(stack.values)), 1e-30))
    noise = np.where(np.isnan(noise), np.nanmax(noise), noise)
    measured = np.isfinite(stack.values) & (stack.count > 0)
    if stack.observable not in SCALARS:
        measured &= np.isfinite(stack.phi_mean) & np.isfinite(stack.phi_variance)
    return np.where(measured, np.sqrt(np.maximum(stack.count, 0)) / noise[:, None], 0.0)


def design(model: Model, stack: Stack, names: Sequence[str] | None = None, values: Mapping[str, float] | None = None) -> Design:
    """The model on the stack's own angles and conditions; `names` by default the free parameters."""
    names = tuple(model.free if names is None else names)
    phi, variance = angles_of(stack)
    told = {"surface": stack.surface, "phi_variance": variance, "values": values, "observable": observable_of(model, stack)}
    wave, level, slope = model.parts(stack.conditions, phi, **told)  # type: ignore[arg-type]
    jacobian = model.jacobian(stack.conditions, phi, names, **told)  # type: ignore[arg-type]
    return Design(names, wave + level, jacobian, wave, slope)


def revolution_columns(weight: FloatArray, waveform: FloatArray, slope: FloatArray, kinds: Sequence[str]) -> FloatArray:
    """Weighted nuisance columns of each revolution, orthonormal, (n, m, len(kinds)): 1, the waveform, its slope."""
    shapes = {"offset": np.ones_like(waveform), "amplitude": waveform, "shift": slope}
    unknown = [kind for kind in kinds if kind not in shapes]
    if unknown:
        raise ModelError(f"unknown nuisance {unknown[0]!r}; allowed are {', '.join(NUISANCES)}; choose among them")
    columns = np.stack([np.where(weight > 0, weight * shapes[kind], 0.0) for kind in kinds], axis=-1)
    return np.linalg.qr(columns)[0]


def project(basis: FloatArray, weighted: FloatArray) -> FloatArray:
    """`weighted` (..., n, m) without its part along each revolution's orthonormal `basis` (n, m, k)."""
    return weighted - np.einsum("nmk,...nk->...nm", basis, np.einsum("nmk,...nm->...nk", basis, weighted))


def project_groups(weight: FloatArray, group: np.ndarray, weighted: FloatArray, basis: FloatArray | None = None) -> FloatArray:
    """`weighted` (..., n, m) without a constant per group of revolutions (an offset per log), `group` (n,) integers.

    With `basis`, the nuisances per revolution that have been projected out before, the constant's columns are projected alike."""
    column = weight if basis is None else project(basis, weight)
    _, label = np.unique(group, return_inverse=True)
    size = np.bincount(label, (column**2).sum(axis=1))
    along = (weighted * column).sum(axis=-1)
    flat = along.reshape(-1, along.shape[-1])
    total = np.stack([np.bincount(label, row) for row in flat]) / np.where(size > 0, size, 1.0)
    return weighted - (total[:, label].reshape(along.shape))[..., None] * column
