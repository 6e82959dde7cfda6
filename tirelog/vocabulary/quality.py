"""Every quality word, once: its sentence, its tables, and the uses that its row is good for.

    estimator --flags (n,) uint32: `marked(rows, Quality.GAP) | ...`--> `good(flags)` for the next
    estimator, `quality_column(flags)` for a table: 'ok', or words joined by ';'

A member of `Quality` is all that a new word needs here; docs/quality_words.md is made from this
file (`make reference`).
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum, IntFlag
from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

#: quality words of rows, a bit for each, shape (n,)
QualityFlags = NDArray[np.uint32]

#: the text of a row without a word
OK = "ok"

_FOOTPRINT, _PHASE_SHIFT = ("footprint",), ("phase-shift",)
_PASSAGES = ("speed", "footprint", "dissipation")
_WHEEL = ("speed", "phase-shift")
_ALL = (*_PASSAGES, "phase-shift")


class Use(Enum):
    """The use of a row; the value is the sentence of the reference page."""

    ANY = "everywhere"
    COMPARISON = "in comparisons with a model, which say how many rows have it"
    FRONTS = "for width, calibration and forces, which the fronts give without it"


class Quality(IntFlag):
    """A word for a fault of a row: NAME = sentence, tables, uses that the row is good for.

    The word in a table is the name in small letters. A row is good for a use if all of its words
    leave it so (Use.ANY: for every use). Only words are stored, no flags: the order here is free.
    """

    sentence: str
    tables: tuple[str, ...]
    good_for: tuple[Use, ...]

    def __new__(cls, sentence: str, tables: tuple[str, ...], *good_for: Use) -> Quality:
        member = int.__new__(cls, 1 << len(cls.__members__))
        member._value_ = int(member)
        member.sentence, member.tables, member.good_for = sentence, tables, good_for
        return member

    @property
    def word(self) -> str:
        """The word in tables."""
        return str(self.name).lower()

    # ---- what the samples were
    LOST_PEAK = "samples of the window are lost, or no patch was found in it", _ALL
    GAP = "the recording has a gap there", _ALL
    CLIPPED = "the signal is at the end of its range", _ALL
    SPIKE = "samples far from all others, or error codes, were left out", _PASSAGES
    FEW_SAMPLES = "too few samples in the window for a waveform", _PASSAGES
    EDGE_OF_LOG = "the log begins or ends there", _ALL
    SPURIOUS_PEAK = "a reported peak was judged to be another grating's", _PASSAGES
    ERROR_CODE = "the instrument reported an error", _PASSAGES
    REPEATED_STAMP = "a time stamp is repeated there", _PASSAGES
    CLOCK_SET_BACK = "the clock was set back there; the log's time goes on", _PASSAGES
    FOREIGN_DOUBT = "the run has a quality word there that this version does not know", _PASSAGES
    # ---- how the wheel turned
    STANDSTILL = "the wheel is at rest, or was between this passage and a neighbour", _ALL
    REVERSING = "the wheel rolls backwards, or changed direction beside this passage", _ALL
    DIRECTION_UNKNOWN = "nothing shows the direction of rolling after a standstill", _WHEEL
    NOT_A_PASSAGE = "not the signal of a tire in its patch: no speed", _PASSAGES
    IMPLAUSIBLE = "no tire does this, or channels or clock of the log contradict it", _ALL
    EXTRAPOLATED = "the speed is not centred, or lies outside a calibration", _ALL, Use.FRONTS
    DELAY_UNKNOWN = "the unknown delay of the vehicle's speed: half a per cent of slip", ("slip",)
    # ---- what could be estimated
    ERROR_UNKNOWN = "a value smaller than its error, left blank", ("speed", "dissipation")
    UNLIKE_NEIGHBOURS = (
        "far from the turns before and after, on the same side of both",
        (*_ALL, "slip"),
    )
    CUTOFF = "the sampling is too coarse for the low-pass", ("footprint", "dissipation")
    PATCH_SHORT = "too few samples between the edges for a length", _FOOTPRINT
    NO_LENGTH = "no contact length could be found", _FOOTPRINT
    EDGE_UNCLEAR = "the second derivative has no clear extremum at an edge", _FOOTPRINT
    FORM_UNCLEAR = (
        "edge shape not recognised: the length may be off by 50 %; a form may hold other physics",
        (*_FOOTPRINT, "form"),
        Use.COMPARISON,
    )
    TRACTION_UNRESOLVED = (
        "the car speeds up or slows down, and the effect of traction on the length is unresolved",
        _FOOTPRINT,
        Use.COMPARISON,
    )
    NO_ZERO = "no stretch for the zero of the phase shift", _PHASE_SHIFT, Use.FRONTS
    DELAY_REMOVED = "a good row: the delay of the calibration was subtracted", _PHASE_SHIFT, Use.ANY
    LEAK = "strain was lost at this stop", ("inflation",)
    # ---- comparisons
    LEFT_OUT = "not compared: too many logs for the memory", ("compare --by revolution",)
    BEYOND_MODEL = "the model does not cover this speed or load", ("compare --by revolution",)
    UNLIKE = "the model covers less than a fifth of the hit", ("compare --by hit",)


#: samples [start, stop) of a channel that reader or clock doubted, and why
Doubt = tuple[int, int, Quality]


def none_of(n: int) -> QualityFlags:
    """Flags of `n` rows without a word."""
    return np.zeros(n, np.uint32)


def marked(rows: NDArray[np.bool_], word: Quality) -> QualityFlags:
    """Flags with `word` in the `rows` that are True, none in the others; shape (n,)."""
    return np.multiply(rows, np.uint32(word), dtype=np.uint32)


def having(flags: QualityFlags, words: int) -> NDArray[np.bool_]:
    """Which rows have at least one of the `words`, shape (n,)."""
    return np.asarray((flags & np.uint32(words)) != 0)


def good(flags: QualityFlags, use: Use = Use.ANY) -> NDArray[np.bool_]:
    """Which rows are good for a use, shape (n,): those without a word that spoils it."""
    return ~having(flags, _spoilers(use))


def good_rows(column: Iterable[object]) -> NDArray[np.bool_]:
    """Which rows of a table's quality column are good, shape (n,).

    An unknown word spoils its row.
    """
    known = _good_texts()
    return np.array([isinstance(text, str) and text in known for text in column], bool)


def quality_text(flags: int) -> str:
    """The words of a row in alphabetical order joined by ';', or 'ok'.

    ValueError: a flag that is no word's.

    >>> quality_text(Quality.SPIKE | Quality.GAP)
    'gap;spike'
    """
    if flags & ~_ALL_FLAGS:
        raise ValueError(f"{flags:#x} has a flag that is no quality word's")
    return ";".join(sorted(flag.word for flag in Quality if flag & flags)) or OK


def quality_column(flags: QualityFlags) -> NDArray[np.object_]:
    """The quality column of a table whose rows have these words, texts of shape (n,).

    Few sets of words are different, so each is put once.
    """
    sets, which = np.unique(flags, return_inverse=True)
    return np.array([quality_text(int(one)) for one in sets], object)[which]


def flag_of(word: str) -> Quality | None:
    """The flag of a word; None if the register does not have it."""
    return _BY_WORD.get(word)


_BY_WORD = {flag.word: flag for flag in Quality}
_ALL_FLAGS = sum(Quality)


@cache
def _spoilers(use: Use) -> int:
    """The flags of all words after which a row is no longer good for a use."""
    return sum(
        flag for flag in Quality if use not in flag.good_for and Use.ANY not in flag.good_for
    )


@cache
def _good_texts() -> tuple[str, ...]:
    """Every text of a row that is good for all uses."""
    harmless = [flag for flag in Quality if Use.ANY in flag.good_for]
    sets = (some for n in range(len(harmless) + 1) for some in combinations(harmless, n))
    return tuple(quality_text(sum(some)) for some in sets)
