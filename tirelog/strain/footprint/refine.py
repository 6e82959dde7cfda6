"""The log's form from the samples themselves.

What all passages share, with each one's own numbers taken out exactly.

    Reference (a start) + windows of some passages of each speed
        --height, offset, shift, length, damping, tilt of each passage eliminated--> what is left,
          averaged along xi by class of speed: mean passages, each put where the form is
        --`reference.AverageFit`--> the shared parameters; again, until they stay
    Reference with errors --`learn_form`--> with the tire's own pressure and stiffness

The misfit is a true chi-square, of the samples. Shared: bending length, tension, inertia (fall of
the tension with the squared speed), tread.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tirelog.strain.footprint.fit import shape_table
from tirelog.strain.footprint.kernels import HEIGHT, OWN, SHIFT, ClassSums, class_sums
from tirelog.strain.footprint.reference import (
    HIGHEST_SHARE,
    TREAD,
    Average,
    AverageFit,
    Reference,
    descend,
    judged,
)
from tirelog.strain.footprint.windows import PatchWindows
from tirelog.vocabulary.arrays import FloatArray, Records

#: rounds of refining, at most; twice as many only help a refinement that has not settled by then
ROUNDS = 6
#: stay when the next round promises less than this of the whole chi-square, and stop when one has
#: changed it by less than this share; half of the latter goes on for some rounds with forms that
#: are those of no tire, and nowhere else
GOOD_ENOUGH, SMALL = 1.0, 0.01
#: weak knowledge of a passage's own damping and tilt; twice as much lets the noise of a passage
#: move them twice as far
ODD_SD = 0.5
#: cells of what is left, and the misfit above which it is more than noise
CELLS, REMARKABLE = 120, 1.3
#: weight of a cell without samples, so that a class without any is known to nothing and not unknown
LEAST_WEIGHT = 1e-6
#: passages with more than this times the usual misfit do not belong; three times the usual size;
#: twice as much keeps passages of 4.2 times
FOREIGN = 9.0
#: what an average misses by passages that are unlike each other, as a share of the height in each
#: cell: a third of it halves the errors of trapezoids, which are then 3.5 of these off; squared, in
#: such units, what a form that is believed may leave (blocks and soft sectors leave 4 to 40); sizes
#: of the form over the ordinary one
UNLIKE, MOST_MISFIT, SIZES = 3e-4, 2.0, (1.0, 0.3, 0.1, 0.02)
#: a form is sought with averages that are trusted more and more, and in few steps beside the tread
#: of the reference
TRUSTS, FIRST_STEPS, FEW_STEPS = (0.01, 0.1, 1.0), 30, 5
#: lengths (logarithm) that are tried: at first an error apart, within these bounds, then twice as
#: far, until the evidence falls by so much, or that far
STEPS, UNLIKELY, FARTHEST = (0.002, 0.02), 5.0, 0.3
#: a form is learnt if the fastest class has so many times the speed of the slowest: at one speed a
#: traction or the stiffness is as good as a pressure
SPEEDS = 1.4
#: error of a length over what the prior of the form's series gives: boxes and trapezoids, which the
#: series does not follow, are 1 to 2.1 times that off; the error is proportional to it
UNFOLLOWED = 2.0


@dataclass(frozen=True)
class Sample:
    """Windows of passages of about one speed, and their `motion` (`PatchWindows.motion`)."""

    windows: PatchWindows
    motion: Records

    @property
    def speed_m_s(self) -> float:
        """Root mean square of the passages' speeds."""
        return float(np.sqrt(np.mean(self.motion["speed_m_s"] ** 2)))

    def take(self, which: NDArray[np.bool_]) -> Sample:
        """The rows `which` (mask)."""
        return Sample(self.windows.take(which), self.motion[which])


def _sums(
    reference: Reference, number: int, sample: Sample, noise: float, half_window_m: float
) -> ClassSums:
    """What the passages of one class leave about the form, each put where it is.

    The class' form holds at its own speed: the tension of each passage follows its squared speed.
    """
    windows = sample.windows
    table, grid = shape_table(reference, number, half_window_m)
    sigma = noise / np.sqrt(windows.averaged)
    return class_sums(
        windows.values, sample.motion, table, grid, -reference.inertia, sigma, ODD_SD, CELLS
    )


