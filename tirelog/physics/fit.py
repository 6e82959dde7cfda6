"""Bounded nonlinear least squares on stacks of revolutions, from several logs and channels at once.

    residual = project[ w (values - lever_share waveform - level) ],   weights w from noise and count

What is linear is eliminated at every step (variable projection): an offset per log and channel of a strain waveform, and the lever arm, which
scales all strain.  The rest is scipy's trust-region reflective least squares in units of the parameters' own sizes.  Several starts are
tried on a few revolutions; the best goes on to all of them.  The errors come from the full Jacobian at the end, lever arm included.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from tirelog.errors import ModelError
from tirelog.physics.carcass import STRAIN, WAVEFORMS
from tirelog.physics.design import angles_of, observable_of, project, project_groups, revolution_columns, weights
from tirelog.physics.model import Model
from tirelog.physics.spectral import FloatArray
from tirelog.recording import Stack

LEVER = "lever_arm_m"
#: Revolutions on which starts are compared.
SCOUTS = 24
_FAR = 1e3
#: Spread of the starts: factors on the structure's values, in turn.
_SPREAD = (
    {},
    {"flexural_stiffness_N_m2": 0.3},
    {"flexural_stiffness_N_m2": 3.0, "patch_half_length_m": 0.8},
    {"patch_half_length_m": 1.25},
)
#: Singular values below this share of the largest mark a combination that the data do not determine.
_BLIND = 1e-6
CORRELATED = 0.9


@dataclass(frozen=True)
class FitResult:
    """A fitted model and how well it is known.

    model           with values and standard errors;  names (p,) what was fitted;  values, se (p,); se is inf where the data are blind
    covariance      (p, p); scaled by the reduced chi-square where that is above 1
    correlations    (name, name, r) with |r| > 0.9;  at_bound, the parameters that stand at a bound
    degenerate      sentences on combinations that share one scale or that the data do not determine
    reduced_chi2    chi-square over degrees of freedom;  freedom, the latter;  revolutions;  offsets per (log, channel)
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
    evaluations: int
    residuals: tuple[FloatArray, ...] = field(repr=False, default=())


