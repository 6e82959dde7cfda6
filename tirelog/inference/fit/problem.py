"""A fit's problem: data in their metric, residuals and slopes.

The slopes are those of the nonlinear parameters, with the lever arm eliminated.

Stack (n, m) --Metric--> values - level, waveform --> share of the lever arm
    --> residuals, slopes (samples, p)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tirelog.data.recording import Stack
from tirelog.inference.fit.design import load_bend_on, load_slope_on, parts_on, slopes_on
from tirelog.inference.metric.revolutions import Metric, estimate_scatter, scatter_shapes
from tirelog.physics.model.model import Model
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import STRAIN, WAVEFORMS

LEVER = "lever_arm_m"
#: Share of the revolutions that may be set aside, and how much worse than the median they must be.
_FEW, _WORSE = 0.02, 5.0


@dataclass(frozen=True)
class Point:
    """The problem at some values: the lever arm's best share of its value, whether that is held
    (not free, or at a bound), and per stack the residuals and the waveform in the metric.
    """

    values: dict[str, float]
    share: float
    held: bool
    residuals: list[FloatArray]
    waves: list[FloatArray]

    @property
    def square(self) -> float:
        """Chi-square."""
        return sum(float((r * r).sum()) for r in self.residuals)


@dataclass(frozen=True)
class Problem:
    """The data, their metric at some values, and the functions of the nonlinear parameters that
    least squares asks for.
    """

    model: Model
    stacks: Sequence[Stack]
    metrics: Sequence[Metric]
    nonlinear: tuple[str, ...]
    lever_free: bool
    aside: Sequence[np.ndarray] = ()

    def values(self, x: FloatArray) -> dict[str, float]:
        """The nonlinear parameters by name."""
        return dict(zip(self.nonlinear, x.tolist()))

    def evaluate(self, values: Mapping[str, float]) -> Point:
        """Residuals with the lever arm at its best."""
        parts = []
        for stack, metric in zip(self.stacks, self.metrics):
            wave, level, _ = parts_on(self.model, stack, values)
            parts.append((metric(stack.values - metric.bend - level), metric(wave)))
        share, held = self._share(parts)
        residuals = [
            d - (share if stack.observable == STRAIN else 1.0) * s
            for stack, (d, s) in zip(self.stacks, parts)
        ]
        return Point(dict(values), share, held, residuals, [s for _, s in parts])

    def _share(self, parts: Sequence[tuple[FloatArray, FloatArray]]) -> tuple[float, bool]:
        """Factor on the lever arm that fits best, and whether it stands at a bound."""
        if not self.lever_free:
            return 1.0, True
        chosen = [(d, s) for stack, (d, s) in zip(self.stacks, parts) if stack.observable == STRAIN]
        across, along = (
            sum(float((d * s).sum()) for d, s in chosen),
            sum(float((s * s).sum()) for _, s in chosen),
        )
        lever = self.model.parameters[LEVER]
        share = across / along if along > 0 else 1.0
        limited = float(
            np.clip(share, max(lever.min, 1e-12 * lever.max) / lever.value, lever.max / lever.value)
        )
        return limited, limited != share

    def with_lever(self, point: Point) -> dict[str, float]:
        """The point's values, lever arm included."""
        return {
            **point.values,
            **(
                {LEVER: self.model.parameters[LEVER].value * point.share} if self.lever_free else {}
            ),
        }

    def lever_held_at(self, point: Point) -> Problem:
        """The problem with the lever arm no longer free, at the point's."""
        if not self.lever_free:
            return self
        lever = self.model.parameters[LEVER].value * point.share
        return replace(self, model=self.model.with_values({LEVER: lever}), lever_free=False)

    def jacobian(self, point: Point, names: Sequence[str], *, eliminate: bool) -> FloatArray:
        """Derivatives of the residuals by `names`, (samples, p), and with `eliminate` the lever arm
        taken out of them (Kaufman).
        """
        values = self.with_lever(point)
        columns = [
            -metric(slopes_on(self.model, stack, names, values)).reshape(len(names), -1)
            for stack, metric in zip(self.stacks, self.metrics)
        ]
        jacobian = np.concatenate(columns, axis=1)
        if eliminate and self.lever_free and not point.held:
            wave = np.concatenate(
                [
                    (s if stack.observable == STRAIN else 0.0 * s).ravel()
                    for stack, s in zip(self.stacks, point.waves)
                ]
            )
            wave /= np.linalg.norm(wave)
            jacobian -= np.outer(jacobian @ wave, wave)
        return jacobian.T

    def measured_at(
        self, values: Mapping[str, float], nuisances: Sequence[str], *, scatter: bool
    ) -> Problem:
        """The same problem in the metric at these values; with `scatter`, what the residual there
        shows of it is whitened.
        """
        aside = self.aside or [np.zeros(len(stack), bool) for stack in self.stacks]
        metrics = [
            _metric(self.model, stack, values, nuisances, scatter, rows)
            for stack, rows in zip(self.stacks, aside)
        ]
        return replace(self, metrics=metrics, aside=aside)

    def without_outliers(self, point: Point, metrics: Sequence[Metric]) -> Problem:
        """The same problem with the few worst revolutions of the point (in `metrics`) set aside
        too: at most `_FEW` of all, each above `_WORSE` times the median.

        A start from standstill or a passage that was cut wrongly would else pull everything; a
        missing effect, that is worse on many revolutions, is left to be seen.
        """
        aside = []
        for already, metric, residual in zip(self.aside, metrics, point.residuals):
            seen = (metric.weight > 0).sum(axis=1)
            mean = np.divide(
                (residual**2).sum(axis=1), seen, out=np.zeros(len(seen)), where=seen > 0
            )
            worst = np.zeros(len(seen), bool)
            worst[np.argsort(mean)[len(seen) - int(_FEW * len(seen)) :]] = True
            aside.append(already | (worst & (mean > _WORSE * np.median(mean))))
        return replace(self, aside=aside)

    @property
    def samples(self) -> int:
        """Bins that were measured."""
        return sum(int((metric.weight > 0).sum()) for metric in self.metrics)

    @property
    def removed(self) -> int:
        """Nuisances that the data paid for."""
        return sum(metric.removed for metric in self.metrics)


def _metric(
    model: Model,
    stack: Stack,
    values: Mapping[str, float],
    nuisances: Sequence[str],
    scatter: bool,
    aside: np.ndarray,
) -> Metric:
    """The stack's metric at these values."""
    if stack.observable not in WAVEFORMS:
        return Metric(stack, stack.values, stack.values, aside=aside)
    wave, level, slope = parts_on(model, stack, values, slope=True)
    plain = Metric(stack, wave, slope, nuisances, aside=aside)
    if not scatter:
        return plain
    by_load = load_slope_on(model, stack, values)
    found = estimate_scatter(
        plain, scatter_shapes(stack, wave, by_load), stack.values - level - wave, stack.manoeuvre
    )
    return Metric(
        stack,
        wave,
        slope,
        nuisances,
        found,
        aside,
        load_bend_on(model, stack, found.load, by_load, values),
    )
