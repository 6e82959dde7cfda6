"""Stamps to a time axis.

One streaming pass that keeps the stamps aside, then a fit in bounded memory.

    blocks: ClockFit.add(stamps [s] or None, sample numbers or None, n)      n samples each, NaN
        if its stamp is unknown
    end:    ClockFit.axis, a TimeAxis, .repairs, .flags, .remarks

How the axis is decided, by what the stamps look like (T the sample period, r = stamp - T x sample
number):

* no stamps: the rate of the setup or the file; a missing sample number is a gap.
* stamps: a sample clock seen through them. T from differences over long stretches (their median,
  which isolated gaps do not move), then least squares with one T and a start for each segment. Its
  rate is the setup's, the file's or a round one if these agree with the stamps.  If many stamps
  are alike or nearly so (one second's resolution, buffers that arrive in bunches) only the first
  stamp of each bunch takes part.  A lasting rise of r by half a period
  is a gap: a new segment starts there.  A passing one is a late stamp and is repaired.  A lasting
  fall by one period is a repeated row, which gets a segment of its own, half a period after its
  neighbour; a larger one is a clock that was set back: the sample clock runs on.  A few stamps at
  an end of the log that leave the clock take no part (`stamps._judge`): they are repaired.
* stamps coarser than the samples: what a tick lacks for good is a gap. If they stray from such a
  clock by more than two of their ticks, its rate wanders, and times follow the stamps
  (`tirelog.runs.clock`).
* stamps that stray from such a clock by more than a tenth of a period and more than their
  resolution, ascend, and come without a declared rate (setup or file): the samples have no clock of
  their own (wheel speeds on a bus), and their times are the stamps.

A declared rate that the stamps contradict by more than 0.2 % gives a remark, and the stamps are
followed; beyond a fifth the setup is refused.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from tirelog.data.recording import TimeAxis
from tirelog.dsp.filters import runs
from tirelog.errors import ReadError, SetupError
from tirelog.runs.stamps import Jump, Stamps
from tirelog.vocabulary.arrays import FloatArray, IntArray
from tirelog.vocabulary.quality import Doubt, Quality

# ---- A sample clock whose rate wanders, seen through stamps coarser than its samples.
#
#     first sample of each tick, its stamp --missing samples counted in--> (clock index, stamp)
#         --one line leaves more than two ticks--> means of some ticks --> times between them
#
# Programs that pace the sampling themselves keep a rate to some percent only. One rate for the
# whole
# log then puts samples seconds away from where they were taken.


#: first sample of a piece between two lasting jumps, and the time of clock index 0 on its line [s]
Level: TypeAlias = tuple[int, float]
#: times [s] of the samples [start, stop)
Times: TypeAlias = Callable[[int, int], FloatArray]
#: ticks averaged to one point of the clock: the first sample of a tick lies anywhere in a period,
#: which the mean of 16 tells to 0.07 of it; twice as many follow a change of rate half as quickly
_TICKS = 16


#: what stamps that are coarser than their samples tell, by the ticks of their clock:
#:   gaps        (first sample behind, samples missing)
#:   wrong       [start, stop) of samples whose stamp is not the clock's
#:   wandering   (times, rates) if one rate will not do: times [s] of samples [start, stop), the
#:               log's first at 0; three rates [Hz], of which the outer ones hold nine tenths
Ticks: TypeAlias = tuple[
    list[tuple[int, int]], list[tuple[int, int]], tuple[Times, tuple[float, ...]] | None
]


def coarse_ticks(stamps: Stamps, period: float, resolution_s: float) -> Ticks | None:
    """The ticks of stamps that are coarser than their samples and always rise, else None.

    `period` is roughly the sample's [s], `resolution_s` the tick of the stamps.
    """
    # samples per tick below which a stamp is no coarse one; twice as many leave finer stamps to the
    # plain fit
    if not stamps.bunched or resolution_s < 4.0 * period:
        return None
    index, k, stamp = _points(stamps, period)
    if k.size < 4 * _TICKS or not (np.diff(stamp) > 0.0).all():
        return None
    wrong = []
    if stamp[-1] - stamp[-2] > stamp[-2] - stamp[0]:  # nothing follows a leap longer than the log
        wrong.append((int(index[-1]), stamps.spool.size))
        index, k, stamp = index[:-1], k[:-1], stamp[:-1]
    from scipy.ndimage import median_filter  # a twentieth of a second, for few logs

    steps, samples = np.diff(stamp), np.diff(k)
    # the usual rate about a tick is the median of so many; twice as many follow a rate that wanders
    # half as quickly
    rate = median_filter(samples / steps, 31, mode="nearest")
    lacking = steps * rate - samples
    usual = 1.4826 * float(np.median(np.abs(lacking - np.median(lacking))))
    # samples that a tick lacks before they count as missing: a steady one has one more or less;
    # twice as many leave gaps of up to three samples unsaid. And more than so many times what ticks
    # usually lack or have too many; twice as many leave gaps unsaid that are half as large where
    # ticks scatter
    least_missing, unusual = 1.6, 6.0
    lacks = lacking > max(least_missing, unusual * usual)
    missing, gaps = np.zeros(lacking.size, np.int64), []
    level = np.concatenate([[0.0], np.cumsum(lacking)])
    # ticks on each side of a gap that say whether it lasts; twice as many need gaps that are twice
    # as far apart
    lasts = 5
    # a pace that is not even walks away a little, too, over as many ticks
    walks = level[2 * lasts :] - level[: -2 * lasts]
    least = max(
        least_missing, unusual * 1.4826 * float(np.median(np.abs(walks - np.median(walks))))
    )
    for start, stop in np.stack(runs(lacks), axis=1).tolist():
        # what one tick lacks the next may have too many: a sample late by a moment is not missing
        before = np.median(level[max(start - lasts, 0) : start + 1])
        lasting = round(float(np.median(level[stop : stop + lasts + 1]) - before))
        if lasting >= least:
            at = start + int(lacking[start:stop].argmax())
            missing[at] = lasting
            gaps.append((int(index[at + 1]), lasting))
    # stamps of a steady clock stay within one tick of their line; beyond so many its rate wanders;
    # twice as many put a clock that wanders by up to four ticks on one straight line
    strays = _strays(k, stamp, missing) > 2.0 * resolution_s
    return gaps, wrong, _wandering(stamps, k, stamp, missing, gaps) if strays else None


def _wandering(
    stamps: Stamps,
    k: IntArray,
    stamp_s: FloatArray,
    missing: IntArray,
    gaps: list[tuple[int, int]],
) -> tuple[Times, tuple[float, ...]]:
    """(times, rates) as of `Ticks`, of first samples of ticks: clock index and stamp, (n,) each.

    `missing` (n - 1,): samples that lack between one and the next; `gaps` the same.
    """
    whole = k + np.concatenate([[0], np.cumsum(missing)])
    groups = whole.size // _TICKS
    at = whole[: groups * _TICKS].reshape(groups, _TICKS).mean(axis=1)
    time = stamp_s[: groups * _TICKS].reshape(groups, _TICKS).mean(axis=1)
    slopes = np.diff(time) / np.diff(at)
    behind = np.array([first for first, _ in gaps], np.int64)
    before = np.cumsum([0, *(samples for _, samples in gaps)])

    def time_of(index: IntArray) -> FloatArray:
        own = stamps.clock_index(index) + before[np.searchsorted(behind, index, side="right")]
        found = np.interp(own, at, time)
        found = np.where(own < at[0], time[0] + slopes[0] * (own - at[0]), found)
        found = np.where(own > at[-1], time[-1] + slopes[-1] * (own - at[-1]), found)
        return np.asarray(found, np.float64)

    begin = time_of(np.zeros(1, np.int64))
    rates = np.percentile(np.diff(at) / np.diff(time), [5.0, 50.0, 95.0])
    return lambda start, stop: time_of(np.arange(start, stop)) - begin, tuple(rates.tolist())


def _strays(k: IntArray, stamp_s: FloatArray, missing: IntArray) -> float:
    """How far [s] the ticks between two gaps reach about lines of one period, at most."""
    piece = np.concatenate([[0], np.cumsum(missing > 0)])
    size = np.bincount(piece)
    k = k - (np.bincount(piece, k) / size)[piece]
    stamp = stamp_s - (np.bincount(piece, stamp_s) / size)[piece]
    residual = stamp - k * (k @ stamp) / max(float(k @ k), 1.0)
    starts = np.concatenate([[0], np.cumsum(size)[:-1]])
    reach = np.maximum.reduceat(residual, starts) - np.minimum.reduceat(residual, starts)
    return float(reach.max())


def _points(stamps: Stamps, period: float) -> tuple[IntArray, IntArray, FloatArray]:
    """(index, clock index, stamp) of the first samples of ticks, _MOST_POINTS at most."""
    many = sum(index.size for index, _, _ in stamps.points(period))
    # first samples of ticks that are looked at; of more, every second, third, ...
    most_points = 1 << 20
    stride, seen, parts = -(-many // most_points) or 1, 0, []
    for index, k, stamp in stamps.points(period):
        taken = slice(-seen % stride, None, stride)
        parts.append((index[taken], k[taken], stamp[taken]))
        seen += index.size
    if not parts:
        return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)
    index, k, stamp = (np.concatenate(column) for column in zip(*parts, strict=True))
    return index, k, stamp


#: samples below which the first and the last stamp tell the period, if no stretch does; twice as
#: many let the two ends tell the period of logs of up to fifteen samples
_FEW = 8


class ClockFit:
    """The time axis of one group of channels, from its stamps and sample numbers.

    `setup_rate_Hz` and `file_rate_Hz` are declared rates or None; `resolution_s` is the step of the
    stamps; `start_s` the time of the first sample if there are none, and `time_example` how a setup
    could name them; `counted` says that the sample number, not the stamp, is the clock; `edges`
    that there is none, however even the stamps are.
    """

    def __init__(
        self,
        *,
        setup_rate_Hz: float | None = None,
        file_rate_Hz: float | None = None,
        resolution_s: float = 0.0,
        start_s: float = 0.0,
        time_example: str = "",
        counted: bool = False,
        edges: bool = False,
    ) -> None:
        self.setup_rate_Hz, self.file_rate_Hz = setup_rate_Hz, file_rate_Hz
        self.resolution_s, self.counted, self.edges = resolution_s, counted, edges
        self.start_s, self.time_example, self.size = start_s, time_example, 0
        self._grown_s = 0.0  # how much longer the last ticks of the stamps are than the first
        self.repairs: dict[str, int] = {}
        self.flags: list[Doubt] = []
        self.remarks: list[str] = []
        self._stamps: Stamps | None = Stamps()
        self._missing: list[
            tuple[int, int]
        ] = []  # (index of the first sample behind, samples missing before it)
        self._last_number: float | None = None
        self._number_step, self._leaping = 0.0, False

    def add(self, stamps_s: FloatArray | None, number: FloatArray | None, n: int) -> None:
        """Takes the next `n` samples.

        Their stamps [s], shape (n,), or None; their sample numbers, shape (n,), or None.
        """
        if number is not None and n and not self._leaping:
            self._note_missing(number)
        if stamps_s is None and n:
            self._stamps = None
        if self._stamps is not None and stamps_s is not None:
            self._stamps.spool.append(stamps_s)
        self.size += n

    def _note_missing(self, number: FloatArray) -> None:
        """Where sample numbers are missing.

        A fall (a counter that began again) and an unreadable one say nothing.
        """
        known = np.flatnonzero(np.isfinite(number))
        if not known.size:
            return
        steps = np.diff(number[known])
        if not self._number_step:
            rising = steps[steps > 0]
            self._number_step = float(np.median(rising)) if rising.size else 1.0
        before = number[0] - self._number_step if self._last_number is None else self._last_number
        steps = np.concatenate(
            [
                [number[known[0]] - before - self._number_step * known[0]],
                steps - self._number_step * (np.diff(known) - 1),
            ]
        )
        leaps = np.flatnonzero(steps > 1.5 * self._number_step)
        # with more leaps than this a column of numbers is no sample counter; twice as many take
        # twice the memory before it is given up
        if len(self._missing) + leaps.size > 100_000:
            self._leaping, self._missing, leaps = True, [], leaps[:0]
            self.remarks.append(
                "the sample numbers leap too often to be sample numbers; they were not used"
            )
        for i in leaps:
            self._missing.append(
                (self.size + int(known[i]), round(steps[i] / self._number_step) - 1)
            )
        self._last_number = float(number[known[-1]]) + self._number_step * (
            number.size - 1 - int(known[-1])
        )

    @property
    def stamped(self) -> bool:
        """True if the samples so far have stamps, whether or not these tell a rate."""
        return self.size > 0 and self._stamps is not None

    # ---- deciding --------------------------------------------------------------------------------

    @cached_property
    def axis(self) -> TimeAxis:
        """The time axis of all samples added.

        ReadError: neither stamps nor a declared rate. SetupError: a declared rate that the stamps
        contradict beyond a fifth.
        """
        stamps, declared = self._stamps, self.setup_rate_Hz or self.file_rate_Hz
        ends = None
        if stamps is not None:
            stamps.know_missing(self._missing)
            ends = stamps.ends()
        if stamps is None or ends is None:
            return self._by_rate(declared)
        (first, start), (last, end) = ends
        if end < start and stamps.rough_period() <= 0.0:
            raise ReadError(
                "the stamps fall: the rows run backwards in time",
                allowed="allowed are rising ones",
                do="sort them by their stamps, the oldest first",
            )
        if self.edges:
            return self._explicit(stamps)
        least_s, tick_s = stamps.ticks()
        coarser = tick_s > self.resolution_s
        self.resolution_s, self._grown_s = max(self.resolution_s, tick_s), tick_s - least_s
        ticks = int(stamps.clock_index(last) - stamps.clock_index(first))
        # few stamps, some of them unknown, are no stretch that tells a period: their ends do
        known = sum(index.size for index, _ in stamps.known())
        axis = self._fitted(stamps, declared, (end - start) / ticks if known < _FEW else 0.0)
        if coarser and axis.explicit is None:
            self.remarks.append(
                f"the stamps are whole steps of {tick_s:g} s; they count as rounded times of even "
                "samples"
            )
        return axis

    def _by_rate(self, declared: float | None, seen: str = "no stamps") -> TimeAxis:
        """The axis if no stamps tell it; `seen` says what there is of them."""
        if not declared:
            if self.size < 2:
                return TimeAxis.uniform(self.size, 1.0)
            raise ReadError(
                f"{seen} and no rate",
                allowed="a log needs a time column or a rate",
                do=f"write time = {self.time_example} or sampling_rate_Hz under [log] in the setup",
            )
        return self._pieces(1.0 / declared, [(0, self.start_s)])

    def _fitted(self, stamps: Stamps, declared: float | None, few: float) -> TimeAxis:
        """The axis through stamps; `few` is the period [s] of few of them, else 0."""
        rough = stamps.rough_period() or few
        if rough <= 0.0:
            if declared:
                self.remarks.append(
                    "the stamps do not rise; the declared rate was used for the time axis"
                )
            return self._by_rate(declared, "stamps that do not rise")
        # where samples are numbered, their numbers say which are missing
        seen = None if self.counted else coarse_ticks(stamps, rough, self.resolution_s)
        gaps, wrong, wandering = seen or ([], [], None)
        if wandering:
            times, (low, middle, high) = wandering
            wanders = f"the sampling rate wanders between {low:.4g} and {high:.4g} Hz"
            if not self.setup_rate_Hz:
                self._count("stamps_repaired", sum(b - a for a, b in wrong))
                self.remarks.append(
                    f"{wanders}; times follow the stamps, whose step is {self.resolution_s:g} s"
                )
                for index, samples in gaps:
                    self._gap(index, samples)
                return TimeAxis.read_by(times, self.size, middle)
            self.remarks.append(
                f"the stamps say that {wanders}; without sampling_rate_Hz in the setup they are "
                "followed"
            )
        noise, rounded = stamps.noise(rough, self.resolution_s)
        noise = max(noise, 0.0 if stamps.bunched else 0.3 * self.resolution_s)
        jumps: list[Jump] = [(index, n * rough) for index, n in gaps]
        rounding = self.resolution_s if rounded and not stamps.bunched else None
        if not seen:
            jumps, wrong = stamps.jumps(rough, noise, rounding)
        period, error, spread, pieces = stamps.fit(rough, jumps, wrong)
        if stamps.bunched and not np.isfinite(error) and self.size >= _FEW:
            # one tick of the stamps begins within the log, and two are needed to time it
            return self._by_rate(declared, "stamps that rise once")
        coarse = stamps.bunched or self.counted
        # share of a period by which a clock's stamps may stray, unless a rate is declared; twice as
        # much puts stamps that stray by a fifth of a period on an even grid
        jitter = 0.1
        strays = spread > max(jitter * period, self.resolution_s)
        if strays and not coarse and (not declared or noise < jitter * period):
            return self._explicit(stamps)
        ticks = max(int(stamps.clock_index(self.size - 1)), 1)
        # a stamp coarser than a period hides two of them: where in the tick it lies, and one lost
        # sample
        hidden = 2.0 * period if self.resolution_s >= period else 0.51 * self.resolution_s
        tolerance = max(4.0 * error, hidden / ticks)
        fitted, period = period, self._settled(period, tolerance)
        self._count("stamps_repaired", sum(stop - start for start, stop in wrong))
        # to a picosecond
        levels = [(first, round(stamp - period * k, 12) + 0.0) for first, k, stamp in pieces]
        shift = levels[0][1]
        if coarse and abs(shift) <= max(self.resolution_s, period):
            # a stamp of one second's resolution does not say where in the second
            levels = [(first, level - shift) for first, level in levels]
        axis = self._pieces(period, self._continued(levels, period))
        # the error of a rate that tables hold, as a share; half of it is below that of most radii,
        # twice as much is as large as that of a good speed
        least_vague = 1e-4
        if coarse:
            self._count_against_stamps(stamps, period)
            reach = stamps.reach(rough, wrong)
            # the first stamp of a tick is half a tick early or late, the same all along or not
            share = max(error / period, 1.0 / reach, self._grown_s / (reach * period))
            given = declared is not None and period == 1.0 / declared
            # a rate that is known to less than this tells no speed
            if share > 1e-2 and not given and self.size >= _FEW:
                return self._by_rate(
                    declared,
                    f"stamps of {self.resolution_s:g} s, too coarse for a rate (an error of "
                    f"{share:.1%})",
                )
            return replace(axis, rate_error=share if share > least_vague and not given else 0.0)
        # stamps that are but rounded may be off alike for long
        of_digits = 1.02 * rounding / ticks if rounding else 0.0
        off = max(tolerance if period != fitted else error, of_digits)
        # a rate that was declared has no error, nor has a round number of three digits, unless one
        # lies near any rate that the stamps allow
        round_Hz = float(f"{1.0 / period:.3g}")
        digit_Hz = 10.0 ** (math.floor(math.log10(round_Hz)) - 2)
        rates = [self.setup_rate_Hz, self.file_rate_Hz]
        rates += [round_Hz] if off * round_Hz < 0.25 * period * digit_Hz else []
        known = any(rate and period == 1.0 / rate for rate in rates)
        vague = off > least_vague * period and not known
        return replace(axis, rate_error=off / period if vague else 0.0)

    def _settled(self, period: float, tolerance: float) -> float:
        """The period in which rate and stamps agree, else that of the stamps.

        Of a declared or a round rate if the stamps agree within `tolerance` [s]. A difference
        from a declared one gives a remark. SetupError beyond a fifth, if the setup declared it.
        """
        rate = 1.0 / period
        for said, declared in (("the setup", self.setup_rate_Hz), ("the file", self.file_rate_Hz)):
            if declared and abs(1.0 / declared - period) <= tolerance:
                return 1.0 / declared
            if not declared:
                continue
            factor = max(declared / rate, rate / declared)
            # a declared rate is contradicted by stamps that differ by this share, and absurd beyond
            # this factor; twice as much leaves rates that are wrong by 0.4 % unsaid
            if factor > 1.2 and said == "the setup":
                raise SetupError(
                    f"sampling_rate_Hz = {declared:g}, but the stamps say {rate:.6g} Hz",
                    allowed="allowed is a rate that the stamps bear out",
                    do="mend sampling_rate_Hz, or time and time_unit, under [log]",
                )
            if factor - 1.0 > 0.002:
                self.remarks.append(
                    f"{said} says {declared:g} Hz, the stamps say {rate:.6g} Hz; the stamps were "
                    "followed"
                )
            self._count("clock_drift_ppm", round(abs(rate / declared - 1.0) * 1e6))
        rounds = [float(f"{rate:.{digits}g}") for digits in (1, 2, 3, 4, 5)]
        return next(
            (1.0 / candidate for candidate in rounds if abs(1.0 / candidate - period) <= tolerance),
            period,
        )

    # ---- building --------------------------------------------------------------------------------

    def _continued(self, levels: list[Level], period: float) -> list[Level]:
        """Levels of pieces whose lines never run backwards.

        A repeated row is a piece of its own between two, a clock set back is made to run on.
        """
        out, shift = [levels[0]], 0.0
        for (_, before), (first, level) in pairwise(levels):
            step = level - before
            if step >= 0.0:
                self._gap(first, round(step / period))
            elif step > -1.5 * period:
                self._count("repeated_stamps", 1)
                self.flags.append((first, first + 1, Quality.REPEATED_STAMP))
                out.append((first, out[-1][1] - 0.5 * period))
                first += 1
            else:
                shift -= step
                if "clock_set_back" not in self.repairs:
                    self.remarks.append(
                        f"the stamps go back by {-step:.4g} s at sample {first}, and times go on "
                        "from there; are these two recordings in one file?"
                    )
                self._count("clock_set_back", 1)
                self.flags.append((first - 1, first + 1, Quality.CLOCK_SET_BACK))
            out.append((first, level + shift))
        return [piece for piece in out if piece[0] < self.size]

    def _pieces(self, period: float, levels: list[Level]) -> TimeAxis:
        """Segments of one period.

        One for each of the `levels`, and one behind each run of missing sample numbers.
        """
        for index, samples in self._missing:
            self._gap(index, samples)
        begins, level = (np.array(column) for column in zip(*levels, strict=True))
        behind = np.array([index for index, _ in self._missing], np.int64)
        firsts = np.unique(np.concatenate([begins, behind]))
        firsts[0] = 0
        which = np.searchsorted(begins, firsts, side="right") - 1
        clock = Stamps()
        clock.know_missing(self._missing)
        starts = level[np.maximum(which, 0)] + period * clock.clock_index(firsts)
        # a clock set back leaves no segment behind
        runs_on = np.abs(np.diff(starts) - period * np.diff(firsts)) < 1e-9 * period
        keep = np.concatenate([[True], ~runs_on])
        return TimeAxis(
            self.size,
            float(1.0 / period),
            firsts[keep],
            starts[keep],
            np.full(int(keep.sum()), float(period)),
        )

    def _gap(self, index: int, samples: int) -> None:
        self._count("gaps", 1)
        self._count("lost_samples", samples)
        self.flags.append((index - 1, index + 1, Quality.GAP))

    def _count_against_stamps(self, stamps: Stamps, period: float) -> None:
        """Notes samples that whole seconds should hold and do not.

        Only if every stamp of a coarse clock is there.
        """
        # the first tick, which the log may begin in the midst of, has no point
        steps, ticks, first, last = [], int(stamps.bunched), 0, 0
        for index, k, _ in stamps.points(period):
            ticks += index.size
            first, last = (
                (first or int(index[index > 0][0]) if (index > 0).any() else first),
                int(index[-1]),
            )
            steps.append(np.diff(k))
        per_tick = float(np.median(np.concatenate(steps))) if ticks > 2 else 0.0
        whole = self.resolution_s / period
        if (
            per_tick < 4
            or abs(per_tick - whole) > 1.5
            or min(first, self.size - last) < per_tick - 1.5
        ):
            # the log begins or ends inside of a tick, so that its length does not say how many
            # samples it should have
            return
        lost = (
            round(ticks * whole)
            - int(stamps.clock_index(self.size - 1))
            - 1
            - self.repairs.get("lost_samples", 0)
        )
        self._count("lost_samples", max(lost, 0))

    def _explicit(self, stamps: Stamps) -> TimeAxis:
        """The stamps themselves; those that are unknown or fall lie between their neighbours."""
        if not self.edges:
            self.remarks.append(
                "the samples have no clock of their own (irregular stamps): their times are the "
                "stamps"
            )
        times, repaired, step, far = stamps.rising()
        self._count("stamps_repaired", repaired)
        for index in far:
            self._gap(index, 0)
        return TimeAxis.read_by(lambda start, stop: times[start:stop], self.size, 1.0 / step)

    def _count(self, what: str, number: int) -> None:
        if number:
            self.repairs[what] = self.repairs.get(what, 0) + number
