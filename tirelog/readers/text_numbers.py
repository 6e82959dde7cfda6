"""Cells one by one, for what is not written as plain digits: too many digits for an exact product, words, and what is no number at all.

block, spans of cells --pyarrow, one cell a line; else each by itself--> numbers, which cells are no numbers
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from tirelog.readers.digits import Block
from tirelog.readers.sniff import LOST_WORDS
from tirelog.recording import FloatArray, IntArray

_NULLS = sorted({*LOST_WORDS, *(w.upper() for w in LOST_WORDS), *(w.capitalize() for w in LOST_WORDS), "NaN", "-NaN", " ", "  "})
#: fewer cells than this are not worth the library
_FEW = 200


def cell_numbers(block: Block, starts: IntArray, stops: IntArray, decimal: str) -> tuple[FloatArray, NDArray[np.bool_]]:
    """(each cell as a number, NaN where it is none or infinite; True where it is neither a number nor a word for a lost one)."""
    texts: list[Block] = [block[a:b] for a, b in zip(starts.tolist(), stops.tolist())]
    if len(texts) >= _FEW:
        import pyarrow as pa

        with suppress(pa.ArrowInvalid):
            return _together(texts, decimal), np.zeros(len(texts), bool)
    numbers, unread = np.full(len(texts), np.nan), np.zeros(len(texts), bool)
    for i, text in enumerate(texts):
        cell = text.decode("latin-1").replace(decimal, ".")
        if cell.lower() in LOST_WORDS:
            continue
        with suppress(ValueError):
            numbers[i] = float(cell) if "_" not in cell else np.nan
        unread[i] = np.isnan(numbers[i])
        numbers[i] = np.nan if np.isinf(numbers[i]) else numbers[i]
    return numbers, unread


def _together(texts: list[Block], decimal: str) -> FloatArray:
    """All cells by the library.  ArrowInvalid where one is no number."""
    import pyarrow as pa
    import pyarrow.csv as csv

    joined = b"\n".join(texts) + b"\n"
    table = csv.read_csv(
        pa.py_buffer(joined),
        csv.ReadOptions(use_threads=False, column_names=["0"], block_size=max(len(joined) + 1, 1024)),
        csv.ParseOptions(delimiter="\x1f", quote_char=False, ignore_empty_lines=False),
        csv.ConvertOptions(check_utf8=False, column_types={"0": pa.float64()}, null_values=_NULLS, decimal_point=decimal),
    )
    if table.num_rows != len(texts):
        raise pa.ArrowInvalid
    values = np.asarray(table.column(0).to_numpy(), dtype=np.float64)
    return np.where(np.isinf(values), np.nan, values)
