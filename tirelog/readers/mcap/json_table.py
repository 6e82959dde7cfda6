"""JSON messages of one shape as a table of numbers.

The fast way for what a logger writes, the same fields again and again.

first message --its text between the numbers--> Shape
    --compiled: text alike, numbers read--> cells (messages, wanted) --> FieldColumn per want

{"wl": [1550.1, 1551.2], "n": 3}        texts  {"wl": [   ,    ], "n":   }    cells  1550.1  1551.2
                                        3
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tirelog.readers.mcap.source import FieldError, Want, is_list
from tirelog.vocabulary.arrays import IntArray

if TYPE_CHECKING:
    from tirelog.readers.mcap.columns import FieldColumn
    from tirelog.readers.mcap.walk import MessageTable

MOST_CELLS = 4096


@dataclass(frozen=True)
class _Cell:
    """A number of the template: the how manieth of its message it is, and how it is written."""

    number: int
    text: str


@dataclass(frozen=True)
class Shape:
    """One message's `texts` before, between and behind its numbers (joined, cut at `edges`), and
    for each want its cells (True: a batch).

    `slots` shape (cells,): the place of each cell among those that are wanted, -1 where it is not.
    """

    texts: NDArray[np.uint8]
    edges: IntArray
    slots: IntArray
    wanted: list[tuple[list[int], bool]]


def shape_of(message: bytes, wants: list[Want]) -> Shape | None:
    """The shape of `message`; None where it is no object of numbers, or a want is none of them."""
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
    return Shape(
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
    """The cells that a want reads; ValueError where one is no number of the template."""
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


def read_messages(table: MessageTable, shape: Shape) -> list[FieldColumn] | None:
    """The columns of the table's messages; None where they have not all this shape."""
    from tirelog.readers.mcap.columns import FieldColumn
    from tirelog.readers.mcap.json_kernel import numbers_between
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
