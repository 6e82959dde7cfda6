"""All candidates against one fitted model: statistic, family-wise p, held-out gain, size.

Base, signatures
    -> whitened, base Jacobian and offsets projected out -> scores by manoeuvre -> `selection`
    -> held-out losses with the candidate's columns added
       -> gain (whitened) and removal (mean square)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tirelog.diagnosis.candidates.sign_flips import Scores, flip_test, gain_and_error, surely_gains
from tirelog.diagnosis.candidates.signatures import Signature
from tirelog.diagnosis.rules import ALARM_P, BEYOND_DOUBT_P, LEAST_SHARE_OF_FLOOR
from tirelog.inference.base import Base
from tirelog.inference.floor import held_out_losses_with
from tirelog.inference.metric.offsets import Offsets, ProjectedOut
from tirelog.inference.metric.projection import per_group, side_by_side
from tirelog.vocabulary.arrays import FloatArray

#: a projected signature with less than this share of its norm left shows nothing of its own: the
#: effect would have to be a thousand times as large as what is seen of it; twice as much refuses
#: effects that are seen to a five hundredth
_INVISIBLE = 1e-3


@dataclass(frozen=True)
class Assessed:
    """A candidate's best variant, with its evidence.

    Statistic, family-wise p, strengths (k,) of the linear fit, held-out gain with its standard
    error, removed mean square [unit^2].
    """

    signature: Signature
    statistic: float
    p: float
    strengths: FloatArray
    gain: float
    gain_error: float
    removed: float

    @property
    def id(self) -> str:
        return self.signature.effect.id

    def alarms(self, base: Base) -> bool:
        """All three rules: significance, held-out gain, size beside what the base leaves.

        The size of what is beyond doubt is judged once it is refitted: if manoeuvres scatter,
        held-out errors do not tell it.
        """
        large = self.removed > LEAST_SHARE_OF_FLOOR * base.floor.square
        return (
            self.p <= ALARM_P
            and surely_gains(self.gain, self.gain_error, self.p, base.share(self.removed))
            and (large or self.p <= BEYOND_DOUBT_P)
        )


def nuisance(base: Base, more: FloatArray | None = None) -> ProjectedOut:
    """The whitened base Jacobian, logs' offsets and `more` (C, m, k), in the observable's unit."""
    parts = [base.fit.moving] if more is None else [base.fit.moving, more]
    return ProjectedOut.of(Offsets.of(base.cells, base.white), side_by_side(base.white, parts))


def assess(
    base: Base, signatures: Sequence[Signature], more: FloatArray | None = None
) -> tuple[list[Assessed], dict[str, str]]:
    """Every candidate's best variant, by falling statistic; and why some show nothing.

    `more`: columns to project out besides.
    """
    kept, scores, reasons = scores_of(base, signatures, more)
    statistic, p = flip_test(scores, base.cells.manoeuvres)
    best = best_variants(kept, statistic)
    losses = held_out_losses_with(
        base.cells,
        base.white,
        base.plain,
        base.fit,
        [[kept[i].columns] for i in best.values()],
    )
    found = [
        _assessed(base, kept[i], scores[i], float(statistic[i]), float(p[i]), held)
        for i, held in zip(best.values(), losses, strict=True)
    ]
    tested = {a.id for a in found}
    return sorted(found, key=lambda a: -a.statistic), {
        k: v for k, v in reasons.items() if k not in tested
    }


def least_left(base: Base, assessed: Sequence[Assessed]) -> float:
    """Held-out mean square [unit^2] above the floor, with one or all of the candidates.

    Linear fits, whichever leaves less: of all at once, columns may be too many for the manoeuvres.
    """
    if not assessed:
        return base.excess
    columns = [[a.signature.columns for a in assessed]]
    ((_, held),) = held_out_losses_with(base.cells, base.white, base.plain, base.fit, columns)
    by_all = float((base.held_plain - held).sum()) / base.plain.weight
    return base.excess - max(by_all, *(a.removed for a in assessed))


def best_variants(kept: Sequence[Signature], statistic: FloatArray) -> dict[str, int]:
    """The variant of each effect that has the largest statistic, by the effect's name."""
    best: dict[str, int] = {}
    for i, signature in enumerate(kept):
        name = signature.effect.id
        if name not in best or statistic[i] > statistic[best[name]]:
            best[name] = i
    return best


def scores_of(
    base: Base, signatures: Sequence[Signature], more: FloatArray | None = None
) -> tuple[list[Signature], list[Scores], dict[str, str]]:
    """The signatures that show something of their own, their scores, and why others do not."""
    other = nuisance(base, more)
    residual = other.without(
        base.white(
            np.where(np.isfinite(base.cells.values), base.cells.values - base.fit.prediction, 0.0)
        )
    )
    kept, scores = [], []
    reasons: dict[str, str] = {}
    for signature in signatures:
        white = base.white(signature.columns)
        left = other.without(white)
        visible = np.linalg.norm(left.reshape(-1, left.shape[-1]), axis=0) / np.linalg.norm(
            white.reshape(-1, white.shape[-1]), axis=0
        )
        if not np.any(visible > _INVISIBLE):
            reasons[signature.effect.id] = "does here only what the model's own parameters do"
            continue
        flat = left.reshape(-1, left.shape[-1])
        score = per_group(
            (np.swapaxes(left, 1, 2) @ residual[..., None])[..., 0], base.cells.manoeuvre
        )
        kept.append(signature)
        scores.append(Scores(score, flat.T @ flat, signature.one_sided))
    return kept, scores, reasons


def _assessed(
    base: Base,
    signature: Signature,
    scores: Scores,
    statistic: float,
    p: float,
    held: tuple[FloatArray, FloatArray],
) -> Assessed:
    """A candidate with its evidence; `held`: the losses (M,) with its columns."""
    held_white, held_plain = held
    gain, error = gain_and_error(base.held_white, held_white)
    removed = float((base.held_plain - held_plain).sum()) / base.plain.weight
    total = scores.scores.sum(axis=0)
    root = scores.root()
    strengths = root @ (root.T @ total)
    return Assessed(signature, statistic, p, strengths, gain, error, removed)
