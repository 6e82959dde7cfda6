"""What a fit says: values with errors, correlations, bounds.

And combinations that the data do not determine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tirelog.inference.base import FittedChannel
from tirelog.inference.cells.joint import LEVER
from tirelog.inference.fit.cells import Errors
from tirelog.physics.model.model import Model
from tirelog.physics.spectral import Parameter
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import STRAIN

#: correlations beyond this are said: a combination of the two is known far better than each; 3.2
#: times better at 0.9, and 4.5 times at 0.95
CORRELATED = 0.9


@dataclass(frozen=True)
class FitResult:
    """A fitted model and how well it is known.

    model           with values and both standard errors;  names (p,) what was fitted;  values,
                    se (p,); se is inf if the data are blind and at a bound
    covariance      (p, p); scaled by the reduced chi-square if that is above 1
    correlations    (name, name, r) with |r| > 0.9;  at_bound, the parameters that stand at a bound
    degenerate      sentences on combinations that share one scale or that the data do not determine
    reduced_chi2    chi-square over degrees of freedom;  freedom, the latter;  revolutions, of all
                    logs and channels
    """

    model: Model
    names: tuple[str, ...]
    values: FloatArray
    se: FloatArray
    covariance: FloatArray
    correlations: tuple[tuple[str, str, float], ...]
    at_bound: tuple[str, ...]
    degenerate: tuple[str, ...]
    reduced_chi2: float
    freedom: int
    revolutions: int


def result_of(channels: Sequence[FittedChannel], model: Model | None = None) -> FitResult:
    """The result of channels that were fitted together.

    `model` is the fitted one with further errors of its parameters, if there are any.
    """
    fit = channels[0].fit
    model = fit.model if model is None else model
    parameters, known, freedom = (
        fit.model.parameters,
        fit.known,
        sum(c.fit.freedom for c in channels),
    )
    errors = dict(zip(fit.names, known.se.tolist(), strict=True))
    at_bound = tuple(n for n in fit.names if n in fit.held or _at_bound(parameters[n]))
    shared = (
        _shared_scale(fit.model, fit.names)
        if all(c.cells.observable == STRAIN for c in channels)
        else []
    )
    return FitResult(
        model=model.with_parameters(
            {
                n: replace(model.parameters[n], se=s if np.isfinite(s) else None)
                for n, s in errors.items()
            }
        ),
        names=fit.names,
        values=np.array([parameters[name].value for name in fit.names]),
        se=known.se,
        covariance=known.covariance,
        correlations=_correlated(fit.names, known),
        at_bound=at_bound,
        degenerate=(*shared, *_undetermined(fit.names, known, fit.held)),
        reduced_chi2=sum(c.noise_chi2 for c in channels) / freedom,
        freedom=int(freedom),
        revolutions=sum(int(c.cells.revolutions.sum()) for c in channels),
    )


def _at_bound(p: Parameter) -> bool:
    return any(
        abs(p.value - bound) <= min(1e-6 * (p.max - p.min), 1e-3 * abs(p.probe))
        for bound in (p.min, p.max)
    )


def _undetermined(names: Sequence[str], known: Errors, held: Sequence[str]) -> list[str]:
    """Sentences on what the data do not determine; what stands at a bound is said elsewhere."""
    return [
        f"the data do not determine {' with '.join(members)}: "
        f"fix {members[0] if len(members) == 1 else 'all but one'}."
        for members in known.undetermined(names)
        if not set(members) <= set(held)
    ]


def _correlated(names: Sequence[str], known: Errors) -> tuple[tuple[str, str, float], ...]:
    pairs = []
    se = np.where(np.isfinite(known.se) & (known.se > 0), known.se, np.inf)
    for i in range(len(names)):
        for j in range(i):
            r = float(known.covariance[i, j] / (se[i] * se[j]))
            if abs(r) > CORRELATED:
                pairs.append((names[j], names[i], r))
    return tuple(pairs)


def _shared_scale(model: Model, names: Sequence[str]) -> list[str]:
    """The scale that stiffness, mass, lever arm and load share in a strain waveform."""
    if LEVER not in names:
        return []
    ratio = (
        "EJ, k, mu, the lever arm and the load"
        if model.carcass == "beam"
        else "EI, k_w, k_v, p0, k_t, the lever arm and the load"
    )
    held = [n for n in ("line_mass_kg_m", "load_N") if n not in names]
    said = (
        f"{' and '.join(held)} {'are' if len(held) > 1 else 'is'} held, and the others are "
        f"relative to {'them' if len(held) > 1 else 'it'}"
    )
    return [
        f"{ratio} share one scale in a strain waveform: "
        f"{said if held else 'nothing is held, so fix line_mass_kg_m and load_N'}."
    ]
