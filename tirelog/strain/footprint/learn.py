"""The log's form: what all passages share, with each one's own numbers taken out exactly.

Passages
    --clean ones, preferably at steady speed, by classes of speed, in clusters-->
    windows of a few hundred
    --those of one speed: scaled by their heights, cells along xi--> average --form--> a start
    --height, offset, shift, length, damping, tilt of each passage eliminated--> what is left,
      averaged along xi by class of speed: mean passages, each put where the form is
    --`reference.AverageFit`--> the shared parameters; again, until they stay
    --`learn_form`--> with the tire's own pressure and stiffness: EdgeForm

The misfit is a true chi-square, of the samples. Shared: bending length, tension, inertia (fall of
the tension with the squared speed), tread.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tirelog.data.recording import BLOCK_SAMPLES, Channel
from tirelog.strain.footprint.kernels import (
    FIT,
    GRID,
    MOTION,
    OWN,
    fit_rows,
)
from tirelog.strain.footprint.reference import (
    AVERAGE,
    CELLS,
    HALF_LENGTH,
    HIGHEST,
    HIGHEST_SHARE,
    LOWEST,
    TILT,
    TREAD,
    AverageFit,
    ComplexArray,
    EdgeFamily,
    Reference,
    cell_basis,
    cell_centres,
    descend,
    judged,
)
from tirelog.strain.passages.find import Passages
from tirelog.strain.passages.match import clusters
from tirelog.strain.passages.template import LENGTH_TO_WIDTH
from tirelog.vocabulary.arrays import BoolArray, FloatArray, IntArray, Record, Records, records
from tirelog.vocabulary.quality import good

# ---- Rectangular windows of a channel around its passages.
#
# With the distance of every sample along the tread.
#
#     Channel + Passages
#         --passages of similar window length, read one stretch of the log at a time-->
#         PatchWindows (rows x columns)
#         --neighbouring samples averaged if they lie closer than needed-->
#         PatchWindows, fewer columns
#
# A row's window depends on its own passage only (its length is the next power of two above what its
# speed needs), so rows do not change with the blocks that are read. Values are turned so that the
# patch is a minimum, whatever the surface.


#: speed and acceleration at the passages of a log, (n,) each
Motions = tuple[FloatArray, FloatArray]


@dataclass(frozen=True)
class PatchWindows:
    """Windows of some passages: rows of samples with the patch downward.

    `row` (n,): ordinals of the passages; `values` (n, m): strain, patch downward, NaN where lost or
    beyond a gap; `motion` (n,) of MOTION: where the patch centre is and how the row moves;
    `averaged`: samples per column.
    """

    row: IntArray
    values: FloatArray
    motion: Records
    averaged: int = 1

    @property
    def rate_Hz(self) -> float:
        """Columns per second."""
        return float(self.motion["rate_Hz"][0])

    @property
    def speed_m_s(self) -> float:
        """Root mean square of the passages' speeds."""
        return float(np.sqrt(np.mean(self.motion["speed_m_s"] ** 2)))

    def take(self, which: Any) -> PatchWindows:
        """The rows `which` (mask, slice or indices)."""
        return PatchWindows(self.row[which], self.values[which], self.motion[which], self.averaged)

    def alike(self, keys: IntArray) -> Iterator[tuple[int, PatchWindows]]:
        """The rows in groups of equal `keys` (one per passage of the log)."""
        own = keys[self.row]
        for key in np.unique(own):
            same = own == key
            yield int(key), self if same.all() else self.take(same)

    def reduced(self, averaged: int) -> PatchWindows:
        """The same windows with `averaged` neighbouring columns as one, NaN if any is lost."""
        if averaged <= 1:
            return self
        count = self.values.shape[1] // averaged
        parts = self.values[:, : count * averaged].reshape(len(self.row), count, averaged)
        motion = self.motion.copy()
        motion["centre"] = (motion["centre"] - 0.5 * (averaged - 1)) / averaged
        motion["rate_Hz"] /= averaged
        return PatchWindows(self.row, parts.mean(axis=2), motion, self.averaged * averaged)


