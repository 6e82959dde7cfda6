"""A fit's problem: data, weights, and the residuals and slopes of the nonlinear parameters with the linear ones eliminated.

Stack (n, m), w --model--> w (values - level), w waveform --nuisances out--> share of the lever arm --> residuals, slopes (samples, p)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tirelog.physics.carcass import STRAIN, WAVEFORMS
from tirelog.physics.design import angles_of, observable_of, project, project_groups, revolution_columns
from tirelog.physics.model import Model
from tirelog.physics.spectral import FloatArray
from tirelog.recording import Stack

LEVER = "lever_arm_m"


@dataclass(frozen=True)
class Point:
    """The problem at some values: the lever arm's best share of its value, whether that is held (not free, or at a bound), and per stack
    the weighted residuals, the weighted waveform, and the nuisances' basis."""

    values: dict[str, float]
    share: float
    held: bool
    residuals: list[FloatArray]
    waves: list[FloatArray]
    bases: list[FloatArray | None]

    @property
    def square(self) -> float:
        """Chi-square."""
        return sum(float((r * r).sum()) for r in self.residuals)


@dataclass(frozen=True)
class Problem:
    """The data, and the functions of the nonlinear parameters that least squares asks for."""

    model: Model
    stacks: Sequence[Stack]
    weight: Sequence[FloatArray]
    nonlinear: tuple[str, ...]
    lever_free: bool
    nuisances: tuple[str, ...]

    def values(self, x: FloatArray) -> dict[str, float]:
        return dict(zip(self.nonlinear, x.tolist()))

    def evaluate(self, values: Mapping[str, float]) -> Point:
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
        return Point(dict(values), share, held, residuals, [s for _, s in parts], bases)

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

    def jacobian(self, point: Point, names: Sequence[str], *, eliminate: bool) -> FloatArray:
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