def _averages(
    reference: Reference,
    samples: list[Sample],
    sums: list[ClassSums],
    noise: float,
    half_window_m: float,
    unlike: float,
) -> list[Average]:
    """Mean passages of the classes, each row put where the class' form is.

    What is quadratic in the rows' lengths and shifts, which are linear in their fits, is taken off.
    `unlike`: what a mean misses, as a share of its height.
    """
    family, xi = reference.family.up_to(HIGHEST_SHARE), _centres(half_window_m)
    basis, kappa, made = family.basis(xi), family.kappa_1_m, []
    for shape, sample, one in zip(reference.shapes, samples, sums, strict=True):
        spectra, own = family.jacobian(shape), one.own[one.own[:, HEIGHT] > 0.0]
        own = own if len(own) else np.eye(OWN)[:1]  # no passage is like the form: it stays there
        beside = own[:, SHIFT:] / own[:, :1]
        low, middle, high = np.quantile(beside, (0.16, 0.5, 0.84), axis=0)
        spread = 0.5 * (0.5 * (high - low)) ** 2
        change = np.column_stack([-1j * kappa * spectra[:, 0], spectra[:, [1, 5, 6]]]) @ middle
        bent = spread[1] * family.second_by_length(shape) - spread[0] * kappa**2 * spectra[:, 0]
        plain, moved = (basis @ np.column_stack([spectra[:, 0], change - bent])).real.T
        height, size = float(np.median(own[:, HEIGHT])), float(np.ptp(plain))
        counts = np.maximum(one.counts, 1.0)
        sigma2 = noise**2 / (sample.windows.averaged * counts)
        weight = (one.counts > 0.0) / (sigma2 / (height * size) ** 2 + unlike**2) + LEAST_WEIGHT
        values = (plain + moved + one.left / counts) / size
        made.append(Average(sample.speed_m_s, xi, values, weight, np.zeros(CELLS)))
    return made


def refine_edges(
    reference: Reference,
    samples: list[Sample],
    noise: float,
    half_window_m: float,
) -> Reference:
    """`reference` (one shape per sample, ascending speed) fitted to the samples.

    `noise`: standard deviation of one sample of the log.
    """
    best, trial = reference, reference
    for again in range(ROUNDS):
        sums = [_sums(trial, k, s, noise, half_window_m) for k, s in enumerate(samples)]
        samples, sums = _without_foreign(samples, sums, trial, noise, half_window_m)
        free = float(sum(one.free.sum() for one in sums))
        misfit = float(sum(one.chi2.sum() for one in sums)) / free
        if again and misfit >= best.misfit:
            break  # where a whole step does harm, shorter ones gain next to nothing
        gain = best.misfit / misfit - 1.0 if again else np.inf
        averages = _averages(trial, samples, sums, noise, half_window_m, 0.0)
        problem = AverageFit(trial.family, averages, trial.shapes[0].half_length_m, own=False)
        start = problem.start(trial)
        found = descend(problem, start)
        left = np.array([one.left / np.maximum(one.counts, 1.0) for one in sums])
        smooth = np.array([np.convolve(row, (0.25, 0.5, 0.25), "same") for row in left])
        lengths = np.array([shape.half_length_m for shape in trial.shapes])
        errors = np.sqrt(np.diag(problem.lengths(found.normal)) * max(misfit, 1.0))
        best = replace(
            trial,
            heights=np.array([float(np.median(one.own[:, HEIGHT])) for one in sums]),
            length_se_m=2.0 * lengths * errors,
            misfit=misfit,
            freedom=free,
            residual_xi_m=_centres(half_window_m) if misfit > REMARKABLE else None,
            residuals=smooth if misfit > REMARKABLE else None,
        )
        if gain < SMALL or found.gain < GOOD_ENOUGH * max(misfit, 1.0):
            break
        trial = problem.reference(found.theta, trial)
    return best