def gather_windows(
    channel: Channel,
    sign: float,
    index: FloatArray,
    motions: Motions,
    reach_samples: FloatArray,
    rows: IntArray,
) -> Iterator[PatchWindows]:
    """Windows around `index` of the passages `rows`, those of one length in a block at a time.

    `index`: fractional samples, NaN is left out. `sign`: +1 if the patch is a maximum of the
    recorded signal; `motions` and `reach_samples` (n,) of all passages, half of the window that
    each needs. The channel is read in blocks of about BLOCK_SAMPLES.

    Half a window is rounded up to 2^k or 3 x 2^k, at least 8 (quick lengths of an FFT). A passage
    whose speed is unknown has no reach; nothing is cut out for it.
    """
    rows = rows[np.isfinite(index[rows])]
    needed = np.fmax(np.minimum(reach_samples, channel.size), 8.0)
    two = 2.0 ** np.ceil(np.log2(needed))
    half = np.where(needed <= 0.75 * two, 0.75 * two, two).astype(np.int64)
    block = np.floor(index[rows] / BLOCK_SAMPLES).astype(np.int64)
    for number in np.unique(block):
        inside = rows[block == number]
        nearest = np.round(index[inside]).astype(np.int64)
        low = max(int((nearest - half[inside]).min()), 0)
        high = min(int((nearest + half[inside]).max()) + 1, channel.size)
        samples = -sign * np.ascontiguousarray(channel.read(low, high), np.float64)
        for size in np.unique(half[inside]).tolist():
            some = inside[half[inside] == size]
            motion = records(
                MOTION,
                centre=index[some] - np.round(index[some]) + size,
                rate_Hz=channel.axis.rate_Hz,
                speed_m_s=motions[0][some],
                acceleration_m_s2=motions[1][some],
            )
            yield PatchWindows(some, _cut(channel, samples, low, index[some], size), motion)


def joined_windows(parts: list[PatchWindows]) -> PatchWindows:
    """One set of windows from several of the same length and rate."""
    row, values, motion = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("row", "values", "motion")
    )
    return replace(parts[0], row=row, values=values, motion=motion)


def _cut(
    channel: Channel, samples: FloatArray, low: int, index: FloatArray, size: int
) -> FloatArray:
    """Windows (n, 2 size) about `index` (n,) out of `samples`, NaN beyond these and beyond a gap.

    These start at sample `low` of the channel.
    """
    nearest = np.round(index).astype(np.int64)
    first = np.append(0, channel.axis.first[1:])
    part = np.searchsorted(first, nearest, side="right")
    begins = np.maximum(low, first[part - 1])
    ends = np.minimum(low + samples.size, np.append(first, channel.size)[part])
    place = (nearest - size)[:, None] + np.arange(2 * size)
    inside = (place >= begins[:, None]) & (place < ends[:, None])
    values = np.full(place.shape, np.nan)
    values[inside] = samples[place[inside] - low]
    return values


# ---- Every passage against the log's own form.
#
# Height, offset, position, length and oddness by one linear least squares per row.
#
#     Reference --on a fine grid of xi--> columns of the linear model at some speeds
#     PatchWindows --`kernels.fit_rows`, columns at each sample's distance--> FITS
#
# A passage is height x form(xi - shift; length, damping, tilt) + offset. Linear in everything about
# the reference; what is quadratic in length and shift is known from two more columns of the same
# products and subtracted in turns, without touching the samples again. At the noise of the log the
# errors are those of Cramer and Rao.


#: points of the form's table over a revolution: every half a millimetre, straight lines between
#: them
TABLE_POINTS = 4096
#: weak knowledge of a passage's own oddness beside the log's: standard deviation of damping and
#: tilt; twice as much lets the noise of a passage move them twice as far
ODD_SD = 0.3


