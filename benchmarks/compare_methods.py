"""The usual rules beside ours on the same cases and signatures: F-test, BIC, thresholded sparse
regression, its bagged form.

    python -m benchmarks.compare_methods [--nulls 10] [--seed 3000]

Sparse regression is PySINDy's STLSQ and EnsembleOptimizer with a threshold chosen by
cross-validation over manoeuvres; without PySINDy installed (`pip install pysindy`) these two are
left out. All see what our own test sees: whitened residual and signatures with the base Jacobian
and the offsets projected out.
"""

import argparse
import importlib.util
import sys
import warnings
from collections import Counter
from collections.abc import Callable

import numpy as np
from scipy.stats import f as f_distribution

from benchmarks.cases import IN_CATALOGUE, Case, case
from tirelog.diagnosis.candidates.assessment import (
    all_signatures,
    assess,
    beside_base,
    candidate_effects,
)
from tirelog.diagnosis.candidates.naming import next_step
from tirelog.inference.base import Base, prepare
from tirelog.inference.cells.cells import cells_of
from tirelog.inference.cells.pieces import pieces_of
from tirelog.inference.stacks.cut import joined, stacks_from_logs
from tirelog.physics.model.model import Model
from tirelog.simulation import simulate, to_recording

F_LEVEL, BIC_MARGIN = 0.0027, 10.0
THRESHOLDS = np.geomspace(1e-3, 1.0, 8)
FOLDS = 5


class Seen:
    """One case as every rule sees it: residual (N,), columns (N, K) of unit norm with the effect of
    each, manoeuvre (N,).
    """

    def __init__(self, base: Base) -> None:
        known, residual = beside_base(base)
        found, _ = all_signatures(base, candidate_effects(base.model))
        best, _ = assess(base, found)
        self.residual = residual.reshape(-1)
        self.effects = [a.id for a in best for _ in a.signature.strengths]
        projected = [known.without(base.white(a.signature.columns)) for a in best]
        columns = np.concatenate([x.reshape(self.residual.size, -1) for x in projected], axis=1)
        self.columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        self.manoeuvre = np.repeat(base.cells.manoeuvre, residual.shape[1])
        self.freedom = base.fit.freedom
        self.base = base


def drops(seen: Seen) -> dict[str, tuple[float, int]]:
    """Effect -> (fall of chi-square with its columns, number of columns)."""
    result = {}
    for name in dict.fromkeys(seen.effects):
        x = seen.columns[:, [e == name for e in seen.effects]]
        theta = np.linalg.lstsq(x, seen.residual, rcond=1e-6)[0]
        result[name] = (
            float((seen.residual**2).sum() - ((seen.residual - x @ theta) ** 2).sum()),
            x.shape[1],
        )
    return result


def by_f_test(seen: Seen) -> str:
    total = float((seen.residual**2).sum())
    p = {
        n: f_distribution.sf(d / k / ((total - d) / (seen.freedom - k)), k, seen.freedom - k)
        for n, (d, k) in drops(seen).items()
    }
    p_of_best = min(p.values())
    largest = max(drops(seen).items(), key=lambda item: item[1][0])[0]
    return largest if p_of_best < F_LEVEL else ""


def by_bic(seen: Seen) -> str:
    gain = {n: d - k * np.log(seen.residual.size) for n, (d, k) in drops(seen).items()}
    best = max(gain, key=lambda n: gain[n])
    return best if gain[best] > BIC_MARGIN else ""


def by_sparse(ensemble: bool) -> Callable[[Seen], str]:
    from pysindy.optimizers import STLSQ, EnsembleOptimizer

    def fitted(threshold: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        optimizer = STLSQ(threshold=threshold, alpha=1e-6)
        if ensemble:
            optimizer = EnsembleOptimizer(optimizer, bagging=True, n_models=10)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            optimizer.fit(x, y[:, None])
        return np.asarray(optimizer.coef_).ravel()

    def fewer(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Least squares by fewer rows: exactly, by the triangle of a QR decomposition; for bags by
        every eighth row.
        """
        if ensemble:
            return x[::8] * np.sqrt(8.0), y[::8] * np.sqrt(8.0)
        triangle = np.linalg.qr(np.column_stack([x, y]), mode="r")
        return triangle[:, :-1], triangle[:, -1]

    def rule(seen: Seen) -> str:
        scale = float(np.linalg.norm(seen.residual))
        x, y = seen.columns, seen.residual / scale
        fold = seen.manoeuvre % FOLDS
        loss = []
        for threshold in THRESHOLDS:
            parts = [
                (fitted(threshold, *fewer(x[fold != k], y[fold != k])), fold == k)
                for k in range(FOLDS)
            ]
            loss.append(sum(float(((y[out] - x[out] @ c) ** 2).sum()) for c, out in parts))
        coefficients = fitted(THRESHOLDS[int(np.argmin(loss))], *fewer(x, y))
        return seen.effects[int(np.argmax(np.abs(coefficients)))] if np.any(coefficients) else ""

    return rule


def ours(seen: Seen) -> str:
    step = next_step(seen.base)
    return step.named.id if step.named else ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--nulls", type=int, default=10)
    parser.add_argument("--seed", type=int, default=3000)
    options = parser.parse_args()
    rules: dict[str, Callable[[Seen], str]] = {"F-test": by_f_test, "BIC": by_bic, "ours": ours}
    if importlib.util.find_spec("pysindy"):
        rules |= {"STLSQ": by_sparse(False), "STLSQ, bagged": by_sparse(True)}
    plan = [("null", (), 0.0)] * options.nulls + [
        ("null, 1 % load scatter", (), 0.01)
    ] * options.nulls
    plan += [("one effect", (name,), 0.0) for name in IN_CATALOGUE]
    hits: Counter[tuple[str, str]] = Counter()
    of: Counter[str] = Counter()
    for i, (kind, effects, scatter) in enumerate(plan):
        logs = case(effects, seed=options.seed + i, how=Case(logs=2, scatter=scatter))
        stacks = stacks_from_logs(
            [to_recording(simulate(log), str(k)) for k, log in enumerate(logs)]
        )
        seen = Seen(prepare(cells_of(pieces_of(joined(stacks))), Model.new("beam", radius_m=0.305)))
        of[kind] += 1
        for name, rule in rules.items():
            said = rule(seen)
            hits[kind, name] += said == effects[0] if effects else bool(said)
        print(f"{i + 1}/{len(plan)}", end="\r", file=sys.stderr, flush=True)
    for kind in of:
        what = "named right" if kind == "one effect" else "false alarms"
        print(
            f"{kind:24} {what:13} "
            + "   ".join(f"{name} {hits[kind, name]}/{of[kind]}" for name in rules)
        )


if __name__ == "__main__":
    main()
