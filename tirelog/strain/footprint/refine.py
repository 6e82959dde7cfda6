"""The log's form from the samples themselves.

What all passages share, with each one's own numbers taken out exactly.

    Reference (a start) + windows of some passages of each speed
        --normal equations per passage, its height, offset, shift, length, damping, tilt
          eliminated (Schur)--> steps of the shared parameters
        --until they stop--> Reference with errors; what is left, averaged along xi

At last the averages of what the rows leave about that form, by class, tell how far the tire's own
pressure and stiffness can be told from the length (`learn_form`).

Averages lump passages whose shifts and heights are known only so well; here nothing is lumped, and
the misfit is a true chi-square. Shared: bending length, tension, inertia (fall of the tension with
the squared speed), tread.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tirelog.strain.footprint.family import HIGHEST, LOWEST, EdgeShape
from tirelog.strain.footprint.fit import shape_table
from tirelog.strain.footprint.kernels import HEIGHT, LENGTH, OWN, SHIFT, class_sums
from tirelog.strain.footprint.reference import (
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
#: stay when the next step promises less than this of the whole chi-square, and stop when one has
#: changed it by less than this share; half of the latter goes on for some rounds with forms that
#: are those of no tire, and nowhere else
GOOD_ENOUGH, SMALL = 1.0, 0.01
#: a step that promises no more than this share of chi-square, and after which the form is NEAR, is
#: taken and believed: nobody looks at what it leaves, which goes with its square; twice as much
#: ends a round earlier in some logs
BELIEVED = 0.1
#: forms that are near each other: lengths and shifts in half lengths, bending lengths, tension and
#: tread, damping and tilt; twice as much leaves four times as much unseen
NEAR_LENGTH, NEAR = 0.002, np.array([0.02, 0.1, 0.1, 0.01, 0.01])
#: shared columns of a class (bending length, tension, tread), and the place of tension among the
#: columns of its table
SHARED, TENSION = 3, 6
#: weak knowledge of the shared parameters about their start: bending length (relative), tension,
#: inertia x squared top speed, tread
PRIOR_SD = np.array([2.0, 30.0, 1.0, 30.0])
#: a step moves the shared parameters, as of PRIOR_SD, by no more than this; twice as much lets a
#: wrong form throw them twice as far
MOST_STEP = np.array([0.3, 2.0, 2.0, 1.5])
#: weak knowledge of a passage's own damping and tilt; twice as much lets the noise of a passage
#: move them twice as far
ODD_SD = 0.5
#: a round moves a class' form by no more than this [m]; twice as much lets a first round with a
#: wrong form throw it farther
MOST_SHIFT = 0.01
#: cells of what is left, and the misfit above which it is more than noise
CELLS, REMARKABLE = 120, 1.3
#: passages with more than this times the usual misfit do not belong; three times the usual size;
#: twice as much keeps passages of 4.2 times
FOREIGN = 9.0
#: what an average misses by passages that are unlike each other, as a share of the height in each
#: cell: a third of it halves the errors of trapezoids, which are then 3.5 of these off; squared, in
#: such units, what a form that is believed may leave (blocks and soft sectors leave 4 to 40); sizes
#: of the form over the ordinary one
UNLIKE, MOST_MISFIT, SIZES = 3e-4, 2.0, (1.0, 0.3, 0.1, 0.03)
#: a form is sought with averages that are trusted more and more, and in few steps beside the tread
#: of the reference; up to this share of the highest wave number, beyond which there is noise
TRUSTS, FIRST_STEPS, FEW_STEPS, HIGHEST_SHARE = (0.01, 0.1, 1.0), 30, 5, 0.6
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


@dataclass(frozen=True)
class _Step:
    """What one class of speed says of the shared columns and of its passages.

    Normal matrix and right side of the shared columns (3, 3), (3,), how a passage's own numbers go
    with them in the mean (3, 6), the passages' own solutions (n, 6), chi2 and degrees of freedom
    of each (n,), what is left by cell and of how many samples.
    """

    normal: FloatArray
    right: FloatArray
    own_by: FloatArray
    own: FloatArray
    chi2: FloatArray
    free: FloatArray
    left: FloatArray
    counts: FloatArray

    @property
    def middle(self) -> FloatArray:
        """Medians of the passages' shifts, lengths [m], damping, tilt beside the form's, (4,)."""
        known = self.own[self.own[:, HEIGHT] != 0.0]
        if not len(known):
            return np.zeros(OWN - SHIFT)
        middle: FloatArray = np.median(known[:, SHIFT:] / known[:, [HEIGHT]], axis=0)
        return middle


def _class_step(
    reference: Reference, number: int, sample: Sample, noise: float, half_window_m: float
) -> _Step:
    """Normal equations of one class at the current form, without its passages' own numbers."""
    windows = sample.windows
    table, grid = shape_table(reference, number, half_window_m)
    sigma = noise / np.sqrt(windows.averaged)
    # the class' form holds at its own speed: the tension of each passage follows its squared speed
    sums = class_sums(
        windows.values,
        sample.motion,
        table,
        grid,
        -reference.inertia,
        TENSION,
        sigma,
        ODD_SD,
        CELLS,
    )
    return _Step(
        normal=sums.normal,
        right=sums.right,
        own_by=sums.own_by,
        own=sums.own,
        chi2=sums.chi2,
        free=np.maximum(sums.used - OWN, 1.0),
        left=sums.left / np.maximum(sums.counts, 1.0),
        counts=sums.counts,
    )