def grid_of(
    reference: Reference,
    number: int,
    half_window_m: float,
    spectra: ComplexArray,
    points: int = TABLE_POINTS,
) -> tuple[FloatArray, Record]:
    """Waves (g, c) of `spectra` (n, c) at speed `number` of `reference`, and their grid.

    The grid as the kernels take it, one GRID, of so many `points` per revolution.
    """
    xi, columns = reference.family.on_grid(spectra, points, 1.02 * half_window_m)
    grid = records(
        GRID,
        first_m=xi[0],
        step_m=xi[1] - xi[0],
        speed2_m2_s2=reference.speed_m_s[number] ** 2,
        shift_m=reference.shifts_m[number],
        half_window_m=half_window_m,
    )
    return columns, grid[0]


def form_table(
    reference: Reference, number: int, half_window_m: float, points: int = TABLE_POINTS
) -> tuple[FloatArray, Record]:
    """The columns that a fit needs at speed `number`, and their grid.

    Height, -shift, length, damping, tilt | second by length, second by shift, by the squared speed.
    The height's wave holds what the form left of the learnt passages.
    """
    form = reference.forms[number]
    family, longer = reference.family, form.copy()
    nudge = 1e-3 * form[HALF_LENGTH]
    longer[HALF_LENGTH] += nudge
    spectra, nudged = family.spectra(np.stack([form, longer]))
    base, wave_number = spectra[:, 0], 1j * family.kappa_1_m
    second = (nudged[:, 1] - spectra[:, 1]) / nudge, wave_number**2 * base
    columns, grid = grid_of(
        reference,
        number,
        half_window_m,
        np.column_stack(
            [
                base,
                -wave_number * base,
                spectra[:, [1, 5, 6]],
                *second,
                -reference.inertia * spectra[:, 3],
            ]
        ),
        points,
    )
    if reference.residuals is not None:
        xi = grid["first_m"] + grid["step_m"] * np.arange(columns.shape[0])
        columns[:, 0] += np.interp(
            xi, cell_centres(half_window_m), reference.residuals[number], 0.0, 0.0
        )
    return columns, grid


#: misfit above which what is left is more than noise
REMARKABLE = 1.3
#: what an average misses by passages that are unlike each other, as a share of the height in each
#: cell: a third of it halves the errors of trapezoids, which are then 3.5 of these off; squared, in
#: such units, what a form that is believed may leave (blocks and soft sectors leave 4 to 40); sizes
#: of the form over the ordinary one
UNLIKE, MOST_MISFIT, SIZES = 3e-4, 2.0, (1.0, 0.3, 0.1, 0.02)
#: error of a length over what the prior of the form's series gives: boxes and trapezoids, which the
#: series does not follow, are 1 to 2.1 times that off; the error is proportional to it
UNFOLLOWED = 2.0


def _fits(
    reference: Reference, number: int, sample: PatchWindows, noise: float, half_window_m: float
) -> tuple[Records, FloatArray]:
    """The fits (n,) of FIT of the passages of one class, 0 without; what they leave (`fit_rows`).

    The class' form holds at its own speed: the tension of each passage follows its squared speed.
    """
    # in half of the time: what the straight lines of so few points miss, up to 5e-5 of a passage's
    # height, is a tenth of the noise of the quietest log; half as many miss four times as much
    table, grid = form_table(replace(reference, residuals=None), number, half_window_m, 2048)
    found, left = np.zeros(len(sample.row), FIT), np.zeros((2, CELLS))
    every, grids = np.zeros(len(sample.row), np.int64), np.stack([grid])
    # weak knowledge of a passage's own damping and tilt; twice as much lets the noise of a passage
    # move them twice as far
    fit_rows(
        sample.values, sample.motion, every, table[None], grids,
        noise / np.sqrt(sample.averaged), 0.5, found, left,
    )  # fmt: skip
    return found, left


