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

from tirelog.diagnosis.candidates.effect_jacobians import Signature
from tirelog.diagnosis.rules import ALARM_P, BEYOND_DOUBT_P, GAIN_SIGMAS, LEAST_SHARE_OF_FLOOR, MOST
from tirelog.inference.base import Base
from tirelog.inference.floor import held_out_losses_with
from tirelog.inference.metric import Offsets, ProjectedOut, per_group, side_by_side
from tirelog.vocabulary.arrays import FloatArray

# ---- Whether an effect is there: significance, held-out gain and size.
#
# Joint sign flips of manoeuvres with the maximum over candidates, leave-one-manoeuvre-out gain, and
# the size rule.
#
#     scores (M, k) of each candidate: inner product of its projected signature with the projected
#         residual, manoeuvre by manoeuvre
#     T = | L^-1 sum of scores |, L L' = Gram of the projected signature (one column: sum / norm;
#     only
#         its sign if one is physical)
#     the same signs for all candidates flip a manoeuvre as a whole; p of a candidate = share of
#     flips
#         whose *largest* T reaches its T
#
# If nothing is missing a manoeuvre's scores are as likely to point one way as the other, whatever
# the
# correlation inside the manoeuvre: the rate of false alarms over all candidates is p. The
# smallest p
# that M manoeuvres allow is 2^-M, or 2^(1-M) if both signs count.


#: up to so many manoeuvres all patterns of signs are tried, 2^13; each more doubles the time
_EXACT = 13
#: and beyond them so many random ones, some at a time: they tell a p of ALARM_P to 8 % of it; twice
#: as many to 5.5 %
_RANDOM = 16383
#: patterns of signs that are worked on at a time: memory and time depend on it alone
_BLOCK = 1024


@dataclass(frozen=True)
class Scores:
    """One signature's evidence: scores (M, k), Gram (k, k).

    `one_sided` if only a positive strength is physical (k = 1).
    """

    scores: FloatArray
    gram: FloatArray
    one_sided: bool = False

    def root(self) -> FloatArray:
        """(k, r) W with T = | scores W |.

        The inverse root of the Gram matrix on its support, whatever units the strengths have.
        """
        length = np.sqrt(np.diag(self.gram))
        length = np.where(length > 0.0, length, np.inf)
        values, vectors = np.linalg.eigh(self.gram / length[:, None] / length)
        keep = values > 1e-8 * max(float(values[-1]), 1e-300)
        root: FloatArray = vectors[:, keep] / np.sqrt(values[keep]) / length[:, None]
        return root


def least_p(manoeuvres: int) -> float:
    """The smallest p that the test can give for a one-sided question.

    What is within twice of it is "at most" that.
    """
    return 0.5**manoeuvres if manoeuvres <= _EXACT else 1.0 / (_RANDOM + 1)


def flip_signs(manoeuvres: int, seed: int = 0) -> FloatArray:
    """Sign patterns of the manoeuvres, (F, M) of +-1.

    All of them up to 13 manoeuvres, else random ones; the first is what was measured.
    """
    if manoeuvres <= _EXACT:
        bits = (np.arange(2**manoeuvres)[:, None] >> np.arange(manoeuvres)) & 1
        return np.asarray(1.0 - 2.0 * bits, dtype=np.float64)
    random, signs = np.random.default_rng(seed), np.empty((_RANDOM + 1, manoeuvres))
    for start in range(
        0, signs.shape[0], _BLOCK
    ):  # row by row, so that the signs are those of one draw
        block = signs[start : start + _BLOCK]
        block[:] = random.integers(0, 2, block.shape) * 2.0 - 1.0
    signs[0] = 1.0
    return signs


def statistics(candidates: Sequence[Scores], signs: FloatArray) -> FloatArray:
    """T of every candidate under every flip, (F, K)."""
    result = np.zeros((signs.shape[0], len(candidates)))
    for i, candidate in enumerate(candidates):
        root = candidate.root()
        projected = candidate.scores @ root
        for start in range(0, signs.shape[0], _BLOCK):
            rows = slice(start, start + _BLOCK)
            flipped = signs[rows] @ projected
            if flipped.shape[1] == 1:
                sign = np.sign(root[0, 0]) if candidate.one_sided else 1.0
                result[rows, i] = (
                    np.maximum(sign * flipped[:, 0], 0.0)
                    if candidate.one_sided
                    else np.abs(flipped[:, 0])
                )
            else:
                result[rows, i] = np.linalg.norm(flipped, axis=1)
    return result


def flip_test(candidates: Sequence[Scores], manoeuvres: int) -> tuple[FloatArray, FloatArray]:
    """(T (K,), family-wise p (K,)) of the candidates."""
    if not candidates:
        return np.zeros(0), np.zeros(0)
    all_t = statistics(candidates, flip_signs(manoeuvres))
    largest = np.sort(all_t.max(axis=1))
    observed = all_t[0]
    reached = largest.size - np.searchsorted(largest, observed * (1.0 - 1e-9), side="left")
    return observed, reached / largest.size


def surely_gains(gain: float, error: float, p: float, share: float) -> bool:
    """Is a held-out gain more than the scatter of manoeuvres?

    `p` of what gains, family-wise; `share` of the excess that it removes held out. What can be
    gained differs with what each manoeuvre is driven under: of an effect of few of them the gains
    scatter by as much as they are. If their signs agree beyond doubt and most of the excess goes,
    that scatter is no doubt.
    """
    return gain > GAIN_SIGMAS * error or (p <= BEYOND_DOUBT_P and share >= MOST)


def gain_and_error(before: FloatArray, after: FloatArray) -> tuple[float, float]:
    """Held-out gain, summed over manoeuvres (M,), and its standard error from their scatter."""
    gain = before - after
    return float(gain.sum()), float(
        np.sqrt(gain.size) * gain.std(ddof=1)
    ) if gain.size > 1 else float("inf")


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
