"""Free shapes over the angle: what a form that is somewhat wrong could leave of an effect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tirelog.errors import ModelError
from tirelog.inference.base import Base, TogetherBase, apart, change_to
from tirelog.inference.cells.together import embedded
from tirelog.vocabulary.arrays import FloatArray

#: nodes of free shapes over the wheel's angle [rad]: 3 degrees apart about the patch, 10 beyond;
#: half as many lose the edges of the patch, twice as many measure noise
ANGLES = np.r_[-180:-60:10.0, -60:60:3.0, 60:181:10.0] * (np.pi / 180.0)
#: share of a contribution's energy that makes it even, or odd: the other part is a quarter as large
#: at most; with twice the rest, a third
_SYMMETRIC = 0.95


def hats_on(x: FloatArray, nodes: FloatArray, period: float | None = None) -> FloatArray:
    """Linear B-splines on nodes (k,), at x (...): (..., k); nothing outside the nodes."""
    if period is not None:
        x = (x - nodes[0]) % period + nodes[0]
    out = np.zeros((*x.shape, nodes.size))
    inside = (x >= nodes[0]) & (x <= nodes[-1])
    i = np.clip(np.searchsorted(nodes, x, side="right") - 1, 0, nodes.size - 2)
    share = (x - nodes[i]) / (nodes[i + 1] - nodes[i])
    np.put_along_axis(out, i[..., None], np.where(inside, 1.0 - share, 0.0)[..., None], -1)
    np.put_along_axis(out, (i + 1)[..., None], np.where(inside, share, 0.0)[..., None], -1)
    return out


def hats(phi: FloatArray) -> FloatArray:
    """Free shapes over the angle, (C, m) to (C, m, k): hats all around the wheel."""
    found = hats_on(np.nan_to_num(phi), ANGLES, 2.0 * np.pi)
    found[..., 0] += found[..., -1]  # half a turn before the patch and after it are one place
    return found[..., :-1]


def freedom_of_shape(base: Base, effect_id: str) -> FloatArray:
    """Columns (C, m, k): an effect's size per cell times free shapes over the angle.

    A form that is somewhat wrong keeps its symmetry: if the effect's own contribution is even
    (or odd) about the patch centre, so are the shapes.
    """
    if isinstance(base, TogetherBase):
        each = [
            embedded(base.cells, i, freedom_of_shape(part, effect_id))
            for i, part in enumerate(apart(base))
            if _acts_in(part, effect_id)
        ]
        if all(part.cells.member for part in apart(base)):  # the tire's shape is one to all
            return np.asarray(sum(each), dtype=np.float64)
        return np.concatenate(each, axis=-1)
    weight = base.plain.weights
    contribution = np.nan_to_num(_contribution(base, effect_id)) * weight
    size, strength, shape = np.linalg.svd(contribution, full_matrices=False)
    loading = size[:, 0] * strength[0] / np.maximum(weight.max(axis=1), 1e-300)
    phi = base.cells.phi
    here = hats(phi)
    even = even_share(shape[0], np.nanmean(phi, axis=0))
    if even > _SYMMETRIC:
        here += hats(-phi)
    elif even < 1.0 - _SYMMETRIC:
        here -= hats(-phi)
    if not 1.0 - _SYMMETRIC <= even <= _SYMMETRIC:
        here = _independent(here)
    columns: FloatArray = loading[:, None, None] * here
    columns /= max(float(np.abs(loading).max()), 1e-300)
    return columns


def _contribution(base: Base, effect_id: str) -> FloatArray:
    """What an effect of the fitted model adds, (C, m); its tangent if nothing holds without it."""
    others = tuple(e for e in base.model.effects if e.id != effect_id)
    lost = change_to(base, replace(base.model, effects=others))
    if not isinstance(lost, ModelError):
        return -lost
    (own,) = (e for e in base.model.effects if e.id == effect_id)
    strengths = [f"{effect_id}.{name}" for name in own.effect.strength]
    values = [base.model.values[n] * (n in strengths) for n in base.fit.names]
    return np.asarray(base.fit.jacobian @ np.array(values))


def _acts_in(part: Base, effect_id: str) -> bool:
    """Does an effect of the model act on this observable?"""
    held = [entry.effect for entry in part.model.effects]
    return any(e.id == effect_id and part.model.acts_on(e, part.cells.observable) for e in held)


def even_share(shape: FloatArray, phi: FloatArray) -> float:
    """Share of the energy of a shape (m,) at angles (m,) that is even about zero."""
    mirrored = np.interp(-phi, phi, shape, period=2.0 * np.pi)
    return float((((shape + mirrored) / 2.0) ** 2).sum() / ((shape**2).sum() + 1e-300))


def _independent(columns: FloatArray) -> FloatArray:
    """Symmetric pairs once: the first half of the hats' columns and the one at zero."""
    half = columns.shape[-1] // 2 + 1
    return columns[..., :half]