def _averages(
    reference: Reference,
    samples: list[PatchWindows],
    fits: list[tuple[Records, FloatArray]],
    noise: float,
    half_window_m: float,
    unlike: float,
) -> Records:
    """Mean passages of the classes (k,) of AVERAGE, each row put where the class' form is.

    `unlike`: what a mean misses, as a share of its height.
    """
    family = reference.family.up_to(HIGHEST_SHARE)
    made = np.zeros(len(samples), AVERAGE)
    kappa = family.kappa_1_m
    basis = cell_basis(family.radius_m, kappa.size, half_window_m)
    every = family.spectra(reference.forms)
    for one, spectra, sample, fit in zip(made, every, samples, fits, strict=True):
        found, (left, counts) = fit
        like = found[found["height"] > 0.0]
        height = float(np.median(like["height"])) if like.size else 1.0
        # no passage is like the form: it stays there
        beside = [
            float(np.median(like[name] / like["height"])) if like.size else 0.0
            for name in ("shift", "length", "damping", "tilt")
        ]
        change = np.column_stack([-1j * kappa * spectra[:, 0], spectra[:, [1, 5, 6]]]) @ beside
        both = np.column_stack([spectra[:, 0], change])
        plain, moved = (basis @ np.vstack([both.real, both.imag])).T
        size, many = float(np.ptp(plain)), np.maximum(counts, 1.0)
        sigma2 = noise**2 / (sample.averaged * many)
        # weight of a cell without samples, so that a class without any is known to nothing and not
        # unknown
        weight = (counts > 0.0) / (sigma2 / (height * size) ** 2 + unlike**2) + 1e-6
        one["speed_m_s"] = sample.speed_m_s
        one["weight"] = weight
        one["values"] = (plain + moved + left / many) / size
    return made


def _free(found: Records) -> FloatArray:
    """Degrees of freedom of fits (n,) of FIT; what is quadratic in them is not free."""
    return np.asarray(np.maximum(found["used"] - OWN, 1.0), np.float64)


def refine_edges(
    reference: Reference,
    samples: list[PatchWindows],
    noise: float,
    half_window_m: float,
) -> Reference:
    """`reference` (one shape per sample, ascending speed) fitted to the samples.

    `noise`: standard deviation of one sample of the log.
    """
    best, trial = reference, reference
    # rounds of refining, at most; twice as many only help a refinement that has not settled by then
    for again in range(6):
        fits = [_fits(trial, k, s, noise, half_window_m) for k, s in enumerate(samples)]
        samples, fits = _without_foreign(samples, fits, trial, noise, half_window_m)
        free = float(sum(_free(found).sum() for found, _ in fits))
        misfit = float(sum(np.sum(found["chi2"]) for found, _ in fits)) / free
        if again and misfit >= best.misfit:
            break  # where a whole step does harm, shorter ones gain next to nothing
        gain = best.misfit / misfit - 1.0 if again else np.inf
        averages = _averages(trial, samples, fits, noise, half_window_m, 0.0)
        problem = AverageFit(trial, averages, half_window_m, own=False)
        found = descend(problem, problem.start)
        left = np.array([total / np.maximum(counts, 1.0) for _, (total, counts) in fits])
        smooth = np.array([np.convolve(row, (0.25, 0.5, 0.25), "same") for row in left])
        errors = np.sqrt(np.diag(problem.lengths(found.normal)) * max(misfit, 1.0))
        best = replace(
            trial,
            heights=np.array([float(np.median(found["height"])) for found, _ in fits]),
            length_se_m=2.0 * trial.forms[:, HALF_LENGTH] * errors,
            misfit=misfit,
            residuals=smooth if misfit > REMARKABLE else None,
        )
        # stay if the next round promises less than this of the whole chi-square, or the last one
        # has changed it by less than that share; half of the latter goes on for some rounds with
        # forms that are those of no tire, and nowhere else
        if gain < 0.01 or found.gain < max(misfit, 1.0):
            break
        trial = problem.reference(found.theta, trial)
    return best


