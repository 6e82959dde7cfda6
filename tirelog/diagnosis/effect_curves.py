"""What each effect of a fitted model adds, as a curve beside what the measurement leaves for it.

    fitted base --prediction with the effect less that without, all else held--> `EffectCurve`

Of a waveform: over the angle, at the mean revolution where the effect is largest. Of a number per
revolution: over the speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePath

import numpy as np

from tirelog.errors import ModelError, or_refusal
from tirelog.inference.base import Base, apart, change_to
from tirelog.inference.cells.together import model_of
from tirelog.inference.scatter import scatter_columns
from tirelog.vocabulary.arrays import FloatArray


@dataclass(frozen=True)
class EffectCurve:
    """An effect's share of the prediction, (m,) each.

    label      of which revolutions it is, with the file name of their `log`; empty if of all
    along      angle from the patch centre [rad], or of a number per revolution the speed [m/s],
               ascending
    added      what the effect adds [unit]; `error` its standard error from the effect's own
               parameters, NaN if the data do not tell one of them
    measured   what is measured less all else that the model predicts [unit]; NaN without a sample
    floor      noise floor of a revolution there [unit]
    """

    effect: str
    label: str
    log: str
    along: FloatArray
    added: FloatArray
    error: FloatArray
    measured: FloatArray
    floor: FloatArray


def effect_curves(base: Base, effects: Sequence[str]) -> list[EffectCurve]:
    """The curve of each effect of a fitted model.

    Of several observables in the first; without those that the model cannot be computed without.
    """
    base = apart(base)[0]
    found = [_curve(base, name) for name in effects]
    return [curve for curve in found if not isinstance(curve, ModelError)]


@or_refusal
def _curve(base: Base, effect: str) -> EffectCurve | ModelError:
    cells, fit = base.cells, base.fit
    lost = change_to(base, model_of(fit.model.without_effect(effect), cells.observable))
    if isinstance(lost, ModelError):
        return lost
    added = -lost
    own = [i for i, name in enumerate(fit.names) if name.startswith(f"{effect}.")]
    slopes = fit.jacobian[..., own]
    covariance = fit.known.covariance[np.ix_(own, own)]
    square = np.einsum("cmi,ij,cmj->cm", slopes, covariance, slopes)
    known = bool(np.isfinite(fit.known.se[own]).all())
    error = np.sqrt(np.maximum(square, 0.0)) if known else np.full(added.shape, np.nan)
    between = base.floor.scatter.square(scatter_columns(cells, fit))
    floor = np.sqrt(cells.within + between)
    left = cells.values - fit.prediction - fit.beside + added
    if cells.phi.shape[1] == 1:
        order = np.argsort(cells.conditions.speed_m_s, kind="stable")
        rows = (column[order, 0] for column in (added, error, left, floor))
        return EffectCurve(effect, "", "", cells.conditions.speed_m_s[order], *rows)
    size = np.nanmean(np.where(np.isfinite(cells.phi), added, np.nan) ** 2, axis=1)
    i = int(np.nanargmax(size))
    log = PurePath(cells.logs[cells.log[i]]).name
    label = f"{cells.conditions.speed_m_s[i]:.1f} m/s, {cells.regime[i]}, {log}"
    return EffectCurve(effect, label, log, cells.phi[i], added[i], error[i], left[i], floor[i])
