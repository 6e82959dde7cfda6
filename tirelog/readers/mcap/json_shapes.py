"""JSON messages that are written alike but for their numbers, read in one compiled pass.

    first message --its text between the numbers--> Shape
        --compiled: text alike, numbers read--> cells (messages, wanted) --> FieldColumn per want

    {"wl": [1550.1, 1551.2], "n": 3}   texts  {"wl": [   ,    ], "n":   }   cells  1550.1 1551.2 3

Kept beside arrow's reader for its cost: 600,000 messages of 16 numbers, 36 MB, took 1.5 s of CPU
from file to arrays, 3.8 s by arrow; all tables of such a log take 4 to 5 s (22 November 2026, two
shared cores, Python 3.11; `tirelog tables` and the reader as `python -m benchmarks mcap` calls it).
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tirelog.kernels import compiled
from tirelog.readers.mcap.source import FieldError, Want, is_list
from tirelog.readers.text.digits import Bytes, as_float, digits_number
from tirelog.vocabulary.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    from tirelog.readers.mcap.source import FieldColumn
    from tirelog.readers.mcap.walk import MessageTable


@compiled
def numbers_between(
    data: Bytes,
    starts: IntArray,
    sizes: IntArray,
    texts: Bytes,
    edges: IntArray,
    slots: IntArray,
    values: FloatArray,
) -> int:
    """Reads messages into the columns of `values`; how many until one is not alike.

    Message i is `data[starts[i] : starts[i] + sizes[i]]` and goes into values[:, i]; a message that
    is not read so easily ends it too.

    Text k of a message is `texts[edges[k] : edges[k + 1]]`, and number k stands behind it: it goes
    to values[slots[k]] (-1: nowhere). `null` is NaN. The last text is not empty and no part of a
    number, so that no number runs past its message.
    """
    for i in range(starts.size):
        at, end = starts[i], starts[i] + sizes[i]
        if at == end or data[end - 1] != texts[texts.size - 1]:
            return i
        for k in range(edges.size - 1):
            length = edges[k + 1] - edges[k]
            if at + length > end:
                return i
            for place in range(length):
                if data[at + place] != texts[edges[k] + place]:
                    return i
            at += length
            if k == slots.size:
                break
            if (
                at + 4 < end
                and data[at] == 110
                and data[at + 1] == 117
                and data[at + 2] == 108
                and data[at + 3] == 108
            ):
                value, at = np.nan, at + 4
            elif at == end or data[at] == 43:
                return i
            else:
                m, e, stop = digits_number(data, at, 46)
                value, good = as_float(m, e, data[at] == 45)
                if stop < 0 or (slots[k] >= 0 and not good):
                    return i
                at = stop
            if slots[k] >= 0:
                values[slots[k], i] = value
        if at != end:
            return i
    return starts.size


#: numbers in a message; one with more has no shape
MOST_CELLS = 4096


@dataclass(frozen=True)
class _Cell:
    """A number of the template: the how manieth of its message it is, and how it is written."""

    number: int
    text: str


@dataclass(frozen=True)
class MessageShape:
    """The form of one message: its texts, and the cells that each want reads.

    `texts` before, between and behind its numbers are joined, and cut at `edges`; each want has its
    cells (True: a batch). `slots` shape (cells,): the place of each cell among those that are
    wanted, -1 if it is not.
    """

    texts: NDArray[np.uint8]
    edges: IntArray
    slots: IntArray
    wanted: list[tuple[list[int], bool]]


def shape_of(message: bytes, wants: list[Want]) -> MessageShape | None:
    """The shape of `message`; None without one.

    So if it is no object of numbers, or a want is none of them.
    """
    found: list[_Cell] = []

    def cell(text: str) -> _Cell:
        if len(found) == MOST_CELLS:
            raise ValueError
        found.append(_Cell(len(found), text))
        return found[-1]

    try:
        template = json.loads(message, object_pairs_hook=_unlike, parse_float=cell, parse_int=cell)
        wanted = [_cells(template, want) for want in wants]
        edges = _edges(message, found)
    except (ValueError, RecursionError):
        return None
    used = sorted({number for cells, _ in wanted for number in cells})
    slots = np.full(len(found), -1)
    slots[used] = np.arange(len(used))
    texts = b"".join(message[a:b] for a, b in edges)
    cuts = np.cumsum([0] + [b - a for a, b in edges])
    return MessageShape(
        np.frombuffer(texts, np.uint8),
        cuts,
        slots,
        [([int(slots[c]) for c in cells], batch) for cells, batch in wanted],
    )


def _edges(message: bytes, cells: list[_Cell]) -> list[tuple[int, int]]:
    """[start, stop) of the texts around the cells, which stand in the message in their order.

    ValueError: not to be told from texts.
    """
    edges, at = [], 0
    for cell in cells:
        start = _outside_strings(message, cell.text.encode(), at)
        edges.append((at, start))
        at = start + len(cell.text)
    return [*edges, (at, len(message))]


def _outside_strings(message: bytes, text: bytes, at: int) -> int:
    """Where the number stands next, from `at` on, which is outside of strings."""
    inside = False
    while at < len(message):
        byte = message[at : at + 1]
        if byte == b'"':
            inside = not inside
        elif byte == b"\\":
            at += 1
        elif not inside and byte in b"-0123456789":
            if not message.startswith(text, at):
                raise ValueError
            return at
        at += 1
    raise ValueError


def _unlike(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    if len({name for name, _ in pairs}) != len(pairs):
        raise ValueError
    return dict(pairs)


def _cells(template: Any, want: Want) -> tuple[list[int], bool]:
    """The cells that a want reads; ValueError if one is no number of the template."""
    at: Any = template
    for k, token in enumerate(want.tokens):
        if isinstance(token, slice):
            if k != len(want.tokens) - 1 or not is_list(at):
                raise FieldError("is no plain list")
            return [_number(item) for item in at[token]], True
        inside = (
            token in at
            if isinstance(at, dict)
            else isinstance(at, list) and isinstance(token, int) and token < len(at)
        )
        if not inside:
            raise FieldError("is not there")
        at = at[token]
    return [_number(at)], False


def _number(value: Any) -> int:
    if not isinstance(value, _Cell):
        raise FieldError("is no number")
    return value.number


def read_messages(table: MessageTable, shape: MessageShape) -> list[FieldColumn] | None:
    """The columns of the table's messages; None if not all have this shape."""
    from tirelog.readers.mcap.source import FieldColumn
    from tirelog.readers.text.digits import bytes_of

    n = len(table)
    values = np.empty((int(shape.slots.max(initial=-1)) + 1, n))
    if (
        numbers_between(
            bytes_of(table.data),
            table.starts,
            table.sizes,
            shape.texts,
            shape.edges,
            shape.slots,
            values,
        )
        < n
    ):
        return None
    return [
        FieldColumn(values[cells].T.ravel(), np.full(n, len(cells)))
        if batch
        else FieldColumn(values[cells[0]])
        for cells, batch in shape.wanted
    ]
