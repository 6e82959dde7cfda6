"""Bounded nonlinear least squares on stacks of revolutions, from several logs and channels at once.

    residual = project[ w (values - lever_share waveform - level) ]

with the weights w from noise and count.

What is linear is eliminated at every step (variable projection): an offset per log and channel of a
waveform, and the lever arm, which scales all strain. The rest is scipy's trust-region reflective
least squares in units of the parameters' own sizes. Several starts are tried on a few revolutions;
the best goes on to all of them. The errors come from the full Jacobian at the end, lever arm
included.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from tirelog.data.recording import Conditions, Stack
from tirelog.errors import ModelError
from tirelog.inference.fit.design import observable_of
from tirelog.inference.fit.problem import LEVER, Point, Problem
from tirelog.inference.fit.result import FitResult, summarise
from tirelog.physics.model.model import Model
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import STRAIN

#: Revolutions on which starts are compared.
SCOUTS = 24
#: How bad a step into what the model refuses is, in units of the start's residual.
_FAR = 1e3
#: Spread of the starts: factors on the structure's values, in turn.
_SPREAD: tuple[dict[str, float], ...] = (
    {},
    {"flexural_stiffness_N_m2": 0.3},
    {"flexural_stiffness_N_m2": 3.0, "patch_half_length_m": 0.8},
    {"patch_half_length_m": 1.25},
)


def fit(
    model: Model,
    stacks: Sequence[Stack],
    *,
    nuisances: Sequence[str] = (),
    scatter: bool = False,
    starts: int = 4,
    max_evaluations: int = 60,
) -> FitResult:
    """The model's free parameters fitted to the stacks (strain, radial acceleration or a number per
    revolution; several logs and channels).

    nuisances   'offset', 'amplitude', 'shift' of every revolution that are taken out; without
                'offset' one offset per log is; with 'amplitude' the lever arm is held
    scatter     load, its rise and the baseline of revolutions and manoeuvres scatter: how much is
                learnt from the residual, they weigh accordingly (`metric`), and the few worst
                revolutions are set aside; the errors then hold on real drives
    starts      how many starts are compared on a few revolutions before all are used
    ModelError  no data, nothing free, another observable, a condition that an effect needs is not
                known, or no convergence: never a number.
    """
    _refuse(model, stacks)
    model = model.resolved(Conditions.concatenate([stack.conditions for stack in stacks]))
    problem = _problem(model, stacks)
    # a free amplitude of every revolution leaves nothing that could show the lever arm: it comes
    # from a first fit without
    first = [kind for kind in nuisances if kind != "amplitude"]
    start = _scouted(problem, starts, first)
    problem = problem.measured_at(problem.values(start), first, scatter=False)
    spent = 0
    # the metric hangs on the waveform: settle roughly, measure there, settle again
    for _ in range(2 if nuisances or scatter else 0):
        rough = _solve(problem, start, max_evaluations, tight=False)
        start, spent = rough.x, spent + rough.evaluations
        held = problem.lever_held_at(rough.point) if "amplitude" in nuisances else problem
        at = problem.with_lever(rough.point)
        if scatter:  # outliers show in the metric that knows the ordinary scatter
            known = held.measured_at(at, nuisances, scatter=True)
            held = held.without_outliers(known.evaluate(known.values(rough.x)), known.metrics)
        problem = held.measured_at(at, nuisances, scatter=scatter)
    solution = _solve(problem, start, max_evaluations)
    return summarise(problem, solution.point, spent + solution.evaluations)


def _refuse(model: Model, stacks: Sequence[Stack]) -> None:
    """ModelError where there is nothing to fit, or to fit to."""
    if not stacks or not sum(len(stack) for stack in stacks):
        raise ModelError(
            "there is no revolution to fit; at least ten are sensible; give a log with patch "
            "passages"
        )
    if not model.free:
        raise ModelError(
            "the model has no free parameter; one with { value, min, max } is needed; "
            "free one in the model file"
        )
    for stack in stacks:
        observable_of(model, stack)
    if all(stack.observable != model.observable for stack in stacks):
        have = ", ".join(sorted({stack.observable for stack in stacks}))
        raise ModelError(
            f"the model predicts {model.observable}, the logs measure {have}; "
            "the same observable is allowed; take another model"
        )
    for stack in stacks:
        for effect, lacking in model.missing_conditions(stack.conditions).items():
            raise ModelError(
                f"effect {effect!r} needs {', '.join(lacking)}, which "
                f"{stack.logs[int(stack.log[0])]} does not know; "
                "every log must know it; add it to the setup, or remove the effect"
            )


def _problem(model: Model, stacks: Sequence[Stack]) -> Problem:
    strain = any(stack.observable == STRAIN for stack in stacks)
    lever = model.parameters.get(LEVER)
    lever_free = bool(strain and lever is not None and lever.free)
    if lever_free and lever is not None and lever.value <= 0.0:
        model = model.with_values({LEVER: min(lever.probe, lever.max)})
    nonlinear = tuple(name for name in model.free if name != LEVER)
    return Problem(model, list(stacks), (), nonlinear, lever_free)


def _scouted(problem: Problem, starts: int, nuisances: Sequence[str]) -> FloatArray:
    """The start whose fit on a few revolutions is best."""
    given = np.array([problem.model.parameters[name].value for name in problem.nonlinear])
    if starts <= 1 or not problem.nonlinear:
        return given
    few = [
        stack.take(np.unique(np.linspace(0, len(stack) - 1, SCOUTS).astype(int)))
        for stack in problem.stacks
    ]
    scout = replace(problem, stacks=few)
    best, cost = given, np.inf
    for k in range(starts):
        try:
            x = _start(problem, given, k)
            scout = scout.measured_at(problem.values(x), nuisances, scatter=False)
            found = _solve(scout, x, 25, tight=False)
        except ModelError:
            continue
        if found.point.square < 0.98 * cost:
            best, cost = found.x, found.point.square
        if cost < 1.5 * scout.samples:
            break  # within the noise: no other start can be better
    return best


def _start(problem: Problem, given: FloatArray, k: int) -> FloatArray:
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


@dataclass(frozen=True)
class _Solution:
    """Where least squares ended: nonlinear parameters, the problem there, evaluations."""

    x: FloatArray
    point: Point
    evaluations: int


class _Tried:
    """The problem at the point last asked for, so that residual and slope share it; None where the
    model refuses the values.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem, self.key = problem, b""
        self.point: Point | None = None

    def at(self, x: FloatArray) -> Point | None:
        if x.tobytes() != self.key:
            self.key = x.tobytes()
            try:
                self.point = self.problem.evaluate(self.problem.values(x))
            except ModelError:
                self.point = None  # supercritical, no load: a step too far
        return self.point


