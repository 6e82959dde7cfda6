"""What a fit says: values with errors, correlations, bounds.

And combinations that the data do not determine.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tirelog.inference.fit.problem import LEVER, Point, Problem
from tirelog.physics.model.model import Model
from tirelog.physics.parameters import Parameter
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import STRAIN

#: Singular values below this share of the largest mark a combination that the data do not
#: determine.
_BLIND = 1e-6
CORRELATED = 0.9


@dataclass(frozen=True)
class FitResult:
    """A fitted model and how well it is known.

    model           with values and standard errors;  names (p,) what was fitted;  values, se (p,);
                    se is inf where the data are blind
    covariance      (p, p); scaled by the reduced chi-square where that is above 1
    correlations    (name, name, r) with |r| > 0.9;  at_bound, the parameters that stand at a bound
    degenerate      sentences on combinations that share one scale or that the data do not determine
    reduced_chi2    chi-square over degrees of freedom;  freedom, the latter;  revolutions, and how
                    many of them were set aside as outliers
    evaluations     of the model on all revolutions
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
    set_aside: int
    evaluations: int
    residuals: tuple[FloatArray, ...] = field(repr=False, default=())


def result_of(
    model: Model,
    names: tuple[str, ...],
    jacobian: FloatArray,
    se: FloatArray,
    *,
    reduced_chi2: float,
    scale: float,
    freedom: int,
    revolutions: int,
) -> FitResult:
    """The result of a fit that was made elsewhere: `jacobian` (N, p) of its whitened residuals,
    `se` (p,) of its parameters; `scale` multiplies the variances.
    """
    parameters = model.parameters
    covariance, _, blind = _errors(jacobian, names, parameters, scale)
    values = {name: parameters[name].value for name in names}
    return FitResult(
        model=model.with_parameters(
            {
                n: replace(parameters[n], se=float(s) if np.isfinite(s) else None)
                for n, s in zip(names, se)
            }
        ),
        names=names,
        values=np.array(list(values.values())),
        se=se,
        covariance=covariance,
        correlations=_correlated(
            names, covariance, np.where(np.isfinite(se), np.sqrt(np.diag(covariance)), np.inf)
        ),
        at_bound=_at_bound(values, parameters),
        degenerate=(*_shared_scale(model, names), *blind),
        reduced_chi2=reduced_chi2,
        freedom=freedom,
        revolutions=revolutions,
        set_aside=0,
        evaluations=0,
    )


def summarise(problem: Problem, point: Point, evaluations: int) -> FitResult:
    """The result at the best point."""
    names = tuple(name for name in problem.model.free if name != LEVER or problem.lever_free)
    values = problem.with_lever(point)
    jacobian = problem.jacobian(point, names, eliminate=False)
    freedom = max(problem.samples - len(names) - problem.removed, 1)
    chi2 = point.square / freedom
    parameters = problem.model.parameters
    covariance, se, blind = _errors(jacobian, names, parameters, max(chi2, 1.0))
    errors = {name: float(s) for name, s in zip(names, se) if np.isfinite(s)}
    return FitResult(
        model=problem.model.with_values(
            {n: float(np.clip(values[n], parameters[n].min, parameters[n].max)) for n in names},
            se=errors,
        ),
        names=names,
        values=np.array([values[n] for n in names]),
        se=se,
        covariance=covariance,
        correlations=_correlated(names, covariance, se),
        at_bound=_at_bound({n: values[n] for n in names}, parameters),
        degenerate=(*_shared_scale(problem.model, names), *blind),
        reduced_chi2=chi2,
        freedom=freedom,
        revolutions=sum(len(stack) for stack in problem.stacks),
        set_aside=sum(int(rows.sum()) for rows in problem.aside),
        evaluations=evaluations,
        residuals=tuple(point.residuals),
    )


def _at_bound(values: Mapping[str, float], parameters: Mapping[str, Parameter]) -> tuple[str, ...]:
    return tuple(
        n
        for n, value in values.items()
        if any(
            _near(value, bound, parameters[n]) for bound in (parameters[n].min, parameters[n].max)
        )
    )


def _near(value: float, bound: float, parameter: Parameter) -> bool:
    return abs(value - bound) <= 1e-6 * (parameter.max - parameter.min) and abs(
        value - bound
    ) <= 1e-3 * abs(parameter.probe)


def _errors(
    jacobian: FloatArray, names: Sequence[str], parameters: Mapping[str, Parameter], scale: float
) -> tuple[FloatArray, FloatArray, list[str]]:
    """Covariance, standard errors (inf where blind), and sentences on the combinations that the
    data do not determine.
    """
    size = np.array([max(abs(parameters[n].value), abs(parameters[n].probe)) for n in names])
    _, s, v = np.linalg.svd(jacobian * size, full_matrices=False)
    blind = s <= _BLIND * s[0] if s.size and s[0] > 0 else np.ones(s.size, bool)
    inverse = np.where(blind, 0.0, 1.0 / np.where(blind, 1.0, s) ** 2)
    covariance = scale * (v.T * inverse) @ v * np.outer(size, size)
    hidden = (v[blind] ** 2).sum(axis=0) > 1e-4 if blind.any() else np.zeros(len(names), bool)
    se = np.where(hidden, np.inf, np.sqrt(np.diag(covariance)))
    sentences = []
    for row in v[blind]:
        members = [n for n, share in zip(names, row) if abs(share) > 0.1]
        sentences.append(
            f"the data do not determine {' with '.join(members)}: "
            f"fix {members[0] if len(members) == 1 else 'all but one'}."
        )
    return covariance, se, sentences


def _correlated(
    names: Sequence[str], covariance: FloatArray, se: FloatArray
) -> tuple[tuple[str, str, float], ...]:
    pairs = []
    for i in range(len(names)):
        for j in range(i):
            if np.isfinite(se[i]) and np.isfinite(se[j]) and se[i] > 0 and se[j] > 0:
                r = float(covariance[i, j] / (se[i] * se[j]))
                if abs(r) > CORRELATED:
                    pairs.append((names[j], names[i], r))
    return tuple(pairs)


def _shared_scale(model: Model, names: Sequence[str]) -> list[str]:
    """The scale that stiffness, mass, lever arm and load share in a strain waveform."""
    if model.observable != STRAIN or LEVER not in names:
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