def _without_foreign(
    samples: list[PatchWindows],
    fits: list[tuple[Records, FloatArray]],
    reference: Reference,
    noise: float,
    half_window_m: float,
) -> tuple[list[PatchWindows], list[tuple[Records, FloatArray]]]:
    """Samples without the passages that fit the start much worse than their neighbours do."""
    kept, again = list(samples), list(fits)
    for number, (found, _) in enumerate(fits):
        share = found["chi2"] / _free(found)
        # passages with more than this times the usual misfit do not belong; three times the usual
        # size; twice as much keeps passages of 4.2 times
        good = (share < 9.0 * max(float(np.median(share)), 1.0)) & (found["height"] > 0)
        if good.any() and not good.all():
            kept[number] = samples[number].take(good)
            again[number] = _fits(reference, number, kept[number], noise, half_window_m)
    return kept, again


def learn_form(
    reference: Reference, samples: list[PatchWindows], noise: float, half_window_m: float
) -> Reference:
    """`reference` with the tire's own form, if that earns its place, and its share of the error.

    The evidence decides on the form's size: the prior of each number times one of SIZES. If it is
    the least, or the form leaves more than noise, the reference stays. The length is the mean, and
    its error the standard deviation, over all lengths that the averages and the prior allow. Each
    length has the form that fits best there: the valley of length against pressure is bent.
    """
    fits = [_fits(reference, k, s, noise, half_window_m) for k, s in enumerate(samples)]
    samples, fits = _without_foreign(samples, fits, reference, noise, half_window_m)
    averages = _averages(reference, samples, fits, noise, half_window_m, UNLIKE)
    problem = AverageFit(reference, averages, half_window_m, own=True)
    start = problem.start.copy()
    here = [judged(problem, start, size) for size in SIZES]
    promised = np.array([one.evidence + one.promise for one in here])
    chances = np.exp(promised - promised.max())
    unseen = np.array([problem.lengths(one.normal).mean() ** 0.5 for one in here])
    unseen[0] /= UNFOLLOWED  # what looks like a large form, and is none, is mostly a misfit
    share = UNFOLLOWED * float(np.sqrt(chances @ unseen**2 / chances.sum()))
    plain = replace(reference, form_share=share)
    speeds = reference.speed_m_s
    # a form is learnt if the fastest class has so many times the speed of the slowest: at one speed
    # a traction or the stiffness is as good as a pressure
    if np.argmax(promised) == len(SIZES) - 1 or speeds[-1] < 1.4 * speeds[0]:
        return plain
    # the tread may have stood for the form, or be what it is beside
    kept = descend(problem, start, SIZES[0], steps=5)
    start[TREAD] = 0.0
    # averages are trusted more and more
    for problem.trust in (0.01, 0.1, 1.0):
        best = descend(problem, start, SIZES[0], steps=30)
        start = best.theta
    best, chosen = max(best, kept, key=lambda one: one.evidence), SIZES[0]
    for size in SIZES[1:-1]:
        found = descend(problem, best.theta, size)
        if found.evidence < best.evidence:
            break
        best, chosen = found, size
    if best.misfit > MOST_MISFIT * np.sum(averages["weight"] > 1.0):
        return plain
    # lengths (logarithm) that are tried: at first an error apart, within these bounds, then twice
    # as far, until the evidence falls by 5, or as far as 0.3
    middle = problem.length(best.theta)
    step = np.clip(problem.lengths(best.normal).mean() ** 0.5, 0.002, 0.02)
    nodes = {0.0: descend(problem, best.theta, chosen, middle)}
    for sign in (1.0, -1.0):
        place, last = sign * step, nodes[0.0]
        while abs(place) < 0.3:
            nodes[place] = last = descend(problem, last.theta, chosen, middle + place)
            if last.evidence < max(n.evidence for n in nodes.values()) - 5.0:
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


# ---- Which passages the form is learnt from, and what is known of its error.


