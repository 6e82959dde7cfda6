"""The log's own form.

Which passages it is learnt from, their averages by speed, and what is known of its error.

Passages
    --clean ones, preferably at steady speed, by classes of speed, in clusters-->
    a few hundred windows
    --those of one speed: scaled by their heights, cells along xi--> average --form--> a start
         --the samples themselves--> EdgeForm
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tirelog.data.recording import BLOCK_SAMPLES, Channel
from tirelog.strain.footprint.family import HIGHEST, LOWEST
from tirelog.strain.footprint.reference import CELLS, Average, Reference, fit_average
from tirelog.strain.footprint.refine import (
    PatchWindows,
    gather_windows,
    joined_windows,
    learn_form,
    refine_edges,
)
from tirelog.strain.passages.find import Passages
from tirelog.strain.passages.match import clusters
from tirelog.strain.passages.template import LENGTH_TO_WIDTH
from tirelog.vocabulary.arrays import BoolArray, FloatArray, IntArray
from tirelog.vocabulary.quality import good

#: window of averages and fits in half lengths
WINDOW = 2.7
#: classes of speed: at most, as many as there are steps of this ratio; passages of all and at
#: least of each, in clusters of neighbours; twice as many passages or classes take twice as long;
#: steps of twice the ratio average over forms that differ
CLASSES, CLASS_RATIO, LEARNT_FROM, LEAST_OF_CLASS, CLUSTERS = 6, 1.12, 480, 48, 6
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
#: what the form may leave of a passage at any place, as a share of its height.  Finite differences
#: of beam and ring leave 0.001, a planted water film 0.036 and a true length within 0.3 %; a
#: ring-down of 0.2 goes with lengths 5 % too long, lopsided pulses of 0.05 to 0.07 with lengths
#: half as long again.  Half of it would doubt the water film, twice as much would let all lopsided
#: pulses pass
MOST_LEFT = 0.045
#: their places among a form's parameters
TREAD, TILT = 3, 5


@dataclass(frozen=True)
class EdgeForm:
    """The log's form, and what was found with it.

    `half_window_m`: what averages and fits look at; `wave_number_1_m`: where a passage's spectrum
    sinks into the noise, the `auto` cut-off; `free_rolling`: whether it was learnt from passages at
    steady speed; `without` (n,): passages of the log that were left out.
    """

    reference: Reference
    half_window_m: float
    wave_number_1_m: float
    free_rolling: bool
    without: BoolArray | None = None

    def length_errors(self, speed_m_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Standard errors [m] of the full length at each speed that all rows share.

        From learning the form, and for what the tire's own form may be.
        """
        lengths = 2.0 * np.array([shape.half_length_m for shape in self.reference.shapes])
        errors = self.reference.length_se_m, self.reference.form_share * lengths
        learning, form = (np.interp(speed_m_s, self.reference.speed_m_s, one) for one in errors)
        return learning, form

    def unclear(self, speed_m_s: FloatArray) -> BoolArray:
        """Whether the form is none of a tire at each speed, (n,).

        It leaves too much, or stands at a bound; lengths may be wrong by half.
        """
        values = np.array([shape.array() for shape in self.reference.shapes])
        # a tread without stiffness, the lower bound, is the parabola of an honest beam
        at_bound = (values >= HIGHEST).any(axis=1) | (
            np.delete(values, TREAD, 1) <= np.delete(LOWEST, TREAD)
        ).any(axis=1)
        left = self.reference.residuals
        own = self.reference.family.own.any()  # which is learnt only if it leaves next to nothing
        missed = np.zeros(len(values)) if left is None or own else np.abs(left).max(axis=1)
        # largest tilt of the pressure, as p (1 - tilt xi / L): beyond it the road would pull at one
        # edge; twice as much would let it pull there as far as it presses in the middle
        doubted = at_bound | (np.abs(values[:, TILT]) > 1.0) | (missed > MOST_LEFT)
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
    count = int(np.clip(np.floor(np.log(high / low) / np.log(CLASS_RATIO)) + 1, 1, CLASSES))
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
    block_samples: int,
) -> list[PatchWindows]:
    """Windows of each class of speed out of the passages `rows`, by ascending speed."""
    motions = passages.speed_m_s, np.nan_to_num(passages.acceleration_m_s2)
    rate, out, names = channel.axis.rate_Hz, [], np.unique(classes)
    most = max(LEARNT_FROM // names.size, LEAST_OF_CLASS)
    for number in names:
        chosen = clusters(rows[classes == number], most, CLUSTERS)
        speed = motions[0][chosen]
        reach = np.full(len(passages), 1.02 * half_window_m / float(speed.min()) * rate + 1.0)
        # samples are averaged while they lie closer than this share of the half length
        share = (1.0 / 36.0) * half_window_m / WINDOW * rate / float(speed.max())
        fewer = 2 ** int(np.log2(max(share, 1.0)))
        windows = gather_windows(
            channel, passages.sign, passages.index, motions, reach, chosen, block_samples
        )
        out.append(joined_windows([one.reduced(fewer) for one in windows]))
    return sorted(out, key=lambda sample: sample.speed_m_s)


def _average(sample: PatchWindows, passages: Passages, half_window_m: float) -> Average:
    """Mean passage of the rows of `sample`, scaled by height and offset of the template."""
    height = np.maximum(np.abs(passages.height[sample.row]), 1e-300)[:, None]
    values = (sample.values + passages.offset[sample.row][:, None]) / height
    cell = (sample.distance_m() / half_window_m + 1.0) * (0.5 * CELLS)
    inside = np.isfinite(values) & (cell > 0.0) & (cell < CELLS)
    cells, each = cell[inside].astype(np.int64), np.broadcast_to(height**2, values.shape)[inside]
    weight, total = (np.bincount(cells, w, CELLS) for w in (each, each * values[inside]))
    mean = total / np.where(weight > 0.0, weight, 1.0)
    sharp = np.asarray(weight * (sample.averaged / passages.noise**2), np.float64)
    return Average(sample.speed_m_s, mean, sharp)


def _wave_number(reference: Reference, rate_Hz: float, half_window_m: float, noise: float) -> float:
    """The highest wave number [1/m] at which a passage stands above the noise.

    Its spectrum above the `noise` of a sample, at the middle speed.
    """
    number = len(reference.shapes) // 2
    speed = float(reference.speed_m_s[number])
    family = reference.family
    spectrum = np.abs(family.spectrum(reference.shapes[number])) * abs(reference.heights[number])
    signal = np.pi * family.radius_m * spectrum * rate_Hz / speed
    floor = noise * np.sqrt(2.0 * half_window_m * rate_Hz / speed)
    above = np.flatnonzero(signal > floor)
    return float(family.kappa_1_m[above[-1]]) if above.size else float(2.0 * np.pi / half_window_m)


def _at(reference: Reference, samples: list[PatchWindows]) -> Reference:
    """`reference`, as another grating has taught it, at the speeds of `samples`."""
    return replace(
        reference.at_speeds(np.array([s.speed_m_s for s in samples])),
        residuals=None,
        residual_xi_m=None,
    )


def _from_a_start(
    samples: list[PatchWindows], passages: Passages, half_window_m: float, rough_m: float
) -> Reference:
    """The form without anything known of it.

    It starts from the class of speed of which most roll freely, of these a middle one.
    """
    free = [np.sum(np.abs(s.motion["acceleration_m_s2"]) < FREE_ROLLING_M_S2) for s in samples]
    middle = 0.5 * (len(samples) - 1)
    first = max(range(len(samples)), key=lambda k: (free[k], -abs(k - middle)))
    speeds = np.array([sample.speed_m_s for sample in samples])
    mean = _average(samples[first], passages, half_window_m)
    start = fit_average(mean, half_window_m, speeds, passages.radius_m, rough_m)
    return refine_edges(start, samples, passages.noise, half_window_m)


def learn_reference(
    channel: Channel,
    passages: Passages,
    block_samples: int = BLOCK_SAMPLES,
    like: EdgeForm | None = None,
    without: BoolArray | None = None,
) -> EdgeForm | None:
    """The form of the passages of `channel`; None if there are none to learn from.

    one; `without` (n,): passages that are left out.
    """
    if passages.template is None or not len(passages):
        return None
    chosen = _to_learn_from(channel, passages, block_samples, without)
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
    found = found or _from_a_start(samples, passages, window, rough)
    if not found.misfit > 0.0:  # no passage with more samples than unknowns
        return None
    highest = _wave_number(found, channel.axis.rate_Hz, window, passages.noise)
    return EdgeForm(found, window, highest, free, without)


def _to_learn_from(
    channel: Channel, passages: Passages, block_samples: int, without: BoolArray | None
) -> tuple[list[PatchWindows], float, float, bool] | None:
    """Samples to learn from, half of their window, a rough half length [m], whether they roll."""
    rows = _usable(passages, without)
    if passages.template is None or not rows.size:
        return None
    rows, classes, free = _steady_first(passages, rows)
    rough = LENGTH_TO_WIDTH * passages.template.half_width_rad * passages.radius_m
    window = min(WINDOW * rough, 2.9 * passages.radius_m)
    return _samples(channel, passages, rows, classes, window, block_samples), window, rough, free


def learn_own(
    channel: Channel, passages: Passages, learnt: EdgeForm, block_samples: int = BLOCK_SAMPLES
) -> EdgeForm:
    """`learnt` with the tire's own pressure and stiffness, or with what these may do to lengths."""
    chosen = _to_learn_from(channel, passages, block_samples, learnt.without)
    assert chosen is not None
    reference = learn_form(learnt.reference, chosen[0], passages.noise, learnt.half_window_m)
    return replace(learnt, reference=reference)