def _tire_columns(reference: Reference, number: int) -> FloatArray:
    """How bending length, tension and tread of a class follow the parameters, (3, 4).

    These are: relative bending length, tension, inertia x top speed^2, tread.
    """
    relative = (reference.speed_m_s[number] / reference.speed_m_s[-1]) ** 2
    ell = reference.shapes[number].bending_length_m
    return np.array([[ell, 0.0, 0.0, 0.0], [0.0, 1.0, -relative, 0.0], [0.0, 0.0, 0.0, 1.0]])


def _moved(reference: Reference, step: FloatArray, steps: list[_Step]) -> Reference:
    """The reference after a step of the shared parameters.

    Each class' length, damping and tilt go to the median of its passages, where these are after
    the step.
    """
    values, shifts = (
        np.array([shape.array() for shape in reference.shapes]),
        reference.shifts_m.copy(),
    )
    for number, one in enumerate(steps):
        shared = _tire_columns(reference, number) @ step
        values[number, [1, 2, 3]] += shared
        shift, length, damping, tilt = one.middle + shared @ one.own_by[:, SHIFT:]
        most = 0.2 * values[number, 0]
        shifts[number] += min(max(shift, -MOST_SHIFT), MOST_SHIFT)
        values[number, [0, 4, 5]] += np.clip(
            (length, damping, tilt), (-most, -0.2, -0.2), (most, 0.2, 0.2)
        )
    shapes = tuple(EdgeShape.of(row) for row in np.clip(values, LOWEST, HIGHEST))
    return replace(
        reference,
        shapes=shapes,
        shifts_m=shifts,
        inertia=reference.inertia + step[2] / reference.speed_m_s[-1] ** 2,
    )


def _in_place(reference: Reference, steps: list[_Step]) -> bool:
    """Whether each class' form lies where its passages do."""
    return all(
        np.abs(step.middle[:2]).max() < NEAR_LENGTH * shape.half_length_m
        for shape, step in zip(reference.shapes, steps, strict=True)
    )


def _near(one: Reference, other: Reference) -> bool:
    """Whether two forms at the same speeds are NEAR each other."""
    here, there = (np.array([shape.array() for shape in form.shapes]) for form in (one, other))
    lengths, change = here[:, 0], np.abs(there - here)
    change[:, 1] /= here[:, 1]
    moved = np.maximum(change[:, 0], np.abs(other.shifts_m - one.shifts_m))
    return bool((moved < NEAR_LENGTH * lengths).all() and (change[:, 1:] < NEAR).all())


def refine_edges(
    reference: Reference,
    samples: list[Sample],
    noise: float,
    half_window_m: float,
) -> tuple[Reference, list[Sample]]:
    """`reference` (one shape per sample, ascending speed) fitted to the samples; those that belong.

    `noise`: standard deviation of one sample of the log.
    """
    best: tuple[float, Reference, list[_Step], FloatArray] | None = None
    trial, samples = reference, list(samples)
    for _ in range(ROUNDS):
        steps = [_class_step(trial, k, s, noise, half_window_m) for k, s in enumerate(samples)]
        samples, steps = _without_foreign(samples, steps, trial, noise, half_window_m)
        free = float(sum(s.free.sum() for s in steps))
        misfit = float(sum(s.chi2.sum() for s in steps)) / free
        if best is not None and misfit >= best[0]:
            break  # where a whole step does harm, shorter ones gain next to nothing
        gain = np.inf if best is None else best[0] / misfit - 1.0
        normal, right = np.diag(PRIOR_SD**-2.0), np.zeros(4)
        for k, step in enumerate(steps):
            columns = _tire_columns(trial, k)
            normal += columns.T @ step.normal @ columns
            right += columns.T @ step.right
        best = misfit, trial, steps, normal
        shift = np.linalg.solve(normal, right)
        promised = float(shift @ right)
        if gain < SMALL or (promised < GOOD_ENOUGH * max(misfit, 1.0) and _in_place(trial, steps)):
            break
        moved = _moved(trial, np.clip(shift, -MOST_STEP, MOST_STEP), steps)
        if promised < BELIEVED * misfit * free and _near(trial, moved):
            best = misfit - promised / free, moved, steps, normal
            break
        trial = moved
    assert best is not None
    misfit, found, steps, normal = best
    return _finished(found, steps, normal, misfit, half_window_m), samples