@dataclass(frozen=True)
class _Problem:
    """The data, and the functions of the nonlinear parameters that least squares asks for."""

    model: Model
    stacks: Sequence[Stack]
    weight: Sequence[FloatArray]
    nonlinear: tuple[str, ...]
    lever_free: bool
    nuisances: tuple[str, ...]

    def values(self, x: FloatArray) -> dict[str, float]:
        return dict(zip(self.nonlinear, x.tolist()))

    def evaluate(self, values: Mapping[str, float]) -> _Point:
        """Weighted residuals with the linear parameters at their best."""
        parts, bases = [], []
        for stack, w in zip(self.stacks, self.weight):
            phi, variance = angles_of(stack)
            told = {"surface": stack.surface, "phi_variance": variance, "values": values, "observable": observable_of(self.model, stack)}
            wave, level, slope = self.model.parts(stack.conditions, phi, slope="shift" in self.nuisances, **told)  # type: ignore[arg-type]
            basis = revolution_columns(w, wave, slope if slope.size else wave, self.nuisances) if self.nuisances else None
            clear = self._clearer(stack, w, basis)
            parts.append((clear(np.where(w > 0, w * (stack.values - level), 0.0)), clear(np.where(w > 0, w * wave, 0.0))))
            bases.append(basis)
        share, held = self._share(parts)
        residuals = [d - (share if stack.observable == STRAIN else 1.0) * s for stack, (d, s) in zip(self.stacks, parts)]
        return _Point(dict(values), share, held, residuals, [s for _, s in parts], bases)

    def _clearer(self, stack: Stack, w: FloatArray, basis: FloatArray | None) -> Callable[[FloatArray], FloatArray]:
        """Takes the nuisances out of weighted arrays: those per revolution, then the offset of each log."""

        def clear(weighted: FloatArray) -> FloatArray:
            if basis is not None:
                weighted = project(basis, weighted)
            if stack.observable in WAVEFORMS and "offset" not in self.nuisances:
                weighted = project_groups(w, stack.log, weighted, basis)
            return weighted

        return clear

    def _share(self, parts: Sequence[tuple[FloatArray, FloatArray]]) -> tuple[float, bool]:
        """Factor on the lever arm that fits best, and whether it stands at a bound."""
        if not self.lever_free:
            return 1.0, True
        chosen = [(d, s) for stack, (d, s) in zip(self.stacks, parts) if stack.observable == STRAIN]
        across, along = sum(float((d * s).sum()) for d, s in chosen), sum(float((s * s).sum()) for _, s in chosen)
        lever = self.model.parameters[LEVER]
        share = across / along if along > 0 else 1.0
        limited = float(np.clip(share, max(lever.min, 1e-12 * lever.max) / lever.value, lever.max / lever.value))
        return limited, limited != share

    def jacobian(self, point: _Point, names: Sequence[str], *, eliminate: bool) -> FloatArray:
        """Derivatives of the residuals by `names`, (samples, p), nuisances taken out, and with `eliminate` the lever arm too (Kaufman)."""
        columns = []
        values = {**point.values, **({LEVER: self.model.parameters[LEVER].value * point.share} if self.lever_free else {})}
        for stack, w, basis in zip(self.stacks, self.weight, point.bases):
            phi, variance = angles_of(stack)
            slopes = self.model.jacobian(
                stack.conditions, phi, names, surface=stack.surface, phi_variance=variance, values=values, observable=stack.observable
            )
            slopes = self._clearer(stack, w, basis)(np.where(w > 0, w * slopes, 0.0))
            columns.append(-slopes.reshape(len(names), -1))
        jacobian = np.concatenate(columns, axis=1)
        if eliminate and self.lever_free and not point.held:
            wave = np.concatenate([(s if stack.observable == STRAIN else 0.0 * s).ravel() for stack, s in zip(self.stacks, point.waves)])
            wave /= np.linalg.norm(wave)
            jacobian -= np.outer(jacobian @ wave, wave)
        return jacobian.T


@dataclass(frozen=True)
class _Point:
    values: dict[str, float]
    share: float
    held: bool
    residuals: list[FloatArray]
    waves: list[FloatArray]
    bases: list[FloatArray | None]


def fit(
    model: Model,
    stacks: Sequence[Stack],
    *,
    nuisances: Sequence[str] = (),
    starts: int = 4,
    max_evaluations: int = 60,
) -> FitResult:
    """The model's free parameters fitted to the stacks (strain, radial acceleration or a number per revolution; several logs and channels).

    nuisances   'offset', 'amplitude', 'shift' of every revolution that are taken out; without 'offset' one offset per log is; with
                'amplitude' the lever arm is held
    starts      how many starts are compared on a few revolutions before all are used
    ModelError  no data, nothing free, another observable, a condition that an effect needs is not known, or no convergence: never a number.
    """
    _refuse(model, stacks)
    model = model.resolved(_all_conditions(stacks))
    problem = _problem(model, stacks, nuisances)
    start = _scouted(problem, starts)
    found, point = _solve(problem, start, max_evaluations)
    return _result(problem, found, point)


def _all_conditions(stacks: Sequence[Stack]):  # type: ignore[no-untyped-def]
    from tirelog.recording import Conditions

    return Conditions.concatenate([stack.conditions for stack in stacks])


def _refuse(model: Model, stacks: Sequence[Stack]) -> None:
    """ModelError where there is nothing to fit, or to fit to."""
    if not stacks or not sum(len(stack) for stack in stacks):
        raise ModelError("there is no revolution to fit; at least ten are sensible; give a log with patch passages")
    if not model.free:
        raise ModelError("the model has no free parameter; one with { value, min, max } is needed; free one in the model file")
    for stack in stacks:
        observable_of(model, stack)
    if all(stack.observable != model.observable for stack in stacks):
        have = ", ".join(sorted({stack.observable for stack in stacks}))
        raise ModelError(
            f"the model predicts {model.observable}, the logs measure {have}; the same observable is allowed; take another model"
        )
    for stack in stacks:
        for effect, lacking in model.missing_conditions(stack.conditions).items():
            raise ModelError(
                f"effect {effect!r} needs {', '.join(lacking)}, which {stack.logs[int(stack.log[0])]} does not know; add it to the setup, or remove the effect"
            )


