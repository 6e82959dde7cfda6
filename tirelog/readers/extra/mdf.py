"""MDF measurements (versions 3 and 4) as HDF5: a group per clock, its channels and their times.

Numbers go through the conversions that the file states. One that is a formula is handed to numexpr,
which evaluates text; so only sums and products of numbers and X are let through.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.readers.extra.child import Answer
from tirelog.readers.extra.datasets import Datasets, proper

#: records read at once
_RECORDS = 1 << 18
_FORMULA = re.compile(r"(?:[-+*/() \t]|\d+\.?\d*(?:[eE][-+]?\d+)?|[Xx]1?)*")
_MOST_LETTERS, _MOST_DEPTH = 200, 8


def load() -> None:
    """Imports what reads it."""
    import asammdf  # noqa: F401


def convert(source: Path, target: Path, answer: Answer) -> None:
    """Writes the channels of numbers to `target`, with the times of each group."""
    from asammdf import MDF

    with MDF(source) as file, Datasets(target, answer) as to:
        answer.start = file.start_time.isoformat()
        masters = file.masters_db
        for number, group in enumerate(file.groups):
            records = int(group.channel_group.cycles_nr)
            if not records:
                continue
            name = getattr(group.channel_group, "acq_name", "") or f"group_{number + 1}"
            made = to.group(name)
            for index, channel in enumerate(group.channels):
                is_time = masters.get(number) == index
                if not is_time and (formula := unsafe_formula(channel.conversion)):
                    answer.passed_over.append(
                        f"{proper(channel.name)} is converted by the formula {formula!r}"
                    )
                    continue
                unit: list[str] = []
                pieces = _pieces(file, number, index, records, unit)
                try:
                    first = next(pieces, None)
                    if first is None:
                        continue
                    to.add(
                        made,
                        "time" if is_time else channel.name,
                        _all(first, pieces),
                        {"units": "s" if is_time else unit[0]},
                    )
                except MemoryError:
                    raise
                # one channel that is damaged is no reason to lose the others
                except Exception as problem:
                    kind = type(problem).__name__
                    answer.losses.append(f"{proper(channel.name)} cannot be read ({kind})")


def _all(first: NDArray[Any], rest: Iterator[NDArray[Any]]) -> Iterator[NDArray[Any]]:
    yield first
    yield from rest


def _pieces(
    file: Any, group: int, index: int, records: int, unit: list[str]
) -> Iterator[NDArray[Any]]:
    """The channel's values, NaN where the file says that they are none; `unit` is filled."""
    for start in range(0, records, _RECORDS):
        signal = file.get(
            group=group,
            index=index,
            record_offset=start,
            record_count=min(_RECORDS, records - start),
            ignore_invalidation_bits=True,
        )
        unit.append(str(signal.unit or ""))
        values = signal.samples
        if signal.invalidation_bits is not None and values.dtype.kind in "iufb":
            values = np.where(np.asarray(signal.invalidation_bits, bool), np.nan, values)
        yield values
        if not values.size:
            return


def unsafe_formula(conversion: Any, depth: int = 0) -> str:
    """A formula in a conversion, or in those that it refers to, that is more than arithmetic."""
    if conversion is None:
        return ""
    formula = getattr(conversion, "formula", "") or ""
    if isinstance(formula, bytes):
        formula = formula.decode("latin-1")
    long = len(formula) > _MOST_LETTERS or depth > _MOST_DEPTH
    if long or "**" in formula or not _FORMULA.fullmatch(formula):
        return str(formula)[:40] or "of formulas"
    inside = getattr(conversion, "referenced_blocks", None) or {}
    found = (unsafe_formula(one, depth + 1) for one in inside.values() if not _is_text(one))
    return next((formula for formula in found if formula), "")


def _is_text(block: object) -> bool:
    return isinstance(block, bytes | str)