def _without_foreign(
    samples: list[Sample],
    steps: list[_Step],
    reference: Reference,
    noise: float,
    half_window_m: float,
) -> tuple[list[Sample], list[_Step]]:
    """Samples without the passages that fit the start much worse than their neighbours do."""
    kept, again = [], []
    for number, (sample, step) in enumerate(zip(samples, steps, strict=True)):
        share = step.chi2 / step.free
        good = (share < FOREIGN * max(float(np.median(share)), 1.0)) & (step.own[:, 0] > 0)
        if good.all() or not good.any():
            kept.append(sample)
            again.append(step)
        else:
            kept.append(sample.take(good))
            again.append(_class_step(reference, number, kept[-1], noise, half_window_m))
    return kept, again


def _finished(
    reference: Reference,
    steps: list[_Step],
    normal: FloatArray,
    misfit: float,
    half_window_m: float,
) -> Reference:
    """The reference with its errors, its misfit and what it leaves."""
    covariance = np.linalg.inv(normal) * max(misfit, 1.0)
    errors = []
    for number, step in enumerate(steps):
        by = step.own_by[:, LENGTH] @ _tire_columns(reference, number)
        errors.append(2.0 * float(np.sqrt(max(float(by @ covariance @ by), 0.0))))
    centres = _centres(half_window_m)
    left = np.array([np.convolve(step.left, (0.25, 0.5, 0.25), "same") for step in steps])
    return replace(
        reference,
        heights=np.array([float(np.median(step.own[:, 0])) for step in steps]),
        length_se_m=np.array(errors),
        misfit=misfit,
        freedom=float(sum(step.free.sum() for step in steps)),
        residual_xi_m=centres if misfit > REMARKABLE else None,
        residuals=left if misfit > REMARKABLE else None,
    )


def _centres(half_window_m: float) -> FloatArray:
    """Abscissae of the CELLS [m]."""
    return (np.arange(float(CELLS)) + 0.5) * (2.0 * half_window_m / CELLS) - half_window_m


def _average(
    reference: Reference, number: int, sample: Sample, step: _Step, noise: float, window_m: float
) -> Average:
    """Mean passage of a class, each row put where the class' form is.

    What is quadratic in the rows' lengths and shifts, which are linear in their fits, is taken off.
    """
    family, shape = reference.family, reference.shapes[number]
    spectra, kappa, xi = family.jacobian(shape), family.kappa_1_m, _centres(window_m)
    own = step.own[step.own[:, HEIGHT] > 0.0]
    apart = np.diff(np.quantile(own[:, SHIFT:] / own[:, :1], (0.16, 0.84), axis=0), axis=0)[0]
    spread = 0.5 * (0.5 * apart) ** 2
    change = np.column_stack([-1j * kappa * spectra[:, 0], spectra[:, [1, 5, 6]]]) @ step.middle
    bent = spread[1] * family.second_by_length(shape) - spread[0] * kappa**2 * spectra[:, 0]
    plain, moved = (family.basis(xi) @ np.column_stack([spectra[:, 0], change - bent])).real.T
    height, size = float(np.median(own[:, HEIGHT])), float(np.ptp(plain))
    sigma2 = noise**2 / (sample.windows.averaged * np.maximum(step.counts, 1.0))
    weight = (step.counts > 0.0) / (sigma2 / (height * size) ** 2 + UNLIKE**2)
    values = (plain + moved + step.left) / size
    return Average(sample.speed_m_s, xi, values, weight, np.zeros(CELLS))


def learn_form(
    reference: Reference, samples: list[Sample], noise: float, half_window_m: float
) -> Reference:
    """`reference` with the tire's own form, if that earns its place, and its share of the error.

    The evidence decides on the form's size: the prior of each number times one of SIZES. If it is
    the least, or the form leaves more than noise, the reference stays. The length is the mean, its
    error the standard deviation over all lengths that the averages and the prior allow, each with
    the form that fits best there: the valley of length against pressure is bent.
    """
    steps = [_class_step(reference, k, s, noise, half_window_m) for k, s in enumerate(samples)]
    samples, steps = _without_foreign(samples, steps, reference, noise, half_window_m)
    averages = [
        _average(reference, number, *both, noise, half_window_m)
        for number, both in enumerate(zip(samples, steps, strict=True))
    ]
    family = reference.family.up_to(HIGHEST_SHARE)
    problem = AverageFit(family, averages, reference.shapes[0].half_length_m, own=True)
    start = problem.start(reference)
    sides = problem.at(start, None)
    here = [judged(problem, start, size, *sides) for size in SIZES]
    promised = np.array([one.evidence + one.promise for one in here])
    chances = np.exp(promised - promised.max())
    unseen = np.array([problem.length_error(one.normal) for one in here[:-1]])
    unseen = np.minimum(unseen, unseen[1])  # a large form that is not learnt is none, but a misfit
    share = UNFOLLOWED * float(np.sqrt(chances[:-1] @ unseen**2 / chances.sum()))
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
    if best.misfit > MOST_MISFIT * sum(np.count_nonzero(one.weight) for one in averages):
        return plain
    middle, step = problem.length(best.theta), np.clip(problem.length_error(best.normal), *STEPS)
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
    return refine_edges(formed, samples, noise, half_window_m)[0]
