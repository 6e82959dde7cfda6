"""Gratings in rows that hold a varying number of peaks.

Found by wavelength and followed as they move, never by position.

    rows of peaks (Parsed.first, .cells, .counts)
        --GratingTracker, block after block--> one value per row and grating

A row is *plain* for a grating on three conditions. Exactly one peak lies in its window, no other
grating claims that peak, and it lies within the gate of the grating's peak before. Plain rows,
nearly all of them, are taken at once. The others are decided one by one, in order: the pairs of
grating and peak are taken by distance from the last accepted position, nearest first, each once.
The gate opens as samples go by without a peak. A grating that is being followed may leave its
window by 3 nm, as far as strain moves it. A peak in the window that is not taken, a duplicate for
one, is refused and its sample flagged `spurious_peak`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from tirelog.data.setup import ChannelSetup
from tirelog.errors import SetupError
from tirelog.readers.base import runs
from tirelog.readers.text.parse import Parsed
from tirelog.vocabulary.arrays import FloatArray, IntArray
from tirelog.vocabulary.quality import Quality

#: how far strain moves a grating [nm]: half the widest window, and how far it is followed beyond a
#: given one
REACH_NM = 3.0
#: the gate is at least this wide on each side [nm] and grows by this share of itself with every
#: sample that goes without a peak
_GATE_NM, _GROWTH = 1.0, 0.25
#: after so many samples without a peak a grating is looked for in its window again
_FORGOTTEN = 1000

_FIBRE = re.compile(r"(?:ch(?:annel)?|fib(?:re|er)|port)\D{0,2}0*(\d+)", re.I)
Flag = tuple[str, int, int, Quality]


@dataclass
class _Grating:
    """One followed grating.

    Its window [nm], its fibre (None: any), the last accepted position and how many samples ago it
    was.
    """

    name: str
    low: float
    high: float
    rest: float
    fibre: int | None
    last: float = np.nan
    age: int = 0

    @property
    def half(self) -> float:
        return max(_GATE_NM, 0.5 * (self.high - self.low))

    def on(self, fibre: IntArray | None) -> NDArray[np.bool_] | bool:
        """Which peaks of these fibres may be its own; all, if the fibres are not known."""
        return True if fibre is None or self.fibre is None else fibre == self.fibre

    def gate(self, age: FloatArray | IntArray | int) -> FloatArray:
        """Half width of the gate [nm] `age` samples after the last accepted peak."""
        return np.minimum(
            self.half * (1.0 + _GROWTH * (np.asarray(age) - 1.0)), 2.0 * (self.half + REACH_NM)
        )


class GratingTracker:
    """Follows the gratings of `channels` (setup's name -> its setup) through a log."""

    def __init__(self, channels: Mapping[str, ChannelSetup]) -> None:
        self._gratings = [_grating(name, channels) for name in channels]
        _refuse_overlap(self._gratings, channels)

    def follow(self, parsed: Parsed) -> tuple[dict[str, FloatArray], list[Flag]]:
        """(values of each grating, shape (n,), NaN if it has no peak; flags) of a block's rows.

        The values are as in the log.
        """
        peaks = np.zeros((parsed.size, 0)) if parsed.peaks is None else parsed.peaks
        some = np.flatnonzero((peaks > 0.0).any(axis=0))
        peaks = peaks[:, : some[-1] + 1 if some.size else 0]
        n, width = peaks.shape
        row = np.repeat(np.arange(n), width)
        cells = np.where(peaks > 0.0, peaks, np.nan).ravel()
        fibre = _fibres(parsed.counts, width)
        claims = [
            (cells >= grating.low) & (cells <= grating.high) & grating.on(fibre)
            for grating in self._gratings
        ]
        values = np.full((len(self._gratings), n), np.nan)
        doubtful = np.zeros((len(self._gratings), n), bool)
        contested = np.sum(claims, axis=0) > 1
        for g, grating in enumerate(self._gratings):
            values[g], doubtful[g], beside = _plain(grating, cells, row, claims[g], n)
            contested |= beside
        for g in range(len(self._gratings)):
            doubtful[g, row[claims[g] & contested]] = True
        values[doubtful] = np.nan
        refused = self._decide(values, doubtful, cells, fibre)
        for g, grating in enumerate(self._gratings):
            known = np.flatnonzero(~np.isnan(values[g]))
            if known.size:
                grating.last, grating.age = float(values[g, known[-1]]), n - 1 - int(known[-1])
            else:
                grating.age += n
        names = [grating.name for grating in self._gratings]
        flags = [
            (name, start, stop, Quality.SPURIOUS_PEAK)
            for name, rows in zip(names, refused, strict=True)
            for start, stop in runs(rows)
        ]
        return dict(zip(names, values, strict=True)), flags

    def why_silent(self, channel: str, peaks: list[float]) -> str:
        """The sentence on a grating that no row had a peak for, by `peaks` of some rows."""
        grating = next(grating for grating in self._gratings if grating.name == channel)
        # to the next half nanometre, those of most rows
        often = Counter(round(2.0 * peak) / 2.0 for peak in peaks if peak > 0.0).most_common(12)
        seen = ", ".join(f"{peak:g}" for peak, _ in sorted(often))
        return (
            f"no peak between {grating.low:g} and {grating.high:g} in any row; peaks were seen "
            f"at about {seen or 'no wavelength'}; "
            "mend window_nm, reference_wavelength_nm or unit in the setup"
        )

    def _decide(
        self,
        values: FloatArray,
        doubtful: NDArray[np.bool_],
        cells: FloatArray,
        fibre: IntArray | None,
    ) -> NDArray[np.bool_]:
        """Fills `values` in the doubtful rows, one after another; where peaks are refused.

        Both have the shape (gratings, rows).
        """
        refused = np.zeros(doubtful.shape, bool)
        n = values.shape[1]
        width = cells.size // max(n, 1)
        index = np.where(~np.isnan(values) & ~doubtful, np.arange(n), -1)
        plain = np.maximum.accumulate(index, axis=1) if n else index
        accepted = [-1] * len(self._gratings)
        for r in np.flatnonzero(doubtful.any(axis=0)).tolist():
            peaks = slice(r * width, (r + 1) * width)
            here = cells[peaks]
            pairs = []
            for g in np.flatnonzero(doubtful[:, r]).tolist():
                grating = self._gratings[g]
                before = max(int(plain[g, r]), accepted[g])
                last, age = (
                    (values[g, before], r - before)
                    if before >= 0
                    else (grating.last, grating.age + r + 1)
                )
                mine = grating.on(None if fibre is None else fibre[peaks])
                pairs += _pairs(grating, g, here, mine, last, age)
            taken: dict[int, int] = {}
            for _, g, peak in sorted(pairs):
                if g not in taken and peak not in taken.values():
                    taken[g] = peak
            for g in np.flatnonzero(doubtful[:, r]).tolist():
                grating = self._gratings[g]
                values[g, r] = here[taken[g]] if g in taken else np.nan
                accepted[g] = r if g in taken else accepted[g]
                left = np.array([peak not in taken.values() for peak in range(here.size)], bool)
                if (left & (here >= grating.low) & (here <= grating.high)).any():
                    refused[g, r] = True
        return refused


def _grating(name: str, channels: Mapping[str, ChannelSetup]) -> _Grating:
    """A channel's grating, in the unit of its source.

    Without a window it reaches half way to its neighbours, at most 3 nm.
    """
    channel = channels[name]
    scale = {"nm": 1.0, "pm": 1e3, "um": 1e-3, "m": 1e-9, "mm": 1e-6}.get(channel.source_unit, 1.0)
    match = _FIBRE.search(channel.source)
    fibre = int(match[1]) - 1 if match else None
    rest = channel.reference_wavelength_nm or 0.0
    others = [
        abs(c.reference_wavelength_nm - rest)
        for n, c in channels.items()
        if n != name and c.reference_wavelength_nm
    ]
    reach = min([REACH_NM] + [0.5 * distance for distance in others if distance > 0.0])
    low, high = channel.window_nm or (rest - reach, rest + reach)
    middle = rest if low <= rest <= high else 0.5 * (low + high)
    first, last = sorted((channel.recorded(low * scale), channel.recorded(high * scale)))
    return _Grating(name, first, last, channel.recorded(middle * scale), fibre)


def _refuse_overlap(gratings: Sequence[_Grating], channels: Mapping[str, ChannelSetup]) -> None:
    """SetupError if two gratings of a fibre may be anywhere in the same part of the spectrum."""
    told = [grating for grating in gratings if channels[grating.name].window_nm is not None]
    for one, other in combinations(told, 2):
        apart = one.fibre is not None and other.fibre is not None and one.fibre != other.fibre
        low, high = max(one.low, other.low), min(one.high, other.high)
        if low < high and not apart:
            raise SetupError(
                f"window_nm of {one.name} and of {other.name} overlap between {low:g} and {high:g}",
                allowed="a peak there may be of either; allowed are windows apart on one fibre",
                do="make one of them end where the other begins",
            )


def _fibres(counts: IntArray | None, width: int) -> IntArray | None:
    """The fibre of each of `width` peaks a row, by the counts in front; None if there are none."""
    if counts is None:
        return None
    ends = np.cumsum(counts, axis=1)[:, None, :]
    which: IntArray = (np.arange(width)[None, :, None] >= ends).sum(axis=2)
    return which.ravel()


def _plain(
    grating: _Grating, cells: FloatArray, row: IntArray, claims: NDArray[np.bool_], n: int
) -> tuple[FloatArray, NDArray[np.bool_], NDArray[np.bool_]]:
    """(the lone peak of each row, rows to decide one by one, peaks beside the window).

    The last ones may be the grating's.
    """
    values = np.full(n, np.nan)
    many = np.bincount(row[claims], minlength=n)
    doubtful = many > 1
    values[row[claims]] = cells[claims]
    beside = (
        ~claims
        & (cells > grating.low - REACH_NM)
        & (cells < grating.high + REACH_NM)
        & (many == 0)[row]
    )
    if np.isnan(grating.last) or grating.age > _FORGOTTEN:
        beside &= row > (np.argmax(many > 0) if many.any() else n)
    doubtful[row[beside]] = True
    known = np.flatnonzero(~np.isnan(values))
    if known.size:
        before = np.concatenate([[grating.last], values[known[:-1]]])
        age = np.concatenate([[known[0] + grating.age + 1], np.diff(known)])
        doubtful[known[np.abs(values[known] - before) > grating.gate(age)]] = True
    return values, doubtful, beside


def _pairs(
    grating: _Grating,
    g: int,
    here: FloatArray,
    mine: NDArray[np.bool_] | bool,
    last: float,
    age: int,
) -> list[tuple[float, int, int]]:
    """(distance, grating, peak) of the peaks of a row that a grating may take."""
    if np.isnan(last) or age > _FORGOTTEN:
        distance = np.abs(here - grating.rest)
        allowed = mine & (here >= grating.low) & (here <= grating.high)
    else:
        distance = np.abs(here - last)
        allowed = (
            mine
            & (distance <= grating.gate(age))
            & (here > grating.low - REACH_NM)
            & (here < grating.high + REACH_NM)
        )
    return [(float(distance[peak]), g, peak) for peak in np.flatnonzero(allowed).tolist()]
