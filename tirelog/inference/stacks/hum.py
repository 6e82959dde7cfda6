"""Hum of the supply, taken out of the waveforms of a log.

A line that keeps its own frequency does not average out over revolutions if the wheel turns at a
whole fraction of it: it then looks like a shape that one manoeuvre has and the others do not. What
repeats with the wheel cancels in the difference of two neighbouring revolutions, and the line does
not, but where it is that whole fraction. So the line is measured in those differences, over the
whole stretch, and no effect of the tire is taken out with it.

    waveforms, times (n, m) --differences of neighbours--> lines that stand above what is around
    them --a course of cosine and sine in time--> waveforms without them, amplitudes
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Stack
from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray, IntArray
from tirelog.vocabulary.observables import OBSERVABLES, shown

# ---- The sums over neighbouring revolutions that a line of the supply is looked for by.
#
# One pass in place of seven of numpy's over megabytes: looking for hum in 350 revolutions takes
# 39 ms
# of CPU for 67 (23 November 2026, two shared cores, Python 3.11).


@compiled
def along_rises(
    turning: NDArray[np.complex128],
    left: FloatArray,
    first: IntArray,
    weighted: FloatArray,
    weight: FloatArray,
    along: NDArray[np.complex128],
) -> float:
    """Fills `along` (k,) with each rise's product with a line's; gives the line's own square.

    turning      (n, m) a line of unit amplitude in each bin, complex; `left` (n, m) of its size
    first        (k,) revolutions that rise to the next one
    weighted     (k, m) the rises, each times its `weight` (k, m)
    """
    size = 0.0
    for k in range(first.size):
        i = first[k]
        product = 0.0j
        for j in range(weight.shape[1]):
            change = turning[i + 1, j] * left[i + 1, j] - turning[i, j] * left[i, j]
            product += weighted[k, j] * np.conj(change)
            size += weight[k, j] * (change.real * change.real + change.imag * change.imag)
        along[k] = product
    return size


#: frequencies of supplies [Hz], and how many of their multiples are looked for; rectifiers give the
#: second, transformers the third, and beyond the fourth little is left
SUPPLIES_HZ, MULTIPLES = (50.0, 60.0), 4
#: a line is looked for so far from its place [Hz of the first multiple]: grids keep to 0.2 Hz, and
#: the clock of an interrogator to less; doubled, twice as many places are looked at
OFF_HZ = 0.25
#: what is around a line is looked at to here [Hz] to either side
_AROUND_HZ = 1.5
#: least length of a stretch [s] and fewest neighbouring revolutions of it: below it lines are not
#: separated from their surroundings
_SHORTEST_S, _FEWEST = 5.0, 20


#: a line: frequency [Hz] and amplitude, in the waveforms' unit
Line = tuple[float, float]


def lines_said(lines: Iterable[Line], observable: str) -> str:
    """What was taken out, in words; of several stretches the largest of each line.

    What a driveline does at one speed may look like it, so a supply is no more than compared with.
    """
    largest: dict[int, Line] = {}
    for amplitude, frequency in sorted((amplitude, frequency) for frequency, amplitude in lines):
        largest[round(frequency)] = frequency, amplitude
    factor, unit = shown(observable, OBSERVABLES[observable].unit)
    each = " and ".join(
        f"{frequency:.4g} Hz ({factor * amplitude:.2g} {unit})"
        for frequency, amplitude in sorted(largest.values())
    )
    what = "a line that keeps" if len(largest) == 1 else "lines that keep"
    return f"{what} the frequency, as hum does, taken out of the waveforms: {each}"


def without_hum(stack: Stack, time_s: FloatArray) -> tuple[FloatArray, list[Line]]:
    """The stack's waveforms (n, m) without the supply's lines, and these.

    time_s   (n, m) mean time of each bin's samples; NaN if it has none
    """
    values = stack.values
    first = np.flatnonzero((np.diff(stack.manoeuvre) == 0) & (np.diff(stack.revolution) == 1))
    if first.size < _FEWEST or np.nanmax(time_s) - np.nanmin(time_s) < _SHORTEST_S:
        return values, []
    speed = np.maximum(stack.conditions.speed_m_s, 1e-3) / stack.radius_m
    square_s2 = np.nan_to_num(stack.phi_variance) / speed[:, None] ** 2
    time_s = np.where(np.isfinite(time_s), time_s, np.nanmin(time_s))
    lines: list[Line] = []
    pairs = _Pairs(values, time_s, square_s2, first)
    for supply in SUPPLIES_HZ:
        for multiple in range(1, MULTIPLES + 1):
            # the third and fourth come with the first or the second
            seen = [frequency / k for frequency, _ in lines for k in range(1, MULTIPLES + 1)]
            if multiple > 2 and not any(abs(one - supply) <= OFF_HZ for one in seen):
                break
            found = pairs.line(multiple * supply, multiple * OFF_HZ)
            if found is not None:
                without, amplitude = pairs.taken_out(found)
                # a line is at least so large against the scatter of one bin: a fainter one adds a
                # fortieth to the squared error of a cell of twenty revolutions at most; doubled, a
                # tenth
                if amplitude >= 0.05 * pairs.scatter:
                    values = without
                    lines.append((found, amplitude))
                    pairs = _Pairs(values, time_s, square_s2, first)
    return values, lines


class _Pairs:
    """The differences of neighbouring revolutions, each bin weighted by its scatter."""

    def __init__(
        self,
        values: FloatArray,
        time_s: FloatArray,
        square_s2: FloatArray,
        first: NDArray[np.intp],
    ) -> None:
        self.values, self.time_s, self.square_s2, self.first = values, time_s, square_s2, first
        rise = values[first + 1] - values[first]
        there = np.isfinite(rise)
        rise = np.where(there, rise, 0.0)
        spread = 1.4826 * np.median(np.abs(rise), axis=0)  # to a standard deviation
        least = np.median(spread[spread > 0]) if (spread > 0).any() else 1.0
        # a flank's bins scatter by where their samples fall, and say little of a line
        scale = np.maximum(spread, 0.3 * least)
        weight = np.broadcast_to(1.0 / scale**2, rise.shape)
        # a flank's bin that has lost a sample tells where the others lie, and nothing of a line
        # differences beyond this are left out [robust standard deviations]: of hum alone none
        # reaches 2; at twice as many they outweigh the line where samples are lost at flanks
        near = np.abs(rise) * np.sqrt(weight) < 5.0
        self.weight = np.where(there & near, weight, 0.0)
        self.weighted = self.weight * rise
        #: of one bin of one revolution, in the middle over the angles
        self.scatter = float(least) / np.sqrt(2.0)
        self.at = 0.5 * (time_s[first] + time_s[first + 1]).mean(axis=1)

    def turning(self, frequency: float) -> NDArray[np.complex128]:
        """A line of unit amplitude at each bin's mean time, (n, m)."""
        return np.asarray(np.exp(2j * np.pi * frequency * self.time_s))

    def left(self, frequency: float) -> FloatArray:
        """What is left of a line's size in the mean over each bin's samples, (n, m)."""
        return np.asarray(np.exp((-2.0 * (np.pi * frequency) ** 2) * self.square_s2))

    @cached_property
    def _near(self) -> tuple[FloatArray, NDArray[np.complex128], NDArray[np.complex128]]:
        """Frequencies about a middle one [Hz], to half a hertz, and what moves its sums there.

        (k,), by every so many steps (few, n), and by the steps between (few, n): of a log of
        hours, one table (k, n) would fill the memory.
        """
        step = 0.25 / float(np.ptp(self.at))
        off = np.arange(-0.5, 0.5, step)
        few = int(np.ceil(np.sqrt(off.size)))
        coarse = np.exp(-2j * np.pi * off[::few, None] * self.at)
        return off, coarse, np.exp(-2j * np.pi * (step * np.arange(few))[:, None] * self.at)

    def power(self, turning: NDArray[np.complex128], middle: float) -> FloatArray:
        """(frequency, power over its own expectation without a line) about a frequency, (k, 2).

        `turning` (n, m): a line of the frequency in the middle.
        """

        along, left = np.empty(self.first.size, np.complex128), self.left(middle)
        size = along_rises(turning, left, self.first, self.weighted, self.weight, along)
        off, coarse, fine = self._near
        amplitude = ((coarse * along) @ fine.T).ravel()[: off.size]
        return np.stack([middle + off, np.abs(amplitude) ** 2 / size], axis=1)

    def line(self, frequency: float, off: float) -> float | None:
        """The frequency of a line near `frequency`; None if there is no line."""
        first = round(frequency - _AROUND_HZ + 0.5)
        turning, one_hertz, parts = self.turning(first), self.turning(1.0), []
        for middle in range(first, round(frequency + _AROUND_HZ + 0.5)):
            parts.append(self.power(turning, middle))
            turning = turning * one_hertz
        found = np.concatenate(parts)
        near = np.flatnonzero(np.abs(found[:, 0] - frequency) <= off)
        best = int(near[np.argmax(found[near, 1])])
        # of a power that is exponentially distributed the mean is the median over log 2
        around = float(np.median(found[:, 1]) / np.log(2.0))
        # a line must stand so many times above the mean of what is around it, as power: 318 places
        # of 78 simulated logs without hum went to 42, hum of half the noise to some thousands
        if found[best, 1] <= 50.0 * around:
            return None
        # the top of a parabola: where the wheel hides the line, its course is held by this alone
        low, top, high = found[best - 1 : best + 2, 1]
        step = float(found[1, 0] - found[0, 0])
        return float(found[best, 0] + 0.5 * step * (low - high) / (low - 2.0 * top + high))

    def taken_out(self, frequency: float) -> tuple[FloatArray, float]:
        """The waveforms without the line, and its size.

        Its cosine and sine follow a course in time.
        """
        low, high = float(self.time_s.min()), float(self.time_s.max())
        # nodes of a line's cosine and sine [s]: grids wander by some hundredths of a hertz, which
        # nodes at twice the distance follow worse; at half of it there are twice as many numbers
        # for the same
        nodes = np.linspace(low, high, max(2, 1 + round((high - low) / 4.0)))
        wave = self.turning(frequency) * self.left(frequency)  # in the mean over a bin's samples
        change = wave[self.first + 1] - wave[self.first]
        parts = np.stack([change.real, change.imag])  # rise = cosine of the one + sine of the other
        hats = _hats(self.at, nodes)
        inner = np.einsum("ikm,jkm,km->ijk", parts, parts, self.weight)
        gram = np.einsum("ka,ijk,kb->iajb", hats, inner, hats).reshape(2 * nodes.size, -1)
        right = ((parts * self.weighted).sum(axis=2) @ hats).ravel()
        course, size = _course(gram, right, nodes, self.scatter)
        cosine, sine = (np.interp(self.time_s, nodes, part) for part in course)
        taken = cosine * wave.real + sine * wave.imag
        return np.asarray(self.values - taken), size