#: window of averages and fits in half lengths, of which samples are averaged while they lie closer
#: than this share
WINDOW, FIT_STEP = 2.7, 1.0 / 36.0
#: passages of all classes of speed and at least of each, in clusters of neighbours; twice as many
#: passages or classes take twice as long
LEARNT_FROM, LEAST_OF_CLASS, CLUSTERS = 480, 48, 6
#: free rolling, as far as the acceleration tells [m/s^2]; with so many such passages in a class of
#: speed it is learnt from them alone
FREE_ROLLING_M_S2, ENOUGH_STEADY = 0.6, 12
#: a slower wheel's windows are not cut out (its passage takes seconds); twice as much leaves out
#: wheels that creep up to 0.6 m/s
LEAST_SPEED_M_S = 0.3
#: chi-square per degree of freedom below this is not believed: errors shrink by its root at most,
#: as the noise of a sample may be overestimated; errors shrink to 0.77 at most; half as much would
#: let them shrink to 0.55
LEAST_SCATTER = 0.6


@dataclass(frozen=True)
class EdgeForm:
    """The log's form, and what was found with it.

    `half_window_m`: what averages and fits look at; `wave_number_1_m`: where a passage's spectrum
    sinks into the noise, the `auto` cut-off; `free_rolling`: whether it was learnt from passages at
    steady speed; `without` (n,): passages of the log that were left out. What passages that roll
    freely leave beside it (`measure.look_at_some`):
    `free_scatter`, `least_gain`; `forms`: `measure.Forms` of it, None if they are to be made.
    """

    reference: Reference
    half_window_m: float
    wave_number_1_m: float
    free_rolling: bool
    without: BoolArray | None = None
    free_scatter: float = 1.0
    least_gain: float = float("inf")
    forms: Any = None

    def length_errors(self, speed_m_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Standard errors [m] of the full length at each speed that all rows share.

        From learning the form, and for what the tire's own form may be.
        """
        lengths = 2.0 * self.reference.forms[:, HALF_LENGTH]
        errors = self.reference.length_se_m, self.reference.form_share * lengths
        learning, form = (np.interp(speed_m_s, self.reference.speed_m_s, one) for one in errors)
        return learning, form

    def unclear(self, speed_m_s: FloatArray) -> BoolArray:
        """Whether the form is none of a tire at each speed, (n,).

        It leaves too much, or is at a bound; lengths may be wrong by half.
        """
        values = self.reference.forms
        # a tread without stiffness, the lower bound, is the parabola of an honest beam
        at_bound = (values >= HIGHEST).any(axis=1) | (
            np.delete(values, TREAD, 1) <= np.delete(LOWEST, TREAD)
        ).any(axis=1)
        left = self.reference.residuals
        own = self.reference.family.own.any()  # which is learnt only if it leaves next to nothing
        missed = np.zeros(len(values)) if left is None or own else np.abs(left).max(axis=1)
        # largest tilt of the pressure, as p (1 - tilt xi / L): beyond it the road would pull at one
        # edge; twice as much would let it pull there as far as it presses in the middle
        # what the form may leave of a passage at any place, as a share of its height.  Finite
        # differences of beam and ring leave 0.001, a planted water film 0.036 and a true length
        # within 0.3 %; a ring-down of 0.2 goes with lengths 5 % too long, lopsided pulses of 0.05
        # to 0.07 with lengths half as long again.  Half of it would doubt the water film, twice as
        # much would let all lopsided pulses pass
        doubted = at_bound | (np.abs(values[:, TILT]) > 1.0) | (missed > 0.045)
        speed = np.nan_to_num(speed_m_s)
        nearest = np.argmin(np.abs(speed[:, None] - self.reference.speed_m_s), axis=1)
        return np.asarray(doubted[nearest], dtype=bool)

    def scatter(self, chi2: FloatArray) -> float:
        """How much larger the passages' residuals are than the noise of a sample tells.

        One number for the log.
        """
        known = chi2[np.isfinite(chi2)]
        return float(np.sqrt(max(LEAST_SCATTER, np.median(known)))) if known.size else 1.0


def _usable(passages: Passages, without: BoolArray | None) -> IntArray:
    """Ordinals of passages that a form can be learnt from.

    No quality word spoils them, they have a neighbour at a turn on either side, and they are not
    among `without` (n,).
    """
    wanted = (
        np.isfinite(passages.time_s) if without is None else np.isfinite(passages.time_s) & ~without
    )
    clean = good(passages.quality) & wanted
    both = passages.turn_before & passages.turn_after & wanted
    with np.errstate(invalid="ignore"):
        # largest relative error of the speed of a passage that is learnt from, if there are such;
        # twice as much learns from passages whose length on the tread is off by twice as much
        sure = passages.speed_se_m_s < 0.001 * passages.speed_m_s
    choices = (
        clean & both & sure,
        clean & both,
        clean & (passages.turn_before | passages.turn_after),
        clean,
        wanted,
    )
    # slower passages are learnt from only if there are no others: they are those of a start or a
    # stop. Twice as much leaves out twice as much of a start, which no other passage of the log is
    # like
    for least in (0.5, LEAST_SPEED_M_S):
        for choice in choices:
            rows = np.flatnonzero(choice & (passages.speed_m_s > least))
            if rows.size:
                return rows
    return np.zeros(0, np.int64)


def _classes(speed_m_s: FloatArray) -> IntArray:
    """Class of each speed: equal steps of its square, which the tension follows."""
    low, high = float(speed_m_s.min()), float(speed_m_s.max())
    # as many as there are steps of this ratio; steps of twice the ratio average over forms that
    # differ
    count = int(np.clip(np.floor(np.log(high / low) / np.log(1.12)) + 1, 1, 6))
    share = (speed_m_s**2 - low**2) / max(high**2 - low**2, 1e-300)
    # numpy squares by x * x, Python by pow: in the last bit the slowest may lie below its class
    return np.clip(np.floor(share * count), 0, count - 1).astype(np.int64)


def _steady_first(passages: Passages, rows: IntArray) -> tuple[IntArray, IntArray, bool]:
    """Rows to learn from, their classes of speed, and whether most roll freely.

    In each class the steady rows if there are enough of them.
    """
    classes = _classes(passages.speed_m_s[rows])
    steady = np.abs(np.nan_to_num(passages.acceleration_m_s2[rows])) < FREE_ROLLING_M_S2
    enough = np.bincount(classes, steady)[classes] >= np.minimum(
        ENOUGH_STEADY, np.bincount(classes)[classes]
    )
    kept = steady | ~enough
    return rows[kept], classes[kept], bool(steady[kept].mean() > 0.5)


def _samples(
    channel: Channel,
    passages: Passages,
    rows: IntArray,
    classes: IntArray,
    half_window_m: float,
) -> list[PatchWindows]:
    """Windows of each class of speed out of the passages `rows`, by ascending speed."""
    motions = passages.speed_m_s, np.nan_to_num(passages.acceleration_m_s2)
    rate, out, names = channel.axis.rate_Hz, [], np.unique(classes)
    most = max(LEARNT_FROM // names.size, LEAST_OF_CLASS)
    for number in names:
        chosen = clusters(rows[classes == number], most, CLUSTERS)
        speed = motions[0][chosen]
        reach = np.full(len(passages), 1.02 * half_window_m / float(speed.min()) * rate + 1.0)
        share = FIT_STEP * half_window_m / WINDOW * rate / float(speed.max())
        fewer = 2 ** int(np.log2(max(share, 1.0)))
        windows = gather_windows(channel, passages.sign, passages.index, motions, reach, chosen)
        out.append(joined_windows([one.reduced(fewer) for one in windows]))
    return sorted(out, key=lambda sample: sample.speed_m_s)


def _wave_number(reference: Reference, rate_Hz: float, half_window_m: float, noise: float) -> float:
    """The highest wave number [1/m] at which a passage is above the noise.

    Its spectrum above the `noise` of a sample, at the middle speed.
    """
    number = len(reference.forms) // 2
    speed = float(reference.speed_m_s[number])
    family = reference.family
    spectrum = family.spectra(reference.forms[[number]])[0, :, 0] * reference.heights[number]
    signal = np.pi * family.radius_m * np.abs(spectrum) * rate_Hz / speed
    floor = noise * np.sqrt(2.0 * half_window_m * rate_Hz / speed)
    above = np.flatnonzero(signal > floor)
    return float(family.kappa_1_m[above[-1]]) if above.size else float(2.0 * np.pi / half_window_m)


def _at(reference: Reference, samples: list[PatchWindows]) -> Reference:
    """`reference`, as another grating has taught it, at the speeds of `samples`."""
    speeds = np.array([sample.speed_m_s for sample in samples])
    return replace(reference.at_speeds(speeds), residuals=None)


def _from_a_start(
    samples: list[PatchWindows], radius_m: float, noise: float, half_window_m: float, rough_m: float
) -> Reference:
    """The form without anything known of it but a rough half length [m].

    From the better of two starts, which are tried on the class of speed of which most roll freely,
    of these a middle one.
    """
    free = [np.sum(np.abs(s.motion["acceleration_m_s2"]) < FREE_ROLLING_M_S2) for s in samples]
    middle = 0.5 * (len(samples) - 1)
    first = samples[max(range(len(samples)), key=lambda k: (free[k], -abs(k - middle)))]
    # highest wave number times half length that the family keeps
    family, none = EdgeFamily(radius_m, 42.0 / (0.8 * rough_m)), np.zeros(1)
    tried: list[Reference] = []
    # starts: half length over the rough one, tension, tread
    for length, tension, tread in ((1.0, 0.3, 0.1), (0.85, 3.0, 2.5)):
        form = np.array([[length * rough_m, 0.75 * rough_m, tension, tread, 0.0, 0.0]])
        start = Reference(family, np.array([first.speed_m_s]), form, none, 0.0, none, none)
        if not tried or tried[0].misfit > REMARKABLE:
            tried.append(refine_edges(start, [first], noise, half_window_m))
    best = min(tried, key=lambda one: one.misfit)
    return refine_edges(_at(best, samples), samples, noise, half_window_m)


def learn_reference(
    channel: Channel,
    passages: Passages,
    like: EdgeForm | None = None,
    without: BoolArray | None = None,
) -> EdgeForm | None:
    """The form of the passages of `channel`; None if there are none to learn from.

    `like`: a form that another channel has taught, tried first; `without` (n,): passages that are
    left out.
    """
    chosen = _to_learn_from(channel, passages, without)
    if chosen is None:
        return None
    samples, window, rough, free = chosen
    found = None
    if like is not None:
        found = refine_edges(_at(like.reference, samples), samples, passages.noise, window)
        # a start from another grating that ends in this many times its misfit is given up; twice as
        # much keeps starts that have three times the misfit, which a search from the beginning may
        # undercut
        if found.misfit > 1.5 * max(like.reference.misfit, 1.0):
            found = None
    found = found or _from_a_start(samples, passages.radius_m, passages.noise, window, rough)
    if not found.misfit > 0.0:  # no passage with more samples than unknowns
        return None
    highest = _wave_number(found, channel.axis.rate_Hz, window, passages.noise)
    return EdgeForm(found, window, highest, free, without)


def _to_learn_from(
    channel: Channel, passages: Passages, without: BoolArray | None
) -> tuple[list[PatchWindows], float, float, bool] | None:
    """Samples to learn from, half of their window, a rough half length [m], whether they roll."""
    rows = _usable(passages, without)
    if passages.template is None or not rows.size:
        return None
    rows, classes, free = _steady_first(passages, rows)
    rough = LENGTH_TO_WIDTH * passages.template.half_width_rad * passages.radius_m
    window = min(WINDOW * rough, 2.9 * passages.radius_m)
    return _samples(channel, passages, rows, classes, window), window, rough, free


def learn_own(channel: Channel, passages: Passages, learnt: EdgeForm) -> EdgeForm:
    """`learnt` with the tire's own pressure and stiffness, or with what these may do to lengths."""
    chosen = _to_learn_from(channel, passages, learnt.without)
    assert chosen is not None
    reference = learn_form(learnt.reference, chosen[0], passages.noise, learnt.half_window_m)
    return replace(learnt, reference=reference)