def _problem(model: Model, stacks: Sequence[Stack], nuisances: Sequence[str]) -> _Problem:
    strain = any(stack.observable == STRAIN for stack in stacks)
    lever = model.parameters.get(LEVER)
    # with a free amplitude in every revolution nothing is left that could show the lever arm
    lever_free = bool(strain and lever is not None and lever.free and "amplitude" not in nuisances)
    if lever_free and lever is not None and lever.value <= 0.0:
        model = model.with_values({LEVER: min(lever.probe, lever.max)})
    nonlinear = tuple(name for name in model.free if name != LEVER)
    return _Problem(model, list(stacks), [weights(stack) for stack in stacks], nonlinear, lever_free, tuple(nuisances))


def _scouted(problem: _Problem, starts: int) -> FloatArray:
    """The start whose fit on a few revolutions is best."""
    given = np.array([problem.model.parameters[name].value for name in problem.nonlinear])
    if starts <= 1 or not problem.nonlinear:
        return given
    few = [stack.take(np.unique(np.linspace(0, len(stack) - 1, SCOUTS).astype(int))) for stack in problem.stacks]
    scout = replace(problem, stacks=few, weight=[weights(stack) for stack in few])
    best, cost = given, np.inf
    for k in range(starts):
        try:
            found, _ = _solve(scout, _start(problem, given, k), 25, tight=False)
        except ModelError:
            continue
        if found.cost < 0.98 * cost:
            best, cost = found.x, found.cost
        freedom = sum(int((w > 0).sum()) for w in scout.weight)
        if 2.0 * cost < 1.5 * freedom:
            break  # within the noise: no other start can be better
    return best


def _start(problem: _Problem, given: FloatArray, k: int) -> FloatArray:
    """Start number k: the values given, then spread ones with every effect at its probe."""
    factors = _SPREAD[k % len(_SPREAD)]
    start = given.copy()
    for i, name in enumerate(problem.nonlinear):
        p = problem.model.parameters[name]
        value = p.value * factors.get(name, 1.0)
        if k and "." in name:
            value = p.probe
        start[i] = np.clip(value, p.min, p.max)
    return start


def _solve(problem: _Problem, start: FloatArray, max_evaluations: int, *, tight: bool = True) -> tuple[OptimizeResult, _Point]:
    """Least squares from one start; ModelError where it did not converge."""
    parameters = [problem.model.parameters[name] for name in problem.nonlinear]
    first = problem.evaluate(problem.values(start))
    if not parameters:
        return OptimizeResult(x=start, cost=0.5 * _square(first), status=1, nfev=1), first
    low, high = np.array([p.min for p in parameters]), np.array([p.max for p in parameters])
    scale = np.array([max(abs(x), abs(p.probe)) for x, p in zip(start, parameters)])
    memory: dict[bytes, _Point | None] = {start.tobytes(): first}
    size = sum(r.size for r in first.residuals)
    far = np.full(size, _FAR * np.sqrt(2.0 * _square(first) / size + 1.0))

    def point(x: FloatArray) -> _Point | None:
        if x.tobytes() not in memory:
            memory.clear()
            try:
                memory[x.tobytes()] = problem.evaluate(problem.values(x))
            except ModelError:
                memory[x.tobytes()] = None  # a step into what the model refuses (supercritical, no load): as bad as can be
        return memory[x.tobytes()]

    def residual(x: FloatArray) -> FloatArray:
        p = point(x)
        return far if p is None else np.concatenate([r.ravel() for r in p.residuals])

    def slope(x: FloatArray) -> FloatArray:
        p = point(x)
        if p is None:
            raise ModelError(
                "the fit ran into values that the model refuses; other start values are allowed; change them in the model file"
            )
        return problem.jacobian(p, problem.nonlinear, eliminate=True)

    inside = np.clip(start, low + 1e-12 * (high - low), high - 1e-12 * (high - low))
    tolerance = 1e-9 if tight else 1e-4
    found = least_squares(
        residual, inside, slope, bounds=(low, high), x_scale=scale, method="trf",
        ftol=tolerance, xtol=1e-7 if tight else 1e-4, gtol=1e-12, max_nfev=max_evaluations,
    )  # fmt: skip
    last = point(found.x)
    if last is None or (tight and found.status <= 0):
        raise ModelError(
            f"the fit did not converge in {found.nfev} steps; a model that the data determine is allowed; fix parameters, give other start values or "
            f"narrower bounds"
        )
    return found, last