def _solve(
    problem: Problem, start: FloatArray, max_evaluations: int, *, tight: bool = True
) -> _Solution:
    """Least squares from one start; ModelError where the model refuses the start, or (`tight`) it
    did not converge.
    """
    first = problem.evaluate(problem.values(start))
    if not problem.nonlinear:
        return _Solution(start, first, 1)
    parameters = [problem.model.parameters[name] for name in problem.nonlinear]
    low, high = np.array([p.min for p in parameters]), np.array([p.max for p in parameters])
    size = sum(r.size for r in first.residuals)
    far = np.full(size, _FAR * np.sqrt(2.0 * first.square / size + 1.0))
    tried = _Tried(problem)

    def residual(x: FloatArray) -> FloatArray:
        point = tried.at(x)
        return far if point is None else np.concatenate([r.ravel() for r in point.residuals])

    def slope(x: FloatArray) -> FloatArray:
        point = tried.at(x)
        return (
            np.zeros((size, x.size))
            if point is None
            else problem.jacobian(point, problem.nonlinear, eliminate=True)
        )

    tolerance = 1e-9 if tight else 1e-4
    found = least_squares(
        residual,
        np.clip(start, low + 1e-12 * (high - low), high - 1e-12 * (high - low)),
        slope,
        bounds=(low, high),
        x_scale=np.array([max(abs(x), abs(p.probe)) for x, p in zip(start, parameters)]),
        ftol=tolerance,
        xtol=1e-7 if tight else 1e-4,
        gtol=1e-12,
        max_nfev=max_evaluations,
    )
    last = tried.at(found.x)
    if last is None or (tight and found.status <= 0):
        raise ModelError(
            f"the fit did not converge in {found.nfev} steps; a model that the data determine is "
            "allowed; fix parameters, give other start values or narrower bounds"
        )
    return _Solution(found.x, last, int(found.nfev))