def _course(
    gram: FloatArray, right: FloatArray, nodes: FloatArray, size: float
) -> tuple[FloatArray, float]:
    """Cosine and sine of a line at the nodes (2, k), and its amplitude where it is seen.

    A Gaussian process that forgets exponentially; its variance by expectation and maximisation
    from `size` on, its memory by the largest evidence (Rasmussen and Williams 2006, ch. 5).
    `gram` (2k, 2k) and `right` (2k,): normal equations whose noise has a variance of one.
    """
    apart = np.abs(nodes[:, None] - nodes)
    told = np.diag(gram).reshape(2, -1)
    best = -np.inf
    course: FloatArray = np.zeros(told.shape)
    # times over which a line may forget its phase [s], of which the likeliest is taken: from a grid
    # that wanders to a clock. Where the wheel hides the line for longer, nothing is taken
    for memory in (5.0, 15.0, 50.0, 200.0, 1000.0):
        alike = np.kron(np.eye(2), np.exp(-apart / memory))
        variance = size**2
        # rounds in which a line's size is found beside its course; half as many end within 2 % of
        # it
        for _ in range(10):
            inner = np.eye(right.size) + variance * alike @ gram
            mean = np.linalg.solve(inner, variance * alike @ right)
            spread = np.linalg.solve(inner, variance * alike)
            seen = np.outer(mean, mean) + spread
            variance = float(np.trace(np.linalg.solve(alike, seen))) / right.size
        evidence = 0.5 * float(right @ mean) - 0.5 * float(np.linalg.slogdet(inner)[1])
        if evidence > best:
            best, course = evidence, np.asarray(mean.reshape(2, -1), np.float64)
    return course, float(np.sqrt(2.0 * (told * course**2).sum() / told.sum()))


def _hats(at: FloatArray, nodes: FloatArray) -> FloatArray:
    """The weight of each node at each time, (k, nodes), linear between them."""
    return np.array([np.interp(at, nodes, row) for row in np.eye(nodes.size)]).T