def _square(point: _Point) -> float:
    return sum(float((r * r).sum()) for r in point.residuals)


def _result(problem: _Problem, found: OptimizeResult, point: _Point) -> FitResult:
    names = tuple(name for name in problem.model.free if name != LEVER or problem.lever_free)
    values = {**point.values}
    if problem.lever_free:
        values[LEVER] = problem.model.parameters[LEVER].value * point.share
    jacobian = problem.jacobian(point, names, eliminate=False)
    rest = _linear_count(problem)
    freedom = max(sum(int((w > 0).sum()) for w in problem.weight) - len(names) - rest, 1)
    chi2 = _square(point) / freedom
    parameters = problem.model.parameters
    covariance, se, blind = _errors(jacobian, names, parameters, max(chi2, 1.0))
    errors = {name: float(s) for name, s in zip(names, se) if np.isfinite(s)}
    at_bound = tuple(
        n for n in names if _near(values[n], parameters[n].min, parameters[n]) or _near(values[n], parameters[n].max, parameters[n])
    )
    return FitResult(
        model=problem.model.with_values({n: float(np.clip(values[n], parameters[n].min, parameters[n].max)) for n in names}, se=errors),
        names=names,
        values=np.array([values[n] for n in names]),
        se=se,
        covariance=covariance,
        correlations=_correlated(names, covariance, se),
        at_bound=at_bound,
        degenerate=(*_shared_scale(problem.model, names), *blind),
        reduced_chi2=chi2,
        freedom=freedom,
        revolutions=sum(len(stack) for stack in problem.stacks),
        evaluations=int(found.nfev),
        residuals=tuple(point.residuals),
    )


def _linear_count(problem: _Problem) -> int:
    """How many nuisances the data paid for."""
    count = 0
    for stack in problem.stacks:
        count += len(problem.nuisances) * len(stack)
        if stack.observable in WAVEFORMS and "offset" not in problem.nuisances:
            count += np.unique(stack.log).size
    return count


def _near(value: float, bound: float, parameter) -> bool:  # type: ignore[no-untyped-def]
    return abs(value - bound) <= 1e-6 * (parameter.max - parameter.min) and abs(value - bound) <= 1e-3 * abs(parameter.probe)


def _errors(jacobian: FloatArray, names, parameters, scale: float):  # type: ignore[no-untyped-def]
    """Covariance, standard errors (inf where blind), and sentences on the combinations that the data do not determine."""
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
        sentences.append(f"the data do not determine {' with '.join(members)}: fix {members[0] if len(members) == 1 else 'all but one'}.")
    return covariance, se, sentences


def _correlated(names: Sequence[str], covariance: FloatArray, se: FloatArray) -> tuple[tuple[str, str, float], ...]:
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
    ratio = "EJ, k, mu, the lever arm and the load" if model.carcass == "beam" else "EI, k_w, k_v, p0, k_t, the lever arm and the load"
    held = [n for n in ("line_mass_kg_m", "load_N") if n not in names]
    said = (
        f"{' and '.join(held)} {'are' if len(held) > 1 else 'is'} held, and the others are relative to {'them' if len(held) > 1 else 'it'}"
    )
    return [f"{ratio} share one scale in a strain waveform: {said if held else 'nothing is held, so fix line_mass_kg_m and load_N'}."]