def _without_foreign(
    samples: list[Sample],
    sums: list[ClassSums],
    reference: Reference,
    noise: float,
    half_window_m: float,
) -> tuple[list[Sample], list[ClassSums]]:
    """Samples without the passages that fit the start much worse than their neighbours do."""
    kept, again = list(samples), list(sums)
    for number, one in enumerate(sums):
        share = one.chi2 / one.free
        good = (share < FOREIGN * max(float(np.median(share)), 1.0)) & (one.own[:, HEIGHT] > 0)
        if good.any() and not good.all():
            kept[number] = samples[number].take(good)
            again[number] = _sums(reference, number, kept[number], noise, half_window_m)
    return kept, again


def _centres(half_window_m: float) -> FloatArray:
    """Abscissae of the CELLS [m]."""
    return (np.arange(float(CELLS)) + 0.5) * (2.0 * half_window_m / CELLS) - half_window_m


def learn_form(
    reference: Reference, samples: list[Sample], noise: float, half_window_m: float
) -> Reference:
    """`reference` with the tire's own form, if that earns its place, and its share of the error.

    The evidence decides on the form's size: the prior of each number times one of SIZES. If it is
    the least, or the form leaves more than noise, the reference stays. The length is the mean, its
    error the standard deviation over all lengths that the averages and the prior allow, each with
    the form that fits best there: the valley of length against pressure is bent.
    """
    sums = [_sums(reference, k, s, noise, half_window_m) for k, s in enumerate(samples)]
    samples, sums = _without_foreign(samples, sums, reference, noise, half_window_m)
    averages = _averages(reference, samples, sums, noise, half_window_m, UNLIKE)
    problem = AverageFit(reference.family, averages, reference.shapes[0].half_length_m, own=True)
    start = problem.start(reference)
    here = [judged(problem, start, size) for size in SIZES]
    promised = np.array([one.evidence + one.promise for one in here])
    chances = np.exp(promised - promised.max())
    unseen = np.array([problem.lengths(one.normal).mean() ** 0.5 for one in here])
    unseen[0] /= UNFOLLOWED  # what looks like a large form, and is none, is mostly a misfit
    share = UNFOLLOWED * float(np.sqrt(chances @ unseen**2 / chances.sum()))
    plain = replace(reference, form_share=share)
    speeds = reference.speed_m_s
    if np.argmax(promised) == len(SIZES) - 1 or speeds[-1] < SPEEDS * speeds[0]:
        return plain
    # the tread may have stood for the form, or be what it is beside
    kept = descend(problem, start, SIZES[0], steps=FEW_STEPS)
    start[TREAD] = 0.0
    for problem.trust in TRUSTS:
        best = descend(problem, start, SIZES[0], steps=FIRST_STEPS)
        start = best.theta
    best, chosen = max(best, kept, key=lambda one: one.evidence), SIZES[0]
    for size in SIZES[1:-1]:
        found = descend(problem, best.theta, size)
        if found.evidence < best.evidence:
            break
        best, chosen = found, size
    if best.misfit > MOST_MISFIT * sum(np.sum(one.weight > 1.0) for one in averages):
        return plain
    middle, step = (
        problem.length(best.theta),
        np.clip(problem.lengths(best.normal).mean() ** 0.5, *STEPS),
    )
    nodes = {0.0: descend(problem, best.theta, chosen, middle)}
    for sign in (1.0, -1.0):
        place, last = sign * step, nodes[0.0]
        while abs(place) < FARTHEST:
            nodes[place] = last = descend(problem, last.theta, chosen, middle + place)
            if last.evidence < max(n.evidence for n in nodes.values()) - UNLIKELY:
                break
            place *= 2.0
    places = np.array(sorted(nodes))
    fine = np.linspace(places[0], places[-1], 400)
    chance = np.interp(fine, places, [nodes[place].evidence for place in places])
    chance = np.exp(chance - chance.max())
    mean = float(chance @ fine / chance.sum())
    share = UNFOLLOWED * float(np.sqrt(chance @ (fine - mean) ** 2 / chance.sum()))
    near = nodes[min(nodes, key=lambda place: abs(place - mean))].theta
    theta = descend(problem, near, chosen, middle + mean).theta
    formed = replace(problem.reference(theta, reference), form_share=share)
    return refine_edges(formed, samples, noise, half_window_m)
